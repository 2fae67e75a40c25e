"""Vaults of flat-sided voussoirs: barrel vaults and domes."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import not_negative, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.strengths import DEFAULT_FRICTION
from cvxlimit.masonry.arches import Ring, between
from cvxlimit.masonry.sizes import ALONG, Span, count, scene_of
from cvxlimit.masonry.walls import running_bond
from cvxlimit.scene import Load, Scene


def barrel_vault(
    rows: int = 12,
    thickness_ratio: float = 0.15,
    *,
    mean_radius: float = 1.0,
    embrace: float = 180.0,
    length: float = 1.2,
    units: int = 3,
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    live: Load | None = None,
    name: str = "barrel-vault",
) -> Scene:
    """A circular vault along y, laid in running bond on two fixed abutments.

    Its cross-section is that of :func:`~cvxlimit.masonry.arch`: bed joints are radial, voussoirs
    straight between them, and a load that does not vary along y is carried as by an arch. Blocks
    are named ``v<row>.<place>``, rows from the left (-x) springing, places along y, both from 1.

    Parameters
    ----------
    rows : int
        Voussoirs around the arch; with an even number a joint lies at the crown.
    thickness_ratio, mean_radius, embrace
        As for :func:`~cvxlimit.masonry.arch`.
    length : float
        Along y, m.
    units : int
        Voussoirs along the length; every other row has half ones at both ends.
    density, friction, live, name
        As for :func:`~cvxlimit.masonry.wall`.

    Raises
    ------
    InputError
        For sizes and counts that are not positive, a ratio of 2 or more, an embrace angle that is
        not between 0 and 360, or voussoirs that each span 180 degrees or more.

    Example
    -------
    >>> scene = barrel_vault(4, units=2, embrace=120.0)
    >>> [scene.blocks[i].id for i in scene.free][:5]
    ['v1.1', 'v1.2', 'v2.1', 'v2.2', 'v2.3']
    """
    number = count(rows, "rows")
    ring = Ring.of(number, mean_radius, thickness_ratio, embrace)
    far, along = positive(length, "length"), count(units, "units")
    weight = positive(density, "density of the vault")
    voussoirs = []
    for row, lengths in enumerate(running_bond(along, number)):
        ends = np.concatenate([[0.0], np.cumsum(lengths)]) * far / along
        for place, sides in enumerate(pairwise(ends), start=1):
            below, above = ring.joints(sides)[row : row + 2]
            voussoirs.append(between(f"v{row + 1}.{place}", below, above, weight))
    left, right = ring.abutments((0.0, far))
    return scene_of((left, *voussoirs, right), ALONG, live, friction, name)


def dome(
    lunes: int = 12,
    courses: int = 8,
    thickness_ratio: float = 0.12,
    *,
    mean_radius: float = 1.0,
    springing: float = 0.0,
    oculus: float = 10.0,
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    live: Load | None = None,
    name: str = "dome",
) -> Scene:
    """A spherical dome of flat-sided blocks on a fixed ring, open at the crown.

    All corners lie on two spheres about the origin, on vertical planes through the axis z and at
    equal steps of latitude. The bed joint at a latitude, a cone in a round dome, is a flat
    trapezoid between two such planes; so are the inner and outer sides: every block is a convex
    hexahedron. Meridional joints run through, as in Heyman's lunes. Blocks are named
    ``d<course>.<lune>``, courses from the bottom, lunes from +x towards +y, both from 1; the
    fixed ring's blocks ``ring<lune>``.

    Parameters
    ----------
    lunes, courses : int
        Blocks in each course, 3 or more; number of courses.
    thickness_ratio : float
        Thickness over mean radius, below 2; measured in the meridional planes.
    mean_radius : float
        Half the sum of the two spheres' radii, m.
    springing, oculus : float
        Degrees: latitude of the lowest joint, 0 for a hemisphere, and angle between the axis and
        the edge of the opening at the crown.
    density, friction, live, name
        As for :func:`~cvxlimit.masonry.wall`.

    Raises
    ------
    InputError
        For sizes and counts that are not positive, fewer than 3 lunes, a ratio of 2 or more, or
        a springing that is negative or not below the oculus.

    Notes
    -----
    Own weight alone, with friction high enough to prevent sliding, leaves a hemisphere standing
    down to a thickness of about 0.042 of the mean radius (Heyman; 0.041 to 0.043 in the
    literature, by how the lune is cut): ``python -m benchmarks run dome``.

    Example
    -------
    >>> scene = dome(lunes=6, courses=3)
    >>> len(scene.free), len(scene.contacts)
    (18, 36)
    """
    around, high = count(lunes, "lunes", least=3), count(courses, "courses")
    ratio = positive(thickness_ratio, "thickness_ratio")
    radius = positive(mean_radius, "mean_radius")
    if ratio >= 2.0:
        raise InputError(
            f"thickness_ratio must be below 2, got {ratio:g}: the inner sphere would have no radius"
        )
    low, top = _latitudes(springing, positive(oculus, "oculus"))
    weight = positive(density, "density of the dome")
    latitudes = np.linspace(low, top, high + 1)
    below = low - (top - low) / max(high, 4)  # the ring is fixed: its depth is for the eye only
    radii = radius + ratio * radius * np.array([[-0.5], [0.5], [0.5], [-0.5]])
    ring = _course("ring", around, (below, low), radii, None)
    shell = [
        block
        for number, ends in enumerate(pairwise(latitudes.tolist()), start=1)
        for block in _course(f"d{number}.", around, ends, radii, weight)
    ]
    return scene_of((*ring, *shell), ALONG, live, friction, name)


def _latitudes(springing: float, oculus: float) -> Span:
    low, top = not_negative(springing, "springing"), 90.0 - oculus
    if low >= top:
        raise InputError(
            "springing and oculus must leave a shell between latitudes 0 and 90 degrees, got a "
            f"springing at {low:g} and an oculus of {oculus:g} from the axis"
        )
    return float(np.radians(low)), float(np.radians(top))


def _course(
    prefix: str, lunes: int, latitudes: Span, radii: FloatArray, density: float | None
) -> Iterator[Block]:
    turns = 2.0 * np.pi * np.arange(lunes + 1) / lunes
    around = np.stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)], axis=1)
    axis = np.array([0.0, 0.0, 1.0])
    for lune in range(lunes):
        outward = around[[lune, lune, lune + 1, lune + 1]]
        lower, upper = (radii * (np.cos(a) * outward + np.sin(a) * axis) for a in latitudes)
        yield between(f"{prefix}{lune + 1}", lower, upper, density)
