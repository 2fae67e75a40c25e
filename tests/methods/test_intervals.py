"""Dead loads that stand only together with a part of the live load: both ends, proved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cvxlimit import (
    Block,
    Certified,
    Load,
    Scene,
    Solution,
    Status,
    ZeroDilatancy,
    solve,
    sweep,
)
from cvxlimit.cli.main import run
from cvxlimit.errors import ModelError
from cvxlimit.io import read_result, write_result, write_scene
from cvxlimit.plotting import picture_of, title
from exhaustive import mostly_slow
from helpers import hand_equilibrium, missing_opening, yield_excess
from intervals import ends, leaning

WITHOUT_PART = "dead load stands only together with a part of the live load"


def slab(
    pull: float = 0.6, friction: float = 0.5, live: tuple[float, ...] = (-1.0, 0.0, 0.0),
    height: float = 0.5, **joints: float,
) -> Scene:  # fmt: skip
    """A block 1 x 1 m that part of its own weight pulls along x; the live load pulls it back."""
    blocks = [
        Block.box("ground", (-1, -1, -1), (2, 2, 0)),
        Block.box("slab", (0, 0, 0), (1, 1, height), density=20.0),
    ]
    dead = Load(gravity=(0, 0, -1), acceleration=(pull, 0, 0))
    return Scene(blocks, ["ground"], Load(acceleration=live), dead, friction=friction, **joints)


def assert_interval(solution: Solution, least: float, most: float) -> None:
    """Both ends, each proved by forces and a mechanism, which are looked at by hand."""
    scene, found = solution.solved_scene, solution.lower_end
    assert scene is not None
    assert found is not None
    assert solution.interval is not None
    assert solution.interval == pytest.approx((least, most), rel=1e-5, abs=1e-7)
    assert solution.is_answered, solution.note
    assert WITHOUT_PART in solution.note
    matrix, dead, live = hand_equilibrium(scene)
    sides = [(solution.load_factor, solution.bracket, solution.forces, solution.mechanism, 1.0)]
    sides += [(found.load_factor, found.bracket, found.forces, found.mechanism, -1.0)]
    for factor, bracket, forces, mechanism, power in sides:
        if factor is None or not np.isfinite(factor):
            assert not bracket.has_any
            continue
        assert bracket.is_proved
        assert bracket.is_within(1e-5)
        assert bracket.lower <= factor <= bracket.upper
        assert forces is not None
        assert mechanism is not None
        load = np.abs(dead).sum() + abs(factor) * np.abs(live).sum()
        residual = matrix @ forces.ravel() + dead + factor * live
        assert np.abs(residual).max() <= 1e-6 * load
        assert yield_excess(scene, forces).max() <= 1e-6 * load
        u = np.array([mechanism[scene.blocks[i].id] for i in scene.free])
        assert live @ u.ravel() == pytest.approx(power)
        assert missing_opening(scene, u).max() <= 1e-6 * np.abs(u).max()
        assert dead @ u.ravel() == pytest.approx(-power * factor, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("surface", ["conic", "octagon", "parabolic"])
@pytest.mark.parametrize("model", ["auto", "full"])
def test_a_slab_that_slides_off_without_the_live_load(surface: str, model: str) -> None:
    assert_interval(solve(slab(), surface, model=model), 0.1, 1.1)  # type: ignore[arg-type]


@pytest.mark.parametrize("live", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_live_load_that_would_hold_it_turned_round(live: tuple[float, float, float]) -> None:
    """No part of it holds the slab; that it would the other way round is said, not an answer."""
    solution = solve(slab(live=live))
    assert solution.status is Status.DEAD_LOAD_UNSTABLE
    assert solution.interval is None
    assert "times the live load in the opposite direction would hold it" in solution.note


def test_a_slender_block_that_falls_over() -> None:
    """It turns about one edge below 0.2, about the other one above 1.0: half its width over half
    its height is 0.4."""
    assert_interval(solve(slab(height=2.5, friction=0.9)), 0.2, 1.0)


def test_cohesion_and_crushing() -> None:
    """Cohesion of 0.05 of the weight, then stone that bears three times the mean pressure."""
    found = solve(slab(cohesion=0.5))
    assert found.interval == pytest.approx((0.05, 1.15))
    assert found.is_proved
    assert found.lower_end is not None
    assert found.lower_end.bracket.is_proved
    found = solve(slab(height=2.5, friction=0.9, compressive_strength=150.0))
    assert found.interval == pytest.approx((0.6 - 0.4 * 2 / 3, 0.6 + 0.4 * 2 / 3), rel=1e-5)


def test_a_live_load_that_presses_has_no_upper_end() -> None:
    """At 0.2 times its weight pressed down besides, friction of 0.5 holds what pulls with 0.6."""
    solution = solve(slab(live=(0.0, 0.0, -1.0)))
    assert solution.status is Status.LIVE_LOAD_HARMLESS
    assert solution.load_factor is None
    assert_interval(solution, 0.2, np.inf)
    assert "from 0.2" in solution.note
    assert "it does no harm without dilatancy either" in solution.note
    assert solution.standing == "certified, without an upper end"
    assert "change the direction" not in solution.note


def test_an_upper_end_that_dilatancy_alone_takes_away(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Beside the slab that the live load presses, it slides a block from under a fixed lid:
    without dilatancy where 0.5 (1 - 0.9 a) = 0.3 a."""
    blocks = list(slab().blocks)
    blocks[0] = Block.box("ground", (-1, -1, -1), (5, 2, 0))
    blocks.append(Block.box("under", (3, 0, 0), (4, 1, 0.5), density=20.0))
    blocks.append(Block.box("lid", (3, 0, 0.5), (4, 1, 1)))
    scene = slab()
    leaning = Load(gravity=(0, 0, -1), forces={"slab": (6.0, 0, 0, 0, 0, 0)})
    live = Load(forces={"slab": (0, 0, -10.0, 0, 0, 0), "under": (3.0, 0, 9.0, 0, 0, 0)})
    scene = Scene(blocks, ["ground", "lid"], live, leaning, friction=0.5)
    solution = solve(scene)
    assert solution.interval == pytest.approx((0.2, np.inf), rel=1e-5)
    assert solution.status is Status.UNBOUNDED
    assert not solution.is_answered
    assert solution.dilatancy is not None
    assert solution.dilatancy.slides_at == pytest.approx(0.5 / 0.75, rel=1e-4)
    assert solution.range_text.endswith(" and more with dilatancy")
    assert "slides at 0.66667 without it" in solution.standing
    write_scene(scene, tmp_path / "scene.json")
    assert run(["solve", str(tmp_path / "scene.json")]) == 3
    assert "slides at 0.66667 without it" in capsys.readouterr().out


