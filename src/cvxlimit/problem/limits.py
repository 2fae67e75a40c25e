"""Limits and objectives that users write in CVXPY, as rows beside those of the limit problem.

CVXPY compiles them by themselves, to A y <= b with equations and cones of its own, y being its
variables. Those that are unknowns of the limit problem get its columns, others new ones
(:meth:`OwnLimits.state`). For proofs the same rows are put on contact forces x and the load factor
(:meth:`OwnLimits.on_contacts`): rows a on internal forces s, x = R s, become rows a R' (R R')^-1 on
x, contact by contact, where these say the same.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import cvxpy as cp
import cvxpy.settings as keys
import numpy as np
import scipy.sparse as sp
from cvxpy.error import DCPError, DPPError, SolverError
from cvxpy.reductions.solution import Solution
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.errors import ModelError
from cvxlimit.model.sinks import CONSTANT_COLUMN, Form, Rows, check_values
from cvxlimit.model.statics import DOF
from cvxlimit.solvers.matrices import Matrices
from cvxlimit.solvers.program import ConeProgram


@dataclass(frozen=True, eq=False)
class ContactLimits:
    """Limits of a user's on contact forces, in the user's units, for proofs: the slack

        right - matrix @ forces - factor * load_factor - unknowns @ others

    of each row is 0, not negative, or with those of its cone in a second-order cone, bound first.

    Attributes
    ----------
    names : tuple of str
        Label of each row's limit.
    matrix : (k, 6 n) sparse array
        On the forces of all contacts, V1 to MT of the first, then of the next.
    factor, right : (k,)
    unknowns : (k, m) array
        On other unknowns: variables of the user's, and those that CVXPY makes for ``abs`` or norms.
    is_equation : (k,) array of bool
        True for rows that are equations.
    cones : tuple of slice
        Rows of each cone; they are last.
    aim : (row (1, 6 n), coefficient of the load factor, row (m,) on unknowns, constant) or None
        What is maximised in place of the load factor.
    """

    names: tuple[str, ...]
    matrix: sp.csr_array
    factor: FloatArray
    right: FloatArray
    unknowns: FloatArray
    is_equation: BoolArray
    cones: tuple[slice, ...] = ()
    aim: tuple[sp.csr_array, float, FloatArray, float] | None = None


class OwnLimits:
    """Named limits and an aim of a user's, compiled by CVXPY by themselves: that costs what they
    cost, not what the problem costs, and when Parameters change their numbers are looked up again.

    Stands for an expression where coefficients are asked for: :attr:`value` are the numbers of the
    rows, at the Parameters' present values.

    Raises
    ------
    ModelError
        If CVXPY finds that a limit or the aim is not convex.
    """

    def __init__(
        self, limits: Mapping[str, Sequence[cp.Constraint]], aim: cp.Expression | None
    ) -> None:
        every = [limit for named in limits.values() for limit in named]
        self.names, self._aim = [name for name, named in limits.items() for _ in named], aim
        self._before: tuple[FloatArray, Any] | None = None  # numbers of rows, these on contacts
        self.problem = cp.Problem(cp.Maximize(0.0 if aim is None else aim), every)
        check_values(self.problem.parameters())
        if not self.problem.is_dcp():
            wrong = [
                name for name, limit in zip(self.names, every, strict=True) if not limit.is_dcp()
            ]
            what = f"limit {wrong[0]!r} is" if wrong else "the aim is"
            raise ModelError(f"{what} not convex by CVXPY's rules: see cvxpy.org, DCP")
        self.has_rows = self.problem.is_dcp(dpp=True)
        self.no_rows = "Parameters in limits or aim are multiplied with each other (not DPP)"
        self.is_compiled = True
        try:
            data, self._chain, self._inverse = self.problem.get_problem_data(
                Matrices(), solver_opts={}
            )
        except (SolverError, DCPError, DPPError):
            self.has_rows = self.is_compiled = False
            self.no_rows = self._beyond()
            return
        self._compiled, self.dims = data["param_prob"], data[ConicSolver.DIMS]
        cost, _, self._matrix, right = self._present()
        self._sizes = len(cost), len(right)
        # rows in units of their largest entry, those of one cone in the same
        rows = np.asarray(abs(self._matrix).max(axis=1).toarray(), dtype=float).ravel()
        for at in self._cones():
            rows[at] = rows[at].max()
        self.unit = np.where(rows > 0.0, rows, 1.0)

    @property
    def is_integer(self) -> bool:
        """True if some variables are whole numbers."""
        return bool(self.problem.is_mixed_integer())

    def _beyond(self) -> str:
        """Which limit asks for other cones than norms do, or for whole numbers."""
        pairs = [
            *((f"limit {name!r}", cp.Problem(cp.Minimize(0.0), [limit]))
              for name, limit in zip(self.names, self.problem.constraints, strict=True)),
            ("the aim", cp.Problem(self.problem.objective)),
        ]  # fmt: skip
        for what, alone in pairs:
            if alone.is_mixed_integer():
                return f"{what} has whole numbers"
            try:
                alone.get_problem_data(Matrices(), solver_opts={})
            except (SolverError, DCPError, DPPError):
                return f"{what} has exponential or semidefinite cones"
        return "limits have other cones"

    def parameters(self) -> list[cp.Parameter]:
        found: list[cp.Parameter] = self.problem.parameters()
        return found

    @property
    def size(self) -> int:
        return int(self._matrix.nnz) + sum(self._sizes)

    @property
    def value(self) -> FloatArray:
        cost, _, found, right = self._present()
        entries = found.data / self.unit[found.indices]
        return np.concatenate([entries, right / self.unit, cost])

    def _present(self) -> tuple[FloatArray, float, sp.csc_array, FloatArray]:
        """Cost, offset, matrix and right-hand sides, at the Parameters' present values.

        Raises
        ------
        ModelError
            For numbers that are not finite.
        """
        cost, offset, matrix, right = self._compiled.apply_parameters(keep_zeros=True)
        cost, matrix, right = np.asarray(cost), sp.csc_array(matrix), np.asarray(right)
        cure = "has a number that is not finite: leave out what limits nothing"
        for at, values in ((matrix.indices, matrix.data), (np.arange(len(right)), right)):
            if not np.isfinite(values).all():
                name = self._labels()[int(at[~np.isfinite(values)][0])] or self.names[0]
                raise ModelError(f"limit {name!r} {cure}")
        if not np.isfinite([*cost, offset]).all():
            raise ModelError(f"the aim {cure}")
        return cost, float(offset), matrix, right

    def _cones(self) -> list[slice]:
        start = self.dims.zero + self.dims.nonneg
        ends = np.cumsum([start, *self.dims.soc]).tolist()
        return list(map(slice, ends, ends[1:]))

    def state(self, into: Rows, by_id: Mapping[int, Form]) -> Form:
        """State the limits to rows, where CVXPY's variables are the forms ``by_id``; the aim."""
        unknown: list[Form] = []
        for variable in self._compiled.variables:
            form = by_id.get(variable.id)
            unknown.append(into.new(variable.size) if form is None else form)
        slots, matrix, (width, height) = into.theta.slots(self), self._matrix, self._sizes
        self.columns = np.concatenate([form.column for form in unknown])
        column = self.columns[np.repeat(np.arange(width), np.diff(matrix.indptr))]
        right = np.arange(height)
        whole = Form(
            into.theta,
            height,
            np.append(matrix.indices, right),
            np.append(column, np.full(height, CONSTANT_COLUMN)),
            np.ones(matrix.nnz + height),
            slots[: matrix.nnz + height],
        )
        ends = np.cumsum([self.dims.zero, self.dims.nonneg]).tolist()
        if ends[0]:
            into.zero(whole[: ends[0]])
        if ends[1] > ends[0]:
            into.nonneg(whole[ends[0] : ends[1]])
        for at in self._cones():
            forms = [whole[at][i : i + 1] for i in range(at.stop - at.start)]
            into.cone(forms[0], forms[1:])
        none = np.zeros(width, np.int64)
        # CVXPY's cost is what is made least
        last = slots[matrix.nnz + height :]
        return Form(into.theta, 1, none, self.columns, -np.ones(width), last)

    def places(self, program: ConeProgram) -> IntArray:
        """Returns where the rows stand among those of a program: last of each kind."""
        zero, nonneg, cones = self.dims.zero, self.dims.nonneg, sum(self.dims.soc)
        ends = program.zero, program.zero + program.nonneg, len(program.right)
        counts = zip(ends, (zero, nonneg, cones), strict=True)
        return np.concatenate([np.arange(end - count, end) for end, count in counts])

    def solution(self, x: FloatArray, duals: FloatArray) -> Solution:
        """CVXPY's record of values of variables and limits, of unknowns x of all rows and duals of
        these."""
        raw = SimpleNamespace(
            status="Solved", x=x[self.columns], z=self.multipliers(duals), obj_val=0.0,
            obj_val_dual=0.0, solve_time=0.0, iterations=0,
        )  # fmt: skip
        return self._chain.invert(raw, self._inverse)

    def on_contacts(
        self, internal: Mapping[int, slice], forces: sp.csr_array, factor: int, load: float
    ) -> Any:
        """The limits and the aim on contact forces, at present, or a sentence on why they are not.

        ``internal`` says where variables stand among the internal forces (p,), ``factor`` which is
        the load factor. ``forces`` (6 n, p) and ``load`` are contact forces and load factor of a
        unit of each, in the user's units.
        """
        if not self.has_rows:
            only = "bounds are computed from linear rows and norms alone"
            return f"{self.no_rows}, and {only}: nothing is proved of problem.value"
        cost, offset, matrix, right = self._present()
        aim = None
        # Parameters change right-hand sides as a rule: rows on contacts are kept with their numbers
        numbers = np.concatenate([matrix.data, cost])
        if self._before is None or not np.array_equal(self._before[0], numbers):
            rows = sp.vstack([sp.csr_array(-matrix), sp.csr_array(-cost[None, :])], format="csc")
            self._before = numbers, self._on_forces(rows, internal, forces, factor, load)
        on_forces = self._before[1]
        if isinstance(on_forces, str):
            return on_forces
        found, alpha, others = on_forces
        if self._aim is not None:
            aim = found[[-1]], float(alpha[-1]), others[-1], -float(offset)
        labels, zero = tuple(self._labels()), np.arange(len(right)) < self.dims.zero
        return ContactLimits(
            labels, found[:-1], alpha[:-1], right, others[:-1], zero,
            tuple(self._cones()), aim,
        )  # fmt: skip

    def _on_forces(
        self, rows: sp.csc_array, internal: Mapping[int, slice], forces: sp.csr_array,
        factor: int, load: float,
    ) -> tuple[sp.csr_array, FloatArray, FloatArray] | str:  # fmt: skip
        """Rows on CVXPY's variables as rows on contact forces, on the load factor and others."""
        whole, start = sp.lil_array((rows.shape[0], forces.shape[1])), 0
        alpha, others = np.zeros(rows.shape[0]), [np.zeros((rows.shape[0], 0))]
        for variable in self._compiled.variables:
            own = rows[:, start : start + variable.size].toarray()
            start += variable.size
            if variable.id == factor:
                alpha = own.ravel() / load
            elif variable.id in internal:
                whole[:, internal[variable.id]] = own
            else:
                others.append(own)
        found, missed = _on_contacts(sp.csr_array(whole), forces)
        if missed.any():
            names = [*map("limit {!r}".format, self._labels()), "the aim"]
            return f"{names[int(missed.argmax())]} is on more than the forces of contacts"
        return found, alpha, np.concatenate(others, axis=1)

    def others(self, x: FloatArray, known: Collection[int]) -> FloatArray:
        """Of unknowns x of all rows those of limits alone, whose variables are none ``known``."""
        each = np.concatenate([[v.id] * v.size for v in self._compiled.variables])
        return x[self.columns[~np.isin(each, [*known])]]

    def multipliers(self, duals: FloatArray) -> FloatArray:
        """What the objective gains per unit of each row's right-hand side, of the rows' duals."""
        signs = np.where(np.arange(len(duals)) < self.dims.zero, -1.0, 1.0)  # equations: A x = b
        return signs * duals / self.unit

    def of_cvxpy(self, duals: Mapping[int, Any]) -> FloatArray | None:
        """The multipliers of linear limits, of CVXPY's duals by the limits' ids; None where there
        are other rows, of which CVXPY tells no duals."""
        stated = self._compiled.constraints if self.has_rows else []
        if not stated or self.dims.soc or not all(each.id in duals for each in stated):
            return None
        return np.concatenate([np.ravel(duals[each.id], order="F") for each in stated])

    def _labels(self) -> list[str]:
        """Label of every row."""
        pairs = zip(self.problem.constraints, self.names, strict=True)
        of = {limit.id: name for limit, name in pairs}
        found: list[str] = []
        for stated in self._compiled.constraints:
            found += [of.get(stated.id, "")] * stated.size
        return found


