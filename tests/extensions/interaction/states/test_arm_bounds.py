"""Bounds on the torsion arms of polygons over triangles of pressure centres.

The true arm is the mean distance over the polygon and its reflection about the pressure centre.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cvxlimit.extensions.interaction.states.cells import ArmBounds, capped
from cvxlimit.geometry.polygons import (
    convex_hull,
    torsion_arm,
)
from determinate import arm_at
from helpers import regular

FloatArray = NDArray[np.float64]

ROUNDING = 2e-9
"""Twice what is added to every bound, as a share of the size."""


def inside(polygon: FloatArray, rng: np.random.Generator, *shape: int) -> FloatArray:
    """Points (*shape, 2) of a convex polygon, many near its edges and corners."""
    return rng.dirichlet(np.full(len(polygon), 0.4), shape) @ polygon


def irregular(seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(int(rng.integers(3, 12)), 2)) * rng.uniform(0.05, 1.0, 2)
    return convex_hull(points)


def assert_above(polygon: FloatArray, triangle: FloatArray, rng: np.random.Generator) -> None:
    bound = ArmBounds(polygon).over(triangle[None])[0]
    for share in [*np.eye(3), *rng.dirichlet(np.full(3, 0.5), 12)]:
        assert arm_at(polygon, share @ triangle) <= share @ bound + 1e-12


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), size=st.sampled_from([1.0, 0.3, 0.05, 1e-3]))
def test_no_arm_in_a_triangle_exceeds_its_bound(seed: int, size: float) -> None:
    polygon, rng = irregular(seed), np.random.default_rng(seed)
    corners = inside(polygon, rng, 3)
    assert_above(polygon, corners[0] + size * (corners - corners[0]), rng)


@pytest.mark.parametrize("size", [1.0, 1e-4])
def test_kinks_are_no_holes(size: float) -> None:
    """A hexagon's opposite edges change places along its diagonals: across them arms bend."""
    polygon, rng = regular(6), np.random.default_rng(5)
    for _ in range(10):
        across = size * rng.uniform(-0.2, 0.2, (3, 2))
        assert_above(polygon, across, rng)


def test_rectangles_are_exact() -> None:
    """Between their kinks c is convex, so its values at the corners are the least bound."""
    half = np.array([0.4, 0.15])
    polygon = half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    triangle = half * [[0.0, 0.0], [1.0, 0.2], [0.3, 1.0]]
    exact = torsion_arm(*(2.0 * (half - triangle)).T)
    assert ArmBounds(polygon).over(triangle[None])[0] == pytest.approx(exact, abs=ROUNDING)


def test_pressed_within_rounding_of_an_edge() -> None:
    """One of two slabs is thinner than rounding: means over its side keep their digits."""
    polygon = regular(3)
    for inward in (0.0, 1e-17, 1e-16, 1e-13, 1e-10):
        e = (1.0 - inward) * (0.9 * polygon[0] + 0.1 * polygon[1])
        bound = ArmBounds(polygon).over(np.array([[e, e, e]]))[0]
        length = 0.2 * float(np.linalg.norm(polygon[1] - polygon[0]))
        assert bound == pytest.approx(length / 4.0, rel=1e-7)
        assert (bound >= length / 4.0 - 1e-10).all()


@pytest.mark.parametrize("corners", [3, 5, 6])
def test_corners_are_exact(corners: int) -> None:
    """Near a corner two edges alone bound the effective region."""
    polygon = regular(corners)
    ways = polygon[[1, -1]] - polygon[0]
    triangle = polygon[0] + 0.1 * np.vstack([np.zeros(2), ways])
    exact = [arm_at(polygon, e) for e in triangle]
    assert ArmBounds(polygon).over(triangle[None])[0] == pytest.approx(exact, abs=ROUNDING)


def excess(polygon: FloatArray, middle: FloatArray, size: float) -> float:
    """Of the bound over the arms at the corners of a triangle of some size."""
    triangle = middle + size * regular(3)
    bound = ArmBounds(polygon).over(triangle[None])[0]
    return float((bound - [arm_at(polygon, e) for e in triangle]).max())


@pytest.mark.parametrize(
    ("polygon", "middle"), [(regular(5), (0.05, 0.1)), (regular(7), (-0.1, 0.02))], ids=["5", "7"]
)
def test_the_error_falls_with_the_square_of_the_size(
    polygon: FloatArray, middle: tuple[float, float]
) -> None:
    at: Callable[[float], float] = lambda size: excess(polygon, np.array(middle), size)  # noqa: E731
    assert at(2e-2) > 1e-5
    assert at(1e-2) <= 0.35 * at(2e-2)
    assert at(5e-3) <= 0.35 * at(1e-2)


def test_bounds_cut_where_no_arm_is_larger() -> None:
    """Pieces of a triangle whose linear bound is cut at the largest arm cover it, each with the
    lesser of both everywhere, to rounding."""
    rng = np.random.default_rng(5)
    triangles = np.dstack([rng.normal(size=(40, 3, 2)), rng.uniform(0.0, 2.0, (40, 3))])
    shares = rng.dirichlet(np.ones(3), 50)
    for triangle in triangles:
        parts = capped(triangle[None], 1.0)
        points = shares @ triangle
        edges = np.ones((len(parts), 3, 3))
        edges[..., :2] = parts[..., :2]
        at = np.linalg.solve(edges.swapaxes(1, 2), np.append(points[:, :2], np.ones((50, 1)), 1).T)
        within = at.min(axis=1)  # the least barycentric coordinate (parts, points)
        assert within.max(axis=0).min() >= -1e-9
        bound = np.einsum("pkn,pk->pn", at, parts[..., 2])[within.argmax(axis=0), np.arange(50)]
        assert bound == pytest.approx(np.minimum(points[:, 2], 1.0), abs=1e-9)
