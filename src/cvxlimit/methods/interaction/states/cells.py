"""States of polygons that press in a box: cells of pressure centres with bounds on their arms.

On rectangles c(e) is convex between its kinks, so corners of boxes have the largest torsion. On
other polygons it is neither convex nor concave. A polygon within a box is therefore cut into cells,
each into triangles, on which

    c(e) <= sum of lambda_k t_k  for e = sum of lambda_k e_k

with proved t_k (:mod:`arm_bounds`), and by Balas' argument forces pressed in the cell are sums of
forces pressed at its corners with arms t_k. Signed shear is convex in e, and exact at corners.
Independent shear drags on torsion with kappa = eps / c; over a cell the least eps and the largest t
stand for it, which loses the less the smaller the cell. So both bounds tend to the truth as boxes
shrink.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cvxlimit.methods.interaction.states.arm_bounds import ArmBounds

FloatArray = NDArray[np.float64]

_PARTS = 2
"""Cells along each side of a box, besides cuts at zero."""


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
    regions = _regions(polygon, np.frombuffer(low), np.frombuffer(high))
    if not regions:
        return Cells(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))
    fans = [np.array([(0, k, k + 1) for k in range(1, len(r) - 1)]) for r in regions]
    triangles = [region[fan] for region, fan in zip(regions, fans, strict=True)]
    bounds = ArmBounds(polygon).over(np.concatenate(triangles))
    ends = np.cumsum([len(fan) for fan in fans])[:-1]
    arms, drags = [], []
    for region, fan, found in zip(regions, fans, np.split(bounds, ends), strict=True):
        arm = np.zeros(len(region))
        np.maximum.at(arm, fan, found)
        arms.append(arm)
        drags.append(np.tile(np.abs(region).min(axis=0)[::-1] / arm.max(), (len(region), 1)))
    return Cells(np.concatenate(regions), np.concatenate(arms), np.concatenate(drags))


def _regions(polygon: FloatArray, low: FloatArray, high: FloatArray) -> list[FloatArray]:
    """Parts (m, 2) of the polygon in a grid of boxes."""
    low, high = np.maximum(low, polygon.min(axis=0)), np.minimum(high, polygon.max(axis=0))
    least = 1e-12 * float(np.ptp(polygon, axis=0).max())
    if (high < low - least).any():
        return []
    high = np.maximum(high, low + 1e3 * least)  # a range without width still has states
    grids = [_ticks(a, b) for a, b in zip(low, high, strict=True)]
    parts = [
        _between(_between(polygon, 0, x0, x1), 1, y0, y1)
        for x0, x1 in pairwise(grids[0])
        for y0, y1 in pairwise(grids[1])
    ]
    return [part for part in parts if len(part) > 2]


def _ticks(low: float, high: float) -> FloatArray:
    ticks = np.linspace(low, high, _PARTS + 1)
    return np.union1d(ticks, [0.0]) if low < 0.0 < high else ticks


def _between(corners: FloatArray, axis: int, low: float, high: float) -> FloatArray:
    """The part of a convex polygon (k, 2) with low <= x <= high; without dropping flat corners,
    which would lose states."""
    for sign, limit in ((1.0, low), (-1.0, -high)):
        side = sign * corners[:, axis] - limit
        kept: list[FloatArray] = []
        for k in range(len(corners)):
            here, there = side[k - 1], side[k]
            if (here >= 0.0) != (there >= 0.0):
                crossing = corners[k - 1] + here / (here - there) * (corners[k] - corners[k - 1])
                crossing[axis] = sign * limit
                kept.append(crossing)
            if there >= 0.0:
                kept.append(corners[k])
        corners = np.array(kept).reshape(-1, 2)
    return corners
