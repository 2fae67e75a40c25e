"""Sizes given to the generators: each refusal names the size, shows the value and the cure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector, members, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE
from cvxlimit.scene import Load, Scene

Size = tuple[float, float, float]
"""Length along x, thickness along y and height along z, in the scene's length unit."""

Span = tuple[float, float]

LEAST_BOND = 0.25
"""Of a unit: bonds of less than a quarter brick are bad craft in every handbook."""

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
    return grounds_below(blocks, depth)[0]


def grounds_below(
    blocks: Sequence[Block], depth: float, cuts: Sequence[float] | float = ()
) -> list[Block]:
    """The same, cut across x at ``cuts`` into ``"ground1"``, ``"ground2"`` ... from the left."""
    low = np.min([b.vertices.min(axis=0) for b in blocks], axis=0)
    high = np.max([b.vertices.max(axis=0) for b in blocks], axis=0)
    given = members(
        cuts, (int, float, np.number), "ground_cuts must be places along x", "write [1.8]"
    )
    at = np.array([low[0], *given, high[0]])
    if not (np.diff(at) > RELATIVE_TOLERANCE * (high[0] - low[0])).all():
        raise InputError(
            f"ground_cuts must ascend, between {low[0]:g} and {high[0]:g}, got {list(given)}"
        )
    names = [f"ground{i}" for i in range(1, len(at))] if given else ["ground"]
    return [
        Block.box(name, (x0, low[1], -depth), (x1, high[1], 0.0))
        for name, (x0, x1) in zip(names, pairwise(at.tolist()), strict=True)
    ]


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


_ROUNDING = 1e-12
"""Of a length: what sums of some thousand sizes lose."""


def drawn_joints(
    rng: np.random.Generator,
    whole: float,
    sizes: Span,
    ends: float,
    closed: Iterable[Span] = (),
) -> list[float] | None:
    """Places from 0 to ``whole`` whose distances are drawn from ``sizes``, the first and the last
    one from ``ends`` on; none of them within a ``closed`` span. None if there are none.

    A place is drawn evenly among those from which the rest can be laid. They are a union of
    intervals, found from the far end back.
    """
    least, most = sizes
    slack = _ROUNDING * whole
    shut = _merged((a + slack, b - slack) for a, b in closed)
    bounds = [0.0, *(end for span in shut for end in span), whole]
    gaps = [(a, b) for a, b in zip(bounds[::2], bounds[1::2], strict=True) if b >= a]
    if whole < least - slack:
        return None
    found: list[Span] = []
    reached = _common(gaps, [(whole - most - slack, whole - ends + slack)])
    while reached:
        found += reached
        reached = _common(gaps, _merged((a - most - slack, b - least + slack) for a, b in reached))
    found, places, step = _merged(found), [0.0], ends
    while whole - places[-1] > most + slack:
        at = places[-1]
        choice = _common(found, [(at + step - slack, at + most + slack)])
        if not choice:
            return None
        rooms = np.cumsum([b - a for a, b in choice])
        drawn = rng.uniform(0.0, rooms[-1])
        number = int(np.searchsorted(rooms[:-1], drawn, side="right"))
        places.append(float(choice[number][1] - (rooms[number] - drawn)))
        step = least
    return [*places, whole]


def _common(first: Iterable[Span], second: Sequence[Span]) -> list[Span]:
    both = ((max(a, c), min(b, d)) for a, b in first for c, d in second)
    return [(a, b) for a, b in both if b >= a]


def _merged(spans: Iterable[Span]) -> list[Span]:
    merged: list[Span] = []
    for low, high in sorted(spans):
        if merged and low <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(merged[-1][1], high)
        else:
            merged.append((low, high))
    return merged
