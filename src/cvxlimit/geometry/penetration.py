"""Refusal of blocks that share volume: separating planes of convex bodies."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def check_no_interpenetration(
    blocks: Sequence[Block],
    first: IntArray,
    second: IntArray,
    contacts: Contacts,
    sizes: FloatArray,
    tolerance: float,
) -> None:
    """Refuse blocks that share volume, among the pairs (``first``, ``second``) that may.

    A contact's plane separates its two convex blocks, so only pairs without a contact whose
    bounding boxes overlap need a look: a separating plane is sought among their faces, then
    among the planes spanned by pairs of edges.
    """
    low = np.array([b.vertices.min(axis=0) for b in blocks])
    high = np.array([b.vertices.max(axis=0) for b in blocks])
    margin = tolerance * np.minimum(sizes[first], sizes[second])
    shared = np.minimum(high[first], high[second]) - np.maximum(low[first], low[second])
    touching = np.isin(first * len(blocks) + second, contacts.a * len(blocks) + contacts.b)
    normals = cache(lambda i: _face_normals(blocks[i]))
    for j in np.flatnonzero((shared.min(axis=1) > margin) & ~touching).tolist():
        a, b = blocks[first[j]], blocks[second[j]]
        overlap = _penetration(a, b, normals(first[j]), normals(second[j]))
        if overlap > margin[j]:
            raise InputError(
                f"blocks {a.id!r} and {b.id!r} interpenetrate by about "
                f"{overlap:.3g}: move or cut one of them"
            )


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
    width = max(len(face) for face in block.faces)
    corners = block.vertices[[[*face, *face[-1:] * (width - len(face))] for face in block.faces]]
    spokes = corners - corners[:, :1]
    return _unit(np.cross(spokes[:, :-1], spokes[:, 1:]).sum(axis=1))


def _edge_directions(block: Block) -> FloatArray:
    pairs = {
        (min(i, k), max(i, k)) for f in block.faces for i, k in zip(f, f[1:] + f[:1], strict=True)
    }
    return _unit(np.array([block.vertices[k] - block.vertices[i] for i, k in sorted(pairs)]))


def _unit(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return result
