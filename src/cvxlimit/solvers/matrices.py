"""What solvers get from CVXPY, quickly, and Clarabel in units of an answer that is nearly right."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import cvxpy.settings as keys
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints import SOC, Zero
from cvxpy.reductions.dcp2cone.cone_matrix_stuffing import ParamConeProg
from cvxpy.reductions.solvers.conic_solvers.clarabel_conif import CLARABEL
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from cvxpy.reductions.utilities import ReducedMat

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import Door

_Named = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Point:
    """An iterate: the unknowns x (n,), the duals y (p,) of equations and z (m,) of inequalities and
    cones, and the slacks s (m,) of the latter."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    s: FloatArray


class Matrices(CLARABEL):
    """CVXPY's way to matrices, linear and second-order cones, laid out as for Clarabel."""

    SUPPORTED_CONSTRAINTS = (*ConicSolver.SUPPORTED_CONSTRAINTS, SOC)

    def __eq__(self, other: object) -> bool:
        """True for another of this kind: CVXPY keeps what it compiled, and the point to start from,
        for the solver that compares equal to the one before."""
        return type(self) is type(other)

    def __hash__(self) -> int:
        return hash(type(self))

    def name(self) -> str:
        """Name in CVXPY's reports."""
        return "MATRICES"

    def import_solver(self) -> None:
        """Nothing to import: it is part of this package."""

    def supports_quad_obj(self) -> bool:
        """Linear objectives only."""
        return False

    @classmethod
    def format_constraints(cls, problem: ParamConeProg, exp_cone_order: Any) -> ParamConeProg:
        """The matrices of CVXPY's own, bit for bit, in a time that grows with their entries.

        Rows of equations change their signs, those of a second-order cone come together, its bound
        first. CVXPY multiplies by a matrix that says so, with a column for every pair of a variable
        and an entry of a Parameter; here every entry's row is looked up.
        """
        signs, goes_to, start = [], [], 0
        for stated in problem.constraints:
            place = start + np.arange(stated.size)
            if isinstance(stated, SOC):
                count, size = stated.args[0].size, stated.size // stated.args[0].size
                by_cone = place.reshape(count, size)  # the bounds of all cones are given first
                place = np.concatenate([by_cone[:, 0], by_cone[:, 1:].ravel()])
            signs.append(np.full(stated.size, -1.0 if isinstance(stated, Zero) else 1.0))
            goes_to.append(place)
            start += stated.size
        given, result = problem.A.tocoo(), copy(problem)
        if start:
            column, row = np.divmod(given.row.astype(np.int64), start)
            entries = given.data * np.concatenate(signs)[row]
            places = column * start + np.concatenate(goes_to)[row], given.col.astype(np.int64)
            result.A = sp.coo_array((entries, places), shape=given.shape)
        result.reduced_A = ReducedMat(result.A, problem.x.size)
        result.formatted = True
        return result


class Rescaled(Matrices):
    """Clarabel in units of an answer that is nearly right.

    Residuals are relative to the largest forces there are. Where densities lie 1e8 apart, one of
    1e-10 of them is a hundredth of what the lightest block weighs, which shows in the answer only.
    So the problem is solved twice, the second time with every unknown in units of what it was found
    to be, or of what would be felt in its equations, and every equation in units of its largest
    term. Static bounds that were off by 1e-5 to 2e-3 came within 1e-7; mechanisms often lose.

    Options are Clarabel's, and ``first``, who gives the first answer: ``"CLARABEL"`` or
    ``"BLOCKWISE"``.

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
        return "RESCALED"

    def solve_via_data(
        self,
        data: _Named,
        warm_start: bool,
        verbose: bool,
        solver_opts: _Named,
        solver_cache: Any = None,
    ) -> Any:
        """Solve from CVXPY's matrices; without a first answer, what the first solver says."""
        options = dict(solver_opts)
        name = options.pop("first", "CLARABEL")
        if name == "CLARABEL":
            first = CLARABEL().solve_via_data(data, False, verbose, options)
        else:
            first = (
                Door("cvxlimit.solvers")[name].plug_in().solve_via_data(data, False, verbose, {})
            )
        x = np.asarray(first.x, dtype=float)
        if not (x.size and np.isfinite(x).all() and "Infeasible" not in str(first.status)):
            return first
        matrix, right, cost = (data[k] for k in (keys.A, keys.B, keys.C))
        columns, rows = _units(sp.csr_array(matrix), np.asarray(right), x, data[ConicSolver.DIMS])
        goal = columns * cost
        size = float(np.abs(goal).max()) or 1.0
        scaled = sp.diags_array(1.0 / rows) @ matrix @ sp.diags_array(columns)
        own = {keys.A: scaled.tocsc(), keys.B: right / rows, keys.C: goal / size}
        found = CLARABEL().solve_via_data(
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


def _units(
    matrix: sp.csr_array, right: FloatArray, x: FloatArray, dims: Any
) -> tuple[FloatArray, FloatArray]:
    """Returns units of the unknowns (n,) and of the rows (m,) near an answer x of A x + s = b.

    The unit of an equation is its largest term. That of an unknown is its value, or the smallest
    value that would be as large as such a term in some equation. That of a cone, the same for all
    its rows, is its largest term with unknowns of one unit each.
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
    """Returns the largest entry of each column (axis 0) or row (axis 1)."""
    return np.asarray(sp.csr_array(matrix).max(axis=axis).toarray(), dtype=np.float64).ravel()
