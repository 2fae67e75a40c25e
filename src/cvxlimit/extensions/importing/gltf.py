"""glTF 2.0, as .glb or .gltf: every node that shows a mesh is a body, under the node's name.

A reader of our own. trimesh leaves out what it does not know in silence (instances, sparse and
normalised accessors, visibility, required extensions: one stone of three was read, or one 32,767
times too large), and pygltflib stops at the JSON, with accessors undecoded. The format says what
must be understood, so that this reader refuses by name whatever it does not know.

Nodes form a tree, and each stands in the one above it; what they show are meshes, of primitives
whose corners are accessors (:mod:`.gltf_data`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, merged, read_by_others
from cvxlimit.extensions.importing.gltf_data import (
    INSTANCING,
    VISIBILITY,
    GltfData,
    compressed,
    extensions_of,
    index_in,
    list_in,
    object_in,
    unread,
)
from cvxlimit.io.fields import LARGEST_FILE, shown

_TRIANGLES, _FAN = 4, 6
"""Modes of primitives that have faces: between them are strips, below them points and lines."""

_UNIT = 0.01
"""Lengths of quaternions differ from 1 by what their numbers are rounded to, at most one byte's
1/127; more is no rotation, and programs make different things of it."""


def read_gltf(path: Path, notes: list[str]) -> list[Body]:
    """The bodies of the scene that the file shows; ``notes`` gets what it does not show."""
    with read_by_others("glTF", "export it again"):
        return [*_bodies(GltfData.of(path), notes)]


def _bodies(data: GltfData, notes: list[str]) -> Iterator[Body]:
    """One body for each node with a mesh, or for each of its instances."""
    notes += [
        f"extension {shown(name)} is not read here, and the file says that it is not needed: "
        "compare the picture with the original, or export again without it"
        for name in sorted({*map(str, unread(_extensions(data)))})
    ]
    if any(list_in(each, "channels") for each in data.each("animations")):
        notes.append("the file moves its nodes (animations): they are taken as they stand")
    corners, number, widest = 0, 0, 0.0
    for name, node, places in _placed(data, notes):
        mesh = _mesh(data, node, name, notes)
        corners += len(mesh.points) * len(places)
        if 24 * corners > LARGEST_FILE:  # bytes of the coordinates, each node's its own
            raise InputError(
                "the same meshes are shown so often that the bodies of the file "
                f"have {corners} corners and more"
            )
        if not len(mesh.faces):
            continue
        number += 1
        for k, place in enumerate(places, 1):
            turn, shift = place[:3, :3], place[:3, 3]
            wide = float(np.abs(turn).sum(axis=1).max())
            widest = max(widest, wide * mesh.step)
            own = name if len(places) == 1 or not name else f"{name}.{k}"
            # Metres, by the format.
            yield Body(own, *_welded(mesh.points @ turn.T + shift, mesh.faces), unit="m")
    if widest:
        notes.append(
            f"positions are whole numbers (quantised), in steps of up to {widest:.3g}: untick "
            "quantisation in the exporter if that is too coarse"
        )
    shown_nodes = sum("mesh" in node for node in data.each("nodes"))
    if number < shown_nodes:
        notes.append(f"{shown_nodes} nodes of the file have a mesh, {number} are bodies here")


def _extensions(data: GltfData) -> Iterator[str]:
    """Extensions of all objects on which it hangs where bodies are."""
    yield from extensions_of(data.json)
    for key in ("nodes", "meshes", "accessors", "bufferViews", "buffers", "scenes"):
        for each in data.each(key):
            yield from extensions_of(each)
    for mesh in data.each("meshes"):
        for primitive in list_in(mesh, "primitives"):
            yield from extensions_of(primitive)


# Nodes


def _placed(data: GltfData, notes: list[str]) -> Iterator[tuple[str, Any, list[FloatArray]]]:
    """Name, node and places (4, 4) in the scene of each node that shows a mesh, in the order of the
    tree; several places are instances."""
    nodes, meshes, scenes = data.each("nodes"), data.each("meshes"), data.each("scenes")
    children = [list_in(node, "children") for node in nodes]
    _check_tree(children)
    if scenes:
        scene = scenes[index_in(data.json.get("scene", 0), scenes, "scene")]
        roots = list_in(scene, "nodes")
    else:
        below = {child for own in children for child in own}
        roots = [k for k in range(len(nodes)) if k not in below]
    # Down the tree: a node stands in the one above it, and is shown if that is.
    hidden, seen = list[str](), set[int]()
    todo = [(root, np.eye(4), True) for root in reversed(roots)]
    while todo:
        number, above, is_shown = todo.pop()
        node = nodes[index_in(number, nodes, "node")]
        seen.add(number)
        said = extensions_of(node).get(VISIBILITY)
        is_shown &= not isinstance(said, dict) or said.get("visible", True) is not False
        name = node.get("name")
        name = name if isinstance(name, str) else ""
        place = above @ _transform(node, name or f"node {number}")
        todo += [(child, place, is_shown) for child in reversed(children[number])]
        if "mesh" not in node:
            continue
        if not is_shown:
            hidden.append(name or f"node {number}")
            continue
        mesh = index_in(node["mesh"], meshes, "mesh")
        name = name or str(meshes[mesh].get("name") or "")
        if "skin" in node:
            raise InputError(
                f"node {shown(name)} is moved by a skin: apply its armature, or "
                "untick skinning in the exporter"
            )
        yield name, node, [place @ each for each in _instances(data, node, name)]
    # What the scene does not show.
    if hidden:
        more = f" and {len(hidden) - 8} more" if len(hidden) > 8 else ""
        notes.append(f"hidden in the file, and left out: {', '.join(map(shown, hidden[:8]))}{more}")
    out = [node for k, node in enumerate(nodes) if k not in seen and "mesh" in node]
    if out:
        notes.append(
            f"{len(out)} nodes with a mesh are not in the scene that the file shows, "
            "and are left out: export one scene"
        )


def _check_tree(children: Sequence[Sequence[Any]]) -> None:
    """Refuse nodes with two parents, and those that lie below themselves."""
    parent = dict[int, int]()
    for number, own in enumerate(children):
        for child in own:
            if not isinstance(child, int):
                continue
            if child in parent:
                raise InputError(f"node {child} is a child of two nodes; nodes must form a tree")
            parent[child] = number
    followed = set[int]()  # nodes from which the way up has been taken already
    for node in parent:
        way = set[int]()
        while node in parent and node not in followed:
            followed.add(node)
            way.add(node)
            node = parent[node]
        if node in way:
            raise InputError(f"node {node} lies below itself; nodes must form a tree")


def _instances(data: GltfData, node: Any, name: str) -> list[FloatArray]:
    """Where each instance of a node's mesh stands, seen from the node: 4 x 4 each."""
    said = extensions_of(node).get(INSTANCING)
    if not isinstance(said, dict):
        return [np.eye(4)]
    given = object_in(said, "attributes")
    read = {
        key.lower(): data.accessor(given[key], width)
        for key, width in (("TRANSLATION", 3), ("ROTATION", 4), ("SCALE", 3))
        if key in given
    }
    if len({len(rows) for rows in read.values()}) != 1:
        counts = ", ".join(f"{key.upper()} {len(rows)}" for key, rows in read.items())
        raise InputError(
            f"the instances of node {shown(name)} have as many places as {counts or 'nothing'}; "
            "untick instancing in the exporter"
        )
    count = len(next(iter(read.values())))
    if 128 * count > LARGEST_FILE:  # bytes of their places
        raise InputError(f"node {shown(name)} claims {count} instances")
    return [
        _transform({key: rows[k].tolist() for key, rows in read.items()}, name)
        for k in range(count)
    ]


