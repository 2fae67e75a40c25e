"""Readings of Eq. 30 with tied signs and Eq. 27 beside it: their rows and support functions.

With a *lever* d(e), a point that depends on the pressure centre e, both conditions read

    Eq. 30:  abs(MT - d1 V2 + d2 V1) <= c (mu N - abs(V)),        Eq. 27:  abs(MT) <= c mu N.

d = e is static torsion about the pressure centre; d = (-s2 abs(e1), s1 abs(e2)) with s1, s2 = +-1
is the paper's reading for one choice of the contact's axes. In each quadrant of e the latter is the
former with V1 or V2 mirrored, so what is known of signed moments holds quadrant by quadrant:

**Safe steps.** Where the sign of e_i is kept, abs(X_i) is linear and the product of it with a shear
is majorised as it stands (:mod:`majorants`); where the present centre is on an axis, independent
signs take that axis over, abs(X_i V_j) <= m_i s_j, so that later steps may cross it. Both are
inside the true set, and exact at the present point. With independent signs in *all* places a set
is inside too: a bound from below with independent signs is one here.

**Support.** For unit compression and rates w, with a = (w_V1, w_V2), d = w_MT, the power of what is
admissible at a fixed e is b . e + h(e), where by duality (d shared out between the conditions)

    h(e) = min over d' of  mu max(norm(a1 - d' d2, a2 + d' d1), c abs(d')) + mu c abs(d - d').

For fixed d' this is convex in e wherever the lever is linear and c convex, that is in each quadrant
of a rectangle: largest at the corners of a box there. So the largest power over a box within a
quadrant is at most min over d' of the maximum over its four corners, a convex function of one
variable; boxes whose bound exceeds the best power found are halved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.interaction.states.majorants import (
    Forces,
    Plane,
    Point,
    Product,
    Row,
    signed_rows,
)
from cvxlimit.methods.interaction.states.support import Support, rectangle_arm

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Lever = Callable[[FloatArray], FloatArray]
"""From pressure centres (..., 2) to the points about which torsion is taken, (..., 2)."""

_CENTRAL = 1e-4
"""Pressure centres within this share of a side from an axis count as on it: a step's rows then let
the centre cross, and cut off at most this share of the torque."""

_PRECISION = 1e-8
"""Share of the largest power in play to which maxima are enclosed: 40 halvings on 1,200 random
rates of contacts with sides 1:1 to 8:1, in 0.4 ms each. The upper end is what counts."""

_GOLDEN = 0.5 * (5.0**0.5 - 1.0)

_SECTIONS = 44
"""Golden sections for the share d': 6e-10 of the range is left. Any share gives a valid bound."""


def limit_rows(f: Forces, plane: Plane, sides: FloatArray, mu: FloatArray) -> list[Row]:
    """Eq. 27, ±MT - mu (ca P1 + cb P2) <= 0: linear, with m_i >= abs(X_i) in the sides P_i."""
    most = sum(
        cp.multiply(plane.slope[:, i] * mu, cp.multiply(sides[:, i], f.N) - 2.0 * f.m[i])
        for i in (0, 1)
    )
    return [Row(sign * f.MT - most, ()) for sign in (1.0, -1.0)]


def limited_signed_rows(
    f: Forces, point: Point, plane: Plane, sides: FloatArray, mu: FloatArray
) -> list[Row]:
    """Signed moments and Eq. 27."""
    return [*signed_rows(f, point, plane, sides, mu), *limit_rows(f, plane, sides, mu)]


@dataclass(frozen=True)
class TiedRows:
    """Rows of the paper's reading for one choice of axes: see the module.

    ``signs`` are s1 and s2, of V1 and V2. Axis i (0: e1, with V2; 1: e2, with V1) keeps the sign of
    the present centre, or is taken over by independent signs where that is zero.
    """

    signs: tuple[int, int]

    def __call__(
        self, f: Forces, point: Point, plane: Plane, sides: FloatArray, mu: FloatArray
    ) -> list[Row]:
        """Two rows for Eq. 30, two for Eq. 27, and two that keep signs."""
        free = np.abs(point.centre) <= _CENTRAL * sides
        sign = np.where(free, 0.0, np.sign(point.centre))
        size = np.linalg.norm(point.shear, axis=1)
        reach = [cp.multiply(sign[:, i], f.X[i]) for i in (0, 1)]  # abs(X), or 0 where it is free
        resistance = sum(
            cp.multiply(plane.slope[:, i] * mu, cp.multiply(sides[:, i], f.N) - 2.0 * f.m[i])
            for i in (0, 1)
        )
        base = cp.multiply((plane.slope * sides).sum(axis=1), f.u) - resistance
        rows = limit_rows(f, plane, sides, mu)
        for turn in (1.0, -1.0):
            products = []
            for i, j in ((0, 1), (1, 0)):
                known = turn * self.signs[j] * (1.0 - free[:, i])
                slope = 2.0 * plane.slope[:, i]
                shear = cp.multiply(known, f.V[j]) + cp.multiply(1.0 * free[:, i], f.s[j])
                there = known * point.shear[:, j] + free[:, i] * np.abs(point.shear[:, j])
                products.append(
                    Product(
                        reach[i] + cp.multiply(1.0 * free[:, i], f.m[i]),
                        shear - cp.multiply(slope, f.u),
                        plane.k[:, i],
                        np.abs(point.centre[:, i]),
                        there - slope * size,
                    )
                )
            rows.append(Row.of(turn * f.MT + base, products, f.N))
        return [*rows, *(Row(-each, ()) for each in reach)]


