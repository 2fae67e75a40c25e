"""Friction at points of the contact, each with its share of a uniform pressure.

A contact pressed uniformly resists slip everywhere. With Coulomb's law at the centroids of cells,
each pressed by the cell's share of N, the contact is weaker than that, and with shares at the
cells' corners stronger: the mean of a convex function over a cell is no less than its value at the
centroid, and no more than the mean over the corners. Both errors fall with the square of the
cells' size. One corner each is what vertex forces are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import area_and_centroid
from cvxlimit.model.flow import Shortfall, corner_openings
from cvxlimit.model.formulations import ForceModel, Part
from cvxlimit.surfaces.base import CONSTANT, Coefficient, Condition, Norm
from cvxlimit.surfaces.exact_torsion import Edges

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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


def friction_at(contacts: Contacts, points: Points) -> ForceModel:
    """Corner compressions, and friction at points: abs(v_i) <= share_i (mu N + c A)."""
    j, (x, y) = points.contact, points.xy.T
    n, (n_x, n_y) = contacts.corner_contact, contacts.corner_xy.T
    parts = [
        Part("n", {"N": 1, "M1": n_y, "M2": -n_x}, n, nonneg=True),
        Part("v1", {"V1": 1, "MT": -y}, j),
        Part("v2", {"V2": 1, "MT": x}, j),
    ]
    resistance: dict[str, Coefficient] = {"N": points.share * contacts.friction[j]}
    if np.any(contacts.cohesion):
        resistance[CONSTANT] = points.share * (contacts.cohesion * contacts.area)[j]
    return ForceModel(contacts, parts, [Condition([Norm({"v1": 1}, {"v2": 1})], resistance, j)])


Placing = Callable[[Contacts, IntArray], Points]


@dataclass(frozen=True, eq=False)
class PointFriction:
    """Formulation with friction at points, ``divisions`` of them across a contact.

    Parameters
    ----------
    placing : callable
        :func:`at_centroids` (safe side) or :func:`at_corners` (unsafe side).
    divisions : int or (n,) int array
        Cells have about 1 / divisions of the contact's size.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> from cvxlimit.surfaces import Rocking
    >>> scene = builtin_scene("single-block")
    >>> inner = solve(scene, [Rocking()], formulation=PointFriction(at_centroids, 2))
    >>> round(inner.load_factor, 6)
    0.4
    """

    placing: Placing
    divisions: int | IntArray = 4

    def __post_init__(self) -> None:
        if np.min(self.divisions) < 1:
            raise ModelError(f"divisions must be at least 1, got {self.divisions!r}")

    def points(self, contacts: Contacts) -> Points:
        """Where friction acts."""
        count = np.broadcast_to(np.asarray(self.divisions, dtype=int), (len(contacts),))
        return self.placing(contacts, count)

    def __call__(self, contacts: Contacts) -> ForceModel:
        """See the class."""
        return friction_at(contacts, self.points(contacts))


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
    """Cells (k, 4, 2) of each rectangle, (k, 3, 2) of each other contact."""
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
    """Triangles between a polygon's centroid and its edges, each cut into k^2 alike."""
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
    """Of parallelograms (k, 4, 2) or triangles (k, 3, 2): the mean of the corners."""
    u, v = cells[:, 1] - cells[:, 0], cells[:, -1] - cells[:, 0]
    return np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]), cells.mean(axis=1)


class ExactFlow:
    """The exact flow rule of contacts pressed uniformly, for certificates of upper bounds.

    Has the methods of :class:`~cvxlimit.model.flow.FlowRule` that certificates use: the missing
    opening is mu times the mean slip, less the opening at the corner where it is least. Nothing
    is approximated, so a certificate with it bounds the load factor of the exact limit surface,
    whatever problem the mechanism came from.

    Parameters
    ----------
    contacts : Contacts
    """

    def __init__(self, contacts: Contacts) -> None:
        self.contacts, self.edges = contacts, Edges.of(contacts)

    def mean_slip(self, rates: FloatArray) -> FloatArray:
        """Mean slip (n,) of relative rates (n, 6)."""
        return self.edges.mean_slip(rates[:, :2], rates[:, COLUMN["MT"]])

    def shortfall(self, rates: FloatArray) -> Shortfall:
        """Of relative rates (n, 6); cohesion dissipates."""
        slip = self.mean_slip(rates)
        opening = self.contacts.corner_minimum(corner_openings(rates, self.contacts))
        lost = float((self.contacts.cohesion * self.contacts.area) @ slip)
        return Shortfall(self.contacts.friction * slip - opening, np.zeros(0), lost)

    def shortfall_bound(self, rates: FloatArray) -> FloatArray:
        """The missing opening (n,) itself."""
        return self.shortfall(rates).missing
