"""The convex problem of one safe step: rows inside Eq. 30 (:mod:`majorants`) at every contact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.methods.interaction.majorants import Plane, Point
from cvxlimit.methods.interaction.moments import Moments
from cvxlimit.methods.interaction.rectangles import Rectangles
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings, run

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StepState(LimitState):
    """A step's answer: a :class:`LimitState`, and the total slack it was allowed to buy.

    ``slack`` is zero for hard steps, in units of total load x typical contact size.
    """

    slack: float


class SafeStep:
    """The convex step of one scene, compiled anew at every point.

    Compiling afresh costs a tenth of a solve; with Parameters (nine vectors) DPP would need
    gigabytes, and without DPP CVXPY compiles afresh anyway.

    Parameters
    ----------
    scene : Scene
    moments : Moments
    """

    def __init__(self, scene: Scene, moments: Moments) -> None:
        self.moments = moments
        self.scaling = Scaling.of(scene)
        rectangles = Rectangles.of(scene.contacts, moments.inscribed)
        statics = replace(Statics.of(scene), contacts=rectangles.contacts)
        self.rectangles = rectangles.scaled(1.0 / self.scaling.length)
        self.statics = self.scaling.apply(statics)
        self.model = corner_compressions(self.statics.contacts)
        self.load_factor = cp.Variable(name="alpha")
        self.equilibrium = (
            self.model.equilibrium(self.statics.matrix) + self.load_factor * self.statics.live
            == -self.statics.dead
        )
        self.fields, self.magnitudes = moments.fields(
            self.model.components, self.statics.contacts.friction
        )

    def solve(self, point: Point, settings: SolverSettings, price: float | None) -> StepState:
        """Maximise the load factor, less ``price`` x slack; None: no slack, every answer safe.

        ``point`` is scaled, as :meth:`point` returns it. Never raises for what the solver does.
        """
        slack = None if price is None else cp.Variable(len(self.statics.contacts), nonneg=True)
        objective = self.load_factor - (0.0 if slack is None else price * cp.sum(slack))
        constraints = [self.equilibrium, *self.magnitudes, *self._cones(point, slack)]
        outcome = run(cp.Problem(cp.Maximize(objective), constraints), settings)
        alpha = self.load_factor.value
        if not outcome.has_values or alpha is None:
            return StepState(outcome, None, None, None, np.inf)
        return StepState(
            outcome,
            self.scaling.load_factor(float(alpha)),
            self._forces(),
            self._mechanism(),
            0.0 if slack is None else float(slack.value.sum()),
        )

    def point(self, forces: FloatArray, otherwise: Point, least: float) -> Point:
        """The point of forces (n, 6) in the user's units; see :meth:`Point.of`."""
        inner = self.rectangles.inward(forces / self.scaling.forces(np.ones_like(forces)))
        return Point.of(inner, self.statics.contacts, otherwise, least)

    def _cones(self, point: Point, slack: cp.Variable | None) -> list[cp.Constraint]:
        contacts = self.statics.contacts
        plane = Plane.at(point, self.rectangles, self.moments.balance)
        found = self.moments.rows(self.fields, point, plane, contacts.sides, contacts.friction)
        return [row.cone(self.fields.N, 0.0 if slack is None else slack) for row in found]

    def _forces(self) -> FloatArray:
        return self.scaling.forces(self.rectangles.outward(self.model.values()))

    def _mechanism(self) -> FloatArray | None:
        if self.equilibrium.dual_value is None:
            return None
        rates = np.asarray(self.equilibrium.dual_value).reshape(-1, DOF)
        return self.scaling.mechanism(rates)
