"""Meshes as programs write them: mass against counting, every repair counted, refusals by name."""

from __future__ import annotations

import pickle

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from cells import cells
from cvxlimit import Load, Scene, solve
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.blocks import BOX_FACES, Block
from cvxlimit.geometry.mesh import triangulated
from cvxlimit.geometry.penetration import Body
from cvxlimit.geometry.shells import winding
from cvxlimit.geometry.solids import solid
from exhaustive import mostly_slow

CUBE = Block.box("cube", (0, 0, 0), (1, 1, 1))
L_SHAPE = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)


def prism(outline: np.ndarray, low: float, high: float) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Vertices and outward faces of an upright prism over a counter-clockwise outline."""
    k = len(outline)
    points = np.array([(x, y, z) for z in (low, high) for x, y in outline])
    sides = [(i, (i + 1) % k, (i + 1) % k + k, i + k) for i in range(k)]
    return points, [tuple(range(k))[::-1], tuple(range(k, 2 * k)), *sides]


def ring() -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """A square plate 3 x 3 x 1 with a square hole 1 x 1 through it; its rims are 4 trapezoids."""
    squares = [np.array([(a, a), (b, a), (b, b), (a, b)]) for a, b in ((0, 3), (1, 2))]
    points = np.array([(x, y, z) for z in (0, 1) for square in squares for x, y in square], float)
    faces = []
    for i in range(4):
        k = (i + 1) % 4
        faces += [(i, i + 4, k + 4, k), (i + 8, k + 8, k + 12, i + 12)]  # below, above
        faces += [(i, k, k + 8, i + 8), (i + 4, i + 12, k + 12, k + 4)]  # outside, inside
    return points, faces


def triangles(block: Block) -> list[tuple[int, ...]]:
    return [tuple(t) for t in triangulated(block.vertices, block.faces)[0].tolist()]


def kinds(block: Block) -> dict[str, int]:
    return {repair.kind: repair.count for repair in block.repairs}


class TestMass:
    def test_l_shaped_prism(self) -> None:
        block = Block.polyhedron("quoin", *prism(L_SHAPE, 0.0, 2.0), density=3.0)
        assert block.volume == pytest.approx(6.0, rel=1e-14)
        np.testing.assert_allclose(block.centroid, [5 / 6, 5 / 6, 1.0], rtol=1e-14)
        assert (block.is_convex, block.weight) == (False, pytest.approx(18.0))
        assert block.surface == pytest.approx(2 * 3 + 2 * 8)

    def test_a_plate_with_a_hole_through_it(self) -> None:
        block = solid("ring", *ring())
        assert (block.volume, block.surface) == pytest.approx((8.0, 2 * 8 + 12 + 4))
        np.testing.assert_allclose(block.centroid, [1.5, 1.5, 0.5])

    @pytest.mark.parametrize("inner_turned", [True, False])
    def test_a_cavity(self, inner_turned: bool) -> None:
        """An inner shell is a cavity, whichever way its faces go round."""
        inner = 0.25 + 0.5 * CUBE.vertices
        hollow = [tuple(i + 8 for i in (f[::-1] if inner_turned else f)) for f in BOX_FACES]
        block = solid("box", np.vstack([CUBE.vertices, inner]), [*BOX_FACES, *hollow])
        assert block.volume == pytest.approx(1.0 - 0.125)
        assert kinds(block) == ({} if inner_turned else {"turned": 6})

    @settings(max_examples=30, deadline=None)
    @given(seed=st.integers(0, 10_000))
    def test_unions_of_boxes_against_counting_cells(self, seed: int) -> None:
        """Random bodies of unit cells, with steps, notches and holes: counted, not integrated."""
        rng = np.random.default_rng(seed)
        filled = np.zeros((6, 6, 6), dtype=bool)
        body = manifold3d.Manifold()
        for _ in range(6):
            low = rng.integers(0, 4, 3)
            size = rng.integers(1, 4, 3)
            high = np.minimum(low + size, 6)
            filled[tuple(map(slice, low, high))] = True
            size = (high - low).astype(float)
            body += manifold3d.Manifold.cube(size.tolist()).translate(low.astype(float).tolist())
        parts = [p for p in body.decompose() if p.genus() >= 0]
        if len(parts) != 1:
            return
        mesh = body.to_mesh64()
        cells = np.argwhere(filled) + 0.5
        block = solid("b", np.asarray(mesh.vert_properties)[:, :3], mesh.tri_verts.tolist())
        assert block.volume == pytest.approx(len(cells), rel=1e-9)
        np.testing.assert_allclose(block.centroid, cells.mean(axis=0), rtol=1e-9)

    @settings(max_examples=30, deadline=None)
    @given(seed=st.integers(0, 10_000))
    def test_star_shaped_bodies_against_tetrahedra_and_trimesh(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        ball = trimesh.creation.icosphere(subdivisions=2)
        points = ball.vertices * rng.uniform(0.6, 1.4, (len(ball.vertices), 1))
        faces = [f if rng.random() < 0.5 else f[::-1] for f in ball.faces.tolist()]
        shift = 10.0 * rng.normal(size=3)
        block = solid("pebble", points + shift, faces)
        corners = points[ball.faces]
        volumes = np.abs(np.linalg.det(corners)) / 6.0
        centroid = (volumes[:, None] * corners.sum(axis=1) / 4.0).sum(axis=0) / volumes.sum()
        assert block.volume == pytest.approx(volumes.sum(), rel=1e-9)
        np.testing.assert_allclose(block.centroid, centroid + shift, rtol=1e-9, atol=1e-9)
        mass = trimesh.Trimesh(points, ball.faces).mass_properties
        assert block.volume == pytest.approx(float(mass["volume"]), rel=1e-9)
        assert not block.is_convex

    def test_a_warped_quadrilateral_counts_as_the_mean_of_its_two_diagonals(self) -> None:
        points = CUBE.vertices.copy()
        points[6, 2] = 1.002
        warped = Block.polyhedron("b", points, BOX_FACES)
        volumes = [
            Block.polyhedron("b", points, [*BOX_FACES[:1], *BOX_FACES[2:], *cut]).volume
            for cut in (((4, 5, 6), (4, 6, 7)), ((5, 6, 7), (5, 7, 4)))
        ]
        assert volumes[0] != pytest.approx(volumes[1], abs=1e-4)
        assert warped.volume == pytest.approx(np.mean(volumes), rel=1e-14)


class TestRepairs:
    def test_exact_input_needs_none(self) -> None:
        assert solid("b", CUBE.vertices, CUBE.faces).repairs == ()

    def test_triangle_soup(self) -> None:
        corners = [i for t in triangles(CUBE) for i in t]
        soup = [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(12)]
        block = solid("b", CUBE.vertices[corners], soup)
        assert (block.volume, kinds(block)) == (pytest.approx(1.0), {"welded": 28})

    def test_an_inverted_shell(self) -> None:
        block = solid("b", CUBE.vertices, [f[::-1] for f in CUBE.faces])
        assert (block.volume, kinds(block)) == (1.0, {"turned": 6})
        assert "inside out" in block.repairs[0].detail

    def test_some_faces_turned(self) -> None:
        faces = [f[::-1] if i in (1, 4) else f for i, f in enumerate(CUBE.faces)]
        assert kinds(solid("b", CUBE.vertices, faces)) == {"turned": 2}

    def test_faces_listed_more_than_once(self) -> None:
        again = [*CUBE.faces, *CUBE.faces, CUBE.faces[0][::-1]]
        assert kinds(solid("b", CUBE.vertices, again)) == {"doubled": 7}

    def test_a_wall_inside(self) -> None:
        """Two boxes joined with the faces between them left in, as a union by name leaves them."""
        points = np.vstack([CUBE.vertices, CUBE.vertices[[1, 2, 5, 6]] + (1.0, 0.0, 0.0)])
        second = [(1, 2, 9, 8), (5, 10, 11, 6), (1, 8, 10, 5), (2, 6, 11, 9), (1, 5, 6, 2),
                  (8, 9, 11, 10)]  # fmt: skip
        block = solid("b", points, [*CUBE.faces, *second])
        assert (block.volume, kinds(block)) == (pytest.approx(2.0), {"doubled": 2})

    def test_vertices_without_a_face_and_faces_without_area(self) -> None:
        points = np.vstack([CUBE.vertices, [(0.5, 0.5, 0.5), (0.5, 0.0, 0.0)]])
        faces = [*CUBE.faces, (0, 1, 9), (3, 3, 2)]
        block = solid("b", points, faces)
        assert kinds(block) == {"degenerate": 2, "unused": 2}
        with pytest.raises(InputError, match=r"face 6 of block 'b' needs at least three different"):
            solid("b", points, [*CUBE.faces, (0, 1, 0, 2)])

    def test_a_body_written_twice_has_its_volume_once(self) -> None:
        """Each copy is closed and convex by itself, corners apart."""
        twice = [*CUBE.faces, *(tuple(8 + i for i in face) for face in CUBE.faces)]
        block = solid("b", np.vstack([CUBE.vertices, CUBE.vertices]), twice)
        assert (block.volume, kinds(block)) == (pytest.approx(1.0), {"welded": 8, "doubled": 6})

    def test_a_vertex_in_the_middle_of_another_faces_edge(self) -> None:
        points = np.vstack([CUBE.vertices, [(0.5, 0.0, 0.0)]])
        faces = [(0, 3, 2), (0, 2, 8), (8, 2, 1), *CUBE.faces[1:]]
        block = solid("b", points, faces)
        assert (block.volume, kinds(block)) == (pytest.approx(1.0), {"joined": 1})

    @pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
    def test_an_open_seam_is_closed_within_the_tolerance(self, scale: float) -> None:
        lid = np.add(CUBE.vertices[4:], (0.0, 0.0, 1e-3))
        points, faces = np.vstack([CUBE.vertices, lid]), [CUBE.faces[0], (8, 9, 10, 11)]
        faces += list(CUBE.faces[2:])
        block = solid("b", scale * points, faces)
        assert kinds(block) == {"welded": 4}
        with pytest.raises(GeometryError, match="'b' is not closed"):
            solid("b", scale * points, faces, tolerance=1e-4 * scale)

    def test_warped_faces_are_cut_beyond_the_tolerance_only(self) -> None:
        points = CUBE.vertices.copy()
        points[6, 2] = 1.05
        assert kinds(solid("b", points, CUBE.faces)) == {"split": 1}
        assert kinds(solid("b", points, CUBE.faces, tolerance=0.02)) == {}

    def test_they_survive_copies(self) -> None:
        block = solid("b", CUBE.vertices, [f[::-1] for f in CUBE.faces])
        assert pickle.loads(pickle.dumps(block)).repairs == block.repairs
        assert block.moved(np.eye(3), (1, 2, 3)).scaled(2.0).repairs == block.repairs


def _moved(row: int, to: tuple[float, float, float]) -> np.ndarray:
    points = CUBE.vertices.copy()
    points[row] = to
    return points


def _torn_ring() -> tuple[np.ndarray, list[tuple[int, ...]]]:
    points, faces = ring()
    return points, faces[:-1]


def _klein() -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """A Klein bottle's grid: closed, every edge with two faces, one side only."""
    n = 5
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(n) * 2 * np.pi / n, indexing="ij")
    r = 3 + np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v)
    points = np.stack([r * np.cos(u), r * np.sin(u), np.sin(u / 2) * np.sin(v)
                       + np.cos(u / 2) * np.sin(2 * v)], axis=-1).reshape(-1, 3)  # fmt: skip
    faces = []
    for i in range(n):
        for k in range(n):
            a, b = i * n + k, i * n + (k + 1) % n
            if i + 1 < n:
                c, d = a + n, b + n
            else:
                c, d = (n - k) % n, (n - k - 1) % n
            faces += [(a, c, b), (b, c, d)]
    return points, faces


