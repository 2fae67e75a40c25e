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
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.sinks import Constraints, Rows, stacked
from cvxlimit.model.statement import Stated
from cvxlimit.model.statics import DOF
from cvxlimit.problem.given import Values
from cvxlimit.problem.limits import ContactForces, LinearLimits, OwnLimits
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, Outcome, SolverSettings
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
        self.states: list[LimitState] | None = None  # of runs, where one's values are asked for

    # Limits and aim of one's own

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
        """The same limits without an aim: an interior-point solver ends well inside them."""
        return self._inside

    @cached_property
    def _inside(self) -> Self:
        result = copy(self)
        result.states = None
        # of variables that the copy shares
        result.change(dict(self.limits), 0.0 * self._in_cvxpy[0].factor)
        return result

    def linear_limits(self) -> LinearLimits | str:
        """What was added, as rows on contact forces and load factor at the Parameters' present
        values, for proofs; or a sentence on why it is none of that kind. The multipliers of a state
        are its ``own["multipliers"]``: what the objective gains per unit of ``right``."""
        if self._own is None:
            return "nothing was added"
        stated, _ = self._in_cvxpy
        if self._strength[0]:
            return "limits have a bracket on surfaces without unknowns of their own only"
        starts = self.model.start.values()
        internal = {v.id: at for v, at in zip(stated.internal, starts, strict=True)}
        units, load = self.scaling.force * self._unit, self.scaling.load_factor(1.0)
        forces = sp.csr_array(self.model.resultant_map @ sp.diags_array(units))
        return self._own.linear(internal, forces, stated.factor.id, load)

    # The two sinks, with limits and aim

    def stated(self, into: Constraints | Rows) -> tuple[Stated, Any]:
        stated, goal = super().stated(into)
        if self._own is not None and isinstance(into, Rows):
            forms = {variable.id: form for variable, form in self._pairs(stated)}
            own = self._own.state(into, forms)
            goal = goal if self.aim is None else own
        return stated, goal

    def _pairs(self, stated: Stated) -> Iterator[tuple[cp.Variable, Any]]:
        """CVXPY's variables, and the unknowns of the rows that they are."""
        theirs, ours = self._in_cvxpy[0].into.unknowns, stated.into.unknowns
        return zip(theirs, ours, strict=False)  # others are unknowns of the own limits

    @cached_property
    def problem(self) -> cp.Problem:
        into = Constraints()
        into.named = dict(self.constraints)
        for into.label, limits in self.limits.items():
            for limit in limits:
                into.keep(limit)
        if self.aim is None:
            return cp.Problem(cp.Maximize(self.factor), into.all)
        wanted = cp.Maximize if self.sense > 0.0 else cp.Minimize
        return cp.Problem(wanted(self.aim), into.all)

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
            else:
                y = state.values[1]
                found = self.gain * own.multipliers(y[own.places(self._in_rows[1].program)])
            if found is not None:
                state = replace(state, own={**state.own, "multipliers": found})
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
                each.save_value(value)

    def _solution(self, state: LimitState) -> Solution:
        """A state's values as CVXPY's record, by the ids of variables and constraints."""
        if isinstance(state.values, Solution):
            return state.values
        (stated, written), (x, y) = self._in_rows, state.values
        theirs, program, gain = self._in_cvxpy[0].into, written.program, self.gain
        assert isinstance(theirs, Constraints)
        primal = {v.id: form.values(x).reshape(v.shape) for v, form in self._pairs(stated)}
        # both sinks were told the same in the same order, each kind of rows apart
        duals = dict[int, FloatArray]()
        starts = {Equality: 0, Inequality: program.zero, cp.SOC: program.zero + program.nonneg}
        for constraint in theirs.stated:
            start, size = starts[type(constraint)], constraint.size
            starts[type(constraint)] += size
            dual = gain * y[start : start + size]
            duals[constraint.id] = dual.reshape(constraint.shape) if size == 1 else dual
        if self._own is not None:
            own = self._own.solution(x, gain * y[self._own.places(program)])
            primal, duals = {**own.primal_vars, **primal}, {**duals, **own.dual_vars}
        return Solution(state.outcome.status, None, primal, duals, {})
