"""JSON documents on disk: read strictly, encoded in UTF-8."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Mapping

from cvxlimit.errors import InputError
from cvxlimit.io.fields import one_line, shown

Path = str | os.PathLike[str]

LARGEST_FILE = 256 * 2**20
"""Bytes. A million boxes need about 150 MiB; more is a mistake, or meant to exhaust memory."""


def read_document(path: Path) -> object:
    """The JSON value in a file, which refusals do not name: the caller does."""
    return parsed(read_bytes(path))


def parsed(data: bytes) -> object:
    """NaN and Infinity come out as floats, and the check of their field refuses them by name."""
    text = decoded(data)
    if not text.strip():
        raise InputError("the file is empty; expected a JSON object {...}")
    try:
        return json.loads(text, object_pairs_hook=_unique_keys)
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
    try:
        return laid_out(document).encode("utf-8")
    except ValueError as error:
        raise InputError(f"cannot be written as JSON in UTF-8: {error}") from error


def laid_out(document: Mapping[str, object]) -> str:
    """JSON with one key per line and one block, contact or force per line: to read and to diff."""
    lines = [f" {_json(key)}: {_laid_out_value(value)}" for key, value in document.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


def file_prefix(path: Path) -> str:
    return f"{one_line(os.fsdecode(path))}: "


def _laid_out_value(value: object) -> str:
    nested = (dict, list, tuple)
    if isinstance(value, dict) and any(isinstance(x, nested) for x in value.values()):
        rows = [f"{_json(key)}: {_json(x)}" for key, x in value.items()]
        return "{\n  " + ",\n  ".join(rows) + "\n }"
    if isinstance(value, (list, tuple)) and any(isinstance(x, nested) for x in value):
        return "[\n  " + ",\n  ".join(map(_json, value)) + "\n ]"
    return _json(value)


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def read_bytes(path: Path) -> bytes:
    try:
        with open(path, "rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except IsADirectoryError as error:
        raise InputError("this is a folder; give the file inside it") from error
    except FileNotFoundError as error:
        raise InputError("there is no such file; check the path") from error
    except (OSError, ValueError) as error:
        raise InputError(f"the file cannot be read: {_reason(error)}") from error
    if len(data) > LARGEST_FILE:
        raise InputError(f"the file is larger than {LARGEST_FILE / 2**20:g} MiB; split the scene")
    return data


def decoded(data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"the file is not UTF-8: byte 0x{data[error.start]:02x} in line {line}; "
            "save it as UTF-8"
        ) from error


def _unique_keys(pairs: list[tuple[str, object]]) -> dict[str, object]:
    result = dict(pairs)
    if len(result) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        where = f" of the object with id {shown(result['id'])}" if "id" in result else ""
        raise InputError(f"key {shown(twice)}{where} is given twice; keep one of them")
    return result


def _reason(error: OSError | ValueError) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)
