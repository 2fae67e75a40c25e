"""Faces cut into triangles and into convex pieces, without new vertices."""

from __future__ import annotations

from collections.abc import Sequence

import manifold3d
import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.mesh import cross, plane_axes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def triangulated(points: FloatArray, faces: Sequence[Sequence[int]]) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of vertex indices that make up the faces, and the face of each (t,).

    A quadrilateral is cut along its shorter diagonal, if that lies inside, so that two blocks
    which share a warped one are cut alike; larger faces by ear clipping in their own planes.
    """
    sizes = np.array([len(face) for face in faces])
    corners: list[IntArray] = []
    owners: list[IntArray] = []
    for size in np.unique(sizes).tolist():
        members = np.flatnonzero(sizes == size)
        loops = np.array([faces[i] for i in members.tolist()])
        if size == 3:
            corners.append(loops)
            owners.append(members)
            continue
        way, fits = _diagonals(points[loops]) if size == 4 else (loops[:, :1], None)
        for row, number in enumerate(members.tolist()):
            is_cut = fits is not None and fits[row]
            cut = _WAYS[way[row]] if is_cut else _ears(points[loops[row]])
            corners.append(loops[row][cut])
            owners.append(np.full(len(cut), number))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(corners)[order].astype(np.int64), owner[order].astype(np.int64)


_WAYS = np.array([[(0, 1, 2), (0, 2, 3)], [(1, 2, 3), (1, 3, 0)]])
"""Triangles of a quadrilateral cut along its first or its second diagonal."""

_EQUAL = 1e-9
"""Diagonals whose lengths differ by less than this share are as long: a square's, rounded."""


def _diagonals(corners: FloatArray) -> tuple[IntArray, NDArray[np.bool_]]:
    """Which diagonal to cut quadrilaterals (q, 4, 3) along, and whether it lies inside.

    The shorter one; of two as long, to rounding, the one whose middle is lower along x, y, z.
    """
    across = corners[:, [2, 3]] - corners[:, [0, 1]]
    normal = cross(across[:, 0], across[:, 1])
    spans = np.linalg.norm(across, axis=2)
    middles = 0.5 * (corners[:, [0, 1]] + corners[:, [2, 3]])
    lower = (middles[:, 0] - middles[:, 1]) / spans.max(axis=1)[:, None]
    lead = np.abs(lower) > _EQUAL
    first = np.take_along_axis(lower, lead.argmax(axis=1)[:, None], axis=1)[:, 0]
    equal = np.abs(spans[:, 0] - spans[:, 1]) <= _EQUAL * spans[:, 0]
    way = np.where(equal, first > 0.0, spans[:, 1] < spans[:, 0]).astype(np.int64)
    cut = _WAYS[np.stack([way, 1 - way], axis=1)]  # q, way, triangle, corner
    a, b, c = (
        np.take_along_axis(corners[:, None, None], cut[..., i, None, None], axis=3)[..., 0, :]
        for i in range(3)
    )
    areas = np.einsum("qwtk,qk->qwt", cross(b - a, c - a), normal)
    fits = (areas > 0.0).all(axis=2)
    return np.where(fits[:, 0], way, 1 - way), fits.any(axis=1)


def _ears(corners: FloatArray) -> IntArray:
    spokes = corners - corners[0]
    normal = cross(spokes[:-1], spokes[1:]).sum(axis=0)
    return flat_triangles([corners @ plane_axes(normal / np.linalg.norm(normal)).T])


def flat_triangles(loops: Sequence[FloatArray]) -> IntArray:
    """Triangles (t, 3) of a plane region: outer loops counter-clockwise, holes clockwise.

    They index the corners of all loops in the order given.
    """
    return np.asarray(manifold3d.triangulate([np.ascontiguousarray(x) for x in loops]), np.int64)
