"""Small blocks of variables that share cones, contacts as a rule, and how each is eliminated."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import SolverError
from cvxlimit.solvers.interior.cones import Cones, NesterovTodd


@dataclass(frozen=True)
class Limits:
    """What counts as a small block, and how far solutions are refined.

    ``widest`` is the most variables of one block. A variable in more than the ``densest`` number of
    equations (the load factor is) borders the Schur complement, together with at most ``border``.
    ``regularisation`` is added to diagonals, relatively. Blocks whose squares have a pivot below
    ``hard``, or less where the target is wider, are eliminated by reflections, none of whose pivots
    is below the share ``softest`` of its column: softer ones cost equilibrium more than they bring
    the flow rule. Refinement takes these effects out again: it ends after so many ``rounds``, when
    every part of the residual does no harm or is below the ``target``, relative to its own
    right-hand side or the share ``floor`` of the largest, or when a round gains less than the
    factor ``slow``. Plain steps are kept up while they gain the factor ``fast``. Where a wide gap
    is asked for the target is up to ``loosest``: the same brackets in three fifths of the
    eliminations.
    """

    widest: int = 128
    densest: int = 200
    border: int = 20
    regularisation: float = 1e-14
    hard: float = 1e-6
    softest: float = 1e-9
    rounds: int = 6
    slow: float = 0.9
    fast: float = 0.1
    target: float = 1e-6
    loosest: float = 1e-3
    floor: float = 1e-8


LIMITS = Limits()


class Blocks:
    """Blocks of variables that share cones, by shape; those in no block form a border.

    ``columns`` and ``rows`` are the order in which every group is a slab; ``inner`` variables are
    in blocks, the others come last.
    """

    def __init__(self, E: sp.csr_array, G: sp.csr_array, orthant: int, soc: list[int]) -> None:
        m, n = G.shape
        sizes = np.concatenate([np.ones(orthant, int), np.asarray(soc, int)])
        unit = np.repeat(np.arange(len(sizes)), sizes)  # the cone that each row belongs to
        entries = G.tocoo()
        ends = unit[entries.row], len(sizes) + entries.col
        shape = (len(sizes) + n, len(sizes) + n)
        links = sp.coo_array((np.ones(len(entries.row)), ends), shape=shape)
        count, label = connected_components(links, directed=False)
        group = label.astype(np.int64)
        of_row, of_column = group[: len(sizes)][unit], group[len(sizes) :]
        self.width = np.bincount(of_column, minlength=count)
        self.height = np.bincount(of_row, minlength=count)
        if np.any(self.width == 0):
            raise SolverError("blockwise: a cone row without variables; use another solver")
        owner = sp.csr_array((np.ones(n), (of_column, np.arange(n))), shape=(count, n))
        pattern = sp.csr_array((np.ones(E.nnz), E.indices, E.indptr), shape=E.shape)
        self.touched = sp.csr_array(owner @ pattern.T)  # equations of each block
        self.touched.sort_indices()
        self.reach = np.diff(self.touched.indptr)
        is_border = (self.width == 1) & ((self.height == 0) | (self.reach > LIMITS.densest))
        border, edge = np.flatnonzero(is_border[of_column]), np.flatnonzero(is_border[of_row])
        self._check(~is_border, len(border), bool(np.any(edge >= orthant)))
        self._by_column = np.argsort(of_column, kind="stable")
        self._by_row = np.argsort(of_row, kind="stable")
        kind = np.where(np.arange(m) < orthant, 1, -sizes[unit])
        self._lay_out(np.flatnonzero(~is_border), of_row[self._by_row], kind, edge, border)

    def _check(self, is_block: NDArray[np.bool_], border: int, is_edge_in_a_cone: bool) -> None:
        if border > LIMITS.border or not is_block.any():
            raise SolverError(
                f"blockwise: {border} variables are in no cone or in more than "
                f"{LIMITS.densest} equations, at most {LIMITS.border} may be; use another solver"
            )
        width, height, reach = self.width, self.height, self.reach
        for worst in np.flatnonzero(
            is_block & ((width > LIMITS.widest) | (reach > LIMITS.densest))
        )[:1]:
            raise SolverError(
                f"blockwise: {width[worst]} variables in {reach[worst]} equations hang together "
                f"through cones, more than {LIMITS.widest} in {LIMITS.densest}; use another solver"
            )
        for worst in np.flatnonzero(is_block & (height < width))[:1]:
            raise SolverError(
                f"blockwise: {width[worst]} variables in {height[worst]} cone rows are not bounded "
                "by them; use another solver"
            )
        if is_edge_in_a_cone:
            raise SolverError("blockwise: a border variable in a cone; use another solver")

    def _lay_out(
        self, members: IntArray, owner: IntArray, kind: IntArray, edge: IntArray, border: IntArray
    ) -> None:
        """Slabs of variables and rows, group by group: linear rows of all groups come first. A
        block's shape is its number of variables, then 1 or minus the cone's size, row by row."""
        first_row = np.cumsum(self.height) - self.height
        first_column = np.cumsum(self.width) - self.width
        shape = np.zeros((len(self.width), 1 + int(self.height.max(initial=0))), int)
        shape[:, 0] = self.width
        shape[owner, 1 + np.arange(len(owner)) - first_row[owner]] = kind[self._by_row]
        shapes, which = np.unique(shape[members], axis=0, return_inverse=True)
        columns, linear, cones, self.groups = [], [], [], []
        slabs: list[tuple[int, int]] = []
        self.inner = row_at = 0
        for i, (c, *kinds) in enumerate(shapes.tolist()):
            blocks = members[which.ravel() == i]
            plain, k = kinds.count(1), len(blocks)
            own = self._by_column[first_column[blocks] + np.arange(c)[:, None]]
            height = np.arange(np.count_nonzero(kinds))[:, None]
            rows = self._by_row[first_row[blocks] + height]
            at, first = plain, len(slabs)
            while at < len(rows):
                d = -kinds[at]
                slabs.append((d, k))
                cones.append(rows[at : at + d].ravel())
                at += d
            columns.append(own.ravel())
            linear.append(rows[:plain].ravel())
            equations = self._equations(blocks)
            group = Group(
                slice(self.inner, self.inner + c * k),
                slice(row_at, row_at + plain * k),
                tuple(range(first, len(slabs))),
                own,
                rows,
                equations,
            )
            self.groups.append(group)
            self.inner, row_at = group.columns.stop, group.orthant.stop
        self.columns = np.concatenate([*columns, border])
        self.rows = np.concatenate([*linear, edge, *cones]).astype(np.int64)
        self.cones = Cones(row_at + len(edge), slabs)

    def _equations(self, blocks: IntArray) -> IntArray:
        """Equations (e, k) in which blocks are, padded with the number of all."""
        place = np.arange(int(self.reach[blocks].max(initial=1)))[:, None]
        result = np.full((len(place), len(blocks)), self.touched.shape[1])
        real = place < self.reach[blocks]
        result[real] = self.touched.indices[(self.touched.indptr[blocks] + place)[real]]
        return result


def _nothing() -> FloatArray:
    return np.zeros((0, 0, 0))


@dataclass(frozen=True, eq=False)
class Group:
    """k blocks of one shape, in slabs: c variables, r cone rows (linear first), e equations."""

    columns: slice
    orthant: slice
    slabs: tuple[int, ...]
    given: IntArray  # (c, k), the variables as they were given
    rows: IntArray  # (r, k)
    equations: IntArray  # (e, k), padded with the number of equations
    cone_part: FloatArray = field(default_factory=_nothing)  # (r, c, k)
    equation_part: FloatArray = field(default_factory=_nothing)  # (e, c, k)

    def scaled_rows(self, scaling: NesterovTodd) -> FloatArray:
        """W^-1 G of each block, (r, c, k)."""
        scaled = np.empty_like(self.cone_part)
        diagonal = scaling.diagonal[self.orthant].reshape(-1, scaled.shape[2])
        at = len(diagonal)
        scaled[:at] = self.cone_part[:at] / diagonal[:, None]
        for slab in self.slabs:
            end = at + scaling.cones.shapes[slab][0]
            scaled[at:end] = scaling.over(slab, self.cone_part[at:end])
            at = end
        return scaled

    def eliminated(self, rows: FloatArray, hard: float, parts: FloatArray) -> FloatArray:
        """R (c, c, k) with R' R the inverse of ``rows``' rows, until the next call; E R' R E' is
        written to ``parts`` (k, e, e)."""
        root, both, half = self._room
        _inverse_root(rows, hard, both, root)
        np.matmul(root.transpose(2, 0, 1), self._by_block, out=half)
        np.matmul(half.transpose(0, 2, 1), half, out=parts)
        return root

    @cached_property
    def _room(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """For the root, and what leads to it: fresh memory for every factorisation cost a tenth
        of the whole solve."""
        (c, k), e = self.given.shape, len(self.equations)
        return np.empty((c, c, k)), np.empty((c, 2 * c, k)), np.empty((k, c, e))

    @cached_property
    def _by_block(self) -> FloatArray:
        return np.ascontiguousarray(self.equation_part.transpose(2, 1, 0))


def _inverse_root(rows: FloatArray, hard: float, both: FloatArray, root: FloatArray) -> None:
    """Into root (c, c, k) R with R' R the inverse of rows' rows, for rows (r, c, k); ``both``
    (c, 2 c, k) is room for what leads to it."""
    least = _root_of_squares(rows, both, root)
    worst = np.flatnonzero(~(least > hard))
    if len(worst):
        root[:, :, worst] = _root_by_reflections(rows[:, :, worst])


def _root_of_squares(rows: FloatArray, both: FloatArray, root: FloatArray) -> FloatArray:
    """By Cholesky's factors of rows' rows, beside which the unit matrix becomes their inverse;
    returns their least pivots (k,), at most 1."""
    c, k = rows.shape[1:]
    gram, each = np.einsum("rik,rjk->ijk", rows, rows, out=both[:, :c]), np.arange(c)
    scale = 1.0 / np.sqrt(gram[each, each] * (1.0 + LIMITS.regularisation))
    gram *= scale[:, None] * scale
    both[:, c:] = 0.0
    gram[each, each], both[each, c + each] = 1.0 + LIMITS.regularisation, 1.0
    least = np.ones(k)
    for i in range(c):
        least = np.minimum(least, both[i, i])
        row = both[i, i + 1 : c + i + 1]
        row /= np.sqrt(both[i, i])
        both[i + 1 :, i + 1 : c + i + 1] -= row[: c - i - 1, None] * row
    np.multiply(both[:, c:], scale, out=root)
    return least


def _root_by_reflections(rows: FloatArray) -> FloatArray:
    """By Householder reflections of the rows themselves, whose squares rounding would not tell
    apart once it spoils the openings. The largest column and row that are left come first: rows
    differ by all that lies between open and pressed corners (A. J. Cox, N. J. Higham, Stability of
    Householder QR factorization for weighted least squares problems, 1998).
    """
    left, (c, k) = rows.copy(), rows.shape[1:]
    order, each = np.tile(np.arange(c)[:, None], k), np.arange(k)
    least = LIMITS.softest * np.sqrt(np.einsum("rik,rik->ik", rows, rows))
    for i in range(c):
        rest = left[i:, i:]
        column = i + np.einsum("rik,rik->ik", rest, rest).argmax(axis=0)
        left[:, i], left[:, column, each] = left[:, column, each], left[:, i].copy()
        order[i], order[column, each] = order[column, each], order[i].copy()
        row = i + np.abs(left[i:, i]).argmax(axis=0)
        left[i], left[row, :, each] = left[row, :, each].T, left[i].T.copy()
        mirror = left[i:, i].copy()
        size = np.sqrt(np.einsum("rk,rk->k", mirror, mirror))
        pivot = -np.copysign(np.maximum(size, least[order[i], each]), mirror[0])
        mirror[0] -= pivot
        share = np.einsum("rk,rjk->jk", mirror, left[i:, i + 1 :]) / (pivot * mirror[0])
        left[i:, i + 1 :] += mirror[:, None] * share
        left[i, i] = pivot
    root = np.zeros((c, c, k))
    for i in range(c):
        root[i, :i] = -np.einsum("jk,jik->ik", left[:i, i], root[:i, :i]) / left[i, i]
        root[i, i] = 1.0 / left[i, i]
    result = np.empty_like(root)
    result[:, order, each] = root
    return result
