"""Plane geometry of contacts: torsion arms, polygon integrals, hulls, overlaps, effective regions.

Corners go round counter-clockwise, and integrals over a polygon are sums over its edges. Many
polygons at once are arrays (p, k, 2) of which the first ``count`` (p,) corners of each are meant.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

import numpy as np
import shapely
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.mesh import turn

_SLENDER = 1e-3
"""Below this side ratio the gradient of c_T is taken at the ratio itself: its log term's slope
is unbounded at zero, and a wrong slope there does not change c_T by more than 1e-6.
Segments shorter than this share of their distance are integrated by Simpson's rule, to 1e-13; the
difference of the integral's ends would lose as many digits as they are short."""


def torsion_arm(l1: ArrayLike, l2: ArrayLike) -> FloatArray:
    """c_T of rectangles (Eq. 16): the mean distance of their points from their centre.

    With r = min / max of the sides it keeps all digits when one goes to zero; Eq. 16 as printed
    does not. Convex and homogeneous of degree 1.

    >>> torsion_arm([1.0, 1.0, 1.0], [1.0, 0.5, 0.0]).round(6).tolist()
    [0.382598, 0.296617, 0.25]
    """
    a, b = np.asarray(l1, dtype=float), np.asarray(l2, dtype=float)
    longer = np.maximum(a, b)
    r = np.minimum(a, b) / np.where(longer > 0.0, longer, 1.0)
    safe = np.where(r > 0.0, r, 1.0)
    thin = np.where(r > 0.0, np.arcsinh(safe) / safe, 1.0)
    log_term = np.where(r > 0.0, safe**2 * np.arcsinh(1.0 / safe), 0.0)
    arm: FloatArray = longer * (thin + log_term + 2.0 * np.hypot(1.0, r)) / 12.0
    return arm


def torsion_arm_gradient(l1: ArrayLike, l2: ArrayLike) -> tuple[FloatArray, FloatArray]:
    a, b = np.asarray(l1, dtype=float), np.asarray(l2, dtype=float)
    point = np.maximum(a, b) <= 0.0
    a, b = np.where(point, 1.0, a), np.where(point, 1.0, b)
    return _slope(a, b), _slope(b, a)


def _slope(a: FloatArray, b: FloatArray) -> FloatArray:
    r = np.clip(a / np.maximum(b, 1e-300), _SLENDER, 1.0 / _SLENDER)
    slope: FloatArray = (
        2.0 * r * np.arcsinh(1.0 / r) - np.arcsinh(r) / r**2 + np.hypot(1.0, r) / r
    ) / 12.0
    return slope


def area_and_centroid(corners: ArrayLike) -> tuple[float, FloatArray]:
    """Area and centroid (2,) of a polygon (k, 2)."""
    points = np.asarray(corners, dtype=float)
    spokes = points - points[0]
    ahead = np.roll(spokes, -1, axis=0)
    doubled = turn(spokes, ahead)
    whole = float(doubled.sum())
    return whole / 2.0, points[0] + doubled @ (spokes + ahead) / (3.0 * whole)


def distance_integral(height: FloatArray, end: FloatArray) -> FloatArray:
    """Integral (length squared) of the distance from a point, along a line that passes the point at
    distance h = ``height``, from the point's foot on it to s = ``end``:
    1/2 (s sqrt(h^2 + s^2) + h^2 asinh(s / abs(h)))."""
    tall = np.where(height != 0.0, np.abs(height), 1.0)
    log_term = np.where(height != 0.0, height**2 * np.arcsinh(end / tall), 0.0)
    return np.asarray(0.5 * (end * np.hypot(height, end) + log_term))


def mean_distance_on_segment(start: FloatArray, end: FloatArray) -> FloatArray:
    """Mean distance (...) of the points of segments from the origin; ends are (..., 2)."""
    along = end - start
    length = np.linalg.norm(along, axis=-1)
    safe = np.where(length > 0.0, length, 1.0)
    begin = (start * along).sum(axis=-1) / safe
    height = turn(start, along) / safe
    whole = distance_integral(height, begin + length) - distance_integral(height, begin)
    ends = np.linalg.norm(start, axis=-1) + np.linalg.norm(end, axis=-1)
    simpson = (ends + 4.0 * np.linalg.norm(0.5 * (start + end), axis=-1)) / 6.0
    return np.where(length > _SLENDER * ends, whole / safe, simpson)


def mean_distance(corners: ArrayLike, point: ArrayLike) -> float:
    """Mean distance of a polygon's points from ``point``: c_T of a general contact.

    Exact: over the triangle between the point and an edge at distance h the integral is h / 3 times
    that along the edge, with h negative for edges seen from outside. A degenerate polygon is its
    longest segment.
    """
    points = np.asarray(corners, dtype=float) - np.asarray(point, dtype=float)
    if len(points) == 0:
        return 0.0
    extent = float(np.ptp(points, axis=0).max())
    area = area_and_centroid(points)[0] if len(points) > 2 else 0.0
    if area <= 1e-12 * extent**2:
        ends = _ends(points, 0.0)
        return float(mean_distance_on_segment(ends[0], ends[-1]))
    along = np.roll(points, -1, axis=0) - points
    length = np.linalg.norm(along, axis=1)
    kept = length > 0.0
    unit = along[kept] / length[kept, None]
    start = (points[kept] * unit).sum(axis=1)
    height = turn(points[kept], unit)
    on_edges = distance_integral(height, start + length[kept]) - distance_integral(height, start)
    return float(height @ on_edges / (3.0 * area))


