"""The Newton system of a cone program whose cone rows hang together in small blocks.

For a limit problem the blocks are the contacts: a contact's forces and their auxiliary variables
meet other contacts in the equilibrium of blocks only. Eliminating them leaves a Schur complement
with six rows per masonry block, far smaller than what a general solver factorises.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.errors import SolverError
from cvxlimit.solvers.interior.cones import Cones, Scaling
from cvxlimit.solvers.sparse import BACKENDS, nested_dissection

Triple = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Limits:
    """What counts as a small block, and how far solutions are refined.

    Attributes
    ----------
    widest : int
        Most variables of one block: beyond that dense blocks do not pay.
    densest : int
        A variable in more equations than this borders the Schur complement (the load factor does).
    border : int
        Most such variables.
    regularisation : float
        Added to diagonals, relatively; refinement takes its effect out of the solution.
    rounds, target, floor, slow, fast : int, float, float, float, float
        Refinement ends after so many rounds, when every part of the residual is below the target,
        relative to its own right-hand side or this share of the largest, or when a round gains less
        than the factor slow. Plain steps are kept up while they gain the factor fast.
    """

    widest: int = 128
    densest: int = 200
    border: int = 20
    regularisation: float = 1e-14
    rounds: int = 6
    slow: float = 0.9
    fast: float = 0.1
    target: float = 1e-6
    floor: float = 1e-6


LIMITS = Limits()


@dataclass(frozen=True, eq=False)
class _Group:
    """k blocks of one shape, in slabs: c variables, r cone rows (linear first), e equations."""

    columns: slice
    orthant: slice
    slabs: tuple[int, ...]
    cone_part: FloatArray  # (r, c, k)
    equations: IntArray  # (e, k), padded with the number of equations
    equation_part: FloatArray  # (e, c, k)


class NewtonSystem:
    """[0 E' G'; E 0 0; G 0 -W^2] (x, y, z) = right-hand side, by block elimination.

    Variables and cone rows are taken in an order of its own: ``columns`` and ``rows`` say which of
    the given ones stand where.

    Parameters
    ----------
    A : (p + m, n) sparse array
        Equations E, then cone rows G.
    zero, orthant : int
        p, and how many of the cone rows are linear.
    soc : sequence of int
        Sizes of the second-order cones.
    backend : str
        One of :data:`BACKENDS`.

    Raises
    ------
    SolverError
        If the cone rows do not fall apart into small blocks.
    """

    def __init__(
        self, A: sp.csr_array, zero: int, orthant: int, soc: list[int], backend: str
    ) -> None:
        E, G = A[:zero], A[zero:]
        self.equations, self.variables = E.shape
        if not self.equations:
            raise SolverError("blockwise: there are no equations; use another solver")
        found = _Blocks(E.tocsc(), G.tocsr(), orthant, soc)
        self.columns, self.rows, self.cones = found.columns, found.rows, found.cones
        self.E, self.G = E.tocsr()[:, self.columns], G.tocsr()[self.rows][:, self.columns]
        self.Et, self.Gt = self.E.T.tocsr(), self.G.T.tocsr()
        self.A = sp.vstack([self.E, self.G], format="csr")
        self.At = self.A.T.tocsr()
        self.groups = found.groups
        self.border = slice(found.inner, self.variables)
        self._edge = self.E[:, self.border].toarray()
        self._edge_rows = self.G[:, self.border].toarray()
        self._set_order()
        self._set_pattern()
        self.factorisation = BACKENDS[backend](self._indices, self._indptr)

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
            at = self._position[group.equations]
            row, column = at[:, None], at[None, :]
            inside = (column <= row) & (row < p)
            keys.append(np.where(inside, column * p + row, p * p).ravel())
        entries = np.concatenate(keys)
        diagonal = np.arange(p) * (p + 1)
        unique, slot = np.unique(np.concatenate([entries, diagonal, [p * p]]), return_inverse=True)
        self._slot, self._diagonal = slot[: len(entries)], slot[len(entries) : -1]
        self._indices = unique[:-1] % p
        self._indptr = np.searchsorted(unique[:-1], np.arange(p + 1) * p)

    def factorise(self, scaling: Scaling) -> None:
        """Take up the scaling W of a new iterate.

        Raises
        ------
        numpy.linalg.LinAlgError, RuntimeError, ArithmeticError
            If rounding has made a matrix singular.
        """
        self.scaling, self._roots, parts = scaling, [], []
        for group in self.groups:
            root = _inverse_root(_scaled_rows(group, scaling))
            half = np.einsum("ijk,ejk->iek", root, group.equation_part)
            self._roots.append(root)
            parts.append(np.einsum("iek,ifk->efk", half, half).ravel())
        sums = np.bincount(self._slot, np.concatenate(parts), len(self._indices) + 1)
        data = np.asarray(sums[:-1], dtype=float)
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

    def solve(self, right: Triple, rounds: int = LIMITS.rounds) -> Triple:
        """x (n,), y (p,), z (m,) by elimination, improved by conjugate residuals.

        Rounding makes elimination wrong in a few directions. Iterative refinement takes those out
        slowly, or stops early; generalised conjugate residuals (S. C. Eisenstat, H. C. Elman,
        M. H. Schultz, Variational iterative methods for nonsymmetric systems of linear equations,
        1983) do it in a few rounds.
        """
        at = self._once(*right)
        if not rounds:
            return at
        most = max(largest(r) for r in right) or 1.0
        units = [1.0 / max(largest(r), LIMITS.floor * most) for r in right]
        back = [1.0 / unit for unit in units]
        left = _scaled(self._residual(right, at), units)
        error = _worst(left)
        tried: list[tuple[Triple, Triple]] = []
        for _ in range(rounds):
            if not error > LIMITS.target:
                break
            change = self._once(*_scaled(left, back))
            whole = _sum(at, 1.0, change)
            new = _scaled(self._residual(right, whole), units)
            effect = _sum(left, -1.0, new)
            if _worst(new) < LIMITS.fast * error:
                at, left, error = whole, new, _worst(new)
                continue
            for other, its_effect in tried:
                share = _dot(effect, its_effect)
                change, effect = _sum(change, -share, other), _sum(effect, -share, its_effect)
            length = float(np.sqrt(_dot(effect, effect)))
            if not 0.0 < length < np.inf:
                break
            change, effect = (_scaled(part, [1.0 / length] * 3) for part in (change, effect))
            tried.append((change, effect))
            step = _dot(effect, left)
            new = _sum(left, -step, effect)
            if not _worst(new) < LIMITS.slow * error:
                break
            at, left, error = _sum(at, step, change), new, _worst(new)
        if tried:  # only whole steps satisfy the equations to rounding
            last = _sum(at, 1.0, self._once(*_scaled(left, back)))
            if _worst(_scaled(self._residual(right, last), units)) < error:
                return last
        return at

    def _residual(self, right: Triple, at: Triple) -> Triple:
        x, y, z = at
        own, across = self.A @ x, self.At @ np.concatenate([y, z])
        p = self.equations
        return right[0] - across, right[1] - own[:p], right[2] - own[p:] + self.scaling.squared(z)

    def _once(self, rx: FloatArray, ry: FloatArray, rz: FloatArray) -> Triple:
        squared, edge = self.scaling.squared, self._edge
        right = rx + self.Gt @ squared(rz, -1.0)
        y = self._schur(self.E @ self._local(right) - ry)
        if edge.size:
            border = self._corner @ (right[self.border] - edge.T @ y)
            y = y + self._solved_edge @ border
        x = self._local(right - self.Et @ y)
        if edge.size:
            x[self.border] = border
        return x, y, squared(self.G @ x - rz, -1.0)

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
    """Largest absolute entry, 0 of an empty vector."""
    return float(np.abs(v).max(initial=0.0))


def _worst(v: Triple) -> float:
    return max(largest(part) for part in v)


def _scaled(u: Triple, factors: Sequence[float]) -> Triple:
    return factors[0] * u[0], factors[1] * u[1], factors[2] * u[2]


def _sum(u: Triple, share: float, v: Triple) -> Triple:
    return u[0] + share * v[0], u[1] + share * v[1], u[2] + share * v[2]


def _dot(u: Triple, v: Triple) -> float:
    return sum(float(a @ b) for a, b in zip(u, v, strict=True))


def _scaled_rows(group: _Group, scaling: Scaling) -> FloatArray:
    """W^-1 G of each block, (r, c, k)."""
    part = group.cone_part
    scaled = np.empty_like(part)
    k = part.shape[2]
    diagonal = scaling.diagonal[group.orthant].reshape(-1, k)
    at = len(diagonal)
    scaled[:at] = part[:at] / diagonal[:, None]
    for slab in group.slabs:
        end = at + scaling.cones.shapes[slab][0]
        scaled[at:end] = scaling.over(slab, part[at:end])
        at = end
    return scaled


def _inverse_root(rows: FloatArray) -> FloatArray:
    """R (c, c, k) with R' R the inverse of rows' rows, for rows (r, c, k)."""
    gram = np.einsum("rik,rjk->ijk", rows, rows)
    c = len(gram)
    scale = 1.0 / np.sqrt(np.einsum("iik->ik", gram) * (1.0 + LIMITS.regularisation))
    gram *= scale[:, None] * scale
    root = np.zeros_like(gram)
    lower = np.zeros_like(gram)
    for i in range(c):
        for j in range(i):
            inner = np.einsum("ik,ik->k", lower[i, :j], lower[j, :j])
            lower[i, j] = (gram[i, j] - inner) / lower[j, j]
        pivot = 1.0 + LIMITS.regularisation - np.einsum("ik,ik->k", lower[i, :i], lower[i, :i])
        lower[i, i] = np.sqrt(pivot)
        root[i, :i] = -np.einsum("jk,jik->ik", lower[i, :i], root[:i, :i]) / lower[i, i]
        root[i, i] = 1.0 / lower[i, i]
    root *= scale[None]
    return root


class _Blocks:
    """Blocks of variables that share cones, by shape; those in no block form a border.

    Attributes
    ----------
    columns, rows : (n,), (m,) int arrays
        The order of variables and cone rows in which every group is a slab.
    inner : int
        Number of variables that are in blocks; the others come last.
    """

    def __init__(self, E: sp.csc_array, G: sp.csr_array, orthant: int, soc: list[int]) -> None:
        m, n = G.shape
        sizes = np.concatenate([np.ones(orthant, int), np.asarray(soc, int)])
        unit = np.repeat(np.arange(len(sizes)), sizes)  # the cone that each row belongs to
        entries = G.tocoo()
        ends = unit[entries.row], len(sizes) + entries.col
        total = len(sizes) + n
        links = sp.coo_array((np.ones(len(entries.row)), ends), shape=(total, total))
        count, label = connected_components(links, directed=False)
        group = label.astype(np.int64)
        of_row, of_column = group[: len(sizes)][unit], group[len(sizes) :]
        touched = np.diff(E.indptr)
        width = np.bincount(of_column, minlength=count)
        height = np.bincount(of_row, minlength=count)
        if np.any(width == 0):
            raise SolverError("blockwise: a cone row without variables; use another solver")
        in_equations = np.bincount(of_column, touched, count)
        is_border = (width == 1) & ((height == 0) | (in_equations > LIMITS.densest))
        border = np.flatnonzero(is_border[of_column])
        if len(border) > LIMITS.border or is_border.all():
            raise SolverError(
                f"blockwise: {len(border)} variables are in no cone or in more than "
                f"{LIMITS.densest} equations, at most {LIMITS.border} may be; use another solver"
            )
        pairs = np.unique(np.repeat(of_column, touched).astype(np.int64) * E.shape[0] + E.indices)
        self._pairs, self._of_pair = pairs, pairs // E.shape[0]
        reach = np.bincount(self._of_pair, minlength=count)
        self._check(~is_border, width, height, reach)
        self._E, self._G, self._of_column = E, G, of_column
        self._by_column = np.argsort(of_column, kind="stable")
        self._by_row = np.argsort(of_row, kind="stable")
        self._starts = [
            np.concatenate([[0], np.cumsum(counts)[:-1]]) for counts in (width, height, reach)
        ]
        self._reach, self._equations = reach, E.shape[0]
        cone_of_row = np.where(np.arange(m) < orthant, 1, -sizes[unit])
        found = self._alike(np.flatnonzero(~is_border), width, height, of_row, cone_of_row)
        edge_rows = np.flatnonzero(is_border[of_row])
        if np.any(edge_rows >= orthant):
            raise SolverError("blockwise: a border variable in a cone; use another solver")
        self._lay_out(found, edge_rows, border)

    @staticmethod
    def _check(
        is_block: NDArray[np.bool_], width: IntArray, height: IntArray, reach: IntArray
    ) -> None:
        wide = is_block & ((width > LIMITS.widest) | (reach > LIMITS.densest))
        if wide.any():
            worst = int(np.flatnonzero(wide)[0])
            raise SolverError(
                f"blockwise: {width[worst]} variables in {reach[worst]} equations hang together "
                f"through cones, more than {LIMITS.widest} in {LIMITS.densest}; use another solver"
            )
        loose = is_block & (height < width)
        if loose.any():
            worst = int(np.flatnonzero(loose)[0])
            raise SolverError(
                f"blockwise: {width[worst]} variables in {height[worst]} cone rows are not bounded "
                "by them; use another solver"
            )

    def _alike(
        self,
        members: IntArray,
        width: IntArray,
        height: IntArray,
        of_row: IntArray,
        cone_of_row: IntArray,
    ) -> list[tuple[IntArray, IntArray]]:
        """Blocks of one shape: number of variables, then 1 or minus the cone's size, row by row."""
        place = np.empty(len(of_row), int)
        place[self._by_row] = np.arange(len(of_row)) - np.repeat(self._starts[1], height)
        shape = np.zeros((len(width), int(height.max(initial=0)) + 1), int)
        shape[:, 0] = width
        shape[of_row, 1 + place] = cone_of_row
        kinds, kind = np.unique(shape[members], axis=0, return_inverse=True)
        return [(k, members[kind.ravel() == i]) for i, k in enumerate(kinds)]

    def _lay_out(
        self, found: list[tuple[IntArray, IntArray]], edge_rows: IntArray, border: IntArray
    ) -> None:
        """Slabs of variables and rows, group by group: linear rows of all groups come first."""
        columns, linear, cones, groups = [], [], [], []
        slabs: list[tuple[int, int]] = []
        at, row_at = 0, 0
        for shape, blocks in found:
            c, k = int(shape[0]), len(blocks)
            kinds = shape[1:][shape[1:] != 0]
            plain = int((kinds == 1).sum())
            own = self._by_column[self._starts[0][blocks] + np.arange(c)[:, None]]
            rows = self._by_row[self._starts[1][blocks] + np.arange(len(kinds))[:, None]]
            first, own_slabs = plain, []
            while first < len(kinds):
                d = -int(kinds[first])
                own_slabs.append(len(slabs))
                slabs.append((d, k))
                cones.append(rows[first : first + d].ravel())
                first += d
            columns.append(own.ravel())
            linear.append(rows[:plain].ravel())
            groups.append(self._group(blocks, own, rows, (at, row_at, plain), tuple(own_slabs)))
            at, row_at = at + c * k, row_at + plain * k
        self.columns = np.concatenate([*columns, border])
        self.rows = np.concatenate([*linear, edge_rows, *cones]).astype(np.int64)
        self.cones = Cones(row_at + len(edge_rows), slabs)
        self.groups, self.inner = groups, at

    def _group(
        self,
        blocks: IntArray,
        columns: IntArray,
        rows: IntArray,
        start: tuple[int, int, int],
        slabs: tuple[int, ...],
    ) -> _Group:
        (c, k), (at, row_at, plain) = columns.shape, start
        e = int(self._reach[blocks].max(initial=1))
        equations = np.full((e, k), self._equations)
        place = np.arange(e)[:, None]
        real = place < self._reach[blocks]
        index = np.where(real, self._starts[2][blocks] + place, 0)
        equations[real] = self._pairs[index][real] % self._equations
        padded = sp.vstack([self._E, sp.csr_array((1, self._E.shape[1]))], format="csr")
        return _Group(
            slice(at, at + c * k),
            slice(row_at, row_at + plain * k),
            slabs,
            _dense_parts(self._G, rows, columns),
            equations,
            _dense_parts(padded, equations, columns),
        )


def _dense_parts(matrix: sp.csr_array, rows: IntArray, columns: IntArray) -> FloatArray:
    """Sub-matrices (r, c, k) at rows (r, k) and columns (c, k)."""
    shape = (len(rows), *columns.shape)
    i = np.broadcast_to(rows[:, None], shape).ravel()
    j = np.broadcast_to(columns[None], shape).ravel()
    return np.asarray(sp.csr_array(matrix)[i, j]).reshape(shape)


def _rank(order: IntArray) -> IntArray:
    """Place of each index in an order: the inverse permutation."""
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank
