"""Facets, and contacts that are not convex: hull for rocking, the polygon itself for torsion."""

from __future__ import annotations

from dataclasses import replace

import manifold3d
import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cvxlimit import solve
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.detection import detect
from cvxlimit.geometry.facets import facets
from cvxlimit.geometry.mesh import triangulated
from cvxlimit.geometry.polygons import mean_distance_over, united
from cvxlimit.geometry.solids import solid
from cvxlimit.scene import Load, Scene
from placements import detect_contacts

L_SHAPE = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)
GROUND = Block.box("ground", (-5, -5, -1), (5, 5, 0))


def prism(id: str, outline: np.ndarray, low: float, high: float) -> Block:
    k = len(outline)
    points = np.array([(x, y, z) for z in (low, high) for x, y in outline])
    sides = [(i, (i + 1) % k, (i + 1) % k + k, i + k) for i in range(k)]
    faces = [tuple(range(k)), tuple(range(k, 2 * k)), *sides]
    return Block.polyhedron(id, points, faces, density=1.0)


def ring(id: str, inner: float = 1.0, height: float = 1.0) -> Block:
    """A square plate of side 3 with a square hole through its middle, its rims 4 trapezoids."""
    low, high = 1.5 - inner / 2, 1.5 + inner / 2
    squares = [np.array([(a, a), (b, a), (b, b), (a, b)]) for a, b in ((0, 3), (low, high))]
    points = np.array([(x, y, z) for z in (0, height) for s in squares for x, y in s], float)
    faces: list[tuple[int, ...]] = []
    for i in range(4):
        k = (i + 1) % 4
        faces += [(i, i + 4, k + 4, k), (i + 8, k + 8, k + 12, i + 12)]
        faces += [(i, k, k + 8, i + 8), (i + 4, i + 12, k + 12, k + 4)]
    return Block.polyhedron(id, points, faces, density=1.0)


def quadrature(region: shapely.Geometry, point: np.ndarray, n: int = 200) -> float:
    """Mean distance from a point: triangles by another library, each cut into n2 equal ones."""
    i, j = np.divmod(np.arange(n * n), n)
    lower = i + j < n
    weights = np.where(
        lower[:, None],
        np.column_stack([i + 1 / 3, j + 1 / 3]) / n,
        np.column_stack([n - i - 1 / 3, n - j - 1 / 3]) / n,
    )
    total = 0.0
    for triangle in shapely.constrained_delaunay_triangles(region).geoms:
        a, b, c = np.array(triangle.exterior.coords)[:3]
        samples = a + weights @ np.stack([b - a, c - a])
        total += triangle.area * np.linalg.norm(samples - point, axis=1).mean()
    return total / region.area


def shape_of(contacts: Contacts, j: int) -> tuple[float, np.ndarray, float, float]:
    """Area, centroid in space, hull's area and c_T of a contact."""
    hull = shapely.Polygon(contacts.corners_of(j))
    return contacts.area[j], contacts.origin[j], hull.area, contacts.torsion_arm[j]


