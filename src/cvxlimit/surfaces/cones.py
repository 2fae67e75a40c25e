"""Cones: how a norm of force components is bounded, exactly or by K facets.

Each cone has a *gauge*, the size that it gives a vector (the Euclidean norm for the circle); a
*polar gauge*, the size of the rates that belong to such forces; and the *epigraph* of both, the
constraint that the size is at most a bound.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
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

    def nonneg(self, form: Any) -> None:
        """form >= 0."""

    def zero(self, form: Any) -> None:
        """form = 0."""

    def cone(self, bound: Any, rows: Sequence[Any]) -> None:
        """Euclidean norm of the rows <= bound, k times."""


class Cone(ABC):
    """Gauge of a vector of force components, its epigraph, and its polar.

    Rows are the vector's components, each an array (n,) or a form of a :class:`Sink`, to which the
    epigraphs are stated. Vectors with one component are bounded by their absolute value whatever
    the cone.
    """

    def gauge(self, rows: Sequence[FloatArray]) -> FloatArray:
        """The size (n,) of the vectors."""
        return np.abs(rows[0]) if len(rows) == 1 else self._gauge(np.stack(rows))

    def polar_gauge(self, rows: Sequence[FloatArray]) -> FloatArray:
        """The dual size (n,): smallest t with ``rows @ v <= t * gauge(v)`` for all v."""
        return np.abs(rows[0]) if len(rows) == 1 else self._polar_gauge(np.stack(rows))

    def epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> None:
        """State ``gauge(rows) <= bound``."""
        (_between if len(rows) == 1 else self._epigraph)(into, bound, rows)

    def polar_epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> None:
        """State ``polar_gauge(rows) <= bound``."""
        (_between if len(rows) == 1 else self._polar_epigraph)(into, bound, rows)

    @abstractmethod
    def _gauge(self, rows: FloatArray) -> FloatArray: ...

    @abstractmethod
    def _polar_gauge(self, rows: FloatArray) -> FloatArray: ...

    @abstractmethod
    def _epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> None: ...

    @abstractmethod
    def _polar_epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> None: ...


Bounded = Sequence[tuple[Cone, slice, Sequence[Sequence[slice]]]]
"""Of conditions that stand one below the other: the cone, the rows of the resistance, and of each
norm the rows of its components, one slice per component."""


def with_gauges(
    bounded: Bounded, components: Sequence[FloatArray], y: list[FloatArray]
) -> list[FloatArray]:
    """Returns ``y`` (k,) of each of some states with the gauges of the norms of every condition
    added to it in place, from the ``components`` (q,) of all norms."""
    for of_state, total in zip(components, y, strict=True):
        for cone, at, norms in bounded:
            for norm in norms:
                total[at] += cone.gauge([of_state[rows] for rows in norm])
    return y


@dataclass(frozen=True)
class Conic(Cone):
    """The exact Euclidean norm: second-order cones (Eq. 10).

    >>> Conic().gauge([np.array([3.0]), np.array([4.0])]).tolist()
    [5.0]
    """

    def __str__(self) -> str:
        return "conic"

    def _gauge(self, rows: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(rows, axis=0))

    def _epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> None:
        into.cone(bound, rows)

    _polar_gauge, _polar_epigraph = _gauge, _epigraph


@dataclass(frozen=True)
class Facets(Cone):
    """The circle replaced by a regular polygon with ``count`` sides (Eq. 11 for 8).

    Build it with :meth:`circumscribed` (unsafe side: friction up to 1 / cos(pi / K)) or
    :meth:`inscribed` (safe side); the two bracket the conic answer, the gap falls as 1 / K^2.
    Facet normals lie at angles 2 pi k / K from t1. Only for vectors of two components.

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

    def _gauge(self, rows: FloatArray) -> FloatArray:
        self._check(len(rows))
        return np.asarray((self.normals @ rows).max(axis=0))

    def _polar_gauge(self, rows: FloatArray) -> FloatArray:
        self._check(len(rows))
        # Corners of the unit polygon, between its facets: the polar gauge is attained at one.
        middle = self.normals + np.roll(self.normals, -1, axis=0)
        middle /= (middle * self.normals).sum(axis=1)[:, None]
        return np.asarray((middle @ rows).max(axis=0))

    def _epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> None:
        self._check(len(rows))
        for normal in self.normals.tolist():
            rest = bound
            for weight, row in zip(normal, rows, strict=True):
                rest = rest - weight * row if weight != 0.0 else rest
            into.nonneg(rest)

    def _polar_epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> None:
        self._check(len(rows))
        # The vector is a sum of facet normals times parts >= 0, and the sum of parts is bounded.
        parts = [into.new(rows[0].size, nonneg=True) for _ in self.normals]
        into.nonneg(bound - sum(parts))
        for weights, row in zip(self.normals.T.tolist(), rows, strict=True):
            into.zero(sum(w * z for w, z in zip(weights, parts, strict=True)) - row)

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

    def __str__(self) -> str:
        return "parabola"

    def _gauge(self, rows: FloatArray) -> FloatArray:
        v1, v2, m = rows
        return np.asarray(np.abs(m) / 2.0 + np.hypot(np.hypot(v1, v2), m / 2.0))

    def _polar_gauge(self, rows: FloatArray) -> FloatArray:
        slip, twist = np.hypot(rows[0], rows[1]), np.abs(rows[2])
        safe = np.where(twist > 0.0, twist, 1.0)
        turning = twist + slip**2 / (4.0 * safe)
        return np.where(slip < 2.0 * twist, turning, slip)

    def _epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> None:
        v1, v2, m = rows
        half = into.new(m.size)
        into.cone(bound - half, [v1, v2, 0.5 * m])
        _between(into, half, [0.5 * m])

    def _polar_epigraph(self, into: Sink, bound: Any, rows: Sequence[Any]) -> None:
        slip_1, slip_2, twist = rows
        share = into.new(twist.size)
        into.cone(bound, [slip_1, slip_2, 2.0 * share])
        _between(into, bound, [2.0 * (twist - share)])


def _between(into: Sink, bound: Any, rows: Sequence[Any]) -> None:
    """States abs(row) <= bound of one row."""
    into.nonneg(bound - rows[0])
    into.nonneg(bound + rows[0])


def parse_cone(name: str, others: Iterable[str] = ()) -> Cone:
    """``"conic"``, ``"octagon"``, ``"16-gon"`` or ``"16-gon-inscribed"`` as a cone; ``others`` are
    names that are none, and that a refusal tells besides.

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
