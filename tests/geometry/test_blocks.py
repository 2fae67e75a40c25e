"""Blocks: volumes and centroids against closed forms, and every refusal."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, Delaunay
from scipy.spatial.transform import Rotation

from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.blocks import BOX_FACES, Block
from cvxlimit.geometry.polyhedra import JOINT_TOLERANCE

CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    dtype=float,
)
TETRAHEDRON = (
    [[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]],
    [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]],
)
WEDGE = (
    [[0, 0, 0], [3, 0, 0], [0, 0, 2], [0, 4, 0], [3, 4, 0], [0, 4, 2]],
    [[0, 1, 2], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [0, 2, 5, 3]],
)


def frustum(base: float, top: float, height: float) -> Block:
    ring = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2.0
    low = np.column_stack([base * ring, np.zeros(4)])
    high = np.column_stack([top * ring, np.full(4, height)])
    return Block.polyhedron("frustum", np.vstack([low, high]), BOX_FACES, density=1.0)


def rotation(seed: int) -> np.ndarray:
    return Rotation.from_quat(np.random.default_rng(seed).normal(size=4)).as_matrix()


class TestClosedForms:
    def test_tetrahedron(self) -> None:
        block = Block.polyhedron("t", *TETRAHEDRON)
        assert block.volume == pytest.approx(1.0)
        np.testing.assert_allclose(block.centroid, [0.25, 0.5, 0.75])

    def test_wedge(self) -> None:
        block = Block.polyhedron("w", *WEDGE)
        assert block.volume == pytest.approx(12.0)
        np.testing.assert_allclose(block.centroid, [1.0, 2.0, 2.0 / 3.0])

    @pytest.mark.parametrize(("a", "b", "h"), [(2.0, 1.0, 3.0), (1.0, 0.25, 0.5), (1.0, 1.0, 2.0)])
    def test_frustum(self, a: float, b: float, h: float) -> None:
        block = frustum(a, b, h)
        ring = a * a + a * b + b * b
        assert block.volume == pytest.approx(h * ring / 3.0)
        height = h * (a * a + 2 * a * b + 3 * b * b) / (4.0 * ring)
        np.testing.assert_allclose(block.centroid, [0, 0, height], atol=1e-15)

    def test_box(self) -> None:
        block = Block.box("b", (1, 2, 3), (2, 4, 6), density=2.5)
        assert (block.volume, block.weight) == (6.0, 15.0)
        assert block.size == pytest.approx(np.sqrt(14.0))
        np.testing.assert_allclose(block.centroid, [1.5, 3.0, 4.5])
        same = Block.polyhedron("b", block.vertices, block.faces)
        assert same.volume == pytest.approx(6.0)
        np.testing.assert_allclose(same.centroid, block.centroid)

    def test_no_density_no_weight(self) -> None:
        assert Block.box("ground", (0, 0, 0), (1, 1, 1)).weight == 0.0

    @pytest.mark.parametrize("seed", range(5))
    def test_rotated(self, seed: int) -> None:
        turn, shift = rotation(seed), np.array([1e3, -2e3, 5e2])
        block = Block.polyhedron("w", *WEDGE, density=2.0).moved(turn, shift)
        again = Block.polyhedron("w", block.vertices, block.faces, density=2.0)
        assert again.volume == pytest.approx(12.0, rel=1e-9)
        np.testing.assert_allclose(again.centroid, turn @ [1.0, 2.0, 2.0 / 3.0] + shift)
        np.testing.assert_allclose(block.centroid, again.centroid)

    @given(seed=st.integers(0, 10_000), points=st.integers(5, 25))
    def test_hull_of_random_points(self, seed: int, points: int) -> None:
        cloud = np.random.default_rng(seed).normal(size=(points, 3))
        block = Block.hull("h", cloud, inner="drop")
        corners = cloud[Delaunay(cloud).simplices]
        volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
        assert block.volume == pytest.approx(ConvexHull(cloud).volume)
        assert block.volume == pytest.approx(volumes.sum())
        centroid = (volumes[:, None] * corners.mean(axis=1)).sum(axis=0) / volumes.sum()
        np.testing.assert_allclose(block.centroid, centroid, atol=1e-9)


class TestFaces:
    def test_direction_of_travel_is_free(self) -> None:
        turned = [face if i % 2 else face[::-1] for i, face in enumerate(WEDGE[1])]
        block, other = Block.polyhedron("w", *WEDGE), Block.polyhedron("w", WEDGE[0], turned)
        assert block.volume == other.volume
        assert {frozenset(f) for f in block.faces} == {frozenset(f) for f in other.faces}

    @pytest.mark.parametrize(
        "block", [Block.box("b", (0, 0, 0), (1, 2, 3)), Block.polyhedron("w", *WEDGE)]
    )
    def test_normals_point_out(self, block: Block) -> None:
        for face in block.faces:
            corners = block.vertices[list(face)]
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
            assert normal @ (corners[0] - block.centroid) > 0.0

    @pytest.mark.parametrize("seed", range(10))
    def test_hull_merges_coplanar_triangles_and_drops_inner_points(self, seed: int) -> None:
        grid = np.array([[x, y, z] for x in (0, 0.5, 1) for y in (0, 0.5, 1) for z in (0, 0.5, 1)])
        block = Block.hull("h", grid @ rotation(seed).T, inner="drop")
        assert len(block.faces) == 6
        assert block.volume == pytest.approx(1.0)

    def test_points_on_the_hulls_edges_bound_no_notch(self) -> None:
        middles = [0.5 * (CUBE[i] + CUBE[k]) for f in BOX_FACES for i, k in pairwise(f)]
        block = Block.hull("h", np.vstack([CUBE, middles]))
        assert (len(block.vertices), block.volume) == (8, pytest.approx(1.0))

    def test_a_notch_is_filled_only_if_that_is_asked_for(self) -> None:
        outline = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
        points = [(x, y, z) for z in (0, 1) for x, y in outline]
        with pytest.raises(
            GeometryError, match=r"2 of 12 points of block 'L' .* \[1.0, 1.0, 0.0\]"
        ):
            Block.hull("L", points)
        assert Block.hull("L", points, inner="drop").volume == pytest.approx(3.5)
        sides = [(i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6)]
        whole = Block.polyhedron("L", points, [range(6), range(6, 12), *sides])
        assert whole.volume == pytest.approx(3.0)

    def test_hull_of_a_prism_has_its_polygons(self) -> None:
        angles = np.arange(6) * np.pi / 3.0
        ring = np.column_stack([np.cos(angles), np.sin(angles)])
        points = [[x, y, z] for z in (0.0, 2.0) for x, y in ring]
        block = Block.hull("hexagon", points)
        assert sorted(len(face) for face in block.faces) == [4] * 6 + [6] * 2
        assert block.volume == pytest.approx(3.0 * np.sqrt(3.0))

    def test_a_face_may_be_given_in_pieces(self) -> None:
        points = np.vstack([CUBE, [[0.5, 0, 1], [0.5, 1, 1]]])
        faces = [(0, 3, 2, 1), (4, 8, 9, 7), (8, 5, 6, 9), (0, 1, 5, 8, 4), (2, 3, 7, 9, 6),
                 (0, 4, 7, 3), (1, 2, 6, 5)]  # fmt: skip
        assert Block.polyhedron("split", points, faces).volume == pytest.approx(1.0)


class TestCopies:
    def test_arrays_are_read_only(self) -> None:
        block = Block.box("b", (0, 0, 0), (1, 1, 1))
        for array in (block.vertices, block.centroid, block.bounds):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 5.0

    def test_the_callers_array_is_left_alone(self) -> None:
        points = CUBE.copy()
        block = Block.polyhedron("b", points, BOX_FACES)
        points[0] = 7.0
        np.testing.assert_array_equal(block.vertices, CUBE)

    def test_scaled_changes_units(self) -> None:
        block = Block.polyhedron("w", *WEDGE, density=20.0)
        small = block.scaled(1e3, 1e-6)
        assert small.volume == pytest.approx(block.volume * 1e9)
        assert small.weight == pytest.approx(block.weight * 1e3)
        np.testing.assert_allclose(small.centroid, block.centroid * 1e3)

    def test_moved_box_is_no_longer_aligned(self) -> None:
        block = Block.box("b", (0, 0, 0), (1, 2, 3)).moved(rotation(0))
        assert block.bounds is None
        assert block.volume == 6.0

    def test_pickle(self) -> None:
        block = Block.polyhedron("w", *WEDGE, density=3.0)
        copy = pickle.loads(pickle.dumps(block))
        assert (copy.id, copy.faces, copy.weight) == (block.id, block.faces, block.weight)


def polyhedron(vertices: object, faces: object, **more: object) -> Callable[[], Block]:
    return lambda: Block.polyhedron("b7", vertices, faces, **more)


def box(low: object, high: object, **more: object) -> Callable[[], Block]:
    return lambda: Block.box("b7", low, high, **more)


def _changed(array: np.ndarray, row: int, value: list[float]) -> np.ndarray:
    copy = array.copy()
    copy[row] = value
    return copy


REFUSALS = {
    "box without length": (box((0, 0, 0), (1, 0, 1)), r"'b7' is degenerate.*length 0 along y"),
    "box upside down": (box((0, 0, 3), (1, 1, 1)), r"'b7' is degenerate.*length -2 along z"),
    "box NaN": (box((0, 0, np.nan), (1, 1, 1)), r"box min of block 'b7' must be finite.*nan"),
    "box infinite": (box((0, 0, 0), (1, np.inf, 1)), r"box max of block 'b7' must be finite.*inf"),
    "box of text": (box((0, 0, 0), "high"), r"box max of block 'b7' must be 3 numbers.*'high'"),
    "box corner of two": (box((0, 0), (1, 1, 1)), r"box min of block 'b7' must be 3 numbers"),
    "negative density": (box((0, 0, 0), (1, 1, 1), density=-2.0), r"density of block 'b7'.*-2"),
    "NaN density": (box((0, 0, 0), (1, 1, 1), density=np.nan), r"density of block 'b7'.*nan"),
    "text density": (box((0, 0, 0), (1, 1, 1), density="20"), r"density of block 'b7'.*'20'"),
    "empty id": (lambda: Block.box("", (0, 0, 0), (1, 1, 1)), r"non-empty text, got ''"),
    "number as id": (lambda: Block.box(3, (0, 0, 0), (1, 1, 1)), r"non-empty text, got 3"),
    "NaN vertex": (
        polyhedron(_changed(CUBE, 5, [1, np.nan, 1]), BOX_FACES),
        r"vertex 5 of block 'b7' must be finite.*nan",
    ),
    "ragged vertices": (polyhedron([[0, 0, 0], [1]], BOX_FACES), r"vertices of block 'b7'"),
    "three vertices": (polyhedron(CUBE[:3], BOX_FACES), r"'b7' needs at least four vertices"),
    "three faces": (polyhedron(CUBE, BOX_FACES[:3]), r"'b7' needs at least four faces, got 3"),
    "not closed": (polyhedron(CUBE, BOX_FACES[:5]), r"'b7' is not closed: the edge between"),
    "face twice": (polyhedron(CUBE, [*BOX_FACES, BOX_FACES[0]]), r"'b7' is not closed"),
    "unknown vertex": (
        polyhedron(CUBE, [*BOX_FACES[:5], (1, 2, 6, 9)]),
        r"face 5 of block 'b7' names vertex 9; there are 8",
    ),
    "fractional vertex": (
        polyhedron(CUBE, [*BOX_FACES[:5], (1, 2, 6, 5.5)]),
        r"face 5 of block 'b7' names vertex 5\.5",
    ),
    "face is a number": (polyhedron(CUBE, [*BOX_FACES[:5], 3]), r"face 5 of block 'b7'.*got 3"),
    "face of two": (
        polyhedron(CUBE, [*BOX_FACES[:5], (1, 2)]),
        r"face 5 of block 'b7' needs at least three different vertices, got \[1, 2\]",
    ),
    "vertex repeated": (
        polyhedron(CUBE, [*BOX_FACES[:5], (1, 2, 2, 5)]),
        r"face 5 of block 'b7' needs at least three different vertices",
    ),
    "not flat": (
        polyhedron(_changed(CUBE, 6, [1, 1, 1.1]), BOX_FACES),
        r"face 1 of block 'b7' is not flat: a vertex lies 0\.0",
    ),
    "crossed face": (
        polyhedron(CUBE, [(0, 2, 3, 1), *BOX_FACES[1:]]),
        r"face 0 of block 'b7'",
    ),
    "flat body": (
        polyhedron([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], TETRAHEDRON[1]),
        r"'b7' is degenerate: its volume is 0 for a size of 1\.41421",
    ),
    "unused vertex": (
        polyhedron([*CUBE, [0.5, 0.5, 0.5]], BOX_FACES),
        r"vertex 8 of block 'b7' belongs to no face",
    ),
    "hull of a plane": (
        lambda: Block.hull("b7", [[x, y, 0] for x in range(3) for y in range(3)]),
        r"'b7' is degenerate: its 9 points span no volume",
    ),
    "mirror": (lambda: cube().moved(np.diag([1, 1, -1])), r"must not mirror"),
    "shear": (lambda: cube().moved([[1, 1, 0], [0, 1, 0], [0, 0, 1]]), r"orthogonal 3 x 3"),
    "NaN rotation": (lambda: cube().moved(np.full((3, 3), np.nan)), r"orthogonal 3 x 3"),
    "translation": (lambda: cube().moved(np.eye(3), 5.0), r"translation must be 3 numbers, got 5"),
    "mirrored units": (lambda: cube().scaled(-1.0), r"scales must be positive, got -1"),
}  # fmt: skip


def cube() -> Block:
    return Block.box("b7", (0, 0, 0), (1, 1, 1))


@pytest.mark.parametrize(("make", "message"), REFUSALS.values(), ids=REFUSALS.keys())
def test_refusals_name_the_block_and_the_value(make: Callable[[], Block], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_flatness_is_judged_by_the_joint_tolerance(scale: float) -> None:
    """A corner lifted by h puts all four corners of its face h / 4 off their mean plane."""
    allowed = JOINT_TOLERANCE / 3.0
    slightly = _changed(CUBE, 6, [1, 1, 1 + 3.9 * allowed])
    clearly = _changed(CUBE, 6, [1, 1, 1 + 4.2 * allowed])
    block = Block.polyhedron("b", slightly * scale, BOX_FACES)
    assert block.volume == pytest.approx(scale**3 * (1.0 + 3.9 * allowed / 4.0))
    coarse = Block.polyhedron("b", clearly * scale, BOX_FACES, joint_tolerance=0.1 * scale)
    assert coarse.volume == pytest.approx(scale**3 * (1.0 + 4.2 * allowed / 4.0))
    with pytest.raises(GeometryError, match="face 1 of block 'b' is not flat"):
        Block.polyhedron("b", clearly * scale, BOX_FACES)


def test_a_dent_and_a_concave_outline_are_shapes_like_any_other() -> None:
    sides = [(4, 5, 8), (5, 6, 8), (6, 7, 8), (7, 4, 8)]
    dented = Block.polyhedron(
        "dented", [*CUBE, [0.5, 0.5, 0.5]], [*BOX_FACES[:1], *BOX_FACES[2:], *sides]
    )
    assert (dented.is_convex, dented.volume) == (False, pytest.approx(1.0 - 0.5 / 3.0))
    dart = [[0, 0], [2, 0], [0.5, 0.5], [0, 2]]
    kite = Block.polyhedron("dart", [[x, y, z] for z in (0, 1) for x, y in dart], BOX_FACES)
    assert (kite.is_convex, kite.volume) == (False, pytest.approx(1.0))