def limited_support(
    lever: Lever,
    w: FloatArray,
    half: FloatArray,
    friction: FloatArray,
    boxes: FloatArray,
    halvings: int,
) -> Support:
    """Largest power on rectangles, for a ``lever`` that is linear in each quadrant: upper ends of
    enclosures (n,), and the best pressure centres found (n, 2); see :mod:`support`."""
    search = _BoxSearch(lever, w, half, friction, boxes)
    search.refine(2 * halvings)  # along two axes
    return search.upper, search.where / half


def polygon_support(lever: Lever, w: FloatArray, contacts: Contacts, rows: IntArray) -> FloatArray:
    """An upper bound on the largest power, but for w_N, of contacts ``rows`` of any convex shape.

    ``w`` (k, 6) are the rates of these contacts, in their order.

    c over an effective region, which is symmetric about its centre, is at most two thirds of its
    largest half chord, hence a third of the contact's diameter; with that for c the bound of the
    module holds for any polygon, at the corners of its parts in the quadrants.
    """
    result = np.empty(len(rows))
    for place, j in enumerate(rows.tolist()):
        corners = contacts.corners_of(j)
        diameter = float(np.linalg.norm(corners[:, None] - corners, axis=2).max())
        e = _with_axis_points(corners)[:, None]
        case = _Case(
            lever, w[[place]], contacts.friction[[j]], e, np.full((len(e), 1), diameter / 3.0)
        )
        result[place] = case.shared()[0]
    return result


def _with_axis_points(corners: FloatArray) -> FloatArray:
    """A polygon's corners (k, 2), where its edges cross the axes, and the origin."""
    points = [corners, np.zeros((1, 2))]
    following = np.roll(corners, -1, axis=0)
    for axis in (0, 1):
        a, b = corners[:, axis], following[:, axis]
        cut = a * b < 0.0
        share = (a[cut] / (a[cut] - b[cut]))[:, None]
        points.append(corners[cut] + share * (following[cut] - corners[cut]))
    return np.concatenate(points)


class _Case:
    """Power at given pressure centres of given contacts, as a function of the share d'.

    Shapes: rates (k, 6), centres e (p, k, 2), arms (p, k) for p places of each of k contacts.
    """

    def __init__(
        self, lever: Lever, w: FloatArray, friction: FloatArray, e: FloatArray, arm: FloatArray
    ) -> None:
        self.friction, self.arm = friction, arm
        self.v1, self.v2, self.twist = (w[:, COLUMN[c]] for c in ("V1", "V2", "MT"))
        about = lever(e)
        self.d1, self.d2 = about[..., 0], about[..., 1]
        self.moment = w[:, COLUMN["M1"]] * e[..., 1] - w[:, COLUMN["M2"]] * e[..., 0]
        size = self.d1**2 + self.d2**2
        least = (self.v1 * self.d2 - self.v2 * self.d1) / np.where(size > 0.0, size, 1.0)
        # Beyond 0 and the twist itself a share can pay only where the lever exceeds the arm.
        least = np.where(size > self.arm**2, least, 0.0)
        self.ends = (
            np.minimum(np.minimum(least, 0.0), self.twist),
            np.maximum(np.maximum(least, 0.0), self.twist),
        )

    def power(self, share: FloatArray) -> FloatArray:
        """b . e + the dual function (p, k) at shares (p, k) or (k,)."""
        slip = np.hypot(self.v1 - share * self.d2, self.v2 + share * self.d1)
        first = np.maximum(slip, self.arm * np.abs(share))
        return self.moment + self.friction * (first + self.arm * np.abs(self.twist - share))

    def each(self) -> FloatArray:
        """Largest power (p, k) at every place."""
        return _least(self.power, *self.ends)

    def shared(self) -> FloatArray:
        """Upper bound (k,) over all that lies between the places, in convex position."""
        ends = self.ends[0].min(axis=0), self.ends[1].max(axis=0)
        return _least(lambda share: self.power(share).max(axis=0), *ends)


