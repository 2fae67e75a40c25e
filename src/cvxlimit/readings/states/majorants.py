"""Convex rows that stay inside Eq. 30: what they allow is admissible, wherever they are built.

Eq. 30 limits the torque of a contact by what its effective area leaves of friction. Multiplied by
N, with X_i = N e_i, P_i = l_i N - 2 abs(X_i) and C the arm c_T, which is convex and homogeneous, it
reads, about the pressure centre,

    abs(MT N - X1 V2 + X2 V1) <= C(P1, P2) (mu N - abs(V)).

It is made convex at a point (e, V / N), where the rows are exact: a plane ca P1 + cb P2 takes the
place of C, which lies above it, and every product x y / N of a moment and a force is majorised by

    x y / N = (p^2 - q^2) / (4 N) <= (p^2 + d^2 N^2 - 2 d q N) / (4 N),   p, q = x / k +- k y,

with d = q / N at the point; k balances both squares. That leaves one second-order cone per contact,
and two for both signs of the torque: docs/evidence/interaction-bounds.md, "Safe steps".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import torsion_arm_gradient
from cvxlimit.readings.settings import SUPPORT
from cvxlimit.readings.states.pressure import eccentricities
from cvxlimit.readings.states.rectangles import Rectangles


@dataclass(frozen=True, eq=False)
class Point:
    """Where a step is built: ``centre`` (n, 2) is e1, e2 in the contacts' unit of length, ``shear``
    (n, 2) is V / N."""

    centre: FloatArray
    shear: FloatArray

    @classmethod
    def middle(cls, contacts: Contacts) -> Point:
        return cls(np.zeros((len(contacts), 2)), np.zeros((len(contacts), 2)))

    @classmethod
    def of(cls, forces: FloatArray, contacts: Contacts, otherwise: Point, least: float) -> Point:
        """Makes points from forces (n, 6); contacts with N below ``least`` keep their place in
        ``otherwise``."""
        normal = forces[:, [COLUMN["N"]]]
        pressed = normal >= least
        shear = forces[:, [COLUMN["V1"], COLUMN["V2"]]] / np.where(pressed, normal, 1.0)
        return cls(
            np.where(pressed, eccentricities(forces), otherwise.centre),
            np.where(pressed, shear, otherwise.shear),
        ).inside(contacts)

    def inside(self, contacts: Contacts) -> Point:
        half, mu = contacts.sides / 2.0, contacts.friction[:, None]
        return Point(np.clip(self.centre, -half, half), np.clip(self.shear, -mu, mu))

    def moved(self, share: float, before: Point) -> Point:
        return Point(
            self.centre + share * (self.centre - before.centre),
            self.shear + share * (self.shear - before.shear),
        )

    def shrunk(self, share: float) -> Point:
        return Point((1.0 - share) * self.centre, (1.0 - share) * self.shear)


class Linear(dict[str, "float | FloatArray"]):
    """A linear form of components, as surfaces take it, with sums and multiples by numbers (n,).
    What comes of single numbers alone is a number, and a zero of these no entry: neither depends on
    where a step is built."""

    __array_ufunc__ = None  # NumPy's arrays leave arithmetic to forms

    def __add__(self, other: Linear) -> Linear:
        more = {name: self[name] + k if name in self else k for name, k in other.items()}
        return Linear({**self, **more})

    def __sub__(self, other: Linear) -> Linear:
        return self + -1.0 * other

    def __neg__(self) -> Linear:
        return -1.0 * self

    def __mul__(self, k: float | FloatArray) -> Linear:
        if np.ndim(k) == 0 and k == 0.0:
            return Linear()
        return Linear((name, k * value) for name, value in self.items())

    __rmul__ = __mul__

    def __truediv__(self, k: float | FloatArray) -> Linear:
        return self * (1.0 / k)


Values = TypeVar("Values", Linear, FloatArray)
"""Linear forms, or what they come to at some forces: nothing here is more than their sums and
multiples."""


@dataclass(frozen=True, eq=False)
class Forces(Generic[Values]):
    """What a step is written in: contact forces, with ``X`` = N e1 and N e2, and bounds ``m`` >=
    abs(X), ``u`` >= norm(V), ``s`` >= abs(V), ``t`` >= abs(MT)."""

    N: Values
    V: Sequence[Values]
    X: Sequence[Values]
    MT: Values
    m: Sequence[Values]
    u: Values
    s: Sequence[Values] = ()
    t: Values | None = None


@dataclass(frozen=True, eq=False)
class Product(Generic[Values]):
    """x y / N with a balance k (n,), and x, y over N at the point (x0, y0)."""

    x: Values
    y: Values
    k: FloatArray
    x0: FloatArray
    y0: FloatArray

    def majorant(self, normal: Values) -> tuple[Values, FloatArray, Values]:
        """p, p over N at the point, and a linear part: x y / N <= linear + p^2 / (4 N), exact where
        x, y / N = x0, y0."""
        x, y = self.x / self.k, self.k * self.y
        x0, y0 = self.x0 / self.k, self.k * self.y0
        d = x0 - y0
        return x + y, x0 + y0, d**2 / 4.0 * normal - d / 2.0 * (x - y)


@dataclass(frozen=True, eq=False)
class Row(Generic[Values]):
    """linear + sum of squares / (4 N) <= 0 at every contact; ``at`` are the squares' roots over N
    at the row's own point."""

    linear: Values
    squares: Sequence[Values] = ()
    at: Sequence[FloatArray] = ()

    @classmethod
    def of(cls, linear: Values, products: Sequence[Product[Values]], normal: Values) -> Row[Values]:
        parts = [product.majorant(normal) for product in products]
        roots, at = [p for p, _, _ in parts], [p0 for _, p0, _ in parts]
        return cls(sum((rest for _, _, rest in parts), start=linear), roots, at)

    def lengthened(self, normal: Values, share: float) -> Row[Values]:
        """Only ``share`` of the curvature: p^2 / (4 N) is its tangent plus that much of the rest.
        Exact at the row's own point like the row itself, but no longer inside the true condition: a
        step with such rows goes farther, and its forces prove nothing."""
        linear, squares = self.linear, []
        for p, p0 in zip(self.squares, self.at, strict=True):
            linear = linear + p0 / 2.0 * p - p0**2 / 4.0 * normal
            squares.append(share**0.5 * (p - p0 * normal))
        return Row(linear, squares, self.at)

    def cone(self, normal: Values, slack: Values, arm: FloatArray) -> list[Values]:
        """norm(squares)^2 <= 4 N w with w = slack - linear, as a second-order cone, bound first. In
        units of an ``arm`` (n,) w is as large as N, without which its last rows are nearly one."""
        w = (slack - self.linear) / arm
        found = [normal + w]
        found += [p / np.sqrt(arm) for p in self.squares]
        found.append(normal - w)
        return found