class TestTouchingItself:
    """Closed solids with edges of four faces, or vertices at which several parts meet, are blocks:
    cells are counted against integrals and against booleans."""

    @pytest.mark.parametrize("turned", ["none", "all", "some"])
    @pytest.mark.parametrize("seed", mostly_slow(range(12), range(6)))
    def test_cells(self, seed: int, turned: str) -> None:
        rng = np.random.default_rng(seed)
        label, _ = ndimage.label(rng.random((3, 3, 3)) < 0.5, np.ones((3, 3, 3)))
        places = np.argwhere(label == 1)
        points, faces = cells(places.tolist())
        share = {"none": 0.0, "all": 1.0, "some": 0.5}[turned]
        faces = [face[::-1] if rng.random() < share else face for face in faces]
        for make in (Block.polyhedron, solid):
            block = make("b", points, faces)
            assert block.volume == pytest.approx(len(places), rel=1e-12)
            np.testing.assert_allclose(block.centroid, places.mean(axis=0) + 0.5)
            inside = Body.of(block, np.zeros(3)).manifold
            assert inside.volume() == pytest.approx(len(places), rel=1e-12)
        again = Block.polyhedron("b", block.vertices, block.faces)
        assert again.faces == block.faces

    @pytest.mark.parametrize("shift", [(1, 0, 1), (1, 1, 1)], ids=["edge", "vertex"])
    def test_two_cubes_as_one_stone(self, shift: tuple[int, int, int]) -> None:
        """Only an edge, or a vertex, holds it together: one rigid block, and it may be stood on."""
        stone = Block.polyhedron("stone", *cells([(0, 0, 0), shift]), density=1.0)
        under = Block.box("under", (1, *shift[1:2], 0), (2, 1 + shift[1], 1), density=1.0)
        ground = Block.box("ground", (-1, -1, -1), (4, 4, 0))
        scene = Scene(
            [ground, stone, under], ["ground"], Load(acceleration=(1, 0, 0)), friction=0.4
        )
        assert {"ground-stone", "ground-under", "stone-under"} <= {*scene.contacts.names}
        assert solve(scene).load_factor == pytest.approx(0.4, rel=1e-6)
        sunk = Block.box("sunk", (1.5, shift[1] + 0.5, 1.5), (3, 3, 3), density=1.0)
        with pytest.raises(GeometryError, match=r"'stone' and 'sunk' interpenetrate by about 0\.5"):
            _ = Scene([ground, stone, under, sunk], ["ground"], scene.live).contacts

    def test_a_hollow_that_touches_the_outside_along_an_edge(self) -> None:
        """Eight cells of a 3 x 3 ring closed by lids, but for one: its hollow meets the notch."""
        hollow = {(1, 1, 1), (0, 0, 1)}
        every = [p for p in np.ndindex(3, 3, 3) if p not in hollow]
        block = Block.polyhedron("b", *cells(every))
        assert block.volume == pytest.approx(25.0)

    def test_leaves_without_volume_are_no_part_of_a_block(self) -> None:
        points = np.vstack([CUBE.vertices, [(2, 2, 2)]])
        with pytest.raises(GeometryError, match=r"lie on each other near .* remove them"):
            Block.polyhedron("fin", points, [*CUBE.faces, (1, 6, 8), (1, 8, 6)])


