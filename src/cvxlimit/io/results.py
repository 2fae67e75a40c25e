"""Result files: ``cvxlimit-result``, version 1."""

from __future__ import annotations

import math
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.geometry.lumped import Lumped
from cvxlimit.io.fields import ANY_FINITE, FilePath, JsonObject, number, shown
from cvxlimit.io.forms import (
    FINITE,
    TEXT,
    WHOLE,
    Document,
    Form,
    Key,
    by_type,
    choice,
    keyed,
    listed,
    nullable,
    plain,
    record,
    row,
)
from cvxlimit.io.scenes import UNITS, scene_digest
from cvxlimit.solution import (
    FromRest,
    Iterate,
    Iteration,
    LowerEnd,
    Member,
    Search,
    Solution,
    Status,
    Step,
    Trial,
)
from cvxlimit.solution.bracket import Bracket, Evidence, Reference
from cvxlimit.solution.kinematics import Dilatancy
from cvxlimit.solution.records import RESIDUALS

_NOT_FINITE = ("nan", "inf", "-inf")


def _figure(value: object, where: str) -> float:
    if isinstance(value, str) and value in _NOT_FINITE:
        return float(value)
    return number(value, where, ANY_FINITE)


def _to_json(value: float, _: str) -> float | str:
    return float(value) if math.isfinite(value) else repr(float(value))


FIGURE = plain(_figure, {"anyOf": [{"type": "number"}, {"enum": [*_NOT_FINITE]}]}, _to_json)
"""JSON has no numbers that are not finite: they are texts."""


def _tolerance(value: object, where: str) -> float:
    found = number(value, where)
    if not 0.0 < found < 1.0:
        raise InputError(f"{where} must be between 0 and 1, got {shown(value)}: solve anew")
    return found


TOLERANCE = plain(_tolerance, {"type": "number", "exclusiveMinimum": 0.0, "exclusiveMaximum": 1.0})
"""Relative width of bracket that was asked for."""

BOUNDS = {"lower": nullable(FIGURE, -math.inf), "upper": nullable(FIGURE, math.inf)}

PROVED = Form(
    lambda value, *place: {
        f"{end}_is_proved": end in listed(choice(BOUNDS)).read(value, *place) for end in BOUNDS
    },
    lambda bracket, *_: [end for end in BOUNDS if getattr(bracket, f"{end}_is_proved")],
    listed(choice(BOUNDS)).schema,
)
BASIS = record(
    Bracket,
    {"proved": Key(PROVED, is_several=True, is_needed=True), "least": Key(FIGURE, is_needed=True)},
    dict,
)
BRACKET = Form(
    BASIS.read,
    lambda solution, *place: (
        None  # files of earlier versions do not say what bounds rest on, and mean this
        if solution.bracket == Bracket(solution.lower, solution.upper)
        else BASIS.write(solution.bracket, *place)
    ),
    BASIS.schema,
)

ITERATE = record(
    Iterate,
    {
        each.name: Key(
            TEXT if each.name in ("solver", "status") else BOUNDS.get(each.name, FIGURE),
            is_needed=each.name in ("seconds", "solver", "status"),
        )
        for each in fields(Iterate)
    },
)

MEMBER = record(
    Member,
    by_type(Member, FIGURE, "start", "iterations", "load_factor", *RESIDUALS, "angle"),
    # forces and mechanism are those of the lowest only, which are the result's own
    lambda **given: Member(**given, forces=np.zeros((0, 6)), mechanism=np.zeros((0, 6))),
)

FORGOTTEN = Form(lambda *_: {}, lambda *_: None, nullable(FIGURE).schema)
"""An entry that files of version 0.2 may have, and that no solution keeps."""

SEARCH = record(Search, by_type(Search, FIGURE))

DILATANCY = record(
    Dilatancy,
    by_type(Dilatancy, FIGURE)
    | {"sliding": listed(TEXT, "name of a contact")}
    | dict.fromkeys(("nearly", "lacks"), Key(FORGOTTEN, is_several=True)),
)

ITERATION = record(Iteration, by_type(Iteration, FIGURE))
"""Solves until the paper's criterion, the load factor then, and the band of the last iterates."""


LUMPED = record(Lumped, by_type(Lumped, FIGURE))
"""Faces that are taken as planes that they are not in; angles in radians."""


TRIAL = record(Trial, by_type(Trial, FIGURE, "what", "end") | {"load_factor": nullable(FIGURE)})

