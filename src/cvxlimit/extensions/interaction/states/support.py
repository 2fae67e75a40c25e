"""How much work contact forces with interaction can do: support functions of the true sets.

For states X of a contact with N = 1 the largest power w . X is w_N plus the maximum of
b . e + h(e) over pressure centres e. The derivation is in docs/evidence/interaction-bounds.md.

====== ============ ============================================================================
letter name         meaning
====== ============ ============================================================================
w      ``w``        rates (n, 6) of V1, V2, N, M1, M2, MT, the order of ``contacts.COMPONENTS``
e      ``ends``     pressure centre (e1, e2) = (-M2, M1) / N (length) along t1, t2; eps = abs(e)
b      ``moment``   (-w_M2, w_M1), what a pressure centre does per length
mu     ``friction`` Coulomb coefficient (n,)
c      ``arm``      torsion arm (n,) of the effective area about e (Eq. 26; length)
d      ``lever``    the point about which a reading of Eq. 30 takes torsion
h                   largest power of shear and torsion at e, which depends on the reading
====== ============ ============================================================================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.extensions.interaction.states.settings import SUPPORT
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import torsion_arm

Support = tuple[FloatArray, FloatArray]
"""Largest power w . X (n,) of states X with N = 1, but for w_N; and the pressure centres (n, 2)
that have it as fractions of the half sides, NaN where they are not known. On polygons beside them
the arm that counts there: (n, 3)."""

Lever = Callable[[FloatArray], FloatArray]
"""From pressure centres (..., 2) to the points about which torsion is taken, (..., 2)."""


Range = tuple[float, float]
"""The lowest and the highest fraction of a half side where pressure centres may be on it. Written
backwards it is one of sizes, from the second to the first, on either side of the middle."""

Pieces = Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Of pieces (q, k, d) of contacts (k,): places (p, k, d), the power at each of them (p, k), and an
upper bound (k,) on that all over the piece."""


DIGITS = int(np.finfo(float).nmant)
"""Binary digits of a number: a piece halved so often is as short as rounding."""


def _halved_boxes(ends: FloatArray, half: FloatArray) -> FloatArray:
    """Boxes (2, k, 2), their lowest and highest ends, cut across their longer side: (2, 2 k, 2)."""
    size = np.abs(ends[1] - ends[0]) / half
    axis = (size[:, 1] > size[:, 0]).astype(int)
    every, k = np.arange(len(half)), len(half)
    middle = 0.5 * (ends[0] + ends[1])[every, axis]
    halves = np.tile(ends, (1, 2, 1))
    halves[1, every, axis] = halves[0, k + every, axis] = middle
    return halves


def _cut_edges(ends: FloatArray, half: FloatArray) -> FloatArray:
    """Edges (2, k, 2) in equal pieces (2, m k, 2): more at a time, for calls of NumPy cost most."""
    at = np.linspace(0.0, 1.0, SUPPORT.pieces + 1)[:, None, None]
    places = ends[0] + at * (ends[1] - ends[0])
    return np.stack([places[:-1].reshape(-1, 2), places[1:].reshape(-1, 2)])


