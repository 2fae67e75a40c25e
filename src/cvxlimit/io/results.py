"""Result files: ``cvxlimit-result``, version 1."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields as dataclass_fields

import numpy as np

from cvxlimit.bracket import Bracket
from cvxlimit.checks import of_type
from cvxlimit.errors import InputError
from cvxlimit.files import write_file
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.io.documents import Path, encoded, file_prefix, read_document
from cvxlimit.io.fields import (
    ANY_FINITE,
    JsonObject,
    check_header,
    fields,
    items,
    mapping,
    number,
    numbers,
    refusals,
    shown,
    text,
    whole,
)
from cvxlimit.solution import LOAD_FACTOR, FloatArray, Iterate, Member, Solution, Status

_REQUIRED = (
    "format", "version", "scene", "surface", "interaction", "moments", "blocks", "contacts",
    "load_factor", "lower", "upper", "status", "history", "seconds", "forces", "mechanism",
)  # fmt: skip
_OPTIONAL = ("note", "bracket", "versions", "torsion_shear", "flow", "members", "model", "quantity")
_RATES = ("ux", "uy", "uz", "rx", "ry", "rz")

_NO_BOUND = {"lower": -math.inf, "upper": math.inf}
_NOT_FINITE = ("nan", "inf", "-inf")
_ITERATE_TEXTS = ("solver", "status")
_ITERATE_REQUIRED = ("seconds", *_ITERATE_TEXTS)
_ITERATE_OPTIONAL = tuple(
    f.name for f in dataclass_fields(Iterate) if f.name not in _ITERATE_REQUIRED
)


def read_result(path: Path) -> Solution:
    """Read a result file written by :func:`write_result`.

    Raises
    ------
    InputError
        If the file cannot be read or is no valid result: one line naming the file, the field,
        the value and the cure.

    Example
    -------
    >>> import tempfile, pathlib
    >>> from cvxlimit.bracket import Bracket
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
    with refusals(file_prefix(path)):
        return result_from_dict(read_document(path))


def write_result(solution: Solution, path: Path) -> None:
    """Write a result file that :func:`read_result` reads back without loss.

    The file is complete or untouched: a temporary file beside it is renamed at the end.

    Raises
    ------
    InputError
        If forces or mechanism are not finite, or the file cannot be written.

    Example
    -------
    See :func:`read_result`.
    """
    with refusals(file_prefix(path)):
        data = encoded(result_to_dict(solution))
    write_file(path, data)


