"""OFF (object file format), as text: counts, vertices a line each, faces a line each."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import numpy as np

from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body
from cvxlimit.io.fields import shown

_HEADER = re.compile(r"(ST)?C?N?OFF\b\s*", re.IGNORECASE)
"""What may stand before the counts: of texture, colour and normals only the place is taken."""


def read_off(text: str) -> list[Body]:
    """The mesh of an OFF file, whose bodies are told apart afterwards."""
    lines = _lines(text)
    number, first = next(lines, (0, ""))
    header = _HEADER.match(first)
    if header is None:
        raise InputError(
            f"line {number} must say OFF, got {shown(first[:40])}; save as OFF in text with three "
            "coordinates"
        )
    rest = first[header.end() :]
    if "BINARY" in rest.upper():
        raise InputError("the OFF file is binary; save it as text")
    number, counts = (number, rest) if rest else next(lines, (number, ""))
    what = "the counts of vertices and faces"
    vertices, faces = (int(x) for x in _numbers(counts, number, what, int, 2))
    if vertices < 0 or faces < 0 or vertices + faces > len(text):
        raise InputError(f"line {number} counts {vertices} vertices and {faces} faces: more than "
                         "the file holds")  # fmt: skip
    points = [_row(lines, "vertex", vertices, i) for i in range(vertices)]
    corners = [_numbers(line, n, "a vertex", float, 3) for n, line in points]
    loops = [_face(*_row(lines, "face", faces, i), vertices) for i in range(faces)]
    return [Body("", np.array(corners, dtype=float).reshape(-1, 3), loops)]


def _lines(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), 1):
        line = line.split("#", 1)[0].strip()
        if line:
            yield number, line


def _row(lines: Iterator[tuple[int, str]], what: str, count: int, i: int) -> tuple[int, str]:
    row = next(lines, None)
    if row is None:
        raise InputError(f"the file ends before {what} {i} of {count}: it is cut off")
    return row


def _face(number: int, line: str, count: int) -> list[int]:
    words = line.split()
    size = int(_numbers(words[0], number, "the corners of a face", int, 1)[0])
    corners = [int(i) for i in _numbers(line, number, "a face", int, 1 + size)[1:]]
    if size < 3 or not all(0 <= i < count for i in corners):
        raise InputError(
            f"line {number}: a face must list at least three of the vertices 0 to {count - 1}, got "
            f"{shown(line[:60])}"
        )
    return corners


def _numbers(
    line: str, number: int, what: str, kind: Callable[[str], float], least: int
) -> list[float]:
    words = line.split()[: max(least, 0)]
    try:
        found = [kind(word) for word in words]
    except ValueError:
        found = []
    if len(found) < least or not found:
        raise InputError(f"line {number}: {what} must be {least} numbers, got {shown(line[:60])}")
    return found
