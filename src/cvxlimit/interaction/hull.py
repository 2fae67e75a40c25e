"""The convex hull of all admissible contact states with interaction: bounds from above.

A contact's true states are a union over its pressure centre e of cones that are convex for fixed
e. Their convex hull is the sum of *copies*: parts (N_k, V_k) of the contact's force, each with its
own frozen pressure centre (Balas' perspective form). With c_k = c(e_k), kappa = (eps2, eps1) / c,

    abs(V_k) + kappa . (abs(V1_k), abs(V2_k)) + tau_k <= mu N_k,   tau_k >= 0,
    abs(MT) <= sum c_k tau_k,   abs(M2) <= sum eps1_k N_k,   abs(M1) <= sum eps2_k N_k

for independent signs, and for signed moments abs(V_k) + tau_k <= mu N_k, M = sum N_k e_k and
abs(MT - sum e_k x V_k) <= sum c_k tau_k. Which e are needed is answered by the support function
(:mod:`cvxlimit.interaction.support`):

- signed: the corners of a box, and its corners at zero where it holds zero. For a whole
  contact the polygon's corners alone (c = 0): *Coulomb friction at the corners of the contact is
  the exact hull of signed torsion-shear-bending*;
- independent: four copies with eps = (0, 0), (l1/2, 0), (0, l2/2), (l1/2, l2/2), and further ones
  on the edges of the box, added where the mechanism shows that they are missed (column pricing).

Bounds never rest on the copies: a mechanism is certified against the support function itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.analysis import Clock
from cvxlimit.certificate import Certificate, Certifier
from cvxlimit.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.formulations import ForceModel
from cvxlimit.interaction.support import (
    InteractionFlow,
    free_sign,
    half_extent,
    rectangle_arm,
    whole_boxes,
)
from cvxlimit.polygons import effective_region, mean_distance
from cvxlimit.scene import Scene
from cvxlimit.solution import Iterate
from cvxlimit.solvers import LimitState, SolverSettings, default_ladder, run
from cvxlimit.statics import DOF, Scaling, Statics
from cvxlimit.surfaces import Rocking

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Progress = Callable[[str], None]

_POINT = 1e-9
"""Arms below this share of the half extent count as zero: the pressure centre is a corner."""

_NOISE = 1e-10
"""Missing opening, as a share of the mechanism's largest rate, that solvers leave anyway."""

_WORTH_A_COPY = 0.1
"""Share of the tolerance by which a contact must raise the bound for copies to be added to it."""

_BESIDE = 0.1
"""Copies beside an added one, in half sides: the next mechanism's worst place is not far."""

MOST_ROUNDS = 12
"""Solves with added copies; the built-in scenes need 2 to 6."""


