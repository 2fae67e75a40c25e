"""Wavefront OBJ with every polygon, object and group kept.

A reader of our own: trimesh merges all objects of the files it was tried on into one mesh of
triangles (with each of its options for objects); meshio keeps polygons and numbers of groups, but
neither objects nor names. Nothing else of the format matters here, and no other file is opened.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, lines_of, with_faces
from cvxlimit.io.fields import shown

_NOT_GEOMETRY = {
    "vt", "vn", "vp", "s", "usemtl", "mtllib", "usemap", "maplib", "shadow_obj",
    "trace_obj", "bevel", "c_interp", "d_interp", "lod", "mg",
}  # fmt: skip
"""Statements that are skipped; free-form surfaces are not among them."""


@dataclass
class _Part:
    object: int
    group: str
    name: str
    faces: list[list[int]] = field(default_factory=list)


def read_obj(path: Path, notes: list[str]) -> list[Body]:
    """The objects of an OBJ file; its groups where it has no more than one object."""
    vertices: list[list[float]] = []
    parts, without = [_Part(0, "", "")], 0
    for number, line in lines_of(path):
        key, *words = line.split()
        if key == "v":
            vertices.append(_coordinates(words, number))
        elif key == "f":
            parts[-1].faces.append(_corners(words, len(vertices), number))
        elif key == "o":
            parts.append(_Part(parts[-1].object + 1, "", " ".join(words)))
        elif key == "g":
            parts.append(_Part(parts[-1].object, " ".join(words), parts[-1].name))
        elif key in ("l", "p"):
            without += 1
        elif key not in _NOT_GEOMETRY:
            raise InputError(
                f"line {number} is no statement of a polygon mesh: {shown(line)}; export the "
                "blocks as meshes"
            )
    if without:
        notes.append(f"{without} lines or points of the file are no faces, and are left out")
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    return [Body(name, *with_faces(points, faces)) for name, faces in _blocks(parts)]


def _blocks(parts: list[_Part]) -> Iterator[tuple[str, list[list[int]]]]:
    parts = [part for part in parts if part.faces]
    by_object = len({part.object for part in parts}) > 1
    blocks: dict[object, tuple[str, list[list[int]]]] = {}
    for part in parts:
        key, name = (part.object, part.name) if by_object else (part.group, part.group or part.name)
        blocks.setdefault(key, (name, []))[1].extend(part.faces)
    yield from blocks.values()


def _coordinates(words: list[str], number: int) -> list[float]:
    try:
        row = [float(word) for word in words[:3]]
    except ValueError as error:
        raise InputError(
            f"line {number}: a vertex must be three numbers, got {shown(' '.join(words))}"
        ) from error
    if len(row) < 3:
        raise InputError(f"line {number}: a vertex must be three numbers, got {len(row)}")
    return row


def _corners(words: list[str], count: int, number: int) -> list[int]:
    result = []
    for word in words:
        try:
            index = int(word.split("/", 1)[0])
        except ValueError as error:
            raise InputError(
                f"line {number}: a face must list vertex numbers, got {shown(word)}"
            ) from error
        place = index - 1 if index > 0 else count + index
        if index == 0 or not 0 <= place < count:
            raise InputError(
                f"line {number}: a face names vertex {index}, but {count} vertices are given "
                "before it, numbered from 1"
            )
        result.append(place)
    if len(result) < 3:
        raise InputError(f"line {number}: a face needs at least three vertices, got {len(result)}")
    return result
