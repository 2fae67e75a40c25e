"""The paper's fixed point (section 4, Eq. 41-43), with its failures named."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from cvxlimit.arrays import FloatArray
from cvxlimit.checks import count, is_number, not_negative, ratio
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.convex import dead_load_falls
from cvxlimit.methods.driver import Answer, Method, Run, Steps, cycles
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.readings.named import parse_moments
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.direct import DirectProblem
from cvxlimit.model.formulations import own_unknowns
from cvxlimit.model.problem import LeastForces, LimitProblem, Objective
from cvxlimit.scene import Scene
from cvxlimit.solution import Status
from cvxlimit.solvers import LimitState, SolverSettings, iterate_ladder
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.base import number as number_of
from cvxlimit.surfaces.cones import Cone, Conic, Facets
from cvxlimit.surfaces.coulomb import Rocking
from cvxlimit.surfaces.frozen import TorsionShearBending

DPP_LIMIT = 3_000
"""Parameter entries (three per contact) up to which the compiled problem is kept for re-solves. The
first compile with them grows with their square; beyond, every solve is compiled afresh."""


@dataclass(frozen=True)
class _Numbers:
    """Iterates on the way have the relative gap ``loose``: ends are those of exact ones, where 1e-3
    moves them by 1 % (docs/evidence/speed.md). The change ``before`` the last one may be so many
    times the tolerance."""

    loose: float = 1e-4
    before: float = 100.0


_N = _Numbers()


class FrozenProblem:
    """The limit problem with eccentricities frozen, solved again as they change.

    CVXPY has them as Parameters. The solver of our own, which starts from the solve before, gets
    the same matrices with the entries changed that depend on them.
    """

    def __init__(
        self,
        scene: Scene | Assemblage,
        cone: Cone,
        moments: Moments,
        objective: Objective | None = None,
    ) -> None:
        self.assemblage, self.objective = Assemblage.of(scene), objective
        self.contacts, self.cone, self.moments = scene.contacts, cone, moments
        self.ignore_dpp = 3 * len(self.contacts) > DPP_LIMIT
        self.kept: dict[str, Any] = {}

    def solve(self, pressure: Pressure, settings: SolverSettings) -> LimitState:
        """One run of one solver; never raises for what the solver does."""
        surface = self._surface(pressure)
        entries = self._entries if settings.row.starts_warm else None
        if entries is not None:
            problem, program = entries.at(surface)
            return problem.state(*program.solve(settings, self.kept))
        for name, value in surface.shares.items():
            self.parameters[name].value = value
        return self.problem.solve(settings, ignore_dpp=self.ignore_dpp)

    def surfaces(self, pressure: Pressure) -> tuple[YieldSurface, ...]:
        """Those of the problem, for certificates."""
        return Rocking(), self._surface(pressure)

    @cached_property
    def parameters(self) -> dict[str, cp.Parameter]:
        """Coefficients of the surface, by name."""
        count = len(self.contacts)
        return {name: cp.Parameter(count) for name in self._centred.shares}

    @cached_property
    def problem(self) -> LimitProblem:
        """In CVXPY."""
        surface = self._centred
        surface.shares = {**self.parameters}
        return LimitProblem(self.assemblage, (Rocking(), surface), objective=self.objective)

    @cached_property
    def _entries(self) -> _Entries | None:
        is_known = self.objective is None and isinstance(self.cone, (Conic, Facets))
        return _Entries(self.assemblage, self._centred) if is_known else None

    @property
    def _centred(self) -> TorsionShearBending:
        nothing = np.zeros((len(self.contacts), len(COLUMN)))
        return self._surface(Pressure.of(nothing, self.contacts))

    def _surface(self, pressure: Pressure) -> TorsionShearBending:
        return self.moments.frozen(self.moments.eccentricity(pressure, self.contacts), self.cone)


class _Entries:
    """The frozen problem's matrix as a function of its coefficients, in which it is affine: each
    entry depends on those of one contact, that of its column."""

    def __init__(self, assemblage: Assemblage, surface: TorsionShearBending) -> None:
        self.assemblage, self._kind = assemblage, surface
        rng, count = np.random.default_rng(0), len(assemblage.contacts)
        names = list(surface.shares)
        self.middle = {name: rng.uniform(0.25, 0.5, count) for name in names}  # no entry vanishes
        self.problem, self.program = self._written(self.middle)
        pointer = self.program.matrix.indptr
        columns = np.repeat(np.arange(len(pointer) - 1), np.diff(pointer))
        contact = self.problem.model.contact  # of the first columns; others never change
        self.slopes = {}
        for name in names:
            moved = self._written(self.middle | {name: self.middle[name] + 0.25})[1]
            change = 4.0 * (moved.matrix.data - self.program.matrix.data)
            at = np.flatnonzero(change)
            self.slopes[name] = at, contact[columns[at]], change[at]

    def _written(self, shares: Mapping[str, FloatArray]) -> tuple[DirectProblem, ConeProgram]:
        surface = copy(self._kind)
        surface.shares = {**shares}
        reduction = Reduction.none(self.assemblage.statics, partial(own_unknowns, surface))
        problem = DirectProblem(self.assemblage, (Rocking(), surface), reduction)
        assert problem.program is not None
        return problem, problem.program

    def at(self, surface: TorsionShearBending) -> tuple[DirectProblem, ConeProgram]:
        """The problem with other coefficients."""
        entries = self.program.matrix.data.copy()
        for name, (at, contact, slope) in self.slopes.items():
            value = np.asarray(number_of(surface.shares[name]))
            entries[at] += slope * (value - self.middle[name])[contact]
        matrix = self.program.matrix
        other = sp.csc_array((entries, matrix.indices, matrix.indptr), shape=matrix.shape)
        problem = copy(self.problem)
        problem.model = own_unknowns(surface, self.assemblage.contacts)
        return problem, replace(self.program, matrix=other)


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
        the forces behind the next eccentricities are unique and do not depend on rounding. Its
        effect: docs/evidence/atlas.md.

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
        if moments.has_eq_24 and dead_load_falls(run):
            return Status.DEAD_LOAD_UNSTABLE
        epsilon = self.epsilon * run.scaling.force / len(run.scene.free)
        blended = np.zeros((len(run.contacts), len(COLUMN)))
        loose, exact = min(_N.loose, self.tolerance), 0  # exact iterates in a row
        is_exact = run.ladder is not None or objective is not None
        for number in range(self.max_iterations):
            pressure = Pressure.of(blended, run.contacts, epsilon)
            solver = partial(frozen.solve, pressure)
            is_exact = is_exact or number == self.max_iterations - 1
            ladder = run.ladder or iterate_ladder(None if is_exact else loose, objective is None)
            state, rung = run.try_solvers(solver, ladder)
            exact = exact + 1 if is_exact else 0
            change = run.change(state)
            run.note(state, rung, change=change)
            if state.forces is None:
                claims = state.outcome.claims_no_optimum
                return Status.DIVERGED if claims else Status.SOLVER_FAILED
            run.best = Answer(state.load_factor, run.best.bracket, state.forces, state.mechanism)
            beta = self.old_value_weight if number else 0.0
            blended = beta * blended + (1.0 - beta) * state.forces
            yield
            if self._has_settled(run) and exact > 1:
                return Status.CONVERGED
            is_cycle = cycles(run.load_factors, self.tolerance)
            if is_cycle and exact:
                return Status.CYCLING
            # what was solved loosely may only seem to settle, or to come back
            is_still = change is not None and change <= self.tolerance
            is_exact = is_exact or is_cycle or is_still
        return Status.NOT_CONVERGED

    def _has_settled(self, run: Run) -> bool:
        changes = [iterate.change for iterate in run.history[-2:]]
        if not changes or changes[-1] is None or changes[-1] > self.tolerance:
            return False
        return changes[0] is None or changes[0] <= _N.before * self.tolerance
