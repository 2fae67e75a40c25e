"""Cone programs as arrays: the same answer and the same duals by every solver that is installed."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from cvxlimit.solvers import SOLVERS, settings_for
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.solvers.table import able

WITHOUT_DUALS = {"SCIP", "GLPK_MI", "CBC", "CUOPT", "XPRESS"}
"""Of cones, or of any problem: no duals come back through CVXPY."""


def slider(has_cones: bool) -> ConeProgram:
    """max alpha: a block of weight 2 on friction of 0.4, pushed by alpha, and one of weight 3 on
    0.5 that is pushed by 2 alpha: alpha = min(0.8, 1.5 / 2). Unknown: N, V of both, alpha."""
    balance = [[1.0, 0, 0, 0, 0], [0, 1, 0, 0, -1], [0, 0, 1, 0, 0], [0, 0, 0, 1, -2]]
    cones = [[-0.4, 0, 0, 0, 0], [0, -1, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, -0.5, 0, 0],
             [0, 0, 0, -1, 0], [0, 0, 0, 0, 0]]  # fmt: skip
    rows = [[-0.4, 1, 0, 0, 0], [-0.4, -1, 0, 0, 0], [0, 0, -0.5, 1, 0], [0, 0, -0.5, -1, 0]]
    matrix = sp.csc_array(np.array([*balance, *(cones if has_cones else rows)], dtype=float))
    right = np.zeros(matrix.shape[0])
    right[[0, 2]] = 2.0, 3.0
    cost = np.array([0.0, 0, 0, 0, -1])
    return ConeProgram(cost, matrix, right, 4, 0 if has_cones else 4, (3, 3) if has_cones else ())


@pytest.mark.parametrize("has_cones", [True, False])
@pytest.mark.parametrize("name", sorted({*able()} & {*SOLVERS}))
def test_every_solver_gives_the_answer_and_its_duals(name: str, has_cones: bool) -> None:
    """Rates: of the second block, whose friction is used up, half of the live load's rate; so much
    lift that it slides along its cone. 1e-4 for first-order methods."""
    outcome, x, y = slider(has_cones).solve(settings_for(name))
    if has_cones and not SOLVERS[name].has_cones:
        assert "takes no second-order cones" in outcome.refusal
    elif name in WITHOUT_DUALS and (has_cones or name == "GLPK_MI"):
        assert "no duals" in outcome.status
        assert x is None
    else:
        assert x is not None
        assert y is not None
        np.testing.assert_allclose(x[[0, 2, 4]], [2.0, 3.0, 0.75], atol=1e-4)
        if name != "SCIP":  # whose presolve loses duals of linear problems
            np.testing.assert_allclose(y, [0.0, 0.0, 0.25, -0.5], atol=1e-4)


@pytest.mark.parametrize("has_cones", [True, False])
@pytest.mark.parametrize(
    "name", sorted(n for n in {*able()} & {*SOLVERS} if SOLVERS[n].takes_matrices)
)
def test_duals_of_all_rows_begin_with_those_of_equations(name: str, has_cones: bool) -> None:
    """As many inequalities as equations, in the linear program: neither may stand for the other."""
    if has_cones and not SOLVERS[name].has_cones:
        pytest.skip("takes no cones")
    program = slider(has_cones)
    _, _, y = program.solve(settings_for(name), all_duals=True)
    assert y is not None
    assert len(y) == len(program.right)
    np.testing.assert_allclose(y[:4], [0.0, 0.0, 0.25, -0.5], atol=1e-4)
    # no gain of the cost is left: cost + A' y = 0
    np.testing.assert_allclose(program.cost + program.matrix.T @ y, 0.0, atol=1e-4)
