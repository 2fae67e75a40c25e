"""Geometry files with one flaw each, whose right answer is known: a tower that tips or slides.

A tower of width b and height H on a slab, pushed along x, tips at b / H or slides at its friction.
``FLAWS`` maps a kind to what makes a file of it: a flaw is either mended, so that the answer is the
tower's, or it is refused or remarked in words that name it.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cvxlimit.geometry.blocks import BOX_FACES, Block
from remeshing import remeshed

Mesh = tuple[str, np.ndarray, list[tuple[int, ...]]]


@dataclass
class Tower:
    """Blocks (names, vertices, faces), the lowest of which is the slab, with width and height."""

    meshes: list[Mesh]
    width: float
    height: float
    friction: float

    @property
    def factor(self) -> float:
        return min(self.friction, self.width / self.height)

    @property
    def thinnest(self) -> float:
        """Mean thickness of the thinnest of the tower's blocks."""
        heights = [float(np.ptp(points[:, 2])) for _, points, _ in self.meshes[1:]]
        return 2.0 / (2.0 / min(heights) + 4.0 / self.width)


@dataclass
class Case:
    """A file, arguments of the import, and what is right: the ``factor`` within ``near`` (relative;
    None if there is to be no answer), and words (patterns) that refusal, notes or remarks have.
    ``retried`` says that a refusal names a joint tolerance with which the answer is right, and
    ``told`` that the words may stand beside an answer that is not."""

    name: str
    content: bytes
    factor: float | None
    near: float = 1e-6
    words: tuple[str, ...] = ()
    retried: bool = False
    told: bool = False
    asked: dict[str, Any] = field(default_factory=dict)


def tower(rng: np.random.Generator) -> Tower:
    width, friction = float(rng.uniform(0.2, 1.0)), float(rng.uniform(0.3, 0.9))
    low, meshes = 0.0, [box("slab", (-1, -1, -0.5), (2, 2, 0))]
    for i in range(int(rng.integers(2, 6))):
        high = low + width * float(rng.uniform(0.4, 1.0))
        meshes.append(box(f"b{i}", (0, 0, low), (width, width, high)))
        low = high
    return Tower(meshes, width, low, friction)


def box(name: str, low: tuple[float, ...], high: tuple[float, ...]) -> Mesh:
    return name, np.array(Block.box(name, low, high).vertices), list(BOX_FACES)


def obj(meshes: list[Mesh], digits: int = 12) -> bytes:
    lines, before = list[str](), 1
    for name, points, faces in meshes:
        lines += [f"o {name}", *("v " + " ".join(f"{x:.{digits}g}" for x in p) for p in points)]
        lines += ["f " + " ".join(str(i + before) for i in face) for face in faces]
        before += len(points)
    return "\n".join(lines).encode()


def stl(meshes: list[Mesh], shift: tuple[float, ...] = (0.0, 0.0, 0.0)) -> bytes:
    rows = [
        struct.pack("<12fH", 0, 0, 0, *(points[[f[0], f[k], f[k + 1]]] + shift).ravel(), 0)
        for _, points, faces in meshes
        for f in faces
        for k in range(1, len(f) - 1)
    ]
    return b"\0" * 80 + struct.pack("<I", len(rows)) + b"".join(rows)


def ply(meshes: list[Mesh]) -> bytes:
    """Text, in double precision."""
    points, faces = joined(meshes)
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}",
            *(f"property double {x}" for x in "xyz"), f"element face {len(faces)}",
            "property list uchar int vertex_indices", "end_header"]  # fmt: skip
    rows = [" ".join(f"{x:.12g}" for x in p) for p in points.tolist()]
    return "\n".join([*head, *rows, *(f"{len(f)} {' '.join(map(str, f))}" for f in faces)]).encode()


def off(meshes: list[Mesh]) -> bytes:
    points, faces = joined(meshes)
    rows = [" ".join(f"{x:.12g}" for x in p) for p in points.tolist()]
    rows += [f"{len(f)} {' '.join(map(str, f))}" for f in faces]
    return "\n".join([f"OFF\n{len(points)} {len(faces)} 0", *rows]).encode()