class TestGrouping:
    def test_a_cube_cut_anyhow_has_six_facets(self) -> None:
        ball = trimesh.creation.box((1, 1, 1)).subdivide().subdivide()
        for turn in (np.eye(3), Rotation.random(rng=3).as_matrix()):
            block = solid("b", ball.vertices @ turn.T, ball.faces.tolist())
            found = facets(block.vertices, block.faces, block.joint_tolerance)
            assert len(found.faces) == len(found.pieces) == 6
            assert sorted(len(p) for p in found.pieces) == [4] * 6
            assert sorted(i for group in found.faces for i in group) == list(range(192))

    def test_faces_in_one_plane_are_one_facet_though_they_share_no_edge(self) -> None:
        bridge = np.array([(0, 0), (1, 0), (1, 1), (2, 1), (2, 0), (3, 0), (3, 2), (0, 2)], float)
        block = prism("bridge", bridge, 0.0, 1.0).moved(Rotation.from_euler("x", 90, degrees=True)
                                                        .as_matrix())  # fmt: skip
        found = block.facets(block.joint_tolerance)
        assert len(found.faces) == 9  # ten faces, two of them feet
        assert found.facet.count(next(i for i, g in enumerate(found.faces) if len(g) == 2)) == 2

    @pytest.mark.parametrize("subdivisions", [2, 3, 4])
    @pytest.mark.exhaustive_cases("4")
    def test_curved_surfaces_are_covered_by_patches_within_the_tolerance(
        self, subdivisions: int
    ) -> None:
        ball = trimesh.creation.icosphere(subdivisions=subdivisions)
        tolerance = 0.01
        found = facets(ball.vertices, tuple(map(tuple, ball.faces.tolist())), tolerance)
        assert sorted(i for group in found.faces for i in group) == list(range(len(ball.faces)))
        for group in found.faces:
            corners = ball.triangles[list(group)]
            normal = ball.face_normals[list(group)].T @ ball.area_faces[list(group)]
            normal /= np.linalg.norm(normal)
            heights = corners.reshape(-1, 3) @ normal
            assert np.ptp(heights) <= 2.0 * tolerance
        if subdivisions == 4:  # faces of 0.07, patches of radius up to sqrt(2 h) = 0.2
            assert len(found.faces) < len(ball.faces) / 3

    @settings(max_examples=30, deadline=None)
    @given(seed=st.integers(0, 10_000))
    def test_pieces_tile_the_faces(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        block = star("s", rng, 0.0, 1.0)
        turn = Rotation.random(rng=seed).as_matrix()
        block = block.moved(turn, rng.normal(size=3))
        found = block.facets(1e-9)
        corners = [block.vertices[list(p)] for p in found.pieces]
        areas = [np.linalg.norm(np.cross(c[1:-1] - c[0], c[2:] - c[0]).sum(axis=0)) / 2
                 for c in corners]  # fmt: skip
        assert sum(areas) == pytest.approx(block.surface, rel=1e-9)


def star(id: str, rng: np.random.Generator, low: float, high: float) -> Block:
    """A prism over a random star-shaped outline of up to nine corners."""
    count = int(rng.integers(4, 10))
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(-0.4, 0.4, count)) / count
    radii = rng.uniform(0.4, 1.0, count)
    return prism(id, np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]), low, high)


