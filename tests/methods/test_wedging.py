"""Live loads of which any multiple is carried with dilatancy: harmless, sliding, or not known."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from cvxlimit import (
    Block,
    LimitProblem,
    Load,
    Reaction,
    Scene,
    Solution,
    Status,
    prove,
    solve,
)
from cvxlimit.base import doors
from cvxlimit.cli.main import run
from cvxlimit.io import read_result, write_result, write_scene
from cvxlimit.masonry import arch
from cvxlimit.plotting import picture_of, title
from cvxlimit.studies import sweep
from exhaustive import mostly_slow, slow
from helpers import hand_equilibrium, yield_excess

pytest.importorskip("cvxlimit.extensions.dilatancy")  # which knows loads without a limit

NEAR = 1e-4
"""How near a member is to the closed form: the power that it may lack, 1e-6, is of second order in
the load factor where the direction of friction turns, and so allows 1e-3 of it at most."""


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


def prism(id: str, profile: list[tuple[float, float]], y0: float, y1: float) -> Block:
    """Along y, of a convex profile in x and z."""
    return Block.hull(id, [(x, y, z) for y in (y0, y1) for x, z in profile], density=20.0)


def groove(half_angle: float, friction: float, dip: float = 15.0) -> Scene:
    """A wedge in a groove of this half angle, pushed down along it."""
    w, t = np.tan(np.radians(half_angle)), np.radians(dip)
    wedge = prism("wedge", [(0, 0), (w, 1), (-w, 1)], 0, 12)
    sides = [
        prism(name, [(0, 0), (s * w, 1), (s * (w + 1), 1), (s, -1), (0, -1)], -5, 25)
        for name, s in (("left", -1), ("right", 1))
    ]
    dead = Load(gravity=(0, np.sin(t), -np.cos(t)))
    live = Load(acceleration=(0, 1, 0))
    return Scene([wedge, *sides], ["left", "right"], live, dead, friction=friction)


def dovetail(live: tuple[float, ...], friction: float = 0.4) -> Scene:
    """A block that is wider below, in a slot that it fills."""
    blocks = [prism("tail", [(-1, 0), (1, 0), (0.5, 1), (-0.5, 1)], 0, 3)]
    blocks.append(prism("bed", [(-2, -1), (2, -1), (2, 0), (-2, 0)], -1, 4))
    for name, s in (("left", -1), ("right", 1)):
        blocks.append(prism(name, [(s, 0), (s * 0.5, 1), (s * 2, 1), (s * 2, 0)], -1, 4))
    return Scene(blocks, ["bed", "left", "right"], Load(acceleration=live), friction=friction)


def keystone(live: tuple[float, ...], friction: float = 0.6) -> Scene:
    """A keystone between fixed springings, whose joints lean by 15 degrees."""
    t = 0.5 * np.tan(np.radians(15.0))
    key = [(t - 0.5, 0), (0.5 - t, 0), (0.5 + t, 1), (-0.5 - t, 1)]
    blocks = [prism("key", key, 0, 1)]
    for name, s in (("left", -1), ("right", 1)):
        side = [(s * (0.5 - t), 0), (s * (0.5 + t), 1), (s * 2, 1), (s * 2, 0)]
        blocks.append(prism(name, side, -0.5, 1.5))
    return Scene(blocks, ["left", "right"], Load(acceleration=live), friction=friction)


def keyed_dam(rise: float, friction: float) -> Scene:
    """A dam on a bed with a key, which its toe leans on at an angle of ``rise`` from level."""
    t = 1.0 / np.tan(np.radians(rise))
    dam = prism("dam", [(-1, 0), (0, 0), (t, 1), (-1, 1)], 0, 1)
    key = prism("key", [(0, 0), (t, 1), (2 + t, 1), (2 + t, 0)], -1, 2)
    bed = prism("bed", [(-3, -1), (3 + t, -1), (3 + t, 0), (-3, 0)], -1, 2)
    return Scene([dam, key, bed], ["key", "bed"], Load(acceleration=(1, 0, 0)), friction=friction)


def assert_harmless(solution: Solution) -> None:
    """Said everywhere alike, with forces that carry the live load alone, looked at by hand."""
    scene = solution.scene
    assert solution.status is Status.LIVE_LOAD_HARMLESS, solution.note
    assert solution.standing == "live load does no harm"
    assert solution.dilatancy is None
    assert "change the direction" in solution.note
    matrix, _, live = hand_equilibrium(scene)
    assert solution.forces is not None
    size = np.abs(live).max()
    assert np.abs(matrix @ solution.forces.ravel() + live).max() <= 1e-7 * size
    assert yield_excess(scene, solution.forces).max() <= 1e-7 * size


def slides_at(solution: Solution) -> float | None:
    """What the solution says of it, everywhere alike; None if it says that it is not known."""
    assert solution.status is Status.UNBOUNDED, solution.note
    assert solution.load_factor is None
    assert solution.dilatancy is not None
    assert solution.dilatancy.is_all
    found = solution.dilatancy.slides_at
    known = "not known" if found is None else "slides at"
    assert solution.standing.startswith(f"no limit with dilatancy, {known}")
    assert solution.standing in title(solution)
    assert "no harm" not in solution.standing + solution.note
    assert "change the direction" not in solution.note
    assert "method 'zero-dilatancy'" in solution.note
    assert ("is not known" in solution.note) is (found is None)
    if found is not None:
        assert solution.dilatancy.safe <= found * (1.0 + NEAR)
        assert solution.dilatancy.sliding
    return found


ANGLES = [20.0, 30.0, 40.0, 45.0, 55.0]


@pytest.mark.parametrize("half_angle", mostly_slow(ANGLES, (30.0,)))
@pytest.mark.parametrize("share", [0.9, 1.15])
def test_a_wedge_in_a_groove(half_angle: float, share: float) -> None:
    """Friction of so much tan h: below tan h the wedge dilates and falls, above it jams with
    dilatancy and slides without it. Both faces press with W cos(dip) / (2 sin h) then."""
    h, dip = np.radians(half_angle), np.radians(15.0)
    mu = share * np.tan(h)
    solution = solve(groove(half_angle, mu))
    if share < 1.0:
        across = np.sqrt(np.sin(h) ** 2 - (mu * np.cos(h)) ** 2)
        associated = mu * np.cos(dip) / across - np.sin(dip)
        assert solution.load_factor == pytest.approx(associated, rel=1e-5)
    else:
        without = mu * np.cos(dip) / np.sin(h) - np.sin(dip)
        assert slides_at(solution) == pytest.approx(without, rel=NEAR)


KNOWN = {
    "lid": (clamped((0.3, 0.0, 0.9), 0.8), 0.8 / (0.3 + 0.8 * 0.9)),  # 0.8 (1 - 0.9 a) = 0.3 a
    "dovetail": (dovetail((0, 1, 0)), 0.4),  # on its bed alone
    "keystone, out of the wall": (keystone((0, 1, 0)), 0.6 / np.sin(np.radians(15.0))),
    "keystone, lifted": (keystone((0, 0, 1)), 1.0),  # nothing presses it then
    "against a wall and up": (row(1, (1.0, 0.0, 3.0)), 1.0 / (3.0 - 0.7)),
}


@pytest.mark.parametrize("name", mostly_slow(KNOWN, ("dovetail", "lid")))
@pytest.mark.exhaustive_cases("lid")
def test_blocks_that_slide_where_dilatancy_would_hold_any_load(name: str) -> None:
    scene, truth = KNOWN[name]
    solution = solve(scene)
    assert slides_at(solution) == pytest.approx(truth, rel=NEAR)
    assert solution.lower <= truth  # where it is not -inf, it is proved


@pytest.mark.exhaustive
@pytest.mark.parametrize("side", [slow(1.0), -1.0], ids=["along", "against"])
@pytest.mark.parametrize(("friction", "most"), [(0.8, 2.0), slow(0.5, 1.0)])
def test_a_reaction_where_dilatancy_would_hold_any_load(
    friction: float, most: float, side: float
) -> None:
    """A block between ground and lid is pushed and lifted: mu (W - 0.9 a W) and the reaction that
    pushes against it, as much as it can, hold 0.3 a W. By ``LimitProblem`` and in a sweep, too."""
    ground, lid = (Block.box(n, (-1, -1, z), (2, 2, z + 1)) for n, z in (("g", -1), ("lid", 1)))
    block = Block.box("b", (0, 0, 0), (1, 1, 1), density=10.0)
    held = Reaction("b", (0.5 - 0.5 * side, 0.5, 0.5), (side, 0, 0), most)
    push = Load(acceleration=(0.3, 0.0, 0.9))
    scene = Scene([ground, block, lid], ["g", "lid"], push, friction=friction, reactions=[held])
    truth = (10.0 * friction + most * (side < 0.0)) / (3.0 + 9.0 * friction)
    assert slides_at(solve(scene)) == pytest.approx(truth, rel=NEAR)
    assert slides_at(LimitProblem(scene).solve()) == pytest.approx(truth, rel=NEAR)
    (status,) = sweep(scene, {"friction": [friction]}, progress=False)["status"]
    assert status == Status.UNBOUNDED


HARMLESS = {
    **{f"into the ground at {a:g}": pushed(a) for a in (0.0, 10.0, 30.0, 34.0)},  # tan 35 is 0.7
    "up in a dovetail": dovetail((0, 0, 1)),
    "across a dovetail": dovetail((1, 0, 0)),
    "down on a keystone": keystone((0, 0, -1)),
    "down on a keystone of little friction": keystone((0, 0, -1), 0.01),
    "dam against an upright key": keyed_dam(90.0, 0.3),
    "dam against a key within friction": keyed_dam(60.0, 0.7),
    "arch under more of its weight": arch(9, live=Load(acceleration=(0, 0, -1))),
    "row against a wall and up": row(1, (1.0, 0.0, 0.6)),
}


@pytest.mark.parametrize("name", HARMLESS)
def test_loads_that_press_joints_themselves(name: str) -> None:
    assert_harmless(solve(HARMLESS[name]))


@pytest.mark.parametrize("name", mostly_slow(HARMLESS, ()))
def test_no_solution_is_found_where_there_is_none(name: str) -> None:
    found = solve(HARMLESS[name], method="zero-dilatancy")
    assert all(member.load_factor <= 0.0 for member in found.members)


def test_a_dam_that_climbs_its_key() -> None:
    """At 40 degrees, and friction of 0.7, it needs tan(40 + 35) at most; its bed lets it go."""
    solution = solve(keyed_dam(40.0, 0.7))
    assert solution.load_factor == pytest.approx(np.tan(np.radians(40.0) + np.arctan(0.7)))


def test_what_no_proof_and_no_search_settles_is_not_known() -> None:
    """A cube that friction alone holds between walls: pressed as little as can be it is about to
    fall, whatever pushes it against one of them."""
    assert slides_at(solve(row(1, (1.0, 0.0, 0.0)))) is None


@pytest.mark.parametrize("method", ["convex", "exact", "certified"])
def test_methods_that_have_no_words_for_friction_without_dilatancy(method: str) -> None:
    """Clamped cubes slide from 1 on; what holds without any friction holds for all of them."""
    solution = solve(clamped(), method=method)  # type: ignore[arg-type]
    found = slides_at(solution)
    if method == "convex":
        assert found == pytest.approx(1.0, rel=NEAR)
        assert solution.lower == pytest.approx(1.0, abs=1e-8)
        assert "below 0.99999 they do not (proved)" in solution.note
    else:
        assert found is None
    down = solve(keystone((0, 0, -1)), method=method)  # type: ignore[arg-type]
    assert down.status is Status.LIVE_LOAD_HARMLESS


@pytest.mark.parametrize("surface", ["conic", "octagon", slow("octagon-inscribed")])
@pytest.mark.parametrize("cubes", [1, slow(3)])
@pytest.mark.exhaustive_cases("1-octagon")
def test_rows_between_walls(cubes: int, surface: str) -> None:
    """Lifted at 1: nothing presses the cubes then."""
    found = slides_at(solve(row(cubes), surface))  # type: ignore[arg-type]
    assert found == pytest.approx(1.0, rel=NEAR)


@pytest.fixture
def without_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where the extension that searches for solutions that slide is not installed."""
    group, name = "cvxlimit.readings", "slides_without_dilatancy"
    monkeypatch.delitem(doors._PLACES[group], name)
    monkeypatch.setitem(doors._ABSENT, (group, name), "dilatancy")


