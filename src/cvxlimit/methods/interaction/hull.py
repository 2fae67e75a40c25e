"""Upper bounds on the load factor from the convex hull of every contact's states.

Which copies (:mod:`copies`) make the hull follows from where the support
function (:mod:`support`) has its maximum:

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

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.analysis import Clock
from cvxlimit.methods.interaction.copies import Copies, box_copies, copy_forces
from cvxlimit.methods.interaction.support import InteractionFlow, whole_boxes
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.problem import LargestFactor, StaticProblem
from cvxlimit.proof.certificate import Certificate, Certifier
from cvxlimit.scene import Scene
from cvxlimit.solution import Iterate
from cvxlimit.solvers import LimitState, SolverSettings, default_ladder
from cvxlimit.surfaces import Rocking

__all__ = ["GlobalBound", "HullProblem", "global_upper_bound"]

FloatArray = NDArray[np.float64]
Progress = Callable[[str], None]

_NOISE = 1e-10
"""Missing opening, as a share of the mechanism's largest rate, that solvers leave anyway."""

_WORTH_A_COPY = 0.1
"""Share of the tolerance by which a contact must raise the bound for copies to be added to it."""

_BESIDE = 0.2
"""Copies come in threes: the worst place, and this far to both sides in round 1, its square in
round 2, and so on. The S12-class panel needs 4 solves instead of 6."""

MOST_ROUNDS = 12
"""Solves with added copies; the built-in scenes need 2 to 6."""


def missed_copies(
    flow: InteractionFlow,
    certifier: Certifier,
    mechanism: FloatArray,
    worth: float,
    beside: float = 0.0,
) -> Copies:
    """Copies at the worst pressure centres of contacts that open too little.

    ``certifier`` opens the mechanism u by t u0 with t = missing / spare, which raises the bound
    by t times the rate -(f_D + alpha f_L) . u0; contacts count that raise it by ``worth``.
    With ``beside``, further copies that far along the edges of whole contacts.
    """
    statics, field = certifier.statics, certifier.witnesses.opening_field
    rates = statics.relative_rates(mechanism)
    missing, centre = flow.worst(rates)
    noise = _NOISE * float(np.abs(rates[:, : COLUMN["N"] + 1]).max())
    chosen = (missing > noise) & np.isfinite(centre).all(axis=1)
    if field is not None:
        bound = -float(statics.dead @ mechanism.ravel())
        price = abs(float((statics.dead + bound * statics.live) @ field.ravel()))
        chosen &= missing * price > worth * -flow.shortfall(statics.relative_rates(field)).missing
    rows = np.flatnonzero(chosen)
    result = Copies.at(rows, centre[rows], flow.boxes, flow.moments)
    if beside > 0.0:
        ends = (centre[rows] <= 0.0) | (centre[rows] >= 1.0)
        inner = ~ends.all(axis=1)
        for step in (-beside, beside):
            moved = np.clip(centre[rows] + np.where(ends, 0.0, step), 0.0, 1.0)[inner]
            result = result.joined(Copies.at(rows[inner], moved, flow.boxes, flow.moments))
    return result


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

    def __init__(self, scene: Scene | Assemblage) -> None:
        self.assemblage = Assemblage.of(scene)
        self.scaling = self.assemblage.scaling

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
        forces = copy_forces(copies, self.assemblage.scaled.contacts)
        objective = LargestFactor(relief_price=relief_price)
        problem = StaticProblem(self.assemblage, forces, (), objective)
        return problem.solve(settings or default_ladder()[0])


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
        self.certifier = Certifier(scene, (Rocking(),), flow=self.flow)
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
            bound = self.certifier.certificate(state.forces, None, state.mechanism)
            if bound.upper < self.best[0]:
                self.best = (bound.upper, bound.upper_is_proved, state.mechanism)
            worth = _WORTH_A_COPY * tolerance * self.unit
            new = missed_copies(self.flow, self.certifier, state.mechanism, worth, _BESIDE**count)
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
        return self.problem.scaling.unit(self.best[0])

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
