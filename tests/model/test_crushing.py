"""Joints that crush: effective rectangle and plastic field, against closed forms and each other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cvxlimit import Block, Contacts, Load, Scene, Status, builtin_scene, solve
from cvxlimit.errors import InputError, ModelError
from cvxlimit.io import read_scene, write_scene
from cvxlimit.masonry import single_block
from cvxlimit.model.crushing import PlasticField
from cvxlimit.model.formulations import Formulation, corner_compressions, resultants
from cvxlimit.model.point_friction import PointFriction, at_centroids, at_corners
from cvxlimit.plotting import plot
from cvxlimit.plotting.annotations import crushed_zones
from cvxlimit.surfaces import Condition, Norm, ParabolicTorsionShear, Rocking, YieldSurface
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES
from helpers import assert_certified, regular, renumbered, rotations

FloatArray = NDArray[np.float64]


def pushed(length: float, width: float, height: float, pressure: float) -> tuple[Scene, float]:
    """A block pushed at mid height on a joint that bears so many times its mean pressure, and
    (l - W / (f b)) / h."""
    scene = single_block((length, width, height), friction=10.0)
    strength = pressure * scene.total_weight / (length * width)
    expected = (length - scene.total_weight / (strength * width)) / height
    return scene.with_strength(compressive=strength), expected


class PlanarCrushing(YieldSurface):
    """N^2 <= f A (N - 2 abs(M2) / l1): one cone for either sign, exact in the plane of t1."""

    name = "planar crushing"

    def __init__(self, strength: float) -> None:
        super().__init__()
        self.strength = strength

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        most = self.strength * contacts.area
        found = []
        for slope in (2.0 / contacts.sides[:, 0], -2.0 / contacts.sides[:, 0]):
            inside = {"N": 1.0, "M2": slope}
            norm = Norm({"N": 2.0}, {**inside, "1": -most})
            found.append(Condition([norm], {**inside, "1": most}))
        return found


class TestClosedForm:
    @pytest.mark.parametrize("pressure", [1.2, 2.0, 20.0, 1e3, 1e5])
    def test_block_on_a_weak_joint(self, pressure: float) -> None:
        scene, expected = pushed(1.0, 0.6, 3.0, pressure)
        solution = solve(scene)
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(expected, rel=1e-6)

    @pytest.mark.exhaustive
    @given(pressure=st.floats(1.1, 50.0), width=st.floats(0.2, 2.0), unit=st.sampled_from([1e3, 1]))
    @settings(max_examples=5, deadline=None)
    def test_any_size_and_unit(self, pressure: float, width: float, unit: float) -> None:
        scene, expected = pushed(1.0, width, 2.0, pressure)
        solution = solve(scene.in_units(scene.units, unit, 7.0))
        assert solution.load_factor == pytest.approx(expected, rel=1e-6)

    def test_one_cone_in_the_plane(self) -> None:
        scene, expected = pushed(1.0, 0.6, 3.0, 2.0)
        strength = scene.compressive_strength
        rigid = scene.with_strength(compressive=np.inf)
        surfaces = [*DEFAULT_SURFACES, PlanarCrushing(strength)]
        solution = solve(rigid, surfaces)
        assert_certified(solution, proved=False)
        assert solution.load_factor == pytest.approx(expected, rel=1e-6)

    def test_pushed_along_the_diagonal(self) -> None:
        """N = f (l - 2 e)^2 with e = alpha h / (2 sqrt 2) both ways."""
        scene, _ = pushed(1.0, 1.0, 2.0, 4.0)
        scene = scene.with_live(Load(acceleration=(0.5**0.5, 0.5**0.5, 0.0)))
        solution = solve(scene)
        assert_certified(solution)
        assert solution.load_factor == pytest.approx((1.0 - 0.5) / 2.0 * 2**0.5, rel=1e-6)

    def test_too_heavy(self) -> None:
        scene, _ = pushed(1.0, 1.0, 2.0, 0.99)
        assert solve(scene).status is Status.DEAD_LOAD_UNSTABLE

    def test_pressing_is_harmful_now(self) -> None:
        """A push into the ground crushes at f A / W - 1; of a rigid joint it does no harm."""
        scene, _ = pushed(1.0, 1.0, 2.0, 3.0)
        down = scene.with_live(Load(acceleration=(0.0, 0.0, -1.0)))
        solution = solve(down)
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(2.0, rel=1e-6)
        rigid = down.with_strength(compressive=np.inf)
        assert solve(rigid).status is Status.LIVE_LOAD_HARMLESS


def field(placing: object, divisions: int) -> Formulation:
    return PlasticField(corner_compressions, placing, divisions)  # type: ignore[arg-type]


class TestPlasticField:
    def test_eccentric_both_ways(self) -> None:
        """At e = l / 5 both ways a square bears (1 - 0.4)^2 f A on its effective square, and more
        under a plastic field."""
        block = Block.box("block", (0, 0, 0), (1, 1, 1), density=1e-6)
        ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
        live = Load(forces={"block": (0, 0, -1, -0.2, 0.2, 0)})
        scene = Scene([ground, block], ["ground"], live).with_strength(compressive=1.0)
        effective = solve(scene)
        assert effective.load_factor == pytest.approx(0.36, rel=1e-4)
        inner, outer = (solve(scene, formulation=field(p, 12)) for p in (at_centroids, at_corners))
        assert effective.load_factor < inner.load_factor < outer.load_factor

    @pytest.mark.exhaustive_cases("ferris-tin-loi-1")
    @pytest.mark.parametrize("name", ["ferris-tin-loi-1", "arch"])
    def test_effective_below_plastic_below_rigid(self, name: str) -> None:
        scene = builtin_scene(name)
        mean = scene.total_weight / scene.contacts.area.sum()
        factors, rigid = [], solve(scene)
        for multiple in (100.0, 1e4):
            weak = scene.with_strength(compressive=multiple * mean)
            effective, outer = solve(weak), solve(weak, formulation=field(at_corners, 4))
            for solution in (effective, outer):
                assert_certified(solution)
            assert effective.lower <= outer.upper
            assert outer.lower <= rigid.upper
            factors.append(effective.load_factor)
        assert factors[0] < factors[1] < rigid.upper
        assert factors[1] == pytest.approx(rigid.load_factor, rel=1e-2)  # 3e-3 at 1e4 times

    def test_cells_from_inside_corners_from_outside(self) -> None:
        scene, expected = pushed(1.0, 0.6, 3.0, 2.0)
        errors = []
        for divisions in (5, 15):
            inner, outer = (
                solve(scene, formulation=field(p, divisions)).load_factor
                for p in (at_centroids, at_corners)
            )
            assert inner <= expected * (1 + 1e-6)
            assert outer >= expected * (1 - 1e-6)
            errors.append(outer - inner)
        assert errors[1] < errors[0] / 4.0

    def test_any_polygon(self) -> None:
        """A hexagonal prism, automatically on cells; the field's corners bound it from above."""
        ring = [np.column_stack([regular(6), np.full(6, z)]) for z in (0.0, 2.0)]
        prism = Block.hull("prism", np.vstack(ring), density=1.0)
        ground = Block.box("ground", (-3, -3, -1), (3, 3, 0))
        scene = Scene([ground, prism], ["ground"], Load(acceleration=(1, 0, 0)), friction=5.0)
        weak = scene.with_strength(compressive=3.0 * scene.total_weight / scene.contacts.area[0])
        inner, outer = solve(weak), solve(weak, formulation=field(at_corners, 6))
        assert_certified(inner, proved=False)  # its note says more than that
        assert inner.is_proved
        assert inner.note.startswith("both bounds are proved, up to rounding; ")
        assert "constant on cells, 8 across" in inner.note
        assert inner.load_factor < outer.load_factor < solve(scene).load_factor
        assert inner.load_factor == pytest.approx(outer.load_factor, rel=0.05)

    def test_vertex_forces_have_no_field(self) -> None:
        def vertex(contacts: Contacts):  # type: ignore[no-untyped-def]
            model = PointFriction(at_corners, 1)(contacts)
            j = contacts.corner_contact
            own = Condition([Norm({"v1": 1})], {"n": 1.0}, j)
            return type(model)(contacts, model.parts, [own])

        with pytest.raises(ModelError, match="no compressions at corners that a field"):
            PlasticField(vertex)(pushed(1.0, 1.0, 1.0, 2.0)[0].contacts)


class TestTogether:
    @pytest.mark.parametrize(
        ("surface", "method"), [("conic", "convex"), ("parabolic", "convex"), ("conic", "exact")]
    )
    def test_with_every_torsion_shear(self, surface: str, method: str) -> None:
        scene, expected = pushed(1.0, 0.6, 3.0, 2.0)
        solution = solve(scene, surface, method)
        assert_certified(solution, proved=False, tolerance=1e-3)
        assert solution.load_factor == pytest.approx(expected, rel=1e-3)

    @pytest.mark.exhaustive
    def test_with_cohesion_and_facets(self) -> None:
        """A low block slides at mu + c A / W before it crushes."""
        scene = single_block((1.0, 1.0, 0.2), friction=0.3)
        weight = scene.total_weight
        weak = scene.with_strength(compressive=50.0 * weight).with_cohesion(0.2 * weight)
        for surface in ("conic", "octagon", [Rocking(), ParabolicTorsionShear()]):
            solution = solve(weak, surface)
            assert_certified(solution)
            assert solution.load_factor == pytest.approx(0.5, rel=1e-6)

    def test_with_resultants(self) -> None:
        """No internal force is a compression there, nor has to be."""
        scene, expected = pushed(1.0, 0.6, 3.0, 2.0)
        solution = solve(scene, formulation=resultants)
        assert_certified(solution, proved=False)  # rates that open the joint are not always found
        assert solution.load_factor == pytest.approx(expected, rel=1e-6)

    @pytest.mark.exhaustive
    @given(turn=rotations(), seed=st.integers(0, 100))
    @settings(max_examples=2, deadline=None)
    def test_rotation_and_renumbering(self, turn: FloatArray, seed: int) -> None:
        scene = builtin_scene("arch").with_strength(compressive=200.0)
        expected = solve(scene).load_factor
        turned = renumbered(builtin_scene("arch"), seed).with_strength(compressive=200.0)
        for other in (scene.moved(turn), turned):
            assert solve(other).load_factor == pytest.approx(expected, rel=2e-5)

    def test_not_with_interaction(self) -> None:
        scene, _ = pushed(1.0, 1.0, 2.0, 2.0)
        with pytest.raises(ModelError, match="knows no strength of stone"):
            solve(scene, method="certified")


class TestScene:
    def test_files_keep_strengths(self, tmp_path: Path) -> None:
        scene = builtin_scene("stack").with_cohesion(0.5).with_strength(20.0, 0.25)
        a, b = (scene.blocks[i].id for i in scene.free[:2])
        scene = type(scene)(
            scene.blocks, scene.supports, scene.live, contact_friction={(a, b): 0.1},
            cohesion=0.5, contact_cohesion={(a, b): 0.75}, compressive_strength=20.0,
            contact_compressive_strength={(b, a): 5.0}, tensile_strength=0.25,
            contact_tensile_strength={(a, b): 0.0},
        )  # fmt: skip
        write_scene(scene, tmp_path / "s.json")
        again = read_scene(tmp_path / "s.json")
        for what in ("cohesion", "compressive_strength", "tensile_strength", "friction"):
            np.testing.assert_array_equal(
                getattr(again.contacts, what), getattr(scene.contacts, what)
            )
        assert sorted(set(again.contacts.compressive_strength)) == [5.0, 20.0]

    def test_strengths_in_other_units(self) -> None:
        scene = builtin_scene("stack").with_strength(20.0, 0.25)
        other = scene.in_units(scene.units, 10.0, 3.0)
        assert other.compressive_strength == pytest.approx(0.6)
        assert other.tensile_strength == pytest.approx(0.0075)

    @pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "much"])
    def test_refused(self, value: object) -> None:
        with pytest.raises(InputError, match="compressive_strength of the scene must be"):
            builtin_scene("stack").with_strength(compressive=value)  # type: ignore[arg-type]


class TestPicture:
    @pytest.mark.exhaustive
    def test_crushed_zone_by_hand(self, tmp_path: Path) -> None:
        """A block of b x l = 0.4 x 0.4 tips about its crushed toe, N / (f l) wide along x."""
        scene = builtin_scene("single-block").with_strength(compressive=200.0)
        solution = solve(scene)
        (zone,) = crushed_zones(scene, solution.forces).values()
        width = scene.total_weight / (200.0 * 0.4)
        along = zone[:, 0]
        assert along.min() == pytest.approx(0.4 - width, abs=1e-4)
        assert along.max() == pytest.approx(0.4, abs=1e-4)
        np.testing.assert_allclose(np.ptp(zone[:, 1]), 0.4, atol=1e-4)
        plot(scene, solution, tmp_path / "crushed.png")
        assert (tmp_path / "crushed.png").stat().st_size > 0

    def test_nothing_crushes_where_stone_is_strong(self) -> None:
        """All contacts but the one that turns about its toe stay below their strength."""
        scene = builtin_scene("stack").with_strength(compressive=1e6)
        zones = crushed_zones(scene, solve(scene).forces)
        assert len(zones) <= 1
        assert not crushed_zones(builtin_scene("stack"), solve(builtin_scene("stack")).forces)
