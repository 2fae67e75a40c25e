"""Blocks between two joints: what arches, vaults, domes and buttresses are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block

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
    """Corners (n, 4, 3), in order around each, of joints at ``angles`` (n,) on a circle in the
    plane (x, z), from +x towards +z; ``radius`` is that of their midpoints, ``thickness`` their
    length along it, ``sides`` their ends in y."""
    radii = radius + thickness * np.array([-0.5, 0.5, 0.5, -0.5])
    corners = np.empty((len(angles), 4, 3))
    corners[:, :, 0] = centre[0] + radii * np.cos(angles)[:, None]
    corners[:, :, 1] = np.array(sides)[[0, 0, 1, 1]]
    corners[:, :, 2] = centre[1] + radii * np.sin(angles)[:, None]
    return corners


def abutment(id: str, joint: FloatArray, angle: float, depth: float) -> Block:
    """A fixed block: the radial joint at ``angle`` pushed by ``depth`` towards growing angles."""
    return between(id, joint, joint + depth * np.array([-np.sin(angle), 0.0, np.cos(angle)]))


@dataclass(frozen=True, eq=False)
class Ring:
    """Joints of an arch in the plane (x, z), about the origin and symmetric to the axis z:
    ``angles`` (n + 1,) from +x towards +z, falling."""

    angles: FloatArray
    radius: float
    thickness: float

    @classmethod
    def of(cls, voussoirs: int, mean_radius: float, thickness_ratio: float, embrace: float) -> Ring:
        """Of so many voussoirs over ``embrace`` degrees; refused if it cannot be built."""
        radius, ratio = (
            positive(mean_radius, "mean_radius"), positive(thickness_ratio, "thickness_ratio"),
        )  # fmt: skip
        angle = positive(embrace, "embrace")
        check_ring(voussoirs, ratio, angle)
        half = np.radians(angle) / 2.0
        angles = np.pi / 2.0 + np.linspace(half, -half, voussoirs + 1)
        return cls(angles, radius, ratio * radius)

    def joints(self, sides: tuple[float, float]) -> FloatArray:
        return radial_joints(self.angles, self.radius, self.thickness, sides)

    def abutments(self, sides: tuple[float, float]) -> tuple[Block, Block]:
        joints, depth = self.joints(sides), self.thickness
        left = abutment("left-abutment", joints[0], self.angles[0], depth)
        return left, abutment("right-abutment", joints[-1], self.angles[-1], -depth)


def check_ring(number: int, ratio: float, angle: float) -> None:
    """Refuse a ring of ``number`` voussoirs over ``angle`` degrees that cannot be built."""
    if ratio >= 2.0:
        raise InputError(
            f"thickness_ratio must be below 2, got {ratio:g}: the joints would reach past the "
            "centre of the arch"
        )
    if angle >= 360.0:
        raise InputError(f"embrace must be below 360 degrees, got {angle:g}")
    if angle / number >= 180.0:
        raise InputError(
            f"voussoirs must each span less than 180 degrees, got {number} over {angle:g} degrees"
        )
