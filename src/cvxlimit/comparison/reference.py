"""Reference load factors: brackets that are proved, and narrow enough to measure errors against.

Solvers stop at about 1e-7 of the load factor. The rest comes from zooming in: the problem is
written for the *correction* of the best forces so far, in units of their error, and solved again.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.certificate import Certifier
from cvxlimit.comparison.models import Measurement, Method
from cvxlimit.comparison.settings import settings_for
from cvxlimit.contacts import COLUMN, COMPONENTS
from cvxlimit.problem import LimitProblem
from cvxlimit.scene import Scene
from cvxlimit.solve import solve
from cvxlimit.solvers import LimitState, SolverSettings, run
from cvxlimit.statics import Scaling, Statics

FloatArray = NDArray[np.float64]

WIDTH = 1e-8
"""Relative width that a reference without interaction must have."""

_AIM = 1e-9
"""Relative width at which the search for a narrower bracket stops."""

_PASSES = 6


@dataclass(frozen=True)
class Zoom:
    """One way to write the correction; lengths in units of the assumed error.

    Attributes
    ----------
    step : float
        Largest correction of a force component.
    far : float
        Rows this far from yielding are left out, and forces this long are replaced by their
        component along their direction: the certificate checks both.
    margin : float
        Distance kept from the yield surfaces, so that the solver's own error stays inside.
    """

    step: float
    far: float
    margin: float


_ZOOMS = (
    Zoom(10.0, 1e5, 1e-3),
    Zoom(10.0, 1e4, 1e-3),
    Zoom(50.0, 1e3, 1e-3),
    Zoom(10.0, 1e5, 1e-4),
)
"""Tried in turn in every pass: no single one works on all scenes. The first took the tuff wall
from 1.2e-7 to 3e-10 in two passes."""


@dataclass(frozen=True)
class Reference(Method):
    """The bracket against which others are measured: cone, no interaction or the certified one."""

    name: str = "reference"
    line: str = "reference"
    interaction: str = "none"
    moments: str = "independent"

    def measure(self, scene: Scene) -> Measurement:
        """The best proved bracket; ``load_factor`` is its middle."""
        start = time.perf_counter()
        if self.interaction == "none":
            best = _Best(scene)
            best.search()
            lower, upper, status = best.lower, best.upper, best.status
        else:
            found = solve(scene, interaction="certified", moments=self.moments)
            lower, upper, status = found.lower, found.upper, str(found.status)
        finite = bool(np.isfinite([lower, upper]).all())
        return Measurement(
            status,
            0.5 * (lower + upper) if finite else None,
            lower,
            upper,
            {},
            time.perf_counter() - start,
            len(scene.contacts),
        )


class _Best:
    """The best bounds of the conic problem so far, proved or not."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.scaling = Scaling.of(scene)
        self.certifier = Certifier(scene, LimitProblem(scene).surfaces)
        self._lower = {True: -np.inf, False: -np.inf}
        self._upper = {True: np.inf, False: np.inf}
        self.forces: FloatArray | None = None

    @property
    def lower(self) -> float:
        """The proved lower bound; where there is none, the best that rests on an assumption."""
        return self._lower[True] if np.isfinite(self._lower[True]) else self._lower[False]

    @property
    def upper(self) -> float:
        """The proved upper bound, or as for :attr:`lower`."""
        return self._upper[True] if np.isfinite(self._upper[True]) else self._upper[False]

    @property
    def width(self) -> float:
        """Relative width of the bracket."""
        if not np.isfinite([self.lower, self.upper]).all():
            return float("inf")
        return (self.upper - self.lower) / max(abs(self.upper), abs(self.lower), 1e-300)

    @property
    def status(self) -> str:
        """The width in words; "bracketed" if a bound rests on an assumption (see Certifier)."""
        proved = np.isfinite([self._lower[True], self._upper[True]]).all()
        return f"{'proved' if proved else 'bracketed'} to {self.width:.1e}"

    def search(self) -> None:
        """Solve in several ways, then zoom in, until the bracket is narrow."""
        for state in self._states():
            self._note(state)
            if self.width <= _AIM:
                return
        for _ in range(_PASSES):
            before = self.width
            for zoom in _ZOOMS:
                if self.forces is None or self.width <= _AIM:
                    return
                self._note(
                    corrected(self.scene, self.forces, self.lower, min(self.width, 1e-4), zoom)
                )
                if self.width < 0.3 * before:
                    break
            if self.width > 0.9 * before:
                return

    def _states(self) -> Iterator[LimitState]:
        for force in (1.0, 0.1, 10.0):
            scaling = replace(self.scaling, force=force * self.scaling.force)
            problem = LimitProblem(self.scene, scaling=scaling)
            for settings in _tight():
                yield problem.solve(settings)

    def _note(self, state: LimitState) -> None:
        bounds = self.certifier.certificate(state.forces, state.load_factor, state.mechanism)
        before, proved = self.lower, bounds.lower_is_proved
        self._lower[proved] = max(self._lower[proved], bounds.lower)
        proved = bounds.upper_is_proved
        self._upper[proved] = min(self._upper[proved], bounds.upper)
        if self.lower > before and state.forces is not None:
            self.forces = self._admissible(state.forces, state.load_factor, self.lower)

    def _admissible(
        self, forces: FloatArray, load_factor: float | None, lower: float
    ) -> FloatArray:
        """The mixture with the dead-load state that proves the lower bound (see Certifier)."""
        witnesses = self.certifier.witnesses
        dead = witnesses.dead_state
        if dead is None or not load_factor:
            return forces
        share = 1.0 - lower / load_factor
        return (1.0 - share) * witnesses.balanced(forces, load_factor) + share * dead


