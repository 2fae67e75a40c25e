"""Path files: ``cvxlimit-path``, version 1, with the scene that the path is of."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import numpy as np

from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.configuration import Configuration, Flow, Points
from cvxlimit.extensions.paths.path import Ending, Work, other_than
from cvxlimit.extensions.paths.path import Path as Displacements
from cvxlimit.extensions.paths.starting import for_path
from cvxlimit.extensions.paths.supports import guided, standing
from cvxlimit.io.fields import ANY_FINITE, FilePath, JsonObject, refusals, shown
from cvxlimit.io.forms import (
    FINITE,
    FLAG,
    TEXT,
    WHOLE,
    Document,
    Form,
    Key,
    choice,
    listed,
    nullable,
    record,
    row,
    together,
)
from cvxlimit.io.results import BOUNDS, FIGURE, MECHANISM, PROVED, RESULT
from cvxlimit.io.scenes import MOTION, POINT, SCENE
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import Bracket

_AXES = [f"{axis}_{along}" for axis in ("t1", "t2", "n") for along in "xyz"]
_POINT = ("a", "b", "x", "y", "z", *_AXES, "gap", "slip_1", "slip_2", "friction", "n", "v_1", "v_2")
"""Columns of a point: blocks by number, place, axes, gap, slip, friction, force."""

_BOUND = (*_POINT, "cohesion", "most", "least", "is_bar")
"""Those where some joint has cohesion (a force), or there are ties or reactions (``is_bar`` 1) and
the largest and the least of their forces; 0 for none. Files of former versions end with ``most``,
and know ties alone."""

_ROWS, _TIED_ROWS, _BOUND_ROWS = (
    listed(row(names, ANY_FINITE), "point {i} of {where}")
    for names in (_POINT, _BOUND[:-2], _BOUND)
)


def _points(value: object, where: str, owner: str) -> JsonObject:
    first: Any = value[0] if isinstance(value, list) and value else None
    forms = {len(_BOUND): _BOUND_ROWS, len(_BOUND) - 2: _TIED_ROWS}
    width = len(first) if isinstance(first, list) and len(first) in forms else len(_POINT)
    rows = np.array(forms.get(width, _ROWS).read(value, where, owner), float).reshape(-1, width)
    blocks = rows[:, :2].astype(int)
    if (blocks != rows[:, :2]).any():
        raise InputError(f"a and b of {where} must be numbers of blocks")
    points = Points(
        blocks[:, 0], blocks[:, 1], rows[:, 2:5], rows[:, 5:14].reshape(-1, 3, 3), rows[:, 14],
        rows[:, 15:17], rows[:, 17],
    )  # fmt: skip
    if width > len(_POINT):
        most = np.where(rows[:, 22] > 0.0, rows[:, 22], np.inf)
        former = np.zeros(len(most)), np.isfinite(most)
        least, is_bar = rows[:, 23:].T if width == len(_BOUND) else former
        points = replace(points, cohesion=rows[:, 21], most=most, least=least, is_bar=is_bar > 0.0)
    return {"points": points, "forces": rows[:, 18:21]}


def _rows_of(c: Configuration, *place: str) -> Any:
    p, k = c.points, len(c.points)
    parts = p.a, p.b, p.at, p.axes.reshape(k, 9), p.gap, p.slip, p.friction, c.forces
    if not p.is_bound:
        return _ROWS.write(np.column_stack(parts), *place)
    most = np.where(np.isfinite(p.most), p.most, 0.0)
    return _BOUND_ROWS.write(np.column_stack([*parts, p.cohesion, most, p.least, p.is_bar]), *place)


_POINTS: JsonObject = {"anyOf": [_ROWS.schema, _TIED_ROWS.schema, _BOUND_ROWS.schema]}


BRACKET = record(
    Bracket,
    {
        **{end: Key(form, is_needed=True) for end, form in BOUNDS.items()},
        "proved": Key(PROVED, is_several=True, is_needed=True),
        "least": Key(FIGURE, is_needed=True),
    },
)
CONFIGURATION = record(
    Configuration,
    {
        "w": FINITE,
        "load_factor": FINITE,
        "displacements": MECHANISM,
        "points": Key(Form(_points, _rows_of, _POINTS), is_needed=True, is_several=True),
        "bracket": Key(nullable(BRACKET), is_needed=True),
        "largest": nullable(BRACKET),
        "widest_gap": Key(FINITE, is_needed=True),
        "residual": Key(FIGURE, is_needed=True),
        "iterates": Key(WHOLE, is_needed=True),
        "loss": FIGURE,
        "is_followed": Key(FLAG, "followed"),
    },
    dict,
)
WORK = row(Work._fields, ANY_FINITE, Work._make)
FAILURE = together({"w": FINITE, "what": TEXT})
CONTROL = together({"block": TEXT, "direction": POINT})


def _path(
    scene: Scene, initial: Solution | None, halved: JsonObject | None = None,
    other_flow: JsonObject | None = None, **given: Any,
) -> Displacements:  # fmt: skip
    """A path whose parts belong to each other."""
    if motions := given.get("motions", ()):
        is_guided = motions[0].supports[0] not in scene.supports  # in files of former versions
        given["given"] = standing(scene, motions) if is_guided else scene
        scene = scene if is_guided else guided(scene, motions)
    scene = for_path(scene)[0]
    path = _run(scene, initial, **given)
    for name in ("units", "contact_names", "lumped"):
        own, found = (getattr(each, name, None) for each in (initial, path.initial))
        if own and str(own) != str(found):
            raise InputError(f"{name} of initial must be those of the scene, got {shown(str(own))}")
    beside = dict[str, Any]()
    for name, flow, run in (
        ("halved", path.flow, halved), ("other_flow", other_than(path.flow), other_flow),
    ):  # fmt: skip
        if run is not None:
            with refusals(f"{name}: "):
                shared: dict[str, Any] = {"flow": flow, "control": path.control}
                shared |= {"until": path.until}
                shared |= {"stretch": path.stretch, "motions": motions, "given": path.given}
                beside[name] = _run(scene, initial, **run, **shared)  # type: ignore[arg-type]
    return replace(path, **beside)


def _run(
    scene: Scene, initial: Solution | None, configurations: tuple[JsonObject, ...], **given: Any
) -> Displacements:
    free = {scene.blocks[i].id for i in scene.free}
    if not configurations:
        raise InputError("configurations must be one at least, which is the structure at rest")
    for i, each in enumerate(configurations):
        ways: Any = each["displacements"]
        points: Any = each["points"]
        if (others := free.symmetric_difference(ways)) or not ways:
            raise InputError(
                f"displacements of configuration {i} must be of the scene's free blocks: block "
                f"{shown(min(others, default=None))} is in one of both only"
            )
        blocks = np.stack([points.a, points.b])
        if ((blocks < 0) | (blocks >= len(scene.blocks))).any() or (points.a == points.b).any():
            raise InputError(f"points of configuration {i} must be between two of the blocks")
    made = tuple(Configuration(scene, **each) for each in configurations)  # type: ignore[arg-type]
    if (fallen := given.get("fallen")) is not None:
        given["fallen"] = Configuration(scene, **fallen)
    if (control := given.get("control")) is not None and control[0] not in free:
        raise InputError(f"block of control must be a free block, got {shown(control[0])}")
    known = {each.w for each in made}
    if lost := [w for w in given.get("snaps", ()) if w not in known]:
        raise InputError(f"snaps must each be the w of a configuration, got {shown(lost[0])}")
    return Displacements(initial and initial.of(scene), made, **given)


RUN = {
    "configurations": listed(CONFIGURATION, "configuration {i}"),
    "status": choice(get_args(Ending)),
    "reason": TEXT,
    "step": FINITE,
    "snaps": listed(FINITE),
    "work": nullable(WORK),
    "slides": FLAG,
    "notes": listed(TEXT),
    "failures": listed(FAILURE, "failure {i}"),
    "fallen": nullable(CONFIGURATION),
}
"""What a path has of its own, beside the runs with half the step and the other flow."""

ANOTHER_RUN = nullable(record(Displacements, RUN, dict, where="{key}"))


_KEYS: dict[str, Key | Form] = {
    "scene": Key(SCENE.inside, is_needed=True),
    "initial": nullable(RESULT.inside),
    **RUN,
    "flow": choice(get_args(Flow)),
    "control": nullable(CONTROL),
    "until": FINITE,
    "stretch": FIGURE,
    "motions": listed(MOTION),
    "halved": ANOTHER_RUN,
    "other_flow": ANOTHER_RUN,
}

PATH = Document("path", Displacements, "path", "pushover(scene) makes one", _KEYS, _path)


def read_path(path: FilePath) -> Displacements:
    """Read a file written by :func:`write_path`: a path with its scene, which goes on from there.

    Raises
    ------
    InputError
        If the file cannot be read or is no valid path: one line naming the field and the value.
    """
    return PATH.read(path)


def write_path(displacements: Displacements, path: FilePath) -> None:
    """Write a path with its scene and all configurations, complete or not at all.

    Raises
    ------
    InputError
        If a number is not finite, or the file cannot be written.

    Example
    -------
    >>> import tempfile, pathlib
    >>> from cvxlimit import builtin_scene, prove, pushover
    >>> path = pushover(builtin_scene("single-block"), step=0.1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "path.json")
    ...     path.save(file)
    ...     read_path(file).d0 == path.d0, prove(file).is_proved
    (True, True)
    """
    PATH.write(displacements, path)