def test_one_factor_only() -> None:
    """Without friction the live load has to take up all of the pull, and nothing else."""
    solution = solve(slab(friction=0.0))
    assert solution.interval == pytest.approx((0.6, 0.6), rel=1e-6)
    assert solution.is_answered


@pytest.mark.parametrize("live", [(0.0, 1.0, 0.0), (0.0, 0.0, -1.0)])
def test_where_no_factor_exists_that_is_what_is_said(live: tuple[float, float, float]) -> None:
    """A second block, on which no live load acts, or a pull that a push across does not hold."""
    scene = slab(live=live)
    if live[2]:
        loose = Block.box("loose", (3, 0, 0), (4, 1, 0.5), density=20.0)
        ground = Block.box("ground", (-1, -1, -1), (9, 2, 0))
        only = Load(forces={"slab": (-10.0, 0, 0, 0, 0, 0)})
        scene = Scene([ground, scene.blocks[1], loose], ["ground"], only, scene.dead, friction=0.5)
    solution = solve(scene)
    assert ends(scene) is None
    assert solution.status is Status.DEAD_LOAD_UNSTABLE
    assert solution.interval is None
    assert "falls" in solution.note
    assert "open" not in solution.note


def test_a_dead_load_that_stands_alone_has_no_interval() -> None:
    solution = solve(slab(pull=0.4))
    assert solution.lower_end is None
    assert solution.interval is None
    assert solution.load_factor == pytest.approx(0.9)


