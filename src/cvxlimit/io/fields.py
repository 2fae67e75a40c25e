"""Checked access to the fields of a JSON document; each refusal says where and what to do."""

from __future__ import annotations

import copy
import difflib
import reprlib
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager

from cvxlimit.errors import InputError

JsonObject = dict[str, object]

LARGEST = 1e30
"""Largest magnitude of a number in a scene. Weights are products of four of them and the
analysis squares moments; beyond this they would overflow. No units need more."""

ANY_FINITE = sys.float_info.max
"""Limit for numbers of a result: any finite double."""


class _Short(reprlib.Repr):
    def repr_int(self, x: int, level: int) -> str:
        return repr(x) if abs(x) < 10**60 else "a whole number of more than 60 digits"


_SHORT = _Short()
_SHORT.maxstring = _SHORT.maxother = 60
_SHORT.maxlevel = 3


def shown(value: object) -> str:
    return one_line(_SHORT.repr(value))


def one_line(text: str) -> str:
    if len(text) > 500:
        text = f"{text[:250]} ... {text[-250:]}"
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


@contextmanager
def refusals(prefix: str = "") -> Iterator[None]:
    try:
        yield
    except InputError as error:
        told = copy.copy(error)  # with all that it carries: points, blocks, a body
        told.args = (one_line(prefix) + one_line(str(error)),)
        raise told from error


def fields(
    value: object, where: str, required: Collection[str], optional: Collection[str] = ()
) -> JsonObject:
    if not isinstance(value, dict):
        raise InputError(f"{where} must be an object {{...}}, got {shown(value)}")
    known = [*required, *optional]
    for key in value:
        if key not in known:
            raise InputError(f"{where} has an unknown key {shown(key)}; {_advice(key, known)}")
    for key in required:
        if key not in value:
            raise InputError(f"{where} lacks the key {key!r}; add it")
    return value


def _advice(key: object, known: Collection[str]) -> str:
    if isinstance(key, str) and len(key) <= 40:
        close = difflib.get_close_matches(key.lower(), known, n=1)
        if close:
            return f"did you mean {close[0]!r}?"
    return f"known keys are {', '.join(known)}"


def mapping(value: object, where: str) -> dict[str, object]:
    if not isinstance(value, dict):
        raise InputError(f"{where} must be an object {{...}}, got {shown(value)}")
    for key in value:
        text(key, f"a key of {where}")
    return value


def items(value: object, where: str) -> list[object] | tuple[object, ...]:
    if not isinstance(value, (list, tuple)):
        raise InputError(f"{where} must be a list [...], got {shown(value)}")
    return value


def text(value: object, where: str) -> str:
    if not isinstance(value, str):
        raise InputError(f"{where} must be a text in quotes, got {shown(value)}")
    if not value.isascii() and any("\ud800" <= c <= "\udfff" for c in value):
        raise InputError(
            f"{where} holds half a character (a lone surrogate), got {shown(value)}; "
            "write valid Unicode"
        )
    return str(value)


def number(value: object, where: str, largest: float = LARGEST) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        cure = "; remove the quotes" if isinstance(value, str) else ""
        raise InputError(f"{where} must be a number, got {shown(value)}{cure}")
    if not abs(value) <= largest:
        raise InputError(
            f"{where} must be a finite number of at most {largest:.3g}, got {shown(value)}; "
            "choose other units or correct the value"
        )
    return float(value)


def numbers(
    value: object, names: Collection[str], where: str, largest: float = LARGEST
) -> tuple[float, ...]:
    row = value if isinstance(value, (list, tuple)) else None
    if row is None or len(row) != len(names):
        raise InputError(
            f"{where} must be {len(names)} numbers [{', '.join(names)}], got {shown(value)}"
        )
    return tuple(
        number(x, f"{name} of {where}", largest) for x, name in zip(row, names, strict=True)
    )


def whole(value: object, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST:
        raise InputError(f"{where} must be a whole number from 0 on, got {shown(value)}")
    return value


def check_header(value: object, kind: str) -> None:
    name = f"cvxlimit-{kind}"
    if not isinstance(value, dict):
        raise InputError(f"a {kind} must be a JSON object {{...}}, got {shown(value)}")
    if "nbformat" in value:
        raise InputError(f"this is a notebook; let it write its {kind} with write_{kind}")
    newer = "write the file for version 1, or install a newer cvxlimit"
    for key, wanted, quoted, cure in (
        ("format", name, repr(name), f"this is not a {kind} file"),
        ("version", 1, "1", newer),
    ):
        if key not in value:
            in_json = quoted.replace("'", '"')
            raise InputError(f'the {kind} lacks the key {key!r}; add "{key}": {in_json}')
        if type(value[key]) is not type(wanted) or value[key] != wanted:
            raise InputError(f"{key} must be {quoted}, got {shown(value[key])}; {cure}")
