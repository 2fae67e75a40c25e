"""Cohesion that is gone once a joint has moved, and ties that yield and break."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from cvxlimit import Block, Load, Path, Scene, code_check, prove, pushover, solve
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.files import PATH
from cvxlimit.io import json_schema, read_path
from cvxlimit.masonry import arch, single_block, stack
from cvxlimit.model.formulations import vertex_forces
from cvxlimit.scene.reactions import Tie
from cvxlimit.surfaces import Rocking
from displaced import assert_balanced_within_friction
from linkages import rocking

B, WIDTH, H = 0.4, 0.5, 1.0
PULL, HIGH, AWAY = 0.2, 0.8, 1.0
"""Strength of the tie, its height on the block's face, and its length at first."""


def quick(scene: Scene, **options: Any) -> Path:
    return pushover(scene, certify="none", **options)


def turn_of(path: Path, block: str = "b1") -> Any:
    return np.array([x.displacements[block][4] for x in path])


# Cohesion


@pytest.mark.parametrize(
    "flow", [pytest.param("associated", marks=pytest.mark.exhaustive), "zero-dilatancy"]
)
def test_a_block_slides_at_its_cohesion_first_and_at_friction_from_then_on(
    flow: Any, tmp_path: File
) -> None:
    scene = single_block((1.0, 0.5, 0.3), friction=0.3).with_cohesion(2.0)
    lines: list[str] = []

    def stop(line: str) -> None:
        lines.append(line)
        if len(lines) == 4:  # it slides on to the end of its support
            raise KeyboardInterrupt

    path = pushover(scene, step=0.15, flow=flow, progress=stop)
    peak = 0.3 + 2.0 * 0.5 / scene.total_weight
    assert path.load_factor[0] == pytest.approx(peak, abs=1e-8)
    assert path.load_factor[1:4] == pytest.approx([0.3] * 3, abs=1e-7)
    assert path.w[1] < 1e-3 * path.step * 1.01  # the drop is enclosed
    assert path.failures == ((0.0, "cohesion of ground-b1"),)
    assert path.failed[:2] == ["", "cohesion of ground-b1"]
    for shown, exact in zip(path.configurations[:4], (peak, 0.3, 0.3, 0.3), strict=True):
        bracket = shown.bracket
        assert bracket is not None
        assert bracket.is_proved
        assert bracket.lower - 1e-7 <= exact <= bracket.upper + 1e-7
        assert bracket.upper - bracket.lower < 1e-6
    path.save(tmp_path / "path.json")
    assert read_path(tmp_path / "path.json").failures == path.failures
    assert prove(tmp_path / "path.json").is_proved


def test_cohesion_without_friction_holds_as_well() -> None:
    scene = single_block((1.0, 0.5, 0.3), friction=0.0).with_cohesion(2.0)
    path = pushover(scene, step=0.05, until=1e-3)
    peak = 2.0 * 0.5 / scene.total_weight
    assert path.load_factor[0] == pytest.approx(peak, abs=1e-8)
    assert path.load_factor[1] == pytest.approx(0.0, abs=1e-7)
    bracket = path[0].bracket
    assert bracket is not None
    assert bracket.is_proved
    assert bracket.lower <= peak + 1e-9
    assert peak - 1e-9 <= bracket.upper
    assert bracket.upper - bracket.lower < 1e-6


def test_a_joint_that_opens_has_lost_its_cohesion() -> None:
    """Cohesion bears no tension: it keeps the block from sliding at rest, not from turning. The
    friction that is left holds the edge on which the block turns."""
    scene = single_block((B, WIDTH, H), friction=0.5).with_cohesion(50.0)
    path = quick(scene, step=0.03)
    assert path.load_factor == pytest.approx([rocking(B, H, w) for w in path.w], abs=1e-8)
    assert path.failures == ((0.0, "cohesion of ground-b1"),)
    assert path[0].points.cohesion.sum() == pytest.approx(50.0 * B * WIDTH)
    assert not path[1].points.cohesion.any()


def test_the_first_load_factor_is_that_of_the_same_cohesion_at_corners() -> None:
    """A second path: the load factor of the scene with a force at every corner of a contact."""
    scene = arch(5, 0.3, friction=0.3).with_cohesion(1.5)
    found = solve(scene, [Rocking()], formulation=vertex_forces)
    dry = solve(scene.with_cohesion(0.0), [Rocking()], formulation=vertex_forces)
    assert found.load_factor is not None
    assert dry.load_factor is not None
    path = pushover(scene, step=0.01, until=10.0)
    assert len(path) == 1
    assert path.load_factor[0] == pytest.approx(found.load_factor, rel=1e-5)
    assert path.load_factor[0] > 1.05 * dry.load_factor


# Ties


def tied(force: float = PULL) -> Scene:
    """A block that is tied to an anchor before its face, at 0.8 of its height."""
    block = single_block((B, WIDTH, H), friction=2.0)
    anchor = Block.box("anchor", (-1.1, 0, 0), (-AWAY, WIDTH, 0.9))
    tie = Tie("anchor", "b1", (-AWAY, 0.25, HIGH), (0.0, 0.25, HIGH), force)
    return replace(
        block, blocks=(*block.blocks, anchor), supports=(*block.supports, "anchor"), ties=(tie,)
    )


