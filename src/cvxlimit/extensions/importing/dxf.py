"""DXF through ezdxf (the extra ``mesh``), which is imported when it is used.

What encloses a volume becomes blocks: closed polylines with a thickness, each the prism over it;
polyface meshes, meshes and solids, each as it is; 3D faces and faces without a thickness, all of a
layer together, whose bodies are told apart afterwards. Lines, texts and dimensions are left alone.
Blocks of the drawing are taken wherever they are inserted. What the drawing does not show, because
its layer is off or frozen, is not meant: it is left out and told.
"""

from __future__ import annotations

import io
import logging
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.extras import needed
from cvxlimit.base.lines import one_line
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, merged, read_by_others
from cvxlimit.io.fields import read_bytes, shown

Polygons = tuple[FloatArray, list[list[int]]]

_MOST = 100_000
"""Entities that a drawing may have once its blocks are inserted: more is a mistake, or meant to
exhaust memory, as blocks of blocks of blocks."""

_STEP = np.pi / 32.0
"""Angle of an arc's chords: both sides of a joint are cut alike, within 0.12 % of the radius."""

_SKIPPED = {
    "LINE", "POINT", "TEXT", "MTEXT", "DIMENSION", "LEADER", "MULTILEADER", "MLEADER", "HATCH",
    "ATTRIB", "ATTDEF", "VIEWPORT", "IMAGE", "RAY", "XLINE", "TOLERANCE", "WIPEOUT", "ARC",
    "OLE2FRAME", "LIGHT", "SUN", "CAMERA",
}  # fmt: skip
"""Entities that bound nothing by themselves."""


_OUTLINES = ("LWPOLYLINE", "POLYLINE", "SOLID", "TRACE")
"""Entities that are a closed outline, or may be."""

_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 14: "dm"}
"""Units of length by their numbers in ``$INSUNITS``; 0 is none."""


def read_dxf(path: Path, notes: list[str]) -> list[Body]:
    """The bodies of a drawing's model space; ``notes`` gets a sentence on what it does not show.

    Raises
    ------
    InputError
        If it cannot be read, or holds something that may be a block and is not closed or known.
    """
    recover, disassemble, units = (
        needed(f"ezdxf.{module}", "mesh", ".dxf files")
        for module in ("recover", "disassemble", "units")
    )
    hidden = Counter[str]()
    data = read_bytes(path)
    if not data.rstrip().endswith(b"EOF"):  # ezdxf would read what there is
        raise InputError("the DXF file has no EOF at its end: it is cut off, or it is not text")
    log = logging.getLogger("ezdxf")
    log.addHandler(logging.NullHandler())
    was, log.propagate = log.propagate, False  # it logs what it mends
    try:
        with read_by_others("DXF", "save it as text again"):
            document, _ = recover.read(io.BytesIO(data))
            _check_size(document)
            entities = _shown(document.modelspace(), _hidden_layers(document), hidden)
            bodies = _bodies(disassemble.recursive_decompose(entities), hidden)
            stated = int(document.header.get("$INSUNITS", 0))
            known = {u.value: u.name.lower() for u in units.InsertUnits if u.value} | _UNITS
            unit = known.get(stated, f"number {stated} of $INSUNITS") if stated else None
    finally:
        log.propagate = was
    if hidden.total():
        notes.append(f"left out: {_left_out(hidden)}")
    return [replace(body, unit=unit) for body in bodies]


def _hidden_layers(document: Any) -> dict[str, bool]:
    """Layers that are off or frozen, in small letters, and whether they are frozen."""
    layers = [layer for layer in document.layers if layer.is_off() or layer.is_frozen()]
    return {str(layer.dxf.name).lower(): bool(layer.is_frozen()) for layer in layers}


def _shown(
    entities: Iterable[Any], layers: Mapping[str, bool], hidden: Counter[str], within: str = "0"
) -> Iterator[Any]:
    """The entities that a drawing shows, inserted blocks taken apart; ``hidden`` counts the others
    by layer. In a block layer 0 stands for the layer on which it is inserted, ``within``. A layer
    that is off hides what is on it, a frozen one also what is in blocks inserted on it."""
    for entity in entities:
        own = str(entity.dxf.get("layer", "0"))
        layer = within if own == "0" else own
        is_hidden, kind = layer.lower() in layers, entity.dxftype()
        if entity.dxf.get("invisible", 0) or (is_hidden and kind != "INSERT"):
            hidden[layer] += kind not in _SKIPPED
        elif kind != "INSERT":
            yield entity
        elif layers.get(layer.lower(), False):
            hidden[layer] += 1
        elif entity.mcount > 1:
            yield from _shown(entity.multi_insert(), layers, hidden, within)
        else:
            yield from _shown(entity.virtual_entities(), layers, hidden, layer)


