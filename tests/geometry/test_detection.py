"""Contacts: exact shapes, relative tolerances, invariance, refusals."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.blocks import BOX_FACES, Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.detection import detect
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, triangulated
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.polygons import (
    area_and_centroid,
)
from cvxlimit.masonry import BUILTIN, arch, builtin_scene, panel, running_bond, wall
from cvxlimit.scene import Scene
from exhaustive import mostly_slow
from placements import detect_contacts, penetration

GROUND = Block.box("ground", (-2, -2, -1), (2, 2, 0))
PLAIN = Block.box("ground", (-60, -60, -1), (60, 60, 0))


def brick(id: str = "brick", low: Sequence[float] = (0, 0, 0), size: object = (1, 1, 1)) -> Block:
    return Block.box(id, low, np.add(low, size), density=1.0)


def turned_about_z(block: Block, angle: float) -> Block:
    return block.moved(Rotation.from_euler("z", angle).as_matrix())


def centred(id: str, z: float, side: float = 1.0) -> Block:
    return brick(id, (-side / 2, -side / 2, z), (side, side, 1.0))


def random_rotation(seed: int) -> np.ndarray:
    return Rotation.from_quat(np.random.default_rng(seed).normal(size=4)).as_matrix()


def assert_sound(contacts: Contacts, blocks: Sequence[Block]) -> None:
    """Frames right-handed, normals from a to b, corners counter-clockwise on both blocks."""
    identity = np.broadcast_to(np.eye(3), (len(contacts), 3, 3))
    products = contacts.axes @ contacts.axes.transpose(0, 2, 1)
    np.testing.assert_allclose(products, identity, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(contacts.axes), 1.0)
    for j, contact in enumerate(contacts):
        a, b = blocks[contacts.a[j]], blocks[contacts.b[j]]
        assert contacts.a[j] < contacts.b[j]
        assert contact.normal @ (a.centroid - contact.origin) < 0.0
        assert contact.normal @ (b.centroid - contact.origin) > 0.0
        area, centre = area_and_centroid(contacts.corners_of(j))
        assert area == pytest.approx(contact.area, rel=1e-9)
        np.testing.assert_allclose(centre, 0.0, atol=1e-7 * np.sqrt(area))
        for block in (a, b):
            assert_on_surface(contact.corners, block)


def assert_on_surface(points: np.ndarray, block: Block) -> None:
    heights = []
    for face in block.faces:
        corners = block.vertices[list(face)]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
        heights.append((points - corners[0]) @ (normal / np.linalg.norm(normal)))
    assert np.abs(np.max(heights, axis=0)).max() <= 2.0 * RELATIVE_TOLERANCE * block.size


class TestRectangles:
    def test_brick_on_ground(self) -> None:
        (contact,) = detect_contacts(
            [GROUND, brick(size=(0.4, 0.2, 0.1))], ["ground"], friction=0.3
        )
        assert (contact.name, contact.a, contact.b) == ("ground-brick", "ground", "brick")
        assert (contact.area, contact.friction) == (pytest.approx(0.08), 0.3)
        np.testing.assert_allclose(contact.origin, [0.2, 0.1, 0.0], atol=1e-15)
        np.testing.assert_array_equal(contact.normal, [0, 0, 1])
        sides = {int(np.abs(t).argmax()): side for t, side in zip(
            (contact.t1, contact.t2), contact.sides, strict=True)}  # fmt: skip
        assert sides == {0: pytest.approx(0.4), 1: pytest.approx(0.2)}
        corners = {tuple(corner) for corner in contact.corners.round(12)}
        assert corners == {(0, 0, 0), (0.4, 0, 0), (0.4, 0.2, 0), (0, 0.2, 0)}

    def test_normal_follows_the_order_of_blocks(self) -> None:
        (contact,) = detect_contacts([brick(), GROUND], ["ground"])
        assert contact.name == "brick-ground"
        np.testing.assert_array_equal(contact.normal, [0, 0, -1])

    @pytest.mark.parametrize("shift", [(0.25, 0.0), (0.0, -0.5), (0.75, 0.75)])
    def test_partial_overlap(self, shift: tuple[float, float]) -> None:
        upper = brick("upper", (*shift, 1.0))
        (contact,) = detect_contacts([brick("lower"), upper])
        expected = 1.0 - np.abs(shift)
        assert sorted(contact.sides) == pytest.approx(sorted(expected))
        assert contact.area == pytest.approx(expected.prod())
        centre = 0.5 + 0.5 * np.array(shift)
        np.testing.assert_allclose(contact.origin, [*centre, 1.0])

    @pytest.mark.parametrize("axis", range(3))
    def test_every_direction(self, axis: int) -> None:
        shift = np.eye(3)[axis]
        (contact,) = detect_contacts([brick("a"), brick("b", shift)])
        np.testing.assert_array_equal(contact.normal, shift)

    def test_two_fixed_blocks_do_not_count(self) -> None:
        wall = Block.box("wall", (-1, 0, 0), (0, 1, 1))
        contacts = detect_contacts([GROUND, wall, brick()], ["ground", "wall"])
        assert contacts.names == ("ground-brick", "wall-brick")

    def test_bricks_that_share_only_an_edge_or_a_corner_do_not_touch(self) -> None:
        blocks = [brick("a"), brick("b", (1, 0, 0)), brick("c", (1, 1, 0)), brick("d", (0, 0, 1)),
                  brick("e", (1, 1, 1))]  # fmt: skip
        assert detect_contacts(blocks).names == ("a-b", "a-d", "b-c", "c-e")

    def test_sliver_overlaps_do_not_count(self) -> None:
        tolerance = brick().joint_tolerance
        base = [GROUND, brick("a")]
        narrow = brick("b", (1.0 - 0.5 * tolerance, 0, 1))
        wide = brick("b", (1.0 - 2.0 * tolerance, 0, 1))
        support = brick("post", (1.0, 0, 0))
        assert "a-b" not in detect_contacts([*base, support, narrow], ["ground"]).names
        assert "a-b" in detect_contacts([*base, support, wide], ["ground"]).names


class TestPolygons:
    @pytest.mark.parametrize("angle", [1e-3, 0.2, np.pi / 4, 1.3])
    def test_turned_square_on_square(self, angle: float) -> None:
        lower, upper = centred("lower", 0.0), turned_about_z(centred("upper", 1.0), angle)
        contacts = detect_contacts([lower, upper])
        (contact,) = contacts
        assert len(contact.corners) == 8
        assert contact.sides is None
        assert contact.area == pytest.approx(2.0 / (1.0 + np.sin(angle) + np.cos(angle)))
        np.testing.assert_allclose(contact.origin, [0, 0, 1], atol=1e-12)
        assert_sound(contacts, [lower, upper])

    def test_turned_small_square_is_a_rectangle_along_its_own_sides(self) -> None:
        angle = 0.4
        upper = turned_about_z(Block.box("upper", (-0.2, -0.1, 1), (0.2, 0.1, 2)), angle)
        (contact,) = detect_contacts([centred("lower", 0.0), upper])
        assert contact.sides == pytest.approx((0.4, 0.2))
        along = [np.cos(angle), np.sin(angle), 0.0]
        assert abs(contact.t1 @ along) == pytest.approx(1.0)

    def test_hexagonal_column(self) -> None:
        angles = np.arange(6) * np.pi / 3.0
        ring = np.column_stack([np.cos(angles), np.sin(angles)])
        column = Block.hull("column", [[x, y, z] for z in (0.0, 2.0) for x, y in ring])
        (contact,) = detect_contacts([GROUND, column], ["ground"])
        assert len(contact.corners) == 6
        assert contact.area == pytest.approx(1.5 * np.sqrt(3.0))

    def test_triangles(self) -> None:
        triangle = np.array([[0, 0], [1, 0], [0, 1]], dtype=float)
        low = Block.hull("low", [[x, y, z] for z in (0.0, 1.0) for x, y in triangle])
        high = Block.hull("high", [[x, y, z] for z in (1.0, 2.0) for x, y in 0.75 - triangle])
        contacts = detect_contacts([low, high])
        assert contacts.area == pytest.approx([0.3125])
        assert_sound(contacts, [low, high])

    def test_all_tetrahedra(self) -> None:
        base = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        up, down = Block.hull("up", [*base, [0, 0, 1]]), Block.hull("down", [*base, [0, 0, -1]])
        contacts = detect_contacts([up, down])
        assert contacts.area == pytest.approx([0.5])
        assert len(contacts.corners_of(0)) == 3
        assert_sound(contacts, [up, down])

    @pytest.mark.parametrize("seed", range(20))
    def test_equal_trapezoids_in_any_position(self, seed: int) -> None:
        shape = np.array([[0, 0], [1, 0], [0.3, 0.8], [0, 0.5]])
        turn = random_rotation(seed)
        low, high = (
            Block.hull(key, [[x, y, z] for z in (z0, z0 + 1) for x, y in shape]).moved(turn)
            for key, z0 in (("low", 0.0), ("high", 1.0))
        )
        contacts = detect_contacts([low, high])
        assert contacts.area == pytest.approx([0.475], rel=1e-9)


class TestOneContactPerPlane:
    """However a face is given, two blocks have one contact in one plane."""

    def test_a_face_given_in_pieces_gives_one_contact(self) -> None:
        points = [*brick().vertices, [0.25, 0, 1], [0.25, 1, 1]]
        faces = [(0, 3, 2, 1), (4, 8, 9, 7), (8, 5, 6, 9), (0, 1, 5, 8, 4), (2, 3, 7, 9, 6),
                 (0, 4, 7, 3), (1, 2, 6, 5)]  # fmt: skip
        lower, upper = Block.polyhedron("low", points, faces), brick("up", (0, 0, 1))
        contacts = detect_contacts([lower, upper])
        assert contacts.names == ("low-up",)
        assert contacts.area == pytest.approx([1.0])
        assert contacts.is_rectangle.all()
        assert_sound(contacts, [lower, upper])
        whole = detect_contacts([brick("low"), upper])
        np.testing.assert_allclose(contacts.origin, whole.origin)
        np.testing.assert_allclose(contacts.torsion_arm, whole.torsion_arm)

    @pytest.mark.parametrize("name", ["ferris-tin-loi-3", "arch", "s12-panel"])
    def test_otherwise_one_contact_per_pair(self, name: str) -> None:
        contacts = builtin_scene(name).contacts
        pairs = set(zip(contacts.a.tolist(), contacts.b.tolist(), strict=True))
        assert len(pairs) == len(contacts)

    def test_a_brick_in_an_inner_corner_touches_both_arms(self) -> None:
        arms = [brick("x", (1, 0, 0), (2, 1, 1)), brick("y", (0, 1, 0), (1, 2, 1))]
        contacts = detect_contacts([*arms, brick("corner", (1, 1, 0))])
        assert contacts.names == ("x-corner", "y-corner")


class TestTolerance:
    @pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3, 1e6])
    def test_gap_just_below_and_above(self, scale: float) -> None:
        tolerance = brick().joint_tolerance
        lower = brick("lower").scaled(scale)
        for gap in (0.9 * tolerance, -0.9 * tolerance):
            upper = brick("upper", (0, 0, 1.0 + gap)).scaled(scale)
            assert len(detect_contacts([lower, upper])) == 1
        apart = brick("upper", (0, 0, 1.0 + 1.1 * tolerance)).scaled(scale)
        with pytest.raises(InputError, match=r"'lower'.*touches no other block"):
            detect_contacts([lower, apart])
        deep = brick("upper", (0, 0, 1.0 - 1.1 * tolerance)).scaled(scale)
        with pytest.raises(InputError, match="'lower' and 'upper' interpenetrate by about"):
            detect_contacts([lower, deep])

    def test_the_thinner_block_decides(self) -> None:
        ground = Block.box("ground", (-50, -50, -1), (50, 50, 0))
        small = brick().joint_tolerance
        assert len(detect_contacts([ground, brick(low=(0, 0, 0.9 * small))], ["ground"])) == 1
        for gap, message in ((1.1 * small, "touches no other"), (-1.1 * small, "interpenetrate")):
            with pytest.raises(InputError, match=message):
                detect_contacts([ground, brick(low=(0, 0, gap))], ["ground"])

    @pytest.mark.parametrize("scale", [1e-6, 1e3, 1e6])
    @pytest.mark.parametrize("name", ["arch", "tuff-wall"])
    def test_micrometres_and_kilometres(self, name: str, scale: float) -> None:
        scene = builtin_scene(name)
        blocks = [block.scaled(scale) for block in scene.blocks]
        found = detect_contacts(blocks, scene.supports)
        assert found.names == scene.contacts.names
        np.testing.assert_allclose(found.sides, scene.contacts.sides * scale, rtol=1e-9)
        np.testing.assert_allclose(found.area, scene.contacts.area * scale**2, rtol=1e-9)

    @pytest.mark.parametrize("ground_first", [True, False])
    @pytest.mark.parametrize("seed", range(10))
    def test_rounded_coordinates_of_a_brick_on_large_ground(
        self, seed: int, ground_first: bool
    ) -> None:
        """The brick's rounded plane misses the ground's far corners; the ground's is meant."""
        turn = random_rotation(seed)
        blocks = [
            Block.polyhedron(block.id, block.moved(turn).vertices.round(7), block.faces)
            for block in (Block.box("ground", (-10, -10, -1), (10, 10, 0)),
                          brick(size=(0.2, 0.1, 0.1)))
        ]  # fmt: skip
        contacts = detect_contacts(blocks if ground_first else blocks[::-1], ["ground"])
        assert contacts.area == pytest.approx([0.02], rel=1e-4)


