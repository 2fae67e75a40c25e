"""The same body in other meshes: faces cut otherwise, further vertices, other numbers."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cvxlimit import Block

Polygons = list[tuple[int, ...]]


def remeshed(
    points: np.ndarray, faces: Polygons, rng: np.random.Generator
) -> tuple[np.ndarray, Polygons]:
    """Each convex face whole, or cut from one of its corners or from a new vertex in its middle;
    then vertices and faces in another order, and each face from another corner on."""
    corners, cut = points.tolist(), Polygons()
    for face in faces:
        start = int(rng.integers(len(face)))
        loop = (*face[start:], *face[:start])
        way = int(rng.integers(3)) if _is_convex(points[list(face)]) else 0
        if way == 0:
            cut.append(loop)
        elif way == 1:
            cut += [(loop[0], b, c) for b, c in pairwise(loop[1:])]
        else:
            corners.append(points[list(face)].mean(axis=0).tolist())
            cut += [(len(corners) - 1, loop[i - 1], loop[i]) for i in range(len(loop))]
    order, place = rng.permutation(len(corners)), np.empty(len(corners), dtype=int)
    place[order] = np.arange(len(corners))
    turned = [tuple(place[list(cut[i])].tolist()) for i in rng.permutation(len(cut))]
    return np.array(corners)[order], turned


def _is_convex(corners: np.ndarray) -> bool:
    along = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(along, np.roll(along, -1, axis=0))
    return bool((turns @ turns.sum(axis=0) >= 0.0).all())


def remeshed_block(block: Block, rng: np.random.Generator) -> Block:
    points, faces = remeshed(block.vertices, list(block.faces), rng)
    return Block.polyhedron(block.id, points, faces, block.density)


def with_a_vertex_more(block: Block, face: int) -> Block:
    """A convex face cut from a new vertex in its middle; all others keep their numbers."""
    loop, new = block.faces[face], len(block.vertices)
    points = np.vstack([block.vertices, block.vertices[list(loop)].mean(axis=0)])
    fan = [(new, loop[i - 1], loop[i]) for i in range(len(loop))]
    faces = [*block.faces[:face], *block.faces[face + 1 :], *fan]
    return Block.polyhedron(block.id, points, faces, block.density)
