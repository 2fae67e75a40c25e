"""The interior point for programs whose cones hang together in small blocks, contacts as a rule.

``interior.c`` does all of it but for the order in which many equations are eliminated.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import SolverError
from cvxlimit.solvers.extensions import INTERIOR
from cvxlimit.solvers.sparse import elimination_order

SOLVED, ALMOST, STALLED = "Solved", "AlmostSolved", "InsufficientProgress"
INFEASIBLE, UNBOUNDED = "PrimalInfeasible", "DualInfeasible"
"""How it ended, in Clarabel's words."""

_STATUS = ("", SOLVED, ALMOST, STALLED, INFEASIBLE, UNBOUNDED)
_WAY = 12
"""Points on the way that are kept: one for every power of ten of the gap down to 1e-14."""

FEW = 600
"""Equations up to which an order by neighbourhood, which costs nothing, does as well as a better
one: some hundred masonry blocks."""

Program = tuple[FloatArray, sp.csc_array, FloatArray, tuple[int, int, list[int]]]
"""min c'x with b - A x in {0}^zero x R+^orthant x second-order cones: c, A, b, and the cones'
numbers and sizes."""


@dataclass(frozen=True, eq=False)
class Point:
    """An iterate: x (n,), duals of equations y (p,) and cones z (m,), slacks s (m,)."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    s: FloatArray


@dataclass(frozen=True, eq=False)
class Result:
    """Status; the answer, and points on the way to it, from which others may start, by the power of
    ten of their gaps and residuals."""

    status: str
    point: Point
    objective: float
    iterations: int
    seconds: float
    way: Mapping[int, Point]

    @property
    def middle(self) -> Point | None:
        """The first on the way."""
        return next(iter(self.way.values()), None)


def minimised(
    program: Program,
    tolerance: float,
    max_iter: int = 150,
    residual: float | None = None,
    enough: float = np.inf,
    starts: Sequence[Point] = (),
    order: IntArray | None = None,
) -> Result:
    """The best iterate, when the relative gap is below the tolerance and residuals are below
    theirs, where the dual objective is ``enough``, or where rounding allows no more.

    ``starts`` are points on the way to another answer, nearest to it first; those that are no use,
    of another size or with NaN, are not used. ``order`` is that of :func:`order_of`. Raises
    SolverError if the cone rows do not fall apart into small blocks.
    """
    began = time.perf_counter()
    given = _arrays(program)
    c, right, zero = given[0], given[4], given[5]
    sizes = (len(c), zero, len(right) - zero)
    # an equation without variables that asks for something
    is_empty = np.bincount(given[2], minlength=len(right))[:zero] == 0
    impossible = np.flatnonzero(is_empty & (right[:zero] != 0.0))[:1]
    if len(impossible):
        duals = np.zeros(len(right))
        duals[impossible] = -1.0 / right[impossible]
        point = Point(np.zeros_like(c), duals[:zero], duals[zero:], np.zeros(sizes[2]))
        return Result(INFEASIBLE, point, np.inf, 0, time.perf_counter() - began, {})
    size = sum(sizes) + sizes[2]
    joined = [np.concatenate([at.x, at.y, at.z, at.s]) for at in starts if _fits(at, sizes)]
    first = np.concatenate(joined) if joined else np.zeros(0)
    found, way, powers = np.empty(size), np.empty((_WAY, size)), np.empty(_WAY, dtype=np.int64)
    code, value, count, passed, said = INTERIOR.minimise(
        *given, _NO_ORDER if order is None else order,
        np.array([tolerance, residual or 0.0, enough]), max_iter, first, found, way, powers,
    )  # fmt: skip
    if said:
        raise SolverError(f"blockwise: {said}; use another solver")
    status, point = _STATUS[code], _parted(found, sizes)
    objective = {INFEASIBLE: np.inf, UNBOUNDED: -np.inf}.get(status, value)
    points = zip(powers[:passed].tolist(), way, strict=False)
    passed_by = {power: _parted(v, sizes) for power, v in points}
    return Result(status, point, objective, count, time.perf_counter() - began, passed_by)


_NO_ORDER = np.zeros(0, dtype=np.int64)


def order_of(program: Program) -> IntArray | None:
    """The order of elimination of many equations, for all programs of this pattern; None for few.

    Equations with the same blocks, those of one masonry block, form one node of the graph.
    """
    given = _arrays(program)
    _, A, _, (zero, _, _) = program
    block = np.empty(len(given[0]), dtype=np.int64)
    if zero <= FEW or INTERIOR.blocks(*given, block):
        return None
    owner = np.repeat(block, np.diff(A.indptr))
    real = (A.indices < zero) & (owner >= 0)
    at = A.indices[real], owner[real]
    shape = (zero, int(block.max()) + 1)
    touches = sp.coo_array((np.ones(len(at[0])), at), shape=shape).tocsr()
    touches.data[:] = 1.0
    fingerprint = np.asarray(touches @ np.random.default_rng(0).random(shape[1]))
    _, node = np.unique(fingerprint, return_inverse=True)
    members = sp.csr_array((np.ones(zero), (node, np.arange(zero))))
    node_touches = members @ touches
    rank = np.argsort(elimination_order((node_touches @ node_touches.T).tocsr()))
    return np.argsort(rank[node], kind="stable")


def _arrays(program: Program) -> tuple[Any, ...]:
    """As ``interior.c`` takes them."""
    if INTERIOR is None:
        raise SolverError("blockwise: it needs a C compiler at installation; use another solver")
    c, A, b, (zero, orthant, soc) = program
    indptr, indices = (part.astype(np.int32, copy=False) for part in (A.indptr, A.indices))
    return c, indptr, indices, A.data, b, zero, orthant, np.array(soc, dtype=np.int64)


def _fits(at: Point, sizes: tuple[int, int, int]) -> bool:
    n, p, m = sizes
    return (len(at.x), len(at.y), len(at.z), len(at.s)) == (n, p, m, m)


def _parted(v: FloatArray, sizes: tuple[int, int, int]) -> Point:
    n, p, m = sizes
    return Point(v[:n], v[n : n + p], v[n + p : n + p + m], v[n + p + m :])
