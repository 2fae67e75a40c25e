"""Eq. 30 where it is convex: with the eccentricities frozen, in Parameters."""

from __future__ import annotations

from dataclasses import replace

import cvxpy as cp
import numpy as np

from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.formulations import ForceModel, corner_compressions, resultants
from cvxlimit.model.problem import LimitProblem
from cvxlimit.model.statement import LARGEST_FACTOR, Goal
from cvxlimit.readings.halves import SymmetricHalf
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.states.pressure import Pressure
from cvxlimit.readings.states.support import half_extent
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import Rocking
from cvxlimit.surfaces.frozen import Frozen, Pressed


def pressed_resultants(contacts: Contacts) -> ForceModel:
    """The six components, for surfaces that say where contacts are pressed."""
    model = resultants(contacts)
    parts = [replace(part, nonneg=part.name == "N") for part in model.parts]
    return replace(model, parts=parts, implied=frozenset({"rocking"}))


class FrozenProblem:
    """The limit problem with eccentricities frozen in Parameters, solved again as they change:
    ``problem`` is that problem, its ``parameters`` the coefficients of its surfaces by name."""

    formulation = staticmethod(corner_compressions)

    def __init__(
        self,
        scene: Scene | Assemblage,
        cone: Cone,
        moments: Moments,
        goal: Goal = LARGEST_FACTOR,
        half: SymmetricHalf | None = None,
    ) -> None:
        self.cone, self.moments = cone, moments
        whole = Assemblage.of(scene)
        reduction = Reduction.none(whole.statics, self.formulation)
        if half is not None:
            reduction = half.reduction(reduction)
        self.contacts = reduction.contacts
        none = np.zeros(len(self.contacts))
        surfaces = self.surfaces(Pressure(none, none, np.asarray(self.contacts.torsion_arm)))
        self.parameters: dict[str, cp.Parameter] = {}
        for surface in surfaces[1:]:
            own = {name: cp.Parameter(len(none), name=name) for name in surface.shares}
            surface.shares = {**own}
            self.parameters |= own
        self.problem = LimitProblem(whole, surfaces, reduction=reduction, goal=goal)

    def solve(
        self, pressure: Pressure, settings: SolverSettings, has_rows: bool | None = None
    ) -> LimitState:
        """One run of one solver; never raises for what the solver does."""
        self.set(pressure)
        return self.problem.run(settings, has_rows)

    def set(self, pressure: Pressure) -> None:
        """Give the Parameters the values for where contacts (k,) of the problem are pressed."""
        for surface in self.surfaces(pressure)[1:]:
            for name, value in surface.shares.items():
                self.parameters[name].value = value

    def surfaces(self, pressure: Pressure) -> tuple[Rocking, *tuple[Frozen, ...]]:
        """Those of the problem, for certificates."""
        at = self.moments.eccentricity(pressure, self.contacts)
        return Rocking(), self.moments.frozen(at, self.cone)


class PressedProblem(FrozenProblem):
    """The same where contacts are pressed, and not merely as strong as if they were: under Eq. 30,
    all of its forces are admissible. With a ``half`` of a symmetric scene it is restricted to that,
    as are the pressures it takes."""

    formulation = staticmethod(pressed_resultants)

    def surfaces(self, pressure: Pressure) -> tuple[Rocking, *tuple[Frozen, ...]]:
        """Those of the problem."""
        extent = half_extent(self.contacts)
        disjuncts = self.moments.safe_disjuncts(self.contacts, pressure.centre / extent)
        spread = extent * disjuncts.spread if self.moments.slopes is None else None
        return (*super().surfaces(pressure), Pressed(extent * disjuncts.centre, spread))