@dataclass(frozen=True, eq=False)
class Copies:
    """Copies of contacts with frozen pressure centres, k of them.

    Attributes
    ----------
    contact : (k,)
    centre, spread : (k, 2)
        Pressure centre as fractions of :func:`half_extent`; with spread it may lie anywhere in
        centre +- spread, and the copy is that of eps = abs(centre) + spread.
    signed : (k,) bool
        True where the torsion is taken about the pressure centre.
    """

    contact: IntArray
    centre: FloatArray
    spread: FloatArray
    signed: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.contact)

    def joined(self, other: Copies) -> Copies:
        """These and ``other``."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Copies(*(np.concatenate(pair) for pair in pairs))

    def without(self, contacts: IntArray) -> Copies:
        """Those of all other contacts."""
        kept = ~np.isin(self.contact, contacts)
        return Copies(*(values[kept] for values in vars(self).values()))

    @classmethod
    def none(cls) -> Copies:
        """No copies."""
        empty = np.zeros((0, 2))
        return cls(np.zeros(0, dtype=int), empty, empty, np.zeros(0, dtype=bool))

    @classmethod
    def at(cls, rows: IntArray, centre: FloatArray, boxes: FloatArray, moments: str) -> Copies:
        """Copies of contacts ``rows`` at ``centre`` (k, 2); spread where boxes allow both signs."""
        free = free_sign(boxes[rows]) & (moments == "independent")
        return cls(
            rows,
            np.where(free, 0.0, centre),
            np.where(free, np.abs(centre), 0.0),
            np.full(len(rows), moments == "signed"),
        )


def missed_copies(
    flow: InteractionFlow, certifier: Certifier, mechanism: FloatArray, worth: float
) -> Copies:
    """Copies at the worst pressure centres of contacts that open too little.

    ``certifier`` opens the mechanism u by t u0 with t = missing / spare, which raises the bound
    by t times the rate -(f_D + alpha f_L) . u0; contacts count that raise it by ``worth``.
    """
    statics, field = certifier.statics, certifier.witnesses.opening_field
    rates = statics.relative_rates(mechanism)
    missing, centre = flow.worst(rates)
    noise = _NOISE * float(np.abs(rates[:, : COLUMN["N"] + 1]).max())
    chosen = (missing > noise) & np.isfinite(centre).all(axis=1)
    if field is not None:
        bound = -float(statics.dead @ mechanism.ravel())
        price = abs(float((statics.dead + bound * statics.live) @ field.ravel()))
        chosen &= missing * price > worth * -flow.shortfall(statics.relative_rates(field))[0]
    rows = np.flatnonzero(chosen)
    return Copies.at(rows, centre[rows], flow.boxes, flow.moments)


def box_copies(contacts: Contacts, moments: str, boxes: FloatArray | None = None) -> Copies:
    """The copies every relaxation starts from, for boxes (n, 2, 2) of pressure centres."""
    boxes = whole_boxes(contacts) if boxes is None else boxes
    whole = (np.abs(boxes) >= 1.0).all(axis=(1, 2))
    cornered = ~contacts.is_rectangle | (whole & (moments == "signed"))
    return _corner_copies(contacts, cornered).joined(_level_copies(~cornered, boxes, moments))


def _corner_copies(contacts: Contacts, chosen: NDArray[np.bool_]) -> Copies:
    """Friction at the corners of polygons."""
    k = np.flatnonzero(chosen[contacts.corner_contact])
    j = contacts.corner_contact[k]
    centre = contacts.corner_xy[k] / half_extent(contacts)[j]
    return Copies(j, centre, np.zeros_like(centre), np.ones(len(k), dtype=bool))


def _level_copies(chosen: NDArray[np.bool_], boxes: FloatArray, moments: str) -> Copies:
    """All pairs of a box's levels: its ends, and zero where it lies between them."""
    free = free_sign(boxes)
    top = np.abs(boxes).max(axis=2)
    symmetric = free & (moments == "independent")
    levels = [
        (np.where(symmetric, top, boxes[..., 1]), np.ones_like(free)),
        (boxes[..., 0], ~symmetric & (boxes[..., 1] > boxes[..., 0])),
        (np.zeros_like(top), free),
    ]
    result = Copies.none()
    for first, has_first in levels:
        for second, has_second in levels:
            rows = np.flatnonzero(chosen & has_first[:, 0] & has_second[:, 1])
            centre = np.stack([first[rows, 0], second[rows, 1]], axis=1)
            result = result.joined(Copies.at(rows, centre, boxes, moments))
    return result


def safe_copies(contacts: Contacts, moments: str, centre: FloatArray) -> Copies:
    """One copy per contact whose states are all admissible, about ``centre`` (n, 2) in fractions.

    Independent signs on rectangles: anywhere with abs(M2) <= eps1 N, abs(M1) <= eps2 N, where the
    true arm is no smaller and the true eccentricities no larger than the frozen ones. Signed
    moments and other polygons: pressed exactly at ``centre``.
    """
    free = (contacts.is_rectangle & (moments == "independent"))[:, None]
    return Copies(
        np.arange(len(contacts)),
        np.where(free, 0.0, centre),
        np.where(free, np.abs(centre), 0.0),
        np.full(len(contacts), moments == "signed"),
    )


def copy_arms(copies: Copies, contacts: Contacts) -> FloatArray:
    """c (k,) of the copies, in the unit of ``contacts``; exactly zero in corners."""
    half = half_extent(contacts)[copies.contact]
    arm = rectangle_arm(half, half * (np.abs(copies.centre) + copies.spread))
    for k in np.flatnonzero(~contacts.is_rectangle[copies.contact]):
        e = half[k] * copies.centre[k]
        arm[k] = mean_distance(effective_region(contacts.corners_of(copies.contact[k]), e), e)
    return np.where(arm > _POINT * half.min(axis=1), arm, 0.0)


