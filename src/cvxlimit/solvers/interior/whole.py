"""The whole iteration compiled (``small.c``), for programs whose calls of NumPy would take longer
than what they compute: nodes of branch and bound.
"""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.solvers.extensions import SMALL
from cvxlimit.solvers.interior.blocks import LIMITS
from cvxlimit.solvers.interior.iteration import (
    ALMOST,
    INFEASIBLE,
    NUMBERS,
    SOLVED,
    STALLED,
    UNBOUNDED,
    Point,
    Result,
)

_STATUS = ("", SOLVED, ALMOST, STALLED, INFEASIBLE, UNBOUNDED)

HANDED_OVER = np.array(
    [
        float(getattr(NUMBERS if hasattr(NUMBERS, name) else LIMITS, name))
        for name in ([] if SMALL is None else SMALL.numbers().split())
    ]
)
"""The numbers of the iteration and of refinement, in the order in which ``small.c`` names them."""

_MOST_EQUATIONS = 600
"""Beyond, sparse factorisation takes less time."""


def small_program(
    c: FloatArray,
    A: sp.csc_array,
    b: FloatArray,
    cones: tuple[int, int, list[int]],
    tolerance: float,
    max_iter: int,
    enough: float = np.inf,
    start: Point | None = None,
) -> Result | None:
    """min c'x with b - A x in {0}^zero x R+^orthant x second-order cones, their numbers and sizes
    in ``cones``; it may end where the dual objective is ``enough``. None if the program does not
    suit, has too many equations, or rounding ended the iteration; what ``max_iter`` iterations have
    not solved, NumPy's would not solve either."""
    zero, orthant, soc = cones
    if SMALL is None or zero > _MOST_EQUATIONS:
        return None
    began = time.perf_counter()
    n, m = len(c), len(b) - zero
    own = np.zeros(n + zero + 2 * m) if start is None else _joined(start)
    starts = int(start is not None and len(own) == n + zero + 2 * m)
    point, middle = (own, np.empty_like(own)) if starts else np.zeros((2, n + zero + 2 * m))
    indptr, indices = (part.astype(np.int32, copy=False) for part in (A.indptr, A.indices))
    given = c, indptr, indices, A.data, b, zero, orthant, np.array(soc, dtype=np.int64)
    code, count = SMALL.minimise(
        *given, tolerance, max_iter, enough, starts, point, middle, HANDED_OVER
    )
    status = _STATUS[code]
    if starts and status in ("", ALMOST, STALLED):
        return small_program(c, A, b, cones, tolerance, max_iter, enough)
    if status == "" or (status == STALLED and count < max_iter):
        return None
    ends = np.cumsum([n, zero, m])
    found, halfway = (Point(*np.split(v, ends)) for v in (point, middle))
    objective = {INFEASIBLE: np.inf, UNBOUNDED: -np.inf}.get(status, float(c @ found.x))
    return Result(status, found, objective, count, time.perf_counter() - began, {-2: halfway})


def _joined(at: Point) -> FloatArray:
    return np.concatenate([at.x, at.y, at.z, at.s])
