"""The solver with CVXPY's interface, and its row in the table of solvers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType, SimpleNamespace
from typing import Any, ClassVar, cast

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
        """Solve from CVXPY's matrices; the answer has the fields of Clarabel's."""
        # The program, from CVXPY's matrices. ``kept`` is what CVXPY keeps from solve to solve.
        options, kept = _checked(solver_opts), {} if solver_cache is None else solver_cache
        dims, matrix = data[ConicSolver.DIMS], sp.csc_array(data[keys.A])
        cones = dims.zero, dims.nonneg, list(dims.soc)
        c, values, b = (np.asarray(v, float) for v in (data[keys.C], matrix.data, data[keys.B]))
        matrix = sp.csc_array((values, matrix.indices, matrix.indptr), matrix.shape)
        program = c, matrix, b, cones
        # Points to start from: those of the last solve if it is to be warm, else any given ones.
        way: dict[int, Point] = kept.setdefault("way", {})
        starts: list[Point] = [way[power] for power in sorted(way)]
        if not warm_start:
            starts = kept.get("starts", [])
        # The same program again has the same answer, and starts cold under other options: a start,
        # however good, would change the last digits.
        question = _Question.of(program, solver_opts, data.get("enough")) if warm_start else None
        before: _Question | None = kept.get("asked")
        if question is not None and before is not None and before.has_program_of(question):
            if before.options == question.options:
                return cast(SimpleNamespace, kept["answer"])
            starts = []
        # The solve, once more without a start where that failed.
        own = kept[self.name()] = _Ordered.of(kept.get(self.name()), program)
        again = partial(
            minimised, program, **options, enough=data.get("enough", np.inf), order=own.order
        )
        result = again(starts=starts)
        if starts and result.status != SOLVED:
            result = again()
        # What the next solve may need, and the answer.
        way |= result.way
        if result.middle is not None:
            kept["middle"] = result.middle
        answer = SimpleNamespace(
            status=result.status,
            x=result.point.x,
            z=np.concatenate([result.point.y, result.point.z]),
            obj_val=result.objective,
            solve_time=result.seconds,
            iterations=result.iterations,
        )
        if verbose:
            heat = "warm" if starts else "cold"
            keys.LOGGER.info(
                f"{self.name()}: {len(c):,} variables, {len(b):,} rows, {len(dims.soc):,} cones; "
                f"{result.iterations} iterations from a {heat} start, {result.seconds:.4f} s; "
                f"{result.status}, objective {result.objective:.12g}"
            )
        kept |= {"asked": question, "answer": answer}
        return answer


@dataclass(frozen=True, eq=False)
class _Question:
    """The numbers of a program that was solved, and the options of the solve."""

    numbers: tuple[NDArray[Any], ...]
    options: tuple[object, ...]

    @classmethod
    def of(cls, program: Program, options: _Named, enough: float | None) -> _Question:
        """Returns the question of a solve, with copies of its numbers."""
        c, matrix, b, (zero, orthant, soc) = program
        numbers = c, b, matrix.data, matrix.indices, matrix.indptr, np.array([zero, orthant, *soc])
        return cls(tuple(part.copy() for part in numbers), (options, enough))

    def has_program_of(self, other: _Question) -> bool:
        """Returns True if both are about the same program."""
        return all(map(np.array_equal, self.numbers, other.numbers))


@dataclass(frozen=True, eq=False)
class _Ordered:
    """A program with its order of elimination, which the next program of this pattern takes."""

    program: Program
    order: IntArray | None

    @classmethod
    def of(cls, before: Any, program: Program) -> _Ordered:
        """Returns ``before`` if the program has its pattern, otherwise the program ordered anew."""
        if isinstance(before, _Ordered) and before.program[3] == program[3]:
            one, other = before.program[1], program[1]
            same = one.shape == other.shape and np.array_equal(one.indptr, other.indptr)
            if same and np.array_equal(one.indices, other.indices):
                return before
        return cls(program, order_of(program))


def _checked(options: _Named) -> _Named:
    """Returns all options, with defaults for those not given. Raises SolverError for others."""
    if unknown := [*options.keys() - Blockwise.OPTIONS.keys()]:
        has = f"its options are {', '.join(Blockwise.OPTIONS)}"
        raise SolverError(f"blockwise has no option {unknown[0]!r}; {has}")
    return {**Blockwise.OPTIONS, **options}


ROW = Solver(
    "BLOCKWISE", "MIT", "cvxlimit", ("tolerance",), 1e-11, pace=(9.4e-7, 1.3), starts_warm=True,
    takes_matrices=True, plug_in=Blockwise,
    lacks="" if INTERIOR is not None else "it needs a C compiler at installation",
)  # fmt: skip
"""What the table of solvers knows of it."""
