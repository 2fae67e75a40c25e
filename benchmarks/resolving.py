"""``python -m benchmarks.resolving``: what compiling costs where a problem is solved many times.

Per scene, in seconds of CPU of one solve each (medians of three):

- the relaxation with interaction: compiled afresh by CVXPY, or written as arrays;
- a safe step: compiled afresh, as it is at every point;
- the paper's frozen problem: rows that are patched, and CVXPY with its Parameters kept compiled,
  and its first solve, which pays for DPP; up to ``--dpp`` contacts, since its memory grows with
  their square.

Beside it the same with one iteration of the solver: compiling, and its setup.

``python -m benchmarks.resolving --sequences [--before CHECKOUT]``: the paper's fixed point
(``--moments signed independent``), in seconds of CPU: the first eight re-solves, cold and warm, by
tolerance and solver, and whole fixed points beside the first plain solve; medians of five
(``--repeat``). ``--before`` measures whole fixed points and first solves of another checkout beside
them, with the Python of its ``.venv``. ``--out FILE`` keeps all records as JSON lines,
``--picture FILE`` draws time of a re-solve against its error.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich.console import Console

from cvxlimit import Scene, builtin_scene
from cvxlimit.compare.chart import few_ticks
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.driver import Run
from cvxlimit.methods.frozen import FrozenProblem
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.restriction.steps import SafeStep
from cvxlimit.model.problem import LimitProblem
from cvxlimit.plotting.chart import label_lines
from cvxlimit.readings.named import parse_moments
from cvxlimit.readings.states.majorants import Point
from cvxlimit.readings.states.pressure import Pressure
from cvxlimit.solvers import LimitState, SolverSettings, settings_for
from cvxlimit.surfaces import Conic

console = Console(highlight=False, soft_wrap=True)

QUICK, TIGHT, OWN = "QOCO", "CLARABEL", "BLOCKWISE"
"""Solvers of what leads the way, at 1e-6, of frozen problems by CVXPY, at 1e-9, and warm ones."""

CALLED = {QUICK: "QOCO", TIGHT: "Clarabel", OWN: "blockwise"}
COLOURS = ("#134b73", "#4aa3a8", "#c77f00", "#d62246")
LEAST = 1e-12
"""Errors below this are drawn there: a logarithmic axis has no zero."""

Solve = Callable[[SolverSettings], LimitState]

SCENES = ("tuff-wall", "s12-panel", "s10-panel")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print a table of Markdown."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.resolving", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=SCENES, help="built-in scenes")
    add = parser.add_argument
    add("--sequences", action="store_true", help="fixed points instead")
    add("--moments", nargs="+", default=["signed"], help="readings of sequences")
    add("--repeat", type=int, default=5)
    add("--before", help="another checkout, for its whole fixed points")
    add("--out", type=argparse.FileType("w"), help="records as JSON lines")
    add("--picture", type=Path, help="of sequences: time of a re-solve against its error")
    parser.add_argument("--dpp", type=int, default=1000, help="most contacts kept compiled")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.scenes if name not in BUILTIN]
    if unknown:
        parser.error(f"there is no scene {unknown[0]!r}")
    if options.picture is not None and not options.sequences:
        parser.error("--picture draws sequences: give --sequences")
    if options.sequences:
        found = []
        for record in records(options):
            found.append(record)
            console.print(" ".join(f"{key}={value}" for key, value in record.items()))
            if options.out:
                options.out.write(json.dumps(record) + "\n")
        if options.picture is not None:
            FigureCanvasAgg(picture(found)).print_figure(options.picture, dpi=190)
        return
    console.print("| scene | problem | seconds | with one iteration |\n|---|---|---|---|")
    for name in options.scenes:
        for problem, (whole, least) in timed(builtin_scene(name), options.dpp).items():
            console.print(f"| {name} | {problem} | {whole:.3f} | {least:.3f} |")


def records(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """A record per measurement: what, and median seconds of CPU."""
    for name in options.scenes:
        scene = builtin_scene(name)
        for moments in options.moments:
            about = {"scene": name, "moments": moments}
            for record in resolved(scene, moments, options.repeat):
                yield about | record
            yield about | {"what": "whole", **whole(name, moments, sys.executable, ".", options)}
            if options.before is not None:
                python = f"{options.before}/.venv/bin/python"
                found = whole(name, moments, python, options.before, options)
                yield about | {"what": "whole, before", **found}


def picture(records: Sequence[dict[str, Any]]) -> Figure:
    """Seconds of a re-solve against the error of its load factor: a plot for every scene and
    reading, a line for every solver, cold or warm, from the loosest tolerance to the tightest."""
    groups: dict[tuple[str, str], dict[str, list[tuple[float, float]]]] = {}
    for record in records:
        if record["what"] == "re-solve" and record["error"] is not None:
            lines = groups.setdefault((record["scene"], record["moments"]), {})
            name = f"{CALLED[record['solver']]}, {record['start']}"
            point = record["seconds"], max(record["error"], LEAST)
            lines.setdefault(name, []).append(point)
    figure = Figure(figsize=(7.7, 0.5 + 2.8 * max(len(groups), 1)), layout="constrained")
    plots = figure.subplots(max(len(groups), 1), 1, squeeze=False)[:, 0]
    for axes, ((scene, moments), lines) in zip(plots, groups.items(), strict=False):
        for (name, points), colour in zip(lines.items(), cycle(COLOURS), strict=False):
            axes.plot(*zip(*points, strict=True), "o-", color=colour, ms=5, label=name)
        axes.set(xscale="log", yscale="log", ylabel="error of the load factor")
        axes.set_title(f"{scene}, {moments} moments", fontsize=10, loc="left")
        axes.grid(True, color="#d9d9d9", linewidth=0.6)
        axes.tick_params(labelsize=9)
        few_ticks(axes.xaxis)
        axes.yaxis.label.set_size(9)
    plots[-1].set_xlabel("CPU seconds of a re-solve, at tolerances 1e-4, 1e-6, 1e-8", fontsize=9)
    figure.draw_without_rendering()
    for axes in plots:
        label_lines(axes, 9.0)
    return figure


def resolved(scene: Scene, moments: str, repeat: int) -> Iterator[dict[str, Any]]:
    """Mean seconds of the first eight re-solves, on the path of warm iterates at 1e-4."""
    contacts, reading = scene.contacts, parse_moments(moments)
    path, forces = FrozenProblem(scene, Conic(), reading), np.zeros((len(contacts), 6))
    centres = []
    for i in range(9):
        centres.append(Pressure.of(forces, contacts))
        found = path.solve(centres[-1], settings_for(OWN, 1e-4)).forces
        assert found is not None
        forces = 0.8 * forces + 0.2 * found if i else found
    exact = FrozenProblem(scene, Conic(), reading).solve(centres[-1], settings_for(OWN, 1e-9))
    rungs = [(OWN, t, warm) for t in (1e-4, 1e-6, 1e-8) for warm in (True, False)]
    rungs += [(solver, t, False) for solver in (QUICK, TIGHT) for t in (1e-4, 1e-6, 1e-8)]
    for solver, tolerance, is_warm in rungs:
        seconds = []
        for _ in range(repeat):
            frozen, settings = (
                FrozenProblem(scene, Conic(), reading),
                settings_for(solver, tolerance),
            )
            frozen.solve(centres[0], settings)
            start = process_time()
            for centre in centres[1:]:
                if not is_warm:
                    frozen.problem._kept.clear()
                state = frozen.solve(centre, settings)
            seconds.append((process_time() - start) / (len(centres) - 1))
        factor = state.load_factor
        known = exact.load_factor
        off = None if factor is None or not known else abs(factor / known - 1.0)
        yield {
            "what": "re-solve", "solver": solver, "tolerance": tolerance,
            "start": "warm" if is_warm else "cold", "seconds": round(median(seconds), 5),
            "error": off,
        }  # fmt: skip


_WHOLE = """
import json, sys
from statistics import median
from time import process_time
from cvxlimit import builtin_scene, solve
from cvxlimit.model.problem import LimitProblem
scene, moments, repeat = builtin_scene(sys.argv[1]), sys.argv[2], int(sys.argv[3])
def timed(run):
    start = process_time()
    return run(), process_time() - start
