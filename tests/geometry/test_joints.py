"""The joint tolerance: the same wall in many forms, what is nearly a joint, what is refused."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cvxlimit import solve
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.detection import detect
from cvxlimit.geometry.mesh import triangulated
from cvxlimit.geometry.nearmisses import near_miss_sentence
from cvxlimit.geometry.polyhedra import JOINT_TOLERANCE
from cvxlimit.geometry.solids import solid
from cvxlimit.io import scene_from_dict, scene_to_dict
from cvxlimit.masonry import builtin_scene
from cvxlimit.scene import Load, Scene, Units
from placements import detect_contacts

WALL = builtin_scene("tuff-wall")
ODD = Rotation.from_euler("xyz", [0.3, 1.1, 2.2]).as_matrix()
GROUND = Block.box("ground", (-2, -2, -1), (2, 2, 0))


def triangles(block: Block) -> list[list[int]]:
    return triangulated(block.vertices, block.faces)[0].tolist()


def as_polyhedron(block: Block) -> Block:
    return Block.polyhedron(block.id, block.vertices, block.faces, block.density)


def as_triangles(block: Block) -> Block:
    return Block.polyhedron(block.id, block.vertices, triangles(block), block.density)


def as_other_triangles(block: Block) -> Block:
    """Cut along the other diagonals, and fanned about a point in the middle of two faces."""
    points = np.vstack([block.vertices, block.vertices[[0, 1, 2, 3]].mean(axis=0)])
    cut = [(f[i], f[(i + 1) % 4], 8) for f in block.faces[:1] for i in range(4)]
    cut += [t for f in block.faces[1:] for t in ((f[1], f[2], f[3]), (f[3], f[0], f[1]))]
    return Block.polyhedron(block.id, points, cut, block.density)


def as_stl(block: Block) -> Block:
    """Every triangle with corners of its own."""
    corners = [i for t in triangles(block) for i in t]
    faces = [(i, i + 1, i + 2) for i in range(0, len(corners), 3)]
    return solid(block.id, block.vertices[corners], faces, block.density)


def rounded(block: Block) -> Block:
    return solid(block.id, block.vertices.round(4), block.faces, block.density)


def rounded_triangles(block: Block) -> Block:
    return solid(block.id, block.vertices.round(4), triangles(block), block.density)


def noisy(block: Block) -> Block:
    """1e-5 of the block's size on every vertex."""
    rng = np.random.default_rng(sum(map(ord, block.id)))
    noise = 1e-5 * block.size * rng.uniform(-1.0, 1.0, block.vertices.shape)
    return solid(block.id, block.vertices + noise, block.faces, block.density)


def noisy_triangles(block: Block) -> Block:
    rng = np.random.default_rng(sum(map(ord, block.id)))
    noise = 1e-5 * block.size * rng.uniform(-1.0, 1.0, block.vertices.shape)
    return solid(block.id, block.vertices + noise, triangles(block), block.density)


EXACT = [as_polyhedron, as_triangles, as_other_triangles, as_stl, rounded]
NOISY = [noisy, noisy_triangles]


@pytest.fixture(scope="module")
def load_factor() -> float:
    return solve(WALL).load_factor


class TestTheSameWall:
    """Boxes, polygons, triangles, STL soup, rounded, turned, noisy: 146 contacts, one factor."""

    def of(self, form: Callable[[Block], Block], scene: Scene = WALL) -> Scene:
        return replace(scene, blocks=[form(block) for block in scene.blocks])

    @pytest.mark.parametrize("turned", [False, True])
    @pytest.mark.parametrize("form", EXACT)
    def test_exact(self, form: Callable[[Block], Block], turned: bool, load_factor: float) -> None:
        whole = WALL.moved(ODD, (3.0, -7.0, 2.0)) if turned else WALL
        scene = self.of(form, whole)
        assert scene.contacts.names == WALL.contacts.names
        assert scene.near_misses == ()
        if turned and form is rounded:  # its bricks are 10 cm: 4 decimals are 5e-4 of their size
            assert solve(scene).load_factor == pytest.approx(load_factor, abs=1e-3)
            return
        np.testing.assert_allclose(scene.contacts.area, WALL.contacts.area, rtol=1e-9)
        np.testing.assert_allclose(
            np.sort(scene.contacts.sides), np.sort(WALL.contacts.sides), rtol=1e-9
        )
        assert solve(scene).load_factor == pytest.approx(load_factor, abs=1e-6)

    @pytest.mark.parametrize("turned", [False, True])
    @pytest.mark.parametrize("form", NOISY)
    @pytest.mark.exhaustive_cases("noisy-False", "noisy_triangles-True")
    def test_noisy(self, form: Callable[[Block], Block], turned: bool, load_factor: float) -> None:
        scene = self.of(form, WALL.moved(ODD) if turned else WALL)
        assert scene.contacts.names == WALL.contacts.names
        np.testing.assert_allclose(scene.contacts.area, WALL.contacts.area, rtol=2e-3)
        assert solve(scene).load_factor == pytest.approx(load_factor, abs=1e-3)


