"""Planar scenes: three degrees of freedom per block, three forces per contact.

A scene is planar when four things hold:

1. normals of contacts, dead and live forces lie in a plane, and load moments are about its normal;
2. centroids and centres of contacts are on one such plane;
3. each contact reaches as far along d on this plane as anywhere else;
4. reflection in the plane carries admissible forces of every contact into admissible ones.

Then the mean of forces and their mirror image is admissible, and its pressure centre is on the
plane and inside the contact. So three forces per contact suffice: one compression at each of the
contact's two ends on the plane, and the shear V along d. Its condition abs(V) gauge(d) <= mu N +
c A is two rows. Blocks move in the plane and turn about y, which opens edges of contacts alike and
twists none, so that the flow rule of the full scene holds. Facets keep reflection where d is along
one of their normals or through one of their corners.

======  =======================================================  ========  ===================
letter  what it is                                               shape     in the code
======  =======================================================  ========  ===================
y       unit normal of the plane                                 (3,)      Plane.normal
y       the same in the axes t1, t2 of contacts                  (n, 2)    Plane.across
d       y x n, in the same axes: along the contact and in plane  (n, 2)    Plane.along
N, V    compression; shear along d                               (n,)      "N", "V"
mu, c   friction coefficient, cohesion                           (n,)      in the conditions
A       area                                                     (n,)      in the conditions
======  =======================================================  ========  ===================
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.crushing import is_weak
from cvxlimit.model.formulations import ForceModel, Part, compressions_at, rotated
from cvxlimit.model.statics import DOF, Statics
from cvxlimit.reductions.mirror import (
    are_loads_alike,
    coefficients,
    directions,
    is_invariant,
    reflected,
)
from cvxlimit.surfaces.base import CONSTANT, Condition, LinearForm, YieldSurface, stated
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import Bounds, Rocking, with_bounds

_IN_PLANE = 2e-12
"""Largest component of a unit vector out of the plane, and largest distance from it over the size
of the scene, that count as rounding. The built-in planar scenes turned by random rotations stay
below 5e-15 (20 turns each); a certificate's forces must balance to 1e-11."""


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane of a planar scene, and its contacts seen in it.

    Attributes
    ----------
    normal : (3,) array
        The unit vector y.
    contacts : Contacts
        The n contacts of the scene.
    conditions : sequence of Condition
        Conditions on N and V, with one coefficient per contact.
    names : frozenset of str
        Names of the surfaces that these conditions are of.
    """

    normal: FloatArray
    contacts: Contacts
    conditions: Sequence[Condition] = ()
    names: frozenset[str] = frozenset()

    @cached_property
    def across(self) -> FloatArray:
        """y in the contacts' axes t1, t2, (n, 2)."""
        return np.asarray(self.contacts.axes[:, :2] @ self.normal)

    @cached_property
    def along(self) -> FloatArray:
        """d = y x n in the contacts' axes t1, t2, (n, 2): y turned by a right angle."""
        return np.stack([-self.across[:, 1], self.across[:, 0]], axis=1)

    @cached_property
    def ends(self) -> FloatArray:
        """Places (n, 2) of each contact's two ends along d, from its origin."""
        reach = self._reach
        start = self.contacts.corner_start[:-1]
        return np.stack([np.minimum.reduceat(reach, start), np.maximum.reduceat(reach, start)], 1)

    @cached_property
    def _reach(self) -> FloatArray:
        """Place along d of each corner of all contacts (corners,)."""
        j = self.contacts.corner_contact
        return np.asarray((self.contacts.corner_xy * self.along[j]).sum(axis=1))

    def spans(self, tolerance: float) -> bool:
        """Returns True if each contact reaches both its ends on the plane itself: corners there lie
        on the plane or on both sides of it, to a ``tolerance`` in length."""
        start = self.contacts.corner_start[:-1]
        j = self.contacts.corner_contact
        beside = (self.contacts.corner_xy * self.across[j]).sum(axis=1)
        for side in (0, 1):
            at = np.abs(self._reach - self.ends[j, side]) <= tolerance
            least = np.minimum.reduceat(np.where(at, beside, np.inf), start)
            most = np.maximum.reduceat(np.where(at, beside, -np.inf), start)
            if (least > tolerance).any() or (most < -tolerance).any():
                return False
        return True

    def model(self, contacts: Contacts) -> ForceModel:
        """Returns the formulation: compressions at the two ends, shear along d, and the conditions
        on them. Rectangles that crush need one unknown s more: s is at most the compression at
        either end, and N^2 <= 2 f A s, which is N <= f (l - 2 abs(M) / N) b."""
        each, faces = np.arange(len(contacts)), contacts.faces
        at = np.concatenate([self.ends[:, 0], self.ends[faces, 1]])  # points have one end
        on = np.concatenate([each, faces])
        along = self.along[faces]
        parts = [
            compressions_at(contacts, on, at[:, None] * self.along[on]),
            Part("V", {"V1": along[:, 0], "V2": along[:, 1]}, faces),
        ]
        conditions = list(self.conditions)
        if len(weak := np.flatnonzero(is_weak(contacts))):
            parts.append(Part("s", {}, weak))
            length = np.ptp(self.ends[weak], axis=1)
            for sign in (-1.0, 1.0):  # of either end: N / 2 + M / l, M about y
                m1, m2 = (sign * self.across[weak] / length[:, None]).T
                end = {"N": 0.5, "M1": m1, "M2": m2, "s": -1.0}
                conditions.append(Condition((), end, weak))
            most = 2.0 * (contacts.compressive_strength * contacts.area)[weak]
            conditions.append(rotated("N", {"s": 1}, {CONSTANT: most}, weak))
        return ForceModel(contacts, parts, conditions, self.names | {Rocking.name})

    @property
    def has_sides(self) -> bool:
        """True if d is along a side of every contact that crushes, which are rectangles."""
        weak = np.flatnonzero(is_weak(self.contacts))
        is_along = np.abs(self.along[weak]).max(axis=1, initial=0.0) >= 1.0 - _IN_PLANE
        return bool((self.contacts.is_rectangle[weak] & is_along).all())

    def taking(self, kept: NDArray[np.bool_]) -> Plane:
        """Returns the plane with only those contacts for which ``kept`` (n,) is true."""
        if kept.all():
            return self
        rows, place = np.flatnonzero(kept), np.cumsum(kept) - 1
        smaller = []
        for c in self.conditions:
            own = rows if c.contact is None else np.flatnonzero(kept[c.contact])
            on = None if c.contact is None else place[c.contact[own]]
            resistance = {k: np.asarray(v)[own] for k, v in c.resistance.items()}
            smaller.append(replace(c, resistance=resistance, contact=on))
        return replace(self, contacts=self.contacts.take(rows), conditions=smaller)

    def with_strength(self, surfaces: Sequence[YieldSurface]) -> Plane | None:
        """Returns the plane with the surfaces' conditions; None if they are not those of a
        plane."""
        each = np.arange(len(self.contacts))
        y = np.pad(self.across, ((0, 0), (0, 1)))
        if not is_invariant(surfaces, self.contacts, each, reflected(y)):
            return None
        surfaces = with_bounds(surfaces, self.contacts)
        stated_rows = [row for s in surfaces for row in self._planar_rows(s)]
        rows = [row for row in stated_rows if row is not None]
        if len(rows) < len(stated_rows):
            return None
        names = frozenset(surface.name for surface in surfaces)
        return replace(self, conditions=rows, names=names)

    def _planar_rows(self, surface: YieldSurface) -> Iterator[Condition | None]:
        """Yields a surface's conditions on N and V, two rows for each of its conditions; None for
        one that depends on other forces in the plane. Rocking is in the formulation itself."""
        if type(surface) is Rocking:
            return
        if type(surface) is Bounds:  # along the normals of points, which are in the plane
            yield from surface.conditions(self.contacts)
            return
        for condition in stated(surface, self.contacts):
            resistance = coefficients(condition.resistance, len(self.contacts))
            sizes = self._shear_sizes(condition, surface.cone)
            if resistance is None or sizes is None or np.any(self._in_plane(resistance)[:, [0, 2]]):
                yield None
                return
            # A condition without shear that no compression can break needs no rows.
            if not sizes.any() and (resistance >= 0.0).all():
                continue
            strength: dict[str, FloatArray] = {"N": resistance[:, 2]}
            if resistance[:, 6].any():
                strength[CONSTANT] = resistance[:, 6]
            for size, sign in zip(sizes, (-1.0, 1.0), strict=True):
                row: LinearForm = {**strength, "V": sign * size}
                yield Condition((), row)

    def _shear_sizes(self, condition: Condition, cone: Cone) -> FloatArray | None:
        """Returns the sum of a condition's norms (2, n) for V = 1 and V = -1; None if they depend
        on more than V."""
        total = np.zeros((2, len(self.contacts)))
        for norm in condition.norms:
            shear = []
            for form in norm.weighted_rows:
                row = coefficients(form, len(self.contacts))
                if row is None or np.any(self._in_plane(row)[:, 1:]) or row[:, 6].any():
                    return None
                shear.append(self._in_plane(row)[:, 0])
            total[0] += cone.gauge(shear)
            total[1] += cone.gauge([-s for s in shear])
        return total

    def _in_plane(self, rows: FloatArray) -> FloatArray:
        """Returns coefficients (n, 3) of V, N and the moment about y, from those (n, 7) of V1, V2,
        N, M1, M2, MT and the constant."""
        shear = (rows[:, :2] * self.along).sum(axis=1)
        moment = (rows[:, 3:5] * self.across).sum(axis=1)
        return np.stack([shear, rows[:, 2], moment], axis=1)


