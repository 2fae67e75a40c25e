"""Result files: ``cvxlimit-result``, version 1."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import of_type
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.geometry.lumped import Lumped
from cvxlimit.io.fields import ANY_FINITE, FilePath, JsonObject, number, shown
from cvxlimit.io.forms import (
    TEXT,
    WHOLE,
    Document,
    Form,
    Key,
    choice,
    keyed,
    listed,
    nullable,
    plain,
    record,
    row,
)
from cvxlimit.io.scenes import UNITS, scene_digest
from cvxlimit.solution import Iterate, Iteration, LowerEnd, Member, Search, Solution, Status
from cvxlimit.solution.bracket import Bracket, Reference
from cvxlimit.solution.kinematics import Dilatancy

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
    {"start": Key(TEXT), "iterations": Key(WHOLE)}
    | {
        name: Key(FIGURE)
        for name in ("load_factor", "equilibrium", "yield_excess", "flow", "complementarity")
    },
    # forces and mechanism are those of the lowest only, which are the result's own
    lambda **given: Member(**given, forces=np.zeros((0, 6)), mechanism=np.zeros((0, 6))),
)

FORGOTTEN = Form(lambda *_: {}, lambda *_: None, nullable(FIGURE).schema)
"""An entry that files of version 0.2 may have, and that no solution keeps."""

SEARCH = record(
    Search,
    {"seed": Key(WHOLE), "load_factor": Key(nullable(FIGURE), is_needed=True)}
    | {name: Key(WHOLE) for name in ("solves", "last_gain")},
)

DILATANCY = record(
    Dilatancy,
    {
        "share": Key(FIGURE),
        "sliding": Key(listed(TEXT, "name of a contact"), is_needed=False),
        "moving": Key(WHOLE, is_needed=False),
        "safe": Key(FIGURE, is_needed=False),
        "slides_at": Key(nullable(FIGURE), is_needed=False),
    }
    | {name: Key(FORGOTTEN, is_needed=False, is_several=True) for name in ("nearly", "lacks")},
)

ITERATION = record(
    Iteration,
    {
        "met_after": Key(nullable(WHOLE)),
        "met_at": Key(nullable(FIGURE)),
        "lowest": Key(FIGURE),
        "highest": Key(FIGURE),
        "last": Key(WHOLE),
    },
)
"""Solves until the paper's criterion, the load factor then, and the band of the last iterates."""


LUMPED = record(
    Lumped,
    {
        "faces": Key(WHOLE),
        "contacts": Key(WHOLE),
        "angle": Key(FIGURE),
        "friction_angle": Key(FIGURE),
        "contact": Key(TEXT),
        "contact_angle": Key(FIGURE),
        "contact_friction_angle": Key(FIGURE),
    },
)
"""Faces that are taken as planes that they are not in; angles in radians."""


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


NUMBERS = listed(
    plain(lambda x, where: number(x, where, ANY_FINITE), {"type": "number"}),
    "internal force {i}",
    lambda forces: np.array(forces, dtype=float),
)

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
MECHANISM = keyed(row(RATES_NAMED, ANY_FINITE), "mechanism of block {key}")
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
        "forces": Key(nullable(STATE)),
        "rates": Key(nullable(RATES)),
    },
)


def _lower_end(lower: float, upper: float, **given: Any) -> LowerEnd:
    basis = {each.name: given.pop(each.name) for each in fields(Bracket) if each.name in given}
    mechanism = given.get("mechanism")
    if mechanism is not None:
        given["mechanism"] = {block: np.array(rates) for block, rates in mechanism.items()}
    return LowerEnd(bracket=Bracket(lower, upper, **basis), **given)


LOWER_END = record(
    LowerEnd,
    {
        "load_factor": Key(FIGURE),
        **{end: Key(form) for end, form in BOUNDS.items()},
        "bracket": Key(BRACKET, is_needed=False, is_several=True),
        "forces": Key(nullable(FORCES), is_needed=True),
        "mechanism": Key(nullable(MECHANISM), is_needed=True),
        "reference": Key(nullable(REFERENCE)),
    },
    _lower_end,
)


