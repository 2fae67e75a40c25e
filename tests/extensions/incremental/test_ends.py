"""Where ways from rest end: mechanisms without dilatancy, between the lowest and the limit."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cvxlimit import Incremental, Load, Scene, Solution, Units, builtin_scene, solve
from cvxlimit.extensions.incremental.stating import ElasticStep
from cvxlimit.masonry import rubble_wall
from cvxlimit.solution import Status, Trial
from cvxlimit.solution.said import WHERE_MET, said
from exhaustive import mostly_slow, slow
from helpers import renumbered
from members import assert_member
from planar import lowest_member
from planar_walls import cut_wall
from random_scenes import pile, ring, vault

PLAIN = Incremental(spread=False)


@cache
def ended(seed: int, courses: int) -> tuple[Scene, Solution]:
    scene = cut_wall(seed, courses)
    return scene, solve(scene, method=PLAIN)


WALLS = [(seed, courses) for seed in range(12) for courses in (2, 4)]


@pytest.mark.parametrize(
    "which", mostly_slow(WALLS, [(0, 2), (0, 4), (1, 2), (4, 2), (4, 4), (7, 2)])
)
def test_the_end_is_a_member_under_the_proved_limit(which: tuple[int, int]) -> None:
    """Friction of a joint in the plane is one force, so that the last state, the curve level or
    fallen, admits a mechanism without dilatancy: matrices, motions and powers are by hand."""
    scene, found = ended(*which)
    assert found.status is Status.REACHED
    assert found.load_factor <= found.from_rest.limit * (1.0 + 1e-7)
    last = found.steps[-1]
    rates = np.array([found.mechanism[scene.blocks[i].id] for i in scene.free])
    if "to come" in found.from_rest.end:  # level but for what is said: no mechanism to all digits
        assert found.from_rest.to_come - found.load_factor <= 5e-3 * found.load_factor
        return
    # states balance to 1e-9 of the largest load, and rates are differences of displacements
    assert_member(scene, last.forces, rates, last.load_factor, tolerance=1e-5)


@pytest.mark.parametrize("seed", mostly_slow([0, 2, 3, 5, 6, 8, 9, 10], [0, 3, 9]))
def test_no_end_is_below_the_lowest_that_a_mixed_integer_program_proves(seed: int) -> None:
    scene, found = ended(seed, 2)
    _, lowest = lowest_member(scene, rate=300.0)
    assert found.steps[-1].load_factor >= lowest * (1.0 - 1e-6)


@pytest.mark.parametrize("name", ["arch-on-piers", "flying-buttress", "dam", "barrel-vault"])
def test_where_nothing_slides_it_is_the_proved_limit(name: str) -> None:
    found = solve(builtin_scene(name), method=PLAIN)
    assert found.load_factor == pytest.approx(found.from_rest.limit, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        slow("dome", 0.99 * 0.4557, 1.01 * 0.4593),
        slow("house-corner", 0.99 * 0.1618, 1.01 * 0.1618),
        slow("facade", 0.98 * 0.2172, 1.02 * 0.2193),
        slow("s12-panel", 0.1252, 0.1274),
    ],
)
def test_values_of_another_program_in_space(name: str, low: float, high: float) -> None:
    """Of a trial with other rules of points and other steps, and what these make of it."""
    found = solve(builtin_scene(name), method=PLAIN)
    assert found.status is Status.REACHED
    assert low <= found.load_factor <= high
    assert found.load_factor <= found.from_rest.limit * (1.0 + 1e-3)  # torsion at points


MADE = {"wall": lambda seed: cut_wall(seed, 2), "pile": pile, "ring": ring, "vault": vault}
PILES = [(kind, seed) for kind, most in (("pile", 14), ("ring", 15), ("vault", 12))
         for seed in range(most) if (kind, seed) != ("ring", 8)]  # fmt: skip
"""Forty scenes beside walls, all but a ring that jams."""


@cache
def made(kind: str, seed: int) -> tuple[Scene, Solution]:
    scene = MADE[kind](seed)
    return scene, solve(scene, method=PLAIN)


@cache
def by_forces(kind: str, seed: int) -> float:
    """The most of the force form in CVXPY, pushed in growing steps until a step that is not short
    gains nothing."""
    step, push, factors = ElasticStep(MADE[kind](seed)), 0.1, [0.0]
    step.start()
    while len(factors) < 40:
        factors.append(step.advance(push))
        gain, push = factors[-1] - factors[-2], 1.6 * push
        if push > 50.0 and gain <= 1e-4 * factors[-1]:
            break
    return max(factors)


SECOND = [("wall", seed) for seed in (100, 102, 103, 109, 111, 115, 117)] + PILES


@pytest.mark.filterwarnings("ignore:Solution may be inaccurate")
@pytest.mark.parametrize(
    "which", mostly_slow(SECOND, [("wall", 103), ("wall", 115), ("pile", 0), ("ring", 5)]), ids=str
)
def test_forces_in_cvxpy_end_where_displacements_do(which: tuple[str, int]) -> None:
    _, found = made(*which)
    assert found.status is Status.REACHED
    assert by_forces(*which) == pytest.approx(found.load_factor, rel=5e-3)


@pytest.mark.exhaustive
@pytest.mark.filterwarnings("ignore:Solution may be inaccurate")
def test_a_second_writing_on_twenty_walls() -> None:
    """Within half a per cent, but where a curve has a peak, which long steps pass by, or two ways
    on: three of twenty, and they stay below the limit."""
    apart = []
    for seed in range(100, 120):
        _, found = made("wall", seed)
        other = by_forces("wall", seed)
        assert other <= found.from_rest.limit * (1.0 + 1e-3)
        if abs(other / found.load_factor - 1.0) > 5e-3:
            apart.append(seed)
    assert len(apart) <= 3


SAME = [("wall", 1), ("wall", 2), ("wall", 3), ("wall", 8), ("wall", 10), *PILES]


@pytest.mark.parametrize(
    "which", mostly_slow(SAME, [("wall", 1), ("wall", 3), ("pile", 1), ("ring", 0)]), ids=str
)
def test_an_end_knows_no_units_order_rotation_or_stiffness(which: tuple[str, int]) -> None:
    """What is heavier by a factor shortens by it: the density stands for the stiffness. In a vault
    rounding decides which of many points on the verge slide first, and by that where steps end."""
    (scene, found), seed = made(*which), which[1]
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    near = 1e-4 if which[0] == "vault" else 1e-6
    heavier = 7.0 if scene.live.forces else 1.0  # over a force of its own, no share of the weight
    for other, share in (
        (scene.moved(turn, (1.0, -2.0, 3.0)), 1.0),
        (renumbered(scene, seed), 1.0),
        (scene.in_units(Units("mm", "N"), 1e3, 1e3), 1.0),
        (scene.with_density(7.0), heavier),
    ):
        again = solve(other, method=PLAIN).load_factor
        assert again == pytest.approx(share * found.load_factor, rel=near)


def test_ways_that_end_apart_are_told_as_a_range_that_is_not_decided() -> None:
    _, found = ended(3, 2)
    way, factor = found.from_rest, found.load_factor
    for other, is_one in ((0.995, True), (0.95, False), (1.05, False)):
        trials = (Trial("half the step", other * factor, "level"),)
        apart = replace(found, from_rest=replace(way, spread=trials))
        assert ("not decided" in said(apart).standing) is not is_one
        assert ("not decided" in said(apart).headline) is not is_one
        assert (" to " in said(apart).headline.split("reached")[0]) is not is_one


@pytest.mark.exhaustive
def test_leaves_part_where_no_joint_of_the_proved_mechanism_slides() -> None:
    """A wall of two leaves overturns as one in the plain solve, at its thickness over its height;
    from rest the leaves part at less, so that the plain answer does not send to itself alone."""
    load = Load(acceleration=(0, 1, 0))
    wall = rubble_wall(2.4, 1.8, 0.45, seed=1, widths=(0.25, 0.6), heights=(0.15, 0.3),
                       through=3, density=20.0, friction=0.6, live=load)  # fmt: skip
    plain = solve(wall)
    assert plain.load_factor == pytest.approx(0.45 / 1.8, rel=1e-5)
    told = said(plain)
    assert not told.rows
    assert (told.report, told.method) == (WHERE_MET, "incremental")
    reached = solve(wall, method=Incremental(spread=False))
    assert reached.load_factor < 0.98 * plain.load_factor
