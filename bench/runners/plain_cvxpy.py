"""What anyone writes first: the cone of Eq. 24 in eight lines of CVXPY, default solver.

Contacts are read from the scene by the package; equilibrium, rocking and the torsion arm are those
of :mod:`benchmarks`, written apart from it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from benchmarks.baselines import MT, N, program
from benchmarks.stability.truths import arm, rocking

from cvxlimit.io import read_scene
from protocol import answer, dry, factor_or


def solve(file: Path) -> dict[str, Any]:
    """max alpha subject to equilibrium, rocking, and |V| + |MT| / c_T <= mu N."""
    dry(file)
    data = program(read_scene(file))
    contacts, n = data.contacts, len(data.contacts)
    rock = sp.block_diag([rocking(contacts, j) for j in range(n)], format="csr")
    arms = np.array([arm(contacts.corners_of(j)) for j in range(n)])
    x, alpha = cp.Variable((n, 6)), cp.Variable()
    force = cp.vec(x, order="C")
    friction = cp.multiply(contacts.friction, x[:, N])
    twist = cp.multiply(1 / arms, cp.abs(x[:, MT]))
    balance = data.equilibrium @ force + data.dead + alpha * data.live == 0
    limits = [rock @ force <= 0, cp.norm(x[:, :2], axis=1) + twist <= friction]
    problem = cp.Problem(cp.Maximize(alpha), [balance, *limits])
    problem.solve()
    value = (
        None if problem.value is None or not np.isfinite(problem.value) else float(problem.value)
    )
    return factor_or(problem.status, value)


answer(("cvxpy", "clarabel"), solve)