def joined(meshes: list[Mesh]) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """All corners and faces as one mesh."""
    before = np.cumsum([0, *(len(points) for _, points, _ in meshes)]).tolist()
    faces = [
        tuple(before[k] + i for i in face) for k, (*_, own) in enumerate(meshes) for face in own
    ]
    return np.concatenate([points for _, points, _ in meshes]), faces


def threedec(meshes: list[Mesh]) -> bytes:
    """Blocks by their faces, one command over several lines each."""
    lines = list[str]()
    for name, points, faces in meshes:
        own = ["face " + " ".join("({:.12g},{:.12g},{:.12g})".format(*points[i]) for i in f)
               for f in faces]  # fmt: skip
        lines.append(" &\n".join([f"poly group '{name}'", *own]) + "  ; a stone")
    return "\n".join([*lines, "gravity 0 0 -9.81"]).encode()


def drawing(meshes: list[Mesh]) -> bytes:
    """3D faces, those of a stone on a layer of its own."""
    rows = ["0", "SECTION", "2", "ENTITIES"]
    for name, points, faces in meshes:
        triangles = [(f[0], f[k], f[k + 1]) for f in faces for k in range(1, len(f) - 1)]
        for a, b, c in triangles:
            rows += ["0", "3DFACE", "8", name]
            for k, i in enumerate((a, b, c, c)):
                for axis, x in enumerate(points[i].tolist()):
                    rows += [str(10 * (axis + 1) + k), repr(x)]
    return "\n".join([*rows, "0", "ENDSEC", "0", "EOF", ""]).encode()


def assembly(meshes: list[Mesh]) -> bytes:
    return json.dumps([compas(mesh) for mesh in meshes]).encode()


FORMS: dict[str, Callable[[list[Mesh]], bytes]] = {
    "a.obj": obj, "a.stl": stl, "a.ply": ply, "a.off": off, "a.dat": threedec, "a.dxf": drawing,
    "a.json": assembly,
}  # fmt: skip
"""How the same meshes are written; glTF has files of its own (``gltf_files.py``)."""


def compas(mesh: Mesh) -> dict[str, Any]:
    _, points, faces = mesh
    data = {
        "vertex": {str(i): dict(zip("xyz", p, strict=True)) for i, p in enumerate(points.tolist())},
        "face": {str(i): list(face) for i, face in enumerate(faces)},
    }
    return {"dtype": "compas.datastructures/Mesh", "data": data}


def noise(made: Tower, rng: np.random.Generator) -> Case:
    """Up to a fiftieth of the thinnest block: corners move the toe and the top by as much."""
    size = made.thinnest * float(10.0 ** rng.uniform(-4.0, -1.7))
    meshes = [
        (name, points + (name != "slab") * rng.uniform(-size, size, points.shape), faces)
        for name, points, faces in made.meshes
    ]
    near = 8.0 * size / made.width + 1e-6
    return Case("a.obj", obj(meshes), made.factor, near, retried=True)


def gap(made: Tower, rng: np.random.Generator) -> Case:
    size = made.thinnest * float(rng.uniform(0.011, 0.15))
    k = int(rng.integers(2, len(made.meshes)))
    raised = [
        (name, points + np.array([0, 0, size * (i >= k)]), faces)
        for i, (name, points, faces) in enumerate(made.meshes)
    ]
    words = (f"block '{made.meshes[k][0]}'", "a gap of")
    return Case("a.obj", obj(raised), made.factor, 2.0 * size / made.height, words, True)


def overlap(made: Tower, rng: np.random.Generator) -> Case:
    """Every block is sunk into the one below."""
    size = made.thinnest * float(rng.uniform(0.011, 0.15)), len(made.meshes) - 1
    sunk = [
        (name, points - np.array([0, 0, size[0] * i]), faces)
        for i, (name, points, faces) in enumerate(made.meshes)
    ]
    words = (f"interpenetrate by about .*the most of {size[1]} pairs",)
    return Case("a.obj", obj(sunk), made.factor, 2 * size[0] * size[1] / made.height, words, True)


def unit(made: Tower, rng: np.random.Generator) -> Case:
    meshes = [(name, 1000.0 * points, faces) for name, points, faces in made.meshes]
    return Case("a.obj", obj(meshes), made.factor, words=("are coordinates in m. In mm",))