problem = LimitProblem(scene)
rung = problem.ladder()[0]
problem.run(rung)
def first():
    start, state = process_time(), problem.run(rung)
    return process_time() - start - state.outcome.compile_seconds
def iterated():
    return solve(scene, method="fixed-point", moments=moments)
found = [timed(iterated) for _ in range(repeat)]
answer = found[-1][0]
print(json.dumps({
    "first": median(first() for _ in range(max(repeat, 5))), "seconds": median(t for _, t in found),
    "solves": len(answer.history), "load_factor": answer.load_factor, "status": str(answer.status),
}))
"""


def whole(
    name: str, moments: str, python: str, folder: str, options: argparse.Namespace
) -> dict[str, Any]:
    """A whole fixed point by some checkout, and its first plain solve, without compiling."""
    command = [python, "-c", _WHOLE, name, moments, str(options.repeat)]
    found: dict[str, Any] = json.loads(subprocess.check_output(command, cwd=folder, text=True))
    return found | {"in first solves": round(found["seconds"] / found["first"], 1)}


def timed(scene: Scene, most: int) -> dict[str, tuple[float, float]]:
    """Seconds of a solve, and of one that ends after an iteration, by problem."""
    run = Run(scene, moments=parse_moments("independent"))
    copies = run.moments.box_copies(run.contacts)
    hull = HullProblem(run.assemblage)
    step = SafeStep(run.assemblage, run.moments)
    middle = Point.middle(step.statics.contacts)
    found = {
        "relaxation": _measured(lambda s: hull.solve(copies, s), QUICK),
        "safe step": _measured(lambda s: step.solve(middle, s), QUICK),
    }
    for has_rows, what in ((True, "rows"), (False, "by CVXPY")):
        if has_rows or len(run.contacts) <= most:
            solve = _frozen(run, has_rows)
            found[f"frozen, {what}, first"] = _once(solve, TIGHT), _once(solve, TIGHT, 1)
            found[f"frozen, {what}"] = _measured(solve, TIGHT)
    return found


def _frozen(run: Run, has_rows: bool) -> Solve:
    """The paper's problem, frozen where the relaxation presses."""
    problem = FrozenProblem(run.assemblage, Conic(), run.moments)
    plain = LimitProblem(run.assemblage).run()
    assert plain.forces is not None
    problem.set(Pressure.of(plain.forces, run.contacts))
    return lambda settings: problem.problem.run(settings, has_rows)


def _measured(solve: Solve, solver: str) -> tuple[float, float]:
    whole, least = (median(_once(solve, solver, most) for _ in range(3)) for most in (None, 1))
    return whole, least


def _once(solve: Solve, solver: str, most: int | None = None) -> float:
    limit = "max_iters" if solver == "QOCO" else "max_iter"
    options = {} if most is None else {limit: most}
    settings = settings_for(solver, 1e-6 if solver == QUICK else 1e-9, solver, **options)
    start = process_time()
    solve(settings)
    return process_time() - start


if __name__ == "__main__":
    main()