class TestInvariance:
    @pytest.mark.exhaustive
    @settings(max_examples=25, deadline=None)
    @given(seed=st.integers(0, 10_000), name=st.sampled_from(["arch", "tuff-wall", "stack"]))
    def test_rotated_and_far_away(self, seed: int, name: str) -> None:
        scene = builtin_scene(name)
        turn = random_rotation(seed)
        far = 1e4 * scene.blocks[1].size * np.random.default_rng(seed).normal(size=3)
        blocks = [block.moved(turn, far) for block in scene.blocks]
        found, known = detect_contacts(blocks, scene.supports), scene.contacts
        assert found.names == known.names
        np.testing.assert_allclose(found.area, known.area, rtol=1e-6)
        np.testing.assert_allclose(np.sort(found.sides), np.sort(known.sides), rtol=1e-6)
        np.testing.assert_allclose(found.axes[:, 2], known.axes[:, 2] @ turn.T, atol=1e-7)
        np.testing.assert_allclose(found.origin, known.origin @ turn.T + far, rtol=1e-9)
        assert_sound(found, blocks)

    @pytest.mark.exhaustive
    @settings(max_examples=25, deadline=None)
    @given(seed=st.integers(0, 10_000), name=st.sampled_from(["ferris-tin-loi-3", "arch"]))
    def test_renumbered(self, seed: int, name: str) -> None:
        scene = builtin_scene(name)
        order = np.random.default_rng(seed).permutation(len(scene.blocks))
        blocks = [scene.blocks[i] for i in order]
        found = detect_contacts(blocks, scene.supports)
        assert_sound(found, blocks)
        areas = {frozenset((c.a, c.b)): c.area for c in found}
        known = {frozenset((c.a, c.b)): c.area for c in scene.contacts}
        assert areas.keys() == known.keys()
        assert [areas[pair] for pair in known] == pytest.approx(list(known.values()))

    @settings(max_examples=25, deadline=None)
    @given(seed=st.integers(0, 10_000))
    def test_pile_of_turned_bricks(self, seed: int) -> None:
        generator = np.random.default_rng(seed)
        pile = [
            turned_about_z(
                centred(f"b{i}", i, generator.uniform(0.5, 1.0)), generator.uniform(0, 7)
            )
            for i in range(5)
        ]
        contacts = detect_contacts(pile)
        assert contacts.names == ("b0-b1", "b1-b2", "b2-b3", "b3-b4")
        assert_sound(contacts, pile)

    @pytest.mark.exhaustive_cases("s10-panel")
    @pytest.mark.parametrize("name", BUILTIN)
    def test_built_in_scenes_are_sound(self, name: str) -> None:
        scene = builtin_scene(name)
        assert_sound(scene.contacts, scene.blocks)


