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
from cvxlimit.base.lines import one_line
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.steps import step_of
from cvxlimit.geometry.mesh import (
    RELATIVE_TOLERANCE,
    SLIVER,
    EdgeTable,
    Faces,
    area_vectors,
    flipped,
    linked,
    with_corners_on,
)
from cvxlimit.geometry.polyhedra import JOINT_TOLERANCE
from cvxlimit.geometry.shells import Shells, by_shell, nested, volumes
from cvxlimit.io.fields import LARGEST_NUMBER, decoded, read_bytes


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
    """The corners (k, 3) that faces have, and the faces by their numbers."""
    used, number = np.unique(np.concatenate(faces), return_inverse=True)
    ends = np.cumsum([len(face) for face in faces])[:-1]
    own = np.split(np.asarray(number).reshape(-1), ends)
    return vertices[used], [face.tolist() for face in own]


def separated(body: Body) -> list[Body]:
    """The bodies that ``body`` is made of, each with its own vertices; itself if it is one.

    Faces belong together when they bound the same material, however they are turned: at an edge of
    two faces always, at an edge of four (two bricks that share it) those on either side of a wedge
    of stone. A shell within another is its cavity and stays with it, if their faces go round in
    opposite ways. Shells that are not closed stay together, for a repair to try, and slivers with
    what they lie on.
    """
    if body.is_box or not len(body.faces):
        return [body]
    if min(map(len, body.faces)) < 3 or not (np.abs(body.vertices) <= LARGEST_NUMBER).all():
        return [body]  # whoever builds the block says what is wrong
    if _is_one_shell(body.faces):
        return [body]
    try:
        points, faces = _as_one_point(body)
    except IndexError:
        return [body]
    has_corners = np.array([len(set(face)) > 2 for face in faces])
    if not has_corners.any():
        return [body]
    # Three corners that are each half a step off lie less than two steps off a line.
    blur = 2.0 * step_of(body.vertices)
    has_area = has_corners & _has_area(points, faces, blur)
    if not has_area.any():
        return [body]
    wide, taken, shells = _told_apart(points, faces, has_corners, has_area, blur)
    listed = [body.faces[i] for i in np.flatnonzero(wide).tolist()]
    label = np.full(len(faces), -1)
    own = _with_cavities_joined(points, taken, shells, listed)
    label[wide] = _with_sheets_apart(points, taken, own, shells.closed)
    label = _with_slivers_joined(points, faces, label)
    numbers, first = np.unique(label, return_index=True)
    if not wide.all():  # they keep two corners, and are counted among the repairs of their stone
        rows = zip(body.faces, wide.tolist(), strict=True)
        body = replace(body, faces=[f if is_wide else (f[0], f[1], f[0]) for f, is_wide in rows])
    if len(numbers) == 1:
        return [body]
    name = f"{body.name}." if body.name else "b"
    members = [np.flatnonzero(label == number) for number in numbers[np.argsort(first)]]
    return [_part(body, faces, f"{name}{i}") for i, faces in enumerate(members, 1)]


def _as_one_point(body: Body) -> tuple[FloatArray, Faces]:
    """Points and faces with corners that are the same to rounding as one, for what hangs together:
    two stones that share a face stay two where one has a corner twice, a hair apart."""
    points, place = np.unique(body.vertices + 0.0, axis=0, return_inverse=True)
    place = np.asarray(place).reshape(-1)
    loops = [place[list(face)] for face in body.faces]
    near = RELATIVE_TOLERANCE * _size(points, loops)
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
    if len(pairs):
        label = linked(len(points), *pairs.T)
        _, first, number = np.unique(label, return_index=True, return_inverse=True)
        points, number = points[first], np.asarray(number).reshape(-1)
        loops = [number[loop] for loop in loops]
    faces = (loop[loop != np.roll(loop, 1)] for loop in loops)
    whole = zip(faces, loops, strict=True)
    return points, tuple(tuple((face if len(face) else loop[:1]).tolist()) for face, loop in whole)


def _shells_among(
    points: FloatArray, faces: Faces, chosen: BoolArray, blur: float
) -> tuple[Faces, Shells]:
    some = tuple(faces[i] for i in np.flatnonzero(chosen).tolist())
    return some, Shells.of(points, some, EdgeTable.of(some), blur)


