"""Conic programs given as arrays: for thousands of small problems of one scene.

Everything else is written in CVXPY, whose compiling takes 20 to 50 ms however small a problem is,
where solvers need 5 to 10. Here CVXPY's interfaces to the solvers get their matrices directly.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import cvxpy as cp
import cvxpy.settings as keys
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints import Zero
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from cvxpy.reductions.solvers.defines import SOLVER_MAP_CONIC

from cvxlimit.arrays import FloatArray
from cvxlimit.solvers.running import Outcome
from cvxlimit.solvers.table import SolverSettings


@dataclass(frozen=True, eq=False)
class ConeProgram:
    """min c . x  subject to  A x + s = b,  s in {0}^zero x R+^nonneg x second-order cones.

    Attributes
    ----------
    cost : (n,), matrix : (m, n) sparse array, right : (m,)
        c, A and b.
    zero, nonneg : int
        Rows of equations, and of inequalities after them.
    cones : tuple of int
        Sizes of the second-order cones that follow.

    Example
    -------
    >>> from cvxlimit.solvers import settings_for
    >>> matrix = sp.csc_array([[1.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    >>> program = ConeProgram(np.array([1.0, 2.0]), matrix, np.array([3.0, 0.0, 0.0]), 1, 2)
    >>> outcome, x, y = program.solve(settings_for("CLARABEL"))
    >>> outcome.status, x.round(6).tolist(), y.round(6).tolist()
    ('optimal', [3.0, 0.0], [-1.0])
    """

    cost: FloatArray
    matrix: sp.csc_array
    right: FloatArray
    zero: int
    nonneg: int
    cones: tuple[int, ...] = ()

    def solve(
        self, settings: SolverSettings
    ) -> tuple[Outcome, FloatArray | None, FloatArray | None]:
        """One run of one solver: outcome, x, and the duals (zero,) of the equations.

        Never raises for what the solver does; see :func:`cvxlimit.solvers.running.run`.
        """
        if (refused := Outcome.refused(settings, bool(self.cones))) is not None:
            return refused, None, None
        start, row = time.perf_counter(), settings.row
        solver = SOLVER_MAP_CONIC[row.name] if row.plug_in is None else row.plug_in()
        data, inverse = self._data(row.splits_equations)
        compiled = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", message="Solution may be inaccurate")
                raw = solver.solve_via_data(data, False, False, dict(settings.options))
                found = solver.invert(raw, inverse)
        except Exception as error:  # solvers raise what they like; the history keeps the reason
            took = time.perf_counter() - compiled
            return Outcome.failed(error, compiled - start, took), None, None
        outcome = Outcome(found.status, compiled - start, time.perf_counter() - compiled)
        if not outcome.has_values:
            return outcome, None, None
        (x,) = found.primal_vars.values()
        (y,) = found.dual_vars.values()
        return outcome, np.asarray(x), np.asarray(y).ravel()

    def _data(self, is_split: bool) -> tuple[dict[str, Any], dict[str, Any]]:
        """What CVXPY's interface to a solver takes, and what it needs for the way back."""
        dims = SimpleNamespace(
            zero=self.zero, nonneg=self.nonneg, soc=list(self.cones), exp=0, psd=[], p3d=[], pnd=[]
        )
        data = {keys.C: self.cost, ConicSolver.DIMS: dims}
        if is_split:
            p = self.zero
            rows = self.matrix.tocsr()
            data |= {keys.A: rows[:p].tocsc(), keys.B: self.right[:p]}
            data |= {keys.G: rows[p:].tocsc(), keys.H: self.right[p:]}
        else:
            data |= {keys.A: self.matrix, keys.B: self.right}
        inverse = {
            ConicSolver.VAR_ID: 0,
            ConicSolver.DIMS: dims,
            ConicSolver.EQ_CONSTR: [Zero(cp.Variable(self.zero))],
            ConicSolver.NEQ_CONSTR: [],
            keys.OFFSET: 0.0,
        }
        return data, inverse
