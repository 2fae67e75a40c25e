"""What a solution says about joints that open because they slide."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cvxlimit import Block, Load, PointForce, Reaction, Scene, Units, builtin_scene, solve
from cvxlimit.cli.main import run
from cvxlimit.io import read_result, write_result, write_scene
from cvxlimit.masonry.walls import running_bond, stack, wall
from cvxlimit.plotting import picture_of
from cvxlimit.plotting.pictures.mechanism import mechanism_of
from cvxlimit.solution.kinematics import dilatancy_of, relative_rates

LENGTH, THICKNESS, HEIGHT, COURSES = 0.5, 0.75, 0.25, 8
WORD = "without dilatancy it may fall at less"


def retaining_wall(friction: float = 0.5) -> tuple[Scene, float]:
    """A dry-stone wall that earth pushes out of its plane, and the push: pressures grow with depth.

    It is so thick that it slides on the ground before it turns about its toe; further up the push
    falls with the square of the depth, the weight with the depth.
    """
    plain = wall(
        running_bond(4, COURSES), (LENGTH, THICKNESS, HEIGHT), friction=friction, density=24.0
    )
    points, total = [], 0.0
    for block in (plain.blocks[i] for i in plain.free):
        low, high = block.vertices.min(axis=0), block.vertices.max(axis=0)
        bottom, top = COURSES * HEIGHT - low[2], COURSES * HEIGHT - high[2]  # depths
        push = 5.4 * 0.5 * (bottom**2 - top**2) * (high[0] - low[0])
        level = COURSES * HEIGHT - (bottom**3 - top**3) / (bottom**2 - top**2) * 2.0 / 3.0
        at = (0.5 * (low[0] + high[0]), low[1], level)
        points.append(PointForce(block.id, at, (0.0, push, 0.0)))
        total += push
    return plain.with_live(Load(points=points)), total


def test_a_retaining_wall_says_that_it_slides(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In summary, note, result file, page and picture; closed form: friction times weight."""
    scene, push = retaining_wall()
    solution = solve(scene)
    assert solution.load_factor == pytest.approx(0.5 * scene.total_weight / push, rel=1e-5)
    found = solution.dilatancy
    assert found is not None
    assert found.share == pytest.approx(1.0, abs=1e-4)
    assert set(found.sliding) == {f"ground-b1.{i}" for i in range(1, 5)}
    assert found.moving == 4
    assert WORD in solution.note
    assert "4 of 4 moving joints slide: " in solution.note
    assert "those that slide: ground-b1.1, " in solution.note
    write_result(solution, tmp_path / "result.json")
    assert read_result(tmp_path / "result.json").dilatancy == found
    caption = mechanism_of(scene, solution).caption
    assert "opening by dilatancy drawn: without it less may be carried" in caption
    assert WORD in picture_of(solution, "page")
    write_scene(scene, tmp_path / "wall.json")
    assert run(["solve", str(tmp_path / "wall.json")]) == 0
    said = [line for line in capsys.readouterr().out.splitlines() if WORD in line]
    assert len(said) == 1
    assert said[0] == f"sliding      4 of 4 moving joints slide: {WORD}"


ROCKING = {
    "block": stack(1, (0.4, 1.0, 1.0)),
    "stack": stack(4, (0.4, 1.0, 0.3)),
    "arch": builtin_scene("arch"),
}


@pytest.mark.parametrize("name", ROCKING)
def test_what_rocks_says_nothing(name: str) -> None:
    solution = solve(ROCKING[name])
    assert solution.dilatancy is not None
    assert solution.dilatancy.share < 1e-6
    assert "dilatancy" not in solution.note
    assert "dilatancy" not in mechanism_of(ROCKING[name], solution).caption


@pytest.mark.parametrize("name", ["tuff-wall", "ferris-tin-loi-1", "dome"])
@pytest.mark.parametrize("surface", ["conic", "octagon"])
def test_the_share_is_how_much_the_load_factor_changes_with_friction(
    name: str, surface: str
) -> None:
    """Relative change over relative change, by differences: another path to the same number."""
    scene = builtin_scene(name)
    share = solve(scene, surface).dilatancy.share  # type: ignore[union-attr]
    more, less = (
        solve(scene.with_friction(k * scene.friction), surface).load_factor for k in (1.001, 0.999)
    )
    assert more is not None
    assert less is not None
    assert share == pytest.approx(np.log(more / less) / np.log(1.001 / 0.999), rel=5e-3)


def slab(friction: float, cohesion: float = 0.0) -> Scene:
    """A flat block, 20 kN on 1 m2, that slides."""
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    block = Block.box("slab", (0, 0, 0), (1, 1, 0.2), density=100.0)
    return Scene(
        [ground, block], ["ground"], Load(acceleration=(1, 0, 0)), friction=friction,
        cohesion=cohesion,
    )  # fmt: skip


def test_cohesion_takes_no_part_in_dilatancy() -> None:
    """The factor is friction and cohesion times area over weight; only friction lifts the block."""
    solution = solve(slab(0.3, cohesion=4.0))
    assert solution.load_factor == pytest.approx(0.5)
    assert solution.dilatancy is not None
    assert solution.dilatancy.share == pytest.approx(0.6)


def test_one_joint_that_slides_is_named_in_the_singular() -> None:
    assert f"1 of 1 moving joints slides: {WORD}" in solve(slab(0.3)).note


def test_reactions_and_ties_are_no_joints() -> None:
    """They move with the slab, one against the push and one with it, and are not counted."""
    ends = [Reaction("slab", (x, 0.5, 0.1), (-1, 0, 0), 1.0) for x in (0, 1)]
    scene = replace(slab(0.3), reactions=ends)
    found = solve(scene).dilatancy
    assert found is not None
    assert (found.sliding, found.moving) == (("ground-slab",), 1)


def test_units_do_not_matter() -> None:
    scene = retaining_wall()[0]
    pair = (scene, scene.in_units(Units("mm", "N"), 1e3, 1e3))
    one, two = (solve(s).dilatancy for s in pair)
    assert one is not None
    assert two is not None
    assert (one.sliding, one.moving) == (two.sliding, two.moving)
    assert one.share == pytest.approx(two.share, rel=1e-4)


@pytest.mark.parametrize("method", ["certified", "exact", "fixed-point"])
def test_methods_that_dilate_say_so_too(method: str) -> None:
    assert WORD in solve(slab(0.3), method=method).note  # type: ignore[arg-type]


def test_zero_dilatancy_does_not() -> None:
    solution = solve(slab(0.3), method="zero-dilatancy")
    assert solution.load_factor == pytest.approx(0.3, rel=1e-3)
    assert solution.dilatancy is None
    assert WORD not in solution.note
    assert "dilatancy drawn" not in mechanism_of(slab(0.3), solution).caption


def test_bounds_that_are_apart_are_no_dilatancy() -> None:
    """Forces well below collapse beside the mechanism of a slender block: their pressure centre is
    inside, so that compressions do work on the opening, but nothing slips."""
    scene = stack(1, (0.4, 1.0, 1.0))
    solution = solve(scene, tolerance=1e-5)
    rates = np.array([solution.mechanism[scene.blocks[i].id] for i in scene.free])  # type: ignore[index]
    every = np.zeros((len(scene.blocks), 6))
    every[scene.free] = rates
    at_rest = np.array([[0.0, 0.0, scene.total_weight, 0.0, 0.0, 0.0]])
    found = dilatancy_of(scene, at_rest, relative_rates(scene, every), rates, 0.4)
    assert found.share < 1e-9
