"""Walls, arches, vaults and piles of any sizes and friction, pushed in any direction."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from cvxlimit import Block, Load, Scene
from cvxlimit.masonry import arch, barrel_vault

KINDS = ("wall", "arch", "vault", "pile")


def random_scene(seed: int) -> Scene:
    """The kinds take turns."""
    random, kind = np.random.default_rng(seed), KINDS[seed % 4]
    friction, way = float(random.uniform(0.35, 0.9)), float(random.uniform(0.0, 6.3))
    push = Load(acceleration=(np.cos(way), np.sin(way), 0.0))
    thickness, number = float(random.uniform(0.14, 0.2)), int(random.integers(5, 9))
    if kind == "arch":
        return arch(number, thickness, embrace=150.0, friction=friction, live=push)
    if kind == "vault":
        return barrel_vault(number, thickness, embrace=150.0, units=2, friction=friction, live=push)
    blocks, base = [Block.box("ground", (-4, -4, -1), (4, 4, 0))], 0.0
    for course in range(int(random.integers(2, 5))):
        top = base + float(random.uniform(0.15, 0.4))
        if kind == "wall":  # in courses of two and three
            cuts = np.sort(random.uniform(0.15, 1.05, 1 + course % 2)).tolist()
            blocks += [
                Block.box(f"s{course}.{i}", (x, 0.0, base), (y, 0.3, top), 20.0)
                for i, (x, y) in enumerate(pairwise([0.0, *cuts, 1.2]))
            ]
        else:
            half = random.uniform(0.25, 0.4, 2)
            low, high = (-half[0], -half[1], 0.0), (half[0], half[1], top - base)
            turn = Rotation.from_euler("z", random.uniform(0.0, 6.0)).as_matrix()
            to = (*random.uniform(-0.04, 0.04, 2), base)
            blocks.append(Block.box(f"s{course}", low, high, 20.0).moved(turn, to))
        base = top
    return Scene(blocks, ["ground"], push, friction=friction)
