"""A limit problem that its user changes: Parameters, limits and aims of one's own."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import chain, combinations
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from cvxlimit import Block, Load, Reaction, Scene, Status, Tie, Units, builtin_scene, solve
from cvxlimit.errors import InputError, ModelError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.masonry import random_wall, single_block, stack
from cvxlimit.problem.problem import LimitProblem
from cvxlimit.solvers import blockwise, settings_for
from exhaustive import slow
from helpers import assert_certified
from referee import referee
from rows import assert_same_rows

ARCH = builtin_scene("arch")
MORTAR = ARCH.with_cohesion(3.0).with_strength(tensile=0.8, compressive=900.0)


def with_values(scene: Scene, **values: Any) -> Scene:
    return scene._with_contacts(scene.contacts.with_values(**values))


def anchored() -> Scene:
    """A block on the ground, tied at its top to a wall beside it."""
    ground = Block.box("ground", (-5, -1, -1), (5, 2, 0))
    wall = Block.box("wall", (-4, 0, 0), (-3, 1, 2))
    block = Block.box("block", (0, 0, 0), (1, 1, 2), density=10.0)
    tie = Tie("wall", "block", (-3, 0.5, 2), (0, 0.5, 2), 4.0)
    live = Load(acceleration=(1.0, 0.0, 0.0))
    return Scene([ground, wall, block], ["ground", "wall"], live, friction=0.9, ties=(tie,))


def random(scene: Scene, low: float, high: float) -> np.ndarray:
    return np.random.default_rng(3).uniform(low, high, len(scene.contacts))


CASES = {
    "friction": (ARCH, "friction", lambda s: 0.5),
    "friction, one per contact": (
        ARCH,
        "friction",
        lambda s: random(s, 0.4, 0.8),
    ),
    "friction with mortar": (MORTAR, "friction", lambda s: random(s, 0.4, 0.8)),
    "cohesion": (MORTAR, "cohesion", lambda s: 2.0),
    "tensile_strength": (MORTAR, "tensile_strength", lambda s: random(s, 0.0, 2.0)),
    "compressive_strength": (ARCH, "compressive_strength", lambda s: 300.0),
}


@pytest.mark.parametrize("name", CASES)
def test_strengths_as_parameters_are_those_of_a_scene(name: str) -> None:
    """Both brackets are proved, and on each other; rows and CVXPY's constraints say the same."""
    scene, what, value = CASES[name]
    given = value(scene)
    parameter = cp.Parameter(np.shape(given), value=np.full(np.shape(given), 0.6), name=what)
    if what == "compressive_strength":
        parameter.value = 500.0
    problem = LimitProblem(scene, **{what: parameter})
    problem.solve()
    parameter.value = given
    assert_same_rows(problem._stated)
    own, anew = problem.solve(), solve(with_values(scene, **{what: given}))
    for solution in (own, anew):
        assert solution.status is Status.CERTIFIED
    assert own.lower <= anew.upper
    assert anew.lower <= own.upper
    forces = own.forces[:, 2]
    np.testing.assert_allclose(problem.N.value, forces, atol=1e-3 * np.abs(forces).max())


@pytest.mark.parametrize("kind", ["acceleration", "list", "forces", "weights", "weights and live"])
def test_loads_as_parameters_are_those_of_a_scene(kind: str) -> None:
    scene = builtin_scene("tuff-wall")
    weights = np.array([scene.blocks[i].weight for i in scene.free])
    push = np.array([0.3, 1.0, 0.1])
    a, w = cp.Parameter(3, value=[0.0, 1.0, 0.0]), cp.Parameter(len(weights), value=weights)
    other = weights * np.random.default_rng(1).uniform(0.5, 1.5, len(weights))
    forces = cp.Parameter((len(weights), 6), value=scene.live_forces)
    given: dict[str, Any] = {
        "acceleration": {"live": a},
        "list": {"live": [a[0], a[1], 0.1]},
        "forces": {"live": forces},
        "weights": {"weights": w},
        "weights and live": {"weights": w, "live": a},
    }[kind]
    problem = LimitProblem(scene, **given)
    problem.solve()
    expected = scene
    if "weights" in given:
        w.value = other
        blocks = list(scene.blocks)
        for i, weight in zip(scene.free, other, strict=True):
            object.__setattr__(block := pickle.loads(pickle.dumps(blocks[i])), "density",
                               weight / blocks[i].volume)  # fmt: skip
            blocks[i] = block
        expected = Scene(blocks, scene.supports, scene.live, friction=scene.friction)
    if "live" in given:
        a.value = push
        forces.value = 2.0 * scene.live_forces
        live = {"live": Load(acceleration=tuple(push))}
        if kind == "forces":
            live["live"] = Load(acceleration=(0.0, 2.0, 0.0))
        expected = expected.with_live(live["live"])
    if kind != "weights and live":  # a product of Parameters, which CVXPY compiles afresh
        assert_same_rows(problem._stated)
    own, anew = problem.solve(), solve(expected)
    assert own.status is anew.status is Status.CERTIFIED
    assert own.lower <= anew.upper * (1.0 + 1e-12)
    assert anew.lower <= own.upper * (1.0 + 1e-12)


