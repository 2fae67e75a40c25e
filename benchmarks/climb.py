"""``python -m benchmarks.climb``: what a certified bracket costs, in first conic solves.

Per scene and convention: the bracket, its width, problems solved, and seconds of CPU of the whole
over those of the first conic problem (``solve(scene, model="full")``, certified), measured in the
same run; and after how many of those the bracket was first as narrow as each of some widths. The
first solve is the median of three, the bracket is measured ``--runs`` times.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from statistics import median
from time import process_time

from rich.console import Console

from benchmarks.cases.panel import build as panel_of
from cvxlimit import Scene, builtin_scene, solve
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.certified import Certified
from cvxlimit.readings.named import MOMENTS
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import Bracket

console = Console(highlight=False, soft_wrap=True)

SCENES = ("tuff-wall", "s12-panel", "s10-panel")
WIDTHS = (0.05, 0.03, 0.01, 0.005)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print one line per scene and convention."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.climb", description=__doc__)
    parser.add_argument(
        "scenes", nargs="*", default=SCENES, help="built-in scenes, or contacts of a panel: 5000"
    )
    parser.add_argument("--moments", nargs="+", default=["independent", "signed"])
    parser.add_argument("--tolerance", type=float, help="stop at this width of the bracket")
    parser.add_argument("--runs", type=int, default=1)
    options = parser.parse_args(arguments)
    unknown = [name for name in options.scenes if name not in BUILTIN and not name.isdigit()]
    unknown += [name for name in options.moments if name not in MOMENTS]
    if unknown:
        parser.error(f"there is no scene or convention {unknown[0]!r}")
    for name in options.scenes:
        scene = panel_of(int(name)) if name.isdigit() else builtin_scene(name)
        first = median(first_solve(scene) for _ in range(3))
        for moments in options.moments:
            for _ in range(options.runs):
                console.print(measured(scene, moments, options.tolerance, first))


def first_solve(scene: Scene) -> float:
    """Seconds of CPU of the conic problem without interaction."""
    scene.contacts  # noqa: B018 - found once, outside all measurements
    start = process_time()
    solve(scene, model="full")
    return process_time() - start


def measured(scene: Scene, moments: str, tolerance: float | None, first: float) -> str:
    """One line: the bracket, what it cost, and when it was how narrow."""
    spent: list[float] = []

    def listen(line: str) -> None:
        if line.startswith("solve "):
            spent.append(process_time() - start)

    start = process_time()
    solution = solve(scene, method=Certified(tolerance=tolerance), moments=moments, progress=listen)
    whole = process_time() - start
    return (
        f"{solution.scene}, {len(scene.contacts)} contacts, {moments}: "
        f"[{solution.lower:.6g}, {solution.upper:.6g}], width {solution.bracket.width:.2%}, "
        f"{len(solution.history)} solves, {whole:.1f} s of CPU, "
        f"{whole / first:.1f} first solves of {first:.2f} s{reached(solution, spent, first)}"
    )


def reached(solution: Solution, spent: Sequence[float], first: float) -> str:
    """After how many first solves the bracket was within each of :data:`WIDTHS`."""
    found = ""
    for width in WIDTHS:
        for entry, seconds in zip(solution.history, spent, strict=False):
            known = entry.lower is not None and entry.upper is not None
            if known and Bracket(entry.lower, entry.upper).width <= width:
                found += f"; {width:.1%} after {seconds / first:.1f}"
                break
    return found


if __name__ == "__main__":
    main()
