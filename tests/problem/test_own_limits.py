"""Brackets of one's own limits and aims, against a cone program written by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from cvxlimit import Block, Load, PointForce, Scene, Status, Tie, builtin_scene, prove, solve
from cvxlimit.errors import ModelError
from cvxlimit.io import write_result
from cvxlimit.masonry import random_wall, single_block, stack
from cvxlimit.problem.own_limits import OwnCertifier, OwnState
from cvxlimit.problem.problem import LimitProblem
from cvxlimit.proof.certificate import Certifier
from exhaustive import mostly_slow
from own_limits import case, forces_of, scene_of
from referee import ROUNDING, referee

COMPONENTS = ("V1", "V2", "N", "M1", "M2", "MT")
WIDTH = 1e-4
"""Of brackets that count as closed: ten times the default tolerance, for degenerate limits."""


def on(row: np.ndarray) -> Callable[[Any, Any], Any]:
    """The sum of forces that a row (6 n,) weighs."""
    return lambda x, _: cp.sum(cp.multiply(row.reshape(-1, 6), x))


def below(rows: list[np.ndarray]) -> Callable[[Any, Any], list[Any]]:
    """Linear limits; rows (6 n + 2,) are forces, alpha, right, each over its largest entry."""
    scaled = [row / np.abs(row[:-1]).max() for row in rows]
    return lambda x, alpha: [on(r[:-2])(x, alpha) + r[-2] * alpha <= r[-1] for r in scaled]


def pushed(seed: int) -> tuple[Scene, np.ndarray, float]:
    """A random wall with a load factor, collapse forces, and the factor."""
    for number in range(seed % 23, 23 + seed):
        found = solve(scene := random_wall(number))
        if found.load_factor is not None and found.forces is not None:
            return scene, found.forces, found.load_factor
    raise AssertionError


def drawn(scene: Scene, random: np.random.Generator, forces: np.ndarray, factor: float):
    """A linear limit on a few contacts, and on the load factor or not, that the optimum breaks."""
    row = np.zeros(6 * len(scene.contacts))
    at = random.choice(len(scene.contacts), size=int(random.integers(1, 4)), replace=False)
    for j in at:
        row[6 * j : 6 * j + 3] = random.normal(size=3)
    of_factor = float(random.choice([0.0, 1.0])) * np.abs(row @ forces.ravel()) / max(factor, 0.1)
    return row, of_factor


def stated(problem: LimitProblem, row: np.ndarray) -> cp.Expression:
    """A row on contact forces as an expression of the problem's."""
    parts = row.reshape(-1, 6)
    terms = [
        parts[j, k] * getattr(problem, name)[j]
        for k, name in enumerate(COMPONENTS)
        for j in np.flatnonzero(parts[:, k]).tolist()
    ]
    return sum(terms[1:], start=terms[0])


def at_rest(scene: Scene) -> np.ndarray:
    """Some state under the dead load alone."""
    dead = LimitProblem(scene)
    dead.add("dead alone", dead.factor == 0.0)
    calm = dead._stated.inside().run().forces
    assert calm is not None
    return calm


@pytest.mark.parametrize("seed", mostly_slow(range(200), range(4)))
@pytest.mark.exhaustive_cases("0")
def test_limits(seed: int) -> None:
    """Limits between what the dead load and what the collapse load give are kept to, and cost."""
    random = np.random.default_rng(seed)
    scene, forces, collapse = pushed(seed)
    problem = LimitProblem(scene)
    calm, rows = at_rest(scene), []
    for i in range(int(random.integers(1, 4))):
        row, of_factor = drawn(scene, random, forces, collapse)
        low, high = row @ calm.ravel(), row @ forces.ravel() + of_factor * collapse
        if high < low:
            row, of_factor, low, high = -row, -of_factor, -low, -high
        right = low + float(random.uniform(0.3, 0.9)) * (high - low)
        rows.append(np.array([*row, of_factor, right]))
        problem.add(f"own {i}", stated(problem, row) + of_factor * problem.factor <= right)
    found = problem.solve()
    exact = referee(scene, below(rows)).optimum
    size = max(abs(exact), abs(collapse))
    assert exact <= collapse + ROUNDING * size
    assert found.bracket.is_proved
    assert found.lower - ROUNDING * size <= exact <= found.upper + ROUNDING * size
    assert found.upper - found.lower <= WIDTH * size
    assert_no_perturbation_refutes(problem, random, exact, size)


