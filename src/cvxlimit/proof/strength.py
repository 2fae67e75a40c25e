"""What all contacts together can bear: their admissible forces, and the flow rule that is dual.

*Admissible forces.* Every condition of a yield surface reads norm(G x) <= h . x + c for the forces
x of a contact. Its yield function y(x) = norm(G x) - h . x - c, a force, is at most 0 where x is
admissible (:meth:`Strength.excess`). Proofs need to know one thing of it, that it is convex: a
mixture (1 - t) x + t x' exceeds no condition by more than (1 - t) y(x) + t y(x').

*Flow rule.* Admissible forces do no less than -D(v) of work on the relative rates v of a contact,
where D(v) is the most that they can take up. It is finite where v opens the contact enough for its
slip, by friction times that for Coulomb's; what is missing of that opening, what it dissipates and
what slips are resisted by nothing is the :class:`~cvxlimit.proof.flow.Shortfall` of ``flow``.

*Equilibrium.* States are put into equilibrium by the least change of compressions at corners, shear
and torsion (:meth:`Strength.balanced`). Forces that nothing resists, as the shear of a contact
without friction, must be zero: they are held there, and a state without them counts as strictly
inside by :data:`NOTHING`, since no other one is nearer to the inside.

Contact forces are arrays (n, 6) in the columns V1 V2 N M1 M2 MT of ``COMPONENTS``, N > 0 in
compression; relative rates (n, 6) are conjugate to them column by column.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Protocol

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.crushing import (
    EffectiveRectangles,
    formulation_of,
    is_weak,
    model_of,
    recession_of,
)
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.statics import SMALLEST, Statics
from cvxlimit.proof.flow import FlowRule, Shortfall
from cvxlimit.solvers.running import Flows
from cvxlimit.surfaces.base import (
    Condition,
    Recession,
    YieldSurface,
    columns,
    conditions_of,
    excesses,
    has_constants,
    stated,
)
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import Rocking, strength_key, with_bounds

NOTHING = 1e-300
"""Reserve of a condition that has no resistance, in a state without the forces that it limits: the
least number but one of rounding, so that it is inside and lends nothing to a mixture."""


class Flow(Protocol):
    """The methods that proofs need of a flow rule; :class:`FlowRule` describes them. One that
    leaves no choice has no use for ``duals``."""

    def shortfall(self, rates: FloatArray, duals: Flows | None = None) -> Shortfall: ...

    def opened(self, rates: FloatArray) -> Shortfall: ...

    def shortfall_bound(self, rates: FloatArray) -> FloatArray: ...


class ContactFlow(Flow, Protocol):
    """A flow rule that is stated for each contact by itself."""

    def of(self, rows: IntArray) -> ContactFlow:
        """Returns the flow rule of some contacts (k,) only."""


class Strength:
    """The admissible forces of all contacts of an assemblage, from its surfaces and formulation.

    Forces are checked as *states*: contact forces (n, 6), or, where the formulation has conditions
    of its own (``is_internal``), its internal forces (p,), on which those are stated. ``flow`` is
    the flow rule of mechanisms; None means that of surfaces and formulation.
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
        # rectangles that crush have closed forms; what else crushes has forces of its own
        is_plain = formulation is corner_compressions
        crushes = is_plain and is_weak(self.contacts).any()
        self.crushing = EffectiveRectangles.of(self.contacts) if crushes else None
        if self.crushing is None:
            model = model_of(formulation, self.contacts, assemblage.corners)
        else:
            model = corner_compressions(self.contacts)
        self.is_internal = bool(model.conditions)
        self.model = model if self.is_internal or is_plain else corner_compressions(self.contacts)
        # Compressions among internal forces, by place: a part of a formulation may have the name of
        # a force component, so that a condition by name would mean the wrong one.
        self._pressed = np.flatnonzero(self.model.nonneg if self.is_internal else [])
        self._points = np.flatnonzero(self.contacts.is_point)
        others = [s for s in surfaces if s.name != Rocking.name]
        self.surfaces = with_bounds((Rocking(), *others), self.contacts)
        self.flow: Flow = FlowRule(surfaces, self.model) if flow is None else flow
        self._idle = np.array([], dtype=int)

    def of(self, part: Assemblage, contacts: IntArray) -> Strength:
        """Returns the strength of a part of the assemblage, with these ``contacts`` (k,) of it."""
        return Strength(part, self.surfaces, formulation_of(self.formulation, contacts))

    # Admissible forces

    @cached_property
    def conditions(self) -> list[tuple[Condition, Cone]]:
        """All conditions on states, each with the cone that bounds its norms."""
        if self.is_internal:
            return [(c, cone) for _, c, cone in self.model.all_conditions(self.surfaces)]
        return [(c, s.cone) for s, c in conditions_of(self.surfaces, self.contacts)]

    @cached_property
    def is_cone(self) -> bool:
        """True if no condition has a constant: any multiple of admissible forces is admissible."""
        conditions = [condition for condition, _ in self.conditions]
        return self.crushing is None and not has_constants(conditions)

    def recession(self) -> tuple[tuple[YieldSurface, ...], Formulation]:
        """Returns surfaces and formulation without their constants: their admissible forces are the
        directions in which those of this strength may grow without end."""
        surfaces = tuple(
            Recession(s) if has_constants(stated(s, self.contacts)) else s for s in self.surfaces
        )
        return surfaces, recession_of(self.formulation)

    def state(self, value: object) -> FloatArray | None:
        """Returns ``value`` as the array of a state; None for None and for numbers not finite."""
        shape = (self.model.resultant_map.shape[1],) if self.is_internal else (self.model.count, 6)
        return finite(value, shape, "internal force" if self.is_internal else "contact")

    def forces(self, state: FloatArray) -> FloatArray:
        """Returns the contact forces (n, 6) of a state."""
        return self.model.forces(state) if self.is_internal else state

    def excess(self, state: FloatArray) -> FloatArray:
        """Returns the yield functions y (k,) of a state, as forces, condition by condition; y <= 0
        is admissible."""
        values = columns(state) if not self.is_internal else self.model.values(state)
        excess = np.concatenate([np.zeros(0), *excesses(self.conditions, values)])
        rows_without, unresisted = self._unresisted
        if unresisted.any():  # a state without these forces is inside
            is_zero = np.concatenate([np.zeros(0, bool), *rows_without])
            excess = np.where(is_zero & (excess <= 0.0), -NOTHING, excess)
        parts = [-state[self._pressed].ravel(), excess]
        if len(self._points) and not self.is_internal:  # they bear nothing but compression
            others = np.delete(state[self._points], COLUMN["N"], axis=1)
            beyond = np.abs(others).max(axis=1)
            parts.append(np.where(beyond == 0.0, -NOTHING, beyond))
        if self.crushing is not None:
            parts.append(self.crushing.excess(state))
        return np.concatenate(parts)

    @cached_property
    def rows(self) -> IntArray:
        """The contact (k,) of every entry of :meth:`excess`."""
        rows = [condition.rows(self.model.count) for condition, _ in self.conditions]
        none = np.zeros(0, int)
        points = none if self.is_internal else self._points
        crushing = none if self.crushing is None else self.crushing.rows
        return np.concatenate([self.model.contact[self._pressed], *rows, points, crushing])

    @cached_property
    def _unresisted(self) -> tuple[list[BoolArray], BoolArray]:
        """The rows whose resistance is zero, condition by condition, and the contact forces (n, 6)
        that must therefore be zero, as shear of a contact without friction."""
        rows_without = [condition.unresisted(self.model.count) for condition, _ in self.conditions]
        unresisted = np.zeros((self.model.count, len(COMPONENTS)), dtype=bool)
        for (condition, _), is_zero in zip(self.conditions, rows_without, strict=True):
            at = np.arange(self.model.count) if condition.contact is None else condition.contact
            names = [name for norm in condition.norms for row in norm.rows for name in row]
            for name in COLUMN.keys() & names:
                unresisted[at[is_zero], COLUMN[name]] = True
        unresisted[self._points, :] = True
        unresisted[:, COLUMN["N"]] = False
        unresisted[self._idle, :] = True
        return rows_without, unresisted

    # Equilibrium

    @cached_property
    def balance(self) -> Balance:
        """The equilibrium of states, with internal forces held at zero that nothing resists."""
        balance = self.assemblage.balance
        if self.is_internal:
            balance = Balance(self.assemblage.statics, self.model)
        unresisted = self._unresisted[1].ravel()
        if not unresisted.any():
            return balance
        gives = abs(balance.model.resultant_map).T
        held = (gives @ unresisted > 0.0) & (gives @ ~unresisted == 0.0)
        return replace(balance, held=held) if held.any() else balance

    def balancing(self, state: FloatArray, load_factor: float, statics: Statics) -> float:
        """Returns the load factor near ``load_factor`` whose loads need the least change of a state
        to be balanced."""
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
        """Returns the state with the least change that balances the loads of ``statics`` at a load
        factor; the state itself where some blocks have no support."""
        balance, is_internal = self.balance, self.is_internal
        if balance.held is not None and balance.is_supported:
            unresisted = balance.held if is_internal else self._unresisted[1]
            state = np.where(unresisted, 0.0, state)
        return balance.balanced(state, load_factor, statics, is_internal)

    @cached_property
    def rate_sizes(self) -> FloatArray:
        """Weights (n, 6) of relative rates in the opening of a contact, by which rounding is
        measured: friction for slips, 1 for opening, the contact's reach for rotations. Each contact
        has its own: with the largest friction of all, one glued joint would make the rounding of
        every other one large."""
        mu, contacts = self.contacts.friction, self.contacts
        reach = -contacts.corner_minimum(-np.abs(contacts.corner_xy).max(axis=1))
        return np.stack([mu, mu, np.ones(len(mu)), reach, reach, mu * reach], axis=1)

    # The same strength of another scene, or of fewer contacts

    def without(self, contacts: IntArray) -> Strength:
        """Returns this strength, whose states are balanced without the forces of some contacts
        (k,): a part of what it admits."""
        result = copy(self)
        result._idle = contacts
        for name in ("_unresisted", "balance"):
            vars(result).pop(name, None)
        return result

    @classmethod
    def shared(
        cls, assemblage: Assemblage, surfaces: Sequence[YieldSurface], formulation: Formulation
    ) -> Strength:
        """Returns the strength that the constructor makes; what follows from contacts and surfaces
        alone is that of the last scene of this geometry, if its strengths were the same."""
        contacts = assemblage.contacts
        about = strength_key(surfaces, contacts) if formulation is corner_compressions else None
        last = assemblage.strengths.get(about)
        if last is None or not contacts.is_in_place_of(last.contacts):
            last = cls(assemblage, surfaces, formulation)
            if about is None:
                return last
            # cached properties are computed here, so that copies have them
            _ = last.rows, last.rate_sizes, last.is_cone, last._unresisted
            assemblage.strengths.clear()
            assemblage.strengths[about] = last
        result = copy(last)
        result.assemblage = assemblage
        return result


def finite(value: object, shape: tuple[int, ...], what: str) -> FloatArray | None:
    """Returns ``value`` as an array of this shape, None for None and for numbers not finite; raises
    ModelError for another shape. ``what`` names a row in the message."""
    if value is None:
        return None
    array = np.asarray(value, dtype=float)
    if array.shape != shape:
        raise ModelError(
            f"the scene has {shape[0]} {what}(s), so an array {shape} is needed, "
            f"got shape {array.shape}: does it belong to another scene?"
        )
    # products of larger ones overflow, as squares of the smallest loads underflow
    return array if np.abs(array).max(initial=0.0) <= 1.0 / SMALLEST else None
