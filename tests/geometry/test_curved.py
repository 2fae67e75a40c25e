"""Curved, crowned and dished joints: answers are those of their faces, and converge."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from curved import (
    Profile,
    Surface,
    arc,
    bowl,
    cushion,
    cushioned,
    dish,
    joined,
    planar_load_factor,
    prism,
    saddle,
    smooth_arc,
    spatial_load_factor,
    stations,
    vee,
)
from cvxlimit import Block, Load, Scene, Status, solve
from cvxlimit.cli.main import run
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.solids import solid
from cvxlimit.io import export, import_geometry, read_result, read_scene, write_scene
from remeshing import remeshed_block, with_a_vertex_more

HALF = 0.5
ANGLE = np.radians(30.0)
HUMP = arc(1.0, HALF)


def hump(lower: int, upper: int, friction: float) -> tuple[Scene, np.ndarray, np.ndarray]:
    sides = [stations(HUMP, HALF, count, is_arc=True) for count in (lower, upper)]
    return joined(sides[0], sides[1], friction), sides[0], sides[1]


class TestConforming:
    """Both sides have the same facets: the linear program over them, to the bracket's digits."""

    @pytest.mark.parametrize("friction", [0.02, 0.3, 1.0])
    @pytest.mark.parametrize("count", [8, 64])
    def test_cylinders(self, count: int, friction: float) -> None:
        scene, lower, upper = hump(count, count, friction)
        assert (len(scene.contacts), scene.lumped, scene.near_misses) == (count, None, ())
        expected = planar_load_factor(scene, lower, upper)
        assert solve(scene).load_factor == pytest.approx(expected, rel=1e-6)

    def test_published_values_of_the_linear_program(self) -> None:
        for friction, expected in ((0.05, 0.047402), (0.3, 0.247485)):
            scene, *_ = hump(64, 64, friction)
            assert solve(scene).load_factor == pytest.approx(expected, abs=1e-6)

    @pytest.mark.parametrize(
        ("profile", "count"),
        [(dish(rise, HALF), 16) for rise in (0.005, 0.01, 0.02, 0.04)]
        + [(vee(rise, HALF), 2) for rise in (1e-4, 0.001, 0.004)],
    )
    @pytest.mark.parametrize("turned_over", [False, True])
    def test_dished_and_crowned_beds(self, profile: Profile, count: int, turned_over: bool) -> None:
        line = stations(profile, HALF, count)
        line = line * [1, -1] if turned_over else line
        scene = joined(line, line, 0.6)
        assert (len(scene.contacts), scene.lumped, scene.near_misses) == (count, None, ())
        expected = planar_load_factor(scene, line, line)
        assert solve(scene).load_factor == pytest.approx(expected, rel=1e-6)

    @pytest.mark.parametrize(("friction", "expected"), [(0.05, 0.8882), (0.3, 1.4523)])
    def test_a_lintel_on_two_curved_bearings(self, friction: float, expected: float) -> None:
        scene = lintel(32, friction)
        assert len(scene.contacts) == 64
        assert solve(scene).load_factor == pytest.approx(expected, abs=5e-5)

    def test_a_bed_that_is_crowned_by_what_rounding_could_explain_is_a_plane(self) -> None:
        line = stations(vee(1e-7, HALF), HALF, 2)
        assert len(joined(line, line, 0.6).contacts) == 1

    def test_facets_that_are_narrower_than_the_tolerance_are_contacts_all_the_same(self) -> None:
        scene = replace(hump(128, 128, 0.3)[0], joint_tolerance=0.01)
        assert scene.joint_tolerance is not None
        assert scene.joint_tolerance > 1.0 / 128
        assert (len(scene.contacts), scene.lumped) == (128, None)


