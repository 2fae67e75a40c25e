"""The same algebra, compiled (``batch.c``): NumPy takes hundreds of calls for an iteration, which
on few contacts cost more than what they compute.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.solvers.extensions import BATCH
from cvxlimit.solvers.interior.blocks import LIMITS, Group
from cvxlimit.solvers.interior.cones import Cones, NesterovTodd
from cvxlimit.solvers.interior.elimination import NewtonSystem


def newton_system(
    A: sp.csr_array, zero: int, orthant: int, soc: list[int], backend: str
) -> NewtonSystem:
    """Compiled, if that could be built."""
    kind = NewtonSystem if BATCH is None else CompiledSystem
    return kind(A, zero, orthant, soc, backend)


class CompiledCones(Cones):
    """Products of cones, compiled."""

    def __init__(self, orthant: int, slabs: Sequence[tuple[int, int]]) -> None:
        super().__init__(orthant, slabs)
        self.layout = np.array([orthant, *np.ravel(slabs)], dtype=np.int64)

    def product(self, u: FloatArray, v: FloatArray) -> FloatArray:
        BATCH.product(self.layout, u, v, result := np.empty(self.size))
        return result

    def quotient(self, v: FloatArray, u: FloatArray) -> FloatArray:
        BATCH.quotient(self.layout, v, u, result := np.empty(self.size))
        return result

    def clipped(self, u: FloatArray, low: float, high: float) -> FloatArray:
        BATCH.clipped(self.layout, u, low, high, result := np.empty(self.size))
        return result

    def margin(self, u: FloatArray) -> float:
        return float(BATCH.margin(self.layout, u))

    def steps(self, u: FloatArray, *directions: FloatArray) -> list[float]:
        worst = [BATCH.shortest(self.layout, u, d) for d in directions]
        return [1.0 / w if w > 0.0 else np.inf if w == 0.0 else w for w in worst]

    def scaling(self, s: FloatArray, z: FloatArray) -> NesterovTodd:
        return CompiledScaling(self, s, z)


class CompiledScaling(NesterovTodd):
    """The same W: ``plain`` is s / z in the orthant, ``w`` the slabs' frames, ``sizes`` theirs."""

    def __init__(self, cones: CompiledCones, s: FloatArray, z: FloatArray) -> None:
        self.cones = cones
        self.plain, self.w = np.split(np.empty(cones.size), [cones.orthant])
        self.sizes = np.empty(cones.degree - cones.orthant)
        if not BATCH.scaling(cones.layout, s, z, self.plain, self.w, self.sizes):
            raise FloatingPointError("an iterate left the cones")
        self._given = cones.layout, self.plain, self.w, self.sizes
        self.lam = self.times(z)

    def times(self, v: FloatArray, sign: float = 1.0) -> FloatArray:
        BATCH.times(*self._given, v, sign, result := np.empty_like(v))
        return result

    def squared(self, v: FloatArray, sign: float = 1.0) -> FloatArray:
        BATCH.squared(*self._given, v, sign, result := np.empty_like(v))
        return result


class Rows:
    """A sparse matrix, to be multiplied by one vector."""

    def __init__(self, matrix: sp.csr_array) -> None:
        self.indptr = matrix.indptr.astype(np.int32)
        self.indices = matrix.indices.astype(np.int32)
        self.data = matrix.data

    def __matmul__(self, v: FloatArray) -> FloatArray:
        result = np.empty(len(self.indptr) - 1)
        BATCH.matvec(self.indptr, self.indices, self.data, v, result)
        return result


LANES = 4
"""Blocks in a tile."""


class _Table(NamedTuple):
    """What batch.c has to know of a group, and room for its roots."""

    shape: IntArray  # r, c, k, linear rows, the first of these
    slabs: IntArray  # size and places in w and sizes of each cone of a block
    square: IntArray  # c, e, tiles
    slots: NDArray[np.int32]  # (tiles, e (e + 1) / 2, LANES): where products are added
    local: IntArray  # c, k, the first of its variables
    root: FloatArray  # (tiles, c, c, LANES)


