"""Cones: how a norm of force components is bounded, exactly or by K facets.

Each cone has a *gauge*, the size that it gives a vector v (the Euclidean norm for the circle); a
*polar gauge*, the size of the rates that belong to such forces; and its *epigraph* as two small
matrices, all that problems need to state it:

    gauge(v) <= t   where, for some w,   P (t, v, w) >= 0   and   Q (t, v, w) is in the cone of
                                                            vectors whose first entry is at least
                                                            the norm of the others.

From these follow its constraints (:meth:`Cone.epigraph`), those of its polar
(:meth:`Cone.polar`), and what rates a solver's duals of them mean (:meth:`Cone.flow`).
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Protocol

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import meant
from cvxlimit.errors import ModelError


class Sink(Protocol):
    """Where a problem is stated: CVXPY constraints, or rows of matrices.

    Forms are affine expressions of the unknowns, k each. Sums of them, multiples by numbers (k,)
    and rows by index are forms again, in CVXPY's notation.
    """

    def new(self, size: int | None = None, name: str | None = None, nonneg: bool = False) -> Any:
        """Unknowns (size,) of one's own as a form; one number without a size."""

    def nonneg(self, form: Any) -> Any:
        """form >= 0; returns that by which its dual is asked for."""

    def zero(self, form: Any) -> None:
        """form = 0."""

    def cone(self, bound: Any, rows: Sequence[Any]) -> Any:
        """Euclidean norm of the rows <= bound, k times; returns that by which its dual is asked
        for."""


class Cone(ABC):
    """Gauge of a vector of force components, its epigraph, and its polar.

    Rows are the vector's components, each an array (n,) or a form of a :class:`Sink`, to which
    constraints are stated. Vectors with one component are bounded by their absolute value whatever
    the cone.

    To add a cone, subclass and give its gauge, its polar and its matrices, of vectors of more
    components than one; nothing else needs to change:

    >>> class Diamond(Cone):
    ...     '''abs(v1) + abs(v2) <= t: with w >= abs(v1), abs(v2) <= t - w.'''
    ...     def gauge_of(self, rows):
    ...         return np.abs(rows).sum(axis=0)
    ...     def polar_gauge_of(self, rows):
    ...         return np.abs(rows).max(axis=0)
    ...     def rows_of(self, size):
    ...         on = [[0, -1, 0, 1], [0, 1, 0, 1], [1, 0, -1, -1], [1, 0, 1, -1]]  # t, v1, v2, w
    ...         return np.array(on), np.zeros((0, 4))
    >>> v = [np.array([3.0]), np.array([-4.0])]
    >>> Diamond().gauge(v).tolist(), Diamond().polar_gauge(v).tolist(), str(Diamond())
    ([7.0], [4.0], 'diamond')
    """

    def __str__(self) -> str:
        """The cone's name: that of its class, unless another is given."""
        return type(self).__name__.lower()

    def gauge(self, rows: Sequence[FloatArray] | FloatArray) -> FloatArray:
        """The size (n,) of the vectors."""
        return np.abs(rows[0]) if len(rows) == 1 else self.gauge_of(np.asarray(rows))

    def polar_gauge(self, rows: Sequence[FloatArray] | FloatArray) -> FloatArray:
        """The dual size (n,): smallest t with ``rows @ v <= t * gauge(v)`` for all v."""
        return np.abs(rows[0]) if len(rows) == 1 else self.polar_gauge_of(np.asarray(rows))

    def rows(self, size: int) -> tuple[FloatArray, FloatArray]:
        """P and Q of the epigraph of vectors of so many components: columns t, v, and any w."""
        if size == 1:
            return _BETWEEN, np.zeros((0, 2))
        linear, second_order = self.rows_of(size)
        if linear.shape[1] != second_order.shape[1] or linear.shape[1] <= size:
            raise ModelError(
                f"P and Q of cone {str(self)!r} must have as many columns, {1 + size} at least for "
                f"t and {size} components, got {linear.shape} and {second_order.shape}"
            )
        return linear, second_order

    def epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> tuple[list[Any], list[Any]]:
        """State ``gauge(rows) <= bound``; returns by what the duals of P and of Q are asked for."""
        linear, second_order = self.rows(len(rows))
        more = linear.shape[1] - 1 - len(rows)
        unknowns = [bound, *rows, *(into.new(rows[0].size) for _ in range(more))]
        stated = [into.nonneg(_mixed(row, unknowns)) for row in linear.tolist()]
        if not len(second_order):
            return stated, []
        first, *others = (_mixed(row, unknowns) for row in second_order.tolist())
        return stated, [into.cone(first, others)]

    def flow(self, size: int, duals: FloatArray) -> FloatArray:
        """Returns what duals (rows of P and Q, k) of the epigraph mean: (bound, rows) with
        ``polar_gauge(rows) <= bound``, (1 + size, k)."""
        every = np.concatenate(self.rows(size))[:, : 1 + size].T @ duals
        return np.concatenate([every[:1], -every[1:]])

    def polar(self, into: Sink, count: int, size: int) -> tuple[Any, list[Any]]:
        """Returns forms (bound, rows), ``count`` each of vectors of ``size`` components, that can
        be any with ``polar_gauge(rows) <= bound``; their unknowns are duals of the epigraph."""
        linear, second_order = self.rows(size)
        duals = [into.new(count, nonneg=True) for _ in linear]
        if len(second_order):
            bound, *rows = (into.new(count) for _ in second_order)
            into.cone(bound, rows)
            duals += [bound, *rows]
        every = np.concatenate([linear, second_order]).T.tolist()
        bound, *rows = (_mixed(row, duals) for row in every[: 1 + size])
        for row in every[1 + size :]:
            into.zero(_mixed(row, duals))
        return bound, [-row for row in rows]

    @abstractmethod
    def gauge_of(self, rows: FloatArray) -> FloatArray:
        """The size (n,) of vectors (components, n)."""

    @abstractmethod
    def polar_gauge_of(self, rows: FloatArray) -> FloatArray:
        """The dual size (n,) of vectors (components, n): any that is no smaller is safe."""

    @abstractmethod
    def rows_of(self, size: int) -> tuple[FloatArray, FloatArray]:
        """P and Q for vectors of so many components."""


