"""Branch and bound over eccentricities: the collapse load with interaction to a tolerance.

Every node allows each contact a box of pressure centres, and has a certified upper bound
(:mod:`exploring`). Boxes of the children of a node cover the node, so the largest bound among the
open and the closed nodes bounds the load factor. The node with the largest bound comes first.

Lower bounds are forces: the best with every contact's eccentricity bounded by that of the
relaxation and its coefficients frozen there (:meth:`Moments.safe_copies`), or the last admissible
ones on the way from these to the relaxation's. They count after they were brought into equilibrium
and passed :meth:`Moments.excess`. The method from below leaves little to find, so they are sought
less often the longer nothing was found.
"""

from __future__ import annotations

import heapq
import uuid
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, field

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.methods.driver import Run
from cvxlimit.methods.interaction.branching.nodes import Explored, Goal, Node, Relaxer
from cvxlimit.methods.interaction.branching.splitting import explore
from cvxlimit.methods.interaction.branching.tightening import tightened_root
from cvxlimit.methods.interaction.branching.workers import Task
from cvxlimit.methods.interaction.restriction.inner import InnerMethod
from cvxlimit.methods.interaction.restriction.lower_bound import LowerBounds, plain_witnesses
from cvxlimit.methods.interaction.settings import SEARCH
from cvxlimit.solvers import LimitState, Outcome

_State = tuple[FloatArray, float]
"""Forces (n, 6) and the load factor at which they are in equilibrium."""


@dataclass(order=True)
class _Entry:
    """A node in the queue: largest bound first, then in the order they came."""

    key: tuple[float, int]
    node: Node = field(compare=False)


