"""Paths of structures that rock, against closed forms, linkages and a check of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from cvxlimit import (
    Block,
    Load,
    Path,
    Scene,
    Units,
    builtin_scene,
    code_check,
    prove,
    pushover,
)
from cvxlimit.errors import ModelError
from cvxlimit.extensions.paths import proof
from cvxlimit.extensions.paths.configuration import Configuration
from cvxlimit.extensions.paths.increment import Found, Increment
from cvxlimit.extensions.paths.loads import Loads
from cvxlimit.extensions.paths.points import Start
from cvxlimit.masonry import arch, single_block, stack
from cvxlimit.model.program import LimitProgram
from cvxlimit.results.movement import rotation
from cvxlimit.scene.loads import PointForce
from displaced import assert_balanced_within_friction
from linkages import FourBars, leaning, rocking
from turning import END, B, turning, wall

PUSH = Load(acceleration=(1, 0, 0))


def quick(scene: Scene, **options: Any) -> Path:
    return pushover(scene, certify="none", **options)


def columns(courses: int, b: float = 0.4, h: float = 2.0) -> Scene:
    """A wall in courses, each as long as the wall."""
    return stack(courses, (b, 0.5, h / courses), friction=2.0)


def prism(id: str, outline: list[tuple[float, float]], width: float, density: float) -> Block:
    """An outline in (x, z), counter-clockwise seen from -y, drawn along y."""
    k = len(outline)
    corners = [(x, y, z) for y in (0.0, width) for x, z in outline]
    sides = [[i, (i + 1) % k, k + (i + 1) % k, k + i] for i in range(k)]
    return Block.polyhedron(
        id, corners, [list(range(k)), list(range(2 * k - 1, k - 1, -1)), *sides], density
    )


def ground(size: float = 5.0) -> Block:
    return Block.box("ground", (-size, -size, -1), (size, size, 0))


# Closed forms


def test_a_block_rocks_until_its_centroid_is_above_its_edge() -> None:
    path = pushover(builtin_scene("single-block"), step=0.04)
    exact = [rocking(0.4, 1.0, w) for w in path.w]
    assert path.load_factor == pytest.approx(exact, abs=1e-8)
    assert path.status == "zero"
    assert path.d0 == pytest.approx(0.2, abs=1e-8)
    for x, value in zip(path, exact, strict=True):
        assert x.bracket is not None
        assert x.bracket.is_proved
        assert x.bracket.lower - 1e-8 <= value <= x.bracket.upper + 1e-8
        assert x.bracket.upper - x.bracket.lower < 1e-8
    assert not path.slides


def test_one_step_equals_ten() -> None:
    scene = builtin_scene("single-block")
    one = quick(scene, step=0.19, until=0.02)
    ten = quick(scene, step=0.019, until=0.02)
    assert one.w[1] == pytest.approx(ten.w[10])
    assert one.load_factor[1] == pytest.approx(ten.load_factor[10], abs=1e-9)


@pytest.mark.parametrize("courses", [12, pytest.param(30, marks=pytest.mark.exhaustive)])
def test_a_wall_in_courses_turns_about_its_toe(courses: int) -> None:
    path = quick(columns(courses), step=0.05)
    assert path.load_factor == pytest.approx([rocking(0.4, 2.0, w) for w in path.w], abs=1e-8)
    assert path.d0 == pytest.approx(0.2, abs=1e-8)


def test_an_obliquely_pushed_tower_turns_about_its_edge() -> None:
    phi = 0.4
    push = Load(acceleration=(np.cos(phi), np.sin(phi), 0.0))
    path = quick(single_block((0.4, 0.4, 1.0), friction=2.0, live=push), step=0.05)
    exact = [rocking(0.4, 1.0, w / np.cos(phi)) / np.cos(phi) for w in path.w]
    assert path.load_factor == pytest.approx(exact, abs=1e-8)


def two_leaning() -> Scene:
    """Smooth but for the toes, which do not slip."""
    blocks = [ground(), Block.box("one", (0, 0, 0), (0.2, 0.5, 1.0), 20.0),
              Block.box("other", (0.25, 0, 0), (0.65, 0.5, 1.3), 20.0)]  # fmt: skip
    held = {("ground", "one"): 2.0, ("ground", "other"): 2.0}
    return Scene(blocks, ["ground"], PUSH, friction=0.0, contact_friction=held)


def test_a_contact_appears_on_the_way_of_two_leaning_blocks() -> None:
    # The toe of the first is at x = 0.2, the second begins 0.05 beyond.
    path = quick(two_leaning(), step=0.02, until=0.05)
    assert path.snaps == ()
    exact = [leaning((0.2, 1.0), (0.4, 1.3), 0.05, w) for w in path.w]
    touched = [angle > 0.0 for _, _, angle in exact]
    assert touched[-1]
    assert not touched[1]
    assert path.load_factor == pytest.approx([alpha for alpha, _, _ in exact], abs=1e-8)
    turn = [x.displacements["other"][4] for x in path]
    assert turn == pytest.approx([angle for _, _, angle in exact], abs=1e-8)


def test_a_path_on_which_a_contact_closes_is_proved_again() -> None:
    """The load factor jumps where blocks meet, and nothing else does: the area leaves that out, in
    the path and where it is found again from its configurations."""
    path = quick(two_leaning(), step=0.02)
    assert path.snaps == ()
    assert prove(path).is_proved
    assert path.work is not None
    # the curve bends within a step, of which there are twelve
    assert path.work.area == pytest.approx(path.work.potential, rel=1e-3)


def oppenheim() -> tuple[Scene, FourBars, FourBars]:
    """Oppenheim's arch (1992), and its linkages before and after its left hinge moves on."""
    scene = arch(7, 0.15, mean_radius=10.0, embrace=157.5, width=2.0, friction=2.0)
    ways = np.radians(90.0 + 157.5 * (0.5 - np.arange(8) / 7.0))
    joints = np.array([[[r * np.cos(a), r * np.sin(a)] for r in (9.25, 10.75)] for a in ways])
    before = FourBars.least(joints)
    return scene, before, FourBars(joints, [(1, before.hinges[0][1]), *before.hinges[1:]])