def mean_distance_over(pieces: Sequence[FloatArray], point: ArrayLike) -> float:
    """Mean distance from ``point`` of the points of all ``pieces``, polygons (k, 2) each."""
    areas = np.array([area_and_centroid(piece)[0] for piece in pieces])
    return float(areas @ [mean_distance(piece, point) for piece in pieces] / areas.sum())


def effective_regions(corners: ArrayLike, pressure_centres: ArrayLike) -> list[FloatArray]:
    """The effective area of a convex contact P for each pressure centre e: P ∩ (2e - P).

    It is the largest part of P that is symmetric about e; for a rectangle that of Eq. 26.
    ``corners`` of P are (k, 2), or (p, k, 2) with one contact for each of the centres (p, 2). What
    is returned has two corners for a centre on an edge, one in a corner, none outside.
    """
    points = np.asarray(corners, dtype=float)
    centres = np.asarray(pressure_centres, dtype=float)
    reach = np.abs(points - centres[:, None]).max(axis=(1, 2))
    both = np.broadcast_to(points, (len(centres), *points.shape[-2:]))
    found, count = _common(both, 2.0 * centres[:, None] - points, 1e-12 * reach)
    area = _doubled(np.where(_meant(found, count)[:, :, None], found, found[:, :1])) / 2.0
    wide = (count > 2) & (area > 1e-12 * reach**2)
    regions = zip(found, count.tolist(), wide.tolist(), reach.tolist(), strict=True)
    return [x[:n] if is_wide else _ends(x[:n], 1e-9 * r) for x, n, is_wide, r in regions]


def _ends(points: FloatArray, tolerance: float) -> FloatArray:
    """The two points that are farthest apart; one where all coincide within the tolerance."""
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    if not gaps.size or gaps.max() <= tolerance:
        return points[:1]
    return points[list(np.unravel_index(int(gaps.argmax()), gaps.shape))]


def united(pieces: Sequence[FloatArray]) -> tuple[FloatArray, float, FloatArray]:
    """Hull (k, 2) of polygons that do not overlap, their whole area and its centroid (2,)."""
    if len(pieces) == 1:
        return pieces[0], *area_and_centroid(pieces[0])
    parts = [area_and_centroid(piece) for piece in pieces]
    area = sum(surface for surface, _ in parts)
    centroid: FloatArray = sum((s * c for s, c in parts), np.zeros(2)) / area
    return convex_hull(np.concatenate(pieces)), area, centroid


def convex_hull(points: ArrayLike) -> FloatArray:
    """Corners (k, 2) of the hull of points (m, 2), counter-clockwise, no straight ones; none on a
    line.

    GEOS, on a grid of 2^-45 of the size, where its turns are exact: on coordinates as they are it
    loses whole corners at times (``tests/geometry/test_plane_geometry.py``), manifold3d does so
    more often, and Qhull refuses slivers.
    """
    cloud = np.asarray(points, dtype=float)
    low, size = cloud.min(axis=0), np.ptp(cloud, axis=0).max(keepdims=True)
    unit = 2.0 ** (np.ceil(np.log2(np.maximum(size, 1e-300))) - 45.0)
    hull = shapely.convex_hull(shapely.multipoints(np.round((cloud - low) / unit)))
    if hull.geom_type != "Polygon":
        return np.empty((0, 2))
    ring = low + unit * shapely.get_coordinates(hull)[:0:-1]  # GEOS goes round clockwise
    ring = np.roll(ring, -int(np.lexsort(ring.T[::-1])[0]), axis=0)
    return simplified(ring[None], np.array([len(ring)]), size)[0]


def convex_overlap(first: FloatArray, second: FloatArray) -> list[FloatArray]:
    """Pairwise overlaps of convex polygons (p, k, 2) and (p, m, 2), corners repeated where they
    have fewer: p counter-clockwise corner lists, empty where there is no area."""
    extents = [np.ptp(polygons, axis=1).max(axis=1) for polygons in (first, second)]
    return simplified(*_common(first, second), np.minimum(*extents))


def _common(
    first: FloatArray, second: FloatArray, tolerance: FloatArray | float = 0.0
) -> tuple[FloatArray, IntArray]:
    """Sutherland and Hodgman's clipping, all pairs at once; points within the tolerance stay.

    Not GEOS: it loses overlaps of polygons that share a corner and have nearly parallel edges
    (one of 250 random triangles against the same with one corner moved by rounding).
    """
    corners, border = (
        np.where(_doubled(x)[:, None, None] < 0.0, x[:, ::-1], x) for x in (first, second)
    )
    count = np.full(len(corners), corners.shape[1])
    edges = np.roll(border, -1, axis=1) - border
    slack = np.reshape(tolerance, (-1, 1)) * np.linalg.norm(edges, axis=2)
    for k in range(border.shape[1]):
        inside = turn(edges[:, k, None], corners - border[:, k, None])
        corners, count = clipped(corners, count, inside + slack[:, k, None])
    return corners, count