def result_to_dict(solution: Solution) -> JsonObject:
    """The result as plain dicts, lists, texts and numbers, laid out as in a result file.

    The keys are those of the format, always all of them, plus ``note``, ``versions``,
    ``model`` (the reductions that were used) and ``bracket`` (which bounds are proved, and by what
    the width of one around zero is measured) when there are any.
    A missing bound (``lower`` -inf, ``upper`` inf) becomes None; any other number that is not
    finite becomes the text "nan", "inf" or "-inf", since JSON has no such numbers. In the
    history, fields that do not apply are left out.

    Raises
    ------
    InputError
        If forces or mechanism are not finite, or not six numbers each.

    Example
    -------
    >>> from cvxlimit.bracket import Bracket
    >>> solution = Solution(
    ...     "tower", "conic", "none", "signed", 1, 1, 0.25, Bracket(upper=0.25),
    ...     Status.NOT_CERTIFIED, (Iterate(0.25, 0.01, "CLARABEL", "optimal"),), {"total": 0.01},
    ... )
    >>> document = result_to_dict(solution)
    >>> document["lower"], document["history"]
    (None, [{'load_factor': 0.25, 'seconds': 0.01, 'solver': 'CLARABEL', 'status': 'optimal'}])
    """
    of_type(solution, Solution, "solution must be a Solution", "solve(scene) makes one")
    with refusals():
        factor = solution.load_factor
        document: JsonObject = {
            "format": "cvxlimit-result",
            "version": 1,
            "scene": text(solution.scene, "scene"),
            "surface": text(solution.surface, "surface"),
            "interaction": text(solution.interaction, "interaction"),
            "moments": text(solution.moments, "moments"),
            "blocks": int(solution.blocks),
            "contacts": int(solution.contacts),
            "load_factor": None if factor is None else _to_json(factor),
            "lower": _to_json(solution.lower, _NO_BOUND["lower"]),
            "upper": _to_json(solution.upper, _NO_BOUND["upper"]),
            "status": str(solution.status),
            "history": [_iterate_to_dict(iterate) for iterate in solution.history],
            "seconds": {text(k, "a phase"): _to_json(v) for k, v in solution.seconds.items()},
            "forces": _forces_to_list(solution.forces),
            "mechanism": _mechanism_to_dict(solution.mechanism),
        }
        if solution.note:
            document["note"] = text(solution.note, "note")
        if solution.bracket != Bracket(solution.lower, solution.upper):
            document["bracket"] = _bracket_to_dict(solution.bracket)
        if solution.torsion_shear != "linear":
            document["torsion_shear"] = text(solution.torsion_shear, "torsion_shear")
        if solution.quantity != LOAD_FACTOR:
            document["quantity"] = text(solution.quantity, "quantity")
        if solution.flow != "associated":
            document["flow"] = text(solution.flow, "flow")
            document["members"] = [_member_to_dict(member) for member in solution.members]
        if solution.versions:
            document["versions"] = _versions(solution.versions)
        if solution.model:
            document["model"] = [text(name, "a reduction") for name in solution.model]
        return document


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
    with refusals():
        check_header(document, "result")
        top = fields(document, "the result", _REQUIRED, _OPTIONAL)
        contacts = whole(top["contacts"], "contacts")
        factor = top["load_factor"]
        return Solution(
            scene=text(top["scene"], "scene"),
            surface=text(top["surface"], "surface"),
            interaction=text(top["interaction"], "interaction"),
            moments=text(top["moments"], "moments"),
            blocks=whole(top["blocks"], "blocks"),
            contacts=contacts,
            load_factor=None if factor is None else _from_json(factor, "load_factor"),
            bracket=_bracket(top),
            status=_status(top["status"]),
            history=tuple(_iterate(i, x) for i, x in enumerate(items(top["history"], "history"))),
            seconds={
                phase: _from_json(x, f"seconds of phase {shown(phase)}")
                for phase, x in mapping(top["seconds"], "seconds").items()
            },
            forces=_forces(top["forces"], contacts),
            mechanism=_mechanism(top["mechanism"]),
            note=text(top.get("note", ""), "note"),
            versions=_versions(top.get("versions", {})),
            torsion_shear=text(top.get("torsion_shear", "linear"), "torsion_shear"),
            flow=text(top.get("flow", "associated"), "flow"),
            quantity=text(top.get("quantity", LOAD_FACTOR), "quantity"),
            members=tuple(
                _member(i, x) for i, x in enumerate(items(top.get("members", []), "members"))
            ),
            model=tuple(text(x, "a reduction") for x in items(top.get("model", []), "model")),
        )


_MEMBER_NUMBERS = ("load_factor", "equilibrium", "yield_excess", "flow", "complementarity")


def _member_to_dict(member: Member) -> JsonObject:
    """Load factor and residuals; forces and mechanism of the lowest are the result's own."""
    figures = {name: _to_json(getattr(member, name)) for name in _MEMBER_NUMBERS}
    return {"start": member.start, "iterations": member.iterations, **figures}


def _member(index: int, value: object) -> Member:
    where = f"entry {index} of members"
    entry = fields(value, where, ("start", "iterations", *_MEMBER_NUMBERS))
    figures = {name: _from_json(entry[name], f"{name} of {where}") for name in _MEMBER_NUMBERS}
    return Member(
        start=text(entry["start"], f"start of {where}"),
        iterations=whole(entry["iterations"], f"iterations of {where}"),
        forces=np.zeros((0, 6)),
        mechanism=np.zeros((0, 6)),
        **figures,
    )


def _to_json(value: float, no_bound: float | None = None) -> float | str | None:
    """A finite number as it is; others as texts, and None where they mean that nothing bounds."""
    plain = float(value)
    if plain == no_bound:
        return None
    return plain if math.isfinite(plain) else repr(plain)