def test_oppenheims_arch_before_and_after_its_snap() -> None:
    scene, before, after = oppenheim()
    path = quick(scene, step=0.1, until=0.1)
    (snap,) = path.snaps
    assert snap == pytest.approx(0.2336, abs=2e-4)
    for w, alpha in zip(path.w, path.load_factor, strict=True):
        assert alpha == pytest.approx((before if w <= snap else after).at(w), abs=1e-8)
    k = int(np.searchsorted(path.w, snap, side="right"))
    assert path.load_factor[k - 1] - path.load_factor[k] > 0.04
    assert path.w[k] - path.w[k - 1] < 2e-3 * 0.1
    assert path.w[-1] > path.w[k]


def test_a_notched_block_rocks_on_the_rim_of_its_notch() -> None:
    """The overhang carries nothing until it has come down on the ground."""
    outline = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.5, 0.2), (0.5, 1.0), (0.0, 1.0)]
    block = prism("notched", outline, 0.5, 20.0)
    assert not block.is_convex
    path = quick(Scene([ground(), block], ["ground"], PUSH, friction=2.0), step=0.01, until=0.05)
    x, _, z = block.centroid
    toe, way = np.hypot(0.3 - x, z), np.arctan2(0.3 - x, z)
    exact = [np.tan(np.arcsin(np.sin(way) - w / toe)) for w in path.w]
    assert path.load_factor == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("roll", [0.0, 1e-8, -1e-8, 1e-7])
@pytest.mark.parametrize("twist", [0.0, 1e-3, 0.1])
def test_an_edge_across_a_rail_bears_on_the_rail_however_little_it_is_rolled(
    roll: float, twist: float
) -> None:
    """A bar on its edge, longer than the rail is wide: moments about the edge have the answer, and
    the rail's own normal lets friction carry it."""
    left = 0.1  # of the way to where the centroid is above the edge
    rail = Block.box("rail", (-1, -0.1, -1), (1, 0.1, 0))
    bar = Block.box("bar", (0, -0.5, 0), (0.4, 0.5, 1), density=20)
    scene = Scene([rail, bar], ["rail"], PUSH, friction=1.1 * np.tan(left))
    turn = Rotation.from_euler("yzx", [np.arctan(0.4) - left, twist, roll])
    edge, centroid = np.array([0.4, 0, abs(np.tan(roll)) * 0.1]), np.array([0.2, 0, 0.5])
    move = edge + turn.apply(centroid - [0.4, 0, 0]) - centroid
    begin = Start.first(scene, 0.1)
    pose = begin.pose.moved(scene.free, np.concatenate([move, turn.as_rotvec()])[None])
    points = begin.points(pose)
    points = points.take(points.gap <= 1e-6)
    found = Increment(scene, points, pose, Loads(scene)).largest()
    assert isinstance(found, Found)
    assert found.load_factor == pytest.approx(np.tan(left) / np.cos(twist), rel=1e-5)


