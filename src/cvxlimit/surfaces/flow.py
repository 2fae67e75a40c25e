"""The associated flow rule (Eq. 33-36): which relative rates a set of surfaces allows.

Rates q are allowed when they are, at every contact,

    q = sum over conditions of (resistance lambda - sum of B^T y) + opening,
    polar_gauge(y) <= lambda,   opening >= 0 at every corner of the contact,

which is the dual cone of the admissible forces. How far rates are from that is measured by
their *shortfall*: the extra opening, uniform over the contact, that would make them allowed.
Forces on a contact then do at least -shortfall * N of work on such rates.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.surfaces.base import (
    Coefficient,
    Condition,
    LinearForm,
    YieldSurface,
    number,
    times,
)
from cvxlimit.surfaces.cones import Cone

FloatArray = NDArray[np.float64]
Rates = Mapping[str, cp.Expression]

TANGENTIAL = ("V1", "V2", "MT")
_TANGENTIAL_COLUMNS = [COLUMN[c] for c in TANGENTIAL]


def corner_openings(rates: FloatArray, contacts: Contacts) -> FloatArray:
    """Opening rate (m,) at every corner, for rates (n, 6): the power of a unit compression."""
    j = contacts.corner_contact
    x, y = contacts.corner_xy.T
    normal, about_1, about_2 = (rates[j, COLUMN[c]] for c in ("N", "M1", "M2"))
    result: FloatArray = normal + y * about_1 - x * about_2
    return result


@dataclass(frozen=True, eq=False)
class _Flow:
    """Symbolic flow of one condition: multiplier lambda, one y per norm row, and their limits."""

    condition: Condition
    cone: Cone
    multiplier: cp.Variable
    parts: list[list[cp.Variable]]
    limits: list[cp.Constraint]

    @classmethod
    def of(cls, condition: Condition, cone: Cone, contacts: int) -> _Flow:
        rows = contacts if condition.contact is None else len(condition.contact)
        multiplier = cp.Variable(rows, nonneg=True)
        parts = [[cp.Variable(rows) for _ in norm.rows] for norm in condition.norms]
        limits = [limit for part in parts for limit in cone.polar_epigraph(multiplier, part)]
        return cls(condition, cone, multiplier, parts, limits)

    def forms(self) -> list[tuple[LinearForm, cp.Variable, float]]:
        """Linear forms with the variable that multiplies each, and its sign."""
        pairs = [(self.condition.resistance, self.multiplier, 1.0)]
        for norm, part in zip(self.condition.norms, self.parts, strict=True):
            pairs += [(form, y, -1.0) for form, y in zip(norm.weighted_rows, part, strict=True)]
        return pairs

    def plastic_rates(self, component: str, contacts: int) -> cp.Expression | None:
        """This condition's share of one rate component (n,), None if it has none."""
        spread = _spread(self.condition, contacts)
        terms = [
            spread(form[component], sign, variable)
            for form, variable, sign in self.forms()
            if component in form
        ]
        return sum(terms[1:], start=terms[0]) if terms else None