def held_by(scene: Scene, turn: Any, force: float) -> Any:
    """Load factor of the block that has turned about its toe, and whose tie pulls with a force."""
    toe, arm = np.array([B, 0.0]), np.array([-B, HIGH])
    c, s = np.cos(turn), np.sin(turn)
    x, z = c * arm[0] + s * arm[1], -s * arm[0] + c * arm[1]
    way = np.stack([-AWAY - toe[0] - x, HIGH - toe[1] - z])
    way = way / np.linalg.norm(way, axis=0)
    back = force * (x * way[1] - z * way[0])  # moment of the tie against the push
    left = np.arctan2(B, H) - turn
    weight = scene.total_weight * 0.5 * np.hypot(B, H)
    return (weight * np.sin(left) + back) / (weight * np.cos(left))


def length_at(turn: float) -> float:
    c, s = np.cos(turn), np.sin(turn)
    end = np.array([B - c * B + s * HIGH, s * B + c * HIGH])
    return float(np.linalg.norm(end - [-AWAY, HIGH]))


@pytest.fixture(scope="module")
def torn() -> Path:
    """Its tie breaks on the way."""
    return pushover(tied(), step=0.06, stretch=0.05)


@pytest.mark.parametrize("stretch", [pytest.param(0.0, marks=pytest.mark.exhaustive), 0.05, 9.0])
@pytest.mark.exhaustive_cases("9.0")
def test_a_tie_pulls_with_its_strength_until_it_breaks(stretch: float, tmp_path: File) -> None:
    scene = tied()
    path = pushover(scene, step=0.06, stretch=stretch)
    turn = turn_of(path)
    holds = np.array([length_at(x) <= AWAY * (1.0 + stretch) + 1e-6 for x in turn])
    exact = np.where(holds, held_by(scene, turn, PULL), held_by(scene, turn, 0.0))
    assert path.load_factor == pytest.approx(exact, abs=1e-7)
    assert path.status == "zero"
    assert path.stretch == stretch
    torn = np.flatnonzero(~holds)
    if stretch == 9.0:
        assert not len(torn)
        assert path.failures == ()
    else:
        first = int(torn[0])
        assert path.failures == ((path.w[first - 1], "tie anchor-b1"),)
        assert path.w[first] - path.w[first - 1] < 1e-3 * path.step * 1.01
        if stretch:  # enclosed: it is stretched by as much as it bears, up to a step of the finest
            assert length_at(turn[first - 1]) == pytest.approx(AWAY * (1 + stretch), abs=1e-3)
    for shown in path:
        assert_balanced_within_friction(shown)
        assert shown.bracket is not None
        assert shown.bracket.is_proved
        assert shown.bracket.upper - shown.bracket.lower < 1e-7
    assert path.work is not None
    assert abs(path.work.difference) < 1e-3  # over few steps; the yielding tie's is part of it
    path.save(tmp_path / "path.json")
    document = PATH.to_dict(path)
    Draft202012Validator(json_schema("path")).validate(document)
    assert prove(tmp_path / "path.json").is_proved
    # begun again from the second configuration, as a scene with a tie of its own
    again = quick(path[2].scene(), until=path.load_factor[2] - 1e-3)
    assert again.load_factor[0] == pytest.approx(path.load_factor[2], abs=1e-7)


def test_a_tie_between_two_blocks_holds_the_upper_one_until_it_opens() -> None:
    """The upper of two blocks is pushed at its centre and tied down at its heel: the load factor is
    by moments about its toe, and once the joint has opened the tie is gone."""
    low, high, force = 0.4, 0.8, 3.0
    ground = Block.box("ground", (-2, -2, -1), (2, 2, 0))
    blocks = [ground, Block.box("low", (0, 0, 0), (B, WIDTH, low), 500.0),
              Block.box("up", (0, 0, low), (B, WIDTH, low + high), 20.0)]  # fmt: skip
    tie = Tie("low", "up", (0.0, 0.25, 0.5 * low), (0.0, 0.25, low + 0.3), force)
    weight = 20.0 * B * WIDTH * high
    push = Load(weights={"up": (1, 0, 0)})
    scene = Scene(blocks, ["ground"], push, friction=2.0, ties=[tie])
    path = pushover(scene, step=0.02)
    arms = (weight * B / 2 + force * B) / (weight * high / 2)
    assert path.load_factor[0] == pytest.approx(arms, abs=1e-8)
    assert path[0].forces[np.isfinite(path[0].points.most), 0] == pytest.approx([force])
    assert path.failures == ((0.0, "tie low-up"),)
    exact = [rocking(B, high, w) for w in path.w[1:]]
    assert path.load_factor[1:] == pytest.approx(exact, abs=1e-7)
    assert not path[1].scene().ties


