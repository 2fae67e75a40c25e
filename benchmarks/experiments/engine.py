"""The interior point for contacts beside Clarabel and QOCO: CPU milliseconds, cold and warm.

Medians; methods in turns. Cold: the limit problem, by tolerance. Warm: the same with friction 1 %
higher, from a point on the way to the first answer (``middle``). Times are the solver's alone, with
its order of elimination.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from statistics import median

import numpy as np
import scipy.sparse as sp
from threadpoolctl import threadpool_limits

from benchmarks.experiment import Head, Lines, Part, experiment
from cvxlimit import Scene, builtin_scene
from cvxlimit.extensions.blockcone.interior import Point, Program, Result, minimised, order_of
from cvxlimit.model.program import LimitProgram
from cvxlimit.solvers import Blockwise, settings_for
from cvxlimit.surfaces.coulomb import surfaces_of

SCENES = (
    "tuff-wall", "tuff-wall:octagon", "arch", "dome", "facade", "s12-panel", "s12-panel:octagon",
    "s10-panel",
)  # fmt: skip
TOLERANCES = (1e-6, 1e-8)
OTHERS = (("CLARABEL", 1e-8), ("QOCO", 1e-8), ("QOCO", 1e-6))
COLUMNS = tuple(f"{tolerance:g}{warm}" for tolerance in TOLERANCES for warm in ("", " warm"))
METHODS = ("CLARABEL", "QOCO", "own")
"""Columns and rows of the table: methods that say nothing are left out."""


Run = Callable[[float, Point | None], Result]


def program_of(scene: Scene, surface: str) -> Program:
    """The limit problem's cost, matrix and right-hand side, and its cones."""
    problem = LimitProgram(scene, surfaces_of(surface)[0]).problem
    data, _, _ = problem.get_problem_data(Blockwise(), solver_opts={})
    dims, c, b = data["dims"], np.asarray(data["c"]), np.asarray(data["b"])
    return c, sp.csc_array(data["A"]), b, (dims.zero, dims.nonneg, list(dims.soc))


def own(scene: Scene, surface: str) -> Run:
    """Our own solver on a limit problem."""
    given = program_of(scene, surface)

    def run(tolerance: float, start: Point | None) -> Result:
        starts = [] if start is None else [start]
        return minimised(given, tolerance, starts=starts, order=order_of(given))

    return run


def others(scene: Scene, surface: str) -> dict[str, Callable[[], object]]:
    """Clarabel and QOCO through CVXPY's interfaces, without its compiling."""
    problem = LimitProgram(scene, surfaces_of(surface)[0]).problem
    runs: dict[str, Callable[[], object]] = {}
    for name, tolerance in OTHERS:
        options = dict(settings_for(name, tolerance).options)
        data, chain, _ = problem.get_problem_data(name, solver_opts=options)

        def run(chain=chain, data=data, options=options) -> None:  # type: ignore[no-untyped-def]
            chain.solve_via_data(problem, data, solver_opts=options)

        runs[f"{name} {tolerance:g}"] = run
    return runs


def measured(name: str, repeat: int) -> dict[str, str]:
    """Median CPU milliseconds and iterations, by method."""
    scene_name, _, surface = name.partition(":")
    scene, surface = builtin_scene(scene_name), surface or "conic"
    runs = others(scene, surface)
    found: dict[str, str] = {}
    rougher = scene.with_friction(1.01 * float(scene.contacts.friction[0]))
    first, second = own(scene, surface), own(rougher, surface)
    before = first(1e-6, None)
    for tolerance in TOLERANCES:
        runs[f"own {tolerance:g}"] = partial(first, tolerance, None)
        runs[f"own {tolerance:g} warm"] = partial(second, tolerance, before.middle)
    seconds: dict[str, list[float]] = {label: [] for label in runs}
    for _ in range(repeat):
        for label, run in runs.items():
            began = time.process_time()
            result = run()
            seconds[label].append(time.process_time() - began)
            found[label] = str(getattr(result, "iterations", ""))
    said = {label: f" ({number})" if number else "" for label, number in found.items()}
    return {label: f"{1e3 * median(s):.3g}{said[label]}" for label, s in seconds.items()}


@experiment(Part(3))
def engine(scenes: Sequence[str] = SCENES, repeat: int = 5) -> Lines:
    """Our own solver beside Clarabel and QOCO: CPU milliseconds (iterations), cold and warm."""
    yield Head("scene", "solver", *COLUMNS)
    with threadpool_limits(1, user_api="blas"):
        for name in scenes:
            yield from rows(name, measured(name, repeat))


def rows(name: str, found: dict[str, str]) -> Lines:
    """A row for every method, from cells by method and column."""
    for method in METHODS:
        cells = [found.get(f"{method} {column}", "") for column in COLUMNS]
        if any(cells):
            yield name, method, *cells
