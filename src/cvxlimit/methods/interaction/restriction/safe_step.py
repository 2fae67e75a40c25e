"""The convex problem of one safe step: rows inside Eq. 30 (:mod:`majorants`) at every contact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cvxpy as cp
import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.methods.interaction.readings.halves import Half
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.states.majorants import Plane, Point, StepRows, force_fields
from cvxlimit.methods.interaction.states.rectangles import Rectangles
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import ForceVariables, corner_compressions
from cvxlimit.model.problem import LargestFactor, StaticProblem
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings


@dataclass(frozen=True, eq=False)
class StepState(LimitState):
    """A step's answer: a :class:`LimitState`, and the total slack it was allowed to buy.

    ``slack`` is zero for hard steps, in units of total load x typical contact size.
    """

    slack: float = 0.0


class SafeStep:
    """The convex step of one scene, compiled anew at every point.

    Compiling afresh costs a tenth of a solve; with Parameters (nine vectors) DPP would need
    gigabytes, and without DPP CVXPY compiles afresh anyway.

    Parameters
    ----------
    scene : Scene or Assemblage
    moments : Moments
    half : Half or None
        The half of a symmetric scene to which steps are restricted; answers are those of the
        whole.
    """

    def __init__(
        self, scene: Scene | Assemblage, moments: Moments, half: Half | None = None
    ) -> None:
        whole = Assemblage.of(scene)
        self.moments, self.scaling = moments, whole.scaling
        rectangles = Rectangles.of(
            whole.contacts, moments.inscribed, moments.largest_arm(whole.contacts)
        )
        self.rectangles = rectangles.scaled(1.0 / self.scaling.length)
        self.assemblage = replace(
            whole, statics=replace(whole.statics, contacts=rectangles.contacts)
        )
        self.statics = self.assemblage.scaled
        self.half = half
        self.kept = np.arange(len(self.statics.contacts)) if self.half is None else self.half.kept
        self.own = self.rectangles.take(self.kept)
        contacts = self.own.contacts
        model = ForceVariables.of(corner_compressions(contacts), 1.0, 1.0)
        slopes = moments.slopes
        has_sizes = slopes is None or bool((slopes[:, 0] != slopes[:, 1]).any())
        self.fields, self.magnitudes = force_fields(model.components, contacts.friction, has_sizes)
        self.model = model if self.half is None else self.half.lifted(model)

    def solve(
        self,
        point: Point,
        settings: SolverSettings,
        price: float | None = None,
        curvature: float = 1.0,
        most: float | None = None,
    ) -> StepState:
        """Maximise the load factor, less ``price`` x slack; None: no slack.

        Without slack and with all of the rows' ``curvature`` every answer is safe; with a share of
        it steps are longer (:meth:`Row.lengthened`). ``point`` is scaled, as :meth:`point` returns
        it; ``most`` is the largest load factor asked for. Never raises for what the solver does.
        """
        slack = None if price is None else cp.Variable(len(self.kept), nonneg=True)
        limits = [*self.magnitudes, *self._cones(point, slack, curvature)]
        bought = None if slack is None else price * cp.sum(slack)
        problem = StaticProblem(
            self.assemblage,
            self.model,
            limits,
            LargestFactor(cost=bought, most=most),
            None if self.half is None else self.half.rates,
        )
        state = problem.solve(settings)
        if state.forces is None:
            return StepState(state.outcome, None, None, None, slack=np.inf)
        return StepState(
            state.outcome,
            state.load_factor,
            self.scaling.forces(self.rectangles.outward(self.model.values())),
            state.mechanism,
            slack=0.0 if slack is None else float(slack.value.sum()),
        )

    def point(self, forces: FloatArray, otherwise: Point, least: float) -> Point:
        """The point of forces (n, 6) in the user's units; see :meth:`Point.of`."""
        inner = self.rectangles.inward(forces / self.scaling.forces(np.ones_like(forces)))
        return Point.of(inner, self.statics.contacts, otherwise, least)

    def _cones(
        self, point: Point, slack: cp.Variable | None, curvature: float
    ) -> list[cp.Constraint]:
        contacts, normal, point = self.own.contacts, self.fields.N, point.take(self.kept)
        plane = Plane.at(point, self.own, self.moments.balance)
        found = StepRows(
            self.fields, point, plane, contacts.sides, contacts.friction,
            self.moments.slopes, self.moments.is_limited,
        ).rows()  # fmt: skip
        if curvature < 1.0:
            found = [row.lengthened(normal, curvature) for row in found]
        return [row.cone(normal, 0.0 if slack is None else slack) for row in found]