def assert_no_perturbation_refutes(
    problem: LimitProblem, random: np.random.Generator, exact: float, size: float
) -> None:
    """Bounds from spoiled forces, mechanisms and multipliers are worse, never wrong."""
    stated = problem._stated
    states = map(stated.run, stated.ladder())
    state = next(state for state in states if state.mechanism is not None)
    limits = stated.contact_limits()
    assert not isinstance(limits, str)
    assert state.mechanism is not None
    assert state.forces is not None
    proof = OwnCertifier(Certifier(stated.at_present(), stated.surfaces), limits)
    inner = stated.inside()
    inside = next(s for s in map(inner.run, inner.ladder()) if s.forces is not None)
    for share in (1e-6, 1e-3, 0.3):
        spoiled = [
            part * (1.0 + share * random.normal(size=part.shape))
            for part in (state.mechanism, state.own["multipliers"], state.forces)
        ]
        upper = proof.upper(spoiled[0], spoiled[1])
        none = np.zeros(0)
        lower = proof.lower(
            OwnState(spoiled[2], state.load_factor, none),
            OwnState(inside.forces, inside.load_factor, none),
        )
        assert lower - ROUNDING * size <= exact <= upper + ROUNDING * size


def test_no_mixture_breaks_a_limit_that_only_the_reserve_breaks() -> None:
    """Forces outside strength that keep a limit, and a reserve inside strength that breaks it."""
    scene = builtin_scene("tuff-wall")
    problem = LimitProblem(scene)
    problem.add("low", problem.factor <= 0.05)
    stated = problem._stated
    limits = stated.contact_limits()
    assert not isinstance(limits, str)
    proof = OwnCertifier(Certifier(stated.at_present(), stated.surfaces), limits)
    inner = LimitProblem(scene)
    inner.add("high", inner.factor == 0.2)
    reserve = inner._stated.inside().run()
    assert reserve.forces is not None
    assert reserve.load_factor is not None
    noise = np.random.default_rng(0).normal(size=reserve.forces.shape)
    outside = 0.05 * np.abs(reserve.forces).max() * noise
    none = np.zeros(0)
    state = OwnState(outside, 0.0499, none)
    assert proof.lower(state, OwnState(reserve.forces, reserve.load_factor, none)) <= 0.05
    within = LimitProblem(scene)
    within.add("lower", within.factor == 0.01)
    inside = within._stated.inside().run()
    assert inside.forces is not None
    assert 0.01 - 1e-6 <= proof.lower(state, OwnState(inside.forces, 0.01, none)) <= 0.05


@pytest.mark.parametrize("seed", mostly_slow(range(100), range(4)))
def test_aims(seed: int) -> None:
    """The largest of some sum of forces under a part of the collapse load."""
    random = np.random.default_rng(1000 + seed)
    scene, forces, collapse = pushed(seed)
    factor = float(random.uniform(0.2, 0.8)) * collapse
    row, _ = drawn(scene, random, forces, collapse)
    problem = LimitProblem(scene)
    problem.add("load", problem.factor == factor)
    problem.maximise(stated(problem, row) + 2.0)
    found = problem.solve()
    exact = referee(scene, lambda _, alpha: [alpha == factor], on(row)).optimum + 2.0
    size = max(abs(exact), scene.total_weight)
    assert found.bracket.is_proved
    assert found.lower - ROUNDING * size <= exact <= found.upper + ROUNDING * size
    assert found.upper - found.lower <= WIDTH * size
    assert found.quantity == "value of the aim"


def component_values(problem: LimitProblem) -> np.ndarray:
    return np.stack([getattr(problem, name).value for name in COMPONENTS], axis=1)


