"""Rectangles inside contacts of other shapes: the safe steps know c_T of rectangles only.

Pressure in a rectangle R inside the convex contact P is pressure in P. If c_P(e), the mean
distance over P ∩ (2e - P), is nowhere in R below share x c_R(e), then forces that satisfy Eq. 30 on
R with its arm times that share satisfy it on P:

- signed moments: torque about the pressure centre, abs(V) and N do not depend on the frame, so R
  may have any place and direction;
- independent signs: abs(V1 e2) + abs(V2 e1) + abs(MT) does depend on it, so R keeps the contact's
  frame and is centred on its origin.

A larger region may have a smaller mean distance, so the share is searched for over a fine grid
with a margin. That is no proof: the checker, which clips polygons, has the last word.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import effective_region, mean_distance, torsion_arm

_ANGLES = 24
"""Directions tried besides those of the contact's own edges."""

_STATIONS = 48
"""Positions of a rectangle's ends that are tried along the contact, besides its corners."""

_GRID = 21
"""Pressure centres per axis at which arms are compared, denser towards the edges."""

_MARGIN = 0.99
"""Share of the smallest ratio of arms found that is used: what may lie between grid points."""


@dataclass(frozen=True)
class Rectangle:
    """A rectangle in a contact's plane: ``centre``, direction of its first side, half sides.

    ``arm_share`` is how much of its c_T is surely there in the contact around it.
    """

    centre: tuple[float, float]
    angle: float
    half: tuple[float, float]
    arm_share: float = 1.0

    @property
    def turn(self) -> FloatArray:
        """Rotation (2, 2) from the rectangle's frame to the contact's."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, -s], [s, c]])


@dataclass(frozen=True, eq=False)
class Rectangles:
    """Contacts that are all rectangles, and the way back to the true ones.

    Attributes
    ----------
    contacts : Contacts
        Rectangles keep their frame; other contacts are replaced by a rectangle with its own.
    arm_share : (n,)
        Factor on c_T of each rectangle, at most 1; 1 for contacts that are rectangles.
    turn : (n, 2, 2), offset : (n, 2)
        Rotation from the rectangle's frame to the contact's, and the rectangle's centre there.
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
        """Those ``inscribed`` in corners (k, 2), with their arms, of which contacts allow at most
        ``largest`` (n,), None for any; rectangles stay as they are."""
        n = len(contacts)
        turn, offset, share = np.tile(np.eye(2), (n, 1, 1)), np.zeros((n, 2)), np.ones(n)
        if contacts.is_rectangle.all():
            return cls(contacts, share, turn, offset)
        corners = [contacts.corners_of(j) for j in range(n)]
        sides, area = contacts.sides.copy(), contacts.area.copy()
        known: dict[bytes, Rectangle] = {}
        largest = np.full(n, np.inf) if largest is None else largest
        for j in np.flatnonzero(~contacts.is_rectangle).tolist():
            key = (
                np.round(corners[j] / np.sqrt(area[j]), 9).tobytes()
                + np.array([area[j], largest[j]]).tobytes()
            )
            if key not in known:
                known[key] = _with_arm(inscribed(corners[j]), corners[j], float(largest[j]))
            found = known[key]
            turn[j], offset[j], share[j] = found.turn, found.centre, found.arm_share
            sides[j] = 2.0 * np.array(found.half)
            area[j] = sides[j].prod()
            corners[j] = _SIGNS * sides[j] / 2.0
        return cls(_replaced(contacts, corners, sides, area, turn, offset), share, turn, offset)

    def take(self, rows: IntArray) -> Rectangles:
        """Some of the contacts (k,)."""
        return Rectangles(
            self.contacts.take(rows), self.arm_share[rows], self.turn[rows], self.offset[rows]
        )

    def scaled(self, length: float) -> Rectangles:
        """The same with all lengths multiplied."""
        return replace(self, contacts=self.contacts.scaled(length), offset=self.offset * length)

    def outward(self, forces: FloatArray) -> FloatArray:
        """Forces (n, 6) on the rectangles in the frames of the true contacts."""
        result = _turned(forces, self.turn)
        return _shifted(result, self.offset)

    def inward(self, forces: FloatArray) -> FloatArray:
        """The inverse of :meth:`outward`."""
        result = _shifted(forces, -self.offset)
        return _turned(result, np.swapaxes(self.turn, 1, 2))


