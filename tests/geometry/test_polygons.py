"""Plane geometry of contacts against closed forms and brute-force integration."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.polygons import (
    area_and_centroid,
    convex_overlap,
    effective_regions,
    mean_distance,
    torsion_arm,
    torsion_arm_gradient,
)
from placements import detect_contacts


def mean_by_small_triangles(corners: np.ndarray, point: np.ndarray, n: int = 300) -> float:
    """Brute force: a fan of triangles, each cut into n2 equal ones, distances at their centres."""
    i, j = np.divmod(np.arange(n * n), n)
    upright = i + j < n
    weights = np.where(
        upright[:, None],
        np.column_stack([i + 1 / 3, j + 1 / 3]) / n,
        np.column_stack([n - i - 1 / 3, n - j - 1 / 3]) / n,
    )
    total = area = 0.0
    for k in range(1, len(corners) - 1):
        p, u, v = corners[0], corners[k] - corners[0], corners[k + 1] - corners[0]
        size = 0.5 * abs(u[0] * v[1] - u[1] * v[0])
        samples = p + weights @ np.stack([u, v])
        total += size * np.linalg.norm(samples - point, axis=1).mean()
        area += size
    return total / area


class TestOverlap:
    def test_polygons_that_only_touch_have_no_overlap(self) -> None:
        (corners,) = convex_overlap(
            np.array([[[0, 0], [1, 0], [1, 1], [0, 1]]], dtype=float),
            np.array([[[0.5, -1], [2, -1], [2, 2], [0.5, 2]]], dtype=float),
        )
        assert area_and_centroid(corners)[0] == pytest.approx(0.5)
        (apart,) = convex_overlap(
            np.array([[[0, 0], [1, 0], [1, 1], [0, 1]]], dtype=float),
            np.array([[[1, 0], [2, 0], [2, 1], [1, 1]]], dtype=float),
        )
        assert apart.shape == (0, 2)

    def test_nearly_parallel_edges_at_a_shared_corner(self) -> None:
        """One triangle, and the same with a corner moved by rounding."""
        first = np.array([[[0.0, 0.0], [0.496959373, 0.0], [0.49272334, 0.59813058]]])
        second = first.copy()
        second[0, 1] = first[0, 1] * (1.0 + 1e-16)
        for a, b in ((first, second), (second, first)):
            (overlap,) = convex_overlap(a, b)
            assert area_and_centroid(overlap)[0] == pytest.approx(area_and_centroid(first[0])[0])

    @given(seed=st.integers(0, 2**32 - 1))
    @example(seed=6234)  # a sliver of rounding whose area is exactly 0
    @example(
        seed=9561
    )  # in exact fractions 1e-16; GEOS says so in one order, and 1.23 in the other
    @settings(max_examples=200)
    def test_random_polygons_as_shapely(self, seed: int) -> None:
        """Areas by another library, in either order: GEOS is wrong in one of them at times."""
        rng = np.random.default_rng(seed)
        polygons = [random_polygon(rng) for _ in range(2)]
        if rng.random() < 0.5:  # share a corner and an edge's direction, with or without rounding
            polygons[1] += polygons[0][0] - polygons[1][0]
            polygons[1][-1] = polygons[1][0] + rng.random() * (polygons[0][-1] - polygons[0][0])
            polygons[1] = convex_hull(polygons[1])
        padded = [np.vstack([p, np.repeat(p[-1:], 12 - len(p), axis=0)])[None] for p in polygons]
        (overlap,), (swapped,) = convex_overlap(*padded), convex_overlap(*padded[::-1])
        areas = [abs(area_and_centroid(p)[0]) if len(p) else 0.0 for p in (overlap, swapped)]
        a, b = (shapely.Polygon(p) for p in polygons)
        size = max(abs(area_and_centroid(p)[0]) for p in polygons)
        assert areas[0] == pytest.approx(areas[1], abs=1e-9 * size)
        expected = min((a & b).area, (b & a).area, key=lambda area: abs(area - areas[0]))
        assert areas[0] == pytest.approx(expected, rel=1e-7, abs=1e-9 * size)

    def test_pairs_of_different_numbers_of_corners_at_once(self) -> None:
        triangle = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0]])
        pentagon = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 1.0]])
        far = pentagon + 5.0
        overlaps = convex_overlap(
            np.stack([triangle, pentagon, pentagon]), np.stack([pentagon, pentagon, far])
        )
        assert [len(corners) for corners in overlaps] == [3, 5, 0]
        assert area_and_centroid(overlaps[1])[0] == pytest.approx(0.875)


def random_polygon(rng: np.random.Generator) -> np.ndarray:
    return convex_hull(rng.normal(size=(int(rng.integers(3, 9)), 2)))


def convex_hull(points: np.ndarray) -> np.ndarray:
    """Counter-clockwise corners."""
    return points[ConvexHull(points).vertices]


class TestTorsionArm:
    @pytest.mark.parametrize("sides", [(1, 1), (1, 0.5), (0.3, 2), (1, 0.01), (1e-3, 1e-3)])
    def test_torsion_arm_by_brute_force(self, sides: tuple[float, float]) -> None:
        x, y = (side * ((np.arange(1000) + 0.5) / 1000 - 0.5) for side in sides)
        brute = np.hypot(x[:, None], y[None]).mean()
        assert torsion_arm(*sides) == pytest.approx(brute, rel=1e-5)

    def test_torsion_arm_published(self) -> None:
        published = [0.3825978582, 0.2966167080, 0.25]
        np.testing.assert_allclose(torsion_arm(1.0, [1.0, 0.5, 0.0]), published, atol=1e-10)
        assert torsion_arm(0.0, 0.0) == 0.0

    @given(st.floats(1e-9, 1e9), st.floats(1e-9, 1e9), st.floats(1e-3, 1e3))
    def test_torsion_arm_is_symmetric_homogeneous_and_between_its_bounds(
        self, a: float, b: float, k: float
    ) -> None:
        arm = float(torsion_arm(a, b))
        assert float(torsion_arm(b, a)) == arm
        assert float(torsion_arm(k * a, k * b)) == pytest.approx(k * arm)
        assert max(a, b) / 4.0 * (1 - 1e-12) <= arm <= (a + b) / 4.0 * (1 + 1e-12)

    @pytest.mark.parametrize("sides", [(1.0, 1.0), (1.0, 0.5), (0.02, 3.0)])
    def test_torsion_arm_gradient_is_the_slope(self, sides: tuple[float, float]) -> None:
        a, b = sides
        h = 1e-6 * min(a, b)
        slopes = (
            (torsion_arm(a + h, b) - torsion_arm(a - h, b)) / (2 * h),
            (torsion_arm(a, b + h) - torsion_arm(a, b - h)) / (2 * h),
        )
        np.testing.assert_allclose(torsion_arm_gradient(a, b), slopes, atol=1e-7)

    @settings(deadline=None, max_examples=20)
    @given(seed=st.integers(0, 10_000), sides=st.integers(3, 8), inside=st.booleans())
    def test_mean_distance_of_random_polygons(self, seed: int, sides: int, inside: bool) -> None:
        generator = np.random.default_rng(seed)
        angles = np.sort(generator.uniform(0, 2 * np.pi, sides))
        corners = np.column_stack([2.0 * np.cos(angles), np.sin(angles)]) + generator.normal(size=2)
        point = corners.mean(axis=0) if inside else generator.normal(size=2) * 5.0
        brute = mean_by_small_triangles(corners, point)
        assert mean_distance(corners, point) == pytest.approx(brute, rel=1e-4)

    def test_mean_distance_of_a_rectangle_is_the_torsion_arm(self) -> None:
        corners = np.array([[-1, -0.2], [1, -0.2], [1, 0.2], [-1, 0.2]])
        assert mean_distance(corners, (0, 0)) == pytest.approx(float(torsion_arm(2.0, 0.4)))

    @pytest.mark.parametrize("angle", [0.2, np.pi / 4])
    def test_torsion_arm_of_a_detected_octagon(self, angle: float) -> None:
        lower = Block.box("lower", (-0.5, -0.5, 0), (0.5, 0.5, 1))
        upper = Block.box("upper", (-0.5, -0.5, 1), (0.5, 0.5, 2))
        turned = upper.moved(Rotation.from_euler("z", angle).as_matrix())
        contacts = detect_contacts([lower, turned])
        brute = mean_by_small_triangles(contacts.corners_of(0), np.zeros(2))
        assert contacts.torsion_arm[0] == pytest.approx(brute, rel=1e-4)

    def test_mean_distance_of_degenerate_polygons(self) -> None:
        assert mean_distance([[-1, 0], [1, 0]], (0, 0)) == pytest.approx(0.5)
        assert mean_distance([[3, 4]], (0, 0)) == pytest.approx(5.0)
        assert mean_distance(np.empty((0, 2)), (0, 0)) == 0.0


class TestEffectiveRegion:
    @pytest.mark.parametrize("centre", [(0, 0), (0.3, 0), (-0.2, 0.15), (0.45, -0.2)])
    def test_effective_region_of_a_rectangle(self, centre: tuple[float, float]) -> None:
        corners = np.array([[-0.5, -0.25], [0.5, -0.25], [0.5, 0.25], [-0.5, 0.25]])
        region = effective_regions(corners, [centre])[0]
        area, middle = area_and_centroid(region)
        sides = np.array([1.0, 0.5]) - 2.0 * np.abs(centre)
        assert area == pytest.approx(sides.prod())
        np.testing.assert_allclose(middle, centre, atol=1e-12)
        np.testing.assert_allclose(np.ptp(region, axis=0), sides)

    def test_effective_region_at_the_rim_and_outside(self) -> None:
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
        assert len(effective_regions(square, [(0.5, 0.0)])[0]) == 2
        assert len(effective_regions(square, [(1.0, 1.0)])[0]) == 1
        assert len(effective_regions(square, [(1.5, 0.5)])[0]) == 0

    @given(seed=st.integers(0, 10_000))
    def test_effective_region_is_symmetric_about_the_pressure_centre(self, seed: int) -> None:
        generator = np.random.default_rng(seed)
        angles = np.sort(generator.uniform(0, 2 * np.pi, 6))
        corners = np.column_stack([np.cos(angles), np.sin(angles)])
        weights = generator.dirichlet(np.ones(6))
        centre = weights @ corners
        region = effective_regions(corners, [centre])[0]
        assert len(region) >= 3
        area, middle = area_and_centroid(region)
        assert 0.0 < area <= area_and_centroid(corners)[0] * (1 + 1e-9)
        np.testing.assert_allclose(middle, centre, atol=1e-7)
