"""The bracket holds whatever forces and mechanism are: corrupted, foreign, missing, not finite.

True factors come from elsewhere: closed forms, SciPy's linprog on matrices of our own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from cvxlimit import (
    Block,
    Certifier,
    Contacts,
    Load,
    Scene,
    Status,
    Units,
    builtin_scene,
    solve,
)
from cvxlimit.errors import ModelError
from cvxlimit.masonry import arch, single_block, stack
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import ForceModel, corner_compressions
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statics import Scaling
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.surfaces import Condition, Facets, Norm, Rocking, TorsionShear
from cvxlimit.surfaces.coulomb import surfaces_of
from helpers import (
    assert_certified,
    hand_equilibrium,
    linear_load_factor,
    missing_opening,
    named_scene,
    piles,
    scenes,
    yield_excess,
)

SLACK = 1e-9
"""Relative; HiGHS gives the true factor to about 1e-10."""

NAMES = ["ferris-tin-loi-3", "tuff-wall", "single-block"]
SIZES = 10.0 ** np.arange(-8, 0)
OCTAGON = surfaces_of("octagon")[0]


@cache
def case(name: str) -> tuple[Scene, Certifier, LimitState, float]:
    """A built-in scene with octagons, its certifier, a good state, and the true factor."""
    scene = builtin_scene(name)
    state = LimitProgram(scene, OCTAGON).run()
    factor = linear_load_factor(scene).load_factor
    assert factor is not None
    return scene, Certifier(scene, OCTAGON), state, factor


def noise(seed: int, shape: tuple[int, ...], unit: float) -> np.ndarray:
    return unit * np.random.default_rng(seed).normal(size=shape)


class TestCorruptedForces:
    @pytest.mark.exhaustive_cases("ferris-tin-loi-3")
    @pytest.mark.parametrize("name", NAMES[:2])  # one block: balance alone restores its forces
    def test_noise_widens_the_bracket_and_never_breaks_it(self, name: str) -> None:
        scene, certifier, state, factor = case(name)
        weight = scene.total_weight / len(scene.free)
        unit = weight * np.array([1, 1, 1, *[certifier.size] * 3])
        means = []
        for size in SIZES:
            lower = []
            for seed in range(8):
                forces = state.forces + noise(seed, state.forces.shape, size) * unit
                c = certifier.certificate(forces, state.load_factor, state.mechanism)
                assert c.lower_is_proved
                assert c.lower <= factor * (1.0 + SLACK)
                assert c.equilibrium_residual > 0.0
                lower.append(c.lower)
            means.append(factor - np.mean(lower))
        assert all(a < b for a, b in pairwise(means)), means
        assert means[-1] > 0.1 * factor

    @pytest.mark.parametrize("name", NAMES)
    @pytest.mark.parametrize("excess", [1e-6, 1e-3, 0.3, 10.0])
    def test_a_load_factor_claimed_too_high(self, name: str, excess: float) -> None:
        _, certifier, state, factor = case(name)
        claim = factor * (1.0 + excess)
        c = certifier.certificate(state.forces, claim, state.mechanism)
        assert c.lower_is_proved
        assert c.lower <= factor * (1.0 + SLACK)

    @pytest.mark.exhaustive
    def test_every_lost_contact_force_and_every_flipped_one(self) -> None:
        scene, certifier, state, factor = case("ferris-tin-loi-3")
        changed = 0
        for j in range(len(scene.contacts)):
            for share in (0.0, -1.0):
                forces = state.forces.copy()
                forces[j] *= share
                c = certifier.certificate(forces, state.load_factor, state.mechanism)
                assert c.lower_is_proved
                assert c.lower <= factor * (1.0 + SLACK)
                changed += c.lower < factor * (1.0 - 1e-4)
        assert changed > len(scene.contacts)  # most contacts carry something that matters

    @pytest.mark.parametrize("name", NAMES)
    @pytest.mark.parametrize("share", [-1.0, 0.0, 0.5, 2.0, 1e6])
    def test_all_forces_multiplied(self, name: str, share: float) -> None:
        _, certifier, state, factor = case(name)
        c = certifier.certificate(share * state.forces, state.load_factor, state.mechanism)
        assert c.lower <= factor * (1.0 + SLACK)
        assert c.equilibrium_residual > 1e-3

    def test_reported_violations_are_those_computed_by_hand(self) -> None:
        scene = builtin_scene("tuff-wall")
        state = LimitProgram(scene).run()
        certifier = Certifier(scene, (Rocking(), TorsionShear()))
        forces = state.forces + noise(1, state.forces.shape, 1e-3) * scene.total_weight
        c = certifier.certificate(forces, state.load_factor, state.mechanism)
        matrix, dead, live = hand_equilibrium(scene)
        rest = (matrix @ forces.ravel() + dead + state.load_factor * live).reshape(-1, 6)
        load = (1.0 + state.load_factor) * scene.total_weight
        largest = np.linalg.norm(rest[:, :3], axis=1)
        largest += np.linalg.norm(rest[:, 3:], axis=1) / certifier.size
        assert c.equilibrium_residual == pytest.approx(largest.max() / load, rel=1e-9)
        sliding = TorsionShear().excess(forces, scene.contacts)[0].max() / load
        assert c.yield_excess >= sliding * (1.0 - 1e-9)
        assert c.yield_excess > 0.0


class TestCorruptedMechanisms:
    @pytest.mark.exhaustive_cases("ferris-tin-loi-3")
    @pytest.mark.parametrize("name", NAMES)
    def test_noise_widens_the_bracket_and_never_breaks_it(self, name: str) -> None:
        _, certifier, state, factor = case(name)
        unit = np.abs(state.mechanism[:, :3]).max() * np.array([1, 1, 1, *[1 / certifier.size] * 3])
        means = []
        for size in SIZES:
            upper = []
            for seed in range(8):
                rates = state.mechanism + noise(seed, state.mechanism.shape, size) * unit
                c = certifier.certificate(state.forces, state.load_factor, rates)
                assert c.upper >= factor * (1.0 - SLACK)
                assert c.upper_is_proved or np.isinf(c.upper)
                upper.append(min(c.upper, 1e6))
            means.append(np.mean(upper) - factor)
        assert all(a < b for a, b in pairwise(means)), means
        assert means[-1] > 0.1 * factor

    def test_every_block_frozen(self) -> None:
        scene, certifier, state, factor = case("ferris-tin-loi-3")
        wider = 0
        for i in range(len(scene.free)):
            rates = state.mechanism.copy()
            rates[i] = 0.0
            c = certifier.certificate(state.forces, state.load_factor, rates)
            assert c.upper >= factor * (1.0 - SLACK)
            wider += c.upper > factor * (1.0 + 1e-4)
        moving = np.abs(state.mechanism).max(axis=1) > 1e-6 * np.abs(state.mechanism).max()
        assert wider >= moving.sum() / 2

    @pytest.mark.parametrize("share", [1e-9, 0.3, 7.0, 1e9])
    def test_size_does_not_matter(self, share: float) -> None:
        _, certifier, state, _ = case("tuff-wall")
        plain, scaled = (
            certifier.certificate(None, None, k * state.mechanism) for k in (1.0, share)
        )
        assert scaled.upper == pytest.approx(plain.upper, rel=1e-9)
        assert scaled.upper_is_proved

    def test_backwards_or_at_rest_proves_nothing(self) -> None:
        _, certifier, state, _ = case("tuff-wall")
        for share in (-1.0, 0.0):
            assert certifier.certificate(None, None, share * state.mechanism).upper == np.inf

    def test_flow_violation_by_hand(self) -> None:
        """Contacts must part where the mechanism is disturbed: same sign and order by hand."""
        scene = builtin_scene("tuff-wall")
        state = LimitProgram(scene).run()
        certifier = Certifier(scene, (Rocking(), TorsionShear()))
        rates = state.mechanism + noise(2, state.mechanism.shape, 1e-2)
        c = certifier.certificate(None, None, rates)
        u = rates / (rates * scene.live_forces).sum()
        expected = missing_opening(scene, u).max() / certifier._largest_rate(rates)
        assert c.flow_violation == pytest.approx(expected, rel=1e-9)


class TestIncomplete:
    def test_forces_alone(self) -> None:
        _, certifier, state, factor = case("tuff-wall")
        c = certifier.certificate(state.forces, state.load_factor, None)
        assert c.lower == pytest.approx(factor, rel=1e-5)
        assert c.lower <= factor * (1.0 + SLACK)
        assert (c.upper, c.upper_is_proved, c.width) == (np.inf, False, np.inf)

    def test_mechanism_alone(self) -> None:
        _, certifier, state, factor = case("tuff-wall")
        c = certifier.certificate(None, None, state.mechanism)
        assert c.upper == pytest.approx(factor, rel=1e-5)
        assert c.upper >= factor * (1.0 - SLACK)
        assert (c.lower, c.lower_is_proved, c.width) == (-np.inf, False, np.inf)

    def test_nothing(self) -> None:
        c = case("tuff-wall")[1].certificate(None, None, None)
        assert (c.lower, c.upper, c.is_proved) == (-np.inf, np.inf, False)

    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_not_finite(self, bad: float) -> None:
        _, certifier, state, _ = case("tuff-wall")
        forces, rates = state.forces.copy(), state.mechanism.copy()
        forces[3, 2], rates[2, 1] = bad, bad
        c = certifier.certificate(forces, state.load_factor, rates)
        assert (c.lower, c.upper, c.is_proved) == (-np.inf, np.inf, False)
        c = certifier.certificate(state.forces, bad, state.mechanism)
        assert c.lower == -np.inf

    def test_wrong_sizes(self) -> None:
        scene, certifier, state, _ = case("tuff-wall")
        n, f = len(scene.contacts), len(scene.free)
        for forces in (state.forces[:-1], state.forces[:, :5], np.zeros(0)):
            with pytest.raises(ModelError, match=f"the scene has {n} contact.* another scene"):
                certifier.certificate(forces, 0.1, None)
        for rates in (state.mechanism[1:], np.vstack([state.mechanism] * 2)):
            with pytest.raises(ModelError, match=f"the scene has {f} free block"):
                certifier.certificate(None, None, rates)

    @pytest.mark.exhaustive
    def test_answers_to_another_question(self) -> None:
        """Same sizes, other friction or other push: bounds are of the scene that was asked."""
        scene, certifier, state, factor = case("tuff-wall")
        for other in (scene.with_friction(0.2), scene.with_live(Load(acceleration=(1, 0.5, 0)))):
            true = linear_load_factor(other).load_factor
            foreign = LimitProgram(other, OCTAGON).run()
            c = certifier.certificate(foreign.forces, foreign.load_factor, foreign.mechanism)
            assert c.lower <= factor * (1.0 + SLACK)
            assert c.upper >= factor * (1.0 - SLACK)
            assert c.width > 1e-3
            c = Certifier(other, OCTAGON).certificate(
                state.forces, state.load_factor, state.mechanism
            )
            assert c.lower <= true * (1.0 + SLACK)
            assert c.upper >= true * (1.0 - SLACK)

    def test_octagon_forces_do_not_prove_the_cone(self) -> None:
        scene, _, state, _ = case("tuff-wall")
        c = Certifier(scene, (Rocking(), TorsionShear())).certificate(
            state.forces, state.load_factor, None
        )
        assert c.lower < 0.4231  # the conic factor of published.json, not the octagon's 0.450034


@pytest.mark.exhaustive
@given(scene=scenes(), seed=st.integers(0, 2**32 - 1), size=st.sampled_from([0.0, 1e-6, 1e-2, 0.3]))
@settings(max_examples=40, deadline=None)
def test_proved_bounds_are_true(scene: Scene, seed: int, size: float) -> None:
    """Against linprog, for forces and mechanisms from nearly right to nonsense."""
    answer = linear_load_factor(scene)
    assume(answer.status == 0)
    assert answer.load_factor is not None
    state = LimitProgram(scene, OCTAGON).run()
    assume(state.forces is not None and state.mechanism is not None)
    certifier = Certifier(scene, OCTAGON)
    forces = state.forces * (1.0 + noise(seed, state.forces.shape, size))
    rates = state.mechanism * (1.0 + noise(seed + 1, state.mechanism.shape, size))
    claim = state.load_factor * (1.0 + size)
    c = certifier.certificate(forces, claim, rates)
    slack = 1e-8 * max(1.0, abs(answer.load_factor))  # linprog's own error on small scenes
    if c.lower_is_proved:
        assert c.lower <= answer.load_factor + slack
    if c.upper_is_proved:
        assert c.upper >= answer.load_factor - slack


class TestUnits:
    @pytest.mark.parametrize("name", ["ferris-tin-loi-3", "tuff-wall"])
    @pytest.mark.parametrize(("length", "force"), [(1e3, 1e3), (1e-3, 1e-6), (39.37, 0.2248)])
    def test_the_bracket_does_not_depend_on_them(
        self, name: str, length: float, force: float
    ) -> None:
        """Same forces and rates in other units: bounds equal to 1e-7, far inside the gap's 1e-5."""
        scene, certifier, state, _ = case(name)
        plain = certifier.certificate(state.forces, state.load_factor, state.mechanism)
        other = scene.in_units(Units("a", "b"), length, force)
        forces = state.forces * force * np.array([1, 1, 1, length, length, length])
        rates = state.mechanism * np.array([length, length, length, 1, 1, 1])
        c = Certifier(other, OCTAGON).certificate(forces, state.load_factor, rates)
        assert c.is_proved
        assert c.lower == pytest.approx(plain.lower, rel=1e-7)
        assert c.upper == pytest.approx(plain.upper, rel=1e-7)


