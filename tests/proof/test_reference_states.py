"""States a solver finds so that bounds need no assumption: self-stress, dead load, opening."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from cvxlimit import Block, Certifier, Load, Scene, Status, builtin_scene, solve
from cvxlimit.masonry import panel, running_bond, single_block, wall
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LargestFactor, largest_self_stress
from cvxlimit.proof.admissible import carried_exactly
from cvxlimit.proof.gluing import with_contacts
from cvxlimit.proof.strength import Strength
from cvxlimit.scene import Units
from cvxlimit.solvers import SolverSettings, default_ladder
from cvxlimit.surfaces import Rocking, Torsion, TorsionShear
from helpers import assert_certified, missing_opening, scenes, yield_excess

SURFACES = (Rocking(), TorsionShear())


def wedged(friction: float) -> Scene:
    """A cube on the ground between two fixed walls that touch it."""
    blocks = (
        Block.box("ground", (-5, -5, -1), (5, 5, 0)),
        Block.box("left", (-1, 0, 0), (0, 1, 1)),
        Block.box("right", (1, 0, 0), (2, 1, 1)),
        Block.box("cube", (0, 0, 0), (1, 1, 1), 20.0),
    )
    push = Load(acceleration=(0, 1, 0))
    return Scene(blocks, ("ground", "left", "right"), push, friction=friction)


def self_stress(scene: Scene) -> tuple[float, np.ndarray]:
    """Largest sum of compressions, none above 1, and the duals as rates (free, 6)."""
    problem = LimitProgram(scene, goal=largest_self_stress)
    state = problem.run()
    assert state.mechanism is not None
    value = float(state.forces[:, 2].sum()) / problem.scaling.force
    return value, state.mechanism * problem.scaling.live


class TestSelfStress:
    @pytest.mark.parametrize("friction", [0.0, 0.1, 0.25, 0.5, 0.8])
    def test_wedged_cube(self, friction: float) -> None:
        """Walls press with 1 each, and pull the cube down with mu each: 2 + min(1, 2 mu)."""
        value, _ = self_stress(wedged(friction))
        assert value == pytest.approx(2.0 + min(1.0, 2.0 * friction), abs=1e-7)

    @given(scene=scenes())
    @settings(max_examples=20, deadline=None)
    def test_either_self_stress_or_rates_that_open_everything(self, scene: Scene) -> None:
        """The theorem of the alternative; 0.99 of the unit by which rates open more than asked."""
        value, rates = self_stress(scene)
        opens = missing_opening(scene, rates).max() < -0.99
        assert opens == (value < 1e-3)

    @pytest.mark.parametrize("name", ["tuff-wall", "s12-panel", "arch"])
    def test_none_in_walls_and_arches(self, name: str) -> None:
        scene = builtin_scene(name)
        value, rates = self_stress(scene)
        assert value == pytest.approx(0.0, abs=1e-6)
        assert missing_opening(scene, rates).max() < -0.99

    def test_a_bracket_on_a_wedged_cube_is_proved_without_opening_it(self) -> None:
        """A rider on the cube slides at 0.5: no rates open all contacts, but the cube does not move
        and counts as ground."""
        scene = wedged(0.5)
        rider = Block.box("rider", (0.2, 0.2, 1), (0.8, 0.8, 1.3), 20.0)
        scene = replace(scene, blocks=(*scene.blocks, rider))
        assert self_stress(scene)[0] > 0.1
        solution = solve(scene)
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(0.5, rel=1e-5)


def cornered(friction: float, live: Load, width: float = 0.5, height: float = 1.0) -> Scene:
    """A block on the ground that touches a wall 1 high."""
    blocks = (
        Block.box("ground", (-5, -5, -1), (5, 5, 0)),
        Block.box("wall", (-1, 0, 0), (0, 1, 1)),
        Block.box("block", (0, 0, 0), (width, 1, height), 20.0),
    )
    return Scene(blocks, ("ground", "wall"), live, friction=friction)


class TestCorners:
    @pytest.mark.parametrize(
        ("width", "height", "push"),
        [(1.0, 0.4, 0.01), (1.0, 0.4, 0.3), (1.0, 1.0, 0.3), (0.5, 1.7, 0.1)],
    )
    def test_forces_far_above_the_loads(self, width: float, height: float, push: float) -> None:
        """At friction 1 rates (1, 0, 1) cost nothing at wall and floor: at most 1 / push.

        A linear program over points of the friction cone comes within 3e-5 of that, with forces of
        1e6 weights and more. Ten total loads were assumed never to be exceeded, and upper bounds
        fell to 1e-2 below it.
        """
        live = Load(acceleration=(push, 1, 0))
        solution = solve(cornered(1.0, live, width, height))
        assert solution.lower <= (1.0 + 1e-9) / push
        assert solution.upper >= (1.0 - 3e-5) / push
        assert 0.9 / push < solution.lower <= solution.upper < 1.1 / push  # not useless either

    @pytest.mark.parametrize("live", [(-1, 0, 0), (0, 0, -1), (-1, 0, -1)])
    def test_loads_that_press_do_no_harm_without_friction(self, live: tuple[float, ...]) -> None:
        """Contacts that carry nothing have rounding only, and no forces of their own to share."""
        solution = solve(cornered(0.0, Load(acceleration=live)))
        assert solution.status is Status.LIVE_LOAD_HARMLESS


def propped(units: int) -> Scene:
    """The paper's tuff wall of three courses per unit, held at one end and pushed out of plane."""
    return wall(
        running_bond(units, 3 * units),
        unit=(0.1, 0.1, 0.05),
        density=12.1,
        friction=0.51,
        side_supports=("start",),
        live=Load(acceleration=(0.0, 1.0, 0.0)),
    )


