"""Walls in the plane whose courses are cut at random, the same for the same seed."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cvxlimit import Block, Load, Scene


def cut_wall(seed: int, courses: int = 3, stones: int = 3) -> Scene:
    """A wall 1.2 long on the ground, ``courses`` high, of up to so many ``stones`` a course, with
    friction of its own, pushed along x."""
    random = np.random.default_rng(seed)
    blocks, low = [Block.box("ground", (-3, -1, -0.5), (5, 1, 0))], 0.0
    for course in range(courses):
        high = low + float(random.uniform(0.2, 0.4))
        cuts = np.sort(random.uniform(0.1, 1.1, int(random.integers(0, stones))))
        ends = [0.0, *(x for x, y in pairwise([*cuts, 1.2]) if y - x > 0.1), 1.2]
        for k, (start, end) in enumerate(pairwise(ends)):
            blocks.append(Block.box(f"s{course}.{k}", (start, 0, low), (end, 0.4, high), 20.0))
        low = high
    push = Load(acceleration=(1, 0, 0))
    return Scene(blocks, ["ground"], push, friction=float(random.uniform(0.3, 0.9)))