@pytest.mark.parametrize("seed", mostly_slow(range(100), range(3)))
def test_values_and_duals_are_those_of_the_answer(seed: int) -> None:
    """In units of force and with a live load drawn at random: after a solve CVXPY's values carry
    the loads and keep the limits, the objective is what they say, and no other right-hand sides
    give more than the duals allow, which a wrong dual would either way."""
    random = np.random.default_rng(2000 + seed)
    scene, forces, collapse = pushed(seed)
    unit, push = 10.0 ** random.uniform(-3, 3, size=2)
    weights = unit * np.array([scene.blocks[i].weight for i in scene.free])
    live = scene.live_forces * unit * push
    problem = LimitProblem(scene, weights=weights, live=live)
    row, _ = drawn(scene, random, forces, collapse)
    is_aim, size = seed % 3 == 0, unit * scene.total_weight
    load = cp.Parameter(value=0.5 * collapse / push)
    if is_aim:  # the most of some sum of forces under half of the load, and with one force kept
        equation = problem.add("load", problem.factor == load)
        problem.maximise(stated(problem, row))
        kept = problem.N[int(np.argmax(np.abs(forces[:, 2])))]
        most = cp.Parameter(value=1.2 * unit * float(np.abs(forces[:, 2]).max()))
        limits = [equation, problem.add("own", kept <= most)]
        rights, scales = [load, most], [load.value, size]
    else:
        low, high = (unit * float(row @ f.ravel()) for f in (at_rest(scene), forces))
        if high < low:
            row, low, high = -row, -low, -high
        most = cp.Parameter(value=low + float(random.uniform(0.3, 0.9)) * (high - low))
        limits = [problem.add("own", stated(problem, row) <= most)]
        rights, scales = [most], [high - low]
    found = problem.solve()
    assert found.status is Status.CERTIFIED
    x, alpha = component_values(problem).ravel(), float(problem.factor.value)
    statics = Certifier(problem._stated.at_present(), problem._stated.surfaces).statics
    residual = statics.matrix @ x + statics.dead + alpha * statics.live
    assert np.abs(residual).max() <= 1e-7 * np.abs(statics.dead).sum()
    np.testing.assert_allclose(x, found.forces.ravel(), atol=1e-9 * np.abs(x).max())
    aim = float(row @ x) if is_aim else alpha
    span = np.abs(row) @ np.abs(x) if is_aim else collapse / push
    assert problem.value == pytest.approx(aim, abs=1e-9 * span)
    assert found.load_factor == pytest.approx(aim, abs=1e-6 * span)
    assert all(limit.violation() <= 1e-6 * s for limit, s in zip(limits, scales, strict=True))
    duals = [float(limit.dual_value) for limit in limits]
    at = [right.value for right in rights]
    for share in (1e-2, -1e-2, 1e-1, -1e-1):
        steps = share * np.array(scales) * random.uniform(size=len(scales))
        for right, value, step in zip(rights, at, steps, strict=True):
            right.value = value + step
        other = problem.solve()
        if other.load_factor is not None and other.status is Status.CERTIFIED:
            allowed = found.upper + float(np.dot(duals, steps))
            assert other.lower <= allowed + 1e-5 * span


class TestNothingThrough:
    """A limit that leaves a force no room has a bracket: that of the scene without the contact."""

    @pytest.mark.parametrize("is_equation", [False, True])
    def test_a_tie_that_bears_nothing(self, is_equation: bool) -> None:
        bare = single_block()
        ground, block = (b.id for b in bare.blocks)
        tie = Tie(ground, block, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), yield_force=5.0)
        tied = replace(bare, ties=(tie,))
        alone, problem = solve(bare), LimitProblem(tied)
        pull = -problem.N[f"tie {ground}-{block}"]
        assert problem.solve().lower > alone.upper  # it holds the block down
        problem.add("loose", pull == 0.0 if is_equation else pull <= 0.0)
        found = problem.solve()
        assert found.status is Status.CERTIFIED
        assert found.load_factor == pytest.approx(alone.load_factor, rel=1e-5)

    def test_a_contact_that_is_open(self) -> None:
        """A block between two walls, pushed at one that bears nothing: it slides."""
        walls = [Block.box(f"wall{s:+d}", (2 * s - 1, -1, -1), (2 * s + 1, 1, 3)) for s in (-1, 1)]
        floor = Block.box("floor", (-1, -1, -1), (1, 1, 0))
        block = Block.box("block", (-1, -1, 0), (1, 1, 1), density=5)
        live = Load(points=(PointForce("block", (-1.0, 0.0, 0.5), (3.0, 0.0, 0.0)),))
        scene = Scene([*walls, floor, block], [w.id for w in walls] + ["floor"], live, friction=0.5)
        problem = LimitProblem(scene)
        assert problem.solve().status is Status.LIVE_LOAD_HARMLESS
        problem.add("open", problem.N["wall+1-block"] <= 0.0)
        found = problem.solve()
        assert found.status is Status.CERTIFIED
        assert found.load_factor == pytest.approx(0.5 * 20.0 / 3.0, rel=1e-5)


