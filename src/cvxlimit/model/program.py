"""The limit problem (Eq. 39), stated once: as CVXPY constraints, and as rows of a cone program.

    max alpha   subject to   A x + f_D + alpha f_L = 0,   x_j in K_j at every contact j.

Unknown are internal forces s, of which contact forces x are a linear map (a formulation), and
alpha. The cones K_j are the conditions of yield surfaces. The duals of equilibrium are the
mechanism: rates of blocks, with live power 1, at which no contact gains power.

A problem is made, solved and read in four stages:

1. :meth:`LimitProgram.stated`: unknowns, strength, goal and equilibrium, told to a sink in units in
   which the total load is 1 (:class:`~cvxlimit.model.statics.Scaling`);
2. what the sink makes of that, once: rows (``_in_rows``) or a problem of CVXPY (``problem``);
3. :meth:`LimitProgram.run`: one solver on either of them, at the Parameters' present values;
4. :meth:`LimitProgram.state`: forces, load factor and mechanism in the user's units.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Self

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage, Equilibrium, Reduction
from cvxlimit.model.crushing import model_of
from cvxlimit.model.formulations import Formulation, corner_compressions, times
from cvxlimit.model.sinks import Constraints, Rows, Written, stacked
from cvxlimit.model.statement import LARGEST_FACTOR, Goal, Stated, admissible
from cvxlimit.model.statics import DOF
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import Reference
from cvxlimit.solvers import (
    Ladder,
    LimitState,
    Outcome,
    Shape,
    SolverSettings,
    limit_ladder,
    run,
)
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces.base import Condition, LinearForm, YieldSurface, product
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import needed_surfaces, surfaces_of, with_bounds

DPP_LIMIT = 3_000
"""Entries of Parameters up to which CVXPY keeps its compilation for re-solves. The first with
them grows with their square, 2.6 GB at 6,000; beyond, every solve by CVXPY compiles afresh."""


@dataclass(frozen=True, eq=False)
class Given:
    """Strengths and loads in place of a scene's own: numbers, or expressions of Parameters.

    Attributes
    ----------
    contacts : Contacts
        What surfaces and formulations see: strengths may be expressions.
    dead, live : array or expression (6 free blocks,)
    pull : array or expression (n,), or None
        What the compressions of contacts that bear tension have too much, as they are stated, and
        those of reactions that push at least so much too little.
    """

    contacts: Contacts
    dead: Any
    live: Any
    pull: Any = None


class LimitProgram:
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
    given : Given or None
        Strengths and loads in place of the scene's, for the full model only.

    Raises
    ------
    ModelError
        Without rocking, or with the same surface twice.

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
        given: Given | None = None,
    ) -> None:
        surfaces, self.surface = surfaces_of(surface)
        self.assemblage = whole = Assemblage.of(scene)
        statics = whole.statics
        self.given = given or Given(statics.contacts, statics.dead, statics.live)
        self.surfaces = with_bounds(needed_surfaces(surfaces), self.given.contacts)
        self.formulation, self.goal, self.scaling = formulation, goal, whole.scaling
        if reduction is None:
            reduction = Reduction.none(statics, formulation)
            reduction = replace(reduction, contacts=self.given.contacts)
        self.reduction = reduction
        self.model = model_of(reduction.formulation, reduction.contacts, whole.corners)
        # units of internal forces, and one over those of equilibrium's rows: moments by the length
        self._unit = np.where(self.model.is_moment, self.scaling.length, 1.0)
        down = np.repeat([1.0, 1.0 / self.scaling.length], 3)
        self._down = np.tile(down, len(statics.dead) // DOF)
        # what solves leave for those after them
        self.reference: Reference | None = None  # of the last bracket
        self.strengths = dict[Hashable, Any]()  # see Assemblage: at all values of the Parameters
        self._ladders = dict[tuple[Shape, float], Ladder]()
        self.forget()

    def forget(self) -> None:
        """Start the next solve as if there had been none."""
        self._kept: dict[str, Any] = {}  # by solvers
        self._values_before: FloatArray | None = None  # of coefficients in Parameters

    # 1. The statement

    def stated(self, into: Constraints | Rows) -> tuple[Stated, Any]:
        """The problem, stated to a sink, and its goal."""
        scaling, (components, conditions) = self.scaling, self._conditions
        into.label = "rocking" if "rocking" in self.model.implied else "compression"
        forces, internal = self.model.unknowns(into, scaling.force, scaling.length, components)
        borne = []
        for name, condition, cone in conditions:
            into.label = name
            borne.append((name, admissible(into, condition, forces, cone)))
        into.label = "goal"
        factor = into.new(name="alpha")
        stated = Stated(self.assemblage, into, forces, internal, factor, *self.loads)
        if not components and not self.reduction.names:  # conditions are those of surfaces then
            stated.borne = borne
        goal = self.goal(stated)
        into.label = "equilibrium"
        equilibrium = self.equilibrium
        stated.before = 0 if isinstance(into, Constraints) else sum(f.size for f in into.equations)
        matrix, dead = equilibrium.matrix, equilibrium.of_load(stated.dead)
        if isinstance(into, Constraints):  # names, for who prints the problem
            matrix = cp.Constant(matrix, name="A")
            dead = dead if isinstance(dead, cp.Expression) else cp.Constant(dead, name="dead")
        load = times(equilibrium.of_load(stated.live), factor) + dead
        into.zero(matrix @ stacked(internal) + load)
        return stated, goal

    @cached_property
    def _conditions(self) -> tuple[dict[str, LinearForm], list[tuple[str, Condition, Cone]]]:
        """Components that unknowns of surfaces' own give, and all conditions, by name."""
        model, plain, components = self.model, list[YieldSurface](), dict[str, LinearForm]()
        conditions = list[tuple[str, Condition, Cone]]()
        for surface in self.surfaces:
            own = surface.unknowns(model.contacts)
            if own is None or not own.components.keys() <= model.start.keys() - components.keys():
                plain.append(surface)
            else:
                if len(faces := model.contacts.faces) < model.count:
                    own = own.on_faces(faces)
                components |= own.components
                conditions += [(surface.name, each, surface.cone) for each in own.conditions]
        return components, [*model.all_conditions(plain), *conditions]

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """Scaled, of the internal forces."""
        is_plain = self.reduction.formulation is corner_compressions and not self.model.conditions
        if is_plain and not self.reduction.names and self.assemblage.corners is not None:
            matrix = self.assemblage.balance.matrix.copy()  # the same for all scenes of a geometry
        else:
            whole = self.assemblage.statics.matrix
            matrix = self.reduction.apply(whole, self.model.resultant_map)
        matrix.data *= np.repeat(self._down, np.diff(matrix.indptr)) * self._unit[matrix.indices]
        matrix.eliminate_zeros()
        sizes = [  # of loads, one where they are open
            np.ones(load.size) if isinstance(load, cp.Expression) else np.abs(load)
            for load in self.loads
        ]
        return Equilibrium.of(matrix, np.stack(sizes), self.scaling, self.reduction.rates)

    @cached_property
    def loads(self) -> tuple[Any, Any]:
        """Scaled dead and live load (6 free blocks,), numbers or CVXPY expressions."""
        dead = product(self._down / self.scaling.force, self.given.dead)
        return dead, product(self._down / self.scaling.live, self.given.live)

    # 2. In CVXPY, and in rows

    @cached_property
    def _in_cvxpy(self) -> tuple[Stated, Any]:
        return self.stated(Constraints())

    @cached_property
    def _in_rows(self) -> tuple[Stated, Written]:
        into = Rows()
        stated, goal = self.stated(into)
        return stated, into.written(goal)

    @property
    def factor(self) -> cp.Expression:
        """The load factor, in CVXPY and in the user's units."""
        return self.scaling.load_factor(1.0) * self._in_cvxpy[0].factor

    @property
    def constraints(self) -> dict[str, list[cp.Constraint]]:
        """Those of :attr:`problem` by label: surfaces, ``"formulation"``, ``"equilibrium"``."""
        into = self._in_cvxpy[0].into
        assert isinstance(into, Constraints)
        return into.named

    @cached_property
    def problem(self) -> cp.Problem:
        """The problem in CVXPY, every constraint with its label; the load factor that it maximises
        is in the user's units, and so are duals."""
        stated, goal = self._in_cvxpy
        assert isinstance(stated.into, Constraints)
        goal = self.factor if self.goal == LARGEST_FACTOR else goal
        return cp.Problem(cp.Maximize(goal), stated.into.all)

    @property
    def gain(self) -> float:
        """What the objective of :attr:`problem` gains per unit of that of the rows."""
        return self.scaling.load_factor(1.0) if self.goal == LARGEST_FACTOR else 1.0

    @property
    def program(self) -> ConeProgram:
        """The rows, at the Parameters' present values. Unknown are internal forces, bounds of
        norms, the load factor, and what the goal adds."""
        written = self._in_rows[1]
        return written.at(written.theta.values())

    def at(self, values: Mapping[str, Any]) -> Self:
        """The problem at other ``values`` of its Parameters, by their names; zero where none is
        given. It is stated once, and solvers that start warm go on from their last answer."""
        for parameter in self._in_rows[1].theta.parameters():
            parameter.value = np.broadcast_to(values.get(parameter.name(), 0.0), parameter.shape)
        return self

    # 3. Solvers

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
        program = self._in_rows[1].program
        return Shape(program.matrix.shape[1], program.zero, len(program.cones), program.nonneg)

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
            Clarabel's later tries, which have a label. Solvers that want more than matrices, and
            quadratic goals, go by CVXPY in any case.
        """
        settings = settings or self.ladder()[0]
        if has_rows is None:
            has_rows = settings.name != "CLARABEL" or settings.label == ""
        is_quadratic = getattr(self.goal, "is_quadratic", False)
        if has_rows and not is_quadratic and settings.row.takes_matrices:
            return self._run_rows(settings)
        return self._run_by_cvxpy(settings)

    def _run_rows(self, settings: SolverSettings) -> LimitState:
        # it starts from the last solve if a Parameter has changed since
        written = self._in_rows[1]
        values, before = written.theta.values(), self._values_before
        self._values_before = values
        is_warm = before is not None and bool((before != values).any())
        program = written.at(values)
        outcome, x, y = program.solve(settings, self._kept, is_warm, all_duals=True)
        if x is None or y is None:
            return self.state(outcome, x, y)
        stated, _ = self._in_rows
        assert isinstance(stated.into, Rows)
        flows = partial(stated.flows, partial(stated.into.duals, y / self.scaling.live))
        return replace(self.state(outcome, x, y), values=(x, y), flows=flows)

    def _run_by_cvxpy(self, settings: SolverSettings) -> LimitState:
        size = sum(parameter.size for parameter in self.problem.parameters())
        outcome = run(self.problem, settings, ignore_dpp=size > DPP_LIMIT)
        stated, _ = self._in_cvxpy
        if not outcome.has_values or stated.factor.value is None:
            return LimitState(outcome, None, None, None)
        equations = self.problem.solution.dual_vars.get(self.constraints["equilibrium"][0].id)
        internal = np.concatenate([np.asarray(form.value).ravel() for form in stated.internal])
        own = {name: np.asarray(form.value).ravel() for name, form in stated.own.items()}
        duals = None if equations is None else equations / self.gain
        state = self._state(outcome, internal, float(stated.factor.value), duals, own)
        flows = None
        if duals is not None and isinstance(stated.into, Constraints):
            found = stated.into.duals(self.gain * self.scaling.live)
            flows = partial(stated.flows, partial(dict, found))
        return replace(state, values=self.problem.solution, flows=flows)

    # 4. What solvers have found

    def state(self, outcome: Outcome, x: FloatArray | None, y: FloatArray | None) -> LimitState:
        """What a solution x of the program says, with duals y of its equations."""
        if x is None or y is None:
            return LimitState(outcome, None, None, None)
        stated, _ = self._in_rows
        internal = stacked(stated.internal).values(x)
        own = {name: np.asarray(form.values(x)).ravel() for name, form in stated.own.items()}
        y = y[stated.before : stated.before + len(self.equilibrium.rows)]
        return self._state(outcome, internal, float(stated.factor.values(x)[0]), y, own)

    def _state(
        self, outcome: Outcome, internal: FloatArray, factor: float, duals: FloatArray | None,
        own: dict[str, FloatArray],
    ) -> LimitState:  # fmt: skip
        """A solution in the solver's units, of the model it saw, in the user's, of the scene."""
        internal = self.scaling.force * self._unit * internal
        forces = self.reduction.invert(self.model.forces(internal))
        mechanism = None if duals is None else self.equilibrium.mechanism(np.asarray(duals))
        factor = self.scaling.load_factor(factor)
        return LimitState(outcome, factor, forces, mechanism, internal, own)
