"""Rectangles inside contacts of other shapes: the safe steps know the arm c_T of rectangles only.

A contact's arm is at least a share of that of a rectangle inside it. The share is searched for over
a fine grid of pressure centres, with a margin. That is no proof: the checker, which clips polygons,
decides in the end whether forces are admissible.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.extensions.interaction.states.settings import SUPPORT
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import effective_regions, torsion_arm
from cvxlimit.readings.pressure import areas_and_arms


@dataclass(frozen=True)
class Rectangle:
    """A rectangle in a contact's plane: its ``centre`` (length), the ``angle`` of its first side
    from t1 (radians, counter-clockwise), and its ``half`` sides (length)."""

    centre: tuple[float, float]
    angle: float
    half: tuple[float, float]

    @property
    def turn(self) -> FloatArray:
        """The rotation (2, 2) from the rectangle's frame to the contact's."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, -s], [s, c]])

    def arm_share(self, corners: FloatArray, largest: float) -> float:
        """Returns the share, at most 1, of the rectangle's arm that the contact with ``corners``
        (k, 2) has at every pressure centre; ``largest`` is the largest arm that counts (length).
        """
        half = np.array(self.half)
        if half.min() <= 0.0:
            return 0.0
        # Pressure centres are denser towards the sides, where arms of rectangles vanish.
        fractions = np.sin(np.linspace(-0.4999 * np.pi, 0.4999 * np.pi, SUPPORT.grid))
        local = half * np.stack(np.meshgrid(fractions, fractions), axis=2).reshape(-1, 2)
        centres = np.array(self.centre) + local @ self.turn.T
        _, own = areas_and_arms(effective_regions(corners, centres), centres)
        arm = torsion_arm(*(2.0 * (half - np.abs(local))).T)
        return min(1.0, SUPPORT.margin * float((np.minimum(own, largest) / arm).min()))


@dataclass(frozen=True, eq=False)
class Rectangles:
    """Contacts that are all rectangles, in place of the n true ones.

    Forces (n, 6) are in the order V1 V2 N M1 M2 MT of ``contacts.COMPONENTS``.

    Attributes
    ----------
    contacts : Contacts
        Rectangles as they are, and a rectangle within each contact of another shape, with its own
        origin and axes.
    arm_share : (n,) array
        Factor on the rectangle's arm c_T.
    turn : (n, 2, 2) array
        Rotation from the rectangle's frame to the contact's.
    offset : (n, 2) array
        The rectangle's centre in the contact's frame (length).
    """

    contacts: Contacts
    arm_share: FloatArray
    turn: FloatArray
    offset: FloatArray

    @classmethod
    def of(
        cls,
        contacts: Contacts,
        inscribed: Callable[[FloatArray], Rectangle],
        largest: FloatArray | None = None,
    ) -> Rectangles:
        """Returns the rectangles of ``contacts``; ``inscribed`` finds one in a polygon (k, 2), and
        ``largest`` (n,) are the largest arms that count.
        """
        n = len(contacts)
        turn, offset, share = np.tile(np.eye(2), (n, 1, 1)), np.zeros((n, 2)), np.ones(n)
        if contacts.is_rectangle.all():
            return cls(contacts, share, turn, offset)
        corners = [contacts.corners_of(j) for j in range(n)]
        sides, area = contacts.sides.copy(), contacts.area.copy()
        # Contacts of the same outline and size share the search.
        shared: dict[bytes, tuple[Rectangle, float]] = {}
        most = np.full(n, np.inf) if largest is None else largest
        for j in np.flatnonzero(~contacts.is_rectangle).tolist():
            outline = np.round(corners[j] / np.sqrt(area[j]), 9).tobytes()
            key = outline + np.array([area[j], most[j]]).tobytes()
            if key not in shared:
                inner = inscribed(corners[j])
                shared[key] = inner, inner.arm_share(corners[j], float(most[j]))
            inner, share[j] = shared[key]
            turn[j], offset[j], sides[j] = inner.turn, inner.centre, 2.0 * np.array(inner.half)
            area[j] = sides[j].prod()
            corners[j] = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * sides[j] / 2.0
        axes = contacts.axes.copy()
        axes[:, :2] = np.einsum("nij,nik->njk", turn, contacts.axes[:, :2])
        replaced = replace(
            contacts,
            origin=contacts.origin + np.einsum("ni,nik->nk", offset, contacts.axes[:, :2]),
            axes=axes,
            corner_start=np.concatenate([[0], np.cumsum([len(c) for c in corners])]),
            corner_xy=np.concatenate(corners),
            sides=sides,
            area=area,
            pieces={},
        )
        return cls(replaced, share, turn, offset)

    def take(self, rows: IntArray) -> Rectangles:
        """Returns the rectangles of some contacts ``rows`` (k,)."""
        return Rectangles(
            self.contacts.take(rows), self.arm_share[rows], self.turn[rows], self.offset[rows]
        )

    def scaled(self, length: float) -> Rectangles:
        """Returns the rectangles with lengths multiplied by ``length``."""
        return replace(self, contacts=self.contacts.scaled(length), offset=self.offset * length)

    def outward(self, forces: FloatArray) -> FloatArray:
        """Returns the true contacts' forces (n, 6) from those of their rectangles."""
        return _shifted(_turned(forces, self.turn), self.offset)

    def inward(self, forces: FloatArray) -> FloatArray:
        """Returns the rectangles' forces (n, 6) from those of the true contacts."""
        return _turned(_shifted(forces, -self.offset), np.swapaxes(self.turn, 1, 2))


