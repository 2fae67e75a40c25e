"""Rubble walls: what every draw keeps, walls without spread, and ground that is cut."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cvxlimit import Load, Scene, SupportMotion, settlement, solve
from cvxlimit.errors import InputError
from cvxlimit.masonry import facade, rubble_wall, running_bond, single_block, wall
from helpers import assert_certified

ROUNDING = 1e-9
"""Of a metre: sums of some fifty sizes lose less than 1e-13."""


def drawn(seed: int) -> tuple[Scene, dict[str, Any]]:
    """A rubble wall whose own sizes, ranges, bond and leaves are drawn, too."""
    rng = np.random.default_rng(seed)
    width, height = rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.25)
    given = {
        "length": rng.uniform(1.0, 4.0), "height": rng.uniform(0.5, 2.0),
        "thickness": rng.uniform(0.2, 0.8), "widths": (width, rng.uniform(2.0, 3.0) * width),
        "heights": (height, rng.uniform(2.0, 2.5) * height), "bond": rng.uniform(0.05, 0.3),
        "through": int(rng.integers(1, 4)), "density": rng.uniform(15.0, 28.0),
    }  # fmt: skip
    return rubble_wall(**given, seed=seed), given


def extents(scene: Scene) -> dict[str, np.ndarray]:
    """Lowest and highest corner of every free block, by its name."""
    free = (scene.blocks[i] for i in scene.free)
    return {b.id: np.array([b.vertices.min(axis=0), b.vertices.max(axis=0)]) for b in free}


def solid(scene: Scene) -> float:
    return sum(scene.blocks[i].volume for i in scene.free)


@pytest.mark.parametrize("seed", range(60))
def test_every_draw_fills_the_wall_in_its_ranges_and_bond(seed: int) -> None:
    """Volume, weight, ranges and bond from the corners alone, in one leaf and in two."""
    scene, given = drawn(seed)
    size = given["length"], given["thickness"], given["height"]
    assert solid(scene) == pytest.approx(np.prod(size), rel=ROUNDING)
    free = [scene.blocks[i] for i in scene.free]
    weight = sum(block.weight for block in free)
    assert weight == pytest.approx(given["density"] * np.prod(size), rel=ROUNDING)
    boxes = extents(scene)
    assert np.min(list(boxes.values()), axis=(0, 1)) == pytest.approx(np.zeros(3), abs=ROUNDING)
    assert np.max(list(boxes.values()), axis=(0, 1)) == pytest.approx(np.array(size))
    for (low, _, bottom), (high, _, top) in boxes.values():
        is_end = low < ROUNDING or high > size[0] - ROUNDING
        least = given["widths"][0] * (0.5 if is_end else 1.0)
        assert least - ROUNDING < high - low < given["widths"][1] + ROUNDING
        assert given["heights"][0] - ROUNDING < top - bottom < given["heights"][1] + ROUNDING
    apart = given["bond"] * 0.5 * sum(given["widths"])
    assert not scene.near_misses  # nor are joints of leaves side by side next to in line
    for upper, lower in on_one_another(boxes):
        for joint in (upper[0, 0], upper[1, 0]):
            for other in (lower[0, 0], lower[1, 0]):
                at_end = min(joint, other, size[0] - joint, size[0] - other) < ROUNDING
                assert at_end or abs(joint - other) > apart - ROUNDING


def on_one_another(boxes: dict[str, np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Blocks of following courses that share a part of the thickness, wherever along x."""
    tops = defaultdict(list)
    for box in boxes.values():
        tops[round(float(box[1, 2]), 7)].append(box)
    return [
        (upper, lower)
        for upper in boxes.values()
        for lower in tops[round(float(upper[0, 2]), 7)]
        if min(upper[1, 1], lower[1, 1]) - max(upper[0, 1], lower[0, 1]) > ROUNDING
    ]


def test_two_leaves_between_courses_of_through_stones() -> None:
    boxes = extents(rubble_wall(3.0, 2.0, 0.6, seed=1, through=3))
    thick = {name: float(np.ptp(box[:, 1])) for name, box in boxes.items()}
    rows = {name: int(name[1:].split(".")[0]) for name in boxes}
    assert all(thick[n] == pytest.approx(0.6 if rows[n] % 3 == 1 else 0.3) for n in boxes)
    assert {n[0] for n in boxes if rows[n] % 3 != 1} == {"f", "r"}


@pytest.mark.parametrize("through", [1, 2])
def test_same_seed_same_wall(through: int) -> None:
    one, two, other = (rubble_wall(2.0, 1.0, seed=s, through=through) for s in (5, 5, 6))
    assert one.geometry == two.geometry != other.geometry


@pytest.mark.parametrize("seed", range(6))
def test_without_spread_it_is_a_running_bond(seed: int) -> None:
    """With half a stone of bond nothing is left to draw but the first course's kind."""
    equal = {"widths": (0.4, 0.4), "heights": (0.175, 0.175), "bond": 0.5}
    scene = rubble_wall(1.6, 0.7, 0.2, seed=seed, **equal)
    first = "half" if "b1.5" in extents(scene) else "whole"
    laid = wall(running_bond(4, 4, first=first), unit=(0.4, 0.2, 0.175))
    own, others = extents(scene), extents(laid)
    assert list(own) == list(others)
    for name, box in own.items():
        assert box == pytest.approx(others[name], abs=ROUNDING)
    found, expected = (solve(s, tolerance=1e-7) for s in (scene, laid))
    assert found.load_factor == pytest.approx(expected.load_factor, rel=3e-7)  # two brackets


