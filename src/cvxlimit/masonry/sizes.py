"""Sizes given to the generators: each refusal names the size, shows the value and the cure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE
from cvxlimit.scene import Load, Scene

Size = tuple[float, float, float]
"""Length along x, thickness along y and height along z, in the scene's length unit."""

Span = tuple[float, float]

ALONG = Load(acceleration=(1.0, 0.0, 0.0))
ACROSS = Load(acceleration=(0.0, -1.0, 0.0))
"""Live loads unless others are given: the weights, in a wall's plane or out of it."""


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


def laid(
    prefix: str, spans: Iterable[Span], axis: int, across: Span, levels: Span, density: float
) -> Iterator[Block]:
    """Boxes ``<prefix>1``, ``<prefix>2`` ... beside one another along x (``axis`` 0) or y (1)."""
    for place, span in enumerate(spans, start=1):
        yield brick(f"{prefix}{place}", span, axis, across, levels, density)


def brick(id: str, span: Span, axis: int, across: Span, levels: Span, density: float) -> Block:
    (x0, x1), (y0, y1) = (span, across) if axis == 0 else (across, span)
    return Block.box(id, (x0, y0, levels[0]), (x1, y1, levels[1]), density)


def pile(prefix: str, x: Span, y: Span, levels: FloatArray, density: float) -> list[Block]:
    heights = enumerate(pairwise(levels.tolist()), start=1)
    return [brick(f"{prefix}{i}", x, 0, y, z, density) for i, z in heights]


def prism(id: str, outline: Sequence[ArrayLike], sides: Span, density: float | None) -> Block:
    """A block whose outline (k, 2) is in the plane (x, z), between two planes across y."""
    flat, k = np.array(outline, dtype=float), len(outline)
    vertices = [np.insert(flat, 1, y, axis=1) for y in sides]
    around = [(i, (i + 1) % k, k + (i + 1) % k, k + i) for i in range(k)]
    faces = [tuple(range(k)), tuple(range(k, 2 * k)), *around]
    return Block.polyhedron(id, np.concatenate(vertices), faces, density)


def scene_of(
    blocks: Sequence[Block],
    usual: Load,
    live: Load | None,
    friction: float,
    name: str,
    ground: float | None = None,
    **more: Any,
) -> Scene:
    """Blocks without density are the supports, and a ground of so much depth below all blocks comes
    first; the ``usual`` live load holds if none is given."""
    if ground is not None:
        blocks = [ground_below(blocks, ground), *blocks]
    supports = tuple(block.id for block in blocks if block.density is None)
    load = usual if live is None else live
    return Scene(tuple(blocks), supports, load, friction=friction, name=name, **more)


def is_negligible(length: float, unit: float) -> bool:
    return length <= RELATIVE_TOLERANCE * unit
