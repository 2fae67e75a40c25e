"""Refusal of blocks that share volume: separating planes of convex bodies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from cvxlimit.blocks import Block
from cvxlimit.contacts import Contacts
from cvxlimit.errors import InputError

FloatArray = NDArray[np.float64]


def check_no_interpenetration(
    blocks: Sequence[Block], contacts: Contacts, sizes: FloatArray, tolerance: float
) -> None:
    """Refuse blocks that share volume.

    A contact's plane separates its two convex blocks, so only pairs without a contact whose
    bounding boxes overlap need a look: a separating plane is sought among their faces, then
    among the planes spanned by pairs of edges.
    """
    low = np.array([b.vertices.min(axis=0) for b in blocks])
    high = np.array([b.vertices.max(axis=0) for b in blocks])
    margin = tolerance * sizes
    flat = _two_longest_axes(low, high)
    boxes = shapely.box(*low[:, flat].T, *high[:, flat].T)
    first, second = shapely.STRtree(boxes).query(boxes)
    once = first < second
    first, second = first[once], second[once]
    shared = np.minimum(high[first], high[second]) - np.maximum(low[first], low[second])
    depth = shared.min(axis=1)
    deep = depth > np.minimum(margin[first], margin[second])
    touching = set(zip(contacts.a.tolist(), contacts.b.tolist(), strict=True))
    pairs = set(zip(first[deep].tolist(), second[deep].tolist(), strict=True)) - touching
    normals = {i: _face_normals(blocks[i]) for i in {i for pair in pairs for i in pair}}
    for i, k in sorted(pairs):
        overlap = _penetration(blocks[i], blocks[k], normals[i], normals[k])
        if overlap > min(margin[i], margin[k]):
            raise InputError(
                f"blocks {blocks[i].id!r} and {blocks[k].id!r} interpenetrate by about "
                f"{overlap:.3g}: move or cut one of them"
            )


def _two_longest_axes(low: FloatArray, high: FloatArray) -> list[int]:
    order = np.argsort(np.ptp(0.5 * (low + high), axis=0))
    return [int(order[2]), int(order[1])]


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
    corners = [block.vertices[list(face)] for face in block.faces]
    areas = np.array(
        [np.cross(c - c[0], np.roll(c, -1, axis=0) - c[0]).sum(axis=0) for c in corners]
    )
    return _unit(areas)


def _edge_directions(block: Block) -> FloatArray:
    pairs = {
        (min(i, k), max(i, k)) for f in block.faces for i, k in zip(f, f[1:] + f[:1], strict=True)
    }
    return _unit(np.array([block.vertices[k] - block.vertices[i] for i, k in sorted(pairs)]))


def _unit(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return result
