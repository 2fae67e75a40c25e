"""Walls that hold back earth or water: a dry-stone retaining wall, and the section of a dam."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from cvxlimit.base.checks import not_negative, positive
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.strengths import DEFAULT_FRICTION
from cvxlimit.masonry.sizes import ALONG, count, scene_of
from cvxlimit.scene import GRAVITY, Load, Pressure, Scene
from cvxlimit.surroundings.reached import earth_pressure, hydrostatic, uplift

_BEHIND = (-1.0, 0.0, 0.0)
"""Earth and water lie on the side of -x."""


def retaining_wall(
    courses: int = 8,
    height: float = 2.4,
    base: float = 1.0,
    top: float = 0.6,
    *,
    length: float = 1.0,
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    soil: float = 18.0,
    coefficient: float = 0.3,
    surcharge: float = 0.0,
    live: Load | None = None,
    name: str = "retaining-wall",
) -> Scene:
    """A dry-stone wall of stepped courses, earth behind its upright back at x = 0 up to its top.

    Courses are alternately one stone through the wall and two, and step back at the front. Stones
    are named ``c1``, ``c2a`` (behind), ``c2b`` (in front), ``c3`` ... from the bottom.

    Parameters
    ----------
    courses : int
    height, base, top : float
        Of the wall; thickness of the lowest and of the highest course.
    length : float
        Along the wall, y.
    density, friction : float
    soil, coefficient, surcharge : float
        Unit weight, coefficient of earth pressure, force per area on top; see
        :func:`~cvxlimit.earth_pressure`.
    live : Load, optional
        Unless given, the earth is the live load: the load factor is how many times the earth
        pressure the wall holds. With one, the earth is part of the dead load.
    name : str

    Raises
    ------
    InputError
        If a number is out of its range.

    Example
    -------
    >>> wall = retaining_wall()
    >>> wall.live_forces[:, 0].sum().round(6).item()  # 0.3 x 18 x 2.4^2 / 2
    15.552
    """
    number = count(courses, "courses")
    levels = np.linspace(0.0, positive(height, "height"), number + 1)
    widths = np.linspace(positive(base, "base"), positive(top, "top"), number)
    y, gamma = positive(length, "length"), positive(density, "density")
    blocks = []
    for i, ((low, high), width) in enumerate(zip(pairwise(levels), widths, strict=True), start=1):
        cuts = (0.0, width) if i % 2 else (0.0, 0.5 * width, width)
        for part, (start, end) in zip("ab", pairwise(cuts), strict=False):
            key = f"c{i}" + (part if len(cuts) > 2 else "")
            blocks.append(Block.box(key, (start, 0.0, low), (end, y, high), gamma))
    given = soil, coefficient, _BEHIND, not_negative(surcharge, "surcharge")
    return _held(blocks, friction, name, live, lambda x: earth_pressure(x, height, *given))


def dam(
    courses: int = 5,
    height: float = 10.0,
    base: float = 9.0,
    crest: float = 1.5,
    *,
    water: float | None = None,
    tail: float | None = None,
    length: float = 1.0,
    density: float = 23.0,
    friction: float = DEFAULT_FRICTION,
    unit_weight: float = 9.81,
    live: Load | None = None,
    name: str = "dam",
) -> Scene:
    """The section of a gravity dam with an upright wet face at x = 0, and uplift in its bed joints.

    Blocks are named ``c1``, ``c2`` ... from the bottom; the dry face slopes from base to crest.

    Parameters
    ----------
    courses : int
    height, base, crest : float
        Of the section; its thickness at the bottom and at the top.
    water, tail : float, optional
        Levels of the water before and behind; unless given, the dam's height, and none behind.
    length : float
        Along the dam, y.
    density, friction, unit_weight : float
    live : Load, optional
        Unless given, water and uplift are the live load: the load factor is how many times the
        water's weight the dam holds. With one, they are part of the dead load.
    name : str

    Raises
    ------
    InputError
        If a number is out of its range.

    Example
    -------
    >>> section = dam()
    >>> section.live_forces[:, [0, 2]].sum(axis=0).round(4).tolist()  # 9.81 (10^2 / 2, 10 9 / 2)
    [490.5, 441.45]
    """
    number, level = count(courses, "courses"), height if water is None else water
    levels = np.linspace(0.0, positive(height, "height"), number + 1)
    widths = np.linspace(positive(base, "base"), positive(crest, "crest"), number + 1)
    y, gamma = positive(length, "length"), positive(density, "density")
    blocks = []
    for i, edges in enumerate(pairwise(zip(levels, widths, strict=True)), start=1):
        corners = [(x, side, z) for z, width in edges for x in (0.0, width) for side in (0.0, y)]
        blocks.append(Block.hull(f"c{i}", corners, gamma))
    given = level, unit_weight, _BEHIND
    return _held(
        blocks, friction, name, live, lambda x: (*hydrostatic(x, *given), *uplift(x, *given, tail))
    )


def _held(
    blocks: list[Block],
    friction: float,
    name: str,
    live: Load | None,
    pressing: Callable[[Scene], tuple[Pressure, ...]],
) -> Scene:
    scene = scene_of(blocks, ALONG, live, friction, name, ground=0.5)
    pressures = pressing(scene)
    if live is None:
        return scene.with_live(Load(pressures=pressures))
    return scene.with_dead(Load(gravity=GRAVITY.gravity, pressures=pressures))
