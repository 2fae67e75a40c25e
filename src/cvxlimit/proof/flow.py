"""The associated flow rule (Eq. 33-36): which relative rates a model's strength allows.

Every condition of a model bounds norms by a resistance: sum of gauge(B s + b) <= R s + c. Its
normal cone has a multiplier for each resistance and flows for each norm. Rates r of the internal
forces are allowed when, summed over all conditions,

    r = R' lambda - B' y + opening,      polar_gauge(y) <= lambda,

where the opening is not negative along compressions, and zero along forces of any sign.

=======  ==================================================  =====  ================================
letter   what it is                                          shape  in the code
=======  ==================================================  =====  ================================
s        internal forces of all contacts, the model's own    (p,)   ``internal``
r        relative rates: what s do power on                  (p,)   ``rates``
R, c     resistances of all conditions, as rows on s         (k,p)  ``resistance.matrix, .constant``
B, b     rows of all norms on s                              (q,p)  ``norms.matrix, .constant``
lambda   a multiplier >= 0 for each row of R                 (k,)   ``multipliers``
y        a flow for each row of B                            (q,)   ``flows``
opening  what remains of r without the two                   (p,)   ``rest``
=======  ==================================================  =====  ================================

Contact forces then do at least -(c' lambda - b' y) of power. For the opening takes no power from
compressions, and y'(B s + b) is at most polar_gauge(y) gauge(B s + b), hence at most
lambda'(R s + c). So c' lambda - b' y is the *dissipation*: what forces take up at most.

How far rates are from allowed is measured by their *shortfall*, the uniform extra opening of a
contact that would make them so: forces on it then do at least -shortfall * N of power besides.

Where conditions leave a choice of lambda and y, a solver's duals of their rows propose them
(:data:`~cvxlimit.solvers.running.Flows`), and where there are none, as for rates that no solver
found, a small cone program does. Either way they are moved as little as makes them exact, in NumPy:
nothing is believed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from cvxlimit.base.arrays import EPSILON, ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.crushing import EffectiveRectangles, is_weak
from cvxlimit.model.formulations import ForceModel, corner_compressions
from cvxlimit.model.sinks import Rows, stacked
from cvxlimit.proof.conditions import ConditionRows
from cvxlimit.solvers import settings_for
from cvxlimit.solvers.running import Flows
from cvxlimit.surfaces.base import CONSTANT, YieldSurface, number
from cvxlimit.surfaces.cones import Sink
from cvxlimit.surfaces.coulomb import Bounds, with_bounds
from cvxlimit.surfaces.exact_torsion import Edges

_PENALTY = 10.0
"""Price of missing opening over that of dissipation as an opening. Any above 1 gives the same flow:
stone that crushes can make up for missing opening, but as no compression is above the strength,
that costs at most 1 in dissipation per unit of opening."""

_NEWTON = 30
"""Steps for :attr:`FlowRule._pressed`, which moves exponents by 1 at most. Polygons whose lightest
row has 1e-4 of the weight of the heaviest take 12 steps."""


@dataclass(frozen=True, eq=False)
class Shortfall:
    """How far rates are from the flow rule.

    Attributes
    ----------
    missing : (n,) array
        Uniform opening that each contact lacks, negative where some is to spare; -inf for a contact
        without compressions.
    unresisted : (number of forces of any sign,) array
        Rates along these forces that no condition resists, less those that are allowed: slips, and
        twists times the typical size of a contact.
    dissipation : float
        The power that forces can take up at most, apart from what missing opening adds.
    by_contact : (n,) array
        The dissipation of each contact.
    multipliers : (k,) array
        lambda, one for each row of resistance.
    """

    missing: FloatArray
    unresisted: FloatArray
    dissipation: float = 0.0
    by_contact: FloatArray = field(default_factory=lambda: np.zeros(0))
    multipliers: FloatArray = field(default_factory=lambda: np.zeros(0))


def scaled(duals: Flows, by: float) -> Flows:
    """Returns a solver's duals of strength for the same mechanism ``by`` times as fast."""
    return lambda: {
        name: [(by * bound, [by * row for row in rows]) for bound, rows in each]
        for name, each in duals().items()
    }


def corner_openings(rates: FloatArray, contacts: Contacts) -> FloatArray:
    """Opening rate (m,) at every corner, for rates (n, 6): the power of a unit compression."""
    j = contacts.corner_contact
    x, y = contacts.corner_xy.T
    result: FloatArray = rates[j, COLUMN["N"]]
    return result + y * rates[j, COLUMN["M1"]] - x * rates[j, COLUMN["M2"]]