def test_numbers_in_place_of_a_scenes_own() -> None:
    """A slab slides at mu in any direction, whatever its weight."""
    scene = single_block((1.0, 1.0, 0.2), friction=0.9)
    problem = LimitProblem(scene, friction=0.3, live=Load(acceleration=(0, 1, 0)), weights=7.0)
    solution = problem.solve()
    assert_certified(solution)
    assert solution.load_factor == pytest.approx(0.3, rel=1e-7)
    assert solution.forces[0, 2] == pytest.approx(7.0)


@pytest.mark.exhaustive
def test_only_what_changed_is_solved_from_where_the_last_solve_ended() -> None:
    """Solved again without a change it is the same, bit for bit; after one it is certified anew."""
    mu = cp.Parameter(value=0.6, name="mu")
    problem = LimitProblem(builtin_scene("tuff-wall"), friction=mu)
    first, again = problem.solve(), problem.solve()
    assert (first.load_factor, first.lower, first.upper) == (
        again.load_factor, again.lower, again.upper
    )  # fmt: skip
    for value in (0.1, 0.7, 3.0, 0.0):
        mu.value = value
        solution = problem.solve()
        anew = solve(builtin_scene("tuff-wall").with_friction(value))
        assert anew.status is solution.status
        if value < 1.0:  # with 3 the live load does no harm
            assert solution.load_factor == pytest.approx(anew.load_factor, rel=1e-5)


@pytest.mark.parametrize("solver", ["CLARABEL", *(own.name for own in blockwise()), "cvxpy"])
def test_a_prop_takes_what_it_may(solver: str) -> None:
    """A slab on mu = 0.5 with its shear limited to a fifth of its weight, then to a third."""
    scene = single_block((1.0, 1.0, 0.2), friction=0.5, live=Load(acceleration=(1, 0, 0)))
    problem, most = LimitProblem(scene), cp.Parameter(name="most")
    weight, name = scene.total_weight, scene.contacts.names[0]
    problem.add("weak joint", cp.abs(problem.V1[name]) <= most, cp.abs(problem.V2[name]) <= most)
    rung = settings_for("CLARABEL" if solver == "cvxpy" else solver)
    with pytest.raises(ModelError, match=r"Parameter 'most' has no value"):
        problem.solve(rung)
    for share in (0.2, 1.0 / 3.0):
        most.value = share * weight
        state = problem._stated.run(rung, has_rows=solver != "cvxpy")
        assert state.load_factor == pytest.approx(share, rel=1e-6)
        assert problem._stated.tell(state) == pytest.approx(share, rel=1e-6)
        assert problem.factor.value == pytest.approx(share, rel=1e-6)
        duals = [float(abs(limit.dual_value)) for limit in problem.constraints["weak joint"]]
        # a unit more of the joint's strength is one over the weight more of the load factor
        assert max(duals) == pytest.approx(1.0 / weight, rel=1e-4)
    problem.remove("weak joint")
    assert problem.solve(rung).load_factor == pytest.approx(0.5, rel=1e-6)


