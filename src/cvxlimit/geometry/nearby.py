"""Which bodies of a scene come near each other: all pairs that touch, and few others.

A balanced tree of bounding boxes, descended level by level for all pairs at once: near n log n.
Boxes along the axes alone do not do: thousands of thin voussoirs of an arch overlap each other's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cvxlimit.arrays import BoolArray, FloatArray, IntArray

_FEW = 512
"""So many pairs of nodes take less time than boxes along the nodes' own axes."""


def nearby_pairs(bodies: Sequence[FloatArray], margin: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs of bodies, first < second and sorted, but for those whose boxes around their points (k,
    3), grown by their ``margin`` (n,), are apart."""
    levels = max(len(bodies) - 1, 0).bit_length()
    count = np.array([len(body) for body in bodies])
    begin = np.cumsum(count) - count
    order = _tree_order(np.add.reduceat(np.concatenate(bodies), begin) / count[:, None], levels)
    points = np.concatenate([bodies[i] for i in order])
    points = points - points.mean(axis=0)
    start = np.cumsum([0, *(len(bodies[i]) for i in order[:-1])])
    first = second = np.zeros(1, dtype=np.int64)
    for level in range(levels):
        step = 1 << (levels - level - 1)
        first, second = _children(first, second, -(-len(bodies) // step))
        leading = np.arange(0, len(bodies), step)
        reach = np.maximum.reduceat(margin[order], leading)
        first, second = _meeting(first, second, points, start[leading], reach)
    a, b = np.sort(np.stack([order[first], order[second]])[:, first != second], axis=0)
    sorting = np.lexsort((b, a))
    return a[sorting], b[sorting]


def _tree_order(centres: FloatArray, levels: int) -> IntArray:
    """Bodies so that each run of 2^k from a multiple of 2^k, a node of the tree, lies together."""
    place = np.arange(len(centres))
    order = place
    for level in range(levels):
        node = place >> (levels - level)
        leading = np.searchsorted(node, np.arange(node[-1] + 1))
        laid = centres[order]
        extent = np.maximum.reduceat(laid, leading) - np.minimum.reduceat(laid, leading)
        along = laid[place, extent.argmax(axis=1)[node]]
        order = order[np.lexsort((along, node))]
    return order


def _children(first: IntArray, second: IntArray, count: int) -> tuple[IntArray, IntArray]:
    a = (2 * first[:, None] + np.array([0, 0, 1, 1])).ravel()
    b = (2 * second[:, None] + np.array([0, 1, 0, 1])).ravel()
    there = (a <= b) & (b < count)
    return a[there], b[there]


def _meeting(
    first: IntArray, second: IntArray, points: FloatArray, start: IntArray, margin: FloatArray
) -> tuple[IntArray, IntArray]:
    low = np.minimum.reduceat(points, start) - margin[:, None]
    high = np.maximum.reduceat(points, start) + margin[:, None]
    meet = overlapping(low, high, first, low, high, second)
    first, second = first[meet], second[meet]
    if len(first) <= _FEW:
        return first, second
    middle, axes, half = _own_boxes(points, start, margin)
    offset = middle[second] - middle[first]
    turn = np.abs(np.einsum("pik,pjk->pij", axes[first], axes[second]))
    of_first = np.abs(np.einsum("pik,pk->pi", axes[first], offset))
    of_second = np.abs(np.einsum("pik,pk->pi", axes[second], offset))
    reach = half[first] + np.einsum("pij,pj->pi", turn, half[second])
    reach_back = half[second] + np.einsum("pij,pi->pj", turn, half[first])
    meet = ((of_first <= reach) & (of_second <= reach_back)).all(axis=1)
    return first[meet], second[meet]


def overlapping(
    low: FloatArray,
    high: FloatArray,
    one: IntArray,
    other_low: FloatArray,
    other_high: FloatArray,
    other: IntArray,
) -> BoolArray:
    """Which boxes ``one`` (k,) of ``low`` to ``high`` (n, 3) meet those ``other`` (k,)."""
    result = np.ones(len(one), dtype=bool)
    for axis in range(3):  # one at a time: NumPy takes long over rows of three
        below = low[:, axis][one] <= other_high[:, axis][other]
        result &= below & (other_low[:, axis][other] <= high[:, axis][one])
    return result


def _own_boxes(
    points: FloatArray, start: IntArray, margin: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    count = np.diff(np.append(start, len(points)))
    node = np.repeat(np.arange(len(start)), count)
    centre = np.add.reduceat(points, start) / count[:, None]
    spokes = points - centre[node]
    spread = np.add.reduceat(spokes[:, :, None] * spokes[:, None, :], start)
    axes = np.linalg.eigh(spread)[1].transpose(0, 2, 1)
    local = np.einsum("mik,mk->mi", axes[node], spokes)
    low, high = np.minimum.reduceat(local, start), np.maximum.reduceat(local, start)
    middle = centre + np.einsum("ni,nik->nk", 0.5 * (low + high), axes)
    return middle, axes, 0.5 * (high - low) + margin[:, None]
