"""Volume shared by two bodies of any shape, and how deep it is. Booleans by manifold3d."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.triangles import triangulated

FloatArray = NDArray[np.float64]


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


def shared_depth(one: Body, other: Body) -> tuple[float, FloatArray]:
    """How deep two bodies are in each other, and corners (k, 3) of the deepest common part.

    The larger of two measures, each exact where the other sees nothing. The mean thickness,
    2 volume / surface, of a common part: that of a plate whatever its outline, while a beam passed
    through a plate has corners on both surfaces only. And the largest distance of its corners from
    the surface of either block: the depth of a corner poked into a face.
    """
    depth, where = 0.0, np.empty((0, 3))
    for part in (one.manifold ^ other.manifold).decompose():
        surface = float(part.surface_area())
        if part.is_empty() or not surface > 0.0:
            continue
        corners = np.asarray(part.to_mesh64().vert_properties)[:, :3] + one.origin
        thick = 2.0 * float(part.volume()) / surface
        deep = max(thick, *(float(_distance(corners, x.triangles).max()) for x in (one, other)))
        if deep > depth:
            depth, where = deep, corners
    return depth, where


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