def test_a_facet_that_is_not_convex_carries_on_its_prongs() -> None:
    """In plan a C that opens in the direction of the push."""
    plan = [(0, 0), (0.6, 0), (0.6, 0.2), (0.2, 0.2), (0.2, 0.4), (0.6, 0.4), (0.6, 0.6), (0, 0.6)]
    flat = prism("c", plan, 1.0, 20.0)  # drawn along y: laid down onto its outline
    turn = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    block = flat.moved(turn, (0.0, 0.6, 0.0))
    block = block.moved(np.eye(3), (0.0, 0.0, -block.vertices[:, 2].min()))
    path = quick(Scene([ground(), block], ["ground"], PUSH, friction=2.0), step=0.1)
    x, _, z = block.centroid
    toe = block.vertices[:, 0].max() - x
    exact = [np.tan(np.arcsin(toe / np.hypot(toe, z) - w / np.hypot(toe, z))) for w in path.w]
    assert path.load_factor == pytest.approx(exact, abs=1e-8)


def test_a_moment_turns_a_block_over_its_edge() -> None:
    """Without a force, w is the rotation times the contact size; weight times arm is the moment."""
    scene = single_block((0.4, 0.4, 1.0), live=Load(forces={"b1": (0, 0, 0, 0, 1, 0)}))
    path = quick(scene, step=0.03)
    angle = path.w / scene.contacts.typical_size
    exact = scene.total_weight * np.hypot(0.2, 0.5) * np.sin(np.arctan(0.4) - angle)
    assert path.load_factor == pytest.approx(exact, abs=1e-7)
    assert path.d0 / scene.contacts.typical_size == pytest.approx(np.arctan(0.4), abs=1e-7)


# Invariances


@pytest.mark.parametrize("how", ["rotated", "units", "permuted"])
@pytest.mark.parametrize(
    ("scene", "until"),
    [(arch(5, 0.2, friction=2.0), 0.18), (two_leaning(), 0.05), (columns(2), 0.02)],
    ids=["arch", "leaning", "wall"],
)
@pytest.mark.exhaustive_cases(
    "arch-rotated",
    "arch-permuted",
    "leaning-rotated",
    "leaning-units",
    "wall-units",
    "wall-permuted",
)
def test_paths_do_not_depend_on_how_a_scene_is_written(
    scene: Scene, until: float, how: str
) -> None:
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    other, length = {
        "rotated": (scene.moved(turn, (3.0, -2.0, 1.0)), 1.0),
        "units": (scene.in_units(Units("mm", "N"), 1e3, 1e3), 1e3),
        "permuted": (replace(scene, blocks=scene.blocks[::-1]), 1.0),
    }[how]
    step = 0.1 * scene.contacts.typical_size
    one = quick(scene, step=step, until=until)
    two = quick(other, step=length * step, until=until)
    assert two.load_factor == pytest.approx(one.load_factor, abs=1e-8)
    assert two.w / length == pytest.approx(one.w, abs=1e-8)


# The whole path


def test_the_area_under_a_rocking_path_is_the_potential() -> None:
    work = quick(columns(3), step=0.02).work
    assert work is not None
    assert work.potential > 0.0
    assert abs(work.difference) < 1e-6


def test_a_control_point_only_relabels_the_axis() -> None:
    scene, top = columns(3), ("b3", (1.0, 0.0, 0.0))
    one, other = quick(scene, step=0.1), quick(scene, step=0.1, control=top)
    assert other.load_factor == pytest.approx(one.load_factor)
    assert other.displacement[1] == pytest.approx(other[1].displacements["b3"][0])
    assert other.displacement[1] > other.w[1] == one.displacement[1]


