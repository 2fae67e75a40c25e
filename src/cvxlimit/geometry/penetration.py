"""Refusal of blocks that share volume: separating planes, or the volume itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import manifold3d
import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.facing import Reach
from cvxlimit.geometry.mesh import area_vectors, place, triangulated, volume_and_centroid
from cvxlimit.geometry.nearmisses import NearMiss


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


def check_no_interpenetration(
    blocks: Sequence[Block], first: IntArray, second: IntArray, contacts: Contacts, reach: Reach
) -> list[NearMiss]:
    """Refuse blocks that share volume, among the pairs (``first``, ``second``) that may.

    A contact's plane separates two convex blocks, so of those only pairs without a contact whose
    bounding boxes overlap need a look: a separating plane is sought among their faces, then
    among the planes spanned by pairs of edges. Other shapes are intersected as bodies
    (:mod:`cvxlimit.geometry.penetration`), which may find overlaps that are beyond the tolerance
    at a corner but too shallow to refuse: these are returned.

    Raises
    ------
    GeometryError
        Naming the two blocks, the depth and the place.
    """
    count = np.array([len(b.vertices) for b in blocks])
    points, begin = np.concatenate([b.vertices for b in blocks]), np.cumsum(count) - count
    low, high = np.minimum.reduceat(points, begin), np.maximum.reduceat(points, begin)
    margin = np.minimum(reach.tolerance[first], reach.tolerance[second])
    shared = np.minimum(high[first], high[second]) - np.maximum(low[first], low[second])
    touching = np.isin(first * len(blocks) + second, contacts.a * len(blocks) + contacts.b)
    simple = np.array([b.is_convex and len(b.faces) <= _MOST_FACES for b in blocks])
    simple = simple[first] & simple[second]
    origin = 0.5 * (low.min(axis=0) + high.max(axis=0))
    normals = cache(lambda i: _face_normals(blocks[i]))
    bodies = cache(lambda i: Body.of(blocks[i], origin))
    sunk = []
    looked = (shared.min(axis=1) > margin) & ~(touching & simple)
    for j in np.flatnonzero(looked).tolist():
        i, k = int(first[j]), int(second[j])
        a, b = blocks[i], blocks[k]
        allowed = float(margin[j])
        if simple[j]:
            overlap = _penetration(a, b, normals(i), normals(k))
            if overlap > allowed:
                raise _refusal(a, b, overlap, allowed, *_shared_box(a, b))
            continue
        if _least_overlap(a, b, np.concatenate([normals(i), -normals(k)])) <= allowed:
            continue
        overlap, where, corners = shared_depth(bodies(i), bodies(k))
        if overlap > _REFUSED * allowed:
            raise _refusal(a, b, overlap, allowed, where, corners)
        if overlap > allowed:
            sunk.append(NearMiss(a.id, b.id, "overlap", overlap, allowed, where, corners))
    return sunk


_MOST_FACES = 60
"""Convex bodies with more faces are intersected too: planes through pairs of their edges are tried
one by one, 90 x 90 for two of them, 20 ms."""

_REFUSED = 2.0
"""Overlaps of bodies are refused beyond so many tolerances: where two planes meet, corners of
joints that overlap by one tolerance each lie deeper than either."""


def _refusal(
    a: Block, b: Block, depth: float, allowed: float, where: FloatArray, corners: FloatArray
) -> GeometryError:
    return GeometryError(
        f"blocks {a.id!r} and {b.id!r} interpenetrate by about {depth:.3g} near {place(where)}, "
        f"beyond their joint tolerance of {allowed:.3g}: move or cut one of them, or raise "
        "joint_tolerance if the model is no more exact",
        points=corners,
        blocks=(a.id, b.id),
    )


def _shared_box(a: Block, b: Block) -> tuple[FloatArray, FloatArray]:
    """Middle (3,) and two corners (2, 3) of the box that two blocks' bounding boxes share."""
    low = np.maximum(a.vertices.min(axis=0), b.vertices.min(axis=0))
    high = np.minimum(a.vertices.max(axis=0), b.vertices.max(axis=0))
    return 0.5 * (low + high), np.stack([low, high])


def penetration(first: Block, second: Block) -> float:
    """Smallest overlap of two convex blocks over all candidate separating directions.

    Zero or negative when they are apart or only touch; length unit of the scene.
    """
    return _penetration(first, second, _face_normals(first), _face_normals(second))


def _penetration(
    first: Block, second: Block, first_normals: FloatArray, second_normals: FloatArray
) -> float:
    overlap = _least_overlap(first, second, np.concatenate([first_normals, -second_normals]))
    if overlap <= 0.0:
        return overlap
    crosses = np.cross(_edge_directions(first)[:, None], _edge_directions(second)[None])
    crosses = crosses.reshape(-1, 3)
    norms = np.linalg.norm(crosses, axis=1)
    crosses = crosses[norms > 1e-9] / norms[norms > 1e-9, None]
    return min(overlap, _least_overlap(first, second, np.concatenate([crosses, -crosses])))


def _least_overlap(first: Block, second: Block, directions: FloatArray) -> float:
    if not len(directions):
        return np.inf
    reach = (first.vertices @ directions.T).max(axis=0)
    return float((reach - (second.vertices @ directions.T).min(axis=0)).min())


def _face_normals(block: Block) -> FloatArray:
    return _unit(area_vectors(block.vertices, block.faces))


def _edge_directions(block: Block) -> FloatArray:
    pairs = {
        (min(i, k), max(i, k)) for f in block.faces for i, k in zip(f, f[1:] + f[:1], strict=True)
    }
    return _unit(np.array([block.vertices[k] - block.vertices[i] for i, k in sorted(pairs)]))


def _unit(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return result
