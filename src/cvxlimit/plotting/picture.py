"""The scene painted as an image: hidden surfaces by a depth buffer, without OpenGL or a display."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np
from numpy.typing import NDArray

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import EdgeTable, area_vectors, cross, linked, triangulated
from cvxlimit.geometry.penetration import Body
from cvxlimit.plotting.contents import Drawing
from cvxlimit.plotting.look import block_colours, rgb
from cvxlimit.plotting.movement import VISIBLE, displaced, free_bounds, free_size
from cvxlimit.scene import Scene

Pixels = NDArray[np.float32]

OVERSAMPLING = 2
"""Image pixels are means of this many by this many drawn ones: smooth edges."""

MARK_WIDTH = 3.0
"""Width of a contact's outline, in image pixels: readable where a joint opens by less."""

MARK_LIFT = 0.004
"""Contact outlines are moved towards the viewer by this fraction of the free blocks' size, to
lie on the faces that they border; a joint on the far side of a block stays hidden. Fillings of
gaps are moved as far away from the viewer, so that a face in the same plane hides them."""

LIGHT = np.array([-0.35, 0.75, 0.56])
"""Towards the light: right, up, viewer. Tops are brightest, then the left sides."""


NOTHING = -1
"""Number of the background in :attr:`Canvas.seen`."""


@dataclass(frozen=True, eq=False)
class Canvas:
    """What is seen at every pixel: ``seen`` (height, width) holds face numbers, ``nearness`` the
    distance towards the viewer."""

    seen: NDArray[np.int32]
    nearness: NDArray[np.float32]

    @classmethod
    def blank(cls, height: int, width: int) -> Canvas:
        return cls(
            np.full((height, width), NOTHING, dtype=np.int32),
            np.full((height, width), -np.inf, dtype=np.float32),
        )

    def draw(self, polygon: FloatArray, number: int) -> None:
        """Draw a convex polygon (k, 3): column, row and nearness, which varies as on the plane
        through the corners (best fit if they are not flat). Edge-on ones leave no trace."""
        corners: list[list[float]] = polygon.tolist()  # few: quicker one by one than as arrays
        x, y, _ = zip(*corners, strict=True)
        spokes = polygon[1:] - polygon[0]
        normal = cross(spokes[:-1], spokes[1:]).sum(axis=0)
        middle = polygon.mean(axis=0)
        if abs(normal[2]) < 1e-6:
            return
        height, width = self.seen.shape
        low = max(math.ceil(min(x)), 0), max(math.ceil(min(y)), 0)
        high = min(math.floor(max(x)) + 1, width), min(math.floor(max(y)) + 1, height)
        if high[0] <= low[0] or high[1] <= low[1]:
            return
        columns = np.arange(low[0], high[0])
        rows = np.arange(low[1], high[1])[:, None]
        inside = np.ones((len(rows), len(columns)), dtype=bool)
        sign = math.copysign(1.0, normal[2])
        for (x0, y0, _), (x1, y1, _) in zip(corners, [*corners[1:], corners[0]], strict=True):
            inside &= sign * (x1 - x0) * (rows - y0) >= sign * (y1 - y0) * (columns - x0)
        across, down = normal[0] / normal[2], normal[1] / normal[2]
        depth = middle[2] - across * (columns - middle[0]) - down * (rows - middle[1])
        window = np.s_[low[1] : high[1], low[0] : high[0]]
        nearest = inside & (depth > self.nearness[window])
        self.nearness[window][nearest] = depth[nearest]
        self.seen[window][nearest] = number

    def outlines(self, patch: IntArray) -> NDArray[np.bool_]:
        """Pixels where one surface (``patch`` of every face) ends; marks have no outline."""
        known = np.append(patch, NOTHING)  # the background's -1 picks the last
        is_face = self.seen < len(patch)
        seen = np.where(is_face, known[np.minimum(self.seen, len(patch))], NOTHING)
        result = np.zeros(seen.shape, dtype=bool)
        for first, second in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
            differ = (seen[first] != seen[second]) & is_face[first] & is_face[second]
            result[first] |= differ
            result[second] |= differ
        return result


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


