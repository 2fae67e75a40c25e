"""Elimination orders: permutations always, and less fill-in than the order they came in."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.linalg import splu

from cvxlimit.solvers.sparse import BACKENDS, factorised, nested_dissection


def grid(width: int, height: int) -> sp.csr_array:
    """Each node of a rectangular grid linked to its up to four neighbours."""
    rows, columns = (
        sp.diags_array([np.ones(n - 1), np.ones(n - 1)], offsets=[-1, 1], shape=(n, n))
        for n in (height, width)
    )
    links = sp.kron(rows, sp.eye_array(width)) + sp.kron(sp.eye_array(height), columns)
    return links.tocsr()


def laplacian(graph: sp.csr_array) -> sp.csc_array:
    degree = np.asarray(graph.sum(axis=1)).ravel()
    return (sp.diags_array(degree + 1.0) - graph).tocsc()


def fill(matrix: sp.csc_array) -> int:
    options = {"SymmetricMode": True}
    return splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options=options).L.nnz


@given(nodes=st.integers(0, 120), links=st.integers(0, 300), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_any_graph_is_ordered(nodes: int, links: int, seed: int) -> None:
    """Connected or not, with loops and repeated edges."""
    rng = np.random.default_rng(seed)
    ends = rng.integers(0, nodes, (2, links if nodes else 0))
    both = np.concatenate([ends, ends[::-1]], axis=1)
    graph = sp.coo_array((np.ones(both.shape[1]), tuple(both)), shape=(nodes, nodes)).tocsr()
    assert np.sort(nested_dissection(graph)).tolist() == list(range(nodes))


@pytest.mark.parametrize(("width", "height"), [(40, 40), (12, 200)])
def test_fill_in(width: int, height: int) -> None:
    """A grid in random order: within George's bound of 31/4 n log2 n entries (1973).

    And half of the fill-in without reordering, or less.
    """
    rng = np.random.default_rng(1)
    shuffled = rng.permutation(width * height)
    graph = grid(width, height)[shuffled][:, shuffled]
    order = nested_dissection(graph.tocsr())
    matrix = laplacian(graph)
    n = width * height
    assert fill(matrix[order][:, order]) <= 31 / 4 * n * np.log2(n)
    assert fill(matrix[order][:, order]) <= 0.5 * fill(matrix)


@pytest.mark.parametrize("backend", BACKENDS)
def test_backends(backend: str) -> None:
    """Twice with one pattern: a kept analysis must not keep the numbers."""
    matrix = laplacian(grid(9, 7))
    lower = sp.tril(matrix, format="csc")
    lower.sort_indices()
    factorisation = BACKENDS[backend](lower.indices, lower.indptr)
    right = np.random.default_rng(0).normal(size=63)
    for size in (1.0, 3.0):
        solve = factorisation.factorise(size * lower.data)
        np.testing.assert_allclose(size * (matrix @ solve(right)), right, atol=1e-12)


def test_rows_in_any_order_and_indefinite() -> None:
    """Cholesky cannot do the second, with one eigenvalue of -1e-3 as rounding may leave; LU can."""
    matrix = laplacian(grid(9, 7))
    right = np.random.default_rng(0).normal(size=63)
    unsorted = matrix[:, np.arange(63)]
    unsorted.indices[:2], unsorted.data[:2] = unsorted.indices[1::-1], unsorted.data[1::-1]
    unsorted.has_sorted_indices = False
    least = np.linalg.eigvalsh(matrix.toarray())[0]
    for m in (unsorted, matrix - (least + 1e-3) * sp.eye_array(63).tocsc()):
        np.testing.assert_allclose(m @ factorised(m.copy())(right), right, atol=1e-10)
