"""``python -m benchmarks.closing``: how far certified brackets close, on two seeded families.

Irregular running-bond walls (:func:`cvxlimit.masonry.random_wall`, 14 to 46 contacts, friction 0.2
to 0.9, any load direction) and stacks of prisms on polygons of 3 to 8 corners. Prints a line per
scene, and the shares within 5 % and 1 %. The budget is CPU time, so that a busy machine does not
decide. Scenes whose live load does no harm are left out.

Every lower bound is checked again from its forces, and every upper bound is held against a search
for better states: the convex problems at thousands of frozen pressure centres about the best
forces and anywhere else.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from cvxlimit import Block, Load, Scene, Solution, Status, builtin_scene
from cvxlimit.masonry import BUILTIN, random_wall
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.driver import Run, drive
from cvxlimit.methods.interaction.climb.lower_bound import LowerBounds
from cvxlimit.methods.interaction.readings.named import parse_moments
from cvxlimit.methods.interaction.relaxation.nodes import NodeProblem
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.methods.interaction.states.support import half_extent
from cvxlimit.solvers import settings_for

FloatArray = NDArray[np.float64]

console = Console(highlight=False, markup=False, soft_wrap=True)

_SPREADS = (1.0, 0.3, 0.1, 0.03)
"""How far from the best pressure centres the search looks, as shares of the half sides."""


@dataclass(frozen=True)
class InCpuTime(Certified):
    """The certified method, stopped after so many CPU seconds of this process."""

    cpu_seconds: float = 60.0

    def start(self, run: Run) -> object:
        """Start its clock too."""
        object.__setattr__(self, "_end", time.process_time() + self.cpu_seconds)
        return super().start(run)

    def is_done(self, run: Run, state: object) -> Status | None:
        """As the method has it, or when the time is up."""
        status = super().is_done(run, state)  # type: ignore[arg-type]
        if status is not None or time.process_time() < self._end:  # type: ignore[attr-defined]
            return status
        good = run.best.bracket.is_within(0.05)
        return Status.CERTIFIED if good else Status.NOT_CERTIFIED


def prisms(seed: int) -> Scene:
    """One to three prisms on one another on the ground, pushed and twisted in random directions.

    Of 3, 5, 6, 7 or 8 corners on circles of 0.3 to 0.5 m, so that contacts are polygons; each
    stands on the middle of the one below.
    """
    rng = np.random.default_rng(seed)
    corners = int(rng.choice([3, 5, 6, 7, 8]))
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
    name = f"prisms-{seed}"
    return Scene(blocks, ("ground",), live, friction=float(rng.uniform(0.3, 0.9)), name=name)


FAMILIES: dict[str, Callable[[int], Scene]] = {"walls": random_wall, "prisms": prisms}


def better(run: Run, tries: int, seed: int = 0) -> float:
    """The largest load factor of admissible states that a random search finds.

    With pressure centres frozen Eq. 30 is one convex problem, whose forces are checked; the search
    begins at the best forces known and moves to what is better.
    """
    rng, contacts = np.random.default_rng(seed), run.contacts
    problem, checker = NodeProblem(run.assemblage), LowerBounds(run.assemblage, run.moments)
    best, forces = run.best.bracket.lower, run.best.forces
    settings = settings_for("CLARABEL", 1e-9)
    for number in range(tries if forces is not None else 0):
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
    """One scene: its bracket before and after branch and bound, and what a search found."""

    solution: Solution
    seconds: float
    is_checked: bool
    found: float

    @property
    def survives(self) -> bool:
        """True if the lower bound passed the checker, and nothing found exceeds the upper one."""
        return self.is_checked and self.found <= self.solution.upper * (1.0 + 1e-9)

    def __str__(self) -> str:
        s = self.solution
        return (
            f"{s.scene:16} {s.contacts:4} {s.moments:12} [{s.lower:.5f}, {s.upper:.5f}] "
            f"{100.0 * s.bracket.width:8.3f} % {self.seconds:6.1f} s CPU, best found "
            f"{self.found:.5f} {'' if self.survives else 'REFUTED'}"
        )


def row(scene: Scene, moments: str, seconds: float, tolerance: float, tries: int) -> Row | None:
    """Solve and check one scene; None if its live load does no harm."""
    start = time.process_time()
    run = Run(scene, moments=parse_moments(moments))
    rule = InCpuTime(tolerance=tolerance, branching_seconds=1e9, cpu_seconds=seconds)
    solution = drive(rule, run)
    spent = time.process_time() - start
    if not solution.status.has_answer:
        return None
    bracket, forces = run.best.bracket, run.best.forces
    checked = LowerBounds(scene, run.moments).of(
        np.zeros((len(run.contacts), 6)) if forces is None else forces,
        run.best.load_factor or bracket.lower,
    )
    is_checked = bool(checked.value >= bracket.lower - 1e-9 * abs(bracket.lower))
    return Row(solution, spent, is_checked, better(run, tries))


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
    parser.add_argument("--family", default="walls", help="walls, prisms or a built-in scene")
    parser.add_argument("--scenes", type=int, default=40, help="how many")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--moments", default="independent")
    parser.add_argument("--seconds", type=float, default=60.0, help="of CPU time each")
    parser.add_argument("--tolerance", type=float, default=2e-3, help="where to stop")
    parser.add_argument("--tries", type=int, default=100, help="of the search for better states")
    asked = parser.parse_args(arguments)
    rows: list[Row] = []
    for scene in scenes(asked.family, asked.scenes, asked.first):
        found = row(scene, asked.moments, asked.seconds, asked.tolerance, asked.tries)
        if found is not None:
            rows.append(found)
            console.print(str(found))
        if len(rows) == asked.scenes:
            break
    widths = np.array([r.solution.bracket.width for r in rows])
    for limit in (0.05, 0.01):
        share = float(np.mean(widths <= limit))
        console.print(f"{asked.family}, {asked.moments}: {share:.0%} within {limit:.0%}")
    return int(not all(r.survives for r in rows))


if __name__ == "__main__":
    raise SystemExit(main())
