"""The kinematic problem (Eq. 40), from the geometry and the flow rule alone.

Nothing here uses the static problem: velocities of the two bodies at a contact's corners and
centre give its rates, the flow rule restricts them, and the dead load's power is minimised.
"""

from __future__ import annotations

from collections.abc import Sequence

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.model.sinks import Constraints
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.proof.flow import FlowRule
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings, default_ladder, run
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES, needed_surfaces

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class KinematicProblem:
    """min -f_D u  subject to  f_L u = 1  and the associated flow rule at every contact.

    Parameters
    ----------
    scene : Scene
    surfaces : sequence of YieldSurface
        As for :class:`~cvxlimit.model.program.LimitProgram`.
    """

    def __init__(self, scene: Scene, surfaces: Sequence[YieldSurface] = DEFAULT_SURFACES) -> None:
        self.scaling = Scaling.of(scene)
        statics = self.scaling.apply(Statics.of(scene))
        self.rates = cp.Variable(len(statics.dead), name="u")
        rates, openings = _relative_velocities(statics, self.rates)
        # Twists in radians and constants as forces: both in the user's units.
        scaled = {"n": openings, **rates, "MT": rates["MT"] / self.scaling.length}
        rule = FlowRule(needed_surfaces(surfaces), scene.contacts)
        each = cp.hstack([scaled[part.name] for part in rule.model.parts])
        flow = rule.stated(into := Constraints(), each)
        constraints = [statics.live @ self.rates == 1.0, *into.all]
        lost = flow.dissipation / self.scaling.force
        self.problem = cp.Problem(cp.Minimize(lost - statics.dead @ self.rates), constraints)

    def solve(self, settings: SolverSettings | None = None) -> LimitState:
        """One run of one solver; the state has a mechanism and no forces."""
        outcome = run(self.problem, settings or default_ladder()[0])
        if not outcome.has_values or self.rates.value is None:
            return LimitState(outcome, None, None, None)
        mechanism = np.asarray(self.rates.value).reshape(-1, DOF)
        factor = self.scaling.load_factor(float(self.problem.value))
        return LimitState(outcome, factor, None, self.scaling.mechanism(mechanism))


def _relative_velocities(
    statics: Statics, rates: cp.Variable
) -> tuple[dict[str, cp.Expression], cp.Expression]:
    """Slip and twist at contact centres, opening at corners, of block b relative to block a."""
    contacts = statics.contacts
    t1, t2, normal = (contacts.axes[:, i] for i in range(3))
    every = np.arange(len(contacts))
    j = contacts.corner_contact

    def velocity(contact: IntArray, points: FloatArray, direction: FloatArray) -> cp.Expression:
        matrix = _velocity_matrix(statics, contact, points, direction)
        return matrix @ rates

    rates_by_component = {
        "V1": velocity(every, contacts.origin, t1),
        "V2": velocity(every, contacts.origin, t2),
        "N": velocity(every, contacts.origin, normal),
        "MT": _spin_matrix(statics, normal) @ rates,
    }
    return rates_by_component, velocity(j, contacts.corner_points, normal[j])


def _velocity_matrix(
    statics: Statics, contact: IntArray, points: FloatArray, direction: FloatArray
) -> sp.csr_array:
    """Row k: velocity of block b minus block a of contact[k] at points[k], along direction[k]."""
    contacts = statics.contacts
    parts = []
    for block, sign in ((contacts.b[contact], 1.0), (contacts.a[contact], -1.0)):
        arm = points - statics.centroids[block]
        values = sign * np.hstack([direction, np.cross(arm, direction)])
        parts.append((block, values))
    return _rows(statics, parts)


def _spin_matrix(statics: Statics, direction: FloatArray) -> sp.csr_array:
    """Row j: rotation rate of block b minus block a of contact j about direction[j]."""
    contacts = statics.contacts
    still = np.zeros_like(direction)
    return _rows(
        statics,
        [
            (contacts.b, np.hstack([still, direction])),
            (contacts.a, np.hstack([still, -direction])),
        ],
    )


def _rows(statics: Statics, parts: list[tuple[IntArray, FloatArray]]) -> sp.csr_array:
    rows, columns, values = [], [], []
    for block, entries in parts:
        number = statics.row_of_block[block]
        free = np.flatnonzero(number >= 0)
        rows.append(np.repeat(free, DOF))
        columns.append((DOF * number[free][:, None] + np.arange(DOF)).ravel())
        values.append(entries[free].ravel())
    shape = (len(parts[0][0]), len(statics.dead))
    matrix = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sp.csr_array(matrix, shape=shape)
