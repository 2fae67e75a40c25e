"""Files for ParaView: blocks as polyhedra, contacts as polygons, written as VTK XML.

The format is written by hand (a page of code) rather than through vtk, whose import needs
libraries that a fresh machine may lack. All blocks are whole here, supports too.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.plotting.movement import Motion, contact_forces, motion, side_rates, velocity_of
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

POLYGON, POLYHEDRON = 7, 42
"""VTK cell types."""

VTK_TYPES = {"float64": "Float64", "int64": "Int64", "uint8": "UInt8"}

Array = NDArray[Any]
Arrays = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Grid:
    """An unstructured grid: points (p, 3) and cells of one type.

    ``cells`` lists the points of every cell, ``faces`` VTK's face stream of every cell
    (polyhedra only).
    """

    points: Array
    cells: list[Array]
    cell_type: int
    faces: list[Array] = field(default_factory=list)
    point_data: Arrays = field(default_factory=dict)
    cell_data: Arrays = field(default_factory=dict)
    field_data: Arrays = field(default_factory=dict)


def vtu_files(scene: Scene, solution: Solution) -> tuple[bytes, bytes]:
    """Contents of two .vtu files: the blocks, and the contacts.

    Blocks carry ``speed`` (relative), ``is_support``, ``block`` (index in the scene), ``id``,
    and at their corners ``velocity`` (the mechanism's rates) and ``displacement`` (scaled for
    viewing: *Warp By Vector* with factor 1). Contacts carry ``kind`` (0 closed, 1 opens,
    2 slides, 3 twists), ``opening``, ``slip``, ``twist``, ``friction``, the indices
    ``block_a``, ``block_b``, the vector ``normal``, and the force components V1 ... MT if the
    solution has them; their ``displacement`` is the mean of both sides. Both files carry the
    load factor and its bracket as field data.
    """
    moving = motion(scene, solution)
    result = _field_data(solution, moving)
    return (
        encoded(_block_grid(scene, moving, result)),
        encoded(_contact_grid(scene, solution, moving, result)),
    )


def _field_data(solution: Solution, moving: Motion) -> Arrays:
    value = np.nan if solution.load_factor is None else solution.load_factor
    numbers = {
        "load_factor": value,
        "lower": solution.lower,
        "upper": solution.upper,
        "displacement_per_rate": moving.scale,
    }
    return {name: np.array([number], dtype=float) for name, number in numbers.items()}


def _block_grid(scene: Scene, moving: Motion, result: Arrays) -> Grid:
    counts = [len(b.vertices) for b in scene.blocks]
    starts = np.concatenate([[0], np.cumsum(counts)])
    points = np.concatenate([b.vertices for b in scene.blocks])
    velocity = velocity_of(scene, moving.rates, points, np.repeat(np.arange(len(counts)), counts))
    fixed = set(scene.supports)
    return Grid(
        points=points,
        cells=[np.arange(s, e) for s, e in pairwise(starts)],
        cell_type=POLYHEDRON,
        faces=[
            _face_stream(b.faces, int(s)) for b, s in zip(scene.blocks, starts[:-1], strict=True)
        ],
        point_data={"displacement": moving.scale * velocity, "velocity": velocity},
        cell_data={
            "speed": moving.speed,
            "is_support": np.array([b.id in fixed for b in scene.blocks], dtype=np.uint8),
            "block": np.arange(len(counts)),
            "id": np.array([b.id for b in scene.blocks]),
        },
        field_data=result,
    )


def _face_stream(faces: tuple[tuple[int, ...], ...], start: int) -> Array:
    """Number of faces, then for each face its number of points and the points."""
    numbers = [len(faces)]
    for face in faces:
        numbers += [len(face), *(start + i for i in face)]
    return np.array(numbers)


def _contact_grid(scene: Scene, solution: Solution, moving: Motion, result: Arrays) -> Grid:
    c, what = scene.contacts, moving.contacts
    one, other = side_rates(scene, moving.rates)
    cells: dict[str, Array] = {
        "kind": what.kind,
        "opening": what.widest,
        "slip": what.slip,
        "twist": what.twist,
        "friction": c.friction,
        "block_a": c.a,
        "block_b": c.b,
        "normal": c.axes[:, 2],
        "name": np.array(c.names),
    }
    forces = contact_forces(scene, solution)
    if forces is not None:
        cells |= dict(zip(COMPONENTS, forces.T, strict=True))
    return Grid(
        points=c.corner_points,
        cells=np.split(np.arange(len(c.corner_points)), c.corner_start[1:-1]),
        cell_type=POLYGON,
        point_data={
            "displacement": 0.5 * moving.scale * (one + other),
            "opening": what.opening,
        },
        cell_data=cells,
        field_data=result,
    )


def encoded(grid: Grid) -> bytes:
    """The .vtu file of ``grid``: little-endian, base64, uncompressed."""
    root = ElementTree.Element(
        "VTKFile", type="UnstructuredGrid", version="1.0", byte_order="LittleEndian",
        header_type="UInt64",
    )  # fmt: skip
    tree = ElementTree.SubElement(root, "UnstructuredGrid")
    _add_arrays(tree, "FieldData", grid.field_data, tuples=True)
    piece = ElementTree.SubElement(
        tree, "Piece", NumberOfPoints=str(len(grid.points)), NumberOfCells=str(len(grid.cells))
    )
    _add_arrays(piece, "PointData", grid.point_data)
    _add_arrays(piece, "CellData", grid.cell_data)
    _add_arrays(piece, "Points", {"Points": grid.points})
    _add_arrays(piece, "Cells", _topology(grid))
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def _topology(grid: Grid) -> Arrays:
    arrays = {
        "connectivity": np.concatenate(grid.cells),
        "offsets": np.cumsum([len(cell) for cell in grid.cells]),
        "types": np.full(len(grid.cells), grid.cell_type, dtype=np.uint8),
    }
    if grid.faces:
        arrays["faces"] = np.concatenate(grid.faces)
        arrays["faceoffsets"] = np.cumsum([len(stream) for stream in grid.faces])
    return arrays


def _add_arrays(
    parent: ElementTree.Element, section: str, arrays: Arrays, tuples: bool = False
) -> None:
    element = ElementTree.SubElement(parent, section)
    for name, values in arrays.items():
        entry = ElementTree.SubElement(element, "DataArray", Name=name)
        if values.ndim == 2:
            entry.set("NumberOfComponents", str(values.shape[1]))
        if tuples:
            entry.set("NumberOfTuples", str(len(values)))
        if values.dtype.kind == "U":
            entry.tag = "Array"
            entry.set("type", "String")
            entry.set("format", "ascii")
            entry.text = _text_codes(values)
        else:
            entry.set("type", VTK_TYPES[values.dtype.name])
            entry.set("format", "binary")
            entry.text = _base64(values)


def _base64(values: Array) -> str:
    raw = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).tobytes()
    return base64.b64encode(np.array([len(raw)], dtype="<u8").tobytes() + raw).decode("ascii")


def _text_codes(texts: Array) -> str:
    """Bytes of all texts as numbers, each text ended by 0: cannot break the XML."""
    return " ".join(
        str(byte) for text in texts.tolist() for byte in text.encode("utf-8", "replace") + b"\0"
    )
