"""Meshes for PyVista, and files for ParaView: blocks as polyhedra, contacts as polygons.

All blocks are whole here, supports too.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.extras import needed
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.results.movement import Motion, motion
from cvxlimit.results.utilisation import contact_forces
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solution.kinematics import velocity_of

POLYGON, POLYHEDRON = 7, 42
"""VTK cell types."""


def vtu_files(scene: Scene, solution: Solution) -> tuple[bytes, bytes]:
    """Contents of two .vtu files: the blocks, and the contacts of :func:`to_pyvista`."""
    blocks, contacts = map(_written, _meshes(scene, solution, "files for ParaView (.vtu)"))
    return blocks, contacts


def to_pyvista(solution: Solution) -> Any:
    """A ``pyvista.MultiBlock`` with the meshes ``"blocks"`` and ``"contacts"``.

    Blocks carry ``speed`` (relative), ``is_support``, ``block`` (index), ``id``, and at their
    corners ``velocity`` and ``displacement`` (scaled for viewing: *Warp By Vector* with factor 1).
    Contacts carry ``name``, ``kind`` (0 closed, 1 opens, 2 slides, 3 twists), ``opening``,
    ``slip``, ``twist``, ``friction``, ``block_a``, ``block_b``, ``normal``, and force components V1
    ... MT if there are any; their ``displacement`` is the mean of both sides. Both carry the load
    factor and its bracket as field data.

    Raises
    ------
    InputError
        For a solution without its scene.
    ModelError
        If PyVista is not installed.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> meshes = to_pyvista(solve(builtin_scene("single-block")))
    >>> meshes["blocks"].n_cells, meshes["contacts"].n_cells
    (2, 1)
    """
    blocks, contacts = _meshes(solution.scene, solution, "PyVista meshes")
    return needed("pyvista", "pyvista", "meshes").MultiBlock(
        {"blocks": blocks, "contacts": contacts}
    )


def _meshes(scene: Scene, solution: Solution, what: str) -> tuple[Any, Any]:
    needed("pyvista", "pyvista", what)
    moving = motion(scene, solution)
    meshes = _blocks(scene, moving), _contacts(scene, solution, moving)
    numbers = {
        "load_factor": np.nan if solution.load_factor is None else solution.load_factor,
        "lower": solution.lower,
        "upper": solution.upper,
        "displacement_per_rate": moving.scale,
    }
    for mesh in meshes:
        for name, number in numbers.items():
            mesh.field_data[name] = np.array([number], dtype=float)
    return meshes


def _blocks(scene: Scene, moving: Motion) -> Any:
    fixed, number = set(scene.supports), np.arange(len(scene.blocks))
    points = np.concatenate([b.vertices for b in scene.blocks])
    counts = np.array([len(b.vertices) for b in scene.blocks])
    velocity = velocity_of(scene, moving.rates, points, np.repeat(number, counts))
    cells = []  # number of faces, then for each face its number of points and the points
    for block, start in zip(scene.blocks, (np.cumsum(counts) - counts).tolist(), strict=True):
        faces = [x for face in block.faces for x in (len(face), *(start + i for i in face))]
        cells.append([len(block.faces), *faces])
    point_data = {"displacement": moving.scale * velocity, "velocity": velocity}
    cell_data = {
        "speed": moving.speed,
        "is_support": np.array([b.id in fixed for b in scene.blocks], dtype=np.uint8),
        "block": number,
        "id": [b.id for b in scene.blocks],
    }
    return _mesh(cells, POLYHEDRON, points, point_data, cell_data)


def _contacts(scene: Scene, solution: Solution, moving: Motion) -> Any:
    c, what = scene.contacts, moving.contacts
    one, other = (
        velocity_of(scene, moving.rates, c.corner_points, block[c.corner_contact])
        for block in (c.a, c.b)
    )
    point_data = {"displacement": 0.5 * moving.scale * (one + other), "opening": what.opening}
    cell_data: dict[str, Any] = {
        "kind": what.kind,
        "opening": what.widest,
        "slip": what.slip,
        "twist": what.twist,
        "friction": c.friction,
        "block_a": c.a,
        "block_b": c.b,
        "normal": c.axes[:, 2],
        "name": c.names,
    }
    forces = contact_forces(scene, solution)
    if forces is not None:
        cell_data |= dict(zip(COMPONENTS, forces.T, strict=True))
    cells = [[*range(*ends)] for ends in pairwise(c.corner_start.tolist())]
    return _mesh(cells, POLYGON, c.corner_points, point_data, cell_data)


def _mesh(
    cells: Sequence[Sequence[int]], kind: int, points: FloatArray,
    point_data: Mapping[str, FloatArray], cell_data: Mapping[str, Any],
) -> Any:  # fmt: skip
    import pyvista

    stream = [x for cell in cells for x in (len(cell), *cell)]
    kinds = np.full(len(cells), kind, dtype=np.uint8)
    mesh = pyvista.UnstructuredGrid(np.array(stream, dtype=np.int64), kinds, points)
    mesh.point_data.update(point_data)
    for name, values in cell_data.items():
        if isinstance(values, np.ndarray):
            mesh.cell_data[name] = values
        else:
            mesh.GetCellData().AddArray(_texts(name, values))
    return mesh


def _texts(name: str, texts: Sequence[str]) -> Any:
    """Returns texts as VTK keeps them: PyVista itself takes ASCII only."""
    from vtkmodules.vtkCommonCore import vtkStringArray

    array = vtkStringArray()
    array.SetName(name)
    for text in texts:
        array.InsertNextValue(text)
    return array


def _written(mesh: Any) -> bytes:
    with tempfile.TemporaryDirectory(prefix="cvxlimit-") as folder:
        path = Path(folder) / "mesh.vtu"
        mesh.save(path)
        return path.read_bytes()
