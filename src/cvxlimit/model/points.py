"""Points of contacts with their shares of the area: where friction or pressure is gathered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import area_and_centroid


@dataclass(frozen=True, eq=False)
class Points:
    """Points of contacts where friction acts.

    Attributes
    ----------
    contact : (k,) int array
    xy : (k, 2)
        In the contact's plane, about its origin.
    share : (k,)
        Of the contact's pressure; shares of a contact add up to 1.
    """

    contact: IntArray
    xy: FloatArray
    share: FloatArray

    def mean_slip(self, rates: FloatArray) -> FloatArray:
        """Slip of contacts' points (n,), weighted by shares, for relative rates (n, 6)."""
        x, y = self.xy.T
        v1, v2, twist = (rates[self.contact, COLUMN[c]] for c in ("V1", "V2", "MT"))
        slip = np.hypot(v1 - y * twist, v2 + x * twist)
        mean: FloatArray = np.bincount(self.contact, self.share * slip, len(rates)).astype(float)
        return mean


Placing = Callable[[Contacts, IntArray], Points]


def at_centroids(contacts: Contacts, divisions: IntArray) -> Points:
    """Cells' centroids with the cells' areas: inside the exact limit surface."""
    found = []
    for j, cells in enumerate(_cells(contacts, divisions)):
        area, centre = _areas_and_centroids(cells)
        found.append((j, centre, area / area.sum()))
    return _collected(found)


def at_corners(contacts: Contacts, divisions: IntArray) -> Points:
    """Cells' corners, each with its part of its cells' areas: outside the exact limit surface."""
    found = []
    for j, cells in enumerate(_cells(contacts, divisions)):
        area, _ = _areas_and_centroids(cells)
        weight = np.repeat(area / area.sum() / cells.shape[1], cells.shape[1])
        size = np.sqrt(float(contacts.area[j]))
        _, first, which = np.unique(
            np.round(cells.reshape(-1, 2) / size, 9), axis=0, return_index=True, return_inverse=True
        )
        shares: FloatArray = np.bincount(which.ravel(), weight).astype(float)
        found.append((j, cells.reshape(-1, 2)[first], shares))
    return _collected(found)


def _collected(found: list[tuple[int, FloatArray, FloatArray]]) -> Points:
    contact = np.repeat([j for j, _, _ in found], [len(xy) for _, xy, _ in found])
    xy, share = (np.concatenate([entry[i] for entry in found]) for i in (1, 2))
    return Points(contact, xy, share)


def _cells(contacts: Contacts, divisions: IntArray) -> list[FloatArray]:
    result = []
    for j, count in enumerate(divisions.tolist()):
        size = float(np.sqrt(contacts.area[j])) / count
        if contacts.is_rectangle[j]:
            result.append(_rectangle_cells(contacts.sides[j], size))
        else:
            result.append(np.concatenate([_fan(p, size) for p in contacts.pieces_of(j)]))
    return result


def _rectangle_cells(sides: FloatArray, size: float) -> FloatArray:
    counts = [max(1, int(np.ceil(side / size - 1e-9))) for side in sides]
    lines = [np.linspace(-s / 2.0, s / 2.0, k + 1) for s, k in zip(sides, counts, strict=True)]
    x, y = np.meshgrid(*lines, indexing="ij")
    grid = np.stack([x, y], axis=-1)
    corners = (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])
    return np.stack(corners, axis=2).reshape(-1, 4, 2)


def _fan(polygon: FloatArray, size: float) -> FloatArray:
    _, centre = area_and_centroid(polygon)
    cells = []
    for p, q in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        u, v = p - centre, q - centre
        k = max(1, int(np.ceil(np.sqrt(abs(u[0] * v[1] - u[1] * v[0])) / size - 1e-9)))
        for i in range(k):
            for l in range(k - i):  # noqa: E741
                at = centre + (i * u + l * v) / k
                cells.append([at, at + u / k, at + v / k])
                if i + l < k - 1:
                    cells.append([at + u / k, at + (u + v) / k, at + v / k])
    return np.array(cells)


def _areas_and_centroids(cells: FloatArray) -> tuple[FloatArray, FloatArray]:
    u, v = cells[:, 1] - cells[:, 0], cells[:, -1] - cells[:, 0]
    return np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]), cells.mean(axis=1)