def _from_json(value: object, where: str) -> float:
    if isinstance(value, str) and value in _NOT_FINITE:
        return float(value)
    return number(value, where, ANY_FINITE)


def _bound(value: object, end: str, where: str) -> float:
    return _NO_BOUND[end] if value is None else _from_json(value, where)


def _bracket_to_dict(bracket: Bracket) -> JsonObject:
    proved = [end for end in _NO_BOUND if getattr(bracket, f"{end}_is_proved")]
    return {"proved": proved, "least": _to_json(bracket.least)}


def _bracket(top: Mapping[str, object]) -> Bracket:
    """Results written by earlier versions have two bounds, and do not say what they rest on."""
    lower, upper = (_bound(top[end], end, end) for end in _NO_BOUND)
    if "bracket" not in top:
        return Bracket(lower, upper)
    basis = fields(top["bracket"], "bracket", ("proved", "least"))
    proved = items(basis["proved"], "proved of bracket")
    for end in proved:
        if end not in _NO_BOUND:
            raise InputError(f"proved of bracket must list 'lower' or 'upper', got {shown(end)}")
    least = _from_json(basis["least"], "least of bracket")
    return Bracket(lower, upper, "lower" in proved, "upper" in proved, least)


def _status(value: object) -> Status:
    try:
        return Status(text(value, "status"))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        known = ", ".join(repr(str(status)) for status in Status)
        raise InputError(f"status must be one of {known}, got {shown(value)}") from error


def _iterate_to_dict(iterate: Iterate) -> JsonObject:
    values = {f.name: getattr(iterate, f.name) for f in dataclass_fields(iterate)}
    return {
        name: str(value) if name in _ITERATE_TEXTS else _to_json(value, _NO_BOUND.get(name))
        for name, value in values.items()
        if value is not None
    }


def _iterate(index: int, value: object) -> Iterate:
    where = f"entry {index} of history"
    entry = fields(value, where, _ITERATE_REQUIRED, _ITERATE_OPTIONAL)
    optional = {
        name: _iterate_number(entry[name], name, where)
        for name in _ITERATE_OPTIONAL
        if name in entry
    }
    return Iterate(
        load_factor=optional.pop("load_factor", None),
        seconds=_from_json(entry["seconds"], f"seconds of {where}"),
        solver=text(entry["solver"], f"solver of {where}"),
        status=text(entry["status"], f"status of {where}"),
        **optional,
    )


def _iterate_number(value: object, name: str, where: str) -> float:
    what = f"{name} of {where}"
    return _bound(value, name, what) if name in _NO_BOUND else _from_json(value, what)


def _versions(value: object) -> dict[str, str]:
    found = mapping(value, "versions")
    return {name: text(x, f"version of {shown(name)}") for name, x in found.items()}


def _forces_to_list(forces: FloatArray | None) -> list[list[float]] | None:
    if forces is None:
        return None
    return [
        list(numbers(row.tolist(), COMPONENTS, f"force on contact {j}", ANY_FINITE))
        for j, row in enumerate(np.asarray(forces))
    ]


def _forces(value: object, contacts: int) -> FloatArray | None:
    if value is None:
        return None
    rows = items(value, "forces")
    if len(rows) != contacts:
        raise InputError(f"forces must be {contacts} rows, one for each contact, got {len(rows)}")
    checked = [
        numbers(row, COMPONENTS, f"force on contact {j}", ANY_FINITE) for j, row in enumerate(rows)
    ]
    return np.array(checked, dtype=float).reshape(-1, len(COMPONENTS))


def _mechanism_to_dict(mechanism: Mapping[str, FloatArray] | None) -> JsonObject | None:
    if mechanism is None:
        return None
    return {
        text(block, "a block id of the mechanism"): list(
            numbers(np.asarray(rates).tolist(), _RATES, _rates_of(block), ANY_FINITE)
        )
        for block, rates in mechanism.items()
    }


def _mechanism(value: object) -> dict[str, FloatArray] | None:
    if value is None:
        return None
    return {
        block: np.array(numbers(rates, _RATES, _rates_of(block), ANY_FINITE))
        for block, rates in mapping(value, "mechanism").items()
    }


def _rates_of(block: str) -> str:
    return f"mechanism of block {shown(block)}"