@dataclass(frozen=True, eq=False)
class Asked:
    """What a support function is evaluated for, on n rectangles.

    ``w`` (n, 6) are the rates, ``half`` (n, 2) the half sides, and ``boxes`` (n, 2, 2) the lowest
    and the highest fraction of the half sides, per axis, where pressure centres may be. Powers up
    to ``floor`` (n,) need not be enclosed closely, others to ``precision`` of the largest power
    possible, if that is coarser than the reading's own. Pieces are cut in halves ``halvings`` times
    at most.
    """

    w: FloatArray
    half: FloatArray
    friction: FloatArray
    boxes: FloatArray
    floor: FloatArray
    precision: float
    halvings: int

    def take(self, rows: IntArray) -> Asked:
        w, half, friction = self.w[rows], self.half[rows], self.friction[rows]
        return replace(
            self, w=w, half=half, friction=friction, boxes=self.boxes[rows], floor=self.floor[rows]
        )

    def largest(
        self,
        rows: IntArray,
        pieces: FloatArray,
        found: Pieces,
        precision: float,
        halvings: int,
        halved: Callable[[FloatArray, FloatArray], FloatArray] = _halved_boxes,
    ) -> Support:
        """The largest power over ``pieces`` (q, k, d) of contacts ``rows`` (k,), from above, by
        branch and bound: pieces whose bound exceeds the best value so far are cut further."""
        # The tolerance is a share of the largest power that moments, shear and torsion can have.
        w, n = np.abs(self.w), len(self.half)
        moments = (w[:, [COLUMN["M2"], COLUMN["M1"]]] * self.half).sum(axis=1)
        shear = w[:, COLUMN["V1"]] + w[:, COLUMN["V2"]]
        twist = w[:, COLUMN["MT"]] * np.hypot(*self.half.T)
        tolerance = max(precision, self.precision) * (moments + self.friction * (shear + twist))
        (best, dropped), where = np.full((2, n), -np.inf), np.zeros((n, pieces.shape[2]))
        before = np.full(len(rows), np.inf)
        for left in reversed(range(halvings + 1)):
            places, powers, bound = found(rows, pieces)
            # A part is bounded by its own bound and by that of the piece it was cut from.
            bound = np.minimum(bound, before)
            for place, power in zip(places, powers, strict=True):
                np.maximum.at(best, rows, power)
                top = power >= best[rows]
                where[rows[top]] = place[top]
            enough = np.maximum(best, self.floor)[rows] + tolerance[rows]
            open_ = (bound > enough) & (left > 0 and len(rows) <= SUPPORT.most_pieces)
            np.maximum.at(dropped, rows[~open_], bound[~open_])
            if not open_.any():
                break
            pieces = halved(pieces[:, open_], self.half[rows[open_]])
            parts = pieces.shape[1] // int(open_.sum())
            rows, before = np.tile(rows[open_], parts), np.tile(bound[open_], parts)
        where[:, :2] /= self.half
        return np.maximum(best, dropped), where