def outline_of(block: Block) -> shapely.Polygon:
    return shapely.Polygon(block.vertices[: len(block.vertices) // 2, :2])


class TestNotConvexContacts:
    def test_an_l_shaped_quoin_on_the_ground(self) -> None:
        contacts = detect_contacts([GROUND, prism("quoin", L_SHAPE, 0.0, 1.0)], ["ground"])
        area, centre, hull, arm = shape_of(contacts, 0)
        assert (len(contacts), area, hull) == (1, pytest.approx(3.0), pytest.approx(3.5))
        np.testing.assert_allclose(centre, [5 / 6, 5 / 6, 0], atol=1e-12)
        assert arm == pytest.approx(
            quadrature(shapely.Polygon(L_SHAPE), np.array([5 / 6, 5 / 6])), rel=1e-5
        )
        assert not contacts.is_rectangle[0]
        assert len(contacts.corners_of(0)) == 5
        filled = shapely.union_all([shapely.Polygon(p[:, :2]) for p in contacts.piece_points(0)])
        assert filled.symmetric_difference(shapely.Polygon(L_SHAPE)).area < 1e-9
        (contact,) = contacts
        assert contact.area == pytest.approx(3.0)

    def test_a_ring(self) -> None:
        block = ring("ring")
        contacts = detect_contacts([GROUND, block], ["ground"])
        area, centre, hull, arm = shape_of(contacts, 0)
        assert (len(contacts), area, hull) == (1, pytest.approx(8.0), pytest.approx(9.0))
        np.testing.assert_allclose(centre, [1.5, 1.5, 0], atol=1e-12)
        # Closed form: (9 c(3, 3) - 1 c(1, 1)) / 8 with c(l, l) = 0.382598 l.
        assert arm == pytest.approx(0.3825978582 * (9 * 3 - 1) / 8, rel=1e-9)

    def test_a_block_on_two_feet_has_one_contact_with_the_ground(self) -> None:
        bridge = np.array([(0, 0), (1, 0), (1, 1), (2, 1), (2, 0), (3, 0), (3, 2), (0, 2)], float)
        turn = Rotation.from_euler("x", 90, degrees=True).as_matrix()
        block = prism("bridge", bridge, 0.0, 1.0).moved(turn)
        contacts = detect_contacts([GROUND, block], ["ground"])
        area, centre, hull, arm = shape_of(contacts, 0)
        assert (len(contacts), area, hull) == (1, pytest.approx(2.0), pytest.approx(3.0))
        np.testing.assert_allclose(centre, [1.5, -0.5, 0], atol=1e-12)
        feet = shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 3, 1)])
        expected = [quadrature(foot, np.array([1.5, 0.5])) for foot in feet.geoms]
        assert arm == pytest.approx(np.mean(expected), rel=1e-5)
        assert len(contacts.pieces_of(0)) == 2

    def test_a_bridge_of_next_to_no_width_between_the_feet_changes_nothing(self) -> None:
        """One facet or two: the answer must not depend on it."""
        turn = Rotation.from_euler("x", 90, degrees=True).as_matrix()
        arms = []
        for sole in (0.0, 1e-7):
            base = [(0, 0), (1, 0), (1, 1), (2, 1), (2, 0), (3, 0), (3, 2), (0, 2)]
            block = prism("bridge", np.array(base, float), 0.0, 1.0).moved(turn)
            blocks = [GROUND, block]
            if sole:
                blocks[1] = Block.polyhedron("bridge", *with_thread(block, sole), density=1.0)
            contacts = detect_contacts(blocks, ["ground"])
            assert len(contacts) == 1
            arms.append(contacts.torsion_arm[0])
        assert arms[0] == pytest.approx(arms[1], rel=1e-5)

    @pytest.mark.parametrize("reach", [1e-7, 1e-3, 0.2])
    def test_a_foot_that_hardly_rests_does_not_count(self, reach: float) -> None:
        """Two feet on a plate that ends under the second: within the joint tolerance that foot
        must not widen the hull, as it would rock about an edge that is not there."""
        bridge = np.array([(0, 0), (1, 0), (1, 1), (2, 1), (2, 0), (3, 0), (3, 2), (0, 2)], float)
        turn = Rotation.from_euler("x", 90, degrees=True).as_matrix()
        plate = Block.box("plate", (-1, -2, -1), (2 + reach, 1, 0))
        found = detect([plate, prism("bridge", bridge, 0.0, 1.0).moved(turn)], ["plate"],
                       joint_tolerance=0.01)  # fmt: skip
        area, _, hull, _ = shape_of(found.contacts, 0)
        wide = reach > 0.01
        assert area == pytest.approx(1.0 + (reach if wide else 0.0))
        assert hull == pytest.approx(2.0 + reach if wide else 1.0)
        seen = [miss.kind for miss in found.near_misses]
        assert seen == (["sliver"] if reach == 1e-3 else [])

    @settings(max_examples=40, deadline=None)
    @given(seed=st.integers(0, 10_000))
    def test_random_outlines_against_another_library(self, seed: int) -> None:
        """Two random prisms on each other: overlap, hull and c_T by GEOS and quadrature."""
        rng = np.random.default_rng(seed)
        lower, upper = star("lower", rng, 0.0, 1.0), star("upper", rng, 1.0, 2.0)
        shift = rng.uniform(-0.2, 0.2, 2)
        upper = upper.moved(np.eye(3), (*shift, 0.0))
        expected = outline_of(lower) & outline_of(upper)
        turn = Rotation.random(rng=seed).as_matrix()
        blocks = [lower.moved(turn), upper.moved(turn)]
        contacts = detect_contacts(blocks)
        area, centre, hull, arm = shape_of(contacts, 0)
        assert len(contacts) == 1
        assert area == pytest.approx(expected.area, rel=1e-9)
        assert hull == pytest.approx(expected.convex_hull.area, rel=1e-9)
        middle = np.array(expected.centroid.coords[0])
        np.testing.assert_allclose(centre @ turn, [*middle, 1.0], atol=1e-9)
        parts = getattr(expected, "geoms", [expected])
        parts = [p for p in parts if p.area > 1e-9]
        mean = sum(quadrature(p, middle, 60) * p.area for p in parts) / expected.area
        assert arm == pytest.approx(mean, rel=2e-4)
        _, inward, offset = contacts.edges
        assert (offset > 0.0).all()
        inside = contacts.corner_xy @ inward.T + offset
        assert inside.min() > -1e-9
        assert sum(shapely.Polygon(p).area for p in contacts.pieces_of(0)) == pytest.approx(area)

    @settings(max_examples=20, deadline=None)
    @given(seed=st.integers(0, 10_000))
    def test_the_order_of_blocks_does_not_matter(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        blocks = [star("lower", rng, 0.0, 1.0), star("upper", rng, 1.0, 2.0)]
        one, other = detect_contacts(blocks), detect_contacts(blocks[::-1])
        assert one.area == pytest.approx(other.area, rel=1e-9)
        assert one.torsion_arm == pytest.approx(other.torsion_arm, rel=1e-9)
        np.testing.assert_allclose(one.origin, other.origin, atol=1e-9)
        np.testing.assert_allclose(one.axes[:, 2], -other.axes[:, 2], atol=1e-9)

    def test_scaled_and_picked(self) -> None:
        blocks = [
            GROUND,
            prism("quoin", L_SHAPE, 0.0, 1.0),
            ring("ring").moved(np.eye(3), (-4, 0, 0)),
        ]
        contacts = detect_contacts(blocks, ["ground"])
        np.testing.assert_allclose(contacts.scaled(1e3).torsion_arm, 1e3 * contacts.torsion_arm)
        swapped = contacts.take(np.array([1, 0]))
        assert swapped.names == contacts.names[::-1]
        np.testing.assert_allclose(swapped.torsion_arm, contacts.torsion_arm[::-1])

    def test_a_rectangle_between_shapes_that_are_not_convex_is_one(self) -> None:
        """An upright L on an upright L: their steps overlap in a plain rectangle."""
        turn = Rotation.from_euler("x", 90, degrees=True).as_matrix()
        lower = prism("lower", L_SHAPE, 0.0, 1.0).moved(turn)
        brick = Block.box("brick", (1, -1, 1), (1.75, 0, 2), density=1.0)
        contacts = detect_contacts([lower, brick])
        assert contacts.is_rectangle.all()
        assert sorted(contacts.area) == pytest.approx([0.75, 1.0])


def with_thread(block: Block, width: float) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """The bridge with a thread of the given width and height between its feet."""
    corners, _ = triangulated(block.vertices, block.faces)
    body = manifold3d.Manifold(
        manifold3d.Mesh64(block.vertices.copy(), corners.astype(np.uint64))
    ) + manifold3d.Manifold.cube([1.2, 100 * width, 1000 * width]).translate([0.9, -0.5, 0.0])
    found = body.to_mesh64()
    return np.asarray(found.vert_properties)[:, :3], found.tri_verts.tolist()


class TestMechanics:
    """Closed forms of one block on the ground, and one rigid body in place of two."""

    @pytest.mark.parametrize(
        ("direction", "arm"),
        [((1, 0, 0), 2 - 5 / 6), ((-1, 0, 0), 5 / 6), ((0, -1, 0), 5 / 6),
         ((np.sqrt(0.5), np.sqrt(0.5), 0), (3 - 5 / 3) / np.sqrt(2))],
    )  # fmt: skip
    def test_an_l_shaped_tower_tips_about_its_hull(
        self, direction: tuple[float, float, float], arm: float
    ) -> None:
        tower = prism("tower", L_SHAPE, 0.0, 4.0)
        scene = Scene([GROUND, tower], ["ground"], Load(acceleration=direction), friction=2.0)
        assert solve(scene).load_factor == pytest.approx(arm / 2.0, rel=1e-6)

    @pytest.mark.parametrize("block", [prism("b", L_SHAPE, 0.0, 1.0), ring("b"), ring("b", 2.5)],
                             ids=["quoin", "ring", "thin ring"])  # fmt: skip
    def test_a_block_twists_on_its_own_outline(self, block: Block) -> None:
        """A moment about the vertical through its centroid: M = c_T mu W, c_T by quadrature."""
        outline = shapely.Polygon(L_SHAPE)
        if len(block.vertices) == 16:
            low, high = block.vertices[4, 0], block.vertices[6, 0]
            outline = shapely.box(0, 0, 3, 3) - shapely.box(low, low, high, high)
        arm = quadrature(outline, block.centroid[:2])
        live = Load(forces={"b": (0, 0, 0, 0, 0, 1.0)})
        scene = Scene([GROUND, block], ["ground"], live, friction=0.5)
        expected = arm * 0.5 * block.weight
        assert solve(scene).load_factor == pytest.approx(expected, rel=1e-5)

    @pytest.mark.parametrize("direction", [1, -1])
    def test_a_stepped_block_is_its_two_halves_glued(self, direction: int) -> None:
        """A base 2 x 1 x 2 with 1 x 1 x 0.5 on it. Tips as one, which the friction between the
        halves and the small one's own stability (2 and more) allow."""
        base = Block.box("base", (0, 0, 0), (2, 1, 2), density=1.0)
        top = Block.box("top", (0, 0, 2), (1, 1, 2.5), density=1.0)
        outline = np.array([(0, 0), (2, 0), (2, 2), (1, 2), (1, 2.5), (0, 2.5)])
        turn = Rotation.from_euler("x", 90, degrees=True).as_matrix()
        whole = prism("whole", outline, -1.0, 0.0).moved(turn)
        live = Load(acceleration=(direction, 0, 0))
        halves = Scene([GROUND, base, top], ["ground"], live, friction=1.5,
                       contact_friction={("base", "top"): 50.0})  # fmt: skip
        glued = Scene([GROUND, whole], ["ground"], live, friction=1.5)
        x, z = (4 * 1 + 0.5 * 0.5) / 4.5, (4 * 1 + 0.5 * 2.25) / 4.5
        expected = ((2 - x) if direction > 0 else x) / z
        assert solve(halves).load_factor == pytest.approx(expected, rel=1e-6)
        assert solve(glued).load_factor == pytest.approx(expected, rel=1e-6)
        np.testing.assert_allclose(whole.centroid, [x, 0.5, z])

    def test_a_quoin_in_a_wall_is_its_two_halves_glued(self) -> None:
        """A quoin whose foot is built into a pier: one block, or two with a joint that holds."""
        turn = Rotation.from_euler("x", 90, degrees=True).as_matrix()
        outline = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], float)
        quoin = prism("quoin", outline, -1.0, 0.0).moved(turn)
        blocks = [
            GROUND,
            Block.box("brick", (1, 0, 1), (2, 1, 2), density=1.0),
            Block.box("lintel", (0, 0, 2), (2, 1, 2.5), density=1.0),
        ]
        halves = [Block.box("foot", (0, 0, 0), (2, 1, 1), density=1.0),
                  Block.box("leg", (0, 0, 1), (1, 1, 2), density=1.0)]  # fmt: skip
        live = Load(acceleration=(1, 0, 0))
        glued = Scene([*blocks, quoin], ["ground"], live, friction=0.3)
        apart = Scene([*blocks, *halves], ["ground"], live, friction=0.3,
                      contact_friction={("foot", "leg"): 10.0})  # fmt: skip
        assert len(glued.contacts) == 5
        assert len(apart.contacts) == 6
        one, other = solve(glued), solve(apart)
        assert one.load_factor == pytest.approx(0.3, rel=1e-6)
        assert other.load_factor == pytest.approx(0.3, rel=1e-6)
        rough = [solve(replace(s, friction=0.9, contact_friction=s.contact_friction))
                 for s in (glued, apart)]  # fmt: skip
        assert rough[0].load_factor >= rough[1].load_factor - 1e-6


def test_mean_distance_over_a_holed_region_from_anywhere() -> None:
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    shifts = [(x, y) for x in range(3) for y in range(3) if (x, y) != (1, 1)]
    pieces = [square + shift for shift in shifts]
    region = shapely.box(0, 0, 3, 3) - shapely.box(1, 1, 2, 2)
    for point in ((1.5, 1.5), (0.0, 0.0), (5.0, -2.0)):
        expected = quadrature(region, np.array(point))
        assert mean_distance_over(pieces, point) == pytest.approx(expected, rel=1e-5)
    hull, area, centroid = united(pieces)
    assert (len(hull), area) == (4, pytest.approx(8.0))
    np.testing.assert_allclose(centroid, [1.5, 1.5])