def _tight() -> list[SolverSettings]:
    more: dict[str, Any] = {"reduced_tol_feas": 1e-9, "iterative_refinement_max_iter": 50}
    raw: dict[str, Any] = {**more, "equilibrate_enable": False}
    return [
        settings_for("CLARABEL", 1e-10),
        settings_for("CLARABEL", 1e-13, "CLARABEL tight", **more),
        settings_for("CLARABEL", 1e-13, "CLARABEL unequilibrated", **raw),
    ]


def corrected(
    scene: Scene, forces: FloatArray, load_factor: float, error: float, zoom: Zoom
) -> LimitState:
    """Forces (n, 6), admissible at ``load_factor`` up to ``error``, improved.

    Torsion-shear on the cone. The unknown is (x - forces) / error; being of order one, it comes
    out with the solver's full number of digits.
    """
    scaling = Scaling.of(scene)
    statics = scaling.apply(Statics.of(scene))
    units = scaling.force * np.array([1.0, 1.0, 1.0] + [scaling.length] * 3)
    base = forces / units / error
    step = cp.Variable(base.shape)
    gain = cp.Variable()
    start = load_factor / scaling.load_factor(1.0) / error
    rest = statics.matrix @ base.ravel() + statics.dead / error + start * statics.live
    constraints = [
        statics.matrix @ cp.vec(step, order="C") + gain * statics.live == -rest,
        cp.abs(step) <= zoom.step,
        *_near_rows(statics, base, step, zoom),
    ]
    problem = cp.Problem(cp.Maximize(gain), constraints)
    outcome = run(problem, settings_for("CLARABEL", 1e-9))
    if not outcome.has_values or step.value is None:
        return LimitState(outcome, None, None, None)
    better = load_factor + scaling.load_factor(float(gain.value) * error)
    return LimitState(outcome, better, (base + step.value) * error * units, None)


def _near_rows(
    statics: Statics, base: FloatArray, step: cp.Variable, zoom: Zoom
) -> Iterator[cp.Constraint]:
    """Rocking and torsion-shear for base + step, where they could bind."""
    contacts = statics.contacts
    contact, inward, offset = contacts.edges
    rows = np.zeros((len(contact), len(COMPONENTS)))
    rows[:, COLUMN["N"]], rows[:, COLUMN["M1"]] = offset, inward[:, 1]
    rows[:, COLUMN["M2"]] = -inward[:, 0]
    slack = (rows * base[contact]).sum(axis=1)
    near = np.flatnonzero(slack < zoom.far)
    yield cp.sum(cp.multiply(rows[near], step[contact[near]]), axis=1) >= zoom.margin - slack[near]

    shear = base[:, [COLUMN["V1"], COLUMN["V2"]]]
    torque = base[:, COLUMN["MT"]] / contacts.torsion_arm
    size = np.linalg.norm(shear, axis=1)
    spare = contacts.friction * base[:, COLUMN["N"]] - size - np.abs(torque)
    near = np.flatnonzero(spare < zoom.far)
    is_long = size[near] > zoom.far
    twist = cp.multiply(1.0 / contacts.torsion_arm[near], step[near, COLUMN["MT"]])
    taken = [_growth(twist, torque[near], zoom.far)]
    for group, long in ((near[is_long], True), (near[~is_long], False)):
        if len(group):
            taken.append(_shear_growth(shear[group], step[group, :2], long))
    order = np.argsort(np.concatenate([np.flatnonzero(is_long), np.flatnonzero(~is_long)]))
    growth = cp.hstack(taken[1:])[order]
    pressure = cp.multiply(contacts.friction[near], step[near, COLUMN["N"]])
    yield taken[0] + growth <= pressure + spare[near] - zoom.margin


def _growth(change: cp.Expression, base: FloatArray, limit: float) -> cp.Expression:
    """abs(base + change) - abs(base), with the sign kept where base is far from zero."""
    far = np.abs(base) > limit
    sign = np.where(far, np.sign(base), 0.0)
    exact = cp.abs(np.where(far, 0.0, base) + cp.multiply(~far, change))
    return cp.multiply(sign, change) + exact - np.where(far, 0.0, np.abs(base))


def _shear_growth(base: FloatArray, change: cp.Expression, is_long: bool) -> cp.Expression:
    """Norm of (base + change) minus norm of base; its tangent where base is long."""
    size = np.linalg.norm(base, axis=1)
    if is_long:
        return cp.sum(cp.multiply(base / size[:, None], change), axis=1)
    return cp.norm(base + change, axis=1) - size