def test_limits_and_aims_are_cvxpys() -> None:
    """Over contacts, with the load factor, cones, variables and quadratic aims of one's own: rows
    and CVXPY agree, to the root of their gaps where forces are squared."""
    scene = builtin_scene("tuff-wall")
    problem, spare = LimitProblem(scene), cp.Variable(nonneg=True, name="spare")
    first, second, *_ = scene.contacts.names
    unit = scene.total_weight
    problem.add("sum", problem.N[first] + 2.0 * problem.N[second] <= 0.01 * unit * problem.factor)
    problem.add("cone", cp.norm(cp.hstack([problem.V1[3], problem.V2[3]])) <= spare)
    problem.add("spare", spare <= 1e-4 * unit)
    rung = settings_for("CLARABEL")
    both = [problem._stated.run(rung, has_rows).load_factor for has_rows in (True, False)]
    assert both[0] == pytest.approx(both[1], rel=1e-6)
    problem.solve(rung)
    assert np.hypot(problem.V1[3].value, problem.V2[3].value) <= spare.value + 1e-7 * unit
    problem.add("load", problem.factor == 0.2)
    problem.maximise(problem.N[3])
    found = [problem._stated.run(rung, has_rows).forces[3, 2] for has_rows in (True, False)]
    assert found[0] == pytest.approx(found[1], rel=1e-6)
    problem.maximise(-cp.sum_squares(problem.N[:3]))
    found = [problem._stated.run(rung, has_rows).forces[:3, 2] for has_rows in (True, False)]
    np.testing.assert_allclose(found[0], found[1], atol=1e-4 * unit)


def test_a_solution_leads_to_its_problem() -> None:
    """With a limit added it says so, pickles, and without the limit is the old one."""
    problem = solve(scene := builtin_scene("tuff-wall")).problem
    name = scene.contacts.names[0]
    problem.add("tie", problem.N[name] <= 0.01)
    solution = problem.solve("CLARABEL")
    assert solution.bracket.is_proved
    assert "with limits 'tie'" in solution.note
    assert solution.problem is problem
    assert pickle.loads(pickle.dumps(solution)).load_factor == solution.load_factor
    problem.remove("tie")
    assert_certified(problem.solve())


def test_limits_that_no_load_factor_satisfies_are_named() -> None:
    problem = LimitProblem(scene := builtin_scene("tuff-wall"))
    weight = scene.total_weight
    problem.add("fair", problem.N[0] >= 0.0)
    problem.add("too much", problem.N[1] >= 50.0 * weight)
    solution = problem.solve()
    assert solution.load_factor is None
    assert "limit 'too much' cannot hold under these loads" in solution.note
    assert "fair" not in solution.note


def test_every_constraint_has_its_label() -> None:
    problem = LimitProblem(builtin_scene("arch"), "octagon")
    problem.add("own", problem.N[0] <= 1.0)
    assert set(problem.constraints) == {"rocking", "torsion-shear", "equilibrium", "own"}
    if hasattr(cp.Constraint, "set_label"):
        labels = {str(limit.label).split(" ")[0] for limit in problem.problem.constraints}
        assert labels == {"rocking", "torsion-shear", "equilibrium", "own"}


def test_it_shows_what_it_is() -> None:
    mu = cp.Parameter(value=0.5, name="mu")
    problem = LimitProblem(builtin_scene("arch"), friction=mu)
    problem.add("roof tie", problem.N[0] <= 3.0)
    shown = repr(problem)
    assert "'arch', conic" in shown
    assert "20 blocks, 21 contacts" in shown
    assert "roof tie 1" in shown
    assert "Parameters: mu" in shown
    assert len(shown) < 300


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p.add("a", 3.0), "limit 'a' must be a CVXPY constraint"),
        (lambda p: p.add("rocking", p.N >= 0), "there is a limit 'rocking' already"),
        (lambda p: p.add("a", cp.norm(p.N) >= 1.0), "limit 'a' is not convex"),
        (lambda p: p.remove("a"), "there is no added limit 'a': there are none"),
        (lambda p: p.maximise(p.N), "only one number that is concave"),
        (lambda p: p.maximise(cp.sum_squares(p.N)), "only one number that is concave"),
        (lambda p: p.maximise(3.0), r"an aim must be of forces, as problem.N\[0\], got 3.0"),
        (lambda p: p.maximise(cp.Constant(3.0)), "an aim must be of forces"),
        (lambda p: p.add("a", cp.Constant(2.0) <= 1.0), "limit 'a' must be on forces"),
        (lambda p: p.N["groun-b1.1"], "there is no contact 'groun-b1.1': did you mean"),
    ],
)
def test_refused_changes(change: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        change(LimitProblem(builtin_scene("tuff-wall")))


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_numbers_that_are_not_finite(number: float) -> None:
    changes: list[tuple[Any, str]] = [
        (lambda p: p.add("a", p.factor <= number), "limit 'a' has a number that is not finite"),
        (lambda p: p.add("a", number * p.N[0] <= p.factor), "limit 'a' has a number"),
        (lambda p: p.maximise(number * p.N[0]), "the aim has a number that is not finite"),
    ]
    for change, message in changes:
        problem = LimitProblem(builtin_scene("single-block"))
        problem.add("b", problem.factor == 0.1)
        change(problem)
        with pytest.raises(ModelError, match=message):
            problem.solve()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"friction": cp.Parameter(name="mu")}, "Parameter 'mu' has no value: set its .value to a"),
        ({"friction": cp.Parameter(value=-0.1)}, "friction of contact '.*' must be .*not negative"),
        ({"friction": [0.5, -0.1, *[0.5] * 144]}, "friction of contact '.*' must be .*negative"),
        ({"friction": np.ones(3)}, "friction must be one number or one for each of 146 contacts"),
        ({"live": cp.Parameter(4)}, r"live must be a Load, an acceleration.*got shape \(4,\)"),
        ({"weights": [1.0, 2.0]}, "weights must be one number or one for each of 54 free blocks"),
    ],
)
def test_refused_values(given: dict[str, Any], message: str) -> None:
    with pytest.raises((ModelError, InputError), match=message):
        LimitProblem(builtin_scene("tuff-wall"), **given).solve()


