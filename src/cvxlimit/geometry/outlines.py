"""Outlines that facets of two blocks share: where they overlap, in the plane between them.

Aligned rectangles overlap in a product of intervals, without rounding. Others are clipped piece by
piece; pieces of the same two facets that hang together are one overlap, which is told by the hull
about it if it is not convex.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import shapely
from numpy.typing import NDArray

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.overlays import union
from cvxlimit.geometry.polygons import area_and_centroid, convex_overlap, members_of, united

_AROUND = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Signs of a rectangle's corners, counter-clockwise."""


@dataclass(frozen=True, eq=False)
class Outlines:
    """Outlines of k overlaps of facets, each about its own centroid with axes along its own sides.

    The ``corners`` of overlap i run from ``start[i]`` to the next start; ``sides`` are NaN if it is
    no rectangle. If it is not convex, ``corners`` are those of its hull and ``pieces`` tile it,
    while ``area``, ``middle`` and ``width`` are those of the overlap itself.
    """

    pair: IntArray  # (k,)
    middle: FloatArray  # (k, 2), centroids in the pairs' planes
    turn: FloatArray  # (k, 2, 2), from plane axes to own ones
    area: FloatArray  # (k,)
    width: FloatArray  # (k,), about the mean width
    sides: FloatArray  # (k, 2)
    pieces: NDArray[np.object_]  # (k,), convex polygons that tile it, or None: its corners do
    start: IntArray  # (k,)
    corners: FloatArray  # (m, 2)

    @classmethod
    def joined(cls, parts: Sequence[Outlines]) -> Outlines:
        names = [field.name for field in fields(Outlines)]
        columns = {name: np.concatenate([getattr(x, name) for x in parts]) for name in names}
        before = np.cumsum([0, *(len(x.corners) for x in parts[:-1])])
        columns["start"] = columns["start"] + np.repeat(before, [len(x.pair) for x in parts])
        return cls(**columns)

    def take(self, rows: IntArray) -> Outlines:
        place, corner = members_of(self.start, len(self.corners), rows)
        return Outlines(
            self.pair[rows], self.middle[rows], self.turn[rows], self.area[rows], self.width[rows],
            self.sides[rows], self.pieces[rows], np.searchsorted(place, np.arange(len(rows))),
            self.corners[corner],
        )  # fmt: skip


def outlines(
    first: FloatArray, second: FloatArray, is_box: BoolArray, pair: IntArray, least: FloatArray
) -> Outlines:
    """Overlaps of pairs of facets, in the order of the pairs. Facets are convex pieces (p, k, 2),
    (p, m, 2), corners repeated where they have fewer; ``pair`` (p,) tells their facets. Where
    ``is_box`` both are one rectangle along the axes. Parts that lie apart and are no wider than
    ``least``, one for each pair, are overlaps of their own: they must not widen the hull."""
    boxes, other = np.flatnonzero(is_box), np.flatnonzero(~is_box)
    together: dict[int, list[FloatArray]] = defaultdict(list)
    overlaps = convex_overlap(first[other], second[other])
    for j, polygon in zip(pair[other].tolist(), overlaps, strict=True):
        if len(polygon) > 2:
            together[j].append(polygon)
    found = [_rectangles(pair[boxes], first[boxes], second[boxes])]
    for j, pieces in together.items():
        found += [_polygon(j, parts) for parts in _bearing(pieces, float(least[j]))]
    result = Outlines.joined(found)
    return result.take(np.argsort(result.pair, kind="stable"))


def _rectangles(pair: IntArray, first: FloatArray, second: FloatArray) -> Outlines:
    """Overlaps of aligned rectangles (k, 4, 2): interval products, without rounding."""
    low = np.maximum(first.min(axis=1), second.min(axis=1))
    high = np.maximum(np.minimum(first.max(axis=1), second.max(axis=1)), low)
    extent = high - low
    k = len(pair)
    return Outlines(
        pair=pair,
        middle=0.5 * (low + high),
        turn=np.broadcast_to(np.eye(2), (k, 2, 2)),
        area=extent.prod(axis=1),
        width=extent.min(axis=1),
        sides=extent,
        pieces=np.full(k, None),
        start=4 * np.arange(k),
        corners=(0.5 * extent[:, None] * _AROUND).reshape(-1, 2),
    )


def _polygon(pair: int, parts: Sequence[FloatArray]) -> Outlines:
    hull, area, middle = united(parts)
    local, extent, turn = _along_own_sides(hull - middle)
    is_whole = abs(area_and_centroid(hull)[0] - area) <= ROUNDING * area
    pieces = np.empty(1, dtype=object)
    if not is_whole:
        pieces[0] = tuple((part - middle) @ turn.T for part in parts)
    widths = [_width(hull, area), *(_width(part) for part in parts if not is_whole)]
    sides = extent if is_whole else np.full(2, np.nan)
    return Outlines(
        np.array([pair]), middle[None], turn[None], np.array([area]), np.array([max(widths)]),
        sides[None], pieces, np.zeros(1, dtype=np.int64), local,
    )  # fmt: skip


def _bearing(pieces: list[FloatArray], least: float) -> list[list[FloatArray]]:
    """All pieces in parts wider than ``least``, then those of each narrower part. A narrow strip
    joined to a wider part stays: it is the blocks' own shape, not a few hairs' breadth by which two
    of them happen to reach over each other."""
    if len(pieces) == 1:
        return [pieces]
    shapes = shapely.polygons([shapely.linearrings(piece) for piece in pieces])
    grid = 2.0 * ROUNDING * float(np.ptp(np.concatenate(pieces), axis=0).max())
    parts = shapely.get_parts(union(shapes, grid, is_snapped=True))
    wide = 2.0 * shapely.area(parts) > least * shapely.length(parts)
    if wide.all() or not wide.any():
        return [pieces]
    nearest = shapely.STRtree(parts).nearest(shapely.centroid(shapes))
    groups = [np.flatnonzero(wide), *np.flatnonzero(~wide)[:, None]]
    members = (np.flatnonzero(np.isin(nearest, group)) for group in groups)
    return [[pieces[i] for i in group.tolist()] for group in members if len(group)]


def _width(polygon: FloatArray, area: float | None = None) -> float:
    sides = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1)
    return 2.0 * (area_and_centroid(polygon)[0] if area is None else area) / float(sides.sum())


def _along_own_sides(corners: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A centred polygon turned so that t1 runs along its longest edge, (l1, l2) if it is a
    rectangle to 1e-9 of its size else NaN, and the rotation (2, 2)."""
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(edges, axis=1)
    longest = edges[int(np.flatnonzero(lengths >= (1.0 - 1e-9) * lengths.max())[0])]
    c, s = longest / np.linalg.norm(longest)
    turn = np.array([[c, s], [-s, c]])
    turned = corners @ turn.T
    extent = np.ptp(turned, axis=0)
    steps = np.roll(turned, -1, axis=0) - turned
    square = len(corners) == 4 and np.abs(steps).min(axis=1).max() <= 1e-9 * extent.max()
    return turned, extent if square else np.full(2, np.nan), turn
