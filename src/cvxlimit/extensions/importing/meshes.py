"""STL, PLY and glTF through trimesh (the extra ``mesh``), which is imported when it is used.

The files may be hostile: sizes that they claim are held against the bytes they have, no file but
buffers in the same folder is opened, and whatever trimesh stumbles over becomes one sentence.
"""

from __future__ import annotations

import io
import logging
import os
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, merged, natural, read_by_others
from cvxlimit.io.fields import parsed, read_bytes, shown

_QUIET = logging.NullHandler()

_MADE_UP = re.compile(r"geometry_\d+")
"""Names that trimesh gives to what has none."""


def read_mesh(path: Path, notes: list[str]) -> list[Body]:
    """The meshes of an STL, PLY, GLB or glTF file, each moved to its place; not yet separated into
    bodies, which one mesh may hold several of."""
    what = f"{path.suffix} files (.obj, .json and .csv work without)"
    trimesh = needed("trimesh", "mesh", what)
    # It logs tracebacks of what it gets over, which would go to stderr where nobody listens.
    logging.getLogger("trimesh").addHandler(_QUIET)
    kind = path.suffix.lower()[1:]
    data = read_bytes(path)
    options: dict[str, Any] = {"process": False}
    if kind in ("glb", "gltf"):
        _check_gltf(data, kind)
        options["resolver"] = _Beside(path)
    elif kind == "stl":
        _check_stl(data)
    with read_by_others(kind.upper(), "export it again"):
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, **options)
        return [_body(name, mesh) for name, mesh in _instances(scene)]


def _instances(scene: Any) -> Iterator[tuple[str, Any]]:
    """Name, and vertices with triangles, of each node of the scene that shows a mesh, in the
    order of names, in which numbers count as such."""
    for node in sorted(scene.graph.nodes_geometry, key=lambda node: natural(str(node))):
        turn, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if not hasattr(mesh, "faces"):
            raise InputError(f"{shown(str(node))} has no faces: only meshes can be blocks")
        yield str(node), (mesh.vertices @ turn[:3, :3].T + turn[:3, 3], mesh.faces)


def _body(name: str, mesh: tuple[Any, Any]) -> Body:
    """The mesh with corners that triangles share stored once; names made up by trimesh are none."""
    vertices, faces = merged(np.asarray(mesh[0], dtype=float), np.asarray(mesh[1], dtype=np.int64))
    return Body("" if _MADE_UP.fullmatch(name) else name, vertices, faces.tolist())


def _check_stl(data: bytes) -> None:
    """Refuse an STL that is cut off: trimesh would read what is left as if it were whole."""
    if data[:5].lower() == b"solid" and b"facet" in data[:2000]:
        if b"\0" in data:
            raise InputError("the file begins as text STL and goes on with binary; export it again")
        if b"endsolid" not in data[-2000:]:
            raise InputError("the text STL has no 'endsolid' at its end: it is cut off")
        return
    if len(data) < 84:
        raise InputError(f"too short for an STL: {len(data)} bytes")
    triangles = struct.unpack_from("<I", data, 80)[0]
    if len(data) != 84 + 50 * triangles:
        raise InputError(
            f"the binary STL says it has {triangles} triangles, which take {84 + 50 * triangles} "
            f"bytes, but it has {len(data)}"
        )


def _check_gltf(data: bytes, kind: str) -> None:
    """Refuse more elements than the buffers have bytes, and nodes that do not form a tree, before
    trimesh acts on either."""
    document = parsed(_gltf_text(data) if kind == "glb" else data)
    if not isinstance(document, dict):
        raise InputError("a glTF file must be a JSON object {...}")
    for i, accessor in enumerate(_list(document, "accessors")):
        count = accessor.get("count") if isinstance(accessor, dict) else None
        if not isinstance(count, int) or isinstance(count, bool) or count < 0:
            raise InputError(f"accessor {i} has no count")
        if "bufferView" not in accessor:
            raise InputError(f"accessor {i} has no bufferView; export without sparse data")
    sizes = [b.get("byteLength") for b in _list(document, "buffers") if isinstance(b, dict)]
    total = sum(size for size in sizes if isinstance(size, int))
    claimed = sum(accessor["count"] for accessor in _list(document, "accessors"))
    if claimed > total:
        raise InputError(f"its accessors count {claimed} elements, its buffers {total} bytes")
    _check_tree(_list(document, "nodes"))


def _check_tree(nodes: Sequence[Any]) -> None:
    """Refuse nodes with two parents, and those that lie below themselves."""
    parent = dict[int, int]()
    for number, node in enumerate(nodes):
        for child in _list(node, "children") if isinstance(node, dict) else ():
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


def _gltf_text(data: bytes) -> bytes:
    """The JSON in a GLB, which is its first part by the format."""
    header = 20  # bytes before the text that says what is in it
    if len(data) < header or data[:4] != b"glTF":
        raise InputError("the file does not begin like a GLB")
    total, length, kind = struct.unpack_from("<II4s", data, 8)
    if kind != b"JSON" or total > len(data) or length > len(data) - header:
        raise InputError(f"the GLB is cut off: it says {total} bytes and has {len(data)}")
    return data[header : header + length]


def _list(document: Mapping[str, Any], key: str) -> list[Any]:
    """The list under a key of the document, empty where there is none."""
    value = document.get(key, [])
    if not isinstance(value, list):
        raise InputError(f"{key!r} of the glTF must be a list [...], got {shown(value)}")
    return value


@dataclass(frozen=True)
class _Beside:
    """Resolves names of buffers to files of the same folder, and nothing else."""

    path: Path

    def __getitem__(self, name: str) -> bytes:
        plain = os.path.basename(name)
        if plain != name or plain in ("", ".", ".."):
            raise InputError(
                f"buffer {shown(name)} must be a file in the folder of {self.path.name}"
            )
        return read_bytes(self.path.with_name(plain), is_asked_for=False)

    get = __getitem__
