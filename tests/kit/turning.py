"""The exact path of a wall that turns as one about its toe: no solver has a part in it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cvxlimit import Block, Configuration, Load, Path, Scene, solve
from cvxlimit.extensions.paths.configuration import Points

B, H = 0.4, 2.0
NONE = Points(*(np.zeros(shape, int) for shape in (0, 0)), *(np.zeros(shape) for shape in
                ((0, 3), (0, 3, 3), 0, (0, 2), 0)))  # fmt: skip


def wall(courses: int, push: Sequence[float] = (1.0, 0.0, 0.0)) -> Scene:
    """A wall of 0.4 x 2 m on its foundation, in courses."""
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    edges = np.linspace(0.0, H, courses + 1)
    blocks = [
        Block.box(f"c{i}", (0, 0, low), (B, 1, high), density=20.0)
        for i, (low, high) in enumerate(pairwise(edges))
    ]
    return Scene([ground, *blocks], ["ground"], Load(acceleration=tuple(push)), friction=0.7)


def turning(scene: Scene, angles: Sequence[float]) -> Path:
    """The exact path of a wall that turns as one about its toe, by angles, without any solve."""
    corners = np.concatenate([scene.blocks[i].vertices for i in scene.free])
    (b, _, h), alpha = corners.max(axis=0), np.arctan2(B, H)
    toe = np.array([b, 0.0, 0.0])
    made = []
    for angle in angles:
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        ways = {}
        for i in scene.free:
            arm = scene.blocks[i].centroid - toe
            ways[scene.blocks[i].id] = np.array([*(turn @ arm - arm), 0.0, angle, 0.0])
        w = 0.5 * b * (1 - c) + 0.5 * h * s
        factor = float(np.tan(alpha - angle))
        made.append(Configuration(scene, w, factor, ways, NONE, np.zeros((0, 3))))
    return Path(solve(scene), tuple(made), "zero", "the load factor is zero")


def angle_at(displacement: float) -> float:
    """At which the wall's centre has moved so far: one number in one unknown, by bisection."""
    low, high = 0.0, 0.5
    for _ in range(60):
        middle = 0.5 * (low + high)
        moved = 0.5 * B * (1 - np.cos(middle)) + 0.5 * H * np.sin(middle)
        low, high = (middle, high) if moved < displacement else (low, middle)
    return low


SLV, SLC, END = angle_at(0.4 * B / 2), angle_at(0.6 * B / 2), float(np.arctan2(B, H))
ANGLES = (0.0, 0.03, SLV, 0.1, SLC, 0.16, END)
