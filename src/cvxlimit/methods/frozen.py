"""Eq. 30 where it is convex: with the eccentricities frozen, in Parameters.

Eq. 30 has the torsion arm c and the eccentricities e1, e2 of the normal force, which depend on the
forces themselves. Fixed at those of a given :class:`~cvxlimit.readings.pressure.Pressure`
they are numbers, and the conditions of a contact are cones (Eq. 32, surfaces/frozen.py). A problem
is stated once; solved at another pressure, only the values of its Parameters change.

- :class:`FrozenProblem` leaves contacts free to be pressed elsewhere, where Eq. 30 may allow less
  or more. Its load factor is no bound; the fixed-point iteration solves one after the other.
- :class:`PressedProblem` demands besides that contacts are pressed where Eq. 30 allows no less. Its
  forces are admissible, so that its load factor is a lower bound, as far as its solver is exact.
"""

from __future__ import annotations

from dataclasses import replace

import cvxpy as cp
import numpy as np

from cvxlimit.extensions.interaction.halves import SymmetricHalf
from cvxlimit.extensions.interaction.states.support import half_extent
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.formulations import ForceModel, corner_compressions, resultants
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LARGEST_FACTOR, Goal
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.pressure import Pressure
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import Rocking
from cvxlimit.surfaces.frozen import Frozen, Pressed


def pressed_resultants(contacts: Contacts) -> ForceModel:
    """The six components of each contact as internal forces, with N >= 0. Rocking need not be
    stated: :class:`~cvxlimit.surfaces.frozen.Pressed` keeps the pressure centre, and with it M1 and
    M2 over N, within the contact."""
    model = resultants(contacts)
    parts = [replace(part, nonneg=part.name == "N") for part in model.parts]
    return replace(model, parts=parts, implied=frozenset({"rocking"}))


class FrozenProblem:
    """The limit problem with eccentricities frozen, which leaves contacts free to be pressed
    elsewhere. With a ``half`` of a symmetric scene it is restricted to that, and so are the
    pressures it takes.

    Attributes
    ----------
    problem : LimitProgram
    contacts : Contacts
        Those of the problem, k of them.
    parameters : dict of str to Parameter
        Coefficients (k,) of the frozen surfaces, by name.
    """

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
        # Any pressure will do here: of its coefficients only the names are used, and Parameters
        # take the places of the numbers, which `set_pressure` gives before every solve.
        zeros = np.zeros(len(self.contacts))
        surfaces = self.frozen_surfaces(Pressure(zeros, zeros, np.array(self.contacts.torsion_arm)))
        self.parameters: dict[str, cp.Parameter] = {}
        for surface in surfaces:
            own = {name: cp.Parameter(len(zeros), name=name) for name in surface.shares}
            surface.shares = {**own}
            self.parameters |= own
        self.problem = LimitProgram(whole, [Rocking(), *surfaces], reduction=reduction, goal=goal)

    def solve(
        self, pressure: Pressure, settings: SolverSettings, has_rows: bool | None = None
    ) -> LimitState:
        """One run of one solver at the pressures (k,); never raises for what the solver does.
        ``has_rows`` is as for :meth:`LimitProgram.run`."""
        self.set_pressure(pressure)
        return self.problem.run(settings, has_rows)

    def set_pressure(self, pressure: Pressure) -> None:
        """Gives the Parameters their values for where contacts (k,) are pressed."""
        for surface in self.frozen_surfaces(pressure):
            for name, value in surface.shares.items():
                self.parameters[name].value = value

    def frozen_surfaces(self, pressure: Pressure) -> tuple[Frozen, ...]:
        """The surfaces beside rocking, with the numbers for a pressure."""
        at = self.moments.eccentricity(pressure, self.contacts)
        return (self.moments.frozen(at, self.cone),)


class PressedProblem(FrozenProblem):
    """The same with contacts pressed at the frozen eccentricities, or nearer to the middle where
    signs are independent: all of its forces are admissible under Eq. 30, if ``cone`` is the true
    one or inside it, and if the arms of its pressures are those of their centres."""

    formulation = staticmethod(pressed_resultants)

    def frozen_surfaces(self, pressure: Pressure) -> tuple[Frozen, ...]:
        """The frozen surface, and where contacts have to be pressed for it to be safe."""
        extent = half_extent(self.contacts)  # of which lengths in disjuncts are fractions
        disjuncts = self.moments.safe_disjuncts(self.contacts, pressure.centre / extent)
        # Tied signs fix the pressure centre itself: without a spread M1 and M2 are no unknowns.
        spread = extent * disjuncts.spread if self.moments.slopes is None else None
        return (*super().frozen_surfaces(pressure), Pressed(extent * disjuncts.centre, spread))