def _transform(node: Mapping[str, Any], name: str) -> FloatArray:
    """Where a node stands in the one above it (4, 4): its matrix, or scale, then turn, then
    move."""
    if "matrix" in node:
        result = _numbers(node, "matrix", [*np.eye(4).ravel()], name).reshape(4, 4).T
        if (result[3] != (0.0, 0.0, 0.0, 1.0)).any():
            raise InputError(f"the matrix of {shown(name)} is no move of a body")
        return result
    turn = _numbers(node, "rotation", (0, 0, 0, 1), name)
    if not abs(float(np.linalg.norm(turn)) - 1.0) < _UNIT:
        raise InputError(
            f"the rotation of {shown(name)} must be a quaternion of length 1, got {turn.tolist()}"
        )
    result = np.eye(4)
    result[:3, :3] = Rotation.from_quat(turn).as_matrix() * _numbers(node, "scale", (1, 1, 1), name)
    result[:3, 3] = _numbers(node, "translation", (0, 0, 0), name)
    return result


def _numbers(node: Mapping[str, Any], key: str, default: Sequence[float], name: str) -> FloatArray:
    """The numbers under a key of a node, as many as those that count without it."""
    value = node.get(key, default)
    good = isinstance(value, Sequence) and len(value) == len(default) and not isinstance(value, str)
    if not good or not all(isinstance(x, int | float) and abs(x) < np.inf for x in value):
        raise InputError(
            f"the {key} of {shown(name)} must be {len(default)} numbers, got {shown(value)}"
        )
    return np.array(value, dtype=float)


