"""Bodies of polyhedra: from vertices and faces to volume and centroid, or a refusal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.crossings import check_faces, check_no_crossing
from cvxlimit.geometry.mesh import Faces, area_vectors, cross, outward, volume_and_centroid

FloatArray = NDArray[np.float64]

RELATIVE_TOLERANCE = 1e-6
"""Exact shapes are told from inexact ones at this fraction of a block's size.

A body that is flat-faced and convex to six digits is taken as such; vertices nearer to each other
than this are one."""

JOINT_TOLERANCE = 0.01
"""Default joint tolerance over a block's mean thickness, 2 volume / surface.

Measured: bricks in running bond, 60 random directions, coordinates rounded to 3 decimals. Joints
of 1.0 x 0.5 x 0.4 blocks gape by up to 0.0047 of their mean thickness, of 1.0 x 0.5 x 0.25 ones by
0.0060, of 0.5 x 0.25 x 0.2 ones by 0.0094; with 4 decimals by a tenth of that. Relative to the
thickness and not to the size, because of a thousand thin voussoirs none may be joined to the next
but one."""


def vertices_of(id: str, value: ArrayLike) -> FloatArray:
    """``value`` as vertices (k, 3), finite and at least four; refused by name if they are not."""
    try:
        points = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"vertices of block {id!r} must be a list of [x, y, z] numbers") from error
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4:
        raise InputError(
            f"block {id!r} needs at least four vertices [x, y, z], got shape {points.shape}"
        )
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InputError(f"vertex {bad} of block {id!r} must be finite, got {points[bad].tolist()}")
    return points


def checked_faces(id: str, faces: Sequence[Sequence[int]], count: int) -> Faces:
    """The faces as tuples of indices below ``count``; refused by name if they are none."""
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
    """Faces (vertex indices, outward) and what they enclose: volume, centroid (3,), and whether
    all vertices lie behind all faces, within the tolerance it was looked at with."""

    faces: Faces
    volume: float
    centroid: FloatArray
    is_convex: bool


def convex_body(points: FloatArray, faces: Faces) -> Body | None:
    """An exact convex body; None if it is not one.

    Most blocks are, and this way they take a tenth of the time of :func:`closed_body`.
    """
    tolerance = RELATIVE_TOLERANCE * float(np.linalg.norm(np.ptp(points, axis=0)))
    middle = points.mean(axis=0)
    oriented = []
    for face in faces:
        corners = points[list(face)]
        area = _area_vector(corners)
        norm = float(np.linalg.norm(area))
        if not norm > tolerance**2:
            return None
        if area @ (corners.mean(axis=0) - middle) <= 0.0:
            face, corners, area = face[::-1], corners[::-1], -area
        if not _bounds_convex_body(points, corners, area / norm, tolerance):
            return None
        oriented.append(face)
    edges = Counter((f[i - 1], f[i]) for f in oriented for i in range(len(f)))
    if any(n != 1 or edges[e[::-1]] != 1 for e, n in edges.items()):
        return None
    if len({i for f in faces for i in f}) < len(points):
        return None
    volume, centroid = volume_and_centroid(points, oriented)
    return Body(tuple(oriented), volume, centroid, True) if volume > tolerance**3 else None


def _area_vector(corners: FloatArray) -> FloatArray:
    """Half the sum of cross products around a closed polygon: area times unit normal."""
    spokes = corners[1:] - corners[0]
    m = spokes[:-1].T @ spokes[1:]  # np.cross takes longer than all else a block needs
    return 0.5 * np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]])


def _bounds_convex_body(
    points: FloatArray, corners: FloatArray, normal: FloatArray, tolerance: float
) -> bool:
    """True if a face is a flat convex polygon and has all points behind it."""
    heights = (points - corners.mean(axis=0)) @ normal
    if heights.max() > tolerance or ((corners - corners[0]) @ normal).min() < -tolerance:
        return False
    edges = np.roll(corners, -1, axis=0) - corners
    turns = cross(edges, np.roll(edges, -1, axis=0)) @ normal
    lengths = np.linalg.norm(edges, axis=1)
    return bool(lengths.min() > tolerance and (turns >= -tolerance * lengths).all())


def closed_body(
    id: str, points: FloatArray, faces: Faces, joint_tolerance: float | None = None
) -> Body:
    """A body of any shape from vertices and faces that are numbers and indices; nothing mended.

    Raises
    ------
    GeometryError
        If they enclose none: open, one-sided, several bodies, vertices to spare, a crossed face,
        or what :func:`body_inside` refuses.
    """
    check_faces(id, points, faces, RELATIVE_TOLERANCE * float(np.linalg.norm(np.ptp(points, 0))))
    unused = set(range(len(points))) - {i for f in faces for i in f}
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
    """The body inside a closed surface whose normals point out.

    Raises
    ------
    GeometryError
        If it has no volume, cuts itself, or has a face that is not flat.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    volume, centroid = volume_and_centroid(points, oriented)
    if not volume > (RELATIVE_TOLERANCE * size) ** 2 * size:
        raise GeometryError(
            f"block {id!r} is degenerate: its volume is {volume:g} for a size of {size:g}",
            points=points,
            blocks=(id,),
        )
    vectors = area_vectors(points, oriented)
    areas = np.linalg.norm(vectors, axis=1)
    allowed = joint_tolerance or default_tolerance(volume, float(areas.sum()))
    check_flat(id, points, oriented, allowed)
    is_convex = _all_behind(points, oriented, vectors / areas[:, None], allowed)
    if not is_convex:
        check_no_crossing(id, points, oriented, allowed)
    return Body(oriented, volume, centroid, is_convex)


def default_tolerance(volume: float, surface: float) -> float:
    """:data:`JOINT_TOLERANCE` of the mean thickness."""
    return JOINT_TOLERANCE * 2.0 * volume / surface


def check_flat(id: str, points: FloatArray, faces: Faces, tolerance: float) -> None:
    """Refuse faces that are warped by more than ``tolerance`` (length)."""
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
    """How far each face's corners are off its mean plane at most, (f,)."""
    normals = area_vectors(points, faces)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    result = np.zeros(len(faces))
    for number in (i for i, face in enumerate(faces) if len(face) > 3):
        corners = points[list(faces[number])]
        result[number] = np.abs((corners - corners.mean(axis=0)) @ normals[number]).max()
    return result


def _all_behind(points: FloatArray, faces: Faces, normals: FloatArray, tolerance: float) -> bool:
    """True if no vertex is in front of a face's plane; most shapes end in the first part."""
    base = np.array([points[list(face)].mean(axis=0) for face in faces])
    level = np.einsum("fk,fk->f", base, normals)
    step = max(1, 1_000_000 // len(points))
    return all(
        ((normals[i : i + step] @ points.T).max(axis=1) <= level[i : i + step] + tolerance).all()
        for i in range(0, len(faces), step)
    )