TWO_CUBES = np.vstack([CUBE.vertices, np.add(CUBE.vertices, (3, 0, 0))])
SPIKE = [*CUBE.faces[:1], *CUBE.faces[2:], (4, 5, 8), (5, 6, 8), (6, 7, 8), (7, 4, 8)]

BROKEN = {
    "open": (CUBE.vertices, CUBE.faces[:5], r"not closed.*no face on its other side"),
    "torn ring": (*_torn_ring(), r"not closed: the edge .* from \(.*\) to \(.*\)"),
    "a fin": (
        np.vstack([CUBE.vertices, [(2, 2, 2)]]), [*CUBE.faces, (1, 6, 8), (1, 8, 6)],
        r"not closed",
    ),
    "three faces at an edge": (
        np.vstack([CUBE.vertices, [(0.5, -1, 0.5)]]), [*CUBE.faces, (0, 1, 8), (0, 8, 1, 5)],
        r"not closed",
    ),
    "two bodies": (
        TWO_CUBES, [*CUBE.faces, *(tuple(i + 8 for i in f) for f in CUBE.faces)],
        r"consists of 2 separate bodies",
    ),
    "one-sided": (*_klein(), r"one side only"),
    "flat": (CUBE.vertices * (1, 1, 0), CUBE.faces, r"'bad' (is degenerate|has)"),
    "a folded sheet": (
        [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)],
        r"degenerate: its volume is",
    ),
    "NaN": (_moved(3, (0, np.nan, 0)), CUBE.faces, r"vertex 3 of block 'bad' must be finite"),
    "infinite": (_moved(3, (0, np.inf, 0)), CUBE.faces, r"vertex 3 of block 'bad' must be finite"),
    "a needle": (CUBE.vertices[[0, 0, 0, 0, 4, 4, 4, 4]], CUBE.faces, r"degenerate"),
    "a bow-tie": (CUBE.vertices, [(0, 2, 3, 1), *CUBE.faces[1:]], r"'bad'"),
    "a spike through the floor": (
        np.vstack([CUBE.vertices, [(0.5, 0.5, -1.0)]]), SPIKE,
        r"cuts itself near \(.*\): two of its faces cross",
    ),
    "an unknown vertex": (CUBE.vertices, [*CUBE.faces[:5], (1, 2, 6, 77)], r"names vertex 77"),
    "no vertices": (np.empty((0, 3)), [], r"needs at least four vertices"),
    "text": (["a", "b"], CUBE.faces, r"must be a list of \[x, y, z\]"),
    "too few faces": (CUBE.vertices, CUBE.faces[:2], r"needs at least four faces"),
}  # fmt: skip


