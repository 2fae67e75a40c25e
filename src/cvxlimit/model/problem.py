"""The static limit problem (Eq. 39) as one vectorised CVXPY problem."""

from __future__ import annotations

from collections.abc import Sequence

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings, limit_ladder, run
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.presets import DEFAULT_SURFACES, needed_surfaces

FloatArray = NDArray[np.float64]


class LimitProblem:
    """max alpha  subject to  A x + f_D + alpha f_L = 0,  x_j in K_j at every contact.

    Duals of equilibrium are the mechanism. Compiled once; surfaces with Parameters may change
    between solves.

    Parameters
    ----------
    scene : Scene
    surfaces : sequence of YieldSurface
        Their intersection is K. Rocking must be one of them; surfaces implied by another are
        not written.
    formulation : callable
        :func:`corner_compressions` (default) or :func:`resultants`.
    scaling : Scaling or None
        Units inside the solver; None is the tested choice, :meth:`Scaling.of`.
    most : float or None
        Upper limit on the load factor, for problems that only ask whether it can be reached.

    Raises
    ------
    ModelError
        Without rocking, or with the same surface twice.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> state = LimitProblem(builtin_scene("single-block")).solve()
    >>> state.outcome.status
    'optimal'
    """

    def __init__(
        self,
        scene: Scene,
        surfaces: Sequence[YieldSurface] = DEFAULT_SURFACES,
        formulation: Formulation = corner_compressions,
        scaling: Scaling | None = None,
        most: float | None = None,
    ) -> None:
        self.surfaces = needed_surfaces(surfaces)
        self.scaling = Scaling.of(scene) if scaling is None else scaling
        self.statics = self.scaling.apply(Statics.of(scene))
        self.forces = formulation(self.statics.contacts)
        self.load_factor = cp.Variable(name="alpha")
        self.equilibrium = (
            self.forces.equilibrium(self.statics.matrix) + self.load_factor * self.statics.live
            == -self.statics.dead
        )
        constraints = [self.equilibrium, *self.forces.constraints]
        for surface in self.surfaces:
            constraints += surface.constraints(self.forces.components, self.statics.contacts)
        if most is not None:
            constraints.append(self.load_factor <= most * self.scaling.live / self.scaling.force)
        self.problem = cp.Problem(cp.Maximize(self.load_factor), constraints)

    def ladder(self, tolerance: float = 1e-5) -> tuple[SolverSettings, ...]:
        """Solvers in the order in which to try them for a bracket within ``tolerance``."""
        blocks = len(self.statics.dead) // DOF
        return limit_ladder(self.problem, len(self.statics.contacts) - blocks, tolerance)

    def solve(self, settings: SolverSettings | None = None, ignore_dpp: bool = False) -> LimitState:
        """One run of one solver, the ladder's first; never raises for what the solver does."""
        outcome = run(self.problem, settings or self.ladder()[0], ignore_dpp)
        alpha = self.load_factor.value
        if not outcome.has_values or alpha is None:
            return LimitState(outcome, None, None, None)
        return LimitState(
            outcome,
            self.scaling.load_factor(float(alpha)),
            self.scaling.forces(self.forces.values()),
            self._mechanism(),
        )

    def _mechanism(self) -> FloatArray | None:
        """Equilibrium duals, scaled to live power 1 (Eq. 37) where they have any."""
        if self.equilibrium.dual_value is None:
            return None
        rates = np.asarray(self.equilibrium.dual_value).reshape(-1, DOF)
        return self.scaling.mechanism(rates)
