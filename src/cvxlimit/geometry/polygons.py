"""Plane geometry of contacts: torsion arms, polygon integrals, overlaps, effective regions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_SLENDER = 1e-3
"""Below this side ratio the gradient of c_T is taken at the ratio itself: its log term's slope
is unbounded at zero, and a wrong slope there does not change c_T by more than 1e-6."""


def torsion_arm(l1: ArrayLike, l2: ArrayLike) -> FloatArray:
    """c_T of rectangles (Eq. 16): the mean distance of their points from their centre.

    ``l1``, ``l2`` are side lengths >= 0 of any common shape; the result has their unit.
    Written with r = min / max so that it keeps all digits when a side goes to zero, where
    Eq. 16 as printed does not. Convex and homogeneous of degree 1; 0 for a point.

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
    """Derivatives of :func:`torsion_arm` by ``l1`` and by ``l2`` (dimensionless).

    >>> d1, d2 = torsion_arm_gradient(1.0, 0.5)
    >>> bool(np.isclose(1.0 * d1 + 0.5 * d2, torsion_arm(1.0, 0.5)))  # Euler, degree 1
    True
    """
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
    """Area and centroid (2,) of a simple polygon with counter-clockwise ``corners`` (k, 2)."""
    points = np.asarray(corners, dtype=float)
    spokes, ahead, doubled = _triangles(points)
    area = float(doubled.sum()) / 2.0
    centroid = points[0] + (doubled[:, None] * (spokes + ahead)).sum(axis=0) / (6.0 * area)
    return area, centroid