class TestRefusals:
    def test_loose_block(self) -> None:
        with pytest.raises(
            InputError, match=r"'far' \(centre \[5.5, 0.5, 0.5\]\) touches no other"
        ):
            detect_contacts([GROUND, brick(), brick("far", (5, 0, 0))], ["ground"])

    def test_block_that_touches_along_a_line_only(self) -> None:
        with pytest.raises(InputError, match=r"'b' .*touches no other block"):
            detect_contacts([GROUND, brick("a"), brick("b", (1, 1, 1))], ["ground"])

    @pytest.mark.parametrize(
        "other",
        [
            brick("other", (0.5, 0.5, 0)),
            brick("other", (0.25, 0.25, 0.25), (0.5, 0.5, 0.5)),
            turned_about_z(brick("other"), 0.1),
            brick("other", (-1, 0.4, 0.4), (3, 0.2, 0.2)),
        ],
        ids=["corner", "inside", "turned", "skewer"],
    )
    def test_shared_volume(self, other: Block) -> None:
        with pytest.raises(InputError, match="'brick' and 'other' interpenetrate by about"):
            detect_contacts([GROUND, brick(), other], ["ground"])

    def test_the_same_body_twice_however_it_is_listed(self) -> None:
        first = brick()
        again = np.arange(8)[::-1]
        faces = [[int(again[i]) for i in face[2:] + face[:2]] for face in first.faces[::-1]]
        cut, _ = triangulated(first.vertices, first.faces)
        others = [
            brick("other"),
            Block.polyhedron("other", first.vertices[again], faces, density=3.0),
            Block.polyhedron("other", first.vertices + 1e-4, cut.tolist(), density=1.0),
        ]
        for other in others:
            for order in ([first, other], [other, first]):
                with pytest.raises(InputError, match="are the same body twice") as refusal:
                    detect_contacts([GROUND, *order], ["ground"])
                assert {"brick", "other"} <= {*str(refusal.value).split("'")}
        with pytest.raises(InputError, match="interpenetrate by about"):
            detect_contacts([GROUND, first, brick("other", size=(1, 1, 0.97))], ["ground"])

    def test_pairs_in_many_portions_are_those_of_one(self, monkeypatch: pytest.MonkeyPatch) -> None:
        scene = builtin_scene("tuff-wall")
        blocks = [block.moved(random_rotation(3)) for block in scene.blocks]
        whole = detect(blocks, scene.supports, 0.5)
        monkeypatch.setattr("cvxlimit.geometry.nearby._PORTION", 5)
        monkeypatch.setattr("cvxlimit.geometry.facing.NUMBERS", 300)
        parts = detect(blocks, scene.supports, 0.5)
        assert parts.contacts.names == whole.contacts.names
        for name in ("a", "b", "origin", "axes", "corner_start", "corner_xy", "sides", "friction"):
            one, other = (getattr(x.contacts, name) for x in (parts, whole))
            np.testing.assert_array_equal(one, other)
        assert len(parts.near_misses) == len(whole.near_misses)

    def test_a_brick_sunk_slightly_into_a_large_side_wall(self) -> None:
        wall = Block.box("wall", (-1, -50, -50), (0, 50, 50))
        sunk = [brick(f"b{i}", (-0.004, 0, i)) for i in range(3)]
        with pytest.raises(InputError, match=r"'wall' and 'b0' interpenetrate by about 0\.004"):
            detect_contacts([wall, *sunk], ["wall"])

    @pytest.mark.parametrize("seed", range(3))
    def test_all_overlaps_are_counted_and_the_largest_is_named(self, seed: int) -> None:
        """Bricks of several sizes on a row of posts, sunk by chance, some by less than is allowed
        and some of them long and thick, which are allowed more: what the sentence says to raise
        the tolerance to takes them all."""
        rng = np.random.default_rng(seed)
        blocks, depths = [PLAIN], {}
        for i in range(12):
            size, sunk = (
                float(rng.choice([0.5, 2.0])),
                float(rng.choice([0.0, rng.uniform(0, 0.04)])),
            )
            blocks.append(brick(f"p{i}", (4.0 * i, 0, 0), (size, size, 1.0)))
            blocks.append(brick(f"t{i}", (4.0 * i, 0, 1.0 - sunk), (size, size, 1.0)))
            if sunk > min(block.joint_tolerance for block in blocks[-2:]):
                depths[f"p{i}", f"t{i}"] = sunk
        with pytest.raises(GeometryError) as refused:
            detect_contacts(blocks, ["ground"])
        deepest = max(depths, key=lambda pair: depths[pair])
        assert refused.value.blocks == deepest
        said = str(refused.value)
        assert f"interpenetrate by about {depths[deepest]:.3g} near" in said
        assert f", the most of {len(depths)} pairs: move" in said
        enough = float(re.search(r"raise joint_tolerance to (\S+), which takes all", said)[1])
        assert depths[deepest] <= enough <= 1.01 * depths[deepest]
        assert len(detect_contacts(blocks, ["ground"], joint_tolerance=enough)) == 24

    def test_the_tolerance_that_takes_small_overlaps_keeps_the_joints_of_large_blocks(self) -> None:
        """What large blocks allow by default is more than what small ones need."""
        large = [brick("a", (0, 0, 0), (20, 20, 20)), brick("b", (0, 0, 20.06), (20, 20, 20))]
        small = [brick("c", (30, 0, 0)), brick("d", (30, 0, 0.98))]
        with pytest.raises(GeometryError, match=r"by about 0\.02 near") as refused:
            detect_contacts([PLAIN, *large, *small], ["ground"])
        enough = float(re.search(r"joint_tolerance to (\S+) if", str(refused.value))[1])
        found = detect_contacts([PLAIN, *large, *small], ["ground"], joint_tolerance=enough)
        assert [c.name for c in found] == ["ground-a", "ground-c", "a-b", "c-d"]

    def test_no_tolerance_is_named_for_what_no_tolerance_should_take(self) -> None:
        with pytest.raises(GeometryError) as refused:
            detect_contacts([GROUND, brick(), brick("other", (0, 0, 0.4))], ["ground"])
        assert "joint_tolerance" not in str(refused.value)

    def test_a_file_read_twice(self) -> None:
        blocks = [brick(f"b{i}", (2.0 * i, 0, 0)) for i in range(5)]
        again = [replace(block, id=f"{block.id}#2") for block in blocks]
        with pytest.raises(GeometryError, match=r"'b0' and 'b0#2' are the same.*; 5 pairs are$"):
            detect_contacts([PLAIN, *blocks, *again], ["ground"])

    @pytest.mark.parametrize("tolerance", [0.34, 3.0, 5000.0])
    def test_an_absurd_tolerance_is_held_against_the_blocks(self, tolerance: float) -> None:
        """A cube's mean thickness is a third of its side; supports may be as thin as they like."""
        sheet = Block.box("sheet", (-2, -2, -0.01), (4, 4, 0))
        said = rf"joint_tolerance {tolerance:.4g} is no less than .* 'brick', 0\.333, .*is 0\.00333"
        with pytest.raises(GeometryError, match=said):
            detect_contacts([sheet, brick()], ["sheet"], joint_tolerance=tolerance)
        assert len(detect_contacts([sheet, brick()], ["sheet"], joint_tolerance=0.3)) == 1

    def test_a_joint_too_narrow_for_the_tolerance_asks_for_a_smaller_one(self) -> None:
        edge = brick("edge", (1 - 0.02, 0, 1))
        with pytest.raises(GeometryError, match="give a smaller joint_tolerance"):
            detect_contacts([brick(), edge], ["brick"], joint_tolerance=0.03)

    def test_edges_that_pass_each_other_do_not_interpenetrate(self) -> None:
        ridge = Block.hull("a", [[0, -1, 0], [0, 1, 0], [-1, 0, -1], [1, 0, -1]])
        cross = Block.hull("b", [[-1, 0, 0.1], [1, 0, 0.1], [0, -1, 1.1], [0, 1, 1.1]])
        assert penetration(ridge, cross) == pytest.approx(-0.1)
        with pytest.raises(InputError, match="touches no other block"):
            detect_contacts([ridge, cross])
        sunk = cross.moved(np.eye(3), (0, 0, -0.3))
        assert penetration(ridge, sunk) == pytest.approx(0.2)
        with pytest.raises(InputError, match="'a' and 'b' interpenetrate by about"):
            detect_contacts([ridge, sunk])

    def test_an_edge_in_a_side_wall_is_as_deep_as_it_reaches(self) -> None:
        """Its ends are on the wall's own faces, and a wedge is half as thick as it is deep."""
        wall = Block.box("wall", (-1, -2, 0), (0, 2, 1))
        plan = np.array([[-0.004, 0.0], [1.0, -1.0], [1.0, 1.0]])
        wedge = Block.hull("wedge", [[x, y, z] for x, y in plan for z in (0, 1)], density=1.0)
        small = 0.0039  # between the thickness of what they share and how deep that is
        with pytest.raises(InputError, match=r"interpenetrate by about 0\.004 near"):
            detect_contacts([GROUND, wall, wedge], ["ground", "wall"], joint_tolerance=small)
        found = detect_contacts([GROUND, wall, wedge], ["ground", "wall"], joint_tolerance=0.0041)
        assert [c.name for c in found] == ["ground-wedge"]


