"""What the contacts of an assemblage can bear, as surfaces and formulation state it: for proofs."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.crushing import recession_of
from cvxlimit.model.flow import FlowRule, Shortfall
from cvxlimit.model.formulations import Formulation, corner_compressions, model_of
from cvxlimit.model.statics import Statics
from cvxlimit.surfaces.base import (
    Condition,
    Recession,
    YieldSurface,
    columns,
    condition_excess,
    has_constants,
    number,
    stated,
)
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import Rocking, strength_key

NOTHING = 1e-300
"""Reserve of a condition without resistance in a state without the forces that it is about: next to
nothing, but inside."""


_HUGE = 1e100
"""Forces and rates beyond this are refused like infinite ones: their products overflow."""


class Flow(Protocol):
    """What is asked of a flow rule: see :class:`FlowRule`, whose methods these are."""

    def shortfall(self, rates: FloatArray) -> Shortfall: ...

    def opened(self, rates: FloatArray) -> Shortfall: ...

    def shortfall_bound(self, rates: FloatArray) -> FloatArray: ...


class ContactFlow(Flow, Protocol):
    """A flow rule of contacts, each for itself."""

    def of(self, rows: IntArray) -> ContactFlow:
        """That of some of them (k,)."""


class Strength:
    """The admissible forces of all contacts of an assemblage, as surfaces and formulation state.

    Forces are checked as *states*: contact forces (n, 6), or, where the formulation has conditions
    of its own, its internal forces (p,), on which those are stated. ``flow`` is the flow rule of
    mechanisms, that of surfaces and formulation where it is None.
    """

    def __init__(
        self,
        assemblage: Assemblage,
        surfaces: Sequence[YieldSurface],
        formulation: Formulation = corner_compressions,
        flow: Flow | None = None,
    ) -> None:
        self.assemblage = assemblage
        self.contacts = assemblage.contacts
        self.formulation = formulation
        own = model_of(formulation, self.contacts)
        self.is_internal = bool(own.conditions)
        is_own = self.is_internal or formulation is corner_compressions
        self.model = own if is_own else corner_compressions(self.contacts)
        # by their places: a part may have the name of a component, which conditions would mean
        self._pressed = np.flatnonzero(self.model.nonneg if self.is_internal else [])
        self.surfaces = (Rocking(), *(s for s in surfaces if s.name != Rocking.name))
        self.flow: Flow = FlowRule(surfaces, self.model) if flow is None else flow

    @cached_property
    def about(self) -> Hashable | None:
        """What it follows from; see :func:`~cvxlimit.surfaces.coulomb.strength_key`."""
        return strength_key(self.surfaces, self.contacts)

    @classmethod
    def shared(
        cls, assemblage: Assemblage, surfaces: Sequence[YieldSurface], formulation: Formulation
    ) -> Strength:
        """Returns what the constructor makes. What follows from contacts and surfaces alone is made
        once for all scenes that have these, where the assemblage keeps anything."""
        own, contacts = partial(cls, assemblage, surfaces, formulation), assemblage.contacts
        if assemblage.repeats is None or formulation is not corner_compressions:
            return own()
        if (about := strength_key(surfaces, contacts)) is None:
            return own()

        def made() -> Strength:
            new = own()
            # so that copies have them
            _ = new.rows, new.rate_sizes, new.is_cone, new._idle, new.about
            return new

        result = copy(assemblage.repeats.shared(("strength", about), contacts, made))
        result.assemblage = assemblage
        return result

    @cached_property
    def balance(self) -> Balance:
        balance = self.assemblage.balance
        if self.is_internal:
            balance = Balance(self.assemblage.statics, self.model)
        free = self._idle[1].ravel()
        if not free.any():
            return balance
        gives = abs(balance.model.resultant_map).T
        return replace(balance, held=(gives @ free > 0.0) & (gives @ ~free == 0.0))

    @cached_property
    def _idle(self) -> tuple[list[BoolArray], BoolArray]:
        """Rows without resistance, condition by condition, and the contact forces (n, 6) that these
        leave none of."""
        voids, unresisted = [], np.zeros((len(self.contacts), len(COMPONENTS)), dtype=bool)
        for condition, _ in self.conditions:
            rows = condition.rows(len(self.contacts))
            sizes = (np.abs(number(k)) for k in condition.resistance.values())
            voids.append((sum(sizes, np.zeros(len(rows))) == 0.0) & bool(condition.norms))
            names = [name for norm in condition.norms for row in norm.rows for name in row]
            for name in COLUMN.keys() & names:
                unresisted[rows[voids[-1]], COLUMN[name]] = True
        return voids, unresisted

    @cached_property
    def conditions(self) -> list[tuple[Condition, Cone]]:
        if self.is_internal:
            return [(c, cone) for _, c, cone in self.model.strength(self.surfaces)]
        return [(c, s.cone) for s in self.surfaces for c in stated(s, self.contacts)]

    @cached_property
    def is_cone(self) -> bool:
        """True if admissible forces may be scaled at will: no condition has a constant."""
        return not any(has_constants(condition) for condition, _ in self.conditions)

    def recession(self) -> tuple[tuple[YieldSurface, ...], Formulation]:
        surfaces = tuple(
            Recession(s) if any(map(has_constants, stated(s, self.contacts))) else s
            for s in self.surfaces
        )
        return surfaces, recession_of(self.formulation)

    def state(self, value: object) -> FloatArray | None:
        shape = (
            (self.model.resultant_map.shape[1],) if self.is_internal else (len(self.contacts), 6)
        )
        return finite(value, shape, "internal force" if self.is_internal else "contact")

    def forces(self, state: FloatArray) -> FloatArray:
        return self.model.forces(state) if self.is_internal else state

    def excess(self, state: FloatArray) -> list[FloatArray]:
        """Yield functions as forces, one array per condition; <= 0 is admissible."""
        values = columns(state) if not self.is_internal else self.model.values(state)
        found = [condition_excess(c, cone, values) for c, cone in self.conditions]
        voids, unresisted = self._idle
        if unresisted.any():
            pairs = zip(found, voids, strict=True)
            found = [np.where(void & (y <= 0.0), -NOTHING, y) for y, void in pairs]
        return [-state[self._pressed], *found] if len(self._pressed) else found

    @cached_property
    def rows(self) -> list[IntArray]:
        found = [condition.rows(len(self.contacts)) for condition, _ in self.conditions]
        return [self.model.contact[self._pressed], *found] if len(self._pressed) else found

    def balancing(self, state: FloatArray, load_factor: float, statics: Statics) -> float:
        """The load factor, near a given one, whose loads the least change of forces balances."""
        balance = self.balance
        if not balance.is_supported:
            return load_factor
        residual = statics.residual(self.forces(state), load_factor).ravel()
        live = statics.live
        if balance.rates is not None:
            residual, live = (np.asarray(balance.rates @ load) for load in (residual, live))
        by_live = balance.solve(live)
        return load_factor - float(by_live @ residual) / float(by_live @ live)

    def balanced(self, state: FloatArray, load_factor: float, statics: Statics) -> FloatArray:
        """The state with the least change that balances the loads of ``statics``."""
        if not self.balance.is_supported:
            return state
        if self.balance.held is not None:
            unresisted = self.balance.held if self.is_internal else self._idle[1]
            state = np.where(unresisted, 0.0, state)
        for _ in range(2):
            residual = statics.residual(self.forces(state), load_factor).ravel()
            change = self.balance.change(residual)
            state = state + (change if self.is_internal else self.balance.model.forces(change))
        return state

    @cached_property
    def rate_sizes(self) -> FloatArray:
        """Weights (n, 6) of slip, opening and rotation rates in each contact's opening. Each
        contact's own: with the largest friction of all, one glued joint would cost every other one
        its precision."""
        mu, contacts = self.contacts.friction, self.contacts
        reach = -contacts.corner_minimum(-np.abs(contacts.corner_xy).max(axis=1))
        return np.stack([mu, mu, np.ones(len(mu)), reach, reach, mu * reach], axis=1)


def finite(value: object, shape: tuple[int, ...], what: str) -> FloatArray | None:
    if value is None:
        return None
    array = np.asarray(value, dtype=float)
    if array.shape != shape:
        raise ModelError(
            f"the scene has {shape[0]} {what}(s), so an array {shape} is needed, "
            f"got shape {array.shape}: does it belong to another scene?"
        )
    return array if np.abs(array).max(initial=0.0) <= _HUGE else None
