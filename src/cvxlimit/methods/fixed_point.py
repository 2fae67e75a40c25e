"""The paper's fixed point (section 4, Eq. 41-43), with its failures named."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import cvxpy as cp
import numpy as np

from cvxlimit.checks import count, is_number, not_negative, ratio
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.convex import dead_load_falls
from cvxlimit.methods.driver import Answer, Method, Run, Steps, cycles
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.readings.named import parse_moments
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.problem import LeastForces, LimitProblem, Objective
from cvxlimit.scene import Scene
from cvxlimit.solution import Status
from cvxlimit.solvers import LimitState, SolverSettings, iterate_ladder
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import Rocking
from cvxlimit.surfaces.frozen import TorsionShearBending

DPP_LIMIT = 3_000
"""Parameter entries (three per contact) up to which the compiled problem is kept for re-solves. The
first compile with them grows with their square; beyond, every solve is compiled afresh."""

_BEFORE = 100.0
"""The change before the last one may be so many times the tolerance."""


class FrozenProblem:
    """The limit problem with eccentricities frozen at Parameters, re-solved as they change."""

    def __init__(
        self,
        scene: Scene | Assemblage,
        cone: Cone,
        moments: Moments,
        objective: Objective | None = None,
    ) -> None:
        self.contacts, self.cone, self.moments = scene.contacts, cone, moments
        self.ignore_dpp = 3 * len(self.contacts) > DPP_LIMIT
        nothing = np.zeros((len(self.contacts), len(COLUMN)))
        surface = self._surface(Pressure.of(nothing, self.contacts))
        self.parameters = {
            name: cp.Parameter(len(self.contacts), value=value)
            for name, value in surface.shares.items()
        }
        surface.shares = {**self.parameters}
        self.problem = LimitProblem(scene, (Rocking(), surface), objective=objective)

    def solve(self, pressure: Pressure, settings: SolverSettings) -> LimitState:
        self.press(pressure)
        return self.problem.solve(settings, ignore_dpp=self.ignore_dpp)

    def press(self, pressure: Pressure) -> None:
        """Give Parameters their values."""
        for name, value in self._surface(pressure).shares.items():
            self.parameters[name].value = value

    def surfaces(self, pressure: Pressure) -> tuple[YieldSurface, ...]:
        """The same surfaces with numbers in place of Parameters, for certificates."""
        return Rocking(), self._surface(pressure)

    def _surface(self, pressure: Pressure) -> TorsionShearBending:
        return self.moments.frozen(self.moments.eccentricity(pressure, self.contacts), self.cone)


@dataclass(frozen=True)
class FixedPoint(Method):
    """The paper's iteration: solve with frozen eccentricities, blend, repeat.

    The first iterate uses whole contacts (Eq. 41). It has no bracket: the bounds of its last convex
    problem, with eccentricities frozen, are not bounds of the collapse load with interaction. For
    those see :class:`~cvxlimit.methods.certified.Certified`.

    Attributes
    ----------
    old_value_weight : float
        Weight beta in [0, 1) of the forces used so far against the new ones, for N, M1 and M2
        alike (Eq. 42, read as Gilbert et al. 2006 do: beta weighs the old value). 0.8 is the
        paper's value.
    tolerance : float
        Relative change of the load factor that counts as converged (Eq. 43), unless the change
        before was more than 100 times as large; the paper's 1e-4.
    max_iterations : int
    moments : str or Moments
        How Eq. 30 adds moments: see :func:`cvxlimit.solve`.
    epsilon : float
        The paper's small number of Eq. 41, here in mean block weights: Eq. 31 divides by
        N + epsilon, so that contacts which carry next to nothing count as pressed near their
        centres. The default is its limit: contacts without compression count as pressed there.
    regularisation : float
        Weight of the squared norm of the forces that is taken off the scaled load factor, so that
        the forces which the next eccentricities are made of are the only ones there are: not those
        that rounding picks. It is no cure: docs/evidence/atlas.md has what it gains.

    Example
    -------
    >>> FixedPoint(old_value_weight=0.5).tolerance
    0.0001
    """

    name = "fixed-point"
    answers = "interaction with bending by the paper's iteration (Eq. 41-43), without a bracket"

    old_value_weight: float = 0.8
    tolerance: float = 1e-4
    max_iterations: int = 60
    epsilon: float = 0.0
    regularisation: float = 0.0
    moments: str | Moments = "independent"

    def __post_init__(self) -> None:
        if not (is_number(self.old_value_weight) and 0.0 <= self.old_value_weight < 1.0):
            raise ModelError(
                "old_value_weight must be at least 0 and below 1 (1 would never move), "
                f"got {self.old_value_weight!r}"
            )
        ratio(self.tolerance, "tolerance")
        count(self.max_iterations, 1, "max_iterations")
        not_negative(self.epsilon, "epsilon")
        not_negative(self.regularisation, "regularisation")

    def steps(self, run: Run) -> Steps:
        moments = run.moments = parse_moments(self.moments)
        caution = [moments.caution] if moments.caution else []
        run.remarks = ["the iteration gives no bounds on the collapse load", *caution]
        with run.clock.phase("compile"):
            objective = LeastForces(self.regularisation) if self.regularisation else None
            frozen = FrozenProblem(run.assemblage, run.cone, moments, objective)
        if dead_load_falls(run):
            return Status.DEAD_LOAD_UNSTABLE
        epsilon = self.epsilon * run.scaling.force / len(run.scene.free)
        blended = np.zeros((len(run.contacts), len(COLUMN)))
        for number in range(self.max_iterations):
            pressure = Pressure.of(blended, run.contacts, epsilon)
            solver = partial(frozen.solve, pressure)
            state, rung = run.try_solvers(solver, run.ladder or iterate_ladder())
            run.note(state, rung, change=run.change(state))
            if state.forces is None:
                claims = state.outcome.claims_no_optimum
                return Status.DIVERGED if claims else Status.SOLVER_FAILED
            run.best = Answer(state.load_factor, run.best.bracket, state.forces, state.mechanism)
            beta = self.old_value_weight if number else 0.0
            blended = beta * blended + (1.0 - beta) * state.forces
            yield
            if self._has_settled(run):
                return Status.CONVERGED
            if cycles(run.load_factors, self.tolerance):
                return Status.CYCLING
        return Status.NOT_CONVERGED

    def _has_settled(self, run: Run) -> bool:
        changes = [iterate.change for iterate in run.history[-2:]]
        if not changes or changes[-1] is None or changes[-1] > self.tolerance:
            return False
        return changes[0] is None or changes[0] <= _BEFORE * self.tolerance
