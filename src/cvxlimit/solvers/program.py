"""Conic programs given as arrays: for thousands of small problems of one scene.

Everything else is written in CVXPY, whose compilation takes 20 to 50 ms however small a problem is,
where solvers need 5 to 10. Here matrices go to CVXPY's interfaces to the solvers directly, where an
interface needs nothing else.
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from pathlib import Path
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
from cvxlimit.base.files import write_file
from cvxlimit.errors import ModelError
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
            # Matrices and sizes of cones as CVXPY's interfaces take them, and what they need to
            # read the answer.
            p, rows = self.zero, len(self.right)
            dims = SimpleNamespace(
                zero=p, nonneg=self.nonneg, soc=list(self.cones), exp=0, psd=[], p3d=[], pnd=[]
            )
            data: dict[str, Any] = {
                keys.C: self.cost,
                ConicSolver.DIMS: dims,
                "enough": self.enough,
            }
            data |= {keys.A: self.matrix, keys.B: self.right}
            if self.quadratic is not None:
                data[keys.P] = self.quadratic
            if row.splits_equations:
                by_row = self.matrix.tocsr()
                data |= {keys.A: by_row[:p].tocsc(), keys.B: self.right[:p]}
                data |= {keys.G: by_row[p:].tocsc(), keys.H: self.right[p:]}
            inverse = {
                ConicSolver.VAR_ID: 0,
                ConicSolver.DIMS: dims,
                ConicSolver.EQ_CONSTR: [_rows(p, "equations")],
                ConicSolver.NEQ_CONSTR: [_rows(rows - p, "others")] if all_duals else [],
                keys.OFFSET: 0.0,
            }
            kept = cache if row.starts_warm else None
            starts = is_warm and kept is not None
            solve = partial(solver.solve_via_data, data, starts, settings.verbose, options, kept)
            return solve, lambda raw: solver.invert(raw, inverse)

        outcome, solution = attempted(settings, bool(self.cones), compiled)
        if solution is None or not outcome.has_values:
            return outcome, None, None
        if not solution.dual_vars:
            return replace(outcome, status=_NO_DUALS), None, None
        (x,) = solution.primal_vars.values()
        y = np.concatenate([np.ravel(part) for part in solution.dual_vars.values()])
        return outcome, np.asarray(x), y if all_duals else y[: self.zero]

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


FORMATS = ("cbf", "mps", "npz")


def write_program(
    program: ConeProgram, path: str | os.PathLike[str], form: str, name: str,
    remarks: Sequence[str] = (),
) -> None:  # fmt: skip
    """Writes a program in one of :data:`FORMATS`, with remarks as comments.

    Raises
    ------
    ModelError
        If the form is MPS, which has no cones, and the problem has some.
    InputError
        If the file cannot be written.
    """
    if form == "mps" and program.cones:
        raise ModelError(
            f"MPS has no second-order cones, {name} has {len(program.cones):,}: "
            "choose --surface octagon or another polygon, or --format cbf"
        )
    if form == "npz":
        write_file(Path(path), _packed(program, remarks))
        return
    starts, lines = ("#", _cbf(program)) if form == "cbf" else ("*", _mps(program, name))
    text = "\n".join([*(f"{starts} {remark}" for remark in remarks), *lines])
    write_file(Path(path), f"{text}\n".encode())


def _packed(program: ConeProgram, remarks: Sequence[str]) -> bytes:
    """Returns the program as a compressed file of NumPy arrays."""
    file, a = io.BytesIO(), program.matrix
    np.savez_compressed(
        file, c=program.cost, b=program.right, data=a.data, indices=a.indices, indptr=a.indptr,
        shape=a.shape, zero=program.zero, nonneg=program.nonneg,
        cones=np.array(program.cones, dtype=np.int64), remarks=np.array(remarks),
    )  # fmt: skip
    return file.getvalue()


def _cbf(program: ConeProgram) -> Iterator[str]:
    """Yields lines of the Conic Benchmark Format, version 3, whose constraints are A x + b in K."""
    cost, right, entries = program.cost, program.right, program.matrix.tocoo()
    kinds = [("L=", program.zero), ("L+", program.nonneg), *(("Q", k) for k in program.cones)]
    kinds = [(kind, size) for kind, size in kinds if size]
    costs, rights = map(np.flatnonzero, (cost, right))
    yield from ("VER", "3", "", "OBJSENSE", "MIN", "")
    yield from ("VAR", f"{len(cost)} 1", f"F {len(cost)}", "")
    yield from ("CON", f"{len(right)} {len(kinds)}")
    yield from (f"{kind} {size}" for kind, size in kinds)
    yield from ("", "OBJACOORD", str(len(costs)))
    yield from (f"{j} {cost[j]:.17g}" for j in costs)
    yield from ("", "ACOORD", str(entries.nnz))
    for i, j, value in zip(entries.row, entries.col, entries.data, strict=True):
        yield f"{i} {j} {-value:.17g}"
    yield from ("", "BCOORD", str(len(rights)))
    yield from (f"{i} {right[i]:.17g}" for i in rights)


def _mps(program: ConeProgram, name: str) -> Iterator[str]:
    """Yields lines of free MPS. Every variable is free, and the cost is row ``cost``."""
    yield from (f"NAME {name}", "ROWS", " N cost")
    for i in range(len(program.right)):
        yield f" {'E' if i < program.zero else 'L'} r{i}"
    yield "COLUMNS"
    a = program.matrix
    for j, cost in enumerate(program.cost):
        if cost:
            yield f" x{j} cost {cost:.17g}"
        for k in range(a.indptr[j], a.indptr[j + 1]):
            yield f" x{j} r{a.indices[k]} {a.data[k]:.17g}"
    yield "RHS"
    yield from (f" RHS r{i} {program.right[i]:.17g}" for i in np.flatnonzero(program.right))
    yield "BOUNDS"
    yield from (f" FR BND x{j}" for j in range(len(program.cost)))
    yield "ENDATA"