class TestProofs:
    """Scenes on which projections find reference states late, or not at all."""

    @pytest.mark.exhaustive_cases("11")
    @pytest.mark.parametrize("units", [7, 11])
    def test_propped_walls_open(self, units: int) -> None:
        scene = propped(units)
        solution = solve(scene)
        assert_certified(solution, scene)
        assert solution.is_proved

    @pytest.mark.exhaustive
    def test_a_panel_with_thin_reserve_stands(self) -> None:
        scene = panel(1.4, 40, left_return=0.52, right_return=0.52)
        assert Certifier(scene, SURFACES).references.dead_state is None
        solution = solve(scene, "octagon")
        assert_certified(solution, scene)
        assert solution.is_proved

    def test_live_load_that_lifts_a_snug_panel(self) -> None:
        """Clarabel says 0.07 where 0.0004 is true: half a brick, lifted and pushed, in any unit."""
        live = Load(acceleration=(1.0, 0.0, -0.5))
        scene = panel(0.20001, 2, left_return=0.1, friction=0.35, live=live)
        solution = solve(scene)
        assert_certified(solution, scene)
        again = solve(scene.in_units(Units("mm", "N"), 1e3, 1e3))
        assert_certified(again)
        assert again.lower <= solution.upper
        assert solution.lower <= again.upper

    @pytest.mark.parametrize("tolerance", [1e-6, 1e-8])
    @pytest.mark.parametrize("name", ["tuff-wall", "s12-panel", "ferris-tin-loi-2"])
    @pytest.mark.parametrize("surface", ["conic", "octagon"])
    @pytest.mark.exhaustive_cases("conic-s12-panel-1e-08", "octagon-s12-panel-1e-06")
    def test_narrow_brackets(self, name: str, surface: str, tolerance: float) -> None:
        scene = builtin_scene(name)
        solution = solve(scene, surface, tolerance=tolerance)
        assert_certified(solution, scene, tolerance=tolerance)


