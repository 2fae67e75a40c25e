"""The package's interior-point method, for programs whose columns fall apart into small blocks.

Two columns belong to one block if a cone or inequality has both, so that a block is a contact as a
rule. The method eliminates the blocks and factorises the remaining equations. ``interior.c`` does
all of it; here are its call and the order in which many equations are eliminated.
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
from cvxlimit.solvers.compiled import loaded
from cvxlimit.solvers.matrices import Point
from cvxlimit.solvers.sparse import elimination_order

INTERIOR: Any = loaded("cvxlimit.extensions.blockcone._interior")
"""``interior.c``; where it is None other solvers are used."""

SOLVED, ALMOST, STALLED = "Solved", "AlmostSolved", "InsufficientProgress"
INFEASIBLE, UNBOUNDED = "PrimalInfeasible", "DualInfeasible"
"""How a solve ended, in Clarabel's words."""

_STATUS = ("", SOLVED, ALMOST, STALLED, INFEASIBLE, UNBOUNDED)
_WAY = 12
"""Most points on the way that are kept: one for every power of ten of the gap down to 1e-14."""

FEW = 600
"""Equations up to which an order by neighbourhood, which costs nothing, does as well as a better
one: some hundred masonry blocks."""

Program = tuple[FloatArray, sp.csc_array, FloatArray, tuple[int, int, list[int]]]
"""The parts c, A, b and (zero, orthant, soc) of: min c'x subject to A x + s = b, where s is zero in
the first ``zero`` rows, not negative in the next ``orthant`` rows, and in second-order cones of the
sizes ``soc`` in the rest."""


@dataclass(frozen=True, eq=False)
class Result:
    """How a solve ended, with its answer.

    Attributes
    ----------
    status : str
        One of the five above.
    point : Point
        The answer, or the certificate that there is none.
    objective : float
        c'x, infinite where there is no answer.
    iterations, seconds : int, float
        What it took.
    way : mapping from int to Point
        Points on the way, from which other problems may start, by the power of ten of their gaps
        and residuals.
    """

    status: str
    point: Point
    objective: float
    iterations: int
    seconds: float
    way: Mapping[int, Point]

    @property
    def middle(self) -> Point | None:
        """The first point on the way, or None."""
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
    """Minimises a program and returns the best iterate.

    It stops when the relative gap is below the tolerance and residuals are below theirs, when the
    dual objective reaches ``enough``, or when rounding allows no more.

    ``starts`` are points on the way to another answer, nearest to it first. Those of another size
    or with NaN are not used. ``order`` is that of :func:`order_of`. Raises SolverError if the cone
    rows do not fall apart into small blocks.
    """
    began = time.perf_counter()
    arrays = _arrays(program)
    c, right, zero = arrays[0], arrays[4], arrays[5]
    sizes = (len(c), zero, len(right) - zero)
    # An equation without unknowns whose right-hand side is not zero cannot be satisfied.
    is_empty = np.bincount(arrays[2], minlength=len(right))[:zero] == 0
    impossible = np.flatnonzero(is_empty & (right[:zero] != 0.0))[:1]
    if len(impossible):
        duals = np.zeros(len(right))
        duals[impossible] = -1.0 / right[impossible]
        point = Point(np.zeros_like(c), duals[:zero], duals[zero:], np.zeros(sizes[2]))
        return Result(INFEASIBLE, point, np.inf, 0, time.perf_counter() - began, {})
    # Points go to C and come back as one row x, y, z, s each.
    size = sum(sizes) + sizes[2]
    joined = [np.concatenate([at.x, at.y, at.z, at.s]) for at in starts if _fits(at, sizes)]
    first = np.concatenate(joined) if joined else np.zeros(0)
    answer, way, powers = np.empty(size), np.empty((_WAY, size)), np.empty(_WAY, dtype=np.int64)
    code, value, count, passed, refusal = INTERIOR.minimise(
        *arrays, _NO_ORDER if order is None else order,
        np.array([tolerance, residual or 0.0, enough]), max_iter, first, answer, way, powers,
    )  # fmt: skip
    if refusal:
        raise SolverError(f"blockwise: {refusal}; use another solver")
    status, point = _STATUS[code], _parted(answer, sizes)
    objective = {INFEASIBLE: np.inf, UNBOUNDED: -np.inf}.get(status, value)
    points = zip(powers[:passed].tolist(), way, strict=False)
    passed_by = {power: _parted(v, sizes) for power, v in points}
    return Result(status, point, objective, count, time.perf_counter() - began, passed_by)


_NO_ORDER = np.zeros(0, dtype=np.int64)


def order_of(program: Program) -> IntArray | None:
    """Returns the order (zero,) in which to eliminate the equations of all programs of this
    pattern; None where they are few.

    The order is one of a graph: equations that touch the same blocks of columns, which are those of
    one masonry block, form one node, and nodes that touch a common block are linked.
    """
    arrays = _arrays(program)
    _, A, _, (zero, _, _) = program
    block = np.empty(len(arrays[0]), dtype=np.int64)
    if zero <= FEW or INTERIOR.blocks(*arrays, block):
        return None
    # Which equations touch which blocks: a matrix of ones (zero, blocks).
    owner = np.repeat(block, np.diff(A.indptr))
    real = (A.indices < zero) & (owner >= 0)
    at = A.indices[real], owner[real]
    shape = (zero, int(block.max()) + 1)
    touches = sp.coo_array((np.ones(len(at[0])), at), shape=shape).tocsr()
    touches.data[:] = 1.0
    # Equations that touch the same blocks have the same sum of random numbers of these blocks.
    fingerprint = np.asarray(touches @ np.random.default_rng(0).random(shape[1]))
    _, node = np.unique(fingerprint, return_inverse=True)
    members = sp.csr_array((np.ones(zero), (node, np.arange(zero))))
    node_touches = members @ touches
    # The order of nodes, and in it that of their equations.
    rank = np.argsort(elimination_order((node_touches @ node_touches.T).tocsr()))
    return np.argsort(rank[node], kind="stable")


def _arrays(program: Program) -> tuple[Any, ...]:
    """Returns the parts of a program as ``interior.c`` takes them."""
    if INTERIOR is None:
        raise SolverError("blockwise: it needs a C compiler at installation; use another solver")
    c, A, b, (zero, orthant, soc) = program
    indptr, indices = (part.astype(np.int32, copy=False) for part in (A.indptr, A.indices))
    return c, indptr, indices, A.data, b, zero, orthant, np.array(soc, dtype=np.int64)


def _fits(at: Point, sizes: tuple[int, int, int]) -> bool:
    """Returns True if a point has the sizes n, p and m of a program."""
    n, p, m = sizes
    return (len(at.x), len(at.y), len(at.z), len(at.s)) == (n, p, m, m)


def _parted(v: FloatArray, sizes: tuple[int, int, int]) -> Point:
    """Returns the point of a row x, y, z, s."""
    n, p, m = sizes
    return Point(v[:n], v[n : n + p], v[n + p : n + p + m], v[n + p + m :])