def lintel(count: int, friction: float) -> Scene:
    """A lintel over two supports with cylindrical tops: arcs of 80 degrees, radius 0.4."""
    half = 0.4 * np.sin(np.radians(40.0))
    line = stations(arc(0.4, half), half, count, is_arc=True)
    base = np.array([(-half, -0.5), (half, -0.5)])
    aside = np.array([2.0, 0.0])
    top = np.array([(2.0 + half, 0.6), (-half, 0.6)])
    blocks = [
        prism("lintel", np.vstack([line, line + aside, top]), 0.5, 20.0),
        prism("left", np.vstack([base, line[::-1]]), 0.5, None),
        prism("right", np.vstack([base, line[::-1]]) + aside, 0.5, None),
    ]
    return Scene(blocks, ["left", "right"], Load(acceleration=(1, 0, 0)), friction=friction)


class TestConvergence:
    def test_the_error_against_the_smooth_arc_falls_with_the_number_of_facets(self) -> None:
        """Edge facets are turned by half a facet from the arc's ends: the first power."""
        counts = np.array([16, 64, 256])
        errors = []
        for count in counts.tolist():
            scene, *_ = hump(count, count, 0.3)
            height = scene.blocks[0].centroid[2] + np.cos(ANGLE)
            found = solve(scene).load_factor
            assert found is not None
            errors.append(found / smooth_arc(1.0, ANGLE, 0.3, height) - 1.0)
        rates = -np.diff(np.log(errors)) / np.diff(np.log(counts))
        assert ((rates > 0.9) & (rates < 1.1)).all()

    @pytest.mark.parametrize("friction", [0.02, 0.6])
    @pytest.mark.parametrize(("lower", "upper"), [(16, 12), (16, 17), (48, 64), (64, 32)])
    def test_sides_of_different_meshes(self, lower: int, upper: int, friction: float) -> None:
        scene, one, other = hump(lower, upper, friction)
        expected = planar_load_factor(scene, one, other)
        assert solve(scene).load_factor == pytest.approx(expected, rel=1e-5)

    @pytest.mark.parametrize(
        ("lower", "upper", "ends"),
        [(8, 6, "in each other at one end and 0 apart"), (6, 8, "0 apart at one end and 0.00285")],
    )
    def test_coarse_sides_apart_beyond_the_tolerance_are_refused_with_the_cure(
        self, lower: int, upper: int, ends: str
    ) -> None:
        scene, one, other = hump(lower, upper, 0.3)
        apart = r"block 'up'.*up-low: faces at an angle"
        with pytest.raises(GeometryError, match=apart) as refused:
            solve(scene)
        assert ends in str(refused.value)
        tolerance = float(str(refused.value).split("a joint tolerance of ")[1].split()[0])
        found = solve(replace(scene, joint_tolerance=tolerance))
        assert found.load_factor == pytest.approx(planar_load_factor(scene, one, other), rel=0.02)

    def test_what_two_meshes_leave_out_is_told(self) -> None:
        scene, *_ = hump(64, 48, 0.05)
        assert scene.lumped is not None
        assert scene.lumped.is_worth_a_word
        assert 0.0 < scene.lumped.angle < 0.5 * (ANGLE / 64 + ANGLE / 48) * 2.0
        solution = solve(scene)
        assert solution.lumped == scene.lumped
        assert "certified for the scene as detected" in solution.note


