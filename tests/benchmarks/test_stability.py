"""The stability bench: a sample of its scenes, its judges, and the cases that once broke ours."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import cvxpy as cp
import numpy as np
import pytest
from benchmarks.experiment import experiments
from benchmarks.rows import Rows
from benchmarks.stability import interacting, models, pictures
from benchmarks.stability.families import FAMILIES, sample, samples
from benchmarks.stability.families.sample import FALLS, HARMLESS
from benchmarks.stability.methods import believed, literal_problem, methods
from benchmarks.stability.outcomes import (
    Claim,
    Outcome,
    Reference,
    claim_of,
    judged,
    reference_of,
    refutation,
)  # fmt: skip
from benchmarks.stability.studies import STUDIES
from benchmarks.stability.truths import Line, arm, closed_form, linear_bounds

from cvxlimit import Block, Certifier, FixedPoint, Load, Scene, builtin_scene, solve
from cvxlimit.extensions.interaction.flow import InteractionFlow
from cvxlimit.masonry import random_wall, single_block
from cvxlimit.readings.named import MOMENTS, parse_moments
from cvxlimit.solution import Status
from cvxlimit.solvers import blockwise
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES
from helpers import assert_certified, linear_load_factor

GROUND = Block.box("ground", (-5, -5, -1), (5, 5, 0))


# --- scenes ---------------------------------------------------------------------------------------


def test_families_cover_what_is_hard_and_are_asked_in_turn() -> None:
    assert len(FAMILIES) >= 20
    asked = list(samples(1_100))
    assert len(set(asked)) == 1_100
    assert set(Counter(name for name, _, _ in asked).values()) == {50}


@pytest.mark.parametrize("family", FAMILIES)
def test_the_same_seed_makes_the_same_scene_and_another_another(family: str) -> None:
    first, again, other = sample(family, 1).scene, sample(family, 1).scene, sample(family, 2).scene
    assert np.array_equal(first.contacts.corner_xy, again.contacts.corner_xy)
    assert np.array_equal(first.live_forces, again.live_forces)
    same = first.contacts.corner_xy.shape == other.contacts.corner_xy.shape and np.array_equal(
        first.contacts.corner_xy, other.contacts.corner_xy
    )
    assert not (same and np.array_equal(first.live_forces, other.live_forces)
                and np.array_equal(first.contacts.friction, other.contacts.friction))  # fmt: skip


def test_a_larger_scale_makes_larger_scenes() -> None:
    for family in ("stacks", "arches", "panels", "rocks"):
        small, large = (np.mean([len(sample(family, s, k).scene.free) for s in range(4)])
                        for k in (1, 2))  # fmt: skip
        assert large > small, family


# --- our default, on a sample ---------------------------------------------------------------------


@pytest.mark.exhaustive_cases("frictions", "propped", "domes")
@pytest.mark.parametrize("family", FAMILIES)
def test_nothing_refutes_the_default(family: str) -> None:
    """Closed forms, fresh certificates, and a linear program written down once more."""
    for seed in range(2):
        made = sample(family, seed)
        solution = solve(made.scene)
        assert refutation(made, solution) == "", (family, seed)
        assert solution.status.is_good or not solution.status.has_answer, (family, seed)
    inscribed, circumscribed = linear_bounds(made.scene)
    if solution.status is Status.CERTIFIED:
        unit = 1e-5 * max(abs(solution.upper), solution.bracket.least)
        assert not inscribed > solution.upper + unit
        assert not circumscribed < solution.lower - unit


def test_a_solver_that_is_believed_is_wrong_on_boulders() -> None:
    """Called optimal: not so our default, which the closed form does not contradict."""
    wrong = 0
    for seed in range(6):
        made = sample("boulders", seed)
        solution = solve(made.scene)
        assert refutation(made, solution) == ""
        reference = reference_of(made, solution)
        claim = believed(literal_problem(made.scene, "conic"), "CLARABEL")
        wrong += judged(claim, reference) is Outcome.WRONG
    assert wrong >= 2


# --- judges ---------------------------------------------------------------------------------------


def test_lever_arms_are_those_of_eq_16() -> None:
    """0.382598 for a square and 0.296617 for 1 x 0.5; a disc has two thirds of its radius."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2.0
    assert arm(square) == pytest.approx(0.382598, abs=1e-6)
    assert arm(square * [1.0, 0.5]) == pytest.approx(0.296617, abs=1e-6)
    angles = np.linspace(0.0, 2.0 * np.pi, 2_000, endpoint=False)
    assert arm(np.stack([np.cos(angles), np.sin(angles)], axis=1)) == pytest.approx(2 / 3, rel=1e-5)


