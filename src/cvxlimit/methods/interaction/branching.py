"""Branch and bound over eccentricities: the collapse load with interaction to a tolerance.

Every node allows each contact a box of pressure centres. Its upper bound comes from the hull of
those states, certified: the mechanism of the node's relaxation is checked against the support
function of the true states *in the boxes*, which is what the bound is a proof for. Boxes of
the children of a node cover the node, so the largest bound among the open and the closed nodes
bounds the load factor.

A node whose states cannot carry the dead load needs no special proof: its relaxation may take
dead load off at a price, and its mechanism then has a bound of minus that price.

Lower bounds are forces: the best with every contact's eccentricity bounded by that of the
relaxation and its coefficients frozen there (:meth:`Moments.safe_copies`), or the last admissible
ones on the way from these to the relaxation's. They count after they were brought into equilibrium
and passed :meth:`Moments.excess`.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import Run
from cvxlimit.methods.interaction.copies import Copies
from cvxlimit.methods.interaction.flow import InteractionFlow
from cvxlimit.methods.interaction.hull import HullProblem, missed_copies
from cvxlimit.methods.interaction.lower_bound import LowerBounds, plain_witnesses
from cvxlimit.methods.interaction.pressure import Pressure
from cvxlimit.methods.interaction.support import half_extent, whole_boxes
from cvxlimit.model.statics import DOF
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solvers import LimitState, SolverSettings, default_ladder
from cvxlimit.surfaces import Rocking

FloatArray = NDArray[np.float64]

ADMISSIBLE = 1e-9
"""Excess and residual, as shares of the total load, up to which forces count as admissible."""

_NARROW = 1e-7
"""Ranges of this width are not split: solvers could not tell their halves apart."""

_WORTH_A_COPY = 0.05
"""Share of the tolerance that a node's bound must stand to lose for a solve with more copies."""

_SAFE_REACH = 0.02
"""Reach of safe states in a node's widest range; without any, determinate scenes have none."""

_STEPS, _HALVINGS = 16, 25
"""Places tried on the way between two force states, and halvings after the last good one."""

_SPEED_AT_REST = 0.1
"""Share of the largest speed with which contacts at rest count: they may move next."""

_ROUNDS, _PRICE = 3, 10.0
"""Solves per node, and the price of the dead load in root bounds: any above minus the lower bound
closes nodes without states."""


_State = tuple[FloatArray, float]
"""Forces (n, 6) and the load factor at which they are in equilibrium."""


@dataclass(order=True)
class _Node:
    """Boxes of all contacts and what is known about them; ordered by bound, largest first."""

    key: tuple[float, int]
    boxes: FloatArray = field(compare=False)
    added: Copies = field(compare=False)
    forces: FloatArray | None = field(compare=False, default=None)
    load_factor: float = field(compare=False, default=-np.inf)
    mechanism: FloatArray | None = field(compare=False, default=None)

    @property
    def bound(self) -> float:
        return -self.key[0]