def test_one_stone_is_a_single_block() -> None:
    """Friction 0.7 lets it rock about its foot at length / height."""
    one = rubble_wall(0.4, 1.0, 0.4, seed=0, widths=(0.4, 0.4), heights=(1.0, 1.0))
    assert extents(one)["b1.1"] == pytest.approx(extents(single_block())["b1"])
    assert solve(one).load_factor == pytest.approx(0.4, rel=1e-5)


@pytest.mark.parametrize(("seed", "through"), [(0, 1), (1, 2), (2, 3)])
def test_draws_are_solved_and_certified(seed: int, through: int) -> None:
    push = Load(acceleration=(0.0, 1.0, 0.0))
    scene = rubble_wall(1.6, 1.0, 0.4, seed=seed, through=through, live=push)
    solution = solve(scene, tolerance=1e-6)
    assert_certified(solution, scene, tolerance=1e-6)
    # where stones go through, it can turn over as a whole; a leaf falls no later
    assert solution.upper <= 0.4 / 1.0 * (1.0 + 1e-6)


def test_side_supports_and_name_are_those_of_walls() -> None:
    scene = rubble_wall(1.0, 0.5, seed=2, side_supports=["end"], name="mine", friction=0.4)
    assert (scene.supports, scene.name, scene.friction) == (("ground", "side-end"), "mine", 0.4)


class TestGroundCuts:
    def test_contacts_of_a_cut_ground_add_up_to_those_of_a_whole_one(self) -> None:
        whole, cut = facade(3.6, 4), facade(3.6, 4, ground_cuts=[1.1, 2.4])
        assert cut.supports == ("ground1", "ground2", "ground3")
        areas = [sum(c.area for c in s.contacts) for s in (whole, cut)]
        assert areas[0] == pytest.approx(areas[1])
        found = [solve(s, tolerance=1e-7).load_factor for s in (whole, cut)]
        assert found[0] == pytest.approx(found[1], rel=3e-7)  # two brackets

    def test_the_reaction_of_all_parts_is_the_weight(self) -> None:
        scene = facade(3.6, 4, ground_cuts=1.8)
        weight = sum(scene.blocks[i].weight for i in scene.free)
        both = settlement(scene, [SupportMotion(scene.supports, (0.0, 0.0, -1.0))])
        assert both.value == pytest.approx(weight, rel=1e-5)
        right = settlement(scene, [SupportMotion("ground2", (0.0, 0.0, -1.0))])
        assert 0.0 < right.value < 0.5 * weight

    @pytest.mark.parametrize("cuts", [[0.0], [3.6], [2.0, 1.0], [1.0, 1.0], [float("nan")]])
    def test_cuts_outside_the_wall_or_out_of_order_are_refused(self, cuts: list[float]) -> None:
        with pytest.raises(InputError, match=r"ground_cuts must ascend, between 0 and 3\.6, got"):
            facade(3.6, 4, ground_cuts=cuts)

    @pytest.mark.parametrize("cuts", ["a", ["a"], None])
    def test_cuts_that_are_no_numbers_are_refused(self, cuts: Any) -> None:
        with pytest.raises(InputError, match="ground_cuts must be"):
            facade(3.6, 4, ground_cuts=cuts)


NONSENSE: dict[str, tuple[Callable[[], Scene], str]] = {
    "no length": (lambda: rubble_wall(0.0, 1.0, seed=1), "length of the wall must be above 0"),
    "turned": (
        lambda: rubble_wall(2.0, 1.0, seed=1, widths=(0.6, 0.2)),
        r"widths must be \(least, most\), got \(0.6, 0.2\): turn them round",
    ),
    "no range": (
        lambda: rubble_wall(2.0, 1.0, seed=1, heights=0.2),  # type: ignore[arg-type]
        r"heights \(least, most\) must be 2 numbers, got 0.2",
    ),
    "no width": (
        lambda: rubble_wall(2.0, 1.0, seed=1, widths=(0.0, 0.2)),
        "the least of widths must be above 0, got 0.0",
    ),
    "no bond": (lambda: rubble_wall(2.0, 1.0, seed=1, bond=0.0), "bond must be above 0, got 0.0"),
    "all bond": (lambda: rubble_wall(2.0, 1.0, seed=1, bond=0.6), "bond must be at most 0.5.* 0.6"),
    "seed": (lambda: rubble_wall(2.0, 1.0, seed=-1), "seed must be a whole number of at least 0"),
    "through": (lambda: rubble_wall(2.0, 1.0, seed=1, through=0), "through must be a whole number"),
    "low": (
        lambda: rubble_wall(2.0, 1.0, seed=1, heights=(0.3, 0.32)),
        "no number of courses of 0.3 to 0.32 is 1 high: change height or heights",
    ),
    "short": (
        lambda: rubble_wall(0.5, 1.0, seed=1, widths=(0.6, 0.7)),
        "no number of stones 0.6 to 0.7 wide is 0.5 long: change length or widths",
    ),
    "unbonded": (
        lambda: rubble_wall(1.5, 1.0, seed=1, widths=(0.4, 0.4), bond=0.5),
        "of stones 0.4 to 0.4 wide found no bond of 0.2 in 1.5 of length, in 100 tries",
    ),
}


@pytest.mark.parametrize(("make", "message"), NONSENSE.values(), ids=NONSENSE.keys())
def test_nonsense_is_refused(make: Callable[[], Scene], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