def near_pairs(blocks: Sequence[Block], margin: float) -> set[tuple[int, int]]:
    found = nearby_pairs([b.vertices for b in blocks], np.full(len(blocks), margin))
    pairs = [
        pair
        for first, second in found
        for pair in zip(first.tolist(), second.tolist(), strict=True)
    ]
    assert len(set(pairs)) == len(pairs)
    return set(pairs)


class TestAllPairs:
    """Leaving far pairs out changes nothing: compared with a look at every pair."""

    @pytest.mark.parametrize("seed", mostly_slow(range(30), range(5)))
    @pytest.mark.exhaustive_cases("2", "3", "4")
    def test_cloud_of_thin_and_thick_bricks(self, seed: int) -> None:
        generator = np.random.default_rng(seed)
        sizes = generator.uniform(0.2, 0.6, (30, 3)) * generator.choice([0.05, 1.0], (30, 3))
        places = generator.uniform(-1.5, 1.5, (30, 3))
        blocks = [
            brick(f"b{i}", -0.5 * size, size).moved(random_rotation(30 * seed + i), place)
            for i, (size, place) in enumerate(zip(sizes, places, strict=True))
        ]
        near = near_pairs(blocks, 0.0)
        pairs = combinations(range(len(blocks)), 2)
        meeting = [(i, k) for i, k in pairs if penetration(blocks[i], blocks[k]) > 0.0]
        assert set(meeting) <= near
        refusal = "touches no other block"
        if meeting:
            refusal = "'b[0-9]+' and 'b[0-9]+' interpenetrate by about"
        with pytest.raises(GeometryError, match=refusal) as refused:
            detect_contacts(blocks)
        if meeting:
            assert tuple(int(name[1:]) for name in refused.value.blocks) in meeting
            told = re.search(r"most of (\d+) pairs", str(refused.value))
            assert int(told[1] if told else 1) == len(meeting)

    @pytest.mark.exhaustive_cases("arch", "thick-arch")
    @pytest.mark.parametrize(
        "scene",
        [arch(24), arch(24, 1.8), wall(running_bond(3, 5)), builtin_scene("stack")],
        ids=["arch", "thick-arch", "wall", "stack"],
    )
    def test_contacts_are_those_of_each_pair_alone(self, scene: Scene) -> None:
        turn = random_rotation(7)
        blocks = [block.moved(turn) for block in scene.blocks]
        alone = []
        for pair in combinations(blocks, 2):
            with suppress(InputError):
                alone += detect_contacts(pair)
        together = detect_contacts(blocks)
        assert together.names == tuple(contact.name for contact in alone)
        for one, other in zip(together, alone, strict=True):
            np.testing.assert_array_equal(one.corners, other.corners)

    def test_thin_voussoirs_are_near_their_neighbours_only(self) -> None:
        blocks = arch(1000).blocks
        near = near_pairs(blocks, 1e-6)
        assert len(blocks) <= len(near) + 1 <= 2 * len(blocks)

    def test_a_thin_voussoir_pushed_into_the_next(self) -> None:
        blocks = list(arch(1000).blocks)
        across = blocks[301].centroid - blocks[300].centroid
        blocks[300] = blocks[300].moved(np.eye(3), 0.1 * across)
        with pytest.raises(InputError, match="'v300' and 'v301' interpenetrate by about"):
            detect_contacts(blocks)


