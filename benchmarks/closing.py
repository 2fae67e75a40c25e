"""``python -m benchmarks.closing``: how far certified brackets close, on seeded families.

Irregular running-bond walls (:func:`cvxlimit.masonry.random_wall`, 14 to 58 contacts, friction 0.2
to 0.9, any load direction), stacks of prisms on polygons of 3 to 8 corners, and of hexagonal drums;
or one built-in scene. Prints a line per scene, and the shares within 5 % and 1 %. The budget is
CPU time, so that a busy machine does not decide. Scenes whose live load does no harm are left out.

Every lower bound is checked again from its forces, and every upper bound is held against a search
for better states: the convex problems at frozen pressure centres about the best forces and
anywhere else.

With ``--default`` scenes are solved as they are without any option, the clock being the
processor's, and judged by 1 % and 5 % of width.

With ``--out FILE`` every scene is a line of JSON in it as soon as it is done, with its bounds over
time; scenes that are there already are not run again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from cvxlimit import Block, Load, Scene, Status, builtin_scene
from cvxlimit.masonry import BUILTIN, random_wall
from cvxlimit.masonry.walls import SIZES
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.driver import Run, Steps, drive
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.restriction.lower_bound import LowerBounds
from cvxlimit.readings.states.pressure import Pressure
from cvxlimit.readings.states.support import half_extent
from cvxlimit.solvers import settings_for

FloatArray = NDArray[np.float64]

console = Console(highlight=False, markup=False, soft_wrap=True)

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
    """Bounds of a run over its CPU time, which ends at a limit.

    Attributes
    ----------
    trace : list of (seconds, lower, upper)
        A line whenever a bound has changed.
    """

    def __init__(self, limit: float) -> None:
        self.start, self.limit = time.process_time(), limit
        self.trace: list[tuple[float, float, float]] = []

    @property
    def spent(self) -> float:
        """CPU seconds of this process since the meter was made."""
        return time.process_time() - self.start

    def read(self, run: Run) -> bool:
        """Note the bounds; True if the time is up."""
        bounds = run.best.bracket.lower, run.best.bracket.upper
        if not self.trace or self.trace[-1][1:] != bounds:
            self.trace.append((self.spent, *bounds))
        return self.spent > self.limit


@dataclass(frozen=True)
class Metered(Certified):
    """The certified method, stopped by a meter."""

    meter: Meter | None = None

    def steps(self, run: Run) -> Steps:
        """As the method has it, or until the time is up."""
        solves = super().steps(run)
        while self.meter is None or not self.meter.read(run):
            try:
                next(solves)
            except StopIteration as end:
                return end.value
            yield
        good = run.best.bracket.is_within(0.05)
        return Status.CERTIFIED if good else Status.NOT_CERTIFIED


def irregular_wall(seed: int) -> Scene:
    """A random wall, of four units by five courses among others."""
    return random_wall(seed, sizes=(*SIZES, (4, 5)))


def prisms(seed: int) -> Scene:
    """One to three prisms on one another on the ground, pushed and twisted in random directions.

    Of 3, 5, 6, 7 or 8 corners on circles of 0.3 to 0.5 m, so that contacts are polygons; each
    stands on the middle of the one below.
    """
    rng = np.random.default_rng(seed)
    return _piled(rng, int(rng.choice([3, 5, 6, 7, 8])), f"prisms-{seed}")


def drums(seed: int) -> Scene:
    """The same with prisms of six corners, as of a column."""
    return _piled(np.random.default_rng(seed), 6, f"drums-{seed}")


def _piled(rng: np.random.Generator, corners: int, name: str) -> Scene:
    level, blocks = 0.0, [Block.box("ground", (-2.0, -2.0, -0.5), (2.0, 2.0, 0.0))]
    for number in range(1, int(rng.integers(1, 4)) + 1):
        angle = 2.0 * np.pi * (np.arange(corners) + rng.uniform(-0.2, 0.2, corners)) / corners
        ring = rng.uniform(0.3, 0.5) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        top = level + rng.uniform(0.2, 0.5)
        points = [(*p, z) for z in (level, top) for p in ring]
        blocks.append(Block.hull(f"b{number}", points, density=20.0))
        level = top
    push = rng.normal(size=3) * (1.0, 1.0, 0.3)
    weight = 20.0 * blocks[-1].volume
    twist = float(rng.uniform(-0.2, 0.2) * weight)
    live = Load(
        acceleration=tuple(push / np.linalg.norm(push)),
        forces={blocks[-1].id: (0.0, 0.0, 0.0, 0.0, 0.0, twist)},
    )
    return Scene(tuple(blocks), ("ground",), live, friction=float(rng.uniform(0.3, 0.9)), name=name)


FAMILIES: dict[str, Callable[[int], Scene]] = {
    "walls": irregular_wall,
    "prisms": prisms,
    "drums": drums,
}


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
        state = problem.solve(run.moments.safe_copies(contacts, centre), settings)
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

    @property
    def has_answer(self) -> bool:
        """False where the live load does no harm."""
        return bool(np.isfinite(self.upper))

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

    def __str__(self) -> str:
        start = f"{self.scene:16} {self.contacts:4} {self.moments:12} "
        if not self.has_answer:
            return start + "does no harm"
        return start + (
            f"[{self.lower:.5f}, {self.upper:.5f}] {100.0 * self.width:7.3f} % "
            f"{self.seconds:6.1f} s CPU, {'proved' if self.is_proved else 'not proved'}, best "
            f"found {self.found:.5f} {'' if self.survives else 'REFUTED'}"
        )


def row(scene: Scene, moments: str, seconds: float, tolerance: float | None, tries: int) -> Row:
    """Solve and check one scene; without a tolerance with default settings."""
    meter = Meter(np.inf if tolerance is None else seconds)
    branching = None if tolerance is None else 1e9
    rule = Metered(tolerance=tolerance, branching_seconds=branching, moments=moments, meter=meter)
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


def stored(file: Path | None) -> list[Row]:
    """Rows of a file of JSON lines, none if there is no such file."""
    if file is None or not file.exists():
        return []
    lines = (json.loads(line) for line in file.read_text().splitlines())
    return [Row(**{**line, "trace": [tuple(t) for t in line["trace"]]}) for line in lines]


def store(file: Path | None, found: Row) -> None:
    """Append a row."""
    if file is not None:
        with file.open("a") as stream:
            stream.write(json.dumps(asdict(found)) + "\n")


def scenes(family: str, count: int, first: int) -> Iterator[Scene]:
    """Scenes of a family from seed ``first`` on, or those built in of this name."""
    if family in BUILTIN:
        yield builtin_scene(family)
        return
    for seed in range(first, first + 4 * count):
        yield FAMILIES[family](seed)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a family, print its table; 1 if any bound is refuted."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.closing", description=__doc__)
    parser.add_argument("--family", default="walls", help="walls, prisms, drums, or a scene")
    parser.add_argument("--scenes", type=int, default=40, help="how many")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--moments", default="independent")
    parser.add_argument("--seconds", type=float, default=60.0, help="of CPU time each")
    parser.add_argument("--tolerance", type=float, default=0.0099, help="where to stop")
    parser.add_argument("--default", action="store_true", help="default settings")
    parser.add_argument("--tries", type=int, default=40, help="of the search for better states")
    parser.add_argument("--out", type=Path, help="file for a line of JSON per scene")
    asked = parser.parse_args(arguments)
    rows: list[Row] = []
    known = {(r.scene, r.moments): r for r in stored(asked.out)}
    for scene in scenes(asked.family, asked.scenes, asked.first):
        found = known.get((scene.name, asked.moments))
        if found is None:
            tolerance = None if asked.default else asked.tolerance
            found = row(scene, asked.moments, asked.seconds, tolerance, asked.tries)
            store(asked.out, found)
        console.print(str(found))
        rows += [found] if found.has_answer else []
        if len(rows) == asked.scenes:
            break
    spent, proved = np.median([r.seconds for r in rows]), np.mean([r.is_proved for r in rows])
    console.print(f"median {spent:.1f} s of CPU, both bounds proved in {proved:.0%}")
    for limit in (0.05, 0.01):
        share = float(np.mean([r.width <= limit for r in rows]))
        console.print(f"{asked.family}, {asked.moments}: {share:.0%} within {limit:.0%}")
    return int(not all(r.survives for r in rows))


if __name__ == "__main__":
    raise SystemExit(main())
