"""The Newton system of a cone program whose cone rows hang together in small blocks.

For a limit problem the blocks are the contacts: a contact's forces and their auxiliary variables
meet other contacts in the equilibrium of blocks only. Eliminating them leaves a Schur complement
with six rows per masonry block, far smaller than what a general solver factorises.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cvxlimit.errors import SolverError
from cvxlimit.solvers.blockwise.cones import Cones, Scaling
from cvxlimit.solvers.sparse import BACKENDS, nested_dissection

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Triple = tuple[FloatArray, FloatArray, FloatArray]

_WIDEST = 128
"""Most variables of one block: beyond that dense blocks do not pay."""

_DENSEST = 200
"""A variable in more equations than this borders the Schur complement (the load factor does)."""

_MOST_BORDER = 20

_REGULARISATION = 1e-14
"""Added to diagonals, relatively; conjugate residuals take its effect out of the solution."""

_ROUNDS, _SLOW, _TARGET, _FLOOR = 7, 0.9, 1e-5, 1e-6
"""At most so many rounds, until one gains less than this factor or every part of the residual is
below the target, relative to its own right-hand side or this share of the largest."""

_FAST = 0.1
"""Plain refinement is kept up while it gains this factor."""


@dataclass(frozen=True)
class _SecondOrder:
    """A second-order cone that every block of a group has: its size class, numbers (k,), place."""

    size_class: int
    numbers: IntArray
    first_row: int


@dataclass(frozen=True, eq=False)
class _Group:
    """k blocks of one shape: c variables, r cone rows (non-negative first), e equations."""

    columns: IntArray  # (k, c)
    rows: IntArray  # (k, r)
    soc: tuple[_SecondOrder, ...]
    cone_part: FloatArray  # (k, r, c)
    equations: IntArray  # (k, e), padded with the number of equations
    equation_part: FloatArray  # (k, e, c)

    @property
    def nonneg(self) -> int:
        """Number of non-negative rows of each block."""
        return self.soc[0].first_row if self.soc else self.rows.shape[1]


@dataclass(frozen=True)
class _Block:
    """One connected set of cone rows and variables; ``cones`` are (size class, number)."""

    columns: IntArray
    rows: IntArray
    cones: tuple[tuple[int, int], ...]
    equations: IntArray

    @property
    def shape(self) -> tuple[int, int, tuple[int, ...]]:
        return len(self.columns), len(self.rows), tuple(size for size, _ in self.cones)


class NewtonSystem:
    """[0 E' G'; E 0 0; G 0 -W^2] (x, y, z) = right-hand side, by block elimination.

    Parameters
    ----------
    E : (p, n) sparse array
        Equations.
    G : (m, n) sparse array
        Cone rows.
    cones : Cones
        Of size m.
    backend : str
        One of :data:`BACKENDS`.

    Raises
    ------
    SolverError
        If the cone rows do not fall apart into small blocks.
    """

    def __init__(self, E: sp.csr_array, G: sp.csr_array, cones: Cones, backend: str) -> None:
        self.E, self.G, self.cones = E.tocsr(), G.tocsr(), cones
        self.Et, self.Gt = self.E.T.tocsr(), self.G.T.tocsr()
        self.equations, self.variables = E.shape
        if not self.equations:
            raise SolverError("blockwise: there are no equations; use another solver")
        blocks, self.border = _blocks(self.E.tocsc(), self.G, cones)
        self._edge = self.E[:, self.border].toarray()
        self._border_cones = self.G[:, self.border].toarray()
        self.groups = [self._group(members) for members in _alike(blocks)]
        self._set_order()
        self._set_pattern()
        self.factorisation = BACKENDS[backend](self._indices, self._indptr)

    def _group(self, blocks: list[_Block]) -> _Group:
        equations = np.full((len(blocks), max(len(b.equations) for b in blocks)), self.equations)
        for row, block in zip(equations, blocks, strict=True):
            row[: len(block.equations)] = block.equations
        columns = np.stack([b.columns for b in blocks])
        rows = np.stack([b.rows for b in blocks])
        classes = blocks[0].shape[2]
        widths = [self.cones.soc[size].shape[1] for size in classes]
        first = rows.shape[1] - sum(widths) + np.concatenate([[0], np.cumsum(widths)])
        soc = tuple(
            _SecondOrder(size, np.array([b.cones[j][1] for b in blocks]), int(first[j]))
            for j, size in enumerate(classes)
        )
        padded = sp.vstack([self.E, sp.csr_array((1, self.variables))], format="csr")
        return _Group(
            columns,
            rows,
            soc,
            _dense_parts(self.G, rows, columns),
            equations,
            _dense_parts(padded, equations, columns),
        )

    def _set_order(self) -> None:
        """Elimination order: equations with the same blocks form one node of the graph."""
        owners, rows, count = [], [], 0
        for group in self.groups:
            k, width = group.equations.shape
            owners.append(np.repeat(count + np.arange(k), width))
            rows.append(group.equations.ravel())
            count += k
        row, owner = np.concatenate(rows), np.concatenate(owners)
        real = row < self.equations
        shape = (self.equations, count)
        touches = sp.csr_array((np.ones(real.sum()), (row[real], owner[real])), shape=shape)
        fingerprint = touches @ np.random.default_rng(0).random(count)
        _, node = np.unique(fingerprint, return_inverse=True)
        members = sp.csr_array((np.ones(self.equations), (node, np.arange(self.equations))))
        node_touches = members @ touches
        node_rank = _rank(nested_dissection((node_touches @ node_touches.T).tocsr()))
        self.order = np.argsort(node_rank[node], kind="stable")
        self._position = np.append(_rank(self.order), self.equations)

    def _set_pattern(self) -> None:
        """Compressed columns of the Schur complement, and where each block's entries go."""
        p = self.equations
        keys = []
        for group in self.groups:
            at = self._position[group.equations]
            inside = (at[:, :, None] < p) & (at[:, None, :] < p)
            keys.append(np.where(inside, at[:, None, :] * p + at[:, :, None], p * p).ravel())
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
        self.scaling = scaling
        inverse = list(scaling.inverse_blocks())
        self._roots = [_inverse_root(_hessian(g, scaling, inverse)) for g in self.groups]
        parts = []
        for group, root in zip(self.groups, self._roots, strict=True):
            half = root @ group.equation_part.transpose(0, 2, 1)
            parts.append((half.transpose(0, 2, 1) @ half).ravel())
        sums = np.bincount(self._slot, np.concatenate(parts), len(self._indices) + 1)
        data = np.asarray(sums[:-1], dtype=float)
        diagonal = data[self._diagonal] * (1.0 + _REGULARISATION)
        data[self._diagonal] = np.where(diagonal > 0.0, diagonal, 1.0)
        self._solve = self.factorisation.factorise(data)
        if len(self.border):
            self._solved_edge = self._schur(self._edge)
            own = np.stack([scaling.over(column) for column in self._border_cones.T])
            self._corner = np.linalg.inv(self._edge.T @ self._solved_edge + own @ own.T)

    def solve(self, rx: FloatArray, ry: FloatArray, rz: FloatArray) -> Triple:
        """x (n,), y (p,), z (m,) by elimination, refined, and improved by conjugate residuals.

        Rounding makes elimination wrong in a few directions. Iterative refinement takes those out
        slowly, or stops early; generalised conjugate residuals (S. C. Eisenstat, H. C. Elman,
        M. H. Schultz, Variational iterative methods for nonsymmetric systems of linear equations,
        1983) do it in a few rounds: on a panel of 4,914 contacts the residual of the flow rule
        ended at 1e-11 in place of 1e-8. A plain step comes first where it gains much, and last,
        because only whole steps satisfy the equations E x = ry to rounding.
        """
        right = (rx, ry, rz)
        most = max(largest(r) for r in right) or 1.0
        units = [1.0 / max(largest(r), _FLOOR * most) for r in right]
        best = _Guess(self, right, units, self._once(*right))
        tried: list[tuple[Triple, Triple]] = []
        for _ in range(_ROUNDS):
            if not best.error >= _TARGET:
                break
            change = best.correction()
            new = best.moved(1.0, change)
            if not new.error < _FAST * best.error:
                step = self._conjugate(change, units, tried)
                if step is None:
                    break
                change, effect = step
                new = best.moved(_dot(effect, best.left), change)
            if not new.error < _SLOW * best.error:
                break
            best = new
        if tried:
            last = best.moved(1.0, best.correction())
            best = last if last.error < best.error else best
        return best.at

    def _conjugate(
        self, change: Triple, units: list[float], tried: list[tuple[Triple, Triple]]
    ) -> tuple[Triple, Triple] | None:
        """A change of (x, y, z) and its scaled effect, of length 1 and square to those before."""
        nothing = _scaled(change, [0.0] * 3)
        effect = _scaled(self._residual(nothing, change), [-unit for unit in units])
        for _ in range(2):  # the second time against rounding
            for other, its_effect in tried:
                share = _dot(effect, its_effect)
                change, effect = _sum(change, -share, other), _sum(effect, -share, its_effect)
        length = float(np.sqrt(_dot(effect, effect)))
        if not 0.0 < length < np.inf:
            return None
        change, effect = (_scaled(part, [1.0 / length] * 3) for part in (change, effect))
        tried.append((change, effect))
        return change, effect

    def _residual(self, right: Triple, at: Triple) -> Triple:
        x, y, z = at
        return (
            right[0] - self.Et @ y - self.Gt @ z,
            right[1] - self.E @ x,
            right[2] - self.G @ x + self.scaling.squared(z),
        )

    def _once(self, rx: FloatArray, ry: FloatArray, rz: FloatArray) -> Triple:
        over_squared = self.scaling.over_squared
        right = rx + self.Gt @ over_squared(rz)
        y = self._schur(self.E @ self._local(right) - ry)
        if len(self.border):
            border = self._corner @ (right[self.border] - self._edge.T @ y)
            y = y + self._solved_edge @ border
        x = self._local(right - self.Et @ y)
        if len(self.border):
            x[self.border] = border
        return x, y, over_squared(self.G @ x - rz)

    def _schur(self, right: FloatArray) -> FloatArray:
        result = np.empty_like(right)
        result[self.order] = self._solve(right[self.order])
        return result

    def _local(self, right: FloatArray) -> FloatArray:
        """(G' W^-2 G)^-1 on the variables of all blocks; 0 on the border."""
        result = np.zeros(self.variables)
        for group, root in zip(self.groups, self._roots, strict=True):
            half = root @ right[group.columns][:, :, None]
            result[group.columns] = (root.transpose(0, 2, 1) @ half)[:, :, 0]
        return result


