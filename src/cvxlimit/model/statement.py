"""The words in which a limit problem is stated to any sink: what it maximises, its goal, and what
contacts bear, its conditions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import express, times
from cvxlimit.model.sinks import Constraints, Rows
from cvxlimit.surfaces.base import Condition, number
from cvxlimit.surfaces.cones import Cone, Sink


@dataclass(frozen=True, eq=False)
class Borne:
    """A condition that has been stated: its norms in the order in which they were, each with what
    its cone returned; ``rest`` is that of the resistance, None where a norm takes all of it."""

    condition: Condition
    cone: Cone
    norms: Sequence[tuple[int, tuple[list[Any], list[Any]]]]
    rest: Any

    def flow(self, duals: Mapping[Any, FloatArray]) -> tuple[FloatArray, list[FloatArray]]:
        """The multipliers and flows (:data:`~cvxlimit.solvers.running.Flows`) that duals are."""
        flows = list[Sequence[FloatArray]]([()] * len(self.condition.norms))
        bound = None if self.rest is None else duals[self.rest][0]
        for which, stated in self.norms:
            norm = self.condition.norms[which]
            every = np.concatenate([duals[at] for at in chain(*stated)])
            last, *rows = self.cone.flow(len(norm.rows), every)
            weight = np.broadcast_to(np.asarray(number(norm.weight), dtype=float), last.shape)
            some = weight > 0.0
            flows[which] = [np.where(some, row, 0.0) / np.where(some, weight, 1.0) for row in rows]
            bound = last if bound is None else bound
        assert bound is not None
        return bound, list(chain(*flows))


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
    borne : list of (str, Borne)
        The conditions by the names of their surfaces, where duals of them are flows.
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
    borne: list[tuple[str, Borne]] = field(default_factory=list)

    def flows(
        self, duals: Callable[[], Mapping[Any, FloatArray]]
    ) -> dict[str, list[tuple[FloatArray, list[FloatArray]]]]:
        """What duals of strength are in rates, by the names of surfaces."""
        found, result = duals(), dict[str, list[tuple[FloatArray, list[FloatArray]]]]()
        for name, borne in self.borne:
            result.setdefault(name, []).append(borne.flow(found))
        return result


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


def admissible(into: Sink, condition: Condition, forces: Mapping[str, Any], cone: Cone) -> Borne:
    """States a condition on force components (n,), which are forms of the sink.

    ``forces`` also holds a :data:`CONSTANT`: the unit in which the components are. Each norm gets
    an auxiliary bound, which is taken off the resistance, except a last one without a weight: its
    bound is the rest of the resistance.
    """
    contact = condition.contact
    remaining = express(condition.resistance, forces, contact)
    norms = sorted(enumerate(condition.norms), key=lambda n: (n[1].is_plain, len(n[1].rows)))
    last = norms.pop() if norms and norms[-1][1].is_plain else None
    stated = []
    for which, norm in norms:
        rows = [express(form, forces, contact) for form in norm.rows]
        bound = into.new(rows[0].size)
        stated.append((which, cone.epigraph(into, bound, rows)))
        remaining = remaining - times(norm.weight, bound)
    if last is None:
        return Borne(condition, cone, stated, into.nonneg(remaining))
    which, norm = last
    rows = [express(form, forces, contact) for form in norm.rows]
    stated.append((which, cone.epigraph(into, remaining, rows)))
    return Borne(condition, cone, stated, None)
