"""States of polygons that press in a box: cells of pressure centres with bounds on their arms.

On a cell c(e) <= sum of lambda_k t_k for e = sum of lambda_k e_k, so forces pressed in it are sums
of forces pressed at its corners with arms t_k: docs/evidence/interaction-bounds.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, combinations_with_replacement, pairwise, product

import numpy as np

from cvxlimit.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import clipped, effective_regions, mean_distance_on_segment
from cvxlimit.methods.interaction.settings import SUPPORT
from cvxlimit.methods.interaction.states.pressure import areas_and_arms, outlines_of
from cvxlimit.methods.interaction.states.support import (
    Lever,
    Shares,
    half_extent,
    shear_support,
    within_quadrants,
)


@dataclass(frozen=True, eq=False)
class Cells:
    """Corners of cells of contacts in boxes, k of them: of which contact and which cell of all,
    ``place`` (k, 2) and ``arm`` t_k in the contacts' unit of length; ``drag`` (k, 2) is kappa2 and
    kappa1: what abs(V1) and abs(V2) cost beside abs(V), with independent signs.
    """

    contact: IntArray
    cell: IntArray
    place: FloatArray
    arm: FloatArray
    drag: FloatArray

    @property
    def start(self) -> IntArray:
        return np.flatnonzero(np.diff(self.cell, prepend=-1))

    @classmethod
    def of(
        cls,
        contacts: Contacts,
        chosen: BoolArray,
        boxes: FloatArray,
        most: FloatArray | float = np.inf,
    ) -> Cells:
        """``most`` (n,) is the largest arm that a contact may have under the reading."""
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
    """Corners (m, 2) and arms t_k (m,) of the cells of a convex polygon between low and high."""
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


def independent_power(w: FloatArray, friction: FloatArray, cells: Cells) -> FloatArray:
    """An upper bound (g,) in each cell; ``w`` (k, 6) and ``friction`` are the corners'."""
    torsion = cells.arm * np.abs(w[:, COLUMN["MT"]])
    shear = np.abs(w[:, [COLUMN["V1"], COLUMN["V2"]]])
    slope = shear_support(shear, np.ones(len(w)), cells.drag)
    e = cells.place
    moments = w[:, COLUMN["M1"]] * e[:, 1] - w[:, COLUMN["M2"]] * e[:, 0]
    return np.maximum.reduceat(moments + friction * np.maximum(torsion, slope), cells.start)


def levered_power(
    lever: Lever, is_limited: bool, w: FloatArray, friction: FloatArray, cells: Cells
) -> FloatArray:
    """The same with torsion about a lever: at the corners, and with Eq. 27 for all of a cell's."""
    if not is_limited:
        shares = Shares(lever, w, friction, cells.place[None], cells.arm[None])
        return np.maximum.reduceat(shares.power(shares.twist)[0], cells.start)
    size = np.diff([*cells.start, len(cells.cell)])
    corner = np.arange(int(size.max()))[:, None]
    rows = cells.start + np.minimum(corner, size - 1)  # (corners, cells), the last one repeated
    at = cells.start
    return Shares(lever, w[at], friction[at], cells.place[rows], cells.arm[rows]).together()


def _regions(polygon: FloatArray, low: FloatArray, high: FloatArray) -> list[FloatArray]:
    low, high = np.maximum(low, polygon.min(axis=0)), np.minimum(high, polygon.max(axis=0))
    least = 1e-12 * float(np.ptp(polygon, axis=0).max())
    if (high < low - least).any():
        return []
    high = np.maximum(high, low + 1e3 * least)  # a range without width still has states
    steps = [_ticks(a, b) for a, b in zip(low, high, strict=True)]
    boxes = np.array(list(product(*(pairwise(along) for along in steps))))
    parts = _in_boxes(np.broadcast_to(polygon, (len(boxes), *polygon.shape)), boxes)
    return [part for part in parts if len(part) > 2]


