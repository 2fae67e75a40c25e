"""Problems with CVXPY Parameters behind our own solver: the same matrices as CVXPY's, kept between
solves, and answers that do not depend on the solve before."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cvxpy as cp
import cvxpy.settings as keys
import numpy as np
import pytest

from cvxlimit.solvers import Blockwise, run, settings_for
from cvxlimit.solvers.table import able
from helpers import COMPILED

BACKENDS = (None, "CPP", "SCIPY", "COO")


def random_problem(rng: np.random.Generator) -> tuple[cp.Problem, Callable[..., None]]:
    """Linear constraints and cones of all shapes that CVXPY takes, with Parameters in any place,
    and what gives these random values, or zeros."""
    n, k = (int(rng.integers(1, 7)) for _ in range(2))
    x, X, t = cp.Variable(n), cp.Variable((k, 3)), cp.Variable(k)
    vector, scalar, size = cp.Parameter(n), cp.Parameter(), cp.Parameter(nonneg=True)
    matrix, other = cp.Parameter((k, n)), cp.Parameter(k)
    stated = [
        cp.multiply(vector, x) <= scalar,
        matrix @ x == other,
        cp.SOC(t + scalar, X, axis=1),
        cp.SOC(cp.multiply(other, t), X.T, axis=0),
        cp.SOC(size, x[:1]),
        cp.norm(cp.multiply(vector, x)) <= 3.0 * size + 1.0,
        x >= -1.0,
        cp.sum(x) == scalar,
        cp.abs(t) <= size,
        size * np.ones((k, 3)) >= X,
        cp.norm(X, "fro") <= size,
        scalar * x[0] + x[0] + size * x[0] <= 3.0,
        x - x == 0.0 * x,
    ]
    chosen = rng.permutation(len(stated))[: int(rng.integers(1, len(stated) + 1))]

    def set_values(is_zero: bool = False) -> None:
        for given in (vector, scalar, size, matrix, other):
            value = rng.normal(size=given.shape) * (rng.random(given.shape) < 0.7)
            value = np.abs(value) if given is size else value
            given.value = 0.0 * value if is_zero else value

    goal = vector @ x if rng.random() < 0.5 else cp.sum(x)
    return cp.Problem(cp.Maximize(goal), [stated[i] for i in chosen]), set_values


@pytest.mark.parametrize("seed", range(24))
def test_matrices_are_those_of_cvxpy_bit_for_bit(seed: int) -> None:
    """At three values of the Parameters, zeros among them, by all ways of compiling."""
    problem, set_values = random_problem(np.random.default_rng(seed))
    again, backend = cp.Problem(problem.objective, problem.constraints), BACKENDS[seed % 4]
    for is_zero in (False, False, True):
        set_values(is_zero)
        own, _, _ = problem.get_problem_data(Blockwise(), canon_backend=backend)
        linear = {"use_quad_obj": False}
        usual, _, _ = again.get_problem_data("CLARABEL", canon_backend=backend, solver_opts=linear)
        for part in ("data", "indices", "indptr"):
            np.testing.assert_array_equal(getattr(own[keys.A], part), getattr(usual[keys.A], part))
        np.testing.assert_array_equal(own[keys.B], usual[keys.B])
        np.testing.assert_array_equal(own[keys.C], usual[keys.C])
        assert str(own["dims"]) == str(usual["dims"])


def sliding_stack() -> tuple[cp.Problem, cp.Parameter, Any]:
    """Five blocks on each other, pushed at rest of friction: alpha = least friction, for each
    joint carries what is above it."""
    weight = 1.0 + np.arange(5)
    friction, alpha = cp.Parameter(5, nonneg=True, value=np.full(5, 0.5)), cp.Variable()
    pressed, shear, bound = cp.Variable(5), cp.Variable((5, 2)), cp.Variable(5)
    above = np.cumsum(weight)
    problem = cp.Problem(
        cp.Maximize(alpha),
        [
            pressed == above,
            shear[:, 0] == alpha * above,
            shear[:, 1] == 0.0,
            cp.SOC(bound, shear, axis=1),
            bound <= cp.multiply(friction, pressed),
        ],
    )
    return problem, friction, above


@COMPILED
class TestResolving:
    def test_answers_follow_the_parameter(self) -> None:
        """Closed form; 1e-8 is a thousand times what the solver is asked for."""
        problem, friction, _ = sliding_stack()
        rng = np.random.default_rng(2)
        for _ in range(6):
            friction.value = 0.2 + rng.random(5)
            value = problem.solve(solver=Blockwise())
            assert value == pytest.approx(friction.value.min(), abs=1e-8)

    def test_the_compilation_is_kept(self) -> None:
        problem, friction, _ = sliding_stack()
        first, chain, _ = problem.get_problem_data(Blockwise())
        friction.value = np.full(5, 0.7)
        second, again, _ = problem.get_problem_data(Blockwise())
        assert second[keys.PARAM_PROB] is first[keys.PARAM_PROB]
        assert again is chain
        assert not np.array_equal(second[keys.A].data, first[keys.A].data)

    def test_a_problem_solved_twice_has_the_same_bits(self) -> None:
        """Also after a solve that started warm: only what has changed is solved again."""
        problem, friction, _ = sliding_stack()
        for value in (0.5, 0.6, 0.61):
            friction.value = np.full(5, value)
            found = []
            for _ in range(2):
                problem.solve(solver=Blockwise())
                found.append([v.value for v in problem.variables()])
            for one, other in zip(*found, strict=True):
                np.testing.assert_array_equal(one, other)

    def test_other_options_are_another_question(self) -> None:
        """A loose answer is not given out for a tight one."""
        problem, friction, _ = sliding_stack()
        friction.value = 0.5 + 0.1 * np.arange(5)
        with pytest.raises(cp.SolverError, match="BLOCKWISE"):
            problem.solve(solver=Blockwise(), max_iter=2)
        assert problem.solve(solver=Blockwise()) == pytest.approx(0.5, abs=1e-8)

    def test_a_point_that_is_no_use_does_no_harm(self) -> None:
        """From friction 100,000 times as large, and back from a problem without an answer."""
        problem, friction, _ = sliding_stack()
        for value in (5e4, 0.5):
            friction.value = np.full(5, value)
            assert problem.solve(solver=Blockwise()) == pytest.approx(value, rel=1e-8)
        above, level, most = cp.Parameter(value=2.0), cp.Variable(), cp.Variable(2)
        other = cp.Problem(cp.Maximize(level), [most == level, most <= 1.0, most >= above])
        other.solve(solver=Blockwise())
        assert other.status == "infeasible"
        above.value = 0.5
        assert other.solve(solver=Blockwise()) == pytest.approx(1.0, abs=1e-8)


CASES = {  # solvers in turn, and the largest x by the Parameter, with the multiplier of its limit
    "linear": (("HIGHS", "SCIPY", "CLARABEL", "BLOCKWISE", "HIGHS"), lambda mu: (2.0 * mu, 1.0)),
    "cone": (("CLARABEL", "SCS", "BLOCKWISE", "RESCALED"), lambda mu: (mu, 1.0)),
    "square": (("CLARABEL", "OSQP", "SCS"), lambda mu: (mu, 0.0)),
    "exponential": (("CLARABEL", "SCS", "CLARABEL"), lambda mu: (np.log(mu), 1.0 / mu)),
}


@pytest.mark.parametrize("kind", CASES)
def test_solvers_in_turn_answer_for_the_present_values(kind: str) -> None:
    """Whatever the one before was given; 1e-4 for first-order methods."""
    names, expected = CASES[kind]
    (x, y, both), mu = (cp.Variable() for _ in range(3)), cp.Parameter(nonneg=True)
    limit = {
        "linear": both <= mu,
        "cone": cp.norm(cp.hstack([x, y])) <= mu,
        "square": both <= 9.0,
        "exponential": cp.exp(x) <= mu,
    }[kind]
    goal = 2.0 * mu * x - cp.square(x) if kind == "square" else x
    problem = cp.Problem(cp.Maximize(goal), [limit, both == x + y, y >= -mu, y <= mu])
    for i, name in enumerate(each for each in names if each in able()):
        mu.value = 1.5 + 0.25 * i
        outcome = run(problem, settings_for(name, 1e-7))
        assert outcome.status == "optimal", (name, outcome)
        found = float(x.value), float(np.ravel(limit.dual_value)[0])
        np.testing.assert_allclose(found, expected(mu.value), atol=1e-4, err_msg=name)
