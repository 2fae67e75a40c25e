"""From rest to collapse: closed forms, limits, checks of states, ends, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from cvxlimit import (
    Block,
    Incremental,
    Load,
    PointForce,
    Pressure,
    Reaction,
    Scene,
    Solution,
    Units,
    builtin_scene,
    solve,
)  # fmt: skip
from cvxlimit.errors import InputError, ModelError
from cvxlimit.masonry import running_bond, wall
from cvxlimit.scene.reactions import Tie
from cvxlimit.solution import Status
from grooves import wedge
from helpers import read, renumbered

PLAIN = Incremental(spread=False)
GROUND = Block.box("ground", (-5, -5, -1), (5, 5, 0))
PUSH = Load(acceleration=(1, 0, 0))


def assert_sound(solution: Solution) -> None:
    """What is true of every state: equilibrium, friction, slip against it; at the end the rates
    are a mechanism at which friction and loads do equal work."""
    assert len(solution.steps) > 1
    for step in solution.steps:
        assert step.equilibrium < 1e-7  # Newton's 1e-9 of the largest load, beside one block's
        assert step.yield_excess < 1e-12
        assert step.against < 1e-9
    assert solution.load_factor == max(step.load_factor for step in solution.steps)


def block(friction: float = 0.7, live: Load = PUSH) -> Scene:
    stone = Block.box("stone", (0, 0, 0), (0.4, 0.8, 1.0), density=20.0)
    return Scene([GROUND, stone], ["ground"], live=live, friction=friction)


FEET = ((0.0, 0.3, 0.2), (1.1, 1.3, 0.6), (1.8, 2.4, 0.4))
"""Where three feet begin and end along a beam, and their friction."""


def on_feet() -> tuple[Scene, float]:
    """A beam with a block on it on three feet, pushed along them at their level, and what it
    carries: pressure goes with a foot's area and is linear along the beam, so that two equations
    have it, and slips change nothing of it. Two feet more than statics knows."""
    feet = [Block.box(f"foot{i}", (a, 0, -1), (b, 1, 0)) for i, (a, b, _) in enumerate(FEET)]
    beam = Block.box("beam", (0, 0, 0), (2.4, 1, 0.4), density=20.0)
    block = Block.box("block", (1.2, 0, 0.4), (1.8, 1, 0.8), density=30.0)
    scene = Scene(
        [*feet, beam, block], [foot.id for foot in feet], friction=0.5,
        contact_friction={(f"foot{i}", "beam"): mu for i, (*_, mu) in enumerate(FEET)},
        live=Load(points=(PointForce("beam", (0.0, 0.5, 0.0), (1, 0, 0)),)),
    )  # fmt: skip
    start, end, mu = np.array(FEET).T
    a, x = end - start, (start + end) / 2.0
    load = 19.2 + 7.2, 19.2 * 1.2 + 7.2 * 1.5
    first = a @ x
    p = np.linalg.solve([[a.sum(), first], [first, (a**3 / 12.0 + a * x**2).sum()]], load)
    return scene, float(mu @ (a * (p[0] + p[1] * x)))


def tied() -> Scene:
    """A block that slides, held from behind by a tie of strength 1 at its middle."""
    behind = Block.box("behind", (-2, 0, 0), (-1, 0.8, 1))
    stone = Block.box("stone", (0, 0, 0), (0.4, 0.8, 0.5), density=20.0)
    tie = Tie("behind", "stone", (-1, 0.4, 0.25), (0, 0.4, 0.25), yield_force=1.0)
    supports = ["ground", "behind"]
    return Scene([GROUND, stone, behind], supports, PUSH, friction=0.3, ties=(tie,))


CLOSED = {
    "two blocks on feet of unequal stiffness": on_feet(),
    "block that a tie holds": (tied(), 0.3 + 1.0 / 3.2),
    "block that a pressure of 10 on its back pushes": (
        block(0.3, Load(pressures=(Pressure("stone", (-1, 0, 0), 10.0),))),
        0.3 * 6.4 / (10.0 * 0.8),
    ),
    "block that tips": (block(), 0.4),
    "block that slides": (block(0.3), 0.3),
    "two blocks that slide, on joints of unequal stiffness": (
        Scene(
            [
                GROUND, Block.box("small", (0, 0, 0), (0.3, 0.5, 0.2), density=20.0),
                Block.box("large", (0.3, 0, 0), (1.5, 0.5, 0.4), density=30.0),
            ],
            ["ground"], friction=0.4,
            contact_friction={("ground", "small"): 0.2, ("small", "large"): 0.0}, live=PUSH,
        ),
        (0.2 * 0.6 + 0.4 * 7.2) / (0.6 + 7.2),
    ),
    "block clamped by a prop that bears no shear": (
        Scene(
            [GROUND, Block.box("stone", (0, 0, 0), (1, 1, 0.3), density=20.0)], ["ground"],
            friction=0.5, live=PUSH,
            dead=Load(
                gravity=(0, 0, -1), points=(PointForce("stone", (0.5, 0.5, 0.3), (0, 0, -9)),)
            ),
        ),
        0.5 * (6.0 + 9.0) / 6.0,
    ),
    "stack": (builtin_scene("stack"), 0.4),
    "arch": (builtin_scene("arch"), solve(builtin_scene("arch")).load_factor),
    "wall that overturns as one": (builtin_scene("tuff-wall"), 1.0 / 6.0),
}  # fmt: skip


@pytest.mark.parametrize("name", CLOSED)
def test_closed_forms(name: str) -> None:
    scene, exact = CLOSED[name]
    found = solve(scene, method=PLAIN)
    assert found.status is Status.REACHED
    assert found.load_factor == pytest.approx(exact, rel=1e-6)
    assert_sound(found)


GROOVES = [(30, 15, 0.6), (30, 15, 0.58), (30, 15, 0.4), (45, 20, 0.5), (60, 25, 0.6)]


@pytest.mark.parametrize(("half", "dip", "friction"), GROOVES)
def test_a_wedge_slides_along_its_groove(half: float, dip: float, friction: float) -> None:
    """mu cos(dip) / sin(half) - sin(dip): all friction is along the groove in the end. At rest a
    part of it is across, which bears the wedge; that fades as it slides."""
    tilt = np.radians(dip)
    closed = friction * np.cos(tilt) / np.sin(np.radians(half)) - np.sin(tilt)
    found = solve(wedge(half, dip, friction), method=PLAIN)
    assert found.steps[-1].load_factor == pytest.approx(closed, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "value", "share"),
    [
        ("ferris-tin-loi-1", 0.6409, 0.01),
        ("ferris-tin-loi-2", 0.5622, 0.01),
        ("ferris-tin-loi-3", 0.35582, 1e-3),
        ("retaining-wall", 1.728395, 1e-5),
    ],
)
def test_values_of_another_program(name: str, value: float, share: float) -> None:
    """Of a trial with another rule of points and other steps; its own spread is 0.1 to 1 %."""
    scene = builtin_scene(name)
    found = solve(scene, method=PLAIN)
    assert found.load_factor == pytest.approx(value, rel=share)
    assert found.load_factor <= solve(scene).upper * (1.0 + 1e-9)
    assert_sound(found)


def test_turned_renumbered_and_in_other_units() -> None:
    scene = wall(running_bond(2, 3), unit=(0.5, 0.3, 0.25), friction=0.5, density=20.0)
    usual = solve(scene, method=PLAIN).load_factor
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    for other in (
        scene.moved(turn, (1.0, -2.0, 3.0)),
        renumbered(scene, 3),
        scene.in_units(Units("mm", "N"), 1e3, 1e3),
        scene.with_density(7.0),
    ):
        # way and end are the same but for rounding, which decides at points on the verge
        assert solve(other, method=PLAIN).load_factor == pytest.approx(usual, rel=1e-4)
    full = solve(scene, method=PLAIN, model="full")
    assert full.load_factor == pytest.approx(usual, rel=1e-4)


def test_spread_and_curve_are_told() -> None:
    found = solve(builtin_scene("ferris-tin-loi-1"), method="incremental")
    assert [x.what for x in found.from_rest.spread] == ["ratio 0.1", "ratio 1", "half the step"]
    assert found.from_rest.limit == pytest.approx(found.from_rest.limit)
    again = read(found)
    assert again.from_rest.spread == found.from_rest.spread
    assert [s.load_factor for s in again.steps] == [s.load_factor for s in found.steps]
    assert found.steps[0].load_factor == 0.0
    assert found.steps[1].displacement == pytest.approx(
        found.steps[1].load_factor / found.load_factor, rel=0.2
    )  # elastic at first


def test_beds_that_are_not_true_end_between_the_lowest_and_the_limit() -> None:
    scene = wall(running_bond(2, 2), unit=(0.5, 0.3, 0.25), friction=0.5, density=20.0)
    method = Incremental(spread=False, bedding=50.0, draws=4, seed=7)
    found = solve(scene, method=method)
    assert len(found.from_rest.draws) == 4
    for draw in found.from_rest.draws:
        assert draw.end
        if draw.load_factor is not None:
            assert 0.0 < draw.load_factor <= found.from_rest.limit * (1.0 + 1e-6)
    assert solve(scene, method=method).from_rest.draws == found.from_rest.draws
    true = solve(scene, method=replace(method, bedding=0.0, draws=1)).from_rest.draws[0]
    assert true.load_factor == pytest.approx(found.load_factor, rel=1e-9)


def test_bedding_as_a_length_needs_a_stiffness_and_is_the_same_number() -> None:
    """One unit of bedding is the dead load over all stiffness: W / (k A)."""
    scene = block(0.3)
    k = 1e6
    length = 2.0 * scene.total_weight / (k * scene.contacts.area.sum())
    ways = [
        solve(scene, method=Incremental(spread=False, bedding=gap, stiffness=stiffness, draws=2))
        for gap, stiffness in ((2.0, None), (length, k))
    ]
    assert ways[0].from_rest.draws == ways[1].from_rest.draws


def test_cohesion_is_gone_where_a_joint_has_slipped() -> None:
    """The peak is friction and cohesion together, where all points slide at once; then friction."""
    scene = block(0.3).with_cohesion(5.0)
    found = solve(scene, method=PLAIN)
    weight, area = scene.total_weight, 0.4 * 0.8
    assert found.load_factor <= 0.3 + 5.0 * area / weight + 1e-9
    assert found.load_factor > 0.3 + 1e-6
    assert found.steps[-1].load_factor == pytest.approx(0.3, abs=1e-6)
    assert "falls" in found.from_rest.end


def test_a_reaction_gives_way_at_its_most() -> None:
    """A prop behind a sliding block adds what it bears."""
    prop = Reaction("stone", at=(0.4, 0.4, 0.0), direction=(-1, 0, 0), most=2.0)
    scene = replace(block(0.05), reactions=(prop,))
    found = solve(scene, method=PLAIN)
    assert found.load_factor == pytest.approx(0.05 + 2.0 / scene.total_weight, rel=1e-5)


def test_stone_that_crushes_bears_less() -> None:
    strong, weak = (
        solve(scene, method=PLAIN).load_factor
        for scene in (block(), block().with_strength(compressive=100.0))
    )
    # a stress block at the edge, 0.5 (l - W / (f b)) / h: points gather it by a tenth too far out
    assert weak == pytest.approx((0.4 - 6.4 / (100.0 * 0.8)) / 1.0, rel=0.1)
    assert weak < strong


def test_jammed_blocks_carry_any_multiple() -> None:
    scene = block(0.8, live=Load(acceleration=(0.3, 0, -1)))
    found = solve(scene, method=PLAIN)
    assert found.status is Status.ENDLESS
    assert found.load_factor is None
    assert "jam" in found.note


def test_a_way_that_is_cut_short_says_so() -> None:
    found = solve(builtin_scene("tuff-wall"), method=replace(PLAIN, max_steps=3))
    assert found.status is Status.NOT_REACHED
    assert "steps" in found.note
    assert found.load_factor == found.steps[-1].load_factor


def test_a_dead_load_that_falls_is_no_way() -> None:
    scene = block().with_dead(Load(gravity=(0.8, 0, -0.6)))
    assert solve(scene, method=PLAIN).status is Status.DEAD_LOAD_UNSTABLE


def test_a_loose_block_is_pushed_until_it_bears() -> None:
    """A block without weight, on a ground without friction, a centimetre from one that bears."""
    loose = Block.box("loose", (-0.4, 0, 0), (0, 0.8, 1.0), density=0.0)
    live = Load(points=(PointForce("loose", (-0.4, 0.4, 0.1), (1, 0, 0)),))
    scene = replace(block(0.3), blocks=(*block().blocks, loose), live=live)
    found = solve(scene, method=PLAIN)
    assert found.load_factor == pytest.approx(0.3 * scene.total_weight, rel=1e-5)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"ratio": 0.0}, "ratio must be .*got 0"),
        ({"ratio": -1.0}, "ratio must be .*got -1"),
        ({"tolerance": 2.0}, "tolerance must be .*got 2"),
        ({"max_steps": 0}, "max_steps must be .*got 0"),
        ({"bedding": -1.0}, "bedding must be .*got -1"),
        ({"draws": 0}, "draws must be .*got 0"),
        ({"seed": -1}, "seed must be .*got -1"),
        ({"stiffness": 1e6}, "stiffness 1e.06 does nothing without bedding"),
    ],
)
def test_settings_are_refused_by_name(given: dict, said: str) -> None:
    with pytest.raises((InputError, ModelError), match=said):
        Incremental(**given)


def test_what_elastic_joints_are_not_stated_for_is_refused() -> None:
    with pytest.raises(ModelError, match="tensile_strength"):
        solve(block().with_strength(tensile=10.0), method=PLAIN)
    with pytest.raises(ModelError, match="goes with surface"):
        solve(block(), "octagon", method=PLAIN)


@pytest.mark.parametrize("friction", [0.3, 0.7])
def test_the_step_in_cvxpy_ends_where_the_engine_does(friction: float) -> None:
    """Forces against displacements, another solver, twelve steps that grow."""
    scene = wall(running_bond(1, 2), unit=(0.5, 0.3, 0.25), friction=friction, density=20.0)
    found = solve(scene, method=PLAIN)
    step = found.problem
    factors = [step.advance(0.2 * 2.0**k) for k in range(12)]
    assert max(factors) == pytest.approx(found.load_factor, rel=5e-3)
