"""``python -m benchmarks.resolving``: what compiling costs where a problem is solved many times.

Per scene, in seconds of CPU of one solve each (medians of three):

- the relaxation with interaction: compiled afresh by CVXPY, or written as arrays;
- a safe step: compiled afresh, as it is at every point;
- the paper's frozen problem: with Parameters kept compiled (DPP), with Parameters compiled afresh,
  and its first solve, which pays for DPP; up to ``--dpp`` contacts, since its memory grows with
  their square.

Beside it the same with one iteration of the solver: compiling, and its setup. Interior-point
solvers take no starting point, so solving in place saves compiling and no more.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from statistics import median
from time import process_time

from rich.console import Console

from cvxlimit import Scene, builtin_scene
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.driver import Run
from cvxlimit.methods.fixed_point import FrozenProblem
from cvxlimit.methods.interaction.readings.named import parse_moments
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.restriction.problems import SafeStep
from cvxlimit.methods.interaction.states.majorants import Point
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.model.problem import LimitProblem
from cvxlimit.solvers import LimitState, SolverSettings, settings_for
from cvxlimit.surfaces import Conic

console = Console(highlight=False, soft_wrap=True)

QUICK, TIGHT = "QOCO", "CLARABEL"
"""Solvers of what leads the way, at 1e-6, and of frozen problems, at 1e-9."""

Solve = Callable[[SolverSettings], LimitState]

SCENES = ("tuff-wall", "s12-panel", "s10-panel")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print a table of Markdown."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.resolving", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=SCENES, help="built-in scenes")
    parser.add_argument("--dpp", type=int, default=1000, help="most contacts kept compiled")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.scenes if name not in BUILTIN]
    if unknown:
        parser.error(f"there is no scene {unknown[0]!r}")
    console.print("| scene | problem | seconds | with one iteration |\n|---|---|---|---|")
    for name in options.scenes:
        for problem, (whole, least) in timed(builtin_scene(name), options.dpp).items():
            console.print(f"| {name} | {problem} | {whole:.3f} | {least:.3f} |")


def timed(scene: Scene, most: int) -> dict[str, tuple[float, float]]:
    """Seconds of a solve, and of one that ends after an iteration, by problem."""
    run = Run(scene, moments=parse_moments("independent"))
    copies = run.moments.box_copies(run.contacts)
    hull = HullProblem(run.assemblage)
    step = SafeStep(run.assemblage, run.moments)
    middle = Point.middle(step.statics.contacts)
    found = {
        "relaxation": _measured(lambda s: hull.solve(copies, s), QUICK),
        "safe step, compiled afresh": _measured(lambda s: step.solve(middle, s), QUICK),
    }
    if len(run.contacts) <= most:
        kept = _frozen(run, is_kept=True)
        found["frozen, kept compiled, first"] = _once(kept, TIGHT), _once(kept, TIGHT, 1)
        found["frozen, kept compiled"] = _measured(kept, TIGHT)
    found["frozen, compiled afresh"] = _measured(_frozen(run, is_kept=False), TIGHT)
    return found


def _frozen(run: Run, *, is_kept: bool) -> Solve:
    """The paper's problem, frozen where the relaxation presses."""
    problem = FrozenProblem(run.assemblage, Conic(), run.moments)
    problem.ignore_dpp = not is_kept
    plain = LimitProblem(run.assemblage).solve()
    assert plain.forces is not None
    centres = Pressure.of(plain.forces, run.contacts)
    return lambda settings: problem.solve(centres, settings)


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
