"""Sparse positive definite matrices: in which order to eliminate, and by which factorisation.

Our own (``cholesky.c``) is used where it is compiled, then CHOLMOD, which comes with CVXOPT (GPL),
then SciPy's SuperLU.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.sparse.linalg import splu

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.solvers.extensions import CHOLESKY

Indices = NDArray[np.signedinteger[Any]]
Solve = Callable[[FloatArray], FloatArray]

_LEAF = 24
"""Parts of so few nodes are not split any more."""

_LANDMARKS = 6

_BALANCE = 0.3
"""Least share of the nodes on either side of a cut."""


def factorised(matrix: sp.csc_array) -> Solve:
    """Solver of a positive definite matrix (n, n), of whose pattern there is but one.

    Minimum degree is found faster than a dissection, which pays where a pattern comes many times.
    """
    if "cholmod" in backends():
        lower = sp.tril(matrix.astype(float), format="csc")
        lower.sum_duplicates()
        with suppress(ArithmeticError):  # indefinite by rounding: LU does not mind
            return Cholmod(lower.indices, lower.indptr, is_ordered=False).factorise(lower.data)
    return symmetric_lu(matrix, "MMD_AT_PLUS_A")


def symmetric_lu(matrix: sp.csc_array, order: Literal["NATURAL", "MMD_AT_PLUS_A"]) -> Solve:
    """SciPy's LU without pivoting, in one of SuperLU's orders.

    Raises RuntimeError if a pivot is zero.
    """
    options = {"SymmetricMode": True, "Equil": False}
    solve: Solve = splu(matrix, permc_spec=order, diag_pivot_thresh=0.0, options=options).solve
    return solve


class Supernodal:
    """Our own Cholesky of matrices of one pattern, without reordering.

    The lower half stands for all: rows (entries,) of its compressed columns, in elimination order.
    A solver holds until the next factorisation.
    """

    def __init__(self, indices: Indices, indptr: Indices) -> None:
        self.factor = CHOLESKY.analysed(indptr.astype(np.int64), indices.astype(np.int64))

    def factorise(self, data: FloatArray) -> Solve:
        """Raises ArithmeticError if the matrix is not positive definite."""
        CHOLESKY.factorised(self.factor, np.ascontiguousarray(data))
        return self._solve

    def _solve(self, right: FloatArray) -> FloatArray:
        columns = np.array(right.T, dtype=float, order="C")
        for column in columns if right.ndim > 1 else [columns]:
            CHOLESKY.solution(self.factor, column)
        return columns.T


class SuperLU:
    """The same by SciPy's LU, without pivoting."""

    def __init__(self, indices: Indices, indptr: Indices) -> None:
        n = len(indptr) - 1
        number = np.arange(1, len(indices) + 1)
        given = sp.csc_array((number, indices, indptr), shape=(n, n))
        given = (given + sp.tril(given, -1).T).tocsc()
        self.place = given.data - 1
        self.indices, self.indptr = given.indices.astype(np.int32), given.indptr.astype(np.int32)

    def factorise(self, data: FloatArray) -> Solve:
        """Solver of the matrix with these entries, in the order of the pattern by columns."""
        shape = (len(self.indptr) - 1, len(self.indptr) - 1)
        matrix = sp.csc_array((data[self.place], self.indices, self.indptr), shape=shape)
        return symmetric_lu(matrix, "NATURAL")


class Cholmod:
    """The same by CHOLMOD's supernodal Cholesky, through CVXOPT; in an order of its own if the rows
    are in none. A solver holds until the next factorisation.
    """

    def __init__(self, indices: Indices, indptr: Indices, is_ordered: bool = True) -> None:
        from cvxopt import cholmod, matrix, spmatrix

        self.cholmod, self.matrix = cholmod, matrix
        n = len(indptr) - 1
        columns, rows = np.repeat(np.arange(n), np.diff(indptr)), indices.astype(np.int64)
        self.lower = spmatrix(1.0, matrix(rows), matrix(columns), (n, n))
        cholmod.options["supernodal"] = 2
        order = {"p": matrix(np.arange(n))} if is_ordered else {}
        self.symbolic = cholmod.symbolic(self.lower, **order)

    def factorise(self, data: FloatArray) -> Solve:
        """Raises ArithmeticError if the matrix is not positive definite."""
        self.lower.V = self.matrix(data)
        self.cholmod.numeric(self.lower, self.symbolic)
        return self._solve

    def _solve(self, right: FloatArray) -> FloatArray:
        result = self.matrix(np.asarray(right, dtype=float))
        self.cholmod.solve(self.symbolic, result)
        return np.array(result).reshape(right.shape)