class BranchAndBound:
    """Nodes of one run: open ones, the largest bound of closed ones, and the best forces.

    Meant for scenes of a few contacts. Contacts that are not rectangles are not split. Bounds go to
    ``run.best`` as they improve; the bracket is valid whenever the search stops.

    Parameters
    ----------
    run : Run
    tolerance : float
        Width of the bracket, relative to the upper bound, at which nodes are closed.

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

    def __init__(self, run: Run, tolerance: float = 1e-4) -> None:
        self.run, self.moments, self.tolerance = run, run.moments, tolerance
        scene, self.contacts = run.scene, run.contacts
        with run.clock.phase("compile"):
            self.half = half_extent(self.contacts)
            whole = InteractionFlow(self.contacts, self.moments)
            self.certifier = Certifier(run.assemblage, (Rocking(),), flow=whole)
            self.statics = self.certifier.statics
            self.opens = (
                self.certifier.witnesses.opening_field is not None
            )  # found once, for all nodes
            self.problem = HullProblem(run.assemblage)
            self.checker = LowerBounds(run.assemblage, self.moments)
        loads = (
            np.linalg.norm(f[:, :3], axis=1).sum() for f in (scene.dead_forces, scene.live_forces)
        )
        self.load = next((float(load) for load in loads if load > 0.0), 1.0)
        self.price: float | None = None
        self.open: list[_Node] = []
        self.closed = -np.inf
        self.lower = -np.inf
        self.forces: FloatArray | None = None
        self.solves = self.count = 0
        self._start()

    @property
    def upper(self) -> float:
        """Largest bound of any node."""
        top = self.open[0].bound if self.open else -np.inf
        return max(top, self.closed, self.lower)

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
        return bool(self.open) and not self.is_closed

    def _start(self) -> None:
        """The root: all pressure centres; and forces that carry the dead load."""
        self.last = root = self._evaluated(whole_boxes(self.contacts), Copies.none(), np.inf, None)
        if np.isfinite(root.bound):
            self.price = _PRICE * max(abs(root.bound), self.run.scaling.load_factor(1.0))
        heapq.heappush(self.open, root)
        at_rest = plain_witnesses(self.run.assemblage).dead_state
        if at_rest is not None and self._is_admissible(at_rest, 0.0):
            self.lower, self.forces = 0.0, at_rest
        self._raise_lower(root)
        self._book()

    def step(self) -> None:
        """Split the node with the largest bound."""
        node = self.last = heapq.heappop(self.open)
        choice = self._choice(node)
        if choice is None:
            self.closed = max(self.closed, node.bound)
            return
        contact, axis, at = choice
        for boxes in self._children(node.boxes, contact, axis, at):
            added = node.added.without(np.array([contact]))
            child = self._evaluated(boxes, added, node.bound, node)
            if child.bound > self.lower + self.width:
                self._raise_lower(child)
            if child.bound > self.lower + 0.5 * self.width:
                heapq.heappush(self.open, child)
            else:
                self.closed = max(self.closed, child.bound)
        self._book()

    def _book(self) -> None:
        """Give the run what is better than its own, and a line of the history for it."""
        run, before = self.run, self.run.best
        if self.forces is not None and self.lower > before.bracket.lower:
            with run.clock.phase("certify"):
                run.best = self.checker.of(self.forces, self.lower).raising(run.best)
        mechanism = (self.open[0] if self.open else self.last).mechanism
        run.best = run.best.lowered(self.upper, self.opens, mechanism)
        if run.best is not before:
            run.note(self.state, f"branch and bound, {self.solves} problems", **run.bounds)

    def _choice(self, node: _Node) -> tuple[int, int, float] | None:
        """Contact, axis and fraction at which to split; None where nothing can be split."""
        forces, mechanism = node.forces, node.mechanism
        if forces is None or mechanism is None:
            return self._widest(node)
        rates = self.statics.relative_rates(mechanism)
        speed = np.hypot(rates[:, 0], rates[:, 1])
        speed = speed + self.contacts.torsion_arm * np.abs(rates[:, COLUMN["MT"]])
        speed = speed + _SPEED_AT_REST * float(speed.max())
        excess = np.maximum(self.moments.excess(forces, self.contacts), 0.0)
        can_split = self.contacts.is_rectangle & (np.ptp(node.boxes, axis=2).max(axis=1) > _NARROW)
        score = np.where(can_split, excess * speed, 0.0)
        contact = int(score.argmax())
        if not score[contact] > 0.0:
            return self._widest(node)
        centre = self._centre(forces)[contact]
        high = node.boxes[contact, :, 1]
        low, centre = self.moments.folded(node.boxes[contact], centre)
        inner = np.maximum((high - centre) * (centre - low), 0.0) + 1e-3 * (high - low) ** 2
        axis = int(inner.argmax())
        return contact, axis, float(centre[axis])

    def _widest(self, node: _Node) -> tuple[int, int, float] | None:
        width = np.ptp(node.boxes, axis=2) * self.contacts.is_rectangle[:, None]
        contact, axis = np.unravel_index(int(width.argmax()), width.shape)
        if width[contact, axis] <= _NARROW:
            return None
        return int(contact), int(axis), float(node.boxes[contact, axis].mean())

    def _evaluated(
        self, boxes: FloatArray, added: Copies, bound: float, parent: _Node | None
    ) -> _Node:
        """Solve, certify, add copies; a solver's failure leaves the parent's bound and forces."""
        flow = InteractionFlow(self.contacts, self.moments, boxes)
        certifier = self.certifier.with_flow(flow)
        first = self.moments.box_copies(self.contacts, boxes)
        best = parent.mechanism if parent else None
        forces = parent.forces if parent else None
        factor = parent.load_factor if parent else -np.inf
        for _ in range(_ROUNDS):
            state = self._solve(first.joined(added), self.price)
            if state.mechanism is None or state.load_factor is None:
                break
            forces, factor = state.forces, state.load_factor
            found = certifier.certificate(state.forces, None, state.mechanism).upper
            if found < bound:
                bound, best = found, state.mechanism
            if found - state.load_factor <= _WORTH_A_COPY * self.width or bound < self.lower:
                break
            missed = missed_copies(flow, certifier, state.mechanism, _WORTH_A_COPY * self.width)
            if not len(missed):
                break
            added = added.joined(missed)
        self.count += 1
        return _Node((-bound, self.count), boxes, added, forces, factor, best)

    def _solve(self, copies: Copies, price: float | None) -> LimitState:
        def solver(rung: SolverSettings) -> LimitState:
            self.solves += 1
            return self.problem.solve(copies, rung, price)

        self.state, _ = self.run.climb(solver, default_ladder()[:3])
        return self.state

    def _centre(self, forces: FloatArray) -> FloatArray:
        """Pressure centres (n, 2) as fractions of the half extent."""
        at = Pressure.of(forces, self.contacts)
        return np.clip(np.stack([at.e1, at.e2], axis=1) / self.half, -1.0, 1.0)

    def _raise_lower(self, node: _Node) -> None:
        """Admissible forces near the node's: the best safe ones, and on the way from these and
        from the best known ones to the node's own."""
        if node.forces is None:
            return
        safe = self._safe(node)
        goal = self._balanced(node.forces, node.load_factor), node.load_factor
        known = None if self.forces is None else (self.forces, self.lower)
        for start in filter(None, (safe, known)):
            forces, factor = self._advanced(start, goal)
            if factor > self.lower:
                self.lower, self.forces = float(factor), forces

    def _safe(self, node: _Node) -> _State | None:
        assert node.forces is not None
        reach = _SAFE_REACH * float(np.ptp(node.boxes, axis=2).max())
        centre = self._centre(node.forces)
        state = self._solve(self.moments.safe_copies(self.contacts, centre, reach), None)
        if state.forces is None or state.load_factor is None:
            return None
        forces = self._balanced(state.forces, state.load_factor)
        return (
            (forces, state.load_factor) if self._is_admissible(forces, state.load_factor) else None
        )

    def _advanced(self, start: _State, goal: _State) -> _State:
        """The last admissible forces found on the way from admissible ones to ``goal``."""
        if goal[1] <= start[1] or not np.isfinite(goal[0]).all():
            return start

        def at(share: float) -> _State:
            return start[0] + share * (goal[0] - start[0]), start[1] + share * (goal[1] - start[1])

        shares = np.linspace(1.0, 0.0, _STEPS + 1)
        low = next((s for s in shares[:-1] if self._is_admissible(*at(s))), 0.0)
        high = min(low + 1.0 / _STEPS, 1.0)
        for _ in range(_HALVINGS if low < 1.0 else 0):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._is_admissible(*at(middle)) else (low, middle)
        return at(low)

    def _balanced(self, forces: FloatArray, load_factor: float) -> FloatArray:
        return self.run.assemblage.balance.balanced(forces, load_factor, self.statics)

    def _is_admissible(self, forces: FloatArray, load_factor: float) -> bool:
        """Equilibrium, rocking and Eq. 30, to 1e-9 of the total load."""
        residual = self.statics.residual(forces, load_factor).reshape(-1, DOF)
        residual[:, 3:] /= self.certifier.size
        excess = [
            np.abs(residual).max(),
            Rocking().excess(forces, self.contacts)[0].max(),
            self.moments.excess(forces, self.contacts).max(),
        ]
        return bool(max(excess) <= ADMISSIBLE * self.load)

    def _children(
        self, boxes: FloatArray, contact: int, axis: int, at: float
    ) -> Iterator[FloatArray]:
        """Boxes with one range cut."""
        low, high = boxes[contact, axis]
        for ends in pairwise(self.moments.split(low, high, at)):
            child = boxes.copy()
            child[contact, axis] = ends
            yield child
