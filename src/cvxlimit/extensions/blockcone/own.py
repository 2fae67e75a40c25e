"""The solver with CVXPY's interface, and its row in the table of solvers.

A solve takes the program from CVXPY's matrices, the order of elimination and the points to start
from of the solve before where they fit, minimises it (:mod:`.interior`), and keeps what the next
solve may need.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType, SimpleNamespace
from typing import Any, ClassVar

import cvxpy.settings as keys
import numpy as np
import scipy.sparse as sp
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from numpy.typing import NDArray

from cvxlimit.base.arrays import IntArray
from cvxlimit.errors import SolverError
from cvxlimit.extensions.blockcone.interior import (
    INTERIOR,
    SOLVED,
    Program,
    Result,
    minimised,
    order_of,
)
from cvxlimit.solvers.matrices import Matrices, Point
from cvxlimit.solvers.table import Solver

_Named = dict[str, Any]


class Blockwise(Matrices):
    """For ``problem.solve(solver=Blockwise())``: linear and second-order cones.

    Made for assemblages: it eliminates the forces of every contact and factorises the remaining
    equations, six rows per block. Data and duals are laid out as for Clarabel, whose CVXPY
    interface does that here. With ``warm_start=True`` it starts from a point on the way to the
    answer before, which halves the iterations where the problem has changed little; a start that is
    no use costs time.

    Options: ``tolerance`` (1e-11) of the gap, ``residual`` (1e-5 of the tolerance, at least 1e-8)
    and ``max_iter`` (150).

    Raises
    ------
    SolverError
        If the cones do not fall apart into small blocks, an option is unknown, or it was not
        compiled when the package was installed.

    Example
    -------
    >>> import cvxpy as cp
    >>> x = cp.Variable(2)
    >>> problem = cp.Problem(cp.Maximize(x[0]), [cp.sum(x) == 1, x >= 0])
    >>> from cvxlimit.solvers import blockwise
    >>> own = Blockwise() if blockwise() else "CLARABEL"  # where nothing is compiled
    >>> round(float(problem.solve(solver=own)), 6)
    1.0
    """

    OPTIONS: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {"tolerance": 1e-11, "residual": None, "max_iter": 150}
    )
    """Options with their defaults."""

    def name(self) -> str:
        """Name in CVXPY's reports."""
        return "BLOCKWISE"

    def solve_via_data(
        self,
        data: _Named,
        warm_start: bool,
        verbose: bool,
        solver_opts: _Named,
        solver_cache: Any = None,
    ) -> SimpleNamespace:
        """Solve from CVXPY's matrices; the answer has the fields of Clarabel's. ``solver_cache`` is
        what CVXPY keeps from solve to solve of a problem."""
        options, kept = _checked(solver_opts), {} if solver_cache is None else solver_cache
        # The program, from CVXPY's matrices: its pattern, and its numbers.
        dims, given = data[ConicSolver.DIMS], sp.csc_array(data[keys.A])
        c, values, b = (np.asarray(v, float) for v in (data[keys.C], given.data, data[keys.B]))
        matrix = sp.csc_array((values, given.indices, given.indptr), given.shape)
        program: Program = c, matrix, b, (dims.zero, dims.nonneg, list(dims.soc))
        pattern = np.array([dims.zero, dims.nonneg, *dims.soc]), given.indices, given.indptr
        numbers = tuple(part.copy() for part in (c, values, b)) if warm_start else ()
        asked = dict(solver_opts), data.get("enough")
        # What is known from the solve before: the order of elimination if the pattern is the same,
        # and if all is, the answer.
        before: _Solved | None = kept.get(self.name())
        if before is None or not _are_equal(pattern, before.pattern):
            before = None
        is_same = before is not None and warm_start and _are_equal(numbers, before.numbers)
        if before is not None and is_same and before.asked == asked:
            return before.answer
        order = order_of(program) if before is None else before.order
        # Points to start from: those of the last solve if it is to be warm, else any given ones.
        # The same program starts cold under other options: a start, however good, would change the
        # last digits.
        way: dict[int, Point] = kept.setdefault("way", {})
        starts = [way[power] for power in sorted(way)] if warm_start else kept.get("starts", [])
        starts = [] if is_same else starts
        # The solve, once more without a start where that failed, and what the next may need of it.
        minimise = partial(minimised, program, **options, enough=data.get("enough", np.inf),
                           order=order)  # fmt: skip
        result = minimise(starts=starts)
        if starts and result.status != SOLVED:
            result = minimise()
        way |= result.way
        if result.middle is not None:
            kept["middle"] = result.middle
        answer = _answer(result)
        kept[self.name()] = _Solved(pattern, order, numbers, asked, answer)
        if verbose:
            keys.LOGGER.info(f"{self.name()}: {_told(program, result, bool(starts))}")
        return answer


@dataclass(frozen=True, eq=False)
class _Solved:
    """A program that was solved: the pattern of its cones and of its matrix with its order of
    elimination, copies of its numbers if the solve was warm, the options, and the answer."""

    pattern: tuple[NDArray[Any], ...]
    order: IntArray | None
    numbers: tuple[NDArray[Any], ...]
    asked: tuple[object, ...]
    answer: SimpleNamespace


def _are_equal(some: tuple[NDArray[Any], ...], others: tuple[NDArray[Any], ...]) -> bool:
    return len(some) == len(others) and all(map(np.array_equal, some, others))


def _answer(result: Result) -> SimpleNamespace:
    """Returns a result in the fields of Clarabel's."""
    return SimpleNamespace(
        status=result.status,
        x=result.point.x,
        z=np.concatenate([result.point.y, result.point.z]),
        obj_val=result.objective,
        solve_time=result.seconds,
        iterations=result.iterations,
    )


def _told(program: Program, result: Result, is_warm: bool) -> str:
    """Returns a line on a solve."""
    c, _, b, (_, _, soc) = program
    return (
        f"{len(c):,} variables, {len(b):,} rows, {len(soc):,} cones; {result.iterations} "
        f"iterations from a {'warm' if is_warm else 'cold'} start, {result.seconds:.4f} s; "
        f"{result.status}, objective {result.objective:.12g}"
    )


def _checked(options: _Named) -> _Named:
    """Returns all options, with defaults for those not given. Raises SolverError for others."""
    if unknown := [*options.keys() - Blockwise.OPTIONS.keys()]:
        has = f"its options are {', '.join(Blockwise.OPTIONS)}"
        raise SolverError(f"blockwise has no option {unknown[0]!r}; {has}")
    return {**Blockwise.OPTIONS, **options}


ROW = Solver(
    "BLOCKWISE", "cvxlimit", ("tolerance",), 1e-11, pace=(9.4e-7, 1.3), starts_warm=True,
    takes_matrices=True, plug_in=Blockwise,
    lacks="" if INTERIOR is not None else "it needs a C compiler at installation",
)  # fmt: skip
"""What the table of solvers knows of it."""
