"""No more model than a scene needs: reduced and full problems have the same certified answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cvxlimit import Block, Contacts, Load, Scene, Solution, Status, builtin_scene, explain, solve
from cvxlimit.errors import ModelError
from cvxlimit.io import read_result, write_result
from cvxlimit.masonry import arch, barrel_vault, panel, running_bond, single_block, stack, wall
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import LimitProgram
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.gluing import with_contacts
from cvxlimit.reductions import choice, planar
from cvxlimit.reductions.choice import Reductions
from cvxlimit.solvers import settings_for
from cvxlimit.studies import varied
from cvxlimit.surfaces import Condition, Norm, Rocking, YieldSurface
from cvxlimit.surfaces.coulomb import surfaces_of
from exhaustive import slow
from helpers import assert_certified, hand_equilibrium, yield_excess

SAME = 1e-6
"""Certified factors agree to this: each bracket is asked to be ten times narrower."""

SEEDS = st.integers(0, 2**16)


def both(scene: Scene, surface: str | Sequence[YieldSurface] = "conic") -> Solution:
    """The reduced answer, after comparison with the full one."""
    lean, full = (solve(scene, surface, model=m, tolerance=1e-7) for m in ("least", "full"))
    assert full.model == ()
    assert lean.status == full.status
    if lean.load_factor is not None and full.load_factor is not None:
        unit = max(abs(full.load_factor), 1e-3)
        assert abs(lean.load_factor - full.load_factor) <= SAME * unit
        assert lean.lower <= full.upper + SAME * unit
        assert full.lower <= lean.upper + SAME * unit
    return lean


def turned(scene: Scene, seed: int) -> Scene:
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    return scene.moved(turn, (3.0, -7.0, 1.0))


@st.composite
def planar_scenes(draw: st.DrawFn) -> Scene:
    push = Load(acceleration=(1.0, 0.0, draw(st.sampled_from([0.0, 0.2, -0.2]))))
    friction = draw(st.sampled_from([0.4, 0.6, 0.8]))
    kind = draw(st.sampled_from(["wall", "arch", "stack"]))
    if kind == "wall":
        courses = running_bond(draw(st.integers(1, 4)), draw(st.integers(1, 5)))
        return wall(courses, friction=friction, live=push)
    if kind == "arch":
        number = draw(st.integers(5, 9))
        return arch(number, 0.25, embrace=120.0, friction=max(friction, 0.6), live=push)
    return stack(draw(st.integers(1, 4)), shift=(0.02, 0.0), friction=friction, live=push)


class TestPlanar:
    @settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck))
    @given(planar_scenes(), SEEDS, st.sampled_from(["conic", "octagon"]))
    def test_in_any_orientation(self, scene: Scene, seed: int, surface: str) -> None:
        lean = both(turned(scene, seed), surface)
        assert lean.model == ("planar",)

    def test_forces_and_mechanism_are_those_of_the_full_scene(self) -> None:
        scene = turned(wall(running_bond(3, 4)), 5)
        solution = solve(scene, model="least")
        assert solution.model == ("planar",)
        assert_certified(solution, scene)

    @pytest.mark.parametrize(
        "scene",
        [
            wall(running_bond(2, 3), live=Load(acceleration=(1, 0, 0))),
            wall(running_bond(7, 10), friction=0.3, live=Load(acceleration=(1, 0, 0))),
            arch(160, live=Load(acceleration=(1, 0, 0))),
            wall(running_bond(9, 15), live=Load(acceleration=(1, 0, 0))),
            wall(running_bond(12, 20), live=Load(acceleration=(1, 0, 0))),
        ],
        ids=lambda scene: str(len(scene.contacts)),
    )
    def test_auto_takes_the_plane_of_one_problem_where_it_pays(self, scene: Scene) -> None:
        """And says so alike in solve, explain and the problem that is exported; both answers are
        in each other's bracket. Methods that solve many problems take it at any size."""
        pays = len(scene.contacts) >= choice.PLANAR_FROM
        auto, least = solve(scene), solve(scene, model="least")
        assert ("planar" in auto.model) is pays
        assert tuple(explain(scene).sizes)[1:] == auto.model
        if auto.status.has_answer:
            assert "planar" in least.model
            unit = SAME * abs(least.load_factor)
            assert auto.lower <= least.upper + unit
            assert least.lower <= auto.upper + unit
        found = Reductions.of(Assemblage.of(scene), surfaces_of("conic")[0])
        assert found.plane is not None

    @pytest.mark.parametrize("count", [3, 5, 6, 7, 10])
    def test_facets_are_planar_only_where_they_are_symmetric(self, count: int) -> None:
        """The friction of a polygon differs along its normals and corners; where the plane is
        neither, shear across it pays and the scene is not planar."""
        scene = wall(running_bond(2, 3), friction=0.35)
        for surface in (f"{count}-gon", f"{count}-gon-inscribed"):
            lean = both(scene, surface)
            assert (lean.model == ("planar",)) == (count % 2 == 0)

    def test_cohesion_is_two_rows_as_well(self) -> None:
        scene = turned(wall(running_bond(2, 4), friction=0.3), 1).with_cohesion(0.05)
        lean = both(scene)
        assert lean.model == ("planar",)
        dry = solve(scene.with_cohesion(0.0)).load_factor
        assert lean.load_factor is not None
        assert dry is not None
        assert lean.load_factor > dry * 1.001

    def test_different_thickness_about_one_plane(self) -> None:
        blocks = [
            Block.box("ground", (-1, -1, -1), (2, 1, 0)),
            Block.box("low", (0, -0.2, 0), (0.5, 0.2, 0.5), density=20.0),
            Block.box("high", (0.05, -0.1, 0.5), (0.4, 0.1, 1.2), density=25.0),
        ]
        scene = Scene(blocks, ["ground"], Load(acceleration=(1, 0, 0)), friction=0.6)
        assert both(turned(scene, 3)).model == ("planar",)

    @pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-2])
    @pytest.mark.parametrize("fault", ["push", "aside", "couple", "skew"])
    def test_nearly_planar_is_not_planar(self, fault: str, size: float) -> None:
        scene = stack(3, live=Load(acceleration=(1, 0, 0)))
        middle = scene.blocks[2]
        if fault == "push":
            scene = scene.with_live(Load(acceleration=(1.0, size, 0.0)))
        elif fault == "couple":
            couple = (0.0, 0.0, 0.0, size, 0.0, 0.0)
            scene = scene.with_live(Load(acceleration=(1, 0, 0), forces={middle.id: couple}))
        else:
            corners = middle.vertices.copy()
            where = slice(None) if fault == "aside" else corners[:, 2] > corners[:, 2].mean()
            corners[where, 1] += size
            other = Block.hull(middle.id, corners, density=middle.density)
            scene = replace(scene, blocks=(*scene.blocks[:2], other, *scene.blocks[3:]))
        lean = both(scene)
        assert "planar" not in lean.model

    def test_one_skew_block_in_a_wall(self) -> None:
        scene = wall(running_bond(2, 3))
        last = scene.blocks[-1]
        corners = last.vertices.copy()
        corners[corners[:, 2] > corners[:, 2].mean(), 1] += 0.03
        skew = Block.hull(last.id, corners, density=last.density)
        lean = both(replace(scene, blocks=(*scene.blocks[:-1], skew)))
        assert lean.model == ()
        assert both(scene).load_factor != lean.load_factor

    def test_ones_own_surface_where_it_can_be_proved(self) -> None:
        class Ellipse(YieldSurface):
            name = "ellipse"

            def conditions(self, contacts: Contacts) -> Sequence[Condition]:
                size = Norm({"V1": 1}, {"V2": 1}, {"MT": 1 / contacts.torsion_arm})
                return [Condition([size], {"N": contacts.friction})]

        class Ratchet(YieldSurface):
            """Slides more easily one way across the plane than the other."""

            name = "ratchet"

            def conditions(self, contacts: Contacts) -> Sequence[Condition]:
                size = Norm({"V1": 1}, {"V2": 1})
                aside = {"N": contacts.friction, "V1": 0.5, "V2": 0.5}
                return [Condition([size], aside)]

        scene = wall(running_bond(2, 3), friction=0.4)
        assert both(scene, [Rocking(), Ellipse()]).model == ("planar",)
        assert both(scene, [Rocking(), Ratchet()]).model == ()


