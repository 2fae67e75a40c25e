"""Conic programs given as arrays: for thousands of small problems of one scene.

Everything else is written in CVXPY, whose compilation takes 20 to 50 ms however small a problem is,
where solvers need 5 to 10. Here matrices go to CVXPY's interfaces to the solvers directly, where an
interface needs nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from types import SimpleNamespace
from typing import Any

import cvxpy as cp
import cvxpy.settings as keys
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints import Zero
from cvxpy.reductions.solution import Solution
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from cvxpy.reductions.solvers.defines import SOLVER_MAP_CONIC

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import meant
from cvxlimit.solvers.matrices import Matrices
from cvxlimit.solvers.running import Outcome, attempted, run
from cvxlimit.solvers.table import SolverSettings, options_of

_NO_DUALS = "failed: returned no duals"


@dataclass(frozen=True, eq=False)
class ConeProgram:
    """min c . x  subject to  A x + s = b,  s in {0}^zero x R+^nonneg x second-order cones.

    ``cost`` (n,), ``matrix`` (m, n) and ``right`` (m,) are c, A and b; ``zero`` rows of equations
    come first, then ``nonneg`` inequalities, then second-order cones of the sizes in ``cones``.
    With ``quadratic`` (n, n) given, P, the cost is c . x + x'Px/2, which Clarabel alone takes.
    Our own solver may end where the dual objective is ``enough``.

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
    enough: float = np.inf
    quadratic: sp.csc_array | None = None

    @classmethod
    def of(cls, problem: cp.Problem) -> ConeProgram:
        """Returns the program of a CVXPY problem at the present values of its Parameters."""
        data, _, _ = problem.get_problem_data(Matrices(), ignore_dpp=True)
        dims = data[ConicSolver.DIMS]
        matrices = data[keys.C], data[keys.A], data[keys.B]
        return cls(*matrices, dims.zero, dims.nonneg, tuple(dims.soc))

    def solve(
        self,
        settings: SolverSettings,
        cache: dict[str, Any] | None = None,
        is_warm: bool = True,
        all_duals: bool = False,
    ) -> tuple[Outcome, FloatArray | None, FloatArray | None]:
        """Runs one solver, and returns the outcome, x (n,), and the duals (zero,) of the equations,
        or with ``all_duals`` those (m,) of all rows; None where the solver returned nothing.

        Solvers that can start warm keep in ``cache`` what they need for the next program, with a
        point on the way to the answer under ``"middle"``. If the start is not to be warm
        (``is_warm`` false) they take from it only the structure, which is that of any program of
        this pattern, and start from its ``"starts"`` if there are any: points, the one nearest to
        the answer first.

        Solvers whose interfaces need more than matrices get the program through CVXPY, all of them
        the same problem. Failures of a solver raise nothing; see
        :func:`cvxlimit.solvers.running.run`.
        """
        row, options = settings.row, dict(settings.options)
        if not row.takes_matrices:
            return self._solve_through_cvxpy(settings)

        def compiled() -> tuple[Callable[[], Any], Callable[[Any], Solution]]:
            solver = SOLVER_MAP_CONIC[row.name] if row.plug_in is None else row.plug_in()
            data, inverse = self._for_cvxpy(row.splits_equations, all_duals)
            kept = cache if row.starts_warm else None
            starts = is_warm and kept is not None
            solve = partial(solver.solve_via_data, data, starts, settings.verbose, options, kept)
            return solve, lambda raw: solver.invert(raw, inverse)

        outcome, solution = attempted(settings, bool(self.cones), compiled)
        if solution is None or not outcome.has_values:
            return outcome, None, None
        if not solution.dual_vars and (self.zero or all_duals):
            return replace(outcome, status=_NO_DUALS), None, None
        (x,) = solution.primal_vars.values()
        y = np.concatenate([np.zeros(0), *map(np.ravel, solution.dual_vars.values())])
        return outcome, np.asarray(x), y if all_duals else y[: self.zero]

    def _for_cvxpy(
        self, splits_equations: bool, all_duals: bool
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Returns matrices and sizes of cones as CVXPY's interfaces to solvers take them, and what
        these need to read the answer."""
        p, rows = self.zero, len(self.right)
        dims = SimpleNamespace(
            zero=p, nonneg=self.nonneg, soc=list(self.cones), exp=0, psd=[], p3d=[], pnd=[]
        )
        data: dict[str, Any] = {keys.C: self.cost, ConicSolver.DIMS: dims, "enough": self.enough}
        data |= {keys.A: self.matrix, keys.B: self.right}
        if self.quadratic is not None:
            data[keys.P] = self.quadratic
        if splits_equations:
            by_row = self.matrix.tocsr()
            data |= {keys.A: by_row[:p].tocsc(), keys.B: self.right[:p]}
            data |= {keys.G: by_row[p:].tocsc(), keys.H: self.right[p:]}
        inverse = {
            ConicSolver.VAR_ID: 0,
            ConicSolver.DIMS: dims,
            ConicSolver.EQ_CONSTR: [_rows(p, "equations")] if p else [],
            ConicSolver.NEQ_CONSTR: [_rows(rows - p, "others")] if all_duals and rows > p else [],
            keys.OFFSET: 0.0,
        }
        return data, inverse

    def _solve_through_cvxpy(
        self, settings: SolverSettings
    ) -> tuple[Outcome, FloatArray | None, FloatArray | None]:
        problem, x, equations = self._stated
        outcome = run(problem, settings)
        if not outcome.has_values or x.value is None:
            return outcome, None, None
        y = np.zeros(0) if equations is None else equations.dual_value
        if y is None:
            return replace(outcome, status=_NO_DUALS), None, None
        return outcome, np.asarray(x.value, dtype=float), np.asarray(y, dtype=float)

    @cached_property
    def _stated(self) -> tuple[cp.Problem, cp.Variable, cp.Constraint | None]:
        """The program as a CVXPY problem, with its variable and its equations."""
        x, rows, at = cp.Variable(len(self.cost)), self.matrix.tocsr(), self.zero
        linear = slice(at, at + self.nonneg)
        equations = rows[:at] @ x == self.right[:at] if at else None
        stated = [] if equations is None else [equations]
        if self.nonneg:
            stated.append(rows[linear] @ x <= self.right[linear])
        starts = linear.stop + np.cumsum([0, *self.cones[:-1]])
        for size in sorted(set(self.cones)):
            first = starts[: len(self.cones)][np.array(self.cones) == size]
            own = [self.right[first + i] - rows[first + i] @ x for i in range(size)]
            stated.append(cp.SOC(own[0], cp.vstack(own[1:]), axis=0) if size > 1 else own[0] >= 0)
        return cp.Problem(cp.Minimize(self.cost @ x), stated), x, equations


def check_options(
    settings: SolverSettings, options: Mapping[str, Any], others: Sequence[str]
) -> None:
    """Tries a solver's options on two unknowns.

    Raises
    ------
    TypeError
        For an option that the solver does not have or take; the message names what is like it of
        its options, and of the ``others`` that a call takes.
    """
    known = options_of(settings.name)
    for option in options if known else ():
        if option not in known:
            hint = meant(option, [*known, *others], f"its options are {', '.join(sorted(known))}")
            raise TypeError(f"{settings.name} has no option {option!r}: {hint}")
    matrix = sp.csc_array([[1.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    small = ConeProgram(np.ones(2), matrix, np.array([1.0, 0.0, 0.0]), 1, 2)
    tried = replace(settings, options={**settings.options, **options}, verbose=False)
    status = small.solve(tried)[0].status
    if status.startswith("failed: ") and not status.startswith("failed: Solver"):
        given = ", ".join(f"{name}={value!r}" for name, value in options.items())
        reason = status.removeprefix("failed: ")
        hint = "".join(meant(option, others, before="; ") for option in options)
        raise TypeError(f"{settings.name} does not take {given}: {reason}{hint}")


@cache
def _rows(count: int, of: str) -> Zero:
    """Returns a constraint of so many rows for interfaces, which ask only for its size, and which
    tell constraints apart by what they are: each kind has its own."""
    return Zero(cp.Variable(count))