def clipped(
    corners: FloatArray, count: IntArray, height: FloatArray
) -> tuple[FloatArray, IntArray]:
    """The parts of convex polygons where a linear height is not negative. ``corners`` are
    (p, k, d), of which the first ``count`` (p,) are valid, and ``height`` (p, k) is that at each.
    Returns corners (p, m, d) and how many are valid. Corners of height zero stay."""
    pairs, width, dimension = corners.shape
    ahead = _neighbour(corners, count, 1)
    height_ahead = _neighbour(height[:, :, None], count, 1)[:, :, 0]
    inside, there = height >= 0.0, _meant(corners, count)
    crosses = inside != (height_ahead >= 0.0)
    share = np.where(crosses, height / np.where(crosses, height - height_ahead, 1.0), 0.0)
    crossing = corners + share[:, :, None] * (ahead - corners)
    points = np.stack([corners, crossing], axis=2).reshape(pairs, 2 * width, dimension)
    kept = np.stack([inside & there, crosses & there], axis=2).reshape(pairs, 2 * width)
    return _kept(points, kept)


def _kept(corners: FloatArray, kept: BoolArray) -> tuple[FloatArray, IntArray]:
    """The corners that are ``kept`` (p, k), moved to the front in order, and how many they are."""
    count = kept.sum(axis=1)
    order = np.argsort(~kept, axis=1, kind="stable")[:, : max(int(count.max(initial=0)), 1)]
    return np.take_along_axis(corners, order[:, :, None], axis=1), count


def _doubled(polygons: FloatArray) -> FloatArray:
    """Twice the signed area (p,) of polygons (p, k, 2), positive counter-clockwise."""
    spokes = polygons[:, 1:] - polygons[:, :1]
    return np.asarray(turn(spokes[:, :-1], spokes[:, 1:]).sum(axis=1))


def simplified(corners: FloatArray, count: IntArray, size: FloatArray) -> list[FloatArray]:
    """Convex polygons (p, k, 2) without corners that coincide or are straight, within
    :data:`~cvxlimit.base.arrays.ROUNDING`
    of the ``size`` (p,) of what they were made from; empty where none is wider. Of straight
    neighbours every other one goes first, so that many of them cannot carry the outline away."""
    tolerance = ROUNDING * size[:, None]
    apart = np.linalg.norm(corners - _neighbour(corners, count, -1), axis=2) > tolerance
    corners, count = _kept(corners, apart & _meant(corners, count))
    for parity in cycle((0, 1)):
        before, ahead = (_neighbour(corners, count, step) for step in (-1, 1))
        chord, offset = ahead - before, corners - before
        straight = np.abs(turn(chord, offset)) <= tolerance * np.linalg.norm(chord, axis=2)
        straight &= (offset * (ahead - corners)).sum(axis=2) >= 0.0  # no tip of a needle
        meant = _meant(corners, count)
        straight &= meant & (count > 3)[:, None]
        if not straight.any():
            break
        straight[:, 1 - parity :: 2] = False
        last = np.arange(corners.shape[1]) == count[:, None] - 1
        straight &= ~(last & straight[:, :1])  # the first one's neighbour
        corners, count = _kept(corners, meant & ~straight)
    corners = np.where(_meant(corners, count)[:, :, None], corners, corners[:, :1])
    wide = _doubled(corners) > tolerance[:, 0] * np.ptp(corners, axis=1).max(axis=1)
    return [x[:n] for x, n in zip(corners, np.where(wide, count, 0).tolist(), strict=True)]


def _meant(corners: FloatArray, count: IntArray) -> BoolArray:
    """True (p, k) for the first ``count`` corners of each polygon, which are the valid ones."""
    return np.arange(corners.shape[1]) < count[:, None]


def _neighbour(corners: FloatArray, count: IntArray, step: int) -> FloatArray:
    """For each corner, the corner that is ``step`` places further round its polygon."""
    place = (np.arange(corners.shape[1]) + step) % np.maximum(count, 1)[:, None]
    return np.take_along_axis(corners, place[:, :, None], axis=1)


def members_of(start: IntArray, end: int, groups: IntArray) -> tuple[IntArray, IntArray]:
    """The rows of all ``groups`` (k,), one group after the other: for each row its place in
    ``groups`` (m,), and its number (m,). Group i has the rows from ``start[i]`` to the next start,
    the last group to ``end``."""
    count = np.diff(start, append=end)[groups]
    place = np.repeat(np.arange(len(groups)), count)
    within = np.arange(len(place)) - (np.cumsum(count) - count)[place]
    return place, start[groups][place] + within
