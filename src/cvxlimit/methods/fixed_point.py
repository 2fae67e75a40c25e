"""The paper's fixed point (section 4, Eq. 41-43), with its failures named."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.checks import count, is_number, ratio
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.analysis import Clock, by_block
from cvxlimit.methods.interaction.pressure import Pressure
from cvxlimit.model.problem import LimitProblem
from cvxlimit.proof.certificate import Certificate, Certifier
from cvxlimit.scene import Scene
from cvxlimit.solution import Iterate, Solution, Status
from cvxlimit.solvers import LimitState, SolverSettings, iterate_ladder
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import Rocking
from cvxlimit.surfaces.frozen import (
    Eccentricity,
    SignedTorsionShearBending,
    TorsionShearBending,
)

FloatArray = NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True)
class FixedPoint:
    """Settings of the paper's iteration.

    Attributes
    ----------
    old_value_weight : float
        Weight beta in [0, 1) of the forces used so far against the new ones, for N, M1 and M2
        alike (Eq. 42, read as Gilbert et al. 2006 do: beta weighs the old value). 0.8 is the
        paper's value.
    tolerance : float
        Relative change of the load factor that counts as converged (Eq. 43), unless the change
        before was more than 100 times as large; the paper's 1e-4.
    most : int
        Iterations before giving up.

    Example
    -------
    >>> FixedPoint(old_value_weight=0.5).tolerance
    0.0001
    """

    old_value_weight: float = 0.8
    tolerance: float = 1e-4
    most: int = 60

    def __post_init__(self) -> None:
        if not (is_number(self.old_value_weight) and 0.0 <= self.old_value_weight < 1.0):
            raise ModelError(
                "old_value_weight must be at least 0 and below 1 (1 would never move), "
                f"got {self.old_value_weight!r}"
            )
        ratio(self.tolerance, "tolerance")
        count(self.most, 1, "most")


DPP_LIMIT = 3_000
"""Parameter entries (three per contact) up to which the compiled problem is kept for re-solves;
beyond, every solve is compiled afresh. The first compile with Parameters grows with their square,
0.5, 1.7 and 3.3 s at 444, 886 and 1,203 contacts (512 and 830 MB at the last two), after which a
re-solve costs 2 to 6 ms; afresh it is 23 to 37 ms each. ``python -m benchmarks run --methods
"frozen/*"`` shows the same."""

_BEFORE = 100.0
"""The change before the last one may be so many times the tolerance."""

_SMALLEST_ARM = 1e-9
"""An effective area without extent counts as this fraction of c_T: the frozen surface keeps an
interior, and nothing is allowed there that a solver could tell from nothing."""


class FrozenProblem:
    """The limit problem with eccentricities frozen at Parameters, re-solved as they change."""

    def __init__(self, scene: Scene, cone: Cone, moments: str) -> None:
        n = len(scene.contacts)
        self.parameters = Eccentricity(
            arm=cp.Parameter(n, nonneg=True, name="arm"),
            e1=cp.Parameter(n, nonneg=moments == "independent", name="e1"),
            e2=cp.Parameter(n, nonneg=moments == "independent", name="e2"),
        )
        self.moments = moments
        self.cone = cone
        self.contacts = scene.contacts
        self.ignore_dpp = 3 * n > DPP_LIMIT
        surfaces = (Rocking(), frozen_surface(self.parameters, moments, cone))
        self.problem = LimitProblem(scene, surfaces)

    def solve(self, pressure: Pressure, settings: SolverSettings) -> LimitState:
        """Set the Parameters from ``pressure`` and solve."""
        values = relative(pressure, self.contacts, self.moments)
        for name in ("arm", "e1", "e2"):
            getattr(self.parameters, name).value = getattr(values, name)
        return self.problem.solve(settings, ignore_dpp=self.ignore_dpp)

    def surfaces(self, pressure: Pressure) -> tuple[YieldSurface, ...]:
        """The same surfaces with numbers in place of Parameters, for certificates."""
        at = relative(pressure, self.contacts, self.moments)
        return Rocking(), frozen_surface(at, self.moments, self.cone)


def frozen_surface(at: Eccentricity, moments: str, cone: Cone) -> YieldSurface:
    """Eq. 32 in either moment convention."""
    kind = SignedTorsionShearBending if moments == "signed" else TorsionShearBending
    return kind(at, cone)


def relative(pressure: Pressure, contacts: Contacts, moments: str) -> Eccentricity:
    """Eccentricities and arms over c_T; magnitudes where signs are independent."""
    e1, e2 = pressure.e1 / contacts.torsion_arm, pressure.e2 / contacts.torsion_arm
    if moments == "independent":
        e1, e2 = np.abs(e1), np.abs(e2)
    arm = np.maximum(pressure.arm / contacts.torsion_arm, _SMALLEST_ARM)
    return Eccentricity(arm, e1, e2)


def run_fixed_point(
    scene: Scene,
    cone: Cone,
    moments: str,
    rule: FixedPoint,
    ladder: Sequence[SolverSettings] | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Iterate until Eq. 43 holds, or say how it fails.

    The first iterate uses whole contacts (Eq. 41). ``lower`` and ``upper`` of the solution bound
    the last convex problem, with its eccentricities frozen; they do not bound the collapse load
    with interaction, for which see the certified method.
    """
    return _Run(scene, cone, moments, rule, ladder, progress).solution()


