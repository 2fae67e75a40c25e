"""Circular arches of straight-sided voussoirs between radial joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry.sizes import count, positive
from cvxlimit.scene import Load, Scene

FloatArray = NDArray[np.float64]

_FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 3, 7, 4), (1, 2, 6, 5))
"""Faces of a block between two joints, whose corners are 0-3 and 4-7 in the same order."""


def arch(
    voussoirs: int = 20,
    thickness_ratio: float = 0.15,
    *,
    mean_radius: float = 1.0,
    embrace: float = 180.0,
    width: float = 0.3,
    density: float = 20.0,
    friction: float = 0.7,
    live: Load | None = None,
    name: str = "arch",
) -> Scene:
    """A circular arch in the plane (x, z), centred on the origin, between two fixed abutments.

    All joints are radial and reach from ``mean_radius - thickness/2`` to ``mean_radius +
    thickness/2``; between them the voussoirs' inner and outer sides are straight. Voussoirs are
    named ``v1``, ``v2`` ... from the left (-x) springing to the right one. With an even number a
    joint lies at the crown. The abutments touch the springing joints only.

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
    density : float
        Weight per volume, kN/m3.
    friction : float
        Coulomb coefficient of all joints.
    live : Load, optional
        Horizontal, along +x, in multiples of the weight, unless given. A load on the crown is
        ``Load(forces={"v10": (0, 0, -1, 0, 0, 0)})``.
    name : str
        Name of the scene.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        For sizes that are not positive, a ratio of 2 or more, an embrace angle that is not
        between 0 and 360, or voussoirs that each span 180 degrees or more.

    Notes
    -----
    Own weight alone, with friction high enough to prevent sliding, leaves a semicircular arch
    standing down to a ratio of 0.107456 with 100 voussoirs (0.107432 with 40); the continuous
    arch has 0.107426 (Cocchetti & Rizzi 2020).

    Example
    -------
    >>> scene = arch(voussoirs=12, thickness_ratio=0.2, embrace=120.0)
    >>> len(scene.free), len(scene.contacts)
    (12, 13)
    """
    number = count(voussoirs, "voussoirs")
    radius, ratio = (
        positive(mean_radius, "mean_radius"),
        positive(thickness_ratio, "thickness_ratio"),
    )
    angle = positive(embrace, "embrace")
    _check_shape(number, ratio, angle)
    half = np.radians(angle) / 2.0
    angles = np.pi / 2.0 + np.linspace(half, -half, number + 1)
    joints = _joints(angles, radius, ratio * radius, positive(width, "width"))
    weight = positive(density, "density of the arch")
    blocks = [
        Block.polyhedron(f"v{i + 1}", np.concatenate(joints[i : i + 2]), _FACES, weight)
        for i in range(number)
    ]
    left = _abutment("left-abutment", joints[0], angles[0], ratio * radius)
    right = _abutment("right-abutment", joints[-1], angles[-1], -ratio * radius)
    return Scene(
        blocks=(left, *blocks, right),
        supports=(left.id, right.id),
        live=Load(acceleration=(1.0, 0.0, 0.0)) if live is None else live,
        friction=friction,
        name=name,
    )


def _check_shape(number: int, ratio: float, angle: float) -> None:
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


def _joints(angles: FloatArray, radius: float, thickness: float, width: float) -> FloatArray:
    """Corners (n, 4, 3) of the radial joints, in order around each of them."""
    radii = radius + thickness * np.array([-0.5, 0.5, 0.5, -0.5])
    corners = np.empty((len(angles), 4, 3))
    corners[:, :, 0] = radii * np.cos(angles)[:, None]
    corners[:, :, 1] = width * np.array([0.0, 0.0, 1.0, 1.0])
    corners[:, :, 2] = radii * np.sin(angles)[:, None]
    return corners


def _abutment(id: str, joint: FloatArray, angle: float, depth: float) -> Block:
    """The springing joint pushed out of the arch by ``depth`` along its normal."""
    outward = depth * np.array([-np.sin(angle), 0.0, np.cos(angle)])
    return Block.polyhedron(id, np.concatenate([joint, joint + outward]), _FACES)
