"""OFF (object file format), as text: counts, vertices a line each, faces a line each."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, lines_of
from cvxlimit.io.fields import shown

T = TypeVar("T")

_HEADER = re.compile(r"(ST)?C?N?OFF\b\s*", re.IGNORECASE)
"""What may stand before the counts: of texture, colour and normals only the place is taken."""


def read_off(path: Path, notes: list[str]) -> list[Body]:
    """The mesh of an OFF file, whose bodies are told apart afterwards."""
    lines = [*lines_of(path)]
    # 1. The word OFF, and the counts behind it or in the next line.
    (number, first), *rest = lines or [(0, "")]
    header = _HEADER.match(first)
    if header is None:
        raise InputError(
            f"line {number} must say OFF, got {shown(first[:40])}; save as OFF in text with three "
            "coordinates"
        )
    counts = first[header.end() :]
    if "BINARY" in counts.upper():
        raise InputError("the OFF file is binary; save it as text")
    if not counts:
        (number, counts), *rest = rest or [(number, "")]
    vertices, faces = _numbers(counts, number, "the counts of vertices and faces", int, 2)
    if min(vertices, faces) < 0 or vertices + faces > len(rest):
        raise InputError(
            f"line {number} counts {vertices} vertices and {faces} faces: more than the file "
            "holds; it is cut off, or the counts are wrong"
        )
    # 2. Vertices by their coordinates, then faces: how many corners, and which.
    corners = [_numbers(line, n, "a vertex", float, 3) for n, line in rest[:vertices]]
    loops = [_face(line, n, vertices) for n, line in rest[vertices : vertices + faces]]
    return [Body("", np.array(corners, dtype=float).reshape(-1, 3), loops)]


def _face(line: str, number: int, count: int) -> list[int]:
    (size,) = _numbers(line, number, "the corners of a face", int, 1)
    corners = _numbers(line, number, "a face", int, 1 + size)[1:]
    if size < 3 or not all(0 <= i < count for i in corners):
        raise InputError(
            f"line {number}: a face must list at least three of the vertices 0 to {count - 1}, got "
            f"{shown(line[:60])}"
        )
    return corners


def _numbers(line: str, number: int, what: str, kind: Callable[[str], T], least: int) -> list[T]:
    """The first ``least`` numbers of a line."""
    try:
        found = [kind(word) for word in line.split()[: max(least, 0)]]
    except ValueError:
        found = []
    if len(found) < least or not found:
        raise InputError(f"line {number}: {what} must be {least} numbers, got {shown(line[:60])}")
    return found
