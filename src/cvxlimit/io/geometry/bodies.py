"""Bodies as geometry files hold them, and the separate bodies in one mesh."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.mesh import EdgeTable, area_vectors, volume_and_centroid

SAME_ANGLE = 1e-6
"""Radians within which two faces at an edge count as one behind the other: between what double
precision leaves of equal angles (1e-15, more at slivers) and the flattest real edges."""


@dataclass(frozen=True, eq=False)
class Body:
    """One solid of a geometry file, as given: nothing checked, nothing repaired.

    The name is empty, support mark and density are None where the file has none. A box has two
    ``vertices``, its opposite corners, and no faces.
    """

    name: str
    vertices: FloatArray
    faces: Sequence[Sequence[int]]
    is_support: bool | None = None
    density: float | None = None
    is_box: bool = False


def natural(name: str) -> list[tuple[bool, int, str]]:
    parts: list[str] = []
    for character in name:
        if parts and parts[-1][-1].isdecimal() == character.isdecimal():
            parts[-1] += character
        else:
            parts.append(character)
    return [(p.isdecimal(), int(p) if p.isdecimal() else 0, p) for p in parts]


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

    Faces belong together when they bound the same material: at an edge of two faces always, at an
    edge of four (two bricks that share it) those on either side of a wedge of stone. A shell that
    is turned inside out within another is its cavity and stays with it. Shells that are not closed
    stay together, for a repair to try.
    """
    if body.is_box or not len(body.faces) or _is_one_shell(body.faces):
        return [body]
    if min(map(len, body.faces)) < 3 or not np.isfinite(body.vertices).all():
        return [body]  # whoever builds the block says what is wrong
    _, place = np.unique(body.vertices + 0.0, axis=0, return_inverse=True)
    place = np.asarray(place).reshape(-1)
    try:
        edges = EdgeTable.of([place[list(face)].tolist() for face in body.faces])
    except IndexError:
        return [body]
    label = _shells(body, edges)
    if not label.any():
        return [body]
    sides = np.stack([label[edges.face], edges.key])
    (of_shell, _), uses = np.unique(sides, axis=1, return_counts=True)
    is_open = np.isin(label, of_shell[uses % 2 == 1])
    label[is_open] = label[is_open].min(initial=len(label))
    label = _with_cavities_joined(body, label)
    numbers, first = np.unique(label, return_index=True)
    if len(numbers) == 1:
        return [body]
    name = f"{body.name}." if body.name else "b"
    members = [np.flatnonzero(label == number) for number in numbers[np.argsort(first)]]
    return [_part(body, faces, f"{name}{i}") for i, faces in enumerate(members, 1)]


def _is_one_shell(faces: Sequence[Sequence[int]]) -> bool:
    """True if every edge has two faces and all hang together: nearly always, and quickly told."""
    if len(faces) > 64:  # up to there plain Python is faster than arrays
        return False
    at: dict[tuple[int, int], list[int]] = defaultdict(list)
    for number, face in enumerate(faces):
        for i, k in zip(face, (*face[1:], face[0]), strict=True):
            at[min(i, k), max(i, k)].append(number)
    if any(len(two) != 2 for two in at.values()):
        return False
    shell = list(range(len(faces)))
    for one, other in at.values():
        if shell[one] != shell[other]:
            shell = [shell[one] if x == shell[other] else x for x in shell]
    return len(set(shell)) == 1


def _part(body: Body, faces: IntArray, name: str) -> Body:
    vertices, own = with_faces(body.vertices, [body.faces[i] for i in faces.tolist()])
    return replace(body, name=name, vertices=vertices, faces=own)


def _shells(body: Body, edges: EdgeTable) -> IntArray:
    pairs = [edges.face[np.stack(edges.twins(), axis=1)]]
    several = np.flatnonzero(edges.uses > 2)
    if len(several):
        normals = area_vectors(body.vertices, body.faces)
        order, end = np.argsort(edges.key, kind="stable"), np.cumsum(edges.uses)
        forward = edges.start < edges.end
        corners = np.concatenate([np.asarray(face) for face in body.faces])  # as sides begin
        following = np.concatenate([np.roll(face, -1) for face in body.faces])
        for group in several:
            sides = order[end[group] - edges.uses[group] : end[group]]
            along = body.vertices[following[sides[0]]] - body.vertices[corners[sides[0]]]
            axis = along if forward[sides[0]] else -along
            face = edges.face[sides]
            pairs.append(_around(axis, normals[face], forward[sides], face))
    joined = np.concatenate(pairs)
    graph = coo_array((np.ones(len(joined)), joined.T), shape=(len(body.faces),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _around(
    axis: FloatArray, normals: FloatArray, forward: NDArray[np.bool_], face: IntArray
) -> IntArray:
    """Pairs of faces (p, 2) that bound one wedge of material at an edge of several faces.

    Turning about the axis, material begins at a face that runs against it and ends at the next
    one that runs along it. Where they do not alternate, all are one shell.
    """
    _, first = np.unique(np.column_stack([face, forward]), axis=0, return_index=True)
    normals, forward, face = normals[first], forward[first], face[first]
    into = np.cross(normals, axis) * np.where(forward, 1.0, -1.0)[:, None]
    across = into[int(np.flatnonzero(~forward)[0])] if (~forward).any() else into[0]
    side = np.cross(axis, across) / max(float(np.linalg.norm(axis)), 1e-300)
    angle = np.mod(np.arctan2(into @ side, into @ across), 2.0 * np.pi)
    angle[forward & (angle < SAME_ANGLE)] = 2.0 * np.pi
    angle[~forward & (angle > 2.0 * np.pi - SAME_ANGLE)] = 0.0
    turn = np.lexsort((~forward, np.round(angle / SAME_ANGLE)))
    if (forward[turn] == (np.arange(len(turn)) % 2 == 1)).all() and len(turn) % 2 == 0:
        result: IntArray = face[turn].reshape(-1, 2)
        return result
    return np.stack([face[:-1], face[1:]], axis=1)


def _with_cavities_joined(body: Body, label: IntArray) -> IntArray:
    shells = []
    for number in np.unique(label).tolist():
        members = [body.faces[i] for i in np.flatnonzero(label == number).tolist()]
        points = body.vertices[np.unique(np.concatenate(members))]
        volume = volume_and_centroid(body.vertices, members)[0]
        shells.append((number, volume, points.min(axis=0), points.max(axis=0)))
    result = label.copy()
    for number, volume, low, high in shells:
        around = [
            (other_volume, other)
            for other, other_volume, other_low, other_high in shells
            if other_volume > -volume and (other_low < low).all() and (high < other_high).all()
        ]
        if volume < 0.0 and around:
            result[label == number] = min(around)[1]
    return result
