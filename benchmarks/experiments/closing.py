"""How far certified brackets close, on seeded families.

Irregular running-bond walls (:func:`cvxlimit.masonry.random_wall`, 14 to 58 contacts, friction 0.2
to 0.9, any load direction), stacks of prisms on polygons of 3 to 8 corners, and of hexagonal drums.
The budget is CPU time, so that a busy machine does not decide. Scenes whose live load does no harm
are left out.

Every lower bound is checked again from its forces, and every upper bound is held against a search
for better states: the convex problems at frozen pressure centres about the best forces and
anywhere else. Every scene is a row of a file as soon as it is done, with its bounds over time.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks.charts import figure_of, save
from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.rows import Measured
from benchmarks.scenes import drums, irregular_wall, prisms
from cvxlimit import Scene
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem
from cvxlimit.extensions.interaction.restriction.lower_bound import LowerBounds
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.methods.driver import Run, Steps, drive
from cvxlimit.readings.pressure import Pressure, half_extent
from cvxlimit.solvers import settings_for

FloatArray = NDArray[np.float64]

_SPREADS = (1.0, 0.3, 0.1, 0.03)
"""How far from the best pressure centres the search looks, as shares of the half sides."""


class CpuClock:
    """CPU seconds of this process, read every half millisecond only: to read them may take longer
    than much of what is to be timed."""

    def __init__(self) -> None:
        self.own, self.read, self.at = time.perf_counter, -np.inf, 0.0

    def __call__(self) -> float:
        """Seconds since the process began."""
        if (now := self.own()) - self.read > 5e-4:
            self.read, self.at = now, time.process_time()
        return self.at


class Meter:
    """Bounds of a run over its CPU time.

    Attributes
    ----------
    trace : list of (seconds, lower, upper)
        A line whenever a bound has changed.
    """

    def __init__(self) -> None:
        self.start = time.process_time()
        self.trace: list[tuple[float, float, float]] = []

    @property
    def spent(self) -> float:
        """CPU seconds of this process since the meter was made."""
        return time.process_time() - self.start

    def read(self, run: Run) -> None:
        """Note the bounds."""
        bounds = run.best.bracket.lower, run.best.bracket.upper
        if not self.trace or self.trace[-1][1:] != bounds:
            self.trace.append((self.spent, *bounds))


@dataclass(frozen=True)
class Metered(Certified):
    """The certified method, read by a meter after every solve."""

    meter: Meter | None = None

    def steps(self, run: Run) -> Steps:
        """As the method has it."""
        solves = super().steps(run)
        while True:
            if self.meter is not None:
                self.meter.read(run)
            try:
                next(solves)
            except StopIteration as end:
                return end.value
            yield


FAMILIES = {"walls": irregular_wall, "prisms": prisms, "drums": drums}

NUMBERS = {"walls": 60, "prisms": 20, "drums": 20}
"""Scenes of each family, from a first seed on at which no setting was chosen."""

ROWS = Path("docs/evidence/closing.jsonl")

COLOURS = {"independent": "#0072b2", "signed": "#d55e00"}
"""Wong's, told apart by colour-blind readers too."""

NAMES = {"independent": "independent signs", "signed": "signed moments"}

MOMENTS_AFTER = (1.0, 5.0, 20.0)
"""CPU seconds at which shares are told."""


@experiment(Part(10, "--picture docs/evidence/closing.png"))
def closing(
    families: Sequence[str] = tuple(FAMILIES), number: int = 0, first: int = 90_000,
    moments: Sequence[str] = tuple(COLOURS), tries: int = 40, out: Path = ROWS,
    picture: Path | None = None, kept: Path | None = None,
) -> Lines:  # fmt: skip
    """How far certified brackets close by default settings, on so many seeds of families from a
    first one on."""
    made = Measured(kept or out, "scene", "moments", kept=kept is not None)
    if kept is not None:
        yield made.said()
    for family in families if kept is None else ():
        for reading in moments:
            count = number or NUMBERS[family]
            for scene in map(FAMILIES[family], range(first, first + 4 * count)):
                if {"scene": scene.name, "moments": reading} not in made:
                    made.add(asdict(measured(scene, reading, tries)))
                found = Row.of(made.get({"scene": scene.name, "moments": reading}) or {})
                count -= found.has_answer
                if not count:
                    break
    rows = [row for row in map(Row.of, made) if row.has_answer]
    yield Title("shares")
    yield from shares(rows)
    if picture is not None:
        save(drawn([row for row in rows if row.family == "walls"]), picture)
    refuted = [f"{row.scene}, {row.moments}" for row in rows if not row.survives]
    if refuted:
        raise SystemExit(f"refuted: {'; '.join(refuted)}")


