"""Whether blocks can hold each other without any load, and if not, rates that open every contact.

The two exclude each other (a theorem of the alternative): by virtual power, contact forces that
balance themselves do no work on any rates, but positive work where every contact opens.
"""

from __future__ import annotations

from collections.abc import Sequence

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings, limit_ladder, run
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.presets import DEFAULT_SURFACES, needed_surfaces

FloatArray = NDArray[np.float64]


class SelfStressProblem:
    """max sum N  subject to  A x = 0,  x_j in K_j,  N_j <= 1 at every contact.

    The value is 0 if there is no self-stress; the duals of equilibrium then open every contact by
    at least 1 more than the flow rule asks for. Where it is positive, duals mean nothing.

    Parameters
    ----------
    scene : Scene
    surfaces : sequence of YieldSurface
        As for :class:`~cvxlimit.model.problem.LimitProblem`.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> state = SelfStressProblem(builtin_scene("tuff-wall")).solve()
    >>> bool(abs(state.load_factor) < 1e-6), state.mechanism.shape
    (True, (54, 6))
    """

    def __init__(self, scene: Scene, surfaces: Sequence[YieldSurface] = DEFAULT_SURFACES) -> None:
        self.scaling = Scaling.of(scene)
        statics = self.scaling.apply(Statics.of(scene))
        contacts = statics.contacts
        forces = corner_compressions(contacts)
        pressure = forces.components["N"]
        self.equilibrium = forces.equilibrium(statics.matrix) == np.zeros(len(statics.dead))
        constraints = [self.equilibrium, *forces.constraints, pressure <= 1.0]
        for surface in needed_surfaces(surfaces):
            constraints += surface.constraints(forces.components, contacts)
        self.problem = cp.Problem(cp.Maximize(cp.sum(pressure)), constraints)
        self.loops = len(contacts) - len(statics.dead) // DOF

    def ladder(self) -> tuple[SolverSettings, ...]:
        """Solvers in the order in which to try them on this problem."""
        return limit_ladder(self.problem, self.loops)

    def solve(self, settings: SolverSettings | None = None) -> LimitState:
        """One run of one solver: the value as load factor, block rates (free, 6), no forces."""
        outcome = run(self.problem, settings or self.ladder()[0])
        if not outcome.has_values or self.equilibrium.dual_value is None:
            return LimitState(outcome, None, None, None)
        rates = np.asarray(self.equilibrium.dual_value).reshape(-1, DOF)
        lengths = np.array([1.0, 1.0, 1.0] + [self.scaling.length] * 3)
        return LimitState(outcome, float(self.problem.value), None, rates / lengths)
