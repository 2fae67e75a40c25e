"""JSON documents on disk, and checked access to their fields: refusals say where and what to do.

Functions from :func:`fields` to :func:`whole` take a ``value`` as JSON gives it, and ``where``, how
refusals call it ("friction of the scene"). They return the value as the type they are named after,
or raise :class:`~cvxlimit.errors.InputError`.
"""

from __future__ import annotations

import copy
import json
import os
import reprlib
import stat
import sys
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager

from cvxlimit.base.checks import meant
from cvxlimit.base.lines import one_line
from cvxlimit.errors import InputError

JsonObject = dict[str, object]

LARGEST_NUMBER = 1e30
"""Largest magnitude of a number in a scene. Weights are products of four of them and the
analysis squares moments; beyond this they would overflow. No units need more."""

ANY_FINITE = sys.float_info.max
"""Limit for numbers of a result: any finite double."""


class _Short(reprlib.Repr):
    """Also shortens numbers whose digits Python would refuse to write, or nobody would read."""

    def repr_int(self, x: int, level: int) -> str:
        return repr(x) if abs(x) < 10**60 else "a whole number of more than 60 digits"


_SHORT = _Short()
_SHORT.maxstring = _SHORT.maxother = 60
_SHORT.maxlevel = 3


def shown(value: object) -> str:
    """A value as a refusal quotes it: on one line, and not longer than one reads.

    >>> shown("two\\nlines")
    "'two\\\\nlines'"
    """
    return one_line(_SHORT.repr(value))


@contextmanager
def refusals(prefix: str = "") -> Iterator[None]:
    """Put ``prefix``, such as a file's name, before what is refused inside, all in one line."""
    try:
        yield
    except InputError as error:
        told = copy.copy(error)  # with all that it carries: points, blocks, a body
        told.args = (one_line(prefix) + one_line(str(error)),)
        raise told from error


def fields(
    value: object, where: str, required: Collection[str], optional: Collection[str] = ()
) -> JsonObject:
    """An object that has all required keys, and none that is neither required nor optional."""
    if not isinstance(value, dict):
        raise InputError(f"{where} must be an object {{...}}, got {shown(value)}")
    known = [*required, *optional]
    for key in value:
        if key not in known:
            raise InputError(f"{where} has an unknown key {shown(key)}; {_advice(key, known)}")
    for key in required:
        if key not in value:
            raise InputError(f"{where} lacks the key {key!r}; add {_EXAMPLES.get(key, 'it')}")
    return value


_EXAMPLES = {
    "dead": '"dead": {"gravity": [0, 0, -1]}',
    "live": '"live": {"acceleration": [0, 1, 0]}, or another direction',
}


def _advice(key: object, known: Collection[str]) -> str:
    """The key that was meant, where one is much like it, or else all that are known."""
    if isinstance(key, str) and len(key) <= 40:
        return meant(key, known, f"known keys are {', '.join(known)}")
    return f"known keys are {', '.join(known)}"


def mapping(value: object, where: str) -> dict[str, object]:
    """An object with any keys, as of blocks by their ids."""
    if not isinstance(value, dict):
        raise InputError(f"{where} must be an object {{...}}, got {shown(value)}")
    for key in value:
        text(key, f"a key of {where}")
    return value


def items(value: object, where: str) -> list[object] | tuple[object, ...]:
    """A list of any length; nothing is said of its entries."""
    if not isinstance(value, (list, tuple)):
        raise InputError(f"{where} must be a list [...], got {shown(value)}")
    return value


def text(value: object, where: str) -> str:
    """A text that can be written as UTF-8 again: JSON's escapes can spell half a character."""
    if not isinstance(value, str):
        raise InputError(f"{where} must be a text in quotes, got {shown(value)}")
    if not value.isascii() and any("\ud800" <= c <= "\udfff" for c in value):
        raise InputError(
            f"{where} holds half a character (a lone surrogate), got {shown(value)}; "
            "write valid Unicode"
        )
    return str(value)


def number(value: object, where: str, largest: float = LARGEST_NUMBER) -> float:
    """A finite number of at most ``largest`` in magnitude; True and False are none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        cure = "; remove the quotes" if isinstance(value, str) else ""
        if isinstance(value, str) and "," in value:
            cure = f"; write {value.replace(',', '.')[:40]}, without quotes"
        raise InputError(f"{where} must be a number, got {shown(value)}{cure}")
    if not abs(value) <= largest:
        cure = "choose other units or correct the value" if abs(value) > largest else "correct it"
        raise InputError(
            f"{where} must be a finite number of at most {largest:.3g}, got {shown(value)}; {cure}"
        )
    return float(value)


def numbers(
    value: object, names: Collection[str], where: str, largest: float = LARGEST_NUMBER
) -> tuple[float, ...]:
    """As many numbers as there are names, which refusals call them by: x, y, z."""
    row = value if isinstance(value, (list, tuple)) else None
    if row is None or len(row) != len(names):
        raise InputError(
            f"{where} must be {len(names)} numbers [{', '.join(names)}], got {shown(value)}"
        )
    return tuple(
        number(x, f"{name} of {where}", largest) for x, name in zip(row, names, strict=True)
    )


def whole(value: object, where: str) -> int:
    """A whole number from 0 on."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST_NUMBER:
        raise InputError(f"{where} must be a whole number from 0 on, got {shown(value)}")
    return value


