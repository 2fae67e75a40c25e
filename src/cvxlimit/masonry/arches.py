"""Circular arches of straight-sided voussoirs between radial joints, on abutments or on piers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.strengths import DEFAULT_FRICTION
from cvxlimit.masonry.sizes import ALONG, Span, count, ground_below, is_negligible, pile, scene_of
from cvxlimit.scene import Load, Scene


def arch(
    voussoirs: int = 20,
    thickness_ratio: float = 0.15,
    *,
    mean_radius: float = 1.0,
    embrace: float = 180.0,
    width: float = 0.3,
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    live: Load | None = None,
    name: str = "arch",
) -> Scene:
    """A circular arch in the plane (x, z), centred on the origin, between two fixed abutments.

    All joints are radial; between them the voussoirs' inner and outer sides are straight. Voussoirs
    are named ``v1``, ``v2`` ... from the left (-x) springing; with an even number a joint lies at
    the crown. The abutments touch the springing joints only.

    Parameters
    ----------
    voussoirs : int
        Number of free blocks.
    thickness_ratio : float
        Thickness over mean radius, below 2.
    mean_radius : float
        Radius of the joints' midpoints, m.
    embrace : float
        Angle between the two springing joints, degrees: 180 for a semicircular arch.
    width : float
        Out of the arch's plane (y), m.
    density, friction, live, name
        As for :func:`~cvxlimit.masonry.wall`. A load on the crown is
        ``Load(forces={"v10": (0, 0, -1, 0, 0, 0)})``.

    Raises
    ------
    InputError
        For sizes that are not positive, a ratio of 2 or more, an embrace angle that is not
        between 0 and 360, or voussoirs that each span 180 degrees or more.

    Notes
    -----
    With friction high enough to prevent sliding, a semicircular arch stands under its own weight
    down to a ratio of 0.107456 with 100 voussoirs (0.107432 with 40), whose weights act at their
    centroids; for the continuous arch that is 0.1075 (Milankovitch 1907), and 0.107426 where the
    weight acts on the centre line (Cocchetti & Rizzi 2020).

    Example
    -------
    >>> scene = arch(voussoirs=12, thickness_ratio=0.2, embrace=120.0)
    >>> len(scene.free), len(scene.contacts)
    (12, 13)
    """
    ring = Ring.of(count(voussoirs, "voussoirs"), mean_radius, thickness_ratio, embrace)
    weight = positive(density, "density of the arch")
    sides = (0.0, positive(width, "width"))
    joints = ring.joints(sides)
    blocks = between_all(joints, weight)
    left, right = ring.abutments(sides)
    return scene_of((left, *blocks, right), ALONG, live, friction, name)


def arch_on_piers(
    voussoirs: int = 20,
    thickness_ratio: float = 0.15,
    *,
    mean_radius: float = 1.0,
    pier_width: float = 0.4,
    pier_height: float = 1.2,
    pier_courses: int = 4,
    width: float = 0.3,
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    live: Load | None = None,
    name: str = "arch-on-piers",
) -> Scene:
    """A semicircular arch in the plane (x, z) on two piers on a fixed ground whose top is z = 0.

    Springing joints are level with the piers' tops. The piers' inner faces are flush with the
    arch's inner side, so the clear span is ``(2 - thickness_ratio) mean_radius``; the additional
    width of a pier lies behind it. Voussoirs are named ``v1``, ``v2`` ... from the left, pier
    blocks ``l1`` ... and ``r1`` ... from the bottom.

    Parameters
    ----------
    voussoirs : int
        Number of voussoirs, 2 or more.
    thickness_ratio, mean_radius
        As for :func:`~cvxlimit.masonry.arch`.
    pier_width, pier_height : float
        Along x, no less than the arch is thick, and from the ground to the springing, m.
    pier_courses : int
        Number of blocks in each pier.
    width : float
        Of arch and piers, out of the arch's plane (y), m.
    density, friction, live, name
        As for :func:`~cvxlimit.masonry.wall`.

    Raises
    ------
    InputError
        For sizes that are not positive, or piers narrower than the arch is thick.

    Example
    -------
    >>> scene = arch_on_piers(8, 0.2, pier_courses=3)
    >>> len(scene.free), len(scene.contacts)
    (14, 15)
    """
    number, radius = count(voussoirs, "voussoirs"), positive(mean_radius, "mean_radius")
    ratio = positive(thickness_ratio, "thickness_ratio")
    check_ring(number, ratio, 180.0)
    depth, broad = ratio * radius, positive(pier_width, "pier_width")
    if not is_negligible(depth - broad, depth):
        raise InputError(
            f"pier_width must be no less than the arch's thickness, {depth:g}, got {broad:g}"
        )
    high, thick = positive(pier_height, "pier_height"), positive(width, "width")
    weight = positive(density, "density of the arch")
    angles = np.linspace(np.pi, 0.0, number + 1)
    joints = radial_joints(angles, radius, depth, (0.0, thick), (0.0, high))
    ring = between_all(joints, weight)
    inner = radius - depth / 2.0
    levels = np.linspace(0.0, high, count(pier_courses, "pier_courses") + 1)
    piers = [
        block
        for prefix, x in (("l", (-inner - broad, -inner)), ("r", (inner, inner + broad)))
        for block in pile(prefix, x, (0.0, thick), levels, weight)
    ]
    ground = ground_below(piers, depth=depth)
    return scene_of((ground, *piers, *ring), ALONG, live, friction, name)


_FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 3, 7, 4), (1, 2, 6, 5))
"""Faces of a block between two joints, whose corners are 0-3 and 4-7 in the same order."""


def between(id: str, first: FloatArray, second: FloatArray, density: float | None = None) -> Block:
    """Returns the block between two faces (4, 3)."""
    return Block.polyhedron(id, np.concatenate([first, second]), _FACES, density)


def between_all(joints: FloatArray, density: float) -> list[Block]:
    """Returns the blocks ``v1``, ``v2`` ... between successive joints (n + 1, 4, 3)."""
    return [between(f"v{i}", *ends, density) for i, ends in enumerate(pairwise(joints), start=1)]


def radial_joints(
    angles: FloatArray,
    radius: float,
    thickness: float,
    sides: Span,
    centre: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """Corners (n, 4, 3) of joints at ``angles`` (n,) on a circle in the plane (x, z), from +x
    towards +z: ``radius`` of their midpoints, ``thickness`` along it, ends ``sides`` in y."""
    radii = radius + thickness * np.array([-0.5, 0.5, 0.5, -0.5])
    corners = np.empty((len(angles), 4, 3))
    corners[:, :, 0] = centre[0] + radii * np.cos(angles)[:, None]
    corners[:, :, 1] = np.array(sides)[[0, 0, 1, 1]]
    corners[:, :, 2] = centre[1] + radii * np.sin(angles)[:, None]
    return corners


def abutment(id: str, joint: FloatArray, angle: float, depth: float) -> Block:
    """Returns the block behind the radial joint at ``angle``, ``depth`` long towards larger
    angles."""
    return between(id, joint, joint + depth * np.array([-np.sin(angle), 0.0, np.cos(angle)]))


@dataclass(frozen=True, eq=False)
class Ring:
    """Joints of an arch in the plane (x, z) about the origin, ``angles`` (n + 1,) from left to
    right."""

    angles: FloatArray
    radius: float
    thickness: float

    @classmethod
    def of(cls, voussoirs: int, mean_radius: float, thickness_ratio: float, embrace: float) -> Ring:
        radius = positive(mean_radius, "mean_radius")
        ratio = positive(thickness_ratio, "thickness_ratio")
        angle = positive(embrace, "embrace")
        check_ring(voussoirs, ratio, angle)
        half = np.radians(angle) / 2.0
        angles = np.pi / 2.0 + np.linspace(half, -half, voussoirs + 1)
        return cls(angles, radius, ratio * radius)

    def joints(self, sides: Span) -> FloatArray:
        return radial_joints(self.angles, self.radius, self.thickness, sides)

    def abutments(self, sides: Span) -> tuple[Block, Block]:
        joints, depth = self.joints(sides), self.thickness
        left = abutment("left-abutment", joints[0], self.angles[0], depth)
        return left, abutment("right-abutment", joints[-1], self.angles[-1], -depth)


def check_ring(number: int, ratio: float, angle: float) -> None:
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