FROM_REST = record(
    FromRest,
    {
        **by_type(FromRest, FIGURE, "end"),
        **dict.fromkeys(("to_come", "limit", "bedding"), nullable(FIGURE)),
        # forces of all steps would be most of the file; those of the result are its own
        "steps": listed(record(Step, by_type(
            Step, FIGURE, "displacement", "load_factor", "sliding", "open", "equilibrium",
            "yield_excess", "against",
        ))),
        "spread": listed(TRIAL),
        "draws": listed(TRIAL),
    },
)  # fmt: skip
"""A way from rest to collapse."""


RATES_NAMED = ("ux", "uy", "uz", "rx", "ry", "rz")


_NAMED = {"forces": list(COMPONENTS), "mechanism": list(RATES_NAMED)}


def _components(value: object, where: str, _: str) -> JsonObject:
    if value != _NAMED:
        raise InputError(f"{where} must be {_NAMED}, got {shown(value)}")
    return {}


COMPONENTS_SAID = Form(
    _components, lambda solution, *_: _NAMED if solution.contact_names else None, {"const": _NAMED}
)
"""What the columns of forces and mechanism are, for those who read the file by other means."""


def _rows(entries: list[tuple[float, ...]]) -> FloatArray:
    return np.array(entries, dtype=float).reshape(-1, len(COMPONENTS))


NUMBERS = listed(FINITE, "internal force {i}", lambda forces: np.array(forces, dtype=float))

SCENE_DIGEST = Form(
    lambda value, *place: {"scene_digest": TEXT.read(value, *place)},
    lambda solution, *_: (
        solution.scene_digest or None
        if solution.solved_scene is None
        else scene_digest(solution.solved_scene)
    ),
    {"type": "string"},
)
"""Of which scene the result is, so that it is not taken for one of another."""

FORCES = listed(row(COMPONENTS, ANY_FINITE), "force on contact {i}", _rows)
MECHANISM = keyed(row(RATES_NAMED, ANY_FINITE, np.array), "mechanism of block {key}")
RATES = listed(row(RATES_NAMED, ANY_FINITE), "rates of free block {i}", _rows)
STATE = Form(
    lambda value, *place: _form_of(value).read(value, *place),
    lambda value, *place: (FORCES if np.ndim(value) == 2 else NUMBERS).write(value, *place),
    {"anyOf": [FORCES.schema, NUMBERS.schema]},
)
"""Contact forces, or internal ones where strength is stated in these."""


def _form_of(value: Any) -> Form:
    has_rows = isinstance(value, list) and all(isinstance(entry, list) for entry in value)
    return FORCES if has_rows else NUMBERS


REFERENCE = record(
    Reference,
    {
        "load_factor": Key(nullable(FIGURE), is_needed=True),
        "forces": nullable(STATE),
        "rates": nullable(RATES),
    },
)

EVIDENCE = record(
    Evidence,
    {
        "load_factor": nullable(FIGURE),
        "forces": nullable(FORCES),
        "rates": nullable(RATES),
        "internal": nullable(NUMBERS),
        "reference": nullable(REFERENCE),
        "cells": nullable(listed(WHOLE, "cells of contact {i}", np.array)),
        "contacts": nullable(listed(WHOLE, "contact {i}", np.array)),
        "until": nullable(FIGURE),
    },
)
"""What is proved beside the bracket, each by forces or rates of its own."""


def _bracketed(kind: Any, **given: Any) -> Any:
    """A record whose file has the parts of its bracket beside its other entries."""
    bracket = {each.name: given.pop(each.name) for each in fields(Bracket) if each.name in given}
    return kind(bracket=Bracket(**bracket), **given)


LOWER_END = record(
    LowerEnd,
    {
        "load_factor": FIGURE,
        **BOUNDS,
        "bracket": Key(BRACKET, is_several=True),
        "forces": Key(nullable(FORCES), is_needed=True),
        "mechanism": Key(nullable(MECHANISM), is_needed=True),
        "reference": nullable(REFERENCE),
    },
    partial(_bracketed, LowerEnd),
)


def _solution(**given: Any) -> Solution:
    contacts, end, names = given["contacts"], given.get("lower_end"), given.get("contact_names")
    for what, forces in (("forces", given["forces"]), ("forces of lower_end", end and end.forces)):
        if forces is not None and len(forces) != contacts:
            raise InputError(
                f"{what} must be {contacts} rows, one for each contact, got {len(forces)}"
            )
    if names and len(names) != contacts:
        raise InputError(f"contact_names must be {contacts} names, got {len(names)}")
    status, factor, upper = given["status"], given["load_factor"], given["upper"]
    if not status.has_answer and not (factor is None and upper == math.inf):
        beside = f"load_factor {shown(factor)}" if factor is not None else f"upper {upper:.7g}"
        raise InputError(
            f"{beside} cannot stand beside status {str(status)!r}, which says that there is none: "
            "the file was changed; solve anew"
        )
    found: Solution = _bracketed(Solution, **given)
    return found