def test_closed_forms_of_a_single_block() -> None:
    assert closed_form(single_block()) == pytest.approx(0.4, rel=1e-12)  # length / height
    assert closed_form(single_block(friction=0.3)) == pytest.approx(0.3, rel=1e-12)
    down = single_block(live=Load(acceleration=(0, 0, -1)))
    assert closed_form(down) == HARMLESS
    assert closed_form(random_wall(1)) is None
    leaning = sample("stacks", 0).scene
    lifted = replace(leaning, dead=Load(gravity=(0, 0, 1)))
    assert closed_form(lifted) == FALLS


def test_the_linear_program_encloses_a_closed_form_and_agrees_with_helpers() -> None:
    scene = single_block(friction=0.3, live=Load(acceleration=(1, 0.37, 0)))
    inscribed, circumscribed = linear_bounds(scene)
    true = closed_form(scene)
    assert isinstance(true, float)
    assert inscribed <= true <= circumscribed <= inscribed / np.cos(np.pi / 24) + 1e-9
    other = linear_load_factor(scene, 24).load_factor
    assert other == pytest.approx(circumscribed, rel=1e-8)


def test_the_linear_program_sees_light_blocks() -> None:
    """Weights 1e9 apart: in units of the total load HiGHS ended 6 % below what is carried."""
    scene = sample("densities", 50_000).scene
    solution, (inscribed, circumscribed) = solve(scene), linear_bounds(scene)
    assert_certified(solution, scene)
    assert inscribed <= solution.upper
    assert solution.lower <= circumscribed <= inscribed / np.cos(np.pi / 24)


@pytest.mark.parametrize(
    ("says", "reference", "outcome"),
    [
        (0.5, Reference(0.5, 0.5), Outcome.RIGHT),
        (0.5 * (1 + 5e-4), Reference(0.5, 0.5), Outcome.LOOSE),
        (0.51, Reference(0.5, 0.5), Outcome.WRONG),
        (None, Reference(0.5, 0.5), Outcome.HONEST),
        (FALLS, Reference(0.5, 0.5), Outcome.WRONG),
        (FALLS, Reference(np.nan, np.nan, FALLS), Outcome.NO_ANSWER),
        (1e9, Reference(np.nan, np.nan, HARMLESS), Outcome.WRONG),
        (HARMLESS, Reference(np.nan, np.nan, FALLS), Outcome.WRONG),
    ],
)
def test_classes(says: float | str | None, reference: Reference, outcome: Outcome) -> None:
    assert judged(Claim(says, "optimal"), reference) is outcome


def test_a_wrong_solution_is_refuted() -> None:
    """The judge can say no: to a bracket moved off, and to claims that there is no answer."""
    made = sample("stacks", 1)
    solution = solve(made.scene)
    moved = replace(solution.bracket, lower=solution.lower * 1.01, upper=solution.upper * 1.01)
    assert "closed form" in refutation(made, replace(solution, bracket=moved))
    for status in (Status.DEAD_LOAD_UNSTABLE, Status.LIVE_LOAD_HARMLESS):
        assert "closed form" in refutation(made, replace(solution, status=status))
    wall = sample("walls", 0)
    found = solve(wall.scene)
    assert found.status is Status.CERTIFIED
    falls = replace(found, status=Status.DEAD_LOAD_UNSTABLE)
    assert "does not prove" in refutation(wall, falls)
    harmless = replace(found, status=Status.LIVE_LOAD_HARMLESS)
    assert "do not carry" in refutation(wall, harmless)