def _on_contacts(rows: sp.csr_array, resultant_map: sp.csr_array) -> tuple[sp.csr_array, BoolArray]:
    """Rows (k, 6 n) on contact forces that are rows (k, p) on internal forces, by contact, and
    which of them are not."""
    given = sp.csr_array(rows @ resultant_map.T)
    touched = np.unique(given.indices // DOF)  # few, as a rule
    found = given
    if len(touched):
        at, each = (DOF * touched[:, None] + np.arange(DOF)).ravel(), np.arange(len(touched) + 1)
        square = sp.coo_array(resultant_map[at] @ resultant_map[at].T)
        row, column = (np.asarray(index, np.int64) for index in square.coords)
        inside, blocks = row // DOF == column // DOF, np.zeros((len(touched), DOF, DOF))
        row, column = row[inside], column[inside]
        blocks[row // DOF, row % DOF, column % DOF] = square.data[inside]
        inverse = sp.bsr_array((np.linalg.pinv(blocks, hermitian=True), each[:-1], each))
        own = sp.csr_array(given[:, at] @ inverse)
        found = sp.csr_array((own.data, at[own.indices], own.indptr), shape=given.shape)
    rest, size = (
        abs(part).max(axis=1).toarray().ravel() for part in (found @ resultant_map - rows, rows)
    )
    return found, rest > 1e-9 * size


def smallest_conflict(
    problem: cp.Problem, limits: Mapping[str, Sequence[cp.Constraint]]
) -> list[str]:
    """Names of the fewest limits that cannot hold together with the rest of a problem; none where
    all can, or where the rest alone cannot.

    Every set of limits that cannot hold has one of those that give way where the others may not, so
    that the smallest set with one of each such group is the answer as soon as it cannot hold.
    """
    own = {limit.id for named in limits.values() for limit in named}
    rest = [limit for limit in problem.constraints if limit.id not in own]
    groups: list[set[str]] = []
    while True:
        conflict = _smallest_with_one_of_each(groups)
        slack = {name: cp.Variable(nonneg=True) for name in limits if name not in conflict}
        stated = [limit for name in conflict for limit in limits[name]]
        stated += [_loosened(limit, s) for name, s in slack.items() for limit in limits[name]]
        loose = cp.Problem(cp.Minimize(sum(slack.values())), rest + stated)
        try:
            loose.solve(solver=cp.CLARABEL)
        except SolverError:
            return []
        if loose.status not in keys.SOLUTION_PRESENT:
            return [name for name in limits if name in conflict]
        sizes = {name: float(s.value) for name, s in slack.items()}
        most = max(sizes.values(), default=0.0)
        groups.append({name for name, size in sizes.items() if size > 1e-6 * max(most, 1e-300)})
        if not groups[-1]:
            return []


def _smallest_with_one_of_each(groups: Sequence[set[str]]) -> set[str]:
    """The fewest names among which are some of every group."""
    names = sorted(set[str]().union(*groups))
    for count in range(len(names) + 1):
        for chosen in combinations(names, count):
            if all(not group.isdisjoint(chosen) for group in groups):
                return set(chosen)
    return set()


def _loosened(limit: Any, slack: cp.Variable) -> cp.Constraint:
    if isinstance(limit, cp.SOC):
        return cp.SOC(limit.args[0] + slack, limit.args[1], axis=limit.axis)
    if isinstance(limit, (cp.constraints.Zero, cp.constraints.Equality)):
        return cp.abs(limit.expr) <= slack
    if isinstance(limit, cp.constraints.NonNeg):
        return limit.expr + slack >= 0
    return limit.expr <= slack