class TestDefault:
    """One hundredth of the mean thickness takes coordinates of 3 decimals of metre-size blocks."""

    @pytest.mark.parametrize("seed", range(6))
    @pytest.mark.parametrize("decimals", [3, 4])
    def test_rounded_coordinates_of_metre_size_blocks(self, decimals: int, seed: int) -> None:
        """Bricks of 1.0 x 0.5 x 0.4 m in running bond, turned anyhow: every joint is found."""
        turn = Rotation.random(rng=seed).as_matrix()
        bricks = [
            Block.box(f"b{row}.{i}", (i + 0.5 * (row % 2), 0, 0.4 * row),
                      (i + 1 + 0.5 * (row % 2), 0.5, 0.4 * (row + 1)), density=20.0)
            for row in range(4) for i in range(4)
        ]  # fmt: skip
        whole = detect_contacts(bricks)
        found = detect([
            Block.polyhedron(b.id, b.moved(turn).vertices.round(decimals), b.faces, b.density)
            for b in bricks
        ])  # fmt: skip
        assert found.contacts.names == whole.names
        np.testing.assert_allclose(found.contacts.area, whole.area, rtol=2e-2)

    def test_it_is_a_share_of_the_mean_thickness(self) -> None:
        plate = Block.box("plate", (0, 0, 0), (100, 100, 1))
        assert plate.thickness == pytest.approx(1.0, rel=0.03)
        assert plate.joint_tolerance == JOINT_TOLERANCE * plate.thickness

    def test_thin_blocks_are_not_joined_through_one_another(self) -> None:
        """Eighty tiles of 1 mm, 1 m wide: each touches the next, and no other is near."""
        tiles = [Block.box(f"t{i}", (0, 0, i / 1000), (1, 1, (i + 1) / 1000)) for i in range(80)]
        found = detect(tiles)
        assert len(found.contacts) == 79
        assert found.near_misses == ()
        assert detect(tiles, joint_tolerance=2e-4).near_misses == ()


def pair(gap: float = 0.0, tilt: float = 0.0, shift: float = 0.0, **more: object) -> Scene:
    """A unit cube on the ground and a second one on top of it, or nearly."""
    upper = Block.box("upper", (shift, 0, 0), (1 + shift, 1, 1), density=1.0)
    turn = Rotation.from_euler("y", -tilt).as_matrix()
    blocks = [GROUND, Block.box("lower", (0, 0, 0), (1, 1, 1), density=1.0)]
    post = Block.box("post", (1, 0, 0), (1.5, 1, 1), density=1.0)
    side = Block.box("side", (0, 1, 0), (2, 2, 3), density=1.0)
    blocks += [post, side, upper.moved(turn, (0, 0, 1 + gap))]
    return Scene(blocks, ["ground"], Load(acceleration=(1, 0, 0)), **more)


