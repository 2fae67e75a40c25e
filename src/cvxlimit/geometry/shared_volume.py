"""Volume shared by two bodies of any shape, and how deep it is. Booleans by manifold3d."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import volume_and_centroid
from cvxlimit.geometry.triangles import triangulated

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Body:
    """A block to intersect with others: its triangles (t, 3, 3), and its solid about ``origin``."""

    triangles: FloatArray
    origin: FloatArray
    manifold: manifold3d.Manifold

    @classmethod
    def of(cls, block: Block, origin: FloatArray) -> Body:
        """In double precision; bodies to intersect have one ``origin`` (3,) near them."""
        corners, _ = triangulated(block.vertices, block.faces)
        mesh = manifold3d.Mesh64(block.vertices - origin, corners.astype(np.uint64))
        return cls(block.vertices[corners], origin, manifold3d.Manifold(mesh))


def shared_depth(one: Body, other: Body) -> tuple[float, FloatArray, FloatArray]:
    """How deep two bodies are in each other; the centroid and corners (k, 3) of the common part.

    The deepest one, if there are several.

    The larger of two measures, each exact where the other sees nothing: the thickness of the part
    along the normal across which it is thinnest, volume / area seen along it, which is that of a
    plate; and the largest distance of its corners from the surface of either block, which is the
    depth of a corner poked into a face. Neither minds the parts without thickness that booleans
    leave where bodies only touch.
    """
    depth, where, deepest = 0.0, one.origin, np.empty((0, 3))
    for part in (one.manifold ^ other.manifold).decompose():
        if part.is_empty() or not part.volume() > 0.0:
            continue
        mesh = part.to_mesh64()
        corners = np.asarray(mesh.vert_properties)[:, :3] + one.origin
        triangles = np.asarray(mesh.tri_verts, dtype=np.int64)
        deep = max(float(_distance(corners, x.triangles).max()) for x in (one, other))
        deep = max(deep, float(part.volume()) / _widest_view(corners, triangles))
        if deep > depth:
            _, where = volume_and_centroid(corners, triangles.tolist())
            depth, deepest = deep, corners
    return depth, where, deepest


_REAL = 1e-3
"""Share of the largest triangle's area from which a triangle's normal is one: booleans leave
slivers whose normals are rounding, and plates are thin across large faces."""


def _widest_view(corners: FloatArray, triangles: IntArray) -> float:
    """Largest area that a body shows, seen along the normals of its larger faces."""
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    vectors = 0.5 * np.cross(b - a, c - a)
    area = np.linalg.norm(vectors, axis=1)
    real = area > _REAL * area.max()
    directions = np.unique((vectors[real] / area[real, None]).round(3), axis=0)
    return float(0.5 * np.abs(directions @ vectors.T).sum(axis=1).max())


def _distance(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Distance of points (k, 3) from the nearest of triangles (t, 3, 3), (k,)."""
    middle = triangles.mean(axis=1)
    reach = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
    result = np.empty(len(points))
    for i, point in enumerate(points):
        away = np.linalg.norm(middle - point, axis=1)
        near = triangles[away - reach <= (away + reach).min()]
        result[i] = _distances(point, near).min()
    return result


def _distances(point: FloatArray, triangles: FloatArray) -> FloatArray:
    """Distance of a point from each triangle: from its plane, or from its sides."""
    along = np.roll(triangles, -1, axis=1) - triangles
    offset = point - triangles
    share = np.einsum("tsk,tsk->ts", offset, along) / np.einsum("tsk,tsk->ts", along, along)
    nearest = triangles + np.clip(share, 0.0, 1.0)[:, :, None] * along
    result: FloatArray = np.linalg.norm(point - nearest, axis=2).min(axis=1)
    normal = np.cross(along[:, 0], along[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    inside = (np.einsum("tsk,tk->ts", np.cross(along, offset), normal) >= 0.0).all(axis=1)
    height = np.abs(np.einsum("tk,tk->t", offset[:, 0], normal))
    return np.where(inside, height, result)
