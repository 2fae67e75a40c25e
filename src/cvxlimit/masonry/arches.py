"""Circular arches of straight-sided voussoirs between radial joints, on abutments or on piers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
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
    left, right = ring.abutments(sides)
    return scene_of((left, *ring.voussoirs(sides, weight), right), ALONG, live, friction, name)


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
    ring = Ring.of(count(voussoirs, "voussoirs"), mean_radius, thickness_ratio, 180.0)
    depth, broad = ring.thickness, positive(pier_width, "pier_width")
    if not is_negligible(depth - broad, depth):
        raise InputError(
            f"pier_width must be no less than the arch's thickness, {depth:g}, got {broad:g}"
        )
    high, thick = positive(pier_height, "pier_height"), positive(width, "width")
    weight = positive(density, "density of the arch")
    angles = np.linspace(np.pi, 0.0, len(ring.angles))  # exactly, so that springings are level
    ring = replace(ring, angles=angles, centre=(0.0, high))
    inner = ring.radius - depth / 2.0
    levels = np.linspace(0.0, high, count(pier_courses, "pier_courses") + 1)
    piers = [
        block
        for prefix, x in (("l", (-inner - broad, -inner)), ("r", (inner, inner + broad)))
        for block in pile(prefix, x, (0.0, thick), levels, weight)
    ]
    ground, arch = ground_below(piers, depth=depth), ring.voussoirs((0.0, thick), weight)
    return scene_of((ground, *piers, *arch), ALONG, live, friction, name)


_FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 3, 7, 4), (1, 2, 6, 5))
"""Faces of a block between two joints, whose corners are 0-3 and 4-7 in the same order."""


def between(id: str, first: FloatArray, second: FloatArray, density: float | None = None) -> Block:
    """Returns the block between two faces (4, 3)."""
    return Block.polyhedron(id, np.concatenate([first, second]), _FACES, density)


@dataclass(frozen=True, eq=False)
class Ring:
    """A ring in the plane (x, z) between radial joints at ``angles`` (n + 1,), from +x towards +z:
    ``radius`` of their midpoints, ``thickness`` along it. ``sides`` of what is made of it are its
    ends in y."""

    angles: FloatArray
    radius: float
    thickness: float
    centre: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(cls, voussoirs: int, mean_radius: float, thickness_ratio: float, embrace: float) -> Ring:
        """Equal voussoirs, from left to right; refuses sizes that make no ring."""
        radius = positive(mean_radius, "mean_radius")
        ratio = positive(thickness_ratio, "thickness_ratio")
        angle = positive(embrace, "embrace")
        if ratio >= 2.0:
            raise InputError(
                f"thickness_ratio must be below 2, got {ratio:g}: the joints would reach past the "
                "centre of the arch"
            )
        if angle >= 360.0:
            raise InputError(f"embrace must be below 360 degrees, got {angle:g}")
        if angle / voussoirs >= 180.0:
            raise InputError(
                f"voussoirs must each span less than 180 degrees, got {voussoirs} over {angle:g} "
                "degrees"
            )
        half = np.radians(angle) / 2.0
        angles = np.pi / 2.0 + np.linspace(half, -half, voussoirs + 1)
        return cls(angles, radius, ratio * radius)

    def joints(self, sides: Span) -> FloatArray:
        """Corners (n + 1, 4, 3) of all joints."""
        radii = self.radius + self.thickness * np.array([-0.5, 0.5, 0.5, -0.5])
        corners = np.empty((len(self.angles), 4, 3))
        corners[:, :, 0] = self.centre[0] + radii * np.cos(self.angles)[:, None]
        corners[:, :, 1] = np.array(sides)[[0, 0, 1, 1]]
        corners[:, :, 2] = self.centre[1] + radii * np.sin(self.angles)[:, None]
        return corners

    def voussoirs(self, sides: Span, density: float) -> list[Block]:
        """The blocks ``v1``, ``v2`` ... between successive joints."""
        ends = enumerate(pairwise(self.joints(sides)), start=1)
        return [between(f"v{i}", *both, density) for i, both in ends]

    def abutments(self, sides: Span) -> Iterator[Block]:
        """Fixed blocks behind the first joint and behind the last, as long as the ring is thick."""
        joints = self.joints(sides)
        for name, end, way in (("left", 0, 1.0), ("right", -1, -1.0)):
            angle = self.angles[end]
            back = way * self.thickness * np.array([-np.sin(angle), 0.0, np.cos(angle)])
            yield between(f"{name}-abutment", joints[end], joints[end] + back)
