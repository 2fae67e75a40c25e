"""glTF files of a tower, each with one thing that the format allows and readers leave out.

``WAYS`` maps what it is to what makes a file of it. The answer is the tower's wherever the file can
be read; where it cannot, the refusal has the words; and what is left out is told.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from flawed_imports import Case, Mesh, Tower, box

KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}


class Gltf:
    """A file as it grows; ``json`` may be changed before it is written."""

    def __init__(self) -> None:
        self.binary = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [],
            "meshes": [], "accessors": [], "bufferViews": [],
        }  # fmt: skip

    def view(self, data: bytes, **more: Any) -> int:
        """The number of a new bufferView."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        each = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **more}
        self.binary += data
        self.json["bufferViews"].append(each)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, rows: Any, kind: int = 5126, **more: Any) -> int:
        rows = np.asarray(rows)
        view = self.view(rows.astype(KINDS[kind]).tobytes())
        return self.described(view, rows, kind, **more)

    def described(self, view: int | None, rows: Any, kind: int = 5126, **more: Any) -> int:
        width = 1 if rows.ndim == 1 else rows.shape[1]
        each = {"componentType": kind, "count": len(rows), **more}
        each["type"] = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[width]
        if view is not None:
            each["bufferView"] = view
        self.json["accessors"].append(each)
        return len(self.json["accessors"]) - 1

    def mesh(self, *primitives: dict[str, Any], **more: Any) -> int:
        self.json["meshes"].append({"primitives": list(primitives), **more})
        return len(self.json["meshes"]) - 1

    def node(self, parent: int | None = None, **each: Any) -> int:
        self.json["nodes"].append(each)
        number = len(self.json["nodes"]) - 1
        above = self.json["scenes"][0] if parent is None else self.json["nodes"][parent]
        above.setdefault("nodes" if parent is None else "children", []).append(number)
        return number

    def stone(self, mesh: Mesh, parent: int | None = None, **each: Any) -> int:
        """A node of a whole mesh, as most programs write it."""
        name, points, faces = mesh
        number = self.mesh(self.primitive(points, triangles(faces)))
        return self.node(parent, **{"mesh": number, "name": name, **each})

    def primitive(self, points: Any, corners: Any, **more: Any) -> dict[str, Any]:
        where = {"POSITION": self.accessor(points)}
        return {"attributes": where, "indices": self.accessor(np.ravel(corners), 5123), **more}

    def uses(self, name: str, required: bool = True) -> None:
        self.json.setdefault("extensionsUsed", []).append(name)
        if required:
            self.json.setdefault("extensionsRequired", []).append(name)

    def glb(self, *more: dict[str, Any]) -> bytes:
        self.json["buffers"] = [{"byteLength": len(self.binary)}, *more]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        rest = self.binary + b"\0" * (-len(self.binary) % 4)
        parts = struct.pack("<I4s", len(text), b"JSON") + text
        parts += struct.pack("<I4s", len(rest), b"BIN\0") + rest
        return b"glTF" + struct.pack("<II", 2, 12 + len(parts)) + parts

    def embedded(self) -> bytes:
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
        self.json["buffers"] = [{"byteLength": len(self.binary), "uri": uri}]
        return json.dumps(self.json).encode()


def triangles(faces: Sequence[Sequence[int]]) -> Any:
    return np.array([(f[0], f[k], f[k + 1]) for f in faces for k in range(1, len(f) - 1)])


def case(made: Tower, file: Gltf, *words: str, near: float = 1e-5, **more: Any) -> Case:
    return Case("a.glb", file.glb(), made.factor, near, words, **more)


def refused(file: Gltf, *words: str) -> Case:
    return Case("a.glb", file.glb(), None, words=words)


def stones(made: Tower, but: int | None = None) -> Gltf:
    """All stones but one."""
    file = Gltf()
    for i, mesh in enumerate(made.meshes):
        if i != but:
            file.stone(mesh)
    return file


def cubes(rng: np.random.Generator) -> tuple[Tower, list[Mesh]]:
    """A pile of equal cubes: one mesh is enough for all of them."""
    size, count = float(rng.uniform(0.2, 1.0)), int(rng.integers(2, 6))
    slab = box("slab", (-1, -1, -0.5), (2, 2, 0))
    pile = [box(f"b{i}", (0, 0, i * size), (size, size, (i + 1) * size)) for i in range(count)]
    return Tower([slab, *pile], size, count * size, float(rng.uniform(0.3, 0.9))), pile


def plain(made: Tower, rng: np.random.Generator) -> Case:
    return case(made, stones(made))


