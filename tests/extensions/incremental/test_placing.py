"""Points of joints: area, second moments, corners, edges and the torsion arm."""

import numpy as np
import pytest

from cvxlimit.extensions.incremental.placing import merged, on_polygon, on_rectangle
from cvxlimit.geometry.polygons import area_and_centroid, convex_hull, mean_distance

RNG = np.random.default_rng(5)


def polygons() -> list[np.ndarray]:
    turned = [
        np.column_stack([np.cos(t), np.sin(t)])
        for n in (3, 4, 5, 6, 8, 12)
        for t in [2.0 * np.pi * np.arange(n) / n]
    ]
    hulls = [convex_hull(RNG.uniform(-1.0, 1.0, (8, 2)) * (3.0, 1.0)) for _ in range(12)]
    return turned + hulls


def second_moments(corners: np.ndarray) -> np.ndarray:
    """Of a polygon about its own axes, over its area: triangles about the origin by their middles
    of sides, a rule that is exact for squares."""
    total = np.zeros((2, 2))
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        area = (p[0] * q[1] - p[1] * q[0]) / 2.0
        for at in (p / 2.0, q / 2.0, (p + q) / 2.0):
            total += area / 3.0 * np.outer(at, at)
    return total / area_and_centroid(corners)[0]


@pytest.mark.parametrize("corners", polygons(), ids=lambda x: f"{len(x)} corners")
def test_polygons_are_exact_but_for_torsion(corners: np.ndarray) -> None:
    _, centre = area_and_centroid(corners)
    at, share = on_polygon(corners)
    assert (share > 0.0).all()
    assert share @ at == pytest.approx(centre, abs=1e-12)
    assert (share * at.T) @ at == pytest.approx(second_moments(corners), abs=1e-12)
    # corners are points
    gaps = np.linalg.norm(at[:, None] - corners, axis=2)
    assert gaps.min(axis=0).max() < 1e-9
    # c_T a little too large: 0 to 1.2 % (1.1 % is the most on rectangles of any ratio)
    mean = share @ np.hypot(*(at - centre).T)
    assert 0.0 <= mean / mean_distance(corners, centre) - 1.0 < 0.012


@pytest.mark.parametrize("ratio", [1.0, 1.3, 2.0, 5.0, 20.0, 1e3])
def test_rectangles_are_exact(ratio: float) -> None:
    sides = np.array([ratio, 1.0]) * 0.7
    at, share = on_rectangle(*sides)
    corners = sides / 2.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    assert share.min() > 0.0
    assert share.sum() == pytest.approx(1.0, abs=1e-14)
    assert share @ at**2 == pytest.approx(sides**2 / 12.0, rel=1e-12)
    assert share @ np.hypot(*at.T) == pytest.approx(mean_distance(corners, (0.0, 0.0)), rel=1e-9)


@pytest.mark.parametrize("ratio", [1.0, 2.0, 5.0])
def test_an_edge_carries_as_a_line_does_about_its_middle(ratio: float) -> None:
    """Points of one edge, by themselves: their mean square distance from its middle."""
    for at, share in (
        on_rectangle(ratio, 1.0),
        on_polygon(np.array([(0, 0), (ratio, 0), (ratio, 1), (0, 1)], dtype=float)),
    ):
        on_edge = at[:, 1] < at[:, 1].min() + 1e-9
        x, w = at[on_edge, 0] - at[on_edge, 0].mean(), share[on_edge]
        assert w @ x**2 / w.sum() == pytest.approx(ratio**2 / 12.0, rel=1e-12)


def test_equal_points_are_one() -> None:
    at, share = merged(np.array([[0.0], [1.0], [0.0]]), np.array([0.2, 0.5, 0.3]))
    assert at.ravel().tolist() == [0.0, 1.0]
    assert share.tolist() == [0.5, 0.5]
