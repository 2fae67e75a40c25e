"""Water, earth, fill, wheels and growing inertia: closed forms, and the same whatever the faces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cvxpy as cp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import cvxlimit
from cvxlimit import (
    Block,
    GrowingAcceleration,
    LimitProblem,
    Load,
    Pressure,
    Scene,
    Solution,
    Units,
    earth_pressure,
    fill,
    hydrostatic,
    pushover,
    solve,
    uplift,
    wheel,
)
from cvxlimit.base.arrays import FloatArray
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError, ModelError
from cvxlimit.masonry import arch, dam, retaining_wall
from cvxlimit.masonry.builtin import BUILTIN, builtin_scene
from exhaustive import mostly_slow
from helpers import assert_certified
from planar import planar_load_factor

BASE = Block.box("base", (-3, -1, -1), (5, 4, 0))
PUSH = Load(acceleration=(1, 0, 0))
LEFT = (-1.0, 0.0, 0.0)


def scene(*blocks: Block, friction: float = 0.8, live: Load = PUSH) -> Scene:
    return Scene((BASE, *blocks), ("base",), live, friction=friction)


def wall(courses: int = 4, wythes: int = 1, strips: int = 1, width: float = 0.8) -> Scene:
    """A wall of 0.8 x 3 x 2 m, in courses, in wythes through it, in strips along it."""
    x, y, z = (
        np.linspace(0, size, n + 1) for size, n in ((width, wythes), (3, strips), (2, courses))
    )
    blocks = [
        Block.box(f"c{k}-{i}-{j}", (x[i], y[j], z[k]), (x[i + 1], y[j + 1], z[k + 1]), 22.0)
        for k in range(courses) for i in range(wythes) for j in range(strips)
    ]  # fmt: skip
    return scene(*blocks)


def total(scene: Scene, load: Load) -> FloatArray:
    """Force and moment about the origin."""
    what = load.actions([scene.blocks[i] for i in scene.free])
    moments = what.moment + np.cross(what.at, what.force)
    return np.concatenate([what.force.sum(axis=0), moments.sum(axis=0)])


def factor(scene: Scene) -> Solution:
    solution = solve(scene)
    assert_certified(solution)
    return solution


# --- pressure that is linear in space -----------------------------------------------------------

NOTCHED = [(0, 0), (3, 0), (3, 2), (2, 2), (2, 0.5), (1, 0.5), (1, 2), (0, 2)]
"""A U, in x and z: neither convex, nor star-shaped about the mean of its corners."""


def prism(outline: list[tuple[float, float]]) -> Block:
    n = len(outline)
    vertices = [(x, y, z) for y in (0, 1) for x, z in outline]
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    return Block.polyhedron(
        "u", vertices, [tuple(range(n))[::-1], tuple(range(n, 2 * n)), *sides], 20
    )


@pytest.mark.parametrize("level", [0.25, 1.2, 2.0, 5.0])
@pytest.mark.parametrize("turned", [False, True])
def test_a_body_in_water_is_lifted_by_the_weight_of_what_it_displaces(
    level: float, turned: bool
) -> None:
    """Archimedes, for a body that is not convex, cut at the water's level at any height: pressure
    on all its faces is a force upwards through the centroid of what is under water."""
    body = prism(NOTCHED)
    turn = (
        Rotation.from_euler("xyz", (20, 30, 40), degrees=True).as_matrix() if turned else np.eye(3)
    )
    up = turn[:, 2]
    water = Load(
        pressures=[
            Pressure("u", n, 0.0, -10 * up, at=level * up, within=-up,
                     corners=[turn @ body.vertices[i] for i in face])
            for face, n in ((f, turn @ normal(body, f)) for f in body.faces)
        ]
    )  # fmt: skip
    body = body.moved(turn)
    # Under water: the slab below the notch, and both legs above it.
    slab, legs = 3 * min(level, 0.5), 2 * max(min(level, 2.0) - 0.5, 0.0)
    z = (slab * min(level, 0.5) / 2 + legs * (0.5 + legs / 4)) / (slab + legs)
    force = 10 * (slab + legs) * up
    what = water.actions([body])
    moment = (what.moment + np.cross(what.at, what.force)).sum(axis=0)
    np.testing.assert_allclose(what.force.sum(axis=0), force, atol=1e-12)
    np.testing.assert_allclose(moment, np.cross(turn @ (1.5, 0.5, z), force), atol=1e-12)


def normal(body: Block, face: tuple[int, ...]) -> FloatArray:
    a = body.vertices[list(face)]
    area = 0.5 * np.cross(a, np.roll(a, -1, axis=0)).sum(axis=0)
    return area / float(np.linalg.norm(area))


def test_the_point_of_application_is_the_centre_of_pressure() -> None:
    """A face half under water, and one under water and soil's surcharge."""
    block = Block.box("b", (0, 0, 0), (1, 2, 3), 20.0)
    half = Pressure("b", LEFT, 0.0, (0, 0, -10), (0, 0, 1.5), (0, 0, -1))
    at, force, moment = half.resultant(block)
    np.testing.assert_allclose(
        [at, force, moment], [(0, 1, 0.5), (22.5, 0, 0), (0, 0, 0)], atol=1e-12
    )
    both = Pressure("b", LEFT, 4.0, (0, 0, -10), (0, 0, 3), (0, 0, -1))  # 4 x 3 and 10 x 9 / 2, x 2
    at, force, moment = both.resultant(block)
    np.testing.assert_allclose(force, (114, 0, 0))
    np.testing.assert_allclose([at, moment], [(0, 1, (24 * 1.5 + 90) / 114), (0, 0, 0)], atol=1e-12)
    dry = replace(half, at=(0, 0, -1))
    np.testing.assert_array_equal(dry.resultant(block)[1], np.zeros(3))