def better(run: Run, tries: int, seed: int = 0) -> float:
    """The largest load factor of admissible states that a random search finds.

    With pressure centres frozen Eq. 30 is one convex problem, whose forces are checked; the search
    begins at the best forces known and moves to what is better.
    """
    rng, contacts = np.random.default_rng(seed), run.contacts
    problem, checker = HullProblem(run.assemblage), LowerBounds(run.assemblage, run.moments)
    best, forces = run.best.bracket.lower, run.best.forces
    settings = settings_for("CLARABEL", 1e-9)
    for number in range(tries):
        if forces is None:
            break
        at = Pressure.of(forces, contacts)
        centre = np.stack([at.e1, at.e2], axis=1) / half_extent(contacts)
        moved = rng.random(len(contacts)) < rng.choice([0.1, 0.3, 1.0])
        step = _SPREADS[number % len(_SPREADS)] * rng.uniform(-1.0, 1.0, centre.shape)
        centre = np.clip(centre + step * moved[:, None], -1.0, 1.0)
        state = problem.solve(states_of(run.moments).safe_disjuncts(contacts, centre), settings)
        if state.forces is None or state.load_factor is None or state.load_factor <= best:
            continue
        bound = checker.of(state.forces, state.load_factor)
        if bound.value > best:
            best, forces = bound.value, bound.forces
    return best


@dataclass(frozen=True)
class Row:
    """One scene: its bracket over time, what a search found, and the checker's word.

    Without an answer (a live load that does no harm) bounds are NaN.
    """

    scene: str
    moments: str
    contacts: int
    friction: float
    lower: float
    upper: float
    is_proved: bool
    is_checked: bool
    found: float
    seconds: float
    trace: list[tuple[float, float, float]]
    note: str

    @classmethod
    def of(cls, stored: dict[str, object]) -> Row:
        """From a row of the file, which has no NaN."""
        return cls(**{k: np.nan if v is None else v for k, v in stored.items()})  # type: ignore[arg-type]

    @property
    def has_answer(self) -> bool:
        """False where the live load does no harm."""
        return bool(np.isfinite(self.upper))

    @property
    def family(self) -> str:
        """Of the scene, by its name."""
        kind = self.scene.rsplit("-", 1)[0]
        return {"random-wall": "walls"}.get(kind, kind)

    @property
    def width(self) -> float:
        """Of the bracket, relative to its upper end."""
        return (self.upper - self.lower) / self.upper

    @property
    def survives(self) -> bool:
        """True if the lower bound passed the checker, and nothing found exceeds the upper one."""
        return self.is_checked and self.found <= self.upper * (1.0 + 1e-9)

    def width_at(self, seconds: float) -> float:
        """Of the bracket after so many CPU seconds; infinite while there was none."""
        known = [line for line in self.trace if line[0] <= seconds]
        if not known or not np.isfinite(known[-1][1]):
            return np.inf
        _, lower, upper = known[-1]
        return (upper - lower) / upper


def measured(scene: Scene, moments: str, tries: int) -> Row:
    """Solve and check one scene."""
    meter = Meter()
    rule = Metered(moments=moments, meter=meter)
    with patch("time.perf_counter", CpuClock()):
        run = Run(scene)
        solution = drive(rule, run)
    spent = meter.spent
    known = scene.name, moments, len(run.contacts), float(run.contacts.friction.max())
    if not solution.status.has_answer:
        return Row(*known, np.nan, np.nan, False, False, np.nan, spent, [], solution.note)
    meter.read(run)
    trace = thinned(meter.trace)
    bracket, forces = run.best.bracket, run.best.forces
    checked = LowerBounds(scene, run.moments).checked(
        np.zeros((len(run.contacts), 6)) if forces is None else forces,
        run.best.load_factor or bracket.lower,
    )
    is_checked = bool(checked.value >= bracket.lower - 1e-9 * abs(bracket.lower))
    return Row(
        *known, bracket.lower, bracket.upper, bracket.is_proved, is_checked, better(run, tries),
        spent, trace, solution.note,
    )  # fmt: skip


