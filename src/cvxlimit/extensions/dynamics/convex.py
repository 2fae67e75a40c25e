"""Blocks cut into convex pieces, without filling what is hollow in them."""

from __future__ import annotations

from collections.abc import Iterable

import manifold3d
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, polygon_vectors
from cvxlimit.geometry.penetration import Body

MOST = 64
"""Pieces of a block: with more of them, every joint has more contacts than an engine takes well."""


def convex_pieces(block: Block) -> list[FloatArray]:
    """Corners (k, 3) of convex pieces that fill a block, one if it is convex itself.

    A piece with a hollow is cut along the plane of one of its faces, the one after which the hulls
    of both sides fill least of what is empty: a plane of a face at a re-entrant edge always does.

    Raises
    ------
    GeometryError
        For a block that would need more than :data:`MOST` pieces.

    Example
    -------
    An L of two boxes:

    >>> profile = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3)]
    >>> points = [(x, y, z) for y in (0, 1) for x, z in profile]
    >>> sides = [(i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i) for i in range(6)]
    >>> block = Block.polyhedron("L", points, [range(6), range(6, 12), *sides], 20.0)
    >>> len(convex_pieces(block))
    2
    """
    if block.is_convex:
        return [block.vertices]
    body = Body.of(block, block.centroid)
    allowed = RELATIVE_TOLERANCE * block.volume
    waiting, done = [*body.manifold.decompose()], list[FloatArray]()
    while waiting:
        piece = waiting.pop()
        if not piece.volume() > allowed / MOST:
            continue  # what a cut leaves of nothing
        if _filled(piece) <= allowed:
            done.append(np.asarray(piece.hull().to_mesh64().vert_properties)[:, :3])
        else:
            waiting += min((_cut(piece, *plane) for plane in _planes(piece)), key=_badness)
        if len(done) + len(waiting) > MOST:
            raise GeometryError(
                f"block {block.id!r} is not convex, and more than {MOST} convex pieces would be "
                "needed to fill it: cut it into several blocks, or give it fewer faces",
                points=block.vertices,
                blocks=(block.id,),
            )
    return [block.centroid + corners for corners in done]


def _filled(piece: manifold3d.Manifold) -> float:
    return float(piece.hull().volume() - piece.volume())


def _badness(parts: Iterable[manifold3d.Manifold]) -> tuple[float, int]:
    filled = [_filled(part) for part in parts]
    return sum(filled), len(filled)


def _cut(
    piece: manifold3d.Manifold, normal: tuple[float, ...], offset: float
) -> list[manifold3d.Manifold]:
    return [part for side in piece.split_by_plane(normal, offset) for part in side.decompose()]


def _planes(piece: manifold3d.Manifold) -> list[tuple[tuple[float, ...], float]]:
    """Planes of faces that have something of the piece on either side, each once."""
    shell = piece.to_mesh64()
    corners = np.asarray(shell.vert_properties)[:, :3]
    triangles = corners[np.asarray(shell.tri_verts, dtype=np.int64)]
    vectors = polygon_vectors(triangles)
    area = np.linalg.norm(vectors, axis=1)
    kept = area > RELATIVE_TOLERANCE * area.max()
    normals = vectors[kept] / area[kept, None]
    offsets = np.einsum("tk,tk->t", normals, triangles[kept].mean(axis=1))
    above = (normals @ corners.T - offsets[:, None]).max(axis=1)
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    found = np.column_stack([normals, offsets / size])[above > RELATIVE_TOLERANCE * size]
    _, first = np.unique(found.round(6), axis=0, return_index=True)
    return [(tuple(row[:3].tolist()), float(row[3] * size)) for row in found[np.sort(first)]]
