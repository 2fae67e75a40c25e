"""What a certified bracket costs, in first conic solves.

Per scene and convention: the bracket, its width, problems solved, and seconds of CPU of the whole
over those of the first conic problem (``solve(scene, model="full")``, certified), measured in the
same run; and after how many of those the bracket was first as narrow as each of some widths. The
first solve is the median of three, the bracket is measured ``--runs`` times.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from time import process_time

from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.scenes import scene_of
from cvxlimit import Scene, solve
from cvxlimit.methods.certified import Certified
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import Bracket

SCENES = ("tuff-wall", "s12-panel", "s10-panel")
WIDTHS = (0.05, 0.03, 0.01, 0.005)


@experiment(Part(3, "--scenes tuff-wall s12-panel s10-panel panel-4914"))
def climb(
    scenes: Sequence[str] = SCENES, moments: Sequence[str] = ("independent", "signed"),
    tolerance: float | None = None, runs: int = 1,
) -> Lines:  # fmt: skip
    """What a certified bracket costs, in first conic solves."""
    yield Head("scene", "contacts", "moments", "bracket", "width", "solves", "CPU s",
               "first solves", *(f"{width:.1%} after" for width in WIDTHS))  # fmt: skip
    for name in scenes:
        scene = scene_of(name)
        first = median(first_solve(scene) for _ in range(3))
        for reading in moments:
            for _ in range(runs):
                yield measured(scene, reading, tolerance, first)


def first_solve(scene: Scene) -> float:
    """Seconds of CPU of the conic problem without interaction."""
    scene.contacts  # noqa: B018 - found once, outside all measurements
    start = process_time()
    solve(scene, model="full")
    return process_time() - start


def measured(
    scene: Scene, moments: str, tolerance: float | None, first: float
) -> tuple[object, ...]:
    """One line: the bracket, what it cost, and when it was how narrow."""
    spent: list[float] = []

    def listen(line: str) -> None:
        if line.startswith("solve "):
            spent.append(process_time() - start)

    start = process_time()
    solution = solve(scene, method=Certified(tolerance=tolerance), moments=moments, progress=listen)
    whole = process_time() - start
    return (
        solution.scene_name, len(scene.contacts), moments, str(solution.bracket),
        f"{solution.bracket.width:.2%}", len(solution.history), f"{whole:.1f}",
        f"{whole / first:.1f}", *(reached(solution, spent, first, width) for width in WIDTHS),
    )  # fmt: skip


def reached(solution: Solution, spent: Sequence[float], first: float, width: float) -> str:
    """After how many first solves the bracket was as narrow as this."""
    for entry, seconds in zip(solution.history, spent, strict=False):
        known = entry.lower is not None and entry.upper is not None
        if known and Bracket(entry.lower, entry.upper).width <= width:
            return f"{seconds / first:.1f}"
    return ""
