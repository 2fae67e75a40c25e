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

====== ======================== ================================================================
letter name                     meaning (each of n contacts)
====== ======================== ================================================================
e_i    ``Point.centre``         pressure centre (e1, e2) = (-M2, M1) / N along t1, t2 (length)
V / N  ``Point.shear``          shear over compression at the point, (n, 2)
X_i    ``Forces.X``             N e_i, signed (force times length)
N      ``Forces.N``             compression, positive
l_i    ``contacts.sides``       sides of the contact's rectangle (length)
mu     ``contacts.friction``    Coulomb coefficient
ca, cb ``StepRows._slope``      slopes (n, 2) of the plane below C
k      ``Product.k``            balance of the squares in a product
p, q   ``Row.squares``          sum and difference of the balanced factors; only p enters a row
d      ``StepRows.slopes``      lever of the reading, as slopes d_i / e_i
====== ======================== ================================================================

Contact forces (n, 6) are in the order V1 V2 N M1 M2 MT of ``contacts.COMPONENTS``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.interaction.states.rectangles import Rectangles
from cvxlimit.extensions.interaction.states.settings import SUPPORT
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import torsion_arm_gradient
from cvxlimit.readings.pressure import eccentricities


@dataclass(frozen=True, eq=False)
class Point:
    """The point at which rows are exact: ``centre`` (n, 2) is e1, e2 in the contacts' unit of
    length, ``shear`` (n, 2) is V / N."""

    centre: FloatArray
    shear: FloatArray

    @classmethod
    def middle(cls, contacts: Contacts) -> Point:
        """Returns the point of forces that press in the middle without shear."""
        return cls(np.zeros((len(contacts), 2)), np.zeros((len(contacts), 2)))

    @classmethod
    def of(cls, forces: FloatArray, contacts: Contacts, otherwise: Point, least: float) -> Point:
        """Returns the point of ``forces`` (n, 6); contacts with N below ``least`` have that of
        ``otherwise``."""
        normal = forces[:, [COLUMN["N"]]]
        pressed = normal >= least
        shear = forces[:, [COLUMN["V1"], COLUMN["V2"]]] / np.where(pressed, normal, 1.0)
        return cls(
            np.where(pressed, eccentricities(forces), otherwise.centre),
            np.where(pressed, shear, otherwise.shear),
        ).inside(contacts)

    def inside(self, contacts: Contacts) -> Point:
        """Returns the nearest point within the contacts' sides and within friction."""
        half, mu = contacts.sides / 2.0, contacts.friction[:, None]
        return Point(np.clip(self.centre, -half, half), np.clip(self.shear, -mu, mu))

    def moved(self, share: float, before: Point) -> Point:
        """Returns the point moved on by ``share`` of the way that led here from ``before``."""
        return Point(
            self.centre + share * (self.centre - before.centre),
            self.shear + share * (self.shear - before.shear),
        )

    def shrunk(self, share: float) -> Point:
        """Returns the point moved by ``share`` of the way to the middle without shear."""
        return Point((1.0 - share) * self.centre, (1.0 - share) * self.shear)


class Linear(dict[str, "float | FloatArray"]):
    """A linear form: coefficients by component's name, as surfaces take it, each a number or (n,).

    Forms are added, and multiplied by numbers or arrays (n,). Single numbers stay numbers, and a
    multiple by zero has no entries: neither depends on the point at which rows are built.
    """

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
"""Linear forms, or arrays (n,) of their values at some forces: rows need only sums and multiples,
so that the same code states rows and evaluates them."""


@dataclass(frozen=True, eq=False)
class Forces(Generic[Values]):
    """The variables of rows: contact forces ``N``, ``V`` (V1 and V2) and ``MT``; ``X`` = N e1 and
    N e2; and bounds ``m`` >= abs(X), ``u`` >= norm(V), ``s`` >= abs(V), ``t`` >= abs(MT)."""

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
        """Returns p, its value p0 over N at the point, and a linear part, so that
        x y / N <= linear + p^2 / (4 N), with equality where x / N = x0 and y / N = y0."""
        x, y = self.x / self.k, self.k * self.y
        x0, y0 = self.x0 / self.k, self.k * self.y0
        d = x0 - y0
        return x + y, x0 + y0, d**2 / 4.0 * normal - d / 2.0 * (x - y)


