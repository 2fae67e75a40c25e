"""Soil behind walls: Coulomb's coefficients, walls in closed form, water in the soil."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from cvxlimit import (
    Block,
    Load,
    Scene,
    coulomb_coefficient,
    coulomb_pressure,
    earth_pressure,
    hydrostatic,
    passive,
    solve,
)
from cvxlimit.errors import InputError
from cvxlimit.masonry import stack
from cvxlimit.scene.loads import GRAVITY
from helpers import assert_certified

BEHIND = (-1.0, 0.0, 0.0)


def wedge(phi: float, delta: float, beta: float, batter: float) -> float:
    """The largest push of all wedges of soil of unit weight behind a wall of height 1, times 2:
    weight, the wall's force at delta to its normal, and the soil's at phi to the plane of slip."""
    p, d, b, t = np.radians([phi, delta, beta, batter])

    def push(slip: float) -> float:
        # corners: heel (0, 0), top of the back (tan t, 1), where slip meets the soil's surface;
        # soil is on the left, so that x points away from the wall
        x = (1.0 + np.tan(t) * np.tan(b)) / (np.tan(slip) - np.tan(b))
        corners = np.array([[0.0, 0.0], [x, x * np.tan(slip)], [-np.tan(t), 1.0]])
        (x1, y1), (x2, y2) = corners[1:]
        weight = 0.5 * abs(x1 * y2 - x2 * y1)
        # forces on the wedge, in the directions of the wall's and of the soil's
        wall = np.array([np.cos(d + t), np.sin(d + t)])
        soil = np.array([-np.sin(slip - p), np.cos(slip - p)])
        return float(np.linalg.solve(np.stack([wall, soil], axis=1), [0.0, weight])[0])

    ends = max(b, 0.0) + 1e-6, 0.5 * np.pi + min(p, t) - 1e-6
    found = minimize_scalar(
        lambda s: -push(s) if s > p else 0.0, bounds=ends, method="bounded", options={"xatol": 1e-9}
    )
    return -2.0 * found.fun


@pytest.mark.parametrize(
    "angles",
    [(30, 0, 0, 0), (30, 20, 0, 0), (35, 20, 15, 0), (33, 22, -10, 0), (32, 16, 10, 12),
     (32, 16, 10, -8), (40, 0, 0, 20)],
)  # fmt: skip
def test_coulombs_coefficient_is_the_worst_wedge(angles: tuple[float, ...]) -> None:
    assert coulomb_coefficient(*angles) == pytest.approx(wedge(*angles), rel=1e-6)


def test_rankines_coefficient() -> None:
    for phi in (20.0, 30.0, 40.0):
        rankine = np.tan(np.radians(45.0 - 0.5 * phi)) ** 2
        assert coulomb_coefficient(phi) == pytest.approx(rankine, rel=1e-12)


def prism(batter: float, height: float = 2.0) -> Block:
    """A stone with an upright face and a back, at x = 0 on the ground, that leans by the batter."""
    top = height * np.tan(np.radians(batter))
    outline = np.array([(0.0, 0.0), (1.2, 0.0), (1.2, height), (top, height)])
    corners = np.array([(x, y, z) for y in (0.0, 1.0) for x, z in outline])
    faces = [(0, 1, 2, 3), (7, 6, 5, 4), *((i, i + 4, (i + 1) % 4 + 4, (i + 1) % 4)
             for i in range(4))]  # fmt: skip
    return Block.polyhedron("wall", corners, faces, density=20.0)


def on_ground(*blocks: Block, friction: float) -> Scene:
    ground = Block.box("ground", (-2, 0, -1), (4, 1, 0))
    live = Load(acceleration=(1.0, 0.0, 0.0))
    return Scene([ground, *blocks], ["ground"], live, friction=friction)


@pytest.mark.parametrize("batter", [-8.0, 0.0, 12.0])
@pytest.mark.parametrize("friction", [0.4, 4.0])
def test_a_wall_with_coulombs_pressure(batter: float, friction: float) -> None:
    """P = K gamma H^2 / 2 at a third of the height, inclined by delta + batter to the horizontal:
    the wall slides at mu (W + Pv) = Ph, and turns over its toe at W a + Pv b = Ph H / 3."""
    phi, delta, beta, gamma, height = 32.0, 18.0, 8.0, 19.0, 2.0
    scene = on_ground(prism(batter), friction=friction)
    earth = coulomb_pressure(scene, height, gamma, BEHIND, phi=phi, delta=delta, beta=beta)
    push = 0.5 * gamma * height**2 * coulomb_coefficient(phi, delta, beta, batter)
    inclined = np.radians(delta + batter)
    level, down = push * np.cos(inclined), push * np.sin(inclined)
    forces = earth.on(scene.blocks)[1:].sum(axis=0)
    assert forces[[0, 2]] == pytest.approx([level, -down], rel=1e-9)
    weight, centroid = scene.total_weight, float(scene.blocks[1].centroid[0])
    at = height / 3.0 * np.tan(np.radians(batter))
    slides = friction * weight / (level - friction * down)
    turning = level * height / 3.0 - down * (1.2 - at)
    turns = weight * (1.2 - centroid) / turning if turning > 0.0 else np.inf
    found = solve(scene.with_live(earth))
    assert_certified(found)
    expected = min(slides if slides > 0.0 else np.inf, turns)
    assert found.load_factor == pytest.approx(expected, rel=1e-6)


def test_a_battered_wall_in_courses_is_pushed_as_a_whole() -> None:
    scene = stack(4, size=(1.0, 1.0, 0.5), density=20.0)
    whole = stack(1, size=(1.0, 1.0, 2.0), density=20.0)
    given = {"phi": 30.0, "delta": 15.0, "surcharge": 5.0}
    sums = [
        coulomb_pressure(each, 2.0, 18.0, BEHIND, **given).on(each.blocks).sum(axis=0)
        for each in (scene, whole)
    ]
    assert sums[0][:3] == pytest.approx(sums[1][:3], rel=1e-9)
    expected = coulomb_coefficient(30.0, 15.0) * (18.0 * 2.0 + 5.0 * 2.0)
    assert np.hypot(*sums[0][[0, 2]]) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("water", [0.0, 0.7, 2.0])
def test_soil_in_ground_water_weighs_less(water: float) -> None:
    """K (gamma H^2 - (gamma - gamma') w^2) / 2, and the water's own w^2 / 2 besides."""
    k, gamma, below = 0.3, 18.0, 10.0
    wall = stack(2, size=(1.0, 1.0, 1.0), density=22.0, friction=0.5)
    soil = earth_pressure(wall, 2.0, gamma, k, BEHIND, water=water, submerged=below)
    own = hydrostatic(wall, water, 9.81, BEHIND) if water else ()
    # one pressure on each stone, and two on that which the water's level crosses; none pulls
    assert len(soil) == 2 + (0.0 < water < 1.0)
    stones = {block.id: block for block in wall.blocks}
    assert min(each.extent(stones[each.block])[0] for each in soil) >= 0.0
    pushed = 0.5 * (k * (gamma * 4.0 - (gamma - below) * water**2) + 9.81 * water**2)
    found = solve(wall.with_live(Load(pressures=[*soil, *own])))
    assert_certified(found)
    turning = (k * (gamma * 8.0 - (gamma - below) * water**3) + 9.81 * water**3) / 6.0
    expected = min(0.5 * 44.0 / pushed, 44.0 * 0.5 / turning)
    assert found.load_factor == pytest.approx(expected, rel=1e-6)
    flat = coulomb_pressure(wall, 2.0, gamma, BEHIND, phi=30.0, water=water, submerged=below)
    rankine = earth_pressure(wall, 2.0, gamma, 1 / 3, BEHIND, water=water, submerged=below)
    one, other = (each.on(wall.blocks) for each in (flat, Load(pressures=rankine)))
    assert one == pytest.approx(other, rel=1e-9, abs=1e-9)


def test_earth_in_ground_water_on_a_stone_with_friction_on_its_back() -> None:
    """Above the water q + gamma z, below it gamma' more per depth: forces and moments, on a face
    that the level of the soil cuts as well."""
    wall, k = stack(1, size=(1.0, 2.0, 3.0)), coulomb_coefficient(30.0, 20.0)
    earth = coulomb_pressure(
        wall, 2.5, 18.0, BEHIND, phi=30.0, delta=20.0, surcharge=4.0, water=1.0, submerged=10.0
    )
    parts = [  # sizes and heights of two rectangles and two triangles of pressure, 2 m wide
        (4.0 * 1.5, 1.75), (18.0 * 1.5**2 / 2, 1.5),
        (31.0 * 1.0, 0.5), (10.0 * 1.0**2 / 2, 1 / 3),
    ]  # fmt: skip
    size, turning = (2.0 * k * sum(x) for x in zip(*((s, s * h) for s, h in parts), strict=True))
    level, down = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    force = earth.on(wall.blocks).sum(axis=0)
    assert force[[0, 2]] == pytest.approx([size * level, -size * down], rel=1e-9)
    # about the centroid, at a height of 1.5 m and 0.5 m from the back
    moment = level * (turning - 1.5 * size) - 0.5 * down * size
    assert force[4] == pytest.approx(moment, rel=1e-9)


def test_soil_before_the_toe_holds_the_wall() -> None:
    """It slides at mu W + K gamma d^2 / 2, resisting soil of depth d in front."""
    wall = stack(2, size=(1.0, 1.0, 1.0), density=20.0, friction=0.3)
    earth = Load(pressures=earth_pressure(wall, 2.0, 18.0, 0.3, BEHIND))
    held = replace(wall, reactions=passive(wall, 0.5, 18.0, 1.5, blocks=["b1"]))
    found = solve(held.with_live(earth))
    assert_certified(found)
    expected = (0.3 * 40.0 + 1.5 * 18.0 * 0.5**2 / 2.0) / (0.3 * 18.0 * 2.0)
    assert found.load_factor == pytest.approx(expected, rel=1e-6)


def test_the_load_may_be_dead() -> None:
    wall = stack(2, size=(1.0, 1.0, 1.0), density=20.0, friction=0.6)
    earth = coulomb_pressure(wall, 2.0, 18.0, BEHIND, phi=30.0, delta=20.0)
    dead = replace(GRAVITY, pressures=earth.pressures, points=earth.points)
    found = solve(wall.with_dead(dead))
    assert_certified(found)
    push = coulomb_coefficient(30.0, 20.0) * 36.0
    level, down = push * np.cos(np.radians(20.0)), push * np.sin(np.radians(20.0))
    turns = (40.0 * 0.5 + down * 1.0 - level * 2.0 / 3.0) / (40.0 * 1.0)
    assert found.load_factor == pytest.approx(min(turns, (0.6 * (40.0 + down) - level) / 40.0))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"phi": 0.0}, "0 < phi < 90"),
        ({"phi": 30.0, "delta": 31.0}, "delta from 0 to phi"),
        ({"phi": 30.0, "beta": 31.0}, "beta at most phi"),
        ({"phi": 30.0, "beta": 5.0, "surcharge": 2.0}, "needs a level surface"),
        ({"phi": 30.0, "water": 1.0}, "water and submerged go together"),
        ({"phi": 30.0, "water": 3.0, "submerged": 9.0}, "must not be above level"),
        ({"phi": 30.0, "water": 1.0, "submerged": 19.0}, "nor submerged 19"),
    ],
)
def test_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        coulomb_pressure(stack(1), 1.0, 18.0, BEHIND, **given)


def test_soil_that_reaches_nothing() -> None:
    with pytest.raises(InputError, match="is below all faces"):
        coulomb_pressure(stack(1), -1.0, 18.0, BEHIND, phi=30.0)
