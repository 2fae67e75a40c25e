"""Bodies of polyhedra: from vertices and faces to volume and centroid, or a refusal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import cvxlimit.geometry.mesh as mesh
from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, Faces
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.orientation import outward


def check_faces(
    id: str, points: FloatArray, faces: Sequence[Sequence[int]], tolerance: float
) -> None:
    """Refuses faces without area, and faces whose sides cross each other."""
    vectors = mesh.area_vectors(points, faces)
    areas = np.linalg.norm(vectors, axis=1)
    if not areas.min() > tolerance**2:
        bad = int(areas.argmin())
        raise GeometryError(
            f"face {bad} of block {id!r} is degenerate: its area is {areas[bad]:g}",
            points=points[list(faces[bad])],
            blocks=(id,),
        )
    for number, face in enumerate(faces):
        if len(face) > 3 and _crosses_itself(points[list(face)], vectors[number] / areas[number]):
            raise GeometryError(
                f"face {number} of block {id!r} crosses itself near "
                f"{mesh.place(points[list(face)].mean(axis=0))}; list its vertices in order around "
                "it",
                points=points[list(face)],
                blocks=(id,),
            )


def _crosses_itself(corners: FloatArray, normal: FloatArray) -> bool:
    flat = corners @ mesh.plane_axes(normal).T
    along = np.roll(flat, -1, axis=0) - flat
    if len(corners) == 4 and (mesh.turn(along, np.roll(along, -1, axis=0)) > 0.0).sum() >= 3:
        return False
    noise = 1e-12 * float(np.abs(along).max()) ** 2
    sides = []  # of every line (rows) on which points (columns) lie
    for points in (flat, flat + along):
        height = mesh.turn(along[:, None], points[None] - flat[:, None])
        sides.append(np.where(np.abs(height) > noise, np.sign(height), 0.0))
    apart = sides[0] * sides[1] < 0.0
    return bool((apart & apart.T).any())


def check_no_crossing(
    id: str, points: FloatArray, faces: Sequence[Sequence[int]], tolerance: float
) -> None:
    """Refuse a surface where a side of a face passes through another by more than a tolerance."""
    corners, _ = mesh.triangulated(points, faces)
    bodies = points[corners]
    for first, second in nearby_pairs(list(bodies), np.zeros(len(bodies))):
        for i, k in ((first, second), (second, first)):
            hit = _pierced(bodies[i], bodies[k], tolerance)
            if hit is not None:
                pair, where = hit
                one, other = bodies[i[pair]], bodies[k[pair]]
                raise GeometryError(
                    f"block {id!r} cuts itself near {mesh.place(where)}: two of its faces cross; "
                    "unite the parts before export, or make a block of each",
                    points=np.vstack([one, other, one.mean(axis=0)]),
                    blocks=(id,),
                )


def _pierced(
    lines: FloatArray, faces: FloatArray, tolerance: float
) -> tuple[int, FloatArray] | None:
    """First pair whose ``lines`` triangle has a side that passes through its ``faces`` triangle."""
    a, b, c = np.moveaxis(faces, 1, 0)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    wide = length > tolerance**2
    normal = normal / np.where(wide, length, 1.0)[:, None]
    for i, k in ((0, 1), (1, 2), (2, 0)):
        ends = lines[:, i], lines[:, k]
        high, low = (np.einsum("pk,pk->p", e - a, normal) for e in ends)
        across = wide & (np.minimum(high, low) < -tolerance) & (np.maximum(high, low) > tolerance)
        rows = np.flatnonzero(across)
        if not len(rows):
            continue
        share = (high[rows] / (high[rows] - low[rows]))[:, None]
        where = ends[0][rows] + share * (ends[1][rows] - ends[0][rows])
        depth = np.full(len(rows), np.inf)
        for p, q in ((a, b), (b, c), (c, a)):
            along = q[rows] - p[rows]
            inward = np.cross(normal[rows], along) / np.linalg.norm(along, axis=1)[:, None]
            depth = np.minimum(depth, np.einsum("pk,pk->p", where - p[rows], inward))
        inside = np.flatnonzero(depth > tolerance)
        if len(inside):
            return int(rows[inside[0]]), where[inside[0]]
    return None


JOINT_TOLERANCE = 0.01
"""Default joint tolerance over a block's mean thickness, 2 volume / surface.

