"""States of polygons that press in a box: cells of pressure centres with bounds on their arms.

On rectangles c(e) is convex between its kinks, so corners of boxes have the largest torsion. On
other polygons it is neither convex nor concave, and nothing but its values is known. A polygon
within a box is therefore cut into cells, each into triangles. On a triangle

    c(e) <= sum of lambda_k t_k  for e = sum of lambda_k e_k,   t_k = c(e_k) + margin,

with :data:`_SAFETY` times the largest excess of c over its interpolation at inner points for a
margin, and by Balas' argument forces pressed in the cell are sums of forces pressed at its corners
with arms t_k. That the margin suffices between the points is not proved: brackets that rest on
cells say so. Signed shear is convex in e, and exact at corners. Independent shear drags on torsion
with kappa = eps / c; over a cell the least eps and the largest t stand for it, which loses the
less the smaller the cell. So both bounds tend to the truth as boxes shrink.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.polygons import (
    area_and_centroid,
    convex_overlap,
    effective_regions,
    mean_distance,
)

FloatArray = NDArray[np.float64]

_PARTS = 2
"""Cells along each side of a box, besides cuts at zero."""

_SAFETY = 1.5
"""Factor on the largest excess found at the inner points; the tests try others."""

_INNER = np.array(
    [[1, 1, 1], [2, 2, 0], [0, 2, 2], [2, 0, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]], dtype=float
)
"""Inner points of triangles (barycentric, not normalised) at which arms are compared."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Corners of all cells of one polygon in one box, k of them.

    Attributes
    ----------
    place : (k, 2)
        Pressure centres, in the polygon's unit.
    arm : (k,)
        t_k, in the same.
    drag : (k, 2)
        kappa2, kappa1: what abs(V1) and abs(V2) cost beside abs(V), with independent signs.
    """

    place: FloatArray
    arm: FloatArray
    drag: FloatArray


def cells(corners: FloatArray, low: FloatArray, high: FloatArray) -> Cells:
    """Cells of a convex polygon (k, 2) between ``low`` and ``high`` (2,); none outside of it.

    Example
    -------
    >>> triangle = np.array([[-0.5, -0.3], [0.5, -0.3], [0.0, 0.6]])
    >>> found = cells(triangle, np.array([0.0, -0.1]), np.array([0.1, 0.0]))
    >>> bool((found.arm > 0.0).all()), len(cells(triangle, np.ones(2), 2.0 * np.ones(2)).arm)
    (True, 0)
    """
    return _cells(corners.tobytes(), low.tobytes(), high.tobytes())


@lru_cache(maxsize=4096)
def _cells(corners: bytes, low: bytes, high: bytes) -> Cells:
    polygon = np.frombuffer(corners).reshape(-1, 2)
    first, last = np.frombuffer(low), np.frombuffer(high)
    first = np.maximum(first, polygon.min(axis=0))
    last = np.minimum(last, polygon.max(axis=0))
    found = [_cell(polygon, region) for region in _regions(polygon, first, last)]
    if not found:
        return Cells(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))
    return Cells(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _regions(polygon: FloatArray, low: FloatArray, high: FloatArray) -> list[FloatArray]:
    """Parts (m, 2) of the polygon in a grid of boxes."""
    least = 1e-12 * float(np.ptp(polygon, axis=0).max())
    if (high < low - least).any():
        return []
    high = np.maximum(high, low + 1e3 * least)  # a range without width still has states
    grids = [_ticks(a, b) for a, b in zip(low, high, strict=True)]
    found = []
    for x0, x1 in zip(grids[0][:-1], grids[0][1:], strict=True):
        for y0, y1 in zip(grids[1][:-1], grids[1][1:], strict=True):
            box = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
            found += [r for r in convex_overlap(polygon[None], box[None]) if len(r) > 2]
    return found


def _ticks(low: float, high: float) -> FloatArray:
    ticks = np.linspace(low, high, _PARTS + 1)
    return np.union1d(ticks, [0.0]) if low < 0.0 < high else ticks


def _cell(polygon: FloatArray, region: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    _, middle = area_and_centroid(region)
    place = np.concatenate([region, middle[None]])
    last = len(region)
    inner = _INNER / _INNER.sum(axis=1, keepdims=True)
    fans = [[k, (k + 1) % last, last] for k in range(last)]
    tried = np.concatenate([place, *(inner @ place[fan] for fan in fans)])
    true = arms_at(polygon, tried)
    arm = true[: last + 1]
    chords = np.concatenate([inner @ arm[fan] for fan in fans])
    margin = max(0.0, float((true[last + 1 :] - chords).max()))
    arm = arm + _SAFETY * margin
    eps = np.abs(region).min(axis=0)
    drag = np.tile(eps[::-1] / max(float(arm.max()), 1e-300), (len(place), 1))
    return place, arm, drag


def arms_at(polygon: FloatArray, centres: FloatArray) -> FloatArray:
    """c of a convex polygon (k, 2) pressed at centres (p, 2)."""
    regions = effective_regions(polygon, centres)
    return np.array([mean_distance(r, e) for r, e in zip(regions, centres, strict=True)])