class StatedFlow(NamedTuple):
    """The flow rule stated to a sink: lambda (k,), y (q,) and the dissipation as forms of its
    unknowns; None where there are no rows."""

    multipliers: Any
    flows: Any
    dissipation: Any


class FlowRule(ConditionRows):
    """The flow rule of several surfaces, in the internal forces of a model.

    Contacts in place of a model stand for corner compressions, in which rocking is opening at
    corners.
    """

    def __init__(self, surfaces: Sequence[YieldSurface], model: ForceModel | Contacts) -> None:
        own = corner_compressions(model) if isinstance(model, Contacts) else model
        super().__init__([s for s in surfaces if s.name != Bounds.name], own)
        # Internal forces of either kind, by number, and what each compression adds to its contact's
        # N: a uniform opening of the contact is that much along it.
        self._signed = np.flatnonzero(~self.model.nonneg)
        self._compressions = np.flatnonzero(self.model.nonneg)
        gives, width = self.model.resultant_map.tocoo(), len(self.model.nonneg)
        is_normal = gives.row % len(COMPONENTS) == COLUMN["N"]
        per_unit = np.bincount(gives.col[is_normal], gives.data[is_normal], width)
        self._normal_per_unit = per_unit[self._compressions]
        size = self.model.contacts.typical_size
        self._length = np.where(self.model.is_moment[self._signed], size, 1.0)
        # Compressions that are bounded above resist any rate: at their bound where it closes them.
        most = np.full(self.model.count, np.inf)
        for surface in with_bounds(surfaces, own.contacts):
            if surface.name == Bounds.name:
                for condition in surface.conditions(own.contacts):
                    most[condition.contact] = number(condition.resistance.get(CONSTANT, 0.0))
        most = most[own.contact[self._compressions]]
        self._bounded = np.flatnonzero(np.isfinite(most))
        self._most = most[self._bounded]
        # So do rectangles that crush, where no conditions of the model's own say so.
        crushes = not own.conditions and is_weak(own.contacts).any()
        self._crushing = EffectiveRectangles.of(own.contacts) if crushes else None
        # Multipliers of resistances that grow with forces of any sign change rates that must agree
        # exactly: they are ``free`` to move with flows, the others follow from these.
        self._is_linear = np.zeros(self.resistance.size, dtype=bool)  # conditions without norms
        grows = self.resistance.matrix.tocoo()
        self._free = np.zeros(self.resistance.size, dtype=bool)
        self._free[grows.row[~self.model.nonneg[grows.col]]] = True
        for _, rows, by_norm in self.conditions:
            self._is_linear[rows] = not by_norm
        # All y is determined where it alone resists the signed rates, with no more rows than these
        # are: B' y = -r has one solution then, and the least multipliers are its polar gauges.
        has_choice = self._is_linear.any() or self._free.any()
        self._is_unique = not has_choice and self.norms.size <= len(self._signed)
        self._no_flows = np.zeros(self.norms.size), np.zeros(self.resistance.size)

    def stated(self, into: Sink, rates: Any, unit: FloatArray | None = None) -> StatedFlow:
        """States to a sink what allows ``rates`` (p,) of the internal forces, a form.

        ``unit`` (n,) is the strength of each contact, a force: the dissipation is divided by it
        contact by contact, and so becomes an opening.
        """
        each, flows = list[Any](), list[Any]()
        for cone, at, by_norm in self.conditions:
            # Of each norm flows y and a bound on their polar gauge; lambda is no less than any.
            polars = [cone.polar(into, *norm.T.shape) for norm in by_norm]
            if len(polars) == 1:
                own = polars[0][0]
            else:
                own = into.new(at.stop - at.start, nonneg=True)
                for bound, _ in polars:
                    into.nonneg(own - bound)
            each.append(own)
            for _, components in polars:
                flows.extend(components)
        # rest = rates - R' lambda + B' y, and dissipation = c' lambda - b' y
        rest, lost, multipliers, y = rates, list[Any](), None, None
        if each:
            rows, multipliers = self.resistance, stacked(each)
            per = 1.0 if unit is None else unit[rows.contact]
            rest = rest - rows.transposed @ multipliers
            lost.append((rows.constant / per) @ multipliers)
        if flows:
            rows, y = self.norms, stacked(flows)
            per = 1.0 if unit is None else unit[rows.contact]
            rest = rest + rows.transposed @ y
            lost.append((-rows.constant / per) @ y)
        # an opening that is zero or not negative
        if len(self._signed):
            into.zero(rest[self._signed])
        if len(self._compressions):
            into.nonneg(rest[self._compressions])
        total = sum(lost[1:], start=lost[0]) if lost else 0.0
        return StatedFlow(multipliers, y, total)

    def shortfall(self, rates: FloatArray, duals: Flows | None = None) -> Shortfall:
        """Returns the shortfall of relative rates (n, 6), with as little dissipation as the missing
        opening allows: exact where the conditions determine the flow, otherwise an upper bound,
        with the flows and multipliers that a solver's ``duals`` are, if there are any."""
        inner = np.asarray(self.model.resultant_map.T @ rates.ravel())
        given = None if duals is None or self._is_unique else self._of_duals(duals)
        return self._completed(inner, *(given or self._proposal(inner, is_cheap=True)))

    def opened(self, rates: FloatArray) -> Shortfall:
        """The same, with as much opening to spare as can be."""
        inner = np.asarray(self.model.resultant_map.T @ rates.ravel())
        return self._completed(inner, *self._proposal(inner, is_cheap=False))

    def shortfall_bound(self, rates: FloatArray) -> FloatArray:
        """Returns an upper bound (n,) on the missing opening, without optimisation: the flows are
        those of least norm. It is infinite where slip or twist is left that no condition resists,
        beyond rounding of rates."""
        inner = np.asarray(self.model.resultant_map.T @ rates.ravel())
        shortfall = self._completed(inner, *self._no_flows)
        # Slips and twists are compared in the user's units. That risks no proof: it serves to find
        # opening fields, which are measured again by `opened` before anything rests on them.
        is_resisted = np.abs(shortfall.unresisted).max(initial=0.0) <= 1e-12 * np.abs(rates).max()
        return shortfall.missing if is_resisted else np.full(len(shortfall.missing), np.inf)

    def _of_duals(self, duals: Flows) -> tuple[FloatArray, FloatArray] | None:
        """Returns flows (q,) and multipliers (k,) that a solver's duals are; None where they are of
        other conditions."""
        flows, multipliers = np.zeros(self.norms.size), np.zeros(self.resistance.size)
        left = {name: list(each) for name, each in duals().items()}
        for name, (_, at, by_norm) in zip(self.names, self.conditions, strict=True):
            of_rows, of_norms = left[name].pop(0) if left.get(name) else (np.zeros(0), [])
            rows = [row for norm in by_norm for row in norm]
            sizes = [at.stop - at.start, *map(len, rows)]
            if sizes != [len(values) for values in (of_rows, *of_norms)]:
                return None
            multipliers[at] = of_rows
            for row, values in zip(rows, of_norms, strict=True):
                flows[row] = values
        return flows, multipliers

    def _completed(
        self, rates: FloatArray, flows: FloatArray, multipliers: FloatArray
    ) -> Shortfall:
        """Returns what rates (p,) lack, with proposed flows (q,) and multipliers (k,) changed as
        little as makes them exact.

        Any lambda and y with polar_gauge(y) <= lambda prove a bound, but what they leave of the
        rates of signed forces must be zero: these forces have no known size or sign. Of all y, and
        lambda of resistances that grow with signed forces, that leave zero, the nearest are taken.
        Where lambda is short of the polar gauges of y then, all that a contact can bear with its
        compression alone is added (:attr:`_pressed`), which leaves signed forces as they are. What
        is negative of the rest along compressions is missing opening.
        """
        norms, resistance, free = self.norms, self.resistance, self._free
        # Signed rates are cancelled. With E of both R and B along signed forces, what is left is
        # r - E'(lambda, -y), and the least change of (lambda, -y) that cancels it is
        # E (E'E)^-1 times it. Resistances that do not grow with signed forces have rows of zeros in
        # E, and need the least multipliers only.
        multipliers = np.where(free | self._is_linear, np.maximum(multipliers, 0.0), 0.0)
        changes, is_idle, solve = self._changes
        count = len(free) if free.any() else 0
        for _ in range(3 if count else 1):  # the next ones remove the rounding of the first
            rest = rates - (resistance.transposed @ multipliers - norms.transposed @ flows)
            step = changes @ np.where(is_idle, 0.0, solve(rest[self._signed]))
            flows = flows - step[count:]
            if count:
                multipliers = multipliers + step[:count]
        # Multipliers are raised to the polar gauges: contact by contact by the least multiple of
        # ``pressed`` that does for all rows, which cancels along signed forces; where there is none
        # one by one, which leaves signed rates that count as unresisted.
        least = self._least_multipliers(flows)
        if count:
            short = np.where(free, least - multipliers, 0.0)
            pressed, contact = self._pressed, resistance.contact
            share = np.zeros(self.model.count)
            at = (short > 0.0) & (pressed > 0.0)
            np.maximum.at(share, contact[at], (1.0 + EPSILON) * short[at] / pressed[at])
            multipliers = multipliers + share[contact] * pressed
        multipliers = np.maximum(multipliers, least)
        rest = rates - (resistance.transposed @ multipliers - norms.transposed @ flows)
        # Dissipation: c' lambda - b' y, contact by contact.
        by_contact = np.zeros(self.model.count)
        np.add.at(by_contact, resistance.contact, resistance.constant * multipliers)
        np.add.at(by_contact, norms.contact, -norms.constant * flows)
        # Missing opening: the uniform one of each contact that brings the rest along all its
        # compressions up to 0. What closes where these have a bound, or crush, dissipates instead.
        missing = np.full(self.model.count, -np.inf)
        contact, opening = self.model.contact[self._compressions], rest[self._compressions]
        bounded = self._bounded
        np.add.at(by_contact, contact[bounded], self._most * np.maximum(-opening[bounded], 0.0))
        lacks = -opening / self._normal_per_unit
        lacks[bounded] = -np.inf
        np.maximum.at(missing, contact, lacks)
        if self._crushing is not None:
            weak = self._crushing.rows
            missing[weak] = -np.inf
            by_contact[weak] += self._crushing.dissipation(*self._on_rectangles(opening))
        unresisted = -rest[self._signed] * self._length
        return Shortfall(missing, unresisted, float(by_contact.sum()), by_contact, multipliers)

    def _on_rectangles(self, opening: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns openings at all compressions of the model as those in the middle of rectangles
        that crush (k,), and their slopes (k, 2) along both sides."""
        assert self._crushing is not None
        rows, contact = self._crushing.rows, self.model.contact[self._compressions]
        # a compression at (x, y) is N = 1, M1 = y, M2 = -x
        place = self.model.resultant_map[:, self._compressions]
        at = np.arange(len(contact))
        x = -np.asarray(place[len(COMPONENTS) * contact + COLUMN["M2"], at])
        y = np.asarray(place[len(COMPONENTS) * contact + COLUMN["M1"], at])

        def summed(values: FloatArray) -> FloatArray:
            return np.bincount(contact, values, self.model.count).astype(float)[rows]

        slope = [summed(v * opening) / summed(v * v) for v in (x, y)]
        return summed(opening) / summed(np.ones(len(contact))), np.stack(slope, axis=1)

    def _least_multipliers(self, flows: FloatArray) -> FloatArray:
        """Returns the least multipliers (k,) that flows (q,) permit: the largest polar gauge of a
        condition's norms, zero for a condition without norms."""
        result = np.zeros(self.resistance.size)
        for cone, at, by_norm in self.conditions:
            for norm in by_norm:
                result[at] = np.maximum(result[at], cone.polar_gauge(flows[norm]))
        return result

    @cached_property
    def _changes(self) -> tuple[sp.csr_array, BoolArray, Callable[[FloatArray], FloatArray]]:
        """The matrix E (k + q, signed forces) by which lambda and -y change the rates of signed
        forces, without the rows of lambda where no resistance grows with these; which of them no
        row changes; and a solver of E'E, with 1 on their diagonal."""
        own = self.norms.matrix
        if self._free.any():
            own = sp.vstack([self.resistance.matrix, own]).tocsr()
        own = own[:, self._signed]
        square = own.T @ own
        is_idle = square.diagonal() == 0.0
        if is_idle.any():
            square = square + sp.diags_array(is_idle.astype(float))
        return own, is_idle, splu(square.tocsc()).solve

    @cached_property
    def _pressed(self) -> FloatArray:
        """Multipliers (k,) > 0 that signed forces do not see, contact by contact; zero where a
        contact does not bound them all, so that there are none.

        They are exp(-R x) where the sum of these over a contact's rows is least of all signed
        forces x: its gradient, -R' exp(-R x), is zero there. That sum is convex, and has a least
        value just where every x that lowers no resistance leaves all of them as they are: along
        any other x the sum falls or stays for ever, and there are no such multipliers (Stiemke).
        Newton's method finds it; where the gradient does not vanish there is none.
        """
        # Forces in units in which each column of R is 1 long; 1e-300 is for columns of zeros.
        rows = self.resistance.matrix[:, self._signed]
        size = np.sqrt(np.maximum(np.bincount(rows.indices, rows.data**2, rows.shape[1]), 1e-300))
        rows = (rows @ sp.diags_array(1.0 / size)).tocsr()
        x, contact = np.zeros(rows.shape[1]), self.resistance.contact
        for _ in range(_NEWTON):
            value = np.exp(-(rows @ x))
            square = rows.T @ sp.diags_array(value) @ rows
            # Damped by rounding, for it is singular along x that no resistance sees.
            damped = square + sp.diags_array(1e-14 * square.diagonal() + 1e-300)
            step = np.asarray(splu(damped.tocsc()).solve(rows.T @ value))
            along = np.zeros(self.model.count)
            np.maximum.at(along, contact, np.abs(rows @ step))
            x = x + step / np.maximum(along, 1.0)[self.model.contact[self._signed]]
        value = np.exp(-(rows @ x))
        left, of = np.zeros(self.model.count), self.model.contact[self._signed]
        np.maximum.at(left, of, np.abs(rows.T @ value))
        return np.where(self._free & (left <= ROUNDING)[contact], value, 0.0)

    def _proposal(self, rates: FloatArray, is_cheap: bool) -> tuple[FloatArray, FloatArray]:
        """Returns flows (q,) and multipliers (k,) >= 0 where the conditions leave a choice, else
        zeros: the cheap ones, with the least missing opening first and then the least dissipation,
        or those that leave most opening to spare."""
        scale = float(np.abs(rates).max())
        if self._is_unique or scale == 0.0:
            return self._no_flows
        # Rates of order 1, with dissipation as an opening: beside missing opening it has a price.
        strength, into = self._constants, Rows()
        unit = np.where(strength > 0.0, strength, 1.0)
        missing = into.new(self.model.count)
        flow = self.stated(into, self._uniform_opening @ missing + rates / scale, unit)
        priced, price = missing, 1.0  # it may be negative: then it is opening to spare
        if is_cheap and np.any(strength):  # least missing first: its price is above what it saves
            priced, price = into.new(self.model.count, nonneg=True), _PENALTY
            into.nonneg(priced - missing)
        goal = np.full(self.model.count, -price) @ priced - flow.dissipation
        program = into.written(goal).program
        _, x, _ = program.solve(settings_for("CLARABEL"))
        if x is None:
            return self._no_flows
        flows, multipliers = self._no_flows
        if flow.flows is not None:
            flows = scale * flow.flows.values(x)
        if flow.multipliers is not None:
            multipliers = np.maximum(scale * flow.multipliers.values(x), 0.0)
        return flows, multipliers

    @cached_property
    def _constants(self) -> FloatArray:
        """The sum (n,) of the sizes of all constants at each contact: a force."""
        result = np.zeros(self.model.count)
        for rows in (self.resistance, self.norms):
            np.add.at(result, rows.contact, np.abs(rows.constant))
        return result

    @cached_property
    def _uniform_opening(self) -> sp.csr_array:
        """Rates of internal forces (p, n) per uniform opening of each contact."""
        index = (self._compressions, self.model.contact[self._compressions])
        shape = (len(self.model.nonneg), self.model.count)
        return sp.csr_array((self._normal_per_unit, index), shape=shape)


class ExactFlow:
    """The exact flow rule of contacts pressed uniformly, for certificates of upper bounds: the
    missing opening is mu times the mean slip, less the opening at the corner where it is least.
    Whatever problem a mechanism came from, its bound is one of the exact limit surface.
    """

    def __init__(self, contacts: Contacts) -> None:
        self.contacts, self.edges = contacts, Edges.of(contacts)

    def mean_slip(self, rates: FloatArray) -> FloatArray:
        return self.edges.mean_slip(rates[:, :2], rates[:, COLUMN["MT"]])

    def shortfall(self, rates: FloatArray, duals: Flows | None = None) -> Shortfall:
        """Returns the shortfall of relative rates (n, 6); cohesion dissipates."""
        slip = self.mean_slip(rates)
        opening = self.contacts.corner_minimum(corner_openings(rates, self.contacts))
        lost = float((self.contacts.cohesion * self.contacts.area) @ slip)
        return Shortfall(self.contacts.friction * slip - opening, np.zeros(0), lost)

    opened = shortfall  # the rule leaves no choice

    def shortfall_bound(self, rates: FloatArray) -> FloatArray:
        return self.shortfall(rates).missing

    def of(self, rows: IntArray) -> ExactFlow:
        return ExactFlow(self.contacts.take(rows))