class TestSymmetry:
    @settings(max_examples=5, deadline=None, suppress_health_check=list(HealthCheck))
    @given(SEEDS, st.booleans(), st.sampled_from([0.0, 0.3]))
    def test_half_of_a_panel(self, seed: int, is_even: bool, up: float) -> None:
        front = 0.32 if is_even else 0.4
        live = Load(acceleration=(0.0, 1.0, up))
        scene = panel(front, 5, left_return=0.2, right_return=0.2, live=live)
        lean = both(turned(scene, seed))
        assert lean.model == ("symmetry",)

    @pytest.mark.parametrize("name", ["dome", "barrel-vault"])
    def test_forces_and_mechanism_are_those_of_both_halves(self, name: str) -> None:
        scene = builtin_scene(name)
        solution = both(scene)
        assert solution.model == ("symmetry",)
        assert_certified(solution, scene)

    @pytest.mark.parametrize("change", [1e-9, 1e-3])
    def test_one_friction_value_is_enough_against_it(self, change: float) -> None:
        scene = barrel_vault(rows=4, embrace=120.0, thickness_ratio=0.2)
        assert both(scene).model == ("symmetry",)
        contact = scene.contacts[0]
        own = {(contact.a, contact.b): scene.friction + change}
        assert both(scene.with_friction(scene.friction, own)).model == ()

    def test_loads_must_be_symmetric(self) -> None:
        scene = barrel_vault(rows=4, embrace=120.0, thickness_ratio=0.2)
        one = scene.blocks[scene.free[0]].id
        push = Load(acceleration=(1, 0, 0), forces={one: (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)})
        assert both(scene.with_live(push)).model == ()

    @settings(max_examples=10, deadline=None)
    @given(SEEDS)
    def test_loads_whose_sum_is_rounding(self, seed: int) -> None:
        """Its direction says nothing about mirror planes."""
        scene, rng = arch(11, 0.15), np.random.default_rng(seed)
        forces = np.zeros((11, 6))
        forces[:5, ::2] = rng.normal(size=(5, 3)) * [1.0, 1.0, 0.0]
        forces[:5, 2] -= forces[:5, 2].mean()
        forces[6:] = forces[4::-1] * [-1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
        own = {scene.blocks[i].id: tuple(f) for i, f in zip(scene.free, forces, strict=True)}
        lean = turned(scene.with_live(Load(forces=own)), seed)
        found = Reductions.of(Assemblage.of(lean), surfaces_of("conic")[0], model="least")
        assert found.plane is not None
        assert found.mirror is not None

    def test_the_mean_of_a_solution_and_its_mirror_image_is_a_solution(self) -> None:
        """What the reduction rests on, with equations of the tests' own."""
        scene = builtin_scene("dome")
        mirror = Reductions.of(Assemblage.of(scene), surfaces_of("conic")[0]).mirror
        assert mirror is not None
        solution = solve(scene, model="full", tolerance=1e-7)
        assert solution.forces is not None
        assert solution.load_factor is not None
        image = np.empty_like(solution.forces)
        image[mirror.contacts] = np.einsum("nij,nj->ni", mirror.carried, solution.forces)
        matrix, dead, live = hand_equilibrium(scene)
        total = np.abs(dead).sum()
        for forces in (image, 0.5 * (image + solution.forces)):
            rest = matrix @ forces.ravel() + dead + solution.load_factor * live
            assert np.abs(rest).max() <= 1e-6 * total
            assert yield_excess(scene, forces).max() <= 1e-6 * total

    def test_both_at_once(self) -> None:
        """An arch pressed on its crown: planar, and one half of it."""
        scene = arch(9, 0.15)
        crown = scene.blocks[scene.free[4]].id
        load = Load(forces={crown: (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)})
        scene = turned(scene.with_live(load), 2)
        lean = both(scene)
        assert lean.model == ("symmetry", "planar")
        assert_certified(lean, scene)


def two_towers(blocks: int, shift: float = 0.0) -> Scene:
    """One is pushed; the other is not, and leans by ``shift`` per block."""
    parts = [Block.box("ground", (-2, -2, -1), (6, 3, 0))]
    for tower, x in enumerate((0.0, 3.0)):
        for i in range(blocks):
            low = np.array([x + tower * shift * i, 0.0, i])
            parts.append(Block.box(f"{tower}.{i}", low, low + 1.0, density=20.0))
    push = (20.0, 5.0, 0.0, 0.0, 0.0, 0.0)
    return Scene(parts, ["ground"], Load(forces={f"0.{blocks - 1}": push}), friction=0.7)


class TestParts:
    def test_what_is_not_loaded_must_stand_and_that_is_all(self) -> None:
        scene = two_towers(3, 0.1)
        lean = both(scene)
        assert lean.model == ("parts",)
        assert_certified(lean, scene)
        assert lean.mechanism is not None
        assert not any(np.any(lean.mechanism[f"1.{i}"]) for i in range(3))

    def test_what_does_not_stand_is_found(self) -> None:
        solution = solve(two_towers(3, 0.8))
        assert solution.status is Status.DEAD_LOAD_UNSTABLE
        assert "'1." in solution.note


class TestChoice:
    def test_a_wrong_reduction_cannot_pass(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """A push out of the plane, taken for planar: the full scene's certificate is not fooled,
        and the full model has the last word."""
        scene = single_block((1.0, 1.0, 0.5), live=Load(acceleration=(1.0, 0.5, 0.0)))
        right = solve(scene, model="full")
        monkeypatch.setattr(planar, "_is_flat", lambda *given: True)
        found = Reductions.of(Assemblage.of(scene), surfaces_of("conic")[0])
        assert found.plane is not None
        solution = solve(scene)
        assert solution.model == ()
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(right.load_factor, rel=1e-6)

    def test_what_does_not_pay_is_left(self) -> None:
        """Half of a small scene is found on request only; larger ones are halved anyway."""
        small = barrel_vault(rows=4, embrace=120.0, thickness_ratio=0.2)
        assert solve(small).model == ()
        assert both(small).model == ("symmetry",)
        assert solve(builtin_scene("dome")).model == ("symmetry",)

    def test_full_is_the_limit_problem(self) -> None:
        scene = builtin_scene("tuff-wall")
        assemblage, surfaces = Assemblage.of(scene), surfaces_of("octagon")[0]
        full = Reductions.of(assemblage, surfaces, model="full")
        assert full.best().names == ()
        one = LimitProgram(assemblage, surfaces, reduction=full.best())
        assert one.shape == LimitProgram(assemblage, surfaces).shape

    def test_models_by_name(self) -> None:
        for call in (solve, explain):
            with pytest.raises(ModelError, match="one of auto, full, least, got 'half'"):
                call(single_block(), model="half")
        assert choice.MODELS == ("auto", "full", "least")

    def test_with_interaction_it_is_the_full_model(self) -> None:
        """Eq. 30 is not convex: the mean of two states need not be admissible."""
        solution = solve(stack(2), method="fixed-point")
        assert solution.model == ()

    @pytest.mark.exhaustive_cases("independent")
    @pytest.mark.parametrize("moments", ["independent", "signed"])
    def test_forces_in_a_plane_have_no_torsion_to_interact_with(self, moments: str) -> None:
        """With interaction a planar scene collapses where it does without: both brackets, each by
        its own checker, hold the same factor, and so does the full model's."""
        for scene in (builtin_scene("arch"), turned(wall(running_bond(2, 3)), 5)):
            plain = solve(scene, tolerance=1e-7)
            lean, full = (
                solve(scene, method="certified", moments=moments, model=m) for m in ("auto", "full")
            )
            assert (lean.model, full.model) == (("planar",), ())
            assert plain.load_factor == pytest.approx(lean.load_factor, rel=SAME)
            unit = SAME * abs(plain.load_factor)
            assert full.lower <= lean.upper + unit
            assert lean.lower <= full.upper + unit
            assert lean.gap < 1e-5

    def test_out_of_the_plane_the_bracket_is_the_climbs(self) -> None:
        twist = Load(forces={"b1": (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)})
        solution = solve(stack(2, live=twist), method="certified")
        assert solution.model == ()

    def test_result_files_name_reductions(self, tmp_path: object) -> None:
        solution = solve(builtin_scene("arch"), model="least")
        path = f"{tmp_path}/arch.json"
        write_result(solution, path)
        assert read_result(path).model == solution.model == ("planar",)


class TestExplain:
    def test_sizes_after_each_reduction(self) -> None:
        """Counted by hand: n contacts with four corners, F free blocks."""
        scene = builtin_scene("ferris-tin-loi-1")
        n, free = len(scene.contacts), len(scene.free)
        found = scene.explain(model="least")
        assert list(found.sizes) == ["full", "planar"]
        full, lean = found.sizes.values()
        assert (full.variables, full.equations, full.cones) == (8 * n + 1, 6 * free, n)
        assert (lean.variables, lean.equations, lean.rows) == (3 * n + 1, 3 * free, 4 * n)
        assert full.rows == 6 * n
        assert lean.cones == 0

    def test_it_is_what_solve_does(self) -> None:
        for name in ("arch", "dome", "tuff-wall"):
            scene = builtin_scene(name)
            found, solution = explain(scene), solve(scene)
            assert tuple(found.sizes)[1:] == solution.model
            # the one that leads: whether others follow depends on the processor's rounding
            assert solution.history[0].solver.split(",")[0] == found.solver
            assert str(found).startswith(f"{name}: {len(scene.free)} free blocks")
            assert found.seconds > 0.0


OTHERS = (
    {"friction": 0.4, "direction": 20.0},
    {"friction": 0.4, "direction": 40.0},
    {"friction": 0.6, "direction": 40.0},
    {"friction": 0.4, "density": 2.0},
    {"friction": 0.4, "cohesion": 1e-3},
    {"contact_friction": {("v1", "v2"): 0.2}},
)


@pytest.mark.parametrize("surface", [slow("conic"), "octagon"])
def test_what_strengths_share_is_what_is_made_anew(surface: str) -> None:
    """Brackets of scenes in turn, of which some have the same strengths."""
    alone, surfaces = Assemblage.of(builtin_scene("arch")), surfaces_of(surface)[0]
    for changes in (*OTHERS, *OTHERS[::-1]):
        scene = varied(alone.scene, **changes)
        among = alone.like(scene)  # which has the strengths of the scene before, if they are these
        own, shared = (
            LimitProgram(given, surfaces) for given in (replace(among, strengths={}), among)
        )
        state = own.run(settings_for("CLARABEL", 1e-9))
        bounds, same = (Certifier(p.assemblage, surfaces).of(state) for p in (own, shared))
        assert (bounds.lower, bounds.upper) == pytest.approx((same.lower, same.upper), rel=1e-12)
        assert bounds.upper - bounds.lower <= 1e-5 * bounds.upper


def test_other_contacts_of_the_same_strength_are_not_the_same() -> None:
    contacts = builtin_scene("arch").contacts
    few, others = contacts.take(np.arange(3)), contacts.take(np.arange(3, 6))
    assert few.is_in_place_of(few.with_values(friction=0.2))
    assert not few.is_in_place_of(others)


def test_parts_share_nothing() -> None:
    """Parts without one contact each, of which some do not stand, are as many and as strong."""
    scene, surfaces = builtin_scene("tuff-wall"), surfaces_of("conic")[0]
    among, count = Assemblage.of(scene), len(scene.contacts)
    assert Certifier(among, surfaces).references.easy_dead_state is not None
    stands = set()
    for left_out in range(0, 35, 7):
        kept = np.delete(np.arange(count), left_out)
        part = with_contacts(among, kept, np.ones(len(scene.free), dtype=bool))
        state = Certifier(part, surfaces).references.easy_dead_state
        stands.add(state is not None)
        if state is not None:
            assert part.statics.is_balanced(state, 0.0, scene.contacts.typical_size)
    assert stands == {False, True}