def refuse_false_polar(cone: Cone, size: int) -> None:
    """Raises ModelError for a polar gauge that is too small on some vectors of ``size`` components,
    of a hundred that are tried: upper bounds rest on it, and would be false."""
    try:
        _tried(cone, size)
    except TypeError:  # it has no hash by which it would be known again
        _tried.__wrapped__(cone, size)


@cache
def _tried(cone: Cone, size: int) -> None:
    # v . r <= gauge(v) polar_gauge(r) for all pairs of a hundred v and a hundred r; once for each
    # cone, as a re-solve would take a twentieth longer
    v, r = np.random.default_rng(0).normal(size=(2, size, 100))
    power, bound = v.T @ r, np.outer(cone.gauge(v), cone.polar_gauge(r))
    is_false = ~(power <= bound * (1.0 + 1e-9))
    if is_false.any():
        i, j = np.argwhere(is_false)[0]
        raise ModelError(
            f"cone {str(cone)!r} has a polar gauge that is too small, so that upper bounds would "
            f"be false: v . r is {power[i, j]:.6g} and gauge(v) polar_gauge(r) is "
            f"{bound[i, j]:.6g} at v = {v[:, i].round(4).tolist()}, r = {r[:, j].round(4).tolist()}"
        )


_BETWEEN = np.array([[1.0, -1.0], [1.0, 1.0]])
"""Linear rows on (t, v) that say abs(v) <= t."""


def _mixed(weights: Sequence[float], forms: Sequence[Any]) -> Any:
    """Returns the sum of forms times their weights, of which one at least is not zero. It has no
    more terms and products than it needs, so that CVXPY's expressions stay small."""
    result: Any = None
    for weight, form in zip(weights, forms, strict=True):
        if weight == 0.0:
            continue
        if result is None:
            result = form if weight == 1.0 else weight * form
        elif abs(weight) == 1.0:
            result = result + form if weight > 0.0 else result - form
        else:
            result = result + weight * form if weight > 0.0 else result - -weight * form
    return result


@dataclass(frozen=True)
class Conic(Cone):
    """The exact Euclidean norm: second-order cones (Eq. 10).

    >>> Conic().gauge([np.array([3.0]), np.array([4.0])]).tolist()
    [5.0]
    """

    def gauge_of(self, rows: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(rows, axis=0))

    def rows_of(self, size: int) -> tuple[FloatArray, FloatArray]:
        return np.zeros((0, 1 + size)), np.eye(1 + size)

    polar_gauge_of = gauge_of


