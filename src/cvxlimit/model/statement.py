"""The limit problem (Eq. 39), stated once to any sink: strength, loads and equilibrium, scaled; and
what it may maximise, its goal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from cvxlimit.errors import ModelError
from cvxlimit.model.assemblage import Assemblage, Equilibrium, Reduction
from cvxlimit.model.formulations import Formulation, corner_compressions, express, model_of, times
from cvxlimit.model.given import Given
from cvxlimit.model.sinks import Constraints, Rows, stacked
from cvxlimit.model.statics import DOF
from cvxlimit.surfaces.base import Condition, LinearForm, YieldSurface, product
from cvxlimit.surfaces.cones import Cone, Sink
from cvxlimit.surfaces.coulomb import needed_surfaces, with_bounds


@dataclass(eq=False)
class Stated:
    """A limit problem on its way into a sink, for goals: all in forms of that sink, scaled.

    Attributes
    ----------
    assemblage : Assemblage
    into : Sink
        Takes unknowns and limits of the goal's own.
    forces : dict of component or part to form (n,)
        Over the unit of force; :data:`CONSTANT` is the user's unit over it.
    internal : sequence of form
        The forces of the formulation's parts, over the units of force and length.
    factor : form
        The load factor.
    dead, live : array or form (6 free blocks,)
        The load that forces balance is ``dead + factor * live``; a goal may put others.
    own : mapping of str to form
        Unknowns of the goal's own whose values are asked for.
    before : int
        Equations stated before those of equilibrium, in rows.
    """

    assemblage: Assemblage
    into: Constraints | Rows
    forces: dict[str, Any]
    internal: Sequence[Any]
    factor: Any
    dead: Any
    live: Any
    own: dict[str, Any] = field(default_factory=dict)
    before: int = 0


Goal = Callable[[Stated], Any]
"""What a problem maximises: a form, with limits of its own stated on the way. With an attribute
``is_quadratic`` it is an expression of CVXPY's alone, and such problems have no rows."""


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


def admissible(into: Sink, condition: Condition, forces: Mapping[str, Any], cone: Cone) -> None:
    """States a condition on force components (n,), which are forms of the sink.

    ``forces`` also holds a :data:`CONSTANT`: the unit in which the components are. Each norm gets
    an auxiliary bound, which is taken off the resistance, except a last one without a weight: its
    bound is the rest of the resistance.
    """
    contact = condition.contact
    remaining = express(condition.resistance, forces, contact)
    norms = sorted(condition.norms, key=lambda norm: (norm.is_plain, len(norm.rows)))
    last = norms.pop() if norms and norms[-1].is_plain else None
    for norm in norms:
        rows = [express(form, forces, contact) for form in norm.rows]
        bound = into.new(rows[0].size)
        cone.epigraph(into, bound, rows)
        remaining = remaining - times(norm.weight, bound)
    if last is None:
        into.nonneg(remaining)
    else:
        cone.epigraph(into, remaining, [express(form, forces, contact) for form in last.rows])


class Statement:
    """What a limit problem says; see :class:`~cvxlimit.model.program.LimitProgram`."""

    def __init__(
        self,
        given: Given,
        surfaces: Sequence[YieldSurface],
        formulation: Formulation,
        reduction: Reduction | None,
        goal: Goal,
    ) -> None:
        self.given, self.assemblage = given, given.assemblage
        self.surfaces = with_bounds(needed_surfaces(surfaces), given.contacts)
        self.formulation = formulation
        if reduction is not None and given.is_symbolic:
            raise ModelError("a problem with Parameters has no smaller model: leave reduction out")
        if reduction is None:
            whole = Reduction.none(self.assemblage.statics, formulation)
            reduction = replace(whole, contacts=given.contacts)
        self.reduction = reduction
        self.goal, self.scaling = goal, self.assemblage.scaling
        self.model = model_of(reduction.formulation, reduction.contacts, self.assemblage.corners)
        # units of internal forces, and one over those of equilibrium's rows: moments by the length
        self._unit = np.where(self.model.is_moment, self.scaling.length, 1.0)
        down = np.repeat([1.0, 1.0 / self.scaling.length], 3)
        self._down = np.tile(down, len(self.assemblage.statics.dead) // DOF)

    def stated(self, into: Constraints | Rows) -> tuple[Stated, Any]:
        """The problem, stated to a sink, and its goal."""
        scaling, (components, written) = self.scaling, self._written
        into.label = "rocking" if "rocking" in self.model.implied else "compression"
        forces, internal = self.model.unknowns(into, scaling.force, scaling.length, components)
        for name, condition, cone in written:
            into.label = name
            admissible(into, condition, forces, cone)
        into.label = "goal"
        factor = into.new(name="alpha")
        stated = Stated(self.assemblage, into, forces, internal, factor, *self.loads)
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
    def _written(self) -> tuple[dict[str, LinearForm], list[tuple[str, Condition, Cone]]]:
        """What unknowns of surfaces' own give, and the conditions to write."""
        model, plain, components = self.model, list[YieldSurface](), dict[str, LinearForm]()
        written = list[tuple[str, Condition, Cone]]()
        for surface in self.surfaces:
            own = surface.unknowns(model.contacts)
            if own is None or not own.components.keys() <= model.start.keys() - components.keys():
                plain.append(surface)
            else:
                if len(faces := model.contacts.faces) < model.count:
                    own = own.on_faces(faces)
                components |= own.components
                written += [(surface.name, condition, surface.cone) for condition in own.conditions]
        return components, [*model.strength(plain), *written]

    @cached_property
    def _in_cvxpy(self) -> tuple[Stated, Any]:
        return self.stated(Constraints())

    @property
    def constraints(self) -> dict[str, list[cp.Constraint]]:
        """Those of :attr:`problem` by label: surfaces, ``"formulation"``, ``"equilibrium"``."""
        into = self._in_cvxpy[0].into
        assert isinstance(into, Constraints)
        return into.named

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """Scaled, of the internal forces."""
        sizes = [  # of loads, one where they are open
            np.ones(load.size) if isinstance(load, cp.Expression) else np.abs(load)
            for load in self.loads
        ]
        return Equilibrium.of(self._matrix(), np.stack(sizes), self.scaling, self.reduction.rates)

    @cached_property
    def loads(self) -> tuple[Any, Any]:
        """Scaled dead and live load (6 free blocks,), numbers or CVXPY expressions."""
        dead = product(self._down / self.scaling.force, self.given.dead)
        return dead, product(self._down / self.scaling.live, self.given.live)

    @cached_property
    def _is_whole(self) -> bool:
        """True if unknown are the corner compressions of all contacts: equilibrium is then the same
        for all scenes of one geometry."""
        is_plain = self.reduction.formulation is corner_compressions and not self.model.conditions
        return is_plain and not self.reduction.names

    def _matrix(self) -> sp.csr_array:
        """The matrix of equilibrium along all six ways of all free blocks, scaled."""
        lift, resultant_map = self.reduction.forces, self.model.resultant_map
        if self._is_whole and self.assemblage.corners is not None:
            matrix = self.assemblage.balance.matrix.copy()
        else:
            forces = resultant_map if lift is None else lift @ resultant_map
            matrix = (self.assemblage.statics.matrix @ forces).tocsr()
        matrix.data *= np.repeat(self._down, np.diff(matrix.indptr)) * self._unit[matrix.indices]
        matrix.eliminate_zeros()
        return matrix
