"""The faces that are drawn: all blocks, with supports cropped to the free blocks' surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.triangles import triangulated
from cvxlimit.plotting.movement import free_bounds, free_size
from cvxlimit.scene import Scene

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SURROUNDINGS = 0.07
"""Supports are drawn as far as this fraction of the free blocks' size around them, so that a
large ground slab does not dwarf what fails."""

SMOOTH = np.cos(np.radians(12.0))
"""No line is drawn at edges where a block's surface bends by less than 12 degrees: triangles of
curved and warped faces; voussoirs and bricks bend by 45 and more."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Flat convex faces of all drawn blocks.

    ``points`` (p, 3) belong to ``point_block`` (p,); face f has the points
    ``corners[face_start[f]:face_start[f + 1]]``, counter-clockwise seen from outside, and
    belongs to ``face_block[f]``. Between faces with the same ``patch[f]`` no line is drawn: they
    are parts of one surface, flat or bent by less than :data:`SMOOTH`.
    """

    points: FloatArray
    point_block: IntArray
    corners: IntArray
    face_start: IntArray
    face_block: IntArray
    patch: IntArray


def drawn_mesh(scene: Scene) -> Mesh:
    """The mesh of ``scene``; supports outside the surroundings are left out."""
    low, high = free_bounds(scene)
    margin = SURROUNDINGS * free_size(scene)
    fixed = set(scene.supports)
    parts: list[tuple[int, FloatArray, Sequence[Sequence[int]]]] = []
    for i, block in enumerate(scene.blocks):
        if block.id not in fixed:
            parts.append((i, block.vertices, _convex_faces(block)))
            continue
        if not block.is_convex:
            parts.append((i, block.vertices, _convex_faces(block)))
            continue
        vertices, faces = cropped(block.vertices, block.faces, low - margin, high + margin)
        if faces:
            parts.append((i, vertices, faces))
    return _joined(parts)


def shown_bounds(scene: Scene) -> FloatArray:
    """Lowest and highest coordinates (2, 3) of the free blocks, and of supports drawn whole."""
    fixed = set(scene.supports)
    whole = [b.vertices for b in scene.blocks if b.id in fixed and not b.is_convex]
    points = np.concatenate([free_bounds(scene), *whole])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def cropped(
    vertices: FloatArray, faces: Sequence[Sequence[int]], low: FloatArray, high: FloatArray
) -> tuple[FloatArray, Sequence[Sequence[int]]]:
    """The part of a convex polyhedron inside a box; no faces if nothing is left."""
    if (vertices >= low).all() and (vertices <= high).all():
        return vertices, faces
    if (vertices.max(axis=0) <= low).any() or (vertices.min(axis=0) >= high).any():
        return vertices, ()
    polygons = [vertices[list(face)] for face in faces]
    for axis in range(3):
        for sign, limit in ((1.0, high[axis]), (-1.0, -low[axis])):
            polygons = _below(polygons, axis, sign, float(limit))
    if not polygons:
        return vertices, ()
    counts = np.cumsum([len(p) for p in polygons])[:-1]
    soup = np.concatenate(polygons)
    rounding = 1e-9 * float(np.ptp(soup, axis=0).max())
    _, first, number = np.unique(
        np.round(soup / rounding), axis=0, return_index=True, return_inverse=True
    )
    split = np.split(np.asarray(number).reshape(-1), counts)
    return soup[first], [face.tolist() for face in split]


def _below(polygons: list[FloatArray], axis: int, sign: float, limit: float) -> list[FloatArray]:
    """Cut closed convex faces at ``sign * x[axis] <= limit`` and close the cut with a face."""
    heights = [sign * p[:, axis] - limit for p in polygons]
    if max(h.max() for h in heights) <= 0.0:
        return polygons
    kept, rim = [], []
    for polygon, height in zip(polygons, heights, strict=True):
        following, next_height = np.roll(polygon, -1, axis=0), np.roll(height, -1)
        cut: list[FloatArray] = []
        for p, q, h, k in zip(polygon, following, height, next_height, strict=True):
            if h <= 0.0:
                cut.append(p)
            if h == 0.0:
                rim.append(p)
            if h * k < 0.0:
                cut.append(p + (q - p) * (h / (h - k)))
                rim.append(cut[-1])
        if len(cut) >= 3:
            kept.append(np.array(cut))
    if len(rim) >= 3:
        kept.append(_closing_face(np.array(rim), axis, sign))
    return kept


def _closing_face(rim: FloatArray, axis: int, sign: float) -> FloatArray:
    """Cut points ordered around the outward normal; every point was found on two faces."""
    other = [(axis + 1) % 3, (axis + 2) % 3]
    spokes = rim[:, other] - rim[:, other].mean(axis=0)
    order = np.argsort(sign * np.arctan2(spokes[:, 1], spokes[:, 0]))
    ring = rim[order]
    step = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1)
    result: FloatArray = ring[step > 1e-9 * np.ptp(ring, axis=0).max()]
    return result


def _convex_faces(block: Block) -> Sequence[Sequence[int]]:
    """The faces of a convex block; of any other one triangles that make them up."""
    if block.is_convex or all(len(face) == 3 for face in block.faces):
        return block.faces
    triangles: list[list[int]] = triangulated(block.vertices, block.faces)[0].tolist()
    return triangles


def _patches(points: FloatArray, corners: IntArray, face_start: IntArray) -> IntArray:
    """Number of the smooth surface that every face belongs to."""
    count, sides = len(face_start) - 1, np.diff(face_start)
    following = np.arange(1, len(corners) + 1)
    following[face_start[1:] - 1] = face_start[:-1]
    base = points[corners[np.repeat(face_start[:-1], sides)]]
    spokes = points[corners] - base
    areas = np.add.reduceat(np.cross(spokes, spokes[following]), face_start[:-1], axis=0)
    normals = areas / np.maximum(np.linalg.norm(areas, axis=1), 1e-300)[:, None]
    low, high = np.sort(np.stack([corners, corners[following]]), axis=0)
    order = np.lexsort((high, low))
    low, high, face = low[order], high[order], np.repeat(np.arange(count), sides)[order]
    same = (low[1:] == low[:-1]) & (high[1:] == high[:-1])
    one, other = face[:-1][same], face[1:][same]
    smooth = np.einsum("ek,ek->e", normals[one], normals[other]) > SMOOTH
    graph = coo_array((np.ones(smooth.sum()), (one[smooth], other[smooth])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _joined(parts: list[tuple[int, FloatArray, Sequence[Sequence[int]]]]) -> Mesh:
    offsets = np.cumsum([0] + [len(vertices) for _, vertices, _ in parts])
    corners = [
        np.array(face, dtype=np.int64) + offset
        for (_, _, faces), offset in zip(parts, offsets[:-1], strict=True)
        for face in faces
    ]
    points = np.concatenate([vertices for _, vertices, _ in parts])
    face_start = np.cumsum([0] + [len(c) for c in corners]).astype(np.int64)
    return Mesh(
        points=points,
        point_block=np.concatenate([np.full(len(v), i, dtype=np.int64) for i, v, _ in parts]),
        corners=np.concatenate(corners),
        face_start=face_start,
        face_block=np.array([i for i, _, faces in parts for _ in faces], dtype=np.int64),
        patch=_patches(points, np.concatenate(corners), face_start),
    )
