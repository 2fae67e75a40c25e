"""The report of a solution: what may stand on its page, and that it is of the same scene."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from cvxlimit.errors import InputError
from cvxlimit.io.scenes import scene_digest
from cvxlimit.plotting.reporting import report
from cvxlimit.results.sensitivity import Sensitivity
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

_SECTIONS: dict[str, tuple[str, Callable[[Any], bool], Callable[[Any], Scene] | None]] = {
    "path": ("Path", lambda value: hasattr(value, "facts"), lambda value: value.scene),
    "check": ("CodeCheck", lambda value: hasattr(value, "rows"), None),
    "sensitivity": (
        "Sensitivity",
        lambda value: isinstance(value, Sensitivity),
        lambda value: value.solution.scene,
    ),
    "without_dilatancy": (
        "Solution", lambda value: isinstance(value, Solution), lambda value: value.scene,
    ),
}  # fmt: skip
"""What a report's sections are made of, how one sees that, and its scene."""


def solution_report(solution: Solution, file: str | os.PathLike[str] | None, given: Any) -> Any:
    """:meth:`cvxlimit.Solution.report`."""
    digest, notes = scene_digest(solution.scene), given["notes"]
    if not (notes is None or isinstance(notes, Mapping)):
        raise InputError(f"notes must be a mapping of names to texts, got {notes!r:.60}")
    for name, (kind, is_one, scene_of) in _SECTIONS.items():
        value = given[name]
        if value is None or isinstance(value, str | Mapping) or hasattr(value, "columns"):
            continue
        if not is_one(value):
            texts = "" if name == "without_dilatancy" else ", a text, a mapping or a table"
            raise InputError(
                f"{name} must be a {kind}{texts}, got {value!r:.60}: it is for the page of a result"
            )
        if scene_of is not None and scene_digest(scene_of(value)) != digest:
            raise InputError(
                f"{name} is of another scene ({scene_of(value).name!r}) than the result of "
                f"{solution.scene_name!r}, to whose page it is to go"
            )
    for name in ("check", "envelope"):
        named = getattr(given[name], "scene_name", solution.scene_name)
        if named != solution.scene_name:
            raise InputError(
                f"{name} is of scene {named!r}, and the result of {solution.scene_name!r}"
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
