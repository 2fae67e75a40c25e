"""Closed surfaces of single bodies, oriented so that all normals point out of the material."""

from __future__ import annotations

import numpy as np

import cvxlimit.geometry.mesh as mesh
from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.mesh import EdgeTable, Faces
from cvxlimit.geometry.shells import Shells, by_shell, nested, volumes


def outward(id: str, points: FloatArray, faces: Faces) -> tuple[Faces, int]:
    """Returns the faces of block ``id`` with all normals pointing out of the material, and how many
    of them were reversed for that.

    Raises
    ------
    GeometryError
        If the surface is open, has one side only, or encloses several bodies that do not touch.
    """
    table = EdgeTable.of(faces)
    open_edges = np.flatnonzero(table.uses % 2 == 1)
    if len(open_edges):
        most = int(table.uses[open_edges].max())
        fault = "has no face on its other side" if most == 1 else f"belongs to {most} faces"
        raise _not_closed(id, points, table, open_edges, fault)
    shells = Shells.of(points, faces, table)
    if shells.folds.any():
        bad = points[list(faces[int(np.argmax(shells.folds))])]
        raise GeometryError(
            f"block {id!r} has a surface with one side only, like a Moebius strip, near "
            f"{mesh.place(bad.mean(axis=0))}: mend the mesh",
            points=bad,
            blocks=(id,),
        )
    if not shells.closed.all():
        edge = table.key[table.uses[table.key].argmax()]
        fault = f"belongs to {table.uses[edge]} faces, which bound no material between them"
        raise _not_closed(id, points, table, np.array([edge]), fault)
    oriented = mesh.flipped(faces, shells.turned)
    turned = shells.turned ^ _is_cavity(id, points, oriented, shells.shell)[shells.shell]
    return mesh.flipped(faces, turned), int(turned.sum())


def _not_closed(
    id: str, points: FloatArray, table: EdgeTable, wrong: IntArray, fault: str
) -> GeometryError:
    """Returns the error for block ``id`` with the ``wrong`` edges, whose first has a ``fault``."""
    side = int(np.flatnonzero(table.key == wrong[int(np.argmax(table.uses[wrong]))])[0])
    ends = points[[table.start[side], table.end[side]]]
    sides = np.flatnonzero(np.isin(table.key, wrong))
    more = f", and {len(wrong) - 1} more edges are at fault" if len(wrong) > 1 else ""
    return GeometryError(
        f"block {id!r} is not closed: the edge between vertices {table.start[side]} and "
        f"{table.end[side]}, from {mesh.place(ends[0])} to {mesh.place(ends[1])}, {fault}{more}; "
        "mend the mesh so that every edge belongs to two faces, or to four where the body touches "
        "itself",
        points=points[np.stack([table.start[sides], table.end[sides]], axis=1)].reshape(-1, 3),
        blocks=(id,),
    )


def _is_cavity(id: str, points: FloatArray, faces: Faces, shell: IntArray) -> BoolArray:
    """Returns for each shell (s,) of block ``id`` whether it bounds a cavity, within another shell.

    Raises
    ------
    GeometryError
        If a shell encloses nothing, or the shells are those of several separate bodies: outer
        shells have to be connected by common vertices, and nothing may lie within a cavity.
    """
    count = int(shell.max()) + 1
    if count == 1:
        return np.zeros(1, dtype=bool)
    own = [np.unique(np.concatenate(x)) for x in by_shell(faces, shell)]
    volume = volumes(points, faces, shell)
    if not volume.min() > 0.0:
        flat = own[int(np.argmin(volume))]
        raise GeometryError(
            f"block {id!r} has faces that lie on each other near "
            f"{mesh.place(points[flat].mean(axis=0))} and enclose nothing: remove them",
            points=points[flat],
            blocks=(id,),
        )
    # The depth of a shell is the number of shells around it: 0 outer, 1 cavity, 2 body in a cavity.
    depth = np.bincount([i for i, _ in nested(points, faces, shell)], minlength=count)
    # Outer shells with a common vertex are one body.
    holder, links = np.full(len(points), -1), []
    for s in np.flatnonzero(depth == 0).tolist():
        links += [(s, t) for t in np.unique(holder[own[s]]).tolist() if t >= 0]
        holder[own[s]] = s
    body = mesh.linked(count, *np.array(links, dtype=np.int64).reshape(-1, 2).T)
    apart = np.unique(np.where(depth == 0, body, -1), return_index=True)[1]
    bodies = np.concatenate([apart[depth[apart] == 0], np.flatnonzero(depth == 2)])
    if len(bodies) > 1:
        witness = np.array([points[own[s][0]] for s in bodies.tolist()])
        raise GeometryError(
            f"block {id!r} consists of {len(bodies)} separate bodies, one of them at "
            f"{mesh.place(witness[1])}: make a block of each",
            points=witness,
            blocks=(id,),
        )
    return np.asarray(depth == 1)