def independent_support(asked: Asked) -> Support:
    """The largest power with independent signs, which lies on an edge of the box.

    On a piece of an edge let c1 be the chord of c: above c, for c is convex. Power grows with c,
    and with c1 it is b . eps + mu c1 m(c1, eps), where m, a maximum of reciprocals of linear
    functions of (c, eps), is convex along the piece and below its own chord m1. So the power is
    below the quadratic b . eps + mu c1 m1, whose maximum is known and whose error falls with the
    square of the piece's length. Where both signs of an eccentricity are allowed alike only its
    magnitude counts, and centres are magnitudes.
    """
    w, mu = asked.w, asked.friction
    moment = np.stack([-w[:, COLUMN["M2"]], w[:, COLUMN["M1"]]], axis=1)
    shear, twist = np.abs(w[:, [COLUMN["V1"], COLUMN["V2"]]]), np.abs(w[:, COLUMN["MT"]])
    free = free_sign(asked.boxes)

    def found(j: IntArray, ends: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        eps = np.abs(ends)
        arm = np.stack([rectangle_arm(asked.half[j], end) for end in eps])
        slope = np.stack(
            [shear_support(shear[j], c, end[:, ::-1]) for c, end in zip(arm, eps, strict=True)]
        )
        turned = moment[j, 0] * ends[..., 0] + moment[j, 1] * ends[..., 1]
        first, last = turned + mu[j] * arm * slope
        crossed = mu[j] * (arm[0] * slope[1] + arm[1] * slope[0])
        middle = 0.5 * (turned[0] + turned[1] + crossed)
        rise, fall = np.maximum(middle - first, 0.0), np.maximum(middle - last, 0.0)
        share = np.divide(rise, rise + fall, out=np.zeros_like(rise), where=rise + fall > 0.0)
        bound = np.where((rise > 0.0) & (fall > 0.0), first + rise * share, np.maximum(first, last))
        return ends, turned + mu[j] * arm * np.maximum(slope, twist[j]), bound

    side = np.where(moment >= 0.0, 1.0, -1.0)
    rows, ends = within_quadrants(asked.boxes, np.where(free, side, 0.0))
    corner = box_corners(ends * asked.half[rows])
    edges = np.concatenate([corner[[a, b]] for a, b in ((0, 2), (2, 3), (1, 3), (0, 1))], axis=1)
    cuts = int(asked.halvings / np.log2(SUPPORT.pieces)) + 1
    every = np.tile(rows, 4)
    upper, centre = asked.largest(every, edges, found, SUPPORT.boxes, cuts, _cut_edges)
    return upper, np.where(free, np.abs(centre), centre)


def levered_support(lever: Lever, is_limited: bool, asked: Asked) -> Support:
    """The largest power with torsion about a lever. For Eq. 30 alone it lies at corners of boxes,
    and no centres are returned; with Eq. 27 beside it boxes are halved along both axes."""

    def found(j: IntArray, ends: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        e = box_corners(ends)
        arm = np.stack([rectangle_arm(asked.half[j], np.abs(corner)) for corner in e])
        shares = Shares(lever, asked.w[j], asked.friction[j], e, arm)
        if is_limited:
            return e, shares.each(), shares.together(asked.precision)
        power = shares.power(shares.twist)  # Eq. 30 alone has all of it
        return e, power, power.max(axis=0)

    rows, ends = within_quadrants(asked.boxes)
    most = 2 * asked.halvings if is_limited else 0
    upper, centre = asked.largest(rows, ends * asked.half[rows], found, SUPPORT.boxes, most)
    return upper, centre if is_limited else np.full_like(centre, np.nan)


class Shares:
    """Power at pressure centres e (p, k, 2) with arms (p, k), p for each of k contacts with rates
    (k, 6), as a function of the share d' of Eq. 30 in the twist. Any share gives a valid bound."""

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
        self.low = np.minimum(np.minimum(least, 0.0), self.twist)
        self.high = np.maximum(np.maximum(least, 0.0), self.twist)

    def power(self, share: FloatArray) -> FloatArray:
        """The power (p, k) for shares (p, k) or (k,)."""
        slip = np.hypot(self.v1 - share * self.d2, self.v2 + share * self.d1)
        first = np.maximum(slip, self.arm * np.abs(share))
        return self.moment + self.friction * (first + self.arm * np.abs(self.twist - share))

    def each(self) -> FloatArray:
        """The least power (p, k), every centre with a share of its own: at an end, where slip and
        torsion of Eq. 30 are equal, or where the slope of slip is 0 or that of torsion."""
        size, arm = self.d1**2 + self.d2**2, self.arm
        along = self.v1 * self.d2 - self.v2 * self.d1
        slip = self.v1**2 + self.v2**2
        flat = along / np.where(size > 0.0, size, 1.0)
        # size s^2 - 2 along s + slip = arm^2 s^2, and (size s - along)^2 = arm^2 (...)
        equal = _roots(size - arm**2, along, slip)
        steep = _roots(size * (size - arm**2), along * (size - arm**2), along**2 - arm**2 * slip)
        tried = [np.zeros_like(arm), self.twist, flat, *equal, *steep, self.low, self.high]
        return np.asarray(
            np.min([self.power(np.clip(share, self.low, self.high)) for share in tried], axis=0)
        )

    def together(self, precision: float) -> FloatArray:
        """The least (k,) of what a share of all centres of a contact leaves to the best of them,
        and a bit more, for the share is sought to a ``precision`` of its range."""
        low, high = self.low.min(axis=0), self.high.max(axis=0)
        within = max(precision, SUPPORT.boxes)
        return _least(lambda shares: self.power(shares[:, None]).max(axis=1), low, high, within)


def _least(
    f: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray, within: float
) -> FloatArray:
    """The least of a convex function, four shares (4, ...) at a time, for calls of NumPy cost most:
    the two fifths of the range beside the best of them are left, until it is ``within`` a share."""
    best = f(np.stack([low, high])).min(axis=0)
    steps = np.arange(1.0, 5.0).reshape(-1, *np.ones(low.ndim, dtype=int))
    for _ in range(int(np.log(within) / np.log(0.4)) + 1):
        span = (high - low) / 5.0
        found = f(low + steps * span)
        least = found.argmin(axis=0)
        best = np.minimum(best, found.min(axis=0))
        low = low + least * span
        high = low + 2.0 * span
    return np.asarray(best)


def _roots(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns both solutions of a s^2 - 2 b s + c = 0, zero where there are none."""
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    larger = b + np.copysign(root, b)
    far = np.divide(larger, a, out=np.zeros_like(larger), where=a != 0.0)
    near = np.divide(c, larger, out=np.zeros_like(larger), where=larger != 0.0)
    return far, near


def corner_support(w: FloatArray, contacts: Contacts) -> FloatArray:
    """Power (n,) of friction at the corners of contacts, for rates w (n, 6)."""
    j, at = contacts.corner_contact, contacts.corner_xy[None]
    shares = Shares(lambda e: e, w[j], contacts.friction[j], at, np.zeros((1, len(j))))
    return np.maximum.reduceat(shares.power(shares.twist)[0], contacts.corner_start[:-1])


def shear_support(rates: FloatArray, arm: FloatArray, weight: FloatArray) -> FloatArray:
    """m (k,) = max a . V subject to arm abs(V) + weight . (abs(V1), abs(V2)) <= 1.

    By duality the root of norm((a - m weight)+) = m arm, which falls from left to right in m: a
    quadratic where both parts are positive, else the larger of a_i / (arm + weight_i).
    ``rates`` (k, 2) are magnitudes; ``arm`` (k,) and ``weight`` (k, 2) >= 0, not both zero.
    """
    # by columns: sums along an axis of two take NumPy several times as long
    (a1, a2), (w1, w2) = rates.T, weight.T
    aa, aw = a1 * a1 + a2 * a2, a1 * w1 + a2 * w2
    square = aw * aw - aa * (w1 * w1 + w2 * w2 - arm * arm)
    root = aw + np.sqrt(np.maximum(square, 0.0))
    both = np.divide(aa, root, out=np.zeros_like(aa), where=root > 0.0)
    single = np.maximum(a1 / np.maximum(arm + w1, 1e-300), a2 / np.maximum(arm + w2, 1e-300))
    inside = (square >= 0.0) & (root > 0.0) & (a1 >= both * w1) & (a2 >= both * w2)
    return np.where(inside, both, single)


def rectangle_arm(half: FloatArray, eps: FloatArray) -> FloatArray:
    """c (k,) of Eq. 26 for half sides and eccentricities (k, 2); exactly 0 in the corner."""
    sides = 2.0 * np.maximum(half - eps, 0.0)
    return torsion_arm(sides[:, 0], sides[:, 1])


def box_corners(ends: FloatArray) -> FloatArray:
    """Corners (4, k, 2) of boxes with ends (2, k, 2): both lowest, and the second axis first."""
    return np.stack(
        [np.stack([ends[i, :, 0], ends[j, :, 1]], axis=1) for i in (0, 1) for j in (0, 1)]
    )


def whole_boxes(contacts: Contacts) -> FloatArray:
    """Boxes (n, 2, 2) of all pressure centres: from -1 to 1 along both axes."""
    return np.tile([-1.0, 1.0], (len(contacts), 2, 1))


def box_keys(boxes: FloatArray, number: IntArray) -> list[tuple[int, bytes]]:
    """A name of each box (n, 2, 2): the contact's ``number`` (n,) and its ends."""
    each = np.ascontiguousarray(boxes).reshape(-1, 4).view("V32").ravel().tolist()
    return list(zip(number.tolist(), each, strict=True))


def is_whole(boxes: FloatArray) -> BoolArray:
    """True (n,) for boxes that leave out no pressure centre."""
    return np.asarray((np.abs(boxes) >= 1.0).all(axis=(1, 2)))


def free_sign(boxes: FloatArray) -> BoolArray:
    """True (n, 2) where a box allows both signs of an eccentricity alike."""
    low, high = boxes[..., 0], boxes[..., 1]
    return np.asarray(((low < 0.0) & (low == -high)) | (low > high))


def within_quadrants(
    boxes: FloatArray, side: FloatArray | float = 0.0
) -> tuple[IntArray, FloatArray]:
    """Boxes (n, 2, 2) cut at zero: which ones (k,), and ends (2, k, 2) of the parts. ``side``
    (n, 2) is the sign of the one half that is wanted, as it is where only sizes count; zero is
    both."""
    side = np.broadcast_to(side, boxes.shape[:2])
    rows, ends = np.arange(len(boxes)), np.moveaxis(boxes, -1, 0)
    of_sizes = ends[0] > ends[1]
    ends = np.where(of_sizes, np.where(side < 0.0, -ends, ends[::-1]), ends)
    for axis in (0, 1):
        mixed = (ends[0, :, axis] < 0.0) & (ends[1, :, axis] > 0.0)
        above, below = ends.copy(), ends[:, mixed]
        above[0, mixed, axis] = below[1, :, axis] = 0.0
        has_above = ~mixed | (side[rows, axis] >= 0.0)
        has_below = side[rows[mixed], axis] <= 0.0
        rows = np.concatenate([rows[has_above], rows[mixed][has_below]])
        ends = np.concatenate([above[:, has_above], below[:, has_below]], axis=1)
    return rows, ends
