"""Faces cut into triangles and into convex pieces, without new vertices."""

from __future__ import annotations

from collections.abc import Sequence

import manifold3d
import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.mesh import plane_axes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def triangulated(points: FloatArray, faces: Sequence[Sequence[int]]) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of vertex indices that make up the faces, and the face of each (t,).

    A quadrilateral is cut along its shorter diagonal, if that lies inside, so that two blocks
    which share a warped one are cut alike; larger faces by ear clipping in their own planes.
    """
    corners: list[tuple[int, ...]] = []
    owner: list[int] = []
    for number, face in enumerate(faces):
        cut = _cut(points[list(face)]) if len(face) > 3 else [(0, 1, 2)]
        corners += [(face[i], face[j], face[k]) for i, j, k in cut]
        owner += [number] * len(cut)
    return np.array(corners, dtype=np.int64), np.array(owner, dtype=np.int64)


def _cut(corners: FloatArray) -> list[tuple[int, int, int]]:
    spokes = corners - corners[0]
    normal = np.cross(spokes[:-1], spokes[1:]).sum(axis=0)
    if len(corners) == 4:
        ways = [[(0, 1, 2), (0, 2, 3)], [(1, 2, 3), (1, 3, 0)]]
        lengths = [np.linalg.norm(corners[2] - corners[0]), np.linalg.norm(corners[3] - corners[1])]
        # Equal to rounding: the one whose middle is lower along x, y, z, whatever comes first.
        if abs(lengths[0] - lengths[1]) > 1e-9 * lengths[0]:
            order = np.argsort(lengths)
        else:
            middles = [tuple((corners[0] + corners[2]).round(12)),
                       tuple((corners[1] + corners[3]).round(12))]  # fmt: skip
            order = np.array([0, 1] if middles[0] <= middles[1] else [1, 0])
        for way in (ways[int(i)] for i in order):
            areas = [np.cross(corners[j] - corners[i], corners[k] - corners[i]) @ normal
                     for i, j, k in way]  # fmt: skip
            if min(areas) > 0.0:
                return way
    return [
        (int(i), int(j), int(k))
        for i, j, k in flat_triangles([corners @ plane_axes(normal / np.linalg.norm(normal)).T])
    ]


def flat_triangles(loops: Sequence[FloatArray]) -> IntArray:
    """Triangles (t, 3) of a plane region: outer loops counter-clockwise, holes clockwise.

    They index the corners of all loops in the order given.
    """
    return np.asarray(manifold3d.triangulate([np.ascontiguousarray(x) for x in loops]), np.int64)