def test_what_was_added_as_rows_on_forces_of_contacts() -> None:
    """For proofs: rows hold what the limits say, with the multipliers of any solver; and the power
    of mechanism and multipliers is the load factor (strong duality, with no strength that resists
    besides friction)."""
    scene = builtin_scene("tuff-wall")
    problem, most = LimitProblem(scene), cp.Parameter(value=0.02, name="most")
    first, second, third, *_ = scene.contacts.names
    arm = cp.Parameter(value=2.0)
    mixed = problem.N[first] - arm * problem.M1[second] + 0.1 * problem.factor
    problem.add("mixed", mixed <= most)
    problem.add("even", problem.V1[third] == 0.5 * problem.V1[second])
    for most.value, arm.value in ((0.02, 2.0), (0.03, 2.0), (0.03, 3.0)):
        state = problem._stated.run(*blockwise() or [settings_for("CLARABEL")])
        rows = problem._stated.contact_limits()
        assert rows.names == ("even", "mixed")
        assert rows.is_equation.tolist() == [True, False]
        left = rows.matrix @ state.forces.ravel() + rows.factor * state.load_factor
        k = scene.contacts.names.index
        said = state.forces[k(first), 2] - arm.value * state.forces[k(second), 3]
        assert left[1] == pytest.approx(said + 0.1 * state.load_factor, rel=1e-9)
        assert rows.right.tolist() == pytest.approx([0.0, most.value])
        assert left[0] == pytest.approx(0.0, abs=1e-7)
        # u . f_L + multipliers . factor = 1, and -u . f_D + multipliers . right = load factor
        multipliers = state.own["multipliers"]
        assert multipliers[1] >= 0.0
        power = float((state.mechanism * scene.live_forces).sum()) + multipliers @ rows.factor
        assert power == pytest.approx(1.0, rel=1e-6)
        given = multipliers @ rows.right - float((state.mechanism * scene.dead_forces).sum())
        assert given == pytest.approx(state.load_factor, rel=1e-6)


def test_duals_are_those_of_cvxpy() -> None:
    problem = LimitProblem(builtin_scene("tuff-wall"))
    problem.add("load", problem.factor == 0.2)
    problem.add("tie", problem.N[3] <= 0.2)
    problem.maximise(problem.N[3] + problem.N[5])
    found = []
    for has_rows in (True, False):
        problem._stated.tell(problem._stated.run(settings_for("CLARABEL"), has_rows))
        own = [problem.constraints[name] for name in ("load", "tie")]
        found.append([float(c.dual_value) for named in own for c in named])
    assert found[0] == pytest.approx(found[1], rel=1e-2)  # duals are not unique to more
    assert any(value != 0.0 for value in found[0])