@dataclass(frozen=True, eq=False)
class StepRows(Generic[Values]):
    """Rows of one reading at one point: Eq. 30, and Eq. 27 where it stands beside it.

    ``slopes`` (2, 2) are d_i / e_i of the reading's lever, for each axis at positive and at
    negative e_i; None for independent signs. With torque MT - d1 V2 + d2 V1, the product of N d_i
    with a shear is majorised

    - *split*, where both slopes are one: with X = X+ - X- and m = X+ + X-, X+- = (m +- X) / 2 >= 0,
      each product has a factor whose sign is known;
    - with its sign *kept*, where they differ: abs(X_i) is linear while the sign of e_i is that of
      the point;
    - *free*, with independent signs, and where a sign would be kept but the point lies on the axis,
      so that later steps may cross it: abs(X_i V_j) <= m_i s_j.
    """

    f: Forces[Values]
    point: Point
    rectangles: Rectangles
    slopes: FloatArray | None
    is_limited: bool
    balance: float

    def rows(self) -> list[Row[Values]]:
        """Returns the rows of Eq. 30 for both signs of the torque (one row with independent signs),
        those of Eq. 27, and those that keep pressure on its side of an axis."""
        f, resistance = self.f, self._resistance
        base = (self._slope * self._sides).sum(axis=1) * f.u - resistance
        if self.slopes is None:
            assert f.t is not None
            return [Row.of(f.t + base, self._products(1.0), f.N)]
        limits = [Row(sign * f.MT - resistance) for sign in (1.0, -1.0)]
        found = limits if self.is_limited else []
        for turn in (1.0, -1.0):
            found.append(Row.of(turn * f.MT + base, self._products(turn), f.N))
        return found + [self._side(i) for i in (0, 1) if not self._is_split(i)]

    def _side(self, i: int) -> Row[Values]:
        """Where pressure stays on its side of an axis; where it may cross that, N >= 0 in place of
        a row without entries, inside which nothing is."""
        x, sign = self._reach(i)
        return Row(-(x + (self._sides[:, i] * (sign == 0.0)) * self.f.N))

    @cached_property
    def _sides(self) -> FloatArray:
        return self.rectangles.contacts.sides

    @cached_property
    def _slope(self) -> FloatArray:
        """The plane below the arm: its derivatives ca, cb (n, 2) by the effective sides."""
        sides = np.maximum(self._sides - 2.0 * np.abs(self.point.centre), 0.0)
        slope = np.stack(torsion_arm_gradient(*sides.T), axis=1)
        return np.asarray(slope * self.rectangles.arm_share[:, None])

    @cached_property
    def _k(self) -> FloatArray:
        """k (n, 2) of products with X1 and with X2."""
        friction = np.maximum(self.rectangles.contacts.friction, SUPPORT.friction)[:, None]
        return np.asarray(np.sqrt(self.balance * self._sides / 2.0 / friction))

    @property
    def _resistance(self) -> Values:
        """mu (ca P1 + cb P2): the torque that the plane leaves without shear."""
        effective = [self._sides[:, i] * self.f.N - 2.0 * self.f.m[i] for i in (0, 1)]
        first, second = (self.rectangles.contacts.friction[:, None] * self._slope).T
        return first * effective[0] + second * effective[1]

    def _is_split(self, i: int) -> bool:
        return self.slopes is not None and self.slopes[i, 0] == self.slopes[i, 1]

    def _products(self, turn: float) -> list[Product[Values]]:
        """All products of the torque with the sign ``turn``, and of the plane with shear."""
        found = []
        for part in (1.0, -1.0):  # in this order: solvers' last digits depend on it
            found += [self._halved(i, turn, part) for i in (0, 1) if self._is_split(i)]
        return found + [self._whole(i, turn) for i in (0, 1) if not self._is_split(i)]

    def _halved(self, i: int, turn: float, part: float) -> Product[Values]:
        """The product with X_i+ or X_i-, by the sign ``part``, where axis i is split."""
        f, j, slope = self.f, 1 - i, 2.0 * self._slope[:, i]
        assert self.slopes is not None
        along = part * turn * _SIGN[i] * float(self.slopes[i, 0])
        centre = part * self.point.centre[:, i]
        share = np.clip(1.0 + 2.0 * centre / self._sides[:, i], SUPPORT.idle, 1.0)
        return Product(
            (f.m[i] + part * f.X[i]) / 2.0,
            along * f.V[j] - slope * f.u,
            self._k[:, i] * share,
            np.maximum(centre, 0.0),
            along * self.point.shear[:, j] - slope * self._size,
        )

    def _whole(self, i: int, turn: float) -> Product[Values]:
        """The product with X_i where its sign is kept, or with m_i where it is free."""
        f, j, slope = self.f, 1 - i, 2.0 * self._slope[:, i]
        shear, there = self.point.shear[:, j], -slope * self._size
        y = -slope * f.u
        x, sign = self._reach(i)
        free, most = 1.0 * (sign == 0.0), 1.0
        if self.slopes is not None:
            most = float(np.abs(self.slopes[i]).max())
            kept = turn * _SIGN[i] * sign * np.where(sign > 0.0, *self.slopes[i])
            y, there = y + kept * f.V[j], there + kept * shear
        x = x + free * f.m[i]
        y = y + most * free * f.s[j]
        there = there + most * free * np.abs(shear)
        return Product(x, y, self._k[:, i], np.abs(self.point.centre[:, i]), there)

    def _reach(self, i: int) -> tuple[Values, FloatArray]:
        """N e_i with the sign of the point's, and that sign: zero where it may change. Such rows
        let the centre cross the axis, and cut off a little of the torque."""
        centre = self.point.centre[:, i]
        sign = np.where(np.abs(centre) <= SUPPORT.central * self._sides[:, i], 0, np.sign(centre))
        if self.slopes is None:
            return 0.0 * self.f.X[i], 0.0 * centre
        return sign * self.f.X[i], sign

    @property
    def _size(self) -> FloatArray:
        return np.asarray(np.linalg.norm(self.point.shear, axis=1))


_SIGN = (-1.0, 1.0)
"""Of N d_1 V2 and N d_2 V1 in the torque."""
