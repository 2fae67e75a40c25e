"""Support functions of polygonal contacts: upper bounds from triangles of pressure centres.

A contact's polygon is cut into triangles. At a point e = sum of lambda_k e_k of a triangle with
corners e_k the torsion arm satisfies c(e) <= sum of lambda_k t_k, where t_k are proved bounds; the
power of a state that presses there is then bounded by values at the corners alone. The derivation
is in docs/evidence/interaction-bounds.md; letters w, e, mu, c, eps are those of :mod:`.support`.

====== ==================== ====================================================================
letter name                 meaning
====== ==================== ====================================================================
e_k    ``corners[..., :2]`` corners of triangles, in the contact's plane (length)
t_k    ``corners[..., 2]``  upper bound on the arm at each corner (length)
b_i    ``widths``           distances of a pressure centre from the polygon's edge lines (length)
e0     ``which``            point of a triangle whose effective region serves as template
M_i    ``moments``          integral of the distance from e0 over sector i of it (length cubed)
====== ==================== ====================================================================

Rates ``asked.w`` (n, 6) are in the order V1 V2 N M1 M2 MT of ``contacts.COMPONENTS``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, combinations_with_replacement, pairwise, product
from typing import NamedTuple

import numpy as np

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.extensions.interaction.states.settings import SUPPORT
from cvxlimit.extensions.interaction.states.support import (
    Asked,
    Lever,
    Pieces,
    Shares,
    Support,
    shear_support,
    within_quadrants,
)
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import clipped, effective_regions, mean_distance_on_segment
from cvxlimit.readings.pressure import areas_and_arms, around, half_extent, outlines_of

_SHEAR = [COLUMN["V1"], COLUMN["V2"]]

_PAIRS = np.array(list(combinations_with_replacement(range(3), 2)))
"""Bernstein coefficients of a quadratic over a triangle, as pairs of corners."""

_TRIPLES = np.array(list(combinations_with_replacement(range(3), 3)))
"""Bernstein coefficients of a cubic over a triangle, as triples of corners."""

_ALIKE = 1e-12
"""Share of a polygon's size, or of a distance, by which two that should be the same may differ:
about one step of the grid of :func:`grid_of`."""


@dataclass(frozen=True, eq=False)
class Cells:
    """The t triangles of all contacts' pressure centres, none of which crosses an axis.

    ``contact`` (t,) is the contact of each; ``corners`` (3, t, 3) are the coordinates e1 and e2 of
    its three corners and the bound t_k there, in the contacts' unit of length.
    """

    contact: IntArray
    corners: FloatArray

    def __len__(self) -> int:
        return len(self.contact)

    @classmethod
    def of(
        cls,
        contacts: Contacts,
        chosen: BoolArray,
        boxes: FloatArray,
        most: FloatArray | float = np.inf,
    ) -> Cells:
        """Returns the triangles of the contacts ``chosen`` (n,), within ``boxes`` (n, axis, end) in
        fractions of half sides; ``most`` (n,) is the largest arm that the reading allows."""
        half, largest = half_extent(contacts), np.broadcast_to(most, (len(contacts),))
        contact, parts = [np.zeros(0, dtype=int)], [np.zeros((0, 3, 3))]
        for j in np.flatnonzero(chosen).tolist():
            low, high = (half[j] * boxes[j, :, side] for side in (0, 1))
            own = capped(triangles(contacts.corners_of(j), low, high), float(largest[j]))
            parts.append(own)
            contact.append(np.full(len(own), j))
        return cls(np.concatenate(contact), np.swapaxes(np.concatenate(parts), 0, 1))


def triangles(corners: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Returns triangles (t, 3, 3) of a convex polygon between ``low`` and ``high`` (2,).

    Each of three corners has e1, e2 and t_k. Coordinates are rounded to :func:`grid_of`, so that
    equal polygons are computed once.
    """
    unit = grid_of(corners)
    on_grid = np.round(corners / unit), np.floor(low / unit), np.ceil(high / unit)
    return _triangles(unit, *(numbers.tobytes() for numbers in on_grid))


