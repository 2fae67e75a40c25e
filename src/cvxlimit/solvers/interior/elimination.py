"""The Newton system of a cone program whose cone rows hang together in small blocks: contacts.

A contact's forces and their auxiliary variables meet others in the equilibrium of blocks only.
Eliminating them leaves a Schur complement with six rows per masonry block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.errors import SolverError
from cvxlimit.solvers.interior.cones import Cones, NesterovTodd
from cvxlimit.solvers.sparse import BACKENDS, nested_dissection


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


def _nothing() -> FloatArray:
    return np.zeros((0, 0, 0))


@dataclass(frozen=True, eq=False)
class _Group:
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


class NewtonSystem:
    """[0 E' G'; E 0 0; G 0 -W^2] (x, y, z) = right-hand side, by block elimination.

    ``columns`` and ``rows`` say which of the given variables and cone rows stand where. A holds the
    equations E, ``zero`` of them, then cone rows G, of which the first ``orthant`` are
    linear, followed by second-order cones of the sizes ``soc``. Raises SolverError if the cone rows
    do not fall apart into small blocks.
    """

    def __init__(
        self, A: sp.csr_array, zero: int, orthant: int, soc: list[int], backend: str
    ) -> None:
        E, G = A[:zero], A[zero:]
        self.equations, self.variables = E.shape
        if not self.equations:
            raise SolverError("blockwise: there are no equations; use another solver")
        found = _Blocks(E.tocsr(), G.tocsr(), orthant, soc)
        self.columns, self.rows, self.cones = found.columns, found.rows, found.cones
        self.border, self.groups = slice(found.inner, self.variables), found.groups
        self._given, self._places = A, list[IntArray]()
        self._name(*self._laid_out(A))
        self.target = LIMITS.target
        self._set_order()
        self._set_pattern()
        self.factorisation = BACKENDS[backend](self._indices, self._indptr)

    def _laid_out(self, A: sp.csr_array) -> tuple[list[sp.csr_array], list[FloatArray]]:
        """A in the order of the groups, in all forms in which it is needed."""
        E, G = A[: self.equations], A[self.equations :]
        padded = sp.vstack([E, sp.csr_array((1, self.variables))], format="csr")
        arrays = []
        for group in self.groups:
            arrays.append(_dense_parts(G, group.rows, group.given))
            arrays.append(_dense_parts(padded, group.equations, group.given))
        E, G = E[:, self.columns], G[self.rows][:, self.columns]
        arrays += [E[:, self.border].toarray(), G[:, self.border].toarray()]
        whole = sp.vstack([E, G], format="csr")
        return [E, G, E.T.tocsr(), G.T.tocsr(), whole, whole.T.tocsr()], arrays

    def _name(self, matrices: list[sp.csr_array], arrays: list[FloatArray]) -> None:
        self._matrices = matrices
        self.E, self.G, self.Et, self.Gt, self.A, self.At = matrices
        *parts, self._edge, self._edge_rows = arrays
        pairs = zip(self.groups, parts[::2], parts[1::2], strict=True)
        self.groups = [replace(g, cone_part=G, equation_part=E) for g, G, E in pairs]

    def renew(self, data: FloatArray) -> None:
        """Other numbers for the entries of A, in its order: their places are looked up once."""
        if not self._places:
            numbered = sp.csr_array(self._given, copy=True)
            numbered.data = np.arange(1.0, len(data) + 1.0)
            matrices, arrays = self._laid_out(numbered)
            self._places = [np.rint(m.data).astype(np.int64) for m in matrices]
            self._places += [np.rint(array).astype(np.int64) for array in arrays]
        parts = [np.append(0.0, data)[at] for at in self._places]
        for matrix, part in zip(self._matrices, parts, strict=False):
            matrix.data = part
        self._name(self._matrices, parts[len(self._matrices) :])

    def _set_order(self) -> None:
        """Elimination order: equations with the same blocks form one node of the graph."""
        row = np.concatenate([g.equations.ravel() for g in self.groups])
        firsts = np.cumsum([0, *(g.equations.shape[1] for g in self.groups)])
        owner = np.concatenate(
            [
                np.tile(first + np.arange(g.equations.shape[1]), len(g.equations))
                for first, g in zip(firsts, self.groups, strict=False)
            ]
        )
        real = row < self.equations
        shape = (self.equations, int(firsts[-1]))
        touches = sp.csr_array((np.ones(real.sum()), (row[real], owner[real])), shape=shape)
        fingerprint = touches @ np.random.default_rng(0).random(shape[1])
        _, node = np.unique(fingerprint, return_inverse=True)
        members = sp.csr_array((np.ones(self.equations), (node, np.arange(self.equations))))
        node_touches = members @ touches
        node_rank = _rank(nested_dissection((node_touches @ node_touches.T).tocsr()))
        self.order = np.argsort(node_rank[node], kind="stable")
        self._position = np.append(_rank(self.order), self.equations)

    def _set_pattern(self) -> None:
        """Compressed columns of the Schur complement's lower half, and where entries go."""
        p, keys = self.equations, []
        for group in self.groups:
            at = self._position[group.equations.T]
            row, column = at[:, :, None], at[:, None]
            inside = (column <= row) & (row < p)
            keys.append(np.where(inside, column * p + row, -1).ravel())
        whole = np.concatenate(keys)
        entries = np.flatnonzero(whole >= 0)
        both = np.concatenate([whole[entries], np.arange(p) * (p + 1)])
        unique, slot = np.unique(both, return_inverse=True)
        self._diagonal = slot[len(entries) :]
        self._indices, self._indptr = unique % p, np.searchsorted(unique, np.arange(p + 1) * p)
        self._entries = np.empty(len(whole))  # of all groups, k blocks' (e, e) each
        ones, shape = np.ones(len(entries)), (len(unique), len(whole))
        self._sums = sp.csr_array((ones, (slot[: len(entries)], entries)), shape=shape)
        parts = np.split(self._entries, np.cumsum([len(key) for key in keys])[:-1])
        shapes = ((g.equations.shape[1], *2 * (len(g.equations),)) for g in self.groups)
        self._parts = [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]

    def factorise(self, scaling: NesterovTodd) -> None:
        """Raises LinAlgError, RuntimeError or ArithmeticError where rounding makes it singular."""
        self.scaling, self._roots, hard = scaling, [], LIMITS.hard * LIMITS.target / self.target
        for group, parts in zip(self.groups, self._parts, strict=True):
            self._roots.append(group.eliminated(group.scaled_rows(scaling), hard, parts))
        data = np.asarray(self._sums @ self._entries, dtype=float)
        diagonal = data[self._diagonal] * (1.0 + LIMITS.regularisation)
        data[self._diagonal] = np.where(diagonal > 0.0, diagonal, 1.0)
        if not np.isfinite(data).all():
            raise FloatingPointError("rounding has made a block singular")
        self._solve = self.factorisation.factorise(data)
        if self._edge.size:
            self._solved_edge = self._schur(self._edge)
            own = [scaling.squared(column, -1.0) for column in self._edge_rows.T]
            self._corner = np.linalg.inv(
                self._edge.T @ self._solved_edge + np.stack(own) @ self._edge_rows
            )

    def parts(self, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Views x (n,), y (p,), z (m,) of one array."""
        n, p = self.variables, self.equations
        return v[:n], v[n : n + p], v[n + p :]

    def solve(self, right: FloatArray) -> FloatArray:
        """(x, y, z) by elimination, refined until nothing of the residual does harm."""
        return self.refined(right, self._eliminated(right))

    def refined(
        self, right: FloatArray, at: FloatArray, allowed: Sequence[float] = (0.0,) * 3
    ) -> FloatArray:
        """A solution improved by generalised conjugate residuals (S. C. Eisenstat, H. C. Elman,
        M. H. Schultz, 1983): rounding makes elimination wrong in a few directions, which iterative
        refinement takes out slowly. ``allowed`` are residuals of x, y and z that do no harm; the
        solution itself is returned where no more are left.
        """
        sizes = np.array([largest(part) for part in self.parts(right)])
        least = self.target * np.maximum(sizes, LIMITS.floor * (sizes.max() or 1.0))
        units = np.maximum(least, allowed)
        unit = np.repeat(units, [len(part) for part in self.parts(right)])
        left = self._residual(right, at) / unit
        error = largest(left)
        tried: list[tuple[FloatArray, FloatArray]] = []
        for _ in range(LIMITS.rounds):
            if not error > 1.0:
                break
            change = self._eliminated(unit * left)
            new = self._residual(right, at + change) / unit
            effect = left - new
            if largest(new) < LIMITS.fast * error:
                at, left, error = at + change, new, largest(new)
                continue
            for other, its_effect in tried:
                share = effect @ its_effect
                change, effect = change - share * other, effect - share * its_effect
            length = float(np.sqrt(effect @ effect))
            if not 0.0 < length < np.inf:
                break
            change, effect = change / length, effect / length
            tried.append((change, effect))
            step = effect @ left
            new = left - step * effect
            if not largest(new) < LIMITS.slow * error:
                break
            at, left, error = at + step * change, new, largest(new)
        if tried:  # only whole steps satisfy the equations to rounding
            last = at + self._eliminated(unit * left)
            if largest(self._residual(right, last) / unit) < error:
                return last
        return at

    def _residual(self, right: FloatArray, at: FloatArray) -> FloatArray:
        x, _, z = self.parts(at)
        result = right - np.concatenate([self.At @ at[self.variables :], self.A @ x])
        result[self.variables + self.equations :] += self.scaling.squared(z)
        return result

    def _eliminated(self, right: FloatArray) -> FloatArray:
        rx, ry, rz = self.parts(right)
        x, y = self.halved(rx + self.Gt @ self.scaling.squared(rz, -1.0), ry)
        return np.concatenate([x, y, self.scaling.squared(self.G @ x - rz, -1.0)])

    def halved(self, rx: FloatArray, ry: FloatArray) -> tuple[FloatArray, FloatArray]:
        """x and y of [G' W^-2 G, E'; E, 0] (x, y) = right-hand side, by elimination alone."""
        edge = self._edge
        y = self._schur(self.E @ self._local(rx) - ry)
        if edge.size:
            border = self._corner @ (rx[self.border] - edge.T @ y)
            y = y + self._solved_edge @ border
        x = self._local(rx - self.Et @ y)
        if edge.size:
            x[self.border] = border
        return x, y

    def _schur(self, right: FloatArray) -> FloatArray:
        result = np.empty_like(right)
        result[self.order] = self._solve(right[self.order])
        return result

    def _local(self, right: FloatArray) -> FloatArray:
        """(G' W^-2 G)^-1 on the variables of all blocks; 0 on the border."""
        result = np.zeros(self.variables)
        for group, root in zip(self.groups, self._roots, strict=True):
            half = np.einsum("ijk,jk->ik", root, right[group.columns].reshape(root.shape[1:]))
            result[group.columns] = np.einsum("ijk,ik->jk", root, half).ravel()
        return result


def largest(v: FloatArray) -> float:
    return float(np.abs(v).max(initial=0.0))


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


class _Blocks:
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
            group = _Group(
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


def _dense_parts(matrix: sp.csr_array, rows: IntArray, columns: IntArray) -> FloatArray:
    shape = (len(rows), *columns.shape)
    i = np.broadcast_to(rows[:, None], shape).ravel()
    j = np.broadcast_to(columns[None], shape).ravel()
    return np.asarray(matrix[i, j]).reshape(shape)


def _rank(order: IntArray) -> IntArray:
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank
