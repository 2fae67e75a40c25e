"""Ordinary walls of random stones: in a plane, holding back earth, and around a corner."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cvxlimit import Block, Load, Pressure, Scene
from cvxlimit.masonry import house_corner

HEIGHT = 0.5
"""Of a course of a retaining wall, m."""


def _cuts(rng: np.random.Generator, length: float, stones: int) -> list[float]:
    """Ends of stones of random lengths, none shorter than a third of the longest."""
    sizes = rng.uniform(0.33, 1.0, stones)
    return [0.0, *(length * np.cumsum(sizes) / sizes.sum()).tolist()]


def planar(seed: int, courses: int = 4) -> Scene:
    """A wall of three to five stones a course, one behind another, pushed along itself."""
    rng = np.random.default_rng((1, seed))
    length, height = float(rng.uniform(1.2, 2.4)), float(rng.uniform(0.2, 0.4))
    blocks = [Block.box("ground", (-1.0, -0.5, -0.5), (length + 1.0, 0.9, 0.0))]
    for course in range(courses):
        cuts = _cuts(rng, length, int(rng.integers(3, 6)))
        low, high = course * height, (course + 1) * height
        for k, (start, end) in enumerate(pairwise(cuts)):
            blocks.append(Block.box(f"s{course}_{k}", (start, 0, low), (end, 0.4, high), 22.0))
    push, friction = Load(acceleration=(1, 0, 0)), float(rng.uniform(0.4, 0.8))
    return Scene(blocks, ["ground"], push, friction=friction, name=f"planar {seed}")


def retaining(
    seed: int, courses: int = 4, stones: int = 4, depth: float = 0.8, *, is_filled: bool = False
) -> Scene:
    """A wall, 2 m long with four stones, in courses of half a metre, partly of two leaves, which
    earth pushes, the live load: from behind the wall, or from between its leaves if it is filled.
    """
    rng = np.random.default_rng((2, seed, courses, stones))
    length = 0.5 * stones
    blocks = [Block.box("ground", (-1.0, -1.0, -0.5), (length + 1.0, depth + 1.0, 0.0))]
    side, earth = (0, -1 if is_filled else 1, 0), []
    for course in range(courses):
        cuts = _cuts(rng, length, stones + int(rng.integers(-1, 2)))
        low, high = course * HEIGHT, (course + 1) * HEIGHT
        at = (courses * HEIGHT - (low + high) / 2.0) * 20.0 / 3.0
        for k, (start, end) in enumerate(pairwise(cuts)):
            middle = depth * float(rng.uniform(0.4, 0.6))
            parts = [(f"f{course}_{k}", 0.0, middle), (f"b{course}_{k}", middle, depth)]
            if rng.uniform() < 0.5:  # a stone through the wall
                parts = [(f"s{course}_{k}", 0.0, depth)]
            for key, front, back in parts:
                blocks.append(Block.box(key, (start, front, low), (end, back, high), 24.0))
            earth.append(Pressure(parts[-1][0], side, at))
    friction = float(rng.uniform(0.4, 0.6))
    live = Load(pressures=tuple(earth))
    return Scene(blocks, ["ground"], live, friction=friction, name=f"retaining {seed}")


def corner(seed: int) -> Scene:
    """One or two storeys of two walls that meet in a corner, with windows, pushed along
    some horizontal direction."""
    rng = np.random.default_rng((3, seed))
    front, side, wide = rng.uniform(1.6, 2.4), rng.uniform(1.5, 2.0), rng.uniform(0.4, 0.6)
    angle, friction = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.4, 0.8)
    return house_corner(
        float(front), float(side), storeys=1 + seed % 2, storey_courses=int(rng.integers(6, 9)),
        window_width=float(wide), friction=float(friction),
        live=Load(acceleration=(float(np.cos(angle)), float(np.sin(angle)), 0.0)),
        name=f"corner {seed}",
    )  # fmt: skip