def test_a_slack_tie_pulls_only_once_it_is_taut_again() -> None:
    """The anchor stands on the side to which the block turns: the tie slackens and is idle."""
    block = single_block((B, WIDTH, H), friction=2.0)
    post = Block.box("post", (1.4, 0, 0), (1.5, WIDTH, 0.9))
    tie = Tie("post", "b1", (1.4, 0.25, HIGH), (B, 0.25, HIGH), PULL)
    scene = replace(
        block, blocks=(*block.blocks, post), supports=(*block.supports, "post"), ties=(tie,)
    )
    path = pushover(scene, step=0.05)
    assert path.load_factor == pytest.approx([rocking(B, H, w) for w in path.w], abs=1e-7)
    assert path.failures == ()
    assert not path[1].scene().ties
    assert prove(path).is_proved


# What is said of them


def test_a_tie_that_costs_more_than_half_is_a_local_failure_of_the_code_check() -> None:
    path = quick(tied(8.0), step=0.06, stretch=0.02, control=("b1", (1, 0, 0)))
    ((at, _),) = path.failures
    check = code_check(path)
    assert check.slv is not None
    assert check.slv.basis == "tie anchor-b1 costs more than half of it"
    spectral = check.d_SLV / path.displacement[int(np.flatnonzero(path.w == at)[0])]
    assert spectral == pytest.approx(check.d0 / path.d0)


def test_what_came_apart_stands_in_curve_and_table(torn: Path) -> None:
    labels = torn.plot().axes[0].get_legend_handles_labels()[1]
    assert "cohesion or tie gone from there on" in labels
    table = torn.to_dataframe()
    assert [x for x in table["failed"] if x] == ["tie anchor-b1"]
    assert any("gone from there on: tie anchor-b1 at w = " in note for note in torn.notes)


@pytest.mark.parametrize(
    ("change", "claim"),
    [
        (lambda p: replace(p, failures=()), "came apart"),
        (lambda p: replace(p, failures=((0.0, "tie anchor-b1"),)), "came apart"),
        (lambda p: replace(p, failures=((0.0, "tie nowhere"),)), "came apart"),
        (lambda p: replace(p, stretch=0.5), "came apart"),
        (lambda p: replace(p, stretch=0.01), "came apart"),
        (lambda p: with_points(p, 1, most=2.0), "points of configuration 1"),
        (lambda p: with_points(p, 5, cohesion=1.0), "points of configuration 5"),
    ],
)
def test_what_was_changed_is_not_proved(
    torn: Path, change: Callable[[Path], Path], claim: str
) -> None:
    missing = [x.claim for x in prove(change(torn)).missing]
    assert any(claim in x for x in missing), missing


def with_points(path: Path, i: int, **values: float) -> Path:
    """The path with other strengths of the points of one configuration."""
    made, p = list(path), path[i].points
    changed = {
        name: np.where(getattr(p, name) < np.inf, value, getattr(p, name))
        for name, value in values.items()
    }
    made[i] = replace(made[i], points=replace(p, **changed))
    return replace(path, configurations=tuple(made))


def test_how_far_ties_stretch_is_a_number_that_is_not_negative() -> None:
    with pytest.raises(InputError, match="stretch must be finite and not negative"):
        pushover(tied(), stretch=-0.1)


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(12))
def test_random_walls_with_cohesion_and_ties_keep_the_laws(seed: int) -> None:
    """Stacks under an oblique push, with a tie from the ground and cohesion in some joints."""
    random = np.random.default_rng(seed)
    way = random.uniform(-0.6, 0.6)
    push = Load(acceleration=(np.cos(way), np.sin(way), 0.0))
    scene = stack(3, (0.5, 0.4, 0.3), friction=float(random.uniform(0.8, 2.0))).with_live(push)
    free = [scene.blocks[i].id for i in scene.free]
    top = scene.blocks[scene.free[-1]].vertices
    at = top[np.lexsort((top[:, 0], top[:, 1], top[:, 2]))[0]]
    tie = Tie(scene.supports[0], free[-1], (at[0], at[1], -0.2), tuple(at), 0.3)
    own = {("b1", "b2"): float(random.uniform(0.0, 4.0))} if {"b1", "b2"} <= {*free} else {}
    scene = replace(scene, ties=(tie,), contact_cohesion=own)
    path = quick(scene, step=0.03, until=0.05, stretch=float(random.choice([0.0, 0.05])))
    assert path.status == "zero", path.reason
    for shown in path:
        p, n = shown.points, shown.forces[:, 0]
        v = np.linalg.norm(shown.forces[:, 1:], axis=1)
        assert (v <= p.friction * n + p.cohesion + 1e-7 * scene.total_weight).all()
        assert (n <= p.most + 1e-7 * scene.total_weight).all()
        assert p.depth <= 1e-7 * scene.contacts.typical_size
    shown = path[len(path) // 2]
    again = quick(shown.scene(), until=shown.load_factor - 1e-3)
    assert again.load_factor[0] == pytest.approx(shown.load_factor, abs=1e-6)