METHODS = ["certified", "exact", "fixed-point", "zero-dilatancy"]


@pytest.mark.parametrize("method", METHODS)
def test_other_methods_say_that_they_need_a_dead_load_that_stands(method: str) -> None:
    with pytest.raises(ModelError, match="method 'convex' finds both ends; or make that part"):
        solve(slab(), method=method)  # type: ignore[arg-type]


def test_what_the_refusal_suggests_gives_the_upper_end() -> None:
    """A part of the live load that is dead load: factors count from there."""
    moved = slab().with_dead(Load(gravity=(0, 0, -1), acceleration=(0.6 - 0.5, 0, 0)))
    for method in (Certified(), ZeroDilatancy(searches=1, budget=40)):
        assert solve(moved, method=method).load_factor == pytest.approx(1.1 - 0.5, rel=1e-3)


def test_units_and_the_size_of_the_live_load_do_not_matter() -> None:
    scene = slab()
    solution = solve(scene.with_live(Load(acceleration=(-1e3, 0, 0))))
    assert solution.interval == pytest.approx((1e-4, 1.1e-3), rel=1e-5)
    heavy = solve(slab(pull=0.5 + 1e-6))  # 0 is out by a millionth
    assert heavy.interval == pytest.approx((1e-6, 1.0 + 1e-6), rel=1e-3)


def test_files_pictures_tables_and_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for live, range_ in (((-1.0, 0.0, 0.0), "0.1"), ((0.0, 0.0, -1.0), "0.2")):
        scene, name = slab(live=live), tmp_path / "scene.json"
        solution = solve(scene)
        write_result(solution, tmp_path / "result.json")
        back = read_result(tmp_path / "result.json")
        assert back.interval == solution.interval
        assert back.lower_end is not None
        assert solution.lower_end is not None
        assert back.lower_end.bracket == solution.lower_end.bracket
        assert np.array_equal(back.lower_end.forces, solution.lower_end.forces)  # type: ignore[arg-type]
        assert back.lower_end.mechanism is not None
        assert solution.to_dataframe().attrs["interval"] == solution.interval
        assert range_ in title(solution)
        assert range_ in repr(solution)
        for kind in ("mechanism", "forces", "page"):
            picture_of(solution, kind)
        write_scene(scene, name)
        assert run(["solve", str(name), "--json", str(tmp_path / "again.json")]) == 0
        out = capsys.readouterr().out
        assert f"load factor  {range_}" in out
        assert "interval     it stands with " in out
        assert "certified" in out


def test_a_sweep_has_a_column_for_the_lower_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = sweep(slab(), {"friction": [0.3, 0.5, 0.7]})
    assert table["least_factor"].tolist()[:2] == pytest.approx([0.3, 0.1])
    assert table["load_factor"].tolist() == pytest.approx([0.9, 1.1, 1.3])
    assert np.isnan(table["least_factor"][2])
    write_scene(slab(), tmp_path / "scene.json")
    assert run(["sweep", str(tmp_path / "scene.json"), "--vary", "friction=0.3,0.7"]) == 0
    assert "least factor" in capsys.readouterr().out


@pytest.mark.parametrize("seed", mostly_slow(range(300), range(8)))
def test_random_piles_agree_with_a_program_of_its_own(seed: int) -> None:
    """Where the dead load leans: intervals, factors from 0 on, none at all."""
    scene = leaning(seed)
    truth, solution = ends(scene), solve(scene)
    if truth is None or truth[1] < -1e-6:
        assert solution.status is Status.DEAD_LOAD_UNSTABLE
        assert ("in the opposite direction" in solution.note) is (truth is not None)
        assert solution.interval is None
    elif truth[0] < -1e-6 and truth[1] > 1e-6:
        assert solution.lower_end is None
        reached = np.inf if solution.load_factor is None else solution.load_factor
        assert reached == pytest.approx(truth[1], rel=1e-5)
    else:
        assert_interval(solution, *truth)