def instances(made: Tower, rng: np.random.Generator) -> Case:
    """One node, placed several times; with turns by quarters and sizes, as scattering writes it."""
    tall, pile = cubes(rng)
    file, count = Gltf(), len(pile)
    file.stone(tall.meshes[0])
    node = file.json["nodes"][file.stone(box("stone", (-0.5,) * 3, (0.5,) * 3))]
    middles = np.array([points.mean(axis=0) for _, points, _ in pile])
    given: dict[str, Any] = {"TRANSLATION": file.accessor(middles)}
    given["SCALE"] = file.accessor(np.full((count, 3), tall.width))
    if rng.random() < 0.5:
        turns = Rotation.from_rotvec(np.pi / 2 * rng.integers(4, size=(count, 1)) * [0, 0, 1])
        given["ROTATION"] = file.accessor(turns.as_quat())
    node["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": given}}
    file.uses("EXT_mesh_gpu_instancing", required=bool(rng.random() < 0.5))
    return Case("a.glb", file.glb(), min(tall.width / tall.height, made.friction), 1e-5)


def one_mesh_for_all(made: Tower, rng: np.random.Generator) -> Case:
    tall, pile = cubes(rng)
    file = Gltf()
    file.stone(tall.meshes[0])
    number = file.mesh(file.primitive(pile[0][1], triangles(pile[0][2])))
    for i in range(len(pile)):
        file.node(mesh=number, name=f"b{i}", translation=[0, 0, i * tall.width])
    return Case("a.glb", file.glb(), min(tall.width / tall.height, made.friction), 1e-5)


def sparse(made: Tower, rng: np.random.Generator) -> Case:
    """Some corners of a stone, or all, stand in the sparse entries only."""
    k = int(rng.integers(1, len(made.meshes)))
    file, (name, points, faces) = stones(made, k), made.meshes[k]
    has_base = rng.random() < 0.5
    moved = rng.permutation(len(points))[: int(rng.integers(1, 8)) if has_base else None]
    base = points.copy()
    base[moved] += 3.0
    view = file.view(base.astype("<f4").tobytes()) if has_base else None
    number = file.described(view, points)
    file.json["accessors"][number]["sparse"] = {
        "count": len(moved),
        "indices": {"bufferView": file.view(np.sort(moved).astype("<u2").tobytes()),
                    "componentType": 5123},
        "values": {"bufferView": file.view(points[np.sort(moved)].astype("<f4").tobytes())},
    }  # fmt: skip
    corners = file.accessor(triangles(faces).ravel(), 5121)
    mesh = file.mesh({"attributes": {"POSITION": number}, "indices": corners})
    file.node(mesh=mesh, name=name)
    return case(made, file)


def quantised(made: Tower, rng: np.random.Generator) -> Case:
    """Positions as whole numbers, normalised or not, of two bytes: told, as they are coarse."""
    file = Gltf()
    is_normal, kind = bool(rng.random() < 0.5), int(rng.choice([5122, 5123]))
    low, high = np.array([-1.0, -1, -0.5]), np.array([2.0, 2.0, max(made.height, 0.1)])
    most = np.iinfo(KINDS[kind]).max
    for name, points, faces in made.meshes:
        whole = np.round((points - low) / (high - low) * most)
        where = file.accessor(whole, kind, normalized=is_normal)
        corners = file.accessor(triangles(faces).ravel(), 5123)
        mesh = file.mesh({"attributes": {"POSITION": where}, "indices": corners})
        scale = (high - low) / (1 if is_normal else most)
        file.node(mesh=mesh, name=name, translation=low.tolist(), scale=scale.tolist())
    file.uses("KHR_mesh_quantization")
    near = 4.0 * float((high - low).max()) / most / made.width
    return case(made, file, "quantised", near=near)


def strips(made: Tower, rng: np.random.Generator) -> Case:
    """A strip for each face, or one of all, joined by triangles of two corners; or fans."""
    file, way = Gltf(), rng.choice(["strips", "strip", "fans"])
    for name, points, faces in made.meshes:
        rows = [list(f) if way == "fans" else [f[0], f[1], f[3], f[2]] for f in faces]
        if way == "strip":
            joined = list[int]()
            for row in rows:
                joined += [*joined[-1:], *row[:1] * bool(joined), *row]
            rows = [joined]
        own = [file.primitive(points, row, mode=6 if way == "fans" else 5) for row in rows]
        file.node(mesh=file.mesh(*own), name=name)
    return case(made, file)


