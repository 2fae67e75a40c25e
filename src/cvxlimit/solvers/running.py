"""One run of one solver on a CVXPY problem."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import cvxpy as cp
from cvxpy.reductions.solution import Solution
from cvxpy.reductions.solvers.defines import SOLVER_MAP_CONIC
from cvxpy.reductions.solvers.solver_inverse_data import SolverInverseData
from cvxpy.reductions.solvers.solving_chain import SolvingChain
from cvxpy.settings import ERROR, INF_OR_UNB, PARAM_PROB, SOLUTION_PRESENT

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import loaded
from cvxlimit.solvers.matrices import Matrices
from cvxlimit.solvers.table import SolverSettings, able, installed


@dataclass(frozen=True)
class Outcome:
    """What a solver reported: CVXPY's status, seconds for CVXPY's compilation and for the solver
    itself, and, if the solver was not run because it lacks something, what it lacks."""

    status: str
    compile_seconds: float
    solve_seconds: float
    refusal: str = ""

    @property
    def has_values(self) -> bool:
        """True if variables carry values, accurate or not."""
        return self.status in SOLUTION_PRESENT

    @property
    def claims_no_optimum(self) -> bool:
        """True if the solver says infeasible or unbounded."""
        return self.status in INF_OR_UNB


Flows = Callable[[], Mapping[str, Sequence[tuple[FloatArray, Sequence[FloatArray]]]]]
"""What reads a solver's duals of strength, which few have to know: of each surface, condition by
condition, multipliers (k,) of the resistance and flows (k,) of all rows of its norms times their
weights. They belong to rates as :mod:`cvxlimit.proof.flow` says."""


@dataclass(frozen=True, eq=False)
class LimitState:
    """One solver's answer in the user's units, not yet certified. Fields are None where the solver
    returned nothing, or the problem does not have them.

    Attributes
    ----------
    outcome : Outcome
        What the solver reported.
    load_factor : float or None
        The load factor.
    forces : (n, 6) array or None
        Contact forces in the order V1, V2, N, M1, M2, MT; N is positive under pressure.
    mechanism : (free blocks, 6) array or None
        Rates of translation and rotation of each block, with live power 1.
    internal : (p,) array or None
        Internal forces of the formulation.
    own : mapping from str to array
        Values of unknowns that the problem's goal added, by name.
    flows : Flows or None
        Duals of strength that belong to the mechanism, where the model is the full one.
    values : (x, y) or CVXPY's Solution, or None
        All unknowns and all duals as the solver returned them, for those who read them in CVXPY.
    """

    outcome: Outcome
    load_factor: float | None
    forces: FloatArray | None
    mechanism: FloatArray | None
    internal: FloatArray | None = None
    own: Mapping[str, FloatArray] = field(default_factory=dict)
    values: Any = None
    flows: Flows | None = None


def run(problem: cp.Problem, settings: SolverSettings, ignore_dpp: bool = False) -> Outcome:
    """Solves a problem and leaves the values in it. Failures come back as a status, not as errors.

    CVXPY's warning about inaccurate solutions is not raised: the status says the same, is kept in
    the history, and the certificate decides whether the solution counts.
    """
    row, options = settings.row, dict(settings.options)

    def compiled() -> tuple[Callable[[], Any], Callable[[Any], Solution]]:
        data, chain, inverse = _compiled(problem, settings, ignore_dpp)
        # Only some solvers start from what CVXPY kept of the run before: its interface to QOCO 0.3
        # then returned the solution for the Parameters of that run.
        solve = partial(
            chain.solve_via_data, problem, data, row.starts_warm, settings.verbose, options
        )
        return solve, partial(_unpacked, problem, chain, inverse)

    has_cones = cp.SOC in map(type, problem.constraints)
    return attempted(settings, has_cones, compiled)[0]


def _compiled(
    problem: cp.Problem, settings: SolverSettings, ignore_dpp: bool
) -> tuple[dict[str, Any], SolvingChain, list[Any]]:
    """Returns what a solver gets: its data, CVXPY's chain of reductions, and what inverts them.

    All solvers of a ladder share one compilation. CVXPY keeps it for one solver only, but just its
    last step belongs to the solver, unless objectives are quadratic or cones of another kind.
    """
    row, options = settings.row, dict(settings.options)
    solver = row.plug_in() if row.plug_in is not None else None
    own = solver or row.name
    if solver is None and row.name in installed():
        solver = SOLVER_MAP_CONIC.get(row.name)
    is_plain = not problem.objective.expr.has_quadratic_term()
    if solver is not None and is_plain and not getattr(solver, "DIR_CONE_KINDS", ()):
        try:
            data, chain, inverse = problem.get_problem_data(Matrices(), ignore_dpp=ignore_dpp)
        except cp.error.SolverError:  # which says that it does not take these cones
            is_plain = False
        if is_plain and not (data[solver.DIMS].soc and not row.has_cones):
            data, last = solver.apply(data[PARAM_PROB])
            chain = SolvingChain(reductions=[*chain.reductions[:-1], solver])
            return data, chain, [*inverse[:-1], SolverInverseData(last, solver, options)]
    return problem.get_problem_data(own, ignore_dpp=ignore_dpp, solver_opts=options)


def _unpacked(problem: cp.Problem, chain: Any, inverse: Any, raw: Any) -> Solution:
    """Returns the solution of a solver's ``raw`` answer, and leaves its values in the problem."""
    solution = chain.invert(raw, inverse)
    if solution.status not in ERROR:
        problem.unpack(solution)
    return solution


def attempted(
    settings: SolverSettings,
    has_cones: bool,
    compiled: Callable[[], tuple[Callable[[], Any], Callable[[Any], Solution]]],
) -> tuple[Outcome, Solution | None]:
    """Runs a solver and measures its time. ``compiled`` returns two functions: the run itself, and
    the one that reads its answer. Returns the outcome, and the solution; None if the run failed."""
    if has_cones and not settings.row.has_cones:
        lacks = f"{settings.name} takes no second-order cones, which this problem has"
        others = f"{', '.join(able(with_cones=True))} take them"
        return Outcome(f"failed: {lacks}", 0.0, 0.0, f"{lacks}; {others}"), None
    start = ready = time.perf_counter()
    try:
        if settings.row.greets and not settings.verbose:
            _greeted(settings.row.greets)
        solve, read = compiled()
        ready = time.perf_counter()
        raw = solve()
        solved = time.perf_counter()
        solution = read(raw)
        if solution.status in ERROR:
            raise cp.error.SolverError(f"Solver '{settings.name}' failed.")
    except Exception as error:  # solvers raise what they like; the history keeps the reason
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        took = time.perf_counter() - ready
        return Outcome(f"failed: {reason[:120]}", ready - start, took), None
    reading = time.perf_counter() - solved
    return Outcome(solution.status, ready - start + reading, solved - ready), solution


@cache
def _greeted(place: str) -> None:
    """Lets a solver print its banner, once in a process, where nobody sees it: stdout is for
    answers. Native code prints past Python, so that the descriptor itself goes elsewhere, for less
    than a millisecond and not while it solves, since other threads may print."""
    made = loaded(place)
    if sys.stdout is not None:
        sys.stdout.flush()
    with open(os.devnull, "wb") as nowhere:
        kept = os.dup(1)
        try:
            os.dup2(nowhere.fileno(), 1)
            made()
        finally:
            os.dup2(kept, 1)
            os.close(kept)