class BranchAndBound:
    """Nodes of one run: open ones, the largest bound of closed ones, and the best forces.

    Bounds go to ``run.best`` as they improve; the bracket is valid whenever the search stops. What
    the run knows already is where it begins.

    Parameters
    ----------
    run : Run
    tolerance : float
        Width of the bracket, relative to the upper bound, at which nodes are closed.
    executor : Executor or None
        Of :mod:`concurrent.futures`, to explore nodes in other processes; None is this process.
    workers : int
        Nodes explored at the same time by ``executor``.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> run = Run(builtin_scene("single-block"))
    >>> search = BranchAndBound(run)
    >>> while search.can_go_on:
    ...     search.step()
    >>> search.is_closed, round(run.best.bracket.lower, 4)
    (True, 0.4)
    """

    def __init__(
        self,
        run: Run,
        tolerance: float = 1e-4,
        executor: Executor | None = None,
        workers: int = 1,
    ) -> None:
        self.run, self.moments, self.tolerance = run, run.moments, tolerance
        self.contacts = run.contacts
        with run.clock.phase("compile"):
            self.relaxer = Relaxer(run.assemblage, self.moments, run.ladder)
            opens = self.relaxer.certifier.witnesses.opening_field is not None
            self.is_proved = opens
            self.checker = LowerBounds(run.assemblage, self.moments)
        self.price: float | None = None
        self.open: list[_Entry] = []
        self.closed = -np.inf
        self.lower = run.best.bracket.lower
        self.forces = run.best.forces if np.isfinite(self.lower) else None
        self.solves = self.count = self.nodes = 0
        self._waited, self._wait, self._told = 0, 1, np.inf
        self._executor, self._workers = executor, max(workers, 1)
        self._task: Task | None = None
        self._running: dict[Future[Explored], Node] = {}
        self._start()

    @property
    def upper(self) -> float:
        """Largest bound of any node."""
        nodes = [entry.node for entry in self.open[:1]] + list(self._running.values())
        return max([self.closed, self.lower, *(node.bound for node in nodes)])

    @property
    def width(self) -> float:
        """The gap that is asked for, as a load factor."""
        known = [x for x in (self.upper, self.lower) if np.isfinite(x)]
        return self.tolerance * self.run.scaling.unit(0.0, *known)

    @property
    def is_closed(self) -> bool:
        """True when the bracket is within the tolerance."""
        return bool(self.upper - self.lower <= self.width)

    @property
    def can_go_on(self) -> bool:
        """True while there is a gap, and nodes to split."""
        return bool(self.open or self._running) and not self.is_closed

    def _goal(self) -> Goal:
        return Goal(
            self.lower,
            self.width,
            self.price,
            SEARCH.tried if self.nodes < SEARCH.tried_nodes else 1,
        )

    def _start(self) -> None:
        with self.run.clock.phase("solve"):
            root = self.relaxer.root(Goal(self.lower, self.tolerance))
        self.solves += self.relaxer.solves
        self.run.solvers.update(self.relaxer.solvers)
        if np.isfinite(root.bound):
            self.price = SEARCH.price * max(abs(root.bound), self.run.scaling.load_factor(1.0))
        self._push(root)
        self._last = root
        if not self.lower > 0.0:
            at_rest = plain_witnesses(self.run.assemblage).dead_state
            if (
                at_rest is not None
                and self.checker.is_admissible(at_rest, 0.0)
                and self.lower < 0.0
            ):
                self.lower, self.forces = 0.0, at_rest
        self._raise_lower(root)
        self._book()
        self._is_tightened = False

    def step(self) -> None:
        """Explore the node with the largest bound, or wait for one that is being explored."""
        if not self._is_tightened:
            self._tighten()
        elif self._executor is None:
            node = heapq.heappop(self.open).node
            with self.run.clock.phase("solve"):
                self._take(node, explore(self.relaxer, node, self._goal()))
        else:
            self._step_elsewhere(self._executor)
        self._book()

    def _tighten(self) -> None:
        self._is_tightened = True
        node = heapq.heappop(self.open).node
        with self.run.clock.phase("solve"):
            self._take(node, tightened_root(self.relaxer, node, self._goal()))

    def _step_elsewhere(self, executor: Executor) -> None:
        if self._task is None:
            self._task = Task.of(uuid.uuid4().hex, self.relaxer, self.run.assemblage)
        while self.open and len(self._running) < self._workers:
            node = heapq.heappop(self.open).node
            self._running[executor.submit(self._task, node, self._goal())] = node
        with self.run.clock.phase("solve"):
            done, _ = wait(self._running, return_when=FIRST_COMPLETED)
        for future in done:
            found = future.result()
            self._take(self._running.pop(future), found)

    def _take(self, node: Node, found: Explored) -> None:
        self.nodes += 1
        self.solves += found.solves
        self.run.solvers.update(found.solvers)
        self.closed = max(self.closed, found.closed)
        for child in found.open:
            if child.bound > self._goal().cut:
                self._push(child)
            else:
                self.closed = max(self.closed, child.bound)
        self._last = node
        best = max(found.open, key=lambda child: child.bound, default=None)
        if best is not None:
            self._sometimes_raise_lower(best)
            if self.nodes in SEARCH.climbs:
                self._climb(best)

    def _climb(self, node: Node) -> None:
        if node.forces is None:
            return
        for _ in InnerMethod(self.run, SEARCH.climb_solves).iterates(node.forces):
            self.solves += 1
        known = self.run.best
        if known.bracket.lower > self.lower and known.forces is not None:
            self.lower, self.forces = known.bracket.lower, known.forces

    def _sometimes_raise_lower(self, node: Node) -> None:
        self._waited += 1
        if self._waited < self._wait:
            return
        before, self._waited = self.lower, 0
        self._raise_lower(node)
        self._wait = 1 if self.lower > before else min(2 * self._wait, SEARCH.rarely)

    def _push(self, node: Node) -> None:
        self.count += 1
        heapq.heappush(self.open, _Entry((-node.bound, self.count), node))

    def _book(self) -> None:
        run, before = self.run, self.run.best
        if self.forces is not None and self.lower > before.bracket.lower:
            with run.clock.phase("certify"):
                run.best = self.checker.of(self.forces, self.lower).raising(run.best)
        mechanism = (self.open[0].node if self.open else self._last).mechanism
        run.best = run.best.lowered(self.upper, self.is_proved, mechanism)
        gap = self.upper - self.lower
        if run.best is not before and (gap <= SEARCH.told * self._told or not self.can_go_on):
            self._told = gap
            outcome = Outcome("optimal", 0.0, 0.0)
            state = LimitState(outcome, self._last.load_factor, None, None)
            run.note(state, f"branch and bound, {self.solves} problems", **run.bounds)

    def _raise_lower(self, node: Node) -> None:
        """Admissible forces near the node's: the best safe ones, and on the way from these and
        from the best known ones to the node's own."""
        if node.forces is None:
            return
        safe = self._settled(node)
        goal = self.checker.balanced(node.forces, node.load_factor), node.load_factor
        known = None if self.forces is None else (self.forces, self.lower)
        for start in filter(None, (safe, known)):
            forces, factor = self._advanced(start, goal)
            if factor > self.lower:
                self.lower, self.forces = float(factor), forces

    def _settled(self, node: Node) -> _State | None:
        """The best safe forces about the node's pressure centres, then about their own, as long as
        that gains: what is safe stays so where its own eccentricities are frozen."""
        assert node.forces is not None
        reach = SEARCH.safe_reach * float(np.ptp(node.boxes, axis=2).max())
        best: _State | None = None
        centre = self.relaxer.centre(node.forces)
        for _ in range(SEARCH.settled):
            found = self._safe(centre, reach)
            if found is None or (best is not None and found[1] <= best[1] + 1e-3 * self.width):
                break
            best, centre, reach = found, self.relaxer.centre(found[0]), 0.0
        return best

    def _safe(self, centre: FloatArray, reach: float) -> _State | None:
        copies = self.moments.safe_copies(self.contacts, centre, reach)
        with self.run.clock.phase("solve"):
            state = self.relaxer.safe(copies)
        self.solves += 1
        if state.forces is None or state.load_factor is None:
            return None
        forces = self.checker.balanced(state.forces, state.load_factor)
        return (
            (forces, state.load_factor)
            if self.checker.is_admissible(forces, state.load_factor)
            else None
        )

    def _advanced(self, start: _State, goal: _State) -> _State:
        if goal[1] <= start[1] or not np.isfinite(goal[0]).all():
            return start

        def at(share: float) -> _State:
            return start[0] + share * (goal[0] - start[0]), start[1] + share * (goal[1] - start[1])

        shares = np.linspace(1.0, 0.0, SEARCH.steps + 1)
        low = next((s for s in shares[:-1] if self.checker.is_admissible(*at(s))), 0.0)
        high = min(low + 1.0 / SEARCH.steps, 1.0)
        for _ in range(SEARCH.halvings if low < 1.0 else 0):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.checker.is_admissible(*at(middle)) else (low, middle)
        return at(low)
