"""Methods of scenes, solutions and problems that call what is above them.

``scene.plot()`` reads better than a function of its own, but pictures see scenes, not they them:
nothing in scenes, solutions and models depends on what is here. Such a method says what it does,
and calls by :func:`cvxlimit.base.doors.attached` what :data:`PLACES` names, or a function here.
Either imports what it needs when it is called, since pictures need a second to load.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from importlib import import_module
from typing import Any

from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.code_check import CodeCheck
from cvxlimit.extensions.paths.path import Path
from cvxlimit.problem.problem import LimitProblem
from cvxlimit.results.sensitivity import Sensitivity
from cvxlimit.solution import Solution

PLACES = {
    "scene_html": ("plotting.notebook", "scene_html"),
    "scene_figure": ("plotting", "scene_figure"),
    "scene_file": ("plotting", "plot_scene"),
    "scene_from_compas": ("io.geometry.importing", "of_compas"),
    "scene_explain": ("reductions.choice", "explain"),
    "scene_explore": ("studies.domains.exploring", "explore"),
    "solution_html": ("plotting.notebook", "solution_html"),
    "solution_plot": ("plotting", "picture_of"),
    "solution_table": ("plotting.frames", "table_of"),
    "solution_sensitivity": ("readings.sensitivity", "sensitivity"),
    "solution_first_look": ("methods.dilatancy.first_look", "first_look"),
    "solution_to_compas": ("io.geometry.compas_results", "results"),
    "sensitivity_table": ("plotting.frames", "sensitivity_table"),
    "without_dilatancy": ("methods.dilatancy.unbounded", "without_dilatancy"),
    "problem_solve": ("methods.modelling", "solved"),
    "path_table": ("plotting.frames", "path_table"),
    "path_save": ("io", "write_path"),
    "path_plot": ("plotting.paths", "draw_path"),
    "check_plot": ("plotting.paths", "draw_check"),
}
"""Module and function that does the work, by the name under which it is attached."""


def __getattr__(name: str) -> Any:
    if name not in PLACES:
        raise AttributeError(f"module 'cvxlimit.plotting.reports' has no attribute {name!r}")
    module, function = PLACES[name]
    return getattr(import_module(f"cvxlimit.{module}"), function)


_SECTIONS: dict[str, tuple[type, Any]] = {
    "path": (Path, lambda value: value.scene),
    "check": (CodeCheck, None),
    "sensitivity": (Sensitivity, lambda value: value.solution.scene),
    "without_dilatancy": (Solution, lambda value: value.scene),
}
"""What a report's sections are made of, and its scene."""


def solution_report(solution: Solution, file: str | os.PathLike[str] | None, given: Any) -> Any:
    """:meth:`cvxlimit.Solution.report`."""
    from cvxlimit.io import scene_digest
    from cvxlimit.plotting.reporting import report

    digest = scene_digest(solution.scene)
    for name, (kinds, scene_of) in _SECTIONS.items():
        value = given[name]
        if value is None or isinstance(value, str | Mapping) or hasattr(value, "columns"):
            continue
        if not (isinstance(value, kinds) or (name == "check" and hasattr(value, "rows"))):
            texts = "" if name == "without_dilatancy" else ", a text, a mapping or a table"
            raise InputError(
                f"{name} must be a {kinds.__name__}{texts}, got {value!r:.60}: it is for the page "
                "of a result"
            )
        if scene_of is not None and scene_digest(scene_of(value)) != digest:
            raise InputError(
                f"{name} is of another scene ({scene_of(value).name!r}) than the result of "
                f"{solution.scene_name!r}, to whose page it is to go"
            )
    if isinstance(given["check"], CodeCheck) and given["check"].scene_name != solution.scene_name:
        raise InputError(
            f"check is of scene {given['check'].scene_name!r}, and the result of "
            f"{solution.scene_name!r}"
        )
    without = given["without_dilatancy"]
    if without is not None and without.flow == "associated":
        raise InputError(
            f"without_dilatancy must be of a method without dilatancy, got {without!r}: "
            "solve(scene, method='zero-dilatancy') makes it"
        )
    if given["sensitivity"] is None and (derive := getattr(solution, "sensitivity", None)):
        with suppress(InputError):  # no optimum of one convex problem has derivatives
            given = given | {"sensitivity": derive()}
    page = report(solution, digest, **given)
    return page if file is None else page.save(file)


def sensitivity_sides(found: Any, change: Any, step: float) -> tuple[float, float]:
    """:meth:`cvxlimit.results.sensitivity.Sensitivity.both_sides`."""
    from cvxlimit.methods.solving import solve

    solution: Solution = found.solution
    surfaces: Any = solution.surfaces or solution.surface
    at = [
        solution.load_factor if way == 0 else solve(change(way * step), surfaces).load_factor
        for way in (-1, 0, 1)
    ]
    low, middle, high = (float("nan") if factor is None else factor for factor in at)
    return (middle - low) / step, (high - middle) / step


def solution_problem(solution: Solution) -> LimitProblem:
    """:attr:`cvxlimit.Solution.problem`."""
    problem = LimitProblem(solution.scene, solution.surfaces or solution.surface)
    problem._stated.surface = solution.surface
    return problem