class TestOffers:
    """Whatever is offered is looked at: nothing false gets in, nothing better gets lost."""

    @staticmethod
    def resting(scene: Scene) -> np.ndarray:
        """Forces that carry the dead load alone, from a solver."""
        alone = scene.with_live(scene.dead).with_dead(Load())
        state = LimitProgram(alone, goal=LargestFactor(most=1.0)).run()
        assert state.forces is not None
        assert state.load_factor is not None
        return state.forces / state.load_factor

    def test_a_good_dead_state_replaces_a_poor_one(self) -> None:
        scene = builtin_scene("tuff-wall")
        certifier = Certifier(scene, SURFACES)
        poor = certifier.references.dead_state
        assert poor is not None
        assert certifier.offer_dead_state(self.resting(scene))
        good = certifier.references.dead_state
        assert good is not None
        assert yield_excess(scene, good).max() < yield_excess(scene, poor).max() < 0.0
        assert certifier.offer_dead_state(poor)
        assert certifier.references.dead_state is good

    @pytest.mark.parametrize("factor", [0.0, -1.0, np.nan, 1e6])
    def test_forces_of_any_size_are_balanced_or_refused(self, factor: float) -> None:
        scene = builtin_scene("s12-panel")
        certifier = Certifier(scene, SURFACES)
        accepted = certifier.offer_dead_state(factor * self.resting(scene))
        kept = certifier.references.dead_state
        assert kept is not None
        assert yield_excess(scene, kept).max() < 0.0
        assert not (accepted and np.isnan(factor))

    def test_forces_outside_are_refused(self) -> None:
        scene = single_block(friction=0.0)
        certifier = Certifier(scene.with_dead(Load(acceleration=(0.1, 0.0, -1.0))), SURFACES)
        assert not certifier.offer_dead_state(self.resting(scene))
        assert certifier.references.dead_state is None

    @pytest.mark.parametrize("sign", [0.0, -1.0, np.nan])
    def test_rates_that_do_not_open_are_refused(self, sign: float) -> None:
        scene = wedged(0.5)
        certifier = Certifier(scene, SURFACES)
        rates = np.ones((1, 6))
        certifier.offer_opening_field(sign * rates)
        assert certifier.references.opening_field is None

    def test_verdicts_do_not_depend_on_the_offer(self) -> None:
        """A wall whose dead load points up falls, whatever was offered before."""
        scene = builtin_scene("tuff-wall").with_dead(Load(gravity=(0.0, 0.0, 1.0)))
        certifier = Certifier(scene, SURFACES)
        assert not certifier.offer_dead_state(-self.resting(builtin_scene("tuff-wall")))
        assert solve(scene).status is Status.DEAD_LOAD_UNSTABLE


def pebble_on_boulder(
    side: float, live: dict[str, tuple[float, ...]], height: float = 1.0
) -> Scene:
    """Unit boulder and a pebble on it, with live forces of the pebble's own weight."""
    blocks = (
        Block.box("ground", (-2, -2, -1), (4, 2, 0)),
        Block.box("boulder", (0, 0, 0), (1, 1, 1), density=1.0),
        Block.box(
            "pebble", (0.3, 0.3, 1), (0.3 + side, 0.3 + side, 1 + height * side), density=1.0
        ),
    )
    return Scene(blocks, ("ground",), Load(forces=live), friction=0.5)


class TestSmallBlocks:
    """What is nothing beside the total load may be all that a small block is loaded with."""

    def test_a_pushed_pebble_is_not_carried_by_a_pressed_boulder(self) -> None:
        """The pebble slides at 0.5, however well the boulder carries its own live load."""
        weight = 3e-4**3
        down, push = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0), (weight, 0.0, 0.0, 0.0, 0.0, 0.0)
        solution = solve(pebble_on_boulder(3e-4, {"boulder": down, "pebble": push}))
        assert solution.status.has_answer
        assert solution.lower <= 0.5 * (1.0 + 1e-9)
        assert solution.upper >= 0.5 * (1.0 - 1e-9)

    @pytest.mark.parametrize("side", [3e-3, 2e-3, 5e-4])
    @pytest.mark.parametrize("seed", range(4))
    def test_certified_means_narrow(self, side: float, seed: int) -> None:
        """Dead over live load is 1e9 here: no unit for a load factor of one half."""
        size = np.array([1, 1, 1, side, side, side]) * side**3
        force = np.random.default_rng(seed).normal(size=6) * size
        solution = solve(pebble_on_boulder(side, {"pebble": tuple(force)}, 2.0), "octagon")
        if solution.status is Status.CERTIFIED:
            assert solution.gap <= 1e-5


