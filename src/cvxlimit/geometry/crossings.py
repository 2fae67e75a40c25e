"""Surfaces that cut themselves: faces like a bow-tie, faces that pass through other faces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import GeometryError
from cvxlimit.geometry.mesh import area_vectors, place, plane_axes
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.triangles import triangulated

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_CHUNK = 200_000
"""Pairs of triangles looked at in one array operation: about 100 MB."""


def check_faces(
    id: str, points: FloatArray, faces: Sequence[Sequence[int]], tolerance: float
) -> None:
    """Refuse faces without area and faces whose own sides cross, seen along their normals."""
    vectors = area_vectors(points, faces)
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
                f"{place(points[list(face)].mean(axis=0))}; list its vertices in order around it",
                points=points[list(face)],
                blocks=(id,),
            )


def _crosses_itself(corners: FloatArray, normal: FloatArray) -> bool:
    """True if two sides of a polygon that do not follow each other cross in its own plane."""
    flat = corners @ plane_axes(normal).T
    along = np.roll(flat, -1, axis=0) - flat
    turns = along[:, 0] * np.roll(along[:, 1], -1) - along[:, 1] * np.roll(along[:, 0], -1)
    if len(corners) == 4 and (turns > 0.0).sum() >= 3:
        return False
    ends = flat + along

    def side(points: FloatArray) -> FloatArray:
        """Sign of the side of every line (rows) on which ``points`` (columns) lie."""
        offset = points[None] - flat[:, None]
        cross = along[:, None, 0] * offset[:, :, 1] - along[:, None, 1] * offset[:, :, 0]
        noise = 1e-12 * float(np.abs(along).max()) ** 2
        return np.where(np.abs(cross) > noise, np.sign(cross), 0.0)

    apart = side(flat) * side(ends) < 0.0
    return bool((apart & apart.T).any())


def check_no_crossing(
    id: str, points: FloatArray, faces: Sequence[Sequence[int]], tolerance: float
) -> None:
    """Refuse a surface where a side of one face passes through another by more than ``tolerance``.

    Seen are crossings of at least that depth on both sides; surfaces that only touch pass.
    """
    corners, _ = triangulated(points, faces)
    bodies = points[corners]
    middle = bodies.mean(axis=1)
    first, second = nearby_pairs(list(bodies), np.zeros(len(bodies)))
    for at in range(0, len(first), _CHUNK):
        chunk = slice(at, at + _CHUNK)
        for i, k in ((first[chunk], second[chunk]), (second[chunk], first[chunk])):
            hit = _pierced(points, corners[i], corners[k], tolerance)
            if hit is not None:
                pair, where = hit
                raise GeometryError(
                    f"block {id!r} cuts itself near {place(where)}: two of its faces cross; "
                    "unite the parts before export, or make a block of each",
                    points=np.vstack([bodies[i[pair]], bodies[k[pair]], middle[i[pair]][None]]),
                    blocks=(id,),
                )


def _pierced(
    points: FloatArray, lines: IntArray, faces: IntArray, tolerance: float
) -> tuple[int, FloatArray] | None:
    """First pair whose ``lines`` triangle has a side that passes through its ``faces`` triangle."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    wide = length > tolerance**2
    normal = normal / np.where(wide, length, 1.0)[:, None]
    for i, k in ((0, 1), (1, 2), (2, 0)):
        ends = points[lines[:, i]], points[lines[:, k]]
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
            inward = np.cross(normal[rows], along)
            inward /= np.linalg.norm(along, axis=1)[:, None]
            depth = np.minimum(depth, np.einsum("pk,pk->p", where - p[rows], inward))
        inside = np.flatnonzero(depth > tolerance)
        if len(inside):
            return int(rows[inside[0]]), where[inside[0]]
    return None