def _solution(lower: float, upper: float, **given: Any) -> Solution:
    basis = {each.name: given.pop(each.name) for each in fields(Bracket) if each.name in given}
    forces, mechanism = given["forces"], given["mechanism"]
    if forces is not None and len(forces) != given["contacts"]:
        raise InputError(
            f"forces must be {given['contacts']} rows, one for each contact, got {len(forces)}"
        )
    end = given.get("lower_end")
    if end is not None and end.forces is not None and len(end.forces) != given["contacts"]:
        raise InputError(
            f"forces of lower_end must be {given['contacts']} rows, one for each contact, got "
            f"{len(end.forces)}"
        )
    names = given.get("contact_names", ())
    if names and len(names) != given["contacts"]:
        raise InputError(f"contact_names must be {given['contacts']} names, got {len(names)}")
    if mechanism is not None:
        given["mechanism"] = {block: np.array(rates) for block, rates in mechanism.items()}
    status, factor = given["status"], given["load_factor"]
    if not status.has_answer and not (factor is None and upper == math.inf):
        beside = f"load_factor {shown(factor)}" if factor is not None else f"upper {upper:.7g}"
        raise InputError(
            f"{beside} cannot stand beside status {str(status)!r}, which says that there is none: "
            "the file was changed; solve anew"
        )
    return Solution(bracket=Bracket(lower, upper, **basis), **given)


RESULT: Document[Solution] = Document(
    "result",
    record(
        Solution,
        {
            "scene": Key(TEXT, "{key}", field="scene_name"),
            "surface": Key(TEXT, "{key}"),
            "interaction": Key(TEXT, "{key}"),
            "moments": Key(TEXT, "{key}"),
            "blocks": Key(WHOLE, "{key}"),
            "contacts": Key(WHOLE, "{key}"),
            "load_factor": Key(nullable(FIGURE), "{key}"),
            **{end: Key(form, "{key}") for end, form in BOUNDS.items()},
            "status": Key(choice(Status), "{key}"),
            "history": Key(listed(ITERATE), "{key}"),
            "seconds": Key(keyed(FIGURE, "seconds of phase {key}"), "{key}"),
            "forces": Key(nullable(FORCES), "{key}", is_needed=True),
            "mechanism": Key(nullable(MECHANISM), "{key}", is_needed=True),
            "note": Key(TEXT, "{key}"),
            "bracket": Key(BRACKET, "{key}", is_needed=False, is_several=True),
            "torsion_shear": Key(TEXT, "{key}"),
            "quantity": Key(TEXT, "{key}"),
            "flow": Key(TEXT, "{key}"),
            "members": Key(listed(MEMBER), "{key}"),
            "searches": Key(listed(SEARCH), "{key}", is_needed=False),
            "lower_end": Key(nullable(LOWER_END), "{key}", is_needed=False),
            "reference": Key(nullable(REFERENCE), "{key}"),
            "dilatancy": Key(nullable(DILATANCY), "{key}", is_needed=False),
            "iteration": Key(nullable(ITERATION), "{key}", is_needed=False),
            "lumped": Key(nullable(LUMPED), "{key}", is_needed=False),
            "versions": Key(keyed(TEXT, "version of {key}"), "{key}"),
            "internal": Key(nullable(NUMBERS), "{key}"),
            "model": Key(listed(TEXT, "a reduction"), "{key}"),
            "components": Key(COMPONENTS_SAID, "{key}", is_needed=False, is_several=True),
            "contact_names": Key(listed(TEXT, "name of contact {i}"), "{key}"),
            "scene_digest": Key(SCENE_DIGEST, "{key}", is_needed=False, is_several=True),
            "units": Key(UNITS, "{key}"),
            "tolerance": Key(nullable(TOLERANCE), "{key}"),
        },
        _solution,
    ),
)


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
    RESULT.write(_checked(solution), path)


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
    return RESULT.to_dict(_checked(solution))


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


def _checked(solution: Any) -> Any:
    return of_type(solution, Solution, "solution must be a Solution", "solve(scene) makes one")