@dataclass(frozen=True)
class Facets(Cone):
    """The circle replaced by a regular polygon with ``count`` sides (Eq. 11 for 8).

    Build it with :meth:`circumscribed` (unsafe side: friction up to 1 / cos(pi / K)) or
    :meth:`inscribed` (safe side); the two bracket the conic answer, the gap falls as 1 / K^2.
    Facet normals lie at angles 2 pi k / K from t1, at the distance ``reach`` from the centre of the
    unit polygon. Only for vectors of two components.

    >>> v = [np.array([1.0]), np.array([1.0])]
    >>> [round(float(f(8).gauge(v)[0]), 4) for f in (Facets.circumscribed, Facets.inscribed)]
    [1.4142, 1.5307]
    """

    count: int
    reach: float

    def __post_init__(self) -> None:
        if isinstance(self.count, bool) or not isinstance(self.count, int) or self.count < 3:
            raise ModelError(f"a yield surface needs at least 3 facets, got {self.count!r}")

    @classmethod
    def circumscribed(cls, count: int) -> Facets:
        """Polygon around the circle: the paper's linearisation with ``count`` = 8."""
        return cls(count, 1.0)

    @classmethod
    def inscribed(cls, count: int) -> Facets:
        """Polygon inside the circle."""
        # circumscribed() first, which refuses a count of 0 before it divides
        return replace(cls.circumscribed(count), reach=float(np.cos(np.pi / count)))

    def __str__(self) -> str:
        name = "octagon" if self.count == 8 else f"{self.count}-gon"
        names = {1.0: name, float(np.cos(np.pi / self.count)): f"{name}-inscribed"}
        return names.get(self.reach, f"{name} of reach {self.reach!r}")

    @property
    def normals(self) -> FloatArray:
        """Outward facet normals (K, 2), scaled so that ``max(normals @ v)`` is the gauge."""
        angles = 2.0 * np.pi * np.arange(1, self.count + 1) / self.count
        exact = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        exact[np.abs(exact) < 1e-15] = 0.0
        return exact / self.reach

    def gauge_of(self, rows: FloatArray) -> FloatArray:
        self._check(len(rows))
        return np.asarray((self.normals @ rows).max(axis=0))

    def polar_gauge_of(self, rows: FloatArray) -> FloatArray:
        self._check(len(rows))
        # Corners of the unit polygon, between its facets: the polar gauge is attained at one.
        middle = self.normals + np.roll(self.normals, -1, axis=0)
        middle /= (middle * self.normals).sum(axis=1)[:, None]
        return np.asarray((middle @ rows).max(axis=0))

    def rows_of(self, size: int) -> tuple[FloatArray, FloatArray]:
        self._check(size)
        return np.hstack([np.ones((self.count, 1)), -self.normals]), np.zeros((0, 3))

    def _check(self, components: int) -> None:
        """Raises ModelError unless vectors have two components."""
        if components != 2:
            raise ModelError(
                f"facets bound vectors of two components, this surface has {components}: "
                "use surface 'conic'"
            )


@dataclass(frozen=True)
class Parabola(Cone):
    """The cone of vectors (v1, v2, m) whose unit ball is abs(m) <= 1 - v1^2 - v2^2.

    Its gauge is abs(m)/2 + norm(v1, v2, m/2), which takes one second-order cone.

    >>> v = [np.array([0.6]), np.array([0.0]), np.array([0.64])]
    >>> Parabola().gauge(v).tolist()
    [1.0]
    """

    def gauge_of(self, rows: FloatArray) -> FloatArray:
        v1, v2, m = rows
        return np.asarray(np.abs(m) / 2.0 + np.hypot(np.hypot(v1, v2), m / 2.0))

    def polar_gauge_of(self, rows: FloatArray) -> FloatArray:
        # The largest slip |v| + twist m over the unit ball is at |v| = slip / (2 twist), or 1.
        slip, twist = np.hypot(rows[0], rows[1]), np.abs(rows[2])
        safe = np.where(twist > 0.0, twist, 1.0)
        within = twist + slip**2 / (4.0 * safe)
        return np.where(slip < 2.0 * twist, within, slip)

    def rows_of(self, size: int) -> tuple[FloatArray, FloatArray]:
        # w >= abs(m)/2, and norm(v1, v2, m/2) <= t - w
        linear, cone = np.zeros((2, 5)), np.zeros((4, 5))
        linear[:, 3:] = [[-0.5, 1.0], [0.5, 1.0]]
        cone[[0, 0, 1, 2, 3], [0, 4, 1, 2, 3]] = [1.0, -1.0, 1.0, 1.0, 0.5]
        return linear, cone


def parse_cone(name: str, others: Iterable[str] = ()) -> Cone:
    """``"conic"``, ``"octagon"``, ``"16-gon"`` or ``"16-gon-inscribed"`` as a cone; ``others`` are
    names of surfaces that are no cones, which the refusal of a name lists as well.

    Raises
    ------
    ModelError
        For any other name.

    Example
    -------
    >>> str(parse_cone("8-gon")), str(parse_cone("octagon-inscribed"))
    ('octagon', 'octagon-inscribed')
    """
    if name == "conic":
        return Conic()
    match = re.fullmatch(r"(octagon|(\d{1,4})-gon)(-inscribed)?", name)
    if match is None:
        known = [f"{cone}{side}" for cone in ("octagon", "16-gon") for side in ("", "-inscribed")]
        raise ModelError(
            f"surface must be {', '.join(map(repr, ['conic', *others]))}, 'octagon' or 'K-gon' "
            f"(say '16-gon'), with '-inscribed' for the safe side, got {name!r}"
            + meant(name, ["conic", *others, *known], before="; ")
        )
    count = int(match[2] or 8)
    return Facets.inscribed(count) if match[3] else Facets.circumscribed(count)