def _told_apart(
    points: FloatArray, faces: Faces, has_corners: BoolArray, has_area: BoolArray, blur: float
) -> tuple[BoolArray, Faces, Shells]:
    """The faces that count, as they are taken, and their shells: of up to three attempts the first
    whose shells all close, else the last.

    1. Faces with an area alone (which way others look is rounding, and leads from one stone to the
       next), edges cut on both sides where they are cut on one, as two stones at the same place may
       have them;
    2. the same with edges as they are, if any was cut;
    3. faces without an area as well, if there are any.
    """
    some = tuple(faces[i] for i in np.flatnonzero(has_area).tolist())
    within = max(RELATIVE_TOLERANCE * _size(points, some), blur)
    table, used = EdgeTable.of(some), np.unique(np.concatenate(some))
    cut, joined = with_corners_on(np.arange(len(table.key)), used, within, points, table, some)
    attempts = [has_area] if joined else []
    if not has_area[has_corners].all():
        attempts.append(has_corners)
    counted, taken, shells = has_area, cut, Shells.of(points, cut, EdgeTable.of(cut), blur)
    for chosen in attempts:
        if shells.closed.all():
            break
        counted, (taken, shells) = chosen, _shells_among(points, faces, chosen, blur)
    return counted, taken, shells


def _size(points: FloatArray, faces: Faces | list[IntArray]) -> float:
    """The median size of the faces (length)."""
    return float(np.median([np.linalg.norm(np.ptp(points[list(f)], axis=0)) for f in faces]))


def _has_area(points: FloatArray, faces: Faces, blur: float) -> BoolArray:
    """False (f,) for faces that are nowhere wider than rounding, or the ``blur`` of corners."""
    areas = np.linalg.norm(area_vectors(points, faces), axis=1)
    long = np.array([np.ptp(points[list(face)], axis=0).max() for face in faces])
    return np.asarray(areas > np.maximum(RELATIVE_TOLERANCE * long, 0.5 * blur) * long)


def _with_slivers_joined(points: FloatArray, faces: Faces, label: IntArray) -> IntArray:
    """Slivers as what they lie on: triangles of two corners (label -1), and faces from both sides
    that close by themselves, where an edge of next to no length has been cut off."""
    ends = np.cumsum([len(face) for face in faces])
    corner, owner = (
        np.concatenate(faces),
        np.repeat(np.arange(len(faces)), np.diff(ends, prepend=0)),
    )
    numbers = np.unique(label).tolist()
    thin = {
        number
        for number in numbers
        if number < 0 or _is_sliver(points[np.unique(corner[label[owner] == number])])
    }
    is_thin = np.isin(label, list(thin))
    if not thin or is_thin.all():
        return label
    # What has most of its corners, or else the corner that is nearest.
    stones = np.flatnonzero(~is_thin[owner])
    tree, result = cKDTree(points[corner[stones]]), label.copy()
    for number in thin:
        rows = np.flatnonzero(label == number)
        for some in [rows] if number >= 0 else rows[:, None]:  # each of two corners by itself
            own = np.unique(np.concatenate([faces[i] for i in some.tolist()]))
            shared = stones[np.isin(corner[stones], own)]
            pairs = np.unique(np.stack([label[owner[shared]], corner[shared]]), axis=1)
            nearest = label[owner[stones[tree.query(points[own].mean(axis=0))[1]]]]
            result[some] = np.bincount(pairs[0]).argmax() if pairs.size else nearest
    return result


def _is_sliver(points: FloatArray) -> bool:
    """True for points in a plane, to rounding, that are a thousand times as long as wide."""
    sides = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(sides[1] <= SLIVER * sides[0] and sides[-1] <= RELATIVE_TOLERANCE * sides[0])


def _is_one_shell(faces: Sequence[Sequence[int]]) -> bool:
    """True if every edge has two faces and all hang together, as nearly always; quick to tell."""
    table = EdgeTable.of(faces)
    one, other = (table.face[side] for side in table.twins())
    return bool((table.uses == 2).all()) and not linked(len(faces), one, other).any()


def _part(body: Body, faces: IntArray, name: str) -> Body:
    vertices, own = with_faces(body.vertices, [body.faces[i] for i in faces.tolist()])
    return replace(body, name=name, vertices=vertices, faces=own)


def _with_cavities_joined(
    points: FloatArray, faces: Faces, found: Shells, listed: Sequence[Sequence[int]]
) -> IntArray:
    """Shells by number, cavities as what they lie in. A shell with the same faces as one before is
    no second body if it shares corners with it in the file (``listed``), or is turned the other way
    round; a copy with corners of its own, turned the same way, is one."""
    shell, outwards = found.shell, flipped(faces, found.turned)
    result = np.arange(int(shell.max()) + 1)
    is_inverted, size = volumes(points, faces, shell) < 0.0, volumes(points, outwards, shell)
    closed = np.isin(result, shell[found.closed])
    corners = [{i for face in own for i in face} for own in by_shell(listed, shell)]
    first: dict[frozenset[frozenset[int]], int] = {}
    for number, own in enumerate(by_shell(faces, shell)):
        same = first.setdefault(frozenset(map(frozenset, own)), number)
        if is_inverted[same] != is_inverted[number] or corners[same] & corners[number]:
            result[number] = same
    if not is_inverted[closed].any() or is_inverted[closed].all():
        return np.asarray(result[shell])
    pairs = nested(points, outwards, shell, is_inverted)
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
