"""Which bodies of a scene come near each other: all pairs that touch, and few others.

Two bodies are near if their boxes along x, y, z meet, and those along their own principal axes do:
boxes along x, y, z of thousands of thin voussoirs of an arch all overlap.

1. Pairs of boxes that meet in plan, from a tree (GEOS), some bodies at a time.
2. Of these the pairs whose boxes meet along all axes, and along both bodies' own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray

_AT_ONCE = 64
"""Bodies that the tree is asked about together: each may meet all others, where a program has lost
the placements of blocks, and the boxes of that many pairs are to fit into memory."""

_PORTION = 2**14
"""Pairs that are yielded together: about 50 MB of facets, and all at once for scenes of ten
thousand contacts."""


def nearby_pairs(
    bodies: Sequence[FloatArray], margin: FloatArray
) -> Iterator[tuple[IntArray, IntArray]]:
    """Yields pairs of bodies, first < second, without those whose boxes are apart. A body is its
    points (k, 3); its box is grown by its ``margin`` (n,). Pairs come sorted, in one portion or
    several, so that memory does not grow with their number."""
    boxes = _Boxes.of(bodies, margin)
    low, high = boxes.low, boxes.high
    # The plan is across the axis along which boxes reach over the largest share of the whole.
    whole = np.maximum(high.max(axis=0) - low.min(axis=0), 1e-300)
    plan = np.argsort((high - low).mean(axis=0) / whole)[:2]
    seen_in_plan = shapely.box(*low[:, plan].T, *high[:, plan].T)
    tree = shapely.STRtree(seen_in_plan)
    waiting = np.empty((2, 0), dtype=np.int64)
    for begin in range(0, len(bodies), _AT_ONCE):
        first, second = tree.query(seen_in_plan[begin : begin + _AT_ONCE])
        ahead = first + begin < second
        found = boxes.meeting(first[ahead] + begin, second[ahead])
        waiting = np.concatenate([waiting, found[:, np.lexsort(found[::-1])]], axis=1)
        while waiting.shape[1] > _PORTION:
            yield waiting[0, :_PORTION], waiting[1, :_PORTION]
            waiting = waiting[:, _PORTION:]
    yield waiting[0], waiting[1]


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Of n bodies: the ``low`` and ``high`` corners (n, 3) of their boxes along x, y, z; the
    ``middle`` (n, 3), ``axes`` (n, 3, 3; rows) and ``half`` extents (n, 3) of those along their
    own."""

    low: FloatArray
    high: FloatArray
    middle: FloatArray
    axes: FloatArray
    half: FloatArray

    @classmethod
    def of(cls, bodies: Sequence[FloatArray], margin: FloatArray) -> _Boxes:
        count = np.array([len(body) for body in bodies])
        start, body = np.cumsum(count) - count, np.repeat(np.arange(len(bodies)), count)
        points = np.concatenate(bodies)
        points = points - points.mean(axis=0)
        low, high = (end.reduceat(points, start) for end in (np.minimum, np.maximum))
        # Principal axes of a body's points about their mean, and the points along them.
        centre = np.add.reduceat(points, start) / count[:, None]
        spokes = points - centre[body]
        spread = np.add.reduceat(spokes[:, :, None] * spokes[:, None, :], start)
        axes = np.linalg.eigh(spread)[1].transpose(0, 2, 1)
        local = np.einsum("mik,mk->mi", axes[body], spokes)
        least, most = (end.reduceat(local, start) for end in (np.minimum, np.maximum))
        middle = centre + np.einsum("ni,nik->nk", 0.5 * (least + most), axes)
        wide = margin[:, None]
        return cls(low - wide, high + wide, middle, axes, 0.5 * (most - least) + wide)

    def meeting(self, first: IntArray, second: IntArray) -> IntArray:
        """Those of the pairs (k,), (k,), as (2, m), whose boxes meet, of both kinds."""
        meet = overlapping(self.low, self.high, first, self.low, self.high, second)
        one, other = first[meet], second[meet]
        # Along each axis of one box: the distance of the middles against both half extents.
        offset = self.middle[other] - self.middle[one]
        turn = np.abs(np.einsum("pik,pjk->pij", self.axes[one], self.axes[other]))
        of_one = np.abs(np.einsum("pik,pk->pi", self.axes[one], offset))
        of_other = np.abs(np.einsum("pik,pk->pi", self.axes[other], offset))
        reach = self.half[one] + np.einsum("pij,pj->pi", turn, self.half[other])
        reach_back = self.half[other] + np.einsum("pij,pi->pj", turn, self.half[one])
        meet = ((of_one <= reach) & (of_other <= reach_back)).all(axis=1)
        return np.stack([one[meet], other[meet]])


def overlapping(
    low: FloatArray,
    high: FloatArray,
    one: IntArray,
    other_low: FloatArray,
    other_high: FloatArray,
    other: IntArray,
) -> BoolArray:
    """True (k,) where box ``one`` (k,) of those from ``low`` to ``high`` (n, 3) meets box ``other``
    (k,) of those from ``other_low`` to ``other_high``."""
    result = np.ones(len(one), dtype=bool)
    for axis in range(3):  # one at a time: NumPy takes long over rows of three
        below = low[:, axis][one] <= other_high[:, axis][other]
        result &= below & (other_low[:, axis][other] <= high[:, axis][one])
    return result