class TestWitnesses:
    @pytest.mark.parametrize("name", ["stack", "ferris-tin-loi-3", "tuff-wall", "s12-panel"])
    def test_dead_state_carries_the_dead_load_strictly_inside(self, name: str) -> None:
        scene = builtin_scene(name)
        state = Certifier(scene, (Rocking(), TorsionShear())).references.dead_state
        assert state is not None
        matrix, dead, _ = hand_equilibrium(scene)
        assert np.abs(matrix @ state.ravel() + dead).max() <= 1e-12 * np.abs(dead).sum()
        assert yield_excess(scene, state).max() < 0.0

    @pytest.mark.parametrize("name", ["stack", "ferris-tin-loi-3", "tuff-wall", "s12-panel"])
    def test_opening_field_opens_every_contact(self, name: str) -> None:
        scene = builtin_scene(name)
        field = Certifier(scene, (Rocking(), TorsionShear())).references.opening_field
        assert field is not None
        assert missing_opening(scene, field).max() < 0.0

    def test_none_where_none_can_be(self) -> None:
        falling = stack(3, (1, 1, 0.2), shift=(0.5, 0.0))
        assert Certifier(falling, (Rocking(), TorsionShear())).references.dead_state is None
        icy = single_block(friction=0.0).with_dead(Load(acceleration=(0.1, 0.0, -1.0)))
        assert Certifier(icy, (Rocking(), TorsionShear())).references.dead_state is None
        wedged = Certifier(_between_walls(0.5), (Rocking(), TorsionShear())).references
        assert wedged.opening_field is None

    def test_on_ice_without_any_shear(self) -> None:
        """A condition without resistance has no inside; a state without shear satisfies it."""
        scene = single_block(friction=0.0)
        state = Certifier(scene, (Rocking(), TorsionShear())).references.dead_state
        assert state is not None
        np.testing.assert_allclose(state[:, 2].sum(), scene.total_weight, rtol=1e-9)
        assert not state[:, [0, 1, 5]].any()

    @given(scene=piles())
    @settings(max_examples=15, deadline=None)
    def test_on_other_polygons(self, scene: Scene) -> None:
        references = Certifier(scene, (Rocking(), TorsionShear(Facets.inscribed(8)))).references
        assert references.dead_state is not None
        assert yield_excess(scene, references.dead_state).max() < 0.0
        assert references.opening_field is not None
        assert missing_opening(scene, references.opening_field).max() < 0.0