def test_thousands_of_bricks() -> None:
    scene = panel(2.4, 80, left_return=1.6, right_return=1.6)
    assert (len(scene.free), len(scene.contacts)) == (5560, 16452)


class TestRecords:
    def test_indexing(self) -> None:
        contacts = builtin_scene("tuff-wall").contacts
        assert contacts[-1].name == contacts.names[-1]
        assert len(list(contacts)) == len(contacts)
        with pytest.raises(IndexError, match="contact 146 of 146"):
            contacts[146]

    def test_corner_points_are_the_records_corners(self) -> None:
        contacts = builtin_scene("arch").contacts
        np.testing.assert_allclose(
            contacts.corner_points, np.concatenate([c.corners for c in contacts])
        )

    def test_edges_hold_the_inside(self) -> None:
        blocks = [centred("lower", 0.0), turned_about_z(centred("upper", 1.0), 0.5)]
        contacts = detect_contacts([*blocks, brick("side", (0.5, 0, 0))])
        owner, inward, offset = contacts.edges
        assert (offset > 0.0).all()
        for j in range(len(contacts)):
            mine = owner == j
            inside = contacts.corners_of(j) @ inward[mine].T + offset[mine]
            assert inside.min() > -1e-12
            outside = 1.01 * contacts.corners_of(j) @ inward[mine].T + offset[mine]
            assert (outside.min(axis=1) < 0.0).all()

    def test_corner_minima(self) -> None:
        contacts = builtin_scene("arch").contacts
        values = np.arange(len(contacts.corner_xy), dtype=float)
        first = contacts.corner_start[:-1]
        np.testing.assert_array_equal(contacts.corner_minimum(values), first)


