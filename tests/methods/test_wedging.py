"""Live loads of which any multiple is carried: by what presses joints, or by dilatancy alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cvxlimit import Block, Load, Scene, Solution, Status, solve
from cvxlimit.cli.main import run
from cvxlimit.io import read_result, write_result, write_scene
from cvxlimit.plotting import picture_of, title

ALONE = "carried by dilatancy alone"


def pushed(angle: float, friction: float = 0.7) -> Scene:
    """A slab on the ground, pushed into it at an angle from upright."""
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    slab = Block.box("slab", (0, 0, 0), (1, 1, 0.3), density=20.0)
    t = np.radians(angle)
    live = Load(acceleration=(np.sin(t), 0.0, -np.cos(t)))
    return Scene([ground, slab], ["ground"], live, friction=friction)


def row(cubes: int, live: tuple[float, ...] = (0.0, 0.0, 1.0), friction: float = 0.7) -> Scene:
    """Cubes one beside the other, clamped between two that are fixed."""
    blocks = [Block.box("w0", (-1, 0, 0), (0, 1, 1))]
    blocks += [Block.box(f"c{i}", (i, 0, 0), (i + 1, 1, 1), density=20.0) for i in range(cubes)]
    blocks += [Block.box("w1", (cubes, 0, 0), (cubes + 1, 1, 1))]
    return Scene(blocks, ["w0", "w1"], Load(acceleration=live), friction=friction)


def clamped(live: tuple[float, ...] = (1.0, 0.0, 0.0), friction: float = 1.0) -> Scene:
    """The middle one of three cubes on one another, of which the outer ones are fixed."""
    blocks = [
        Block.box(f"p{i}", (0, 0, 0.5 * i), (0.5, 0.5, 0.5 * i + 0.5), density=20.0)
        for i in range(3)
    ]
    return Scene(blocks, ["p0", "p2"], Load(acceleration=live), friction=friction)


def is_wedged(solution: Solution) -> bool:
    """What the solution says about it, everywhere alike."""
    assert solution.status is Status.LIVE_LOAD_HARMLESS
    found = solution.dilatancy is not None and solution.dilatancy.is_all
    assert (solution.standing == ALONE) is found
    assert (ALONE in title(solution)) is found
    assert ("change the direction" in solution.note) is not found
    assert ("method 'zero-dilatancy'" in solution.note) is found
    return found


@pytest.mark.parametrize("method", ["convex", "exact", "certified"])
def test_clamped_cubes_are_carried_by_dilatancy_alone(method: str) -> None:
    """Without dilatancy the middle one slides from 1 on."""
    solution = solve(clamped(), method=method)  # type: ignore[arg-type]
    assert is_wedged(solution)
    assert solution.dilatancy is not None
    assert solution.dilatancy.sliding == ("p0-p1", "p1-p2")
    if method == "convex":  # strength of the others depends on more than compressions
        assert solution.lower == solution.dilatancy.safe == pytest.approx(1.0, abs=1e-8)
        assert "none of them below a load factor of 1 (proved)" in solution.note
    without = solve(clamped(), method="zero-dilatancy")
    assert without.load_factor == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("surface", ["conic", "octagon", "octagon-inscribed"])
@pytest.mark.parametrize("cubes", [1, 2, 3])
def test_rows_between_walls(cubes: int, surface: str) -> None:
    assert is_wedged(solve(row(cubes), surface))  # type: ignore[arg-type]


@pytest.mark.parametrize("angle", [0.0, 10.0, 30.0, 34.0])
def test_a_push_within_the_cone_of_friction_presses_by_itself(angle: float) -> None:
    """tan 35 degrees is 0.7: friction is needed, dilatancy is not."""
    assert not is_wedged(solve(pushed(angle)))


@pytest.mark.parametrize(("rise", "wedged"), [(0.0, False), (0.6, False), (0.8, True), (3, True)])
def test_a_push_against_a_wall_and_up(rise: float, wedged: bool) -> None:
    """The wall pushes back as hard: up to friction times that is held; beyond, both walls have to
    press harder than the load does."""
    assert is_wedged(solve(row(1, (1.0, 0.0, rise)))) is wedged


def test_a_twist_between_two_cubes() -> None:
    scene = clamped()
    twist = scene.with_live(Load(forces={"p1": (0, 0, 0, 0, 0, 1.0)}))
    assert is_wedged(solve(twist))


def test_an_interval_without_an_upper_end() -> None:
    """The load presses the joint itself: nothing is said of dilatancy."""
    scene = pushed(0.0, 0.5).with_dead(Load(gravity=(0, 0, -1), acceleration=(0.6, 0, 0)))
    solution = solve(scene)
    assert solution.interval == pytest.approx((0.2, np.inf))
    assert solution.dilatancy is None


def test_files_and_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    solution = solve(clamped())
    assert "change the direction" not in picture_of(solution, "page")
    assert "zero-dilatancy" in solution._repr_html_()
    write_result(solution, tmp_path / "result.json")
    assert json.loads((tmp_path / "result.json").read_text())["dilatancy"]["share"] == "inf"
    assert read_result(tmp_path / "result.json").dilatancy == solution.dilatancy
    write_scene(clamped(), tmp_path / "scene.json")
    assert run(["solve", str(tmp_path / "scene.json")]) == 3
    out, err = capsys.readouterr()
    assert ALONE in out
    assert ALONE in err
    assert "zero-dilatancy" in err
    assert "change the direction" not in out + err
