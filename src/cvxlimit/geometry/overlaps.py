"""Outlines of contacts: where two faces on a common plane overlap."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import shapely
from numpy.typing import NDArray

from cvxlimit.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.polygons import SAME, area_and_centroid, convex_overlap, united

_AROUND = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Signs of a rectangle's corners, counter-clockwise."""


@dataclass(frozen=True, eq=False)
class Outlines:
    """Overlaps of facet pairs, centred, and turned along their own sides. ``corners`` of overlap i
    begin at ``start[i]``; ``sides`` are NaN if it is no rectangle. Where it is not convex,
    ``corners`` are those of its hull and ``pieces`` tile it; ``area``, ``middle`` and ``width`` are
    its own."""

    pair: IntArray  # (k,)
    middle: FloatArray  # (k, 2), centroids in the pairs' planes
    turn: FloatArray  # (k, 2, 2), from plane axes to own ones
    area: FloatArray  # (k,)
    width: FloatArray  # (k,), about the mean width
    sides: FloatArray  # (k, 2)
    pieces: NDArray[np.object_]  # (k,), convex polygons that tile it, or None: its corners do
    start: IntArray  # (k,)
    corners: FloatArray  # (m, 2)

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
    names = [field.name for field in fields(Outlines)]
    columns = {name: np.concatenate([getattr(x, name) for x in found]) for name in names}
    before = np.cumsum([0, *(len(x.corners) for x in found[:-1])])
    columns["start"] += np.repeat(before, [len(x.pair) for x in found])
    return Outlines(**columns).take(np.argsort(columns["pair"], kind="stable"))


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
    is_whole = abs(area_and_centroid(hull)[0] - area) <= _WHOLE * area
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
    grid = 2.0 * SAME * float(np.ptp(np.concatenate(pieces), axis=0).max())
    parts = shapely.get_parts(shapely.union_all(shapes, grid_size=grid))
    wide = 2.0 * shapely.area(parts) > least * shapely.length(parts)
    if wide.all() or not wide.any():
        return [pieces]
    nearest = shapely.STRtree(parts).nearest(shapely.centroid(shapes))
    groups = [np.flatnonzero(wide), *np.flatnonzero(~wide)[:, None]]
    members = (np.flatnonzero(np.isin(nearest, group)) for group in groups)
    return [[pieces[i] for i in group.tolist()] for group in members if len(group)]


_WHOLE = 1e-9
"""Share of its area by which a polygon may fall short of its hull and still count as convex."""


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


def members_of(start: IntArray, end: int, groups: IntArray) -> tuple[IntArray, IntArray]:
    """For each of ``groups`` all its rows: places in ``groups``, and rows. Group i has the rows
    from ``start[i]`` to the next start, the last one to ``end``."""
    count = np.diff(start, append=end)[groups]
    place = np.repeat(np.arange(len(groups)), count)
    within = np.arange(len(place)) - (np.cumsum(count) - count)[place]
    return place, start[groups][place] + within
