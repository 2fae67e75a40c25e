"""Whether two cone programs ask for the same, row by row, whatever order they have them in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from cvxlimit.model.program import LimitProgram
from cvxlimit.solvers.program import ConeProgram

ROUNDING = 1e-12
"""Of the largest entry: a hundred times the rounding of products of a dozen terms."""


def by_cvxpy(problem: cp.Problem, unknowns: Sequence[cp.Variable]) -> ConeProgram:
    """What CVXPY makes of a problem, its columns in the order of the unknowns: where CVXPY puts the
    values of a solution that counts its own columns says which is which."""
    data, chain, inverse = problem.get_problem_data("CLARABEL", solver_opts={})
    n = data["A"].shape[1]
    counted = SimpleNamespace(
        status="Solved", x=np.arange(float(n)), z=np.zeros(len(data["b"])), obj_val=0.0,
        obj_val_dual=0.0, solve_time=0.0, iterations=0,
    )  # fmt: skip
    problem.unpack_results(counted, chain, inverse)
    known = [v for v in unknowns if v.size]
    columns = np.concatenate([np.atleast_1d(v.value).ravel(order="F") for v in known])
    order = columns.round().astype(int)
    assert sorted(order) == list(range(n))
    dims, matrix = data["dims"], sp.csc_array(data["A"])[:, order]
    return ConeProgram(data["c"][order], matrix, data["b"], dims.zero, dims.nonneg, (*dims.soc,))


def assert_same_rows(problem: LimitProgram) -> None:
    """The rows of both sinks at the Parameters' present values."""
    theirs = by_cvxpy(problem.problem, problem._in_cvxpy[0].into.unknowns)
    # CVXPY's objective is in the user's units
    assert_same(problem.program, replace(theirs, cost=theirs.cost / problem.gain))


def assert_same(own: ConeProgram, theirs: ConeProgram) -> None:
    """Rows and cost of two programs with the same columns."""
    sizes = [(p.matrix.shape, p.zero, p.nonneg, sorted(p.cones)) for p in (own, theirs)]
    assert sizes[0] == sizes[1]
    size = float(abs(theirs.matrix).max())
    np.testing.assert_allclose(own.cost, theirs.cost, rtol=0.0, atol=ROUNDING)
    for one, other in zip(sorted_rows(own), sorted_rows(theirs), strict=True):
        assert abs(one - other).max() <= ROUNDING * size


def sorted_rows(program: ConeProgram) -> list[sp.csr_array]:
    """Rows with their right-hand sides, of equations, of inequalities and of cones by size, each
    kind in the order of its products with a random vector; rows of a cone stay together."""
    rows = sp.csr_array(sp.hstack([program.matrix, program.right[:, None]]))
    random = np.random.default_rng(0).normal(size=rows.shape[1])
    ends = program.zero, program.zero + program.nonneg
    kinds = [np.arange(ends[0])[:, None], np.arange(*ends)[:, None]]
    starts = ends[1] + np.cumsum([0, *program.cones])[:-1]
    cones = np.array(program.cones, dtype=int)
    kinds += [starts[cones == k, None] + np.arange(k) for k in np.unique(cones)]
    found = []
    for members in kinds:
        keys = (rows @ random)[members] @ np.arange(1.0, members.shape[1] + 1.0)
        found.append(rows[members[np.argsort(keys)].ravel()])
    return found


def at_random(problem: LimitProgram, seed: int = 0) -> None:
    """Random values for the problem's Parameters, all positive."""
    random = np.random.default_rng(seed)
    for parameter in problem.problem.parameters():
        parameter.value = random.uniform(0.1, 0.9, parameter.shape)