def test_what_a_solver_says_is_taken_at_its_word() -> None:
    x = cp.Variable()
    assert believed(cp.Problem(cp.Maximize(x), [x <= 2]), "CLARABEL").says == pytest.approx(2.0)
    assert believed(cp.Problem(cp.Maximize(x)), "CLARABEL").says == HARMLESS
    assert believed(cp.Problem(cp.Maximize(x), [x <= 1, x >= 2]), "CLARABEL").says == FALLS


def test_eq_30_written_down_again_agrees_with_the_package() -> None:
    """A block whose weight is off its middle, twisted: c_T of the effective rectangle."""
    block = Block.box("b", (0, 0, 0), (1, 0.6, 0.5), 20.0)
    dead = Load(gravity=(0, 0, -1), forces={"b": (0, 0, 0, 0.7, -1.0, 0)})
    twist = Load(forces={"b": (0, 0, 0, 0, 0, 1)})
    scene = Scene((GROUND, block), ("ground",), twist, dead, friction=0.5)
    true = interacting.closed_form(scene, "independent")
    weight = block.weight
    side = np.array([1.0 - 2.0 * 1.0 / weight, 0.6 - 2.0 * 0.7 / weight])
    assert true == pytest.approx(float(interacting.arms(*side)) * 0.5 * weight, rel=1e-9)
    solution = solve(scene, method="certified")
    assert solution.lower <= true * (1 + 1e-9)
    assert solution.upper >= true * (1 - 1e-9)
    rng = np.random.default_rng(3)
    contacts = random_wall(5).contacts
    forces = rng.normal(size=(len(contacts), 6)) * [1, 1, 1, 0.02, 0.02, 0.1] + [0, 0, 6, 0, 0, 0]
    for moments in ("independent", "signed"):
        ours = interacting.excess(forces, contacts, moments) <= 0.0
        package = parse_moments(moments).excess(forces, contacts) <= 0.0
        assert np.array_equal(ours, package)
        assert 0 < ours.sum() < len(ours)


# --- what once broke ours -------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [23, 58, 107])
def test_glued_walls_are_proved(seed: int) -> None:
    """Friction of 1e6: rounding of slips that are zero left brackets 4e-5 to 0.7 wide, and none
    was proved."""
    made = sample("frictions", seed)
    assert made.scene.friction == 1e6
    assert_certified(solve(made.scene), made.scene)


@pytest.mark.parametrize("seed", [0, 1, 5])
def test_brackets_beside_locked_blocks_are_proved(seed: int) -> None:
    made = sample("locked", seed)
    solution = solve(made.scene)
    assert_certified(solution, made.scene)
    assert solution.load_factor == pytest.approx(made.truth, rel=1e-5)


@pytest.mark.parametrize("seed", [4, 5, 7])
def test_brackets_around_blocks_without_weight_are_proved(seed: int) -> None:
    """No forces are strictly inside where nothing presses; contacts that carry nothing are left
    out, if the solver says so to half its digits, as ours does."""
    made = sample("few-loads", seed)
    assert any(block.density == 0.0 for block in made.scene.blocks)
    assert_certified(solve(made.scene), made.scene, proved=bool(blockwise()))


@pytest.mark.parametrize("seed", [44, 66, 72, 89])
def test_densities_far_apart_are_certified(seed: int) -> None:
    """1e6 to 1e9 apart: static bounds were 1e-5 to 2e-3 off, and open, until problems were solved
    once more in units of their own answers."""
    made = sample("densities", seed)
    assert_certified(solve(made.scene), made.scene)


