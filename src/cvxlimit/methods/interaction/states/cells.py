"""States of polygons that press in a box: cells of pressure centres with bounds on their arms.

On rectangles c(e) is convex between its kinks, so corners of boxes have the largest torsion. On
other polygons it is neither convex nor concave. A polygon within a box is therefore cut into cells,
each into triangles, on which

    c(e) <= sum of lambda_k t_k  for e = sum of lambda_k e_k

with proved t_k (:mod:`arm_bounds`), and by Balas' argument forces pressed in the cell are sums of
forces pressed at its corners with arms t_k. Signed shear is convex in e, and exact at corners.
Independent shear drags on torsion with kappa = eps / c; over a cell the least eps and the largest t
stand for it, which loses the less the smaller the cell. So both bounds tend to the truth as boxes
shrink. Eq. 27 beside Eq. 30 limits the sum over a cell's corners (:mod:`levered`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import clipped
from cvxlimit.methods.interaction.states.arm_bounds import ArmBounds
from cvxlimit.methods.interaction.states.support import half_extent, shear_support

_PARTS = 2
"""Cells along each side of a box, besides cuts at zero."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Corners of cells of contacts in boxes, k of them.

    Attributes
    ----------
    contact, cell : (k,)
        Which contact, and which cell of all, a corner is one of.
    place : (k, 2)
        Pressure centres, in the contacts' unit of length.
    arm : (k,)
        t_k, in the same.
    drag : (k, 2)
        kappa2, kappa1: what abs(V1) and abs(V2) cost beside abs(V), with independent signs.
    """

    contact: IntArray
    cell: IntArray
    place: FloatArray
    arm: FloatArray
    drag: FloatArray

    @property
    def start(self) -> IntArray:
        """First corner (g,) of each cell."""
        return np.flatnonzero(np.diff(self.cell, prepend=-1))

    @classmethod
    def of(
        cls,
        contacts: Contacts,
        chosen: NDArray[np.bool_],
        boxes: FloatArray,
        most: FloatArray | float = np.inf,
    ) -> Cells:
        """Of the contacts that are ``chosen`` (n,) in boxes (n, 2, 2), fractions of their extent.

        ``most`` (n,) is the largest arm that a contact may have under the reading: cells all of
        whose corners have a larger one get that.
        """
        half, largest = half_extent(contacts), np.broadcast_to(most, (len(contacts),))
        parts, start = [], 0
        for j in np.flatnonzero(chosen).tolist():
            low, high = (half[j] * boxes[j, :, side] for side in (0, 1))
            for place, arm in cells(contacts.corners_of(j), low, high):
                capped = np.full(len(arm), largest[j]) if arm.min() >= largest[j] else arm
                drag = np.tile(np.abs(place).min(axis=0)[::-1] / capped.max(), (len(arm), 1))
                index = np.full((2, len(arm)), [[j], [start]])
                parts.append((*index, place, capped, drag))
                start += 1
        nothing = np.zeros((2, 0), dtype=int)
        parts.append((*nothing, np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2))))
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def cells(
    corners: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Corners (m, 2) and arms t_k (m,) of the cells of a convex polygon (k, 2) between ``low`` and
    ``high`` (2,); none outside of it.

    Example
    -------
    >>> triangle = np.array([[-0.5, -0.3], [0.5, -0.3], [0.0, 0.6]])
    >>> found = cells(triangle, np.array([0.0, -0.1]), np.array([0.1, 0.0]))
    >>> all((arm > 0.0).all() for _, arm in found)
    True
    >>> len(cells(triangle, np.ones(2), 2.0 * np.ones(2)))
    0
    """
    return _cells(corners.tobytes(), low.tobytes(), high.tobytes())


@lru_cache(maxsize=4096)
def _cells(corners: bytes, low: bytes, high: bytes) -> tuple[tuple[FloatArray, FloatArray], ...]:
    polygon = np.frombuffer(corners).reshape(-1, 2)
    regions = _regions(polygon, np.frombuffer(low), np.frombuffer(high))
    if not regions:
        return ()
    fans = [np.array([(0, k, k + 1) for k in range(1, len(r) - 1)]) for r in regions]
    triangles = [region[fan] for region, fan in zip(regions, fans, strict=True)]
    bounds = ArmBounds(polygon).over(np.concatenate(triangles))
    ends = np.cumsum([len(fan) for fan in fans])[:-1]
    found = []
    for region, fan, bound in zip(regions, fans, np.split(bounds, ends), strict=True):
        arm = np.zeros(len(region))
        np.maximum.at(arm, fan, bound)
        found.append((region, arm))
    return tuple(found)


def independent_cell_support(w: FloatArray, friction: FloatArray, cells: Cells) -> FloatArray:
    """An upper bound (g,) on the power pressed in each cell; ``w`` (k, 6) and ``friction`` (k,) are
    those of the cells' corners, in their order."""
    torsion = cells.arm * np.abs(w[:, COLUMN["MT"]])
    shear = np.abs(w[:, [COLUMN["V1"], COLUMN["V2"]]])
    slope = shear_support(shear, np.ones(len(w)), cells.drag)
    e = cells.place
    moments = w[:, COLUMN["M1"]] * e[:, 1] - w[:, COLUMN["M2"]] * e[:, 0]
    return np.maximum.reduceat(moments + friction * np.maximum(torsion, slope), cells.start)


def _regions(polygon: FloatArray, low: FloatArray, high: FloatArray) -> list[FloatArray]:
    low, high = np.maximum(low, polygon.min(axis=0)), np.minimum(high, polygon.max(axis=0))
    least = 1e-12 * float(np.ptp(polygon, axis=0).max())
    if (high < low - least).any():
        return []
    high = np.maximum(high, low + 1e3 * least)  # a range without width still has states
    steps = [_ticks(a, b) for a, b in zip(low, high, strict=True)]
    boxes = np.array(list(product(*(pairwise(along) for along in steps))))  # (b, axis, end)
    parts = np.broadcast_to(polygon, (len(boxes), *polygon.shape))
    count = np.full(len(boxes), len(polygon))
    for axis, end in product(range(2), range(2)):
        limit = boxes[:, axis, end, None]
        inside = parts[:, :, axis] - limit
        parts, count = clipped(parts, count, inside if end == 0 else -inside)
        # exactly in the box: a state beyond it would belong to no cell
        reach = parts[:, :, axis]
        parts[:, :, axis] = np.maximum(reach, limit) if end == 0 else np.minimum(reach, limit)
    return [part[:n] for part, n in zip(parts, count.tolist(), strict=True) if n > 2]


def _ticks(low: float, high: float) -> FloatArray:
    ticks = np.linspace(low, high, _PARTS + 1)
    return np.union1d(ticks, [0.0]) if low < 0.0 < high else ticks
