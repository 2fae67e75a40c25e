"""Loads where they act: points, faces and selected weights, against statics by hand."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cvxlimit import Block, GrowingAcceleration, Load, PointForce, Pressure, Scene, Units, solve
from cvxlimit.errors import InputError
from cvxlimit.io import scene_from_dict, scene_to_dict

GROUND = Block.box("ground", (-3, -3, -1), (3, 3, 0))
TOWER = Block.box("tower", (0, 0, 0), (1, 1, 4), density=20.0)
WEDGE = Block.hull(
    "wedge", [(x, y, z) for y in (0, 2) for x, z in ((0, 0), (2, 0), (2, 1))], density=10.0
)
WEIGHT = 80.0
"""Of the tower: 20 x 1 x 1 x 4."""


def scene(live: Load, friction: float = 0.7, **changes: Any) -> Scene:
    return Scene((GROUND, TOWER), ("ground",), live, friction=friction, **changes)


# --- resultants by hand -------------------------------------------------------------------------


def test_a_point_force_turns_about_the_centroid() -> None:
    """Centroid (0.5, 0.5, 2): arm (0.5, -0.5, 1), force (3, 4, 5), moment = arm x force."""
    load = Load(points=[PointForce("tower", (1, 0, 3), (3, 4, 5))])
    np.testing.assert_allclose(load.on([TOWER]), [[3, 4, 5, -6.5, 0.5, 3.5]], atol=1e-12)


def test_two_point_forces_make_a_couple() -> None:
    pair = [PointForce("tower", (0.5, 0.5, z), (f, 0, 0)) for z, f in ((4, 2), (0, -2))]
    np.testing.assert_allclose(Load(points=pair).on([TOWER]), [[0, 0, 0, 0, 8, 0]], atol=1e-12)


def test_pressure_on_a_side_acts_at_its_middle() -> None:
    """2.5 on 4 of area, pushing along +y at height 2: through the centroid, no moment."""
    load = Load(pressures=[Pressure("tower", (0, -7, 0), 2.5)])
    np.testing.assert_allclose(load.on([TOWER]), [[0, 10, 0, 0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(load.actions([TOWER]).at[-1], [0.5, 0, 2])


def test_pressure_on_a_slope() -> None:
    """Slope 2 x sqrt(5), normal (-1, 0, 2)/sqrt(5): force -p (-2, 0, 4) at (1, 1, 0.5)."""
    load = Load(pressures=[Pressure("wedge", (-1, 0, 2), 3.0)])
    force = np.array([6.0, 0.0, -12.0])
    arm = np.array([1.0, 1.0, 0.5]) - [4 / 3, 1.0, 1 / 3]
    expected = np.concatenate([force, np.cross(arm, force)])
    np.testing.assert_allclose(load.on([WEDGE])[0], expected, atol=1e-12)


def test_the_same_pressure_all_around_cancels() -> None:
    """A closed surface under uniform pressure is in equilibrium (divergence theorem)."""
    normals = [(0, 0, -1), (1, 0, 0), (-1, 0, 2), (0, 1, 0), (0, -1, 0)]
    load = Load(pressures=[Pressure("wedge", n, 3.0) for n in normals])
    np.testing.assert_allclose(load.on([WEDGE]), np.zeros((1, 6)), atol=1e-12)


def test_a_face_in_triangles_is_one_face() -> None:
    """Every side of the tower cut in two triangles: the same resultant."""
    faces = [t for f in TOWER.faces for t in ((f[0], f[1], f[2]), (f[0], f[2], f[3]))]
    cut = Block.polyhedron("tower", TOWER.vertices, faces, density=20.0)
    load = Load(pressures=[Pressure("tower", (1, 0, 0), 2.0)])
    np.testing.assert_allclose(load.on([cut]), load.on([TOWER]), atol=1e-12)


def test_weights_of_selected_blocks() -> None:
    load = Load(weights={"tower": (0, 0.25, -1)})
    np.testing.assert_allclose(
        load.on([WEDGE, TOWER]), [np.zeros(6), [0, 0.25 * WEIGHT, -WEIGHT, 0, 0, 0]]
    )


def test_parts_add_up_and_every_action_is_listed() -> None:
    load = Load(
        (0, 0, -1), None, {"tower": (1, 0, 0, 0, 2, 0)},
        [PointForce("tower", (1, 0, 3), (3, 4, 5))],
        [Pressure("tower", (0, -1, 0), 2.5)], {"tower": (0.5, 0, 0)},
    )  # fmt: skip
    np.testing.assert_allclose(load.on([TOWER]), [[44, 14, -75, -6.5, 2.5, 3.5]], atol=1e-12)
    what = load.actions([TOWER])
    assert what.block.tolist() == [0, 0, 0, 0]
    np.testing.assert_allclose(what.force.sum(axis=0), [44, 14, -75])


# --- collapse by hand ---------------------------------------------------------------------------


@pytest.mark.parametrize("height", [1.0, 2.5, 4.0])
def test_a_tower_pushed_at_a_height_overturns(height: float) -> None:
    """W x 0.5 = alpha x height; high friction keeps it from sliding."""
    push = Load(points=[PointForce("tower", (0, 0.5, height), (1, 0, 0))])
    answer = solve(scene(push, friction=2.0 * WEIGHT))
    expected = 0.5 * WEIGHT / height
    assert answer.lower <= expected * (1 + 1e-9)
    assert answer.upper >= expected * (1 - 1e-9)
    assert answer.load_factor == pytest.approx(expected, rel=1e-5)


def test_a_tower_pushed_low_slides() -> None:
    """At a height of 0.5 it would overturn at 80, and slides at 0.7 x 80."""
    push = Load(points=[PointForce("tower", (0, 0.5, 0.5), (1, 0, 0))])
    assert solve(scene(push)).load_factor == pytest.approx(0.7 * WEIGHT, rel=1e-5)


def test_wind_overturns_a_tower() -> None:
    """p x 4 at height 2 against W x 0.5: alpha = 5."""
    wind = Load(pressures=[Pressure("tower", (-1, 0, 0), 1.0)])
    assert solve(scene(wind)).load_factor == pytest.approx(5.0, rel=1e-5)


# --- changes of frame, units and form -----------------------------------------------------------

WATER = Pressure(
    "tower", (0, -1, 0), 2.5, (0.5, 0, -3), (1, 0, 2), (0, 0.1, -1),
    ((0, 0, 0), (1, 0, 0), (1, 0, 3)),
)  # fmt: skip
ALL = Load(
    (0, 0, -1),
    (0.1, 0, 0),
    {"tower": (1, 2, 3, 4, 5, 6)},
    (PointForce("tower", (0, 0.5, 3), (1, 0.2, 0)), PointForce("tower", (1, 1, 4), (0, 0, -2))),
    (Pressure("tower", (-1, 0, 0), 1.5), WATER),
    {"tower": (0, 0.3, 0)},
    (GrowingAcceleration((1, 0.5, 0), (0, 0, -1), (0, 0.5, 4)),),
)


def test_a_turned_scene_has_turned_loads() -> None:
    turn = Rotation.from_quat(np.random.default_rng(5).normal(size=4)).as_matrix()
    base = scene(ALL)
    both = np.kron(np.eye(2), turn)
    moved = base.moved(turn, (5, -6, 7))
    np.testing.assert_allclose(moved.live_forces, base.live_forces @ both.T, atol=1e-10)


def test_loads_in_other_units() -> None:
    base = scene(ALL)
    other = base.in_units(Units("mm", "N"), length=1e3, force=1e3)
    np.testing.assert_allclose(other.live_forces, base.live_forces * ([1e3] * 3 + [1e6] * 3))


def test_the_factor_does_not_depend_on_frame_or_units() -> None:
    """Certified brackets of one and the same problem overlap, whatever the frame and units."""
    push = Load(
        points=[PointForce("tower", (0, 0.3, 3), (1, 0.2, 0))],
        pressures=[Pressure("tower", (-1, 0, 0), 0.5)],
    )
    turn = Rotation.from_euler("xyz", (17, 31, -43), degrees=True).as_matrix()
    base = scene(push)
    answers = [
        solve(s)
        for s in (base, base.moved(turn, (1, 2, 3)), base.in_units(Units("mm", "N"), 1e3, 1e3))
    ]
    for one in answers:
        assert one.status.is_good
        for other in answers:
            assert one.lower <= other.upper
    assert answers[1].load_factor == pytest.approx(answers[0].load_factor, rel=2e-5)


def test_loads_survive_files_and_pickles() -> None:
    for load in (ALL, Load(weights={"tower": (1, 0, 0)}), Load(points=ALL.points)):
        base = scene(load)
        for copy in (pickle.loads(pickle.dumps(base)), scene_from_dict(scene_to_dict(base))):
            assert copy.live == load
            assert copy.live_forces.tolist() == base.live_forces.tolist()


# --- refusals -----------------------------------------------------------------------------------

REFUSALS: dict[str, tuple[Callable[[], object], str]] = {
    "point off the block": (
        lambda: scene(Load(points=[PointForce("tower", (0, 0, 3000), (1, 0, 0))])),
        r"point load on block 'tower' acts at \[0.0, 0.0, 3000.0\], 2998 from the block's centroid",
    ),
    "no such face": (
        lambda: scene(Load(pressures=[Pressure("tower", (1, 1, 0), 1)])),
        r"block 'tower' has no face that looks along \[0.7071, 0.7071, 0.0\]",
    ),
    "no direction": (lambda: Pressure("tower", (0, 0, 0), 1), "must be a direction"),
    "NaN pressure": (lambda: Pressure("tower", (0, 0, 1), float("nan")), "finite, got .nan"),
    "no point": (
        lambda: Pressure("tower", (0, 0, 1), 1, gradient=(0, 0, -10)),
        "at of the pressure on block 'tower' is missing: give the point where the pressure is 1",
    ),
    "polygon across": (
        lambda: Pressure("tower", (0, 0, 1), 1, corners=((0, 0, 0), (0, 1, 0), (0, 0, 1))),
        r"corners of the pressure on block 'tower' must be a polygon that looks along its normal",
    ),
    "polygon elsewhere": (
        lambda: scene(
            Load(pressures=[Pressure("tower", (0, 0, 1), 1,
                                     corners=((0, 0, 50), (1, 0, 50), (0, 1, 50)))])
        ),
        "the polygon of a pressure on block 'tower' lies around .*, which is off the block",
    ),
    "no rise": (
        lambda: GrowingAcceleration((1, 0, 0), (0, 0, 1), (0, 0, 1)),
        r"base and top of a growing acceleration are both \[0.0, 0.0, 1.0\]",
    ),
    "NaN point": (lambda: PointForce("tower", (0, np.nan, 0), (1, 0, 0)), "point .*'tower'.*nan"),
    "force of two": (lambda: PointForce("tower", (0, 0, 0), (1, 0)), "force of the point load"),  # type: ignore[arg-type]
    "tuple for a point": (
        lambda: Load(points=[("tower", (0, 0, 0), (1, 0, 0))]),  # type: ignore[list-item]
        "points of a load must be PointForce objects",
    ),
    "a stranger": (
        lambda: scene(Load(points=[PointForce("roof", (0, 0, 0), (1, 0, 0))])),
        "the live load names block 'roof', which is not in the scene",
    ),
    "a support": (
        lambda: scene(Load(pressures=[Pressure("ground", (0, 0, 1), 1)])),
        "the live load acts on block 'ground', which is a support",
    ),
    "weight of a support": (
        lambda: scene(Load((1, 0, 0)), dead=Load(weights={"ground": (0, 0, -1)})),
        "the dead load acts on block 'ground', which is a support",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("make", "message"), REFUSALS.values(), ids=REFUSALS.keys())
def test_refusals(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_none_means_no_forces() -> None:
    assert Load(acceleration=(1, 0, 0), forces=None) == Load(acceleration=(1, 0, 0))  # type: ignore[arg-type]


def test_messages_from_files_name_the_entry() -> None:
    document: Any = scene_to_dict(scene(ALL))
    document["loads"]["live"]["points"][1]["forces"] = 1
    with pytest.raises(
        InputError, match="point load 1 has an unknown key 'forces'; did you mean 'force'"
    ):
        scene_from_dict(document)