@pytest.mark.parametrize(("points", "faces", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_what_cannot_be_mended_is_refused_by_name(
    points: np.ndarray, faces: list[tuple[int, ...]], message: str
) -> None:
    for make in (solid, Block.polyhedron):
        with pytest.raises(InputError, match="'bad'") as refusal:
            make("bad", points, faces)
        assert "\n" not in str(refusal.value)
    with pytest.raises(InputError, match=message):
        solid("bad", points, faces)


@pytest.mark.parametrize("name", ["open", "three faces at an edge", "a spike through the floor"])
def test_refusals_carry_the_place(name: str) -> None:
    points, faces, _ = BROKEN[name]
    with pytest.raises(GeometryError) as refusal:
        solid("bad", points, faces)
    error = refusal.value
    assert error.blocks == ("bad",)
    assert error.points.shape[1] == 3
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    assert ((error.points >= low - 1e-9) & (error.points <= high + 1e-9)).all()
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_winding_numbers() -> None:
    corners = CUBE.vertices[triangulated(CUBE.vertices, CUBE.faces)[0]]
    assert winding(np.array([0.3, 0.6, 0.2]), corners) == pytest.approx(1.0)
    assert winding(np.array([1.3, 0.6, 0.2]), corners) == pytest.approx(0.0, abs=1e-12)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_triangles_of_any_face_have_its_area(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 9))
    angles = np.sort(rng.uniform(0, 2 * np.pi, count))
    if np.diff(angles, append=angles[0] + 2 * np.pi).max() > 3.0:
        return
    radii = rng.uniform(0.3, 1.0, count)
    outline = np.column_stack([radii * np.cos(angles), radii * np.sin(angles), np.zeros(count)])
    x, y = outline[:, 0], outline[:, 1]
    area = 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    corners, owner = triangulated(outline, [tuple(range(count))])
    spans = outline[corners[:, 1:]] - outline[corners[:, :1]]
    pieces = 0.5 * np.cross(spans[:, 0], spans[:, 1])[:, 2]
    assert (pieces > -1e-12).all()
    assert pieces.sum() == pytest.approx(area)
    assert (owner == 0).all()


def test_two_blocks_cut_a_warped_face_they_share_alike() -> None:
    face = np.array([(0, 0, 0), (1, 0, 0.2), (1, 1, 0), (0, 1, 0.2)])
    cuts = set()
    for shift in range(4):
        for order in (range(4), range(3, -1, -1)):
            loop = np.roll(list(order), shift)
            corners, _ = triangulated(face[loop], [(0, 1, 2, 3)])
            cuts.add(frozenset(frozenset(loop[t].tolist()) for t in corners))
    assert len(cuts) == 1