def test_a_control_across_the_motion_measures_nothing() -> None:
    path = quick(columns(3), step=0.1, control=("b3", (0.0, 1.0, 0.0)))
    assert path.control_stays
    assert np.isnan(path.d0)
    assert "'b3', does not move along (0.0, 1.0, 0.0), though w comes to" in path.headline
    assert code_check(path).refused == path.headline
    assert not replace(path, control=None).control_stays


def test_a_point_load_moves_with_its_block() -> None:
    """Pushed at the top, the block needs half; the load's point has moved by w."""
    push = Load(points=[PointForce("b1", (0.2, 0.2, 1.0), (8.0, 0.0, 0.0))])
    scene = single_block((0.4, 0.4, 1.0), density=50.0, friction=2.0, live=push)
    path = quick(scene, step=0.05, until=0.1)
    moved = path[1].scene()
    (point,) = moved.live.points
    assert point.at[0] - 0.2 == pytest.approx(0.05, abs=1e-9)
    turn = path[1].displacements["b1"][4]
    toe, top = np.hypot(0.2, 0.5), np.array([-0.2, 1.0])
    height = top[1] * np.cos(turn) - top[0] * np.sin(turn)
    arm = toe * np.sin(np.arctan(0.4) - turn)
    assert path.load_factor[1] == pytest.approx(arm / height, abs=1e-8)


def pushing_another() -> Scene:
    """A tall block that turns pushes a low one along the ground, which slides."""
    low = Block.box("low", (0, 0, 0), (0.3, 0.5, 0.3), 20.0)
    tall = Block.box("tall", (-0.3, 0, 0), (0, 0.5, 1), 20.0)
    return Scene([ground(), low, tall], ["ground"], PUSH, friction=0.3)


def test_a_path_that_slides_has_the_run_with_half_of_every_step_beside_it() -> None:
    path = quick(pushing_another())
    fine = path.halved
    assert fine is not None
    assert path.slides
    middle = 0.5 * (path.w[1:] + path.w[:-1])
    kept = min(len(fine), 2 * len(middle))
    assert fine.w[:kept] == pytest.approx(np.sort([*path.w[:-1], *middle])[:kept])
    at_the_same = np.interp(path.w[:-1], fine.w, fine.load_factor)
    assert (at_the_same <= path.load_factor[:-1] + 1e-9).all()  # dilatancy of a step is unsafe
    assert path.d0_interval == (fine.d0, path.d0)
    assert f"{fine.d0:.4g} m (zero) instead of {path.d0:.4g} m" in path.notes[1]
    assert "by the step" in repr(path)
    assert str(code_check(path)).count("by the step") >= 3  # d0 and both limit states
    given = quick(pushing_another(), step=path.step, until=0.2)
    assert given.slides
    assert given.halved is None
    assert "on the unsafe side" in given.notes[0]


def test_d0_is_where_the_curve_crosses_zero_and_not_the_end_of_a_path_that_went_on() -> None:
    path = turning(wall(1), (0.0, END - 0.01, END + 0.03))
    assert path.load_factor[-1] < 0.0
    assert path.d0 == pytest.approx(B / 2, abs=1e-4)
    assert path.d0_interval == (path.d0, path.d0)


def test_a_run_with_half_the_step_that_was_broken_off_is_kept_and_goes_on() -> None:
    lines: list[str] = []

    def stop(line: str) -> None:
        lines.append(line)
        if sum("half the step" in each for each in lines) == 2:
            raise KeyboardInterrupt

    path = quick(pushing_another(), until=0.27, progress=stop)
    assert path.status == "zero"
    assert path.halved is not None
    assert path.halved.status == "interrupted"
    assert len(path.halved) == 3
    again = pushover(path, until=0.27, certify="none")
    assert again.halved is not None
    assert again.load_factor.tolist() == path.load_factor.tolist()
    assert again.halved.status == "zero"
    assert again.halved.load_factor[:3].tolist() == path.halved.load_factor.tolist()
    assert again.halved.load_factor[-1] == pytest.approx(0.27, abs=1e-2)


@pytest.mark.exhaustive
def test_what_falls_is_named() -> None:
    path = quick(builtin_scene("flying-buttress"))
    assert path.status == "falls"
    assert "blocks that move most: " in path.reason
    assert np.isnan(path.d0)


