"""The mechanism that only slides: the least load factor at which blocks move without turning.

    min  -f_dead . d + sum c_i |s_i| + sum F_i o_i
    s.t. n_i . d + o_i >= mu_i |s_i|,    f_live . d = 1

over translations d of the blocks, where n_i . d opens a point, s_i = (t1_i . d, t2_i . d) is its
slip, c_i its cohesion, and what gives way at a largest force F_i is overrun by o_i >= 0. Blocks
that also turn may move at less. A check that divides load factors by the share of mass that takes
part, as that of the Italian commentary, may be decided by it all the same: all of what slides takes
part.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.paths.increment import FINE, Increment
from cvxlimit.model.sinks import Rows
from cvxlimit.model.statics import DOF
from cvxlimit.solvers import ladder_for


def sliding(given: Increment, bodies: Sequence[Sequence[int]]) -> tuple[float, FloatArray] | None:
    """Returns the least load factor of a mechanism that only slides, and its rates (free blocks,
    6); None where no such mechanism exists or no solver finds it. The free blocks of each of
    ``bodies``, by number, move as one."""
    points, statics, scaling = given.points, given.assemblage.statics, given.assemblage.scaling
    scaled, k = scaling.apply(statics), len(points)
    count = len(scaled.dead) // DOF
    shifts = (DOF * np.arange(count)[:, None] + np.arange(3)).ravel()
    body = np.arange(count)
    for own in bodies:
        body[own] = own[0]
    moved = sp.csr_array(
        sp.kron(sp.eye_array(count).tocsr()[body], sp.eye_array(3))
    )  # with its body
    rates = scaled.matrix.T.tocsr()[:, shifts] @ moved
    dead, live = (load[shifts] @ moved for load in (scaled.dead, scaled.live))
    normal, *along = (rates[DOF * np.arange(k) + column] for column in (2, 0, 1))
    yields = np.isfinite(points.most)
    bears = (points.most - points.least)[yields] / scaling.force
    overrun = sp.csr_array(sp.eye_array(k))[:, yields]
    into = Rows()
    d, over = into.new(len(shifts)), into.new(int(yields.sum()), nonneg=True)
    slip = into.new(k)
    into.cone(slip, [each @ d for each in along])
    into.nonneg(normal @ d + overrun @ over - points.friction * slip)
    into.zero(live[None] @ d - 1.0)
    cost = points.cohesion / scaling.force
    goal = dead[None] @ d - cost[None] @ slip - bears[None] @ over
    program = into.written(goal).program
    for settings in ladder_for("paths", FINE):
        outcome, x, _ = program.solve(settings)
        if outcome.claims_no_optimum:
            return None
        if x is not None:
            found = np.zeros((count, DOF))
            found[:, :3] = np.asarray(moved @ x[: len(shifts)]).reshape(-1, 3)
            return scaling.load_factor(-float(goal.values(x)[0])), found
    return None
