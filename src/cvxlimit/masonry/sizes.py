"""Sizes given to the generators: each refusal names the size, shows the value and the cure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.checks import finite_vector, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.polyhedra import RELATIVE_TOLERANCE
from cvxlimit.scene import Load, Scene

Size = tuple[float, float, float]
"""Length along x, thickness along y and height along z, in the scene's length unit."""


def count(value: Any, what: str, least: int = 1) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise InputError(f"{what} must be a whole number of at least {least}, got {value!r}")
    return int(value)


def size_of(value: Any, what: str) -> Size:
    given = finite_vector(value, 3, f"{what} (length, thickness, height)").tolist()
    names = ("length", "thickness", "height")
    x, y, z = (positive(v, f"{name} of {what}") for v, name in zip(given, names, strict=True))
    return x, y, z


def ground_below(blocks: Sequence[Block], depth: float) -> Block:
    """A fixed block ``"ground"`` under the plan of ``blocks``, its top at z = 0."""
    low = np.min([b.vertices.min(axis=0) for b in blocks], axis=0)
    high = np.max([b.vertices.max(axis=0) for b in blocks], axis=0)
    return Block.box("ground", (low[0], low[1], -depth), (high[0], high[1], 0.0))


def pile(
    prefix: str, x: tuple[float, float], y: tuple[float, float], levels: ArrayLike, density: float
) -> list[Block]:
    """Boxes on one another between ``levels`` (z, ascending): ``<prefix>1``, ``<prefix>2`` ..."""
    heights = np.asarray(levels, dtype=float)
    return [
        Block.box(f"{prefix}{i + 1}", (x[0], y[0], z0), (x[1], y[1], z1), density)
        for i, (z0, z1) in enumerate(pairwise(heights))
    ]


def scene_of(
    blocks: Sequence[Block], push: Size, live: Load | None, friction: float, name: str
) -> Scene:
    """Blocks without density are the supports; ``push`` times the weights is the load if none is
    given."""
    return Scene(
        blocks=tuple(blocks),
        supports=tuple(block.id for block in blocks if block.density is None),
        live=Load(acceleration=push) if live is None else live,
        friction=friction,
        name=name,
    )


def is_negligible(length: float, unit: float) -> bool:
    """True if ``length`` is too short to be told from rounding in a block of size ``unit``."""
    return length <= RELATIVE_TOLERANCE * unit
