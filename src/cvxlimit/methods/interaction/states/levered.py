"""Support functions of readings with tied signs, which take torsion about a lever.

With a *lever* d(e), a point that depends on the pressure centre e,

    Eq. 30:  abs(MT - d1 V2 + d2 V1) <= c (mu N - abs(V)),        Eq. 27:  abs(MT) <= c mu N,

the latter in readings that have it. d = e is static torsion about the pressure centre;
d = (-s2 abs(e1), s1 abs(e2)) with s1, s2 = +-1 is the paper's reading for one choice of the
contact's axes. A lever is linear in each quadrant of e, and d_i depends on e_i alone.

For unit compression and rates w, with a = (w_V1, w_V2), d = w_MT, the power of what is admissible
at a fixed e is b . e + h(e). With Eq. 30 alone h(e) = mu max(norm(a1 - d d2, a2 + d d1), c abs(d)),
and by duality (d shared out between the conditions) with Eq. 27 beside it

    h(e) = min over d' of  mu max(norm(a1 - d' d2, a2 + d' d1), c abs(d')) + mu c abs(d - d').

For fixed d' this is convex in e and c, and grows with c: over a box within a quadrant of a
rectangle, where c is convex, it is largest at the corners, and over a cell of another polygon, with
arms t_k that bound c (:mod:`cells`), at the cell's. So the largest power is at most min over d' of
the maximum over the corners, a convex function of one variable; boxes of rectangles whose bound
exceeds the best power found are halved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.interaction.states.cells import Cells
from cvxlimit.methods.interaction.states.copies import Lever
from cvxlimit.methods.interaction.states.support import (
    Support,
    axis_levels,
    corner_power,
    rectangle_arm,
)

_PRECISION = 1e-8
"""Share of the largest power in play to which maxima are enclosed: 40 halvings on 1,200 random
rates of contacts with sides 1:1 to 8:1, in 0.4 ms each. The upper end is what counts."""

_GOLDEN = 0.5 * (5.0**0.5 - 1.0)

_SECTIONS = 44
"""Golden sections for the share d': 6e-10 of the range is left. Any share gives a valid bound."""


def levered_support(
    lever: Lever, w: FloatArray, half: FloatArray, friction: FloatArray, boxes: FloatArray
) -> Support:
    """Largest power on rectangles with Eq. 30 alone: ends of boxes, and zero where it lies between
    them. No search, and no centres."""
    best = np.full(len(w), -np.inf)
    levels = [place for place, _ in axis_levels(boxes)]
    for first in levels:
        for second in levels:
            e = half * np.stack([first[:, 0], second[:, 1]], axis=1)
            torsion = rectangle_arm(half, np.abs(e)) * np.abs(w[:, COLUMN["MT"]])
            best = np.maximum(best, corner_power(w, e, friction, torsion, lever(e)))
    return best, np.full((len(w), 2), np.nan)


def limited_support(
    lever: Lever,
    w: FloatArray,
    half: FloatArray,
    friction: FloatArray,
    boxes: FloatArray,
    halvings: int,
) -> Support:
    """Largest power on rectangles with Eq. 27 beside Eq. 30: upper ends of enclosures (n,), and the
    best pressure centres found (n, 2)."""
    search = _BoxSearch(lever, w, half, friction, boxes)
    search.refine(2 * halvings)  # along two axes
    return search.upper, search.where / half


def cell_support(
    lever: Lever, is_limited: bool, w: FloatArray, friction: FloatArray, cells: Cells
) -> FloatArray:
    """Upper bounds (g,) on the power pressed in each cell; ``w`` (k, 6) and ``friction`` (k,) are
    those of the cells' corners, in their order."""
    if not is_limited:
        torsion = cells.arm * np.abs(w[:, COLUMN["MT"]])
        power = corner_power(w, cells.place, friction, torsion, lever(cells.place))
        return np.maximum.reduceat(power, cells.start)
    size = np.diff([*cells.start, len(cells.cell)])
    corner = np.arange(int(size.max()))[:, None]
    rows = cells.start + np.minimum(corner, size - 1)  # (corners, cells), the last one repeated
    at = cells.start
    return _Case(lever, w[at], friction[at], cells.place[rows], cells.arm[rows]).shared()


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
        slip = np.hypot(self.v1 - share * self.d2, self.v2 + share * self.d1)
        first = np.maximum(slip, self.arm * np.abs(share))
        return self.moment + self.friction * (first + self.arm * np.abs(self.twist - share))

    def each(self) -> FloatArray:
        return _least(self.power, *self.ends)

    def shared(self) -> FloatArray:
        ends = self.ends[0].min(axis=0), self.ends[1].max(axis=0)
        return _least(lambda share: self.power(share).max(axis=0), *ends)


def _least(f: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
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
        x, y = (np.stack([self.low[:, i], self.high[:, i]]) for i in (0, 1))
        return np.stack([np.stack([x[i], y[j]], axis=1) for i in (0, 1) for j in (0, 1)])

    def halved(self, size: FloatArray) -> _Boxes:
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
        result = np.maximum(self.best, self.dropped)
        np.maximum.at(result, self.left.contact, self.bound)
        return result

    def refine(self, rounds: int) -> None:
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
        every, (low, high) = np.arange(len(boxes)), np.moveaxis(boxes, -1, 0)
        middle = np.clip(0.0, low, high)
        sides = ((low, middle), (middle, high))
        ends = [
            [np.stack([first[k][:, 0], second[k][:, 1]], axis=1) for k in (0, 1)]
            for first in sides
            for second in sides
        ]
        low, high = (np.concatenate(column) for column in zip(*ends, strict=True))
        return _Boxes(np.tile(every, len(ends)), low, high)

    def _bounded(self, boxes: _Boxes) -> FloatArray:
        j, e = boxes.contact, boxes.corners
        arm = np.stack([rectangle_arm(self.half[j], np.abs(corner)) for corner in e])
        case = _Case(self.lever, self.w[j], self.friction[j], e, arm)
        for corner, power in zip(e, case.each(), strict=True):
            np.maximum.at(self.best, j, power)
            top = power >= self.best[j]
            self.where[j[top]] = corner[top]
        return case.shared()