@pytest.mark.usefixtures("without_search")
@pytest.mark.parametrize(
    "name", mostly_slow(HARMLESS, ("into the ground at 30", "down on a keystone"))
)
def test_no_harm_is_proved_without_the_extension_that_searches(name: str) -> None:
    assert_harmless(solve(HARMLESS[name]))


@pytest.mark.usefixtures("without_search")
def test_what_no_search_was_made_for_is_not_known_and_names_what_is_missing() -> None:
    solution = solve(clamped())
    assert slides_at(solution) is None
    assert solution.lower == pytest.approx(1.0, abs=1e-8)  # proved, by no search
    assert "slide is of extension 'dilatancy', which is not part of this" in solution.note


def test_a_surface_of_ones_own_proves_nothing() -> None:
    """Its friction may be another than that of the contacts."""
    assert solve(pushed(0.0), "parabolic").status is Status.UNBOUNDED


def test_files_and_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    solution = solve(clamped())
    assert "change the direction" not in picture_of(solution, "page")
    assert "zero-dilatancy" in solution._repr_html_()
    write_result(solution, tmp_path / "result.json")
    held = json.loads((tmp_path / "result.json").read_text())
    assert held["status"] == "no limit with dilatancy"
    assert held["dilatancy"]["share"] == "inf"
    assert held["dilatancy"]["slides_at"] == pytest.approx(1.0, rel=NEAR)
    assert read_result(tmp_path / "result.json").dilatancy == solution.dilatancy
    write_scene(clamped(), tmp_path / "scene.json")
    assert run(["solve", str(tmp_path / "scene.json")]) == 3
    out, err = capsys.readouterr()
    assert "slides at 1.0000 without it" in out
    assert "slides at 1.0000 without it" in err
    assert "zero-dilatancy" in err
    assert "no harm" not in out + err


