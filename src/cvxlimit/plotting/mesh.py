"""The faces that are drawn: all blocks, with supports cropped to the free blocks' surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import EdgeTable, area_vectors, triangulated
from cvxlimit.geometry.penetration import Body
from cvxlimit.plotting.movement import free_bounds, free_size
from cvxlimit.scene import Scene

Faces = Sequence[Sequence[int]]

SURROUNDINGS = 0.07
"""Supports are drawn as far as this fraction of the free blocks' size around them, so that a
large ground slab does not dwarf what fails."""

SMOOTH = np.cos(np.radians(12.0))
"""No line is drawn at edges where a block's surface bends by less than 12 degrees: triangles of
curved and warped faces; voussoirs and bricks bend by 45 and more."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Flat convex faces of all drawn blocks: ``points`` (p, 3) of ``point_block``, faces
    counter-clockwise seen from outside of ``face_block``. Between faces of one ``patch`` no line is
    drawn."""

    points: FloatArray
    point_block: IntArray
    faces: list[list[int]]
    face_block: IntArray
    patch: IntArray


def drawn_mesh(scene: Scene) -> Mesh:
    """Supports outside the surroundings are left out."""
    margin = np.array([[-1.0], [1.0]]) * SURROUNDINGS * free_size(scene)
    low, high = free_bounds(scene) + margin
    fixed = set(scene.supports)
    parts = [
        cropped(block, low, high)
        if block.id in fixed and block.is_convex
        else (block.vertices, _convex_faces(block))
        for block in scene.blocks
    ]
    points = np.concatenate([vertices for vertices, faces in parts if len(faces)])
    shown = [len(vertices) if len(faces) else 0 for vertices, faces in parts]
    offsets = np.cumsum([0, *shown]).tolist()
    faces = [
        [i + offset for i in face]
        for (_, own), offset in zip(parts, offsets[:-1], strict=True)
        for face in own
    ]
    number = np.arange(len(parts))
    face_block = np.repeat(number, [len(own) for _, own in parts])
    return Mesh(points, np.repeat(number, shown), faces, face_block, _patches(points, faces))


def shown_bounds(scene: Scene) -> FloatArray:
    """Lowest and highest coordinates (2, 3) of the free blocks, and of supports drawn whole."""
    fixed = set(scene.supports)
    whole = [b.vertices for b in scene.blocks if b.id in fixed and not b.is_convex]
    points = np.concatenate([free_bounds(scene), *whole])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def cropped(block: Block, low: FloatArray, high: FloatArray) -> tuple[FloatArray, Faces]:
    """The part of a convex block inside a box; no faces if nothing is left."""
    vertices = block.vertices
    if (vertices >= low).all() and (vertices <= high).all():
        return vertices, block.faces
    if (vertices.max(axis=0) <= low).any() or (vertices.min(axis=0) >= high).any():
        return vertices, ()
    box = manifold3d.Manifold.cube((high - low).tolist())
    left = (Body.of(block, low).manifold ^ box).to_mesh64()
    return np.asarray(left.vert_properties)[:, :3] + low, np.asarray(left.tri_verts).tolist()


def _convex_faces(block: Block) -> Faces:
    if block.is_convex or all(len(face) == 3 for face in block.faces):
        return block.faces
    triangles: list[list[int]] = triangulated(block.vertices, block.faces)[0].tolist()
    return triangles


def _patches(points: FloatArray, faces: Faces) -> IntArray:
    areas = area_vectors(points, faces)
    normals = areas / np.maximum(np.linalg.norm(areas, axis=1), 1e-300)[:, None]
    table = EdgeTable.of(faces)
    one, other = (table.face[side] for side in table.twins())
    smooth = np.einsum("ek,ek->e", normals[one], normals[other]) > SMOOTH
    graph = coo_array(
        (np.ones(smooth.sum()), (one[smooth], other[smooth])), shape=(len(faces), len(faces))
    )
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