@pytest.mark.parametrize("atom", [cp.abs, cp.max, cp.norm1, cp.pos, lambda x: cp.maximum(x, 0.1)])
def test_limits_by_functions_have_a_bracket(atom: Any) -> None:
    """Where they govern and where they do not: that of a program of the tests' own."""
    scene = random_wall(5, sizes=[(2, 3)])
    problem, most = LimitProblem(scene), cp.Parameter()
    problem.add("plain", problem.N[0] <= 1e3)
    problem.add("cap", atom(-problem.V1) <= most)
    free = solve(scene).lower
    for most.value in (1e3, 0.15):
        found = problem.solve()
        exact = referee(scene, lambda x, _: [atom(-x[:, 0]) <= most.value]).optimum
        assert found.status is Status.CERTIFIED, found.note
        assert found.load_factor == pytest.approx(exact, rel=1e-5)
    assert exact < 0.99 * free


def test_an_aim_of_the_load_factor_alone_is_its_multiple() -> None:
    problem = LimitProblem(builtin_scene("arch"))
    plain = problem.solve()
    problem.maximise(2.0 * problem.factor)
    found = problem.solve()
    assert found.load_factor == pytest.approx(2.0 * plain.load_factor, rel=1e-6)
    assert found.bracket.lower <= 2.0 * plain.upper


@pytest.mark.skipif(not hasattr(cp.Constraint, "set_label"), reason="labels, since CVXPY 1.9")
def test_a_printed_problem_has_names_and_no_columns_of_digits() -> None:
    text = str(LimitProblem(builtin_scene("tuff-wall")).problem)
    assert len(text.splitlines()) < 12
    assert "equilibrium: A @ Hstack(n, V1, V2, MT)" in text
    assert "var" not in text