def test_sums_of_pressures_keep_their_surfaces() -> None:
    """A factor below zero turns the pressure round, not the side of the surface it acts on."""
    block = Block.box("b", (0, 0, 0), (1, 2, 3), 20.0)
    water = Load(pressures=[Pressure("b", LEFT, 0.0, (0, 0, -10), (0, 0, 1.5), (0, 0, -1))])
    growing = Load(growing=[GrowingAcceleration((1, 0, 0), (0, 0, 0), (0, 0, 3))])
    both = cvxlimit.loads.combined([water, growing], [-2.0, 3.0])
    np.testing.assert_allclose(both.on([block]), -2 * water.on([block]) + 3 * growing.on([block]))


# --- water and earth beside walls ---------------------------------------------------------------


@pytest.mark.parametrize("shape", [(1, 1, 1), (4, 1, 1), (5, 1, 3), (7, 2, 2), (16, 1, 1)])
def test_water_does_not_depend_on_how_a_wall_is_cut(shape: tuple[int, int, int]) -> None:
    """gamma h^2 / 2 at a third of the height; it overturns at W b / 2 = alpha gamma h^3 / 6."""
    cut = wall(*shape)
    water = Load(pressures=hydrostatic(cut, 2.0, 9.81, LEFT))
    force = 9.81 * 2.0 * 3
    np.testing.assert_allclose(
        total(cut, water), [force, 0, 0, 0, force * 2 / 3, -force * 1.5], atol=1e-9
    )
    if shape[1:] == (1, 1):
        solution = factor(cut.with_live(water))
        assert solution.load_factor == pytest.approx(1.076453, rel=1e-6)


def test_faces_in_triangles_and_partly_covered_ones() -> None:
    """A buttress of 1 x 1 m stands against the wet face: it takes its own water, and the wall the
    rest; faces in triangles are as good as whole ones."""
    plain = wall(1)
    faces = [t for f in plain.blocks[1].faces for t in ((f[0], f[1], f[2]), (f[0], f[2], f[3]))]
    cut = Block.polyhedron("c", plain.blocks[1].vertices, faces, 22.0)
    buttress = Block.box("buttress", (-0.5, 1.0, 0), (0, 2.0, 1.0), 22.0)
    for block in (plain.blocks[1], cut):
        both = scene(block, buttress)
        water = Load(pressures=hydrostatic(both, 1.5, 10.0, LEFT))
        force, depth = 10 * 1.5**2 / 2 * 3, 1.5 / 3
        np.testing.assert_allclose(total(both, water)[:5], [force, 0, 0, 0, force * depth])
        own = water.on(both.blocks)[2]
        np.testing.assert_allclose(own[0], 10 * (1.5**2 - 0.5**2) / 2)