@dataclass(frozen=True, eq=False)
class Frame:
    """Part of the projected space, from ``low`` to ``high`` (3,), that is painted, in image
    pixels."""

    low: FloatArray
    high: FloatArray
    width: int
    height: int

    @property
    def scale(self) -> float:
        return OVERSAMPLING * self.width / float(self.high[0] - self.low[0])

    def pixels(self, projected: FloatArray) -> FloatArray:
        """Column, row and nearness (n, 3) in drawn pixels. Nearness too, so that normals keep their
        direction, from the farthest point, so that single precision will do far from the origin."""
        from_corner = projected - np.array([self.low[0], self.high[1], self.low[2]])
        result: FloatArray = from_corner * np.array([1.0, -1.0, 1.0]) * self.scale
        return result - np.array([0.5, 0.5, 0.0])


@dataclass(frozen=True, eq=False)
class Picture:
    """A painted image (height, width, 4) in 0..1, its frame, and the blocks at rest behind it."""

    image: Pixels
    frame: Frame
    ghost: Canvas | None = None


def paint(
    drawing: Drawing, pixels: int = 1500, frame: Frame | None = None, ghost: Canvas | None = None
) -> Picture:
    """Blocks, marks and decals, ``pixels`` on the longer side; ``ghost`` is that of another picture
    in the same ``frame``."""
    scene, moving, camera = drawing.scene, drawing.moving, drawing.camera
    mesh = drawn_mesh(scene)
    still = camera.project(mesh.points)
    moved = camera.project(displaced(scene, moving, mesh.points, mesh.point_block))
    if frame is None:
        frame = frame_of(np.concatenate([still, moved]) if moving.moves else moved, pixels)
    size = frame.height * OVERSAMPLING, frame.width * OVERSAMPLING
    image = np.zeros((*size, 4), dtype=np.float32)
    lines = np.zeros(size, dtype=bool)
    if moving.moves:
        ghost = ghost or _draw_blocks(mesh, frame.pixels(still), frame)
        gone = (ghost.seen != NOTHING) & (moving.speed > VISIBLE)[mesh.face_block][ghost.seen]
        lines = gone & ghost.outlines(mesh.patch)
        _blend(image, gone, np.array([0.5, 0.53, 0.6]), 0.16)
        _blend(image, lines, np.array([0.3, 0.33, 0.4]), 0.45)
    points = frame.pixels(moved)
    canvas = _draw_blocks(mesh, points, frame)
    colours = drawing.colours
    if colours is None:
        colours = block_colours(scene, moving, drawing.notes.culprits)
    inks = [colours[mesh.face_block] * _shades(mesh, points)[:, None]]
    inks.append(_draw_marks(canvas, drawing, frame, len(mesh.faces)))
    inks.append(_draw_decals(canvas, drawing, frame, sum(map(len, inks))))
    _ink(image, canvas, np.concatenate(inks))
    _blend(image, canvas.outlines(mesh.patch), np.array([0.10, 0.12, 0.15]), 0.62)
    _blend(image, lines, np.array([0.15, 0.15, 0.2]), 0.14)
    return Picture(_reduced(image), frame, ghost)


def frame_of(projected: FloatArray, pixels: int) -> Frame:
    low, high = projected.min(axis=0), projected.max(axis=0)
    pad = 0.01 * (high - low)[:2].max()
    low, high = low - pad, high + pad
    extent = (high - low)[:2]
    width, height = np.ceil(pixels * extent / extent.max()).astype(int).tolist()
    high[1] = low[1] + extent[0] * height / width
    return Frame(low, high, width, height)


def _draw_blocks(mesh: Mesh, points: FloatArray, frame: Frame) -> Canvas:
    canvas = Canvas.blank(frame.height * OVERSAMPLING, frame.width * OVERSAMPLING)
    facing = np.flatnonzero(area_vectors(points, mesh.faces)[:, 2] < 0.0)
    for f in facing.tolist():
        canvas.draw(points[mesh.faces[f]], f)
    return canvas


