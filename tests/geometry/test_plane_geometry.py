"""Hulls, clips and overlaps where points coincide nearly, against exact fractions and shapely."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
import shapely

from cvxlimit.geometry.polygons import (
    area_and_centroid,
    clipped,
    convex_hull,
    convex_overlap,
    distance_integral,
    effective_regions,
    mean_distance_on_segment,
)

LOST_BY_GEOS = [
    (1.299999, 9.621925478597858e-17), (0.49999890000000013, 3.7007352737816755e-17),
    (0.2999990000000001, 2.2204386477634832e-17), (0.299999, 0.8000001000000001),
    (-1.9984015553475839e-16, 1.8000001000000003), (-1.6653357581830614e-16, 1.5000011),
    (-1.6653357581830616e-16, 1.5000011000000002), (-8.881785307224277e-17, 0.8000001000000002),
    (0.29999900000000007, 0.8000001000000003), (0.2999989999999999, 1.8000001000000003),
    (-8.881785307224278e-17, 0.8000001000000005), (-5.551127335579053e-17, 0.5000011000000002),
    (0.299999, 0.8000001000000004), (-5.551127335579053e-17, 0.5000011),
    (-1.5407439555097887e-33, 0.0), (0.2999990000000001, 0.2999990000000002),
    (0.2999989999999999, 0.8000001000000001),
]  # fmt: skip
"""A plus on a ring, turned: GEOS 3.14 finds a hull of 0.72, which is 1.44."""


def exact_hull_area(points: np.ndarray) -> float:
    """Area of the convex hull in fractions: no rounding anywhere."""
    cloud = sorted({(Fraction(x), Fraction(y)) for x, y in points.tolist()})

    def chain(run: list[tuple[Fraction, Fraction]]) -> list[tuple[Fraction, Fraction]]:
        kept: list[tuple[Fraction, Fraction]] = []
        for p in run:
            while len(kept) > 1 and turn(kept[-2], kept[-1], p) <= 0:
                kept.pop()
            kept.append(p)
        return kept[:-1]

    def turn(a, b, c):
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    hull = chain(cloud) + chain(cloud[::-1])
    return float(sum(turn(hull[0], p, q) for p, q in pairwise(hull)) / 2)


def hostile_points(rng: np.random.Generator) -> np.ndarray:
    """Points of a coarse grid and near-duplicates, on lines, far off, of any size."""
    points = np.round(rng.random((int(rng.integers(3, 12)), 2)), int(rng.integers(1, 4)))
    if rng.random() < 0.3:
        points[:, 1] *= 10.0 ** rng.uniform(-9, 0)
    if rng.random() < 0.3:
        points = np.vstack([points, points[0] + rng.random((4, 1)) * rng.normal(size=2)])
    close = rng.normal(size=points.shape) * 10.0 ** rng.uniform(-17, -6)
    shift, scale = rng.choice([0.0, 1.0, 1e3, 1e6]), 10.0 ** rng.choice([-9, -4, 0, 3, 7])
    return (np.vstack([points, points + close]) + shift) * scale


def check_hulls(seed: int, count: int) -> None:
    """The area in fractions, every point inside, and corners that are points."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        points = hostile_points(rng)
        size = float(np.ptp(points, axis=0).max())
        hull = convex_hull(points)
        area = area_and_centroid(hull)[0] if len(hull) else 0.0
        # corners within 1e-9 of the size are dropped, along sides of up to 1.5 times it
        assert area == pytest.approx(exact_hull_area(points), abs=5e-9 * size**2, rel=0)
        if len(hull):
            ring = shapely.Polygon(hull / size)
            assert shapely.distance(ring, shapely.points(points / size)).max() <= 3e-9
            nearest = np.abs(hull[:, None] - points[None]).max(axis=2).min(axis=1)
            assert nearest.max() <= 1e-13 * size + 1e-15 * np.abs(points).max()


