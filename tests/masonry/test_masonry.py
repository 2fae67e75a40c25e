"""Generators and built-in scenes: published counts and load factors, sizes, refusals.

Scenes in the plane (x, z) are checked with the linear program of ``planar.py``, which uses nothing
of the package's solver.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import cvxlimit.masonry as masonry
from cvxlimit.errors import InputError
from cvxlimit.geometry.strengths import DEFAULT_FRICTION
from cvxlimit.masonry import (
    BUILTIN,
    arch,
    builtin_scene,
    panel,
    running_bond,
    single_block,
    stack,
    wall,
)
from cvxlimit.scene import Load, Scene
from planar import planar_load_factor

COUNTS = {
    "single-block": (1, 1),
    "stack": (5, 5),
    "ferris-tin-loi-1": (33, 83),
    "ferris-tin-loi-2": (55, 141),
    "ferris-tin-loi-3": (46, 102),
    "arch": (20, 21),
    "tuff-wall": (54, 146),
    "s12-panel": (314, 888),
    "s10-panel": (661, 1906),
    "facade": (127, 329),
    "house-corner": (146, 374),
    "arch-on-piers": (28, 29),
    "flying-buttress": (28, 29),
    "barrel-vault": (42, 103),
    "dome": (96, 192),
    "retaining-wall": (12, 19),
    "retaining-wall-shaken": (12, 19),
    "dam": (5, 5),
}
"""Free blocks and contacts; those of a dome and the head joints of a vault are trapezoids."""


class TestBuiltin:
    def test_names(self) -> None:
        assert list(BUILTIN) == list(COUNTS)

    @pytest.mark.parametrize("name", COUNTS)
    def test_published_counts(self, name: str) -> None:
        scene = builtin_scene(name)
        assert (len(scene.free), len(scene.contacts)) == COUNTS[name]
        assert scene.name == name
        assert scene.contacts.is_rectangle.all() != (name in ("barrel-vault", "dome"))

    @pytest.mark.parametrize("name", BUILTIN)
    def test_one_line_descriptions(self, name: str) -> None:
        description = BUILTIN[name].description
        assert 10 < len(description) < 90
        assert "\n" not in description

    def test_unknown_name_lists_the_known_ones(self) -> None:
        with pytest.raises(InputError, match=r"no built-in scene 'castle'.*single-block, stack"):
            builtin_scene("castle")

    def test_registry_cannot_be_changed(self) -> None:
        with pytest.raises(TypeError):
            BUILTIN["castle"] = BUILTIN["stack"]  # type: ignore[index]

    @pytest.mark.parametrize(
        ("name", "expected"),
        [
            ("single-block", 0.4),
            ("stack", 0.4),
            ("ferris-tin-loi-1", 0.642859),
            ("ferris-tin-loi-2", 0.579999),
            ("ferris-tin-loi-3", 0.403694),
        ],
    )
    def test_published_load_factors(self, name: str, expected: float) -> None:
        assert planar_load_factor(builtin_scene(name)) == pytest.approx(expected, rel=1e-5)

    def test_tuff_wall_as_described_in_the_paper(self) -> None:
        scene = builtin_scene("tuff-wall")
        corners = np.concatenate([scene.blocks[i].vertices for i in scene.free])
        np.testing.assert_allclose(np.ptp(corners, axis=0), [0.4, 0.1, 0.6])
        assert scene.total_weight == pytest.approx(0.4 * 0.1 * 0.6 * 12.1)
        held = [c for c in scene.contacts if c.a == "side-start"]
        assert len(held) == 12
        assert sum(c.area for c in held) == pytest.approx(0.1 * 0.6)
        assert scene.live.acceleration == (0.0, 1.0, 0.0)


class TestWalls:
    def test_running_bond(self) -> None:
        half, whole = [0.5, 1.0, 0.5], [1.0, 1.0]
        assert running_bond(2, 3) == [whole, half, whole]
        assert running_bond(2, 3, first="half") == [half, whole, half]
        assert running_bond(1, 2) == [[1.0], [0.5, 0.5]]

    def test_opening_leaves_a_gap_and_is_spanned(self) -> None:
        scene = wall([[1, -1, 1], [1.5, 1.5]], unit=(0.2, 0.1, 0.1))
        names = scene.contacts.names
        assert "b1.1-b1.2" not in names
        assert set(names) == {"ground-b1.1", "ground-b1.2", "b1.1-b2.1", "b1.2-b2.2", "b2.1-b2.2"}
        boxes = {block.id: block.bounds for block in scene.blocks}
        np.testing.assert_allclose(boxes["b1.2"], [[0.4, 0, 0], [0.6, 0.1, 0.1]])
        np.testing.assert_allclose(boxes["b2.1"], [[0, 0, 0.1], [0.3, 0.1, 0.2]])

    def test_side_supports_at_both_ends(self) -> None:
        scene = wall(running_bond(2, 2), side_supports=("end", "start"))
        assert scene.supports == ("ground", "side-start", "side-end")
        areas = {c.name: c.area for c in scene.contacts if "side" in c.name}
        assert len(areas) == 4
        assert list(areas.values()) == pytest.approx([0.2 * 0.175] * 4)

    def test_ragged_courses_make_a_stepped_wall(self) -> None:
        scene = wall([[1, 1, 1], [0.5, 1, 1], [1, 1], [0.5, 1], [1]])
        assert len(scene.contacts) > len(scene.free)

    def test_own_live_load_friction_and_name(self) -> None:
        live = Load(acceleration=(0, 1, 0))
        scene = wall([[1]], friction=0.2, live=live, name="mine", density=3.0)
        assert (scene.friction, scene.live, scene.name) == (0.2, live, "mine")
        assert scene.total_weight == pytest.approx(3.0 * 0.4 * 0.2 * 0.175)

    def test_a_lintel_on_nothing_is_refused_with_the_contacts(self) -> None:
        scene = wall([[1, -2], [-2, 1]])
        with pytest.raises(InputError, match=r"'b2.1'.*touches no other block"):
            _ = scene.contacts


class TestPanels:
    def test_volume_is_that_of_the_plan(self) -> None:
        scene = panel(0.80, 19, left_return=0.52)
        plan = 0.80 * 0.04 + (0.52 - 0.04) * 0.04
        assert scene.total_weight == pytest.approx(plan * 19 * 0.03 * 27.3)

    @pytest.mark.parametrize("sides", [{}, {"left_return": 0.3}, {"right_return": 0.3}])
    def test_bond_no_head_joint_runs_on_into_the_next_course(self, sides: dict[str, float]) -> None:
        scene = panel(0.6, 2, **sides)
        joints = {
            row: {round(b.bounds[0, 0], 6) for b in scene.blocks if b.id.startswith(f"f{row}.")}
            for row in (1, 2)
        }
        assert not (joints[1] & joints[2]) - {0.0}
        assert len(scene.contacts) > len(scene.free)

    def test_mirrored_panels_weigh_the_same_and_touch_as_much(self) -> None:
        left, right = panel(0.6, 4, left_return=0.3), panel(0.6, 4, right_return=0.3)
        assert left.total_weight == pytest.approx(right.total_weight)

    def test_last_brick_is_cut(self) -> None:
        scene = panel(0.20, 1)
        lengths = [np.ptp(b.bounds, axis=0)[0] for b in scene.blocks if b.id != "ground"]
        assert lengths == pytest.approx([0.08, 0.08, 0.04])

    def test_corner_alternates(self) -> None:
        scene = panel(0.24, 2, left_return=0.16)
        boxes = {block.id: block.bounds for block in scene.blocks}
        np.testing.assert_allclose(boxes["f1.1"][0], [0, 0, 0])
        np.testing.assert_allclose(boxes["l1.1"][0], [0, 0.04, 0])
        np.testing.assert_allclose(boxes["f2.1"][0], [0.04, 0, 0.03])
        np.testing.assert_allclose(boxes["l2.1"][0], [0, 0, 0.03])


class TestArches:
    def test_geometry(self) -> None:
        scene = arch(voussoirs=10, thickness_ratio=0.2, mean_radius=3.0, width=0.5)
        contacts = scene.contacts
        np.testing.assert_allclose(np.linalg.norm(contacts.origin[:, [0, 2]], axis=1), 3.0)
        np.testing.assert_allclose(contacts.area, 0.6 * 0.5)
        piece = np.sin(np.pi / 10.0) / 2.0 * (3.3**2 - 2.7**2) * 0.5
        np.testing.assert_allclose([scene.blocks[i].volume for i in scene.free], piece)
        radial = np.einsum("nc,nc->n", contacts.axes[:, 2], contacts.origin * [1, 0, 1])
        np.testing.assert_allclose(radial, 0.0, atol=1e-12)

    @pytest.mark.parametrize("embrace", [20.0, 90.0, 180.0, 250.0])
    def test_abutments_touch_the_springings_only(self, embrace: float) -> None:
        contacts = arch(voussoirs=7, embrace=embrace).contacts
        assert len(contacts) == 8
        held = [c.name for c in contacts if "abutment" in c.name]
        assert held == ["left-abutment-v1", "v7-right-abutment"]

    def test_an_even_number_has_a_joint_at_the_crown(self) -> None:
        crown = arch(voussoirs=6).contacts.origin[3]
        np.testing.assert_allclose(crown[[0, 2]], [0.0, 1.0], atol=1e-12)

    @pytest.mark.parametrize(("number", "least"), [(40, 0.107432), (100, 0.107456)])
    def test_least_thickness_of_the_semicircular_arch(self, number: int, least: float) -> None:
        standing = arch(number, least + 2e-6, friction=10.0)
        falling = arch(number, least - 2e-6, friction=10.0)
        assert planar_load_factor(standing) == pytest.approx(0.0, abs=1e-3)
        assert planar_load_factor(falling) is None

    def test_default_arch_stands_and_resists(self) -> None:
        assert planar_load_factor(builtin_scene("arch")) == pytest.approx(0.14935, rel=1e-4)

    def test_load_on_the_crown(self) -> None:
        scene = arch(voussoirs=21, live=Load(forces={"v11": (0, 0, -1, 0, 0, 0)}))
        factor = planar_load_factor(scene)
        assert factor is not None
        assert factor > 0.0


class TestStacks:
    @pytest.mark.parametrize(("length", "height", "mu"), [(0.3, 1.0, 0.7), (1.0, 0.5, 0.6)])
    def test_single_block_rocks_or_slides(self, length: float, height: float, mu: float) -> None:
        scene = single_block((length, 0.5, height), friction=mu)
        assert planar_load_factor(scene) == pytest.approx(min(length / height, mu))

    def test_stack_rocks_as_one(self) -> None:
        scene = stack(4, size=(0.5, 0.5, 0.5), friction=0.7)
        assert planar_load_factor(scene) == pytest.approx(0.25)

    @pytest.mark.parametrize("shift", [0.0, 0.1, 0.199, 0.25])
    def test_leaning_stack(self, shift: float) -> None:
        """What is above a joint rocks about its edge; below 0 the stack falls by itself."""
        length, height, number = 1.0, 0.2, 5
        scene = stack(number, (length, 1.0, height), shift=(shift, 0.0), friction=10.0)
        above = np.arange(1, number + 1)
        overhang = np.where(above < number, above + 1, number - 1) / 2.0 * shift
        expected = ((length / 2.0 - overhang) / (above * height / 2.0)).min()
        assert planar_load_factor(scene) == pytest.approx(expected)


NONSENSE: dict[str, tuple[Callable[[], Any], str]] = {
    "no units": (lambda: running_bond(0, 3), "whole_units must be a whole number.*got 0"),
    "half a course": (lambda: running_bond(2, 2.5), "courses must be a whole number.*2.5"),
    "unknown start": (lambda: running_bond(2, 2, first="third"), "'whole' or 'half', got 'third'"),
    "no courses": (lambda: wall([]), "the wall has no courses"),
    "empty course": (lambda: wall([[1], []]), r"course 2 of the wall has no block, got \[\]"),
    "only an opening": (lambda: wall([[1], [-1]]), r"course 2 of the wall has no block, got \[-1"),
    "zero length": (lambda: wall([[1, 0]]), r"course 1 of the wall.*not 0.*\[1, 0\]"),
    "NaN length": (lambda: wall([[1, float("nan")]]), "course 1 of the wall.*nan"),
    "text length": (lambda: wall([["long"]]), r"course 1 of the wall.*\['long'\]"),
    "number as course": (lambda: wall([1, 1]), "course 1 of the wall must list.*got 1"),
    "flat unit": (lambda: wall([[1]], (1, 0, 1)), "thickness of the unit must be above 0.*0.0"),
    "unit of two": (lambda: wall([[1]], (1, 1)), r"the unit \(length, thickness, height\) must be"),
    "no density": (lambda: wall([[1]], density=0), "density of the wall must be above 0.*got 0"),
    "side": (lambda: wall([[1]], side_supports=("left",)), "'start' and 'end', got 'left'"),
    "friction": (lambda: wall([[1]], friction=-1), "friction of the scene.*got -1"),
    "no front": (lambda: panel(0.0, 3), "front must be above 0, got 0.0"),
    "no panel courses": (lambda: panel(1.0, 0), "courses must be a whole number.*got 0"),
    "short front": (
        lambda: panel(0.08, 2, left_return=0.2, right_return=0.2),
        "front must be longer than the thickness of its returns, 0.08, got 0.08",
    ),
    "short return": (
        lambda: panel(1.0, 2, left_return=0.04),
        "left_return must be longer than the brick's thickness, 0.04, got 0.04; use 0",
    ),
    "negative return": (lambda: panel(1.0, 2, right_return=-1), "right_return must be above 0"),
    "no brick": (lambda: panel(1.0, 2, brick=(0.1, 0.1, -1)), "height of the brick.*got -1.0"),
    "no voussoirs": (lambda: arch(0), "voussoirs must be a whole number of at least 1, got 0"),
    "one voussoir": (lambda: arch(1), "voussoirs must each span less than 180 degrees, got 1 over"),
    "thin arch": (lambda: arch(10, 0.0), "thickness_ratio must be above 0, got 0.0"),
    "thick arch": (lambda: arch(10, 2.0), "thickness_ratio must be below 2, got 2"),
    "full circle": (lambda: arch(10, embrace=360), "embrace must be below 360 degrees, got 360"),
    "no radius": (lambda: arch(10, mean_radius=-1.0), "mean_radius must be above 0.*-1.0"),
    "no width": (lambda: arch(10, width=0.0), "width must be above 0, got 0.0"),
    "true is no number": (
        lambda: arch(10, width=True),
        "width must be a number, got True",
    ),
    "no blocks": (lambda: stack(0), "blocks must be a whole number of at least 1, got 0"),
    "no size": (lambda: stack(2, (1, 1, 0)), "height of the block must be above 0.*0.0"),
    "shift of three": (lambda: stack(2, shift=(1, 2, 3)), "shift must be 2 numbers"),
    "shifted off": (
        lambda: stack(2, (1, 1, 1), shift=(1.0, 0.0)).contacts,
        "'b2'.*touches no other block",
    ),
    "infinite block": (lambda: single_block((np.inf, 1, 1)), "the block.*must be finite"),
}


@pytest.mark.parametrize(("make", "message"), NONSENSE.values(), ids=NONSENSE.keys())
def test_nonsense_is_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_generators_and_scenes_have_one_friction_unless_it_is_stated() -> None:
    """Published scenes state theirs: they are what they are whatever the default is."""
    made = [getattr(masonry, name) for name in masonry.__all__]
    signatures = [inspect.signature(each).parameters for each in made if inspect.isroutine(each)]
    stated = [
        parameters["friction"].default for parameters in signatures if "friction" in parameters
    ]
    scene = single_block()
    assert {*stated, Scene(scene.blocks, scene.supports, scene.live).friction} == {DEFAULT_FRICTION}
    published = {"ferris-tin-loi-1": 0.65, "tuff-wall": 0.51, "s12-panel": 0.7, "s10-panel": 0.7}
    assert {name: builtin_scene(name).friction for name in published} == published