def _least(f: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
    """Least value found of convex functions between ``low`` and ``high``, by golden sections."""
    best = np.minimum(f(low), f(high))
    for _ in range(_SECTIONS):
        span = _GOLDEN * (high - low)
        left, right = high - span, low + span
        at_left, at_right = f(left), f(right)
        best = np.minimum(best, np.minimum(at_left, at_right))
        is_left = at_left <= at_right
        low, high = np.where(is_left, low, left), np.where(is_left, right, high)
    return best


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Boxes of pressure centres within a quadrant: contact (k,), ends low and high (k, 2)."""

    contact: IntArray
    low: FloatArray
    high: FloatArray

    def __getitem__(self, rows: NDArray[np.bool_]) -> _Boxes:
        return _Boxes(self.contact[rows], self.low[rows], self.high[rows])

    @property
    def corners(self) -> FloatArray:
        """(4, k, 2)."""
        x, y = (np.stack([self.low[:, i], self.high[:, i]]) for i in (0, 1))
        return np.stack([np.stack([x[i], y[j]], axis=1) for i in (0, 1) for j in (0, 1)])

    def halved(self, size: FloatArray) -> _Boxes:
        """Both halves of each, cut across the side that is longer in units of ``size`` (k, 2)."""
        axis = ((self.high - self.low) / size).argmax(axis=1)
        rows = np.arange(len(axis))
        middle = 0.5 * (self.low + self.high)[rows, axis]
        low, high = self.low.copy(), self.high.copy()
        high[rows, axis] = low[rows, axis] = middle
        return _Boxes(
            np.tile(self.contact, 2),
            np.concatenate([self.low, low]),
            np.concatenate([high, self.high]),
        )


class _BoxSearch:
    """Largest power over boxes, enclosed from both sides."""

    def __init__(
        self,
        lever: Lever,
        w: FloatArray,
        half: FloatArray,
        friction: FloatArray,
        boxes: FloatArray,
    ) -> None:
        self.lever, self.w, self.half, self.friction = lever, w, half, friction
        slip = np.hypot(w[:, COLUMN["V1"]], w[:, COLUMN["V2"]])
        moments = np.abs(w[:, [COLUMN["M2"], COLUMN["M1"]]] * half).sum(axis=1)
        twist = np.abs(w[:, COLUMN["MT"]]) * np.hypot(*half.T)
        self.tolerance = _PRECISION * (moments + friction * (slip + twist))
        self.best = np.full(len(w), -np.inf)
        self.where = np.zeros_like(half)
        self.dropped = np.full(len(w), -np.inf)
        self.left = self._quadrants(boxes * half[..., None])
        self.bound = self._bounded(self.left)

    @property
    def upper(self) -> FloatArray:
        """An upper bound (n,) on the power, whatever boxes are left."""
        result = np.maximum(self.best, self.dropped)
        np.maximum.at(result, self.left.contact, self.bound)
        return result

    def refine(self, rounds: int) -> None:
        """Halve the boxes that may hold more than the best power found."""
        for _ in range(rounds):
            j = self.left.contact
            kept = self.bound > self.best[j] + self.tolerance[j]
            np.maximum.at(self.dropped, j[~kept], self.bound[~kept])
            left = self.left[kept]
            self.left = left.halved(self.half[left.contact])
            self.bound = np.minimum(self._bounded(self.left), np.tile(self.bound[kept], 2))
            if not kept.any():
                return

    def _quadrants(self, boxes: FloatArray) -> _Boxes:
        """The boxes (n, 2, 2), cut at zero where they hold it."""
        middle = np.clip(0.0, boxes[..., 0], boxes[..., 1])
        low, high = boxes[..., 0], boxes[..., 1]
        every = np.arange(len(boxes))
        parts = []
        for first in ((low, middle), (middle, high)):
            for second in ((low, middle), (middle, high)):
                ends = [np.stack([first[k][:, 0], second[k][:, 1]], axis=1) for k in (0, 1)]
                parts.append(_Boxes(every, *ends))
        return _Boxes(
            np.tile(every, 4),
            np.concatenate([part.low for part in parts]),
            np.concatenate([part.high for part in parts]),
        )

    def _bounded(self, boxes: _Boxes) -> FloatArray:
        """Upper bounds (k,) of boxes; the best power at their corners is kept."""
        j, e = boxes.contact, boxes.corners
        arm = np.stack([rectangle_arm(self.half[j], np.abs(corner)) for corner in e])
        case = _Case(self.lever, self.w[j], self.friction[j], e, arm)
        for corner, power in zip(e, case.each(), strict=True):
            np.maximum.at(self.best, j, power)
            top = power >= self.best[j]
            self.where[j[top]] = corner[top]
        return case.shared()
