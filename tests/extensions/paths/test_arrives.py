"""Random scenes of several kinds: every path ends where nothing holds, and says so by name."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cvxlimit import Block, Load, Path, Scene, pushover
from cvxlimit.extensions.paths.following import LEVEL_FOR
from cvxlimit.masonry import arch, arch_on_piers, barrel_vault, dome, panel, random_wall
from displaced import imbalance
from exhaustive import slow

GROUND = Block.box("ground", (-4, -4, -1), (4, 4, 0))
Drawn = Callable[[np.random.Generator, float, Load], Scene]


def rough_wall(random: np.random.Generator, friction: float, push: Load) -> Scene:
    """Courses of unequal stones of which few joints lie above one another."""
    blocks, base = [GROUND], 0.0
    for course in range(int(random.integers(2, 5))):
        height = random.uniform(0.15, 0.4)
        cuts = np.sort(random.uniform(0.2, 1.0, 1 + course % 2)).tolist()
        ends = [0.0, *(x for x, y in pairwise([*cuts, 1.2]) if y - x > 0.1), 1.2]
        blocks += [
            Block.box(f"s{course}.{i}", (x, 0, base), (y, 0.3, base + height), 20.0)
            for i, (x, y) in enumerate(pairwise(ends))
        ]
        base += height
    return Scene(blocks, ["ground"], push, friction=friction)


def turned_pile(random: np.random.Generator, friction: float, push: Load) -> Scene:
    """Boxes on one another, each turned about the vertical and out of the middle."""
    blocks, base = [GROUND], 0.0
    for course in range(int(random.integers(2, 5))):
        height, half = random.uniform(0.15, 0.4), random.uniform(0.25, 0.4, 2)
        box = Block.box(f"s{course}", (*-half, 0), (*half, height), 20.0)
        turn = Rotation.from_euler("z", random.uniform(0.0, 6.0)).as_matrix()
        blocks.append(box.moved(turn, (*random.uniform(-0.04, 0.04, 2), base)))
        base += height
    return Scene(blocks, ["ground"], push, friction=friction)


KINDS: dict[str, Drawn] = {
    "rough wall": rough_wall,
    "pile": turned_pile,
    "wall in bond": lambda random, friction, push: random_wall(
        int(random.integers(1000)), sizes=((2, 3), (3, 3), (2, 5))
    ),
    "arch": lambda random, friction, push: arch(
        int(random.integers(5, 12)), random.uniform(0.12, 0.2), embrace=150.0, friction=friction,
        live=push,
    ),
    "arch on piers": lambda random, friction, push: arch_on_piers(
        int(random.integers(4, 9)), random.uniform(0.15, 0.25), pier_courses=2,
        pier_height=random.uniform(0.6, 1.5), friction=friction, live=push,
    ),
    "barrel vault": lambda random, friction, push: barrel_vault(
        int(random.integers(4, 8)), random.uniform(0.14, 0.2), units=2, embrace=150.0,
        friction=friction, live=push,
    ),
    "dome": lambda random, friction, push: dome(
        int(random.integers(5, 8)), int(random.integers(2, 4)), random.uniform(0.12, 0.2),
        oculus=random.uniform(10.0, 30.0), friction=friction, live=push,
    ),
    "corner": lambda random, friction, push: panel(
        random.uniform(0.3, 0.6), int(random.integers(2, 4)), left_return=random.uniform(0.1, 0.3),
        friction=friction, live=push,
    ),
}  # fmt: skip


def drawn(seed: int) -> Scene:
    """The scene of a seed, pushed in any horizontal direction."""
    random, kind = np.random.default_rng(seed), list(KINDS)[seed % len(KINDS)]
    friction, way = random.uniform(0.35, 0.9), random.uniform(0.0, 2.0 * np.pi)
    push = Load(acceleration=(np.cos(way), np.sin(way), 0.0))
    return KINDS[kind](random, friction, push)


def assert_arrives(path: Path) -> None:
    """It ends where the load factor is zero, no equilibrium follows or joints slide for good."""
    assert path.status in ("zero", "falls", "slides"), path
    if path.slides_away:
        assert "there is no d0" in path.reason
        assert any(joint in path.reason for joint in path.sliding_joints)
    elif path.status == "zero":
        assert "load factor" in path.reason
        assert path.d0 > 0.0
    else:
        assert any(block.id in path.reason for block in path.scene.blocks)
        assert LEVEL_FOR not in path.reason


def assert_keeps_the_laws(path: Path) -> None:
    """Forces are within friction and in equilibrium but for the residual, and blocks are in one
    another by no more than steps may leave. No load factor is above what its bracket proves."""
    size, weight = path.scene.contacts.typical_size, path.scene.total_weight
    first = abs(path[0].load_factor)
    for shown in path:
        n, v = shown.forces[:, 0], np.linalg.norm(shown.forces[:, 1:], axis=1)
        assert (n > -1e-9 * weight).all()
        assert (v <= shown.points.friction * n + 1e-8 * weight).all()
        lacks = (shown.residual if shown.is_followed else 0.0) + 1e-8
        assert lacks <= 1e-4
        force, moment = imbalance(shown)
        assert max(force, moment / size) <= lacks * weight
        if shown.bracket is not None:
            near = 1e-6 * first
            assert shown.bracket.is_proved or not shown.is_followed
            if shown.bracket.lower_is_proved and shown.bracket.upper_is_proved:
                assert shown.bracket.lower <= shown.bracket.upper + near
            if shown.bracket.upper_is_proved:
                assert shown.load_factor <= shown.bracket.upper + near


LONG = {1, 12, 14}
"""Seeds whose paths take a minute each, and are like others."""


@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 30) if seed not in LONG)])
def test_every_path_arrives(seed: int) -> None:
    scene = drawn(seed)
    flow = ("associated", "zero-dilatancy")[seed // len(KINDS) % 2]
    path = pushover(scene, flow=flow, halvings=0)
    assert_arrives(path)
    assert_keeps_the_laws(path)
