"""Sparse positive definite matrices: in which order to eliminate, and by which factorisation.

Our own (``cholesky.c``) is used where it is compiled: it takes a third to a fifth of the time of
SciPy's SuperLU, which does the same elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.sparse.linalg import SuperLU, splu

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.solvers.compiled import CHOLESKY

Indices = NDArray[np.signedinteger[Any]]
Solve = Callable[[FloatArray], FloatArray]

_WIDE = 5_000
"""Nodes from which cuts into halves leave less fill-in than minimum degrees do: fifty thousand
contacts are factorised in half of the time. On sixteen thousand that differs by a tenth, and the
order itself takes five times as long."""

# The next three were measured on walls one and three stones thick and on a ring, of seven to ten
# thousand stones each; operations are those of the factorisation.

_LEAF = 24
"""Parts with this many nodes or fewer are not split any more. With 8 the order takes nearly twice
as long and saves 1 to 3 % of the operations; with 96 they are 9 to 17 % more."""

_FEW = 400
"""Equations below which SuperLU takes less time."""

_LANDMARKS = 6
"""Nodes far apart from which distances are taken as coordinates. With 4 operations are 2 to 24 %
more; with 12 the order takes a third to a half longer and saves up to 5 % of them."""

_BALANCE = 0.3
"""Least share of the nodes on either side of a cut. Any from 0.1 to 0.45 changes operations by 2 %
at most: cuts go through medians, and are uneven only where many nodes share a level."""


def factorised(matrix: sp.csc_array, group: int = 1) -> Solve:
    """Factorises a positive definite matrix (n, n), and returns a function that solves with it.

    Rows are ordered in groups of ``group``, the equations of a masonry block.
    """
    n = matrix.shape[0]
    if CHOLESKY is None or n < _FEW:
        return cast(Solve, _lu(matrix).solve)
    # The order of elimination, from the graph of groups.
    node = np.arange(n) // group
    places = node[matrix.indices], np.repeat(node, np.diff(matrix.indptr))
    graph = sp.coo_array((np.ones(matrix.nnz), places), shape=(n // group, n // group))
    order = (elimination_order(graph.tocsr())[:, None] * group + np.arange(group)).ravel()
    # The lower half of the matrix in this order.
    rank = np.argsort(order)
    row, column = rank[matrix.indices], np.repeat(rank, np.diff(matrix.indptr))
    is_kept = row >= column
    entries = matrix.data[is_kept], (row[is_kept], column[is_kept])
    lower = sp.coo_array(entries, shape=(n, n)).tocsc()
    lower.sort_indices()
    try:
        solve = Supernodal(lower.indices, lower.indptr).factorise(lower.data)
    except ArithmeticError:  # It is indefinite by rounding, which LU bears.
        return cast(Solve, _lu(matrix).solve)
    return lambda right: solve(right[order])[rank]


def _lu(matrix: sp.csc_array) -> SuperLU:
    """Returns SciPy's LU without pivoting, rows with the fewest neighbours first. Raises
    RuntimeError if a pivot is zero."""
    options = {"SymmetricMode": True, "Equil": False}
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


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


def elimination_order(graph: sp.csr_array) -> IntArray:
    """Returns the order (n,) in which to eliminate the nodes of a symmetric graph (n, n), so that
    little fills in."""
    return minimum_degree(graph) if graph.shape[0] < _WIDE else nested_dissection(graph)


def minimum_degree(graph: sp.csr_array) -> IntArray:
    """Returns the order (n,) that takes nodes with the fewest neighbours first. It is SuperLU's,
    which gives its order only with the factors of a matrix; the one used is diagonally dominant."""
    n = graph.shape[0]
    if n == 0:
        return np.zeros(0, dtype=np.int64)
    degree = np.diff(graph.indptr) + 1.0
    links = sp.csc_array((-np.ones(graph.nnz), graph.indices, graph.indptr), shape=(n, n))
    return np.argsort(_lu(links + sp.diags_array(degree, format="csc")).perm_c)


def nested_dissection(graph: sp.csr_array) -> IntArray:
    """Returns the order (n,) by nested dissection: the graph is cut in two along a level of one of
    a few coordinates, the nodes on the cut come last, and each part is treated alike.

    Coordinates are distances in edges from nodes far apart, which follow a wall around corners.
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
    """Recursive bisection of one connected graph.

    ``places`` (n, 2 k - 1) are its coordinates: distances in edges from k landmarks, and the
    differences of every two that follow each other. ``is_beyond`` is space for :meth:`split`: which
    nodes lie on the far side of each possible cut.
    """

    def __init__(self, graph: sp.csr_array) -> None:
        """Takes the coordinates: the first landmark is a node farthest from any one, and each
        further landmark the node whose nearest landmark is farthest away."""
        self.graph = graph
        distances = [_distances(graph, int(np.argmax(_distances(graph, 0))))]
        for _ in range(_LANDMARKS - 1):
            distances.append(_distances(graph, int(np.argmax(np.min(distances, axis=0)))))
        places = np.stack(distances, axis=1)
        self.places = np.concatenate([places, places[:, :-1] - places[:, 1:]], axis=1)
        self.is_beyond = np.zeros((graph.shape[0], 2 * self.places.shape[1]))

    def split(self, nodes: IntArray) -> list[IntArray]:
        """Returns the order of nodes in parts: the near side and the far side, each split again,
        and last the separator, which is the boundary of the near side."""
        if len(nodes) <= _LEAF:
            return [nodes]
        # Cuts through the median of each coordinate, with nodes on the level on either side.
        places, n = self.places[nodes], len(nodes)
        middle = np.median(places, axis=0)
        near = np.concatenate([places <= middle, places < middle], axis=1)
        self.is_beyond[nodes] = ~near
        touches = self.graph[nodes] @ self.is_beyond > 0.0
        self.is_beyond[nodes] = 0.0
        # The cut with the smallest boundary of those that are balanced.
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
    """Returns the distances (n,) in edges from a node to all."""
    return np.asarray(dijkstra(graph, unweighted=True, indices=np.array([start]))[0])
