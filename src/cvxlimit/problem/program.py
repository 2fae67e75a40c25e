"""The limit problem as its user has changed it: Parameters for strengths and loads, limits under
names, another aim; and the values of an answer in CVXPY's variables and duals.

Limits and aim are stated beside the limit problem, never instead of it: in CVXPY as further
constraints of the same variables, in rows as further rows (:class:`OwnLimits`), compiled by CVXPY
by themselves.
"""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import cvxpy as cp
import cvxpy.settings as keys
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints import Equality, Inequality
from cvxpy.reductions.solution import Solution

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.sinks import Constraints, Rows, stacked
from cvxlimit.model.statement import Stated
from cvxlimit.model.statics import DOF
from cvxlimit.problem.duals import ScaledConstraints
from cvxlimit.problem.forces import ContactForces
from cvxlimit.problem.given import Values
from cvxlimit.problem.interfaces import Part, parts_of
from cvxlimit.problem.limits import ContactLimits, OwnLimits
from cvxlimit.scene import Scene
from cvxlimit.solvers import Ladder, LimitState, Outcome, SolverSettings
from cvxlimit.solvers.table import SOLVERS, installed
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone


class UserProgram(LimitProgram):
    """A limit problem with ``values`` in place of the scene's, by the names that
    :class:`~cvxlimit.LimitProblem` has for them, to which limits are added."""

    def __init__(
        self,
        scene: Scene | Assemblage,
        surface: str | Cone | Sequence[YieldSurface],
        values: Mapping[str, Any],
        formulation: Formulation = corner_compressions,
    ) -> None:
        self.values = Values.of(scene, values)
        whole, given = self.values.assemblage, self.values.given
        super().__init__(whole, surface, formulation=formulation, given=given)
        self.limits: dict[str, tuple[cp.Constraint, ...]] = {}
        self.aim: cp.Expression | None = None
        self.sense = 1.0  # of the aim: -1 for one that is minimised
        self.has_goal = True
        self.states: list[LimitState] | None = None  # of runs, where one's values are asked for

    # Limits and aim of one's own

    @property
    def unknowns(self) -> list[cp.Variable]:
        """CVXPY's variables, without those of limits."""
        into = self._in_cvxpy[0].into
        assert isinstance(into, Constraints)
        return into.unknowns

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """The blocks of each contact."""
        contacts, ids = self.assemblage.contacts, [b.id for b in self.assemblage.scene.blocks]
        return [(ids[a], ids[b]) for a, b in zip(contacts.a, contacts.b, strict=True)]

    @property
    def has_own(self) -> bool:
        """True if limits were added, or something else is maximised."""
        return bool(self.limits) or self.aim is not None

    @property
    def said_own(self) -> str:
        """What was added, for notes."""
        names = reprlib.repr(list(self.limits))[1:-1]
        parts = [f"limits {names}" if names else "", "an aim" if self.aim is not None else ""]
        return " and ".join(filter(None, parts))

    @cached_property
    def _own(self) -> OwnLimits | None:
        aim = None if self.aim is None else self.sense * self.aim
        return OwnLimits(self.limits, aim) if self.has_own else None

    def change(
        self,
        limits: dict[str, tuple[cp.Constraint, ...]],
        aim: cp.Expression | None,
        sense: float = 1.0,
    ) -> None:
        """Other limits, by name, and another aim, None for the load factor; it is maximised, or
        minimised where ``sense`` is -1."""
        self.limits, self.aim, self.sense = limits, aim, sense
        for name in ("problem", "_in_rows", "_own", "shape", "_inside"):
            self.__dict__.pop(name, None)
        self.forget()

    def forget(self) -> None:
        super().forget()
        self.within: LimitState | None = None  # the limits, in a solve before

    def inside(self) -> Self:
        """The same limits, with nothing to maximise: an interior-point solver ends well inside."""
        return self._inside

    @cached_property
    def _inside(self) -> Self:
        result, own = copy(self), self._own
        result.states = None
        result.change(dict(self.limits), self.aim, self.sense)
        result.__dict__["_own"] = own  # with the unknowns that CVXPY made for its functions
        result.has_goal = False
        return result

    def contact_limits(self) -> ContactLimits | str:
        """What was added, as rows on contact forces and load factor at the Parameters' present
        values, for proofs; or a sentence on why it is none of that kind. A state has multipliers of
        these rows, what the objective gains per unit of ``right``, as ``own["multipliers"]``, and
        values of further unknowns as ``own["others"]``."""
        if self._own is None:
            return "nothing was added"
        stated, _ = self._in_cvxpy
        if self._conditions[0]:
            return "limits have a bracket on surfaces without unknowns of their own only"
        starts = self.model.start.values()
        internal = {v.id: at for v, at in zip(stated.internal, starts, strict=True)}
        units, load = self.scaling.force * self._unit, self.scaling.load_factor(1.0)
        forces = sp.csr_array(self.model.resultant_map @ sp.diags_array(units))
        return self._own.on_contacts(internal, forces, stated.factor.id, load)

    # The two sinks, with limits and aim

    @cached_property
    def _in_cvxpy(self) -> tuple[Stated, Any]:
        factor = self.scaling.load_factor(1.0)

        def rates(duals: Any) -> FloatArray:
            return self.equilibrium.mechanism(np.ravel(duals) / factor).ravel()

        return self.stated(ScaledConstraints(self.scaling.force, rates))

    def stated(self, into: Constraints | Rows) -> tuple[Stated, Any]:
        stated, goal = super().stated(into)
        if self._own is not None and self._own.is_compiled and isinstance(into, Rows):
            forms = {variable.id: form for variable, form in self._pairs(stated)}
            own = self._own.state(into, forms)
            goal = goal if self.aim is None else own
        return stated, goal if self.has_goal else 0.0 * stated.factor

    def _pairs(self, stated: Stated) -> Iterator[tuple[cp.Variable, Any]]:
        """CVXPY's variables, and the unknowns of the rows that they are."""
        return zip(
            self.unknowns, stated.into.unknowns, strict=False
        )  # others are unknowns of the own limits

    @cached_property
    def problem(self) -> cp.Problem:
        into = Constraints()
        into.named = dict(self.constraints)
        for into.label, limits in self.limits.items():
            for limit in limits:
                into.keep(limit)
        if self.aim is None or not self.has_goal:
            return cp.Problem(cp.Maximize(float(self.has_goal) * self.factor), into.all)
        wanted = cp.Maximize if self.sense > 0.0 else cp.Minimize
        return cp.Problem(wanted(self.aim), into.all)

    def ladder(self, tolerance: float = 1e-5) -> Ladder:
        """As of the limit problem; solvers that CVXPY has for them where limits have other cones,
        or whole numbers."""
        if self._own is None or self._own.is_compiled:
            return super().ladder(tolerance)
        is_integer, has_cones = self._own.is_integer, bool(self._in_rows[1].program.cones)
        names = ("MOSEK", "GUROBI", "HIGHS") if is_integer else ("CLARABEL", "SCS")
        rows = [SOLVERS[name] for name in names if name in installed()]
        found = tuple(row.at() for row in rows if row.has_cones or not has_cones)
        if not found:
            raise ModelError(
                f"{self._own.no_rows}, and no solver that is installed takes these with the cones "
                f"of surface {self.surface!r}: a polygon has none, as surface='octagon'"
            )
        return found

    @property
    def gain(self) -> float:
        return super().gain if self.aim is None else 1.0

    def run(
        self, settings: SolverSettings | None = None, has_rows: bool | None = None
    ) -> LimitState:
        """As :meth:`LimitProgram.run`; limits of one's own that have no rows go by CVXPY."""
        own = self._own
        state = super().run(settings, has_rows if own is None or own.has_rows else False)
        if own is not None and state.values is not None:
            if isinstance(state.values, Solution):
                found = own.of_cvxpy(state.values.dual_vars)
                others = np.zeros(0)  # if there are any, there are no multipliers either
            else:
                x, y = state.values
                found = self.gain * own.multipliers(y[own.places(self._in_rows[1].program)])
                others = own.others(x, [variable.id for variable in self.unknowns])
            if found is not None:
                state = replace(state, own={**state.own, "multipliers": found, "others": others})
        if self.states is not None:
            self.states.append(state)
        return state

    def _state(
        self, outcome: Outcome, internal: FloatArray, factor: float, duals: FloatArray | None,
        own: dict[str, FloatArray],
    ) -> LimitState:  # fmt: skip
        if duals is not None and self.aim is not None:  # duals of an aim are in its units
            duals = np.asarray(duals) / self.scaling.load_factor(1.0)
        return super()._state(outcome, internal, factor, duals, own)

    # Which rows are whose

    def places(self) -> Iterator[tuple[cp.Constraint, slice]]:
        """The limit problem's constraints in CVXPY, and where their rows stand in the program."""
        theirs, program = self._in_cvxpy[0].into, self._in_rows[1].program
        assert isinstance(theirs, Constraints)
        # both sinks were told the same in the same order, each kind of rows apart
        starts = {Equality: 0, Inequality: program.zero, cp.SOC: program.zero + program.nonneg}
        for constraint in theirs.stated:
            start = starts[type(constraint)]
            starts[type(constraint)] += constraint.size
            yield constraint, slice(start, start + constraint.size)

    def parts(self) -> list[Part]:
        """What contacts bear, with the contact of each row."""
        stated, written = self._in_rows
        start, contact = 0, np.full(written.program.matrix.shape[1], -1)
        for form in stated.internal:
            is_entry = form.column >= 0
            contact[form.column[is_entry]] = self.model.contact[start + form.row[is_entry]]
            start += form.size
        is_bound = contact < 0
        is_bound[stated.factor.column] = False
        names = {c.id: name for name, every in self.constraints.items() for c in every}
        placed = [(names[c.id], c, at) for c, at in self.places() if names[c.id] != "equilibrium"]
        patterns = sp.csr_array(written.program.matrix), sp.csr_array(self.program.matrix)
        return parts_of(placed, *patterns, contact, is_bound)

    # What CVXPY's expressions, variables and duals say

    @cached_property
    def forces(self) -> dict[str, ContactForces]:
        """Forces of all contacts by component, CVXPY expressions (n,) in the user's units; those of
        one contact by its number or name: ``problem.N["a-b"]``."""
        internal, names = stacked(self._in_cvxpy[0].internal), self.assemblage.contacts.names
        units = sp.diags_array(self.scaling.force * self._unit)
        resultants = (self.model.resultant_map @ units).tocsr()
        forces = {}
        for component, k in COLUMN.items():
            rows, unknown = resultants[k::DOF], internal
            if component == "N" and self.given.pull is not None:
                rows = sp.csr_array(sp.hstack([rows, -sp.eye_array(len(names))]))
                unknown = cp.hstack([internal, self.given.pull])
            forces[component] = ContactForces(cp.Constant(rows, name=component), unknown, names)
        return forces

    def at_present(self) -> Assemblage:
        """The mechanics at the Parameters' present values.

        Raises
        ------
        ModelError, InputError
            For a Parameter without a value, or with one that a scene refuses.
        """
        return self.values.at_present()

    def tell(self, primal: LimitState, dual: LimitState | None = None, status: str = "") -> float:
        """Give every variable, dual and the problem in CVXPY the values of an answer: forces of one
        state, duals of it or of another; returns the objective's."""
        found = self._solution(primal)
        duals = found if dual is None or dual.values is None else self._solution(dual)
        status = status or primal.outcome.status
        told = Solution(status, found.opt_val, found.primal_vars, duals.dual_vars, {})
        self.problem.unpack(told)
        return float(self.problem.value)

    def tell_none(self, status: str) -> None:
        """As :meth:`tell` where there is no answer: as CVXPY does for that ``status``."""
        is_known = status in keys.INF_OR_UNB
        value = self.sense * (np.inf if "unbounded" in status else -np.inf)
        self.problem.unpack(Solution(status if is_known else keys.INFEASIBLE, value, {}, {}, {}))
        if not is_known:  # CVXPY raises there, and has no word for a problem to say so
            self.problem._value, self.problem._status = None, keys.SOLVER_ERROR

    @contextmanager
    def untouched(self) -> Iterator[None]:
        """Leaves the values of variables and duals as they are, whatever is told inside."""
        said = self.problem.variables()
        said += [dual for limit in self.problem.constraints for dual in limit.dual_variables]
        before = [each.value for each in said]
        try:
            yield
        finally:
            for each, value in zip(said, before, strict=True):
                cp.Variable.save_value(each, value)  # as it was, in the user's units

    def _solution(self, state: LimitState) -> Solution:
        """A state's values as CVXPY's record, by the ids of variables and constraints."""
        if isinstance(state.values, Solution):
            return state.values
        (stated, written), (x, y) = self._in_rows, state.values
        program, gain = written.program, self.gain
        primal = {v.id: form.values(x).reshape(v.shape) for v, form in self._pairs(stated)}
        duals = dict[int, FloatArray]()
        for constraint, at in self.places():
            dual, is_one = gain * y[at], at.stop - at.start == 1
            duals[constraint.id] = dual.reshape(constraint.shape) if is_one else dual
        if self._own is not None and self._own.is_compiled:
            own = self._own.solution(x, gain * y[self._own.places(program)])
            primal, duals = {**own.primal_vars, **primal}, {**duals, **own.dual_vars}
        return Solution(state.outcome.status, None, primal, duals, {})
