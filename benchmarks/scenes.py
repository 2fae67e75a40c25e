"""Scenes by name: built-in ones, scenes of any size, and seeded ones. To add one, add a line.

>>> scene_of("panel-500").name, len(scene_of("stack").contacts)
('panel 0.44 x 14', 4)
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry import (
    BUILTIN,
    arch,
    builtin_scene,
    panel,
    random_wall,
    running_bond,
    wall,
)
from cvxlimit.masonry.walls import SIZES
from cvxlimit.scene import Load, Scene


def arch_of(contacts: int) -> Scene:
    """A semicircular arch, pushed along its span: one contact more than voussoirs."""
    return arch(contacts - 1, name=f"arch of {contacts - 1}")


def panel_of(contacts: int) -> Scene:
    """A brick panel with two returns, pushed out of plane; 16,452 gives exactly as many, and 5,560
    blocks. Fronts and returns are multiples of half a brick of 0.08 m."""

    def whole(length: float) -> float:
        return round(2 * length / 0.08) * 0.04

    scale = sqrt(contacts / 16_452)
    front, side = max(0.16, whole(2.4 * scale)), max(0.08, whole(1.6 * scale))
    courses = max(2, round(80 * scale))
    return panel(
        front, courses, left_return=side, right_return=side, name=f"panel {front:.2f} x {courses}"
    )


def planar_wall(contacts: int) -> Scene:
    """A wall in running bond, twice as many courses as units, pushed in its plane."""
    return wall_of(max(2, round(sqrt(contacts / 6))))


def wall_of(units: int) -> Scene:
    """The same by its units: three contacts per block, 99,588 at 129."""
    name = f"planar wall {units} x {2 * units}"
    return wall(running_bond(units, 2 * units), friction=0.65, name=name)


def s12_class(contacts: int = 886) -> Scene:
    """One return, 313 blocks, 886 contacts: the octagon is 1.4 % off. Close to the paper's
    specimen, the built-in ``s12-panel``; kept because figures on speed were measured on it."""
    return panel(0.80, 19, left_return=0.52, name="s12-class")


def s10_class(contacts: int = 1_902) -> Scene:
    """Two returns, 663 blocks, 1,902 contacts: rocking decides. Close to ``s10-panel``."""
    return panel(0.88, 34, left_return=0.36, right_return=0.36, name="s10-class")


def irregular_wall(seed: int) -> Scene:
    """A random wall, of four units by five courses among others."""
    return random_wall(seed, sizes=(*SIZES, (4, 5)))


def prisms(seed: int) -> Scene:
    """One to three prisms on one another on the ground, pushed and twisted in random directions.

    Of 3, 5, 6, 7 or 8 corners on circles of 0.3 to 0.5 m, so that contacts are polygons; each
    stands on the middle of the one below.
    """
    rng = np.random.default_rng(seed)
    return _piled(rng, int(rng.choice([3, 5, 6, 7, 8])), f"prisms-{seed}")


def drums(seed: int) -> Scene:
    """The same with prisms of six corners, as of a column."""
    return _piled(np.random.default_rng(seed), 6, f"drums-{seed}")


def _piled(rng: np.random.Generator, corners: int, name: str) -> Scene:
    level, blocks = 0.0, [Block.box("ground", (-2.0, -2.0, -0.5), (2.0, 2.0, 0.0))]
    for number in range(1, int(rng.integers(1, 4)) + 1):
        angle = 2.0 * np.pi * (np.arange(corners) + rng.uniform(-0.2, 0.2, corners)) / corners
        ring = rng.uniform(0.3, 0.5) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        top = level + rng.uniform(0.2, 0.5)
        points = [(*p, z) for z in (level, top) for p in ring]
        blocks.append(Block.hull(f"b{number}", points, density=20.0))
        level = top
    push = rng.normal(size=3) * (1.0, 1.0, 0.3)
    weight = 20.0 * blocks[-1].volume
    twist = float(rng.uniform(-0.2, 0.2) * weight)
    live = Load(
        acceleration=tuple(push / np.linalg.norm(push)),
        forces={blocks[-1].id: (0.0, 0.0, 0.0, 0.0, 0.0, twist)},
    )
    return Scene(tuple(blocks), ("ground",), live, friction=float(rng.uniform(0.3, 0.9)), name=name)


NUMBERED: dict[str, Callable[[int], Scene]] = {
    "arch": arch_of, "panel": panel_of, "planar-wall": planar_wall, "wall": wall_of,
    "random-wall": random_wall, "irregular-wall": irregular_wall,
    "prisms": prisms, "drums": drums,
}  # fmt: skip
"""Scenes by about how many contacts, or units, they have, and by their seed."""

OTHERS = {"s12-class": s12_class, "s10-class": s10_class}


def scene_of(name: str) -> Scene:
    """A scene by its name: built-in, one of :data:`OTHERS`, or one of :data:`NUMBERED` and its
    number, as in ``panel-5000``."""
    if name in BUILTIN:
        return builtin_scene(name)
    if name in OTHERS:
        return OTHERS[name]()
    kind, _, number = name.rpartition("-")
    if kind in NUMBERED and number.isdigit():
        return NUMBERED[kind](int(number))
    raise SystemExit(
        f"there is no scene {name!r}: there are built-in ones, {', '.join(OTHERS)}, "
        f"and {', '.join(NUMBERED)} with a number behind them"
    )