def check_header(value: object, kind: str) -> None:
    """Refuse what does not say that it is a file of this kind, of the version known here."""
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


FilePath = str | os.PathLike[str]

LARGEST_FILE = 256 * 2**20
"""Bytes. A million boxes need about 150 MiB; more is a mistake, or meant to exhaust memory."""


def read_document(path: FilePath) -> object:
    """The JSON value in a file; errors leave the file's name to the caller."""
    return parsed(read_bytes(path))


def parsed(data: bytes) -> object:
    """The JSON value that bytes in UTF-8 hold.

    NaN and Infinity come out as floats, and the check of their field refuses them by name.
    """
    content = decoded(data)
    if not content.strip():
        raise InputError("the file is empty; expected a JSON object {...}")
    try:
        return json.loads(content, object_pairs_hook=_unique_keys)
    except InputError:
        raise
    except json.JSONDecodeError as error:
        raise InputError(
            f"not valid JSON at line {error.lineno}, column {error.colno}: {error.msg}"
        ) from error
    except RecursionError as error:
        raise InputError("brackets are nested too deeply; flatten the lists") from error
    except ValueError as error:  # only an integer beyond Python's limit of digits is left
        raise InputError("a number has thousands of digits; shorten it") from error


def encoded(document: Mapping[str, object]) -> bytes:
    """The bytes of a document's file; refused if a number is not finite or a text not Unicode."""
    try:
        return laid_out(document).encode("utf-8")
    except ValueError as error:
        raise InputError(f"cannot be written as JSON in UTF-8: {error}") from error


def laid_out(document: Mapping[str, object]) -> str:
    """JSON with one key, block, contact or force per line, which can be read and compared."""
    lines = [f" {_json(key)}: {_laid_out_value(value)}" for key, value in document.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


def file_prefix(path: FilePath) -> str:
    """What :func:`refusals` puts before a sentence on a file: its name."""
    return f"{one_line(os.fsdecode(path))}: "


def _laid_out_value(value: object) -> str:
    """With a line for each entry if any of them has entries of its own."""
    nested = (dict, list, tuple)
    if isinstance(value, dict) and any(isinstance(x, nested) for x in value.values()):
        rows = [f"{_json(key)}: {_json(x)}" for key, x in value.items()]
        return "{\n  " + ",\n  ".join(rows) + "\n }"
    if isinstance(value, (list, tuple)) and any(isinstance(x, nested) for x in value):
        return "[\n  " + ",\n  ".join(map(_json, value)) + "\n ]"
    return _json(value)


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


_AT_ONCE = getattr(os, "O_NONBLOCK", 0)
"""Flag that opens a pipe without waiting for who writes to it; absent on Windows."""


def read_bytes(path: FilePath, is_asked_for: bool = True) -> bytes:
    """The content of a file that the user asks for, which may be a pipe that another program
    fills, or of one that a file names, which must be a regular file: nobody may be there to write
    to a pipe, and it would be waited for without end."""
    at_once = 0 if is_asked_for else _AT_ONCE
    try:
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | at_once)) as file:
            if not (is_asked_for or stat.S_ISREG(os.fstat(file.fileno()).st_mode)):
                raise InputError(
                    "this is no regular file but a pipe or a device; save its content as a file"
                )
            data = file.read(LARGEST_FILE + 1)
    except IsADirectoryError as error:
        raise InputError("this is a folder; give the file inside it") from error
    except InputError:
        raise
    except FileNotFoundError as error:
        raise InputError("there is no such file; check the path") from error
    except (OSError, ValueError) as error:
        raise InputError(f"the file cannot be read: {_reason(error)}") from error
    if len(data) > LARGEST_FILE:
        raise InputError(f"the file is larger than {LARGEST_FILE / 2**20:g} MiB; split the scene")
    return data


def decoded(data: bytes) -> str:
    """Text in UTF-8, with or without a mark of byte order at its start."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"the file is not UTF-8: byte 0x{data[error.start]:02x} in line {line}; "
            "save it as UTF-8"
        ) from error


def _unique_keys(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """The object that pairs of key and value make; json alone would keep the last of equal keys."""
    result = dict(pairs)
    if len(result) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        where = f" of the object with id {shown(result['id'])}" if "id" in result else ""
        raise InputError(f"key {shown(twice)}{where} is given twice; keep one of them")
    return result


def _reason(error: OSError | ValueError) -> str:
    """What the system says, without the number of the error and the path, which others add."""
    return (error.strerror if isinstance(error, OSError) else None) or str(error)
