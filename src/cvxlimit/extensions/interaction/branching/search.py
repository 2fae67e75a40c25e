"""Branch and bound over eccentricities: a node allows each contact a box of pressure centres.

Children cover their node, so the largest certified bound among open and closed nodes is an upper
bound of the load factor. One step of the search has four stages:

1. *explore*: the open nodes with the largest bounds are split, and relaxations bound the children
   (:mod:`~cvxlimit.extensions.interaction.branching.nodes`). A child is closed where its bound is
   within the tolerance of the lower bound.
2. *settle*: pressure centres are held where the best child's forces have them. Interaction is
   convex there, so that the limit problem has forces that are safe; a line search goes on from
   them, and from the best forces so far, towards those of the child.
3. *climb*: now and then a search for a lower bound starts at the forces of any open node.
4. *book*: both bounds go to the run. Lower ones are of forces that the checker accepts.

Forces are arrays (n, 6) in the order V1, V2, N, M1, M2, MT; boxes are arrays (n, 2, 2) of contact,
side of the contact (e1, e2), low and high end, as fractions of the half extents.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import cached_property

import numpy as np

from cvxlimit.base.arrays import SMALL, FloatArray, IntArray
from cvxlimit.base.search import searched
from cvxlimit.extensions.interaction.branching.nodes import Explored, Goal, Node, Relaxer
from cvxlimit.extensions.interaction.branching.tightening import tightened_root
from cvxlimit.extensions.interaction.relaxation.upper import UpperBound
from cvxlimit.extensions.interaction.restriction.inner import InnerMethod
from cvxlimit.extensions.interaction.restriction.lower_bound import LowerBounds, plain_references
from cvxlimit.extensions.interaction.settings import BRANCH
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.extensions.interaction.states.support import whole_boxes
from cvxlimit.methods.driver import Run
from cvxlimit.readings.pressure import centres
from cvxlimit.solvers import LimitState, Outcome

_State = tuple[FloatArray, float]
"""Forces (n, 6), and the load factor with which they are in equilibrium."""


class BranchAndBound:
    """The branch and bound of one run. Bounds go to ``run.best``, and the bracket is valid whenever
    the search stops.

    Parameters
    ----------
    run : Run
        The run.
    tolerance : float
        Nodes are closed at this width, relative to the upper bound.
    executor : Executor or None
        Explores as many nodes at a time as it has ``workers``; None is this process.
    outer : UpperBound or None
        The relaxation of the run, which becomes the root; None solves it here.
    seconds : float
        Time for the search; tightening the root may take a share of it.

    Attributes
    ----------
    open : list of (float, int, Node)
        Heap of open nodes: largest bound first, then in the order in which they came.
    closed : float
        The largest bound of nodes that need no further look.
    lower, forces : float, (n, 6) array or None
        The best lower bound, and its forces.
    price : float or None
        Price of the dead load that a relaxation may leave uncarried.
    solves, nodes : int
        How many problems were solved, and how many nodes were split.
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
            opening = None if outer is None else outer.certifier.references.opening_field
            self.relaxer = Relaxer(run.assemblage, run.moments, run.ladder, opening, tolerance)
            self.is_proved = self.relaxer.certifier.references.opening_field is not None
            self.checker = LowerBounds(run.assemblage, run.moments)
        self.price: float | None = None
        self.open: list[tuple[float, int, Node]] = []
        self.closed = -np.inf
        self.lower = run.best.bracket.lower
        self.forces = run.best.forces if np.isfinite(self.lower) else None
        self.solves = self.count = self.nodes = self._climb_solves = 0
        self._random = np.random.default_rng(0)
        self._booked_forces: FloatArray | None = None
        self._nodes_since_settling, self._nodes_between = 0, 1
        self._noted_gap, self._is_tightened = np.inf, False
        self._under_way: list[Node] = []
        # One node waits where others are explored elsewhere: no worker idles.
        self._explored = searched(self.relaxer, self._next, executor, max(workers, 1) + 1)
        self._start(outer)

    @property
    def upper(self) -> float:
        """The upper bound: the largest bound of all nodes."""
        under_way = (node.bound for node in self._under_way)
        return max([self.closed, self.lower, *(-key for key, *_ in self.open[:1]), *under_way])

    @property
    def width(self) -> float:
        """The gap, in load factors, at which the search ends."""
        bounds = [x for x in (self.upper, self.lower) if np.isfinite(x)]
        return self.tolerance * self.run.scaling.unit(0.0, *bounds)

    @property
    def can_go_on(self) -> bool:
        """True if nodes are open and the gap is wider than asked for."""
        return bool(self.open or self._under_way) and self.upper - self.lower > self.width

    def _goal(self) -> Goal:
        """Returns what nodes have to reach as bounds are now."""
        return Goal(self.lower, self.width, self.price, BRANCH.precision * self.tolerance)

    def _start(self, outer: UpperBound | None) -> None:
        """Makes the root, seeks first forces, and books both bounds."""
        # The root: the relaxation over whole contacts, solved here unless it has been.
        boxes, best = whole_boxes(self.run.contacts), self.run.best
        state = None if outer is None else outer.state
        # The searches before began at its forces; they are not repeated where tightening changes
        # nothing.
        self._searched = None if state is None else state.forces
        if outer is not None and state is not None and state.load_factor is not None:
            answer = state.forces, state.load_factor, best.mechanism
            root = Node(best.bracket.upper, boxes, (), *answer)
        else:
            goal = Goal(self.lower, self.width)
            with self.run.clock.phase("solve"):
                (root,) = self.relaxer.evaluated([Node(np.inf, boxes)], goal)
        self.solves += self.relaxer.solves
        self.run.solvers.update(self.relaxer.solvers)
        if np.isfinite(root.bound):
            self.price = BRANCH.price * max(abs(root.bound), self.run.scaling.load_factor(1.0))
        self._push(root)
        self._last = root
        # First forces: those of the dead load alone, then those near the root's.
        if self.lower < 0.0:
            at_rest = plain_references(self.run.assemblage).dead_state
            if at_rest is not None and self.checker.is_admissible(at_rest, 0.0):
                self.lower, self.forces = 0.0, at_rest
        self._settle_at(root)
        self._book()

    def step(self) -> None:
        """Takes one step: tightens the root, or explores the nodes with the largest bounds, which
        may mean to wait for some that other processes explore."""
        with self.run.clock.phase("solve"):
            if self._is_tightened:
                (nodes, _), explored = next(self._explored)
                self._under_way = [node for node in self._under_way if node not in nodes]
            else:
                nodes, clock = [heapq.heappop(self.open)[2]], self.run.clock
                self._is_tightened, has_time = True, lambda: clock.elapsed < self._until
                explored = tightened_root(self.relaxer, nodes[0], self._goal(), has_time)
            self._take(nodes, explored)
        self._book()

    def _next(self) -> tuple[Sequence[Node], Goal] | None:
        """Takes the nodes with the largest bounds off the heap, and returns them with what they
        have to reach: several at a time where they have few contacts, None while none is open."""
        count = min(max(1, BRANCH.at_a_time // len(self.run.contacts)), len(self.open))
        nodes, goal = [heapq.heappop(self.open)[2] for _ in range(count)], self._goal()
        self._under_way += nodes
        return (nodes, goal) if nodes else None

    def _take(self, nodes: Sequence[Node], explored: Explored) -> None:
        """Takes the children of explored nodes in, settles at the best of them, and climbs where
        that pays."""
        self.nodes += len(nodes)
        self.solves += explored.solves
        self.run.solvers.update(explored.solvers)
        # Children are pushed, or closed where their bound is near enough to the lower one.
        self.closed = max(self.closed, explored.closed)
        for child in explored.open:
            if child.bound > self._goal().cut:
                self._push(child)
            else:
                self.closed = max(self.closed, child.bound)
        self._last = nodes[0]
        # Settling: the more of it gains nothing, the more nodes lie between two attempts.
        best = max(explored.open, key=lambda child: child.bound, default=None)
        self._nodes_since_settling += len(nodes)
        if best is not None and self._nodes_since_settling >= self._nodes_between:
            lower, self._nodes_since_settling = self.lower, 0
            self._settle_at(best)
            self._nodes_between = 1 if self.lower > lower else 2 * self._nodes_between
        # Climbing: as often as its share of all problems allows.
        while self._may_climb and self._has_time:
            if not self._climb():
                break

    @property
    def _may_climb(self) -> bool:
        """Is true as long as climbs take their share, which falls with every one that gains
        nothing."""
        in_vain = 1.0 + float(self._vain_climbs.min()) / BRANCH.patience
        return in_vain * self._climb_solves < BRANCH.climbing * self.solves

    @property
    def _has_time(self) -> bool:
        """Is true until the search's time is over."""
        return self.run.clock.elapsed <= self._end

    def _climb(self) -> bool:
        """Climbs once, from the forces of any open node: those of nodes with the largest bounds are
        much alike. Returns False if no node has forces."""
        forces = (node.forces for _, _, node in self.open)
        starts = [each for each in forces if each is not None and each is not self._searched]
        if not starts:
            return False
        self._climb_solves += 1  # A climb counts even if it solves no problem at all.
        # The way that has been in vain least often, from a start on the way to a node's forces.
        kind = int(self._vain_climbs.argmin())
        search, share = self._ways[kind]
        start = starts[int(self._random.integers(len(starts)))]
        if self.forces is not None:
            start = self.forces + share * (start - self.forces)
        for _ in search(start):
            self._climb_solves, self.solves = self._climb_solves + 1, self.solves + 1
            if not self._has_time:
                break
        # Where it gained, forces are settled: climbs solve loosely.
        best = self.run.best
        self._vain_climbs[kind] += 1
        if best.bracket.lower > self.lower and best.forces is not None:
            self.lower, self.forces = best.bracket.lower, best.forces
            self._settle(best.forces)
            self._vain_climbs[kind] = 0
        return True

    @cached_property
    def _ways(self) -> list[tuple[Callable[[FloatArray], Iterator[object]], float]]:
        """The ways to climb, each with the share of the way from the best forces to a node's at
        which it starts: by steps, or by boxes that shrink. Which one gains differs from scene to
        scene."""
        ways: list[tuple[Callable[[FloatArray], Iterator[object]], float]] = []
        every = InnerMethod(self.run)
        for share, first in BRANCH.ahead:
            inner = every.within(first)
            ways.append((inner.iterates, share))
            if "boxes" in inner.starts:
                ways.append((inner.narrowed, share))
        return ways

    @cached_property
    def _vain_climbs(self) -> IntArray:
        """How many climbs each way has made since one of them gained (ways,)."""
        return np.zeros(len(self._ways), dtype=int)

    def _push(self, node: Node) -> None:
        """Puts a node on the heap, without its point to start from where the heap is large."""
        self.count += 1
        if len(self.open) > BRANCH.remembered:
            node = replace(node, halfway=None)
        heapq.heappush(self.open, (-node.bound, self.count, node))

    def _book(self) -> None:
        """Gives the run both bounds, and its history a line where the gap has become smaller."""
        # The lower bound, of forces that are new.
        run, before = self.run, self.run.best
        forces = None if self.forces is self._booked_forces else self.forces
        if forces is not None and self.lower > before.bracket.lower:
            self._booked_forces = forces
            with run.clock.phase("certify"):
                run.best = self.checker.of(forces, self.lower).raising(run.best)
        # The upper bound, with the mechanism of the node that has it.
        mechanism = (self.open[0][2] if self.open else self._last).mechanism
        run.best = run.best.lowered(self.upper, self.is_proved, mechanism)
        gap = self.upper - self.lower
        if run.best is not before and (
            gap <= (1.0 - SMALL) * self._noted_gap or not self.can_go_on
        ):
            self._noted_gap = gap
            state = LimitState(Outcome("optimal", 0.0, 0.0), self._last.load_factor, None, None)
            run.note(state, f"branch and bound, {self.solves} problems", **run.bounds)

    def _settle_at(self, node: Node) -> None:
        """Seeks admissible forces near a node's: on the lines there from safe forces about its
        pressure centres, and from the best forces so far. As boxes shrink their load factor tends
        to the node's bound."""
        if node.forces is None or not np.isfinite(node.forces).all():
            return
        reach = BRANCH.safe_reach * float(np.ptp(node.boxes, axis=2).max())
        safe = self._settle(node.forces, reach)
        target = self.checker.balanced(node.forces, node.load_factor), node.load_factor
        best = None if self.forces is None else (self.forces, self.lower)
        for start in filter(None, (safe, best)):
            self._keep(self._advanced(start, target))

    def _settle(self, forces: FloatArray, reach: float = 0.0) -> _State | None:
        """Returns the best safe forces about the pressure centres of given ones, then about their
        own centres, as long as that gains; None if there are none. Safe forces stay safe where
        their own eccentricities are frozen, so that no step loses."""
        best: _State | None = None
        for _ in range(BRANCH.settled):
            if not self._has_time:
                break
            safe = self._safe(centres(forces, self.run.contacts), reach)
            if safe is None or (best is not None and safe[1] <= best[1] + 1e-3 * self.width):
                break
            best, forces, reach = safe, safe[0], 0.0
            self._keep(best)
        return best

    def _keep(self, state: _State) -> None:
        """Takes a state as the best one if its load factor is larger."""
        if state[1] > self.lower:
            self.forces, self.lower = state[0], float(state[1])

    def _safe(self, centre: FloatArray, reach: float) -> _State | None:
        """Returns the state with the largest load factor whose forces press within ``reach`` of
        given centres (n, 2), both fractions of the half extents; None unless the checker accepts
        it."""
        disjuncts = states_of(self.run.moments).safe_disjuncts(self.run.contacts, centre, reach)
        with self.run.clock.phase("solve"):
            state = self.relaxer.solve(disjuncts, None, ladder=self.relaxer.tight[:1])
        self.solves += 1
        if state.forces is None or state.load_factor is None:
            return None
        safe = self.checker.balanced(state.forces, state.load_factor), state.load_factor
        return safe if self.checker.is_admissible(*safe) else None

    def _advanced(self, start: _State, target: _State) -> _State:
        """Returns the last state on the line from ``start`` to ``target`` that the checker accepts:
        the farthest of equal steps, then halvings of the step beyond it."""
        (x, factor), (end, end_factor) = start, target
        if end_factor <= factor or not np.isfinite(end).all():
            return start

        def at(share: float) -> _State:
            """Returns the state at a share of the line."""
            return x + share * (end - x), factor + share * (end_factor - factor)

        shares = np.linspace(1.0, 0.0, BRANCH.steps + 1)
        low = next((s for s in shares[:-1] if self.checker.is_admissible(*at(s))), 0.0)
        high = min(low + 1.0 / BRANCH.steps, 1.0)
        for _ in range(BRANCH.halvings if low < 1.0 else 0):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.checker.is_admissible(*at(middle)) else (low, middle)
        return at(low)
