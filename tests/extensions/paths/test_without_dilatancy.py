"""Paths along which joints slide without opening, against closed forms and a check of their own."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cvxlimit import Block, Load, Path, Scene, builtin_scene, pushover, solve
from cvxlimit.base import doors
from cvxlimit.extensions.paths.configuration import Configuration
from cvxlimit.extensions.paths.starting import from_rest
from displaced import assert_balanced_within_friction
from exhaustive import slow

TURNED = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()


def slid(scene: Scene, step: float = 0.1, most: int = 99, **options: Any) -> Path:
    lines: list[str] = []

    def stop(line: str) -> None:
        lines.append(line)
        if len(lines) > most:
            raise KeyboardInterrupt

    return pushover(
        scene, step, flow="zero-dilatancy", certify="none", progress=stop, **options
    )  # fmt: skip


def bed(end: float = 3.0) -> Block:
    return Block.box("bed", (-3.0, -3.0, -1.0), (end, 3.0, 0.0))


def push(angle: float = 0.0) -> Load:
    return Load(acceleration=(np.cos(angle), np.sin(angle), 0.0))


def box(name: str, x: float, size: tuple[float, float, float], z: float = 0.0) -> Block:
    """From x on, across the middle of the bed."""
    return Block.box(name, (x, -size[1] / 2, z), (x + size[0], size[1] / 2, z + size[2]), 20.0)


def rises(path: Path, up: np.ndarray) -> float:
    """How far any block has moved along ``up``."""
    return max(abs(float(d[:3] @ up)) for x in path for d in x.displacements.values())


@pytest.mark.parametrize("is_turned", [False, True])
def test_a_block_slides_to_the_end_of_its_bed_and_falls(is_turned: bool) -> None:
    scene = Scene([bed(0.5), box("b", -0.25, (0.5, 0.5, 0.25))], ["bed"], push(), friction=0.3)
    scene = scene.moved(TURNED, (3.0, -2.0, 1.0)) if is_turned else scene
    path = slid(scene)
    slides = path.w < 0.45  # then it turns about the end of the bed
    assert slides.sum() == 5
    assert path.load_factor[slides] == pytest.approx(0.3, abs=1e-8)
    up = TURNED[:, 2] if is_turned else np.array([0.0, 0.0, 1.0])
    assert rises(replace(path, configurations=path[:5]), up) < 1e-8
    assert path.w[-1] == pytest.approx(0.5, abs=1e-8)
    assert path.slides_away
    assert "'bed'-'b' slides" in path.reason
    assert "without dilatancy" in path.notes[0]
    assert max(x.loss for x in path) < 1e-8


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_stack_slides_at_its_bed_in_the_direction_of_the_push(angle: float) -> None:
    blocks = [box(f"b{i}", -0.25, (0.5, 0.5, 0.2), 0.2 * i) for i in range(3)]
    scene = Scene([bed(), *blocks], ["bed"], push(angle), friction=0.6,
                  contact_friction={("bed", "b0"): 0.25})  # fmt: skip
    path = slid(scene, most=3)
    assert path.load_factor == pytest.approx(0.25, abs=1e-8)
    assert rises(path, np.array([0.0, 0.0, 1.0])) < 1e-8
    for x in path:
        for d in x.displacements.values():
            assert d == pytest.approx(
                [x.w * np.cos(angle), x.w * np.sin(angle), 0, 0, 0, 0], abs=1e-6
            )


@pytest.mark.parametrize("slope", [-0.2, 0.15])
def test_a_block_on_an_inclined_plane(slope: float) -> None:
    """Down the slope and up."""
    turn = Rotation.from_euler("y", slope).as_matrix()
    blocks = [b.moved(turn, (0.0, 0.0, 0.0)) for b in (bed(), box("b", -0.25, (0.5, 0.5, 0.25)))]
    path = slid(Scene(blocks, ["bed"], push(), friction=0.5), most=3)
    assert path.load_factor == pytest.approx(np.tan(np.arctan(0.5) - slope), abs=1e-8)
    assert rises(path, turn[:, 2]) < 1e-8


def test_one_block_pushes_another_before_it() -> None:
    low, rough = box("low", 0.0, (0.5, 0.5, 0.25)), box("rough", 0.5, (0.4, 0.5, 0.2))
    friction = {("bed", "low"): 0.2, ("bed", "rough"): 0.5}
    scene = Scene([bed(), low, rough], ["bed"], push(), friction=0.0, contact_friction=friction)
    weight = np.array([low.volume, rough.volume])
    path = slid(scene, most=3)
    assert path.load_factor == pytest.approx(weight @ [0.2, 0.5] / weight.sum(), abs=1e-8)
    assert rises(path, np.array([0.0, 0.0, 1.0])) < 1e-8


def tower(seed: int) -> Scene:
    """Boxes of any sizes on one another, each turned about z, all joints of different friction."""
    random = np.random.default_rng(seed)
    blocks, friction, base = [bed()], dict[tuple[str, str], float](), 0.0
    for i in range(int(random.integers(2, 5))):
        size = random.uniform([0.5, 0.5, 0.15], [0.8, 0.8, 0.3])
        low = (-size[0] / 2, -size[1] / 2, 0.0)
        made = Block.box(f"b{i}", low, (size[0] / 2, size[1] / 2, size[2]), 20.0)
        turn = Rotation.from_euler("z", random.uniform(0.0, 6.0)).as_matrix()
        friction[blocks[-1].id, f"b{i}"] = float(random.uniform(0.2, 0.5))
        blocks.append(made.moved(turn, (*random.uniform(-0.04, 0.04, 2), base)))
        base += size[2]
    return Scene(blocks, ["bed"], push(random.uniform(0.0, 6.3)), contact_friction=friction)


def lost(shown: Configuration) -> float:
    """Work of compressions across gaps, and of friction that does not oppose the whole slip."""
    points, n = shown.points, shown.forces[:, 0]
    slip = np.linalg.norm(points.slip, axis=1)
    each = n * (points.gap + points.friction * slip) + (shown.forces[:, 1:] * points.slip).sum(1)
    return float(each.sum())


@pytest.mark.parametrize(
    "seeds", [range(1), pytest.param(range(1, 40), marks=pytest.mark.exhaustive)]
)
def test_random_towers_slide_by_the_laws(seeds: range) -> None:
    for seed in seeds:
        path = slid(tower(seed), 0.03, most=3)
        assert path.status in ("interrupted", "zero"), (seed, path.reason)
        assert path.slides
        least = min(tower(seed).contact_friction.values())
        assert path.load_factor[0] <= least + 1e-6
        for shown in path:
            assert_balanced_within_friction(shown)
        weight = path.scene.total_weight  # the live load's size
        for before, shown in pairwise(path):
            work = path.load_factor[0] * (shown.w - before.w) * weight
            assert lost(shown) <= shown.loss * work + 1e-8 * weight


@pytest.mark.parametrize(
    ("name", "first"), [slow("tuff-wall", 1.0 / 6.0), ("ferris-tin-loi-3", 0.355817)]
)
def test_a_path_begins_where_the_way_from_rest_ends(name: str, first: float) -> None:
    """The tuff wall overturns as one, and the lowest state of the wall of Ferris and Tin-Loi is
    known; both come down from there, and nothing is lost: joints that slide without opening may
    do so in other states, at higher load factors."""
    scene = builtin_scene(name)
    reached = solve(scene, method="incremental")
    path = slid(scene, scene.contacts.typical_size / 100.0, most=1)
    assert path.load_factor[0] == pytest.approx(first, abs=1e-6)
    assert path.load_factor[0] == pytest.approx(reached.steps[-1].load_factor, rel=1e-6)
    assert any(x.startswith("the path begins where the way from rest ends") for x in path.notes)
    assert (np.diff(path.load_factor) < 0.0).all()
    assert max(x.loss for x in path) < 1e-6  # a thousandth of what counts as none
    for shown in path:
        assert_balanced_within_friction(shown)


def test_a_path_begins_somewhere_where_nobody_goes_the_way_from_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delitem(doors._PLACES["cvxlimit.methods"], "incremental", raising=False)
    scene = builtin_scene("ferris-tin-loi-3")
    from_rest.cache_clear()
    path = slid(scene, 0.01, most=0)
    from_rest.cache_clear()
    assert 0.355817 - 1e-6 <= path.load_factor[0] <= 0.403695
    (told,) = (note for note in path.notes if note.startswith("the path begins"))
    assert "not where a way from rest ends" in told