def test_box_faces_and_hull_faces_agree() -> None:
    """A brick as a box, as a polyhedron and as a hull makes the same contact."""
    corners = brick().vertices
    forms = [brick(), Block.polyhedron("brick", corners, BOX_FACES), Block.hull("brick", corners)]
    areas = [detect_contacts([GROUND, form], ["ground"]).sides.tolist() for form in forms]
    assert areas == [[[1.0, 1.0]]] * 3


def test_cut_polyhedra_that_share_a_corner() -> None:
    """GEOS 3.14 loses one of these contacts, a different one in each order of the blocks."""
    ground, wall = Block.box("g", (0, 0, -1), (2, 1, 0)), Block.box("k", (0, 1, -1), (2, 2, 1))
    a = [
        (0, 1, 0), (0, 1, 1), (0, 0.0345546785592389, 0), (0, 0.8993756123718891, 1),
        (0.19669469319397442, 1, 1), (0.8499879974990074, 1, 0),
        (0.9277286452282183, 0.5091588750185979, 0), (0.8770669632888672, 1, 0.5975323121514795),
    ]  # fmt: skip
    b = [
        (1.7526954144432565, 1, 0.07956270398191556), (0.8770669632888672, 1, 0.5975323121514795),
        (1.7526954144432565, 1, 0.0726968478387972),
        (1.7526954144432565, 0.9940622638788851, 0.0726968478387972),
        (0.8532824728196298, 1, 0.0726968478387972),
        (0.9215650545598882, 0.5688754825562187, 0.0726968478387972),
    ]  # fmt: skip
    first, second = Block.hull("a", a, density=1.0), Block.hull("b", b, density=1.0)
    found = []
    for blocks in ([ground, wall, first, second], [ground, wall, second, first]):
        contacts = detect_contacts(blocks, fixed=["g", "k"], friction=0.9)
        pairs = zip(contacts.a, contacts.b, contacts.area, strict=True)
        found.append({frozenset((blocks[i].id, blocks[k].id)): area for i, k, area in pairs})
    assert found[0].keys() == found[1].keys()
    assert frozenset("ab") in found[0]
    for pair, area in found[0].items():
        assert found[1][pair] == pytest.approx(area, rel=1e-9)
