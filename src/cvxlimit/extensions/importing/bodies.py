"""Bodies as geometry files hold them, and the separate bodies in one mesh."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.errors import InputError
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, EdgeTable, Faces, flipped, linked
from cvxlimit.geometry.polyhedra import JOINT_TOLERANCE
from cvxlimit.geometry.shells import Shells, by_shell, nested, volumes
from cvxlimit.io.fields import decoded, one_line, read_bytes


@dataclass(frozen=True, eq=False)
class Body:
    """One solid of a geometry file, as given: nothing checked, nothing repaired.

    The name is empty, support mark, density and ``unit`` of length are None where the file has
    none. A box has two ``vertices``, its opposite corners, and no faces.
    """

    name: str
    vertices: FloatArray
    faces: Sequence[Sequence[int]]
    is_support: bool | None = None
    density: float | None = None
    is_box: bool = False
    unit: str | None = None


@contextmanager
def read_by_others(kind: str, cure: str) -> Iterator[None]:
    """Refuse in one sentence what a library stumbles over: its parsers let anything through."""
    try:
        yield
    except InputError:
        raise
    except MemoryError as error:
        raise InputError("the file claims more than fits into memory") from error
    except Exception as error:
        reason = one_line(f"{type(error).__name__}: {error}")[:200]
        raise InputError(f"cannot be read as {kind} ({reason}); {cure}") from error


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """The numbered lines of a text that say something: a # begins a comment, and a backslash at the
    end of a line joins the next to it."""
    begun = ""
    for number, line in enumerate(decoded(read_bytes(path)).splitlines(), 1):
        line = begun + line.split("#", 1)[0].strip()
        begun = f"{line[:-1]} " if line.endswith("\\") else ""
        if line and not begun:
            yield number, line
    if begun.strip():
        yield number, begun.strip()


def natural(name: str) -> list[tuple[bool, int, str]]:
    """A key for sorting by which "b2" comes before "b10"; of numbers the longer are larger."""
    parts = [(part.isdecimal(), part.lstrip("0")) for part in re.findall(r"\d+|\D+", name)]
    return [(is_number, len(part) if is_number else 0, part) for is_number, part in parts]


def merged(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """The mesh with equal vertices made one, for formats that store every corner by itself."""
    kept, first, number = np.unique(vertices + 0.0, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return kept[order], place[np.asarray(number).reshape(-1)][faces]


def with_faces(
    vertices: FloatArray, faces: Sequence[Sequence[int]]
) -> tuple[FloatArray, list[list[int]]]:
    used, number = np.unique(np.concatenate(faces), return_inverse=True)
    ends = np.cumsum([len(face) for face in faces])[:-1]
    own = np.split(np.asarray(number).reshape(-1), ends)
    return vertices[used], [face.tolist() for face in own]


def separated(body: Body) -> list[Body]:
    """The bodies that ``body`` is made of, each with its own vertices; itself if it is one.

    Faces belong together when they bound the same material, however they are turned: at an edge of
    two faces always, at an edge of four (two bricks that share it) those on either side of a wedge
    of stone. A shell within another is its cavity and stays with it, if their faces go round in
    opposite ways. Shells that are not closed stay together, for a repair to try.
    """
    if body.is_box or not len(body.faces):
        return [body]
    if min(map(len, body.faces)) < 3 or not np.isfinite(body.vertices).all():
        return [body]  # whoever builds the block says what is wrong
    if _is_one_shell(body.faces):
        return [body]
    points, place = np.unique(body.vertices + 0.0, axis=0, return_inverse=True)
    place = np.asarray(place).reshape(-1)
    try:
        faces = tuple(tuple(place[list(face)].tolist()) for face in body.faces)
    except IndexError:
        return [body]
    found = Shells.of(points, faces, EdgeTable.of(faces))
    label = _with_cavities_joined(points, faces, found)
    label = _with_sheets_apart(points, faces, label, found.closed)
    numbers, first = np.unique(label, return_index=True)
    if len(numbers) == 1:
        return [body]
    name = f"{body.name}." if body.name else "b"
    members = [np.flatnonzero(label == number) for number in numbers[np.argsort(first)]]
    return [_part(body, faces, f"{name}{i}") for i, faces in enumerate(members, 1)]


def _is_one_shell(faces: Sequence[Sequence[int]]) -> bool:
    """True if every edge has two faces and all hang together: nearly always, and quickly told."""
    table = EdgeTable.of(faces)
    one, other = (table.face[side] for side in table.twins())
    return bool((table.uses == 2).all()) and not linked(len(faces), one, other).any()


def _part(body: Body, faces: IntArray, name: str) -> Body:
    vertices, own = with_faces(body.vertices, [body.faces[i] for i in faces.tolist()])
    return replace(body, name=name, vertices=vertices, faces=own)


def _with_cavities_joined(points: FloatArray, faces: Faces, found: Shells) -> IntArray:
    """Shells by number, cavities as what they lie in. Faces that a program listed twice, or once
    from either side, are no second body."""
    shell, outwards = found.shell, flipped(faces, found.turned)
    result = np.arange(int(shell.max()) + 1)
    given, size = volumes(points, faces, shell) < 0.0, volumes(points, outwards, shell)
    closed = np.isin(result, shell[found.closed])
    first: dict[frozenset[frozenset[int]], int] = {}
    for number, own in enumerate(by_shell(faces, shell)):
        result[number] = first.setdefault(frozenset(map(frozenset, own)), number)
    if not given[closed].any() or given[closed].all():
        return np.asarray(result[shell])
    pairs = nested(points, outwards, shell, given)
    for inner, outer in sorted(pairs, key=lambda pair: -size[pair[1]]):  # the smallest comes last
        if closed[inner] and closed[outer] and result[inner] != result[outer]:
            result[inner] = result[outer]
    return np.asarray(result[shell])


def _with_sheets_apart(
    points: FloatArray, faces: Faces, label: IntArray, closed: BoolArray
) -> IntArray:
    """Open faces that lie in one plane, and by themselves, are a body: ground of no thickness. Near
    other open faces they may be part of a torn shell, and stay with that."""
    rows = np.flatnonzero(~closed)
    if not len(rows):
        return label
    corner = np.concatenate([faces[i] for i in rows.tolist()])
    owner = np.repeat(np.arange(len(rows)), [len(faces[i]) for i in rows.tolist()])
    order = np.argsort(corner, kind="stable")
    same = np.flatnonzero(np.diff(corner[order]) == 0)
    part = linked(len(rows), owner[order[same]], owner[order[same + 1]])
    result = label.copy()
    for number in range(int(part.max()) + 1):
        own, others = (
            np.unique(corner[(part == number)[owner] == is_own]) for is_own in (True, False)
        )
        if len(own) < 3 or not is_plane(points[own]):
            continue
        near = JOINT_TOLERANCE * float(np.linalg.norm(np.ptp(points[own], axis=0)))
        if len(others) and np.min(cKDTree(points[others]).query(points[own])[0]) < near:
            continue
        result[rows[part == number]] = result.max() + 1
    return result


def is_plane(points: FloatArray) -> bool:
    """True for points (k, 3) that all lie in one plane and span it."""
    if len(points) < 3:
        return False
    _, wide, thick = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[1]
    flat = RELATIVE_TOLERANCE * float(np.linalg.norm(np.ptp(points, axis=0)))
    return bool(thick <= flat < wide)
