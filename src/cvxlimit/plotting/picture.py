"""The scene painted as an image: ghost of the undeformed blocks, deformed blocks, contact marks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvxlimit.plotting.annotations import Decal, Marking
from cvxlimit.plotting.camera import Camera
from cvxlimit.plotting.look import block_colours, rgb
from cvxlimit.plotting.mesh import Mesh, drawn_mesh
from cvxlimit.plotting.movement import VISIBLE, Motion, free_size, velocity_of
from cvxlimit.plotting.raster import NOTHING, Canvas
from cvxlimit.scene import Scene

FloatArray = NDArray[np.float64]
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


@dataclass(frozen=True, eq=False)
class Frame:
    """Part of the projected space that is painted, and its size in image pixels.

    ``low`` and ``high`` (3,) bound it to the right, upwards and towards the viewer.
    """

    low: FloatArray
    high: FloatArray
    width: int
    height: int

    def pixels(self, projected: FloatArray, times: int) -> FloatArray:
        """Column, row and nearness (n, 3) of projected points, at ``times`` the resolution.

        Nearness is in pixels too, so that normals keep their direction, and is counted from
        the farthest point, so that single precision will do however far away the origin is.
        """
        scale = times * self.width / (self.high[0] - self.low[0])
        result: FloatArray = np.stack(
            [
                (projected[:, 0] - self.low[0]) * scale - 0.5,
                (self.high[1] - projected[:, 1]) * scale - 0.5,
                (projected[:, 2] - self.low[2]) * scale,
            ],
            axis=1,
        )
        return result


@dataclass(frozen=True, eq=False)
class Picture:
    """A painted scene: ``image`` (height, width, 4) with values 0..1, its frame, and the blocks
    at rest behind those that move."""

    image: Pixels
    frame: Frame
    ghost: Canvas | None = None


def paint(
    scene: Scene,
    motion: Motion,
    camera: Camera,
    pixels: int = 1500,
    marking: Marking | None = None,
    culprits: frozenset[str] = frozenset(),
    colours: FloatArray | None = None,
    decals: Sequence[Decal] = (),
    frame: Frame | None = None,
    ghost: Canvas | None = None,
) -> Picture:
    """Paint ``scene`` in its mechanism; the longer side of the image has ``pixels`` pixels.

    ``marking`` says which contacts are outlined; None outlines nothing. Blocks that are
    ``culprits`` are red. ``colours`` (n_blocks, 3) replace those of the blocks, ``frame`` that
    which holds what is painted, and ``ghost`` is that of another picture in the same frame.
    """
    mesh = drawn_mesh(scene)
    still = camera.project(mesh.points)
    shift = motion.scale * velocity_of(scene, motion.rates, mesh.points, mesh.point_block)
    moved = camera.project(mesh.points + shift)
    marks = None if marking is None else _marks(scene, motion, camera, marking)
    if frame is None:
        frame = frame_of(np.concatenate([still, moved]) if motion.moves else moved, pixels)
    size = frame.height * OVERSAMPLING, frame.width * OVERSAMPLING
    image = np.zeros((*size, 4), dtype=np.float32)
    if motion.moves:
        ghost = ghost or _draw_blocks(mesh, frame.pixels(still, OVERSAMPLING), frame)
        _blend(image, _ghost_shape(ghost, motion, mesh), np.array([0.5, 0.53, 0.6]), 0.16)
        _blend(image, _ghost_lines(ghost, motion, mesh), np.array([0.3, 0.33, 0.4]), 0.45)
    points = frame.pixels(moved, OVERSAMPLING)
    canvas = _draw_blocks(mesh, points, frame)
    own = block_colours(scene, motion, culprits) if colours is None else colours
    inks = [own[mesh.face_block] * _shades(mesh, points)[:, None]]
    lift = MARK_LIFT * free_size(scene)
    if marks is not None and marking is not None:
        _draw_marks(canvas, marks, frame, len(mesh.face_block), lift)
        kinds = [rgb(marking.colours[k]) for k in marks.kind.tolist()]
        inks.append(np.array(kinds).reshape(-1, 3))
    first = sum(len(ink) for ink in inks)
    for number, decal in enumerate(decals, first):
        carried = np.full(len(decal.points), decal.block)
        at = decal.points + motion.scale * velocity_of(scene, motion.rates, decal.points, carried)
        raised = camera.project(at) + np.array([0.0, 0.0, decal.lift * lift])
        canvas.draw(frame.pixels(raised, OVERSAMPLING), number)
    inks.append(np.array([rgb(decal.colour) for decal in decals]).reshape(-1, 3))
    _ink(image, canvas, np.concatenate(inks), mesh)
    if motion.moves and ghost is not None:
        _blend(image, _ghost_lines(ghost, motion, mesh), np.array([0.15, 0.15, 0.2]), 0.14)
    return Picture(_reduced(image), frame, ghost)


@dataclass(frozen=True, eq=False)
class _Marks:
    """Edges of the contacts that move: ends (n, 2 sides, 2 ends, 3) projected, kind (n,), and
    width (n,) as a share of :data:`MARK_WIDTH`."""

    ends: FloatArray
    kind: NDArray[np.int64]
    width: FloatArray


def _marks(scene: Scene, motion: Motion, camera: Camera, marking: Marking) -> _Marks:
    c = marking.contacts
    sides = [
        camera.project(
            c.corner_points
            + motion.scale
            * velocity_of(scene, motion.rates, c.corner_points, block[c.corner_contact])
        )
        for block in (c.a, c.b)
    ]
    following = np.arange(1, len(c.corner_xy) + 1)
    following[c.corner_start[1:] - 1] = c.corner_start[:-1]
    ends = np.stack([np.stack([s, s[following]], axis=1) for s in sides], axis=1)
    kind = marking.kind[c.corner_contact]
    marked = np.isin(kind, list(marking.colours))
    width = np.ones(len(c)) if marking.width is None else marking.width
    return _Marks(ends[marked], kind[marked], width[c.corner_contact][marked])


def frame_of(projected: FloatArray, pixels: int) -> Frame:
    """The frame around projected points (n, 3); its longer side has ``pixels`` pixels."""
    low, high = projected.min(axis=0), projected.max(axis=0)
    pad = 0.01 * (high - low)[:2].max()
    low, high = low - pad, high + pad
    extent = (high - low)[:2]
    width, height = np.ceil(pixels * extent / extent.max()).astype(int).tolist()
    high[1] = low[1] + extent[0] * height / width
    return Frame(low, high, width, height)


def _draw_blocks(mesh: Mesh, points: FloatArray, frame: Frame) -> Canvas:
    """Faces that look at the viewer; rows count downwards, so these turn clockwise."""
    canvas = Canvas.blank(frame.height * OVERSAMPLING, frame.width * OVERSAMPLING)
    facing = np.flatnonzero(_normals(mesh, points)[:, 2] < 0.0)
    for f in facing.tolist():
        canvas.draw(points[mesh.corners[mesh.face_start[f] : mesh.face_start[f + 1]]], f)
    return canvas


def _normals(mesh: Mesh, points: FloatArray) -> FloatArray:
    """Area vectors (f, 3) of the faces in pixel space."""
    corner = points[mesh.corners]
    start = mesh.face_start[:-1]
    spokes = corner - np.repeat(corner[start], np.diff(mesh.face_start), axis=0)
    following = np.arange(1, len(corner) + 1)
    following[mesh.face_start[1:] - 1] = start
    result: FloatArray = np.add.reduceat(np.cross(spokes, spokes[following]), start, axis=0)
    return result


def _shades(mesh: Mesh, points: FloatArray) -> FloatArray:
    """Brightness (f,) under :data:`LIGHT`."""
    normals = _normals(mesh, points) * np.array([-1.0, 1.0, -1.0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    result: FloatArray = 0.80 + 0.20 * np.clip(normals @ LIGHT, 0.0, 1.0) / 0.75
    return np.minimum(result, 1.0)


def _draw_marks(canvas: Canvas, marks: _Marks, frame: Frame, first: int, lift: float) -> None:
    """Fill the gap between the two sides of every contact edge, and line both sides."""
    points = frame.pixels(marks.ends.reshape(-1, 3), OVERSAMPLING).reshape(-1, 2, 2, 3)
    raised = lift * OVERSAMPLING * frame.width / (frame.high[0] - frame.low[0])
    half = 0.5 * MARK_WIDTH * OVERSAMPLING * marks.width
    sunk = np.array([0.0, 0.0, raised])
    for number, (a, b) in enumerate(points, start=first):
        canvas.draw(np.array([a[0], a[1], b[1]]) - sunk, number)
        canvas.draw(np.array([a[0], b[1], b[0]]) - sunk, number)
        for line in (a, b):
            canvas.draw(_ribbon(line, float(half[number - first]), raised), number)


def _ribbon(line: FloatArray, half: float, raised: float) -> FloatArray:
    """A line (2, 3) as a strip (4, 3) of the given half width, moved towards the viewer."""
    dx, dy = line[1, :2] - line[0, :2]
    length = float(np.hypot(dx, dy)) or 1.0
    across = np.array([-dy, dx, 0.0]) * (half / length)
    lift = np.array([0.0, 0.0, raised])
    return np.array([line[0] - across, line[1] - across, line[1] + across, line[0] + across]) + lift


def _ink(image: Pixels, canvas: Canvas, colours: FloatArray, mesh: Mesh) -> None:
    drawn = np.flatnonzero(canvas.seen != NOTHING)
    opaque = np.ones((len(colours), 4), dtype=np.float32)
    opaque[:, :3] = colours
    image.reshape(-1, 4)[drawn] = opaque[canvas.seen.ravel()[drawn]]
    _blend(image, canvas.outlines(mesh.patch), np.array([0.10, 0.12, 0.15]), 0.62)


def _ghost_shape(ghost: Canvas, motion: Motion, mesh: Mesh) -> NDArray[np.bool_]:
    """Pixels where a moving block was."""
    moves: NDArray[np.bool_] = motion.speed[mesh.face_block] > VISIBLE
    return (ghost.seen != NOTHING) & moves[ghost.seen]


def _ghost_lines(ghost: Canvas, motion: Motion, mesh: Mesh) -> NDArray[np.bool_]:
    return _ghost_shape(ghost, motion, mesh) & ghost.outlines(mesh.patch)


def _blend(image: Pixels, where: NDArray[np.bool_], colour: FloatArray, opacity: float) -> None:
    """Paint ``colour`` over some pixels of an image with straight alpha."""
    pixels, at = image.reshape(-1, 4), np.flatnonzero(where)
    below = pixels[at]
    left = below[:, 3:] * np.float32(1.0 - opacity)
    alpha = left + np.float32(opacity)
    mixed = (colour.astype(np.float32) * np.float32(opacity) + below[:, :3] * left) / alpha
    pixels[at] = np.concatenate([mixed, alpha], axis=1)


def _reduced(image: Pixels) -> Pixels:
    """Means of the oversampled pixels, weighted by opacity."""
    image[..., :3] *= image[..., 3:]
    times = range(OVERSAMPLING)
    parts = [image[i::OVERSAMPLING, j::OVERSAMPLING] for i in times for j in times]
    total = sum(parts[1:], start=parts[0])
    alpha = total[..., 3:]
    total[..., :3] /= np.maximum(alpha, np.float32(1e-12))
    alpha /= np.float32(OVERSAMPLING**2)
    return total