def two_materials(made: Tower, rng: np.random.Generator) -> Case:
    """Faces of a stone parted among primitives, each with corners of its own."""
    k = int(rng.integers(1, len(made.meshes)))
    file, (name, points, faces) = stones(made, k), made.meshes[k]
    cut = int(rng.integers(1, 6))
    parts = [file.primitive(points, triangles(some)) for some in (faces[:cut], faces[cut:])]
    file.node(mesh=file.mesh(*parts), name=name)
    return case(made, file)


def with_lines(made: Tower, rng: np.random.Generator) -> Case:
    """Lines on a stone, or a node of points alone, which is no stone: told."""
    if rng.random() < 0.5:
        file = stones(made)
        number = file.mesh(file.primitive(made.meshes[1][1], [0, 1, 2, 3], mode=1))
        file.node(mesh=number, name="axes")
        return case(made, file, "'axes' are points or lines", "nodes of the file have a mesh")
    file = stones(made, 1)
    name, points, faces = made.meshes[1]
    edges = file.primitive(points, [0, 1, 2, 3], mode=int(rng.integers(4)))
    file.node(mesh=file.mesh(file.primitive(points, triangles(faces)), edges), name=name)
    return case(made, file, f"'{name}' are points or lines")


def hidden(made: Tower, rng: np.random.Generator) -> Case:
    """One stone more, which the file hides, by itself or with the group that it is in."""
    file = stones(made)
    top = box("spare", (0, 0, made.height), (made.width, made.width, made.height + made.width))
    unseen = {"KHR_node_visibility": {"visible": False}}
    if rng.random() < 0.5:
        file.stone(top, extensions=unseen)
    else:
        file.stone(top, file.node(name="layer", extensions=unseen))
    file.uses("KHR_node_visibility", required=bool(rng.random() < 0.5))
    return case(made, file, "hidden in the file, and left out: 'spare'")


def another_scene(made: Tower, rng: np.random.Generator) -> Case:
    file = stones(made)
    top = box("spare", (0, 0, made.height), (made.width, made.width, made.height + made.width))
    file.json["scenes"][0]["nodes"].remove(file.stone(top))
    return case(made, file, "1 nodes with a mesh are not in the scene")


def compressed(made: Tower, rng: np.random.Generator) -> Case:
    file = stones(made)
    name = str(rng.choice(["KHR_draco_mesh_compression", "EXT_meshopt_compression",
                           "KHR_meshopt_compression"]))  # fmt: skip
    file.uses(name)
    return refused(file, f"needs the extension '{name}'", "untick Compression|leave out")


def draco_without_need(made: Tower, rng: np.random.Generator) -> Case:
    """Compressed, and said not to be needed: with numbers beside, or without any."""
    file, name = stones(made), "KHR_draco_mesh_compression"
    file.uses(name, required=False)
    first = file.json["meshes"][1]["primitives"][0]
    first["extensions"] = {name: {"bufferView": 0, "attributes": {"POSITION": 0}}}
    if rng.random() < 0.5:
        return case(made, file, f"extension '{name}' is not read here")
    del file.json["accessors"][first["attributes"]["POSITION"]]["bufferView"]
    return refused(file, f"'b0' has the extension '{name}'", "untick Compression")


def fallback_without_bytes(made: Tower, rng: np.random.Generator) -> Case:
    """Compressed by meshopt, where the buffer for readers that cannot is left empty."""
    file, name = stones(made), "EXT_meshopt_compression"
    file.uses(name, required=False)
    file.json["bufferViews"][2] |= {"buffer": 1, "extensions": {name: {"buffer": 0}}}
    content = file.glb({"byteLength": 96, "extensions": {name: {"fallback": True}}})
    return Case("a.glb", content, None, words=(f"the extension '{name}'", "leave out"))


def unknown_extension(made: Tower, rng: np.random.Generator) -> Case:
    file, name = stones(made), "EXT_bends_all_stones"
    file.json["nodes"][1]["extensions"] = {name: {}}
    is_required = bool(rng.random() < 0.5)
    file.uses(name, is_required)
    if is_required:
        return refused(file, f"needs the extension '{name}'", "untick it in the exporter")
    return case(made, file, f"extension '{name}' is not read here")


def looks_alone(made: Tower, rng: np.random.Generator) -> Case:
    """Extensions of materials and textures change no stone, needed or not."""
    file = stones(made)
    file.uses("KHR_materials_unlit")
    file.uses("KHR_texture_transform")
    return case(made, file)


