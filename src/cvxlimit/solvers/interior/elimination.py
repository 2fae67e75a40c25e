"""The Newton system of a cone program whose cone rows hang together in small blocks: contacts.

A contact's forces and their auxiliary variables meet others in the equilibrium of blocks only.
Eliminating them leaves a Schur complement with six rows per masonry block.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import SolverError
from cvxlimit.solvers.extensions import BATCH
from cvxlimit.solvers.interior.blocks import LIMITS, Blocks, Group
from cvxlimit.solvers.interior.cones import Cones, NesterovTodd
from cvxlimit.solvers.sparse import BACKENDS, Indices, elimination_order

Entries = tuple[IntArray, IntArray, IntArray, IntArray]
"""Entries of A: numbers, their rows and columns in their blocks, and these."""

Places = tuple[tuple[int, ...], IntArray, IntArray]
"""An array's shape, places in it, and entries of A that go there."""


class NewtonSystem:
    """[0 E' G'; E 0 0; G 0 -W^2] (x, y, z) = right-hand side, by block elimination.

    ``columns`` and ``rows`` say which of the given variables and cone rows stand where. A holds the
    equations E, ``zero`` of them, then cone rows G, of which the first ``orthant`` are
    linear, followed by second-order cones of the sizes ``soc``. Raises SolverError if the cone rows
    do not fall apart into small blocks.
    """

    cones_type = Cones

    def __init__(
        self, A: sp.csr_array, zero: int, orthant: int, soc: list[int], backend: str
    ) -> None:
        E, G = A[:zero], A[zero:]
        self.equations, self.variables = E.shape
        if not self.equations:
            raise SolverError("blockwise: there are no equations; use another solver")
        found = Blocks(E.tocsr(), G.tocsr(), orthant, soc)
        self.columns, self.rows = found.columns, found.rows
        self.cones = self.cones_type(found.cones.orthant, found.cones.shapes)
        self.border, self.groups = slice(found.inner, self.variables), found.groups
        row, column = self._set_rows(A)
        self._places = [self._places_of(*own) for own in self._entries_by_group(row, column)]
        self._beyond = np.flatnonzero(column >= self.border.start)
        self._edge_at = row[self._beyond], column[self._beyond] - self.border.start
        self.renew(A.data)
        self.target = LIMITS.target
        self._set_order()
        self._set_pattern()
        self.factorisation = BACKENDS[backend](self._indices, self._indptr)

    def _set_rows(self, A: sp.csr_array) -> tuple[IntArray, IntArray]:
        """Which entry of A stands where in the order of the groups; their rows and columns.
        Products do not mind unsorted rows."""
        p = self.equations
        numbers = np.arange(len(A.data)), A.indices, A.indptr
        order = np.concatenate([np.arange(p), p + self.rows])
        placed = sp.csr_array(numbers, shape=A.shape)[order]
        self._given_entries = placed.data
        self._layout = _rank(self.columns)[placed.indices].astype(np.int32), placed.indptr
        self.lengths = np.diff(placed.indptr)  # entries of each equation and cone row
        return np.repeat(np.arange(len(order)), self.lengths), self._layout[0].astype(np.int64)

    @staticmethod
    def _sparse(data: FloatArray, indices: Indices, indptr: Indices, width: int) -> Any:
        return sp.csr_array((data, indices, indptr), shape=(len(indptr) - 1, width))

    def _entries_by_group(
        self, row: IntArray, column: IntArray
    ) -> list[tuple[Group, Entries, Entries]]:
        """Of each group, the entries in its blocks' cone rows and equations."""
        p = self.equations
        firsts = [group.columns.start for group in self.groups]
        owner = np.searchsorted([*firsts, self.border.start], column, side="right") - 1
        by_owner = np.argsort(owner, kind="stable")
        parts = np.split(by_owner, np.searchsorted(owner[by_owner], np.arange(1, len(firsts) + 1)))
        place, result = np.zeros(len(self.rows), dtype=np.int64), []
        for group in self.groups:
            place[group.rows] = np.arange(len(group.rows))[:, None]
        place = place[self.rows]
        for group, at in zip(self.groups, parts, strict=False):
            variable, block = np.divmod(column[at] - group.columns.start, group.given.shape[1])
            is_cone = row[at] >= p
            cones, equations = at[is_cone], at[~is_cone]
            found = _places_in(group.equations, row[equations], block[~is_cone], p)
            result.append(
                (
                    group,
                    (cones, place[row[cones] - p], variable[is_cone], block[is_cone]),
                    (equations, found, variable[~is_cone], block[~is_cone]),
                )
            )
        return result

    def _places_of(self, group: Group, cones: Entries, equations: Entries) -> list[Places]:
        c, k = group.given.shape
        return [
            ((height, c, k), (place * c + variable) * k + block, entry)
            for height, (entry, place, variable, block) in (
                (len(group.rows), cones),
                (len(group.equations), equations),
            )
        ]

    def renew(self, data: FloatArray) -> None:
        """Other numbers for the entries of A, in its order."""
        data, (indices, indptr), p = data[self._given_entries], self._layout, self.equations
        cut, n = int(indptr[p]), self.variables
        self.E = self._sparse(data[:cut], indices[:cut], indptr[: p + 1], n)
        self.G = self._sparse(data[cut:], indices[cut:], indptr[p:] - cut, n)
        self.A = self._sparse(data, indices, indptr, n)
        self.Et, self.Gt, self.At = (A.transpose() for A in (self.E, self.G, self.A))
        groups = []
        for group, places in zip(self.groups, self._places, strict=True):
            cones, equations = (
                np.asarray(np.bincount(at, data[entries], math.prod(shape)), float).reshape(shape)
                for shape, at, entries in places
            )
            groups.append(replace(group, cone_part=cones, equation_part=equations))
        self.groups = groups
        whole = np.zeros((self.equations + len(self.rows), self.variables - self.border.start))
        np.add.at(whole, self._edge_at, data[self._beyond])
        self._edge = whole[: self.equations]
        self._edge_rows = np.ascontiguousarray(whole[self.equations :].T)

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
        node_rank = _rank(elimination_order((node_touches @ node_touches.T).tocsr()))
        self.order = np.argsort(node_rank[node], kind="stable")
        self._position = np.append(_rank(self.order), self.equations)

    def _set_pattern(self) -> None:
        """Compressed columns of the Schur complement's lower half, and where entries go."""
        p, keys = self.equations, []
        for group in self.groups:
            at = self._position[group.equations.T]
            row, column = at[:, :, None], at[:, None]
            inside = (column <= row) & (row < p)
            keys.append(np.where(inside, column * p + row, -1))
        diagonal = np.arange(p) * (p + 1)
        unique = np.unique(np.concatenate([key[key >= 0] for key in keys] + [diagonal]))
        self._indices, self._indptr = unique % p, np.searchsorted(unique, np.arange(p + 1) * p)
        self._set_sums([np.where(k >= 0, np.searchsorted(unique, k), -1) for k in keys])

    def _set_sums(self, slots: list[IntArray]) -> None:
        """Where entries go of the Schur complement: ``slots`` (k, e, e) of each group, or -1."""
        whole = np.concatenate([slot.ravel() for slot in slots])
        entries = np.flatnonzero(whole >= 0)
        self._entries = np.empty(len(whole))  # of all groups, k blocks' (e, e) each
        ones, shape = np.ones(len(entries)), (len(self._indices), len(whole))
        self._sums = sp.csr_array((ones, (whole[entries], entries)), shape=shape)
        parts = np.split(self._entries, np.cumsum([slot.size for slot in slots])[:-1])
        self._parts = [part.reshape(slot.shape) for part, slot in zip(parts, slots, strict=True)]

    def _summed(self, hard: float) -> FloatArray:
        """Entries of the Schur complement."""
        self._roots = [
            group.eliminated(group.scaled_rows(self.scaling), hard, parts)
            for group, parts in zip(self.groups, self._parts, strict=True)
        ]
        return np.asarray(self._sums @ self._entries, dtype=float)

    def factorise(self, scaling: NesterovTodd) -> None:
        """Raises LinAlgError, RuntimeError or ArithmeticError where rounding makes it singular."""
        self.scaling = scaling
        data = self._summed(LIMITS.hard * LIMITS.target / self.target)
        first = self._indptr[:-1]
        diagonal = data[first] * (1.0 + LIMITS.regularisation)
        data[first] = np.where(diagonal > 0.0, diagonal, 1.0)
        if not np.isfinite(data).all():
            raise FloatingPointError("rounding has made a block singular")
        self._solve = self.factorisation.factorise(data)
        if self._edge.size:
            self._solved_edge = self._schur(self._edge)
            own = [scaling.squared(column, -1.0) for column in self._edge_rows]
            self._corner = np.linalg.inv(
                self._edge.T @ self._solved_edge + np.stack(own) @ self._edge_rows.T
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
    return float(np.abs(v).max(initial=0.0) if BATCH is None else BATCH.largest(v))


def _places_in(equations: IntArray, row: IntArray, block: IntArray, beyond: int) -> IntArray:
    """Where rows stand among the ``equations`` (e, k) of blocks, which ascend."""
    keys = (equations + (beyond + 1) * np.arange(equations.shape[1])).T.ravel()
    return np.searchsorted(keys, (beyond + 1) * block + row) - len(equations) * block


def _rank(order: IntArray) -> IntArray:
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank
