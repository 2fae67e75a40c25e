"""Bricks on blocks of other shapes, and one scene elsewhere: the same contacts, and the truth."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import shapely
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation
from shapely.affinity import affine_transform

from cvxlimit import Block, Load, Scene, solve
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.solids import solid
from placements import (
    OUTLINES,
    assert_same_contacts,
    common_parts,
    detect_contacts,
    mean_distance_of,
    plan,
    prism,
    shaped,
)

L_PLAN = plan("L")


def placements() -> list[tuple[np.ndarray, np.ndarray]]:
    """Low and high corners (2,) of bricks of 1.2 x 0.6 on a grid of 0.1 that lie on the L."""
    found = []
    for x, y in product(range(-11, 20), range(-5, 20)):
        low, high = np.array([x, y]) / 10, np.array([x + 12, y + 6]) / 10
        if (L_PLAN & shapely.box(*low, *high)).area > 0.05:
            found.append((low, high))
    return found


def check_bricks(step: int) -> None:
    """Hull, area and arm of every so many placements as shapely has them."""
    below = shaped("L")
    chosen = placements()[::step]
    assert len(chosen) > 500 / step
    for low, high in chosen:
        contacts = detect_contacts([below, Block.box("b", (*low, 0.0), (*high, 0.5))])
        region = common_parts(L_PLAN, shapely.box(*low, *high))
        hull = shapely.Polygon(contacts.corners_of(0)).area
        assert hull == pytest.approx(region.convex_hull.area), (low, high)
        assert contacts.area[0] == pytest.approx(region.area)
        assert contacts.torsion_arm[0] == pytest.approx(mean_distance_of(region))


def test_bricks_on_an_l_shaped_block() -> None:
    check_bricks(5)


@pytest.mark.exhaustive
def test_every_brick_on_an_l_shaped_block() -> None:
    check_bricks(1)


def rigid_brick_factor(low: np.ndarray, high: np.ndarray, push: float, friction: float) -> float:
    """A brick of height 1 on the L, pushed along x: a linear programme over one force of N and V at
    each corner of shapely's hull, independent of the package."""
    corners = shapely.get_coordinates((L_PLAN & shapely.box(*low, *high)).convex_hull)[:-1]
    middle = 0.5 * (low + high)
    k = len(corners)
    spokes = corners - middle
    # columns: N at corners, V at corners (along x), load factor; weight 1
    equal = np.zeros((4, 2 * k + 1))
    equal[0, :k] = 1.0  # vertical
    equal[1, k:-1], equal[1, -1] = 1.0, push  # along x
    equal[2, :k] = spokes[:, 1]  # about x
    equal[3, :k] = spokes[:, 0]  # about y: V acts 0.5 below the centroid
    equal[3, k:-1] = 0.5
    bounds = np.hstack([-friction * np.eye(k), np.eye(k), np.zeros((k, 1))])
    mirrored = np.hstack([-friction * np.eye(k), -np.eye(k), np.zeros((k, 1))])
    found = linprog(
        np.append(np.zeros(2 * k), -1.0), np.vstack([bounds, mirrored]), np.zeros(2 * k), equal,
        [1.0, 0.0, 0.0, 0.0], [(0.0, None)] * k + [(None, None)] * k + [(0.0, None)],
    )  # fmt: skip
    return float(found.x[-1])


@pytest.mark.parametrize(
    ("low", "high", "push"), [((0.0, 0.3), (1.2, 0.9), 1.0), ((1.4, 0.1), (2.6, 0.7), -1.0)]
)
def test_bricks_whose_hull_lost_corners(low, high, push) -> None:
    """[0.2400, 0.2400] was "proved" for the first, and that the second cannot stand; shifted by
    (1, 1) both gave the truth, which is sliding at the friction of 0.6."""
    truth = rigid_brick_factor(np.array(low), np.array(high), push, 0.6)
    assert truth == pytest.approx(0.6)
    for shift in ((0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (-3e3, 2e3, 1e3)):
        blocks = [shaped("L"), Block.box("b", (*low, 0.0), (*high, 1.0), 20.0)]
        moved = [block.moved(np.eye(3), shift) for block in blocks]
        live = Load(acceleration=(push, 0.0, 0.0))
        scene = Scene(moved, supports=["below"], live=live, friction=0.6)
        solution = solve(scene)
        assert solution.lower == pytest.approx(truth, rel=1e-5)
        assert solution.upper == pytest.approx(truth, rel=1e-5)


NEARLY = (0.0, 1e-12, -1e-12, 1e-11, 1e-8, -1e-8, 1e-7, 1e-6, -1e-6)
"""How much corners miss each other by; from 1e-11 on it counts as nothing."""


def bearing(shared: shapely.MultiPolygon, tolerance: float) -> shapely.MultiPolygon:
    """The parts wider than the joint tolerance: the others touch by chance, and do not count."""
    parts = shapely.get_parts(shared)
    return shapely.MultiPolygon(
        list(parts[2 * shapely.area(parts) > tolerance * shapely.length(parts)])
    )


def hostile_pair(seed: int) -> tuple[list[Block], shapely.MultiPolygon]:
    """A block of one plan on one of another, corners coinciding nearly, and what they share."""
    rng = np.random.default_rng(seed)
    while True:
        names = list(OUTLINES)
        below, above = (names[i] for i in rng.integers(0, 5, 2))
        off = rng.choice(NEARLY, 4)
        low = rng.integers(-10, 28, 2) / 10
        if rng.random() < 0.6:
            high = low + rng.integers(2, 32, 2) / 10 + off[2:]
            outline = shapely.box(*(low + off[:2]), *high)
            block = Block.box("b", (*(low + off[:2]), 0.0), (*high, 1.0), 20.0)
        else:
            turn = Rotation.from_euler("z", 90 * int(rng.integers(4)), degrees=True).as_matrix()
            block = shaped(above, "b").moved(turn, (*(low + off[:2]), 1.0))
            (a, b), (c, d) = turn[:2, :2]
            outline = affine_transform(plan(above), [a, b, c, d, *(low + off[:2])])
        plain = shapely.transform(outline, lambda x: np.round(x, 9))  # what is nothing goes
        shared = common_parts(plan(below), plain)
        if shared.area > 1e-3:
            return [shaped(below), block], bearing(shared, block.joint_tolerance)


def check_hostile_pair(seed: int) -> None:
    blocks, shared = hostile_pair(seed)
    contacts = detect_contacts(blocks)
    assert len(contacts) == 1
    hull = shapely.Polygon(contacts.corners_of(0)).area
    # a corner off by 1e-9 moves a hull's side of 4 at most
    assert hull == pytest.approx(shared.convex_hull.area, abs=1e-8)
    assert contacts.area[0] == pytest.approx(shared.area, abs=1e-8)
    assert contacts.torsion_arm[0] == pytest.approx(mean_distance_of(shared), abs=1e-8)


class TestHostileShapes:
    @pytest.mark.parametrize("seed", range(40))
    def test_plans_on_plans(self, seed: int) -> None:
        check_hostile_pair(seed)

    @pytest.mark.parametrize("seed", range(0, 40, 4))
    def test_plans_on_plans_elsewhere(self, seed: int) -> None:
        assert_same_contacts(hostile_pair(seed)[0])

    @pytest.mark.exhaustive
    def test_thousands_of_plans_on_plans(self) -> None:
        for seed in range(1_000, 3_000):
            check_hostile_pair(seed)
            if seed % 10 == 0:
                assert_same_contacts(hostile_pair(seed)[0])

    def test_a_plus_on_a_ring_off_by_a_millionth_turned(self) -> None:
        """GEOS on coordinates as they are loses a third of this hull in one direction."""
        turn = Rotation.from_euler("z", -90, degrees=True).as_matrix()
        above = shaped("plus", "b").moved(turn, (-1.700001, 1.8000001, 1.0))
        assert_same_contacts([shaped("ring"), above])

    def test_a_brick_between_two_legs_does_not_reach_the_second_by_rounding(self) -> None:
        """Its end and the leg's side coincide: in whatever direction, no sliver makes a part."""
        brick = Block.box("b", (0.2, 1.2, 0.0), (2.0, 1.8, 1.0), 20.0)
        contacts = assert_same_contacts([shaped("U"), brick])
        assert contacts.area[0] == pytest.approx(0.8 * 0.6)
        assert shapely.Polygon(contacts.corners_of(0)).area == pytest.approx(0.8 * 0.6)

    def test_two_shapes_with_faces_of_the_same_names(self) -> None:
        """The facets of a U tried on a T have no area together: no warning, and no facet."""
        far = shaped("T", "t").moved(np.eye(3), (10.0, 0.0, 0.0))
        bricks = [Block.box(f"b{x}", (x, 0.1, 0.0), (x + 1, 0.9, 1.0)) for x in (1, 11)]
        assert detect_contacts([shaped("U"), *bricks, far]).area.round(9).tolist() == [0.8, 0.8]

    @pytest.mark.parametrize("eps", [1e-13, 1e-10, 1e-8, 1e-7])
    def test_blocks_with_corners_nearly_in_one_place(self, eps: float) -> None:
        """Corners next to corners, in the middle of sides and off them by as little."""
        outline = []
        for (x, y), (u, v) in zip(
            OUTLINES["L"], OUTLINES["L"][1:] + OUTLINES["L"][:1], strict=True
        ):
            a, b = np.array([x, y], dtype=float), np.array([u, v], dtype=float)
            out = np.array([v - y, x - u]) * eps
            outline += [a, a + eps * (b - a), 0.5 * (a + b) + out, b - 0.4 * eps * (b - a)]
        brick = Block.box("b", (0.5, -0.3, 0.0), (1.7, 1.6, 1.0), 20.0)
        shared = common_parts(L_PLAN, shapely.box(0.5, -0.3, 1.7, 1.6))
        n = len(outline)
        vertices = [(x, y, z) for z in (-1.0, 0.0) for x, y in outline]
        faces = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
        faces += [tuple(range(n))[::-1], tuple(range(n, 2 * n))]
        mended = solid("a", vertices, faces, 20.0)
        below = [mended] if eps < 1e-11 else [mended, prism("a", outline, -1.0, 0.0)]
        for block in below:
            contacts = assert_same_contacts([block, brick])
            hull = shapely.Polygon(contacts.corners_of(0)).area
            assert hull == pytest.approx(shared.convex_hull.area, abs=1e-8 + 10 * eps)
            assert contacts.area[0] == pytest.approx(shared.area, abs=1e-8 + 10 * eps)

    def test_faces_too_small_to_have_a_direction_are_refused(self) -> None:
        outline = [(0, 0), (1, 0), (1, 1e-13), (1, 1), (0, 1), (0, 0.5)]
        with pytest.raises(GeometryError, match="degenerate: its area is"):
            prism("a", outline, -1.0, 0.0)


def test_a_hull_that_leaves_out_a_corner_is_refused() -> None:
    """Whoever made the contacts: every proof starts from the hull, so that none would see it."""
    brick = Block.box("b", (0.5, -0.3, 0.0), (1.7, 1.6, 1.0), 20.0)
    contacts = detect_contacts([shaped("L"), brick])
    kept = np.arange(len(contacts.corner_xy)) != 2
    with pytest.raises(
        GeometryError, match="'below-b': faces as rough as these leave it no outline"
    ):
        replace(
            contacts,
            corner_xy=contacts.corner_xy[kept],
            corner_start=np.array([0, len(contacts.corner_xy) - 1]),
        )
