"""Broken geometry files, each with a phrase that the one-line refusal must hold.

``BROKEN`` maps a name to (file name, content, phrase). Where a block exists in the file the phrase
names it.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence

CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 4, 7, 3), (1, 2, 6, 5)]
GROUND = [(x, y, z - 1) for x, y, z in CUBE]

Points = Sequence[tuple[object, object, object]]
Polygons = Sequence[Sequence[object]]


def obj(points: Points = CUBE, faces: Polygons = FACES, name: str = "brick") -> str:
    """A ground cube and a named object above it."""
    lines = ["o ground", *(f"v {x} {y} {z}" for x, y, z in GROUND)]
    lines += ["f " + " ".join(str(i + 1) for i in f) for f in FACES]
    lines += [f"o {name}", *(f"v {x} {y} {z}" for x, y, z in points)]
    lines += [
        "f " + " ".join(str(i + 9) if isinstance(i, int) else str(i) for i in f) for f in faces
    ]
    return "\n".join(lines) + "\n"


def moved(index: int, to: tuple[object, object, object]) -> Points:
    return [to if i == index else p for i, p in enumerate(CUBE)]


def triangles() -> list[tuple[int, int, int]]:
    return [(f[0], f[k], f[k + 1]) for f in FACES for k in (1, 2)]


def binary_stl(count: int | None = None, corners: Points = CUBE) -> bytes:
    faces = triangles()
    data = b"\0" * 80 + struct.pack("<I", len(faces) if count is None else count)
    for f in faces:
        data += struct.pack("<12fH", 0, 0, 0, *(x for i in f for x in corners[i]), 0)  # type: ignore[arg-type]
    return data


def text_stl() -> str:
    rows = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*CUBE[i]) for i in f)
        + "endloop\nendfacet"
        for f in triangles()
    ]
    return "solid cube\n" + "\n".join(rows) + "\nendsolid cube\n"


def ply(vertices: int = 8, faces: int = 12, last: str = "") -> str:
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {faces}\nproperty list uchar int vertex_indices\n"
        "end_header\n"
    )
    body = [" ".join(map(str, p)) for p in CUBE] + [
        "3 " + " ".join(map(str, f)) for f in triangles()
    ]
    if last:
        body[-1] = last
    return head + "\n".join(body) + "\n"


def gltf(**changes: object) -> dict[str, object]:
    document: dict[str, object] = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "brick"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 144},
        ],
        "buffers": [{"byteLength": 240}],
    }  # fmt: skip
    return {**document, **changes}


def glb(document: object, binary: bytes | None = None, total: int | None = None) -> bytes:
    if binary is None:
        binary = struct.pack("<24f", *(x for p in CUBE for x in p))
        binary += struct.pack("<36I", *(i for f in triangles() for i in f))
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<II", len(text), 0x4E4F534A) + text
    parts += struct.pack("<II", len(binary), 0x004E4942) + binary
    size = 12 + len(parts) if total is None else total
    return b"glTF" + struct.pack("<II", 2, size) + parts


def assembly(mesh: object = None, **node: object) -> str:
    """A COMPAS assembly of one node "7"."""
    cube = {
        "vertex": {str(i): dict(zip("xyz", p, strict=True)) for i, p in enumerate(CUBE)},
        "face": {str(i): list(f) for i, f in enumerate(FACES)},
    }
    block = {
        "dtype": "compas_assembly.datastructures/Block",
        "data": cube if mesh is None else mesh,
    }
    graph = {"dtype": "compas/Graph", "data": {"node": {"7": {"block": block, **node}}}}
    return json.dumps(
        {"dtype": "compas_assembly.datastructures/Assembly", "data": {"graph": graph}}
    )


def cube_mesh(**changes: object) -> dict[str, object]:
    mesh: dict[str, object] = json.loads(assembly())["data"]["graph"]["data"]["node"]["7"]["block"]
    return {**mesh["data"], **changes}  # type: ignore[dict-item]


HEAD = "id,xmin,ymin,zmin,xmax,ymax,zmax"
TABLE = HEAD + ",density,support\nground,0,0,-1,1,1,0,,yes\n"
PILE = {"x": 0.0, "y": 0.0, "z": 0.0}

STAR = [(i, (i * 2) % 5) for i in range(5)]

BROKEN: dict[str, tuple[str, str | bytes, str]] = {
    # shapes that are no bodies
    "open": ("a.obj", obj(faces=FACES[1:]), "'brick'"),
    "two-faces-missing": ("a.obj", obj(faces=FACES[2:]), "'brick'"),
    "one-face": ("a.obj", obj(faces=FACES[:1]), "'brick'"),
    "zero-volume": ("a.obj", obj([(x, y, 0) for x, y, _ in CUBE]), "'brick'"),
    "a-needle": ("a.obj", obj([(x, 0, 0) for x, _, _ in CUBE]), "'brick'"),
    "a-point": ("a.obj", obj([(0, 0, 0)] * 8), "'brick'"),
    "both-sides-of-a-sheet": ("a.obj", obj(faces=[(0, 1, 2, 3), (3, 2, 1, 0)]), "'brick'"),
    "self-crossing": ("a.obj", obj(moved(6, (0.5, 0.5, -2))), "'brick'"),
    "twisted": ("a.obj", obj([*CUBE[:4], CUBE[6], CUBE[7], CUBE[4], CUBE[5]]), "'brick'"),
    "bow-tie-face": ("a.obj", obj(faces=[(0, 2, 3, 1), *FACES[1:]]), "'brick'"),
    "repeated-vertex": ("a.obj", obj(faces=[(0, 3, 0, 1), *FACES[1:]]), "'brick'"),
    "fin": ("a.obj", obj([*CUBE, (2, 2, 2)], [*FACES, (5, 6, 8)]), "'brick'"),
    "three-faces-at-an-edge": ("a.obj", obj([*CUBE, (2, 0, 0.5)], [*FACES, (1, 5, 8)]), "'brick'"),
    "wall-inside": ("a.obj", obj(faces=[*FACES, (0, 2, 6, 4)]), "'brick'"),
    "nan": ("a.obj", obj(moved(3, ("nan", 0, 0))), "'brick'"),
    "infinite": ("a.obj", obj(moved(3, (0, "inf", 0))), "'brick'"),
    "overflowing": ("a.obj", obj(moved(3, (0, "1e300", 0))), "'brick'"),
    "far-off-vertex": ("a.obj", obj(moved(6, (1, 1, 1e9))), "'brick'"),
    # text that is no OBJ
    "no-faces": ("a.obj", "o brick\nv 0 0 0\nv 1 0 0\nv 0 1 0\n", "a.obj: the file holds no faces"),
    "empty-obj": ("a.obj", "", "a.obj: the file holds no faces"),
    "index-too-large": ("a.obj", obj(faces=[(0, 1, 99), *FACES]), "a face names vertex 108"),
    "index-zero": ("a.obj", obj(faces=[("0", 1, 2), *FACES]), "a face names vertex 0"),
    "index-negative": ("a.obj", obj(faces=[("-99", 1, 2), *FACES]), "a face names vertex -99"),
    "index-as-text": ("a.obj", obj(faces=[("one", 1, 2), *FACES]), "numbers, got 'one'"),
    "index-huge": ("a.obj", obj(faces=[("9" * 5000, 1, 2)]), "a face must list vertex numbers"),
    "two-corners": ("a.obj", obj(faces=[(0, 1), *FACES]), "needs at least three vertices, got 2"),
    "two-coordinates": ("a.obj", "v 0 0\n", "a.obj: line 1: a vertex must be three numbers, got 2"),
    "binary-in-text": ("a.obj", obj().encode() + b"\xff\xfe\0\x80", "a.obj: the file is not UTF-8"),
    "curves": ("a.obj", obj() + "curv 0 1 1 2\n", "is no statement of a polygon mesh"),
    "truncated-obj": ("a.obj", obj()[:-40], "a.obj: line 28: a face needs at least three"),
    # STL and PLY
    "stl-truncated": ("a.stl", binary_stl()[:-25], "a.stl: the binary STL says it has 12"),
    "stl-claims-billions": ("a.stl", binary_stl(4_000_000_000), "says it has 4000000000 triangles"),
    "stl-short": ("a.stl", b"\0" * 20, "a.stl: too short for an STL"),
    "stl-nan": ("a.stl", binary_stl(corners=moved(0, (float("nan"), 0, 0))), "block '"),
    "stl-text-cut-off": ("a.stl", text_stl()[:700], "a.stl: the text STL has no 'endsolid'"),
    "stl-text-then-binary": ("a.stl", text_stl().encode() + b"\0" * 99, "goes on with binary"),
    "ply-claims-more": ("a.ply", ply(vertices=2_000_000_000), "a.ply: "),
    "ply-wrong-index": ("a.ply", ply(last="3 0 1 99"), "a.ply"),
    "ply-strips": (
        "a.ply", ply().replace("element face 12", "element tristrips 1\nelement face 12"),
        "a.ply: its faces are triangle strips",
    ),
    "ply-no-header": ("a.ply", "0 0 0\n1 0 0\n", "a.ply: cannot be read as PLY"),
    # glTF
    "glb-magic": ("a.glb", b"FTlg" + b"\0" * 40, "a.glb: the file does not begin like a GLB"),
    "glb-cut-off": ("a.glb", glb(gltf())[:-30], "a.glb: the GLB is cut off"),
    "glb-count": (
        "a.glb",
        glb(gltf(accessors=[{"bufferView": 0, "componentType": 5126, "count": 10**12,
                             "type": "VEC3"}])),
        "a.glb: its accessors count 1000000000000 elements",
    ),
    "glb-no-view": (
        "a.glb", glb(gltf(accessors=[{"componentType": 5126, "count": 8, "type": "VEC3"}])),
        "a.glb: accessor 0 has no bufferView",
    ),
    "glb-wrong-view": (
        "a.glb",
        glb(gltf(bufferViews=[{"buffer": 0, "byteOffset": 0, "byteLength": 10}])),
        "a.glb: accessor 0 reaches beyond the bytes that the file has",
    ),
    "gltf-outside": (
        "a.gltf", json.dumps(gltf(buffers=[{"byteLength": 240, "uri": "../../etc/passwd"}])),
        "must be a file in the folder of a.gltf",
    ),
    "gltf-laughs": (
        "a.gltf",
        json.dumps(gltf(nodes=[{"children": [i + 1, i + 1]} for i in range(60)] + [{"mesh": 0}])),
        "is a child of two nodes",
    ),
    "gltf-in-a-circle": (
        "a.gltf",
        json.dumps(gltf(nodes=[{"children": [1], "mesh": 0}, {"children": [0]}, {"mesh": 0}])),
        "a.gltf: node 1 lies below itself; nodes must form a tree",
    ),
    # JSON and tables
    "json-nested": ("a.json", "[" * 100_000, "a.json: brackets are nested too deeply"),
    "json-wrapped-without-end": (
        "a.json", '{"dtype": "compas", "data": ' * 400 + "{}" + "}" * 400,
        "a.json: a COMPAS object",
    ),
    "json-of-others": ("a.json", '{"type": "FeatureCollection"}', "holds no blocks that are known"),
    "json-no-blocks": ("a.json", '{"dtype": "compas/Mesh", "data": {}}', "neither elements nor"),
    "json-no-mesh": ("a.json", assembly({"brep": 1}), "block '7' is no mesh"),
    "json-open": ("a.json", assembly(cube_mesh(face={"0": [0, 1, 2, 3]})), "'7'"),
    "json-wrong-index": ("a.json", assembly(cube_mesh(face={"0": [0, 99]})), "of block '7' names"),
    "json-face-as-text": ("a.json", assembly(cube_mesh(face={"0": "012"})), "of block '7' must be"),
    "json-text-coordinate": (
        "a.json", assembly(cube_mesh(vertex={"0": {**PILE, "x": "1"}})),
        "x of vertex '0' of block '7' must be a number",
    ),
    "json-nan": (
        "a.json", assembly(cube_mesh(vertex={"0": {**PILE, "x": float("nan")}})), "of block '7'",
    ),
    "json-density": ("a.json", assembly(None, density="heavy"), "density of block '7' must be"),
    "table-column": ("a.csv", "id,xmin,ymin\n", "a.csv: the table lacks the column 'zmin'"),
    "table-cells": ("a.csv", TABLE + "brick,0,0,0,1,1\n", "a.csv: line 3 has 6 cells"),
    "table-number": ("a.csv", TABLE + "brick,0,0,zero,1,1,1,,\n", "zmin of block 'brick'"),
    "table-nan": ("a.csv", TABLE + "brick,0,0,nan,1,1,1,,\n", "'brick' must be finite"),
    "table-inside-out": ("a.csv", TABLE + "brick,0,0,1,1,1,0,,\n", "block 'brick' is degenerate"),
    "table-support": ("a.csv", TABLE + "brick,0,0,0,1,1,1,,maybe\n", "support of block 'brick'"),
    "table-no-id": ("a.csv", TABLE + ",0,0,0,1,1,1,,\n", "a.csv: line 3 has no id"),
    # files
    "unknown-suffix": ("a.xyz", "?", "a.xyz: cannot tell the format from '.xyz'"),
    "unread-dwg": ("a.dwg", "?", "a.dwg: .dwg files are not read: in the drawing program, save as"),
    "unread-rhino": ("a.3DM", "?", "a.3DM: .3dm files are not read: in Rhino"),
    # 3DEC
    "3dec-cut": ("a.dat", "poly brick 0 1 0 1 0 1\njset dip 30 dd 90\n", "line 2: 'jset dip 30"),
    "3dec-computed": ("a.dat", "def walls\npoly brick @x 1 0 1 0 1\nend\n", "line 1: 'def walls'"),
    "3dec-four-numbers": ("a.dat", "block create brick 0 1 0 1\n", "a brick must have six"),
    "3dec-prism": ("a.dat", "poly prism a 0 0 0 1 0 0 0 1 0 b 0 0 1 1 0 1\n", "three or more"),
    "3dec-word": ("a.dat", "poly drum 0 0 0 1\n", "line 1: 'drum' of a block is not known here"),
    "3dec-unended": ("a.dat", "poly brick 0 1 &\n", "the file is cut off"),
    "3dec-empty": ("a.dat", "gravity 0 0 -10\n", "a.dat: the file holds no faces"),
    "empty-json": ("a.json", "", "a.json: the file is empty"),
}  # fmt: skip


def damaged(data: bytes, cuts: list[tuple[int, int, bytes]]) -> bytes:
    """Each cut replaces some bytes from a place on by others."""
    for place, length, new in cuts:
        at = place % (len(data) + 1)
        data = data[:at] + new + data[at + length :]
    return data


GEOMETRIES = {
    "a.obj": obj().encode(),
    "a.ply": ply().encode(),
    "a.stl": binary_stl(),
    "a.glb": glb(gltf()),
    "b.stl": text_stl().encode(),
    "a.json": assembly().encode(),
    "a.csv": (TABLE + "brick,0,0,0,1,1,1,20,\n").encode(),
}