def _between_walls(friction: float, density: float = 20.0, live: Load | None = None) -> Scene:
    blocks = (
        Block.box("ground", (-5, -5, -1), (5, 5, 0)),
        Block.box("left", (-1, 0, 0), (0, 1, 1)),
        Block.box("right", (1, 0, 0), (2, 1, 1)),
        Block.box("b", (0, 0, 0), (1, 1, 1), density),
    )
    push = Load(acceleration=(0, 1, 0)) if live is None else live
    return Scene(blocks, ("ground", "left", "right"), push, friction=friction)


class TestPebbleOnABoulder:
    """Truth: the pebble slides at 0.3. Its weight is 1e-6 to 1e-12 of the whole, below what a
    solver resolves: it says "optimal" with primal = dual = 0.5, where the boulder slides.
    """

    @staticmethod
    def scene(side: float) -> Scene:
        blocks = (
            Block.box("ground", (-1, -1, -1), (2, 2, 0)),
            Block.box("boulder", (0, 0, 0), (1, 1, 1), 20.0),
            Block.box("pebble", (0.5, 0.5, 1), (0.5 + side, 0.5 + side, 1 + side), 20.0),
        )
        push = Load(acceleration=(1, 0, 0))
        slippery = {("boulder", "pebble"): 0.3}
        return Scene(blocks, ("ground",), push, friction=0.5, contact_friction=slippery)

    @pytest.mark.parametrize("side", [1e-1, 1e-2, 1e-3, 1e-4])
    def test_bracket_holds_the_truth(self, side: float) -> None:
        solution = solve(self.scene(side))
        assert solution.lower <= 0.3 * (1.0 + 1e-9)
        assert solution.upper >= 0.3 * (1.0 - 1e-9)
        assert "proved" in solution.note
        if solution.status is Status.CERTIFIED:
            assert solution.load_factor == pytest.approx(0.3, rel=1e-5)

    def test_solver_is_sure_and_wrong_and_caught(self) -> None:
        scene = self.scene(1e-4)
        state = LimitProgram(scene).run()
        assert state.outcome.status == "optimal"
        dual = -(state.mechanism * scene.dead_forces).sum()
        assert state.load_factor == pytest.approx(dual, rel=1e-6)  # primal and dual agree ...
        assert state.load_factor == pytest.approx(0.5, rel=1e-6)  # ... on a wrong factor
        c = Certifier(scene, (Rocking(), TorsionShear())).certificate(
            state.forces, state.load_factor, state.mechanism
        )
        assert c.width > 0.3
        assert c.lower_is_proved
        assert c.lower <= 0.3 * (1.0 + 1e-9)