def corners_in(
    contacts: Contacts, rows: IntArray, boxes: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Corners of what boxes (n, 2, 2) leave of contacts ``rows`` in each quadrant: of which contact
    (k,), and where (k, 2) as fractions of :func:`half_extent`."""
    quadrant, ends = within_quadrants(boxes[rows])
    j = rows[quadrant]
    half = half_extent(contacts)[j]
    parts = _in_boxes(outlines_of(contacts, j), np.moveaxis(ends * half, 0, 2))
    contact = np.repeat(j, [len(part) for part in parts])
    place = np.concatenate([part / h for part, h in zip(parts, half, strict=True)])
    found = np.unique(np.column_stack([contact, place]), axis=0)
    return found[:, 0].astype(int), found[:, 1:]


def _in_boxes(parts: FloatArray, boxes: FloatArray) -> list[FloatArray]:
    """What boxes (b, axis, end) leave of convex polygons (b, k, 2)."""
    count = np.full(len(boxes), parts.shape[1])
    for axis, end in product(range(2), range(2)):
        limit = boxes[:, axis, end, None]
        inside = parts[:, :, axis] - limit
        parts, count = clipped(parts, count, inside if end == 0 else -inside)
        # exactly in the box: a state beyond it would belong to no cell
        reach = parts[:, :, axis]
        parts[:, :, axis] = np.maximum(reach, limit) if end == 0 else np.minimum(reach, limit)
    return [part[:n] for part, n in zip(parts, count.tolist(), strict=True)]


def _ticks(low: float, high: float) -> FloatArray:
    ticks = np.linspace(low, high, SUPPORT.cells + 1)
    return np.union1d(ticks, [0.0]) if low < 0.0 < high else ticks


_TRIPLES = np.array(list(combinations_with_replacement(range(3), 3)))
"""Bernstein coefficients of a cubic over a triangle, as triples of corners."""


class ArmBounds:
    """Bounds on the arms of one convex polygon, corners (k, 2) counter-clockwise.

    Example
    -------
    >>> square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    >>> corner = np.array([[0.3, 0.3], [0.5, 0.3], [0.5, 0.5]])
    >>> ArmBounds(square).over(corner[None]).round(6).tolist()  # exact: a parallelogram
    [[0.153039, 0.1, 0.0]]
    """

    def __init__(self, polygon: FloatArray) -> None:
        self.polygon, self.size = polygon, float(np.ptp(polygon, axis=0).max())
        along = np.roll(polygon, -1, axis=0) - polygon
        length = np.linalg.norm(along, axis=1)
        turned = np.stack([along[:, 1], -along[:, 0]], axis=1)[length > 0.0]
        self.normals = turned / length[length > 0.0, None]
        self.offsets = (self.normals @ polygon.T).max(axis=1)
        every = np.array(list(combinations(range(len(turned)), 2)))
        rows = self.normals[every]
        crossing = np.abs(np.linalg.det(rows)) > SUPPORT.rounding
        self.pairs, self.edges = every[crossing], np.linalg.inv(rows[crossing]).swapaxes(1, 2)

    def widths(self, centres: FloatArray) -> FloatArray:
        return np.asarray(np.maximum(self.offsets - centres @ self.normals.T, 0.0))

    def over(self, triangles: FloatArray) -> FloatArray:
        """t (p, 3) of triangles (p, 3, 2) of pressure centres in the polygon: the least found."""
        centres = np.concatenate([triangles, triangles.mean(axis=1, keepdims=True)], axis=1)
        regions = effective_regions(self.polygon, centres.reshape(-1, 2))
        areas, arms = areas_and_arms(regions, centres.reshape(-1, 2))
        found = [
            self._over(at, regions[4 * k : 4 * k + 4], areas[4 * k : 4 * k + 4], arm[:3])
            for k, (at, arm) in enumerate(zip(centres, arms.reshape(-1, 4), strict=True))
        ]
        return np.array(found).reshape(-1, 3) + SUPPORT.rounding * self.size

    def _over(
        self, at: FloatArray, regions: Sequence[FloatArray], areas: FloatArray, arm: FloatArray
    ) -> FloatArray:
        widths = self.widths(at)
        bounds = [*self._by_parallelograms(widths[:3]), self._by_radii(widths[:3])]
        best: FloatArray = min(bounds, key=np.sum)
        if (best - arm).max() <= SUPPORT.rounding * self.size:
            return best
        sectors = [
            self._sectors(region - centre, there)
            for region, centre, there, area in zip(regions, at, widths, areas, strict=True)
            if area > SUPPORT.rounding * self.size**2  # else it is no e0
        ]
        return min(best, arm + self._margin(sectors, widths[:3], areas[:3], arm), key=np.sum)

    def _by_parallelograms(self, widths: FloatArray) -> FloatArray:
        pairs, edges = self.pairs, self.edges
        half = widths[:, pairs].transpose(1, 2, 0)[:, :, :, None] * edges[:, :, None, :]
        first, second = half[:, 0], half[:, 1]
        # diagonals cut them into triangles of one area, with 2/3 of the mean of their outer side
        p, q = first + second, second - first
        mean = (mean_distance_on_segment(p, q) + mean_distance_on_segment(q, -p)) / 3.0
        reach = np.abs(first @ self.normals.T) + np.abs(second @ self.normals.T)
        idle = (reach <= widths * (1.0 + 1e-12)).all(axis=1)
        far = widths.min(axis=0) >= mean.max(axis=1)[:, None]
        own = np.zeros(idle.shape, dtype=bool)
        np.put_along_axis(own, pairs, True, axis=1)
        return np.asarray(mean[(idle | far | own).all(axis=1)])

    def _by_radii(self, widths: FloatArray) -> FloatArray:
        most = widths.max(axis=0)
        half = most[self.pairs][:, :, None] * self.edges
        corners = np.concatenate([half.sum(axis=1), half[:, 0] - half[:, 1]])
        inside = (np.abs(corners @ self.normals.T) <= most + SUPPORT.rounding * self.size).all(
            axis=1
        )
        radius = np.linalg.norm(corners[inside], axis=1).max(initial=0.0)
        return np.full(3, 2.0 / 3.0 * float(radius))

    def _margin(
        self, sectors: Sequence[_Sectors], widths: FloatArray, areas: FloatArray, arm: FloatArray
    ) -> float:
        """What the arms at the corners must be raised by to be a bound, by the best e0."""
        (j, k, m), root, margin = _TRIPLES.T, np.sqrt(areas), np.inf
        pairs = (root[k] * root[m], root[j] * root[m], root[j] * root[k])
        weight = sum(pairs) / 3.0
        given = (arm[j] * pairs[0] + arm[k] * pairs[1] + arm[m] * pairs[2]) / 3.0
        for slabs, there, moments in sectors:
            ratio = widths[:, slabs] / there
            over = (ratio[j] * ratio[k] * ratio[m]) @ moments - given
            needed = np.divide(over, weight, out=np.full(len(over), np.inf), where=weight > 0.0)
            margin = min(margin, float(np.where(over > 0.0, needed, 0.0).max()))
        return margin

    def _sectors(self, corners: FloatArray, widths: FloatArray) -> _Sectors:
        """Slabs behind the edges of S(e0), given by corners from e0; b_i(e0); M_i of sectors."""
        ahead = np.roll(corners, -1, axis=0)
        middle = 0.5 * (corners + ahead)
        slab = np.abs(np.abs(middle @ self.normals.T) - widths).argmin(axis=1)
        doubled = np.abs(corners[:, 0] * ahead[:, 1] - corners[:, 1] * ahead[:, 0])
        return slab, widths[slab], doubled / 3.0 * mean_distance_on_segment(corners, ahead)


_Sectors = tuple[IntArray, FloatArray, FloatArray]
