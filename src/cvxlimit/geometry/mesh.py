"""Closed surfaces: which faces share an edge, which way round they go, what they enclose.

Nothing here repairs: :mod:`cvxlimit.geometry.solids` does before it asks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from cvxlimit.base.arrays import ROUNDING, FloatArray, IntArray

Faces = tuple[tuple[int, ...], ...]

RELATIVE_TOLERANCE = 1e-6
"""Exact shapes are told from inexact ones at this fraction of a block's size.

A body that is flat-faced and convex to six digits is taken as such; vertices nearer to each other
than this are one, faces and angles (radians) that differ by less alike, and sides shorter than this
share of the longest say nothing of directions."""


SLIVER = 1e-3
"""Share of an area below which triangles say nothing of how it is turned: of slivers with which
programs cut planes into triangles, and which booleans leave, the normals are rounding."""


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """The m directed sides of all faces, and the e undirected edges that they lie on.

    Side i runs from vertex ``start[i]`` to vertex ``end[i]``, belongs to face ``face[i]`` and lies
    on edge ``key[i]``; ``uses`` (e,) is the number of sides on each edge, two on a simple closed
    surface.
    """

    start: IntArray
    end: IntArray
    face: IntArray
    key: IntArray
    uses: IntArray

    @classmethod
    def of(cls, faces: Sequence[Sequence[int]]) -> EdgeTable:
        sizes = np.array([len(f) for f in faces])
        start = np.array([i for f in faces for i in f], dtype=np.int64)
        place = np.arange(len(start))
        first = np.repeat(np.cumsum(sizes) - sizes, sizes)
        last = place == first + np.repeat(sizes, sizes) - 1
        end = start[np.where(last, first, place + 1)]
        low, high = np.minimum(start, end), np.maximum(start, end)
        _, key, uses = np.unique(low * (high.max() + 1) + high, return_inverse=True,
                                 return_counts=True)  # fmt: skip
        return cls(start, end, np.repeat(np.arange(len(sizes)), sizes), key, uses)

    def twins(self) -> tuple[IntArray, IntArray]:
        """The two sides, (t,) each, of every edge that has two."""
        order = np.argsort(self.key, kind="stable")
        order = order[self.uses[self.key[order]] == 2]
        return order[::2], order[1::2]


def with_corners_on(
    sides: IntArray, ends: IntArray, distance: float, points: FloatArray, table: EdgeTable,
    faces: Sequence[Sequence[int]],
) -> tuple[Faces, int]:  # fmt: skip
    """The faces with those of the vertices ``ends`` that lie within ``distance`` of one of the
    ``sides``, and not near its ends, as corners of its face; and how many were joined."""
    a, along = points[table.start[sides]], points[table.end[sides]] - points[table.start[sides]]
    length = np.linalg.norm(along, axis=1)
    near = cKDTree(points[ends]).query_ball_point(a + 0.5 * along, 0.5 * length + distance)
    row = np.repeat(np.arange(len(sides)), [len(each) for each in near])
    corner = ends[np.concatenate([*near, []]).astype(np.int64)]
    offset = points[corner] - a[row]
    share = np.einsum("nk,nk->n", offset, along[row]) / length[row] ** 2
    away = np.linalg.norm(offset - share[:, None] * along[row], axis=1)
    margin = distance / length[row]
    hits = np.flatnonzero((away <= distance) & (share > margin) & (share < 1.0 - margin))
    loops, joined = [list(face) for face in faces], 0
    for hit in hits[np.lexsort((-share[hits], row[hits]))].tolist():  # the last along a side first
        side, new = int(sides[row[hit]]), int(corner[hit])
        loop = loops[int(table.face[side])]
        if new not in loop:
            loop.insert(loop.index(int(table.start[side])) + 1, new)
            joined += 1
    return tuple(map(tuple, loops)), joined


def by_size(faces: Sequence[Sequence[int]]) -> Iterator[tuple[IntArray, IntArray]]:
    """Yields faces of equal size k at once: their numbers (m,) and their vertices (m, k)."""
    sizes = np.array([len(f) for f in faces])
    for size in np.unique(sizes).tolist():
        members = np.flatnonzero(sizes == size)
        yield members, np.array([faces[i] for i in members.tolist()])


def fan(points: FloatArray, faces: Sequence[Sequence[int]]) -> tuple[FloatArray, IntArray]:
    """Triangles (t, 3, 3) that make up the faces, and the face of each (t,). Faces of more than
    three corners are fanned about their mean: for a warped one this does not depend on where it
    starts."""
    corners, owners = [], []
    for members, indices in by_size(faces):
        loops, size = points[indices], indices.shape[1]
        if size > 3:
            middle = np.repeat(loops.mean(axis=1)[:, None], size, axis=1)
            loops = np.stack([middle, loops, np.roll(loops, -1, axis=1)], axis=2).reshape(-1, 3, 3)
            members = np.repeat(members, size)
        corners.append(loops)
        owners.append(members)
    return np.concatenate(corners), np.concatenate(owners)


def padded(faces: Faces, width: int = 0) -> IntArray:
    """Faces as one array (f, k), the last vertex of each repeated up to the largest size."""
    width = max(width, *map(len, faces))
    return np.array([[*f, *f[-1:] * (width - len(f))] for f in faces])


def linked(count: int, first: IntArray, second: IntArray) -> IntArray:
    """The number of the group (count,) of each of ``count`` things, if ``first[i]`` and
    ``second[i]`` are in one group."""
    links = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def turn(u: FloatArray, v: FloatArray) -> FloatArray:
    """Cross products of vectors (..., 2) of a plane: positive from u to v counter-clockwise."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def cross(u: FloatArray, v: FloatArray) -> FloatArray:
    """Cross products of vectors (..., 3); on small arrays three times as fast as ``np.cross``."""
    x, y, z = u[..., 0], u[..., 1], u[..., 2]
    p, q, r = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p], axis=-1)