@pytest.mark.parametrize("seed", [50_034, 70_009, 80_018, 80_021])
def test_what_rounding_carries_is_no_lower_bound(seed: int) -> None:
    """Some joints without friction slide at once. Forces in equilibrium to rounding carried 2e-11
    of a push on a block of a hundredth of what presses on it, beyond a proved upper bound of 4e-13;
    elsewhere 6e-12 of all weights, once forces of 1e-10 were mixed with those of the dead load."""
    bracket = solve(sample("mixed", seed).scene).bracket
    assert bracket.lower == 0.0
    assert 0.0 <= bracket.upper < 1e-10
    assert bracket.is_proved


def test_friction_next_to_none_is_certified() -> None:
    """1e-6 in every joint: head joints that nothing presses had 1e-13 to spare in the dead load's
    own state, and mixing with that took a third of the bound away."""
    assert_certified(solve((made := sample("frictions", 100)).scene), made.scene)


@pytest.mark.exhaustive
def test_one_gripping_joint_does_not_cost_the_others_their_precision() -> None:
    """Rounding is allowed for contact by contact: with the largest friction of all everywhere the
    bracket was 0.05 wide. 1e-3 tells that apart; whether it closes to 1e-5 depends on how a solver
    rounds, as friction above 1e4 makes an opening of every slip."""
    made = sample("frictions", 18)
    assert made.scene.contacts.friction.max() > 1e4
    solution = solve(made.scene)
    assert solution.bracket.is_proved
    assert solution.gap <= 1e-3


@pytest.mark.exhaustive_cases("signed-torsion-bending")
@pytest.mark.parametrize("moments", MOMENTS)
def test_polygons_among_rectangles_are_bounded_by_their_own_rates(moments: str) -> None:
    """The paper's reading took another contact's rates for them, where some are rectangles."""
    contacts = sample("domes", 0).scene.contacts
    assert 0 < contacts.is_rectangle.sum() < len(contacts)
    rates = np.random.default_rng(0).normal(size=(len(contacts), 6))
    reading = parse_moments(moments)
    together = InteractionFlow(contacts, reading).shortfall(rates).missing
    alone = [
        InteractionFlow(contacts.take(np.array([j])), reading).shortfall(rates[[j]]).missing[0]
        for j in range(len(contacts))
    ]
    np.testing.assert_allclose(together, alone, rtol=1e-9)


def test_what_is_glued_is_still_checked() -> None:
    """A mechanism that opens nothing and slides through friction has no bound, glued or not."""
    scene = builtin_scene("stack")
    sliding = np.zeros((5, 6))
    sliding[3:, 0] = 1.0
    certificate = Certifier(scene, DEFAULT_SURFACES).certificate(None, None, sliding)
    true = solve(scene)
    assert certificate.upper >= true.lower
    assert certificate.missing_opening > 0.1


# --- records and pages ----------------------------------------------------------------------------


@pytest.mark.exhaustive
def test_a_study_goes_on_where_it_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[str] = []
    plain = STUDIES["default"][0].__globals__["sample"]
    monkeypatch.setattr(
        "benchmarks.stability.studies.sample", lambda *of: asked.append(of[0]) or plain(*of)
    )
    atlas, where = experiments()["atlas"], ["--out", str(tmp_path)]
    for size in (5, 7):
        atlas(["--studies", "default", "--size", str(size), *where])
    assert asked == list(FAMILIES)[:7]
    rows = list(Rows(tmp_path / "default.jsonl", "key"))
    assert {row["outcome"] for row in rows} <= {Outcome.RIGHT, Outcome.NO_ANSWER}
    some = methods()[::9]
    monkeypatch.setattr("benchmarks.stability.studies.methods", lambda: some)
    monkeypatch.setattr("benchmarks.stability.models.MODELS", models.MODELS[:2])
    others = [name for name in STUDIES if name != "default"]
    atlas(["--studies", *others, "--size", "1", *where])
    capsys.readouterr()
    atlas(["--size", "0", *where, "--docs", str(tmp_path)])
    assert "### default\n| scenes |" in (shown := capsys.readouterr().out)
    assert "| 7 | " in shown
    assert {path.name for path in tmp_path.glob("*.png")} == {*pictures.PICTURES}


