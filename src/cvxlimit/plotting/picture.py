"""What is seen of a scene: faces, outlines, joints, for whatever draws them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import EdgeTable, area_vectors, linked, triangulated
from cvxlimit.geometry.overlays import union
from cvxlimit.geometry.penetration import Body
from cvxlimit.plotting.contents import Drawing
from cvxlimit.plotting.look import block_colours, rgb
from cvxlimit.plotting.visible import Faces, outlines, rings
from cvxlimit.results.movement import displaced, free_bounds, free_size
from cvxlimit.scene import Scene
from cvxlimit.solution.kinematics import VISIBLE

MARK_WIDTH = 1.8
"""Width of the widest contact's outline in points: readable where a joint opens by less."""

MARK_LIFT = 0.004
"""Contact outlines are moved towards the viewer by this fraction of the free blocks' size, to
lie on the faces that they border; a joint on the far side of a block stays hidden. Fillings of
gaps are moved as far away from the viewer, so that a face in the same plane hides them."""

LIGHT = np.array([-0.35, 0.75, 0.56])
"""Towards the light: right, up, viewer. Tops are brightest, then the left sides."""

FaceList = Sequence[Sequence[int]]

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


def cropped(block: Block, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FaceList]:
    vertices = block.vertices
    if (vertices >= low).all() and (vertices <= high).all():
        return vertices, block.faces
    if (vertices.max(axis=0) <= low).any() or (vertices.min(axis=0) >= high).any():
        return vertices, ()
    box = manifold3d.Manifold.cube((high - low).tolist())
    left = (Body.of(block, low).manifold ^ box).to_mesh64()
    return np.asarray(left.vert_properties)[:, :3] + low, np.asarray(left.tri_verts).tolist()


def _convex_faces(block: Block) -> FaceList:
    if block.is_convex or all(len(face) == 3 for face in block.faces):
        return block.faces
    triangles: list[list[int]] = triangulated(block.vertices, block.faces)[0].tolist()
    return triangles


def _patches(points: FloatArray, faces: FaceList) -> IntArray:
    areas = area_vectors(points, faces)
    normals = areas / np.maximum(np.linalg.norm(areas, axis=1), 1e-300)[:, None]
    table = EdgeTable.of(faces)
    one, other = (table.face[side] for side in table.twins())
    smooth = np.einsum("ek,ek->e", normals[one], normals[other]) > SMOOTH
    return linked(len(faces), one[smooth], other[smooth])


@dataclass(frozen=True, eq=False)
class Fill:
    """A region of one colour, by its closed outlines (k, 2); holes run with the clock."""

    rings: Sequence[FloatArray]
    colour: FloatArray


@dataclass(frozen=True, eq=False)
class Seen:
    """Parts of a picture in the order in which they are drawn, to the scene's scale.

    ``ghost`` and ``ghost_lines`` are blocks at rest behind those that have moved, ``lines`` the
    outlines of all faces, ``marks`` (p, 2, 2) those of joints, ``widths`` (p,) in points.
    """

    ghost: Fill
    ghost_lines: Sequence[FloatArray]
    fills: Sequence[Fill]
    lines: Sequence[FloatArray]
    marks: FloatArray
    widths: FloatArray
    colours: FloatArray
    bounds: FloatArray


def seen(drawing: Drawing) -> Seen:
    """Hidden parts are left out; the bounds hold the blocks at rest too."""
    scene, moving, camera = drawing.scene, drawing.moving, drawing.camera
    mesh = drawn_mesh(scene)
    still = camera.project(mesh.points)
    moved = camera.project(displaced(scene, moving, mesh.points, mesh.point_block))
    ghost, ghost_lines = _ghost(drawing, mesh, still)
    colours = drawing.colours
    if colours is None:
        colours = block_colours(scene, moving, drawing.notes.culprits)
    front, solid = _facing(mesh, moved)
    extent = np.concatenate([still, moved] if moving.moves else [moved])[:, :2]
    opaque = np.ones(len(front), dtype=bool)
    lines = outlines(solid.visible(), mesh.patch[front], solid.grid) if drawing.glass else None
    if drawing.glass:
        opaque = ~np.isin(mesh.face_block[front], scene.free)
    shades = _shades(mesh, moved)[front]
    inks = [colours[mesh.face_block[front]][opaque] * shades[opaque, None]]
    corners = [solid.corners[i] for i in np.flatnonzero(opaque).tolist()]
    marks = _marks(drawing)
    for shapes, ink in (marks.fills, _decals(drawing)):
        corners += shapes
        inks.append(np.array(ink).reshape(-1, 3))
    everything = Faces(corners)
    regions = everything.visible()
    if lines is None:
        lines = outlines(regions[: len(front)], mesh.patch[front], everything.grid)
    fills = [
        Fill(own, ink)
        for own, ink in zip(map(rings, regions), np.concatenate(inks), strict=True)
        if own
    ]
    segments, number = everything.visible_lines(marks.ends, MARK_LIFT * free_size(scene))
    bounds = np.stack([extent.min(axis=0), extent.max(axis=0)])
    return Seen(
        ghost, ghost_lines, fills, lines, segments, marks.widths[number], marks.colours[number],
        bounds,
    )  # fmt: skip