def capped(triangles: FloatArray, most: float) -> FloatArray:
    """Returns ``triangles`` (t, 3, 3) with bounds t_k of at most ``most``, which no arm exceeds.

    A triangle with corners on both sides of that value is cut along the line where its linear bound
    equals it.
    """
    over = triangles[..., 2] > most
    count = over.sum(axis=1)
    across = (count == 1) | (count == 2)
    if not over.any():
        return triangles
    # Corner a is alone on its side; p and q are where the line cuts the sides from a to b and c.
    alone = (over[across] == (count[across] == 1)[:, None]).argmax(axis=1)
    order = (alone[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles[across], order[..., None], axis=1).swapaxes(0, 1)
    p, q = (a + ((most - a[:, 2:]) / (end - a)[:, 2:]) * (end - a) for end in (b, c))
    parts = [np.stack(corners, axis=1) for corners in ((a, p, q), (p, b, c), (p, c, q))]
    result = np.concatenate([triangles[~across], *parts])
    result[..., 2] = np.minimum(result[..., 2], most)
    return result


def grid_of(corners: FloatArray) -> float:
    """Returns the length to which a polygon is rounded, a power of two; the margin of bounds on
    arms is a thousand times as large."""
    return float(2.0 ** (np.ceil(np.log2(np.ptp(corners, axis=0).max())) - SUPPORT.digits))


@lru_cache(maxsize=4096)
def _triangles(unit: float, corners: bytes, low: bytes, high: bytes) -> FloatArray:
    """Returns :func:`triangles` of a polygon and a box, whose arrays in multiples of ``unit`` come
    as bytes, since the cache needs keys."""
    polygon, *ends = (unit * np.frombuffer(numbers) for numbers in (corners, low, high))
    bounds = ArmBounds(polygon.reshape(-1, 2))
    regions = _regions(bounds.polygon, *ends)
    fans = [region[[0, k, k + 1]] for region in regions for k in range(1, len(region) - 1)]
    corners_xy = np.array(fans).reshape(-1, 3, 2)
    return np.dstack([corners_xy, bounds.over(corners_xy)])


def independent_cells(asked: Asked, cells: Cells) -> Support:
    """Returns the support function under the reading with independent signs, from above.

    The power is the larger of two. With torsion alone it is linear over a triangle, and so largest
    at a corner. With shear it is b . e + mu c1 m(c1, eps), with c1 = sum of lambda_k t_k. As m is
    convex it lies below m1 = sum of lambda_k m_k; the quadratic b . e + mu c1 m1 is at most its
    largest Bernstein coefficient. Another bound is the sum of the separate maxima of b . e and c1
    m, which both lie at corners. The smaller of both bounds counts.
    """
    twist, rates = np.abs(asked.w[:, COLUMN["MT"]]), np.abs(asked.w[:, _SHEAR])
    speed, (i, k) = np.hypot(*rates.T), _PAIRS.T

    def bounded(j: IntArray, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        mu, arm, eps = asked.friction[j], at[..., 2], np.abs(at[..., 1::-1])
        moment = _moment(asked.w[j], at)
        slopes = [shear_support(rates[j], c, e) for c, e in zip(arm, eps, strict=True)]
        m = np.stack(slopes)
        crossed = 0.5 * (moment[i] + moment[k] + mu * (arm[i] * m[k] + arm[k] * m[i]))
        slip = mu * np.fmin(arm * m, speed[j])  # m is infinite in a corner on an axis
        apart = moment.max(axis=0) + slip.max(axis=0)
        torsion = moment + mu * arm * twist[j]
        bound = np.maximum(np.fmin(crossed.max(axis=0), apart), torsion.max(axis=0))
        return at, np.maximum(torsion, moment + slip), bound

    return _largest(asked, cells.contact, cells.corners, bounded)


def levered_cells(lever: Lever, is_limited: bool, asked: Asked, cells: Cells) -> Support:
    """Returns the support function under a reading with torsion about a ``lever``, from above.

    Without Eq. 27 (``is_limited`` false) the power is largest at corners of triangles. With it the
    shares of a triangle's corners are bounded together, and triangles are halved.
    """

    def bounded(j: IntArray, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        own = Shares(lever, asked.w[j], asked.friction[j], at[..., :2], at[..., 2])
        if is_limited:
            return at, own.each(), own.together(asked.precision)
        power = own.power(own.twist)
        return at, power, power.max(axis=0)

    return _largest(asked, cells.contact, cells.corners, bounded)


def _largest(asked: Asked, rows: IntArray, corners: FloatArray, bounded: Pieces) -> Support:
    """Returns the largest power over triangles, each cut up to twice as often as boxes are."""
    most = 2 * asked.halvings
    return asked.largest(rows, corners, bounded, SUPPORT.boxes, most, _halved_triangles)


def _halved_triangles(corners: FloatArray, half: FloatArray) -> FloatArray:
    """Returns triangles (3, k, 3) cut across their longest side: (3, 2 k, 3)."""
    opposite = (np.roll(corners, 1, axis=0) - np.roll(corners, -1, axis=0))[..., :2] / half
    longest, every = (opposite**2).sum(axis=2).argmax(axis=0), np.arange(corners.shape[1])
    ends = [(longest + step) % 3 for step in (1, 2)]
    middle = 0.5 * (corners[ends[0], every] + corners[ends[1], every])
    halves = [corners.copy(), corners.copy()]
    for part, end in zip(halves, ends, strict=True):
        part[end, every] = middle
    return np.concatenate(halves, axis=1)


def _moment(w: FloatArray, at: FloatArray) -> FloatArray:
    """Returns b . e, the power (..., k) of pressure at places ``at`` (..., k, 2 or more)."""
    return np.asarray(w[:, COLUMN["M1"]] * at[..., 1] - w[:, COLUMN["M2"]] * at[..., 0])


def _regions(polygon: FloatArray, low: FloatArray, high: FloatArray) -> list[FloatArray]:
    """Returns the convex parts (k, 2) of a polygon between ``low`` and ``high`` (2,), cut by a grid
    and along both axes.
    """
    low, high = np.maximum(low, polygon.min(axis=0)), np.minimum(high, polygon.max(axis=0))
    least = _ALIKE * float(np.ptp(polygon, axis=0).max())
    if (high < low - least).any():
        return []
    # A range without width still has states: cells get a billionth of the polygon's size.
    high = np.maximum(high, low + 1e3 * least)
    extent = np.ptp(polygon, axis=0)
    steps = [_ticks(a, b, size) for a, b, size in zip(low, high, extent, strict=True)]
    boxes = np.array(list(product(*(pairwise(along) for along in steps))))
    parts = _in_boxes(np.broadcast_to(polygon, (len(boxes), *polygon.shape)), boxes)
    return [part for part in parts if len(part) > 2]


def corners_in(
    contacts: Contacts, rows: IntArray, boxes: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Returns the corners of contacts ``rows`` cut to ``boxes`` (n, 2, 2) in each quadrant.

    They are given as the contact (k,) of each, and its place (k, 2) in fractions of
    :func:`half_extent`.
    """
    if not len(rows):
        return rows, np.zeros((0, 2))
    quadrant, ends = within_quadrants(boxes[rows])
    j = rows[quadrant]
    half = half_extent(contacts)[j]
    parts = _in_boxes(outlines_of(contacts, j), np.moveaxis(ends * half, 0, 2))
    contact = np.repeat(j, [len(part) for part in parts])
    place = np.concatenate([part / h for part, h in zip(parts, half, strict=True)])
    once = np.unique(np.column_stack([contact, place]), axis=0)
    return once[:, 0].astype(int), once[:, 1:]


def _in_boxes(parts: FloatArray, boxes: FloatArray) -> list[FloatArray]:
    """Returns convex polygons (b, k, 2) clipped to ``boxes`` (b, axis, end), each (corners, 2)."""
    count = np.full(len(boxes), parts.shape[1])
    for axis, end in product(range(2), range(2)):
        limit = boxes[:, axis, end, None]
        inside = parts[:, :, axis] - limit
        parts, count = clipped(parts, count, inside if end == 0 else -inside)
        # exactly in the box: a state beyond it would belong to no cell
        reach = parts[:, :, axis]
        parts[:, :, axis] = np.maximum(reach, limit) if end == 0 else np.minimum(reach, limit)
    return [part[:n] for part, n in zip(parts, count.tolist(), strict=True)]


def _ticks(low: float, high: float, extent: float) -> FloatArray:
    """Returns the places of grid lines from ``low`` to ``high``, with 0 where it lies between."""
    count = max(2, int(np.ceil(SUPPORT.cells * (high - low) / extent - ROUNDING)))
    ticks = np.linspace(low, high, count + 1)
    return np.union1d(ticks, [0.0]) if low < 0.0 < high else ticks


class _Sectors(NamedTuple):
    """The k sectors of r regions S(e0), between the pressure centre e0 and each edge of its region.

    ``slabs`` (r, k) are the polygon's edges that limit the sectors, ``widths`` (r, k) their
    distances b_i(e0), ``moments`` (r, k) the sectors' moments M_i. ``is_template`` (r,) is true of
    regions that are wide enough to be templates.
    """

    slabs: IntArray
    widths: FloatArray
    moments: FloatArray
    is_template: BoolArray


class ArmBounds:
    """Upper bounds on the torsion arms of one convex polygon, corners (k, 2) counter-clockwise.

    ``normals`` (edges, 2) and ``offsets`` (edges,) state its edge lines; ``pairs`` (pairs, 2) are
    edges that are not parallel, and ``edges`` (pairs, 2, 2) the inverse of their normals.

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
        crossing = np.abs(np.linalg.det(rows)) > ROUNDING
        self.pairs, self.edges = every[crossing], np.linalg.inv(rows[crossing]).swapaxes(1, 2)

    def widths(self, centres: FloatArray) -> FloatArray:
        """Returns the distances b (p, edges) of ``centres`` (p, 2) from the edge lines."""
        return np.asarray(np.maximum(self.offsets - centres @ self.normals.T, 0.0))

    def over(self, triangles: FloatArray) -> FloatArray:
        """Returns bounds t (p, 3) at the corners of triangles (p, 3, 2) of pressure centres: of
        several valid ones, those with the least sum."""
        # Regions, areas and arms at all corners, and at the middles as one more template e0.
        centres = np.concatenate([triangles, triangles.mean(axis=1, keepdims=True)], axis=1)
        places, which = np.unique(centres.reshape(-1, 2), axis=0, return_inverse=True)
        which = which.reshape(-1, 4)
        regions = effective_regions(self.polygon, places)
        areas, arms = areas_and_arms(regions, places)
        widths, arm = self.widths(places), arms[which[:, :3]]
        corners = widths[which[:, :3]]
        # Bounds by regions around the effective one, whose arms are known in closed form.
        closed_form = np.concatenate(
            [self._by_parallelograms(corners), self._by_radii(corners)[:, None]], axis=1
        )
        best = _least_of(closed_form)
        # Where these lie above the true arms, the arms themselves are tried, raised by a margin.
        far = (best - arm).max(axis=1) > ROUNDING * self.size
        if far.any():
            margin = self._margin(
                self._sectors(regions, places, widths, areas),
                which[far],
                corners[far],
                areas[which[far, :3]],
                arm[far],
            )
            best[far] = _least_of(np.stack([best[far], arm[far] + margin[:, None]], axis=1))
        return best + ROUNDING * self.size

    def _by_parallelograms(self, widths: FloatArray) -> FloatArray:
        """Returns the arms (p, pairs, 3) of parallelograms between two pairs of parallel edges.

        ``widths`` are (p, 3, edges). Infinite where that is no bound: every other edge has to leave
        the parallelogram whole, or be at least as far away as the arm.
        """
        pairs, edges = self.pairs, self.edges
        half = widths[:, :, pairs].transpose(0, 2, 3, 1)[..., None] * edges[:, :, None, :]
        first, second = half[:, :, 0], half[:, :, 1]
        # Diagonals cut it into triangles of equal area, in which the mean distance from the centre
        # is two thirds of that of the outer side.
        p, q = first + second, second - first
        mean = (mean_distance_on_segment(p, q) + mean_distance_on_segment(q, -p)) / 3.0
        reach = np.abs(first @ self.normals.T) + np.abs(second @ self.normals.T)
        idle = (reach <= widths[:, None] * (1.0 + _ALIKE)).all(axis=2)
        far = widths.min(axis=1)[:, None] >= mean.max(axis=2)[:, :, None]
        own = np.zeros(idle.shape[1:], dtype=bool)
        np.put_along_axis(own, pairs, True, axis=1)
        is_bound = (idle | far | own).all(axis=2)
        return np.where(is_bound[:, :, None], mean, np.inf)

    def _by_radii(self, widths: FloatArray) -> FloatArray:
        """Returns two thirds of the largest radius (p, 3) of the regions within the largest widths
        of each triangle: that is a bound on the mean distance in any region.
        """
        most = widths.max(axis=1)
        half = most[:, self.pairs][..., None] * self.edges
        corners = np.concatenate([half.sum(axis=2), half[:, :, 0] - half[:, :, 1]], axis=1)
        reach = most[:, None] + ROUNDING * self.size
        inside = (np.abs(corners @ self.normals.T) <= reach).all(axis=2)
        radius = np.where(inside, np.linalg.norm(corners, axis=2), 0.0).max(axis=1, initial=0.0)
        return np.repeat(2.0 / 3.0 * radius[:, None], 3, axis=1)

    def _margin(
        self,
        sectors: _Sectors,
        which: IntArray,
        widths: FloatArray,
        areas: FloatArray,
        arm: FloatArray,
    ) -> FloatArray:
        """Returns by how much (p,) the arms at corners must be raised to be bounds.

        The sectors of the region at a template e0 are stretched by the ratios of widths; the bound
        of the arm is then a cubic over the triangle, and holds where all its Bernstein coefficients
        do. Of the four templates, the corners and the middle, the best counts.
        """
        (j, k, m), root = _TRIPLES.T, np.sqrt(areas)
        pairs = root[:, k] * root[:, m], root[:, j] * root[:, m], root[:, j] * root[:, k]
        weight = sum(pairs) / 3.0
        stated = (arm[:, j] * pairs[0] + arm[:, k] * pairs[1] + arm[:, m] * pairs[2]) / 3.0
        margin = np.full(len(which), np.inf)
        for e0 in which.T:
            slabs, template, moments, is_e0 = (part[e0] for part in sectors)
            ratio = np.take_along_axis(widths, slabs[:, None], axis=2) / template[:, None]
            cubic = (ratio[:, j] * ratio[:, k] * ratio[:, m]) @ moments[:, :, None]
            over = cubic[..., 0] - stated
            needed = np.divide(over, weight, out=np.full(over.shape, np.inf), where=weight > 0.0)
            raised = np.where(over > 0.0, needed, 0.0).max(axis=1)
            margin = np.minimum(margin, np.where(is_e0, raised, np.inf))
        return margin

    def _sectors(
        self,
        regions: Sequence[FloatArray],
        centres: FloatArray,
        widths: FloatArray,
        areas: FloatArray,
    ) -> _Sectors:
        """Returns the sectors between pressure centres and the edges of their regions."""
        corners, _ = around(regions, centres)
        ahead = np.roll(corners, -1, axis=1)
        middle = 0.5 * (corners + ahead)
        slab = np.abs(np.abs(middle @ self.normals.T) - widths[:, None]).argmin(axis=2)
        doubled = np.abs(corners[..., 0] * ahead[..., 1] - corners[..., 1] * ahead[..., 0])
        moments = doubled / 3.0 * mean_distance_on_segment(corners, ahead)
        width = np.take_along_axis(widths, slab, axis=1)
        is_e0 = areas > ROUNDING * self.size**2
        is_used = is_e0[:, None] & (moments > 0.0)  # not a corner repeated
        return _Sectors(slab, np.where(is_used, width, 1.0), moments, is_e0)


def _least_of(bounds: FloatArray) -> FloatArray:
    """Returns of bounds (p, b, 3) those (p, 3) with the least sum."""
    least = bounds.sum(axis=2).argmin(axis=1)
    return np.asarray(bounds[np.arange(len(bounds)), least])