# --- models against each other --------------------------------------------------------------------


def test_every_option_is_asked() -> None:
    """Of surfaces, torsion-shear, formulations, readings, flow rules and reductions."""
    names = {model.name for model in models.MODELS}
    assert {f"certified, {reading}" for reading in MOMENTS} <= names
    assert {"parabolic", "exact", "resultants", "vertex forces", "zero dilatancy"} <= names
    assert {"Gilbert", "full model", "least model"} <= names
    assert {a for a, _, _ in models.BELOW} | {b for _, b, _ in models.BELOW} == names


@pytest.mark.parametrize("family", ["stacks", "boulders"])
def test_models_do_not_contradict_each_other(family: str) -> None:
    """All but the slow ones; zero dilatancy's members are checked by a second writing. Gilbert's
    scheme may end where its load factor settles before Coulomb's law holds, and then says so."""
    slow = ("certified", "exact", "strong", "weak")
    asked = [m for m in models.MODELS if not m.name.startswith(slow)]
    made = sample(family, 1)
    found = {model.name: models.ask(model, made) for model in asked}
    assert models.contradictions(found, made.scene) == {}
    assert found.pop("Gilbert")["outcome"] in (Outcome.RIGHT, Outcome.NO_ANSWER, Outcome.HONEST)
    assert {record["outcome"] for record in found.values()} <= {Outcome.RIGHT, Outcome.NO_ANSWER}
    assert found["zero dilatancy"]["members"] >= 1


def test_a_contradiction_between_models_is_found() -> None:
    def record(low: float, high: float) -> dict[str, float]:
        return {"low": low, "high": high, "unit": high, "natural": 1.0}

    found = {"conic": record(0.5, 0.5), "8-gon": record(0.49, 0.49), "4-gon": record(0.6, 0.6)}
    assert set(models.contradictions(found, single_block())) == {"conic", "8-gon"}


def test_what_forces_leave_of_equilibrium_and_yield() -> None:
    scene = single_block(friction=0.3)
    solution = solve(scene)
    good = models.leftover(scene, solution.forces, solution.load_factor)
    assert good < 1e-7
    assert models.leftover(scene, solution.forces, 1.1 * solution.load_factor) > 1e-2
    assert models.leftover(scene, 1.1 * solution.forces, solution.load_factor) > 1e-2
    assert models.leftover(scene.with_friction(0.25), solution.forces, solution.load_factor) > 1e-2


def test_a_line_of_forces_holds_the_forces_of_a_solution() -> None:
    scene = sample("stacks", 1).scene
    line, solution = Line.of(scene), solve(scene)
    assert line is not None
    forces = line.x + solution.load_factor * line.y
    np.testing.assert_allclose(forces, solution.forces, atol=1e-6 * np.abs(forces).max())


def test_the_atlas_in_the_docs_shows_its_pictures() -> None:
    docs = Path(__file__).parents[2] / "docs" / "evidence"
    page = (docs / "atlas.md").read_text("utf-8")
    for name in pictures.PICTURES:
        assert f"]({name})" in page
        assert (docs / name).stat().st_size > 5_000


def test_claims_of_ours() -> None:
    solution = solve(builtin_scene("stack"))
    assert claim_of(solution) == Claim(solution.load_factor, "certified")
    iterated = solve(sample("slivers", 1).scene, method=FixedPoint(0.0, max_iterations=3))
    assert claim_of(iterated).says is None or iterated.status is Status.CONVERGED
