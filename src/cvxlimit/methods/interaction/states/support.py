"""How much work contact forces with interaction can do: support functions of the true sets.

For unit compression N = 1 and rates w the power of admissible forces is at most

    max over e of  b . e + torsion or shear at the pressure centre e,   plus w_N,

where b . e = w_M1 e2 - w_M2 e1 is the power of the moments. With a = (w_V1, w_V2), d = w_MT and
c = c(e) the effective arm of Eq. 26, the admissible shears and torsions at a fixed e are

- *independent signs*: c abs(V) + eps2 abs(V1) + eps1 abs(V2) + abs(MT) <= c mu, the unit ball of
  a sum of two gauges. Its support is the larger one: mu c abs(d) (all torsion) or mu c m (all
  shear), m(c, eps) = max a . V subject to c abs(V) + eps2 abs(V1) + eps1 abs(V2) <= 1;
- *signed*: MT = e1 V2 - e2 V1 + t with c abs(V) + abs(t) <= c mu; the support is
  mu max(c abs(d), norm(a1 - d e2, a2 + d e1)).

**Where the maximum over e lies.** c_T is a mean of norms, so c is convex in eps where no sign of
e changes: torsion is largest at corners of sign quadrants. Signed shear is convex in e: corners
again. Independent shear: for one direction of V it is proportional to r = c / (c + k . eps), and
{r < r0} = {(1 - r0) c < r0 k . eps} is convex. So a line through any inner point has r no
smaller on all of it, and b . e does not fall along one of its halves: the maximum lies on the
boundary of any convex set of e within a quadrant, for a rectangle on its edges.

**Polygons** that are not rectangles: any pointwise Coulomb friction can be moved to the corners by
barycentric weights without changing a resultant, and uniform pressure on the effective region
attains the signed condition, which the independent one implies. Friction at the corners,
abs(V_k) <= mu n_k, therefore contains both sets; its support is
max over corners of b . e + mu norm(a1 - d e2, a2 + d e1). It is the exact hull of the signed set,
and an outer one of the independent set.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import torsion_arm

Support = tuple[FloatArray, FloatArray]
"""Largest power w . X (n,) of states X with N = 1, but for w_N; and the pressure centres (n, 2)
that have it as fractions of the half sides, NaN where they are not known."""

_PRECISION = 1e-10
"""Width to which maxima along edges are enclosed, as a share of the largest power in play. The
upper end of the enclosure is what counts, so this costs tightness, never validity."""

_PIECES = 4
"""First pieces per edge: what quick bounds make do with."""


def half_extent(contacts: Contacts) -> FloatArray:
    """Half sides of rectangles, or the largest coordinates of a polygon's corners, (n, 2).

    Pressure centres and boxes of them are given as fractions of it.
    """
    size = np.maximum.reduceat(np.abs(contacts.corner_xy), contacts.corner_start[:-1], axis=0)
    return np.where(contacts.is_rectangle[:, None], contacts.sides / 2.0, size)


def whole_boxes(contacts: Contacts) -> FloatArray:
    """The box of all pressure centres, (n, 2, 2): per axis from -1 to 1."""
    return np.tile([-1.0, 1.0], (len(contacts), 2, 1))


def is_whole(boxes: FloatArray) -> NDArray[np.bool_]:
    """True (n,) for boxes of all pressure centres."""
    return np.asarray((np.abs(boxes) >= 1.0).all(axis=(1, 2)))


def rectangle_arm(half: FloatArray, eps: FloatArray) -> FloatArray:
    """c (k,) of Eq. 26 for half sides and eccentricities (k, 2); exactly 0 in the corner."""
    sides = 2.0 * np.maximum(half - eps, 0.0)
    return torsion_arm(sides[:, 0], sides[:, 1])


def shear_support(rates: FloatArray, arm: FloatArray, weight: FloatArray) -> FloatArray:
    """m (k,) = max a . V subject to arm abs(V) + weight . (abs(V1), abs(V2)) <= 1.

    By duality the root of norm((a - m weight)+) = m arm, which falls from left to right in m: a
    quadratic where both parts are positive, else the larger of a_i / (arm + weight_i).
    ``rates`` (k, 2) are magnitudes; ``arm`` (k,) and ``weight`` (k, 2) >= 0, not both zero.
    """
    aa, ww = (rates**2).sum(axis=1), (weight**2).sum(axis=1)
    aw = (rates * weight).sum(axis=1)
    square = aw**2 - aa * (ww - arm**2)
    root = aw + np.sqrt(np.maximum(square, 0.0))
    both = np.divide(aa, root, out=np.zeros_like(aa), where=root > 0.0)
    single = (rates / np.maximum(arm[:, None] + weight, 1e-300)).max(axis=1)
    inside = (square >= 0.0) & (root > 0.0) & (rates >= both[:, None] * weight).all(axis=1)
    return np.where(inside, both, single)


def independent_support(
    w: FloatArray, half: FloatArray, friction: FloatArray, boxes: FloatArray, halvings: int
) -> Support:
    """On the edges of boxes, as ranges of magnitudes; moment rates with the signs of those."""
    rows, parts = _one_signed(boxes)
    upper, where = _quadrant_support(w[rows], half[rows], friction[rows], parts, halvings)
    if len(rows) == len(w):
        return upper, where
    best = np.full(len(w), -np.inf)
    np.maximum.at(best, rows, upper)
    centre = np.zeros_like(half)
    top = upper >= best[rows]
    centre[rows[top]] = where[top]
    return best, centre


def _one_signed(boxes: FloatArray) -> tuple[IntArray, FloatArray]:
    rows, parts = np.arange(len(boxes)), boxes
    for axis in (0, 1):
        cut = np.flatnonzero((mixed_sign(parts) & ~free_sign(parts))[:, axis])
        other = parts[cut].copy()
        other[:, axis, 1] = 0.0
        parts = parts.copy()
        parts[cut, axis, 0] = 0.0
        rows, parts = np.concatenate([rows, rows[cut]]), np.concatenate([parts, other])
    return rows, parts


def _quadrant_support(
    w: FloatArray, half: FloatArray, friction: FloatArray, boxes: FloatArray, halvings: int
) -> Support:
    low, high = boxes[..., 0], boxes[..., 1]
    free = free_sign(boxes)
    sign = np.where(low + high >= 0.0, 1.0, -1.0)
    moment = np.stack([-w[:, COLUMN["M2"]], w[:, COLUMN["M1"]]], axis=1)
    near = np.where(free, 0.0, np.minimum(np.abs(low), np.abs(high)))
    far = np.maximum(np.abs(low), np.abs(high))
    search = _EdgeSearch(
        np.where(free, np.abs(moment), sign * moment),
        w,
        half,
        friction,
        (near * half, far * half),
        np.where(free, 1.0, sign),
    )
    search.refine(halvings)
    return search.upper(), search.where / half


def axis_levels(boxes: FloatArray) -> list[tuple[FloatArray, NDArray[np.bool_]]]:
    """Ends of boxes along both axes (n, 2), and zero where it lies between them: places, and where
    a box has them besides the others."""
    low, high, mixed = boxes[..., 0], boxes[..., 1], mixed_sign(boxes)
    everywhere = np.ones_like(mixed)
    return [(high, everywhere), (low, high > low), (np.clip(0.0, low, high), mixed)]


def corner_power(
    w: FloatArray,
    e: FloatArray,
    friction: FloatArray,
    torsion: FloatArray | float = 0.0,
    about: FloatArray | None = None,
) -> FloatArray:
    """Power (k,) of a unit compression at e (k, 2) with the better of full friction, with torsion
    ``about`` a point (e itself), and pure ``torsion``; but for w_N."""
    twist, d = w[:, COLUMN["MT"]], e if about is None else about
    slip = np.hypot(w[:, COLUMN["V1"]] - twist * d[:, 1], w[:, COLUMN["V2"]] + twist * d[:, 0])
    moments = w[:, COLUMN["M1"]] * e[:, 1] - w[:, COLUMN["M2"]] * e[:, 0]
    result: FloatArray = moments + friction * np.maximum(torsion, slip)
    return result


def corner_support(w: FloatArray, contacts: Contacts, rows: IntArray) -> FloatArray:
    """Power (k,) of friction at the corners of contacts ``rows``, for rates w (k, 6)."""
    place = np.full(len(contacts), -1)
    place[rows] = np.arange(len(rows))
    k = np.flatnonzero(place[contacts.corner_contact] >= 0)
    j = place[contacts.corner_contact[k]]
    power = np.full(len(rows), -np.inf)
    friction = contacts.friction[rows]
    np.maximum.at(power, j, corner_power(w[j], contacts.corner_xy[k], friction[j]))
    return power


def mixed_sign(boxes: FloatArray) -> NDArray[np.bool_]:
    """True (n, 2) where a box allows both signs of an eccentricity."""
    return np.asarray((boxes[..., 0] < 0.0) & (boxes[..., 1] > 0.0))


def free_sign(boxes: FloatArray) -> NDArray[np.bool_]:
    """True (n, 2) where a box allows both signs of an eccentricity alike."""
    return mixed_sign(boxes) & np.asarray(boxes[..., 0] == -boxes[..., 1])


@dataclass(frozen=True, eq=False)
class _Points:
    """Eccentricities on box edges: contact, eps (k, 2), arm c, slope m, and power b . eps, (k,)."""

    contact: IntArray
    eps: FloatArray
    arm: FloatArray
    slope: FloatArray
    moment: FloatArray

    def __getitem__(self, rows: IntArray | NDArray[np.bool_]) -> _Points:
        return _Points(**{name: values[rows] for name, values in vars(self).items()})

    def joined(self, other: _Points) -> _Points:
        pairs = {name: (values, getattr(other, name)) for name, values in vars(self).items()}
        return _Points(**{name: np.concatenate(pair) for name, pair in pairs.items()})


class _EdgeSearch:
    """Largest power over the edges of boxes of eccentricities, enclosed from both sides.

    On a piece of an edge let c1 be the chord of c: above c, for c is convex. Power grows with c,
    and with c1 it is b . eps + mu c1 m(c1, eps), where m, a maximum of reciprocals of linear
    functions of (c, eps), is convex along the piece and below its own chord m1. So the power is
    below the quadratic b . eps + mu c1 m1, whose maximum is known and whose error falls with the
    square of the piece's length. Pieces whose maximum exceeds the best value found are halved.
    """

    def __init__(
        self,
        moment: FloatArray,
        w: FloatArray,
        half: FloatArray,
        friction: FloatArray,
        box: tuple[FloatArray, FloatArray],
        sign: FloatArray,
    ) -> None:
        self.moment, self.half, self.friction, self.sign = moment, half, friction, sign
        self.shear = np.abs(w[:, [COLUMN["V1"], COLUMN["V2"]]])
        twist = np.abs(w[:, COLUMN["MT"]])
        size = np.hypot(*half.T)
        self.tolerance = _PRECISION * (
            np.abs(moment * half).sum(axis=1) + friction * (self.shear.sum(axis=1) + twist * size)
        )
        self.best = np.full(len(half), -np.inf)
        self.where = np.zeros_like(half)
        self.dropped = np.full(len(half), -np.inf)
        self.start, self.end = self._pieces(*box)
        self._note(self.start)
        torsion = self.start.moment + friction[self.start.contact] * (
            twist[self.start.contact] * self.start.arm
        )
        self._note(self.start, torsion)

    def refine(self, halvings: int) -> None:
        for _ in range(halvings):
            bound = self._bound()
            j = self.start.contact
            kept = bound > self.best[j] + self.tolerance[j]
            np.maximum.at(self.dropped, j[~kept], bound[~kept])
            self.start, self.end = self.start[kept], self.end[kept]
            if not kept.any():
                return
            middle = self._at(self.start.contact, 0.5 * (self.start.eps + self.end.eps))
            self._note(middle)
            self.start, self.end = self.start.joined(middle), middle.joined(self.end)

    def upper(self) -> FloatArray:
        result = np.maximum(self.best, self.dropped)
        if len(self.start.contact):
            np.maximum.at(result, self.start.contact, self._bound())
        return result

    def _pieces(self, near: FloatArray, far: FloatArray) -> tuple[_Points, _Points]:
        corners = [
            near,
            np.stack([far[:, 0], near[:, 1]], axis=1),
            far,
            np.stack([near[:, 0], far[:, 1]], axis=1),
        ]
        ring = [
            corners[k] + share * (corners[(k + 1) % 4] - corners[k])
            for k in range(4)
            for share in np.arange(_PIECES) / _PIECES
        ]
        points = np.stack([*ring, ring[0]], axis=1)
        index = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
        found = self._at(index.ravel() // points.shape[1], points.reshape(-1, 2))
        return found[index[:, :-1].ravel()], found[index[:, 1:].ravel()]

    def _at(self, contact: IntArray, eps: FloatArray) -> _Points:
        arm = rectangle_arm(self.half[contact], eps)
        slope = shear_support(self.shear[contact], arm, eps[:, ::-1])
        return _Points(contact, eps, arm, slope, (self.moment[contact] * eps).sum(axis=1))

    def _note(self, points: _Points, power: FloatArray | None = None) -> None:
        j = points.contact
        if power is None:
            power = points.moment + self.friction[j] * points.arm * points.slope
        np.maximum.at(self.best, j, power)
        top = power >= self.best[j]
        self.where[j[top]] = (self.sign[j] * points.eps)[top]

    def _bound(self) -> FloatArray:
        p, q = self.start, self.end
        mu = self.friction[p.contact]
        first = p.moment + mu * p.arm * p.slope
        last = q.moment + mu * q.arm * q.slope
        middle = 0.5 * (p.moment + q.moment + mu * (p.arm * q.slope + q.arm * p.slope))
        rise, fall = np.maximum(middle - first, 0.0), np.maximum(middle - last, 0.0)
        share = np.divide(rise, rise + fall, out=np.zeros_like(rise), where=rise + fall > 0.0)
        return np.where((rise > 0.0) & (fall > 0.0), first + rise * share, np.maximum(first, last))
