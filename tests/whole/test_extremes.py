"""Scenes at the ends of physics: guides, lifted blocks, friction from nothing to glue."""

from __future__ import annotations

import numpy as np
import pytest

from cvxlimit import Block, Load, Scene, solve
from cvxlimit.masonry import running_bond, wall
from cvxlimit.plotting.camera import upright
from cvxlimit.solution import Status
from helpers import dead_load_stands

WALLS = Block.box("left", (-1, 0, 0), (0, 1, 1)), Block.box("right", (1, 0, 0), (2, 1, 1))
CUBE = Block.box("cube", (0, 0, 0), (1, 1, 1), 20.0)
GROUND = Block.box("ground", (-5, -5, -1), (5, 5, 0))

UNLIMITED = Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED


class TestGuides:
    """A block between two walls, above the ground."""

    def scene(self, friction: float, live: tuple[float, ...] = (0, 1, 0)) -> Scene:
        return Scene((*WALLS, CUBE), ("left", "right"), Load(acceleration=live), friction=friction)

    @pytest.mark.parametrize("live", [(0, 1, 0), (1, 0, 0)])
    def test_without_friction_no_force_could_hold_it(self, live: tuple[float, ...]) -> None:
        """However hard the walls press: the note must not promise that it would stand."""
        solution = solve(self.scene(0.0, live))
        assert solution.status is Status.DEAD_LOAD_UNSTABLE
        assert solution.note.startswith("block 'cube' falls")
        assert "would stand" not in solution.note
        assert solution.mechanism is not None
        assert solution.mechanism["cube"][2] < 0.0

    def test_without_friction_a_live_load_that_lifts_must_carry_it_all(self) -> None:
        assert solve(self.scene(0.0, (0, 0, 1))).interval == pytest.approx((1.0, 1.0))

    def test_with_any_friction_self_stress_holds_it(self) -> None:
        """The flow rule dilates, so the walls can press as hard as it takes."""
        assert solve(self.scene(1e-3)).status is Status.UNBOUNDED


class TestLiftedBlock:
    """Forces of the dead load pull a block off the ground."""

    scene = Scene(
        (GROUND, CUBE),
        ("ground",),
        Load(acceleration=(1, 0, 0)),
        Load(gravity=(0, 0, -1), forces={"cube": (0, 0, 50, 0, 0, 0)}),
    )

    @pytest.mark.parametrize("method", ["convex", "certified"])
    def test_it_does_not_fall_upwards(self, method: str) -> None:
        assert not dead_load_stands(self.scene)
        solution = solve(self.scene, method=method)
        assert solution.status is Status.DEAD_LOAD_UNSTABLE
        assert "falls" not in solution.note
        assert "'cube' is lifted" in solution.note
        assert solution.mechanism is not None
        assert solution.mechanism["cube"][2] > 0.0

    def test_its_picture_stays_upright(self) -> None:
        assert upright(self.scene).tolist() == [0.0, 0.0, 1.0]


class TestFrictionFromNothingToGlue:
    """Blocks wedged between walls carry any force by self-stress; what rests on them does not."""

    @pytest.mark.parametrize("friction", [1e-4, 1e-3, 1e-2, 1e3, 1e5, 1e6, 1e8])
    @pytest.mark.parametrize("direction", [(0, 1, 0), (1, 0, 0)])
    def test_a_rider_on_a_wedged_cube(self, friction: float, direction: tuple[float, ...]) -> None:
        """It slides at mu and tips at width / height = 2: certified, or a bracket that holds it."""
        rider = Block.box("rider", (0.2, 0.2, 1), (0.8, 0.8, 1.3), 20.0)
        blocks = (GROUND, *WALLS, CUBE, rider)
        live = Load(acceleration=direction)
        scene = Scene(blocks, ("ground", "left", "right"), live, friction=friction)
        solution, true = solve(scene), min(friction, 2.0)
        assert solution.lower <= true * (1.0 + 1e-9)
        assert solution.upper >= true * (1.0 - 1e-9)
        assert solution.gap <= (1e-5 if friction <= 1e6 else 1e-3)
        assert (solution.status is Status.CERTIFIED) == (solution.gap <= 1e-5)

    @pytest.mark.exhaustive_cases(
        "certified-0.0001", "convex-0.0001", "convex-0.01", "convex-100000.0"
    )
    @pytest.mark.parametrize("friction", [1e-4, 1e-2, 1e5, 1e6])
    @pytest.mark.parametrize("method", ["convex", "certified"])
    def test_a_wall_between_walls(self, friction: float, method: str) -> None:
        scene = wall(
            running_bond(3, 4),
            unit=(0.1, 0.1, 0.05),
            friction=friction,
            side_supports=("start", "end"),
            live=Load(acceleration=(0.3, 1.0, 0.2)),
        )
        assert solve(scene, method=method).status in UNLIMITED

    @pytest.mark.parametrize("friction", [1e-5, 1e-3, 0.5])
    @pytest.mark.exhaustive_cases("1e-05")
    def test_a_wedge_in_a_groove(self, friction: float) -> None:
        """Pushed along a groove of 45 degrees both faces press with W / sqrt(2): sqrt(2) mu W for
        small friction; above tan(45) it locks."""
        cheeks = [
            Block.hull(name, [(0, y, 0) for y in (0, 1)]
                       + [(s * 2, y, z) for y in (0, 1) for z in (0, 2)])
            for name, s in (("l", -1), ("r", 1))
        ]  # fmt: skip
        wedge = [(x, y, z) for y in (0, 1) for x, z in ((0, 0), (-1, 1), (1, 1))]
        block = Block.hull("wedge", wedge, density=20.0)
        scene = Scene((*cheeks, block), ("l", "r"), Load(acceleration=(0, 1, 0)), friction=friction)
        solution = solve(scene)
        assert solution.status is Status.CERTIFIED
        if friction < 0.1:
            assert solution.load_factor == pytest.approx(np.sqrt(2.0) * friction, rel=1e-4)
        assert solve(scene.with_friction(1e5)).status is Status.UNBOUNDED
