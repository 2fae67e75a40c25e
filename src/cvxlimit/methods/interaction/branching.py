"""Branch and bound over eccentricities: the collapse load with interaction to a tolerance.

Every node allows each contact a box of pressure centres. Its upper bound comes from the hull of
those states, certified: the mechanism of the node's relaxation is checked against the support
function of the true states *in the boxes*, which is what the bound is a proof for. Boxes of
the children of a node cover the node, so the largest bound among the open and the closed nodes
bounds the load factor.

A node whose states cannot carry the dead load needs no special proof: its relaxation may take
dead load off at a price, and its mechanism then has a bound of minus that price.

Lower bounds are forces: the
best with every contact's eccentricity bounded by that of the relaxation and its coefficients
frozen there (:func:`~cvxlimit.methods.interaction.copies.safe_copies`), or the last admissible
ones on the way from these to the relaxation's. They count after they were brought into equilibrium
and passed :func:`~cvxlimit.methods.interaction.pressure.interaction_excess`.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.interaction.copies import Copies, box_copies, safe_copies
from cvxlimit.methods.interaction.hull import HullProblem, missed_copies
from cvxlimit.methods.interaction.pressure import Pressure, interaction_excess
from cvxlimit.methods.interaction.support import (
    InteractionFlow,
    free_sign,
    half_extent,
    whole_boxes,
)
from cvxlimit.model.statics import DOF
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.strength import Strength
from cvxlimit.proof.witnesses import Witnesses
from cvxlimit.scene import Scene
from cvxlimit.solution import Iterate
from cvxlimit.solvers import LimitState, default_ladder
from cvxlimit.surfaces import Rocking, TorsionShear

FloatArray = NDArray[np.float64]
Progress = Callable[[str], None]

ADMISSIBLE = 1e-9
"""Excess and residual, as shares of the total load, up to which forces count as admissible."""

_NARROWEST_CHILD = 0.2
"""Least share of a range that a child gets, so that ranges shrink whatever the forces say."""

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


@dataclass(frozen=True, eq=False)
class Bracket:
    """What branch and bound has proved.

    Attributes
    ----------
    lower, upper : float
        Of the load factor with interaction; infinite where nothing was found.
    is_proved : bool
        True if the upper bound needs no assumption (see :class:`Certifier`).
    is_closed : bool
        True if the bracket is within the tolerance.
    forces : (n, 6) or None
        Admissible, in equilibrium at ``lower``.
    mechanism : (free blocks, 6) or None
        Of the node with the largest bound when the search ended.
    history : tuple of Iterate
        One entry whenever a bound improved.
    solves : int
    seconds : float
    """

    lower: float
    upper: float
    is_proved: bool
    is_closed: bool
    forces: FloatArray | None
    mechanism: FloatArray | None
    history: tuple[Iterate, ...]
    solves: int
    seconds: float


def branch_and_bound(
    scene: Scene,
    moments: str,
    tolerance: float = 1e-4,
    most_solves: int = 5_000,
    seconds: float = 60.0,
    progress: Progress | None = None,
) -> Bracket:
    """Bracket the load factor with interaction to ``tolerance``, relative to the upper bound.

    Ends after ``most_solves`` convex problems or ``seconds``; the bracket is valid then, too. Meant
    for scenes of a few contacts. Contacts that are not rectangles are not split.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> bracket = branch_and_bound(builtin_scene("single-block"), "signed")
    >>> bracket.is_closed, round(bracket.lower, 4)
    (True, 0.4)
    """
    search = _Search(scene, moments, tolerance, progress or (lambda message: None))
    search.start()
    while not search.is_closed and search.open:
        if search.solves >= most_solves or search.elapsed() > seconds:
            break
        search.step()
    return search.bracket()


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


class _Search:
    """Open nodes, the largest bound of closed ones, and the best forces."""

    def __init__(self, scene: Scene, moments: str, tolerance: float, tell: Progress) -> None:
        self.scene, self.moments, self.tolerance, self.tell = scene, moments, tolerance, tell
        self.started = time.perf_counter()
        self.contacts = scene.contacts
        self.half = half_extent(self.contacts)
        whole = InteractionFlow(self.contacts, moments)
        self.certifier = Certifier(scene, (Rocking(),), flow=whole)
        self.statics, self.witnesses = self.certifier.statics, self.certifier.witnesses
        self.opens = self.witnesses.opening_field is not None  # found once, for all nodes
        self.problem = HullProblem(scene)
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
        self.history: list[Iterate] = []

    @property
    def upper(self) -> float:
        """Largest bound of any node."""
        top = self.open[0].bound if self.open else -np.inf
        return max(top, self.closed, self.lower)

    @property
    def width(self) -> float:
        """The gap that is asked for, as a load factor."""
        known = [x for x in (self.upper, self.lower) if np.isfinite(x)]
        return self.tolerance * self.problem.scaling.unit(0.0, *known)

    @property
    def is_closed(self) -> bool:
        """True when the bracket is within the tolerance."""
        return bool(self.upper - self.lower <= self.width)

    def elapsed(self) -> float:
        """Seconds so far."""
        return time.perf_counter() - self.started

    def bracket(self) -> Bracket:
        """The present state."""
        return Bracket(
            lower=self.lower,
            upper=self.upper,
            is_proved=self.opens and bool(np.isfinite(self.upper)),
            is_closed=self.is_closed,
            forces=self.forces,
            mechanism=self.open[0].mechanism if self.open else self.last.mechanism,
            history=tuple(self.history),
            solves=self.solves,
            seconds=self.elapsed(),
        )

    def start(self) -> None:
        """The root: all pressure centres; and forces that carry the dead load."""
        self.last = root = self._evaluated(whole_boxes(self.contacts), Copies.none(), np.inf, None)
        if np.isfinite(root.bound):
            self.price = _PRICE * max(abs(root.bound), self.problem.scaling.load_factor(1.0))
        heapq.heappush(self.open, root)
        at_rest = self._plain().dead_state
        if at_rest is not None and self._is_admissible(at_rest, 0.0):
            self.lower, self.forces = 0.0, at_rest
        self._raise_lower(root)
        self._note()

    def _plain(self) -> Witnesses:
        """Reference states under the surfaces without interaction."""
        assemblage = self.certifier.assemblage
        return Witnesses(assemblage, Strength(assemblage, (Rocking(), TorsionShear())))

    def step(self) -> None:
        """Split the node with the largest bound."""
        node = self.last = heapq.heappop(self.open)
        choice = self._choice(node)
        if choice is None:
            self.closed = max(self.closed, node.bound)
            return
        contact, axis, at = choice
        for boxes in _children(node.boxes, contact, axis, at, self.moments):
            added = node.added.without(np.array([contact]))
            child = self._evaluated(boxes, added, node.bound, node)
            if child.bound > self.lower + self.width:
                self._raise_lower(child)
            if child.bound > self.lower + 0.5 * self.width:
                heapq.heappush(self.open, child)
            else:
                self.closed = max(self.closed, child.bound)
        self._note()

    def _note(self) -> None:
        known = [float(x) if np.isfinite(x) else None for x in (self.lower, self.upper)]
        if self.history and [self.history[-1].lower, self.history[-1].upper] == known:
            return
        self.history.append(
            Iterate(known[0], self.elapsed(), "branch and bound", f"{self.solves} solves", *known)
        )
        self.tell(f"branch and bound: [{self.lower:.6f}, {self.upper:.6f}], {len(self.open)} open")

    def _choice(self, node: _Node) -> tuple[int, int, float] | None:
        """Contact, axis and fraction at which to split; None where nothing can be split."""
        forces, mechanism = node.forces, node.mechanism
        if forces is None or mechanism is None:
            return self._widest(node)
        rates = self.statics.relative_rates(mechanism)
        speed = np.hypot(rates[:, 0], rates[:, 1])
        speed = speed + self.contacts.torsion_arm * np.abs(rates[:, COLUMN["MT"]])
        speed = speed + _SPEED_AT_REST * float(speed.max())
        excess = np.maximum(interaction_excess(forces, self.contacts, self.moments), 0.0)
        can_split = self.contacts.is_rectangle & (np.ptp(node.boxes, axis=2).max(axis=1) > _NARROW)
        score = np.where(can_split, excess * speed, 0.0)
        contact = int(score.argmax())
        if not score[contact] > 0.0:
            return self._widest(node)
        centre = self._centre(forces)[contact]
        low, high = node.boxes[contact].T
        if self.moments == "independent":
            symmetric = free_sign(node.boxes[contact])
            low, centre = np.where(symmetric, 0.0, low), np.where(symmetric, abs(centre), centre)
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
        first = box_copies(self.contacts, self.moments, boxes)
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
        for settings in default_ladder()[:3]:
            self.solves += 1
            state = self.problem.solve(copies, settings, price)
            if state.mechanism is not None or state.outcome.claims_no_optimum:
                break
        return state

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
        goal = (
            self.certifier.strength.balanced(node.forces, node.load_factor, self.statics),
            node.load_factor,
        )
        known = None if self.forces is None else (self.forces, self.lower)
        for start in filter(None, (safe, known)):
            forces, factor = self._advanced(start, goal)
            if factor > self.lower:
                self.lower, self.forces = float(factor), forces

    def _safe(self, node: _Node) -> _State | None:
        assert node.forces is not None
        reach = _SAFE_REACH * float(np.ptp(node.boxes, axis=2).max())
        centre = self._centre(node.forces)
        state = self._solve(safe_copies(self.contacts, self.moments, centre, reach), None)
        if state.forces is None or state.load_factor is None:
            return None
        forces = self.certifier.strength.balanced(state.forces, state.load_factor, self.statics)
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

    def _is_admissible(self, forces: FloatArray, load_factor: float) -> bool:
        """Equilibrium, rocking and Eq. 30, to 1e-9 of the total load."""
        residual = self.statics.residual(forces, load_factor).reshape(-1, DOF)
        residual[:, 3:] /= self.certifier.size
        excess = [
            np.abs(residual).max(),
            Rocking().excess(forces, self.contacts)[0].max(),
            interaction_excess(forces, self.contacts, self.moments).max(),
        ]
        return bool(max(excess) <= ADMISSIBLE * self.load)


def _children(
    boxes: FloatArray, contact: int, axis: int, at: float, moments: str
) -> list[FloatArray]:
    """Boxes with one range cut: at ``at``; at zero where it has both signs; or, with independent
    signs, into its middle and two sides, so that no other range has both signs."""
    low, high = boxes[contact, axis]
    if moments == "independent" and low < 0.0 < high:
        cut = float(np.clip(abs(at), _NARROWEST_CHILD * high, (1.0 - _NARROWEST_CHILD) * high))
        ends = [low, -cut, cut, high]
    elif low < 0.0 < high:
        ends = [low, 0.0, high]
    else:
        reserve = _NARROWEST_CHILD * (high - low)
        ends = [low, float(np.clip(at, low + reserve, high - reserve)), high]
    children = []
    for left, right in pairwise(ends):
        child = boxes.copy()
        child[contact, axis] = left, right
        children.append(child)
    return children
