"""Friction held at given compressions: Tresca's law in place of Coulomb's, for any surface.

A condition is one of friction if shear or torsion stand in it. Its resistance is k N plus further
terms, where N is the compression of a contact and k the condition's slope, mu as a rule. Held at
compressions N' the resistance is k N' plus the same terms: it no longer grows with N, so that
joints slide without opening. Everything else about a surface stays associated.

======  ====================================================  ======  =============================
letter  what it is                                            shape   in the code
======  ====================================================  ======  =============================
N'      compressions at which friction is held                (n,)    ``pressed`` in this folder
k       slope of a condition, for each of its m rows          (m,)    ``slope``, ``resistance["N"]``
tilt    share of the slope with which resistance falls as N   number  ``tilt``
        grows: Gilbert's eta for cones that are rotated
        beyond the vertical, 0 for Tresca's law
======  ====================================================  ======  =============================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.formulations import ForceModel, Formulation
from cvxlimit.proof.flow import FlowRule, Shortfall
from cvxlimit.surfaces.base import (
    CONSTANT,
    Condition,
    YieldSurface,
    is_some,
    number,
    product,
)
from cvxlimit.surfaces.coulomb import Bounds, Rocking

Compressions: TypeAlias = "FloatArray | cp.Parameter"
"""Those at which friction is held (n,): numbers, or a Parameter where they change between solves,
so that the problem is stated once."""

_SHEARS = ("V1", "V2", "MT", "V")
"""What friction bounds: components, and the shear of planar models."""


def is_friction(condition: Condition) -> bool:
    """Returns True if a condition bounds shear or torsion."""
    return any(is_some(form.get(name, 0.0)) for form in condition.forms() for name in _SHEARS)


def held(condition: Condition, pressed: Compressions, tilt: float = 0.0) -> Condition:
    """Returns a condition with its friction held at compressions ``pressed`` (n,); the condition
    itself where it is not one of friction, or does not depend on N.

    The resistance is k N' - tilt k N plus the same further terms.
    """
    slope = condition.resistance.get("N", 0.0)
    if not (is_friction(condition) and is_some(slope)):
        return condition
    rest = {name: k for name, k in condition.resistance.items() if name != "N"}
    at = pressed if condition.contact is None else pressed[condition.contact]
    friction = product(slope, at)
    rest[CONSTANT] = rest[CONSTANT] + friction if CONSTANT in rest else friction
    if tilt:
        rest["N"] = product(-tilt, slope)
    return replace(condition, resistance=rest)


class Tresca(YieldSurface):
    """A surface that is another one with its friction held at compressions ``pressed`` (n,), as
    :func:`held` does with each condition."""

    def __init__(self, surface: YieldSurface, pressed: Compressions, tilt: float = 0.0) -> None:
        super().__init__(surface.cone)
        self.surface, self.pressed, self.tilt = surface, pressed, tilt
        self.name = surface.name  # type: ignore[misc]  # stands for it wherever names are asked
        self.implies = surface.implies  # type: ignore[misc]

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        stated = self.surface.conditions(contacts)
        return [held(condition, self.pressed, self.tilt) for condition in stated]


def tresca(
    surfaces: Sequence[YieldSurface], pressed: Compressions, tilt: float = 0.0
) -> tuple[YieldSurface, ...]:
    """Returns surfaces with their friction held. Rocking, and the bounds of reactions, have none:
    they stay the very same surfaces."""
    without = (Rocking.name, Bounds.name)
    return tuple(s if s.name in without else Tresca(s, pressed, tilt) for s in surfaces)


@dataclass(frozen=True, eq=False)
class HeldFormulation:
    """Wraps a formulation that has friction conditions of its own (the planar one has), and holds
    these; whatever else it states stays."""

    formulation: Formulation
    pressed: Compressions
    tilt: float

    @property
    def sees_to_strength(self) -> bool:
        """As of the formulation."""
        return bool(getattr(self.formulation, "sees_to_strength", False))

    def __call__(self, contacts: Contacts) -> ForceModel:
        model = self.formulation(contacts)
        conditions = [held(condition, self.pressed, self.tilt) for condition in model.conditions]
        return replace(model, conditions=conditions)


class HeldFlow:
    """The flow rule with friction held, in the internal forces of a model.

    For a mechanism it says which openings joints lack, what power cohesion and strength take up,
    and what opening dilatancy would have added. Here friction is held at N' = 0, where it takes up
    no power; what it takes up at other compressions is these times :meth:`dilatancy`.
    """

    def __init__(self, surfaces: Sequence[YieldSurface], model: ForceModel | Contacts) -> None:
        contacts = model if isinstance(model, Contacts) else model.contacts
        self.flow = FlowRule(tresca(surfaces, np.zeros(len(contacts))), model)
        # Of each row of resistance: the slope k before it was held, zero without friction, and the
        # contact. Holding changes no rows, so those of the flow rule come in the same order.
        slopes, at = [np.zeros(0)], [np.zeros(0, dtype=np.int64)]
        for _, condition, _ in self.flow.model.all_conditions(surfaces):
            rows = condition.rows(len(contacts))
            slope = number(condition.resistance.get("N", 0.0)) if is_friction(condition) else 0.0
            slopes.append(np.broadcast_to(slope, len(rows)))
            at.append(rows)
        self._slope, self._contact = np.concatenate(slopes), np.concatenate(at)

    def shortfall(self, rates: FloatArray) -> Shortfall:
        """Returns the openings that relative rates (n, 6) lack, and what cohesion and strength take
        up of their power. The columns are rates along t1, t2 and n, and turns about t1, t2 and
        n, in the order of :data:`COMPONENTS`."""
        return self.flow.shortfall(rates)

    def dilatancy(self, shortfall: Shortfall) -> FloatArray:
        """Returns the opening (n,) that associated friction would add at each contact: k times the
        multiplier, summed over its rows. Times the compression it is the power that friction takes
        up."""
        each = self._slope * shortfall.multipliers
        return np.asarray(np.bincount(self._contact, each, len(self.flow.model.contacts)), float)
