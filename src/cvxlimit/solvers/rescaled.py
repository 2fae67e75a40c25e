"""Clarabel a second time, in units of an answer that is nearly right."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import cvxpy.settings as settings
import numpy as np
import scipy.sparse as sp
from cvxpy.reductions.solvers.conic_solvers.clarabel_conif import CLARABEL
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver

from cvxlimit.arrays import FloatArray
from cvxlimit.solvers.interior import Blockwise

FIRST = {"CLARABEL": CLARABEL, "BLOCKWISE": Blockwise}
"""Who gives the first answer, by the option ``first``."""


class Rescaled(CLARABEL):
    """For ``problem.solve(solver=Rescaled())``: linear and second-order cones.

    Residuals are relative to the largest forces there are. Where densities lie 1e8 apart, one of
    1e-10 of them is a hundredth of what the lightest block weighs, and nothing in the problem's
    matrices says so: it shows in the answer only. So the problem is solved twice, the second time
    with every unknown in units of what it was found to be, or of what would be felt in the
    equations it enters, and every equation in units of its largest term. It is iterative
    refinement's idea (residuals in units of their own) without shifting cones, in which digits
    would be lost. On eleven random walls with densities 1e6 to 1e9 apart whose static bounds were
    off by 1e-5 to 2e-3, they came within 1e-7; mechanisms gain nothing, and often lose.

    Options are Clarabel's, and ``first``: ``"CLARABEL"`` or ``"BLOCKWISE"``.

    Example
    -------
    >>> import cvxpy as cp
    >>> x = cp.Variable(2, nonneg=True)
    >>> problem = cp.Problem(cp.Maximize(x[1]), [x[0] == 1e8, x[1] <= 2e-6])
    >>> _ = problem.solve(solver=Rescaled())  # Clarabel alone: 3.0e-6
    >>> print(f"{x.value[1]:.2e}")
    2.00e-06
    """

    def name(self) -> str:
        """Name in CVXPY's reports."""
        return "RESCALED"

    def supports_quad_obj(self) -> bool:
        """Linear objectives only."""
        return False

    def solve_via_data(
        self,
        data: dict[str, Any],
        warm_start: bool,
        verbose: bool,
        solver_opts: dict[str, Any],
        solver_cache: Any = None,
    ) -> Any:
        """Solve from CVXPY's matrices; without a first answer, what the first solver says."""
        options = dict(solver_opts)
        solver = FIRST[options.pop("first", "CLARABEL")]
        given = options if solver is CLARABEL else {}
        first = solver().solve_via_data(data, False, verbose, given)
        x = np.asarray(first.x, dtype=float)
        if not (x.size and np.isfinite(x).all() and "Infeasible" not in str(first.status)):
            return first
        matrix, right, cost = (data[k] for k in (settings.A, settings.B, settings.C))
        columns, rows = units(sp.csr_array(matrix), np.asarray(right), x, data[ConicSolver.DIMS])
        goal = columns * cost
        size = float(np.abs(goal).max()) or 1.0
        scaled = sp.diags_array(1.0 / rows) @ matrix @ sp.diags_array(columns)
        own = {settings.A: scaled.tocsc(), settings.B: right / rows, settings.C: goal / size}
        found = super().solve_via_data(
            {**data, **own}, False, verbose, {**options, "equilibrate_enable": False}
        )
        return SimpleNamespace(
            status=found.status,
            x=columns * np.asarray(found.x),
            z=size / rows * np.asarray(found.z),
            obj_val=size * found.obj_val,
            solve_time=first.solve_time + found.solve_time,
            iterations=first.iterations + found.iterations,
        )


def units(
    matrix: sp.csr_array, right: FloatArray, x: FloatArray, dims: Any
) -> tuple[FloatArray, FloatArray]:
    """Units of the unknowns (n,) and of the rows (m,) near an answer x of A x + s = b.

    An equation's is its largest term. An unknown's is its value, or the least that would be such a
    term somewhere. A cone's, the same for all its rows, is the largest term in those units.
    """
    equations = abs(matrix[: dims.zero])
    terms = equations @ sp.diags_array(np.abs(x))
    largest = np.maximum(_largest(terms, 1), np.abs(right[: dims.zero]))
    largest = np.where(largest > 0.0, largest, largest[largest > 0.0].min(initial=1.0))
    felt = _largest(sp.diags_array(1.0 / largest) @ equations, 0)
    columns = np.maximum(np.abs(x), 1.0 / np.where(felt > 0.0, felt, np.inf))
    columns = np.where(columns > 0.0, columns, 1.0)
    rows = _largest(abs(matrix) @ sp.diags_array(columns), 1)
    rows[: dims.zero] = largest
    at = dims.zero + dims.nonneg
    for size in dims.soc:
        rows[at : at + size] = rows[at : at + size].max()
        at += size
    return columns, np.where(rows > 0.0, rows, 1.0)


def _largest(matrix: sp.csr_array, axis: int) -> FloatArray:
    return np.asarray(sp.csr_array(matrix).max(axis=axis).toarray(), dtype=np.float64).ravel()