_KEYS: dict[str, Key | Form] = {
    "scene": Key(TEXT, field="scene_name"),
    **by_type(Solution, FIGURE, "surface", "interaction", "moments", "blocks", "contacts"),
    "load_factor": nullable(FIGURE),
    **BOUNDS,
    "status": choice(Status),
    "history": listed(ITERATE),
    "seconds": keyed(FIGURE, "seconds of phase {key}"),
    "forces": Key(nullable(FORCES), is_needed=True),
    "mechanism": Key(nullable(MECHANISM), is_needed=True),
    "note": TEXT,
    "bracket": Key(BRACKET, is_several=True),
    **by_type(Solution, FIGURE, "torsion_shear", "quantity", "flow"),
    "members": listed(MEMBER),
    "searches": listed(SEARCH),
    "lower_end": nullable(LOWER_END),
    "reference": nullable(REFERENCE),
    "beside": keyed(EVIDENCE, "evidence of {key}"),
    "dilatancy": nullable(DILATANCY),
    "iteration": nullable(ITERATION),
    "from_rest": nullable(FROM_REST),
    "lumped": nullable(LUMPED),
    "versions": keyed(TEXT, "version of {key}"),
    "internal": nullable(NUMBERS),
    "model": listed(TEXT, "a reduction"),
    "components": Key(COMPONENTS_SAID, is_several=True),
    "contact_names": listed(TEXT, "name of contact {i}"),
    "scene_digest": Key(SCENE_DIGEST, is_several=True),
    "units": UNITS,
    "tolerance": nullable(TOLERANCE),
}

RESULT = Document("result", Solution, "solution", "solve(scene) makes one", _KEYS, _solution)


def read_result(path: FilePath) -> Solution:
    """Read a result file written by :func:`write_result`.

    Raises
    ------
    InputError
        If the file cannot be read, or as for :func:`result_from_dict`.

    Example
    -------
    >>> import tempfile, pathlib
    >>> from cvxlimit.solution.bracket import Bracket
    >>> solution = Solution(
    ...     "tower", "conic", "none", "signed", 1, 1, 0.25, Bracket(lower=0.2499),
    ...     Status.NOT_CERTIFIED, (), {"total": 0.01},
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "result.json")
    ...     write_result(solution, file)
    ...     read_result(file).upper
    inf
    """
    return RESULT.read(path)


def write_result(solution: Solution, path: FilePath) -> None:
    """Write a result file, complete or not at all, that :func:`read_result` reads without loss.

    Raises
    ------
    InputError
        As for :func:`result_to_dict`, or if the file cannot be written.
    """
    RESULT.write(solution, path)


def result_to_dict(solution: Solution) -> JsonObject:
    """The result as plain dicts, lists, texts and numbers, laid out as in a result file.

    Keys are the fields of :class:`~cvxlimit.solution.Solution`, ``scene`` for the scene's name, and
    ``components``, which names the columns of forces and mechanism; ``bracket`` says which bounds
    are proved, and by what the width of one around zero is measured. A missing bound becomes None;
    any other number that is not finite the text "nan", "inf" or "-inf". In the history, fields that
    do not apply are left out.

    Raises
    ------
    InputError
        If forces or mechanism are not finite, or not six numbers each.

    Example
    -------
    >>> from cvxlimit.solution.bracket import Bracket
    >>> solution = Solution(
    ...     "tower", "conic", "none", "signed", 1, 1, 0.25, Bracket(upper=0.25),
    ...     Status.NOT_CERTIFIED, (Iterate(0.25, 0.01, "CLARABEL", "optimal"),), {"total": 0.01},
    ... )
    >>> document = result_to_dict(solution)
    >>> document["lower"], document["history"]
    (None, [{'load_factor': 0.25, 'seconds': 0.01, 'solver': 'CLARABEL', 'status': 'optimal'}])
    """
    return RESULT.to_dict(solution)


def result_from_dict(document: object) -> Solution:
    """The result described by the content of a result file; see :func:`result_to_dict`.

    Raises
    ------
    InputError
        If it is no valid result: one line naming the field, the value and the cure.

    Example
    -------
    >>> result_from_dict({"format": "cvxlimit-scene"})
    Traceback (most recent call last):
    cvxlimit.errors.InputError: format must be 'cvxlimit-result', got 'cvxlimit-scene'; \
this is not a result file
    """
    return RESULT.from_dict(document)
