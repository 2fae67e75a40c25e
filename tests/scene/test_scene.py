"""Scenes: loads, friction, copies, changes of frame and units, and every refusal."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cvxlimit import solve
from cvxlimit.errors import CvxlimitError, InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry import builtin_scene, stack
from cvxlimit.scene import GRAVITY, Load, PointForce, Scene, Units

GROUND = Block.box("ground", (-2, -2, -1), (2, 2, 0))
LOWER = Block.box("lower", (0, 0, 0), (1, 1, 0.5), density=20.0)
UPPER = Block.box("upper", (0, 0, 0.5), (1, 1, 1.5), density=10.0)
PUSH = Load(acceleration=(1, 0, 0))


def scene(**changes: Any) -> Scene:
    parts = {"blocks": (GROUND, LOWER, UPPER), "supports": ("ground",), "live": PUSH}
    return Scene(**{**parts, **changes})


def prism(id: str, side: list[tuple[float, float]]) -> Block:
    """One unit along y, with corners (x, z) in order around its side."""
    n = len(side)
    points = [(x, y, z) for y in (0.0, 1.0) for x, z in side]
    walls = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    return Block.polyhedron(id, points, [range(n), range(n, 2 * n), *walls], density=20.0)


class TestLoads:
    def test_own_weight_pulls_down(self) -> None:
        np.testing.assert_allclose(
            scene().dead_forces, [[0, 0, -10, 0, 0, 0], [0, 0, -10, 0, 0, 0]]
        )

    def test_live_load_is_a_multiple_of_the_weight(self) -> None:
        live = scene(live=Load(acceleration=(0.5, -1, 0))).live_forces
        np.testing.assert_allclose(live, [[5, -10, 0, 0, 0, 0]] * 2)

    def test_forces_act_on_their_block_only(self) -> None:
        force = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
        live = scene(live=Load(forces={"upper": force})).live_forces
        np.testing.assert_array_equal(live, [np.zeros(6), force])

    def test_parts_add_up(self) -> None:
        dead = Load((0, 0, -1), (0.1, 0, 0), {"lower": (0, 0, -5, 0, 0, 1)})
        np.testing.assert_allclose(
            scene(dead=dead).dead_forces, [[1, 0, -15, 0, 0, 1], [1, 0, -10, 0, 0, 0]]
        )

    def test_gravity_along_any_direction(self) -> None:
        down = np.array([0.6, 0.0, -0.8])
        forces = scene(dead=Load(gravity=tuple(down))).dead_forces
        np.testing.assert_allclose(forces[:, :3], 10.0 * np.array([down, down]))

    def test_loads_cannot_be_changed_afterwards(self) -> None:
        given = {"upper": (1, 0, 0, 0, 0, 0)}
        load = Load(forces=given)
        given["upper"] = (9, 9, 9, 9, 9, 9)
        assert load.forces["upper"] == (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        with pytest.raises(TypeError):
            load.forces["upper"] = (0,) * 6  # type: ignore[index]

    def test_default_dead_load(self) -> None:
        assert scene().dead is GRAVITY
        assert scene().total_weight == pytest.approx(20.0)


class TestBlocksAndFriction:
    def test_free_blocks_are_those_that_are_not_supports(self) -> None:
        mixed = scene(blocks=(UPPER, GROUND, LOWER))
        assert mixed.free.tolist() == [0, 2]
        assert mixed.contacts.names == ("upper-lower", "ground-lower")

    def test_a_fixed_block_may_have_density_without_weighing(self) -> None:
        heavy = Block.box("ground", (-2, -2, -1), (2, 2, 0), density=99.0)
        assert scene(blocks=(heavy, LOWER, UPPER)).total_weight == pytest.approx(20.0)

    @pytest.mark.parametrize("pair", [("lower", "upper"), ("upper", "lower")])
    def test_friction_of_one_contact_in_either_order(self, pair: tuple[str, str]) -> None:
        own = scene(friction=0.5, contact_friction={pair: 0.1}).contacts
        assert dict(zip(own.names, own.friction, strict=True)) == {
            "ground-lower": 0.5,
            "lower-upper": 0.1,
        }

    def test_friction_override_holds_for_all_contacts_of_the_pair(self) -> None:
        """Two treads and a riser; two triangles of one tread would be one contact."""
        step = [(0, 0), (1, 0), (1, 0.5), (0.5, 0.5), (0.5, 1), (0, 1)]
        rest = [(0.5, 0.5), (1, 0.5), (1, 1.5), (0, 1.5), (0, 1), (0.5, 1)]
        lower, upper = (prism(name, side) for name, side in (("lower", step), ("upper", rest)))
        own = scene(
            blocks=(GROUND, lower, upper),
            friction=0.5,
            contact_friction={("lower", "upper"): 0.1},
        )
        several = ("lower-upper", "lower-upper#2", "lower-upper#3")
        assert own.contacts.names == ("ground-lower", *several)
        assert own.contacts.friction.tolist() == [0.5, 0.1, 0.1, 0.1]
        assert own.contacts["lower-upper#2"].friction == 0.1

    def test_no_friction_at_all_is_allowed(self) -> None:
        assert scene(friction=0).contacts.friction.tolist() == [0.0, 0.0]


class TestCopies:
    def test_contacts_are_kept_when_geometry_is(self) -> None:
        base = scene(friction=0.5)
        found = base.contacts
        for copy in (base.with_live(Load(acceleration=(0, 1, 0))), base.with_dead(PUSH),
                     base.with_friction(0.2), base.with_name("other")):  # fmt: skip
            assert copy.contacts.origin is found.origin
        assert base.contacts.friction.tolist() == [0.5, 0.5]

    def test_with_friction_reaches_the_contacts(self) -> None:
        base = scene(friction=0.5, contact_friction={("lower", "upper"): 0.1})
        assert base.contacts.friction.tolist() == [0.5, 0.1]
        assert base.with_friction(0.3).contacts.friction.tolist() == [0.3, 0.1]
        assert base.with_friction(0.3, {}).contacts.friction.tolist() == [0.3, 0.3]

    def test_each_copy_changes_one_thing(self) -> None:
        base, live = scene(), Load(acceleration=(0, 2, 0))
        assert base.with_live(live).live is live
        assert base.with_dead(live).dead is live
        assert base.with_name("other").name == "other"
        assert (base.live, base.dead, base.name) == (PUSH, GRAVITY, "scene")

    def test_frozen(self) -> None:
        with pytest.raises(AttributeError):
            scene().friction = 0.1  # type: ignore[misc]
        with pytest.raises(TypeError):
            scene().contact_friction["lower", "upper"] = 0.1  # type: ignore[index]

    def test_pickle(self) -> None:
        base = scene(contact_friction={("lower", "upper"): 0.1}, units=Units("mm", "N"), name="p")
        copy = pickle.loads(pickle.dumps(base))
        assert copy.contacts.names == base.contacts.names
        assert (copy.units, copy.name, copy.live) == (base.units, "p", base.live)
        assert dict(copy.contact_friction) == dict(base.contact_friction)


class TestFrameAndUnits:
    def test_moved_turns_blocks_and_loads(self) -> None:
        turn = Rotation.from_quat(np.random.default_rng(3).normal(size=4)).as_matrix()
        live = Load(acceleration=(1, 0, 0), forces={"upper": (1, 2, 3, 4, 5, 6)})
        base = scene(live=live)
        moved = base.moved(turn, (5, 6, 7))
        both = np.kron(np.eye(2), turn)
        np.testing.assert_allclose(moved.dead_forces, base.dead_forces @ both.T, atol=1e-12)
        np.testing.assert_allclose(moved.live_forces, base.live_forces @ both.T, atol=1e-12)
        assert moved.contacts.names == base.contacts.names
        np.testing.assert_allclose(
            moved.contacts.origin, base.contacts.origin @ turn.T + [5, 6, 7], atol=1e-9
        )

    def test_in_units(self) -> None:
        live = Load(acceleration=(1, 0, 0), forces={"upper": (1, 2, 3, 4, 5, 6)})
        base = scene(live=live)
        other = base.in_units(Units("mm", "N"), length=1e3, force=1e3)
        assert other.units == Units("mm", "N")
        assert other.total_weight == pytest.approx(base.total_weight * 1e3)
        factors = [1e3] * 3 + [1e6] * 3
        np.testing.assert_allclose(other.live_forces, base.live_forces * factors)
        np.testing.assert_allclose(other.dead_forces, base.dead_forces * factors)
        np.testing.assert_allclose(other.contacts.area, base.contacts.area * 1e6)
        assert other.contacts.names == base.contacts.names

    @pytest.mark.parametrize(("unit", "times", "said"), [
        ("m", 1.0, ""), ("mm", 1000.0, ""), ("furlong", 1000.0, ""),
        ("m", 1000.0, "is 1.73e+03 m across: are coordinates in m?"),
    ])  # fmt: skip
    def test_stones_of_no_quarry_are_told(self, unit: str, times: float, said: str) -> None:
        found = scene().in_units(Units(unit, "kN"), times, 1.0)
        assert said in " ".join(found.told)
        assert bool(found.told) == bool(said)

    def test_scaled_contacts_are_those_of_the_scaled_scene(self) -> None:
        base = builtin_scene("arch")
        scaled = base.contacts.scaled(1e3)
        found = base.in_units(Units("mm", "kN"), 1e3, 1.0).contacts
        np.testing.assert_allclose(scaled.area, found.area)
        np.testing.assert_allclose(scaled.torsion_arm, found.torsion_arm)
        np.testing.assert_allclose(scaled.corner_points, found.corner_points, atol=1e-9)


FAR = Block.box("far", (5, 5, 5), (6, 6, 6), density=1.0)
BARE = Block.box("bare", (0, 0, 1.5), (1, 1, 2))

REFUSALS: dict[str, tuple[Callable[[], Any], str]] = {
    "duplicate id": (
        lambda: scene(blocks=(GROUND, LOWER, LOWER)),
        "block id 'lower' is used twice",
    ),
    "unknown support": (lambda: scene(supports=("floor",)), "support 'floor' is not a block"),
    "support twice": (
        lambda: scene(supports=("ground", "ground")),
        "support 'ground' is listed twice",
    ),
    "no free block": (
        lambda: scene(supports=("ground", "lower", "upper"), name="wall"),
        "scene 'wall' has no free block",
    ),
    "no blocks": (lambda: scene(blocks=(), supports=()), "scene 'scene' has no free block"),
    "no density": (
        lambda: scene(blocks=(GROUND, LOWER, UPPER, BARE)),
        "free block 'bare' has no density",
    ),
    "zero live load": (
        lambda: scene(live=Load(acceleration=(0, 0, 0))),
        "the live load is zero everywhere",
    ),
    "no live load": (lambda: scene(live=Load()), "the live load is zero everywhere"),
    "negative friction": (
        lambda: scene(friction=-0.1),
        "friction of the scene must be finite and not negative, got -0.1",
    ),
    "NaN friction": (lambda: scene(friction=float("nan")), "friction of the scene.*nan"),
    "text friction": (lambda: scene(friction="0.7"), "friction of the scene.*'0.7'"),
    "negative contact friction": (
        lambda: scene(contact_friction={("lower", "upper"): -0.2}),
        "friction of contact 'lower'-'upper' must be finite and not negative, got -0.2",
    ),
    "friction of an unknown block": (
        lambda: scene(contact_friction={("lower", "roof"): 0.2}),
        "contact 'lower'-'roof', but there is no block 'roof'",
    ),
    "friction given twice": (
        lambda: scene(contact_friction={("lower", "upper"): 0.2, ("upper", "lower"): 0.3}),
        "friction of contact 'lower'-'upper' is given twice",
    ),
    "friction of blocks apart": (
        lambda: scene(contact_friction={("ground", "upper"): 0.2}).contacts,
        "contact 'ground'-'upper', but these blocks do not touch",
    ),
    "friction of blocks apart, later": (
        lambda: scene().with_friction(0.5, {("upper", "ground"): 0.2}).contacts,
        "contact 'ground'-'upper', but these blocks do not touch",
    ),
    "support misspelt": (
        lambda: scene(supports=("gruond",)),
        "support 'gruond' is not a block of the scene; did you mean 'ground'",
    ),
    "live load on a block misspelt": (
        lambda: scene(live=Load(forces={"Upper": (1, 0, 0, 0, 0, 0)})),
        "names block 'Upper', which is not in the scene; did you mean 'upper'",
    ),
    "live load on a stranger": (
        lambda: scene(live=Load(forces={"roof": (1, 0, 0, 0, 0, 0)})),
        "the live load names block 'roof', which is not in the scene",
    ),
    "dead load on a support": (
        lambda: scene(dead=Load(forces={"ground": (1, 0, 0, 0, 0, 0)})),
        "the dead load acts on block 'ground', which is a support",
    ),
    "force of three": (
        lambda: Load(forces={"lower": (1, 0, 0)}),
        r"force on block 'lower' must be 6 numbers, got \(1, 0, 0\)",
    ),
    "NaN force": (
        lambda: Load(forces={"lower": (np.nan, 0, 0, 0, 0, 0)}),
        "force on block 'lower' must be finite.*nan",
    ),
    "gravity in m/s2": (
        lambda: Load(gravity=(0, 0, -9.81)),
        r"gravity must be a unit vector, got \[0.0, 0.0, -9.81\]",
    ),
    "NaN acceleration": (
        lambda: Load(acceleration=(0, np.nan, 0)),
        "acceleration must be finite.*nan",
    ),
    "acceleration of two": (
        lambda: Load(acceleration=(0, 1)),
        r"acceleration must be 3 numbers, got \(0, 1\)",
    ),
    "loose block": (
        lambda: scene(blocks=(GROUND, LOWER, UPPER, FAR)).contacts,
        "block 'far' .*touches no other block",
    ),
    "shared volume": (
        lambda: scene(blocks=(GROUND, LOWER, Block.box("b", (0, 0, 0.2), (1, 1, 1), 1.0))).contacts,
        "blocks 'lower' and 'b' interpenetrate by about 0.3",
    ),
}


@pytest.mark.parametrize(("make", "message"), REFUSALS.values(), ids=REFUSALS.keys())
def test_refusals_name_the_object_and_the_value(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        make()
    assert isinstance(caught.value, CvxlimitError)
    assert isinstance(caught.value, ValueError)


def test_what_a_scene_has_shows_itself_in_one_line() -> None:
    """A terminal's width or little more, however many contacts there are."""
    scene = builtin_scene("tuff-wall")
    assert repr(scene.contacts).startswith(f"Contacts({len(scene.contacts)}: '")
    assert repr(builtin_scene("single-block").contacts) == "Contacts(1: 'ground-b1')"
    assert repr(scene.live) == "Load(acceleration=(0.0, 1.0, 0.0))"
    assert repr(Load(forces={"b": (1, 0, 0, 0, 0, 0)})) == (
        "Load(forces={'b': (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)})"
    )
    for each in (scene, scene.contacts, scene.explain()):
        assert len(repr(each)) < 160


def test_what_a_scene_has_shows_itself_in_notebooks_as_a_table() -> None:
    scene = builtin_scene("tuff-wall")
    texts = [each._repr_html_() for each in (scene.contacts, scene.live, scene.explain())]
    assert all(len(text) < 3000 for text in texts)
    assert "146 contacts" in texts[0]
    assert scene.contacts.names[0] in texts[0]
    assert "(0.0, 1.0, 0.0)" in texts[1]
    assert "other methods" in texts[2]
    loaded = Load(points=[PointForce("<b>", (0, 0, 1), (1, 0, 0))], weights={"<i>": (0, 0, -1)})
    assert "<b>" not in loaded._repr_html_()
    assert "&lt;i&gt;" in loaded._repr_html_()


@pytest.mark.parametrize(
    ("times", "unit", "meant"),
    [
        (1000.0, "m", "mm"),
        (100.0, "m", "cm"),
        (1.0, "m", ""),
        (1000.0, "mm", ""),
        (1e6, "mm", "mm"),
    ],
)
def test_lengths_of_hills_ask_for_the_unit(times: float, unit: str, meant: str) -> None:
    """Bricks of 0.5 m in a wall of 3 m, in a unit that is not theirs; (1e6, "mm") is a file in
    micrometres, for which no unit is named that would do."""
    built = stack(6, size=(0.3, 0.2, 0.5))
    read = Scene(
        [block.scaled(times) for block in built.blocks],
        built.supports, Load(acceleration=(1, 0, 0)), units=Units(unit, "kN"),
    )  # fmt: skip
    assert len(read.told) == bool(meant)
    if meant:
        cure = f"? In {meant} the largest block would have 0." if meant != unit else "?"
        assert f"are coordinates in {unit}{cure}" in read.told[0]
        assert read.told[0] in solve(read).note


def test_friction_in_degrees_is_remarked_wherever_it_stands() -> None:
    built = stack(2)
    for rough in (
        built.with_friction(31.0),
        built.with_friction(0.6, {("b1", "b2"): 31.0}),
    ):
        said = "friction 31 is 88.2 degrees: in degrees? tan 31 = 0.60"
        assert said in rough.told
        assert said in solve(rough).note
    assert built.with_friction(200.0).told == ("friction 200 is 89.7 degrees",)
    assert built.with_friction(1.5).told == ()
