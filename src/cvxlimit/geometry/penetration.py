"""Refusal of blocks that share volume: separating planes, or the volume itself."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import GeometryError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.facing import Reach
from cvxlimit.geometry.mesh import area_vectors, place
from cvxlimit.geometry.nearmisses import NearMiss
from cvxlimit.geometry.shared_volume import Body, shared_depth

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def check_no_interpenetration(
    blocks: Sequence[Block], first: IntArray, second: IntArray, contacts: Contacts, reach: Reach
) -> list[NearMiss]:
    """Refuse blocks that share volume, among the pairs (``first``, ``second``) that may.

    A contact's plane separates two convex blocks, so of those only pairs without a contact whose
    bounding boxes overlap need a look: a separating plane is sought among their faces, then
    among the planes spanned by pairs of edges. Other shapes are intersected as bodies
    (:mod:`cvxlimit.geometry.shared_volume`), which may find overlaps that are beyond the tolerance
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
                raise _refusal(a, b, overlap, *_shared_box(a, b))
            continue
        if _least_overlap(a, b, np.concatenate([normals(i), -normals(k)])) <= allowed:
            continue
        overlap, where, corners = shared_depth(bodies(i), bodies(k))
        if overlap > _REFUSED * allowed:
            raise _refusal(a, b, overlap, where, corners)
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
    a: Block, b: Block, depth: float, where: FloatArray, corners: FloatArray
) -> GeometryError:
    return GeometryError(
        f"blocks {a.id!r} and {b.id!r} interpenetrate by about {depth:.3g} near {place(where)}: "
        "move or cut one of them, or raise joint_tolerance if the model is no more exact",
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