def test_a_hole_in_what_is_wet() -> None:
    """A beam of 1 x 0.5 m ends in the middle of the wet face."""
    beam = Block.box("beam", (-2, 1.0, 0.5), (0, 2.0, 1.0), 22.0)
    both = scene(wall(1).blocks[1], beam)
    water = Load(pressures=hydrostatic(both, 2.0, 10.0, LEFT, blocks=["c0-0-0"]))
    assert total(both, water)[0] == pytest.approx(10 * (2.0 * 3 - 0.5 * 1.25))


def test_water_on_a_batter_presses_down_as_well() -> None:
    outline = ((-1, 0), (2, 0), (1, 2), (0, 2))
    slope = Block.hull("dam", [(x, y, z) for y in (0, 1) for x, z in outline], 20.0)
    one = scene(slope)
    water = Load(pressures=hydrostatic(one, 2.0, 10.0, LEFT))
    np.testing.assert_allclose(total(one, water)[:3], [20, 0, -10], atol=1e-12)


def test_the_same_in_another_frame_and_other_units() -> None:
    base = retaining_wall(surcharge=5.0)
    turn = Rotation.from_euler("xyz", (17, 31, -43), degrees=True).as_matrix()
    moved = base.moved(turn)
    again = earth_pressure(moved, 2.4, 18.0, 0.3, turn @ LEFT, 5.0)
    np.testing.assert_allclose(
        moved.with_live(Load(pressures=again)).live_forces, moved.live_forces, atol=1e-9
    )
    other = base.in_units(Units("mm", "N"), 1e3, 1e3)
    expected = solve(base).load_factor
    for one in (moved, other):
        assert factor(one).load_factor == pytest.approx(expected, rel=2e-5)


# --- structures in closed form ------------------------------------------------------------------


@pytest.mark.parametrize(("friction", "base"), [(0.4, 1.0), (3.0, 1.0), (3.0, 0.6)])
def test_a_retaining_wall_slides_or_turns_over(friction: float, base: float) -> None:
    """E = K gamma h^2 / 2 + K q h; sliding mu W, turning about the toe of a course."""
    h, k, gamma, q = 2.0, 0.3, 18.0, 4.0
    stones = retaining_wall(4, h, base, base, friction=friction, surcharge=q)
    weight, push = 20.0 * base * h, k * gamma * h**2 / 2 + k * q * h
    turning = k * gamma * h**3 / 6 + k * q * h**2 / 2
    # A course in two stones turns about the front stone's toe as one only if both are pressed;
    # with one stone a course through the wall at the foot the wall turns as a whole.
    expected = min(friction * weight / push, weight * base / 2 / turning)
    whole = retaining_wall(1, h, base, base, friction=friction, surcharge=q)
    assert factor(whole).load_factor == pytest.approx(expected, rel=1e-6)
    assert factor(stones).load_factor <= expected * (1 + 1e-6)
    if friction < 1.0:
        assert factor(stones).load_factor == pytest.approx(expected, rel=1e-6)


def test_earth_as_a_dead_load() -> None:
    """What friction has left: (mu W - E) / W."""
    shaken = retaining_wall(4, 2.0, 1.0, 1.0, friction=0.5, live=PUSH)
    assert factor(shaken).load_factor == pytest.approx((0.5 * 40 - 10.8) / 40, rel=1e-6)


@pytest.mark.parametrize("friction", [0.5, 5.0])
@pytest.mark.parametrize("tail", [None, 2.0])
def test_a_dam_with_uplift(friction: float, tail: float | None) -> None:
    """One block on its foundation: alpha (H + mu U) = mu W, or moments about the toe."""
    h, b, top, gamma, t = 10.0, 7.0, 2.0, 9.81, tail or 0.0
    section = dam(1, h, b, top, friction=friction, tail=tail)
    weight = 23.0 * h * (b + top) / 2
    arm = (23.0 * h * top * (b - top / 2) + 23.0 * h * (b - top) / 2 * (b - top) * 2 / 3) / weight
    push, lift = gamma * h**2 / 2, gamma * b * (h + t) / 2
    turning = gamma * h**3 / 6 + gamma * b**2 * (t / 2 + (h - t) / 3)
    expected = min(friction * weight / (push + friction * lift), weight * arm / turning)
    assert factor(section).load_factor == pytest.approx(expected, rel=1e-6)


def test_water_in_a_joint_presses_both_blocks_alike() -> None:
    """Equal and opposite on two free blocks; on a block that stands on a support, on it alone."""
    two = wall(2, wythes=2)
    water = Load(pressures=uplift(two, 2.0, 10.0, LEFT))
    blocks = [two.blocks[i] for i in two.free]
    lower = Load(pressures=uplift(two, 2.0, 10.0, LEFT, blocks=[b.id for b in blocks[:2]]))
    upper = Load(pressures=uplift(two, 2.0, 10.0, LEFT, blocks=[b.id for b in blocks[2:]]))
    np.testing.assert_allclose(total(two, water), total(two, lower) + total(two, upper))
    ground = 20 / 2 * 0.8 * 3, 10 / 2 * 0.8 * 3  # at the ground and at the joint above
    assert total(two, water)[2] == pytest.approx(ground[0])
    assert total(two, upper)[2] == pytest.approx(ground[1])
    # The wet wythe has three quarters of what is in the joint, the dry one a quarter.
    parts = upper.on(two.blocks)[3:, 2]
    np.testing.assert_allclose(parts, np.array([0.75, 0.25]) * ground[1])


# --- on arches ----------------------------------------------------------------------------------


def test_fill_on_an_arch_weighs_what_it_weighs() -> None:
    """Between level and polygon of the extrados, and level by level the same in two steps."""
    bridge = arch(20, 0.15, embrace=120.0)
    weight = -total(bridge, Load(points=fill(bridge, 1.5, 18.0)))[2]
    corners = np.unique(np.concatenate([b.vertices for b in bridge.blocks[1:-1]]).round(9), axis=0)
    outer = corners[
        np.isclose(np.hypot(corners[:, 0], corners[:, 2]), 1.075) & (corners[:, 1] == 0)
    ]
    x, z = outer[np.argsort(outer[:, 0])][:, [0, 2]].T
    assert weight == pytest.approx(18.0 * 0.3 * float(np.trapezoid(1.5 - z, x)))


def test_a_wheel_is_shared_by_the_stones_under_it() -> None:
    bridge = arch(20, 0.15, embrace=120.0)
    points = wheel(bridge, (0.17, 0.15, 9.0), (0.3, 0.2), 50.0)
    assert 2 <= len(points) <= 4
    what = total(bridge, Load(points=points))
    np.testing.assert_allclose(what[:5], [0, 0, -50, -50 * 0.15, 50 * 0.17], atol=1e-9)


# --- faces that other blocks cover in part -------------------------------------------------------

UP = (0.0, 0.0, 1.0)
LOOKS = np.cos(np.radians(80.0))
"""As fill and water are documented to see: faces within 80 degrees."""


def triangles(block: Block) -> FloatArray:
    """Faces (t, 3, 3) fanned from their first corners, as those of built-in scenes may be."""
    return np.array(
        [block.vertices[[f[0], *f[k : k + 2]]] for f in block.faces for k in range(1, len(f) - 1)]
    )


def on_bare_faces(scene: Scene, towards: FloatArray, level: float) -> FloatArray:
    """Integral (3,) of the depth over the bare faces that look along ``towards``, by another way:
    over whole faces, less that over the contacts. Both are plane, so that the depth of their
    centroid is their mean; the level is above them."""
    result = np.zeros(3)
    for i in scene.free:
        corners = triangles(scene.blocks[i])
        areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        looks = areas @ towards > LOOKS * np.linalg.norm(areas, axis=1)
        result += (level - corners.mean(axis=1)[looks, 2]) @ areas[looks]
    for a, b, contact in zip(scene.contacts.a, scene.contacts.b, scene.contacts, strict=True):
        for i, normal in ((a, contact.normal), (b, -contact.normal)):
            if i in scene.free and normal @ towards > LOOKS:
                result -= (level - contact.origin[2]) * contact.area * normal
    return result


def columns_of_fill(scene: Scene, level: float) -> float:
    """The volume between a level and what it is above, by vertical rays through the middles of
    cells between all corners: exact where edges run along x and y in plan."""
    places, half = [], []
    for axis in (0, 1):
        lines = np.unique(np.concatenate([b.vertices[:, axis] for b in scene.blocks]).round(9))
        lines = np.unique(np.concatenate([lines, np.linspace(lines[0], lines[-1], 60)]))
        places.append(0.5 * (lines[1:] + lines[:-1]))
        half.append(np.diff(lines))
    x, y = np.meshgrid(*places, indexing="ij")
    highest, is_loaded = np.full(x.shape, -np.inf), np.zeros(x.shape, bool)
    for i, block in enumerate(scene.blocks):
        for a, b, c in triangles(block):
            whole, (ab, ac) = np.cross(b - a, c - a), (b - a, c - a)
            if whole[2] <= 1e-9 * np.linalg.norm(whole):
                continue
            s = ((x - a[0]) * ac[1] - (y - a[1]) * ac[0]) / whole[2]
            t = ((y - a[1]) * ab[0] - (x - a[0]) * ab[1]) / whole[2]
            z = np.where((s >= 0) & (t >= 0) & (s + t <= 1), a[2] + s * ab[2] + t * ac[2], -np.inf)
            seen = bool(i in scene.free and whole[2] > LOOKS * np.linalg.norm(whole))
            is_loaded = np.where(z > highest, seen, is_loaded)
            highest = np.maximum(highest, z)
    return float((np.where(is_loaded, level - highest, 0.0) * np.outer(*half))[is_loaded].sum())


FAST = sorted(BUILTIN.keys() - {"s10-panel", "s12-panel", "dome", "barrel-vault"})
"""The others take a second each."""


@pytest.mark.parametrize("name", mostly_slow(BUILTIN, FAST))
def test_fill_on_every_built_in_scene(name: str) -> None:
    """0.5 m above the top: each column once, and on all bare faces where blocks are named. The
    dome's edges in plan run through the cells, 1 in 60 of its width: half a percent."""
    built = builtin_scene(name)
    level = max(b.vertices[:, 2].max() for b in built.blocks) + 0.5
    once = total(built, Load(points=fill(built, level, 20.0)))[2]
    near = 5e-3 if name == "dome" else 1e-8
    assert -once == pytest.approx(20.0 * columns_of_fill(built, level), rel=near)
    named = fill(built, level, 20.0, blocks=[built.blocks[i].id for i in built.free])
    expected = 20.0 * on_bare_faces(built, np.array(UP), level)[2]
    assert -total(built, Load(points=named))[2] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("name", mostly_slow(BUILTIN, FAST))
@pytest.mark.exhaustive_cases("house-corner", "facade")
def test_water_on_every_built_in_scene(name: str) -> None:
    built = builtin_scene(name)
    level = max(b.vertices[:, 2].max() for b in built.blocks) + 0.5
    for towards in np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), UP], dtype=float):
        expected = -9.81 * on_bare_faces(built, towards, level)
        try:
            water = Load(pressures=hydrostatic(built, level, 9.81, towards))
        except InputError:
            np.testing.assert_allclose(expected, 0.0, atol=1e-9)
            continue
        size = np.abs(expected).max()
        np.testing.assert_allclose(total(built, water)[:3], expected, atol=1e-6 * size)


def test_a_face_half_covered_keeps_the_other_half() -> None:
    """10 kN/m3 up to 3 m on the bare half of a block 0.5 m high, whose other half bears a post; in
    water the same half is pressed."""
    block = Block.box("block", (0, 0, 0), (1, 1, 0.5), 20.0)
    half = scene(block, Block.box("post", (0.5, 0, 0.5), (1, 1, 3.0), 20.0))
    (load,) = fill(half, 3.0, 10.0)
    np.testing.assert_allclose([*load.at, *load.force], [0.25, 0.5, 0.5, 0, 0, -12.5], atol=1e-6)
    water = Load(pressures=hydrostatic(half, 3.0, 10.0, UP))
    assert total(half, water)[2] == pytest.approx(-12.5)
    stands = Load(points=wheel(half, (0.25, 0.5, 0), (0.5, 1.0), 7.0))
    assert total(half, stands)[2] == pytest.approx(-7.0)


def test_a_face_around_a_post() -> None:
    """What is left has a hole."""
    block = Block.box("block", (0, 0, 0), (2, 2, 0.5), 20.0)
    around = scene(block, Block.box("post", (0.5, 0.5, 0.5), (1, 1, 3.0), 20.0))
    assert -total(around, Load(points=fill(around, 3.0, 10.0)))[2] == pytest.approx(93.75)


@pytest.mark.parametrize("turned", [False, True])
def test_a_column_of_fill_rests_on_the_highest_stone(turned: bool) -> None:
    """A floor of 4 x 1 m between two piers, a lintel over its middle 2.2 m: 20 kN/m3 up to 2 m
    rest on the lintel's top at 1.5 m and on what of piers and floor it leaves open; so does a
    wheel. The floor under the lintel has fill where it is named."""
    floor = Block.box("floor", (0, 0, 0), (4, 1, 0.2), 22.0)
    piers = [Block.box(f"p{x}", (x, 0, 0.2), (x + 0.4, 1, 1.2), 22.0) for x in (1.0, 2.6)]
    lintel = Block.box("lintel", (0.9, 0, 1.2), (3.1, 1, 1.5), 22.0)
    built = scene(floor, *piers, lintel)
    turn = Rotation.from_euler("z", 25, degrees=True).as_matrix() if turned else np.eye(3)
    built = built.moved(turn)
    points = fill(built, 2.0, 20.0)
    on = {
        name: sum(-p.force[2] for p in points if p.block == name)
        for name in [b.id for b in built.blocks]
    }
    expected = {"lintel": 20 * 0.5 * 2.2, "floor": 20 * 1.8 * 1.8, "p1.0": 0, "p2.6": 0, "base": 0}
    assert on == pytest.approx(expected)
    below = fill(built, 2.0, 20.0, blocks=["floor"])
    assert -sum(p.force[2] for p in below) == pytest.approx(20 * 1.8 * (4 - 0.8))
    (stands,) = wheel(built, turn @ (2.0, 0.5, 0), (0.5, 0.5), 30.0, along=turn[:, 0])
    assert stands.block == "lintel"
    (stands,) = wheel(built, turn @ (2.0, 0.5, 0), (0.5, 0.5), 30.0, turn[:, 0], ["floor"])
    assert stands.block == "floor"


def test_faces_under_a_support_are_not_filled() -> None:
    under = Block.box("under", (0, 0, 0), (1, 1, 1), 20.0)
    pier, shelf = (
        Block.box("pier", (2, 0, 0), (3, 1, 1.5)),
        Block.box("shelf", (0, 0, 1.5), (3, 1, 2)),
    )
    hidden = Scene((BASE, under, pier, shelf), ("base", "pier", "shelf"), PUSH)
    with pytest.raises(InputError, match="all 1 faces that look up lie under other blocks: name"):
        fill(hidden, 3.0, 20.0)
    assert fill(hidden, 1.5, 20.0, blocks="under")[0].force[2] == pytest.approx(-10.0)


def test_an_arch_on_piers_under_its_fill() -> None:
    """With the fill's weight on all that is bare; the plane program is not ours."""
    built = builtin_scene("arch-on-piers")
    level = max(b.vertices[:, 2].max() for b in built.blocks) + 0.5
    filled = built.with_dead(Load(gravity=(0, 0, -1), points=fill(built, level, 20.0)))
    assert factor(filled).load_factor == pytest.approx(planar_load_factor(filled), rel=1e-6)


# --- inertia ------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(1, 1, 1), (4, 1, 2), (3, 2, 1)])
def test_inertia_that_grows_with_height(shape: tuple[int, int, int]) -> None:
    """Half of the weight at two thirds of the height, however the wall is cut; and the push from
    a point in the middle of the wall turns without pushing."""
    cut = wall(*shape)
    weight = 22 * 0.8 * 3 * 2
    growing = Load(growing=[GrowingAcceleration((1, 0, 0), (0, 0, 0), (0, 0, 2))])
    np.testing.assert_allclose(
        total(cut, growing), [weight / 2, 0, 0, 0, weight * 2 / 3, -weight * 0.75], atol=1e-9
    )
    rocking = Load(growing=[GrowingAcceleration((1, 0, 0), (0, 0, 1), (0, 0, 2))])
    np.testing.assert_allclose(total(cut, rocking)[[0, 4]], [0, weight / 3], atol=1e-9)
    if shape[1:] == (1, 1):
        assert factor(cut.with_live(growing)).load_factor == pytest.approx(0.4 / (2 / 3), rel=1e-6)


def test_a_push_with_a_vertical_part() -> None:
    """alpha h / 2 = (1 - alpha / 2) b / 2."""
    pushed = wall(1).with_live(Load(acceleration=(1, 0, 0.5)))
    assert factor(pushed).load_factor == pytest.approx(0.4 / (1 + 0.2), rel=1e-6)


def test_weights_as_parameters_carry_growing_inertia() -> None:
    one = wall(1).with_live(Load(growing=[GrowingAcceleration((1, 0, 0), (0, 0, 0), (0, 0, 2))]))
    weights = cp.Parameter(1, value=[3.0 * one.total_weight])
    problem = LimitProblem(one, weights=weights)
    assert problem.solve().load_factor == pytest.approx(0.6, rel=1e-5)


# --- refusals -----------------------------------------------------------------------------------

TWO = wall(2, wythes=2)
REFUSALS: dict[str, tuple[Callable[[], object], str]] = {
    "negative level": (
        lambda: hydrostatic(TWO, -1.0, 9.81, LEFT),
        r"level -1 is below all faces that look along \[-1.0, 0.0, 0.0\], which lie between the "
        "heights 0 and 2: give a level above the lowest",
    ),
    "no weight": (lambda: hydrostatic(TWO, 1.0, 0.0, LEFT), "unit_weight .* got 0"),
    "no number": (lambda: hydrostatic(TWO, float("nan"), 9.81, LEFT), "level .*nan"),
    "coefficient": (lambda: earth_pressure(TWO, 1.0, 18.0, -0.3, LEFT), "coefficient .* got -0.3"),
    "surcharge": (lambda: earth_pressure(TWO, 1.0, 18.0, 0.3, LEFT, -5.0), "surcharge .* got -5"),
    "stranger": (
        lambda: hydrostatic(TWO, 1.0, 9.81, LEFT, blocks=["C0-0-0"]),
        "'C0-0-0' is no block of scene 'scene': did you mean 'c[01]-0-0'?",
    ),
    "support": (
        lambda: hydrostatic(TWO, 1.0, 9.81, LEFT, blocks=["base"]),
        "'base' is a support, which cannot move",
    ),
    "in contact": (
        lambda: hydrostatic(TWO, 1.0, 9.81, LEFT, blocks=["c0-1-0"]),
        r"all 1 faces that look along \[-1.0, 0.0, 0.0\] are in contact with other blocks",
    ),
    "no such face": (
        lambda: hydrostatic(scene(*arch().blocks[1:3]), 1.0, 9.81, (0, 0, 0)),
        "direction must not be zero",
    ),
    "tail above": (lambda: uplift(TWO, 1.0, 9.81, LEFT, tail=1.5), "tail 1.5 is above level 1"),
    "upright": (lambda: uplift(TWO, 1.0, 9.81, (0, 0, 1)), "direction must be horizontal"),
    "no joint": (lambda: uplift(TWO, 0.0, 9.81, LEFT), "no bed joint lies below level 0"),
    "beside": (
        lambda: wheel(TWO, (0, 1.5, 0), (0.4, 0.4), 50.0), "stands on 50 % of its area: move it"
    ),
    "low fill": (lambda: fill(TWO, 0.5, 18.0), "level 0.5 is below all faces that look up"),
}  # fmt: skip


@pytest.mark.parametrize(("make", "message"), REFUSALS.values(), ids=REFUSALS.keys())
def test_refusals(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_show_says_what_loads_add_up_to(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Water and uplift of the dam, and its weight: 9.81 (10^2 / 2, 10 9 / 2) and 23 x 52.5."""
    assert run(["show", "dam", "--plot", str(tmp_path / "dam.html")]) == 0
    out = capsys.readouterr().out
    assert "dead load  0, 0, -1207.5 kN in all\n" in out
    assert "live load  490.5, 0, 441.45 kN in all, 14 pressures\n" in out
    assert "pressure 0 kN/m\\u00b2 that grows by 9.81 kN/m\\u00b3 on c1" in (
        tmp_path / "dam.html"
    ).read_text("utf-8")


def test_paths_know_no_inertia_that_grows() -> None:
    growing = Load(growing=[GrowingAcceleration((1, 0, 0), (0, 0, 0), (0, 0, 2))])
    with pytest.raises(ModelError, match="has inertia that grows with height in the live load"):
        pushover(wall(1).with_live(growing))
