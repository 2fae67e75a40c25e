"""Friction at points of the contact, each with its share of a uniform pressure.

With Coulomb's law at the centroids of cells the contact is weaker than one that resists slip
everywhere, and with shares at the cells' corners stronger: the mean of a convex function over a
cell lies between. Both errors fall with the square of the cells' size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import IntArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.formulations import ForceModel, compressions_at, friction_at
from cvxlimit.model.points import Placing, Points, at_centroids, at_corners
from cvxlimit.surfaces.base import CONSTANT, Coefficient, is_some, product

__all__ = ["PointFriction", "at_centroids", "at_corners"]


@dataclass(frozen=True, eq=False)
class PointFriction:
    """Formulation with friction at points: ``placing`` is :func:`at_centroids` (safe side) or
    :func:`at_corners` (unsafe side); cells have about 1 / ``divisions`` of the contact's size.

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

    def of(self, contacts: IntArray) -> PointFriction:
        """Returns the formulation of these ``contacts`` (k,) only."""
        divisions = np.asarray(self.divisions)
        return replace(self, divisions=divisions[contacts]) if divisions.ndim else self

    def points(self, contacts: Contacts) -> Points:
        count = np.broadcast_to(np.asarray(self.divisions, dtype=int), (len(contacts),))
        faces = contacts.faces
        if len(faces) == len(contacts):
            return self.placing(contacts, count)
        points = self.placing(contacts.take(faces), count[faces])
        return replace(points, contact=faces[points.contact])

    def __call__(self, contacts: Contacts) -> ForceModel:
        points = self.points(contacts)
        j, resistance = points.contact, dict[str, Coefficient]()
        resistance["N"] = product(points.share, contacts.friction[j])
        if is_some(contacts.cohesion):
            resistance[CONSTANT] = product(points.share * contacts.area[j], contacts.cohesion[j])
        parts, coulomb = friction_at(j, points.xy, resistance)
        n = compressions_at(contacts, contacts.corner_contact, contacts.corner_xy)
        return ForceModel(contacts, [n, *parts], [coulomb])
