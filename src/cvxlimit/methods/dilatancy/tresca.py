"""Friction held at given compressions: Tresca's law in place of Coulomb's, for any surface.

A condition is one of friction if shear or torsion stand in it. Its resistance is k N plus further
terms, where N is the compression of a contact and k the condition's slope, mu as a rule. Held at
compressions N' the resistance is k N' plus the same terms: it no longer grows with N, so that
joints slide without opening. Everything else about a surface stays associated.

In this folder compressions N' at which friction is held are called ``pressed`` (n,).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.flow import FlowRule, Shortfall
from cvxlimit.model.formulations import ForceModel, Formulation
from cvxlimit.surfaces.base import (
    CONSTANT,
    Condition,
    YieldSurface,
    is_some,
    number,
    product,
)

_SHEARS = ("V1", "V2", "MT", "V")
"""What friction bounds: components, and the shear of planar models."""


def is_friction(condition: Condition) -> bool:
    """Returns True if a condition bounds shear or torsion."""
    return any(is_some(form.get(name, 0.0)) for form in condition.forms() for name in _SHEARS)


def held(condition: Condition, pressed: Any, turned: float = 0.0) -> Condition:
    """Returns a condition with its friction held at compressions ``pressed`` (n,), numbers or a
    Parameter.

    With ``turned`` > 0 the resistance is k N' - turned k N: it falls a little as N grows, as on a
    cone that is turned beyond the vertical.
    """
    slope = condition.resistance.get("N", 0.0)
    if not (is_friction(condition) and is_some(slope)):
        return condition
    rest = {name: k for name, k in condition.resistance.items() if name != "N"}
    at = pressed if condition.contact is None else pressed[condition.contact]
    friction = product(slope, at)
    rest[CONSTANT] = rest[CONSTANT] + friction if CONSTANT in rest else friction
    if turned:
        rest["N"] = product(-turned, slope)
    return replace(condition, resistance=rest)


class Tresca(YieldSurface):
    """A surface that is another one with its friction held at compressions ``pressed`` (n,)."""

    def __init__(self, surface: YieldSurface, pressed: Any, turned: float = 0.0) -> None:
        super().__init__(surface.cone)
        self.surface, self.pressed, self.turned = surface, pressed, turned
        self.name = surface.name  # type: ignore[misc]  # stands for it wherever names are asked
        self.implies = surface.implies  # type: ignore[misc]

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        stated = self.surface.conditions(contacts)
        return [held(condition, self.pressed, self.turned) for condition in stated]


def tresca(
    surfaces: Sequence[YieldSurface], pressed: Any, turned: float = 0.0
) -> tuple[YieldSurface, ...]:
    """Returns surfaces with their friction held; rocking, which has none, stays as it is."""
    return tuple(s if s.name == "rocking" else Tresca(s, pressed, turned) for s in surfaces)


@dataclass(frozen=True, eq=False)
class HeldFormulation:
    """A formulation that is another one, which states friction itself as planar models do, with
    that friction held."""

    formulation: Formulation
    pressed: Any
    turned: float = 0.0

    def __call__(self, contacts: Contacts) -> ForceModel:
        model = self.formulation(contacts)
        stated = [held(condition, self.pressed, self.turned) for condition in model.conditions]
        return replace(model, conditions=stated)


class Slip:
    """The flow rule with friction held, in the internal forces of a model.

    For a mechanism it says which openings joints lack, what power cohesion and strength take up,
    and what opening dilatancy would have added.
    """

    def __init__(self, surfaces: Sequence[YieldSurface], model: ForceModel | Contacts) -> None:
        contacts = model if isinstance(model, Contacts) else model.contacts
        self.flow = FlowRule(tresca(surfaces, np.zeros(len(contacts))), model)
        # Of each row of the flow rule: the slope k, zero without friction, and the contact.
        slopes, at = [np.zeros(0)], [np.zeros(0, dtype=np.int64)]
        for _, condition, _ in self.flow.model.strength(surfaces):
            row = condition.rows(len(contacts))
            slope = number(condition.resistance.get("N", 0.0)) if is_friction(condition) else 0.0
            slopes.append(np.broadcast_to(slope, len(row)))
            at.append(row)
        self._slope, self._contact = np.concatenate(slopes), np.concatenate(at)

    def of(self, rates: FloatArray) -> Shortfall:
        """Returns the openings that relative rates (n, 6) lack, and what cohesion and strength take
        up of their power. The columns are rates along t1, t2 and n, and turns about t1, t2 and
        n, in the order of :data:`COMPONENTS`."""
        return self.flow.shortfall(rates)

    def dilatancy(self, shortfall: Shortfall) -> FloatArray:
        """Returns the opening (n,) that associated friction would add at each contact. Times the
        compression it is the power that friction takes up."""
        each = self._slope * shortfall.multipliers
        return np.asarray(np.bincount(self._contact, each, len(self.flow.model.contacts)), float)