def interleaved(made: Tower, rng: np.random.Generator) -> Case:
    """Positions and normals in turns, at a stride; corners of each triangle by themselves."""
    file = Gltf()
    for name, points, faces in made.meshes:
        rows = points[triangles(faces).ravel()]
        both = np.hstack([rows, rng.normal(size=rows.shape)]).astype("<f4")
        view = file.view(both.tobytes(), byteStride=24)
        where = file.described(view, rows)
        mesh = file.mesh({"attributes": {"POSITION": where}})
        file.node(mesh=mesh, name=name)
    return case(made, file)


def moved_nodes(made: Tower, rng: np.random.Generator) -> Case:
    """Stones of any place, turn, size and hand below a node of another, by matrix or in parts."""
    file = Gltf()
    turn, size = Rotation.random(random_state=rng), float(rng.uniform(0.5, 2.0))
    shift = rng.uniform(-2, 2, 3)
    parent = file.node(name="all", rotation=turn.as_quat().tolist(), scale=[size] * 3,
                       translation=shift.tolist())  # fmt: skip
    for name, points, faces in made.meshes:
        own = turn.inv().apply(points - shift) / size
        hand = -1.0 if rng.random() < 0.5 else 1.0
        inner = Rotation.random(random_state=rng)
        place = np.eye(4)
        place[:3, :3] = inner.as_matrix() @ np.diag([hand, 1, 1])
        place[:3, 3] = rng.uniform(-2, 2, 3)
        local = (own - place[:3, 3]) @ np.linalg.inv(place[:3, :3]).T
        if rng.random() < 0.5:
            each: dict[str, Any] = {"matrix": place.T.ravel().tolist()}
        else:
            each = {"rotation": inner.as_quat().tolist(), "scale": [hand, 1, 1],
                    "translation": place[:3, 3].tolist()}  # fmt: skip
        file.stone((name, local, faces), parent, **each)
    return case(made, file, near=1e-4)


def blended(made: Tower, rng: np.random.Generator) -> Case:
    """Shapes to be blended: the file stands between them, by weights of the mesh or the node."""
    k = int(rng.integers(1, len(made.meshes)))
    file, (name, points, faces) = stones(made, k), made.meshes[k]
    away, weight = rng.normal(size=points.shape), float(rng.choice([0.25, 0.5, 1.0]))
    own = file.primitive(points - weight * away, triangles(faces))
    own["targets"] = [{"POSITION": file.accessor(away)}]
    at_node = rng.random() < 0.5
    mesh = file.mesh(own, weights=[0.1 if at_node else weight])
    file.node(mesh=mesh, name=name, **({"weights": [weight]} if at_node else {}))
    return case(made, file)


def skinned(made: Tower, rng: np.random.Generator) -> Case:
    file = stones(made)
    file.json["nodes"][1]["skin"] = 0
    file.json["skins"] = [{"joints": [0]}]
    return refused(file, "node 'b0' is moved by a skin")


def embedded(made: Tower, rng: np.random.Generator) -> Case:
    return Case("a.gltf", stones(made).embedded(), made.factor, 1e-5)


def of_one_name(made: Tower, rng: np.random.Generator) -> Case:
    file = stones(made)
    for node in file.json["nodes"][1:]:
        node["name"] = "stone"
    words = () if len(made.meshes) == 2 else ("several blocks have the same name",)
    return case(made, file, *words)


def one_node_of_several(made: Tower, rng: np.random.Generator) -> Case:
    """A wall as one mesh: each body in it is a stone, and that is told."""
    file, shared, before = Gltf(), [], 0
    for _, points, faces in made.meshes:
        shared.append((points, triangles(faces) + before))
        before += len(points)
    rows, corners = (np.concatenate(each) for each in zip(*shared, strict=True))
    file.node(mesh=file.mesh(file.primitive(rows, corners)), name="wall")
    return case(made, file, f"'wall' holds {len(made.meshes)} separate bodies")


def twice(made: Tower, rng: np.random.Generator) -> Case:
    file = stones(made)
    file.node(mesh=1, name="again")
    return refused(file, "'b0' and 'again' are the same body twice")


WAYS: dict[str, Callable[[Tower, np.random.Generator], Case]] = {
    way.__name__: way
    for way in (
        plain, instances, one_mesh_for_all, sparse, quantised, strips, two_materials, with_lines,
        hidden, another_scene, compressed, draco_without_need, fallback_without_bytes,
        unknown_extension, looks_alone,
        interleaved, moved_nodes, blended, skinned, embedded, of_one_name, one_node_of_several,
        twice,
    )
}  # fmt: skip