class TestValuesAfterASolve:
    """All that CVXPY shows is of the answer handed back. Figures of the arch are an own program's,
    to the digits given."""

    def values(self, problem: LimitProblem, solution: Any) -> None:
        forces = np.stack([getattr(problem, name).value for name in COLUMN], axis=1)
        size = np.abs(forces).max()
        np.testing.assert_allclose(forces, solution.forces, atol=1e-9 * size)
        assert problem.problem.value == pytest.approx(problem.problem.objective.value)
        assert problem.value == pytest.approx(solution.load_factor, rel=1e-6)
        for limits in problem.constraints.values():
            for limit in limits:
                assert limit.dual_value is not None
                assert np.max(limit.violation()) <= 1e-6 * max(1.0, size)

    def test_without_a_limit(self) -> None:
        problem = LimitProblem(ARCH)
        solution = problem.solve()
        self.values(problem, solution)
        assert problem.status == problem.problem.status == cp.OPTIMAL
        before = problem.value, problem.constraints["equilibrium"][0].dual_value.copy()
        problem.problem.solve("CLARABEL")  # CVXPY's own says the same, duals too
        assert problem.value == pytest.approx(before[0], rel=1e-6)
        duals = problem.constraints["equilibrium"][0].dual_value
        np.testing.assert_allclose(before[1], duals, atol=1e-4 * np.abs(duals).max())

    def test_a_limit_that_the_state_inside_keeps_otherwise(self) -> None:
        problem = LimitProblem(ARCH)
        limit = problem.add("thrust", problem.V1[3] >= 0.03)
        self.values(problem, problem.solve())
        assert problem.factor.value == pytest.approx(0.093299, abs=1e-6)
        assert limit.dual_value == pytest.approx(0.99359, abs=1e-5)

    @pytest.mark.parametrize("solver", ["CLARABEL", "RESCALED", "HIGHS"])
    def test_whoever_solves_it(self, solver: str) -> None:
        """HiGHS is run by CVXPY; its values and multipliers are the same, and prove as much."""
        problem = LimitProblem(ARCH, "octagon")
        limit = problem.add("weak joint", problem.V1[3] >= -0.05)
        solution = problem.solve(solver)
        assert_certified(solution)
        self.values(problem, solution)
        found = float(limit.dual_value)
        problem.problem.solve("CLARABEL")
        assert limit.dual_value == pytest.approx(found, rel=1e-5)

    @pytest.mark.parametrize(("kind", "most"), [("equation", 1.337451), ("factor", 1.380983)])
    def test_an_aim(self, kind: str, most: float) -> None:
        problem = LimitProblem(ARCH)
        problem.add("load", problem.factor == 0.1)
        given = problem.V1[3] == 0.01 if kind == "equation" else problem.factor <= 0.1
        problem.add("given", given)
        problem.maximise(problem.N[0])
        solution = problem.solve()
        assert solution.load_factor == pytest.approx(most, abs=1e-6)
        self.values(problem, solution)
        assert problem.factor.value == pytest.approx(0.1, rel=1e-9)
        assert solution.status is Status.CERTIFIED

    def test_an_aim_that_is_least(self) -> None:
        """Each of both words; value and bracket are the expression's."""
        for least in ("minimise", "minimize"):
            problem = LimitProblem(single_block())
            problem.add("load", problem.factor == 0.0)
            getattr(problem, least)(3.0 * problem.N[0] + 1.0)
            solution, weight = problem.solve(), single_block().total_weight
            assert_certified(solution)
            assert solution.load_factor == pytest.approx(3.0 * weight + 1.0)
            assert problem.value == pytest.approx(3.0 * weight + 1.0)
            assert problem.problem.objective.value == pytest.approx(3.0 * weight + 1.0)
            problem.add("none", problem.N[0] <= 0.0)
            problem.solve()
            assert problem.value == np.inf
        assert LimitProblem.maximize is LimitProblem.maximise

    @pytest.mark.parametrize("push", [0.001, 0.5, 1.0, 2.0, 3000.0])
    def test_duals_whatever_the_live_load(self, push: float) -> None:
        """The load factor grows by one with its limit, by 1 / (push x weight) with a joint's."""
        scene = single_block(live=Load(acceleration=(push, 0.0, 0.0)))
        problem, weight = LimitProblem(scene), scene.total_weight
        limit = problem.add("service", problem.factor <= 0.1 / push)
        problem.solve()
        assert limit.dual_value == pytest.approx(1.0, rel=1e-6)
        problem.remove("service")
        limit = problem.add("joint", problem.V1[0] >= -0.1 * weight)
        problem.solve()
        assert limit.dual_value == pytest.approx(1.0 / (push * weight), rel=1e-6)
        found = float(limit.dual_value)
        problem.problem.solve("CLARABEL")
        assert limit.dual_value == pytest.approx(found, rel=1e-4)

    def test_where_there_is_no_answer(self) -> None:
        problem = LimitProblem(ARCH)
        problem.solve()
        limit = problem.add("none", problem.N[0] <= -1.0)
        problem.solve()
        assert (problem.status, problem.value) == (cp.INFEASIBLE, -np.inf)
        assert problem.N.value is limit.dual_value is None
        harmless = LimitProblem(single_block(live=Load(acceleration=(0.0, 0.0, -1.0))))
        harmless.solve()
        assert (harmless.status, harmless.value) == (cp.UNBOUNDED, np.inf)

    def test_sure_of_what_was_added(self) -> None:
        problem = LimitProblem(ARCH)
        both = problem.add("joint", problem.V1[3] <= 0.05, problem.V1[3] >= -0.05)
        assert problem.constraints["joint"] == both
        assert problem.add("other", factor := problem.factor <= 9.0) is factor

    def test_what_joints_carry_at_rest(self) -> None:
        """A pile of blocks: what stands above, whatever was solved before, which stays as it is."""
        scene = stack(4)
        problem = LimitProblem(scene)
        solution = problem.solve()
        above = [
            sum(scene.blocks[i].weight for i in scene.free[j:]) for j in range(len(scene.free))
        ]
        for name, weight in zip(scene.contacts.names, above, strict=True):
            for found in problem.at_rest(problem.N[name]):
                assert_certified(found)
                assert found.load_factor == pytest.approx(weight, rel=1e-6)
        self.values(problem, solution)
        heavy = [1e6 * scene.blocks[i].weight for i in scene.free]
        in_newton = LimitProblem(scene, weights=heavy)
        for found in in_newton.at_rest(in_newton.M1[0]):
            assert found.status is Status.CERTIFIED
            assert found.lower <= 0.0 <= found.upper  # they stand centred

    def test_limits_of_any_name_count_at_rest(self) -> None:
        for name in ("load factor", "another"):
            problem = LimitProblem(builtin_scene("single-block"))
            problem.add(name, problem.factor <= -1.0)
            assert all(found.load_factor is None for found in problem.at_rest(problem.N[0]))

    def test_a_scene_with_values_of_its_own_refuses_what_would_miss_them(self) -> None:
        scene = LimitProblem(builtin_scene("single-block"), friction=0.3).solve().scene
        for same in (scene.with_density(2.0), scene.with_live(scene.live), scene.with_name("b")):
            assert same.contacts.friction.tolist() == [0.3]
        for change in (
            lambda: scene.with_friction(0.1),
            lambda: scene.with_cohesion(1.0),
            lambda: scene.with_strength(tensile=0.1),
            lambda: scene.moved(np.eye(3)),
            lambda: scene.in_units(Units("mm", "N"), 1e3, 1e3),
        ):
            with pytest.raises(InputError, match="values of their own, as a LimitProblem gives"):
                change()