class TestAssumptions:
    def test_rates_that_slide_where_nothing_resists_are_no_opening(self) -> None:
        """Without a shear surface sliding costs nothing, and may not buy opening: true 0.5."""
        blocks = (
            Block.box("ground", (-1, -1, -1), (2, 2, 0)),
            Block.box("block", (0, 0, 0), (1, 1, 2), density=1.0),
        )
        scene = Scene(blocks, ("ground",), Load(acceleration=(1, 0, 0)), friction=0.3)
        for surfaces in ([Rocking()], [Rocking(), Torsion()]):
            certifier = Certifier(scene, surfaces)
            good = solve(scene, surfaces)
            assert good.mechanism is not None
            assert good.upper == pytest.approx(0.5, rel=1e-6)
            certifier.offer_opening_field(np.array([[5.0, 0.0, 0.1, 0.0, 0.0, 0.0]]))
            wrong = good.mechanism["block"] - np.array([0.0, 0.0, 0.02, 0.0, 0.0, 0.0])
            assert certifier.certificate(None, None, wrong).upper >= 0.5 * (1.0 - 1e-9)

    @pytest.mark.parametrize("factor", [1e160, 1e200, 1e300])
    def test_forces_that_overflow_prove_nothing(self, factor: float) -> None:
        scene = builtin_scene("tuff-wall")
        state = LimitProgram(scene).run()
        assert state.forces is not None
        certifier = Certifier(scene, SURFACES)
        c = certifier.certificate(factor * state.forces, 5.0, None)
        assert (c.lower, c.lower_is_proved) == (-np.inf, False)
        strength = Strength(certifier.assemblage, SURFACES)
        assert carried_exactly(strength, factor * state.forces) is None

    def test_a_wedge_that_needs_huge_thrust_falls_on_an_assumption(self) -> None:
        """Its taper is 1e-7 steeper than friction: it would stand on 5e7 times its weight."""
        taper = 0.1
        hang = [(x, y, z) for z, half in ((0, 0.5 + taper), (1, 0.5)) for x in (-half, half)
                for y in (0, 1)]  # fmt: skip
        left = [(x, y, z) for z, half in ((0, 0.5 + taper), (1, 0.5)) for x in (-2, -half)
                for y in (0, 1)]  # fmt: skip
        right = [(-x, y, z) for x, y, z in left]
        blocks = (
            Block.hull("left", left),
            Block.hull("right", right),
            Block.hull("wedge", hang, density=1.0),
        )
        push = Load(acceleration=(0, 1, 0))
        scene = Scene(blocks, ("left", "right"), push, friction=taper * (1.0 + 1e-7))
        solution = solve(scene)
        assert solution.status is Status.DEAD_LOAD_UNSTABLE
        assert "contact forces beyond 5e+07 times the dead load could hold it" in solution.note
        smooth = solve(scene.with_friction(0.05))
        assert smooth.status is Status.DEAD_LOAD_UNSTABLE


@pytest.mark.exhaustive_cases("default")
@pytest.mark.parametrize("ladder", [default_ladder()[:1], None], ids=["clarabel", "default"])
def test_a_small_stack_on_a_large_block(ladder: tuple[SolverSettings, ...] | None) -> None:
    """Weights 2e-11 apart: Clarabel's 0.5817 was certified on an assumption about rates.

    0.332305 by HiGHS, with 256 facets and every row in units of its own block's weight.
    """
    r = 0.0002849017716788
    blocks = [
        Block.box("ground", (-3, -3, -1), (3, 3, 0)),
        Block.box("large", (0, 0, 0), (1, 1, 1), density=20.0),
        *(
            Block.box(f"beside {i}", (1, i * r, 0), (1 + r, (i + 1) * r, r), density=20.0)
            for i in range(4)
        ),
        Block.box("top", (0.3, 0.3, 1), (0.3 + r, 0.3 + r, 1 + r), density=20.0),
        Block.box("cap", (0.3 - r, 0.3 - r, 1 + r), (0.3 + 2 * r, 0.3 + 2 * r, 1 + 3 * r), 454.0),
    ]
    push = Load(acceleration=(0.5665323414776418, -0.8240395051572835, -0.28084006224681257))
    solution = solve(Scene(blocks, ["ground"], push, friction=0.5), ladder=ladder)
    assert solution.lower <= 0.332306
    assert solution.upper >= 0.332304
    assert solution.status is not Status.CERTIFIED or solution.load_factor == pytest.approx(
        0.332305, rel=1e-5
    )


def test_a_guide_stays_with_its_block_where_others_are_left_out() -> None:
    """The top block of a stack of five, guided upwards: what pushes it sideways is taken up."""
    stack = Assemblage.of(builtin_scene("stack"))
    rates = np.zeros((5, 6))
    rates[4, 2] = 1.0
    guided = replace(stack, statics=stack.statics.guided(rates))
    top = with_contacts(guided, np.array([4]), np.zeros(5, dtype=bool)).statics
    assert top.guide is not None
    np.testing.assert_array_equal(top.guide.toarray()[6:, 6:], np.diag([0.0, 0, 1, 0, 0, 0]))
    np.testing.assert_array_equal(top.dead[6:], guided.statics.dead[24:])
    np.testing.assert_array_equal(top.live.reshape(-1, 6)[1], np.zeros(6))  # it was sideways
