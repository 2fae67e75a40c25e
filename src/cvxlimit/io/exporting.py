"""Scenes written for other programs: OBJ and glTF of the blocks, CSV of the contacts, MJCF."""

from __future__ import annotations

import csv
import io
import os
from pathlib import Path

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import Door
from cvxlimit.base.extras import needed
from cvxlimit.base.files import write_file
from cvxlimit.base.lines import one_line
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, pressure_centres
from cvxlimit.geometry.mesh import triangulated
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution


def export(
    scene: Scene, path: str | os.PathLike[str], solution: Solution | None = None
) -> tuple[Path, ...]:
    """Write a scene for other programs; the suffix of ``path`` says what.

    =========  =================================================================================
    ``.obj``   blocks, one object each, polygons kept, every digit of the coordinates
    ``.glb``   blocks, one node each, in triangles and single precision (needs trimesh)
    ``.mjcf``  all of it for MuJoCo, to move in time, see :mod:`cvxlimit.extensions.dynamics`
    ``.csv``   contacts: name, blocks, centre, normal, area, friction; with a ``solution`` also
               the force components and the pressure centre; units stand in the first row
    =========  =================================================================================

    Blocks and contacts for ParaView (``.vtu``) are written by :func:`cvxlimit.plotting.plot`.

    Returns
    -------
    tuple of Path
        The file written, complete or not at all.

    Raises
    ------
    InputError
        For another suffix, a folder that cannot be written to, or a solution of another scene.
    ModelError
        If trimesh is needed and not installed.

    Example
    -------
    >>> import tempfile
    >>> from cvxlimit.masonry import builtin_scene
    >>> from cvxlimit.io import read_bodies
    >>> path = Path(tempfile.mkdtemp()) / "arch.obj"
    >>> _ = export(builtin_scene("arch"), path)
    >>> len(read_bodies(path)) == len(builtin_scene("arch").blocks)
    True
    """
    target = Path(path)
    suffix = target.suffix.lower()
    EXPORTS.check(suffix)
    if suffix not in EXPORTS:
        raise InputError(
            f"cannot tell what to export from {target.name!r}: give a name that ends in "
            f"{', '.join(EXPORTS)}"
        )
    written: str | bytes = EXPORTS[suffix](scene, solution)
    write_file(target, written.encode("utf-8", "replace") if isinstance(written, str) else written)
    return (target,)


def obj_text(scene: Scene) -> str:
    lines = [f"# {one_line(scene.name)}, coordinates in {one_line(scene.units.length)}"]
    begin = 1
    for block in scene.blocks:
        lines.append(f"o {one_line(block.id)}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in block.vertices.tolist()]
        lines += ["f " + " ".join(str(begin + i) for i in face) for face in block.faces]
        begin += len(block.vertices)
    return "\n".join(lines) + "\n"


def contacts_table(scene: Scene, solution: Solution | None = None) -> str:
    length, force = scene.units.length, scene.units.force
    c = scene.contacts
    columns: dict[str, list[object]] = {
        "contact": list(c.names),
        "a": [c.block_ids[i] for i in c.a],
        "b": [c.block_ids[i] for i in c.b],
        **_triple("xyz", c.origin, f" ({length})"),
        **_triple(("nx", "ny", "nz"), c.axes[:, 2], ""),
        f"area ({length}\u00b2)": c.area.tolist(),
        "friction": c.friction.tolist(),
    }
    if solution is not None and solution.forces is not None:
        forces = solution.forces
        if forces.shape != (len(c), len(COMPONENTS)):
            raise InputError(
                f"the solution has forces of shape {forces.shape}, but scene {scene.name!r} has "
                f"{len(c)} contacts: it does not belong to it"
            )
        for name, column in COLUMN.items():
            unit = f"{force} {length}" if name.startswith("M") else force
            columns[f"{name} ({unit})"] = forces[:, column].tolist()
        columns |= _triple(("px", "py", "pz"), pressure_centres(c, forces)[1], f" ({length})")
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(map(one_line, columns))
    for row in zip(*columns.values(), strict=True):
        writer.writerow(one_line(x) if isinstance(x, str) else x for x in row)
    return buffer.getvalue()


def _triple(names: str | tuple[str, ...], rows: FloatArray, unit: str) -> dict[str, list[object]]:
    return {
        f"{name}{unit}": ["" if np.isnan(x) else x for x in rows[:, k].tolist()]
        for k, name in enumerate(names)
    }


def _glb(scene: Scene) -> bytes:
    trimesh = needed("trimesh", "mesh", ".glb files")
    result = trimesh.Scene()
    for block in scene.blocks:
        triangles, _ = triangulated(block.vertices, block.faces)
        mesh = trimesh.Trimesh(block.vertices, triangles, process=False)
        result.add_geometry(mesh, node_name=block.id, geom_name=block.id)
    data: bytes = result.export(file_type="glb")
    return data


EXPORTS = Door(
    "cvxlimit.writers",
    {
        ".obj": lambda scene, _: obj_text(scene),
        ".glb": lambda scene, _: _glb(scene),
        ".csv": contacts_table,
    },
)
"""By suffix: from a scene, and a solution of it or None, to the text or the bytes of a file."""
