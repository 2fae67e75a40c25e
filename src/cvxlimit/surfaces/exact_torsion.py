"""Exact torsion and shear of a contact under uniform pressure (Eq. 18-21), for any polygon.

Friction mu p acts against the slip of every point r of the contact. Slip is a rotation about a
point c of the plane, the *centre* of rotation, so the limit states are, as shares of mu N,

    V  = mean of (r - c)/abs(r - c), turned by 90 degrees,
    MT = mean of abs(r - c), plus the moment of V at c about the contact's origin,

with c anywhere. Means are over the contact's area A. By Gauss's theorem integrals over the area are
sums over its edges. With n the outward normal of an edge, h = (r - c) . n the signed distance of
its line from c, and ds along the edge,

    integral of abs(r - c) dA           = sum over edges of h/3 times integral of abs(r - c) ds,
    integral of (r - c)/abs(r - c) dA   = sum over edges of n times integral of abs(r - c) ds,

since the divergence of abs(r - c) (r - c) is 3 abs(r - c), and the gradient of abs(r - c) is
(r - c)/abs(r - c). Along an edge abs(r - c) = hypot(h, s), with s from the foot of c on its line.

======  =================================================  ===========  ===========================
letter  what it is                                         shape        in the code
======  =================================================  ===========  ===========================
c       centre of rotation                                 (n, ..., 2)  ``centre``
t       unit vector along an edge, counter-clockwise       (m, 2)       ``Edges.along``
n       outward normal of an edge, (t2, -t1)               (m, 2)       in ``mean_direction``
h, s    first corner of an edge, from c along n and t      (m, ...)     in ``Edges._integrals``
A       area of a contact                                  (n,)         ``Edges.area``
======  =================================================  ===========  ===========================
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import ROUNDING, FloatArray, IntArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.polygons import distance_integral

_FAR = 1000.0
"""Centres of rotation farther off than this many sizes of the contact count as translations, with
the rotation's share bounded from above, to _FAR^-3 = 1e-9 of the slip."""

_GRID, _ROUNDS, _REACH, _MARGIN = 25, 5, 3.0, 1e-6
"""Centres of rotation that are tried for a polygon: a grid of 25 x 25 over three times its size to
either side, then four finer ones around the worst. More of them change arms by less than the
margin, a share by which arms are made smaller."""


@dataclass(frozen=True, eq=False)
class Edges:
    """The m edges of the convex pieces of n contacts, in the contacts' axes t1, t2.

    Attributes
    ----------
    contact : (m,) array of int
        Contact of each edge.
    start, along : (m, 2) arrays
        First corner of each edge, and unit vector along it; corners come counter-clockwise.
    length : (m,) array
        Lengths of the edges.
    area : (n,) array
        Areas of the contacts.
    size : (n,) array
        Largest distance of a contact's corner from its origin.
    spread : (n, 2, 2) array
        Mean of the outer products r r' over each contact.
    """

    contact: IntArray
    start: FloatArray
    along: FloatArray
    length: FloatArray
    area: FloatArray
    size: FloatArray
    spread: FloatArray

    @classmethod
    def of(cls, contacts: Contacts) -> Edges:
        """Returns the edges of contacts."""
        polygons = [(j, piece) for j in range(len(contacts)) for piece in contacts.pieces_of(j)]
        return cls.of_polygons(polygons, np.asarray(contacts.area))

    @classmethod
    def of_polygons(cls, polygons: list[tuple[int, FloatArray]], area: FloatArray) -> Edges:
        """Returns the edges of polygons (corners, 2), each with the number of its contact."""
        start = np.concatenate([polygon for _, polygon in polygons])
        end = np.concatenate([np.roll(polygon, -1, axis=0) for _, polygon in polygons])
        contact = np.repeat([j for j, _ in polygons], [len(polygon) for _, polygon in polygons])
        length = np.linalg.norm(end - start, axis=1)
        kept = length > 0.0
        start, length, contact = start[kept], length[kept], contact[kept]
        along = (end[kept] - start) / length[:, None]
        size = np.zeros(len(area))
        np.maximum.at(size, contact, np.linalg.norm(start, axis=1))
        spread = np.zeros((len(area), 2, 2))
        np.add.at(spread, contact, _second_moments(start, end[kept]))
        return cls(contact, start, along, length, area, size, spread / area[:, None, None])

    def _means(self, values: FloatArray) -> FloatArray:
        """Returns sums of ``values`` (m, ...) over each contact's edges, over its area (n, ...)."""
        result = np.zeros((len(self.area), *values.shape[1:]))
        np.add.at(result, self.contact, values)
        return result / self.area.reshape(-1, *[1] * (values.ndim - 1))

    def _integrals(self, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns for each edge (m, ...), with ``centre`` (n, ..., 2) that of its contact, the
        signed distance h of the edge's line, and the integral of abs(r - c) ds along the edge."""
        trials = [1] * (centre.ndim - 2)  # room for several centres per contact
        x, y = np.moveaxis(self.start.reshape(-1, *trials, 2) - centre[self.contact], -1, 0)
        t1, t2, length = (v.reshape(-1, *trials) for v in (*self.along.T, self.length))
        h, s = x * t2 - y * t1, x * t1 + y * t2
        return h, distance_integral(h, s + length) - distance_integral(h, s)

    def mean_distance(self, centre: FloatArray) -> FloatArray:
        """Returns the mean of abs(r - c) (n, ...) for ``centre`` (n, ..., 2)."""
        h, integral = self._integrals(centre)
        return self._means(h * integral) / 3.0

    def mean_direction(self, centre: FloatArray) -> FloatArray:
        """Returns the mean of (r - c)/abs(r - c) (n, ..., 2) for ``centre`` (n, ..., 2)."""
        _, integral = self._integrals(centre)
        t1, t2 = (t.reshape(-1, *[1] * (integral.ndim - 1)) for t in self.along.T)
        return np.stack([self._means(t2 * integral), self._means(-t1 * integral)], axis=-1)

    def mean_slip(self, slip: FloatArray, twist: FloatArray) -> FloatArray:
        """Returns the mean size (n,) of the slip of each contact's points, for ``slip`` (n, 2) at
        its centroid and ``twist`` (n,). It is exact, except that where next to nothing rotates it
        is up to :data:`_FAR` to the power of -3 of itself too large. It is never too small but for
        rounding."""
        speed = np.linalg.norm(slip, axis=1)
        turning = np.abs(twist) * self.size  # what rotation alone adds at most, at any point
        # A rotation about the point that does not slip, unless that point is too far off.
        is_far = speed >= _FAR * turning
        safe = np.where(is_far, 1.0, twist)
        centre = np.stack([-slip[:, 1] / safe, slip[:, 0] / safe], axis=1)
        centre = np.where(is_far[:, None], 0.0, centre)
        rotating = np.abs(twist) * self.mean_distance(centre)
        # Far off: hypot(a, b) <= a + b^2 / (2 a) at every point, with a its slip along the slip of
        # the centroid, and b = twist (r . ahead) the one across. The contact's origin is its
        # centroid, so the mean of a is `speed`, and a >= `least`. That is too much by the next term
        # of the series, about turning^3 / speed^2: at most _FAR^-3 of the speed.
        least = np.where(is_far & (speed > 0.0), speed - turning, 1.0)
        ahead = slip / np.where(speed > 0.0, speed, 1.0)[:, None]
        mean_b_squared = twist**2 * np.einsum("ni,nik,nk->n", ahead, self.spread, ahead)
        translating = speed + mean_b_squared / (2.0 * least)
        # The mean size is never below the size of the mean, whatever the rounding.
        return np.where(is_far, translating, np.maximum(rotating, speed))


def _second_moments(start: FloatArray, end: FloatArray) -> FloatArray:
    """Returns the integrals (m, 2, 2) of r r' over the triangles between edges and the origin.

    With corners a and b of the edge they are (a x b) / 24 times a a' + b b' + (a + b)(a + b)'.
    """
    doubled = start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]
    corners = (start, end, start + end)
    squares = sum((p[:, :, None] * p[:, None, :] for p in corners), np.zeros((len(start), 2, 2)))
    return np.asarray(doubled[:, None, None] * squares / 24.0)


