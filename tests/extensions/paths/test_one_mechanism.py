"""A code check and its path are of one mechanism and one set of joints, by hand formulas."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from cvxlimit import Block, Load, Scene, code_check, pushover, solve
from cvxlimit.extensions.paths.oscillator import OF_PATH, OF_SLIDING
from cvxlimit.io import read_path

G, FC = 9.81, 1.35
GROUND = Block.box("ground", (-4, -1, -1), (6, 3, 0))
PUSH = Load(acceleration=(1, 0, 0))


def random_wall(seed: int) -> tuple[Scene, float, float, float]:
    """A wall of two to five courses of random height and weight, with its friction, the load factor
    at which all of it turns about its toe, and e* of that."""
    draw = np.random.default_rng(seed)
    width, edges = draw.uniform(0.3, 0.8), np.cumsum([0.0, *draw.uniform(0.2, 0.6, 2 + seed % 4)])
    blocks = [
        Block.box(f"c{i}", (0, 0, low), (width, 1, high), density=draw.uniform(15, 25))
        for i, (low, high) in enumerate(pairwise(edges))
    ]
    weight = np.array([block.weight for block in blocks])
    z = np.array([block.centroid[2] for block in blocks])
    turns = weight.sum() * width / 2 / (weight @ z)
    e_star = (weight @ z) ** 2 / (weight.sum() * (weight @ z**2))
    # Sliding begins before, after with the least a0* all the same, or never.
    friction = {0: 0.8 * turns, 1: turns * (0.3 + 0.7 / e_star), 2: 1.2 * turns / e_star}[seed % 3]
    scene = Scene([GROUND, *blocks], ["ground"], PUSH, friction=friction)
    return scene, float(friction), float(turns), float(e_star)


@pytest.mark.parametrize("seed", [
    *range(3), *(pytest.param(seed, marks=pytest.mark.exhaustive) for seed in range(3, 23)),
])  # fmt: skip
@pytest.mark.exhaustive_cases("0")
def test_the_least_a0_of_rocking_and_sliding_leads(seed: int) -> None:
    scene, friction, turns, e_star = random_wall(seed)
    path = pushover(scene, certify="none", halvings=0)
    check = code_check(path, FC)
    assert path.load_factor[0] == pytest.approx(min(friction, turns), rel=1e-7)
    leads, rocks = min((friction, True), (turns / e_star, False)), turns < friction
    assert check.a0_star == pytest.approx(leads[0] * G / FC, rel=1e-6)
    assert check.e_star == pytest.approx(1.0 if leads[1] else e_star, rel=1e-6)
    assert check.weight == pytest.approx(scene.total_weight, rel=1e-9)
    # Rates of the path's own mechanism carry its curve, whichever leads.
    assert path.slides_away != rocks
    if rocks:
        per_control = 1.0 / e_star
        assert check.displacement == pytest.approx(per_control * path.displacement, rel=1e-6)
        assert check.acceleration == pytest.approx(path.load_factor * G / e_star / FC, rel=1e-6)
        own = next(each for each in check.mechanisms if each.of == OF_PATH)
        assert own.e_star == pytest.approx(e_star, rel=1e-6)
        assert (check.mechanisms[0].of == OF_SLIDING) is leads[1]


def test_grouped_blocks_slide_as_one() -> None:
    scene, friction, _, _ = random_wall(4)
    path = pushover(scene, certify="none", halvings=0)
    names = [scene.blocks[i].id for i in scene.free]
    assert code_check(path, FC, groups=[names]).a0_star == pytest.approx(
        min(friction, path.load_factor[0]) * G / FC, rel=1e-6
    )  # e* of one weight is 1


def on_a_sliver(wide: float) -> Scene:
    """A block of 1 x 1 m on a pier that ends 0.1 m beyond its middle, and on another by a joint
    ``wide``."""
    near = Block.box("near", (-1, 0, -1), (0.6, 1, 0))
    far = Block.box("far", (1.0 - wide, 0, -1), (3, 1, 0))
    block = Block.box("b", (0, 0, 0), (1, 1, 1), density=20)
    cap = Block.box("cap", (1.5, 0, 0), (2.8, 1, 0.1), density=20)
    return Scene([near, far, block, cap], ["near", "far"], PUSH, friction=3.0, joint_tolerance=1e-3)


def test_slivers_are_left_out_as_solve_does_and_say_what_they_are_worth(tmp_path) -> None:
    for wide, factor in ((0.9e-3, 0.2), (1.1e-3, 1.0)):  # turns about x = 0.6 or about x = 1
        scene = on_a_sliver(wide)
        path = pushover(scene, step=0.05, certify="none")
        assert solve(scene).load_factor == pytest.approx(factor, abs=1e-6)
        assert path.load_factor[0] == pytest.approx(factor, abs=1e-6)
        said = " ".join(path.notes)
        left_out = "far-b: a joint 0.0009 m wide, kept from 0.001, left out at rest as solve does"
        worth = f"{left_out}; with it the "
        assert (f"{worth}path begins at 1, +400.0%" in said) is (factor == 0.2)
    path.save(tmp_path / "path.json")
    assert read_path(tmp_path / "path.json").notes == path.notes
