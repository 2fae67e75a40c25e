"""The static problem: closed forms, SciPy's linprog on matrices of our own, both formulations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings

from cvxlimit import Load, Scene, builtin_scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.masonry import single_block
from cvxlimit.methods.convex import Convex
from cvxlimit.model.formulations import corner_compressions, resultants
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LargestFactor
from cvxlimit.solvers import SolverSettings
from cvxlimit.surfaces.coulomb import surfaces_of
from helpers import (
    assert_certified,
    linear_load_factor,
    piles,
    scenes,
    walls,
    yield_excess,
)

ANGLES = np.arange(0.0, 360.0, 22.5)
COS = np.cos(np.pi / 8.0)


def push(angle: float) -> Load:
    return Load(acceleration=(np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0))


class TestSingleBlock:
    """Closed forms; 1e-7 is a hundred times what Clarabel leaves at its 1e-10."""

    @pytest.mark.parametrize("angle", [0.0, 10.0, 22.5, 33.0, 45.0, 90.0, 200.0, 292.5])
    def test_sliding_conic_is_mu_in_any_direction(self, angle: float) -> None:
        scene = single_block((1.0, 1.0, 0.2), friction=0.5, live=push(angle))
        solution = solve(scene)
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(0.5, rel=1e-7)

    @pytest.mark.parametrize("angle", ANGLES)
    def test_sliding_octagon_depends_on_the_direction(self, angle: float) -> None:
        """mu along k * 45 degrees, mu / cos(22.5 degrees) between; inscribed cos(22.5) as much."""
        scene = single_block((1.0, 1.0, 0.2), friction=0.5, live=push(angle))
        expected = 0.5 if angle % 45.0 == 0.0 else 0.5 / COS
        for surface, share in (("octagon", 1.0), ("octagon-inscribed", COS)):
            solution = solve(scene, surface)
            assert_certified(solution, scene)
            assert solution.load_factor == pytest.approx(share * expected, rel=1e-7)

    @pytest.mark.parametrize("k", [3, 5, 16])
    @pytest.mark.parametrize("angle", [0.0, 17.0, 100.0])
    def test_sliding_with_any_facets(self, k: int, angle: float) -> None:
        """mu over the largest cosine between the push and a facet normal."""
        scene = single_block((1.0, 1.0, 0.2), friction=0.5, live=push(angle))
        contact = scene.contacts[0]
        # Friction acts against the push: on the block, along minus the load.
        v = -np.array([push(angle).acceleration @ t for t in (contact.t1, contact.t2)])
        normals = 2.0 * np.pi * np.arange(k) / k
        expected = 0.5 / (v[0] * np.cos(normals) + v[1] * np.sin(normals)).max()
        solution = solve(scene, f"{k}-gon")
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(expected, rel=1e-7)

    @pytest.mark.parametrize("surface", ["conic", "octagon", "octagon-inscribed"])
    @pytest.mark.parametrize("angle", [0.0, 30.0, 45.0, 60.0, 90.0, 135.0, 250.0])
    def test_overturning(self, surface: str, angle: float) -> None:
        """The line of push leaves the base where it meets its rim, at half the height's lever."""
        a, b, h = 0.4, 0.3, 2.0
        scene = single_block((a, b, h), friction=0.9, live=push(angle))
        c, s = abs(np.cos(np.radians(angle))), abs(np.sin(np.radians(angle)))
        reach = min(a / 2 / c if c > 1e-9 else np.inf, b / 2 / s if s > 1e-9 else np.inf)
        solution = solve(scene, surface)
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(reach / (h / 2.0), rel=1e-7)

    @pytest.mark.parametrize(("b", "h", "mu"), [(0.3, 1.0, 0.7), (1.0, 1.0, 0.7), (0.7, 1.0, 0.7)])
    def test_the_lesser_of_both(self, b: float, h: float, mu: float) -> None:
        solution = solve(single_block((b, b, h), friction=mu))
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(min(b / h, mu), rel=1e-7)

    @pytest.mark.parametrize("lift", [-0.5, 0.5, 1.0])
    def test_push_with_a_vertical_part(self, lift: float) -> None:
        """alpha = mu (1 - lift alpha) when sliding."""
        live = Load(acceleration=(1.0, 0.0, lift))
        solution = solve(single_block((1.0, 1.0, 0.2), friction=0.4, live=live))
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(0.4 / (1.0 + 0.4 * lift), rel=1e-7)

    def test_pure_torsion(self) -> None:
        """MT = c_T mu W, with c_T of the unit square from published.json."""
        live = Load(forces={"b1": (0, 0, 0, 0, 0, 1.0)})
        scene = single_block((1.0, 1.0, 0.5), density=20.0, friction=0.5, live=live)
        solution = solve(scene)
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(0.3825978582 * 0.5 * 10.0, rel=1e-7)

    def test_pure_uplift(self) -> None:
        solution = solve(single_block(live=Load(acceleration=(0, 0, 1))))
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(1.0, rel=1e-7)

    def test_incline(self) -> None:
        """On a slope of angle t < arctan mu, pushed down it: tan(phi - t) with mu = tan phi."""
        for slope in (5.0, 15.0, 25.0):
            t = np.radians(slope)
            turn = np.array([[np.cos(t), 0, -np.sin(t)], [0, 1, 0], [np.sin(t), 0, np.cos(t)]])
            tilted = single_block((1.0, 1.0, 0.2), friction=0.6).moved(turn)
            # Gravity stays vertical; the push is horizontal, towards the lower side.
            scene = tilted.with_dead(Load(gravity=(0, 0, -1))).with_live(
                Load(acceleration=(-1, 0, 0))
            )
            solution = solve(scene)
            assert_certified(solution, scene)
            assert solution.load_factor == pytest.approx(np.tan(np.arctan(0.6) - t), rel=1e-7)