BACKENDS: dict[str, type[Supernodal | Cholmod | SuperLU]] = {
    "supernodal": Supernodal,
    "cholmod": Cholmod,
    "superlu": SuperLU,
}
"""Factorisations by name, the best first."""


@cache
def backends() -> tuple[str, ...]:
    """Those that can be used here: SuperLU always, CHOLMOD where CVXOPT is installed."""
    lacking = {"supernodal"} if CHOLESKY is None else set()
    return tuple(name for name in BACKENDS if name not in lacking | _without_cholmod())


def best_backend() -> str:
    """The fastest of them."""
    return backends()[0]


@cache
def _without_cholmod() -> set[str]:
    try:
        import_module("cvxopt.cholmod")
    except Exception:  # a library that it needs may be missing: whatever it raises, go without
        return {"cholmod"}
    return set()


def nested_dissection(graph: sp.csr_array) -> IntArray:
    """Order (n,) in which to eliminate the nodes of a symmetric graph (n, n) for little fill-in: it
    is cut along a level of one of a few coordinates, the separator comes last, each part is treated
    alike. Coordinates are distances in edges from nodes far apart: they follow a wall around
    corners.
    """
    n = graph.shape[0]
    graph = sp.csr_array((np.ones(graph.nnz), graph.indices, graph.indptr), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    by_label = np.argsort(label, kind="stable")
    starts = np.flatnonzero(np.diff(label[by_label])) + 1
    order = [by_label[:0]]
    for nodes in np.split(by_label, starts):
        if len(nodes) <= _LEAF:
            order.append(nodes)
        else:
            parts = _Dissection(graph[nodes][:, nodes]).split(np.arange(len(nodes)))
            order.append(nodes[np.concatenate(parts)])
    return np.concatenate(order)


class _Dissection:
    """Recursive bisection of one connected graph."""

    def __init__(self, graph: sp.csr_array) -> None:
        """Distances (n, k) from landmarks that are far from each other, and their differences."""
        self.graph = graph
        distances = [_distances(graph, int(np.argmax(_distances(graph, 0))))]
        for _ in range(_LANDMARKS - 1):
            distances.append(_distances(graph, int(np.argmax(np.min(distances, axis=0)))))
        places = np.stack(distances, axis=1)
        self.places = np.concatenate([places, places[:, :-1] - places[:, 1:]], axis=1)
        self.is_beyond = np.zeros((graph.shape[0], 2 * self.places.shape[1]))

    def split(self, nodes: IntArray) -> list[IntArray]:
        """Near side, far side, each split again, and the separator: the near side's boundary."""
        if len(nodes) <= _LEAF:
            return [nodes]
        places, n = self.places[nodes], len(nodes)
        middle = np.median(places, axis=0)
        near = np.concatenate([places <= middle, places < middle], axis=1)
        self.is_beyond[nodes] = ~near
        touches = self.graph[nodes] @ self.is_beyond > 0.0
        self.is_beyond[nodes] = 0.0
        boundary = near & touches
        share = near.mean(axis=0)
        good = (share >= _BALANCE) & (share <= 1.0 - _BALANCE) & (near & ~touches).any(axis=0)
        if not good.any():
            return [nodes]
        best = int(np.where(good, boundary.sum(axis=0), n + 1).argmin())
        is_near, is_boundary = near[:, best], boundary[:, best]
        within, beyond = nodes[is_near & ~is_boundary], nodes[~is_near]
        return [*self.split(within), *self.split(beyond), nodes[is_boundary]]


def _distances(graph: sp.csr_array, start: int) -> FloatArray:
    return np.asarray(dijkstra(graph, unweighted=True, indices=np.array([start]))[0])
