"""Mortar with cohesion and tensile strength, against hand calculation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cvxlimit import Block, Load, Scene, Status, builtin_scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.masonry import single_block
from cvxlimit.model.mortar import Mortar
from helpers import assert_certified, hand_equilibrium, regular, renumbered, rotations

FloatArray = NDArray[np.float64]


def glued(scene: Scene, tension: float, cohesion: float) -> Scene:
    """With strengths in units of weight over contact area."""
    unit = scene.total_weight / scene.contacts.area[0]
    return scene.with_cohesion(cohesion * unit).with_strength(tensile=tension * unit)


class TestOneBlock:
    @given(
        tension=st.floats(0.0, 3.0),
        height=st.floats(0.3, 3.0),
        unit=st.sampled_from([1e-3, 1.0]),
    )
    @settings(max_examples=10, deadline=None)
    def test_tips_or_slides(self, tension: float, height: float, unit: float) -> None:
        """Tips when the whole joint pulls with t A about the edge: (1 + t A / W) l / h; slides at
        mu + c A / W. With V at the limit friction and cohesion hold what N carries."""
        scene = glued(single_block((1.0, 0.7, height), friction=0.5), tension, 2.0)
        solution = solve(scene.in_units(scene.units, unit, 7.0))
        assert_certified(solution)
        expected = min((1.0 + tension) / height, 0.5 + 2.0)
        assert solution.load_factor == pytest.approx(expected, rel=1e-5)

    def test_hangs_from_the_ceiling(self) -> None:
        """A prism of any shape pulled off: t A - W; torn off at less than its weight it falls."""
        ring = [np.column_stack([regular(5), np.full(5, z)]) for z in (-1.0, 0.0)]
        prism = Block.hull("prism", np.vstack(ring), density=1.0)
        ceiling = Block.box("ceiling", (-2, -2, 0), (2, 2, 1))
        scene = Scene([ceiling, prism], ["ceiling"], Load(acceleration=(0, 0, -1)), friction=0.4)
        solution = solve(glued(scene, 1.5, 1.0))
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(0.5, rel=1e-6)
        assert solution.forces[0, 2] == pytest.approx(-1.5 * scene.total_weight, rel=1e-6)
        assert solve(glued(scene, 0.9, 1.0)).status is Status.DEAD_LOAD_UNSTABLE

    def test_crushed_and_torn(self) -> None:
        """A plastic joint in bending: tension t over one part, pressure f over the other."""
        block = Block.box("block", (0, 0, 0), (1, 1, 1), density=1e-6)
        ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
        moment = Load(forces={"block": (0, 0, 0, 0, 1, 0)})
        scene = Scene([ground, block], ["ground"], moment, friction=1.0)
        scene = scene.with_cohesion(9.0).with_strength(compressive=6.0, tensile=2.0)
        part = 2.0 / 8.0  # in compression: 6 part = 2 (1 - part)
        solution = solve(scene)
        assert_certified(solution, proved=False)
        assert solution.load_factor == pytest.approx(8.0 * part * (1 - part) / 2.0, rel=1e-5)


class TestWalls:
    def test_forces_balance_the_original_loads_and_yield_nowhere(self) -> None:
        scene = builtin_scene("ferris-tin-loi-1").with_cohesion(3.0).with_strength(tensile=2.0)
        solution = solve(scene)
        assert_certified(solution)
        matrix, dead, live = hand_equilibrium(scene)
        rest = matrix @ solution.forces.ravel() + dead + solution.load_factor * live
        assert np.abs(rest).max() < 1e-6 * np.abs(dead).sum()
        contacts = scene.contacts
        v1, v2, n = solution.forces[:, :3].T
        room = contacts.friction * n + 3.0 * contacts.area - np.hypot(v1, v2)
        assert room.min() > -1e-6 * scene.total_weight
        assert (n + 2.0 * contacts.area).min() > -1e-6 * scene.total_weight

    def test_more_tension_is_never_worse(self) -> None:
        scene = builtin_scene("tuff-wall").with_cohesion(5.0)
        factors = [solve(scene.with_strength(tensile=t)).load_factor for t in (0.0, 2.0, 5.0)]
        assert factors[0] < factors[1] < factors[2]

    @given(turn=rotations(), seed=st.integers(0, 100))
    @settings(max_examples=2, deadline=None)
    def test_rotation_and_renumbering(self, turn: FloatArray, seed: int) -> None:
        def mortared(scene: Scene) -> Scene:
            return scene.with_cohesion(3.0).with_strength(tensile=2.0)

        scene = builtin_scene("arch")
        expected = solve(mortared(scene)).load_factor
        for other in (mortared(scene).moved(turn), mortared(renumbered(scene, seed))):
            assert solve(other).load_factor == pytest.approx(expected, rel=2e-5)


def test_tension_beyond_the_apex() -> None:
    scene = glued(builtin_scene("single-block"), 1.0, 0.1)
    with pytest.raises(ModelError, match="beyond its cohesion over friction"):
        solve(scene)


def test_a_dry_scene_is_left_alone() -> None:
    scene = builtin_scene("arch")
    assert Mortar.of(scene).scene is scene