class CompiledSystem(NewtonSystem):
    """The Newton system. Parts of groups come in tiles of blocks: (tiles, i, j, LANES)."""

    cones_type = CompiledCones
    scaling: CompiledScaling

    def _laid_out(self, A: sp.csr_array) -> tuple[list[sp.csr_array], list[FloatArray]]:
        matrices, arrays = super()._laid_out(A)
        return matrices, [*(_tiled(array) for array in arrays[:-2]), *arrays[-2:]]

    def _name(self, matrices: Sequence[Any], arrays: list[FloatArray]) -> None:
        kept = [m if isinstance(m, Rows) else Rows(m) for m in matrices]
        super()._name(kept, arrays)

    def _set_pattern(self) -> None:
        at = [self._position[group.equations.T] for group in self.groups]
        shapes = np.array([part.shape for part in at])
        sizes = shapes[:, 0] * shapes[:, 1] * (shapes[:, 1] + 1) // 2
        self._indptr = np.empty(self.equations + 1, dtype=np.int64)
        indices = np.empty(sizes.sum() + self.equations, dtype=np.int64)
        slots = np.empty(sizes.sum(), dtype=np.int32)
        places = np.concatenate([part.ravel() for part in at])
        count = BATCH.pattern(shapes.ravel(), places, self._indptr, indices, slots)
        self._indices = indices[:count].copy()
        own = np.split(slots, np.cumsum(sizes)[:-1])
        pairs = zip(self.groups, own, strict=True)
        self._tables = [self._table(g, o.reshape(g.rows.shape[1], -1).T) for g, o in pairs]

    def _table(self, group: Group, slots: NDArray[np.int32]) -> _Table:
        (r, k), (c, _), e = group.rows.shape, group.given.shape, len(group.equations)
        shapes = np.array(self.cones.shapes, dtype=np.int64).reshape(-1, 2)
        entries, cones = np.cumsum(shapes.prod(axis=1)), np.cumsum(shapes[:, 1])
        starts = np.stack([shapes[:, 0], entries - shapes.prod(axis=1), cones - shapes[:, 1]])
        plain = (group.orthant.stop - group.orthant.start) // k
        at = _tiled(slots, -1)
        tiles = len(at)
        return _Table(
            np.array([r, c, k, plain, group.orthant.start]),
            np.ascontiguousarray(starts[:, list(group.slabs)].T).ravel(),
            np.array([c, e, tiles]),
            at,
            np.array([c, k, group.columns.start]),
            np.empty((tiles, c, c, LANES)),
        )

    def _summed(self, hard: float) -> FloatArray:
        scaling, data = self.scaling, np.zeros(len(self._indices))
        numbers = LIMITS.regularisation, hard, LIMITS.softest
        for group, at in zip(self.groups, self._tables, strict=True):
            frames = at.slabs, scaling.w, scaling.sizes
            BATCH.roots(at.shape, group.cone_part, scaling.plain, *frames, *numbers, at.root)
            BATCH.add_squares(at.square, at.root, group.equation_part, at.slots, data)
        return data

    def _local(self, right: FloatArray) -> FloatArray:
        result = np.zeros(self.variables)
        for table in self._tables:
            BATCH.local(table.local, table.root, right, result)
        return result


def _tiled(parts: NDArray[Any], beyond: int | None = None) -> NDArray[Any]:
    """(..., k) to (tiles, ..., LANES); the last block is repeated beyond the last, or a number."""
    *shape, k = parts.shape
    more = np.repeat(parts[..., -1:], -k % LANES, axis=-1)
    if beyond is not None:
        more[:] = beyond
    whole = np.concatenate([parts, more], axis=-1).reshape(*shape, -1, LANES)
    return np.ascontiguousarray(np.moveaxis(whole, -2, 0))