Measured: bricks in running bond, 60 random directions, coordinates rounded to 3 decimals. Joints
of 1.0 x 0.5 x 0.4 blocks gape by up to 0.0047 of their mean thickness, of 1.0 x 0.5 x 0.25 ones by
0.0060, of 0.5 x 0.25 x 0.2 ones by 0.0094; with 4 decimals by a tenth of that. Relative to the
thickness and not to the size, because of a thousand thin voussoirs none may be joined to the next
but one."""


def vertices_of(id: str, value: ArrayLike) -> FloatArray:
    """The vertices (k, 3) of a block as an array; refused unless they are four finite points."""
    try:
        points = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"vertices of block {id!r} must be a list of [x, y, z] numbers") from error
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4:
        rows = points.ndim == 2 and points.shape[1] == 3
        got = len(points) if rows else f"shape {points.shape}"
        raise InputError(f"block {id!r} needs at least four vertices [x, y, z], got {got}")
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InputError(f"vertex {bad} of block {id!r} must be finite, got {points[bad].tolist()}")
    return points


def checked_faces(id: str, faces: Sequence[Sequence[int]], count: int) -> Faces:
    """The faces as tuples of numbers of ``count`` vertices; refused if they are anything else."""
    if len(faces) < 4:
        raise GeometryError(
            f"block {id!r} needs at least four faces, got {len(faces)}", blocks=(id,)
        )
    return tuple(_face_indices(id, number, face, count) for number, face in enumerate(faces))


def _face_indices(id: str, number: int, face: Sequence[int], count: int) -> tuple[int, ...]:
    if not isinstance(face, Sequence | np.ndarray):
        raise InputError(f"face {number} of block {id!r} must list vertices, got {face!r}")
    wrong = [
        i for i in face if isinstance(i, bool) or not isinstance(i, (int, np.integer))
        or not 0 <= i < count
    ]  # fmt: skip
    if wrong:
        raise InputError(
            f"face {number} of block {id!r} names vertex {wrong[0]!r}; "
            f"there are {count} vertices, numbered from 0"
        )
    indices = tuple(int(i) for i in face)
    if len(indices) < 3 or len(set(indices)) < len(indices):
        raise InputError(
            f"face {number} of block {id!r} needs at least three different vertices, "
            f"got {list(indices)}"
        )
    return indices


@dataclass(frozen=True, eq=False)
class Body:
    """Faces (outward) and what they enclose; convex within the tolerance it was looked at with."""

    faces: Faces
    volume: float
    centroid: FloatArray
    is_convex: bool


def convex_body(points: FloatArray, faces: Faces) -> Body | None:
    """The body of these faces if it is exactly convex, else None. Most blocks are, and this takes a
    tenth of the time of :func:`closed_body`."""
    # Faces have an area, are flat and convex.
    tolerance = RELATIVE_TOLERANCE * float(np.linalg.norm(np.ptp(points, axis=0)))
    vectors = mesh.area_vectors(points, faces)
    areas = np.linalg.norm(vectors, axis=1)
    if not areas.min() > tolerance**2:
        return None
    normals, middles = vectors / areas[:, None], np.empty((len(faces), 3))
    for members, indices in mesh.by_size(faces):
        corners, normal = points[indices], normals[members, None]
        middles[members] = middle = corners.mean(axis=1)
        edges = np.roll(corners, -1, axis=1) - corners
        turns = (mesh.cross(edges, np.roll(edges, -1, axis=1)) * normal).sum(axis=2)
        lengths = np.linalg.norm(edges, axis=2)
        if not (lengths.min() > tolerance and (turns >= -tolerance * lengths).all()):
            return None
        if np.abs((corners - middle[:, None]) @ normal.transpose(0, 2, 1)).max() > tolerance:
            return None
    # Every vertex lies behind every face, once normals point away from the middle.
    turned = np.einsum("fk,fk->f", normals, middles - points.mean(axis=0)) <= 0.0
    normals[turned] *= -1.0
    if not _all_behind(points, middles, normals, tolerance):
        return None
    # Closed: each edge is passed once each way, and all vertices are used.
    oriented = mesh.flipped(faces, turned)
    edges_of = Counter((f[i - 1], f[i]) for f in oriented for i in range(len(f)))
    if any(n != 1 or edges_of[e[::-1]] != 1 for e, n in edges_of.items()):
        return None
    if len(set().union(*faces)) < len(points):
        return None
    # Once: a body that is written twice has Euler's number twice.
    if len(points) - len(edges_of) // 2 + len(faces) != 2:
        return None
    volume, centroid = mesh.volume_and_centroid(points, oriented)
    return Body(oriented, volume, centroid, True) if volume > tolerance**3 else None


def closed_body(
    id: str, points: FloatArray, faces: Faces, joint_tolerance: float | None = None
) -> Body:
    """The body of these faces, convex or not; a GeometryError says why there is none."""
    check_faces(id, points, faces, RELATIVE_TOLERANCE * float(np.linalg.norm(np.ptp(points, 0))))
    unused = set(range(len(points))).difference(*faces)
    if unused:
        raise GeometryError(
            f"vertex {min(unused)} of block {id!r} belongs to no face; remove it",
            points=points[min(unused)],
            blocks=(id,),
        )
    return body_inside(id, points, outward(id, points, faces)[0], joint_tolerance)


def body_inside(
    id: str, points: FloatArray, oriented: Faces, joint_tolerance: float | None
) -> Body:
    """The body inside a closed surface whose normals point out; refused without volume or flat
    faces."""
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    volume, centroid = mesh.volume_and_centroid(points, oriented)
    if not volume > (RELATIVE_TOLERANCE * size) ** 2 * size:
        raise GeometryError(
            f"block {id!r} is degenerate: its volume is {volume:g} for a size of {size:g}",
            points=points,
            blocks=(id,),
        )
    allowed = joint_tolerance or default_tolerance(volume, mesh.surface(points, oriented))
    check_flat(id, points, oriented, allowed)
    middles = np.array([points[list(face)].mean(axis=0) for face in oriented])
    normals = mesh.unit(mesh.area_vectors(points, oriented))
    is_convex = _all_behind(points, middles, normals, allowed)
    if not is_convex:
        check_no_crossing(id, points, oriented, allowed)
    return Body(oriented, volume, centroid, is_convex)


def default_tolerance(volume: float, surface: float) -> float:
    return JOINT_TOLERANCE * 2.0 * volume / surface


def check_flat(id: str, points: FloatArray, faces: Faces, tolerance: float) -> None:
    off = warps(points, faces)
    number = int(off.argmax())
    if off[number] > (1.0 + RELATIVE_TOLERANCE) * tolerance:  # sums in another order may differ
        raise GeometryError(
            f"face {number} of block {id!r} is not flat: a vertex lies {off[number]:g} off its "
            f"plane, more than the joint tolerance {tolerance:.3g}; raise joint_tolerance or cut "
            "the face into triangles",
            points=points[list(faces[number])],
            blocks=(id,),
        )


def warps(points: FloatArray, faces: Faces) -> FloatArray:
    """How far (f,) the farthest corner of each face lies off the face's mean plane."""
    normals = mesh.unit(mesh.area_vectors(points, faces))
    result = np.zeros(len(faces))
    for number in (i for i, face in enumerate(faces) if len(face) > 3):
        corners = points[list(faces[number])]
        result[number] = np.abs((corners - corners.mean(axis=0)) @ normals[number]).max()
    return result


def _all_behind(
    points: FloatArray, middles: FloatArray, normals: FloatArray, tolerance: float
) -> bool:
    """True if no point lies farther than the tolerance in front of a face; in portions of faces, so
    that memory does not grow with faces times points."""
    level = np.einsum("fk,fk->f", middles, normals)
    step = max(1, 1_000_000 // len(points))
    return all(
        ((normals[i : i + step] @ points.T).max(axis=1) <= level[i : i + step] + tolerance).all()
        for i in range(0, len(normals), step)
    )