class TestNearMisses:
    ALLOWED = JOINT_TOLERANCE / 3.0  # of a unit cube

    def between(self, scene: Scene) -> list[tuple[str, float, float]]:
        return [(miss.kind, miss.size, miss.allowed) for miss in scene.near_misses
                if (miss.a, miss.b) == ("lower", "upper")]  # fmt: skip

    @pytest.mark.parametrize("share", [0.1, 0.9])
    def test_a_gap_within_the_tolerance_is_a_joint(self, share: float) -> None:
        scene = pair(share * self.ALLOWED)
        assert "lower-upper" in scene.contacts.names
        assert not self.between(scene)
        j = scene.contacts.names.index("lower-upper")
        assert scene.contacts.origin[j, 2] == pytest.approx(1.0 + 0.5 * share * self.ALLOWED)

    @pytest.mark.parametrize("share", [1.1, 10.0, 29.0])
    def test_a_gap_beyond_it_is_reported(self, share: float) -> None:
        scene = pair(share * self.ALLOWED)
        assert "lower-upper" not in scene.contacts.names
        [(kind, size, allowed)] = self.between(scene)
        assert (kind, size, allowed) == (
            "gap", pytest.approx(share * self.ALLOWED), pytest.approx(self.ALLOWED)
        )  # fmt: skip
        miss = next(m for m in scene.near_misses if m.a == "lower")
        np.testing.assert_allclose(miss.place, [0.5, 0.5, 1.0 + 0.5 * share * self.ALLOWED])
        np.testing.assert_allclose(np.ptp(miss.outline, axis=0), [1, 1, 0], atol=1e-12)

    def test_a_wide_gap_is_none(self) -> None:
        assert not self.between(pair(31.0 * self.ALLOWED))

    @pytest.mark.parametrize("share", [1e-3, 0.9])
    def test_an_angle_that_opens_within_the_tolerance_is_a_joint(self, share: float) -> None:
        assert "lower-upper" in pair(tilt=np.arcsin(share * self.ALLOWED)).contacts.names

    @pytest.mark.parametrize("share", [1.5, 20.0])
    def test_an_angle_beyond_it_is_reported(self, share: float) -> None:
        scene = pair(tilt=np.arcsin(share * self.ALLOWED))
        assert "lower-upper" not in scene.contacts.names
        [(kind, size, _)] = self.between(scene)
        assert (kind, size) == ("angle", pytest.approx(share * self.ALLOWED, rel=0.01))

    def test_a_sliver_is_reported_and_two_edges_that_meet_are_not(self) -> None:
        """The upper cube rests on the post, and by a sliver on the lower one."""
        assert not self.between(pair(shift=1.0))
        scene = pair(shift=1.0 - 0.5 * self.ALLOWED)
        assert "lower-upper" not in scene.contacts.names
        [(kind, size, _)] = self.between(scene)
        assert (kind, size) == ("sliver", pytest.approx(0.5 * self.ALLOWED))
        assert "lower-upper" in pair(shift=1.0 - 2.0 * self.ALLOWED).contacts.names

    @pytest.mark.parametrize("gap", [1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 0.09])
    def test_a_brick_off_its_neighbour_is_joined_or_reported(self, gap: float) -> None:
        """Whatever the gap, up to 30 tolerances of a brick: nothing is lost without a word."""
        bricks = [Block.box("a", (0, 0, 0), (1, 1, 1)), Block.box("b", (1 + gap, 0, 0), (2, 1, 1))]
        for tolerance in (None, 1e-5, 4e-3):
            found = detect([GROUND, *bricks], ["ground"], joint_tolerance=tolerance)
            joined = "a-b" in found.contacts.names
            reported = [m for m in found.near_misses if (m.a, m.b) == ("a", "b")]
            allowed = min(b.joint_tolerance for b in bricks) if tolerance is None else tolerance
            assert joined == (gap <= allowed)
            assert len(reported) == (allowed < gap <= 30 * allowed)

    def test_between_two_fixed_blocks_there_is_none(self) -> None:
        fixed = [Block.box("a", (0, 0, -1), (0.99, 1, 0)), Block.box("b", (1, 0, -1), (2, 1, 0))]
        top = Block.box("top", (0, 0, 0), (2, 1, 1), density=1.0)
        found = detect([*fixed, top], ["a", "b"])
        assert (found.contacts.names, found.near_misses) == (("a-top", "b-top"), ())

    def test_a_loose_block_hears_what_it_nearly_touches(self) -> None:
        high = Block.box("high", (0, 0, 0.01), (1, 1, 1), density=1.0)
        with pytest.raises(
            GeometryError, match=r"'high'.*touches no other block.*ground-high: a gap of 0.01"
        ) as refusal:
            detect([GROUND, high], ["ground"])
        assert refusal.value.blocks == ("high",)

    def test_the_sentence_counts_them_and_names_the_nearest(self) -> None:
        scene = pair(10.0 * self.ALLOWED)
        assert len(scene.near_misses) == 1
        assert scene.near_miss_note.startswith("1 joint is nearly there but is none; lower-upper:")
        assert "0.0333 m" in scene.near_miss_note
        further = pair(20.0 * self.ALLOWED)
        both = near_miss_sentence([*further.near_misses, *scene.near_misses], "m")
        assert both.startswith("2 joints are nearly there")
        assert "0.0333 m" in both
        assert pair().near_miss_note == ""


