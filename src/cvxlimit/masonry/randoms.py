"""Random walls, the same for the same seed: for benchmarks and for tests of many scenes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry.sizes import Size, count, ground_below, size_of
from cvxlimit.scene import Load, Scene

SIZES = ((2, 3), (2, 4), (2, 5), (3, 3), (3, 4), (3, 5), (4, 3), (4, 4))
"""Whole units and courses: 14 to 46 contacts, with a side support or without."""

FRICTION = (0.2, 0.9)
"""Range of the coefficient of friction."""

_JITTER = 0.2
"""Head joints and course heights vary by this share of a unit, up and down, so that joints of
following courses stay a tenth of a unit apart: bonded, though badly."""


def random_wall(
    seed: int,
    *,
    unit: Size = (0.4, 0.2, 0.2),
    density: float = 20.0,
    sizes: Sequence[tuple[int, int]] = SIZES,
) -> Scene:
    """An irregular running-bond wall with a random size, bond, friction and load direction.

    Courses differ in height, head joints are moved at random about those of a running bond; half
    of the walls lean on a rigid support at their start. The live load pushes in any direction of
    space, in multiples of the weight; one that presses the wall down does no harm. The same seed
    gives the same wall, whatever else was drawn before. Blocks are named as in
    :func:`~cvxlimit.masonry.wall`. Each block rests with its whole lower face on the course below,
    so the wall carries its own weight.

    Parameters
    ----------
    seed : int
        0 or more.
    unit : (float, float, float)
        Mean length, thickness and mean height of a block, m.
    density : float
        Weight per volume, kN/m3.
    sizes : sequence of (int, int)
        Whole units and courses, one of which is drawn; 14 to 46 contacts unless others are given.

    Raises
    ------
    InputError
        If the seed is not a whole number of 0 or more, or a size is not positive.

    Example
    -------
    >>> scene = random_wall(7)
    >>> scene.name, len(scene.free), len(scene.contacts)
    ('random-wall-7', 18, 42)
    """
    rng = np.random.default_rng(count(seed, "seed", least=0))
    length, thickness, height = size_of(unit, "the unit")
    units, courses = sizes[int(rng.integers(len(sizes)))]
    heights = height * rng.uniform(1.0 - _JITTER, 1.0 + _JITTER, courses)
    levels = np.concatenate([[0.0], np.cumsum(heights)])
    blocks = []
    for row, (z0, z1) in enumerate(pairwise(levels)):
        inner = np.arange(1, units) if row % 2 == 0 else np.arange(units) + 0.5
        joints = length * (inner + rng.uniform(-_JITTER, _JITTER, len(inner)))
        ends = [0.0, *joints.tolist(), units * length]
        for place, (x0, x1) in enumerate(pairwise(ends), start=1):
            low, high = (x0, 0.0, z0), (x1, thickness, z1)
            blocks.append(Block.box(f"b{row + 1}.{place}", low, high, density))
    fixed = [ground_below(blocks, depth=height)]
    if rng.random() < 0.5:
        fixed.append(Block.box("side-start", (-length, 0.0, 0.0), (0.0, thickness, levels[-1])))
    direction = rng.normal(size=3)
    return Scene(
        blocks=(*fixed, *blocks),
        supports=tuple(block.id for block in fixed),
        live=Load(acceleration=tuple(direction / np.linalg.norm(direction))),
        friction=float(rng.uniform(*FRICTION)),
        name=f"random-wall-{seed}",
    )
