"""The set of all load vectors that a structure carries, between what is proved on either side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector
from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.domains.polytopes import FLAT, Inner, Outer, ring
from cvxlimit.extensions.studies.domains.supports import Support
from cvxlimit.model.statics import ZERO
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import Load, combined
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import Bracket

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from cvxlimit.plotting.pictures.webpage import Page

Answer = Literal["carried", "not carried", "open"]

WINDOW = 100.0
"""Load factors, over their natural size, up to which gaps are sought: beyond, what is not carried
to any multiple is beyond what any structure is asked for."""


@dataclass(frozen=True, eq=False)
class LoadDomain:
    """All load factors p of two or three live loads that a structure carries beside its dead load.

    For every convex model this set is convex. Forces prove points inside, whose convex hull is
    inside as well; mechanisms prove half-spaces that hold it. With interaction the set need not be
    convex: half-spaces hold it all the same, and nothing is said between its points.

    Attributes
    ----------
    scene_name, surface, method : str
        What was asked about.
    loads : mapping of str to Load
        The live loads by name; load factors stand in their order.
    units : (k,) array
        Natural size of each load factor: the dead load over the live load.
    supports : tuple of Support
        What every solve has shown, and every mirror image of one, with its solution.
    status : Status
        Certified where the gap is within the tolerance in all directions.
    tolerance : float
    is_convex : bool
        False where nothing holds between points.
    solves : int
        Solver runs.
    seconds : float
    about : str
        A digest of all that decides about the set, by which a file is continued.
    scene_digest : str
        That of the scene, :func:`~cvxlimit.io.scene_digest`; empty in files of earlier versions.
    versions : mapping of distribution to version
        cvxlimit's; empty in files of earlier versions.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.studies import load_domain
    >>> domain = load_domain(builtin_scene("single-block"), progress=False)
    >>> str(domain.status), domain.contains((0.39, 0.39)), domain.contains((0.41, 0.0))
    ('certified', 'carried', 'not carried')
    >>> bracket = domain.load_factor((1, 0))
    >>> bracket.lower <= 0.4 <= bracket.upper, bracket.width < 0.01
    (True, True)
    """

    format: ClassVar[str] = "cvxlimit-domain"

    scene_name: str
    surface: str
    method: str
    loads: Mapping[str, Load]
    units: FloatArray
    supports: tuple[Support, ...]
    status: Status
    tolerance: float
    is_convex: bool = True
    solves: int = 0
    seconds: float = 0.0
    about: str = field(default="", repr=False)
    scene_digest: str = field(default="", repr=False)
    versions: Mapping[str, str] = field(default_factory=dict, repr=False)

    @property
    def points(self) -> FloatArray:
        """Load factors (n, k) that are carried."""
        return self._stacked([s.point for s in self.supports if s.point is not None])

    @property
    def rays(self) -> FloatArray:
        """Load factors (m, k) of which any multiple is carried besides."""
        return self._stacked([s.ray for s in self.supports if s.ray is not None])

    @property
    def normals(self) -> FloatArray:
        """Half-spaces normals (h, k) @ p <= offsets (h,) hold all that is carried."""
        return self._stacked([s.normal for s in self._bounding])

    @property
    def offsets(self) -> FloatArray:
        """See :attr:`normals`."""
        return np.array([s.offset for s in self._bounding])

    @cached_property
    def _bounding(self) -> list[Support]:
        """Supports whose half-space holds all: one that rests on an assumption, and that a ray
        leaves by more than solvers' rounding, is refuted by the ray's forces."""
        bounding = [s for s in self.supports if np.isfinite(s.offset)]
        leaves = [
            (self.rays @ s.normal > FLAT * np.abs(self.rays) @ np.abs(s.normal)).any()
            for s in bounding
        ]
        return [
            s for s, leaves in zip(bounding, leaves, strict=True)
            if s.half_space_is_proved or not leaves
        ]  # fmt: skip

    def _stacked(self, rows: Sequence[FloatArray]) -> FloatArray:
        return np.array(rows, dtype=float).reshape(-1, len(self.units))

    @cached_property
    def outer(self) -> Outer:
        """The half-spaces, in natural units of the load factors."""
        normals = self.normals * self.units
        size = np.linalg.norm(normals, axis=1)
        size = np.where(size > 0.0, size, 1.0)
        return Outer(normals / size[:, None], self.offsets / size)

    @cached_property
    def inner(self) -> Inner | None:
        """The hull of all points, in natural units; None without any."""
        points, rays = self.points / self.units, self.rays / self.units
        if not len(points) or not self.is_convex:
            return None
        return Inner.of(points, rays / (np.linalg.norm(rays, axis=1)[:, None]), WINDOW)

    @property
    def is_empty(self) -> bool:
        """True if the dead load cannot stand with any load factors, by proof."""
        return bool((~self.normals.any(axis=1) & (self.offsets < 0.0)).any())

    @property
    def is_proved(self) -> bool:
        """True if no bound needs an assumption."""
        points = (s.point_is_proved for s in self.supports if s.point is not None)
        return all(points) and all(s.half_space_is_proved for s in self._bounding)

    @cached_property
    def centre(self) -> FloatArray:
        """The place from where gaps are measured, in natural units: zero where it is inside, else a
        mean."""
        zero = np.zeros(len(self.units))
        if self.inner is None or self.inner.margin(zero) > ZERO:
            return zero
        points = self.inner.points
        return np.asarray(points.mean(axis=0) if len(points) > 1 else points[0])

    def gaps(self) -> tuple[FloatArray, FloatArray]:
        """Corners (n, k) of what half-spaces leave, in natural units, and the gap (n,) at each.

        On the ray from the centre to a corner, what is open over what is not ruled out. No other
        direction has a larger gap: the least multiple of the hull that holds a point is convex, and
        so is largest at a corner.
        """
        inner, centre = self.inner, self.centre
        if inner is None:
            return np.zeros((0, len(self.units))), np.zeros(0)
        window = np.full(len(centre), WINDOW)
        corners = self.outer.within(-window, window).corners(inner, centre)
        size = np.linalg.norm(corners - centre, axis=1)
        corners = corners[size > ZERO]
        room = inner.offsets - inner.normals @ centre
        speed = (corners - centre) @ inner.normals.T
        share = np.min(room / np.maximum(speed, 1e-300), axis=1, initial=1.0)
        return corners, 1.0 - share

    @cached_property
    def worst(self) -> tuple[float, FloatArray]:
        """The largest relative gap of any direction, and that direction in load factors."""
        corners, gaps = self.gaps()
        if self.is_empty:
            return 0.0, np.zeros(len(self.units))
        if not self.is_convex or self.inner is None:
            return np.inf, np.zeros(len(self.units))
        if not len(gaps):
            return 0.0, np.zeros(len(self.units))
        at = int(gaps.argmax())
        gap = float(gaps[at])  # where nothing is known to be carried on the way, it is beyond one
        return gap if gap <= 1.0 else np.inf, (corners[at] - self.centre) * self.units

    @property
    def gap(self) -> float:
        """The largest relative gap of any direction, 1 at most; infinite where nothing holds
        between points, or where too little is known yet.

        Measured from zero, or from inside the set where zero is not; loads beyond a hundred times
        their natural size are left out.
        """
        return self.worst[0]

    @property
    def gap_said(self) -> str:
        """The gap in words: ``"0.93 %"``, or ``"unbounded"``."""
        if not np.isfinite(self.gap):
            return "unbounded"
        return f"{100.0 * self.gap:.0f} %" if self.gap >= 0.1 else f"{100.0 * self.gap:.2g} %"

    def load_factor(self, direction: ArrayLike) -> Bracket:
        """Bounds on the largest t for which t times ``direction`` is carried; nothing is solved.

        The lower bound is -inf where no multiple is known to be carried, the upper bound inf
        where none is ruled out, and -inf where all are.

        Raises
        ------
        InputError
            If ``direction`` is not as many finite numbers as there are loads, or zero.
        """
        given = self._vector(direction, "direction")
        if not given.any():
            raise InputError(f"direction must not be zero, got {given.tolist()}")
        along, zero = given / self.units, np.zeros(len(given))
        least_kept, upper = self.outer.reach(zero, along)
        if self.is_empty or least_kept > upper:  # the whole line is ruled out
            upper = -np.inf
        low, high = self._along(along) if self.inner is None else self.inner.reach(zero, along)
        lower = min(high, upper) if low <= high else -np.inf  # where both meet but for rounding
        least = ZERO / float(np.abs(along).max())
        return Bracket(lower, upper, self.is_proved, self.is_proved, least)

    def _along(self, along: FloatArray) -> tuple[float, float]:
        """Multiples of a direction among the points, where nothing holds between them."""
        points = self.points / self.units
        times = points @ along / (along @ along)
        off = np.abs(points - times[:, None] * along).max(axis=1, initial=0.0)
        on = times[off <= 1e-9 * np.abs(points).max(initial=1.0)]
        return (float(on.min()), float(on.max())) if len(on) else (np.inf, -np.inf)

    def contains(self, point: ArrayLike) -> Answer:
        """``"carried"``, ``"not carried"``, or ``"open"`` where neither is proved.

        Raises
        ------
        InputError
            If ``point`` is not as many finite numbers as there are loads.
        """
        at = self._vector(point, "point") / self.units
        if self.is_empty or self.outer.excludes(at):
            return "not carried"
        if self.inner is None:
            return "carried" if (self.points == np.asarray(point)).all(axis=1).any() else "open"
        return "carried" if self.inner.holds(at) else "open"

    def _vector(self, value: ArrayLike, what: str) -> FloatArray:
        return np.asarray(finite_vector(value, len(self.units), f"{what} of the load domain"))

    @cached_property
    def frame(self) -> FloatArray:
        """What a picture shows (2, k): all points; of a set without end three times the part that
        has one, and what it holds so far."""
        far = 0.5 * WINDOW if len(self.rays) else WINDOW  # in between it is hardly more than a ray
        points = self.points / self.units
        near = np.vstack([points[np.abs(points).max(axis=1) < far], self.centre])
        inner = self.inner
        if inner is not None and len(self.rays):
            about = np.zeros(len(self.units))
            if not inner.holds(about):
                about = points[np.linalg.norm(points, axis=1).argmin()]
            ends = [
                inner.reach(about, way)[1] for way in (*np.eye(len(about)), *-np.eye(len(about)))
            ]
            size = max([end for end in ends if end < far] + [float(np.abs(about).max())]) or 1.0
            near = np.vstack([self._cut(about - 3.0 * size, about + 3.0 * size)[0], about])
        low, high = near.min(axis=0), near.max(axis=0)
        size = high - low
        spare = np.where(size > ZERO, 0.12 * size, 0.5 * size.max() or 0.5)
        return np.stack([low - spare, high + spare]) * self.units

    def shapes(self, frame: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What to draw: corners (n, k) of the hull and (m, k) of what half-spaces leave, where both
        are cut off at ``frame`` (2, k), in the plane in order; none of a hull where nothing holds
        between points.
        """
        inside, outside = self._cut(*(frame / self.units))
        return inside * self.units, outside * self.units

    def _cut(self, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same in natural units."""
        inner, outer = self.inner, self.outer
        none = np.zeros((0, len(low)))
        if len(low) == 2:
            inside = none if inner is None else ring(inner.normals, inner.offsets, low, high, inner)
            return inside, ring(outer.normals, outer.offsets, low, high)
        low, high = np.minimum(low, self.centre - ZERO), np.maximum(high, self.centre + ZERO)
        plane = inner or Inner.of(np.vstack([self.centre, np.eye(len(low))]), none, WINDOW)
        outside = outer.within(low, high).corners(plane, self.centre)
        if inner is not None:
            none = Outer(inner.normals, inner.offsets).within(low, high).corners(inner, self.centre)
        return none, outside

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the loads, in their order."""
        return tuple(self.loads)

    def of(self, scene: Scene) -> LoadDomain:
        """The same with the scene in all its solutions, which files do not keep.

        Raises
        ------
        InputError
            If the solutions do not belong to the scene.
        """
        loads, made = list(self.loads.values()), []
        for s in self.supports:
            solution = s.solution
            if solution is not None and s.loaded is not None:
                solution = solution.of(scene.with_live(combined(loads, s.loaded)))
            made.append(replace(s, solution=solution))
        return replace(self, supports=tuple(made))

    def to_dataframe(self) -> DataFrame:
        """A row per support: its direction, point or ray, half-space, and what they rest on.

        Raises
        ------
        ModelError
            If pandas is not installed.
        """
        pandas = needed("pandas", "frames", "tables")
        plain = ("offset", "point_is_proved", "half_space_is_proved", "is_mirrored")
        rows, none = [], np.full(len(self.names), np.nan)
        for s in self.supports:
            row = dict[str, Any]()
            for what in ("direction", "point", "ray", "normal"):
                vector = getattr(s, what)
                numbers = zip(self.names, none if vector is None else vector, strict=True)
                row |= {f"{what} {name}": x for name, x in numbers}
            row |= {what: getattr(s, what) for what in plain}
            rows.append(row | {"solver": s.solution.history[-1].solver if s.solution else ""})
        table: DataFrame = pandas.DataFrame(rows)
        table.attrs = {"scene": self.scene_name, "surface": self.surface, "gap": self.gap}
        return table

    def plot(self, path: str | None = None, **options: Any) -> Figure | Page | Any:
        """Draw it: in the plane a figure, of three loads a page to turn; with ``path``, a file.

        ``ax``, ``figsize``, ``title`` and ``legend`` of a figure are those of
        :func:`cvxlimit.plotting.picture`; with the first or the second, three loads make one too.

        Raises
        ------
        InputError
            For a suffix that does not go with it.
        ModelError
            If Matplotlib is not installed.
        """
        from cvxlimit.extensions.studies.domains.pictures import draw_domain

        return draw_domain(self, path, **options)

    def _repr_html_(self) -> str:
        from cvxlimit.extensions.studies.domains.pictures import domain_html

        return domain_html(self)

    def __repr__(self) -> str:
        return f"LoadDomain({self.summary})"

    @property
    def summary(self) -> str:
        """One line: what of, how close, from how many solves."""
        gap = f"gap {self.gap_said}" if self.is_convex else "points one by one"
        return (
            f"{self.scene_name!r} under {', '.join(self.names)}, {self.surface}: {gap}, "
            f"{len(self.points)} points, {len(self.offsets)} half-spaces, "
            f"{self.solves} solves, {self.status}"
        )

    def extent(self) -> dict[str, str]:
        """Bounds on the largest and least load factor of each load alone, as texts."""
        ways = zip(np.eye(len(self.names)), self.names, strict=True)
        return {
            f"{'-' * (sign < 0)}{name}": self.load_factor(sign * way).shown(5)
            for way, name in ways
            for sign in (1.0, -1.0)
        }