def inside_out(made: Tower, rng: np.random.Generator) -> Case:
    which = rng.integers(len(made.meshes))
    meshes = [
        (name, points, [f[::-1] for f in faces] if i == which else faces)
        for i, (name, points, faces) in enumerate(made.meshes)
    ]
    return Case("a.obj", obj(meshes), made.factor)


def duplicate(made: Tower, rng: np.random.Generator) -> Case:
    name, points, faces = made.meshes[int(rng.integers(1, len(made.meshes)))]
    meshes = [*made.meshes, ("again", *remeshed(points, faces, rng))]
    return Case("a.obj", obj(meshes), None, words=("are the same body twice", name, "'again'"))


def open_mesh(made: Tower, rng: np.random.Generator) -> Case:
    k, lost = int(rng.integers(1, len(made.meshes))), int(rng.integers(6))
    meshes = list(made.meshes)
    name, points, faces = meshes[k]
    meshes[k] = (name, points, faces[:lost] + faces[lost + 1 :])
    return Case("a.obj", obj(meshes), None, words=(f"block '{name}'", "not closed|open"))


def doubled_face(made: Tower, rng: np.random.Generator) -> Case:
    meshes = [(name, points, [*faces, faces[0]]) for name, points, faces in made.meshes]
    return Case("a.obj", obj(meshes), made.factor)


def unlike_meshes(made: Tower, rng: np.random.Generator) -> Case:
    meshes = [(name, *remeshed(points, faces, rng)) for name, points, faces in made.meshes]
    return Case("a.obj", obj(meshes), made.factor)


def soup(made: Tower, rng: np.random.Generator) -> Case:
    """One STL of all, in single precision: b / H to a millionth of a coordinate."""
    return Case("a.stl", stl(made.meshes), made.factor, 1e-5)


def nested_list(made: Tower, rng: np.random.Generator) -> Case:
    lists: Any = [compas(mesh) for mesh in made.meshes]
    cut = int(rng.integers(1, len(lists)))
    lists = [lists[:cut], [lists[cut:]]]
    return Case("a.json", json.dumps(lists).encode(), made.factor)


def degrees(made: Tower, rng: np.random.Generator) -> Case:
    friction = float(rng.integers(15, 45))
    factor = min(friction, made.width / made.height)
    words = (rf"friction {friction:g} is 8\d[.\d]* degrees: in degrees. tan",)
    return Case("a.obj", obj(made.meshes), factor, words=words, asked={"friction": friction})


def absurd_tolerance(made: Tower, rng: np.random.Generator) -> Case:
    tolerance = made.thinnest * float(10.0 ** rng.uniform(0.01, 4.0))
    words = ("joint_tolerance .* is no less than the mean thickness of block",)
    return Case("a.obj", obj(made.meshes), None, words=words, asked={"joint_tolerance": tolerance})


def y_up(made: Tower, rng: np.random.Generator) -> Case:
    """Turned about x; asked for with z up, the blocks lie side by side."""
    meshes = [
        (name, points[:, [0, 2, 1]] * (1, 1, -1), faces) for name, points, faces in made.meshes
    ]
    if rng.random() < 0.5:
        return Case("a.obj", obj(meshes), made.factor, asked={"up": "y"})
    words = ("another axis points up|touches no other|dead load",)
    return Case("a.obj", obj(meshes), None, words=words)


def map_coordinates(made: Tower, rng: np.random.Generator) -> Case:
    shift = np.array([*rng.uniform(1e5, 9e6, 2).round(), 100.0])
    if rng.random() < 0.5:
        meshes = [(name, points + shift, faces) for name, points, faces in made.meshes]
        return Case("a.obj", obj(meshes, 15), made.factor)
    words = ("numbers cannot tell its blocks apart: along [xy]",)
    return Case("a.stl", stl(made.meshes, tuple(shift)), None, words=words, told=True)


def no_area(made: Tower, rng: np.random.Generator) -> list[Mesh]:
    """Triangles of two corners, or of three on a line."""
    meshes = list(made.meshes)
    k = int(rng.integers(len(meshes)))
    name, points, faces = meshes[k]
    if rng.random() < 0.5:
        i, j = rng.permutation(len(points))[:2].tolist()
        meshes[k] = (name, points, [*faces, (i, i, j)])
    else:
        a, b = faces[0][:2]
        points = np.vstack([points, 0.5 * (points[a] + points[b])])
        meshes[k] = (name, points, [*faces, (a, b, len(points) - 1)])
    return meshes


