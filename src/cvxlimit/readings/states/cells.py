"""Largest power of states of polygons that press in a box: triangles with bounds on their arms.

On a triangle c(e) <= sum of lambda_k t_k for e = sum of lambda_k e_k, with proved t_k; power is
then bounded from its corners: docs/evidence/interaction-bounds.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, combinations_with_replacement, pairwise, product

import numpy as np

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import clipped, effective_regions, mean_distance_on_segment
from cvxlimit.readings.settings import SUPPORT
from cvxlimit.readings.states.pressure import areas_and_arms, around, outlines_of
from cvxlimit.readings.states.support import (
    Asked,
    Lever,
    Pieces,
    Shares,
    Support,
    half_extent,
    shear_support,
    within_quadrants,
)


@dataclass(frozen=True, eq=False)
class Cells:
    """Triangles of pressure centres of contacts in boxes, t of them, none across an axis: of which
    ``contact`` (t,), and their ``corners`` (3, t, 3): place and t_k, in the contacts' unit of
    length."""

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
        """``most`` (n,) is the largest arm that a contact may have under the reading."""
        half, largest = half_extent(contacts), np.broadcast_to(most, (len(contacts),))
        contact, parts = [np.zeros(0, dtype=int)], [np.zeros((0, 3, 3))]
        for j in np.flatnonzero(chosen).tolist():
            low, high = (half[j] * boxes[j, :, side] for side in (0, 1))
            found = capped(triangles(contacts.corners_of(j), low, high), float(largest[j]))
            parts.append(found)
            contact.append(np.full(len(found), j))
        return cls(np.concatenate(contact), np.swapaxes(np.concatenate(parts), 0, 1))


def triangles(corners: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Triangles (t, 3, 3) of a convex polygon between low and high: places of their corners, and
    bounds t_k on their arms. Polygons that are equal but for :func:`grid_of` share theirs."""
    unit = grid_of(corners)
    on_grid = np.round(corners / unit), np.floor(low / unit), np.ceil(high / unit)
    return _triangles(unit, *(numbers.tobytes() for numbers in on_grid))


