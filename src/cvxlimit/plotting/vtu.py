"""Files for ParaView: blocks as polyhedra, contacts as polygons, written as VTK XML.

The format is written by hand. vtk needs libraries that a fresh machine may lack; meshio (5.3.5)
writes polyhedra, but ends in a KeyError with texts, which are the names here, and leaves field data
out in silence, which are the load factor and its bracket. All blocks are whole here, supports too.
"""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from cvxlimit.extras import needed
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.joints import velocity_of
from cvxlimit.plotting.movement import Motion, contact_forces, motion
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

POLYGON, POLYHEDRON = 7, 42
"""VTK cell types."""

VTK_TYPES = {"float64": "Float64", "int64": "Int64", "uint8": "UInt8"}

Arrays = Mapping[str, NDArray[Any]]


def vtu_files(scene: Scene, solution: Solution) -> tuple[bytes, bytes]:
    """Contents of two .vtu files: the blocks, and the contacts.

    Blocks carry ``speed`` (relative), ``is_support``, ``block`` (index), ``id``, and at their
    corners ``velocity`` and ``displacement`` (scaled for viewing: *Warp By Vector* with factor 1).
    Contacts carry ``kind`` (0 closed, 1 opens, 2 slides, 3 twists), ``opening``, ``slip``,
    ``twist``, ``friction``, ``block_a``, ``block_b``, ``normal``, and force components V1 ... MT if
    there are any; their ``displacement`` is the mean of both sides. Both carry the load factor and
    its bracket as field data.
    """
    moving = motion(scene, solution)
    numbers = {
        "load_factor": np.nan if solution.load_factor is None else solution.load_factor,
        "lower": solution.lower,
        "upper": solution.upper,
        "displacement_per_rate": moving.scale,
    }
    result = {name: np.array([number], dtype=float) for name, number in numbers.items()}
    return _blocks(scene, moving, result), _contacts(scene, solution, moving, result)


def to_pyvista(solution: Solution) -> Any:
    """A ``pyvista.MultiBlock`` with the meshes ``"blocks"`` and ``"contacts"``.

    They carry what the ``.vtu`` files carry: speeds, displacements, forces, openings ...; warp by
    ``"displacement"`` to see the mechanism.

    Raises
    ------
    InputError
        For a solution without its scene.
    ModelError
        If pyvista is not installed.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> meshes = to_pyvista(solve(builtin_scene("single-block")))
    >>> meshes["blocks"].n_cells, meshes["contacts"].n_cells
    (2, 1)
    """
    pyvista = needed("pyvista", "pyvista", "pyvista meshes")
    parts = vtu_files(solution.drawn_scene, solution)
    result = pyvista.MultiBlock()
    with tempfile.TemporaryDirectory(prefix="cvxlimit-") as folder:
        for name, content in zip(("blocks", "contacts"), parts, strict=True):
            path = Path(folder) / f"{name}.vtu"
            path.write_bytes(content)
            result[name] = pyvista.read(path)
    return result


def _blocks(scene: Scene, moving: Motion, result: Arrays) -> bytes:
    fixed, number = set(scene.supports), np.arange(len(scene.blocks))
    points = np.concatenate([b.vertices for b in scene.blocks])
    counts = np.array([len(b.vertices) for b in scene.blocks])
    velocity = velocity_of(scene, moving.rates, points, np.repeat(number, counts))
    streams = []  # number of faces, then for each face its number of points and the points
    for block, start in zip(scene.blocks, (np.cumsum(counts) - counts).tolist(), strict=True):
        faces = [x for face in block.faces for x in (len(face), *(start + i for i in face))]
        streams.append([len(block.faces), *faces])
    point_data = {"displacement": moving.scale * velocity, "velocity": velocity}
    cell_data: Arrays = {
        "speed": moving.speed,
        "is_support": np.array([b.id in fixed for b in scene.blocks], dtype=np.uint8),
        "block": number,
        "id": np.array([b.id for b in scene.blocks]),
    }
    topology = {
        "faces": np.concatenate(streams),
        "faceoffsets": np.cumsum([len(stream) for stream in streams]),
    }
    return _file(result, point_data, cell_data, points, counts, POLYHEDRON, topology)


def _contacts(scene: Scene, solution: Solution, moving: Motion, result: Arrays) -> bytes:
    c, what = scene.contacts, moving.contacts
    one, other = (
        velocity_of(scene, moving.rates, c.corner_points, block[c.corner_contact])
        for block in (c.a, c.b)
    )
    point_data = {"displacement": 0.5 * moving.scale * (one + other), "opening": what.opening}
    cell_data = {
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
        cell_data |= dict(zip(COMPONENTS, forces.T, strict=True))
    counts = np.diff(c.corner_start)
    return _file(result, point_data, cell_data, c.corner_points, counts, POLYGON, {})


def _file(
    field_data: Arrays,
    point_data: Arrays,
    cell_data: Arrays,
    points: NDArray[np.float64],
    counts: NDArray[np.int64],
    cell_type: int,
    topology: Arrays,
) -> bytes:
    """Little-endian, base64, uncompressed; ``counts`` are the points of each cell, in turn."""
    root = ElementTree.Element(
        "VTKFile", type="UnstructuredGrid", version="1.0", byte_order="LittleEndian",
        header_type="UInt64",
    )  # fmt: skip
    tree = ElementTree.SubElement(root, "UnstructuredGrid")
    _add_arrays(tree, "FieldData", field_data)
    piece = ElementTree.SubElement(
        tree, "Piece", NumberOfPoints=str(len(points)), NumberOfCells=str(len(counts))
    )
    cells: Arrays = {
        "connectivity": np.arange(len(points)),
        "offsets": np.cumsum(counts),
        "types": np.full(len(counts), cell_type, dtype=np.uint8),
    }
    _add_arrays(piece, "PointData", point_data)
    _add_arrays(piece, "CellData", cell_data)
    _add_arrays(piece, "Points", {"Points": points})
    _add_arrays(piece, "Cells", {**cells, **topology})
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def _add_arrays(parent: ElementTree.Element, section: str, arrays: Arrays) -> None:
    element = ElementTree.SubElement(parent, section)
    for name, values in arrays.items():
        entry = ElementTree.SubElement(element, "DataArray", Name=name)
        if values.ndim == 2:
            entry.set("NumberOfComponents", str(values.shape[1]))
        if section == "FieldData":
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


def _base64(values: NDArray[Any]) -> str:
    raw = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).tobytes()
    return base64.b64encode(np.array([len(raw)], dtype="<u8").tobytes() + raw).decode("ascii")


def _text_codes(texts: NDArray[Any]) -> str:
    """Bytes of all texts as numbers, each text ended by 0: cannot break the XML."""
    return " ".join(
        str(byte) for text in texts.tolist() for byte in text.encode("utf-8", "replace") + b"\0"
    )