class TestHull:
    def test_points_that_geos_takes_wrongly(self) -> None:
        points = np.array(LOST_BY_GEOS)
        assert exact_hull_area(points) == pytest.approx(1.44, abs=1e-5)
        assert area_and_centroid(convex_hull(points))[0] == pytest.approx(exact_hull_area(points))

    def test_near_duplicates_collinear_points_far_away_and_of_any_size(self) -> None:
        check_hulls(0, 400)

    @pytest.mark.exhaustive
    def test_many_near_duplicates(self) -> None:
        check_hulls(1, 10_000)

    @pytest.mark.parametrize("points", [[[0, 0]] * 3, [[0, 0], [1, 1], [3, 3]], [[1e3, 0]] * 2])
    def test_points_on_a_line_have_no_hull(self, points: list[list[float]]) -> None:
        assert convex_hull(points).shape == (0, 2)

    def test_a_fine_circle_keeps_its_area(self) -> None:
        """A third of a million corners are each straight within the tolerance: not all may go."""
        angle = np.linspace(0.0, 2.0 * np.pi, 300_000, endpoint=False)
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        assert area_and_centroid(convex_hull(circle))[0] == pytest.approx(np.pi, rel=1e-8)


def hostile_pairs(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of convex polygons (count, 6, 2): corners on an ellipse, coarse, some on a common line;
    second ones share corners, sides and their directions with the first, nearly or exactly."""
    rng = np.random.default_rng(seed)

    def convex() -> np.ndarray:
        angle = np.sort(rng.random((count, 6)), axis=1) * 2.0 * np.pi
        angle = np.where(
            rng.random((count, 1)) < 0.5, np.round(angle * 4 / np.pi) / 4 * np.pi, angle
        )
        sides = np.stack([np.cos(angle), np.sin(angle)], axis=2)
        return sides * 10.0 ** rng.uniform(-3, 0, (count, 1, 2))

    first, second = convex(), convex()
    off = 10.0 ** rng.uniform(-17, -3, (count, 1, 1)) * rng.normal(size=(count, 6, 2))
    kind = rng.integers(0, 5, count)[:, None, None]
    row = np.arange(count)
    shared = first[row, rng.integers(0, 6, count)] - second[row, rng.integers(0, 6, count)]
    along = first[:, 1] - first[:, 0]
    slid = first + (along * np.round(rng.random((count, 1)), 1))[:, None]
    second = np.where(kind == 0, first, second)  # the same
    second = np.where(kind == 1, slid, second)  # on the same line
    second = np.where(kind >= 3, second + shared[:, None], second)  # a common corner
    nearly = (rng.random(count) < 0.6)[:, None, None] & (kind != 2)
    second = second + np.where(nearly, off[:, :1], 0.0)  # all corners alike: it stays convex
    shift = rng.choice([0.0, 1.0, 1e3], (count, 1, 1))
    return first + shift, second + shift


def check_overlaps(seed: int, count: int) -> None:
    """Areas as shapely has them, in whichever order it does better: it loses some of either."""
    first, second = hostile_pairs(seed, count)
    sizes = [np.ptp(p, axis=1).max(axis=1) for p in (first, second)]
    real = np.minimum(*sizes) > 1e-6 * np.maximum(*sizes)  # but for six corners in one place
    first, second, size = first[real], second[real], np.minimum(*sizes)[real]
    areas = np.array([area_and_centroid(p)[0] if len(p) else 0.0
                      for p in convex_overlap(first, second)])  # fmt: skip
    middle, unit = first[:, :1], size[:, None, None]
    a, b = (shapely.convex_hull(shapely.multipoints((p - middle) / unit)) for p in (first, second))
    left, off = np.arange(len(first)), np.empty(len(first))
    for one, other, grid in ((a, b, None), (b, a, None), (a, b, 1e-11)):
        found = shapely.area(shapely.intersection(one[left], other[left], grid_size=grid))
        off[left] = np.abs(found - areas[left] / size[left] ** 2)
        left = left[off[left] > 1e-8]
    assert len(left) == 0, (seed, left[:5].tolist(), off[left[:5]].tolist())


class TestOverlaps:
    def test_nearly_coincident_polygons(self) -> None:
        check_overlaps(0, 4_000)

    @pytest.mark.exhaustive
    @pytest.mark.parametrize("seed", range(1, 11))
    def test_a_million_of_them(self, seed: int) -> None:
        check_overlaps(seed, 100_000)

    def test_a_sliver_of_rounding_is_no_overlap(self) -> None:
        """Triangles between two sides at an angle of 1e-15, and specks of 1e-16."""
        square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        beside = np.array([[1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0 - 1e-15, 1.0]])
        speck = square + (1.0 - 2e-16)
        for other in (beside, speck):
            assert len(convex_overlap(square[None], other[None])[0]) == 0


class TestClipped:
    def test_the_two_parts_of_a_polygon_make_it_up(self) -> None:
        first, _ = hostile_pairs(3, 2_000)
        corners = convex_overlap(first, first)
        whole = np.array([area_and_centroid(p)[0] if len(p) else 0.0 for p in corners])
        rng = np.random.default_rng(4)
        normal = rng.normal(size=(len(first), 1, 2))
        middle = first[:, :1] + rng.random((len(first), 1, 1)) * (first[:, 3:4] - first[:, :1])
        height = ((first - middle) * normal).sum(axis=2)
        size = np.ptp(first, axis=1).max(axis=1)
        parts = np.zeros(len(first))
        for sign in (1.0, -1.0):
            found, count = clipped(first, np.full(len(first), 6), sign * height)
            parts += [abs(area_and_centroid(p[:n])[0]) if len(np.unique(p[:n], axis=0)) > 2 else 0.0
                      for p, n in zip(found, count, strict=True)]  # fmt: skip
        np.testing.assert_allclose(parts, whole, atol=1e-8 * float(size.max()) ** 2)

    def test_in_space(self) -> None:
        triangle = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]])
        found, count = clipped(triangle, np.array([3]), 0.5 - triangle[:, :, 2])
        assert found[0, : count[0]].tolist() == [[0, 0, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]]


class TestIntegrals:
    def test_distance_along_a_line_by_quadrature(self) -> None:
        s = np.linspace(0.0, 2.0, 200_001)
        for height in (0.0, 0.3, -1.7):
            brute = np.trapezoid(np.hypot(height, s), s)
            found = distance_integral(np.array(height), np.array(2.0))
            assert float(found) == pytest.approx(brute, rel=1e-9)

    def test_segments_of_any_length(self) -> None:
        """Short ones too, where the difference of two integrals has no digits."""
        rng = np.random.default_rng(2)
        start = rng.normal(size=(500, 2))
        end = start + rng.normal(size=(500, 2)) * 10.0 ** rng.uniform(-9, 1, (500, 1))
        share, weight = np.polynomial.legendre.leggauss(200)
        along = start[:, None] + 0.5 * (share[:, None] + 1.0) * (end - start)[:, None]
        brute = np.linalg.norm(along, axis=2) @ weight / 2.0
        np.testing.assert_allclose(mean_distance_on_segment(start, end), brute, rtol=1e-5)

    def test_effective_regions_as_shapely(self) -> None:
        """Also for pressure centres on the rim, in a corner and next to it."""
        rng = np.random.default_rng(6)
        for _ in range(100):
            corners = convex_hull(rng.normal(size=(7, 2)))
            weights = rng.dirichlet(np.full(len(corners), 0.2), 20)
            centres = np.vstack([weights @ corners, corners, 0.5 * (corners[:2] + corners[1:3])])
            whole = shapely.Polygon(corners)
            for centre, region in zip(centres, effective_regions(corners, centres), strict=True):
                mirrored = shapely.Polygon(2.0 * centre - corners)
                area = area_and_centroid(region)[0] if len(region) > 2 else 0.0
                expected = shapely.intersection(whole, mirrored, grid_size=1e-12).area
                assert area == pytest.approx(expected, abs=1e-9)
                assert len(region) > 0
                assert shapely.distance(whole, shapely.points(region)).max() <= 1e-9
