"""Solver settings at an asked tolerance, whatever each solver calls its options."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

import cvxpy as cp

from cvxlimit.errors import ModelError
from cvxlimit.solvers import SolverSettings
from cvxlimit.solvers.running import PLUG_INS
from cvxlimit.solvers.sparse import best_backend

_TOLERANCE_OPTIONS: Mapping[str, tuple[str, ...]] = {
    "BLOCKWISE": ("tolerance",),
    "CLARABEL": ("tol_gap_abs", "tol_gap_rel", "tol_feas"),
    "ECOS": ("abstol", "reltol", "feastol"),
    "SCS": ("eps_abs", "eps_rel"),
    "QOCO": ("abstol", "reltol"),
    "HIGHS": ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
    "MOSEK": ("eps",),
    "GUROBI": ("BarConvTol", "BarQCPConvTol"),
    "CUOPT": ("optimality",),
}

_FIXED_OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "CLARABEL": {"direct_solve_method": "qdldl", "max_iter": 500},
    "ECOS": {"max_iters": 300},
    "SCS": {"max_iters": 100_000},
}


def settings_for(
    solver: str, tolerance: float, label: str = "", /, **options: Any
) -> SolverSettings:
    """Settings of ``solver`` (CVXPY's name) at ``tolerance``, whatever it calls its options.

    Raises
    ------
    ModelError
        If the tolerance is not a number between 0 and 1.

    >>> settings_for("SCS", 1e-4).options["eps_rel"]
    0.0001
    """
    if not (isinstance(tolerance, float) and 0.0 < tolerance < 1.0):
        raise ModelError(f"tolerance must be a number between 0 and 1, got {tolerance!r}")
    names = _TOLERANCE_OPTIONS.get(solver, ())
    own = {**_FIXED_OPTIONS.get(solver, {}), **dict.fromkeys(names, tolerance), **options}
    return SolverSettings(solver, own, label or solver)


def check_installed(settings: SolverSettings) -> None:
    """Refuse a solver that CVXPY cannot find, and a factorisation that is not installed."""
    name, backend = settings.name, settings.options.get("backend", "")
    known = [*cp.installed_solvers(), *PLUG_INS]
    if name not in known:
        close = get_close_matches(name.upper(), known, 1, 0.8)
        hint = f"did you mean {close[0]}?" if close else "CVXPY finds it once it is"
        raise ModelError(f"solver {name} is not installed; {hint}")
    if backend == "cholmod" and best_backend() != backend:
        raise ModelError("CHOLMOD is not installed; it comes with the package cvxopt")