@dataclass(frozen=True, eq=False)
class Row(Generic[Values]):
    """The condition ``linear`` + sum of ``squares``^2 / (4 N) <= 0 at every contact; ``at`` are the
    values of ``squares`` over N at the point where the row is exact."""

    linear: Values
    squares: Sequence[Values] = ()
    at: Sequence[FloatArray] = ()

    @classmethod
    def of(cls, linear: Values, products: Sequence[Product[Values]], normal: Values) -> Row[Values]:
        """Returns the row in which every product is replaced by its majorant."""
        parts = [product.majorant(normal) for product in products]
        roots, at = [p for p, _, _ in parts], [p0 for _, p0, _ in parts]
        return cls(sum((rest for _, _, rest in parts), start=linear), roots, at)

    def lengthened(self, normal: Values, share: float) -> Row[Values]:
        """Returns the row with only ``share`` of its curvature: p^2 / (4 N) is replaced by its
        tangent at the point plus that share of the rest. Exact at the row's own point like the row
        itself, but no longer inside the true condition: a step with such rows goes farther, and its
        forces prove nothing."""
        linear, squares = self.linear, []
        for p, p0 in zip(self.squares, self.at, strict=True):
            linear = linear + p0 / 2.0 * p - p0**2 / 4.0 * normal
            squares.append(share**0.5 * (p - p0 * normal))
        return Row(linear, squares, self.at)

    def cone(self, normal: Values, slack: Values, arm: FloatArray) -> list[Values]:
        """Returns the entries of the second-order cone norm(squares)^2 <= 4 N w, its bound first,
        with w = slack - linear. Divided by ``arm`` (n,) w is as large as N; otherwise the first and
        the last entry would hardly differ."""
        w = (slack - self.linear) / arm
        entries = [normal + w]
        entries += [p / np.sqrt(arm) for p in self.squares]
        entries.append(normal - w)
        return entries


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
        result = limits if self.is_limited else []
        for turn in (1.0, -1.0):
            result.append(Row.of(turn * f.MT + base, self._products(turn), f.N))
        return result + [self._side(i) for i in (0, 1) if not self._is_split(i)]

    def _side(self, i: int) -> Row[Values]:
        """Returns the row that keeps pressure on its side of axis ``i``; where it may cross that,
        the row is N >= 0, since nothing would be strictly inside a row without entries."""
        x, sign = self._reach(i)
        return Row(-(x + (self._sides[:, i] * (sign == 0.0)) * self.f.N))

    @cached_property
    def _sides(self) -> FloatArray:
        return self.rectangles.contacts.sides

    @cached_property
    def _slope(self) -> FloatArray:
        """The plane below C, the arm of N times the effective area: its derivatives ca, cb (n, 2)
        by the effective sides."""
        sides = np.maximum(self._sides - 2.0 * np.abs(self.point.centre), 0.0)
        slope = np.stack(torsion_arm_gradient(*sides.T), axis=1)
        return np.asarray(slope * self.rectangles.arm_share[:, None])

    @cached_property
    def _k(self) -> FloatArray:
        """Balances k (n, 2) of the products with X1 and with X2."""
        friction = np.maximum(self.rectangles.contacts.friction, SUPPORT.friction)[:, None]
        return np.asarray(np.sqrt(self.balance * self._sides / 2.0 / friction))

    @property
    def _resistance(self) -> Values:
        """mu (ca P1 + cb P2): the torque that the plane leaves without shear."""
        effective = [self._sides[:, i] * self.f.N - 2.0 * self.f.m[i] for i in (0, 1)]
        first, second = (self.rectangles.contacts.friction[:, None] * self._slope).T
        return first * effective[0] + second * effective[1]

    def _is_split(self, i: int) -> bool:
        """Returns whether X_i is split into its positive and its negative part."""
        return self.slopes is not None and self.slopes[i, 0] == self.slopes[i, 1]

    def _products(self, turn: float) -> list[Product[Values]]:
        """Returns the products in torque with the sign ``turn``, and those of the plane and
        shear."""
        result = []
        for part in (1.0, -1.0):  # in this order: solvers' last digits depend on it
            result += [self._halved(i, turn, part) for i in (0, 1) if self._is_split(i)]
        return result + [self._whole(i, turn) for i in (0, 1) if not self._is_split(i)]

    def _halved(self, i: int, turn: float, part: float) -> Product[Values]:
        """Returns the product with X_i+ or X_i-, by the sign ``part``, where axis i is split."""
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
        """Returns the product with X_i where its sign is kept, or with m_i where it is free."""
        f, j, slope = self.f, 1 - i, 2.0 * self._slope[:, i]
        shear, y0 = self.point.shear[:, j], -slope * self._size
        y = -slope * f.u
        x, sign = self._reach(i)
        free, most = 1.0 * (sign == 0.0), 1.0
        if self.slopes is not None:
            most = float(np.abs(self.slopes[i]).max())
            signed = turn * _SIGN[i] * sign * np.where(sign > 0.0, *self.slopes[i])
            y, y0 = y + signed * f.V[j], y0 + signed * shear
        x = x + free * f.m[i]
        y = y + most * free * f.s[j]
        y0 = y0 + most * free * np.abs(shear)
        return Product(x, y, self._k[:, i], np.abs(self.point.centre[:, i]), y0)

    def _reach(self, i: int) -> tuple[Values, FloatArray]:
        """Returns N e_i times the sign of e_i at the point, and that sign: zero where it may
        change. Such rows let the centre cross the axis, and cut off a little of the torque."""
        centre = self.point.centre[:, i]
        sign = np.where(np.abs(centre) <= SUPPORT.central * self._sides[:, i], 0, np.sign(centre))
        if self.slopes is None:
            return 0.0 * self.f.X[i], 0.0 * centre
        return sign * self.f.X[i], sign

    @property
    def _size(self) -> FloatArray:
        """The size of the shear over N at the point, (n,)."""
        return np.asarray(np.linalg.norm(self.point.shear, axis=1))


_SIGN = (-1.0, 1.0)
"""The signs of N d_1 V2 and N d_2 V1 in the torque MT - d1 V2 + d2 V1."""