# Meshes


class _Mesh(NamedTuple):
    """Corners (k, 3), triangles (t, 3), and the largest step of quantised positions, or 0."""

    points: FloatArray
    faces: Any
    step: float


def _mesh(data: GltfData, node: Any, name: str, notes: list[str]) -> _Mesh:
    """All primitives of a node's mesh: materials and modes part what is one body."""
    mesh, step = data.each("meshes")[node["mesh"]], 0.0
    points, faces, before = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], 0
    without = 0
    for primitive in list_in(mesh, "primitives"):
        if not isinstance(primitive, dict):
            raise InputError(f"a primitive of {shown(name)} must be an object {{...}}")
        mode = primitive.get("mode", _TRIANGLES)
        if mode not in range(_FAN + 1):
            raise InputError(
                f"a primitive of {shown(name)} has mode {shown(mode)}, which is "
                "neither triangles nor points or lines"
            )
        if mode < _TRIANGLES:
            without += 1
            continue
        weights = list_in(node if "weights" in node else mesh, "weights")
        own, corners, own_step = _primitive(data, primitive, weights, name)
        if mode == _TRIANGLES and len(corners) % 3:
            raise InputError(
                f"{shown(name)} has {len(corners)} corners, which make no whole "
                "number of triangles; it is cut off"
            )
        points.append(own)
        faces.append(_triangles(corners, mode) + before)
        before, step = before + len(own), max(step, own_step)
    if without:
        notes.append(
            f"{without} primitives of {shown(name)} are points or lines, not faces, "
            "and are left out"
        )
    return _Mesh(np.concatenate(points), np.concatenate(faces), step)


def _primitive(
    data: GltfData, primitive: Any, weights: Sequence[Any], name: str
) -> tuple[FloatArray, Any, float]:
    """Corners of a primitive, which of them its triangles take, one after the other, and the step
    between quantised positions."""
    attributes = object_in(primitive, "attributes")
    with_cure = compressed(primitive)
    try:
        if "POSITION" not in attributes:
            raise InputError(f"a primitive of {shown(name)} has no POSITION")
        points = data.accessor(attributes["POSITION"], 3)
        step = data.step(attributes["POSITION"])
        # Shapes between which the mesh is blended, where the file stands between them.
        targets = list_in(primitive, "targets")
        for target, weight in zip(targets, weights, strict=False):
            if isinstance(weight, int | float) and weight and "POSITION" in target:
                points = points + weight * data.accessor(target["POSITION"], 3)
        corners = np.arange(len(points))
        if "indices" in primitive:
            corners = data.accessor(primitive["indices"], 1)[:, 0].astype(np.int64)
    except InputError as error:
        if with_cure:
            raise InputError(f"{shown(name)} has {with_cure}") from error
        raise
    if len(corners) and corners.max() >= len(points):
        raise InputError(
            f"a face of {shown(name)} names vertex {corners.max()}, but there are "
            f"{len(points)}, numbered from 0"
        )
    return points, corners, step


def _triangles(corners: Any, mode: int) -> Any:
    """Triangles (t, 3) of a primitive's corners; of a strip every other one is turned."""
    if mode == _TRIANGLES:
        return corners.reshape(-1, 3)
    count = max(len(corners) - 2, 0)
    if mode == _FAN:
        hub = np.full(count, corners[0] if count else 0)
        return np.stack([hub, corners[1 : 1 + count], corners[2 : 2 + count]], axis=1)
    found = np.stack([corners[k : k + count] for k in range(3)], axis=1)
    found[1::2] = found[1::2, [1, 0, 2]]
    return found


def _welded(points: FloatArray, faces: Any) -> tuple[FloatArray, list[list[int]]]:
    """The mesh with equal corners stored once, without the triangles of two corners by which
    strips are joined, and without corners of no triangle."""
    points, faces = merged(points, faces)
    kept = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, number = np.unique(kept, return_inverse=True)
    return points[used], np.asarray(number).reshape(-1, 3).tolist()