class TestWithoutBracket:
    """It still solves, and says why nothing is proved."""

    def problem(self) -> LimitProblem:
        return LimitProblem(builtin_scene("single-block"))

    @pytest.mark.parametrize(
        "limit",
        [
            lambda p: cp.exp(p.V1[0] / 10.0) <= 2.0,
            lambda p: cp.log(p.N[0]) >= 1.0,
            lambda p: cp.lambda_max(cp.bmat([[p.N[0], p.V1[0]], [p.V1[0], p.N[0]]])) <= 9.0,
        ],
    )
    def test_other_cones(self, limit: Any) -> None:
        problem = self.problem()
        problem.add("bent", limit(problem))
        found = problem.solve()
        assert found.status is Status.NOT_CERTIFIED
        assert not found.bracket.has_any
        assert found.load_factor is None
        assert problem.value == pytest.approx(0.4, rel=1e-6)
        assert "limit 'bent' has exponential or semidefinite cones" in found.note
        assert "nothing is proved of problem.value" in found.note

    def test_whole_numbers(self) -> None:
        """Either of two anchors, not both; cones and whole numbers together take other solvers."""
        scene = builtin_scene("single-block")
        for surface in ("octagon", "conic"):
            problem, first = LimitProblem(scene, surface), cp.Variable(boolean=True, name="first")
            problem.add("either", problem.V1[0] >= -0.5 - 0.25 * first, problem.V1[0] >= -1 + first)
            if surface == "octagon":
                found = problem.solve()
                assert problem.value == pytest.approx(0.5 / scene.total_weight, rel=1e-6)
                assert "limit 'either' has whole numbers" in found.note
            elif not {"MOSEK", "GUROBI"} & {*cp.installed_solvers()}:
                with pytest.raises(ModelError, match=r"'either' has whole numbers.*octagon"):
                    problem.solve()

    def test_forces_of_another_problem(self) -> None:
        problem, other = self.problem(), self.problem()
        with pytest.raises(ModelError, match="of another LimitProblem, variable 'n'"):
            problem.add("other", other.N[0] <= 3.0)
        with pytest.raises(ModelError, match="of another LimitProblem, variable 'alpha'"):
            problem.add("ours", problem.N[0] <= 3.0, problem.factor <= other.factor)
        with pytest.raises(ModelError, match="the aim has forces or the load factor of another"):
            problem.maximise(other.factor)
        assert problem.constraints.keys().isdisjoint({"other", "ours"})

    def test_no_room_is_told(self) -> None:
        """Friction held at its limit: forces on the edge of strength alone, at mu = 0.3."""
        problem = LimitProblem(builtin_scene("single-block"), friction=0.3)
        problem.add("slides", problem.V1[0] <= -0.3 * problem.N[0])
        found = problem.solve()
        assert found.load_factor == pytest.approx(0.3, rel=1e-6)
        assert found.upper == pytest.approx(0.3, rel=1e-5)
        assert found.lower == -np.inf
        assert "no lower bound, since no forces were found strictly inside" in found.note

    def test_an_aim_under_a_free_load_factor(self) -> None:
        problem = self.problem()
        problem.maximise(problem.N[0] + problem.factor)
        assert "no upper bound, since no equation gives the load factor" in problem.solve().note

    def test_two_that_cannot_hold_together_are_named(self) -> None:
        problem = LimitProblem(builtin_scene("arch"))
        problem.add("fair", problem.N[3] >= 0.1)
        problem.add("service", problem.factor == 0.1)
        problem.add("pair", problem.N[20] - problem.N[0] == 0.05)
        note = problem.solve().note
        assert "limit 'service' and limit 'pair' cannot hold together" in note
        assert "fair" not in note
        problem.remove("service")
        assert problem.solve().load_factor is not None

    def test_loads_that_nothing_carries_and_limits_that_bound_nothing(self) -> None:
        leaning = LimitProblem(stack(4, shift=(0.3, 0.0)))
        for found in leaning.at_rest(leaning.N[0]):
            assert "no forces were found that carry these loads" in found.note
        pressed = LimitProblem(single_block(live=Load(acceleration=(0.0, 0.0, -1.0))))
        pressed.add("some", pressed.N[0] >= 0.0)
        assert "no largest value: limits 'some' leave it free" in pressed.solve().note
        assert (pressed.status, pressed.value) == (cp.UNBOUNDED, np.inf)

    def test_three_of_which_any_two_can_hold(self) -> None:
        """A load factor in three steps, none of which is too much alone; and one beside, which is
        no part of it."""
        problem = LimitProblem(builtin_scene("single-block"))
        a, b = cp.Variable(name="a"), cp.Variable(name="b")
        problem.add("first", problem.factor >= a)
        problem.add("second", a >= b + 0.25)
        problem.add("beside", b <= 7.0)
        problem.add("third", b >= 0.25)
        note = problem.solve().note
        assert "limit 'first' and limit 'second' and limit 'third' cannot hold together" in note

    def test_a_limit_on_corners_beside_huge_rows(self) -> None:
        """It is on more than contact forces however large the numbers of another limit are."""
        problem = LimitProblem(builtin_scene("arch"))
        (corner,) = (v for v in problem.problem.variables() if v.name() == "n")
        problem.add("huge", 1e12 * problem.N[0] <= 1e14)
        problem.add("corner", corner[3] <= 0.01)
        found = problem.solve()
        assert not found.bracket.has_any
        assert "'corner' is on more than the forces of contacts" in found.note

    def test_limits_that_cannot_hold_are_named(self) -> None:
        problem = self.problem()
        problem.add("weightless", problem.N[0] <= 0.0)
        problem.add("harmless", problem.factor <= 100.0)
        found = problem.solve()
        assert found.load_factor is None
        assert "limit 'weightless' cannot hold" in found.note