def _turned(forces: FloatArray, turn: FloatArray) -> FloatArray:
    """Returns forces (n, 6) with shears and bending moments rotated by ``turn`` (n, 2, 2)."""
    result = forces.copy()
    for pair in (("V1", "V2"), ("M1", "M2")):
        columns = [COLUMN[name] for name in pair]
        result[:, columns] = np.einsum("nij,nj->ni", turn, forces[:, columns])
    return result


def _shifted(forces: FloatArray, offset: FloatArray) -> FloatArray:
    """Returns forces (n, 6) with moments about a point from which their own origin is at ``offset``
    (n, 2).
    """
    x, y = offset.T
    result = forces.copy()
    result[:, COLUMN["M1"]] += y * forces[:, COLUMN["N"]]
    result[:, COLUMN["M2"]] -= x * forces[:, COLUMN["N"]]
    result[:, COLUMN["MT"]] += x * forces[:, COLUMN["V2"]] - y * forces[:, COLUMN["V1"]]
    return result


def largest_anywhere(corners: FloatArray) -> Rectangle:
    """Returns the largest rectangle in a polygon (k, 2), over directions that include all
    edges'."""
    along = np.roll(corners, -1, axis=0) - corners
    own = np.arctan2(along[:, 1], along[:, 0])
    angles = np.concatenate([own, np.linspace(0.0, np.pi, SUPPORT.angles, endpoint=False)])
    each = (_largest_at(corners, float(angle)) for angle in angles)
    return max(each, key=lambda rectangle: rectangle.half[0] * rectangle.half[1])


def _largest_at(corners: FloatArray, angle: float) -> Rectangle:
    """Returns the largest rectangle in a convex polygon (k, 2) with a side at ``angle``."""
    # Between stations x0 and x1 a rectangle reaches from the higher of the lower chain's two ends
    # to the lower of the upper chain's: all pairs of stations are tried.
    turn = Rectangle((0.0, 0.0), angle, (0.0, 0.0)).turn
    points = corners @ turn
    first, last = points[:, 0].min(), points[:, 0].max()
    x = np.union1d(np.linspace(first, last, SUPPORT.stations), points[:, 0])
    low, high = _chains(points, x)
    height = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
    size = (x[None, :] - x[:, None]) * np.maximum(height, 0.0)
    i, k = np.unravel_index(int(size.argmax()), size.shape)
    middle = [x[i] + x[k], min(high[i], high[k]) + max(low[i], low[k])]
    centre = turn @ np.array(middle, dtype=float) / 2.0
    half = (float(x[k] - x[i]) / 2.0, float(height[i, k]) / 2.0)
    return Rectangle((float(centre[0]), float(centre[1])), angle, half)


def largest_centred(corners: FloatArray) -> Rectangle:
    """Returns the largest rectangle about the contact's origin, in the contact's own frame."""
    reach = min(float(corners[:, 0].max()), -float(corners[:, 0].min()))
    x = np.linspace(0.0, reach, 4 * SUPPORT.stations)
    ends = [_chains(corners, sign * x) for sign in (1.0, -1.0)]
    half = np.minimum.reduce([np.minimum(-low, high) for low, high in ends])
    best = int((x * half).argmax())
    return Rectangle((0.0, 0.0), 0.0, (float(x[best]), float(half[best])))


def _chains(points: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns the lower and the upper boundary of a convex polygon (k, 2) at stations ``x``."""
    start = int(np.lexsort((points[:, 1], points[:, 0]))[0])
    loop = np.roll(points, -start, axis=0)
    right = int(np.lexsort((-loop[:, 1], -loop[:, 0]))[0])
    upper = np.concatenate([loop[right:], loop[:1]])[::-1]
    lower = loop[: right + 1]
    if loop[-1, 0] <= loop[0, 0]:  # a vertical left edge: its top belongs to the upper chain
        upper = upper[1:]
    if right > 0 and lower[-2, 0] >= lower[-1, 0]:
        lower = lower[:-1]
    return np.interp(x, *lower.T), np.interp(x, *upper.T)
