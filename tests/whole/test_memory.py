"""Memory: blocks that lie in each other, and 1,000 solves.

A scene of 3,000 blocks has 4.5 million pairs, which all lie in each other if their placements were
lost; arrays of all of them took 13 GB before the first overlap was named.

Solves are made in a process of their own: a test runner keeps things too. Garbage is collected and
what is free is given back before memory is read: left to Python's own time, cycles of CVXPY's
expressions spread it over 20 MB more, and the C library keeps up to 14 MB of freed pages for the
next solve, more in one run than in another. Seen: 151.3 MB after 100 solves, when everything is
there that is kept, and 151.5 MB after 1,000 and after 1,500.
"""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
from collections.abc import Sequence

import numpy as np
import pytest

from cvxlimit import Block
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.detection import detect
from cvxlimit.masonry import arch


def in_one_place(count: int) -> list[Block]:
    return [Block.box(f"b{i}", (0, 0, 0), (1, 1, 1), density=1.0) for i in range(count)]


def without_placements(count: int) -> list[Block]:
    """Voussoirs, each about its own centroid, as programs export them that keep placements."""
    made = arch(count).blocks
    return [b.moved(np.eye(3), -b.centroid) for b in made if b.density is not None]


def plates_across_each_other(count: int) -> list[Block]:
    places = np.random.default_rng(1).uniform(0.0, 0.5, (count, 3))
    return [
        Block.box(f"b{i}", p, p + np.array([1, 1, 0.05]), density=1.0) for i, p in enumerate(places)
    ]


@pytest.mark.parametrize(
    ("blocks", "fault"),
    [
        (in_one_place(3000), "are the same body twice"),
        (without_placements(1500), "are the same body twice|interpenetrate by about"),
        (plates_across_each_other(3000), "interpenetrate by about"),
    ],
    ids=["in-one-place", "without-placements", "plates"],
)
@pytest.mark.exhaustive_cases("plates", "without-placements")
def test_blocks_in_each_other_are_named_before_all_pairs_are_looked_at(
    blocks: Sequence[Block], fault: str
) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(GeometryError, match=fault):
            detect(blocks)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 100e6  # bytes; 500 MB of the process are asked for, and imports take 80


PROGRAM = """
import ctypes
import gc
from cvxlimit import solve
from cvxlimit.masonry import random_wall

scenes = [random_wall(seed) for seed in range(10)]
for k in range(1, 1001):
    solve(scenes[k % 10])
    if k % 100 == 0:
        gc.collect()
    if k in (100, 1000):
        getattr(ctypes.CDLL(None), "malloc_trim", int)(0)  # of glibc
        with open("/proc/self/statm", encoding="ascii") as file:
            print(int(file.read().split()[1]) * 4096 / 1e6)
"""


@pytest.mark.exhaustive
def test_a_thousand_solves_leave_nothing_behind() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, check=True)
    before, after = map(float, done.stdout.split())
    assert before < 1_000.0
    assert after - before < 2.0  # MB; an array of 300 floats left by every solve would be 2.2