def inner(a: FloatArray, b: FloatArray) -> float:
    """a'b without BLAS, whose threads wait for each other on a busy machine."""
    return float(np.einsum("i,i->", a, b))


class _Guess:
    """A solution (x, y, z), what it leaves of the right-hand side in units, and the worst."""

    def __init__(self, system: NewtonSystem, right: Triple, units: list[float], at: Triple) -> None:
        self.system, self.right, self.units, self.at = system, right, units, at
        self.left = _scaled(system._residual(right, at), units)
        self.error = max(largest(part) for part in self.left)

    def correction(self) -> Triple:
        """What elimination adds to take away what is left."""
        return self.system._once(*_scaled(self.left, [1.0 / unit for unit in self.units]))

    def moved(self, step: float, change: Triple) -> _Guess:
        """A step further along a change."""
        return _Guess(self.system, self.right, self.units, _sum(self.at, step, change))


def largest(v: FloatArray) -> float:
    """Largest absolute entry, 0 of an empty vector."""
    return float(np.abs(v).max(initial=0.0))


def _scaled(u: Triple, factors: Sequence[float]) -> Triple:
    return factors[0] * u[0], factors[1] * u[1], factors[2] * u[2]


def _sum(u: Triple, share: float, v: Triple) -> Triple:
    return u[0] + share * v[0], u[1] + share * v[1], u[2] + share * v[2]