@pytest.mark.parametrize("density", [1e-6, 1.0, 20.0, 2e4, 2e9])
def test_assumed_forces_have_the_scenes_unit(density: float) -> None:
    """A block on ice between walls stands, whatever the unit of force: its factor is 0."""
    solution = solve(_between_walls(0.0, density))
    assert solution.status is not Status.DEAD_LOAD_UNSTABLE
    assert solution.lower <= 1e-9
    assert solution.upper >= -1e-9


class TestWronglyScaledRuns:
    """Design section 4: block weights as units, and every sign of success on a wrong factor."""

    @pytest.mark.exhaustive_cases("0.1")
    @pytest.mark.parametrize("share", [1e-1, 1e-3])
    def test_caught(self, share: float) -> None:
        """Unit of force and live load: ``share`` of a block's weight; Clarabel at its default 1e-8.

        Primal and dual agree to 6 digits of the true factor; the factor is off by more than the
        bracket's tolerance (by 95 % with the smaller unit). Kept to what such runs do reliably:
        the certificate is wide, and true.
        """
        scene = named_scene("s10-class")
        usual = Scaling.of(scene)
        unit = share / len(scene.free)
        scaling = replace(usual, force=usual.force * unit, live=usual.live * unit)
        problem = LimitProgram(Assemblage.of(scene, scaling))
        state = problem.run(SolverSettings("CLARABEL", {"direct_solve_method": "qdldl"}))
        true = 0.165318  # published.json, to 1e-5
        assert state.outcome.status in ("optimal", "optimal_inaccurate")
        dual = -(state.mechanism * scene.dead_forces).sum()
        assert abs(state.load_factor - dual) <= 1e-6 * true
        assert abs(state.load_factor - true) > 2e-5 * true
        c = Certifier(scene, problem.surfaces).certificate(
            state.forces, state.load_factor, state.mechanism
        )
        assert c.lower <= true * (1.0 + 1e-5)
        assert c.upper >= true * (1.0 - 1e-5)
        assert c.width > 1e-3

    def test_total_weight_as_unit_is_certified(self) -> None:
        assert_certified(solve(named_scene("s10-class")))

    @pytest.mark.parametrize(
        "settings",
        [
            SolverSettings("SCS", {"eps_abs": 1e-3, "eps_rel": 1e-3}, "SCS loose"),
            SolverSettings("SCS", {"eps_abs": 1e-5, "eps_rel": 1e-5, "max_iters": 2000}),
            *(SolverSettings("CLARABEL", {"max_iter": k}, f"CLARABEL {k}") for k in (2, 6, 9, 12)),
            *(
                SolverSettings(
                    "CLARABEL", dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), t)
                )
                for t in (1e-2, 1e-4)
            ),
        ],
        ids=str,
    )
    @pytest.mark.parametrize("name", ["tuff-wall", "ferris-tin-loi-3"])
    def test_loose_and_stopped_runs(self, name: str, settings: SolverSettings) -> None:
        """Whatever comes back, the bracket is true; where the factor is off, it is wide."""
        scene = builtin_scene(name)
        true = {"tuff-wall": 0.4230557, "ferris-tin-loi-3": 0.4036941}[name]
        problem = LimitProgram(scene)
        state = problem.run(settings)
        c = Certifier(scene, problem.surfaces).certificate(
            state.forces, state.load_factor, state.mechanism
        )
        assert c.lower <= true * (1.0 + 1e-6)  # the digits given above
        assert c.upper >= true * (1.0 - 1e-6)
        if state.load_factor is None:
            assert c.width == np.inf
        elif abs(state.load_factor - true) > 1e-4 * true:
            assert c.width > 1e-5


