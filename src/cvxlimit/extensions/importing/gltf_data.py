"""What a glTF 2.0 file holds: its JSON, its extensions, and the numbers of its accessors.

An accessor describes numbers in a bufferView, a stretch of the bytes of a buffer. The file may be
hostile: indices, offsets and sizes that it claims are held against the bytes that it has, and no
file but buffers in the same folder is opened.
"""

from __future__ import annotations

import base64
import binascii
import os
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeGuard
from urllib.parse import unquote

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.io.fields import parsed, read_bytes, shown

INSTANCING, VISIBILITY = "EXT_mesh_gpu_instancing", "KHR_node_visibility"

_READ = {INSTANCING, VISIBILITY, "KHR_mesh_quantization"}

_LOOKS = (
    "KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "EXT_lights_",
    "KHR_xmp", "ADOBE_materials_", "MSFT_packing_", "FB_ngon_",
)  # fmt: skip
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


@dataclass(eq=False)
class GltfData:
    """The JSON of a file, with the bytes of its buffers as they are asked for.

    ``binary`` is what a GLB has behind its JSON, the buffer that has no name.
    """

    json: dict[str, Any]
    path: Path
    binary: bytes | None
    buffers: dict[int, bytes] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path) -> GltfData:
        """Those of a .glb or .gltf file; of another version, or if it needs an extension that would
        have to be known, it is refused."""
        data = read_bytes(path)
        text, binary = _chunks(data) if path.suffix.lower() == ".glb" else (data, None)
        document = parsed(text)
        if not isinstance(document, dict):
            raise InputError("a glTF file must be a JSON object {...}")
        version = object_in(document, "asset").get("version")
        if not str(version).startswith("2"):
            raise InputError(f"it is of glTF version {shown(version)}; export it as glTF 2.0")
        strange = [*unread(list_in(document, "extensionsRequired"))]
        if strange:
            raise InputError(f"it needs {_said_of(strange[0])}")
        return cls(document, path, binary)

    def each(self, key: str) -> list[Any]:
        """The objects of a list of the document."""
        found = list_in(self.json, key)
        for i, value in enumerate(found):
            if not isinstance(value, dict):
                raise InputError(
                    f"entry {i} of {key!r} must be an object {{...}}, got {shown(value)}"
                )
        return found

    def accessor(self, number: object, width: int) -> FloatArray:
        """The numbers (count, width) that an accessor describes, as they are meant: integers that
        are normalised become shares of the largest, and sparse entries are put in."""
        each = self.each("accessors")
        number = index_in(number, each, "accessor")
        accessor, where = each[number], f"accessor {number}"
        kind, count = _KINDS.get(accessor.get("componentType", 0)), accessor.get("count")
        if kind is None or _WIDTHS.get(accessor.get("type", "")) != width:
            got = f"{accessor.get('type')} of {accessor.get('componentType')}"
            raise InputError(f"{where} must hold {width} numbers an element, got {shown(got)}")
        if not _is_whole(count):
            raise InputError(f"{where} has no count")
        if "bufferView" in accessor:
            self._check_compressed(accessor["bufferView"], where)
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
            found = self._with_sparse(found, object_in(accessor, "sparse"), kind, where)
        result = found.astype(float)
        if accessor.get("normalized") is True and "f" not in kind:
            result = np.maximum(result / np.iinfo(kind).max, -1.0)
        return result

    def step(self, number: int) -> float:
        """What neighbouring numbers of an accessor differ by; 0 for those with a point."""
        accessor = self.each("accessors")[number]
        kind = _KINDS[accessor["componentType"]]
        if "f" in kind:
            return 0.0
        return 1.0 / np.iinfo(kind).max if accessor.get("normalized") is True else 1.0

    def _with_sparse(self, found: Any, sparse: Any, kind: str, where: str) -> Any:
        """The rows of an accessor, with those that it has apart in place of the ones there."""
        some, (count, width) = sparse.get("count"), found.shape
        if not _is_whole(some) or some > count:
            raise InputError(f"{where} has {shown(some)} sparse entries of {count}")
        places = object_in(sparse, "indices")
        which = _KINDS.get(places.get("componentType", 0))
        if which is None or "f" in which or "i" in which:
            raise InputError(f"the sparse indices of {where} must be whole numbers")
        rows = self._values(places, some, 1, which, where)[:, 0]
        if len(rows) and rows.max() >= count:
            raise InputError(f"{where} has a sparse entry {rows.max()} of {count}")
        found = found.copy()
        found[rows] = self._values(object_in(sparse, "values"), some, width, kind, where)
        return found

    def _check_compressed(self, number: object, where: str) -> None:
        """Refuse numbers that are there in a compressed form only."""
        views = self.each("bufferViews")
        view = views[index_in(number, views, "bufferView")]
        with_cure = compressed(view)
        if with_cure:
            buffer = index_in(view.get("buffer"), self.each("buffers"), "buffer")
            if not self._buffer(buffer):
                raise InputError(f"{where} has {with_cure}")

    def _values(self, given: Any, count: int, width: int, kind: str, where: str) -> Any:
        """``count`` rows at a byteOffset of a bufferView, which may leave bytes between them."""
        views, size = self.each("bufferViews"), np.dtype(kind).itemsize * width
        view = views[index_in(given.get("bufferView"), views, "bufferView")]
        buffer = self._buffer(index_in(view.get("buffer"), self.each("buffers"), "buffer"))
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
        return sum(len(self._buffer(k)) for k in range(len(self.each("buffers"))))

    def _buffer(self, number: int) -> bytes:
        """The bytes of a buffer, which are read once: of the GLB, of a data URI, or of a file."""
        if number in self.buffers:
            return self.buffers[number]
        buffer = self.each("buffers")[number]
        uri, length = buffer.get("uri"), buffer.get("byteLength")
        if not _is_whole(length):
            raise InputError(f"buffer {number} has no byteLength")
        if uri is None:
            data = self.binary if number == 0 and self.binary is not None else b""
        elif not isinstance(uri, str):
            raise InputError(f"the uri of buffer {number} must be a text, got {shown(uri)}")
        elif uri.startswith("data:"):
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
        # Without a uri no bytes are what compression leaves of a buffer; who needs it is refused.
        is_left = uri is None and not data
        if len(data) < length and not is_left:
            raise InputError(f"buffer {number} says {length} bytes and has {len(data)}")
        self.buffers[number] = data[:length]
        return self.buffers[number]


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