def _dot(u: Triple, v: Triple) -> float:
    return sum(inner(a, b) for a, b in zip(u, v, strict=True))


def _hessian(group: _Group, scaling: Scaling, inverse: list[FloatArray]) -> FloatArray:
    """G' W^-2 G of each block, (k, c, c)."""
    scaled = np.empty_like(group.cone_part)
    plain = group.nonneg
    if plain:
        diagonal = scaling.diagonal[group.rows[:, :plain]]
        scaled[:, :plain] = group.cone_part[:, :plain] / diagonal[:, :, None]
    for cone in group.soc:
        w = inverse[cone.size_class][cone.numbers]
        place = slice(cone.first_row, cone.first_row + w.shape[1])
        scaled[:, place] = w @ group.cone_part[:, place]
    return scaled.transpose(0, 2, 1) @ scaled


def _inverse_root(matrices: FloatArray) -> FloatArray:
    """R with R' R the inverse of each positive definite matrix (k, c, c), scaled to be safe."""
    diagonal = np.einsum("kii->ki", matrices) * (1.0 + _REGULARISATION)
    scale = 1.0 / np.sqrt(diagonal)
    unit = matrices * scale[:, :, None] * scale[:, None, :]
    np.einsum("kii->ki", unit)[...] = 1.0 + _REGULARISATION
    return np.linalg.inv(np.linalg.cholesky(unit)) * scale[:, None, :]


