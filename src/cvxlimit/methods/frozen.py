"""Eq. 30 where it is convex: with the eccentricities frozen, in Parameters.

Eq. 30 has the torsion arm c and the eccentricities e1, e2 of the normal force, which depend on the
forces themselves. Fixed at those of a given :class:`~cvxlimit.readings.pressure.Pressure`
they are numbers, and the conditions of a contact are cones (Eq. 32, surfaces/frozen.py). A problem
is stated once; solved at another pressure, only the values of its Parameters change.

It leaves contacts free to be pressed elsewhere, where Eq. 30 may allow less or more. Its load
factor is no bound; the fixed-point iteration solves one after the other.
"""

from __future__ import annotations

from collections.abc import Callable

import cvxpy as cp
import numpy as np

from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LARGEST_FACTOR, Goal
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.pressure import Pressure
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import Rocking
from cvxlimit.surfaces.frozen import Frozen


class FrozenProblem:
    """The limit problem with eccentricities frozen, which leaves contacts free to be pressed
    elsewhere. It may be ``restricted`` to a part of the scene, and so are the pressures it takes.

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
        restricted: Callable[[Reduction], Reduction] | None = None,
    ) -> None:
        self.cone, self.moments = cone, moments
        whole = Assemblage.of(scene)
        reduction = Reduction.none(whole.statics, self.formulation)
        if restricted is not None:
            reduction = restricted(reduction)
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