def _triangles(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Two sides (k, 2) and twice the area (k,) of the triangles at a polygon's first corner."""
    spokes = points - points[0]
    ahead = np.roll(spokes, -1, axis=0)
    return spokes, ahead, spokes[:, 0] * ahead[:, 1] - spokes[:, 1] * ahead[:, 0]


def mean_distance(corners: ArrayLike, point: ArrayLike) -> float:
    """Mean distance of a polygon's points from ``point``: c_T of a general contact.

    Exact: over the triangle between the point and an edge at distance h, with s along the edge,
    the integral of r is (h s sqrt(h2 + s2) + h3 asinh(s / abs(h))) / 6 between the edge's ends;
    h is negative for edges seen from outside.
    ``corners`` (k, 2) counter-clockwise; a degenerate polygon is treated as its longest segment.

    >>> square = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
    >>> round(mean_distance(square, [0.0, 0.0]), 6)
    0.382598
    """
    points = np.asarray(corners, dtype=float) - np.asarray(point, dtype=float)
    if len(points) == 0:
        return 0.0
    extent = float(np.ptp(points, axis=0).max())
    area = area_and_centroid(points)[0] if len(points) > 2 else 0.0
    if area <= 1e-12 * extent**2:
        return _mean_distance_on_segment(points)
    ends = np.roll(points, -1, axis=0)
    along = ends - points
    length = np.linalg.norm(along, axis=1)
    kept = length > 0.0
    unit = along[kept] / length[kept, None]
    start = (points[kept] * unit).sum(axis=1)
    height = points[kept, 0] * unit[:, 1] - points[kept, 1] * unit[:, 0]
    integral = _edge_integral(height, start + length[kept]) - _edge_integral(height, start)
    return float(integral.sum() / area)


def _edge_integral(h: FloatArray, s: FloatArray) -> FloatArray:
    safe = np.where(h != 0.0, h, 1.0)
    log_term = np.where(h != 0.0, h**3 * np.arcsinh(s / np.abs(safe)), 0.0)
    result: FloatArray = (h * s * np.hypot(h, s) + log_term) / 6.0
    return result


def _mean_distance_on_segment(points: FloatArray) -> float:
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    i, j = np.unravel_index(int(gaps.argmax()), gaps.shape)
    length = gaps[i, j]
    if length == 0.0:
        return float(np.linalg.norm(points[0]))
    unit = (points[j] - points[i]) / length
    start = float(points[i] @ unit)
    height = abs(float(points[i, 0] * unit[1] - points[i, 1] * unit[0]))

    def primitive(s: float) -> float:
        log_term = height**2 * np.arcsinh(s / height) if height > 0.0 else 0.0
        return float(0.5 * (s * np.hypot(s, height) + log_term))

    return (primitive(start + length) - primitive(start)) / float(length)


def effective_region(corners: ArrayLike, pressure_centre: ArrayLike) -> FloatArray:
    """P ∩ (2e - P): the largest part of a convex contact centred on the pressure centre.

    For a rectangle this is the effective area of Eq. 26. ``corners`` (k, 2), ``pressure_centre``
    (2,); returns corners (m, 2) counter-clockwise: two of them for a centre on an edge, one in a
    corner, none outside.
    """
    return effective_regions(corners, np.asarray(pressure_centre, dtype=float)[None])[0]


def effective_regions(corners: ArrayLike, pressure_centres: ArrayLike) -> list[FloatArray]:
    """:func:`effective_region` of one contact for many pressure centres (p, 2)."""
    points = np.asarray(corners, dtype=float)
    centres = np.asarray(pressure_centres, dtype=float)
    reach = np.abs(points - centres[:, None]).max(axis=(1, 2))
    both = np.broadcast_to(points, (len(centres), *points.shape))
    regions = _overlaps(both, 2.0 * centres[:, None] - points, 1e-12 * reach)
    return [_region(region, float(r)) for region, r in zip(regions, reach, strict=True)]


def _region(region: FloatArray, reach: float) -> FloatArray:
    """A region that has an area, or the ends of what is left of it."""
    if len(region) > 2 and area_and_centroid(region)[0] > 1e-12 * reach**2:
        return region
    return _ends(region, 1e-9 * reach)


def _ends(points: FloatArray, tolerance: float) -> FloatArray:
    """The two points farthest apart; one if they agree within the tolerance."""
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    if not gaps.size or gaps.max() <= tolerance:
        return points[:1]
    return points[list(np.unravel_index(int(gaps.argmax()), gaps.shape))]


def convex_overlap(first: FloatArray, second: FloatArray) -> list[FloatArray]:
    """Pairwise overlaps of convex polygons; arrays (p, k, 2) and (p, m, 2), corners repeated
    where polygons have fewer. Returns p counter-clockwise corner lists, empty where the overlap
    has no area.

    >>> square = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
    >>> [overlap] = convex_overlap(square, square + 0.5)
    >>> area_and_centroid(overlap)[0]
    0.25
    """
    return [_without_straight_corners(corners) for corners in _overlaps(first, second)]


def united(pieces: Sequence[FloatArray]) -> tuple[FloatArray, float, FloatArray]:
    """Hull (k, 2) of polygons that do not overlap, their whole area and its centroid (2,).

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> hull, area, centroid = united([square, square + (3.0, 0.0)])
    >>> hull.tolist(), area, centroid.tolist()
    ([[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [0.0, 1.0]], 2.0, [2.0, 0.5])
    """
    if len(pieces) == 1:
        return pieces[0], *area_and_centroid(pieces[0])
    parts = [area_and_centroid(piece) for piece in pieces]
    area = sum(surface for surface, _ in parts)
    centroid: FloatArray = sum((s * c for s, c in parts), np.zeros(2)) / area
    return convex_hull(np.concatenate(pieces)), area, centroid


def convex_hull(points: FloatArray) -> FloatArray:
    """Corners (k, 2) of the convex hull of points (m, 2), counter-clockwise, no straight ones.

    Andrew's monotone chain; Qhull refuses the slivers that overlaps of rounded facets can be.
    """
    size = float(np.ptp(points, axis=0).max())
    order = sorted(map(tuple, points.tolist()))
    chains = []
    for run in (order, order[::-1]):
        chain: list[tuple[float, ...]] = []
        for p in run:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= 1e-15 * size**2:
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    return _without_straight_corners(np.array(chains[0] + chains[1]))


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def mean_distance_over(pieces: Sequence[FloatArray], point: ArrayLike) -> float:
    """Mean distance from ``point`` over polygons that do not overlap: c_T of any contact.

    >>> half = np.array([[0.0, -0.5], [0.5, -0.5], [0.5, 0.5], [0.0, 0.5]])
    >>> round(mean_distance_over([half, -half], (0.0, 0.0)), 6)
    0.382598
    """
    areas = np.array([area_and_centroid(piece)[0] for piece in pieces])
    return float(areas @ [mean_distance(piece, point) for piece in pieces] / areas.sum())


def _overlaps(
    first: FloatArray, second: FloatArray, tolerance: FloatArray | float = 0.0
) -> list[FloatArray]:
    """Sutherland and Hodgman's clipping, all pairs at once; points within the tolerance stay.

    Not GEOS: it loses overlaps of polygons that share a corner and have nearly parallel edges
    (one of 250 random triangles against the same with one corner moved by rounding).
    """
    corners, clip = _counter_clockwise(first), _counter_clockwise(second)
    count = np.full(len(corners), corners.shape[1])
    for k in range(clip.shape[1]):
        start, edge = clip[:, k], clip[:, (k + 1) % clip.shape[1]] - clip[:, k]
        corners, count = _clipped(corners, count, start, edge, tolerance)
    return [polygon[:n] for polygon, n in zip(corners, count.tolist(), strict=True)]


def _clipped(
    corners: FloatArray,
    count: IntArray,
    start: FloatArray,
    edge: FloatArray,
    tolerance: FloatArray | float,
) -> tuple[FloatArray, IntArray]:
    """Polygons (p, k, 2), the first ``count`` of their corners, left of lines (p, 2)."""
    pairs, width = corners.shape[:2]
    offset = corners - start[:, None]
    side = edge[:, None, 0] * offset[:, :, 1] - edge[:, None, 1] * offset[:, :, 0]
    side += (tolerance * np.linalg.norm(edge, axis=1))[:, None]
    place = np.arange(width)
    following = np.where(place + 1 < count[:, None], place + 1, 0)
    ahead = np.take_along_axis(corners, following[:, :, None], axis=1)
    ahead_side = np.take_along_axis(side, following, axis=1)
    inside, there = side >= 0.0, place < count[:, None]
    crosses = inside != (ahead_side >= 0.0)
    share = np.where(crosses, side / np.where(crosses, side - ahead_side, 1.0), 0.0)
    crossing = corners + share[:, :, None] * (ahead - corners)
    points = np.stack([corners, crossing], axis=2).reshape(pairs, 2 * width, 2)
    kept = np.stack([inside & there, crosses & there], axis=2).reshape(pairs, 2 * width)
    count = kept.sum(axis=1)
    order = np.argsort(~kept, axis=1, kind="stable")[:, : max(int(count.max(initial=0)), 1)]
    return np.take_along_axis(points, order[:, :, None], axis=1), count


def _counter_clockwise(polygons: FloatArray) -> FloatArray:
    spokes = polygons - polygons[:, :1]
    ahead = np.roll(spokes, -1, axis=1)
    doubled = spokes[:, :, 0] * ahead[:, :, 1] - spokes[:, :, 1] * ahead[:, :, 0]
    return np.where(doubled.sum(axis=1)[:, None, None] < 0.0, polygons[:, ::-1], polygons)


def _without_straight_corners(corners: FloatArray) -> FloatArray:
    """Drop corners that lie on the line between their neighbours, within 1e-9 of the size."""
    if len(corners) < 3:
        return np.empty((0, 2))
    tolerance = 1e-9 * float(np.ptp(corners, axis=0).max())
    before = corners - np.roll(corners, 1, axis=0)
    corners = corners[np.linalg.norm(before, axis=1) > tolerance]
    while len(corners) > 3:
        back, ahead = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        chord = ahead - back
        offset = corners - back
        distance = np.abs(chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0])
        straight = distance <= tolerance * np.linalg.norm(chord, axis=1)
        if not straight.any():
            break
        corners = np.delete(corners, int(np.flatnonzero(straight)[0]), axis=0)
    has_area = len(corners) > 2 and _triangles(corners)[2].sum() > 0.0
    return corners if has_area else np.empty((0, 2))
