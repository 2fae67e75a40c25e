"""The limit problem (Eq. 39), stated once: as CVXPY constraints, and as rows of a cone program."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
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
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.changing import Changeable
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.given import Given
from cvxlimit.model.limits import ContactForces
from cvxlimit.model.sinks import Constraints, Rows, Written, stacked
from cvxlimit.model.statement import LARGEST_FACTOR, Goal, LargestFactor, Stated
from cvxlimit.model.statics import DOF
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import Reference
from cvxlimit.solvers import Ladder, LimitState, Outcome, Shape, SolverSettings, limit_ladder, run
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import surfaces_of

DPP_LIMIT = 3_000
"""Entries of Parameters up to which CVXPY keeps its compilation for re-solves. The first with
them grows with their square, 2.6 GB at 6,000; beyond, every solve by CVXPY compiles afresh."""


class LimitProgram(Changeable):
    """max alpha  subject to  A x + f_D + alpha f_L = 0,  x_j in K_j at every contact j.

    What methods solve, once or many times; users meet it as
    :class:`~cvxlimit.LimitProblem`.

    Parameters
    ----------
    scene : Scene or Assemblage
    surface
        As :class:`~cvxlimit.LimitProblem` takes it.
    formulation : callable
        :func:`corner_compressions` (default), :func:`resultants`, or one of your own.
    reduction : Reduction or None
        A smaller model, with a formulation of its own.
    goal : callable
        What is maximised, stated to either sink; the load factor by default.
    values
        In place of the scene's, by the names that :class:`~cvxlimit.LimitProblem` has for them:
        ``friction`` and so on.

    Raises
    ------
    ModelError
        Without rocking, or with the same surface twice, and for values of another shape.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> problem = LimitProgram(builtin_scene("single-block"))
    >>> state = problem.run(problem.ladder()[0])
    >>> state.outcome.status, round(state.load_factor, 6)
    ('optimal', 0.4)
    """

    def __init__(
        self,
        scene: Scene | Assemblage,
        surface: str | Cone | Sequence[YieldSurface] = "conic",
        *,
        formulation: Formulation = corner_compressions,
        reduction: Reduction | None = None,
        goal: Goal = LARGEST_FACTOR,
        **values: Any,
    ) -> None:
        surfaces, self.surface = surfaces_of(surface)
        given = Given.of(scene, values)
        super().__init__(given, surfaces, formulation, reduction, goal)
        self.reference: Reference | None = None  # of the last bracket, for the next
        self.strengths = dict[Hashable, Any]()  # see Assemblage: at all values of the Parameters
        self._ladders = dict[tuple[Shape, float], Ladder]()
        self._ready: ConeProgram | None = None  # rows that come from another problem

    @cached_property
    def _in_rows(self) -> tuple[Stated, Written]:
        """The statement in rows, with limits and aim of one's own, and what was written."""
        into = Rows()
        stated, goal = self.stated(into)
        if self._own is not None:
            own = self._own.state(
                into, {variable.id: form for variable, form in self._pairs(stated)}
            )
            goal = goal if self.aim is None else own
        return stated, into.written(goal)

    def _pairs(self, stated: Stated) -> Iterator[tuple[cp.Variable, Any]]:
        """CVXPY's variables, and the unknowns of the rows that they are."""
        theirs, ours = self._in_cvxpy[0].into.unknowns, stated.into.unknowns
        return zip(theirs, ours, strict=False)  # others are unknowns of the own limits

    # In the user's units

    @property
    def factor(self) -> cp.Expression:
        """The load factor, in CVXPY."""
        return self.scaling.load_factor(1.0) * self._in_cvxpy[0].factor

    @cached_property
    def forces(self) -> dict[str, ContactForces]:
        """Forces of all contacts by component, CVXPY expressions (n,) in the user's units; those of
        one contact by its number or name: ``problem.N["a-b"]``."""
        internal, given_forces = stacked(self._in_cvxpy[0].internal), self.reduction.given_forces
        lift, names = self.reduction.forces, self.assemblage.contacts.names
        resultant_map = (
            self.model.resultant_map if lift is None else lift @ self.model.resultant_map
        )
        resultant_map = (resultant_map @ sp.diags_array(self.scaling.force * self._unit)).tocsr()
        forces = {}
        if given_forces is not None:
            resultant_map = sp.csr_array(
                sp.hstack([resultant_map, sp.csr_array(given_forces.reshape(-1, 1))])
            )
            internal = cp.hstack([internal, 1.0])
        for component, k in COLUMN.items():
            rows, unknown = resultant_map[k::DOF], internal
            if component == "N" and self.given.pull is not None:
                rows = sp.csr_array(sp.hstack([rows, -sp.eye_array(len(names))]))
                unknown = cp.hstack([internal, self.given.pull])
            forces[component] = ContactForces(cp.Constant(rows, name=component), unknown, names)
        return forces

    # The two doors

    @cached_property
    def problem(self) -> cp.Problem:
        """The problem in CVXPY, every constraint with its label; the load factor that it maximises
        is in the user's units, and so are duals."""
        _, goal = self._in_cvxpy
        into = Constraints()
        into.named = dict(self.constraints)
        for into.label, limits in self.limits.items():
            for limit in limits:
                into.keep(limit)
        if self.aim is not None:
            wanted = cp.Maximize if self.sense > 0.0 else cp.Minimize
            return cp.Problem(wanted(self.aim), into.all)
        goal = self.factor if self.goal == LARGEST_FACTOR else goal
        return cp.Problem(cp.Maximize(goal), into.all)

    @property
    def program(self) -> ConeProgram:
        """The rows, at the Parameters' present values. Unknown are internal forces, bounds of
        norms, the load factor, and what the goal adds."""
        if self._ready is not None:
            return self._ready
        written = self._in_rows[1]
        return written.at(written.theta.values())

    def at(self, values: Mapping[str, Any]) -> Self:
        """The problem at other ``values`` of its Parameters, by their names; zero where none is
        given. It is stated once, and solvers that start warm go on from their last answer."""
        for parameter in self._in_rows[1].theta.parameters():
            parameter.value = np.broadcast_to(values.get(parameter.name(), 0.0), parameter.shape)
        return self

    def ladder(self, tolerance: float = 1e-5) -> tuple[SolverSettings, ...]:
        """Solvers in the order in which to try them for a bracket within ``tolerance``, the same
        at every value of the Parameters."""
        asked = self.shape, tolerance
        if asked not in self._ladders:
            self._ladders[asked] = limit_ladder(*asked)
        return self._ladders[asked]

    @cached_property
    def shape(self) -> Shape:
        """Counts, which decide about solvers."""
        program = self._ready or self._in_rows[1].program
        variables, cones = program.matrix.shape[1], len(program.cones)
        return Shape(variables, program.zero, cones, program.nonneg)

    def run(
        self, settings: SolverSettings | None = None, has_rows: bool | None = None
    ) -> LimitState:
        """One run of one solver; never raises for what the solver does.

        There are two ways to a solver: the rows of this problem, at once, or CVXPY, which compiles
        the same problem into rows of another order. The optimum is the same; in which order the
        rows stand matters only where rounding decides.

        Parameters
        ----------
        settings : SolverSettings or None
            The solver, with its options; None is the first of the ladder.
        has_rows : bool or None
            True for the rows, False for CVXPY. None is the usual choice: the rows, but CVXPY for
            Clarabel's later tries, which have a label. Solvers that want more than matrices,
            quadratic goals and limits of one's own that have no rows go by CVXPY in any case.
        """
        settings = settings or self.ladder()[0]
        if has_rows is None:
            has_rows = settings.name != "CLARABEL" or settings.label == ""
        has_rows = has_rows and not getattr(self.goal, "is_quadratic", False)
        has_rows = has_rows and (self._own is None or self._own.has_rows)
        is_direct = has_rows and settings.row.takes_matrices
        state = self._run_rows(settings) if is_direct else self._run_by_cvxpy(settings)
        if self.states is not None:
            self.states.append(state)
        return state

    def _run_rows(self, settings: SolverSettings) -> LimitState:
        # the rows at the present values, and what solves of the same structure keep
        values, program = None, self._ready
        if program is None:
            values = self._in_rows[1].theta.values()
            program = self._in_rows[1].at(values)
        # it starts from the last solve if a Parameter has changed since
        before, self._values_before = self._values_before, values
        is_warm = before is not None and values is not None and bool((before != values).any())
        outcome, x, y = program.solve(settings, self._kept, is_warm, all_duals=True)
        state = self.state(outcome, x, y)
        if self._own is not None and x is not None and y is not None:
            multipliers = self._gain * self._own.multipliers(y[self._own.places(program)])
            state = replace(state, own={**state.own, "multipliers": multipliers})
        return replace(state, values=None if x is None else (x, y))

    def _run_by_cvxpy(self, settings: SolverSettings) -> LimitState:
        size = sum(parameter.size for parameter in self.problem.parameters())
        outcome = run(self.problem, settings, ignore_dpp=size > DPP_LIMIT)
        stated, _ = self._in_cvxpy
        if not outcome.has_values or stated.factor.value is None:
            return LimitState(outcome, None, None, None)
        equations = self.constraints["equilibrium"][0].dual_value
        internal = np.concatenate([np.asarray(form.value).ravel() for form in stated.internal])
        own = {name: np.asarray(form.value).ravel() for name, form in stated.own.items()}
        duals = None if equations is None else equations / self._gain
        values = self.problem.solution
        found = None if self._own is None else self._own.of_cvxpy(values.dual_vars)
        own |= {} if found is None else {"multipliers": found}
        state = self._state(outcome, internal, float(stated.factor.value), duals, own)
        return replace(state, values=values)

    # What CVXPY's variables, duals and problem say

    @property
    def _gain(self) -> float:
        """What the objective in the user's units gains per unit of that of the rows."""
        is_factor = self.aim is None and self.goal == LARGEST_FACTOR
        return self.scaling.load_factor(1.0) if is_factor else 1.0

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
        (stated, _), theirs, (x, y) = self._in_rows, self._in_cvxpy[0].into, state.values
        assert isinstance(theirs, Constraints)
        primal = {v.id: form.values(x).reshape(v.shape) for v, form in self._pairs(stated)}
        # both sinks were told the same in the same order, each kind of rows apart
        duals, program = dict[int, FloatArray](), self.program
        starts = {Equality: 0, Inequality: program.zero, cp.SOC: program.zero + program.nonneg}
        for constraint in theirs.stated:
            start, size = starts[type(constraint)], constraint.size
            starts[type(constraint)] += size
            dual = self._gain * y[start : start + size]
            duals[constraint.id] = dual.reshape(constraint.shape) if size == 1 else dual
        if self._own is not None:
            own = self._own.solution(x, self._gain * y[self._own.places(program)])
            primal, duals = {**own.primal_vars, **primal}, {**duals, **own.dual_vars}
        return Solution(state.outcome.status, None, primal, duals, {})

    def state(self, outcome: Outcome, x: FloatArray | None, y: FloatArray | None) -> LimitState:
        """What a solution x of the program says, with duals y of its equations."""
        if x is None or y is None:
            return LimitState(outcome, None, None, None)
        rows = len(self.equilibrium.rows)
        if self._ready is not None:
            return self._state(outcome, x[: len(self._unit)], float(x[-1]), y[:rows], {})
        stated, _ = self._in_rows
        internal = stacked(stated.internal).values(x)
        own = {name: np.asarray(form.values(x)).ravel() for name, form in stated.own.items()}
        y = y[stated.before : stated.before + rows]
        return self._state(outcome, internal, float(stated.factor.values(x)[0]), y, own)

    def _state(
        self, outcome: Outcome, internal: FloatArray, factor: float, duals: FloatArray | None,
        own: dict[str, FloatArray],
    ) -> LimitState:  # fmt: skip
        """A solution in the solver's units, of the model it saw, in the user's, of the scene."""
        reduction = self.reduction
        internal = self.scaling.force * self._unit * internal
        forces = self.model.forces(internal)
        if reduction.forces is not None:
            forces = np.asarray(reduction.forces @ forces.ravel()).reshape(-1, DOF)
        if duals is not None and self.aim is not None:  # duals of an aim are in its units
            duals = np.asarray(duals) / self.scaling.load_factor(1.0)
        return LimitState(
            outcome,
            self.scaling.load_factor(factor),
            forces if reduction.given_forces is None else forces + reduction.given_forces,
            None if duals is None else self.equilibrium.mechanism(np.asarray(duals)),
            internal,
            own,
        )

    def at_present(self) -> Assemblage:
        """The mechanics at the Parameters' present values.

        Raises
        ------
        ModelError, InputError
            For a Parameter without a value, or with one that a scene refuses.
        """
        return self.given.at_present()

    # The same rows under another load

    def dead_alone(self) -> LimitProgram:
        """Which share, at most all, of the dead load alone is carried: these rows, another load."""
        assemblage, scaling = self.assemblage, self.scaling
        alone, goal = assemblage.alone(assemblage.statics.dead), LargestFactor(most=1.0)
        result = LimitProgram(alone, self.surfaces, reduction=self.reduction, goal=goal)
        if alone.scaling.force != scaling.force:
            return result
        # Cached properties are filled, so that nothing is stated again. The dead load takes the
        # live one's place, and one row is new, behind those that are not negative: 1 - share, of
        # the last unknown.
        result.__dict__["equilibrium"] = self.equilibrium
        dead = self.equilibrium.of_load(self.loads[0])
        before = self.program.under(np.zeros_like(dead), dead)
        at, matrix = before.zero + before.nonneg, before.matrix
        entries = (
            np.append(matrix.data, 1.0),
            np.append(matrix.indices + (matrix.indices >= at), at),
            np.append(matrix.indptr[:-1], matrix.nnz + 1),
        )
        shape = matrix.shape[0] + 1, matrix.shape[1]
        result._ready = replace(
            before,
            matrix=sp.csc_array(entries, shape),
            right=np.insert(before.right, at, 1.0),
            nonneg=before.nonneg + 1,
        )
        return result
