"""Solvers of this package, with CVXPY's interface."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType, SimpleNamespace
from typing import Any, cast

import cvxpy.settings as keys
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints import SOC, Zero
from cvxpy.reductions.dcp2cone.cone_matrix_stuffing import ParamConeProg
from cvxpy.reductions.solvers.conic_solvers.clarabel_conif import CLARABEL
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from cvxpy.reductions.utilities import ReducedMat
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import SolverError
from cvxlimit.extensions.blockcone.interior import SOLVED, Point, Program, minimised, order_of

_Named = dict[str, Any]


class Blockwise(CLARABEL):
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

    SUPPORTED_CONSTRAINTS = (*ConicSolver.SUPPORTED_CONSTRAINTS, SOC)

    def __eq__(self, other: object) -> bool:
        """True for another of this kind: CVXPY keeps what it compiled, and the point to start from,
        for the solver that compares equal to the one before."""
        return type(self) is type(other)

    def __hash__(self) -> int:
        return hash(type(self))

    def name(self) -> str:
        """Name in CVXPY's reports."""
        return "BLOCKWISE"

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


OPTIONS: Mapping[str, Any] = MappingProxyType(
    {"tolerance": 1e-11, "residual": None, "max_iter": 150}
)
"""Options of :class:`Blockwise`, with their defaults."""


def _checked(options: _Named) -> _Named:
    """Returns all options, with defaults for those not given. Raises SolverError for others."""
    if unknown := [*options.keys() - OPTIONS.keys()]:
        has = f"its options are {', '.join(OPTIONS)}"
        raise SolverError(f"blockwise has no option {unknown[0]!r}; {has}")
    return {**OPTIONS, **options}


class Rescaled(Blockwise):
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
        if options.pop("first", "CLARABEL") == "CLARABEL":
            first = CLARABEL().solve_via_data(data, False, verbose, options)
        else:
            first = Blockwise().solve_via_data(data, False, verbose, {})
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