def test_a_closed_form() -> None:
    """A block 0.4 as wide as high, whose joint bears a shear of half its weight at most times 0.5:
    it would rock at 0.4, and now slides off the limit at 0.25; the mechanism is the limit's."""
    scene = builtin_scene("single-block")
    problem = LimitProblem(scene)
    problem.add("weak", -0.25 * scene.total_weight <= problem.V1)
    problem.add("weak too", 0.25 * scene.total_weight >= problem.V1)
    found = problem.solve()
    assert found.bracket.is_proved
    assert (found.lower, found.upper) == pytest.approx((0.25, 0.25), rel=1e-6)
    problem.remove("weak")
    problem.remove("weak too")
    assert problem.solve().load_factor == pytest.approx(0.4, rel=1e-6)


def test_other_values_where_the_dead_load_alone_breaks_the_limits() -> None:
    """What was inside them before may be outside now: proved anew at every value, both ways."""
    problem, share = LimitProblem(scene := builtin_scene("arch")), cp.Parameter(value=1.0)
    at_rest = np.abs(solve(scene).forces[:, 0])
    most = float(at_rest.max())
    j = int(at_rest.argmax())
    problem.add("weak", problem.V1[j] <= most * share, problem.V1[j] >= -most * share)
    for share.value in (0.7, 0.69, 0.5, 0.7):
        found, anew = problem.solve(), LimitProblem(scene)
        anew.add("weak", anew.V1[j] <= most * share.value, anew.V1[j] >= -most * share.value)
        expected = anew.solve()
        assert found.bracket.is_proved
        assert found.lower <= expected.upper
        assert expected.lower <= found.upper
        assert found.upper - found.lower <= 1e-5 * abs(found.upper)


