"""Volume shared by two bodies of any shape, and how deep it is. Booleans by manifold3d."""

from __future__ import annotations

import manifold3d
import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.triangles import triangulated

FloatArray = NDArray[np.float64]


def body(block: Block) -> manifold3d.Manifold:
    """The block as a body to intersect, in double precision."""
    corners, _ = triangulated(block.vertices, block.faces)
    return manifold3d.Manifold(
        manifold3d.Mesh64(np.ascontiguousarray(block.vertices), corners.astype(np.uint64))
    )


def shared_depth(
    one: manifold3d.Manifold, other: manifold3d.Manifold, a: Block, b: Block
) -> tuple[float, FloatArray]:
    """How deep two bodies are in each other, and corners (k, 3) of the deepest common part.

    The larger of two measures, each exact where the other sees nothing. The mean thickness,
    2 volume / surface, of a common part: that of a plate whatever its outline, while a beam passed
    through a plate has corners on both surfaces only. And the largest distance of its corners from
    the surface of either block: the depth of a corner poked into a face.
    """
    common = one ^ other
    depth, where = 0.0, np.empty((0, 3))
    if common.is_empty():
        return depth, where
    for part in common.decompose():
        corners = np.asarray(part.to_mesh64().vert_properties)[:, :3]
        if not part.surface_area() > 0.0:
            continue
        thick = 2.0 * float(part.volume()) / float(part.surface_area())
        deep = max(float(distance_from_surface(corners, x).max()) for x in (a, b))
        if max(thick, deep) > depth:
            depth, where = max(thick, deep), corners
    return depth, where


def distance_from_surface(points: FloatArray, block: Block) -> FloatArray:
    """Distance of points (k, 3) from the nearest face of a block, (k,)."""
    corners = block.vertices[triangulated(block.vertices, block.faces)[0]]
    return np.array([_distance(p, corners).min() for p in points])


def _distance(point: FloatArray, triangles: FloatArray) -> FloatArray:
    """Distance of a point from triangles (t, 3, 3): from their planes, or from their sides."""
    start = triangles
    along = np.roll(triangles, -1, axis=1) - start
    offset = point - start
    share = np.einsum("tsk,tsk->ts", offset, along) / np.einsum("tsk,tsk->ts", along, along)
    nearest = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
    result: FloatArray = np.linalg.norm(point - nearest, axis=2).min(axis=1)
    normal = np.cross(along[:, 0], along[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    inside = (np.einsum("tsk,tk->ts", np.cross(along, offset), normal) >= 0.0).all(axis=1)
    height = np.abs(np.einsum("tk,tk->t", offset[:, 0], normal))
    return np.where(inside, height, result)