class TestInvariance:
    @pytest.fixture(scope="class")
    def scene(self) -> Scene:
        return hump(32, 24, 0.3)[0]

    @pytest.fixture(scope="class")
    def load_factor(self, scene: Scene) -> float | None:
        return solve(scene).load_factor

    @pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (4e5, 5e6, 300.0)])
    def test_turned_and_moved(
        self, shift: tuple[float, float, float], scene: Scene, load_factor: float
    ) -> None:
        moved = scene.moved(Rotation.random(rng=5).as_matrix(), shift)
        assert len(moved.contacts) == len(scene.contacts)
        assert solve(moved).load_factor == pytest.approx(load_factor, rel=1e-5)

    @pytest.mark.parametrize("size", [1e-3, 1e3])
    def test_scaled(self, size: float, scene: Scene, load_factor: float) -> None:
        scaled = replace(scene, blocks=[block.scaled(size) for block in scene.blocks])
        assert solve(scaled).load_factor == pytest.approx(load_factor, rel=1e-6)

    def test_either_block_first(self, scene: Scene, load_factor: float) -> None:
        swapped = replace(scene, blocks=scene.blocks[::-1])
        assert solve(swapped).load_factor == pytest.approx(load_factor, rel=1e-6)

    def test_triangles_instead_of_polygons(self, scene: Scene, load_factor: float) -> None:
        """Cut one way on one side, the other way on the other, as two programs would."""
        cut = []
        for way, b in enumerate(scene.blocks):
            turned = [f[way:] + f[:way] for f in b.faces]
            triangles = [(f[0], f[i], f[i + 1]) for f in turned if len(f) == 4 for i in (1, 2)]
            triangles += [f for f in turned if len(f) > 4]  # side walls, which are not convex
            cut.append(solid(b.id, b.vertices, triangles, b.density))
        assert solve(replace(scene, blocks=cut)).load_factor == pytest.approx(load_factor, rel=1e-6)

    def test_through_files(self, scene: Scene, load_factor: float, tmp_path: Path) -> None:
        write_scene(scene, tmp_path / "joint.json")
        again = read_scene(tmp_path / "joint.json")
        assert solve(again).load_factor == pytest.approx(load_factor, rel=1e-9)
        export(scene, tmp_path / "joint.obj")
        found = import_geometry(
            tmp_path / "joint.obj", length_unit="m", up="z", density=20, friction=0.3,
            supports=["low"], live=(1, 0, 0),
        )  # fmt: skip
        assert solve(found.scene).load_factor == pytest.approx(load_factor, rel=1e-6)
        assert found.scene.lumped == again.lumped


class TestDoublyCurved:
    @pytest.mark.parametrize("surface", [bowl(0.005), bowl(-0.1), saddle(0.02)])
    @pytest.mark.parametrize("friction", [0.05, 0.6])
    def test_bowls_and_saddles(self, surface: Surface, friction: float) -> None:
        scene = cushioned(surface, 6, 6, friction)
        assert (len(scene.contacts), scene.lumped) == (72, None)
        expected = spatial_load_factor(scene, surface, 6)
        assert solve(scene).load_factor == pytest.approx(expected, rel=1e-5)

    def test_a_coarse_one_whose_cells_are_warped_quadrilaterals(self) -> None:
        scene = cushioned(bowl(0.1), 4, 4, 0.05)
        expected = spatial_load_factor(scene, bowl(0.1), 4)
        assert solve(scene).load_factor == pytest.approx(expected, rel=1e-5)

    def test_meshed_apart_it_differs_by_what_the_meshes_do(self) -> None:
        """By no more than the coarser mesh alone does from the finer one, to a factor of two."""
        fine, coarse, mixed = (
            solve(cushioned(saddle(0.02), lower, upper, 0.6)).load_factor
            for lower, upper in ((8, 8), (4, 4), (8, 6))
        )
        assert fine is not None
        assert coarse is not None
        assert mixed == pytest.approx(fine, abs=2.0 * abs(coarse - fine))


