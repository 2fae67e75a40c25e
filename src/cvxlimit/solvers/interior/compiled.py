"""The same algebra, compiled (``batch.c``): NumPy takes hundreds of calls for an iteration, which
on few contacts cost more than what they compute.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.solvers.extensions import BATCH
from cvxlimit.solvers.interior.blocks import LIMITS, Group
from cvxlimit.solvers.interior.cones import Cones, NesterovTodd
from cvxlimit.solvers.interior.elimination import Entries, NewtonSystem, Places
from cvxlimit.solvers.sparse import Indices


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

    def __init__(self, data: FloatArray, indices: Indices, indptr: Indices, width: int) -> None:
        self.width = width
        self.given = indptr.astype(np.int32), indices, data

    def transpose(self) -> Columns:
        return Columns(self)

    def __matmul__(self, v: FloatArray) -> FloatArray:
        BATCH.matvec(*self.given, v, result := np.empty(len(self.given[0]) - 1))
        return result


class Columns:
    """The transpose of a sparse matrix."""

    def __init__(self, rows: Rows) -> None:
        self.rows = rows

    def __matmul__(self, v: FloatArray) -> FloatArray:
        BATCH.transposed_matvec(*self.rows.given, v, result := np.zeros(self.rows.width))
        return result


LANES = 1 if BATCH is None else BATCH.LANES
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

    _sparse = staticmethod(Rows)

    def _places_of(self, group: Group, cones: Entries, equations: Entries) -> list[Places]:
        c, k = group.given.shape
        result: list[Places] = []
        for height, entries in ((len(group.rows), cones), (len(group.equations), equations)):
            last = [part[entries[3] == k - 1] for part in entries]
            more = [(*last[:3], last[3] + i) for i in range(1, 1 + -k % LANES)]
            entry, place, variable, block = map(np.concatenate, zip(entries, *more, strict=True))
            tile, lane = np.divmod(block, LANES)
            at = ((tile * height + place) * c + variable) * LANES + lane
            result.append(((-(-k // LANES), height, c, LANES), at, entry))
        return result

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
        at = _tiled(slots)
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


def _tiled(slots: NDArray[np.int32]) -> NDArray[np.int32]:
    """(..., k) to (tiles, ..., LANES), with -1 beyond the last."""
    *shape, k = slots.shape
    more = np.full((*shape, -k % LANES), -1, dtype=slots.dtype)
    whole = np.concatenate([slots, more], axis=-1).reshape(*shape, -1, LANES)
    return np.ascontiguousarray(np.moveaxis(whole, -2, 0))
