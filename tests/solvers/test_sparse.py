"""Elimination orders: permutations always, and less fill-in than the order they came in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.linalg import splu

from cvxlimit.base.arrays import IntArray
from cvxlimit.solvers.compiled import CHOLESKY
from cvxlimit.solvers.sparse import Supernodal, factorised, minimum_degree, nested_dissection

ORDERS = (minimum_degree, nested_dissection)
COMPILED = pytest.mark.skipif(CHOLESKY is None, reason="not compiled here")


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
    for order in ORDERS:
        assert np.sort(order(graph)).tolist() == list(range(nodes))


@pytest.mark.parametrize("ordered", ORDERS)
@pytest.mark.parametrize(("width", "height"), [(40, 40), (12, 200)])
def test_fill_in(width: int, height: int, ordered: Callable[[sp.csr_array], IntArray]) -> None:
    """A grid in random order: within George's bound of 31/4 n log2 n entries (1973).

    And half of the fill-in without reordering, or less.
    """
    rng = np.random.default_rng(1)
    shuffled = rng.permutation(width * height)
    graph = grid(width, height)[shuffled][:, shuffled]
    order = ordered(graph.tocsr())
    matrix = laplacian(graph)
    n = width * height
    assert fill(matrix[order][:, order]) <= 31 / 4 * n * np.log2(n)
    assert fill(matrix[order][:, order]) <= 0.5 * fill(matrix)


@COMPILED
def test_two_matrices_of_one_pattern() -> None:
    """A kept analysis must not keep the numbers."""
    matrix = laplacian(grid(9, 7))
    lower = sp.tril(matrix, format="csc")
    lower.sort_indices()
    factorisation = Supernodal(lower.indices, lower.indptr)
    right = np.random.default_rng(0).normal(size=63)
    for size in (1.0, 3.0):
        solve = factorisation.factorise(size * lower.data)
        np.testing.assert_allclose(size * (matrix @ solve(right)), right, atol=1e-12)


@COMPILED
@given(
    n=st.integers(1, 60),
    share=st.sampled_from([0.0, 0.02, 0.1, 0.5, 1.0]),
    width=st.integers(1, 7),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=60, deadline=None)
def test_random_matrices(n: int, share: float, width: int, seed: int) -> None:
    """Of any pattern, from diagonal to full, in blocks as contacts make them: as dense solutions,
    to 1e-9 for matrices whose condition is below 1e4."""
    rng = np.random.default_rng(seed)
    links = np.kron(rng.random((n, n)) < share, np.ones((width, width)))
    half = links * rng.normal(size=links.shape)
    matrix = half @ half.T + np.diag(
        1e-3 * np.linalg.norm(half) ** 2 + rng.uniform(0.5, 1.0, n * width)
    )
    lower = sp.csc_array(np.tril(matrix))
    lower.sort_indices()
    solve = Supernodal(lower.indices, lower.indptr).factorise(lower.data)
    right = rng.normal(size=n * width)
    np.testing.assert_allclose(solve(right), np.linalg.solve(matrix, right), rtol=1e-9, atol=1e-9)
    both = solve(np.stack([right, -right], axis=1))
    np.testing.assert_allclose(both[:, 1], -both[:, 0], atol=1e-12)


@COMPILED
@pytest.mark.parametrize("value", [-1.0, 0.0, np.nan])
def test_a_pivot_that_is_not_positive(value: float) -> None:
    lower = sp.csc_array(np.tril(np.ones((3, 3)) + np.eye(3)))
    factorisation = Supernodal(lower.indices, lower.indptr)
    with pytest.raises(ArithmeticError, match="not positive definite"):
        factorisation.factorise(np.where(lower.data == 2.0, value, lower.data))


@pytest.mark.parametrize("group", [1, 3, 7])
@pytest.mark.parametrize("few", [0, 1_500])
def test_groups_of_rows_in_any_order_and_indefinite(
    monkeypatch: pytest.MonkeyPatch, few: int, group: int
) -> None:
    """Cholesky cannot do the last, with one eigenvalue of -1e-3 as rounding may leave; LU can."""
    monkeypatch.setattr("cvxlimit.solvers.sparse._FEW", few)
    matrix = laplacian(grid(9, 7))
    right = np.random.default_rng(0).normal(size=63)
    unsorted = matrix[:, np.arange(63)]
    unsorted.indices[:2], unsorted.data[:2] = unsorted.indices[1::-1], unsorted.data[1::-1]
    unsorted.has_sorted_indices = False
    least = np.linalg.eigvalsh(matrix.toarray())[0]
    for m in (matrix, unsorted, matrix - (least + 1e-3) * sp.eye_array(63).tocsc()):
        np.testing.assert_allclose(m @ factorised(m.copy(), group)(right), right, atol=1e-10)


@COMPILED
@pytest.mark.parametrize(("width", "height"), [(1, 700), (150, 8), (280, 3)])
def test_wide_fronts(width: int, height: int) -> None:
    """Products of many columns at a time, and of few; a band of dense blocks, whose solution is
    known to 1e-9 for a condition below 1e4."""
    rng = np.random.default_rng(5)
    band = sp.kron(grid(1, height) + sp.eye_array(height), np.ones((width, width))).tocsc()
    band.data = rng.normal(size=band.nnz)
    matrix = (band @ band.T + 1e-3 * abs(band).sum() * sp.eye_array(width * height)).tocsc()
    lower = sp.tril(matrix, format="csc")
    lower.sort_indices()
    expected = rng.normal(size=width * height)
    solve = Supernodal(lower.indices, lower.indptr).factorise(lower.data)
    np.testing.assert_allclose(solve(matrix @ expected), expected, rtol=1e-9, atol=1e-9)