class TestSceneKnowsIt:
    def test_it_decides(self) -> None:
        assert "lower-upper" in pair(0.01, joint_tolerance=0.02).contacts.names
        assert "lower-upper" not in pair(0.01, joint_tolerance=0.005).contacts.names

    @pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, "1 mm", True])
    def test_it_is_a_positive_length(self, value: object) -> None:
        with pytest.raises(InputError, match="joint_tolerance of the scene must be"):
            pair(joint_tolerance=value)

    def test_copies_keep_it(self) -> None:
        scene = pair(0.01, joint_tolerance=0.02)
        for copy in (scene.with_name("n"), scene.with_live(scene.dead), scene.with_friction(0.3),
                     scene.moved(ODD), pickle.loads(pickle.dumps(scene))):  # fmt: skip
            assert copy.joint_tolerance == 0.02
            assert copy.contacts.names == scene.contacts.names
        other = scene.in_units(Units("mm", "N"), 1e3, 1e3)
        assert other.joint_tolerance == pytest.approx(20.0)
        assert other.contacts.names == scene.contacts.names

    def test_scene_files_keep_it(self) -> None:
        points = GROUND.vertices.copy()
        points[6, 2] = 0.03  # warped by 0.0075, more than its default of 0.0067
        warped = Block.polyhedron("ground", points, GROUND.faces, joint_tolerance=0.02)
        scene = replace(pair(0.01, joint_tolerance=0.02), blocks=(warped, *pair().blocks[1:]))
        document = scene_to_dict(scene)
        assert document["joint_tolerance"] == 0.02
        again = scene_from_dict(document)
        assert again.joint_tolerance == 0.02
        assert again.contacts.names == scene.contacts.names
        assert "joint_tolerance" not in scene_to_dict(pair())
        for wrong in (0, -1, "x", None):
            with pytest.raises(InputError, match="joint_tolerance"):
                scene_from_dict({**document, "joint_tolerance": wrong})

    def test_copies_keep_near_misses(self) -> None:
        scene = pair(0.01)
        assert len(scene.near_misses) == 1
        for copy in (scene.with_name("n"), pickle.loads(pickle.dumps(scene)), scene.moved(ODD)):
            assert [(m.a, m.b) for m in copy.near_misses] == [("lower", "upper")]
        millimetres = scene.in_units(Units("mm", "N"), 1e3, 1e3)
        assert millimetres.near_misses[0].size == pytest.approx(10.0)


class TestInterpenetration:
    def test_convex_pairs_say_how_deep_and_where(self) -> None:
        sunk = Block.box("sunk", (0.5, 0.25, -0.125), (1.5, 0.75, 1))
        with pytest.raises(GeometryError, match=r"interpenetrate by about 0.125 near \(1, 0.5, -"):
            detect([GROUND, sunk], ["ground"])

    @pytest.mark.parametrize("deep", [0.1, 0.02])
    @pytest.mark.parametrize("seed", range(3))
    def test_a_brick_in_the_notch_of_a_quoin(self, deep: float, seed: int) -> None:
        """It fits, with two contacts; moved into one arm it is refused with depth and place."""
        outline = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
        points = np.array([(x, y, z) for z in (0, 1) for x, y in outline], float)
        sides = [(i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6)]
        quoin = Block.polyhedron("quoin", points, [tuple(range(6)), tuple(range(6, 12)), *sides])
        brick = Block.box("brick", (1, 1, 0), (2, 2, 1))
        turn = Rotation.random(rng=seed).as_matrix()
        found = detect([quoin.moved(turn), brick.moved(turn)])
        assert found.contacts.names == ("quoin-brick", "quoin-brick#2")
        assert found.contacts.area == pytest.approx([1.0, 1.0])
        moved = brick.moved(np.eye(3), (-deep, 0, 0)).moved(turn)
        message = rf"'quoin' and 'brick' interpenetrate by about {deep:.2g}"
        with pytest.raises(GeometryError, match=message) as refusal:
            detect([quoin.moved(turn), moved])
        where = [float(x) for x in re.findall(r"near \((.*)\)", str(refusal.value))[0].split(",")]
        np.testing.assert_allclose(where @ turn, [1 - deep / 2, 1.5, 0.5], atol=1e-4)
        corners = refusal.value.points @ turn
        np.testing.assert_allclose(corners.min(axis=0), [1 - deep, 1, 0], atol=1e-6)

    def test_a_beam_through_a_plate(self) -> None:
        """Corners of the common part lie on both surfaces; the part's thickness tells."""
        outline = np.array([(0, 0), (2, 0), (2, 2), (1, 1.5), (0, 2)], float)
        points = np.array([(x, y, z) for z in (0, 0.2) for x, y in outline])
        sides = [(i, (i + 1) % 5, (i + 1) % 5 + 5, i + 5) for i in range(5)]
        plate = Block.polyhedron("plate", points, [tuple(range(5)), tuple(range(5, 10)), *sides])
        beam = Block.box("beam", (0.4, 0.4, -1), (0.6, 0.6, 1))
        with pytest.raises(
            GeometryError, match=r"'plate' and 'beam' interpenetrate by about 0.2 near"
        ):
            detect([plate, beam])

    def test_a_ring_around_a_post_touches_it_on_four_sides(self) -> None:
        squares = [np.array([(a, a), (b, a), (b, b), (a, b)]) for a, b in ((0, 3), (1, 2))]
        points = np.array([(x, y, z) for z in (0, 1) for s in squares for x, y in s], float)
        faces = []
        for i in range(4):
            k = (i + 1) % 4
            faces += [(i, i + 4, k + 4, k), (i + 8, k + 8, k + 12, i + 12)]
            faces += [(i, k, k + 8, i + 8), (i + 4, i + 12, k + 12, k + 4)]
        nut = Block.polyhedron("nut", points, faces)
        post = Block.box("post", (1, 1, -1), (2, 2, 2))
        assert detect_contacts([nut, post]).area == pytest.approx([1.0] * 4)
        with pytest.raises(GeometryError, match=r"'nut' and 'post' interpenetrate by about 0\.1 "):
            detect([nut, post.moved(np.eye(3), (0.1, 0, 0))])
        free = detect([nut, Block.box("thin", (1.2, 1.2, -1), (1.8, 1.8, 2)),
                       Block.box("base", (-1, -1, -2), (4, 4, -1)),
                       Block.box("prop", (0, 0, -1), (0.5, 0.5, 0))])  # fmt: skip
        assert set(free.contacts.names) == {"nut-prop", "thin-base", "base-prop"}


