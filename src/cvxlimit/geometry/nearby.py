"""Which bodies of a scene come near each other: all pairs that touch, and few others.

Bodies are the leaves of a balanced tree of bounding boxes, which is descended level by level for
all pairs at once, in about n log n steps. Two nodes are near if their boxes along x, y, z meet and
their boxes along their own principal axes do: those along x, y, z of thousands of thin voussoirs of
an arch all overlap.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray

_FEW = 512
"""So many pairs of nodes take less time than boxes along the nodes' own axes."""

_PORTION = 2**14
"""Pairs of nodes whose children are looked at together: about 50 MB, and all at once for scenes of
ten thousand contacts. Of bodies that all lie in one place every pair is near."""


def nearby_pairs(
    bodies: Sequence[FloatArray], margin: FloatArray
) -> Iterator[tuple[IntArray, IntArray]]:
    """Yields pairs of bodies, first < second, without those whose boxes are apart. A body is its
    points (k, 3); its box is grown by its ``margin`` (n,). Pairs come in sorted portions, so that
    memory does not grow with their number."""
    tree = _Tree.of(bodies, margin)
    pending = [(0, *np.zeros((2, 1), dtype=np.int64))]
    while pending:
        # Pairs of nodes of one level: first == second stands for the pairs within a node.
        level, first, second = pending.pop()
        if len(first) > _PORTION:
            pending.append((level, first[_PORTION:], second[_PORTION:]))
            first, second = first[:_PORTION], second[:_PORTION]
        if level < len(tree.levels):
            nodes = tree.levels[level]
            near = nodes.meeting(*_children(first, second, len(nodes.start)))
            pending.append((level + 1, *near))
            continue
        a, b = np.sort(np.stack([tree.order[first], tree.order[second]])[:, first != second], 0)
        sorting = np.lexsort((b, a))
        if len(sorting):
            yield a[sorting], b[sorting]


@dataclass(frozen=True, eq=False)
class _Tree:
    """The bodies' numbers in the ``order`` (n,) of the leaves, and the nodes of each of the
    ``levels`` below the root; the children of node i are nodes 2 i and 2 i + 1 of the next."""

    order: IntArray
    levels: list[_Nodes]

    @classmethod
    def of(cls, bodies: Sequence[FloatArray], margin: FloatArray) -> _Tree:
        levels = max(len(bodies) - 1, 0).bit_length()
        count = np.array([len(body) for body in bodies])
        begin = np.cumsum(count) - count
        order = _tree_order(np.add.reduceat(np.concatenate(bodies), begin) / count[:, None], levels)
        points = np.concatenate([bodies[i] for i in order])
        points = points - points.mean(axis=0)
        start = np.cumsum([0, *(len(bodies[i]) for i in order[:-1])])
        leading = [np.arange(0, len(bodies), 1 << k) for k in reversed(range(levels))]
        reach = (np.maximum.reduceat(margin[order], rows) for rows in leading)
        nodes = [_Nodes(points, start[rows], m) for rows, m in zip(leading, reach, strict=True)]
        return cls(order, nodes)


def _tree_order(centres: FloatArray, levels: int) -> IntArray:
    """Orders bodies so that each run of 2^k from a multiple of 2^k on, a node of the tree, lies
    together: every node is sorted along its longest side."""
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
    """All pairs of children, a <= b, of pairs of nodes; the next level has ``count`` nodes."""
    a = (2 * first[:, None] + np.array([0, 0, 1, 1])).ravel()
    b = (2 * second[:, None] + np.array([0, 1, 0, 1])).ravel()
    exists = (a <= b) & (b < count)
    return a[exists], b[exists]


@dataclass(frozen=True, eq=False)
class _Nodes:
    """The nodes of one level: node i has the ``points`` (m, 3) from ``start[i]`` to the next start,
    and its boxes are grown by ``margin[i]``."""

    points: FloatArray
    start: IntArray
    margin: FloatArray

    def meeting(self, first: IntArray, second: IntArray) -> tuple[IntArray, IntArray]:
        """Those pairs of nodes whose boxes meet, along x, y, z and along the nodes' own axes."""
        low, high = self.boxes
        meet = overlapping(low, high, first, low, high, second)
        first, second = first[meet], second[meet]
        if len(first) <= _FEW:
            return first, second
        middle, axes, half = self.own_boxes
        # Along each axis of one box: the distance of the middles against both half extents.
        offset = middle[second] - middle[first]
        turn = np.abs(np.einsum("pik,pjk->pij", axes[first], axes[second]))
        of_first = np.abs(np.einsum("pik,pk->pi", axes[first], offset))
        of_second = np.abs(np.einsum("pik,pk->pi", axes[second], offset))
        reach = half[first] + np.einsum("pij,pj->pi", turn, half[second])
        reach_back = half[second] + np.einsum("pij,pi->pj", turn, half[first])
        meet = ((of_first <= reach) & (of_second <= reach_back)).all(axis=1)
        return first[meet], second[meet]

    @cached_property
    def boxes(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest x, y, z (n, 3) of each node."""
        low = np.minimum.reduceat(self.points, self.start) - self.margin[:, None]
        return low, np.maximum.reduceat(self.points, self.start) + self.margin[:, None]

    @cached_property
    def own_boxes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Middle (n, 3), principal axes (n, 3, 3; rows) and half extents (n, 3) of each node."""
        count = np.diff(np.append(self.start, len(self.points)))
        node = np.repeat(np.arange(len(self.start)), count)
        centre = np.add.reduceat(self.points, self.start) / count[:, None]
        spokes = self.points - centre[node]
        spread = np.add.reduceat(spokes[:, :, None] * spokes[:, None, :], self.start)
        axes = np.linalg.eigh(spread)[1].transpose(0, 2, 1)
        local = np.einsum("mik,mk->mi", axes[node], spokes)
        low, high = (end.reduceat(local, self.start) for end in (np.minimum, np.maximum))
        middle = centre + np.einsum("ni,nik->nk", 0.5 * (low + high), axes)
        return middle, axes, 0.5 * (high - low) + self.margin[:, None]


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
