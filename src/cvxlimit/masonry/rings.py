"""Blocks between two joints: what arches, vaults, domes and buttresses are made of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.blocks import Block

FloatArray = NDArray[np.float64]

_FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 3, 7, 4), (1, 2, 6, 5))
"""Faces of a block between two joints, whose corners are 0-3 and 4-7 in the same order."""


def between(id: str, first: FloatArray, second: FloatArray, density: float | None = None) -> Block:
    """The block between two joints (4, 3) whose corners follow each other in the same order."""
    return Block.polyhedron(id, np.concatenate([first, second]), _FACES, density)


def radial_joints(
    angles: FloatArray,
    radius: float,
    thickness: float,
    sides: tuple[float, float],
    centre: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """Corners (n, 4, 3) of joints on radii of a circle in the plane (x, z), in order around each.

    Parameters
    ----------
    angles : (n,) array
        From +x towards +z, radians.
    radius, thickness : float
        Radius of the joints' midpoints, and their length along the radius.
    sides : (float, float)
        The joints reach from the first to the second of these, along y.
    centre : (float, float)
        Centre of the circle, x and z.
    """
    radii = radius + thickness * np.array([-0.5, 0.5, 0.5, -0.5])
    corners = np.empty((len(angles), 4, 3))
    corners[:, :, 0] = centre[0] + radii * np.cos(angles)[:, None]
    corners[:, :, 1] = np.array(sides)[[0, 0, 1, 1]]
    corners[:, :, 2] = centre[1] + radii * np.sin(angles)[:, None]
    return corners


def abutment(id: str, joint: FloatArray, angle: float, depth: float) -> Block:
    """A fixed block: the radial joint at ``angle`` pushed along its normal by ``depth``.

    Positive depths go the way of growing angles.
    """
    return between(id, joint, joint + depth * np.array([-np.sin(angle), 0.0, np.cos(angle)]))