def _blocks(E: sp.csc_array, G: sp.csr_array, cones: Cones) -> tuple[list[_Block], IntArray]:
    """Blocks of variables that share cones; and single variables without cones or in many
    equations, which form a border."""
    unit, cone_of = _units(cones)
    m, n = G.shape
    entries = G.tocoo()
    ends = np.concatenate([entries.row, np.arange(m)]), np.concatenate([m + entries.col, unit])
    links = sp.coo_array((np.ones(len(ends[0])), ends), shape=(m + n, m + n))
    _, label = connected_components(links, directed=False)
    blocks, border = [], []
    for part in _classes(label.astype(np.int64)):
        first_column = np.searchsorted(part, m)
        rows, columns = part[:first_column], part[first_column:] - m
        if not len(columns):
            raise SolverError("blockwise: a cone row without variables; use another solver")
        equations = np.unique(
            np.concatenate([E.indices[E.indptr[c] : E.indptr[c + 1]] for c in columns])
        )
        if len(columns) == 1 and (not len(rows) or len(equations) > _DENSEST):
            border.append(int(columns[0]))
            continue
        _check_block(columns, rows, equations)
        held = tuple(cone_of[row] for row in rows.tolist() if row in cone_of)
        blocks.append(_Block(columns, rows, held, equations))
    if len(border) > _MOST_BORDER or not blocks:
        raise SolverError(
            f"blockwise: {len(border)} variables are in no cone or in more than {_DENSEST} "
            f"equations, at most {_MOST_BORDER} may be; use another solver"
        )
    return blocks, np.array(border, dtype=np.int64)


def _check_block(columns: IntArray, rows: IntArray, equations: IntArray) -> None:
    if len(columns) > _WIDEST or len(equations) > _DENSEST:
        raise SolverError(
            f"blockwise: {len(columns)} variables in {len(equations)} equations hang together "
            f"through cones, more than {_WIDEST} in {_DENSEST}; use another solver"
        )
    if len(rows) < len(columns):
        raise SolverError(
            f"blockwise: {len(columns)} variables in {len(rows)} cone rows are not bounded by "
            "them; use another solver"
        )


def _units(cones: Cones) -> tuple[IntArray, dict[int, tuple[int, int]]]:
    """First row of the cone each row belongs to; size class and number by a cone's first row."""
    unit = np.arange(cones.size)
    cone_of = {}
    for size, i in enumerate(cones.soc):
        unit[i] = i[:, :1]
        for number, first in enumerate(i[:, 0].tolist()):
            cone_of[first] = (size, number)
    return unit, cone_of


def _classes(label: IntArray) -> list[IntArray]:
    """Indices of equal label, ascending."""
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _alike(blocks: list[_Block]) -> Iterator[list[_Block]]:
    """Blocks of the same shape, together."""
    found: dict[tuple[int, int, tuple[int, ...]], list[_Block]] = {}
    for block in blocks:
        found.setdefault(block.shape, []).append(block)
    yield from found.values()


def _dense_parts(matrix: sp.csr_array, rows: IntArray, columns: IntArray) -> FloatArray:
    """Sub-matrices (k, r, c) at rows (k, r) and columns (k, c)."""
    shape = (*rows.shape, columns.shape[1])
    if 0 in shape:
        return np.zeros(shape)
    i = np.broadcast_to(rows[:, :, None], shape).ravel()
    j = np.broadcast_to(columns[:, None, :], shape).ravel()
    return np.asarray(sp.csr_array(matrix)[i, j]).reshape(shape)


def _rank(order: IntArray) -> IntArray:
    """Place of each index in an order: the inverse permutation."""
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank
