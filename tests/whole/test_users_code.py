"""What users write outside the package: surfaces and formulations of their own, certified."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cvxlimit
from cvxlimit import Block, Load, Scene, builtin_scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.extensions.interaction.relaxation.upper import UpperBound
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.masonry import single_block
from cvxlimit.methods.driver import Run
from cvxlimit.model.formulations import ForceModel, Part, vertex_forces
from cvxlimit.readings.moments import SIGNED
from cvxlimit.solution import Status
from cvxlimit.solvers import default_ladder
from cvxlimit.surfaces import Condition, Facets, Norm, Rocking, YieldSurface
from helpers import assert_certified, contact_of, regular

# A cohesive surface, as a user would write it.


class Mortar(YieldSurface):
    """abs(MT) / c_T + abs(V) <= mu N + c A."""

    name = "mortar"

    def __init__(self, cohesion: float) -> None:
        super().__init__()
        self.cohesion = cohesion

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        norms = [Norm({"MT": 1 / contacts.torsion_arm}), Norm({"V1": 1}, {"V2": 1})]
        resistance = {"N": contacts.friction, "1": self.cohesion * contacts.area}
        return [Condition(norms, resistance)]


def closed_form(scene: Scene, cohesion: float) -> float:
    """A block pushed along x slides at mu + c A / W, and tips about its edge at length / height."""
    block = scene.blocks[int(scene.free[0])]
    length, _, height = np.ptp(block.vertices, axis=0)
    area = float(np.prod(np.ptp(block.vertices, axis=0)[:2]))
    return min(scene.friction + cohesion * area / block.weight, length / height)


@given(
    cohesion=st.floats(0.0, 5.0).map(lambda c: round(c, 3)),
    height=st.floats(0.2, 3.0),
    friction=st.sampled_from([0.0, 0.05, 0.3, 0.7, 1.0]),
    unit=st.sampled_from([1e-3, 1.0, 1e3]),
)
@settings(max_examples=25, deadline=None)
def test_cohesion_against_the_closed_form(
    cohesion: float, height: float, friction: float, unit: float
) -> None:
    """In any unit of length and force: strengths are the user's."""
    scene = single_block((1.0, 0.6, height), friction=friction)
    expected = closed_form(scene, cohesion)
    other = scene.in_units(scene.units, unit, 7.0)
    for solved in (
        solve(scene.with_cohesion(cohesion)),
        solve(scene, [Rocking(), Mortar(cohesion)]),
        solve(other, [Rocking(), Mortar(cohesion * 7.0 / unit**2)]),
        solve(scene.with_cohesion(cohesion).in_units(scene.units, unit, 7.0)),
    ):
        assert_certified(solved, proved=False)
        assert solved.load_factor == pytest.approx(expected, rel=1e-5, abs=1e-6)
        assert solved.lower <= expected + 1e-9
        assert solved.upper >= expected - 1e-9


class TestCohesion:
    def test_facets_err_to_either_side(self) -> None:
        scene = single_block((1.0, 1.0, 0.2), live=Load(acceleration=(0.6, 0.8, 0)))
        low, exact, high = (
            solve(scene.with_cohesion(1.0), surface).load_factor
            for surface in ("octagon-inscribed", "conic", "octagon")
        )
        assert low < exact < high

    def test_a_wall_gains_nothing_from_none_and_tips_on_much(self) -> None:
        """Rocking bounds what cohesion can add: tension is not carried."""
        scene = builtin_scene("ferris-tin-loi-1")
        factors = [solve(scene.with_cohesion(c)).load_factor for c in (0.0, 0.5, 1e6, 1e7)]
        assert factors[0] == pytest.approx(0.642859, rel=1e-5)
        assert factors[0] < factors[1] < factors[2] == pytest.approx(factors[3], rel=1e-6)

    def test_a_load_that_only_cohesion_stops_is_not_harmless(self) -> None:
        """Sliding along an icy floor: c A / 1, and the dead load's weight does not matter."""
        scene = single_block((1.0, 1.0, 1.0), friction=0.0, live=Load(acceleration=(1, 0, 0)))
        solution = solve(scene.with_cohesion(0.25))
        assert_certified(solution, proved=False)
        assert solution.load_factor == pytest.approx(min(0.25 / scene.total_weight, 1.0), rel=1e-6)

    def test_a_dead_load_that_cohesion_cannot_hold_falls(self) -> None:
        """A block leaning on a vertical wall with its end face: c A must carry the weight."""
        wall = Block.box("wall", (-1, 0, 0), (0, 1, 1))
        clamp = Block.box("clamp", (1, 0, 0), (2, 1, 1))
        block = Block.box("block", (0, 0, 0), (1, 1, 1), density=1.0)
        live = Load(acceleration=(0, 1, 0))
        scene = Scene([wall, clamp, block], ["wall", "clamp"], live, friction=0.0)
        weak, strong = solve(scene.with_cohesion(0.4)), solve(scene.with_cohesion(0.6))
        assert weak.status is Status.DEAD_LOAD_UNSTABLE
        assert strong.status is not Status.DEAD_LOAD_UNSTABLE
        assert strong.lower <= np.sqrt(1.2**2 - 1.0) <= strong.upper + 1e-9  # both faces, 0.6 each


# Vertex forces: Coulomb friction at every corner of the contact.


class TestVertexForces:
    @pytest.mark.parametrize("name", ["single-block", "stack", "ferris-tin-loi-1", "tuff-wall"])
    def test_the_hull_of_signed_interaction(self, name: str) -> None:
        """Friction at the corners is the convex hull of signed torsion-shear-bending: another
        module finds the same number from copies of contacts."""
        scene = builtin_scene(name)
        solution = solve(scene, [Rocking()], formulation=vertex_forces)
        assert_certified(solution, scene)
        run = Run(scene, moments=SIGNED)
        UpperBound(run).search(1e-8, default_ladder())
        assert solution.load_factor == pytest.approx(run.best.bracket.upper, rel=1e-5)

    def test_pure_torsion_of_a_square(self) -> None:
        """All friction at the corners, half the diagonal away: 1.85 times c_T."""
        block = Block.box("block", (0, 0, 0), (1, 1, 0.1), density=10.0)
        ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
        twist = Load(forces={"block": (0, 0, 0, 0, 0, 1.0)})
        scene = Scene([ground, block], ["ground"], twist, friction=0.5)
        solution = solve(scene, [Rocking()], formulation=vertex_forces)
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(0.5 * np.sqrt(0.5), rel=1e-6)
        assert solution.load_factor / solve(scene).load_factor == pytest.approx(1.848, abs=1e-3)

    def test_rocking_alone_is_another_model(self) -> None:
        """Without friction at the corners nothing bounds shear: the block tips, at 1 / 0.2."""
        scene = single_block((1.0, 1.0, 0.2), friction=0.3)
        assert solve(scene, [Rocking()]).load_factor == pytest.approx(5.0, rel=1e-6)
        solution = solve(scene, [Rocking()], formulation=vertex_forces)
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(0.3, rel=1e-6)

    def test_excess_is_checked_at_corners(self) -> None:
        model = vertex_forces(contact_of(regular(5), friction=0.5))
        rng = np.random.default_rng(0)
        pressed, shear = rng.random(5), 0.4 * rng.random((2, 5))
        values = model.values(np.concatenate([pressed, *shear]))
        np.testing.assert_allclose(values["N"], pressed.sum())
        np.testing.assert_allclose(values["V1"], shear[0].sum())


# A planar formulation: two corners and one shear per contact, no torsion.


@cache
def across(seed: int = 0) -> np.ndarray:
    return np.array([0.0, 1.0, 0.0])


def planar(contacts: Contacts) -> ForceModel:
    """For scenes in the x-z plane: compressions at a contact's two ends, and one shear."""
    n, each = len(contacts), np.arange(len(contacts))
    along = np.cross(np.array([0.0, 1.0, 0.0]), contacts.axes[:, 2])
    direction = np.einsum("nik,nk->ni", contacts.axes[:, :2], along)
    reach = np.einsum("mi,mi->m", contacts.corner_xy, direction[contacts.corner_contact])
    far, near = np.full(n, -np.inf), np.full(n, np.inf)
    np.maximum.at(far, contacts.corner_contact, reach)
    np.minimum.at(near, contacts.corner_contact, reach)
    ends = np.concatenate([near, far])[:, None] * np.tile(direction, (2, 1))
    x, y = ends.T
    return ForceModel(
        contacts,
        [
            Part("n", {"N": 1, "M1": y, "M2": -x}, np.tile(each, 2), nonneg=True),
            Part("V", {"V1": direction[:, 0], "V2": direction[:, 1]}, each),
        ],
    )


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("ferris-tin-loi-1", 0.642859),
        ("ferris-tin-loi-2", 0.579999),
        ("ferris-tin-loi-3", 0.403694),
        ("arch", None),
    ],
)
@pytest.mark.parametrize("surface", ["conic", "octagon"])
def test_planar_scenes_need_three_forces_per_contact(
    name: str, expected: float | None, surface: str
) -> None:
    """Certified against the whole scene's surfaces, with a quarter fewer unknowns and no rows
    across the plane."""
    scene = builtin_scene(name)
    solution, whole = solve(scene, surface, formulation=planar), solve(scene, surface)
    assert_certified(solution, scene)
    apart = max(solution.lower, whole.lower) - min(solution.upper, whole.upper)
    assert apart <= 1e-9 * whole.upper  # both brackets hold the same number, rounding apart
    if expected is not None:
        assert solution.load_factor == pytest.approx(expected, rel=1e-5)


def test_a_planar_formulation_out_of_its_plane_is_not_certified() -> None:
    """It restricts forces; what it misses shows as a bracket that stays open, never as a number."""
    scene = single_block((1.0, 1.0, 1.0), live=Load(acceleration=(0.0, 1.0, 0.0)))
    solution = solve(scene, formulation=planar)
    assert solution.status is not Status.CERTIFIED
    assert solution.lower <= 0.7 <= solution.upper


class TestRefusals:
    def test_parts_by_name(self) -> None:
        contacts = contact_of(regular(4))
        for parts, message in (
            ([Part("n", {"Nn": 1}, np.array([0]))], "'n' gives 'Nn', which is no force component"),
            ([Part("n", {"N": 1}, np.array([0]))] * 2, "names of their own"),
        ):
            with pytest.raises(Exception, match=message):
                ForceModel(contacts, parts)

    def test_conditions_of_the_wrong_length(self) -> None:
        contacts = contact_of(regular(4))
        parts = [Part("n", {"N": 1}, contacts.corner_contact, nonneg=True)]
        model = ForceModel(contacts, parts, [Condition([], {"n": 1})])
        with pytest.raises(ModelError, match="has 1 rows where 'n' has 4 entries"):
            model.all_conditions([Rocking()])

    def test_what_is_no_formulation(self) -> None:
        with pytest.raises(ModelError, match="function from contacts to a ForceModel"):
            solve(single_block(), formulation=len)  # type: ignore[arg-type]

    def test_facets_at_corners(self) -> None:
        """The formulation's own cone may be a polygon as well."""

        def octagon(contacts: Contacts) -> ForceModel:
            model = vertex_forces(contacts)
            return ForceModel(contacts, model.parts, model.conditions, cone=Facets.circumscribed(8))

        scene = single_block((1.0, 1.0, 0.2), live=Load(acceleration=(1, 0.2, 0)))
        exact = solve(scene, [Rocking()], formulation=vertex_forces)
        facets = solve(scene, [Rocking()], formulation=octagon)
        assert_certified(facets, scene)
        assert exact.load_factor < facets.load_factor < 1.083 * exact.load_factor


def test_tab_completion_offers_public_names_and_python_can_suggest_them() -> None:
    offered = [name for name in dir(cvxlimit) if not name.startswith("_")]
    assert sorted(offered) == sorted(set(cvxlimit.__all__) - {"__version__"})
    with pytest.raises(AttributeError) as caught:
        cvxlimit.slove  # noqa: B018
    assert caught.value.name == "slove"  # from these two Python asks: did you mean 'solve'?
    assert caught.value.obj is cvxlimit