def test_interrupted_paths_return_what_was_found() -> None:
    lines: list[str] = []

    def stop(line: str) -> None:
        lines.append(line)
        if len(lines) == 3:
            raise KeyboardInterrupt

    path = quick(columns(2), step=0.02, progress=stop)
    assert path.status == "interrupted"
    assert len(path) == 3


def test_load_factors_at_points_and_of_the_usual_surface_are_both_named() -> None:
    path = quick(arch(5, 0.2, friction=0.4), step=0.01, until=0.9)
    assert len(path) == 1
    assert path.initial.load_factor is not None
    assert path.load_factor[0] == path[0].load_factor
    assert path.initial.status == "certified"


# A check of its own


def tower(seed: int) -> Scene:
    """Boxes of any sizes on one another, each turned about z, pushed in any direction."""
    random = np.random.default_rng(seed)
    blocks, base = [ground(9.0)], 0.0
    for i in range(int(random.integers(2, 5))):
        size = random.uniform([0.5, 0.5, 0.3], [0.8, 0.8, 0.9])
        half = size / 2
        low, high = (-half[0], -half[1], 0.0), (half[0], half[1], size[2])
        box = Block.box(f"b{i}", low, high, density=float(random.uniform(15.0, 25.0)))
        turn = Rotation.from_euler("z", random.uniform(0.0, 6.0)).as_matrix()
        blocks.append(box.moved(turn, (*random.uniform(-0.04, 0.04, 2), base)))
        base += size[2]
    way = random.uniform(0.0, 6.3)
    push = Load(acceleration=(np.cos(way), np.sin(way), 0.0))
    return Scene(blocks, ["ground"], push, friction=3.0)


def overlap(one: Block, other: Block) -> float:
    """Radius of the largest ball in both of two convex blocks, by a linear program."""
    rows, right = [], []
    for block in (one, other):
        for face in block.faces:
            corners = block.vertices[list(face)]
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
            normal = normal / np.linalg.norm(normal)
            rows.append([*normal, 1.0])
            right.append(normal @ corners[0])
    bounds = [(None, None)] * 3 + [(-100.0, None)]
    return float(linprog([0, 0, 0, -1.0], rows, right, bounds=bounds).x[3])


def check(shown: Configuration, is_last: bool) -> None:
    """Balance, complementarity, Coulomb's law; of the last one that no two blocks are in each
    other."""
    assert_balanced_within_friction(shown)
    scene, points, size = shown.scene(), shown.points, shown.start.contacts.typical_size
    assert shown.residual <= 1e-7
    most = (1e-8 + shown.residual) * shown.start.total_weight * size
    assert np.abs(shown.forces[:, 0] * points.distance).max() < most
    for i, one in enumerate(scene.blocks if is_last else ()):
        for other in scene.blocks[i + 1 :]:
            assert overlap(one, other) < 1e-8 * size


@pytest.mark.parametrize(
    "seeds", [range(1), pytest.param(range(1, 200), marks=pytest.mark.exhaustive)]
)
def test_random_towers_in_space_keep_the_laws(seeds: range) -> None:
    """Every configuration, to the digits that it says it has."""
    for seed in seeds:
        path = quick(tower(seed), step=0.02, until=0.02)
        assert path.status == "zero", (seed, path.reason)
        assert not path.slides
        for shown in path:
            check(shown, is_last=shown is path[-1])
        assert path.work is not None
        assert abs(path.work.difference) < 1e-3


def test_a_tower_that_turns_as_one_snaps_into_turning_in_two() -> None:
    """Where its lowest block turns back, iterates have a fifth of the contact size to go, by way of
    other mechanisms."""
    path = quick(tower(369), step=0.013, until=0.02)
    assert path.status == "zero"
    assert len(path.snaps) == 1
    for shown in path:
        check(shown, is_last=shown is path[-1])
    before, after = (np.linalg.norm(path[i].displacements["b0"][3:]) for i in (-2, -1))
    assert before > 0.1
    assert after < 1e-8


# Proof