def tiny_edge(made: Tower, rng: np.random.Generator) -> list[Mesh]:
    """A corner becomes two, a hair apart; faces about it have one, the other or both."""
    meshes = list(made.meshes)
    k = int(rng.integers(len(meshes)))
    name, points, faces = meshes[k]
    i = int(rng.integers(len(points)))
    first = next(f for f in faces if i in f)
    beside = first[first.index(i) - 1]
    hair = float(10.0 ** rng.uniform(-9, -7)) * float(np.ptp(points, axis=0).min())
    along = points[beside] - points[i]
    new = len(points)
    points = np.vstack([points, points[i] + hair * along / np.linalg.norm(along)])
    cut = []
    for f in faces:
        at = f.index(i) if i in f else -1
        if at < 0:
            cut.append(f)
        elif f[at - 1] == beside:
            cut.append((*f[:at], new, *f[at:]))
        elif f[(at + 1) % len(f)] == beside:
            cut.append((*f[: at + 1], new, *f[at + 1 :]))
        else:
            cut.append(f)
    meshes[k] = (name, points, cut)
    return meshes


def copied(made: Tower, rng: np.random.Generator) -> list[Mesh]:
    """The same stone once more, with corners of its own."""
    _, points, faces = made.meshes[int(rng.integers(1, len(made.meshes)))]
    return [*made.meshes, ("again", points.copy(), list(faces))]


def layer(made: Tower, rng: np.random.Generator) -> list[Mesh]:
    """All stones once more: a layer that was left on."""
    return [*made.meshes, *((f"{name} copy", points, faces) for name, points, faces in made.meshes)]


def turned_faces(made: Tower, rng: np.random.Generator) -> list[Mesh]:
    return [
        (name, points, [f[::-1] if rng.random() < 0.5 else f for f in faces])
        for name, points, faces in made.meshes
    ]


def rough(made: Tower, rng: np.random.Generator) -> list[Mesh]:
    """A millimetre of noise, or less, on stones of some decimetres, in whole faces or triangles."""
    size = float(rng.choice([3e-4, 8e-4, 1e-3]))
    meshes = [
        (name, points + (name != "slab") * rng.uniform(-size, size, points.shape), faces)
        for name, points, faces in made.meshes
    ]
    if rng.random() < 0.5:
        meshes = [
            (name, points, [(f[0], f[k], f[k + 1]) for f in faces for k in (1, 2)])
            for name, points, faces in meshes
        ]
    return meshes


def unlike(made: Tower, rng: np.random.Generator) -> list[Mesh]:
    return [(name, *remeshed(points, faces, rng)) for name, points, faces in made.meshes]


MESH_FLAWS: dict[str, Callable[[Tower, np.random.Generator], list[Mesh]]] = {
    flaw.__name__: flaw for flaw in (no_area, tiny_edge, copied, layer, turned_faces, rough, unlike)
}
"""Flaws of meshes, whatever the format."""


def near_of(flaw: str, name: str, made: Tower) -> float:
    """How far an answer may be off: noise moves the toe by as much as itself, and single precision
    corners by a ten-millionth."""
    return 8e-3 / made.width if flaw == "rough" else (1e-5 if name == "a.stl" else 1e-6)


FLAWS: dict[str, Callable[[Tower, np.random.Generator], Case]] = {
    flaw.__name__: flaw
    for flaw in (
        noise, gap, overlap, unit, inside_out, duplicate, open_mesh, doubled_face, unlike_meshes,
        soup, nested_list, degrees, absurd_tolerance, y_up, map_coordinates,
    )
}  # fmt: skip


def tolerance_named(text: str) -> float | None:
    """The joint tolerance that a message says would do; the last, which takes all."""
    found = re.findall(r"joint.tolerance (?:of|to) ([\d.e+-]*\d)", text)
    return float(found[-1]) if found else None


def written(case: Case, folder: Path) -> Path:
    path = folder / case.name
    path.write_bytes(case.content)
    return path