class TestLeaning:
    """Faces that meet along an edge and open beyond the reach of near misses are told."""

    GROUND = Block.box("ground", (-3, -3, -1), (3, 3, 0))

    def leaning(self, degrees: float) -> list[Block]:
        """A cube on one of its edges, opened by an angle, and another one on top of it."""
        turn = Rotation.from_euler("y", -degrees, degrees=True).as_matrix()
        cubes = [Block.box(n, (0, 0, z), (1, 1, z + 1), 1.0) for n, z in (("low", 0), ("top", 1))]
        return [b.moved(turn) for b in cubes]

    @pytest.mark.parametrize("degrees", [0.3, 1.0, 3.0, 5.5])
    def test_neighbour_distance_angle_and_the_tolerance_that_joins(self, degrees: float) -> None:
        blocks = [self.GROUND, *self.leaning(degrees)]
        with pytest.raises(
            GeometryError, match=r"'ground'.*touches no other block.*give a joint_tolerance of"
        ):
            detect(blocks, ["ground"])
        stool = Block.box("stool", (-2, 0, 0), (-1, 1, 1), density=1.0)
        (miss,) = detect([*blocks, stool], ["ground"]).near_misses
        far = np.sin(np.radians(degrees))
        assert (miss.a, miss.b, miss.kind) == ("ground", "low", "angle")
        assert miss.gaps == pytest.approx((0.0, far), rel=2e-3, abs=1e-9)
        assert np.degrees(miss.angle) == pytest.approx(degrees)
        assert f"an angle of {degrees:.3g} degrees, 0 m apart at one end" in miss.sentence("m")
        tolerance = float(miss.sentence().split("a joint tolerance of ")[1].split()[0])
        assert tolerance == pytest.approx(far, rel=0.01)
        found = detect([*blocks, stool], ["ground"], joint_tolerance=tolerance)
        assert {"ground-low", "low-top", "ground-stool"} <= {*found.contacts.names}

    @pytest.mark.parametrize("degrees", [7.0, 20.0])
    def test_too_steep_for_any_tolerance(self, degrees: float) -> None:
        with pytest.raises(GeometryError, match=r"no joint tolerance joins .*\): move") as refusal:
            detect([self.GROUND, self.leaning(degrees)[0]], ["ground"])
        assert "give a" not in str(refusal.value)

    def test_blocks_that_are_joined_elsewhere_are_not_told(self) -> None:
        """A chamfer opens from the joint beside it."""
        outline = np.array([[0, 0], [1, 0], [1.4, 0.15], [1.4, 1], [0, 1]])
        points = [[x, y, z] for x, z in outline for y in (0.0, 1.0)]
        stone = Block.hull("stone", points, density=1.0)
        found = detect([self.GROUND, stone], ["ground"])
        assert found.contacts.names == ("ground-stone",)
        assert not found.near_misses
