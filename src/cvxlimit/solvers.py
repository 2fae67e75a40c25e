"""Solver settings, the ladder that is climbed when an answer is not certified, and one run.

To add a solver: if CVXPY knows it, it is on the ladder already when it is installed; settings
that it needs go into :data:`OPTIONS`.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.settings import INF_OR_UNB, SOLUTION_PRESENT
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_CLARABEL = {"direct_solve_method": "qdldl"}
"""Clarabel's own LDL: on block assemblages 2 to 8 times faster than its default (faer)."""


def _clarabel(tolerance: float, **more: Any) -> dict[str, Any]:
    names = ("tol_gap_abs", "tol_gap_rel", "tol_feas")
    return {**_CLARABEL, **dict.fromkeys(names, tolerance), **more}


OPTIONS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "CLARABEL": _clarabel(1e-11, max_iter=200),
        "ECOS": {"abstol": 1e-10, "reltol": 1e-10, "feastol": 1e-10, "max_iters": 300},
        "SCS": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iters": 100_000},
        "HIGHS": {},
        "MOSEK": {},
        "GUROBI": {"BarQCPConvTol": 1e-9},
    }
)
"""Tight settings per solver name, as CVXPY spells it.

Looser ones save little and cost the bracket: Clarabel at 1e-8 was 0 to 12 % faster than at 1e-10 on
panels of 886 to 7,219 contacts, with brackets 4e-6 to 1e-4 wide in place of 4e-8 to 3e-7."""

_LINEAR_ONLY = frozenset({"HIGHS", "GLOP", "PDLP", "SCIPY", "GLPK", "CBC"})


@dataclass(frozen=True)
class SolverSettings:
    """A solver by CVXPY's name, its options, and a label for the history.

    Example
    -------
    >>> SolverSettings("CLARABEL", {"max_iter": 50}).name
    'CLARABEL'
    """

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""

    def __str__(self) -> str:
        return self.label or self.name


def default_ladder() -> tuple[SolverSettings, ...]:
    """Rungs in order: Clarabel as a rule, then tighter, then every other installed solver."""
    rungs = [
        SolverSettings("CLARABEL", OPTIONS["CLARABEL"]),
        SolverSettings(
            "CLARABEL",
            _clarabel(1e-13, max_iter=500, reduced_tol_feas=1e-9, iterative_refinement_max_iter=50),
            "CLARABEL tight",
        ),
        SolverSettings(
            "CLARABEL",
            _clarabel(1e-12, max_iter=500, equilibrate_enable=False),
            "CLARABEL unequilibrated",
        ),
    ]
    others = [name for name in ("MOSEK", "GUROBI", "ECOS", "HIGHS", "SCS") if name in _installed()]
    return (*rungs, *(SolverSettings(name, OPTIONS[name]) for name in others))


def suits(settings: SolverSettings, problem: cp.Problem) -> bool:
    """False for solvers of linear problems when the problem has second-order cones."""
    conic = any(isinstance(constraint, cp.SOC) for constraint in problem.constraints)
    return not (conic and settings.name in _LINEAR_ONLY)


def _installed() -> Sequence[str]:
    return list(cp.installed_solvers())


@dataclass(frozen=True)
class Outcome:
    """What a solver reported, with seconds for CVXPY's compile and for the solver itself."""

    status: str
    compile_seconds: float
    solve_seconds: float

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
    solver returned nothing, or the problem does not have them.
    """

    outcome: Outcome
    load_factor: float | None
    forces: FloatArray | None
    mechanism: FloatArray | None


def run(problem: cp.Problem, settings: SolverSettings, ignore_dpp: bool = False) -> Outcome:
    """Solve and leave the values in the problem; failures come back as a status, not as errors.

    CVXPY's warning about inaccurate solutions is not shown: the status says the same, is kept in
    the history, and the certificate decides what the solution is worth.
    """
    start = compiled = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")
            data, chain, inverse = problem.get_problem_data(
                settings.name, ignore_dpp=ignore_dpp, solver_opts=dict(settings.options)
            )
            compiled = time.perf_counter()
            raw = chain.solve_via_data(
                problem, data, warm_start=True, verbose=False, solver_opts=dict(settings.options)
            )
            solved = time.perf_counter()
            problem.unpack_results(raw, chain, inverse)
    except Exception as error:  # solvers raise what they like; the history keeps the reason
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        message = f"failed: {reason[:120]}"
        return Outcome(message, compiled - start, time.perf_counter() - compiled)
    overhead = time.perf_counter() - solved
    return Outcome(problem.status, compiled - start + overhead, solved - compiled)
