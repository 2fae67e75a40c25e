"""The interior point as CVXPY sees it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import cvxpy.settings as settings
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints import SOC
from cvxpy.reductions.solvers.conic_solvers.clarabel_conif import CLARABEL
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from threadpoolctl import threadpool_limits

from cvxlimit.errors import SolverError
from cvxlimit.solvers.interior.iteration import (
    ALMOST,
    INFEASIBLE,
    SOLVED,
    UNBOUNDED,
    InteriorPoint,
    Point,
)
from cvxlimit.solvers.sparse import BACKENDS, best_backend

_STATUS = {
    SOLVED: "Solved",
    ALMOST: "AlmostSolved",
    INFEASIBLE: "PrimalInfeasible",
    UNBOUNDED: "DualInfeasible",
}


class Blockwise(CLARABEL):
    """For ``problem.solve(solver=Blockwise())``: linear and second-order cones.

    Made for assemblages: it eliminates the forces of every contact and factorises what is left, six
    rows per block. Data and duals are laid out as for Clarabel, whose CVXPY interface does that
    here. With ``warm_start=True`` it starts from a point on the way to the answer before, which
    halves the iterations where the problem has changed little; a start that is no use costs time.

    Options: ``tolerance`` (1e-11), ``max_iter`` (150), ``backend`` (``"cholmod"`` or
    ``"superlu"``; the better one that is installed).

    Raises
    ------
    SolverError
        If the cones do not fall apart into small blocks, or an option is unknown.

    Example
    -------
    >>> import cvxpy as cp
    >>> x = cp.Variable(2)
    >>> problem = cp.Problem(cp.Maximize(x[0]), [cp.sum(x) == 1, x >= 0])
    >>> round(float(problem.solve(solver=Blockwise())), 6)
    1.0
    """

    SUPPORTED_CONSTRAINTS = (*ConicSolver.SUPPORTED_CONSTRAINTS, SOC)

    def name(self) -> str:
        """Name in CVXPY's reports."""
        return "BLOCKWISE"

    def import_solver(self) -> None:
        """Nothing to import: it is part of this package."""

    def supports_quad_obj(self) -> bool:
        """Linear objectives only."""
        return False

    def solve_via_data(
        self,
        data: dict[str, Any],
        warm_start: bool,
        verbose: bool,
        solver_opts: dict[str, Any],
        solver_cache: dict[str, Any] | None = None,
    ) -> SimpleNamespace:
        """Solve from CVXPY's matrices; the answer has the fields of Clarabel's."""
        dims = data[ConicSolver.DIMS]
        options = _checked(solver_opts)
        cache = {} if solver_cache is None else solver_cache
        start: Point | None = cache.get(self.name()) if warm_start else None
        # Small blocks gain nothing from threads of BLAS, which wait for each other on a busy
        # machine: with all cores taken, runs with four took 1.8 times as long as with one.
        with threadpool_limits(1, user_api="blas"):
            program = InteriorPoint(
                np.asarray(data[settings.C], dtype=float),
                sp.csr_array(data[settings.A]),
                np.asarray(data[settings.B], dtype=float),
                dims.zero,
                dims.nonneg,
                list(dims.soc),
                options.pop("backend"),
            )
            result = program.minimise(**options, start=start)
        if result.middle is not None:
            cache[self.name()] = result.middle
        return SimpleNamespace(
            status=_STATUS.get(result.status, "InsufficientProgress"),
            x=result.point.x,
            z=np.concatenate([result.point.y, result.point.z]),
            obj_val=result.objective,
            solve_time=result.seconds,
            iterations=result.iterations,
        )


def _checked(options: dict[str, Any]) -> dict[str, Any]:
    known = {"tolerance": 1e-11, "max_iter": 150, "backend": best_backend()}
    for name in options:
        if name not in known:
            raise SolverError(
                f"blockwise has no option {name!r}; its options are {', '.join(known)}"
            )
    chosen = {**known, **options}
    if chosen["backend"] not in BACKENDS:
        raise SolverError(
            f"backend must be one of {', '.join(BACKENDS)}, got {chosen['backend']!r}"
        )
    return chosen