@pytest.mark.parametrize("share", [1e-9, 1e-3])
def test_wrong_forces_and_mechanisms_give_no_wrong_bracket(
    share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = quick(builtin_scene("single-block"), step=0.05, until=0.25)
    shown, random = path[2], np.random.default_rng(1)
    exact, run = rocking(0.4, 1.0, shown.w), proof._run

    def noisy(given: Increment, goal: Any = None) -> Any:
        state = run(given, goal)
        assert state is not None
        off = {
            name: value * (1.0 + share * random.standard_normal(value.shape))
            for name in ("internal", "mechanism")
            if (value := getattr(state, name)) is not None
        }
        factor = (state.load_factor or 0.0) * (1.0 + share * float(random.standard_normal()))
        return replace(state, **off, load_factor=factor)

    monkeypatch.setattr(proof, "_run", noisy)
    begin = Start.first(shown.start, 0.1)
    pose = begin.pose.moved(
        shown.start.free, np.array([shown.displacements[b.id] for b in shown.start.blocks[1:]])
    )
    for _ in range(6):
        bracket, _ = proof.bracket_of(shown.start, shown.points, pose, Loads(shown.start))
        assert bracket.lower <= exact + 1e-9
        assert bracket.upper >= exact - 1e-9


# The problem


def test_both_sinks_state_the_same_increment() -> None:
    scene = single_block((0.4, 0.4, 1.0), friction=0.7)
    begin = Start.first(scene, 0.1)
    points, loads = begin.points(begin.pose), Loads(scene)
    increment = Increment(scene, points, begin.pose, loads)
    k = len(points)
    push, gap = cp.Parameter(name="push"), cp.Parameter(k, name="gap")
    slip = cp.Parameter(k, name="slip 1"), cp.Parameter(k, name="slip 2")
    problem = increment.problem(increment.goal(push, gap, slip))
    push.value, gap.value = 1.0, np.full(k, 0.01)
    slip[0].value, slip[1].value = np.full(k, 0.02), np.zeros(k)
    numbers = increment.problem(increment.goal(1.0, gap.value, (slip[0].value, slip[1].value)))
    found = [p.run(LimitProgram.ladder(p)[0]).load_factor for p in (problem, numbers)]
    in_cvxpy = problem.problem.solve(solver="CLARABEL")
    at = problem.run(LimitProgram.ladder(problem)[0])
    assert found[0] == pytest.approx(found[1], abs=1e-9)
    assert problem.factor.value == pytest.approx(at.load_factor, abs=1e-6)
    assert np.isfinite(in_cvxpy)


def test_rotations_are_exact() -> None:
    vectors = np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, 2e-9], [0.3, -1.2, 0.7]])
    assert rotation(vectors) == pytest.approx(Rotation.from_rotvec(vectors).as_matrix(), abs=1e-15)


def test_points_without_friction_have_no_friction_force() -> None:
    scene = single_block((0.4, 0.4, 1.0), friction=0.0, live=Load(acceleration=(0, 0, 1)))
    begin = Start.first(scene, 0.1)
    points = begin.points(begin.pose)
    problem = Increment(scene, points, begin.pose, Loads(scene)).problem()
    state = problem.run(problem.ladder()[0])
    assert state.load_factor == pytest.approx(1.0, abs=1e-6)


# Refusals


def refused() -> dict[str, tuple[Callable[[], Scene], str]]:
    block = single_block((0.4, 0.4, 1.0))
    overhang = stack(3, (0.5, 0.5, 0.25), shift=(0.3, 0.0))
    return {
        "does not stand": (lambda: overhang, "does not stand"),
        "harmless": (lambda: block.with_live(Load(acceleration=(0, 0, -1))), "does no harm"),
        "tension": (lambda: block.with_strength(tensile=1.0), "tensile strength"),
        "crushing": (lambda: block.with_strength(compressive=9.0), "compressive strength"),
    }


@pytest.mark.parametrize("what", refused())
def test_scenes_without_a_path_are_refused_by_the_property(what: str) -> None:
    scene, words = refused()[what]
    with pytest.raises(ModelError, match=words):
        pushover(scene())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"flow": "plastic"}, "flow must be one of"),
        ({"certify": "some"}, "certify must be one of"),
        ({"step": 0.0}, "step must be above 0"),
        ({"control": ("b7", (1, 0, 0))}, "no free block"),
        ({"control": "b1"}, "control"),
        ({"control": ("b1", (0, 0, 0))}, "must not be zero"),
        ({"until": "zero"}, "until must be a load factor"),
        ({"pressures": "following"}, "pressures must be one of turning, keeping"),
    ],
)
def test_unknown_choices_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pushover(builtin_scene("single-block"), **options)