class _Run:
    def __init__(
        self,
        scene: Scene,
        cone: Cone,
        moments: str,
        rule: FixedPoint,
        ladder: Sequence[SolverSettings] | None,
        progress: Progress | None,
    ) -> None:
        self.clock = Clock()
        start = time.perf_counter()
        self.scene, self.contacts = scene, scene.contacts
        self.clock.measure("detect", start)
        start = time.perf_counter()
        self.frozen = FrozenProblem(scene, cone, moments)
        self.clock.measure("compile", start)
        self.rule, self.ladder = rule, ladder or iterate_ladder()
        self.tell = progress or (lambda message: None)
        self.history: list[Iterate] = []

    def solution(self) -> Solution:
        blended = np.zeros((len(self.contacts), len(COLUMN)))
        status, state = Status.NOT_CONVERGED, None
        for number in range(1, self.rule.most + 1):
            pressure = Pressure.of(blended, self.contacts)
            new = self._solve(number, pressure)
            if new.forces is None:
                status = Status.DIVERGED
                break
            state, frozen_at = new, pressure
            if self._has_settled():
                status = Status.CONVERGED
                break
            if _cycles([h.load_factor for h in self.history], self.rule.tolerance):
                status = Status.CYCLING
                break
            blended = self._blend(blended, new.forces) if number > 1 else new.forces
        if state is None:
            return self._packed(status, None, None)
        return self._packed(status, state, self._certificate(frozen_at, state))

    def _has_settled(self) -> bool:
        """Eq. 43, and not by chance: between changes of 2 % one of 0.002 % was seen."""
        before, last = (self.history[-i].change if len(self.history) >= i else None for i in (2, 1))
        if last is None or last > self.rule.tolerance:
            return False
        return before is None or before <= _BEFORE * self.rule.tolerance

    def _blend(self, old: FloatArray, new: FloatArray) -> FloatArray:
        beta = self.rule.old_value_weight
        return beta * old + (1.0 - beta) * new

    def _solve(self, number: int, pressure: Pressure) -> LimitState:
        """Solve at ``pressure``, with the next solver where one has nothing to offer."""
        for settings in self.ladder:
            self.tell(f"iterate {number}: solving with {settings}")
            state = self.frozen.solve(pressure, settings)
            self.clock.seconds["compile"] += state.outcome.compile_seconds
            self.clock.seconds["solve"] += state.outcome.solve_seconds
            if state.forces is not None or state.outcome.claims_no_optimum:
                break
        factor = state.load_factor
        last = self.history[-1].load_factor if self.history else None
        change = None
        if factor is not None and last is not None:
            change = abs(factor - last) / max(abs(factor), 1e-300)
        self.history.append(
            Iterate(
                load_factor=factor,
                seconds=state.outcome.compile_seconds + state.outcome.solve_seconds,
                solver=str(settings),
                status=state.outcome.status,
                change=change,
            )
        )
        if factor is not None:
            self.tell(f"iterate {number}: load factor {factor:.6f}")
        return state

    def _certificate(self, pressure: Pressure, state: LimitState) -> Certificate:
        start = time.perf_counter()
        certifier = Certifier(self.scene, self.frozen.surfaces(pressure))
        result = certifier.certificate(state.forces, state.load_factor, state.mechanism)
        self.clock.measure("certify", start)
        return result

    def _packed(
        self, status: Status, state: LimitState | None, bounds: Certificate | None
    ) -> Solution:
        if bounds is not None:
            self.history[-1] = replace(
                self.history[-1], lower=_known(bounds.lower), upper=_known(bounds.upper)
            )
        note = "the bracket is that of the last problem with frozen eccentricities"
        if not status.is_good:
            note = f"{status.advice}; {note}"
        return Solution(
            scene=self.scene.name,
            surface=str(self.frozen.cone),
            interaction="fixed-point",
            moments=self.frozen.moments,
            blocks=len(self.scene.free),
            contacts=len(self.contacts),
            load_factor=None if state is None else state.load_factor,
            lower=-np.inf if bounds is None else bounds.lower,
            upper=np.inf if bounds is None else bounds.upper,
            status=status,
            history=tuple(self.history),
            seconds=self.clock.report(),
            forces=None if state is None else state.forces,
            mechanism=None if state is None else by_block(self.scene, state.mechanism),
            note=note,
        )


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _cycles(factors: list[float | None], tolerance: float) -> bool:
    """True if the last load factors repeat with a period of 2 to 8, three times over."""
    for period in range(2, 9):
        tail = factors[-3 * period :]
        if len(tail) < 3 * period or any(f is None for f in tail):
            continue
        laps = np.array(tail, dtype=float).reshape(3, period)
        if np.ptp(laps, axis=0).max() <= tolerance * np.abs(laps).max():
            return True
    return False