def _left_out(hidden: Counter[str]) -> str:
    """Says what is hidden."""
    on = ", ".join(shown(layer) for layer, count in sorted(hidden.items()) if count)
    number = hidden.total()
    return f"{number} object{'s' * (number > 1)} that the drawing does not show (layers {on})"


def _check_size(document: Any) -> None:
    """Refuse drawings with too many entities, counted without inserting any."""
    counts: dict[str, int] = {}

    def count(name: str, layout: Any, above: tuple[str, ...]) -> int:
        if name in above:
            raise InputError(f"block {shown(name)} of the drawing contains itself")
        if name not in counts:
            counts[name] = 0
            for entity in layout:
                times, inside = 1, ""
                if entity.dxftype() == "INSERT":
                    inside = str(entity.dxf.get("name", ""))
                if inside in document.blocks:
                    times = max(entity.mcount, 1)
                    times *= count(inside, document.blocks.get(inside), (*above, name))
                counts[name] += times
        return counts[name]

    total = count("*Model_Space", document.modelspace(), ())
    if total > _MOST:
        raise InputError(
            f"it has more than {_MOST} entities once its blocks are inserted; export less"
        )


def _bodies(entities: Iterable[Any], hidden: Counter[str]) -> list[Body]:
    solids: list[tuple[str, Polygons]] = []
    loose: dict[str, list[FloatArray]] = defaultdict(list)
    left_open, outlines = "", Counter[str]()  # closed polylines among the loose faces
    # What encloses a volume by itself, and the loose faces of each layer.
    for entity in entities:
        layer, kind = str(entity.dxf.get("layer", "0")), entity.dxftype()
        if kind in _SKIPPED:
            continue
        if kind == "3DFACE":
            loose[layer].append(np.array([v.xyz for v in entity.wcs_vertices()]))
        elif kind not in _OUTLINES or _is_mesh(entity):
            solids += [(layer, polygons) for polygons in _meshes(entity, kind, layer)]
        elif (outline := _outline(entity)) is None:
            left_open = left_open or f", but an open polyline on layer {shown(layer)}"
        elif (made := _prism(entity, outline)) is not None:
            solids.append((layer, made))
        else:
            loose[layer].append(_in_space(entity, outline))
            outlines[layer] += kind in ("LWPOLYLINE", "POLYLINE")
    # The faces of a layer together; what bodies they are of is told afterwards.
    for layer, faces in loose.items():
        _check_outlines(layer, faces, outlines[layer])
        numbers = iter(range(sum(map(len, faces))))
        solids.append((layer, (np.concatenate(faces), [[*islice(numbers, len(f))] for f in faces])))
    if not solids:
        left_open += f", but {_left_out(hidden)}" if hidden.total() else ""
        raise InputError(
            f"the drawing has nothing that encloses a block{left_open}: draw closed polylines with "
            "a thickness, 3D faces, meshes or solids"
        )
    return _named(solids)


def _check_outlines(layer: str, faces: list[FloatArray], outlines: int) -> None:
    """Refuse closed polylines side by side in one plane: stones of which the thickness is missing.
    One alone may be the ground."""
    points = np.concatenate(faces)
    off = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if 1 < outlines == len(faces) and off[2] <= 1e-9 * off[0]:
        raise InputError(
            f"{outlines} closed polylines on layer {shown(layer)} have no thickness, and so "
            "enclose no stone: give them the wall's in the drawing program's properties"
        )


def _named(solids: Sequence[tuple[str, Polygons]]) -> list[Body]:
    """Bodies named for their layers, and numbered where a layer has several."""
    times, seen, result = Counter(layer for layer, _ in solids), Counter[str](), []
    for layer, (points, faces) in solids:
        seen[layer] += 1
        name = layer if times[layer] == 1 else f"{layer}.{seen[layer]}"
        result.append(_body("" if layer == "0" and times[layer] == 1 else name, points, faces))
    return result


def _body(name: str, points: FloatArray, faces: list[list[int]]) -> Body:
    """Equal corners made one; a corner listed twice in a row, as in 3D faces of three, is one."""
    kept, number = merged(points, np.arange(len(points)))
    loops = [[int(number[i]) for i in face] for face in faces]
    loops = [[i for k, i in enumerate(loop) if i != loop[k - 1]] for loop in loops]
    return Body(name, kept, [loop for loop in loops if len(loop) > 2])


def _is_mesh(entity: Any) -> bool:
    return entity.dxftype() == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh)


def _in_space(entity: Any, outline: FloatArray) -> FloatArray:
    """The corners of an outline, which most entities give in a plane of their own."""
    if entity.dxftype() == "POLYLINE" and not entity.is_2d_polyline:
        return outline
    return np.array([entity.ocs().to_wcs(tuple(point)) for point in outline.tolist()])


