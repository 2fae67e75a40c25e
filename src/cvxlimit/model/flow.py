"""The associated flow rule (Eq. 33-36): which relative rates a model's strength allows.

Rates of internal forces are allowed when they are

    rates = sum over conditions of (resistance lambda - sum of B^T y) + opening,
    polar_gauge(y) <= lambda,   opening >= 0 along compressions,

with resistance and B the rows of a condition without its constants: the normal cone of the
admissible forces, over all of them. Contact forces then do at least

    -(sum of c lambda - sum of b^T y)

of work, the *dissipation*, with c and b the constants; without constants, none. How far rates are
from allowed is measured by their *shortfall*: the extra opening, uniform over the contact, that
would make them so. Forces on a contact then do at least -shortfall * N of work besides.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.formulations import ForceModel, corner_compressions
from cvxlimit.surfaces.base import Condition, YieldSurface
from cvxlimit.surfaces.cones import Cone

_TIGHT = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}
"""Of proposed flows: dissipation is a small difference where strength is far above the forces."""

_PENALTY = 10.0
"""Price of missing opening over that of dissipation; any above 1 gives the same flows."""

_Goal = Callable[[cp.Variable, "list[_Flow]"], cp.Expression]


@dataclass(frozen=True, eq=False)
class Shortfall:
    """How far rates are from the flow rule.

    Attributes
    ----------
    missing : (n,)
        Opening that contacts lack; negative where some is to spare.
    unresisted : (k,)
        Slip that no condition resists; twists times the size of a contact.
    dissipation : float
        Power that forces can take up at most while rates are as the flow rule has them.
    """

    missing: FloatArray
    unresisted: FloatArray
    dissipation: float = 0.0


def corner_openings(rates: FloatArray, contacts: Contacts) -> FloatArray:
    """Opening rate (m,) at every corner, for rates (n, 6): the power of a unit compression."""
    j = contacts.corner_contact
    x, y = contacts.corner_xy.T
    normal, about_1, about_2 = (rates[j, COLUMN[c]] for c in ("N", "M1", "M2"))
    result: FloatArray = normal + y * about_1 - x * about_2
    return result


@dataclass(frozen=True, eq=False)
class _Rows:
    """One condition as rows on the internal forces: (k, p) matrices and (k,) constants."""

    cone: Cone
    resistance: sp.csr_array
    constant: FloatArray
    norms: list[list[sp.csr_array]]
    constants: list[list[FloatArray]]
    contact: NDArray[np.int64]

    @classmethod
    def of(cls, condition: Condition, cone: Cone, model: ForceModel) -> _Rows:
        every = np.arange(len(model.contacts))
        resistance, constant = model.rows(condition.resistance, condition.contact)
        found = [
            [model.rows(form, condition.contact) for form in norm.weighted_rows]
            for norm in condition.norms
        ]
        return cls(
            cone,
            resistance,
            constant,
            [[matrix for matrix, _ in rows] for rows in found],
            [[constant for _, constant in rows] for rows in found],
            every if condition.contact is None else condition.contact,
        )


@dataclass(frozen=True, eq=False)
class _Flow:
    """Symbolic flow of one condition: multiplier lambda, one y per norm row, and their limits."""

    rows: _Rows
    multiplier: cp.Variable
    parts: list[list[cp.Variable]]
    limits: list[cp.Constraint]

    @classmethod
    def of(cls, rows: _Rows) -> _Flow:
        multiplier = cp.Variable(len(rows.constant), nonneg=True)
        parts = [[cp.Variable(len(rows.constant)) for _ in norm] for norm in rows.norms]
        limits = [c for part in parts for c in rows.cone.polar_epigraph(multiplier, part)]
        return cls(rows, multiplier, parts, limits)

    def rates(self) -> cp.Expression:
        total = self.rows.resistance.T @ self.multiplier
        for norm, part in zip(self.rows.norms, self.parts, strict=True):
            for matrix, y in zip(norm, part, strict=True):
                total = total - matrix.T @ y
        return total

    def dissipation(self, unit: FloatArray | None = None) -> cp.Expression:
        per = 1.0 if unit is None else unit[self.rows.contact]
        total = (self.rows.constant / per) @ self.multiplier
        for norm, part in zip(self.rows.constants, self.parts, strict=True):
            for constant, y in zip(norm, part, strict=True):
                total = total - (constant / per) @ y
        return total


@dataclass(frozen=True, eq=False)
class SymbolicFlow:
    """Constraints that allow rates, the dissipation that goes with them, and the flows."""

    limits: list[cp.Constraint]
    dissipation: cp.Expression
    flows: list[_Flow]


class FlowRule:
    """The flow rule of several surfaces, in the internal forces of a model.

    Parameters
    ----------
    surfaces : sequence of YieldSurface
    model : ForceModel or Contacts
        Contacts stand for corner compressions, in which rocking is opening at corners.
    """

    def __init__(self, surfaces: Sequence[YieldSurface], model: ForceModel | Contacts) -> None:
        self.model = corner_compressions(model) if isinstance(model, Contacts) else model
        self._rows = [
            _Rows.of(condition, cone, self.model)
            for _, condition, cone in self.model.strength(surfaces)
        ]
        every, width = self._rows, self.model.meaning.shape[1]
        normed = [(rows, norm) for rows in every for norm in rows.norms]
        self._free = np.flatnonzero(~self.model.nonneg)
        self._pressed = np.flatnonzero(self.model.nonneg)
        normal = self.model.meaning[COLUMN["N"] :: len(COMPONENTS)]
        self._compression = np.asarray(normal.sum(axis=0), dtype=float).ravel()[self._pressed]
        size = self.model.contacts.typical_size
        self._reach = np.where(self.model.is_moment[self._free], size, 1.0)
        self._resistance = _stacked([rows.resistance for rows in every], width)
        self._constant = _joined([rows.constant for rows in every])
        # resistances of conditions without norms, empty rows for the others
        self._linear = _stacked([rows.resistance * float(not rows.norms) for rows in every], width)
        self._norm_rows = _stacked([matrix for _, norm in normed for matrix in norm], width)
        self._norm_constants = _joined([c for rows in every for n in rows.constants for c in n])
        # Norm rows of conditions whose resistance grows with forces of any sign. Their multipliers
        # change rates that must agree exactly, so their flows are left as proposed and the others
        # make up for them.
        self._is_coupled = _joined(
            [
                np.full(len(rows.constant) * len(norm), rows.resistance[:, self._free].nnz > 0.0)
                for rows, norm in normed
            ]
        ).astype(bool)
        kept = sp.diags_array((~self._is_coupled).astype(float), shape=(len(self._is_coupled),) * 2)
        self._loose_rows = (kept @ self._norm_rows).tocsr()[:, self._free]
        is_linear = any(not rows.norms for rows in every) or self._is_coupled.any()
        self._is_unique = not is_linear and self._norm_rows.shape[0] <= len(self._free)
        self._nothing = np.zeros(self._norm_rows.shape[0]), np.zeros(len(self._constant))

    def symbolic(self, rates: cp.Expression) -> SymbolicFlow:
        """For CVXPY: what allows ``rates`` (p,) of the internal forces, and their dissipation."""
        flows = [_Flow.of(rows) for rows in self._rows]
        rest = rates - sum((flow.rates() for flow in flows), start=np.zeros(rates.shape))
        limits = [c for flow in flows for c in flow.limits]
        if len(self._free):
            limits.append(rest[self._free] == 0)
        if len(self._pressed):
            limits.append(rest[self._pressed] >= 0)
        lost = sum((flow.dissipation() for flow in flows), start=cp.Constant(0.0))
        return SymbolicFlow(limits, lost, flows)

    def shortfall(self, rates: FloatArray) -> Shortfall:
        """Of relative rates (n, 6), with as little dissipation as the missing opening allows.

        Exact when the conditions determine the flow uniquely, and otherwise an upper bound, from
        the best decomposition found.
        """
        inner = np.asarray(self.model.meaning.T @ rates.ravel())
        return self._completed(inner, *self._proposal(inner, self._cheapest))

    def opened(self, rates: FloatArray) -> Shortfall:
        """The same, with as much opening to spare as can be."""
        inner = np.asarray(self.model.meaning.T @ rates.ravel())
        return self._completed(inner, *self._proposal(inner, self._most_open))

    def shortfall_bound(self, rates: FloatArray) -> FloatArray:
        """An upper bound (n,) on the missing opening, without optimisation: least-norm flows."""
        inner = np.asarray(self.model.meaning.T @ rates.ravel())
        found = self._completed(inner, *self._nothing)
        resisted = np.abs(found.unresisted).max(initial=0.0) <= 1e-12 * np.abs(rates).max()
        return found.missing if resisted else np.full(len(found.missing), np.inf)

    def _completed(
        self, rates: FloatArray, flows: FloatArray, multipliers: FloatArray
    ) -> Shortfall:
        """Complete proposed flows to exact ones with the least change, and measure what is left.

        ``flows`` (all norm rows,) and ``multipliers`` (all conditions' rows,) are in order.
        """
        matrix, norms = self._norm_rows, self._loose_rows
        held = np.where(self._is_coupled, flows, 0.0)
        taken = self._linear.T @ multipliers - matrix.T @ held
        taken = taken + self._resistance.T @ self._multipliers(held)
        target = -(rates - taken)[self._free]
        flows = flows + norms @ self._normal(target - norms.T @ flows)
        least = self._multipliers(flows)
        rest = rates - self._linear.T @ multipliers
        rest = rest - (self._resistance.T @ least - matrix.T @ flows)
        lost = self._constant @ (least + multipliers) - self._norm_constants @ flows
        missing = np.full(len(self.model.contacts), -np.inf)  # uniform, brings all rates up to zero
        at = self.model.contact[self._pressed]
        np.maximum.at(missing, at, -rest[self._pressed] / self._compression)
        return Shortfall(missing, -rest[self._free] * self._reach, float(lost))

    def _multipliers(self, flows: FloatArray) -> FloatArray:
        result: list[FloatArray] = [np.zeros(0)]
        at = 0
        for rows in self._rows:
            multiplier = np.zeros(len(rows.constant))
            for norm in rows.norms:
                part = [flows[at + i * len(rows.constant) : at + (i + 1) * len(rows.constant)]
                        for i in range(len(norm))]  # fmt: skip
                at += len(norm) * len(rows.constant)
                multiplier = np.maximum(multiplier, rows.cone.polar_gauge(part))
            result.append(multiplier)
        return np.concatenate(result)

    @cached_property
    def _normal(self):  # type: ignore[no-untyped-def]
        """Solver of G' G for loose norm rows G on the free rates; nothing where nobody resists."""
        square = (self._loose_rows.T @ self._loose_rows).tocsc()
        idle = square.diagonal() == 0.0
        solve = splu((square + sp.diags_array(idle.astype(float))).tocsc()).solve
        return lambda right: np.where(idle, 0.0, solve(right))

    def _proposal(self, rates: FloatArray, goal: _Goal) -> tuple[FloatArray, FloatArray]:
        """Flows that are best for a goal where the conditions leave a choice, else zero; and the
        multipliers >= 0 of conditions without norms.

        One small conic problem without coupling between contacts; what comes back is only a
        proposal, which :meth:`shortfall` makes exact and measures.
        """
        scale = float(np.abs(rates).max())
        if self._is_unique or scale == 0.0:
            return self._nothing
        missing = cp.Variable(len(self.model.contacts))
        found = self.symbolic(rates / scale + self._opening @ missing)
        problem = cp.Problem(cp.Minimize(goal(missing, found.flows)), found.limits)
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", message="Solution may be inaccurate")
                problem.solve(solver=cp.CLARABEL, ignore_dpp=True, **_TIGHT)
        except cp.error.SolverError:
            return self._nothing
        if missing.value is None:
            return self._nothing
        parts = [y.value for flow in found.flows for part in flow.parts for y in part]
        linear = [
            np.maximum(flow.multiplier.value, 0.0) * float(not flow.rows.norms)
            for flow in found.flows
        ]
        return (
            scale * _joined(parts),
            scale * _joined(linear),
        )

    def _most_open(self, missing: cp.Variable, flows: list[_Flow]) -> cp.Expression:
        return cp.sum(missing) + self._dissipation(flows)

    def _cheapest(self, missing: cp.Variable, flows: list[_Flow]) -> cp.Expression:
        """Dissipation; opening that is missing costs more than it can save, since no compression
        is above the strength that limits it; opening to spare is worth nothing."""
        if not np.any(self._strength):
            return cp.sum(missing)
        return _PENALTY * cp.sum(cp.pos(missing)) + self._dissipation(flows)

    def _dissipation(self, flows: list[_Flow]) -> cp.Expression:
        unit = np.where(self._strength > 0.0, self._strength, 1.0)
        return sum((flow.dissipation(unit) for flow in flows), start=cp.Constant(0.0))

    @cached_property
    def _strength(self) -> FloatArray:
        result = np.zeros(len(self.model.contacts))
        for rows in self._rows:
            for constant in (rows.constant, *(c for norm in rows.constants for c in norm)):
                np.add.at(result, rows.contact, np.abs(constant))
        return result

    @cached_property
    def _opening(self) -> sp.csr_array:
        index = (self._pressed, self.model.contact[self._pressed])
        shape = (len(self.model.nonneg), len(self.model.contacts))
        return sp.csr_array((self._compression, index), shape=shape)


def _stacked(matrices: list[sp.csr_array], width: int) -> sp.csr_array:
    if not matrices:
        return sp.csr_array((0, width))
    return sp.vstack(matrices, format="csr")


def _joined(arrays: list[FloatArray]) -> FloatArray:
    return np.concatenate([np.zeros(0), *arrays])
