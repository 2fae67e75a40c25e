"""Pressures on a path: as large as on the faces they were found on, turning with them or not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest

from cvxlimit import Block, Load, Scene, builtin_scene, prove, pushover
from cvxlimit.errors import ModelError
from cvxlimit.extensions.paths.starting import with_resultants
from cvxlimit.masonry import single_block, stack
from cvxlimit.scene.loads import Pressure

B, H, WIDTH = 0.4, 1.0, 0.5
RADIUS, UPRIGHT = 0.5 * np.hypot(B, H), np.arctan2(B, H)
PUSH = (1.0, 0.0, 0.0)
DOWN = (0.0, 0.0, -1.0)

WIND = Pressure("b1", normal=(-1, 0, 0), pressure=1.0)
WATER = Pressure("b1", (-1, 0, 0), 0.0, (0, 0, -10.0), at=(0, 0, 0.8), within=(0, 0, -1))
FORCE = {WIND: (H * WIDTH, H / 2), WATER: (10 * 0.8**2 / 2 * WIDTH, 0.8 / 3)}
"""What each presses with on the block's left face, and how high."""

CASES: dict[str, tuple[list[Pressure], Load]] = {
    "live": ([], Load(pressures=[WIND])),
    "dead": ([WATER], Load(acceleration=PUSH)),
    "both": ([WATER], Load(acceleration=PUSH, pressures=[WIND])),
}


def moment(pressure: Pressure, angle: Any, pressures: str) -> Any:
    """About the toe of the block that has turned by an angle over it."""
    force, height = FORCE[pressure]
    if pressures == "turning":  # the lever stays as it is
        return force * height + 0.0 * angle
    return force * (B * np.sin(angle) + height * np.cos(angle))


@pytest.mark.parametrize("pressures", ["turning", "keeping"])
@pytest.mark.parametrize(
    "case", ["both", *(pytest.param(x, marks=pytest.mark.exhaustive) for x in ("live", "dead"))]
)
def test_a_block_under_pressure_turns_about_its_toe(
    case: str, pressures: Any, tmp_path: File
) -> None:
    dead, live = CASES[case]
    block = single_block((B, WIDTH, H), friction=5.0).with_live(live)
    scene = block.with_dead(Load(gravity=DOWN, pressures=dead))
    path = pushover(scene, step=0.05, pressures=pressures)
    angle, weight = np.array([x.displacements["b1"][4] for x in path]), scene.total_weight
    left = weight * RADIUS * np.sin(UPRIGHT - angle)
    left -= sum(moment(x, angle, pressures) for x in dead)
    by = sum(moment(x, angle, pressures) for x in live.pressures)
    if live.acceleration:
        by = by + weight * RADIUS * np.cos(UPRIGHT - angle)
    assert path.load_factor == pytest.approx(left / by, abs=1e-7)
    assert path.status == "zero"
    said = {"turning": "turn with them", "keeping": "keep their direction"}[pressures]
    assert said in path.notes[0]
    assert path.work is not None
    assert abs(path.work.difference) < 5e-3
    for shown in path:
        assert shown.bracket is not None
        assert shown.bracket.is_proved
        assert shown.bracket.upper - shown.bracket.lower < 1e-7
    path.save(tmp_path / "path.json")
    assert prove(tmp_path / "path.json").is_proved
    # begun again from the middle, as a scene with loads of its own
    shown = path[len(path) // 2]
    again = pushover(shown.scene(), until=shown.load_factor - 1e-3, certify="none")
    assert again.load_factor[0] == pytest.approx(shown.load_factor, abs=1e-8)


def test_one_step_of_a_turning_push_equals_many() -> None:
    scene = single_block((1.0, WIDTH, H), friction=5.0).with_live(Load(pressures=[WIND]))
    for step in (0.3, 0.1):
        path = pushover(scene, step=step, until=1.0, certify="none")
        angle = np.array([x.displacements["b1"][4] for x in path])
        left = scene.total_weight * np.hypot(0.5, 0.5) * np.sin(np.pi / 4 - angle)
        assert path.load_factor == pytest.approx(left / moment(WIND, angle, "turning"), abs=1e-6)


@pytest.mark.parametrize("pressures", ["turning", "keeping"])
def test_a_wall_in_courses_under_water_turns_as_one_block(pressures: Any) -> None:
    """The joint at the ground opens; those above stay closed, whatever presses on each course."""
    courses = stack(4, (B, WIDTH, H / 4), friction=5.0)
    free = [courses.blocks[i].id for i in courses.free]
    water = [replace(WATER, block=name) for name in free]
    water = [x for x in water if courses.blocks[1 + free.index(x.block)].vertices[:, 2].min() < 0.8]
    one = single_block((B, WIDTH, H), friction=5.0)
    many = courses.with_dead(Load(gravity=DOWN, pressures=water))
    one = one.with_dead(Load(gravity=DOWN, pressures=[WATER]))
    found = [
        pushover(x, step=0.03, until=0.02, certify="none", pressures=pressures) for x in (one, many)
    ]
    both = [x for x in found if len(x) > 2]
    assert len(both) == 2
    k = min(map(len, both)) - 1
    assert both[1].load_factor[:k] == pytest.approx(both[0].load_factor[:k], abs=1e-8)


def test_a_moment_that_is_left_on_a_rough_face_is_kept() -> None:
    """Resultants on faces of several planes are a force and a moment."""
    corners = np.array(
        [(0, 0, 0), (0.4, 0, 0), (0.4, 0.5, 0), (0, 0.5, 0), (0.03, 0, 1), (0.4, 0, 1),
         (0.4, 0.5, 1), (0, 0.5, 1)]
    )  # fmt: skip
    faces = [[3, 2, 1, 0], [4, 5, 6], [4, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6],
             [3, 0, 4], [3, 4, 7]]  # fmt: skip
    block = Block.polyhedron("b1", corners, faces, 20.0)
    ground = Block.box("ground", (-2, -2, -1), (2, 2, 0))
    push = Load(pressures=[WIND])
    scene = Scene([ground, block], ["ground"], push, friction=5.0)
    other = with_resultants(scene)
    assert any(other.live.forces["b1"][3:])
    assert other.live_forces == pytest.approx(scene.live_forces, abs=1e-12)


def test_what_pressures_do_is_chosen_where_a_path_begins() -> None:
    path = pushover(builtin_scene("single-block").with_live(Load(pressures=[WIND])), step=0.1)
    with pytest.raises(ModelError, match="a path goes on with its own loads"):
        pushover(path, pressures="keeping")