def test_proved_again() -> None:
    """What is said to do no harm, and where the status of the file was changed to that."""
    for scene in (keystone((0, 0, -1)), pushed(30.0)):
        assert prove(solve(scene), scene).is_proved
    jammed = solve(clamped())
    assert prove(jammed, clamped()).is_proved
    changed = replace(jammed, status=Status.LIVE_LOAD_HARMLESS)
    assert not prove(changed, clamped()).is_proved


def random_clamped(seed: int) -> Scene:
    """Stones in courses on the ground, mostly under a lid and between walls, some with a dead load
    that is turned; the live load points anywhere."""
    rng = np.random.default_rng(seed)
    wide, courses = rng.integers(1, 4, 2)
    height, top = float(rng.uniform(0.3, 1.5)), float(courses)
    blocks = []
    for k in range(courses):
        shift = rng.uniform(-0.3, 0.3) if rng.random() < 0.5 else 0.0
        cuts = [0.0, *(np.arange(1, wide) + shift), float(wide)]
        blocks += [
            Block.box(f"b{i}-{k}", (a, 0, k * height), (b, 1, (k + 1) * height), density=20.0)
            for i, (a, b) in enumerate(pairwise(cuts))
        ]
    top *= height
    fixed = [Block.box("ground", (-1, -0.5, -1), (wide + 1, 1.5, 0))]
    for share, name, low, high in (
        (0.7, "lid", (-1, -0.5, top), (wide + 1, 1.5, top + 1)),
        (0.6, "left", (-1, -0.5, 0), (0, 1.5, top)),
        (0.6, "right", (wide, -0.5, 0), (wide + 1, 1.5, top)),
    ):
        if rng.random() < share:
            fixed.append(Block.box(name, low, high))
    gravity = np.array([0.0, 0.0, -1.0])
    if rng.random() < 0.35:
        gravity += 0.7 * rng.normal(size=3)
    live = rng.normal(size=3) * [1.0, rng.random() < 0.4, 1.0]
    dead = Load(gravity=tuple(gravity / np.linalg.norm(gravity)))
    load = Load(acceleration=tuple(live / np.linalg.norm(live)))
    friction = float(rng.uniform(0.2, 1.2))
    return Scene([*blocks, *fixed], [b.id for b in fixed], load, dead, friction=friction)


@pytest.mark.parametrize("seed", mostly_slow(range(200), ()))
def test_no_false_comfort_in_random_scenes(seed: int) -> None:
    """No solution without dilatancy is found where the live load is said to do no harm."""
    scene = random_clamped(seed)
    solution = solve(scene)
    if solution.status is not Status.LIVE_LOAD_HARMLESS:
        return
    if solution.lower_end is not None:
        part = 1.001 * solution.lower_end.load_factor
        given, way = np.array(scene.dead.gravity), np.array(scene.live.acceleration)
        scene = scene.with_dead(Load(gravity=tuple(given), acceleration=tuple(part * way)))
    found = solve(scene, method="zero-dilatancy")
    assert all(member.load_factor <= 0.0 for member in found.members)
