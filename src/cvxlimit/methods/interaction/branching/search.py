"""Branch and bound over eccentricities: nodes allow each contact a box of pressure centres.

Children cover their node, so the largest certified bound among open and closed nodes bounds the
load factor; that node comes first.
"""

from __future__ import annotations

import heapq
import uuid
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import replace

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.methods.driver import Run
from cvxlimit.methods.interaction.branching.nodes import Explored, Goal, Node, Relaxer, explore
from cvxlimit.methods.interaction.branching.tightening import tightened_root
from cvxlimit.methods.interaction.branching.workers import Task
from cvxlimit.methods.interaction.relaxation.upper import UpperBound
from cvxlimit.methods.interaction.restriction.inner import InnerMethod
from cvxlimit.methods.interaction.restriction.lower_bound import LowerBounds, plain_witnesses
from cvxlimit.methods.interaction.settings import BRANCH
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.methods.interaction.states.pressure import centres
from cvxlimit.methods.interaction.states.support import whole_boxes
from cvxlimit.solvers import LimitState, Outcome

_State = tuple[FloatArray, float]  # forces, and the load factor with which they are in equilibrium


class BranchAndBound:
    """Nodes of one run: open ones, the largest bound of closed ones, and the best forces.

    Bounds go to ``run.best``; the bracket is valid whenever the search stops. Nodes are closed at a
    ``tolerance`` relative to the upper bound. An ``executor`` explores as many nodes at a time as
    it has ``workers``, None is this process. The root is the relaxation of ``outer``, where that is
    known, and its tightening may take a share of ``seconds``.
    """

    def __init__(
        self,
        run: Run,
        tolerance: float = 1e-4,
        executor: Executor | None = None,
        workers: int = 1,
        outer: UpperBound | None = None,
        seconds: float = np.inf,
    ) -> None:
        self.run, self.tolerance = run, tolerance
        self._until = run.clock.elapsed + BRANCH.tightening * seconds
        self._end = run.clock.elapsed + seconds
        with run.clock.phase("compile"):
            opening = None if outer is None else outer.certifier.witnesses.opening_field
            self.relaxer = Relaxer(run.assemblage, run.moments, run.ladder, opening, tolerance)
            self.is_proved = self.relaxer.certifier.witnesses.opening_field is not None
            self.checker = LowerBounds(run.assemblage, run.moments)
        self.price: float | None = None
        self.open: list[tuple[float, int, Node]] = []  # largest bound first, then as they came
        self.closed = -np.inf
        self.lower = run.best.bracket.lower
        self.forces = run.best.forces if np.isfinite(self.lower) else None
        self.solves = self.count = self.nodes = 0
        self._booked: FloatArray | None = None
        self._waited, self._wait, self._told, self._is_tightened = 0, 1, np.inf, False
        self._executor, self._workers = executor, max(workers, 1)
        self._task: Task | None = None
        self._running: dict[Future[Explored], Node] = {}
        self._start(outer)

    @property
    def upper(self) -> float:
        running = (node.bound for node in self._running.values())
        return max([self.closed, self.lower, *(-key for key, *_ in self.open[:1]), *running])

    @property
    def width(self) -> float:
        known = [x for x in (self.upper, self.lower) if np.isfinite(x)]
        return self.tolerance * self.run.scaling.unit(0.0, *known)

    @property
    def can_go_on(self) -> bool:
        return bool(self.open or self._running) and self.upper - self.lower > self.width

    def _goal(self) -> Goal:
        return Goal(self.lower, self.width, self.price, BRANCH.precision * self.tolerance)

    def _start(self, outer: UpperBound | None) -> None:
        boxes, best = whole_boxes(self.run.contacts), self.run.best
        state = None if outer is None else outer.state
        # the searches before began there: where tightening changed nothing they are not repeated
        self._searched = None if state is None else state.forces
        if outer is not None and state is not None and state.load_factor is not None:
            known = state.forces, state.load_factor, best.mechanism
            root = Node(best.bracket.upper, boxes, Copies.none(), *known)
        else:
            root = Node(np.inf, boxes, Copies.none())
            with self.run.clock.phase("solve"):
                root = self.relaxer.evaluated(root, Goal(self.lower, self.tolerance))
        self.solves += self.relaxer.solves
        self.run.solvers.update(self.relaxer.solvers)
        if np.isfinite(root.bound):
            self.price = BRANCH.price * max(abs(root.bound), self.run.scaling.load_factor(1.0))
        self._push(root)
        self._last = root
        if self.lower < 0.0:
            at_rest = plain_witnesses(self.run.assemblage).dead_state
            if at_rest is not None and self.checker.is_admissible(at_rest, 0.0):
                self.lower, self.forces = 0.0, at_rest
        self._raise_lower(root)
        self._book()

    def step(self) -> None:
        """Explore the node with the largest bound, or wait for one that is being explored."""
        if self._executor is not None and self._is_tightened:
            self._step_elsewhere(self._executor)
        else:
            (_, _, node), clock = heapq.heappop(self.open), self.run.clock
            with clock.phase("solve"):
                if self._is_tightened:
                    found = explore(self.relaxer, node, self._goal())
                else:
                    self._is_tightened, has_time = True, lambda: clock.elapsed < self._until
                    found = tightened_root(self.relaxer, node, self._goal(), has_time)
                self._take(node, found)
        self._book()

    def _step_elsewhere(self, executor: Executor) -> None:
        if self._task is None:
            self._task = Task.of(uuid.uuid4().hex, self.relaxer, self.run.assemblage)
        while self.open and len(self._running) < self._workers:
            _, _, node = heapq.heappop(self.open)
            self._running[executor.submit(self._task, node, self._goal())] = node
        with self.run.clock.phase("solve"):
            done, _ = wait(self._running, return_when=FIRST_COMPLETED)
        for future in done:
            self._take(self._running.pop(future), future.result())

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
        if best is None:
            return
        self._waited += 1
        if self._waited >= self._wait:
            before, self._waited = self.lower, 0
            self._raise_lower(best)
            self._wait = 1 if self.lower > before else min(2 * self._wait, BRANCH.rarely)
        is_new = best.forces is not None and best.forces is not self._searched
        if self.nodes in BRANCH.climbs and is_new:
            self._searched = best.forces
            for _ in InnerMethod(self.run, BRANCH.climb_solves).iterates(best.forces):
                self.solves += 1
                if self.run.clock.elapsed > self._end:
                    break
            known = self.run.best
            if known.bracket.lower > self.lower and known.forces is not None:
                self.lower, self.forces = known.bracket.lower, known.forces

    def _push(self, node: Node) -> None:
        self.count += 1
        if len(self.open) > BRANCH.remembered:
            node = replace(node, halfway=None)
        heapq.heappush(self.open, (-node.bound, self.count, node))

    def _book(self) -> None:
        run, before = self.run, self.run.best
        forces = None if self.forces is self._booked else self.forces
        if forces is not None and self.lower > before.bracket.lower:
            self._booked = forces
            with run.clock.phase("certify"):
                run.best = self.checker.of(forces, self.lower).raising(run.best)
        mechanism = (self.open[0][2] if self.open else self._last).mechanism
        run.best = run.best.lowered(self.upper, self.is_proved, mechanism)
        gap = self.upper - self.lower
        if run.best is not before and (gap <= BRANCH.told * self._told or not self.can_go_on):
            self._told = gap
            state = LimitState(Outcome("optimal", 0.0, 0.0), self._last.load_factor, None, None)
            run.note(state, f"branch and bound, {self.solves} problems", **run.bounds)

    def _raise_lower(self, node: Node) -> None:
        """Admissible forces near the node's: on the way to them from safe ones and the best."""
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
        reach = BRANCH.safe_reach * float(np.ptp(node.boxes, axis=2).max())
        best: _State | None = None
        centre = centres(node.forces, self.run.contacts)
        for _ in range(BRANCH.settled):
            if self.run.clock.elapsed > self._end:
                break
            found = self._safe(centre, reach)
            if found is None or (best is not None and found[1] <= best[1] + 1e-3 * self.width):
                break
            best, centre, reach = found, centres(found[0], self.run.contacts), 0.0
        return best

    def _safe(self, centre: FloatArray, reach: float) -> _State | None:
        copies = self.run.moments.safe_copies(self.run.contacts, centre, reach)
        with self.run.clock.phase("solve"):
            state = self.relaxer.solve(copies, None, ladder=self.relaxer.tight)
        self.solves += 1
        if state.forces is None or state.load_factor is None:
            return None
        found = self.checker.balanced(state.forces, state.load_factor), state.load_factor
        return found if self.checker.is_admissible(*found) else None

    def _advanced(self, start: _State, goal: _State) -> _State:
        if goal[1] <= start[1] or not np.isfinite(goal[0]).all():
            return start

        def at(share: float) -> _State:
            return start[0] + share * (goal[0] - start[0]), start[1] + share * (goal[1] - start[1])

        shares = np.linspace(1.0, 0.0, BRANCH.steps + 1)
        low = next((s for s in shares[:-1] if self.checker.is_admissible(*at(s))), 0.0)
        high = min(low + 1.0 / BRANCH.steps, 1.0)
        for _ in range(BRANCH.halvings if low < 1.0 else 0):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.checker.is_admissible(*at(middle)) else (low, middle)
        return at(low)