def polygon_vectors(corners: FloatArray) -> FloatArray:
    """Area times unit normal (..., 3) of closed polygons (..., k, 3), flat or not, that go round
    counter-clockwise seen against it; repeated corners do no harm."""
    spokes = corners[..., 1:, :] - corners[..., :1, :]
    return np.asarray(0.5 * cross(spokes[..., :-1, :], spokes[..., 1:, :]).sum(axis=-2))


def cut_off(triangles: FloatArray, depth: FloatArray) -> FloatArray:
    """The parts of triangles (t, 3, 3) where a linear ``depth``, given at the corners (t, 3), is
    positive, as triangles that go round the same way."""
    inside = depth > 0.0
    number = inside.sum(axis=1)
    parts = [triangles[number == 3]]
    for count in (1, 2):
        rows = np.flatnonzero(number == count)
        lone = (inside[rows] == (count == 1)).argmax(axis=1)  # the corner alone on its side, first
        order = (lone[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(triangles[rows], order[:, :, None], 1), 1, 0)
        d = np.take_along_axis(depth[rows], order, 1)
        ab = a + (d[:, 0] / (d[:, 0] - d[:, 1]))[:, None] * (b - a)
        ac = a + (d[:, 0] / (d[:, 0] - d[:, 2]))[:, None] * (c - a)
        cuts = [(a, ab, ac)] if count == 1 else [(ab, b, c), (ab, c, ac)]
        parts += [np.stack(cut, axis=1) for cut in cuts]
    return np.concatenate(parts)


def area_vectors(points: FloatArray, faces: Sequence[Sequence[int]]) -> FloatArray:
    """Area times unit normal (f, 3) of each face, see :func:`polygon_vectors`."""
    result = np.empty((len(faces), 3))
    for members, indices in by_size(faces):
        result[members] = polygon_vectors(points[indices])
    return result


def surface(points: FloatArray, faces: Sequence[Sequence[int]]) -> float:
    return float(np.linalg.norm(area_vectors(points, faces), axis=1).sum())


def volume_and_centroid(
    points: FloatArray, faces: Sequence[Sequence[int]]
) -> tuple[float, FloatArray]:
    """Computes both by the divergence theorem, exact for closed surfaces whose normals point
    out."""
    origin = points.mean(axis=0)
    corners = fan(points, faces)[0] - origin
    volumes = np.linalg.det(corners) / 6.0
    volume = float(volumes.sum())
    if volume <= 0.0:
        return volume, origin
    return volume, origin + (volumes[:, None] * corners.sum(axis=1)).sum(axis=0) / (4.0 * volume)


def flipped(faces: Faces, which: NDArray[np.bool_]) -> Faces:
    """The faces, with those marked in ``which`` (f,) running the other way round."""
    return tuple(f[::-1] if turns else f for f, turns in zip(faces, which.tolist(), strict=True))


def second_moments(points: FloatArray, faces: Sequence[Sequence[int]]) -> FloatArray:
    """Integral of x x^T (3, 3) over the body that a closed surface encloses, about the origin.

    The body is cut into tetrahedra with one corner in the origin and the others at p_1, p_2, p_3;
    each of volume v adds v / 20 (sum_i p_i p_i^T + s s^T), where s = p_1 + p_2 + p_3.
    """
    corners = fan(points, faces)[0]
    volumes, whole = np.linalg.det(corners) / 120.0, corners.sum(axis=1)
    each = np.einsum("t,tkx,tky->xy", volumes, corners, corners)
    return np.asarray(each + np.einsum("t,tx,ty->xy", volumes, whole, whole))


def plane_axes(normal: FloatArray) -> FloatArray:
    """Two unit vectors (2, 3) of the plane, right-handed with its unit normal."""
    first = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def place(point: FloatArray) -> str:
    """A point as it is written in messages."""
    return "(" + ", ".join(f"{x:.6g}" for x in np.asarray(point).tolist()) + ")"


def triangulated(points: FloatArray, faces: Sequence[Sequence[int]]) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of vertex indices that make up the faces, and the face of each (t,). A
    quadrilateral is cut along its shorter diagonal, if that lies inside, so that two blocks which
    share a warped one are cut alike; larger faces by ear clipping in their own planes."""
    corners: list[IntArray] = []
    owners: list[IntArray] = []
    for members, loops in by_size(faces):
        size = loops.shape[1]
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


def _diagonals(corners: FloatArray) -> tuple[IntArray, NDArray[np.bool_]]:
    """Which diagonal to cut quadrilaterals (q, 4, 3) along, and whether it lies inside: the
    shorter; of two as long, to rounding, the one whose middle is lower along x, y, z."""
    across = corners[:, [2, 3]] - corners[:, [0, 1]]
    normal = cross(across[:, 0], across[:, 1])
    spans = np.linalg.norm(across, axis=2)
    middles = 0.5 * (corners[:, [0, 1]] + corners[:, [2, 3]])
    lower = (middles[:, 0] - middles[:, 1]) / spans.max(axis=1)[:, None]
    lead = np.abs(lower) > ROUNDING
    first = np.take_along_axis(lower, lead.argmax(axis=1)[:, None], axis=1)[:, 0]
    equal = np.abs(spans[:, 0] - spans[:, 1]) <= ROUNDING * spans[:, 0]
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
    """Triangles (t, 3) of corner numbers that tile one polygon, by ear clipping in its plane."""
    normal = polygon_vectors(corners)
    flat = corners @ plane_axes(normal / np.linalg.norm(normal)).T
    return np.asarray(manifold3d.triangulate([np.ascontiguousarray(flat)]), np.int64)
