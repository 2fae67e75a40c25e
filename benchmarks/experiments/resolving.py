"""What a re-solve costs: the paper's frozen problem, again and again with other coefficients.

Seconds of CPU, medians: the first eight re-solves of a fixed point, cold and warm, by tolerance and
solver; and whole fixed points beside the first plain solve.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.charts import COLOURS, few_ticks, name_lines, save, stacked
from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.runs import Limits, apart
from benchmarks.scenes import scene_of
from cvxlimit import Scene, solve
from cvxlimit.methods.frozen import FrozenProblem
from cvxlimit.model.problem import LimitProblem
from cvxlimit.readings.named import parse_moments
from cvxlimit.readings.states.pressure import Pressure
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Conic

QUICK, TIGHT, OWN = "QOCO", "CLARABEL", "BLOCKWISE"
"""Solvers of frozen problems; the last starts from the one before, warm."""

CALLED = {QUICK: "QOCO", TIGHT: "Clarabel", OWN: "blockwise"}
LEAST = 1e-12
"""Errors below this are drawn there: a logarithmic axis has no zero."""

Record = dict[str, Any]

SCENES = ("tuff-wall", "s12-panel", "s10-panel")


@experiment(
    Part(
        7, "--scenes tuff-wall s12-panel s10-panel --repeat 2 --picture docs/evidence/resolving.png"
    )
)
def resolving(
    scenes: Sequence[str] = SCENES, moments: Sequence[str] = ("signed",), repeat: int = 5,
    picture: Path | None = None,
) -> Lines:  # fmt: skip
    """What a re-solve costs, cold and warm, by solver and tolerance; and whole fixed points."""
    yield Title("re-solves")
    yield Head("scene", "moments", "solver", "tolerance", "start", "ms", "error")
    found: list[Record] = []
    for name, reading in product(scenes, moments):
        for record in resolved(scene_of(name), reading, repeat):
            found.append({"scene": name, "moments": reading, **record})
            off = "" if record["error"] is None else f"{record['error']:.0e}"
            yield (name, reading, CALLED[record["solver"]], f"{record['tolerance']:g}",
                   record["start"], f"{1e3 * record['seconds']:.1f}", off)  # fmt: skip
    yield Title("whole")
    yield Head("scene", "moments", "first solve, s", "fixed point, s", "in first solves", "solves",
               "load factor", "status")  # fmt: skip
    for name, reading in product(scenes, moments):
        first, seconds, end = apart(partial(whole, name, reading, repeat), Limits(3600.0))
        yield (name, reading, f"{first:.3f}", f"{seconds:.2f}", f"{seconds / first:.1f}", *end)
    if picture is not None:
        save(drawn(found), picture)


def drawn(records: Sequence[Record]) -> Figure:
    """Seconds of a re-solve against the error of its load factor: a plot for every scene and
    reading, a line for every solver, cold or warm, from the loosest tolerance to the tightest."""
    groups: dict[tuple[str, str], dict[str, list[tuple[float, float]]]] = {}
    for record in records:
        if record["error"] is not None:
            lines = groups.setdefault((record["scene"], record["moments"]), {})
            name = f"{CALLED[record['solver']]}, {record['start']}"
            point = record["seconds"], max(record["error"], LEAST)
            lines.setdefault(name, []).append(point)
    figure, plots = stacked(max(len(groups), 1), 2.8)
    for axes, ((scene, moments), lines) in zip(plots, groups.items(), strict=False):
        for (name, points), colour in zip(lines.items(), COLOURS, strict=False):
            axes.plot(*zip(*points, strict=True), "o-", color=colour, ms=5, label=name)
        axes.set(xscale="log", yscale="log", ylabel="error of the load factor")
        axes.set_title(f"{scene}, {moments} moments", fontsize=10, loc="left")
        few_ticks(axes.xaxis)
    plots[-1].set_xlabel("CPU seconds of a re-solve, at tolerances 1e-4, 1e-6, 1e-8")
    name_lines(figure, plots)
    return figure


def resolved(scene: Scene, moments: str, repeat: int) -> Iterator[Record]:
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
            "solver": solver, "tolerance": tolerance, "start": "warm" if is_warm else "cold",
            "seconds": median(seconds), "error": off,
        }  # fmt: skip


def whole(name: str, moments: str, repeat: int) -> tuple[float, float, tuple[object, ...]]:
    """Seconds of the first plain solve, without compiling, and of whole fixed points."""
    scene = scene_of(name)
    problem = LimitProblem(scene)
    rung = problem.ladder()[0]
    problem.run(rung)
    first, spent = [], []
    for _ in range(max(repeat, 5)):
        start, state = process_time(), problem.run(rung)
        first.append(process_time() - start - state.outcome.compile_seconds)
    for _ in range(repeat):
        start = process_time()
        answer = solve(scene, method="fixed-point", moments=moments)
        spent.append(process_time() - start)
    end = len(answer.history), f"{answer.load_factor:.6g}", str(answer.status)
    return median(first), median(spent), end
