"""STL and PLY through trimesh (the extra ``mesh``), which is imported when it is used.

The files may be hostile: sizes that they claim are held against the bytes they have, no other file
is opened, and whatever trimesh stumbles over becomes one sentence.
"""

from __future__ import annotations

import io
import logging
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, merged, natural, read_by_others
from cvxlimit.io.fields import read_bytes, shown

_QUIET = logging.NullHandler()

_MADE_UP = re.compile(r"geometry_\d+")
"""Names that trimesh gives to what has none."""


def read_mesh(path: Path, notes: list[str]) -> list[Body]:
    """The meshes of an STL or PLY file, not yet separated into bodies, which one mesh may hold
    several of."""
    what = f"{path.suffix} files (.obj, .glb, .json and .csv work without)"
    trimesh = needed("trimesh", "mesh", what)
    # It logs tracebacks of what it gets over, which would go to stderr where nobody listens.
    logging.getLogger("trimesh").addHandler(_QUIET)
    kind = path.suffix.lower()[1:]
    data = read_bytes(path)
    if kind == "stl":
        _check_stl(data)
    elif re.search(rb"^element\s+tristrips\b", data.split(b"end_header", 1)[0], re.MULTILINE):
        raise InputError("its faces are triangle strips, which are left out here: export triangles")
    with read_by_others(kind.upper(), "export it again"):
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False)
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