def _prism(entity: Any, outline: FloatArray) -> Polygons | None:
    """The prism over an outline in a plane; None without a thickness."""
    height = float(entity.dxf.get("thickness", 0.0))
    if not height or (entity.dxftype() == "POLYLINE" and not entity.is_2d_polyline):
        return None
    points, k = _in_space(entity, outline), len(outline)
    up = height * np.array(entity.ocs().to_wcs((0.0, 0.0, 1.0)))
    sides = [[i, (i + 1) % k, k + (i + 1) % k, k + i] for i in range(k)]
    faces = [list(range(k))[::-1], list(range(k, 2 * k)), *sides]
    return np.vstack([points, points + up]), faces


def _outline(entity: Any) -> FloatArray | None:
    """Corners of a closed polyline in its own plane, arcs cut into chords; None if it is open."""
    if entity.dxftype() in ("SOLID", "TRACE"):  # 1 2 4 3 in the file, 1 2 3 4 here
        return np.array([v.xyz for v in entity.vertices()])
    if entity.dxftype() == "LWPOLYLINE":
        height = float(entity.dxf.elevation)
        rows = [(x, y, height, bulge) for x, y, bulge in entity.get_points("xyb")]
        closed = bool(entity.closed)
    else:
        height = float(entity.dxf.elevation[2]) if entity.is_2d_polyline else 0.0
        rows = [
            (*v.dxf.location.vec2, v.dxf.location.z or height, v.dxf.get("bulge", 0.0))
            for v in entity.vertices
        ]
        closed = bool(entity.is_closed)
    points = np.array([row[:3] for row in rows], dtype=float).reshape(-1, 3)
    bulges = [float(row[3]) for row in rows]
    if len(points) > 1 and (points[0] == points[-1]).all():  # drawn back to where it began
        points, bulges, closed = points[:-1], bulges[:-1], True
    if not closed or len(points) < (3 if not any(bulges) else 2):
        return None
    result = []
    for start, end, bulge in zip(points, np.roll(points, -1, axis=0), bulges, strict=True):
        result += [start, *_arc(start, end, bulge)]
    return np.array(result)


def _arc(start: FloatArray, end: FloatArray, bulge: float) -> list[FloatArray]:
    """Points between the ends of an arc whose quarter angle has the tangent ``bulge``."""
    if not bulge:
        return []
    angle = 4.0 * np.arctan(bulge)
    chord = end - start
    aside = np.array([-chord[1], chord[0], 0.0])
    centre = 0.5 * (start + end) + aside * (1.0 - bulge**2) / (4.0 * bulge)
    spoke = start - centre
    steps = np.linspace(0.0, angle, max(2, int(np.ceil(abs(angle) / _STEP))) + 1)[1:-1]
    across = np.array([-spoke[1], spoke[0], 0.0])
    return [centre + np.cos(t) * spoke + np.sin(t) * across for t in steps]


def _meshes(entity: Any, kind: str, layer: str) -> Iterator[Polygons]:
    """Bodies that an entity holds by itself; refused where only its program could read them."""
    from ezdxf.render import MeshBuilder

    if kind == "POLYLINE":
        made = [MeshBuilder.from_polyface(entity)]
    elif kind == "MESH":
        if entity.dxf.get("subdivision_levels", 0) > 0:
            raise InputError(
                f"a mesh on layer {shown(layer)} is smoothed, so that its faces are not what is "
                "drawn: convert it to a polyface mesh, or set its smoothness to none"
            )
        made = [MeshBuilder.from_mesh(entity)]
    elif kind in ("3DSOLID", "BODY"):
        made = _acis(entity, layer)
    else:
        raise InputError(
            f"{kind} on layer {shown(layer)} is no body that can be read: draw closed polylines "
            "with a thickness, 3D faces, meshes or solids, or move it out of the drawing"
        )
    for mesh in made:
        points = np.array([v.xyz for v in mesh.vertices], dtype=float).reshape(-1, 3)
        yield points, [[int(i) for i in face] for face in mesh.faces]


def _acis(entity: Any, layer: str) -> list[Any]:
    from ezdxf.acis import api

    cure = "explode it into 3D faces, or convert it to a mesh"
    try:
        bodies = api.load_dxf(entity)
        made = [mesh for body in bodies for mesh in api.mesh_from_body(body)]
    except Exception as error:
        raise InputError(
            f"a solid on layer {shown(layer)} is stored in a way that cannot be read "
            f"({one_line(str(error))[:100]}): {cure}"
        ) from error
    if not made or not any(mesh.faces for mesh in made):
        raise InputError(
            f"a solid on layer {shown(layer)} has no flat faces that can be read: {cure}"
        )
    return made