class TestLinprog:
    """A second path to the same number: matrices from scratch, HiGHS at 1e-10; agree to 1e-7."""

    @pytest.mark.parametrize(
        "name", ["single-block", "stack", "arch", "ferris-tin-loi-1", "ferris-tin-loi-3"]
    )
    def test_builtin_octagon(self, name: str) -> None:
        scene = builtin_scene(name)
        solution = solve(scene, "octagon")
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(linear_load_factor(scene).load_factor, 1e-7)

    @pytest.mark.exhaustive_cases("octagon-8-1.0", "octagon-inscribed-8-0.9238795325112867")
    @pytest.mark.parametrize(
        ("surface", "count", "reach"),
        [("octagon", 8, 1.0), ("octagon-inscribed", 8, COS), ("5-gon", 5, 1.0)],
    )
    def test_tuff_wall(self, surface: str, count: int, reach: float) -> None:
        scene = builtin_scene("tuff-wall")
        answer = linear_load_factor(scene, count, reach)
        solution = solve(scene, surface, tolerance=1e-7)
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(answer.load_factor, rel=1e-7)

    @pytest.mark.exhaustive
    @given(scene=scenes())
    @settings(max_examples=25, deadline=None)
    def test_random_scenes(self, scene: Scene) -> None:
        answer = linear_load_factor(scene)
        solution = solve(scene, "octagon", Convex(tolerance=1e-6))
        if answer.status == 0:
            assert_certified(solution, scene, proved=False)
            assert solution.load_factor == pytest.approx(answer.load_factor, rel=1e-6)
            assert solution.lower <= answer.load_factor + 1e-8
            assert answer.load_factor <= solution.upper + 1e-8
        else:
            assert not solution.status.has_answer

    @given(scene=walls())
    @settings(max_examples=10, deadline=None)
    def test_dead_and_live_forces_on_single_blocks(self, scene: Scene) -> None:
        """Moments and forces beside gravity, and contacts with friction of their own."""
        first = scene.blocks[scene.free[0]]
        w = first.weight
        extra = {first.id: (0.05 * w, 0.03 * w, -w, 0.001 * w, -0.002 * w, 0.001 * w)}
        pair = (scene.contacts[0].a, scene.contacts[0].b)
        scene = scene.with_dead(Load(gravity=(0, 0, -1), forces=extra)).with_friction(
            scene.friction, {pair: 0.45}
        )
        assert scene.contacts[0].friction == 0.45
        answer = linear_load_factor(scene)
        assume(answer.status == 0)
        solution = solve(scene, "octagon")
        assert_certified(solution, scene, proved=False)
        assert solution.load_factor == pytest.approx(answer.load_factor, rel=1e-6)


class TestFormulations:
    @pytest.mark.parametrize("surface", ["conic", "octagon"])
    @pytest.mark.parametrize("name", ["tuff-wall", "ferris-tin-loi-3", "arch"])
    def test_same_answer(self, name: str, surface: str) -> None:
        """1e-6 relative: the resultants' rows leave Clarabel a hundred times less accurate."""
        scene = builtin_scene(name)
        surfaces, _ = surfaces_of(surface)
        corner, six = (
            LimitProgram(scene, surfaces, formulation=formulation).run()
            for formulation in (corner_compressions, resultants)
        )
        assert six.load_factor == pytest.approx(corner.load_factor, rel=1e-6)

    @given(scene=piles())
    @settings(max_examples=10, deadline=None)
    def test_same_answer_on_other_polygons(self, scene: Scene) -> None:
        states = [
            LimitProgram(scene, formulation=f).run() for f in (corner_compressions, resultants)
        ]
        assume(all(state.outcome.status == "optimal" for state in states))
        assert states[0].load_factor == pytest.approx(states[1].load_factor, rel=1e-6)

    @pytest.mark.parametrize("formulation", [corner_compressions, resultants])
    def test_forces_are_admissible_and_the_mechanism_has_live_power_one(
        self, formulation: Any
    ) -> None:
        scene = builtin_scene("tuff-wall")
        state = LimitProgram(scene, formulation=formulation).run()
        assert state.forces is not None
        assert state.mechanism is not None
        assert yield_excess(scene, state.forces).max() <= 1e-8 * scene.total_weight
        assert (state.mechanism * scene.live_forces).sum() == pytest.approx(1.0, abs=1e-6)


class TestLimitProblem:
    @pytest.mark.parametrize("most", [0.1, 0.3, 0.5])
    def test_most(self, most: float) -> None:
        state = LimitProgram(single_block(), goal=LargestFactor(most=most)).run()
        assert state.load_factor == pytest.approx(min(most, 0.4), rel=1e-7)

    def test_needs_rocking(self) -> None:
        with pytest.raises(ModelError, match="add Rocking"):
            LimitProgram(single_block(), surfaces_of("conic")[0][1:])

    @pytest.mark.parametrize(
        "settings",
        [
            SolverSettings("NO_SUCH_SOLVER"),
            SolverSettings("CLARABEL", {"no_such_option": 1}),
            SolverSettings("HIGHS"),  # cannot do second-order cones
        ],
    )
    def test_failures_are_a_status(self, settings: SolverSettings) -> None:
        state = LimitProgram(single_block()).run(settings)
        assert state.outcome.status.startswith("failed: ")
        assert "\n" not in state.outcome.status
        assert not state.outcome.has_values
        assert (state.load_factor, state.forces, state.mechanism) == (None, None, None)

    def test_solved_again_is_the_same(self) -> None:
        problem = LimitProgram(builtin_scene("tuff-wall"))
        first, again = problem.run(), problem.run()
        assert again.load_factor == pytest.approx(first.load_factor, rel=1e-10)  # its tolerance