class FlowRule:
    """The flow rule of several surfaces on given contacts; rocking is always part of it."""

    def __init__(self, surfaces: Sequence[YieldSurface], contacts: Contacts) -> None:
        self.contacts = contacts
        self._conditions = [
            (condition, surface.cone)
            for surface in surfaces
            if surface.name != "rocking"
            for condition in surface.conditions(contacts)
        ]

    def constraints(self, rates: Rates, openings: cp.Expression) -> list[cp.Constraint]:
        """For CVXPY: ``rates`` by component (n,) and ``openings`` at the corners (m,)."""
        flows = self._flows()
        rest, openings = self._rest(flows, rates, openings)
        return [
            *(c for flow in flows for c in flow.limits),
            *(rest[c] == 0 for c in TANGENTIAL),
            openings >= 0,
        ]

    def shortfall(self, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Missing opening (n,) of rates (n, 6), negative where some is to spare; and leftovers.

        Leftovers (n, 3) are rates along V1, V2, MT that no surface resists. The shortfall is
        exact when the surfaces determine the flow uniquely, and otherwise an upper bound, from
        the best decomposition found.
        """
        return self._shortfall(rates, *self._proposal(rates))

    def shortfall_bound(self, rates: FloatArray) -> FloatArray:
        """An upper bound (n,) on the shortfall that costs no optimisation: least-norm flows."""
        flows = np.zeros((len(self.contacts), self._stacked.shape[1]))
        missing, leftover = self._shortfall(rates, flows, np.zeros_like(rates))
        resisted = np.abs(leftover).max(axis=1) <= 1e-12 * np.abs(rates).max()
        return np.where(resisted, missing, np.inf)

    def _shortfall(
        self, rates: FloatArray, flows: FloatArray, linear: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Complete proposed flows to exact ones with the least change, and measure them."""
        stack = self._stacked
        rates = rates - linear
        target = -rates[:, _TANGENTIAL_COLUMNS]
        missing = target - np.einsum("nrc,nr->nc", stack, flows)
        flows = flows + np.einsum("nrc,nc->nr", self._inverse, missing)
        leftover = target - np.einsum("nrc,nr->nc", stack, flows)
        opening = corner_openings(rates - self._plastic(flows), self.contacts)
        return -self.contacts.corner_minimum(opening), leftover

    @cached_property
    def _stacked(self) -> FloatArray:
        """Tangential coefficients of all norm rows, (n, rows, 3)."""
        rows = [self._row(form)[:, _TANGENTIAL_COLUMNS] for form in self._norm_forms()]
        return np.stack(rows, axis=1) if rows else np.zeros((len(self.contacts), 0, 3))

    @cached_property
    def _inverse(self) -> FloatArray:
        """Least-norm solution (n, rows, 3) of stack^T y = rates."""
        if not self._stacked.shape[1]:
            return np.zeros_like(self._stacked)
        return np.asarray(np.linalg.pinv(np.swapaxes(self._stacked, 1, 2)), dtype=np.float64)

    @cached_property
    def _is_unique(self) -> bool:
        linear = any(not condition.norms for condition, _ in self._conditions)
        return not linear and self._stacked.shape[1] <= len(TANGENTIAL)

    def _norm_forms(self) -> list[LinearForm]:
        return [
            f for condition, _ in self._conditions for n in condition.norms for f in n.weighted_rows
        ]

    def _row(self, form: LinearForm) -> FloatArray:
        """Coefficients (n, 6) of a linear form with one row per contact."""
        row = np.zeros((len(self.contacts), len(COMPONENTS)))
        for component, coefficient in form.items():
            row[:, COLUMN[component]] = number(coefficient)
        return row

    def _plastic(self, flows: FloatArray) -> FloatArray:
        """Rates (n, 6) of flows (n, rows) with the least multipliers that allow them."""
        result = np.zeros((len(self.contacts), len(COMPONENTS)))
        at = 0
        for condition, cone in self._conditions:
            multiplier = np.zeros(len(self.contacts))
            for norm in condition.norms:
                part = [flows[:, at + i] for i in range(len(norm.rows))]
                at += len(norm.rows)
                multiplier = np.maximum(multiplier, cone.polar_gauge(part))
                for form, flow in zip(norm.weighted_rows, part, strict=True):
                    result -= self._row(form) * flow[:, None]
            if condition.norms:
                result += self._row(condition.resistance) * multiplier[:, None]
        return result

    def _proposal(self, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Flows (n, rows) with the least shortfall where the surfaces leave a choice, else zero;
        and the rates (n, 6) of conditions without norms, with multipliers >= 0.

        One small conic problem without coupling between contacts; what comes back is only a
        proposal, which :meth:`shortfall` makes exact and measures.
        """
        none = np.zeros((len(self.contacts), self._stacked.shape[1])), np.zeros_like(rates)
        scale = float(np.abs(rates).max())
        if self._is_unique or scale == 0.0:
            return none
        flows = self._flows()
        symbolic = {c: cp.Constant(rates[:, COLUMN[c]] / scale) for c in COMPONENTS}
        missing = cp.Variable(len(self.contacts))
        opening = cp.Constant(corner_openings(rates / scale, self.contacts))
        rest, opening = self._rest(flows, symbolic, opening)
        constraints = [*(c for flow in flows for c in flow.limits)]
        constraints += [rest[c] == 0 for c in TANGENTIAL]
        constraints.append(opening + missing[self.contacts.corner_contact] >= 0)
        problem = cp.Problem(cp.Minimize(cp.sum(missing)), constraints)
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", message="Solution may be inaccurate")
                problem.solve(solver=cp.CLARABEL, ignore_dpp=True)
        except cp.error.SolverError:
            return none
        if missing.value is None:
            return none
        found, linear = none
        parts = [y.value for flow in flows for part in flow.parts for y in part]
        if parts:
            found = scale * np.stack(parts, axis=1)
        for flow in flows:
            if not flow.condition.norms:
                linear = linear + scale * self._linear_rates(flow)
        return found, linear

    def _linear_rates(self, flow: _Flow) -> FloatArray:
        """Rates (n, 6) of a condition without norms, for the multipliers it carries."""
        multiplier = np.maximum(flow.multiplier.value, 0.0)
        contact = flow.condition.contact
        rates = np.zeros((len(self.contacts), len(COMPONENTS)))
        for component, coefficient in flow.condition.resistance.items():
            share = np.broadcast_to(number(coefficient) * multiplier, multiplier.shape)
            rows = np.arange(len(multiplier)) if contact is None else contact
            np.add.at(rates[:, COLUMN[component]], rows, share)
        return rates

    def _flows(self) -> list[_Flow]:
        return [
            _Flow.of(condition, cone, len(self.contacts)) for condition, cone in self._conditions
        ]

    def _rest(
        self, flows: list[_Flow], rates: Rates, openings: cp.Expression
    ) -> tuple[dict[str, cp.Expression], cp.Expression]:
        """Tangential rates and corner openings that the flows do not explain."""
        j = self.contacts.corner_contact
        x, y = self.contacts.corner_xy.T
        weights = {"N": np.ones(len(j)), "M1": y, "M2": -x}
        rest = {c: rates[c] for c in TANGENTIAL}
        for flow in flows:
            for component in COMPONENTS:
                share = flow.plastic_rates(component, len(self.contacts))
                if share is None:
                    continue
                if component in rest:
                    rest[component] = rest[component] - share
                else:
                    openings = openings - cp.multiply(weights[component], share[j])
        return rest, openings


def _spread(condition: Condition, contacts: int):  # type: ignore[no-untyped-def]
    """Maps a coefficient and a variable per row to an expression per contact."""

    def share(coefficient: Coefficient, sign: float, variable: cp.Variable) -> cp.Expression:
        product = sign * times(coefficient, variable)
        if condition.contact is None:
            return product
        rows = np.arange(len(condition.contact))
        matrix = sp.csr_array(
            (np.ones(len(rows)), (condition.contact, rows)), (contacts, len(rows))
        )
        return matrix @ product

    return share
