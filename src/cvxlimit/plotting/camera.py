"""Where to look from: a parallel projection that shows the mechanism."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector
from cvxlimit.errors import InputError
from cvxlimit.results.movement import Motion, free_bounds
from cvxlimit.scene import Scene

ELEVATION = 20.0
IN_PLANE_AZIMUTH = 28.0
OUT_OF_PLANE_AZIMUTH = 50.0
"""Degrees. A wall that fails in its plane is seen almost from the front, one that falls out of
its plane more from the side, so that the movement is not along the line of sight."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Rows of ``axes`` (3, 3): right and up on the picture, and towards the viewer."""

    axes: FloatArray

    def project(self, points: FloatArray) -> FloatArray:
        """Points (p, 3) as seen: right, up and nearness to the viewer, (p, 3)."""
        return np.asarray(points @ self.axes.T)


def camera_from(scene: Scene, viewer: ArrayLike) -> Camera:
    towards = finite_vector(viewer, 3, "viewer")
    if not np.any(towards):
        raise InputError("viewer must be a direction from the scene, got zero")
    return _camera_towards(towards, upright(scene))


def _camera_towards(viewer: FloatArray, up: FloatArray) -> Camera:
    towards = viewer / np.linalg.norm(viewer)
    right = np.cross(up, towards)
    if np.linalg.norm(right) < 1e-6:
        right = np.roll(np.abs(up), 1)
    right /= np.linalg.norm(right)
    return Camera(np.stack([right, np.cross(towards, right), towards]))


def default_camera(scene: Scene, motion: Motion) -> Camera:
    """Look at the widest upright side, from the end to which the structure moves, or is pushed."""
    up = upright(scene)
    thin, wide = _horizontal_axes(scene, up)
    move = motion.rates[:, :3].sum(axis=0)
    if not move.any():
        move = scene.live_forces[:, :3].sum(axis=0)
    across, along = float(move @ thin), float(move @ wide)
    azimuth = IN_PLANE_AZIMUTH
    if abs(across) > abs(along):
        azimuth = OUT_OF_PLANE_AZIMUTH
        front = thin if across >= 0.0 else -thin
        side = np.cross(up, front)
        side = side if along > 1e-6 * abs(across) or along == 0.0 else -side
    else:
        side = wide if along >= 0.0 else -wide
        front = np.cross(side, up)
    a, e = np.radians(azimuth), np.radians(ELEVATION)
    level = np.cos(a) * front + np.sin(a) * side
    return _camera_towards(np.cos(e) * level + np.sin(e) * up, up)


def upright(scene: Scene) -> FloatArray:
    """The coordinate axis (3,) nearest to the direction against gravity, or +z if the scene has no
    weight. Where the dead load states gravity, that counts rather than its forces, so that forces
    which lift blocks do not turn the picture upside down."""
    given = scene.dead.gravity
    down = scene.dead_forces[:, :3].sum(axis=0) if given is None else np.array(given)
    size = float(np.linalg.norm(down))
    if given is None and not size > 1e-9 * max(scene.total_weight, 1e-300):
        return np.array([0.0, 0.0, 1.0])
    result: FloatArray = -down / size
    axis = int(np.abs(result).argmax())
    return np.eye(3)[axis] * np.sign(result[axis])


def thin_axis(scene: Scene) -> FloatArray:
    """The horizontal coordinate axis (3,) along which the structure is shortest."""
    return _horizontal_axes(scene, upright(scene))[0]


def _horizontal_axes(scene: Scene, up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The two horizontal axes: along the short and along the long side of the structure."""
    extent = np.ptp(free_bounds(scene), axis=0)
    level = [axis for axis in range(3) if not up[axis]]
    thin, wide = sorted(level, key=lambda axis: float(extent[axis]))
    return np.eye(3)[thin], np.eye(3)[wide]
