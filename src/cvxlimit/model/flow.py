"""The associated flow rule (Eq. 33-36): which relative rates a model's strength allows.

Rates of internal forces are allowed when they are

    rates = sum over conditions of (resistance lambda - sum of B^T y) + opening,
    polar_gauge(y) <= lambda,   opening >= 0 along compressions,

with resistance and B the rows of a condition without its constants: the normal cone of the
admissible forces, over all of them. Contact forces then do at least

    -(sum of c lambda - sum of b^T y)

of work, the *dissipation*, with c and b the constants. How far rates are from allowed is measured
by their *shortfall*, the uniform extra opening that would make them so: forces on a contact then do
at least -shortfall * N of work besides.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate, chain, islice, repeat
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.formulations import ForceModel, corner_compressions
from cvxlimit.model.sinks import Constraints, Rows, stacked
from cvxlimit.solvers import clarabel_at, run
from cvxlimit.surfaces.base import LinearForm, YieldSurface, express, number
from cvxlimit.surfaces.cones import Cone

_TIGHT = 1e-11
"""Of proposed flows: dissipation is a small difference where strength is far above the forces."""

_PENALTY = 10.0
"""Price of missing opening over that of dissipation; any above 1 gives the same flows."""


@dataclass(frozen=True, eq=False)
class Shortfall:
    """How far rates are from the flow rule.

    ``missing`` (n,) is the opening that contacts lack, negative where some is to spare;
    ``unresisted`` (k,) slip that no condition resists, twists times the size of a contact;
    ``dissipation`` the power that forces can take up at most while rates are as the rule has them,
    ``by_contact`` (n,) of each, and ``multipliers`` those of the rows of resistance.
    """

    missing: FloatArray
    unresisted: FloatArray
    dissipation: float = 0.0
    by_contact: FloatArray = field(default_factory=lambda: np.zeros(0))
    multipliers: FloatArray = field(default_factory=lambda: np.zeros(0))


def corner_openings(rates: FloatArray, contacts: Contacts) -> FloatArray:
    """Opening rate (m,) at every corner, for rates (n, 6): the power of a unit compression."""
    j = contacts.corner_contact
    x, y = contacts.corner_xy.T
    result: FloatArray = rates[j, COLUMN["N"]]
    return result + y * rates[j, COLUMN["M1"]] - x * rates[j, COLUMN["M2"]]


class _Forms:
    """Linear forms as rows on the internal forces, one below the other: ``places`` says where."""

    def __init__(
        self, forces: Mapping[str, Any], size: tuple[int, int],
        forms: list[tuple[LinearForm, IntArray | None]],
    ) -> None:  # fmt: skip
        contacts, width = size
        every = np.arange(contacts)
        at_present = [{k: number(c) for k, c in form.items()} for form, _ in forms]
        rows = [express(form, forces, at) for form, (_, at) in zip(at_present, forms, strict=True)]
        ends = list(accumulate((form.size for form in rows), initial=0))
        self.places, self.size = list(map(slice, ends, ends[1:])), ends[-1]
        whole = stacked(rows or [forces["N"][every[:0]]])
        self.matrix, self.constant = whole.matrix(width), whole.constant
        self.contact = np.concatenate(
            [every[:0], *(every if at is None else at for _, at in forms)]
        )
        self.transposed: sp.csc_array = self.matrix.T


class StrengthRows:
    """Conditions of several surfaces, and of a model itself, as rows on its internal forces.

    ``conditions`` are cones, the rows of ``resistance``, and those of every norm in ``norms``.
    """

    def __init__(self, surfaces: Sequence[YieldSurface], model: ForceModel) -> None:
        self.model, stated = model, model.strength(surfaces)
        resistances: list[tuple[LinearForm, IntArray | None]] = []
        norms: list[tuple[LinearForm, IntArray | None]] = []
        for _, condition, _ in stated:
            resistances.append((condition.resistance, condition.contact))
            for norm in condition.norms:
                norms += zip(norm.weighted_rows, repeat(condition.contact))
        forces, _ = model.unknowns(into := Rows())
        size = len(model.contacts), into.width
        self.resistance, self.norms = (_Forms(forces, size, f) for f in (resistances, norms))
        self.conditions: list[tuple[Cone, slice, list[list[slice]]]] = []
        places = iter(self.norms.places)
        for (_, condition, cone), where in zip(stated, self.resistance.places, strict=True):
            rows = [list(islice(places, len(norm.rows))) for norm in condition.norms]
            self.conditions.append((cone, where, rows))

    def excess(self, internal: FloatArray) -> list[tuple[FloatArray, IntArray]]:
        """Yield functions of internal forces (p,), and the contact of every entry, one pair per
        condition; <= 0 is admissible."""
        resistance = self.resistance.matrix @ internal + self.resistance.constant
        sizes = self.norms.matrix @ internal + self.norms.constant
        result = []
        for cone, where, norms in self.conditions:
            y = -resistance[where]
            for norm in norms:
                y = y + cone.gauge([sizes[row] for row in norm])
            result.append((y, self.resistance.contact[where]))
        return result


@dataclass(frozen=True, eq=False)
class SymbolicFlow:
    """Constraints that allow rates, the dissipation that goes with them, and the flows: a
    multiplier per row of resistance, a rate per row of a norm; None where there are no rows."""

    limits: list[cp.Constraint]
    dissipation: cp.Expression
    multipliers: cp.Variable | None
    flows: cp.Variable | None


class FlowRule(StrengthRows):
    """The flow rule of several surfaces, in the internal forces of a model.

    Contacts in place of a model stand for corner compressions, in which rocking is opening at
    corners.
    """

    def __init__(self, surfaces: Sequence[YieldSurface], model: ForceModel | Contacts) -> None:
        own = corner_compressions(model) if isinstance(model, Contacts) else model
        super().__init__(surfaces, own)
        self._free = np.flatnonzero(~self.model.nonneg)
        self._pressed = np.flatnonzero(self.model.nonneg)
        normal = self.model.resultant_map[COLUMN["N"] :: len(COMPONENTS)]
        self._compression = np.asarray(normal.sum(axis=0), dtype=float).ravel()[self._pressed]
        size = self.model.contacts.typical_size
        self._reach = np.where(self.model.is_moment[self._free], size, 1.0)
        # Norm rows of conditions whose resistance grows with forces of any sign are coupled. Their
        # multipliers change rates that must agree exactly, so their flows are left as proposed and
        # the others make up for them.
        self._is_linear = np.zeros(self.resistance.size, dtype=bool)
        self._is_coupled = np.zeros(self.norms.size, dtype=bool)
        free = np.diff(self.resistance.matrix[:, self._free].indptr)
        for _, where, rows in self.conditions:
            self._is_linear[where] = not rows
            for row in chain(*rows):
                self._is_coupled[row] = free[where].any()
        is_open = self._is_linear.any() or self._is_coupled.any()
        self._is_unique = not is_open and self.norms.size <= len(self._free)
        self._nothing = np.zeros(self.norms.size), np.zeros(self.resistance.size)

    def symbolic(self, rates: cp.Expression, unit: FloatArray | None = None) -> SymbolicFlow:
        """States for CVXPY what allows ``rates`` (p,) of the internal forces, and their
        dissipation, which ``unit`` (n,) divides contact by contact."""
        sides: list[Any] = []
        rest, lost = rates, cp.Constant(0.0)
        for sign, rows in ((1.0, self.resistance), (-1.0, self.norms)):
            if not rows.size:
                sides.append(None)
                continue
            sides.append(cp.Variable(rows.size, nonneg=sign > 0.0))
            rest = rest - sign * rows.transposed @ sides[-1]
            per = 1.0 if unit is None else unit[rows.contact]
            lost = lost + sign * (rows.constant / per) @ sides[-1]
        multipliers, flows = sides
        into = Constraints()
        for cone, where, norms in self.conditions:
            for norm in norms:
                cone.polar_epigraph(into, multipliers[where], [flows[row] for row in norm])
        if len(self._free):
            into.zero(rest[self._free])
        if len(self._pressed):
            into.nonneg(rest[self._pressed])
        return SymbolicFlow(into.all, lost, multipliers, flows)

    def shortfall(self, rates: FloatArray) -> Shortfall:
        """Returns the shortfall of relative rates (n, 6), with as little dissipation as the missing
        opening allows: exact where the conditions determine the flow, otherwise an upper bound."""
        inner = np.asarray(self.model.resultant_map.T @ rates.ravel())
        return self._completed(inner, *self._proposal(inner, True))

    def opened(self, rates: FloatArray) -> Shortfall:
        """The same, with as much opening to spare as can be."""
        inner = np.asarray(self.model.resultant_map.T @ rates.ravel())
        return self._completed(inner, *self._proposal(inner, False))

    def shortfall_bound(self, rates: FloatArray) -> FloatArray:
        """An upper bound (n,) on the missing opening, without optimisation: least-norm flows."""
        inner = np.asarray(self.model.resultant_map.T @ rates.ravel())
        shortfall = self._completed(inner, *self._nothing)
        resisted = np.abs(shortfall.unresisted).max(initial=0.0) <= 1e-12 * np.abs(rates).max()
        return shortfall.missing if resisted else np.full(len(shortfall.missing), np.inf)

    def _completed(
        self, rates: FloatArray, flows: FloatArray, multipliers: FloatArray
    ) -> Shortfall:
        """Complete proposed flows to exact ones with the least change, measure what is left."""
        norms, resistance = self.norms, self.resistance
        rest, held = rates, np.where(self._is_coupled, flows, 0.0)
        if multipliers.any():
            rest = rest - resistance.transposed @ np.where(self._is_linear, multipliers, 0.0)
        loose, idle, solve = self._loose
        target = rest
        if held.any():
            target = rest + norms.transposed @ held
            target = target - resistance.transposed @ self._multipliers(held)
        target = -target[self._free] - loose.T @ flows
        flows = flows + loose @ np.where(idle, 0.0, solve(target))
        least = self._multipliers(flows)
        rest = rest - (resistance.transposed @ least - norms.transposed @ flows)
        multipliers = least + multipliers
        lost = np.zeros(len(self.model.contacts))
        np.add.at(lost, resistance.contact, resistance.constant * multipliers)
        np.add.at(lost, norms.contact, -norms.constant * flows)
        missing = np.full(len(self.model.contacts), -np.inf)  # uniform, brings all rates up to zero
        at = self.model.contact[self._pressed]
        np.maximum.at(missing, at, -rest[self._pressed] / self._compression)
        unresisted = -rest[self._free] * self._reach
        return Shortfall(missing, unresisted, float(lost.sum()), lost, multipliers)

    def _multipliers(self, flows: FloatArray) -> FloatArray:
        result = np.zeros(self.resistance.size)
        for cone, where, norms in self.conditions:
            for norm in norms:
                size = cone.polar_gauge([flows[row] for row in norm])
                result[where] = np.maximum(result[where], size)
        return result

    @cached_property
    def _loose(self) -> tuple[sp.csr_array, BoolArray, Callable[[FloatArray], FloatArray]]:
        """Norm rows G that are not coupled, on the free rates; where nobody resists; and a solver
        of G' G."""
        loose = self.norms.matrix[:, self._free]
        if self._is_coupled.any():
            loose = loose.multiply(~self._is_coupled[:, None]).tocsr()
        square = loose.T @ loose
        idle = square.diagonal() == 0.0
        if idle.any():
            square = square + sp.diags_array(idle.astype(float))
        return loose, idle, splu(square.tocsc()).solve

    def _proposal(self, rates: FloatArray, is_cheap: bool) -> tuple[FloatArray, FloatArray]:
        """Flows where the conditions leave a choice, else zero; and the multipliers >= 0 of
        conditions without norms: cheap ones, or those that leave most opening to spare. Missing
        opening costs more than dissipation can save: no compression is above its strength."""
        scale = float(np.abs(rates).max())
        if self._is_unique or scale == 0.0:
            return self._nothing
        strength = self._strength
        missing = cp.Variable(len(self.model.contacts))
        unit = np.where(strength > 0.0, strength, 1.0)
        flow = self.symbolic(rates / scale + self._opening @ missing, unit)
        goal = cp.sum(missing) + flow.dissipation
        if is_cheap and not np.any(strength):
            goal = cp.sum(missing)
        elif is_cheap:
            goal = _PENALTY * cp.sum(cp.pos(missing)) + flow.dissipation
        problem = cp.Problem(cp.Minimize(goal), flow.limits)
        if not run(problem, clarabel_at(_TIGHT)[0], ignore_dpp=True).has_values:
            return self._nothing
        flows, multipliers = self._nothing
        if flow.flows is not None:
            flows = scale * flow.flows.value
        if flow.multipliers is not None:
            multipliers = scale * np.maximum(flow.multipliers.value, 0.0) * self._is_linear
        return flows, multipliers

    @cached_property
    def _strength(self) -> FloatArray:
        result = np.zeros(len(self.model.contacts))
        for rows in (self.resistance, self.norms):
            np.add.at(result, rows.contact, np.abs(rows.constant))
        return result

    @cached_property
    def _opening(self) -> sp.csr_array:
        index = (self._pressed, self.model.contact[self._pressed])
        shape = (len(self.model.nonneg), len(self.model.contacts))
        return sp.csr_array((self._compression, index), shape=shape)