def thinned(trace: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Lines of a trace where the gap fell by 2 % since the last one kept, and the last."""
    kept: list[tuple[float, float, float]] = []
    for line in trace:
        if not kept or line is trace[-1] or line[2] - line[1] < 0.98 * (kept[-1][2] - kept[-1][1]):
            kept.append((round(line[0], 3), line[1], line[2]))
    return kept


def shares(rows: Sequence[Row]) -> Lines:
    """The table of families."""
    yield Head("scenes", "moments", "number", "contacts",
               *(f"after {t:g} s" for t in MOMENTS_AFTER), "at the end within 5 %", "within 1 %",
               "both bounds proved", "CPU s, median")  # fmt: skip
    for kind in dict.fromkeys(r.family for r in rows):
        for moments in COLOURS:
            group = [r for r in rows if r.family == kind and r.moments == moments]
            if not group:
                continue
            widths = np.array([r.width for r in group])
            counts, seconds = [r.contacts for r in group], [r.seconds for r in group]
            yield (
                kind, moments, len(group), f"{min(counts)} to {max(counts)}",
                *(f"{np.mean([r.width_at(t) <= 0.01 for r in group]):.0%}" for t in MOMENTS_AFTER),
                f"{np.mean(widths <= 0.05):.1%}", f"{np.mean(widths <= 0.01):.1%}",
                sum(r.is_proved for r in group), f"{np.median(seconds):.1f}",
            )  # fmt: skip


def drawn(rows: Sequence[Row]) -> Figure:
    """Width against time, a line per wall, and how many walls were within a width when."""
    figure = figure_of(6.6)
    axes = figure.subplots(2, 2, sharey="row")
    for column, (moments, colour) in enumerate(COLOURS.items()):
        group = [r for r in rows if r.moments == moments]
        _draw_lines(axes[0, column], group, colour)
        axes[0, column].set_title(
            f"{len(group)} irregular walls, {NAMES[moments]}", loc="left", fontsize=10
        )
        _draw_shares(axes[1, column], group)
    axes[0, 0].set_ylabel("width of the bracket (%)")
    axes[1, 0].set_ylabel("walls within that width (%)")
    return figure


def _draw_lines(axes: Axes, rows: Sequence[Row], colour: str) -> None:
    for row in rows:
        lines = [t for t in row.trace if np.isfinite(t[1]) and t[2] > 0.0]
        times = [max(t[0], 0.05) for t in lines] + [row.seconds]
        widths = [max(100.0 * (t[2] - t[1]) / t[2], 0.02) for t in lines]
        axes.step(times, [*widths, widths[-1]], where="post", color=colour, alpha=0.45, lw=1.1)
        axes.plot(times[-1], widths[-1], "o", color=colour, ms=3.5)
    for limit in (1.0, 5.0):
        axes.axhline(limit, color="#222222", lw=0.8, ls="--")
        axes.annotate(f"{limit:g} %", (30.0, limit), (0, 2), textcoords="offset points")
    axes.set(xscale="log", yscale="log", xlim=(0.05, 80.0), ylim=(0.015, 60.0))
    axes.set_xlabel("CPU seconds")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_major_formatter("{x:g}")


def _draw_shares(axes: Axes, rows: Sequence[Row]) -> None:
    for number, seconds in enumerate(MOMENTS_AFTER):
        widths = np.sort([100.0 * r.width_at(seconds) for r in rows])
        share = 100.0 * np.arange(1, len(widths) + 1) / len(widths)
        shade = 0.75 - 0.25 * number
        axes.step(
            np.maximum(widths, 0.02), share, where="post", color=(shade,) * 3,
            label=f"after {seconds:g} s",
        )  # fmt: skip
    axes.set(xscale="log", xlim=(0.015, 60.0), ylim=(0.0, 102.0))
    axes.set_xlabel("width of the bracket (%); 0.02 stands for less")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.legend(loc="lower right", frameon=False, fontsize=9)