class TestWordsOfCvxpy:
    def test_those_it_has(self) -> None:
        problem = LimitProblem(ARCH)
        first = problem.solve("CLARABEL", warm_start=False, verbose=False, gp=False, max_iter=200)
        again = problem.solve(solver="CLARABEL", warm_start=True, ignore_dpp=True)
        assert first.load_factor == pytest.approx(again.load_factor, rel=1e-6)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            (
                {"solver": "CLARABEL", "max_itr": 3},
                "has no option 'max_itr': did you mean 'max_iter'?",
            ),
            ({"warm_strat": True}, "did you mean 'warm_start'?"),
            ({"foo": 3}, "has no option 'foo': its options are .*max_iter"),
            ({"max_iter": "many"}, "does not take max_iter='many'"),
            ({"solver": "SCS", "foo": 3}, "SCS does not take foo=3"),
            ({"solver": "HIGHS", "mip_rel_gp": 3}, "did you mean 'mip_rel_gap'?"),
        ],
    )
    def test_those_that_nobody_knows(self, options: dict[str, Any], message: str) -> None:
        with pytest.raises(TypeError, match=message):
            LimitProblem(ARCH).solve(**options)

    def test_those_that_mean_nothing(self) -> None:
        with pytest.raises(ModelError, match=r"no requires_grad=True: .*sensitivity"):
            LimitProblem(ARCH).solve(requires_grad=True)

    @pytest.mark.parametrize("what", ["friction", "cohesion", "live", "weights"])
    def test_variables_are_none_of_its_numbers(self, what: str) -> None:
        with pytest.raises(ModelError, match=f"{what} must be known, got Variable 'open'"):
            LimitProblem(ARCH, **{what: cp.Variable(3 if what == "live" else (), name="open")})


STRENGTHS = {
    "friction": 0.6, "cohesion": 30.0, "tensile_strength": 2.0, "compressive_strength": 400.0
}  # fmt: skip


def test_mortar_as_a_parameter_where_no_stone_crushes() -> None:
    """Closed: 0.4 (1 + 2 x 0.16 / 3.2), tension in all of the joint about the toe."""
    tension = cp.Parameter(value=2.0)
    scene = builtin_scene("single-block").with_cohesion(5.0)
    solution = LimitProblem(scene, tensile_strength=tension).solve()
    assert_certified(solution)
    assert solution.load_factor == pytest.approx(0.44, rel=1e-6)


def _mixtures() -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    """Strengths that are given, and those of them that are Parameters."""
    found = []
    for given in chain.from_iterable(combinations(STRENGTHS, k) for k in range(1, 5)):
        if "tensile_strength" in given and "cohesion" not in given:
            continue  # beyond Mohr-Coulomb's cone
        found += [(given, p) for k in range(1, len(given) + 1) for p in combinations(given, k)]
    return found


@pytest.mark.parametrize(
    ("kind", "every"),
    [("tie", 9), *(slow(kind, 1) for kind in ("block", "tie", "arch", "some crush"))],
)
def test_numbers_and_parameters_agree_in_all_mixtures(kind: str, every: int) -> None:
    """Strengths with each other and with loads, one for all or one each; also where ties, which
    always crush, stand beside joints that do not."""
    scene = {"arch": ARCH, "some crush": ARCH}.get(kind, single_block())
    if kind == "tie":
        scene = anchored()
    n = len(scene.contacts)
    if kind == "some crush":
        strong = np.where(np.arange(n) % 3 > 0, np.inf, 400.0)
        scene = with_values(scene, compressive_strength=strong)
    push = scene.live_forces
    for i, (given, symbols) in enumerate(_mixtures()[::every]):
        if kind == "some crush" and "compressive_strength" in given:
            continue
        numbers: dict[str, Any] = {name: STRENGTHS[name] for name in given}
        if i % 2:
            numbers["live"] = 1.5 * push
        mixed = {
            k: cp.Parameter(np.shape(v), value=v) if k in symbols or k == "live" else v
            for k, v in numbers.items()
        }
        by_number, by_parameter = (LimitProblem(scene, **g).solve() for g in (numbers, mixed))
        assert by_number.status is by_parameter.status is Status.CERTIFIED, (given, symbols)
        assert by_parameter.lower <= by_number.upper * (1.0 + 1e-12)
        assert by_number.lower <= by_parameter.upper * (1.0 + 1e-12)