def test_gap_is_relative_to_the_larger_bound() -> None:
    _, certifier, state, _ = case("tuff-wall")
    c = certifier.certificate(state.forces, state.load_factor, state.mechanism)
    assert c.width == pytest.approx((c.upper - c.lower) / c.upper)
    assert c.is_proved


def _arch_pressed_at_its_crown(thickness: float) -> Scene:
    """Friction 10: it cannot slide, and rocks on its thrust line; least thickness 0.107."""
    return arch(20, thickness, friction=10.0, live=Load(forces={"v10": (0, 0, -1, 0, 0, 0)}))


@pytest.mark.parametrize("thickness", [0.108, 0.11])
def test_arches_near_their_least_thickness_are_proved(thickness: float) -> None:
    """Hardly any state lies strictly inside, and yet neither bound needs an assumption."""
    scene = _arch_pressed_at_its_crown(thickness)
    solution = solve(scene)
    assert_certified(solution, scene)
    answer = linear_load_factor(scene)
    assert solution.load_factor == pytest.approx(answer.load_factor, abs=1e-7)  # linprog's error


def test_a_thinner_arch_falls() -> None:
    """linprog: it stands if its crown is pulled up by 0.015, so not on its own."""
    scene = _arch_pressed_at_its_crown(0.105)
    factor = linear_load_factor(scene).load_factor
    assert factor is not None
    assert factor < 0.0
    solution = solve(scene)
    assert solution.status is Status.DEAD_LOAD_UNSTABLE
    assert "it would stand" not in solution.note


@pytest.mark.parametrize("name", ["n", "N", "1"])
def test_compressions_are_checked_whatever_a_formulation_calls_them(name: str) -> None:
    """One of them pulls, with the resultants of compressions that all push."""

    def named(contacts: Contacts) -> ForceModel:
        compressions, *others = corner_compressions(contacts).parts
        sliding = Condition([Norm({"V1": 1}, {"V2": 1})], {"N": contacts.friction})
        return ForceModel(contacts, [replace(compressions, name=name), *others], [sliding])

    scene = single_block()
    certifier = Certifier(scene, [Rocking()], named)
    pushing = np.append(np.full(4, scene.total_weight / 4.0), np.zeros(3))
    pulling = pushing - scene.total_weight * np.array([1.0, -1.0, 1.0, -1.0, 0.0, 0.0, 0.0])
    assert certifier.certificate(pushing, 0.0, None).yield_excess == 0.0
    assert certifier.certificate(pulling, 0.0, None).yield_excess == pytest.approx(0.75)


def test_the_name_of_a_surface_is_refused():
    with pytest.raises(ModelError, match="got the name 'octagon'"):
        Certifier(single_block(), "octagon")  # type: ignore[arg-type]