def limit_states(edges: Edges, centre: ArrayLike) -> FloatArray:
    """Returns limit forces V1, V2, MT (n, ..., 3) over mu N for slip about ``centre`` (n, ..., 2).

    MT is about each contact's origin and has the unit of length; the opposite rotation gives the
    opposite forces.

    >>> square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    >>> edges = Edges.of_polygons([(0, square)], np.array([1.0]))
    >>> limit_states(edges, [[0.0, 0.0]])[0, 2].round(6).tolist()
    0.382598
    """
    c = np.asarray(centre, dtype=float)
    direction = edges.mean_direction(c)
    v1, v2 = -direction[..., 1], direction[..., 0]
    moment = edges.mean_distance(c) + c[..., 0] * v2 - c[..., 1] * v1
    return np.stack([v1, v2, moment], axis=-1)


def parabola_arm(contacts: Contacts) -> FloatArray:
    """Returns the largest arm c (n,), a length, for which the parabola
    abs(MT) / c <= mu N - abs(V)^2 / (mu N) is inside the exact set.

    For rectangles it is c_T. For other polygons it is searched over centres of rotation, and c_T
    is the most that is taken, since a smaller arm is always inside too.
    """
    arm = np.array(contacts.torsion_arm)
    others = np.flatnonzero(~(contacts.is_rectangle | contacts.is_point))
    if len(others):
        some = contacts.take(others)
        arm[others] = np.minimum(arm[others], (1.0 - _MARGIN) * _largest_arm(Edges.of(some)))
    return arm


def _largest_arm(edges: Edges) -> FloatArray:
    """Returns the largest arm (n,) of a parabola that is inside the exact set.

    It is inside if every limit state is outside the parabola or on it, as shares of mu N:
    abs(MT) >= c (1 - abs(V)^2) for all centres of rotation. So the largest arm is the least of all
    abs(MT) / (1 - abs(V)^2): on a grid of centres, which becomes finer around the worst of them.
    """
    every = np.arange(len(edges.area))
    middle, width = np.zeros((len(every), 2)), _REACH * edges.size
    least_arm = np.full(len(every), np.inf)
    ticks = np.linspace(-1.0, 1.0, _GRID)
    cells = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    for _ in range(_ROUNDS):
        centre = middle[:, None] + width[:, None, None] * cells
        v1, v2, moment = np.moveaxis(limit_states(edges, centre), -1, 0)
        left = 1.0 - v1**2 - v2**2
        rotates = left > ROUNDING
        arm = np.where(rotates, np.abs(moment) / np.where(rotates, left, 1.0), np.inf)
        worst = arm.argmin(axis=1)
        least_arm = np.minimum(least_arm, arm[every, worst])
        # The next grid: one and a half cells of this one to either side of the worst centre.
        middle = centre[every, worst]
        width = width * (3.0 / (_GRID - 1))
    return least_arm
