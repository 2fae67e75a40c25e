"""Points of joints at which stone presses on stone, with their shares of the area.

What must be right is the area and its second moments (elasticity), the corners (rocking), what the
points of an edge carry about its middle (a joint that rocks stands on an edge), and the mean
distance from the centre, c_T (torsion under uniform pressure). Two rules have all of that:

1. *Rectangles*: four by four points, at the ends and at the share ``inner`` of each half side, with
   weights that have the area and the second moment of a line. ``inner`` is chosen so that c_T is
   exact: from 0.391 for squares down to 1/3, Simpson's three-eighths rule, for thin strips.
2. *Other convex polygons*: at every corner the quadrilateral of the corner, the middles of its two
   sides and the centroid, with Simpson's three by three points. c_T comes out 0.1 to 1.1 % too
   large.

Joints that are not convex stand on their hull, as they rock about it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cvxlimit.base.arrays import ROUNDING, FloatArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.polygons import area_and_centroid, torsion_arm

_SIMPSON = ((0.0, 1.0), (0.5, 4.0), (1.0, 1.0))


def on_rectangle(l1: float, l2: float) -> tuple[FloatArray, FloatArray]:
    """Points (16, 2) of a rectangle about its centre, and their shares (16,) of its area.

    Example
    -------
    >>> at, share = on_rectangle(2.0, 1.0)
    >>> round(float(share @ np.hypot(*at.T) / torsion_arm(2.0, 1.0)), 9)
    1.0
    >>> (share @ at**2 * 12).round(9).tolist()
    [4.0, 1.0]
    """
    inner = _inner(round(min(l1, l2) / max(l1, l2), 12))
    line, weight = _line(inner)
    x, y = np.meshgrid(line * l1 / 2.0, line * l2 / 2.0)
    return np.column_stack([x.ravel(), y.ravel()]), np.outer(weight, weight).ravel()


def _line(inner: float) -> tuple[FloatArray, FloatArray]:
    """Points on [-1, 1] with shares that have its length and second moment."""
    middle = 1.0 / (3.0 * (1.0 - inner**2))
    weight = [0.5 - middle, middle]
    return np.array([-1.0, -inner, inner, 1.0]), np.array(weight + weight[::-1])


@lru_cache(maxsize=4096)
def _inner(ratio: float) -> float:
    """Share of half a side at which c_T of a rectangle with sides in this ratio is exact: it grows
    with the share, so halving an interval finds it."""
    low, high, arm = 1.0 / 3.0, 0.5, float(torsion_arm(2.0, 2.0 * ratio))
    for _ in range(40):  # to 1e-13
        inner = (low + high) / 2.0
        line, weight = _line(inner)
        mean = float(weight @ np.hypot(line[:, None], ratio * line) @ weight)
        low, high = (inner, high) if mean < arm else (low, inner)
    return inner


def on_polygon(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (p, 2) of a convex polygon (k, 2), and their shares (p,) of its area.

    Example
    -------
    >>> at, share = on_polygon(np.array([(0.0, 0.0), (3.0, 0.0), (0.0, 3.0)]))
    >>> len(at), (share @ at).round(9).tolist(), (share @ at**2).round(9).tolist()
    (19, [1.0, 1.0], [1.5, 1.5])
    """
    _, centre = area_and_centroid(corners)
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    quads = np.stack(  # (k, 4, 2): corner, middle of the next side, centroid, middle of the last
        [corners, (corners + after) / 2.0, np.broadcast_to(centre, corners.shape),
         (before + corners) / 2.0], axis=1,
    )  # fmt: skip
    at, share = [], []
    for u, wu in _SIMPSON:
        for v, wv in _SIMPSON:
            shape = np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
            along = (1 - v) * (quads[:, 1] - quads[:, 0]) + v * (quads[:, 2] - quads[:, 3])
            across = (1 - u) * (quads[:, 3] - quads[:, 0]) + u * (quads[:, 2] - quads[:, 1])
            at.append(np.einsum("i,kij->kj", shape, quads))
            size = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
            share.append(wu * wv * size)
    return merged(np.concatenate(at), np.concatenate(share) / np.sum(share))


def merged(at: FloatArray, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (p, k) without repetitions, and their shares, those of equal ones added up."""
    if len(at) == 1:
        return at, share
    unit = ROUNDING * float(np.ptp(at, axis=0).max())
    _, first, which = np.unique(np.round(at / unit), axis=0, return_index=True, return_inverse=True)
    return at[first], np.bincount(which.ravel(), share).astype(float)


def points_of(contacts: Contacts, j: int) -> tuple[FloatArray, FloatArray]:
    """Points (p, 2) of contact j about its origin, and their shares (p,) of its area."""
    corners = contacts.corners_of(j)
    if len(corners) < 3:
        return corners, np.full(len(corners), 1.0 / len(corners))
    if contacts.is_rectangle[j]:
        l1, l2 = contacts.sides[j]
        at, share = on_rectangle(float(l1), float(l2))
        return at + (corners.min(axis=0) + corners.max(axis=0)) / 2.0, share
    return on_polygon(corners)
