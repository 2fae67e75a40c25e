"""glTF 2.0, as .glb or .gltf: every node that shows a mesh is a body, under the node's name.

A reader of our own. trimesh leaves out what it does not know in silence (instances, sparse and
normalised accessors, visibility, required extensions: one stone of three was read, or one 32,767
times too large), and pygltflib stops at the JSON, with accessors undecoded. The format says what
must be understood, so that this reader refuses by name whatever it does not know.

The file may be hostile: indices, offsets and sizes that it claims are held against the bytes that
it has, and no file but buffers in the same folder is opened.
"""

from __future__ import annotations

import base64
import binascii
import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeGuard
from urllib.parse import unquote

import numpy as np
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, merged, read_by_others
from cvxlimit.io.fields import LARGEST_FILE, parsed, read_bytes, shown

INSTANCING, VISIBILITY = "EXT_mesh_gpu_instancing", "KHR_node_visibility"

_READ = {INSTANCING, VISIBILITY, "KHR_mesh_quantization"}

_LOOKS = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
    "ADOBE_materials_",
    "MSFT_packing_",
    "FB_ngon_",
)
"""How names of extensions begin that change how a body looks, and not where it is."""

_CURES = {
    "KHR_draco_mesh_compression": "untick Compression in the exporter (gltf-transform: leave out "
    "draco)",
    "EXT_meshopt_compression": "leave out -c and -cc of gltfpack, or meshopt of gltf-transform",
    "KHR_meshopt_compression": "leave out the compression by meshopt",
}
"""What to do about extensions that are refused; of others it is the exporter's option for them."""

_KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Types of NumPy by componentType."""

_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
"""Modes of primitives that have faces; those below are points and lines."""


def read_gltf(path: Path, notes: list[str]) -> list[Body]:
    """The bodies of the scene that the file shows; ``notes`` gets what it does not show."""
    with read_by_others("glTF", "export it again"):
        return [*_Document.of(path).bodies(notes)]


@dataclass(eq=False)
class _Document:
    """The JSON of a file, with the bytes of its buffers as they are asked for."""

    json: dict[str, Any]
    path: Path
    binary: bytes | None
    buffers: dict[int, bytes] = field(default_factory=dict)
    corners: int = 0
    step: float = 0.0

    @classmethod
    def of(cls, path: Path) -> _Document:
        data = read_bytes(path)
        text, binary = _chunks(data) if path.suffix.lower() == ".glb" else (data, None)
        document = parsed(text)
        if not isinstance(document, dict):
            raise InputError("a glTF file must be a JSON object {...}")
        made = cls(document, path, binary)
        made._check()
        return made

    def _check(self) -> None:
        """Refuse other versions, and extensions that this reader would have to know."""
        version = self._object(self.json, "asset").get("version")
        if not str(version).startswith("2"):
            raise InputError(f"it is of glTF version {shown(version)}; export it as glTF 2.0")
        for name in self._list(self.json, "extensionsRequired"):
            if name not in _READ and not str(name).startswith(_LOOKS):
                raise InputError(f"it needs {self._unread(name)}")

    def _unread(self, name: object) -> str:
        """What is to be said of an extension that cannot be read."""
        cure = _CURES.get(str(name), "untick it in the exporter")
        return f"the extension {shown(name)}, which is not read here: {cure}, and export it again"

    def bodies(self, notes: list[str]) -> Iterator[Body]:
        """One body for each node with a mesh, or for each of its instances."""
        strange = {name for each in self._carriers() for name in self._extensions(each)} - _READ
        strange = {name for name in strange if not name.startswith(_LOOKS)}
        notes += [
            f"extension {shown(name)} is not read here, and the file says that it is not needed: "
            "compare the picture with the original, or export again without it"
            for name in sorted(strange)
        ]
        if any(self._list(each, "channels") for each in self._each("animations")):
            notes.append("the file moves its nodes (animations): they are taken as they stand")
        number, widest = 0, 0.0
        for name, node, places in self._placed(notes):
            points, faces = self._mesh(node, name, notes)
            self.corners += len(points) * len(places)
            if 24 * self.corners > LARGEST_FILE:  # bytes of the coordinates, each node's its own
                raise InputError(
                    "the same meshes are shown so often that the bodies of the file "
                    f"have {self.corners} corners and more"
                )
            number += bool(len(faces))
            for k, place in enumerate(places, 1):
                if len(faces):
                    wide = float(np.abs(place[:3, :3]).sum(axis=1).max())
                    widest = max(widest, wide * self.step)
                    moved = points @ place[:3, :3].T + place[:3, 3]
                    own = name if len(places) == 1 or not name else f"{name}.{k}"
                    yield Body(own, *_welded(moved, faces), unit="m")  # by the format
        if widest:
            notes.append(
                f"positions are whole numbers (quantised), in steps of up to {widest:.3g}: untick "
                "quantisation in the exporter if that is too coarse"
            )
        shown_nodes = sum("mesh" in node for node in self._each("nodes"))
        if number < shown_nodes:
            notes.append(f"{shown_nodes} nodes of the file have a mesh, {number} are bodies here")

    def _carriers(self) -> Iterator[Any]:
        """All that may carry an extension which changes where bodies are."""
        yield self.json
        for key in ("nodes", "meshes", "accessors", "bufferViews", "buffers", "scenes"):
            yield from self._each(key)
        for mesh in self._each("meshes"):
            yield from self._list(mesh, "primitives")

    def _extensions(self, each: Any) -> Mapping[str, Any]:
        return self._object(each, "extensions") if isinstance(each, dict) else {}

    # --- nodes ----------------------------------------------------------------------------------

    def _placed(self, notes: list[str]) -> Iterator[tuple[str, Any, list[FloatArray]]]:
        """Name, node and places (4, 4) in the scene of each node that shows a mesh, in the order
        of the tree; several places are instances."""
        nodes = self._each("nodes")
        _check_tree([self._list(node, "children") for node in nodes])
        scenes = self._each("scenes")
        roots = (
            self._list(scenes[self._index(self.json.get("scene", 0), scenes, "scene")], "nodes")
            if scenes
            else self._roots(nodes)
        )
        hidden, seen = list[str](), set[int]()
        todo = [(root, np.eye(4), True) for root in reversed(roots)]
        while todo:
            number, above, is_shown = todo.pop()
            node = nodes[self._index(number, nodes, "node")]
            seen.add(number)
            said = self._object(node, "extensions").get(VISIBILITY)
            is_shown &= not isinstance(said, dict) or said.get("visible", True) is not False
            name = node.get("name")
            name = name if isinstance(name, str) else ""
            place = above @ _transform(node, name or f"node {number}")
            todo += [(n, place, is_shown) for n in reversed(self._list(node, "children"))]
            if "mesh" not in node:
                continue
            if not is_shown:
                hidden.append(name or f"node {number}")
                continue
            mesh = self._index(node["mesh"], self._each("meshes"), "mesh")
            name = name or str(self._each("meshes")[mesh].get("name") or "")
            if "skin" in node:
                raise InputError(
                    f"node {shown(name)} is moved by a skin: apply its armature, or "
                    "untick skinning in the exporter"
                )
            yield name, node, [place @ each for each in self._instances(node, name)]
        if hidden:
            more = f" and {len(hidden) - 8} more" if len(hidden) > 8 else ""
            notes.append(
                f"hidden in the file, and left out: {', '.join(map(shown, hidden[:8]))}{more}"
            )
        out = [node for k, node in enumerate(nodes) if k not in seen and "mesh" in node]
        if out:
            notes.append(
                f"{len(out)} nodes with a mesh are not in the scene that the file shows, "
                "and are left out: export one scene"
            )

    def _roots(self, nodes: Sequence[Any]) -> list[int]:
        below = {child for node in nodes for child in self._list(node, "children")}
        return [k for k in range(len(nodes)) if k not in below]

    def _instances(self, node: Any, name: str) -> list[FloatArray]:
        """Where each instance of a node's mesh stands, seen from the node: 4 x 4 each."""
        said = self._object(node, "extensions").get(INSTANCING)
        if not isinstance(said, dict):
            return [np.eye(4)]
        given = self._object(said, "attributes")
        turns = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}
        read = {
            key: self._accessor(given[key], width) for key, width in turns.items() if key in given
        }
        if len({len(rows) for rows in read.values()}) != 1:
            raise InputError(
                f"the instances of node {shown(name)} have as many places as "
                f"{', '.join(f'{k} {len(v)}' for k, v in read.items()) or 'nothing'}; "
                "untick instancing in the exporter"
            )
        keys = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
        count = len(next(iter(read.values())))
        if 128 * count > LARGEST_FILE:  # bytes of their places
            raise InputError(f"node {shown(name)} claims {count} instances")
        return [
            _transform({keys[key]: rows[k].tolist() for key, rows in read.items()}, name)
            for k in range(count)
        ]

    # --- meshes ---------------------------------------------------------------------------------

    def _mesh(self, node: Any, name: str, notes: list[str]) -> tuple[FloatArray, Any]:
        """Corners (k, 3) and triangles (t, 3) of all primitives of a node's mesh: materials and
        modes part what is one body."""
        mesh, self.step = self._each("meshes")[node["mesh"]], 0.0
        points, faces, before = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], 0
        without = 0
        for primitive in self._list(mesh, "primitives"):
            if not isinstance(primitive, dict):
                raise InputError(f"a primitive of {shown(name)} must be an object {{...}}")
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in range(7):
                raise InputError(
                    f"a primitive of {shown(name)} has mode {shown(mode)}, which is "
                    "neither triangles nor points or lines"
                )
            if mode < _TRIANGLES:
                without += 1
                continue
            weights = self._list(node if "weights" in node else mesh, "weights")
            own, corners = self._primitive(primitive, weights, name)
            if mode == _TRIANGLES and len(corners) % 3:
                raise InputError(
                    f"{shown(name)} has {len(corners)} corners, which make no whole "
                    "number of triangles; it is cut off"
                )
            points.append(own)
            faces.append(_triangles(corners, mode) + before)
            before += len(own)
        if without:
            notes.append(
                f"{without} primitives of {shown(name)} are points or lines, not faces, "
                "and are left out"
            )
        return np.concatenate(points), np.concatenate(faces)

    def _primitive(
        self, primitive: Any, weights: Sequence[Any], name: str
    ) -> tuple[FloatArray, Any]:
        """Corners of a primitive, and which of them its triangles take, one after the other."""
        attributes = self._object(primitive, "attributes")
        compressed = [key for key in self._extensions(primitive) if key in _CURES]
        try:
            if "POSITION" not in attributes:
                raise InputError(f"a primitive of {shown(name)} has no POSITION")
            points = self._accessor(attributes["POSITION"], 3)
            self.step = max(self.step, self._step(attributes["POSITION"]))
            # Shapes between which the mesh is blended, where the file stands between them.
            targets = self._list(primitive, "targets")
            for target, weight in zip(targets, weights, strict=False):
                if isinstance(weight, int | float) and weight and "POSITION" in target:
                    points = points + weight * self._accessor(target["POSITION"], 3)
            corners = np.arange(len(points))
            if "indices" in primitive:
                corners = self._accessor(primitive["indices"], 1)[:, 0].astype(np.int64)
        except InputError as error:
            if compressed:
                raise InputError(f"{shown(name)} has {self._unread(compressed[0])}") from error
            raise
        if len(corners) and corners.max() >= len(points):
            raise InputError(
                f"a face of {shown(name)} names vertex {corners.max()}, but there are "
                f"{len(points)}, numbered from 0"
            )
        return points, corners

    # --- numbers --------------------------------------------------------------------------------

    def _accessor(self, number: object, width: int) -> FloatArray:
        """The numbers (count, width) that an accessor describes, as they are meant: integers that
        are normalised become shares of the largest, and sparse entries are put in."""
        each = self._each("accessors")
        number = self._index(number, each, "accessor")
        accessor, where = each[number], f"accessor {number}"
        kind, count = _KINDS.get(accessor.get("componentType", 0)), accessor.get("count")
        if kind is None or _WIDTHS.get(accessor.get("type", "")) != width:
            got = f"{accessor.get('type')} of {accessor.get('componentType')}"
            raise InputError(f"{where} must hold {width} numbers an element, got {shown(got)}")
        if not _is_whole(count):
            raise InputError(f"{where} has no count")
        self._check_compressed(accessor, where)
        if count > self._size:
            raise InputError(
                f"its accessors count {count} elements, its buffers {self._size} bytes"
            )
        if "bufferView" in accessor:
            found = self._values(accessor, count, width, kind, where)
        elif "sparse" in accessor:
            found = np.zeros((count, width), dtype=kind)
        else:
            raise InputError(
                f"{where} has no bufferView, and so no numbers; export it again without compression"
            )
        if "sparse" in accessor:
            sparse = self._object(accessor, "sparse")
            some = sparse.get("count")
            if not _is_whole(some) or some > count:
                raise InputError(f"{where} has {shown(some)} sparse entries of {count}")
            places = self._object(sparse, "indices")
            which = _KINDS.get(places.get("componentType", 0))
            if which is None or "f" in which or "i" in which:
                raise InputError(f"the sparse indices of {where} must be whole numbers")
            rows = self._values(places, some, 1, which, where)[:, 0]
            if len(rows) and rows.max() >= count:
                raise InputError(f"{where} has a sparse entry {rows.max()} of {count}")
            found = found.copy()
            found[rows] = self._values(self._object(sparse, "values"), some, width, kind, where)
        result = found.astype(float)
        if accessor.get("normalized") is True and "f" not in kind:
            result = np.maximum(result / np.iinfo(kind).max, -1.0)
        return result

    def _check_compressed(self, accessor: Any, where: str) -> None:
        """Refuse numbers that are there in a compressed form only."""
        views = self._each("bufferViews")
        view = (
            views[self._index(accessor["bufferView"], views, "bufferView")]
            if ("bufferView" in accessor)
            else {}
        )
        if compressed := [name for name in self._extensions(view) if name in _CURES]:
            buffer = self._index(view.get("buffer"), self._each("buffers"), "buffer")
            if not self._buffer(buffer):
                raise InputError(f"{where} has {self._unread(compressed[0])}")

    def _step(self, number: int) -> float:
        """What neighbouring numbers of an accessor differ by; 0 for those with a point."""
        accessor = self._each("accessors")[number]
        kind = _KINDS[accessor["componentType"]]
        if "f" in kind:
            return 0.0
        return 1.0 / np.iinfo(kind).max if accessor.get("normalized") is True else 1.0

    def _values(self, given: Any, count: int, width: int, kind: str, where: str) -> Any:
        """``count`` rows at a byteOffset of a bufferView, which may leave bytes between them."""
        views, size = self._each("bufferViews"), np.dtype(kind).itemsize * width
        view = views[self._index(given.get("bufferView"), views, "bufferView")]
        buffer = self._buffer(self._index(view.get("buffer"), self._each("buffers"), "buffer"))
        stride = view.get("byteStride", size)
        begin, length = view.get("byteOffset", 0), view.get("byteLength")
        offset = given.get("byteOffset", 0)
        if not all(map(_is_whole, (stride, begin, length, offset))) or stride < size:
            raise InputError(f"the bufferView of {where} has no sizes that make sense")
        end = offset + stride * (count - 1) + size if count else 0
        if end > length or begin + length > len(buffer):
            raise InputError(f"{where} reaches beyond the bytes that the file has; it is cut off")
        if not count:
            return np.empty((0, width), kind)
        strides = (stride, np.dtype(kind).itemsize)
        return np.ndarray((count, width), kind, buffer, begin + offset, strides)

    @cached_property
    def _size(self) -> int:
        """Bytes of all buffers: no accessor can have more elements."""
        return sum(len(self._buffer(k)) for k in range(len(self._each("buffers"))))

    def _buffer(self, number: int) -> bytes:
        if number not in self.buffers:
            self.buffers[number] = self._loaded(number)
        return self.buffers[number]

    def _loaded(self, number: int) -> bytes:
        buffer = self._each("buffers")[number]
        uri, length = buffer.get("uri"), buffer.get("byteLength")
        if not _is_whole(length):
            raise InputError(f"buffer {number} has no byteLength")
        if uri is None:
            data = self.binary if number == 0 and self.binary is not None else b""
            # A buffer of no bytes is what compression leaves of one; who needs it is refused.
            if data and len(data) < length:
                raise InputError(f"buffer {number} says {length} bytes and has {len(data)}")
            return data[:length]
        if not isinstance(uri, str):
            raise InputError(f"the uri of buffer {number} must be a text, got {shown(uri)}")
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            try:
                data = base64.b64decode(body, validate=True)
            except binascii.Error as error:
                raise InputError(f"the data of buffer {number} must be base64") from error
            if not head.endswith(";base64"):
                raise InputError(f"the data of buffer {number} must be base64, got {shown(head)}")
        else:
            name = unquote(uri)
            plain = os.path.basename(name)
            if plain != name or plain in ("", ".", "..") or "\0" in name or "\\" in name:
                raise InputError(
                    f"buffer {shown(uri)} must be a file in the folder of {self.path.name}"
                )
            data = read_bytes(self.path.with_name(plain), is_asked_for=False)
        if len(data) < length:
            raise InputError(f"buffer {number} says {length} bytes and has {len(data)}")
        return data[:length]

    # --- JSON -----------------------------------------------------------------------------------

    def _each(self, key: str) -> list[Any]:
        """The objects of a list of the document."""
        found = self._list(self.json, key)
        for i, value in enumerate(found):
            if not isinstance(value, dict):
                raise InputError(
                    f"entry {i} of {key!r} must be an object {{...}}, got {shown(value)}"
                )
        return found

    @staticmethod
    def _list(value: Any, key: str) -> list[Any]:
        found = value.get(key, [])
        if not isinstance(found, list):
            raise InputError(f"{key!r} of the glTF must be a list [...], got {shown(found)}")
        return found

    @staticmethod
    def _object(value: Any, key: str) -> dict[str, Any]:
        found = value.get(key, {})
        if not isinstance(found, dict):
            raise InputError(f"{key!r} of the glTF must be an object {{...}}, got {shown(found)}")
        return found

    @staticmethod
    def _index(value: object, things: Sequence[Any], what: str) -> int:
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < len(things):
            raise InputError(f"there is no {what} {shown(value)}: the file has {len(things)}")
        return value


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON of a GLB, which is its first part by the format, and the bytes after it."""
    head = 20  # bytes before the text that says what is in it
    if len(data) < head or data[:4] != b"glTF":
        raise InputError("the file does not begin like a GLB")
    total, length, kind = struct.unpack_from("<II4s", data, 8)
    if kind != b"JSON" or total > len(data) or length > len(data) - head:
        raise InputError(f"the GLB is cut off: it says {total} bytes and has {len(data)}")
    text, place = data[head : head + length], head + length
    while place + 8 <= total:
        length, kind = struct.unpack_from("<I4s", data, place)
        if length > total - place - 8:
            raise InputError(f"the GLB is cut off: a part says {length} bytes")
        if kind == b"BIN\0":
            return text, data[place + 8 : place + 8 + length]
        place += 8 + length
    return text, None


def _is_whole(value: object) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53


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


_UNIT = 0.01
"""Lengths of quaternions differ from 1 by what their numbers are rounded to, at most one byte's
1/127; more is no rotation, and programs make different things of it."""


def _numbers(node: Mapping[str, Any], key: str, default: Sequence[float], name: str) -> FloatArray:
    value = node.get(key, default)
    good = isinstance(value, Sequence) and len(value) == len(default) and not isinstance(value, str)
    if not good or not all(isinstance(x, int | float) and abs(x) < np.inf for x in value):
        raise InputError(
            f"the {key} of {shown(name)} must be {len(default)} numbers, got {shown(value)}"
        )
    return np.array(value, dtype=float)


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
