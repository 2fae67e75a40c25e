"""One run of one solver on a CVXPY problem."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass

import cvxpy as cp
from cvxpy.settings import INF_OR_UNB, SOLUTION_PRESENT

from cvxlimit.arrays import FloatArray
from cvxlimit.solvers.ladders import is_conic
from cvxlimit.solvers.table import SolverSettings, able


@dataclass(frozen=True)
class Outcome:
    """What a solver reported, with seconds for CVXPY's compile and for the solver itself.

    ``refusal`` says what the solver lacks, if it was not run for that.
    """

    status: str
    compile_seconds: float
    solve_seconds: float
    refusal: str = ""

    @classmethod
    def failed(cls, error: Exception, compile_seconds: float, solve_seconds: float) -> Outcome:
        """Of a run that ended in an error."""
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        return cls(f"failed: {reason[:120]}", compile_seconds, solve_seconds)

    @classmethod
    def refused(cls, settings: SolverSettings, has_cones: bool) -> Outcome | None:
        """Of a problem that the solver cannot take, or None if it can."""
        if settings.row.has_cones or not has_cones:
            return None
        lacks = f"{settings.name} takes no second-order cones, which this problem has"
        others = f"{', '.join(able(with_cones=True))} take them"
        return cls(f"failed: {lacks}", 0.0, 0.0, f"{lacks}; {others}")

    @property
    def has_values(self) -> bool:
        """True if variables carry values, accurate or not."""
        return self.status in SOLUTION_PRESENT

    @property
    def claims_no_optimum(self) -> bool:
        """True if the solver says infeasible or unbounded."""
        return self.status in INF_OR_UNB


@dataclass(frozen=True, eq=False)
class LimitState:
    """One solver's answer in the user's units, not yet certified.

    ``forces`` (contacts, 6), ``mechanism`` (free blocks, 6) with live power 1; None where the
    solver returned nothing, or the problem does not have them. ``internal`` (p,) are the internal
    forces of the formulation.
    """

    outcome: Outcome
    load_factor: float | None
    forces: FloatArray | None
    mechanism: FloatArray | None
    internal: FloatArray | None = None


def run(problem: cp.Problem, settings: SolverSettings, ignore_dpp: bool = False) -> Outcome:
    """Solve and leave the values in the problem; failures come back as a status, not as errors.

    Only solvers whose row says so start from what CVXPY kept of the run before: its interface to
    QOCO 0.3 then returned the solution for the Parameters of that run.

    CVXPY's warning about inaccurate solutions is not shown: the status says the same, is kept in
    the history, and the certificate decides what the solution is worth.
    """
    if (refused := Outcome.refused(settings, is_conic(problem))) is not None:
        return refused
    start = compiled = time.perf_counter()
    row, options = settings.row, dict(settings.options)
    try:
        solver = row.name if row.plug_in is None else row.plug_in()
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")
            data, chain, inverse = problem.get_problem_data(
                solver, ignore_dpp=ignore_dpp, solver_opts=options
            )
            compiled = time.perf_counter()
            raw = chain.solve_via_data(
                problem, data, warm_start=row.starts_warm, verbose=False, solver_opts=options
            )
            solved = time.perf_counter()
            problem.unpack_results(raw, chain, inverse)
    except Exception as error:  # solvers raise what they like; the history keeps the reason
        return Outcome.failed(error, compiled - start, time.perf_counter() - compiled)
    overhead = time.perf_counter() - solved
    return Outcome(problem.status, compiled - start + overhead, solved - compiled)