def solved_with(seed: int) -> None:
    """Limits of all kinds that some forces satisfy: bounds hold the referee's optimum and close."""
    scene, limits, alone = case(seed)
    problem = LimitProblem(scene)
    forces = forces_of(problem)
    for i, limit in enumerate(limits):
        problem.add(f"{limit.name} {i}", *limit.stated(forces, problem.factor))
    found = problem.solve()
    verdict = referee(scene, lambda x, a: [c for limit in limits for c in limit.stated(x, a)])
    assert verdict.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)
    exact, room = verdict.optimum, 3 * ROUNDING * max(alone, abs(verdict.optimum))
    assert found.lower - room <= exact <= found.upper + room
    assert found.status is Status.CERTIFIED, found.note
    assert found.note.startswith("both bounds are proved")


@pytest.mark.parametrize("seed", mostly_slow(range(9), [1, 2, 4, 5, 6, 7, 8]))  # each kind once
@pytest.mark.exhaustive_cases("4")
def test_limits_of_all_kinds(seed: int) -> None:
    solved_with(seed)


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(9, 120))
def test_a_hundred_scenes_with_limits_of_all_kinds(seed: int) -> None:
    solved_with(seed)


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("kind", ["sum of squares", "norm", "largest"])
def test_aims_that_are_not_linear(seed: int, kind: str) -> None:
    """The least of convex functions of forces, under a part of the collapse load."""
    scene, _, collapse = scene_of(seed)
    factor = 0.5 * collapse

    def least(x: Any, _: Any) -> Any:
        some = x[:3, :3] / scene.total_weight
        if kind == "sum of squares":
            return cp.sum_squares(some)
        return cp.norm(cp.vec(some, order="C")) if kind == "norm" else cp.max(cp.abs(some))

    problem = LimitProblem(scene)
    problem.add("load", problem.factor == factor)
    problem.minimise(least(forces_of(problem), None))
    found = problem.solve()
    exact = -referee(scene, lambda _, a: [a == factor], lambda x, a: -least(x, a)).optimum
    assert found.status is Status.CERTIFIED, found.note
    assert found.lower - 1e-6 <= exact <= found.upper + 1e-6
    assert found.load_factor == pytest.approx(exact, abs=1e-6)


def test_variables_of_ones_own_have_bounds() -> None:
    """A strut that gives way: a force beside, of a price. By hand: the block slides at mu and takes
    what the strut adds, over its weight."""
    scene = single_block((1.0, 1.0, 0.2), friction=0.5)
    problem, strut = LimitProblem(scene), cp.Variable(name="strut")
    problem.add("held", problem.V1[0] >= -1.0 - strut, strut <= 0.5, strut >= 0.0)
    found = problem.solve()
    assert found.status is Status.CERTIFIED
    assert found.load_factor == pytest.approx(1.5 / scene.total_weight, rel=1e-6)
    assert strut.value == pytest.approx(0.5, rel=1e-6)


def test_equations_between_forces_have_bounds() -> None:
    problem = LimitProblem(builtin_scene("arch"))
    free = problem.solve()
    problem.add("alike", problem.N[0] == problem.N[20])
    found = problem.solve()
    assert found.status is Status.CERTIFIED
    assert found.upper < free.lower
    assert problem.N.value[0] == pytest.approx(problem.N.value[20], rel=1e-7)


def test_files_keep_no_limits_and_the_answer_says_so(tmp_path) -> None:
    """The limit halves the load factor: the scene alone bears out no such upper bound."""
    scene = single_block()
    free, problem = solve(scene).load_factor, LimitProblem(scene)
    problem.add("less shear", cp.abs(cp.sum(problem.V1)) <= 0.5 * free * scene.total_weight)
    found = problem.solve()
    assert found.status == "certified"
    assert found.load_factor == pytest.approx(0.5 * free, rel=1e-5)  # by equilibrium
    assert "result files keep no limits" in found.note
    write_result(found, tmp_path / "result.json")
    assert not prove(tmp_path / "result.json", scene).is_proved
