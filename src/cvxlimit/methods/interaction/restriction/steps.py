"""The convex step of one scene, written straight as matrices.

CVXPY takes as long to compile a step of a small scene as solvers take for it, and every step has
other coefficients: Parameters for them, nine vectors, would need gigabytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.model.assemblage import Assemblage, Equilibrium
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.statics import DOF
from cvxlimit.readings.halves import Half
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.settings import SUPPORT
from cvxlimit.readings.states.majorants import Forces, Point, StepRows
from cvxlimit.readings.states.rectangles import Rectangles
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.solvers.program import ConeProgram


@dataclass(frozen=True, eq=False)
class StepState(LimitState):
    """A step's answer, with the total slack that it bought, over total load x contact size."""

    slack: float = 0.0


class SafeStep:
    """With a ``half`` of a symmetric scene steps are restricted to that; answers are those of the
    whole. Solvers that start from the step before find that in a cache."""

    def __init__(
        self, scene: Scene | Assemblage, moments: Moments, half: Half | None = None
    ) -> None:
        whole = Assemblage.of(scene)
        self.moments, self.scaling = moments, whole.scaling
        largest, slopes = moments.largest_arm(whole.contacts), moments.slopes
        rectangles = Rectangles.of(whole.contacts, moments.inscribed, largest)
        self.rectangles = rectangles.scaled(1.0 / self.scaling.length)
        statics = replace(whole.statics, contacts=rectangles.contacts)
        self.assemblage = replace(whole, statics=statics)
        self.statics, self.half = self.assemblage.scaled, half
        self.kept = np.arange(len(whole.contacts)) if half is None else half.kept
        self.own = self.rectangles.take(self.kept)
        self.model = corner_compressions(self.own.contacts)
        is_tied = slopes is not None and bool((slopes[:, 0] == slopes[:, 1]).all())
        self._magnitudes = 6 if slopes is None else 3 if is_tied else 5  # m, u, s, t of Forces
        self._cache: dict[str, Any] = {}

    def solve(
        self,
        point: Point,
        settings: SolverSettings,
        price: float | None = None,
        curvature: float = 1.0,
        most: float | None = None,
    ) -> StepState:
        """The load factor, at most ``most``, less ``price`` x slack; None: no slack. Then, with all
        of the rows' ``curvature``, every answer is safe; with a share of it steps are longer."""
        program = self.program(point, price, curvature, most)
        outcome, x, y = program.solve(settings, self._cache)
        if x is None or y is None:
            return StepState(outcome, None, None, None, slack=np.inf)
        forces = np.asarray(self._per_internal @ x[: self._per_internal.shape[1]])
        return StepState(
            outcome,
            self.scaling.load_factor(float(x[-1])),
            self.scaling.forces(self.rectangles.outward(forces.reshape(-1, DOF))),
            self.equilibrium.mechanism(y),
            slack=0.0 if price is None else float(x[-1 - len(self.kept) : -1].sum()),
        )

    def point(self, forces: FloatArray, otherwise: Point, least: float) -> Point:
        inner = self.rectangles.inward(forces / self.scaling.forces(np.ones_like(forces)))
        return Point.of(inner, self.statics.contacts, otherwise, least)

    def program(
        self,
        point: Point,
        price: float | None = None,
        curvature: float = 1.0,
        most: float | None = None,
    ) -> ConeProgram:
        """Unknown are internal forces, magnitudes, slack if it has a price, and the load factor."""
        equilibrium, count = self.equilibrium, len(self.kept)
        dead, live = (equilibrium.of_load(load) for load in (self.statics.dead, self.statics.live))
        meaning = self._fields(price is not None)
        linear, cones = self._bounds(point, price is not None, curvature)
        blocks = [[form] for form in linear] + cones
        local = sp.vstack([_local(block) for block in blocks], format="csr") @ meaning
        width, internal = meaning.shape[1] + 1, equilibrium.matrix.shape[1]
        signs = sp.eye_array(internal, width, format="csr")[self.model.nonneg]
        factor = sp.csr_array(([-1.0], ([0], [width - 1])), (1, width))[: most is not None]
        nothing = sp.csr_array((len(live), width - 1 - internal))
        parts = [
            sp.hstack([equilibrium.matrix, nothing, sp.csr_array(live[:, None])]),
            -factor,
            -signs,
            sp.hstack([-local, sp.csr_array((local.shape[0], 1))]),
        ]
        matrix = sp.vstack(parts, format="csc")
        right = np.zeros(matrix.shape[0])
        right[: len(dead)] = -dead
        if most is not None:
            right[len(dead)] = most / self.scaling.load_factor(1.0)
        cost = np.zeros(width)
        cost[-1] = -1.0
        if price is not None:
            cost[-1 - count : -1] = price
        nonneg = factor.shape[0] + signs.shape[0] + count * len(linear)
        sizes = tuple(len(cone) for cone in cones for _ in range(count))
        return ConeProgram(cost, matrix, right, len(live), nonneg, sizes)

    def _bounds(
        self, point: Point, has_slack: bool, curvature: float
    ) -> tuple[list[FloatArray], list[list[FloatArray]]]:
        """Forms (fields, contacts) that are not negative, and second-order cones, bound first: of
        the magnitudes, and of Eq. 30 at ``point``."""
        size = DOF + self._magnitudes + has_slack
        unit = np.eye(size)[:, :, None] * np.ones(len(self.kept))
        slack = unit[-1] if has_slack else 0.0 * unit[-1]
        f = self._forces(unit)
        linear = [slack] if has_slack else []
        linear.append(self.own.contacts.friction * f.N - f.u)
        sizes = [*zip(f.X, f.m, strict=True), *zip(f.V[: len(f.s)], f.s, strict=True)]
        sizes += [] if f.t is None else [(f.MT, f.t)]
        linear += [bound - sign * value for value, bound in sizes for sign in (1.0, -1.0)]
        cones = [[f.u, *f.V]]
        moments, here = self.moments, Point(point.centre[self.kept], point.shear[self.kept])
        slopes, is_limited = moments.slopes, moments.is_limited
        for row in StepRows(f, here, self.own, slopes, is_limited, moments.balance).rows():
            if row.squares:
                longer = row if curvature == 1.0 else row.lengthened(f.N, curvature)
                cones.append(longer.cone(f.N, slack, self._arm))
            else:
                linear.append(slack - row.linear)
        return linear, cones

    def _forces(self, unit: FloatArray) -> Forces:
        v1, v2, normal, m1, m2, mt, *sizes = unit[: DOF + self._magnitudes]
        t = sizes[5] if len(sizes) == 6 else None
        return Forces(normal, (v1, v2), (-m2, m1), mt, sizes[:2], sizes[2], sizes[3:5], t)

    @cached_property
    def _arm(self) -> FloatArray:
        """Of the torque that contacts resist, per compression."""
        contacts = self.own.contacts
        arm = np.maximum(contacts.friction, SUPPORT.friction) * contacts.torsion_arm
        return np.where(arm > 0.0, arm, 1.0)

    def _fields(self, has_slack: bool) -> sp.csr_array:
        """Contact forces, component by component, then magnitudes and slack (fields x contacts)."""
        count = len(self.kept)
        order = DOF * np.arange(count) + np.arange(DOF)[:, None]
        others = sp.eye_array((self._magnitudes + has_slack) * count)
        forces = self.model.meaning[order.ravel()]
        return sp.csr_array(sp.block_diag([forces, others], format="csr"))

    @cached_property
    def _per_internal(self) -> sp.csr_array:
        """Forces (6 n, p) of all contacts, scaled, per internal force."""
        meaning = self.model.meaning
        return meaning if self.half is None else (self.half.forces @ meaning).tocsr()

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """Scaled, of the internal forces."""
        statics, rates = self.statics, None if self.half is None else self.half.rates
        loads = np.stack([statics.dead.ravel(), statics.live.ravel()])
        matrix = (statics.matrix @ self._per_internal).tocsr()
        return Equilibrium.of(matrix, loads, self.scaling, rates)


def _local(forms: Sequence[FloatArray]) -> sp.csr_array:
    """Rows (forms x contacts) of forms (fields, contacts), those of one contact together."""
    stack = np.stack(forms, axis=1)
    fields, size, count = stack.shape
    field, form, contact = np.nonzero(stack)
    at = size * contact + form, count * field + contact
    return sp.csr_array((stack[field, form, contact], at), (size * count, fields * count))
