"""What a certificate asks of a model: how far forces are beyond yield, which rates are allowed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import ModelError
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.crushing import recession_of
from cvxlimit.model.flow import FlowRule, Shortfall
from cvxlimit.model.formulations import (
    Formulation,
    corner_compressions,
    model_of,
)
from cvxlimit.model.statics import Statics
from cvxlimit.surfaces.base import (
    Condition,
    Recession,
    YieldSurface,
    columns,
    condition_excess,
    has_constants,
    stated,
)
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import Rocking

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_HUGE = 1e100
"""Forces and rates beyond this are refused like infinite ones: their products overflow."""


class Flow(Protocol):
    """What is asked of a flow rule: see :class:`FlowRule`, whose methods these are."""

    def shortfall(self, rates: FloatArray) -> Shortfall:
        """How far rates (n, 6) are from it, sublinear in them."""

    def opened(self, rates: FloatArray) -> Shortfall:
        """The same, with much opening to spare where the rule leaves a choice."""

    def shortfall_bound(self, rates: FloatArray) -> FloatArray:
        """A cheap upper bound (n,) on the missing opening."""


class Strength:
    """The admissible forces of all contacts of an assemblage, as surfaces and formulation state.

    Forces are checked as *states*: contact forces (n, 6), or, where the formulation has conditions
    of its own, its internal forces (p,), on which those are stated. A formulation without own
    conditions only chooses among the forces that surfaces allow, so contact forces say it all.

    Parameters
    ----------
    assemblage : Assemblage
    surfaces : sequence of YieldSurface
    formulation : callable
    flow : Flow or None
        Flow rule of the mechanisms; None is that of surfaces and formulation.
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
        self.model = own if self.is_internal else corner_compressions(self.contacts)
        self.surfaces = (Rocking(), *(s for s in surfaces if s.name != Rocking.name))
        self.flow: Flow = FlowRule(surfaces, self.model) if flow is None else flow

    @cached_property
    def balance(self) -> Balance:
        """What restores equilibrium of states."""
        if not self.is_internal:
            return self.assemblage.balance
        return Balance(self.assemblage.statics, self.model)

    @cached_property
    def conditions(self) -> list[tuple[Condition, Cone]]:
        """What states must satisfy, besides compressions that are not negative."""
        if self.is_internal:
            return [(c, cone) for _, c, cone in self.model.strength(self.surfaces)]
        return [(c, s.cone) for s in self.surfaces for c in stated(s, self.contacts)]

    @cached_property
    def is_cone(self) -> bool:
        """True if admissible forces may be scaled at will: no condition has a constant."""
        return not any(has_constants(condition) for condition, _ in self.conditions)

    def recession(self) -> tuple[tuple[YieldSurface, ...], Formulation]:
        """Surfaces and formulation without their constants."""
        surfaces = tuple(
            Recession(s) if any(map(has_constants, stated(s, self.contacts))) else s
            for s in self.surfaces
        )
        return surfaces, recession_of(self.formulation)

    def state(self, value: object) -> FloatArray | None:
        """``value`` as a state; None if it holds numbers that are not finite, or is None.

        Raises
        ------
        ModelError
            If it has not one row per contact (or entry per internal force).
        """
        shape = (self.model.meaning.shape[1],) if self.is_internal else (len(self.contacts), 6)
        return finite(value, shape, "internal force" if self.is_internal else "contact")

    def forces(self, state: FloatArray) -> FloatArray:
        """Contact forces (n, 6) of a state."""
        return self.model.forces(state) if self.is_internal else state

    def excess(self, state: FloatArray) -> list[FloatArray]:
        """Yield functions as forces, one array per condition; <= 0 is admissible."""
        if not self.is_internal:
            values = columns(state)
            return [condition_excess(c, cone, values) for c, cone in self.conditions]
        values = self.model.values(state)
        found = [condition_excess(c, cone, values) for c, cone in self.conditions]
        return [-state[self.model.nonneg], *found] if self._has_compressions else found

    @cached_property
    def rows(self) -> list[IntArray]:
        """Contact of every entry of :meth:`excess`."""
        each = np.arange(len(self.contacts))
        found = [each if c.contact is None else c.contact for c, _ in self.conditions]
        is_first = self.is_internal and self._has_compressions
        return [self.model.contact[self.model.nonneg], *found] if is_first else found

    @cached_property
    def _has_compressions(self) -> bool:
        return bool(self.model.nonneg.any())

    def balanced(self, state: FloatArray, load_factor: float, statics: Statics) -> FloatArray:
        """The state with the least change that balances the loads of ``statics``."""
        if not self.balance.is_supported:
            return state
        for _ in range(2):
            residual = statics.residual(self.forces(state), load_factor).ravel()
            change = self.balance.change(self.balance.along(residual))
            state = state + (change if self.is_internal else self.balance.model.forces(change))
        return state

    @cached_property
    def rate_sizes(self) -> FloatArray:
        """Weights (n, 6) of slip, opening and rotation rates in each contact's opening.

        Each contact's own: with the largest friction of all, one glued joint would cost every other
        contact its precision.
        """
        mu, contacts = self.contacts.friction, self.contacts
        reach = -contacts.corner_minimum(-np.abs(contacts.corner_xy).max(axis=1))
        return np.stack([mu, mu, np.ones(len(mu)), reach, reach, mu * reach], axis=1)


def finite(value: object, shape: tuple[int, ...], what: str) -> FloatArray | None:
    """``value`` as a float array of ``shape``; None if it is None or not finite.

    Raises
    ------
    ModelError
        If it has not that shape.
    """
    if value is None:
        return None
    array = np.asarray(value, dtype=float)
    if array.shape != shape:
        raise ModelError(
            f"the scene has {shape[0]} {what}(s), so an array {shape} is needed, "
            f"got shape {array.shape}: does it belong to another scene?"
        )
    small = np.abs(array).max(initial=0.0) <= _HUGE
    return array if small else None