def test_a_strength_that_never_ends_is_no_parameter() -> None:
    """Said here, or by older CVXPY, which takes no such value."""
    said = r"compressive_strength as a Parameter must be finite|Parameter value must be real"
    with pytest.raises((ModelError, ValueError), match=said):
        LimitProblem(ARCH, compressive_strength=cp.Parameter(value=np.inf)).solve()


@pytest.mark.parametrize(("least", "most"), [(0, 3), (2, 3), (-1, 3), (-2, -1)])
def test_bounds_of_reactions_as_parameters(least: float, most: float) -> None:
    """A column of 1 m by 2 m, weight 40, turned about its edge by its weight times alpha; a force
    at its top holds it by what is largest, or pulls it by what is least in that way."""
    held = Reaction("b2", (1.0, 0.5, 2.0), (-1, 0, 0), most, least)
    other = Reaction("b1", (1.0, 0.5, 1.0), (-1, 0, 0), 4.0)  # half as far from the edge
    scene = replace(stack(2, size=(1.0, 1.0, 1.0), density=20.0), reactions=(held, other))
    ends = cp.Parameter(2), cp.Parameter(2)
    problem = LimitProblem(scene, most=ends[0], least=ends[1])
    for way in (1.0, 2.0, 0.5):
        ends[0].value, ends[1].value = [way * most, 4.0 * way], [way * least, 0.0]
        found = problem.solve()
        assert_certified(found)
        by_hand = (40.0 * 0.5 + way * (2.0 * most + 4.0)) / 40.0
        assert found.load_factor == pytest.approx(by_hand, rel=1e-6)
        plain = LimitProblem(scene, most=ends[0].value, least=ends[1].value).solve()
        assert_certified(plain)
        assert plain.load_factor == pytest.approx(by_hand, rel=1e-6)
        assert problem.N["reaction ground-b1 (1)"].value == pytest.approx(4.0 * way, rel=1e-5)


def test_bounds_of_reactions_that_are_refused() -> None:
    prop = Reaction("b2", (1.0, 0.5, 2.0), (-1, 0, 0), np.inf, 1.0)
    column = stack(2, size=(1.0, 1.0, 1.0), density=20.0)
    scene = replace(column, reactions=(prop,))
    with pytest.raises(ModelError, match="of which the scene has none"):
        LimitProblem(column, most=1.0)
    with pytest.raises(ModelError, match="one for each of 1 reactions"):
        LimitProblem(scene, most=[1.0, 2.0])
    with pytest.raises(ModelError, match="is infinite, which no expression is"):
        LimitProblem(scene, least=cp.Parameter())
    with pytest.raises(ModelError, match=r"least below most, got 1 and 0\.5"):
        LimitProblem(scene, most=0.5)
    bound = cp.Parameter(value=-2.0)
    with pytest.raises(ModelError, match="least below most, got 1 and -2"):
        LimitProblem(scene, most=bound).solve()


def test_a_tie_that_has_nothing_to_do_is_left_out() -> None:
    """A block that nothing moves, tied to the ground, beside one that is pushed."""
    blocks = [Block.box(f"b{i}", (3 * i, 0, 0), (3 * i + 1, 1, 1), density=10.0) for i in (0, 1)]
    ground = Block.box("ground", (-1, 0, -1), (5, 1, 0))
    rope = Reaction("b1", (4.0, 0.5, 0.5), (1, 0, 0), -1.0, -2.0)
    live = Load(forces={"b0": (1, 0, 0, 0, 0, 0)})
    scene = Scene([ground, *blocks], ["ground"], live, friction=0.3, reactions=(rope,))
    for found in (solve(scene), LimitProblem(scene).solve()):
        assert_certified(found)
        assert found.load_factor == pytest.approx(3.0, rel=1e-6)