_SIGNS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _turned(forces: FloatArray, turn: FloatArray) -> FloatArray:
    result = forces.copy()
    for pair in (("V1", "V2"), ("M1", "M2")):
        columns = [COLUMN[name] for name in pair]
        result[:, columns] = np.einsum("nij,nj->ni", turn, forces[:, columns])
    return result


def _shifted(forces: FloatArray, offset: FloatArray) -> FloatArray:
    x, y = offset.T
    result = forces.copy()
    result[:, COLUMN["M1"]] += y * forces[:, COLUMN["N"]]
    result[:, COLUMN["M2"]] -= x * forces[:, COLUMN["N"]]
    result[:, COLUMN["MT"]] += x * forces[:, COLUMN["V2"]] - y * forces[:, COLUMN["V1"]]
    return result


def _replaced(
    contacts: Contacts,
    corners: list[FloatArray],
    sides: FloatArray,
    area: FloatArray,
    turn: FloatArray,
    offset: FloatArray,
) -> Contacts:
    axes = contacts.axes.copy()
    axes[:, :2] = np.einsum("nij,nik->njk", turn, contacts.axes[:, :2])
    return replace(
        contacts,
        origin=contacts.origin + np.einsum("ni,nik->nk", offset, contacts.axes[:, :2]),
        axes=axes,
        corner_start=np.concatenate([[0], np.cumsum([len(c) for c in corners])]),
        corner_xy=np.concatenate(corners),
        sides=sides,
        area=area,
        pieces={},
    )


def largest_anywhere(corners: FloatArray) -> Rectangle:
    """The largest rectangle in a polygon (k, 2) over directions, those of all edges among them."""
    along = np.roll(corners, -1, axis=0) - corners
    own = np.arctan2(along[:, 1], along[:, 0])
    angles = np.concatenate([own, np.linspace(0.0, np.pi, _ANGLES, endpoint=False)])
    return max(
        (_largest_at(corners, float(a)) for a in angles), key=lambda r: r.half[0] * r.half[1]
    )


def _largest_at(corners: FloatArray, angle: float) -> Rectangle:
    """Largest rectangle with its first side along ``angle``.

    Between x0 and x1 a convex polygon has the height that its ends leave: the lower one of its
    upper, the upper one of its lower chain.
    """
    turn = Rectangle((0.0, 0.0), angle, (0.0, 0.0)).turn
    points = corners @ turn
    x = np.union1d(np.linspace(points[:, 0].min(), points[:, 0].max(), _STATIONS), points[:, 0])
    low, high = _chains(points, x)
    height = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
    size = (x[None, :] - x[:, None]) * np.maximum(height, 0.0)
    i, k = np.unravel_index(int(size.argmax()), size.shape)
    middle = np.array(
        [x[i] + x[k], min(high[i], high[k]) + max(low[i], low[k])], dtype=float
    ) / 2.0  # fmt: skip
    centre = turn @ middle
    half = (float(x[k] - x[i]) / 2.0, float(height[i, k]) / 2.0)
    return Rectangle((float(centre[0]), float(centre[1])), angle, half)


def largest_centred(corners: FloatArray) -> Rectangle:
    """Largest rectangle in the contact's own frame, about its origin."""
    reach = min(float(corners[:, 0].max()), -float(corners[:, 0].min()))
    x = np.linspace(0.0, reach, 4 * _STATIONS)
    ends = [_chains(corners, sign * x) for sign in (1.0, -1.0)]
    half = np.minimum.reduce([np.minimum(-low, high) for low, high in ends])
    best = int((x * half).argmax())
    return Rectangle((0.0, 0.0), 0.0, (float(x[best]), float(half[best])))


def _chains(points: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
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


def _with_arm(found: Rectangle, corners: FloatArray, largest: float) -> Rectangle:
    half = np.array(found.half)
    if half.min() <= 0.0:
        return replace(found, arm_share=0.0)
    least = min(_arm_ratios(corners, found, half, largest), default=1.0)
    return replace(found, arm_share=min(1.0, _MARGIN * least))


def _arm_ratios(
    corners: FloatArray, rectangle: Rectangle, half: FloatArray, largest: float
) -> Iterator[float]:
    fractions = np.sin(np.linspace(-0.4999 * np.pi, 0.4999 * np.pi, _GRID))
    for p in fractions:
        for q in fractions:
            local = half * (p, q)
            centre = np.array(rectangle.centre) + rectangle.turn @ local
            arm = float(torsion_arm(*(2.0 * (half - np.abs(local)))))
            own = mean_distance(effective_region(corners, centre), centre)
            yield min(own, largest) / arm
