"""The faces that are drawn: all blocks, with supports cropped to the free blocks' surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import EdgeTable, area_vectors, linked, triangulated
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
    """Flat convex faces of all drawn blocks, counter-clockwise seen from outside. Between faces of
    one ``patch`` no line is drawn."""

    points: FloatArray
    point_block: IntArray
    faces: list[list[int]]
    face_block: IntArray
    patch: IntArray


def drawn_mesh(scene: Scene) -> Mesh:
    margin = np.array([[-1.0], [1.0]]) * SURROUNDINGS * free_size(scene)
    low, high = free_bounds(scene) + margin
    fixed = set(scene.supports)
    vertices: list[FloatArray] = []
    point_block: list[int] = []
    faces: list[list[int]] = []
    face_block: list[int] = []
    for number, block in enumerate(scene.blocks):
        corners, own = block.vertices, _convex_faces(block)
        if block.id in fixed and block.is_convex:
            corners, own = cropped(block, low, high)
        if len(own):
            faces += [[i + len(point_block) for i in face] for face in own]
            face_block += [number] * len(own)
            vertices.append(corners)
            point_block += [number] * len(corners)
    points = np.concatenate(vertices)
    owners = np.array(point_block), np.array(face_block)
    return Mesh(points, owners[0], faces, owners[1], _patches(points, faces))


def shown_bounds(scene: Scene) -> FloatArray:
    fixed = set(scene.supports)
    whole = [b.vertices for b in scene.blocks if b.id in fixed and not b.is_convex]
    points = np.concatenate([free_bounds(scene), *whole])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def cropped(block: Block, low: FloatArray, high: FloatArray) -> tuple[FloatArray, Faces]:
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
    return linked(len(faces), one[smooth], other[smooth])