class _CopyForces:
    """Variables and constraints of copies, as a :class:`ForceModel`."""

    def __init__(self, copies: Copies, contacts: Contacts) -> None:
        self.copies, self.contacts = copies, contacts
        self.half = half_extent(contacts)[copies.contact]
        self.arm = copy_arms(copies, contacts)
        self.friction = contacts.friction[copies.contact]
        self.shears = np.flatnonzero(copies.signed | (self.arm > 0.0))
        self.twists = np.flatnonzero(self.arm > 0.0)
        self.compression = cp.Variable(len(copies), name="N")
        self.maps: list[tuple[cp.Variable, sp.csr_array]] = []
        self.constraints: list[cp.Constraint] = []

    def model(self) -> ForceModel:
        """The forces of all contacts as sums over their copies."""
        self._add_compression()
        for axis, moment in enumerate(("M2", "M1")):
            self._add_spread(axis, moment)
        self._add_tangential()
        return ForceModel(self.maps, {}, self.constraints)

    def _add_compression(self) -> None:
        k = np.arange(len(self.copies))
        e1, e2 = (self.half * self.copies.centre).T
        self._map(self.compression, [("N", k, k, np.ones(len(k))), ("M1", k, k, e2),
                                     ("M2", k, k, -e1)])  # fmt: skip
        implied = np.zeros(len(k), dtype=bool)
        implied[self.shears] = self.friction[self.shears] > 0.0
        if not implied.all():
            self.constraints.append(self.compression[np.flatnonzero(~implied)] >= 0.0)

    def _add_spread(self, axis: int, moment: str) -> None:
        """abs(moment) <= sum of spread N, for contacts with spread along ``axis``."""
        reach = (self.half * self.copies.spread)[:, axis]
        k = np.flatnonzero(reach > 0.0)
        self._add_bounded(moment, k, reach[k], self.compression[k] if len(k) else None)

    def _add_tangential(self) -> None:
        k = self.shears
        shear = cp.Variable((len(k), 2), name="V") if len(k) else None
        if shear is None:
            return
        along, arms = np.arange(len(k)), (self.half * self.copies.centre)[k]
        arms = np.where(self.copies.signed[k][:, None], arms, 0.0)
        self._map(shear, [
            ("V1", k, along, np.ones(len(k))), ("V2", k, along + len(k), np.ones(len(k))),
            ("MT", k, along, -arms[:, 1]), ("MT", k, along + len(k), arms[:, 0]),
        ])  # fmt: skip
        remaining = cp.multiply(self.friction[k], self.compression[k])
        remaining -= self._torsion(len(k)) + self._drag(shear)
        self.constraints.append(cp.SOC(remaining, shear, axis=1))

    def _torsion(self, rows: int) -> cp.Expression:
        """tau of the copies that shear, and the contacts' torsion bounded by it."""
        if not len(self.twists):
            return cp.Constant(np.zeros(rows))
        share = cp.Variable(len(self.twists), nonneg=True, name="tau")
        self._add_bounded("MT", self.twists, self.arm[self.twists], share)
        return _places(np.searchsorted(self.shears, self.twists), rows) @ share

    def _drag(self, shear: cp.Variable) -> cp.Expression:
        """kappa . (abs(V1), abs(V2)) of independent signs, (rows,)."""
        k = self.shears
        eps = self.half[k] * (np.abs(self.copies.centre[k]) + self.copies.spread[k])
        eps = np.where(self.copies.signed[k][:, None], 0.0, eps)
        total = cp.Constant(np.zeros(len(k)))
        for column in (0, 1):
            weight = eps[:, 1 - column] / np.where(self.arm[k] > 0.0, self.arm[k], 1.0)
            rows = np.flatnonzero(weight > 0.0)
            if len(rows):
                size = cp.Variable(len(rows))
                part = shear[rows, column]
                self.constraints += [part <= size, -part <= size]
                total = total + _places(rows, len(k), weight[rows]) @ size
        return total

    def _add_bounded(
        self, component: str, k: IntArray, reach: FloatArray, size: cp.Expression | None
    ) -> None:
        """A free part of a force component, between +- sums of reach * size over the copies k."""
        if size is None:
            return
        rows, place = np.unique(self.copies.contact[k], return_inverse=True)
        part = cp.Variable(len(rows))
        each = np.arange(len(rows))
        self.maps.append(
            (part, self._columns([(component, rows, each, np.ones(len(rows)))], len(rows)))
        )
        bound = sp.csr_array((reach, (place, np.arange(len(k)))), (len(rows), len(k))) @ size
        self.constraints += [part <= bound, -part <= bound]

    def _map(self, variable: cp.Variable, entries: list[_Entry]) -> None:
        by_contact = [(c, self.copies.contact[k], column, v) for c, k, column, v in entries]
        self.maps.append((variable, self._columns(by_contact, variable.size)))

    def _columns(self, entries: list[_Entry], size: int) -> sp.csr_array:
        rows = np.concatenate([len(COMPONENTS) * j + COLUMN[c] for c, j, _, _ in entries])
        columns = np.concatenate([column for _, _, column, _ in entries])
        values = np.concatenate([v for _, _, _, v in entries])
        matrix = sp.csr_array(
            (values, (rows, columns)), (len(COMPONENTS) * len(self.contacts), size)
        )
        matrix.eliminate_zeros()
        return matrix