def _ghost(drawing: Drawing, mesh: Mesh, still: FloatArray) -> tuple[Fill, list[FloatArray]]:
    """Blocks that move, at rest: the region they take, and their outlines."""
    paper = np.array([0.92, 0.925, 0.936])
    if not drawing.moving.moves:
        return Fill((), paper), []
    front, faces = _facing(mesh, still)
    gone = (drawing.moving.speed > VISIBLE)[mesh.face_block[front]]
    regions = faces.visible()[gone]
    whole = rings(union(regions, faces.grid))
    return Fill(whole, paper), outlines(regions, mesh.patch[front][gone], faces.grid)


def _facing(mesh: Mesh, points: FloatArray) -> tuple[IntArray, Faces]:
    front = np.flatnonzero(area_vectors(points, mesh.faces)[:, 2] > 0.0)
    return front, Faces([points[mesh.faces[f]] for f in front.tolist()])


def _shades(mesh: Mesh, points: FloatArray) -> FloatArray:
    normals = area_vectors(points, mesh.faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    result: FloatArray = 0.80 + 0.20 * np.clip(normals @ LIGHT, 0.0, 1.0) / 0.75
    return np.minimum(result, 1.0)


@dataclass(frozen=True, eq=False)
class _Marks:
    """Lines (m, 2, 3) along both sides of marked contacts, and what fills the gap between them."""

    ends: FloatArray
    widths: FloatArray
    colours: FloatArray
    fills: tuple[list[FloatArray], list[FloatArray]]


def _marks(drawing: Drawing) -> _Marks:
    marking, moving = drawing.marking, drawing.moving
    if marking is None:
        return _Marks(np.empty((0, 2, 3)), np.empty(0), np.empty((0, 3)), ([], []))
    c = marking.contacts
    following = np.arange(1, len(c.corner_xy) + 1)
    following[c.corner_start[1:] - 1] = c.corner_start[:-1]
    kind = marking.kind[c.corner_contact]
    chosen = np.flatnonzero(np.isin(kind, list(marking.colours)))
    sides = []
    for block in (c.a, c.b):
        at = displaced(drawing.scene, moving, c.corner_points, block[c.corner_contact])
        points = drawing.camera.project(at)
        sides.append(np.stack([points, points[following]], axis=1)[chosen])
    colours = np.array([rgb(marking.colours[k]) for k in kind[chosen].tolist()]).reshape(-1, 3)
    width = np.ones(len(c)) if marking.width is None else marking.width
    widths = MARK_WIDTH * width[c.corner_contact][chosen]
    back = np.array([0.0, 0.0, MARK_LIFT * free_size(drawing.scene)])
    gaps, inks = list[FloatArray](), list[FloatArray]()
    if moving.moves:
        for a, b, ink in zip(*sides, colours, strict=True):
            gaps += [np.array([a[0], a[1], b[1]]) - back, np.array([a[0], b[1], b[0]]) - back]
            inks += [ink, ink]
    return _Marks(np.concatenate(sides), np.tile(widths, 2), np.tile(colours, (2, 1)), (gaps, inks))


def _decals(drawing: Drawing) -> tuple[list[FloatArray], list[FloatArray]]:
    lift = np.array([0.0, 0.0, MARK_LIFT * free_size(drawing.scene)])
    shapes, inks = [], []
    for decal in drawing.decals:
        carried = np.full(len(decal.points), decal.block)
        at = displaced(drawing.scene, drawing.moving, decal.points, carried)
        shapes.append(drawing.camera.project(at) + decal.lift * lift)
        inks.append(rgb(decal.colour))
    return shapes, inks