class TestStillLumped:
    """What only one side shows, or each for itself, is taken as a plane, and told."""

    @staticmethod
    def rough(seed: int, level: float, height: float = 1e-3) -> Surface:
        """Heights that are another at every corner of the mesh."""
        rng = np.random.default_rng(seed)
        return lambda x, y: height * rng.uniform(-1.0, 1.0, np.shape(x))

    def hammered(self, smooth: bool) -> Scene:
        up = cushion("up", self.rough(1, 0.0), 8, 1.0, 20.0)
        low = cushion("low", self.rough(2, 0.0), 8, -1.0, None)
        if smooth:
            low = Block.box("low", (-1, -1, -1), (1, 1, 0))
        return Scene([up, low], ["low"], Load(acceleration=(1, 0, 0)), friction=0.6)

    @pytest.mark.parametrize("smooth", [False, True])
    def test_hammered_faces(self, smooth: bool) -> None:
        scene = self.hammered(smooth)
        assert len(scene.contacts) == 1
        assert solve(scene).load_factor == pytest.approx(0.6, rel=1e-2)
        lumped = scene.lumped
        assert lumped is not None
        assert lumped.contacts == 1
        assert lumped.faces >= 128
        slopes = 4.0 * 1e-3 * 8.0 / np.sqrt(2.0)  # of a cell's triangle, at most
        assert 0.2 * slopes < lumped.angle < slopes
        assert lumped.friction_angle == pytest.approx(np.arctan(0.6))
        assert lumped.is_worth_a_word
        assert scene.told[-1] == str(lumped)
        assert scene.with_friction(1e9).lumped.share < lumped.share

    @pytest.mark.parametrize("cut", [False, True])
    def test_a_warped_quadrilateral_is_one_contact_whole_or_cut(self, cut: bool) -> None:
        corners = [(0, 0, 0.0), (1, 0, 0.001), (1, 1, 0.0), (0, 1, 0.001)]
        faces = [(0, 1, 2), (0, 2, 3)] if cut else [(0, 1, 2, 3)]
        blocks = []
        for name, level, density in (("up", 1.0, 20.0), ("low", -1.0, None)):
            points = np.array([*corners, *((x, y, level) for x, y, _ in corners)])
            sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
            blocks.append(Block.polyhedron(name, points, [*faces, (4, 5, 6, 7), *sides], density))
        scene = Scene(blocks, ["low"], Load(acceleration=(1, 0, 0)), friction=0.6)
        assert len(scene.contacts) == 1
        assert scene.lumped is not None
        assert scene.lumped.angle == pytest.approx(np.hypot(0.001, 0.001), rel=0.5)

    def test_planes_have_nothing_to_tell(self) -> None:
        ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
        stone = Block.box("stone", (0, 0, 0), (1, 1, 1), density=1.0)
        scene = Scene([ground, stone], ["ground"], Load(acceleration=(1, 0, 0)))
        assert (scene.lumped, scene.told, solve(scene).lumped) == (None, (), None)

    def test_a_ridge_of_one_block_is_not_taken_for_that_of_another(self) -> None:
        """Blocks with the same faces: what is flat enough in one is not in the other."""
        top = [(0.5, 1), (-0.5, 1)]
        low, high = (
            prism("up", np.vstack([stations(vee(rise, HALF), HALF, 2), top]), 0.5, 1.0)
            for rise in (0.001, 0.1)
        )
        ground = Block.box("ground", (-5, -5, -1), (5, 5, 0))
        both = [ground, low, replace(high, id="other").moved(np.eye(3), (2.0, 0.0, 0.0))]
        with pytest.raises(GeometryError, match=r"'other'.*touches no other block"):
            len(Scene(both, ["ground"], Load(acceleration=(1, 0, 0))).contacts)


@pytest.mark.exhaustive
def test_a_thousand_random_joints_against_the_linear_program() -> None:
    """Arcs, dishes, vees and waves, turned over, turned, moved, meshed apart."""
    worst = 0.0
    for seed in range(1000):
        scene, expected = random_joint(np.random.default_rng(seed))
        found = solve(scene).load_factor
        assert found is not None, seed
        worst = max(worst, abs(found / expected - 1.0))
        assert found == pytest.approx(expected, rel=1e-4), seed
    assert worst < 1e-4


def random_joint(rng: np.random.Generator) -> tuple[Scene, float]:
    half = HALF
    rise = float(10.0 ** rng.uniform(-3.0, -0.7))
    kind = int(rng.integers(3))
    profile = (dish(rise, half), arc((half**2 + rise**2) / (2 * rise), half), vee(rise, half))[kind]
    counts = [int(2 ** rng.uniform(3.0, 6.5))] * 2
    if rng.random() < 0.5:
        counts[1] = max(8, round(counts[0] * rng.uniform(0.7, 1.4)))
    if kind == 2:
        counts = [2, 2]
    sides = [stations(profile, half, count, is_arc=kind == 1) for count in counts]
    if rng.random() < 0.5:
        sides = [side * (1.0, -1.0) for side in sides]
    friction = float(10.0 ** rng.uniform(-1.7, 0.0))
    scene = joined(sides[0], sides[1], friction)
    expected = planar_load_factor(scene, sides[0], sides[1])
    if rng.random() < 0.5:
        scene = replace(scene, blocks=scene.blocks[::-1])
    turn = Rotation.random(rng=int(rng.integers(2**31))).as_matrix()
    return scene.moved(turn, rng.uniform(-1.0, 1.0, 3) * 10.0 ** rng.uniform(0.0, 5.0)), expected