_Entry = tuple[str, IntArray, IntArray, FloatArray]
"""Component, copies (or contacts), columns of the variable, coefficients."""


def _places(at: IntArray, rows: int, values: FloatArray | float = 1.0) -> sp.csr_array:
    """Matrix (rows, len(at)) that puts entry i, times its value, into row ``at[i]``."""
    entries = np.broadcast_to(np.asarray(values, dtype=float), at.shape)
    return sp.csr_array((entries, (at, np.arange(len(at)))), (rows, len(at)))


class HullProblem:
    """Limit problems over copies of one scene's contacts, in the units of :class:`Scaling`.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> scene = builtin_scene("single-block")
    >>> state = HullProblem(scene).solve(box_copies(scene.contacts, "signed"))
    >>> round(state.load_factor, 4)
    0.4
    """

    def __init__(self, scene: Scene) -> None:
        self.scaling = Scaling.of(scene)
        self.statics = self.scaling.apply(Statics.of(scene))

    def solve(
        self,
        copies: Copies,
        settings: SolverSettings | None = None,
        relief_price: float | None = None,
    ) -> LimitState:
        """One run of one solver; never raises for what the solver does.

        With ``relief_price``, any share of the dead load may be taken off at this price in load
        factors, so that the problem always has a solution and a mechanism: where no state of
        the copies carries the dead load, the mechanism's bound falls to minus the price.
        """
        forces = _CopyForces(copies, self.statics.contacts).model()
        alpha = cp.Variable(name="alpha")
        load, goal, limits = self.statics.dead, alpha, list(forces.constraints)
        if relief_price is not None:
            relief = cp.Variable(name="relief", nonneg=True)
            limits.append(relief <= 1.0)
            load = load - relief * load
            goal = alpha - relief_price / self.scaling.load_factor(1.0) * relief
        equilibrium = (
            forces.equilibrium(self.statics.matrix) + alpha * self.statics.live + load == 0.0
        )
        outcome = run(
            cp.Problem(cp.Maximize(goal), [equilibrium, *limits]), settings or default_ladder()[0]
        )
        if not outcome.has_values or alpha.value is None:
            return LimitState(outcome, None, None, None)
        dual = equilibrium.dual_value
        return LimitState(
            outcome,
            self.scaling.load_factor(float(alpha.value)),
            self.scaling.forces(forces.values()),
            None if dual is None else self.scaling.mechanism(np.asarray(dual).reshape(-1, DOF)),
        )


@dataclass(frozen=True, eq=False)
class GlobalBound:
    """Upper bound on the load factor with interaction, over all eccentricities.

    Attributes
    ----------
    upper : float
        Best certified bound; infinite where the relaxation gave none.
    is_proved : bool
        True if it needs no assumption on contact forces (see :class:`Certifier`).
    relaxed : float or None
        Load factor of the last relaxation: no hull bound could be lower than nearly this.
    mechanism : (free blocks, 6) or None
        Has the bound.
    forces : (n, 6) or None
        Of the last relaxation; their pressure centres are a start for methods from below.
    copies : Copies
        Those added by pricing, for further relaxations.
    history : tuple of Iterate
    seconds : mapping
        ``compile``, ``solve``, ``certify`` and others of :class:`Clock`.
    """

    upper: float
    is_proved: bool
    relaxed: float | None
    mechanism: FloatArray | None
    forces: FloatArray | None
    copies: Copies
    history: tuple[Iterate, ...]
    seconds: dict[str, float]