def capped(given: FloatArray, most: float) -> FloatArray:
    """Triangles (t, 3, 3) whose bounds t_k are at most ``most``, which no arm exceeds: those across
    are cut where their bound is that."""
    over = given[..., 2] > most
    count = over.sum(axis=1)
    across = (count == 1) | (count == 2)
    if not over.any():
        return given
    alone = (over[across] == (count[across] == 1)[:, None]).argmax(axis=1)
    order = (alone[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(given[across], order[..., None], axis=1).swapaxes(0, 1)
    p, q = (a + ((most - a[:, 2:]) / (end - a)[:, 2:]) * (end - a) for end in (b, c))
    parts = [np.stack(corners, axis=1) for corners in ((a, p, q), (p, b, c), (p, c, q))]
    found = np.concatenate([given[~across], *parts])
    found[..., 2] = np.minimum(found[..., 2], most)
    return found


def grid_of(corners: FloatArray) -> float:
    """What a polygon is rounded to: bounds on arms have a margin that is a thousand times that."""
    return float(2.0 ** (np.ceil(np.log2(np.ptp(corners, axis=0).max())) - SUPPORT.digits))


@lru_cache(maxsize=4096)
def _triangles(unit: float, corners: bytes, low: bytes, high: bytes) -> FloatArray:
    polygon, *ends = (unit * np.frombuffer(numbers) for numbers in (corners, low, high))
    bounds = ArmBounds(polygon.reshape(-1, 2))
    regions = _regions(bounds.polygon, *ends)
    fans = [region[[0, k, k + 1]] for region in regions for k in range(1, len(region) - 1)]
    found = np.array(fans).reshape(-1, 3, 2)
    return np.dstack([found, bounds.over(found)])


def independent_cells(asked: Asked, cells: Cells, halvings: int) -> Support:
    """With independent signs. Torsion alone is largest at corners. Shear has c1 m(c1, eps) with
    c1 = sum of lambda_k t_k and m convex, so below m1 = sum of lambda_k m_k: b . e + mu c1 m1 is
    below the largest of its Bernstein coefficients. And c1 m is largest at corners on its own."""
    twist, rates = np.abs(asked.w[:, COLUMN["MT"]]), np.abs(asked.w[:, _SHEAR])
    speed, (i, k) = np.hypot(*rates.T), _PAIRS.T

    def found(j: IntArray, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
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

    return _largest(asked, cells.contact, cells.corners, found, halvings)


def levered_cells(
    lever: Lever, is_limited: bool, asked: Asked, cells: Cells, halvings: int
) -> Support:
    """With torsion about a lever: at corners, and with Eq. 27 for all of a triangle's together."""

    def shares(j: IntArray, at: FloatArray) -> Shares:
        return Shares(lever, asked.w[j], asked.friction[j], at[..., :2], at[..., 2])

    def found(j: IntArray, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        there = shares(j, at)
        if is_limited:
            return at, there.each(), there.together()
        power = there.power(there.twist)
        return at, power, power.max(axis=0)

    j, at = cells.contact, cells.corners
    if not is_limited:
        return _largest(asked, j, at, found, 0)
    rough, least = shares(j, at).roughly(), asked.floor.copy()
    order = np.lexsort((-rough, j))
    first = order[np.flatnonzero(np.diff(j[order], prepend=-1))]
    reached = shares(j[first], at[:, first]).each().max(axis=0)
    least[j[first]] = np.maximum(least[j[first]], reached)
    kept = rough >= least[j]
    upper, where = _largest(asked, j[kept], at[:, kept], found, halvings)
    np.maximum.at(upper, j[~kept], rough[~kept])
    return upper, where


def _largest(
    asked: Asked, rows: IntArray, corners: FloatArray, found: Pieces, halvings: int
) -> Support:
    return asked.largest(rows, corners, found, SUPPORT.boxes, 2 * halvings, _halved_triangles)


def _halved_triangles(corners: FloatArray, half: FloatArray) -> FloatArray:
    """Triangles (3, k, 3) cut across their longest side: (3, 2 k, 3)."""
    opposite = (np.roll(corners, 1, axis=0) - np.roll(corners, -1, axis=0))[..., :2] / half
    longest, every = (opposite**2).sum(axis=2).argmax(axis=0), np.arange(corners.shape[1])
    ends = [(longest + step) % 3 for step in (1, 2)]
    middle = 0.5 * (corners[ends[0], every] + corners[ends[1], every])
    halves = [corners.copy(), corners.copy()]
    for part, end in zip(halves, ends, strict=True):
        part[end, every] = middle
    return np.concatenate(halves, axis=1)


_SHEAR = [COLUMN["V1"], COLUMN["V2"]]

_PAIRS = np.array(list(combinations_with_replacement(range(3), 2)))
"""Bernstein coefficients of a quadratic over a triangle, as pairs of corners."""


def _moment(w: FloatArray, at: FloatArray) -> FloatArray:
    return np.asarray(w[:, COLUMN["M1"]] * at[..., 1] - w[:, COLUMN["M2"]] * at[..., 0])


def _regions(polygon: FloatArray, low: FloatArray, high: FloatArray) -> list[FloatArray]:
    low, high = np.maximum(low, polygon.min(axis=0)), np.minimum(high, polygon.max(axis=0))
    least = 1e-12 * float(np.ptp(polygon, axis=0).max())
    if (high < low - least).any():
        return []
    high = np.maximum(high, low + 1e3 * least)  # a range without width still has states
    extent = np.ptp(polygon, axis=0)
    steps = [_ticks(a, b, size) for a, b, size in zip(low, high, extent, strict=True)]
    boxes = np.array(list(product(*(pairwise(along) for along in steps))))
    parts = _in_boxes(np.broadcast_to(polygon, (len(boxes), *polygon.shape)), boxes)
    return [part for part in parts if len(part) > 2]


def corners_in(
    contacts: Contacts, rows: IntArray, boxes: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Corners of what boxes (n, 2, 2) leave of contacts ``rows`` in each quadrant: of which contact
    (k,), and where (k, 2) as fractions of :func:`half_extent`."""
    if not len(rows):
        return rows, np.zeros((0, 2))
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


def _ticks(low: float, high: float, extent: float) -> FloatArray:
    count = max(2, int(np.ceil(SUPPORT.cells * (high - low) / extent - ROUNDING)))
    ticks = np.linspace(low, high, count + 1)
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
        crossing = np.abs(np.linalg.det(rows)) > ROUNDING
        self.pairs, self.edges = every[crossing], np.linalg.inv(rows[crossing]).swapaxes(1, 2)

    def widths(self, centres: FloatArray) -> FloatArray:
        return np.asarray(np.maximum(self.offsets - centres @ self.normals.T, 0.0))

    def over(self, triangles: FloatArray) -> FloatArray:
        """t (p, 3) of triangles (p, 3, 2) of pressure centres in the polygon: the least found."""
        centres = np.concatenate([triangles, triangles.mean(axis=1, keepdims=True)], axis=1)
        places, which = np.unique(centres.reshape(-1, 2), axis=0, return_inverse=True)
        which = which.reshape(-1, 4)
        regions = effective_regions(self.polygon, places)
        areas, arms = areas_and_arms(regions, places)
        widths, arm = self.widths(places), arms[which[:, :3]]
        corners = widths[which[:, :3]]
        found = np.concatenate(
            [self._by_parallelograms(corners), self._by_radii(corners)[:, None]], axis=1
        )
        best = _least_of(found)
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
        """Of widths (p, 3, edges) (p, pairs, 3), infinite where they are no bound."""
        pairs, edges = self.pairs, self.edges
        half = widths[:, :, pairs].transpose(0, 2, 3, 1)[..., None] * edges[:, :, None, :]
        first, second = half[:, :, 0], half[:, :, 1]
        # diagonals cut them into triangles of one area, with 2/3 of the mean of their outer side
        p, q = first + second, second - first
        mean = (mean_distance_on_segment(p, q) + mean_distance_on_segment(q, -p)) / 3.0
        reach = np.abs(first @ self.normals.T) + np.abs(second @ self.normals.T)
        idle = (reach <= widths[:, None] * (1.0 + 1e-12)).all(axis=2)
        far = widths.min(axis=1)[:, None] >= mean.max(axis=2)[:, :, None]
        own = np.zeros(idle.shape[1:], dtype=bool)
        np.put_along_axis(own, pairs, True, axis=1)
        is_bound = (idle | far | own).all(axis=2)
        return np.where(is_bound[:, :, None], mean, np.inf)

    def _by_radii(self, widths: FloatArray) -> FloatArray:
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
        """What the arms at corners must be raised by to be bounds (p,), by the best e0 of four."""
        (j, k, m), root = _TRIPLES.T, np.sqrt(areas)
        pairs = root[:, k] * root[:, m], root[:, j] * root[:, m], root[:, j] * root[:, k]
        weight = sum(pairs) / 3.0
        given = (arm[:, j] * pairs[0] + arm[:, k] * pairs[1] + arm[:, m] * pairs[2]) / 3.0
        margin = np.full(len(which), np.inf)
        for e0 in which.T:
            slabs, there, moments, is_e0 = (part[e0] for part in sectors)
            ratio = np.take_along_axis(widths, slabs[:, None], axis=2) / there[:, None]
            over = ((ratio[:, j] * ratio[:, k] * ratio[:, m]) @ moments[:, :, None])[..., 0] - given
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
        corners, _ = around(regions, centres)
        ahead = np.roll(corners, -1, axis=1)
        middle = 0.5 * (corners + ahead)
        slab = np.abs(np.abs(middle @ self.normals.T) - widths[:, None]).argmin(axis=2)
        doubled = np.abs(corners[..., 0] * ahead[..., 1] - corners[..., 1] * ahead[..., 0])
        moments = doubled / 3.0 * mean_distance_on_segment(corners, ahead)
        there = np.take_along_axis(widths, slab, axis=1)
        is_e0 = areas > ROUNDING * self.size**2
        is_used = is_e0[:, None] & (moments > 0.0)  # not a corner repeated
        return slab, np.where(is_used, there, 1.0), moments, is_e0


def _least_of(bounds: FloatArray) -> FloatArray:
    """Returns of bounds (p, b, 3) those (p, 3) with the least sum."""
    least = bounds.sum(axis=2).argmin(axis=1)
    return np.asarray(bounds[np.arange(len(bounds)), least])


_Sectors = tuple[IntArray, FloatArray, FloatArray, BoolArray]
"""Of regions S(e0) (r, k): slabs behind their edges, b_i(e0), and M_i of sectors; and which (r,)
are wide enough to be an e0."""