def test_the_command_line_tells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, *_ = hump(64, 48, 0.05)
    path = str(tmp_path / "scene.json")
    write_scene(scene, path)
    for command in ("solve", "explain", "show"):
        files = ["--json", str(tmp_path / "out.json")] if command == "solve" else []
        files += ["--plot", str(tmp_path / "out.png")] if command == "show" else []
        assert run([command, path, *files]) == 0
        told = capsys.readouterr()
        assert "192 faces at 96 joints are taken as planes" in told.out + told.err
        assert "certified for the scene as detected" in told.out + told.err
    lumped = json.loads((tmp_path / "out.json").read_text("utf-8"))["lumped"]
    assert (lumped["faces"], lumped["contacts"]) == (192, 96)
    assert lumped["friction_angle"] == pytest.approx(np.arctan(0.05))
    assert read_result(tmp_path / "out.json").lumped == scene.lumped


def test_a_slate_off_its_bed_falls_and_the_note_says_what_would_hold_it() -> None:
    """20 micrometres are a fiftieth of it: a tolerance of more would join stacks of slates through
    one another."""
    gap = 2e-5
    blocks = [
        Block.box("ground", (-1, -1, -1), (2, 2, 0)),
        Block.box("slate", (0, 0, gap), (1, 1, 1e-3 + gap), density=28.0),
        Block.box("top", (0, 0, 1e-3 + gap), (1, 1, 1), density=20.0),
    ]
    scene = Scene(blocks, ["ground"], Load(acceleration=(1, 0, 0)), friction=0.7)
    solution = solve(scene)
    assert solution.status is Status.DEAD_LOAD_UNSTABLE
    assert "ground-slate: a gap of 2e-05 m" in solution.note
    assert "give a joint_tolerance" in solution.note
    joined_up = replace(scene, joint_tolerance=1.01 * gap)
    assert solve(joined_up).load_factor == pytest.approx(0.7, rel=1e-6)  # it slides


def courses(count: int, rise: float) -> list[Block]:
    """Three crescent courses of one shape on a support that fits them."""
    line = stations(arc((HALF**2 + rise**2) / (2 * rise), HALF), HALF, count, is_arc=True)
    feet, up = np.array([(-HALF, -1.0), (HALF, -1.0)]), np.array([0.0, 0.4])
    outlines = [np.vstack([line + k * up, (line + (k + 1) * up)[::-1]]) for k in range(3)]
    return [
        prism("low", np.vstack([feet, line[::-1]]), 0.5, None),
        *(prism(f"c{k}", outline, 0.5, 20.0) for k, outline in enumerate(outlines)),
    ]


@pytest.mark.parametrize("which", [(1,), (2,), (1, 2, 3)])
@pytest.mark.parametrize("rise", [0.003, 0.03])
def test_blocks_of_one_shape_in_unlike_meshes(which: tuple[int, ...], rise: float) -> None:
    """A vertex more in a face that is no joint, all faces of the joints with the same numbers; and
    every face cut otherwise: the contacts and the load factor of the plain blocks."""
    blocks, rng = courses(8, rise), np.random.default_rng(5)
    live = Load(acceleration=(1, 0.2, 0))
    plain = Scene(blocks, ["low"], live, friction=0.3)
    expected = solve(plain).load_factor
    for change in (
        lambda b: with_a_vertex_more(b, len(b.faces) - 1),
        partial(remeshed_block, rng=rng),
    ):
        other = [change(b) if i in which else b for i, b in enumerate(blocks)]
        scene = Scene(other, ["low"], live, friction=0.3)
        assert len(scene.contacts) == len(plain.contacts)
        assert solve(scene).load_factor == pytest.approx(expected, rel=1e-6)