def global_upper_bound(
    scene: Scene,
    moments: str,
    tolerance: float = 1e-5,
    settings: Sequence[SolverSettings] | None = None,
    progress: Progress | None = None,
) -> GlobalBound:
    """Bound the load factor with interaction from above by the hull of every contact.

    Solves with the first copies, certifies the mechanism, adds copies where it opens too little,
    and repeats until bound and relaxation are within ``tolerance`` of each other. Solvers that
    give nothing are followed by the next of ``settings``, the solver ladder by default.
    """
    search = _Pricing(scene, moments, progress or (lambda message: None))
    ladder = tuple(settings or default_ladder())
    for rung in ladder:
        for _ in range(MOST_ROUNDS):
            is_changed = search.improve(rung, tolerance)
            if search.is_closed(tolerance):
                return search.result()
            if not is_changed:
                break
        if search.claims_no_optimum:
            break
    return search.result()


class _Pricing:
    """Copies so far, and the best bound they led to."""

    def __init__(self, scene: Scene, moments: str, tell: Progress) -> None:
        self.scene, self.moments, self.tell = scene, moments, tell
        self.clock = Clock()
        start = time.perf_counter()
        self.boxes = whole_boxes(scene.contacts)
        self.flow = InteractionFlow(scene.contacts, moments)
        self.certifier = Certifier(scene, (Rocking(),), self.flow)
        self.problem = HullProblem(scene)
        self.first = box_copies(scene.contacts, moments)
        self.added = Copies.none()
        self.clock.measure("compile", start)
        self.best: tuple[float, bool, FloatArray | None] = (np.inf, False, None)
        self.state: LimitState | None = None
        self.history: list[Iterate] = []
        self.claims_no_optimum = False

    def improve(self, settings: SolverSettings, tolerance: float) -> bool:
        """Solve, certify, price; False if another round with this solver would not help."""
        count = len(self.history) + 1
        self.tell(f"outer bound {count}: {len(self.added)} copies added, solving with {settings}")
        state = self.problem.solve(self.first.joined(self.added), settings)
        self.claims_no_optimum = state.outcome.claims_no_optimum
        bound, new = None, Copies.none()
        start = time.perf_counter()
        if state.mechanism is not None:
            self.state = state
            bound = self.certifier.certificate(None, None, state.mechanism)
            if bound.upper < self.best[0]:
                self.best = (bound.upper, bound.upper_is_proved, state.mechanism)
            worth = _WORTH_A_COPY * tolerance * self.unit
            new = missed_copies(self.flow, self.certifier, state.mechanism, worth)
        self.clock.measure("certify", start)
        self._book(settings, state, bound)
        self.added = self.added.joined(new)
        return len(new) > 0

    def _book(self, settings: SolverSettings, state: LimitState, bound: Certificate | None) -> None:
        self.clock.seconds["compile"] += state.outcome.compile_seconds
        self.clock.seconds["solve"] += state.outcome.solve_seconds
        known = bound is not None and np.isfinite(bound.upper)
        entry = Iterate(
            load_factor=state.load_factor,
            seconds=state.outcome.compile_seconds + state.outcome.solve_seconds,
            solver=str(settings),
            status=state.outcome.status,
        )
        if bound is not None and known:
            entry = replace(entry, upper=bound.upper, flow_violation=bound.flow_violation)
            self.tell(f"outer bound {len(self.history) + 1}: at most {bound.upper:.6f}")
        self.history.append(entry)

    def is_closed(self, tolerance: float) -> bool:
        """True if more copies could not lower the bound by more than ``tolerance``."""
        if self.state is None or self.state.load_factor is None:
            return False
        return self.best[0] - self.state.load_factor <= tolerance * self.unit

    @property
    def unit(self) -> float:
        """What tolerances are relative to: the bound, or its natural unit near zero."""
        return max(abs(self.best[0]), 1e-6 * self.problem.scaling.load_factor(1.0))

    def result(self) -> GlobalBound:
        """The best so far."""
        state = self.state
        return GlobalBound(
            upper=self.best[0],
            is_proved=self.best[1],
            relaxed=None if state is None else state.load_factor,
            mechanism=self.best[2],
            forces=None if state is None else state.forces,
            copies=self.added,
            history=tuple(self.history),
            seconds=self.clock.report(),
        )
