"""Methods of scenes, solutions and problems that call what is above them.

``scene.plot()`` reads better than a function of its own, but pictures see scenes, not they them:
nothing in scenes, solutions and models depends on what is here. Such a method says what it does,
and calls the function of that name by :func:`cvxlimit.base.attached.attached`; the function
imports what it needs when it is called, since pictures need a second to load.
"""

from __future__ import annotations

import os
from contextlib import suppress
from typing import Any

from cvxlimit.errors import InputError
from cvxlimit.model.problem import LimitProblem
from cvxlimit.paths.path import Path
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution


def scene_html(scene: Scene) -> str:
    """What a notebook shows of a scene."""
    from cvxlimit.plotting.notebook import scene_html

    return scene_html(scene)


def scene_plot(
    scene: Scene,
    path: str | os.PathLike[str] | None,
    viewer: tuple[float, float, float] | None,
    options: dict[str, Any],
) -> Any:
    """:meth:`cvxlimit.Scene.plot`."""
    from cvxlimit.plotting import plot_scene, scene_figure

    if viewer is not None:
        options["viewer"] = viewer
    return scene_figure(scene, **options) if path is None else plot_scene(scene, path, **options)


def scene_explain(scene: Scene, surface: Any, options: dict[str, Any]) -> Any:
    """:meth:`cvxlimit.Scene.explain`."""
    from cvxlimit.reductions.choice import explain

    return explain(scene, surface, **options)


def scene_explore(scene: Scene, options: dict[str, Any]) -> Any:
    """:meth:`cvxlimit.Scene.explore`."""
    from cvxlimit.studies.domains.exploring import explore

    return explore(scene, **options)


def solution_html(solution: Solution) -> str:
    """What a notebook shows of a solution."""
    from cvxlimit.plotting.notebook import solution_html

    return solution_html(solution)


def solution_plot(
    solution: Solution, kind: str, path: str | os.PathLike[str] | None, options: dict[str, Any]
) -> Any:
    """:meth:`cvxlimit.Solution.plot`."""
    from cvxlimit.plotting import picture_of

    return picture_of(solution, kind, path, **options)


def solution_report(solution: Solution, file: str | os.PathLike[str] | None, given: Any) -> Any:
    """:meth:`cvxlimit.Solution.report`."""
    from cvxlimit.io import scene_digest
    from cvxlimit.plotting.reporting import report

    if given["sensitivity"] is None and (derive := getattr(solution, "sensitivity", None)):
        with suppress(InputError):  # no optimum of one convex problem has derivatives
            given = given | {"sensitivity": derive()}
    made = report(solution, scene_digest(solution.scene), **given)
    return made if file is None else made.save(file)


def solution_table(solution: Solution, what: str) -> Any:
    """:meth:`cvxlimit.Solution.to_dataframe`."""
    from cvxlimit.plotting.frames import table_of

    return table_of(solution, what)


def path_table(path: Path) -> Any:
    """:meth:`cvxlimit.Path.to_dataframe`."""
    from cvxlimit.plotting.frames import path_table

    return path_table(path)


def solution_sensitivity(solution: Solution) -> Any:
    """:meth:`cvxlimit.Solution.sensitivity`."""
    from cvxlimit.readings.sensitivity import sensitivity

    return sensitivity(solution)


def sensitivity_table(found: Any, what: str) -> Any:
    """:meth:`cvxlimit.readings.sensitivity.Sensitivity.to_dataframe`."""
    from cvxlimit.plotting.frames import sensitivity_table

    return sensitivity_table(found, what)


def sensitivity_sides(found: Any, change: Any, step: float) -> tuple[float, float]:
    """:meth:`cvxlimit.readings.sensitivity.Sensitivity.both_sides`."""
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
    found = LimitProblem(solution.scene, solution.surfaces or solution.surface)
    found.surface = solution.surface
    return found


def solution_first_look(solution: Solution, progress: Any) -> Solution:
    """:meth:`cvxlimit.Solution.first_look`."""
    from cvxlimit.methods.dilatancy.first_look import first_look

    return first_look(solution, progress)


def problem_solve(
    problem: LimitProblem, solver: Any, tolerance: float, verbose: bool, options: dict[str, Any]
) -> Solution:
    """:meth:`cvxlimit.LimitProblem.solve`."""
    from cvxlimit.methods.modelling import solved

    return solved(problem, solver, tolerance, verbose, options)


def check_plot(check: Any, path: str | os.PathLike[str] | None, options: dict[str, Any]) -> Any:
    """:meth:`cvxlimit.CodeCheck.plot`."""
    from cvxlimit.plotting.paths import draw_check

    return draw_check(check, path, options)


def path_save(path: Path, file: str | os.PathLike[str]) -> None:
    """:meth:`cvxlimit.Path.save`."""
    from cvxlimit.io import write_path

    write_path(path, file)


def path_plot(
    path: Path, kind: str, file: str | os.PathLike[str] | None, options: dict[str, Any]
) -> Any:
    """:meth:`cvxlimit.Path.plot`."""
    from cvxlimit.plotting.paths import draw_path

    return draw_path(path, kind, file, options)
