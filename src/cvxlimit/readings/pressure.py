"""Where contacts press: plain NumPy on forces in the user's units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.mesh import turn
from cvxlimit.geometry.polygons import (
    effective_regions,
    mean_distance_on_segment,
    torsion_arm,
)


@dataclass(frozen=True, eq=False)
class Pressure:
    """Pressure centres and effective torsion arms (n,) of all contacts (Eq. 26 and 31); contacts
    without compression count as pressed at their centre, where they carry nothing anyway.
    """

    e1: FloatArray
    e2: FloatArray
    arm: FloatArray

    @classmethod
    def of(cls, forces: FloatArray, contacts: Contacts, epsilon: float = 0.0) -> Pressure:
        """Makes pressures from forces (n, 6), with N + ``epsilon`` for N in Eq. 31, which takes
        contacts that carry next to nothing for pressed near their centres: bounds are without
        it."""
        return cls.at(eccentricities(forces, epsilon), contacts)

    @classmethod
    def at(cls, centre: FloatArray, contacts: Contacts) -> Pressure:
        """Makes pressures at centres (n, 2)."""
        e1, e2 = centre.T
        return cls(e1, e2, effective_arm(e1, e2, contacts))

    @property
    def centre(self) -> FloatArray:
        return np.stack([self.e1, self.e2], axis=1)


def eccentricities(forces: FloatArray, epsilon: float = 0.0) -> FloatArray:
    """Pressure centres (e1, e2) = (-M2, M1) / N (n, 2; Eq. 31) of forces (n, 6), zero for contacts
    without compression."""
    normal = forces[:, [COLUMN["N"]]]
    moments = np.stack([-forces[:, COLUMN["M2"]], forces[:, COLUMN["M1"]]], axis=1)
    return np.where(normal > 0.0, moments / np.where(normal > 0.0, normal + epsilon, 1.0), 0.0)


def centres(forces: FloatArray, contacts: Contacts, sizes: FloatArray | float = 1.0) -> FloatArray:
    """The same as fractions of :func:`half_extent`, in contacts shrunk to ``sizes`` (n,)."""
    size = np.broadcast_to(sizes, len(contacts))[:, None]
    at, rows = eccentricities(forces), np.flatnonzero(~contacts.is_rectangle)
    if len(rows):
        at[rows] = _within(size[rows, :, None] * outlines_of(contacts, rows), at[rows])
    return np.clip(at / half_extent(contacts), -size, size)


def effective_arm(e1: FloatArray, e2: FloatArray, contacts: Contacts) -> FloatArray:
    """c_T (n,) of the effective regions around pressure centres (e1, e2).

    For a rectangle the effective area of Eq. 26; for other convex polygons P the region
    P ∩ (2 e - P), which is the same for a rectangle, and the mean distance from e over it. Beyond
    an edge it is that of the nearest point: to be outside at all is left to Eq. 9.
    """
    l1, l2 = contacts.sides.T
    with np.errstate(invalid="ignore"):
        arm = torsion_arm(
            np.maximum(l1 - 2.0 * np.abs(e1), 0.0), np.maximum(l2 - 2.0 * np.abs(e2), 0.0)
        )
    rows = np.flatnonzero(~contacts.is_rectangle)
    arm[rows] = polygon_arms(contacts, rows, np.stack([e1, e2], axis=1)[rows])
    return arm


def polygon_arms(contacts: Contacts, rows: IntArray, centres: FloatArray) -> FloatArray:
    """c_T (k,) of the effective regions of contacts ``rows`` (k,) about ``centres`` (k, 2)."""
    if not len(rows):
        return np.zeros(0)
    corners = outlines_of(contacts, rows)
    inside = _within(corners, centres)
    return areas_and_arms(effective_regions(corners, inside), inside)[1]


def outlines_of(contacts: Contacts, rows: IntArray) -> FloatArray:
    """Corners (k, m, 2) of contacts ``rows``, the last one repeated where there are fewer."""
    start, size = contacts.corner_start[rows], np.diff(contacts.corner_start)[rows]
    corner = np.minimum(np.arange(int(size.max())), size[:, None] - 1)
    return np.asarray(contacts.corner_xy[start[:, None] + corner])


def _within(corners: FloatArray, points: FloatArray) -> FloatArray:
    """The nearest points (k, 2) of convex polygons (k, m, 2), counter-clockwise."""
    along = np.roll(corners, -1, axis=1) - corners
    away = points[:, None] - corners
    outside = np.any(turn(along, away) < 0.0, axis=1, keepdims=True)
    square = (along**2).sum(axis=2)
    share = (away * along).sum(axis=2) / np.where(square > 0.0, square, 1.0)
    on_edges = corners + np.clip(share, 0.0, 1.0)[:, :, None] * along
    nearest = ((points[:, None] - on_edges) ** 2).sum(axis=2).argmin(axis=1)
    return np.where(outside, on_edges[np.arange(len(points)), nearest], points)


def half_extent(contacts: Contacts) -> FloatArray:
    """Half sides (n, 2), or a polygon's largest coordinates: pressure centres are fractions."""
    size = np.maximum.reduceat(np.abs(contacts.corner_xy), contacts.corner_start[:-1], axis=0)
    return np.where(contacts.is_rectangle[:, None], contacts.sides / 2.0, size)


def areas_and_arms(
    regions: Sequence[FloatArray], centres: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Areas (k,) of effective regions, and the mean distances (k,) of their points from their
    centres (k, 2); regions without area are the segments or points that are left of them."""
    corners, size = around(regions, centres)
    ahead = np.roll(corners, -1, axis=1)
    doubled = corners[..., 0] * ahead[..., 1] - corners[..., 1] * ahead[..., 0]
    on_edges = mean_distance_on_segment(corners, ahead)
    area = np.where(size > 2, doubled.sum(axis=1) / 2.0, 0.0)
    arm = (doubled * on_edges).sum(axis=1) / np.where(area > 0.0, 3.0 * area, 1.0)
    return area, np.where(area > 0.0, arm, on_edges[:, 0])


def around(regions: Sequence[FloatArray], centres: FloatArray) -> tuple[FloatArray, IntArray]:
    """Corners (k, m, 2) of regions from their centres (k, 2), the last one repeated where there are
    fewer, and how many they have (k,)."""
    size = np.array([len(region) for region in regions], dtype=int)
    corner = np.arange(max(int(size.max(initial=0)), 2))
    corners = np.zeros((len(regions), len(corner), 2))
    for own, region, centre in zip(corners, regions, centres, strict=True):
        if len(region):
            own[:] = region[np.minimum(corner, len(region) - 1)] - centre
    return corners, size


def own_arm(contacts: Contacts) -> FloatArray:
    """Largest arm (n,) that independent signs grant a contact: its own c_T where it is no
    rectangle, infinite on rectangles, whose effective regions are no larger anyway. On a flat
    triangle pressed at its long side that of the effective region is, and so is that of the hull of
    a contact that is not convex; with this limit the safe reading implies Eq. 24 on all shapes.
    """
    return np.where(contacts.is_rectangle, np.inf, contacts.torsion_arm)
