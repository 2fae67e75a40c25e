"""Vehicles that cross a bridge: the load factor at every position, and the worst of them."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.checks import not_negative, positive
from cvxlimit.base.extras import needed
from cvxlimit.base.progressbar import Progress, progress_bar
from cvxlimit.errors import InputError
from cvxlimit.methods.solving import solve
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.plotting.look import saved
from cvxlimit.plotting.registry import figures
from cvxlimit.plotting.style import Style
from cvxlimit.scene import Scene, Units
from cvxlimit.scene.loads import Load, PointForce
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import rounded
from cvxlimit.surroundings.roads import BOUSSINESQ, Road

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True)
class Vehicle:
    """Axles on a road, by their distance behind the first one.

    Attributes
    ----------
    axles : sequence of (distance, force)
    length : float
        Of the patch that each axle loads on the road, along it.
    spread : float or "boussinesq"
        As for :meth:`cvxlimit.Road.load`.

    Raises
    ------
    InputError
        For no axle, and numbers that are no distances or forces.

    Example
    -------
    >>> Vehicle([(0.0, 60.0), (3.2, 115.0)]).force
    175.0
    """

    axles: Sequence[tuple[float, float]]
    length: float = 0.3
    spread: float | str = 0.5

    def __post_init__(self) -> None:
        own = [tuple(axle) for axle in self.axles]
        if not own or any(len(axle) != 2 for axle in own):
            raise InputError(
                f"axles of a vehicle must be (distance, force), at least one, got "
                f"{self.axles!r:.60}"
            )
        checked = [
            (not_negative(d, "distance of an axle"), positive(f, "force of an axle"))
            for d, f in own
        ]
        object.__setattr__(self, "axles", tuple(checked))
        positive(self.length, "length of an axle's patch")
        if self.spread != BOUSSINESQ:
            not_negative(self.spread, "spread of a vehicle")

    @property
    def force(self) -> float:
        """Of all axles."""
        return float(sum(force for _, force in self.axles))

    def placed(self, at: float, is_forward: bool = True) -> tuple[tuple[float, float], ...]:
        """Place and force of every axle, along the road, if the first one stands ``at``."""
        sign = 1.0 if is_forward else -1.0
        return tuple(sorted((at - sign * behind, force) for behind, force in self.axles))


@dataclass(frozen=True, eq=False)
class Crossing:
    """The answer at one position: ``at`` of the first axle, ``is_forward`` for the way along the
    axis, the force ``lost`` beside the blocks, and the solution, None where all of it is lost."""

    at: float
    is_forward: bool
    lost: float
    solution: Solution | None

    @property
    def load_factor(self) -> float:
        """Infinite where any multiple of the vehicle is carried, with dilatancy at least, as the
        status says; NaN where there is no answer."""
        found = self.solution
        without_limit = (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED)
        if found is None or found.status in without_limit:
            return float("inf")
        return float("nan") if found.load_factor is None else found.load_factor

    @property
    def bounds(self) -> tuple[float, float]:
        """Infinite where any multiple of the vehicle is carried, as the load factor."""
        if self.solution is None or np.isinf(self.load_factor):
            return float("inf"), float("inf")
        return self.solution.lower, self.solution.upper

    @property
    def status(self) -> str:
        """As of the solution."""
        return "not on the bridge" if self.solution is None else str(self.solution.status)


@dataclass(frozen=True, eq=False)
class Envelope:
    """What :func:`envelope` found at all positions.

    Attributes
    ----------
    scene_name : str
    vehicle : Vehicle
    units : Units
    crossings : tuple of Crossing
        Forward ones first, in the order of the positions.
    road : Road
    """

    scene_name: str
    vehicle: Vehicle
    units: Units
    crossings: tuple[Crossing, ...]
    road: Road

    @property
    def worst(self) -> Crossing:
        """The position with the least load factor.

        Raises
        ------
        InputError
            If no position has an answer.
        """
        known = [each for each in self.crossings if not np.isnan(each.load_factor)]
        if not known:
            raise InputError(
                f"no position on {self.scene_name!r} has an answer: the first says "
                f"{self.crossings[0].status}"
            )
        return min(known, key=lambda each: each.load_factor)

    def __str__(self) -> str:
        worst, length = self.worst, self.units.length
        way = "forward" if worst.is_forward else "backward"
        open_ones = sum(np.isnan(each.load_factor) for each in self.crossings)
        if np.isinf(worst.load_factor):
            first = f"{self.scene_name}: any multiple of the vehicle is carried at all positions"
        else:
            first = (
                f"{self.scene_name}: least load factor {rounded(worst.load_factor)} of "
                f"{self.vehicle.force:g} {self.units.force}, {worst.status}, first axle at "
                f"{worst.at:g} {length}, {way}"
            )
        rest = f"{len(self.crossings)} positions"
        rest += f", {open_ones} of them without an answer" if open_ones else ""
        return f"{first}\n{rest}"

    @cached_property
    def without_reactions(self) -> Solution | None:
        """The answer at the worst position if nothing resists but the structure, as for K = 0; None
        if there are no reactions."""
        worst = self.worst.solution
        if worst is None or not worst.scene.reactions:
            return None
        return solve(replace(worst.scene, reactions=()), worst.surfaces)

    def told(self) -> Iterator[tuple[str, str]]:
        """Yields what somebody needs who computes the worst position again, a name and a text."""
        force, length = self.units.force, self.units.length
        axles = (f"{size:g} {force} at {behind:g} {length}" for behind, size in self.vehicle.axles)
        yield "axles, behind the first", ", ".join(axles)
        spread = self.vehicle.spread
        how = "as Boussinesq has it, cut off at 30 degrees"
        if spread != BOUSSINESQ:
            how = f"growing by {spread:g} of the depth on either side"
        yield "each on the road", f"{self.vehicle.length:g} {length} along it; in the fill {how}"
        road = self.road
        yield (
            "road",
            (
                f"level {road.level:g} {length}, along {np.array(road.along).tolist()}, on a width "
                f"of {road.width:.6g} {length}, with {road.cover:.6g} {length} of fill at least"
            ),
        )
        at = [each.at for each in self.crossings]
        ways = "both ways" if any(not each.is_forward for each in self.crossings) else "one way"
        tried = f"{len(set(at))} places of the first axle from {min(at):g} to {max(at):g} {length}"
        yield "positions", f"{tried}, {ways}; between them nothing is proved"
        worst = self.worst
        way = "forward" if worst.is_forward else "backward"
        yield (
            "worst place",
            f"first axle at {worst.at:g} {length}, {way}: {'; '.join(self._there())}",
        )
        yield "lost there", f"{worst.lost:.6g} {force} on abutments and ground, not on the arch"
        if (bare := self.without_reactions) is not None:
            text = bare.standing if bare.load_factor is None else rounded(bare.load_factor)
            if bare.bracket.has_both:
                text += f", between {bare.lower:.6g} and {bare.upper:.6g}"
            yield "there without reactions (K = 0)", text

    def _there(self) -> Iterator[str]:
        """Yields for each axle at the worst place where it is and what of it the bridge gets."""
        force, length, worst = self.units.force, self.units.length, self.worst
        for at, size in self.vehicle.placed(worst.at, worst.is_forward):
            text = f"{size:g} {force} at {at:g} {length}"
            reached = size - _loads(self.road, self.vehicle, [(at, size)])[1]
            if not reached > 1e-9 * size:
                yield f"{text} beside the bridge"
                continue
            depth = f"{self.road.depth(at):.4g} {length} of fill"
            yield f"{text}, {reached:.6g} {force} of it on the bridge through {depth}"

    def _repr_html_(self) -> str:
        return f"<pre>{self}</pre>"

    def to_dataframe(self) -> DataFrame:
        """A row for each position: ``at``, ``way`` (1 forward, -1 backward), ``load_factor``, which
        is infinite where any multiple is carried, ``lower``, ``upper``, ``status``, ``lost``."""
        pandas = needed("pandas", "frames", "tables")
        names = ["at", "way", "load_factor", "lower", "upper", "status", "lost"]
        rows = [
            (c.at, 1 if c.is_forward else -1, c.load_factor, *c.bounds, c.status, c.lost)
            for c in self.crossings
        ]
        table: DataFrame = pandas.DataFrame(rows, columns=names)
        table.attrs = {"units": {"at": self.units.length, "lost": self.units.force}}
        return table

    def plot(self, file: str | os.PathLike[str] | None = None, **options: Any) -> Any:
        """A chart of load factors over positions, with brackets; the figure, or the file's path.

        ``options`` are those of all charts: ``figsize`` in inches, ``title``, ``ax``, ``legend``.
        """
        chart = figures("sheet").Sheet.of((6.4, 3.8), **options)
        for way, colour in (("forward", Style.blue), ("back", Style.brown)):
            own = [c for c in self.crossings if c.is_forward is (way == "forward")]
            if own:
                at, factors = np.array([(c.at, c.load_factor) for c in own]).T
                shown = np.where(np.isfinite(factors), factors, np.nan)
                label = f"{way}: load factor"
                chart.axes.plot(at, shown, ".-", color=colour, lw=1.2, ms=4, label=label)
        worst = self.worst
        if np.isfinite(worst.load_factor):
            label = f"least: {rounded(worst.load_factor, 4)}"
            chart.axes.plot([worst.at], [worst.load_factor], "o", mfc="none", mec=Style.red, ms=9,
                            label=label)  # fmt: skip
        chart.axes.set(xlabel=f"first axle at ({self.units.length})", ylabel="load factor")
        chart.axes.set_yscale("log")  # half and twice the least count alike
        for each in (chart.axes.yaxis.set_major_formatter, chart.axes.yaxis.set_minor_formatter):
            each(needed("matplotlib.ticker", "plot", "charts").LogFormatter())
        chart.write(f"{self.scene_name}: a vehicle of {self.vehicle.force:g} {self.units.force}")
        return chart.figure if file is None else saved(chart.figure, file, options)


def envelope(
    scene: Scene,
    vehicle: Vehicle,
    positions: ArrayLike,
    level: float,
    *,
    along: ArrayLike = (1.0, 0.0, 0.0),
    both_ways: bool = True,
    blocks: Collection[str] | None = None,
    progress: Progress = None,
    **options: Any,
) -> Envelope:
    """The load factor of a vehicle at each of some positions, both ways, and the worst.

    What positions share is computed once. Parts of the vehicle that are beside the bridge, or over
    an abutment that is fixed, are lost; each row of :meth:`Envelope.to_dataframe` says how much.

    Parameters
    ----------
    scene : Scene
        Its live load does not matter.
    vehicle : Vehicle
    positions : (n,)
        Places of the first axle along the axis.
    level, along, blocks
        The road's, as for :class:`cvxlimit.Road`.
    both_ways : bool
        Whether the vehicle crosses in the other direction, too.
    progress : bool, callable or None
        True shows a bar on stderr; a function is called with one line of text at every position.
    options
        As for :func:`cvxlimit.solve`: ``surface``, ``tolerance``, ``method`` ...

    Raises
    ------
    InputError
        For a wrong number, or a vehicle that is beside the bridge at all positions.

    Example
    -------
    >>> from cvxlimit.masonry.bridges import Arch, bridge
    >>> scene = bridge(Arch(3.0, 0.75, voussoirs=12), thickness=0.2, width=1.0, cover=0.2)
    >>> found = envelope(scene, Vehicle([(0.0, 10.0)]), [0.5, 0.75, 1.0], 1.15, both_ways=False)
    >>> found.worst.at
    0.75
    """
    every = np.atleast_1d(np.array(positions, dtype=float)).tolist()
    road = Road(scene, level, along, blocks)
    todo = list(product((True, False) if both_ways else (True,), every))
    shared: Assemblage | None = None
    found, by_places = list[Crossing](), dict[Any, tuple[float, Solution | None]]()
    with progress_bar("crossing", len(todo), progress) as advance:
        for is_forward, at in todo:
            # the same forces at the same places are one load, whichever way the vehicle goes
            if (axles := vehicle.placed(at, is_forward)) not in by_places:
                points, lost = _loads(road, vehicle, axles)
                solution = None
                if points:
                    loaded = scene.with_live(Load(points=points))
                    shared = shared or Assemblage.of(loaded)
                    solution = solve(shared.like(loaded), **options)
                by_places[axles] = lost, solution
            found.append(Crossing(at, is_forward, *by_places[axles]))
            advance(f"first axle at {at:g}")
    if all(each.solution is None for each in found):
        raise InputError(
            f"the vehicle is beside {scene.name!r} at all positions: give places of its first axle "
            "over the bridge"
        )
    return Envelope(scene.name, vehicle, scene.units, tuple(found), road)


def _loads(
    road: Road, vehicle: Vehicle, axles: Sequence[tuple[float, float]]
) -> tuple[tuple[PointForce, ...], float]:
    """The forces of all axles, by place and force, and what of them is lost."""
    points, lost = list[PointForce](), 0.0
    for place, force in axles:
        if not road.reaches(place, vehicle.length, vehicle.spread):
            lost += force
            continue
        own = road.load(place, force, vehicle.length, vehicle.spread)
        points += own.points
        lost += own.lost
    return tuple(points), lost