# Extensions


def extensions_of(value: Any) -> Mapping[str, Any]:
    """The extensions that an object of the file has, by name."""
    return object_in(value, "extensions") if isinstance(value, dict) else {}


def unread(names: Iterable[object]) -> Iterator[object]:
    """Those of extensions that change where bodies are, and that are not read here."""
    for name in names:
        if name not in _READ and not str(name).startswith(_LOOKS):
            yield name


def compressed(value: Any) -> str:
    """What is to be said of the extension that compresses an object's numbers; empty without."""
    return next((_said_of(name) for name in extensions_of(value) if name in _CURES), "")


def _said_of(name: object) -> str:
    cure = _CURES.get(str(name), "untick it in the exporter")
    return f"the extension {shown(name)}, which is not read here: {cure}, and export it again"


# JSON


def list_in(value: Any, key: str) -> list[Any]:
    """The list under a key of an object; empty without."""
    found = value.get(key, [])
    if not isinstance(found, list):
        raise InputError(f"{key!r} of the glTF must be a list [...], got {shown(found)}")
    return found


def object_in(value: Any, key: str) -> dict[str, Any]:
    """The object under a key of an object; empty without."""
    found = value.get(key, {})
    if not isinstance(found, dict):
        raise InputError(f"{key!r} of the glTF must be an object {{...}}, got {shown(found)}")
    return found


def index_in(value: object, things: Sequence[Any], what: str) -> int:
    """The value, if it is the number of one of the things."""
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < len(things):
        raise InputError(f"there is no {what} {shown(value)}: the file has {len(things)}")
    return value


def _is_whole(value: object) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53
