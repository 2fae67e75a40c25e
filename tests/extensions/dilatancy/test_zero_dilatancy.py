"""Friction without dilatancy: published ranges, and solutions checked by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from cvxlimit import Block, Load, Road, Scene, Solution, Status, builtin_scene, passive, solve
from cvxlimit.cli.main import run
from cvxlimit.errors import ModelError
from cvxlimit.extensions.dilatancy.remarks import about_zero, found_by
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.io import read_result
from cvxlimit.masonry import Arch, bridge, single_block
from cvxlimit.model.formulations import vertex_forces
from cvxlimit.solution import Search
from exhaustive import mostly_slow, slow
from grooves import wedge
from helpers import renumbered, rotations
from members import assert_member

FloatArray = NDArray[np.float64]

PUBLISHED = {
    "ferris-tin-loi-1": (0.638982, 0.642859),
    "ferris-tin-loi-2": (0.557416, 0.579606),
    "ferris-tin-loi-3": (0.355817, 0.388684),
}
"""Lowest and highest exact solutions found by linear programs on complementarity pieces, by an
independent prototype in the plane. The true set may be wider."""

ASSOCIATED = {"ferris-tin-loi-1": 0.642859, "ferris-tin-loi-2": 0.579999,
              "ferris-tin-loi-3": 0.403694}  # fmt: skip


@cache
def solved(name: str, seed: int = 0) -> Solution:
    return solve(builtin_scene(name), method=ZeroDilatancy(seed=seed, searches=3))


RINGS = [(v, r, k) for v in (8, 12, 16, 24) for r in (2, 4) for k in (0.0, 1.5)]
RINGS += [(46, 2, 0.0), (46, 2, 1.5)]
RINGS.remove(
    (8, 4, 1.5)
)  # one search ends at a loss of 2.5e-6, Gilbert's scheme at 228.51 of 276.07


@pytest.mark.parametrize("ring", mostly_slow(RINGS, [(8, 4, 0.0), (12, 2, 1.5)]))
@pytest.mark.exhaustive_cases("ring4")
def test_rings_that_came_apart_and_carry_soil(ring: tuple[int, int, float]) -> None:
    """Bolton 3-2 and 5-2 under a load at the quarter: rings slide on each other, which dilatancy
    makes dearer, and each search finds a member within its budget."""
    voussoirs, rings, soil = ring
    span, rise = (3.0, 0.75) if rings == 2 else (5.0, 1.25)
    arch = Arch(span, rise, voussoirs=voussoirs)
    sizes = {"thickness": 0.215 * rings / 2.0, "width": 2.88, "cover": 0.305}
    scene = bridge(arch, friction=0.6, rings=rings, ring_friction=0.53, fill=22.2, **sizes)
    level = arch.rise + sizes["thickness"] + sizes["cover"]
    if soil:
        scene = replace(scene, reactions=passive(scene, level, 22.2, soil))
    points = Road(scene, level).load(0.25 * arch.span, 1.0).points
    scene = scene.with_live(Load(points=points))
    found = solve(scene, method=ZeroDilatancy(searches=1))
    assert found.status is Status.CONVERGED
    assert found.lower <= found.load_factor < found.upper
    for member in found.members:
        assert_member(scene, member.forces, member.mechanism, member.load_factor)


@pytest.mark.parametrize("name", mostly_slow(PUBLISHED, []))
def test_walls_within_what_is_known(name: str) -> None:
    """Nothing is above the associated factor, nothing below what an exhaustive search found, and
    that lowest one is found again."""
    solution = solved(name)
    lowest, _ = PUBLISHED[name]
    assert solution.status is Status.CONVERGED
    assert solution.flow == "zero-dilatancy"
    factors = [member.load_factor for member in solution.members]
    assert factors == sorted(factors)
    assert solution.load_factor == factors[0] == pytest.approx(lowest, rel=1e-5)
    assert factors[-1] > lowest * (1 + 1e-3)
    assert factors[-1] <= solution.upper * (1 + 1e-6)
    assert solution.bracket.upper_is_proved
    assert solution.upper == pytest.approx(ASSOCIATED[name], rel=1e-5)
    assert max(member.residual for member in solution.members) <= 1e-6
    for member in (solution.members[0], solution.members[-1]):
        assert_member(builtin_scene(name), member.forces, member.mechanism, member.load_factor)


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", [100, 200, 300, 400])
@pytest.mark.parametrize("name", PUBLISHED)
def test_other_seeds_find_the_same(name: str, seed: int) -> None:
    """Up to a thousandth: a search asks for members that are lower than its lowest by as much."""
    assert solved(name, seed).load_factor == pytest.approx(PUBLISHED[name][0], rel=1e-3)


def planar_wall_without_a_first_member() -> Scene:
    """Seventeen stones: pairs that begin at the associated mechanism stall above a loss of 4e-4."""
    ends = (
        (0.256294572611077, 0.5859621735051198, 1.0114291602972663, 1.4308286907636063),
        (0.20824496400014728, 0.6017074244714533, 1.0021038563365705, 1.3369064152389611),
        (0.7740211503443472, 1.3465228172907002),
        (0.4941744, 0.9314, 1.4812),
    )
    blocks = [Block.box("ground", (-1.0, -0.5, -0.5), (2.7858462, 0.9, 0.0))]
    for course, cuts in enumerate(ends):
        low, high = 0.3 * course, 0.3 * course + 0.3
        for k, (start, end) in enumerate(pairwise((0.0, *cuts, 1.7858462))):
            blocks.append(Block.box(f"s{course}_{k}", (start, 0, low), (end, 0.4, high), 20.0))
    push = Load(acceleration=(1, 0, 0))
    return Scene(blocks, ["ground"], push, friction=0.6392563488836344)


@pytest.mark.parametrize("seed", mostly_slow(range(5), [0]))
def test_a_wall_where_the_associated_mechanism_leads_to_none(seed: int) -> None:
    """Its lowest member was confirmed by hand: 0.53413."""
    scene = planar_wall_without_a_first_member()
    found = solve(scene, method=ZeroDilatancy(seed=seed, searches=1))
    assert found.load_factor == pytest.approx(0.53413, rel=1e-3)
    assert_member(scene, found.forces, found.members[0].mechanism, found.load_factor)


@pytest.mark.parametrize(
    ("half", "dip", "friction"),
    [
        (30, 15, 0.6),
        *(slow(*each) for each in ((30, 15, 0.57), (30, 15, 0.4), (45, 20, 0.5), (60, 25, 0.6))),
    ],
)
def test_a_wedge_in_a_groove_to_1e_5(half: float, dip: float, friction: float) -> None:
    """It slides along the groove, closed: mu cos(dip) / sin(half) - sin(dip). The first one has no
    associated load factor, since it jams where it dilates. Friction at an angle to slip loses the
    square of the angle: members that lose 1e-6 would be 1e-3 lower."""
    tilt = np.radians(dip)
    closed = friction * np.cos(tilt) / np.sin(np.radians(half)) - np.sin(tilt)
    found = solve(wedge(half, dip, friction), method=ZeroDilatancy(searches=2))
    assert found.load_factor == pytest.approx(closed, rel=1e-5)
    assert np.isinf(found.upper) == (half == 30 and friction == 0.6)


GROOVES = [(30.0, 15.0, 0.58)]
"""Half angle and dip in degrees, and friction: first one that was told 1e-3 too low."""
GROOVES += [
    (half, dip, mu)
    for half, dip, mu in np.random.default_rng(7)
    .uniform((15, 2, 0.25), (75, 35, 0.9), (14, 3))
    .tolist()
    if mu / np.sin(np.radians(half)) > 1.1 * np.tan(np.radians(dip))  # it stands by itself
]


@pytest.mark.parametrize("groove", mostly_slow(GROOVES, GROOVES[:2]), ids=str)
def test_what_members_say_of_their_error_holds_with_any_solver(
    groove: tuple[float, float, float],
) -> None:
    """Through Clarabel states below the one load factor there is pass every check to 1e-6: with
    friction at an angle to slip. They are settled before they count, and the angle is told."""
    half, dip, friction = groove
    tilt = np.radians(dip)
    closed = friction * np.cos(tilt) / np.sin(np.radians(half)) - np.sin(tilt)
    found = solve(wedge(half, dip, friction), method=ZeroDilatancy(searches=2), ladder=["CLARABEL"])
    assert found.load_factor == pytest.approx(closed, rel=1e-5)
    for member in found.members:
        assert member.angle is not None
        assert member.is_settled
        # statics multiply it by the groove's 1 / sin(half), four at most; digits of a solver
        assert abs(member.load_factor / closed - 1.0) < 10.0 * member.angle + 1e-6


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["tuff-wall", "facade", "house-corner"])
def test_space(name: str) -> None:
    """To 1e-6, checked by hand."""
    scene = builtin_scene(name)
    found = solve(scene, method=ZeroDilatancy(searches=1))
    assert found.status is Status.CONVERGED
    for member in found.members:
        assert member.residual <= 1e-6
        assert_member(scene, member.forces, member.mechanism, member.load_factor)


@pytest.mark.exhaustive
@given(rotations())
@settings(max_examples=1)
def test_rotation(turn: FloatArray) -> None:
    """The first member is of the same problem in any frame: so is its load factor."""
    scene, rule = builtin_scene("ferris-tin-loi-1"), ZeroDilatancy(searches=1, budget=10)
    one, two = (solve(s, method=rule).members[-1].load_factor for s in (scene, scene.moved(turn)))
    assert one == pytest.approx(two, rel=1e-5)


def test_a_slope_that_stands_by_its_state_of_forces() -> None:
    """A block on a slope that is too steep, held by a wedge of stone: 0 lies between members, or
    all are below it, and that is said."""
    assert "0 lies between" in about_zero(-0.1, 0.2)
    assert "below zero" in about_zero(-0.2, -0.1)
    assert about_zero(0.1, 0.2) == ""


class TestWordsOnSearches:
    """They claim no more than that it is the lowest of so many."""

    def test_all_alike(self) -> None:
        searches = [Search(seed, 0.3116 + 1e-5 * seed, 300, 90) for seed in range(3)]
        assert found_by(searches).startswith(
            "lowest of 3 searches, ended at 0.3116; whether there are lower ones is not known"
        )

    def test_apart(self) -> None:
        ends = ((0.868, 10), (0.740, 290), (0.744, 30))
        said = found_by([Search(k, factor, 300, at) for k, (factor, at) in enumerate(ends)])
        assert said.startswith("lowest of 3 searches, ended at 0.7400, 0.7440, 0.8680; the last")
        assert "gain came after 290 of 300 solves: search on" in said
        assert "--searches" in said

    def test_one_and_none(self) -> None:
        assert "lowest of one search, ended at 0.5" in found_by([Search(7, 0.5, 300, 2)])
        said = found_by([Search(0, None, 300, 0), Search(1, 0.5, 300, 12)])
        assert said.startswith("lowest of 2 searches, ended at 0.5, none; the last gain")
        assert found_by([Search(0, None, 300, 0)]) == ""


class TestSmall:
    def test_a_load_straight_down_gives_no_number(self) -> None:
        """It does no harm with associated friction, and what the iteration ends at is no answer."""
        block = single_block()
        pressed = Scene(block.blocks, block.supports, Load(acceleration=(0, 0, -1)), friction=0.4)
        found = solve(pressed, method="zero-dilatancy")
        assert (found.status, found.load_factor) == (Status.NOT_CONVERGED, None)
        assert np.isinf(found.upper)
        assert found.bracket.lower_is_proved or np.isinf(found.lower)  # there is no solution

    def test_a_sliding_and_a_tipping_block_are_unique(self) -> None:
        for height, expected in ((0.5, 0.6), (2.0, 0.5)):
            solution = solve(
                single_block((1.0, 1.0, height), friction=0.6), method="zero-dilatancy"
            )
            spread = [member.load_factor for member in solution.members]
            np.testing.assert_allclose(spread, expected, rtol=1e-5)
            first = solution.members[0]
            assert all(type(x) is float for x in vars(first).values() if np.ndim(x) == 0
                       and not isinstance(x, (str, int)))  # as people read them  # fmt: skip

    def test_wedged_block_slides_at_less_than_the_associated_factor(self) -> None:
        """A block under a fixed lintel that just touches: to slide it must dilate, and cannot, if
        friction is associated. Without dilatancy any clamping force will do, none among them, and
        then it slides at 0.4."""
        ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
        lintel = Block.box("lintel", (-1, -1, 1), (2, 2, 2))
        block = Block.box("block", (0, 0, 0), (1, 1, 1), density=1.0)
        scene = Scene([ground, lintel, block], ["ground", "lintel"], Load(acceleration=(1, 0, 0)),
                      friction=0.4)  # fmt: skip
        assert solve(scene).status is Status.UNBOUNDED
        solution = solve(scene, method=ZeroDilatancy(searches=1))
        assert solution.status is Status.CONVERGED
        assert solution.load_factor == pytest.approx(0.4, rel=1e-5)

    def test_units_and_numbering(self) -> None:
        """The first start is the same problem in any units and order: so is the lowest member on
        its mechanism, as far as that is unique."""
        scene = single_block((1.0, 1.0, 0.5), friction=0.6)
        for other in (scene.in_units(scene.units, 1e3, 1e3), renumbered(scene, 1)):
            found = solve(other, method="zero-dilatancy")
            assert found.load_factor == pytest.approx(0.6, rel=1e-5)

    def test_given_up(self) -> None:
        """What is known is said, and nothing that has just failed is recommended."""
        rule = ZeroDilatancy(searches=1, budget=2, tolerance=1e-12)
        solution = solve(builtin_scene("ferris-tin-loi-3"), method=rule)
        assert solution.status is Status.NOT_CONVERGED
        assert "no solution without dilatancy was found" in solution.note
        assert "the smallest loss was" in solution.note
        assert "none above 0.40369" in solution.note
        assert "method 'zero-dilatancy'" not in solution.note
        assert solution.advice == solution.note
        assert not solution.members

    def test_command_line_and_file(self, tmp_path: Path) -> None:
        out = tmp_path / "out.json"
        arguments = ["solve", "single-block", "--method", "zero-dilatancy", "--json", str(out)]
        assert run(arguments) == 0
        document = json.loads(out.read_text())
        assert document["flow"] == "zero-dilatancy"
        assert document["upper"] == pytest.approx(document["members"][-1]["load_factor"], rel=1e-5)
        again = read_result(out)
        assert len(again.members) == len(document["members"]) >= 1
        assert run(["solve", "stack", "--method", "none"]) == 2

    def test_seeds_and_budgets_on_the_command_line(self, tmp_path: Path) -> None:
        out = tmp_path / "out.json"
        efforts = ["--seed", "3", "--searches", "2", "--budget", "40"]
        arguments = ["solve", "ferris-tin-loi-2", *efforts]
        assert run([*arguments, "--method", "zero-dilatancy", "--json", str(out)]) == 0
        document = json.loads(out.read_text())
        assert [search["seed"] for search in document["searches"]] == [3, 4]
        assert all(40 <= search["solves"] <= 42 for search in document["searches"])
        lowest = min(search["load_factor"] for search in document["searches"])
        assert lowest == document["load_factor"]
        assert read_result(out).searches[1].seed == 4
        assert run(arguments) == 2  # of method convex they are none

    def test_refusals(self) -> None:
        scene = builtin_scene("single-block")
        with pytest.raises(ModelError, match="brings its own formulation"):
            solve(scene, method="zero-dilatancy", formulation=vertex_forces)
        for wrong in ({"seed": -1}, {"searches": 0}, {"budget": 0}):
            with pytest.raises(ModelError, match=f"^{next(iter(wrong))} must be"):
                replace(ZeroDilatancy(), **wrong)