@dataclass(frozen=True, eq=False)
class InPlane:
    """The formulation of a plane's contacts, which states their strength itself."""

    plane: Plane
    sees_to_strength: ClassVar[bool] = True

    def __call__(self, contacts: Contacts) -> ForceModel:
        return self.plane.model(contacts)


def find_plane(statics: Statics, surfaces: Sequence[YieldSurface]) -> Plane | None:
    """Returns the plane of a scene under these surfaces, or None if the scene is not planar to
    rounding."""
    size = statics.contacts.extent
    for normal in _candidates(statics):
        if _is_flat(statics, normal, size):
            plane = Plane(normal, statics.contacts)
            if plane.has_sides and plane.spans(_IN_PLANE * size):
                return plane.with_strength(surfaces)
    return None


def _candidates(statics: Statics) -> Iterator[FloatArray]:
    """Yields unit vectors that may be the plane's normal: the direction in which normals of
    contacts vary least, and the edges of the first contact."""
    contacts = statics.contacts
    corners = contacts.corner_points[: contacts.corner_start[1]]
    edges = np.roll(corners, -1, axis=0) - corners
    normals = contacts.axes[:, 2]
    axes = np.linalg.svd(np.append(normals, np.zeros((3, 3)), 0), full_matrices=False)[2]
    return directions([axes[2], *edges])


def _is_flat(statics: Statics, normal: FloatArray, size: float) -> bool:
    """Returns True if the first two points of the module's text hold for this normal in a scene of
    this size."""
    contacts = statics.contacts
    if np.abs(contacts.axes[:, 2] @ normal).max() > _IN_PLANE:
        return False
    loads = (load.reshape(-1, DOF) for load in (statics.dead, statics.live))
    if not all(are_loads_alike(f, f @ reflected(normal), size, 2.0 * _IN_PLANE) for f in loads):
        return False
    places = [contacts.origin @ normal, statics.centroids[statics.row_of_block >= 0] @ normal]
    return float(np.ptp(np.concatenate(places))) <= _IN_PLANE * size
