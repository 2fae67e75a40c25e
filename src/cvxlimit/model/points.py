"""Points of contacts with their shares of the area: where friction or pressure is gathered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import area_and_centroid


@dataclass(frozen=True, eq=False)
class Points:
    """Points of contacts where friction acts.

    ``xy`` (k, 2) is about the contact's origin in its plane; ``share`` (k,) is that of the
    contact's pressure, and adds up to 1 over a contact.
    """

    contact: IntArray
    xy: FloatArray
    share: FloatArray

    def mean_slip(self, rates: FloatArray) -> FloatArray:
        x, y = self.xy.T
        v1, v2, twist = (rates[self.contact, COLUMN[c]] for c in ("V1", "V2", "MT"))
        slip = np.hypot(v1 - y * twist, v2 + x * twist)
        return np.asarray(np.bincount(self.contact, self.share * slip, len(rates)), dtype=float)


Placing = Callable[[Contacts, IntArray], Points]


def at_centroids(contacts: Contacts, divisions: IntArray) -> Points:
    """Cells' centroids with the cells' areas: inside the exact limit surface."""
    points = []
    for cells in _cells(contacts, divisions):
        area = _areas(cells)
        points.append((cells.mean(axis=1), area / area.sum()))
    return _collected(points)


def at_corners(contacts: Contacts, divisions: IntArray) -> Points:
    """Cells' corners, each with its part of its cells' areas: outside the exact limit surface."""
    points = []
    for cells in _cells(contacts, divisions):
        area, corners = _areas(cells), cells.reshape(-1, 2)
        weight = np.repeat(area / area.sum() / cells.shape[1], cells.shape[1])
        near = np.round(corners / np.sqrt(area.sum()), 9)
        _, first, which = np.unique(near, axis=0, return_index=True, return_inverse=True)
        points.append((corners[first], np.bincount(which.ravel(), weight).astype(float)))
    return _collected(points)


def _collected(points: list[tuple[FloatArray, FloatArray]]) -> Points:
    contact = np.repeat(np.arange(len(points)), [len(xy) for xy, _ in points])
    return Points(contact, *(np.concatenate(parts) for parts in zip(*points, strict=True)))


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


def _areas(cells: FloatArray) -> FloatArray:
    """Returns the areas of parallelograms; twice those of triangles."""
    u, v = cells[:, 1] - cells[:, 0], cells[:, -1] - cells[:, 0]
    return np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
