"""The convex hull of contacts' states once more, written in CVXPY: the second path to one answer.

The package states it to a sink (:mod:`cvxlimit.extensions.interaction.relaxation.hull`); formulas
are those of :mod:`cvxlimit.extensions.interaction.states.disjuncts`.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.extensions.interaction.states.disjuncts import Disjuncts, disjunct_arms, sheared
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.statics import DOF
from cvxlimit.readings.pressure import half_extent
from cvxlimit.solvers import LimitState, SolverSettings, run

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def hull_solved(
    assemblage: Assemblage,
    disjuncts: Disjuncts,
    settings: SolverSettings,
    price: float | None = None,
) -> LimitState:
    """The limit problem over disjuncts, compiled by CVXPY; any share of the dead load may be taken
    off at a ``price`` in load factors."""
    scaling, scaled = assemblage.scaling, assemblage.scaled
    forces, limits = disjunct_forces(disjuncts, scaled.contacts)
    alpha, relief = cp.Variable(), cp.Variable(nonneg=True)
    balance = scaled.matrix @ forces + (1.0 - relief) * scaled.dead + alpha * scaled.live == 0
    cost = 0.0 if price is None else price / scaling.load_factor(1.0)
    most = relief <= (0.0 if price is None else 1.0)
    problem = cp.Problem(cp.Maximize(alpha - cost * relief), [balance, most, *limits])
    outcome = run(problem, settings)
    if not outcome.has_values:
        return LimitState(outcome, None, None, None)
    return LimitState(
        outcome,
        scaling.load_factor(float(alpha.value)),
        scaling.forces(np.asarray(forces.value).reshape(-1, len(COMPONENTS))),
        scaling.mechanism(np.asarray(balance.dual_value).reshape(-1, DOF)),
    )


def disjunct_forces(
    disjuncts: Disjuncts, contacts: Contacts
) -> tuple[cp.Expression, list[cp.Constraint]]:
    """Forces of all contacts (6 n,) as sums over disjuncts, and what bounds them."""
    maps, limits = _DisjunctForces(disjuncts, contacts).model()
    return sum(matrix @ cp.vec(v, order="F") for v, matrix in maps), limits


class _DisjunctForces:
    """Variables and constraints of all disjuncts; contact forces are sums over them."""

    def __init__(self, disjuncts: Disjuncts, contacts: Contacts) -> None:
        self.disjuncts, self.contacts = disjuncts, contacts
        self.half = half_extent(contacts)[disjuncts.contact]
        self.arm = disjunct_arms(disjuncts, contacts)
        self.friction = contacts.friction[disjuncts.contact]
        self.along = sheared(disjuncts, self.arm)
        self.shears = np.flatnonzero(self.along.any(axis=1))
        self.twists = np.flatnonzero(self.arm > 0.0)
        self.compression = cp.Variable(len(disjuncts), name="N")
        self.maps: list[tuple[cp.Variable, sp.csr_array]] = []
        self.constraints: list[cp.Constraint] = []

    def model(self) -> tuple[list[tuple[cp.Variable, sp.csr_array]], list[cp.Constraint]]:
        """Variables with what they give to the forces of all contacts, and their constraints."""
        self._add_compression()
        for axis, moment in enumerate(("M2", "M1")):
            self._add_spread(axis, moment)
        self._add_tangential()
        return self.maps, self.constraints

    def _add_compression(self) -> None:
        k = np.arange(len(self.disjuncts))
        e1, e2 = (self.half * self.disjuncts.centre).T
        self._map(self.compression, [("N", k, k, np.ones(len(k))), ("M1", k, k, e2),
                                     ("M2", k, k, -e1)])  # fmt: skip
        implied = np.zeros(len(k), dtype=bool)
        implied[self.shears] = self.friction[self.shears] > 0.0
        if not implied.all():
            self.constraints.append(self.compression[np.flatnonzero(~implied)] >= 0.0)

    def _add_spread(self, axis: int, moment: str) -> None:
        """abs(moment) <= sum of spread N, for contacts with spread along ``axis``."""
        reach = (self.half * self.disjuncts.spread)[:, axis]
        k = np.flatnonzero(reach > 0.0)
        self._add_bounded(moment, k, reach[k], self.compression[k] if len(k) else None)

    def _add_tangential(self) -> None:
        k = self.shears
        shear = cp.Variable((len(k), 2), name="V") if len(k) else None
        if shear is None:
            return
        along, arms = np.arange(len(k)), self._lever(k)
        self._map(shear, [
            ("V1", k, along, self.along[k, 0]), ("V2", k, along + len(k), self.along[k, 1]),
            ("MT", k, along, -arms[:, 1]), ("MT", k, along + len(k), arms[:, 0]),
        ])  # fmt: skip
        remaining = cp.multiply(self.friction[k], self.compression[k])
        remaining -= self._torsion(shear) + self._drag(shear)
        self.constraints.append(cp.SOC(remaining, shear, axis=1))

    def _lever(self, k: IntArray) -> FloatArray:
        """Where the torsion of disjuncts ``k`` is taken about, (len(k), 2), in the unit of
        length."""
        signed = self.disjuncts.signed[k][:, None]
        return np.where(signed, self.half[k] * self.disjuncts.lever[k], 0.0)

    def _torsion(self, shear: cp.Variable) -> cp.Expression:
        """tau of the disjuncts that shear, and the contacts' torsion bounded by it."""
        rows, limited = len(self.shears), self.disjuncts.limited[self.twists]
        if not len(self.twists):
            self._limit_torsion(shear, None)
            return cp.Constant(np.zeros(rows))
        share = cp.Variable(len(self.twists), nonneg=True, name="tau")
        free, own = np.flatnonzero(~limited), np.flatnonzero(limited)
        if len(free):
            self._add_bounded("MT", self.twists[free], self.arm[self.twists[free]], share[free])
        self._limit_torsion(shear, share[own] if len(own) else None)
        return _places(np.searchsorted(self.shears, self.twists), rows) @ share

    def _limit_torsion(self, shear: cp.Variable, share: cp.Expression | None) -> None:
        """Eq. 27: torsion of their own for limited disjuncts, which with what their shear does
        about the contact's centre is at most c mu N."""
        k = self.shears[self.disjuncts.limited[self.shears]]
        if not len(k):
            return
        at, lever = np.searchsorted(self.shears, k), self._lever(k)
        total = cp.multiply(lever[:, 0], shear[at, 1]) - cp.multiply(lever[:, 1], shear[at, 0])
        if share is not None:
            twists = self.twists[self.disjuncts.limited[self.twists]]
            own, each = cp.Variable(len(twists), name="t"), np.arange(len(twists))
            self._map(own, [("MT", twists, each, np.ones(len(twists)))])
            bound = cp.multiply(self.arm[twists], share)
            self.constraints += [own <= bound, -own <= bound]
            total = total + _places(np.searchsorted(k, twists), len(k)) @ own
        most = cp.multiply(self.arm[k] * self.friction[k], self.compression[k])
        self.constraints += [total <= most, -total <= most]

    def _drag(self, shear: cp.Variable) -> cp.Expression:
        """kappa . (abs(V1), abs(V2)): torsion whose sign or pressure centre is free, (rows,)."""
        k = self.shears
        fixed = np.where(self.disjuncts.signed[k][:, None], 0.0, np.abs(self.disjuncts.centre[k]))
        eps = self.half[k] * (fixed + self.disjuncts.spread[k])
        total = cp.Constant(np.zeros(len(k)))
        for column in (0, 1):
            weight = eps[:, 1 - column] / np.where(self.arm[k] > 0.0, self.arm[k], 1.0)
            rows = np.flatnonzero(weight > 0.0)
            if len(rows):
                size = cp.Variable(len(rows))
                part = shear[rows, column]
                self.constraints += [part <= size, -part <= size]
                total = total + _places(rows, len(k), weight[rows]) @ size
        return total

    def _add_bounded(
        self, component: str, k: IntArray, reach: FloatArray, size: cp.Expression | None
    ) -> None:
        """A free part of a force component, between +- sums of reach * size over the disjuncts
        k."""
        if size is None:
            return
        rows, place = np.unique(self.disjuncts.contact[k], return_inverse=True)
        part = cp.Variable(len(rows))
        each = np.arange(len(rows))
        self.maps.append(
            (part, self._columns([(component, rows, each, np.ones(len(rows)))], len(rows)))
        )
        bound = sp.csr_array((reach, (place, np.arange(len(k)))), (len(rows), len(k))) @ size
        self.constraints += [part <= bound, -part <= bound]

    def _map(self, variable: cp.Variable, entries: list[_Entry]) -> None:
        by_contact = [(c, self.disjuncts.contact[k], column, v) for c, k, column, v in entries]
        self.maps.append((variable, self._columns(by_contact, variable.size)))

    def _columns(self, entries: list[_Entry], size: int) -> sp.csr_array:
        rows = np.concatenate([len(COMPONENTS) * j + COLUMN[c] for c, j, _, _ in entries])
        columns = np.concatenate([column for _, _, column, _ in entries])
        values = np.concatenate([v for _, _, _, v in entries])
        matrix = sp.csr_array(
            (values, (rows, columns)), (len(COMPONENTS) * len(self.contacts), size)
        )
        matrix.eliminate_zeros()
        return matrix


_Entry = tuple[str, IntArray, IntArray, FloatArray]
"""Component, disjuncts (or contacts), columns of the variable, coefficients."""


def _places(at: IntArray, rows: int, values: FloatArray | float = 1.0) -> sp.csr_array:
    """Matrix (rows, len(at)) that puts entry i, times its value, into row ``at[i]``."""
    entries = np.broadcast_to(np.asarray(values, dtype=float), at.shape)
    return sp.csr_array((entries, (at, np.arange(len(at)))), (rows, len(at)))