def _shades(mesh: Mesh, points: FloatArray) -> FloatArray:
    normals = area_vectors(points, mesh.faces) * np.array([-1.0, 1.0, -1.0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    result: FloatArray = 0.80 + 0.20 * np.clip(normals @ LIGHT, 0.0, 1.0) / 0.75
    return np.minimum(result, 1.0)


def _draw_marks(canvas: Canvas, drawing: Drawing, frame: Frame, first: int) -> FloatArray:
    """Fill the gap between both sides of every marked contact's edges, and line them; returns
    colours."""
    marking, moving = drawing.marking, drawing.moving
    if marking is None:
        return np.empty((0, 3))
    c = marking.contacts
    following = np.arange(1, len(c.corner_xy) + 1)
    following[c.corner_start[1:] - 1] = c.corner_start[:-1]
    sides = []
    for block in (c.a, c.b):
        at = displaced(drawing.scene, moving, c.corner_points, block[c.corner_contact])
        points = frame.pixels(drawing.camera.project(at))
        sides.append(np.stack([points, points[following]], axis=1))
    kind = marking.kind[c.corner_contact]
    marked = np.flatnonzero(np.isin(kind, list(marking.colours)))
    width = np.ones(len(c)) if marking.width is None else marking.width
    half = 0.5 * MARK_WIDTH * OVERSAMPLING * width[c.corner_contact]
    lift = np.array([0.0, 0.0, _lift(drawing, frame)])
    for number, j in enumerate(marked.tolist(), start=first):
        a, b = sides[0][j], sides[1][j]
        canvas.draw(np.array([a[0], a[1], b[1]]) - lift, number)
        canvas.draw(np.array([a[0], b[1], b[0]]) - lift, number)
        for line in (a, b):
            canvas.draw(_ribbon(line, float(half[j])) + lift, number)
    return np.array([rgb(marking.colours[k]) for k in kind[marked].tolist()]).reshape(-1, 3)


def _draw_decals(canvas: Canvas, drawing: Drawing, frame: Frame, first: int) -> FloatArray:
    lift = np.array([0.0, 0.0, _lift(drawing, frame)])
    for number, decal in enumerate(drawing.decals, first):
        carried = np.full(len(decal.points), decal.block)
        at = displaced(drawing.scene, drawing.moving, decal.points, carried)
        canvas.draw(frame.pixels(drawing.camera.project(at)) + decal.lift * lift, number)
    return np.array([rgb(decal.colour) for decal in drawing.decals]).reshape(-1, 3)


def _lift(drawing: Drawing, frame: Frame) -> float:
    return MARK_LIFT * free_size(drawing.scene) * frame.scale


def _ribbon(line: FloatArray, half: float) -> FloatArray:
    dx, dy = line[1, :2] - line[0, :2]
    length = float(np.hypot(dx, dy)) or 1.0
    across = np.array([-dy, dx, 0.0]) * (half / length)
    return np.array([line[0] - across, line[1] - across, line[1] + across, line[0] + across])


def _ink(image: Pixels, canvas: Canvas, colours: FloatArray) -> None:
    drawn = np.flatnonzero(canvas.seen != NOTHING)
    opaque = np.ones((len(colours), 4), dtype=np.float32)
    opaque[:, :3] = colours
    image.reshape(-1, 4)[drawn] = opaque[canvas.seen.ravel()[drawn]]


def _blend(image: Pixels, where: NDArray[np.bool_], colour: FloatArray, opacity: float) -> None:
    pixels, at = image.reshape(-1, 4), np.flatnonzero(where)
    below = pixels[at]
    left = below[:, 3:] * np.float32(1.0 - opacity)
    alpha = left + np.float32(opacity)
    mixed = (colour.astype(np.float32) * np.float32(opacity) + below[:, :3] * left) / alpha
    pixels[at] = np.concatenate([mixed, alpha], axis=1)


def _reduced(image: Pixels) -> Pixels:
    image[..., :3] *= image[..., 3:]
    times = range(OVERSAMPLING)
    parts = [image[i::OVERSAMPLING, j::OVERSAMPLING] for i in times for j in times]
    total = sum(parts[1:], start=parts[0])
    alpha = total[..., 3:]
    total[..., :3] /= np.maximum(alpha, np.float32(1e-12))
    alpha /= np.float32(OVERSAMPLING**2)
    return total
