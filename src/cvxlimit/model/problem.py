"""The limit problem (Eq. 39), stated once: as CVXPY constraints, and as rows of a cone program."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from cvxlimit.arrays import FloatArray
from cvxlimit.model.assemblage import Assemblage, Equilibrium, Reduction
from cvxlimit.model.formulations import Formulation, corner_compressions, model_of
from cvxlimit.model.sinks import Constraints, Rows, Written, stacked
from cvxlimit.model.statics import DOF
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, Outcome, Shape, SolverSettings, limit_ladder, run
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces.base import (
    Condition,
    LinearForm,
    YieldSurface,
    admissible,
    times,
)
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import needed_surfaces, strength_key, surfaces_of

_WANT_MATRICES = ("CLARABEL", "BLOCKWISE", "RESCALED", "QOCO")
"""Solvers whose interfaces need matrices and nothing else of a problem."""


@dataclass(eq=False)
class Stated:
    """A limit problem on its way into a sink, for goals: all in forms of that sink, scaled.

    Attributes
    ----------
    assemblage : Assemblage
    into : Sink
        Takes unknowns and limits of the goal's own.
    forces : mapping of component or part to form (n,)
        Over the unit of force; :data:`CONSTANT` is the user's unit over it.
    internal : sequence of form
        The forces of the formulation's parts, over the units of force and length.
    factor : form
        The load factor.
    dead, live : array or form (6 free blocks,)
        The load that forces balance is ``dead + factor * live``; a goal may put others.
    own : mapping of str to form
        Unknowns of the goal's own whose values are asked for.
    """

    assemblage: Assemblage
    into: Constraints | Rows
    forces: Mapping[str, Any]
    internal: Sequence[Any]
    factor: Any
    dead: Any
    live: Any
    own: dict[str, Any] = field(default_factory=dict)


Goal = Callable[[Stated], Any]
"""What a problem maximises: a form, with limits of its own stated on the way."""


@dataclass(frozen=True)
class LargestFactor:
    """The load factor, at most ``most`` where only its reach is asked for."""

    most: float | None = None

    def __call__(self, stated: Stated) -> Any:
        if self.most is not None:
            most = self.most / stated.assemblage.scaling.load_factor(1.0)
            stated.into.nonneg(most - stated.factor)
        return stated.factor


LARGEST_FACTOR = LargestFactor()


def largest_self_stress(stated: Stated) -> Any:
    """Sum of all compressions without any load, none above one: whether blocks hold each other.

    If the value is 0, the duals of equilibrium open every contact by at least 1 more than the flow
    rule asks for: forces that balance themselves do no work on any rates, but positive work where
    every contact opens. If it is positive, duals mean nothing.
    """
    pressure = stated.forces["N"]
    stated.into.nonneg(1.0 - pressure)
    stated.into.zero(stated.factor)
    stated.dead, stated.live = 0.0 * stated.dead, 0.0 * stated.live
    return np.ones(pressure.size) @ pressure


class LimitProblem:
    """max alpha  subject to  A x + f_D + alpha f_L = 0,  x_j in K_j at every contact j.

    Parameters
    ----------
    scene : Scene or Assemblage
    surface : str, Cone or sequence of YieldSurface
        As :func:`cvxlimit.solve` takes it. Surfaces implied by another are not written.
    formulation : callable
        :func:`corner_compressions` (default), :func:`resultants`, or one of your own.
    reduction : Reduction or None
        A smaller model, with a formulation of its own.
    goal : callable
        What is maximised, stated to either sink; the load factor by default.
    repeats : Repeats or None
        What problems of scenes like this one share
        (:class:`~cvxlimit.reductions.repeated.Repeats`), if there are any.

    Raises
    ------
    ModelError
        Without rocking, or with the same surface twice.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> problem = LimitProblem(builtin_scene("single-block"))
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
        repeats: Any = None,
    ) -> None:
        self.assemblage = assemblage = Assemblage.of(scene)
        self.surfaces = needed_surfaces(surfaces_of(surface)[0])
        self.reduction = reduction or Reduction.none(assemblage.statics, formulation)
        self.goal, self.repeats, self.scaling = goal, repeats, assemblage.scaling
        self.model = model_of(self.reduction.formulation, self.reduction.contacts)
        self._unit = np.where(self.model.is_moment, self.scaling.length, 1.0)
        self._kept: dict[str, Any] = {}  # by solvers, for the next run
        self._values_before: FloatArray | None = None  # of coefficients, in the run before

    # The statement

    def stated(self, into: Constraints | Rows) -> tuple[Stated, Any]:
        """The problem, stated to a sink, and its goal."""
        scaling, (gives, written) = self.scaling, self._written
        forces, internal = self.model.unknowns(into, scaling.force, scaling.length, gives)
        for name, condition, cone in written:
            into.label = name
            admissible(into, condition, forces, cone)
        into.label = "goal"
        factor = into.new(name="alpha")
        found = Stated(self.assemblage, into, forces, internal, factor, *self._loads)
        goal = self.goal(found)
        into.label = "equilibrium"
        equilibrium = self.equilibrium
        load = times(equilibrium.of_load(found.live), factor) + equilibrium.of_load(found.dead)
        into.zero(equilibrium.matrix @ stacked(internal) + load)
        return found, goal

    @cached_property
    def _written(self) -> tuple[dict[str, LinearForm], list[tuple[str, Condition, Cone]]]:
        """What unknowns of surfaces' own give, and the conditions to write."""
        model, plain, gives = self.model, list[YieldSurface](), dict[str, LinearForm]()
        written = list[tuple[str, Condition, Cone]]()
        for surface in self.surfaces:
            own = surface.unknowns(model.contacts)
            if own is None or not own.gives.keys() <= model.start.keys() - gives.keys():
                plain.append(surface)
            else:
                gives |= own.gives
                written += [(surface.name, condition, surface.cone) for condition in own.conditions]
        return gives, [*model.strength(plain), *written]

    @cached_property
    def _in_cvxpy(self) -> tuple[Stated, Any]:
        return self.stated(Constraints())

    @cached_property
    def _in_rows(self) -> tuple[Stated, Written]:
        into = Rows()
        found, goal = self.stated(into)
        return found, into.written(goal)

    # The two doors

    @cached_property
    def problem(self) -> cp.Problem:
        """In CVXPY, every constraint with its label."""
        found, goal = self._in_cvxpy
        assert isinstance(found.into, Constraints)
        return cp.Problem(cp.Maximize(goal), found.into.all)

    @property
    def constraints(self) -> dict[str, list[cp.Constraint]]:
        """Those of :attr:`problem` by label: surfaces, ``"formulation"``, ``"equilibrium"``."""
        into = self._in_cvxpy[0].into
        assert isinstance(into, Constraints)
        return into.named

    @property
    def program(self) -> ConeProgram:
        """The rows, at the Parameters' present values. Unknown are internal forces, bounds of
        norms, the load factor, and what the goal adds."""
        if self._shared is not None:
            return self._shared
        return self._in_rows[1].at_present()

    @cached_property
    def _shared(self) -> ConeProgram | None:
        """The rows that scenes like this one share, under this one's loads."""
        about = strength_key(self.surfaces, self.model.contacts)
        is_full = self._is_whole and len(self.equilibrium.rows) == self._loads.shape[1]
        if self.repeats is None or about is None or not is_full or self.goal != LARGEST_FACTOR:
            return None
        what, contacts = ("program", about, self.scaling.force), self.model.contacts
        found = self.repeats.shared(what, contacts, lambda: self._in_rows[1].at_present())
        dead, live = self._loads
        shared: ConeProgram = found.under(dead, live)
        return shared

    def ladder(self, tolerance: float = 1e-5) -> tuple[SolverSettings, ...]:
        """Solvers in the order in which to try them for a bracket within ``tolerance``."""
        return limit_ladder(self.shape, tolerance, self.repeats is not None)

    @cached_property
    def shape(self) -> Shape:
        """Counts, which decide about solvers."""
        program = self.program
        variables, cones = program.matrix.shape[1], len(program.cones)
        return Shape(variables, program.zero, cones, program.nonneg)

    def run(self, settings: SolverSettings | None = None, has_rows: bool = True) -> LimitState:
        """One run of one solver, the ladder's first, by the rows, or by CVXPY where it wants more
        than matrices; never raises for what the solver does.

        Where rounding decides, Clarabel's last rungs see the rows in CVXPY's order.
        """
        settings = settings or self.ladder()[0]
        is_last = settings.name == "CLARABEL" and settings.label != ""
        if settings.name not in _WANT_MATRICES or is_last or not has_rows:
            return self._run_by_cvxpy(settings)
        program, kept = self.program, self._kept
        if self.repeats is not None:
            kept = self.repeats.structure(program)
        values = None if self._shared is not None else self._in_rows[1].theta.values()
        before, self._values_before = self._values_before, values
        is_warm = before is not None and values is not None and bool((before != values).any())
        return self.state(*program.solve(settings, kept, is_warm))

    def _run_by_cvxpy(self, settings: SolverSettings) -> LimitState:
        outcome = run(self.problem, settings)
        found, _ = self._in_cvxpy
        if not outcome.has_values or found.factor.value is None:
            return LimitState(outcome, None, None, None)
        equations = self.constraints["equilibrium"][0].dual_value
        internal = np.concatenate([np.asarray(form.value).ravel() for form in found.internal])
        factor = float(found.factor.value)
        return self._state(outcome, internal, factor, equations, self._values(found, None))

    def state(self, outcome: Outcome, x: FloatArray | None, y: FloatArray | None) -> LimitState:
        """What a solution x of the program says, with duals y of its equations."""
        if x is None or y is None:
            return LimitState(outcome, None, None, None)
        if self._shared is not None:
            return self._state(outcome, x[: len(self._unit)], float(x[-1]), y, {})
        found, _ = self._in_rows
        internal = stacked(found.internal).values(x)
        own = self._values(found, x)
        return self._state(outcome, internal, float(found.factor.values(x)[0]), y, own)

    def _values(self, found: Stated, x: FloatArray | None) -> dict[str, FloatArray]:
        return {
            name: np.asarray(form.value if x is None else form.values(x)).ravel()
            for name, form in found.own.items()
        }

    def _state(
        self, outcome: Outcome, internal: FloatArray, factor: float, duals: FloatArray | None,
        own: dict[str, FloatArray],
    ) -> LimitState:  # fmt: skip
        reduction = self.reduction
        internal = self.scaling.force * self._unit * internal
        forces = self.model.forces(internal)
        if reduction.forces is not None:
            forces = np.asarray(reduction.forces @ forces.ravel()).reshape(-1, DOF)
        # equilibrium is stated last: its duals come after those of a goal's own equations
        rows = len(self.equilibrium.rows)
        return LimitState(
            outcome,
            self.scaling.load_factor(factor),
            forces if reduction.still is None else forces + reduction.still,
            None if duals is None else self.equilibrium.mechanism(np.asarray(duals)[-rows:]),
            internal,
            own,
        )

    # Equilibrium

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """Scaled, of the internal forces."""
        return Equilibrium.of(self._matrix, self._loads, self.scaling, self.reduction.rates)

    @cached_property
    def _down(self) -> FloatArray:
        """Units of equilibrium's rows: moments are over the length."""
        units = np.repeat([1.0, 1.0 / self.scaling.length], 3)
        return np.tile(units, len(self.assemblage.statics.dead) // DOF)

    @cached_property
    def _loads(self) -> FloatArray:
        """Scaled dead and live load (2, 6 free blocks)."""
        statics, scaling = self.assemblage.statics, self.scaling
        return self._down * np.stack([statics.dead / scaling.force, statics.live / scaling.live])

    @cached_property
    def _is_whole(self) -> bool:
        """True if unknown are the corner compressions of all contacts: equilibrium is then the same
        for all scenes of one geometry."""
        is_plain = self.reduction.formulation is corner_compressions and not self.model.conditions
        return is_plain and not self.reduction.names

    @cached_property
    def _matrix(self) -> sp.csr_array:
        """Of equilibrium along all six ways of all free blocks, scaled."""
        if self.repeats is None or not self._is_whole:
            return self._scaled()
        result: sp.csr_array = self.repeats.shared("matrix", self.model.contacts, self._scaled)
        return result

    def _scaled(self) -> sp.csr_array:
        lift, meaning = self.reduction.forces, self.model.meaning
        forces = meaning if lift is None else lift @ meaning
        matrix = (self.assemblage.statics.matrix @ forces).tocsr()
        matrix.data *= np.repeat(self._down, np.diff(matrix.indptr)) * self._unit[matrix.indices]
        matrix.eliminate_zeros()
        return matrix

    # The same rows under another load

    def dead_alone(self) -> LimitProblem:
        """Which share, at most all, of the dead load alone is carried: these rows, another load."""
        assemblage, scaling = self.assemblage, self.scaling
        alone, goal = assemblage.alone(assemblage.statics.dead), LargestFactor(most=1.0)
        result = LimitProblem(alone, self.surfaces, reduction=self.reduction, goal=goal)
        if alone.scaling.force != scaling.force:
            return result
        result.__dict__["equilibrium"] = self.equilibrium
        dead = self.equilibrium.of_load(self._loads[0])
        before = self.program.under(np.zeros_like(dead), dead)
        at, given = before.zero + before.nonneg, before.matrix
        entries = (
            np.append(given.data, 1.0),
            np.append(given.indices + (given.indices >= at), at),
            np.append(given.indptr[:-1], given.nnz + 1),
        )
        shape = given.shape[0] + 1, given.shape[1]
        result.__dict__["_shared"] = replace(
            before,
            matrix=sp.csc_array(entries, shape),
            right=np.insert(before.right, at, 1.0),
            nonneg=before.nonneg + 1,
        )
        return result
