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

Contact forces then do at least -(c' lambda - b' y) of power. For the opening takes none from
compressions, and y'(B s + b) is at most polar_gauge(y) gauge(B s + b), hence at most
lambda'(R s + c). So c' lambda - b' y is the *dissipation*: what forces take up at most.

How far rates are from allowed is measured by their *shortfall*, the uniform extra opening of a
contact that would make them so: forces on it then do at least -shortfall * N of power besides.
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
from cvxlimit.model.crushing import EffectiveRectangles
from cvxlimit.model.formulations import ForceModel, corner_compressions, express, is_weak
from cvxlimit.model.sinks import Constraints, Rows, stacked
from cvxlimit.solvers import run, settings_for
from cvxlimit.surfaces.base import CONSTANT, LinearForm, YieldSurface, number
from cvxlimit.surfaces.cones import Cone, with_gauges
from cvxlimit.surfaces.coulomb import Bounds, with_bounds

_PENALTY = 10.0
"""Price of missing opening over that of dissipation as an opening. Any above 1 gives the same flow:
stone that crushes can make up for missing opening, but as no compression is above the strength,
that costs at most 1 in dissipation per unit of opening."""


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


def corner_openings(rates: FloatArray, contacts: Contacts) -> FloatArray:
    """Opening rate (m,) at every corner, for rates (n, 6): the power of a unit compression."""
    j = contacts.corner_contact
    x, y = contacts.corner_xy.T
    result: FloatArray = rates[j, COLUMN["N"]]
    return result + y * rates[j, COLUMN["M1"]] - x * rates[j, COLUMN["M2"]]


class _Forms:
    """Linear forms as rows on the internal forces: matrix @ internal + constant.

    ``forces`` are the components of ``contacts`` contacts as forms of ``width`` unknowns, the
    internal forces; ``forms`` come with the contact of each of their rows, None for one per
    contact. They stand one below the other: ``slices`` says which rows are those of each form, and
    ``contact`` has the contact of every row.
    """

    def __init__(
        self, forces: Mapping[str, Any], contacts: int, width: int,
        forms: list[tuple[LinearForm, IntArray | None]],
    ) -> None:  # fmt: skip
        every = np.arange(contacts)
        rows = [express(form, forces, at) for form, at in forms]
        ends = list(accumulate((form.size for form in rows), initial=0))
        self.slices, self.size = list(map(slice, ends, ends[1:])), ends[-1]
        whole = stacked(rows or [forces["N"][every[:0]]])  # without forms, no rows
        self.matrix, self.constant = whole.matrix(width), whole.constant
        self.contact = np.concatenate(
            [every[:0], *(every if at is None else at for _, at in forms)]
        )
        self.transposed: sp.csc_array = self.matrix.T


class StrengthRows:
    """Conditions of several surfaces, and of a model itself, as rows on its internal forces.

    Attributes
    ----------
    resistance, norms : rows R, c and B, b of all conditions
        Each has ``matrix``, its transpose ``transposed``, ``constant`` and ``contact``, the contact
        of every row.
    conditions : list of (cone, slice, list of lists of slices)
        Of every condition the cone, its rows of ``resistance``, and for each of its norms those of
        ``norms``, one slice per component of the norm.
    """

    def __init__(self, surfaces: Sequence[YieldSurface], model: ForceModel) -> None:
        self.model, stated = model, model.strength(surfaces)
        resistances: list[tuple[LinearForm, IntArray | None]] = []
        norms: list[tuple[LinearForm, IntArray | None]] = []
        for _, condition, _ in stated:
            resistance, rows = condition.at_present()
            resistances.append((resistance, condition.contact))
            norms += zip(rows, repeat(condition.contact))
        unknowns = Rows()
        forces, _ = model.unknowns(unknowns)
        count, width = model.count, unknowns.width
        self.resistance = _Forms(forces, count, width, resistances)
        self.norms = _Forms(forces, count, width, norms)
        # Forms were collected condition by condition, so their slices come in that order.
        self.conditions: list[tuple[Cone, slice, list[list[slice]]]] = []
        of_norms = iter(self.norms.slices)
        for (_, condition, cone), at in zip(stated, self.resistance.slices, strict=True):
            by_norm = [list(islice(of_norms, len(norm.rows))) for norm in condition.norms]
            self.conditions.append((cone, at, by_norm))

    def excess(self, *states: FloatArray) -> list[FloatArray]:
        """Yield functions (k,) of each of some states, internal forces (p,), row by row of the
        resistances; <= 0 is admissible."""
        resistance, norms = self.resistance, self.norms
        excess = [-(resistance.matrix @ state + resistance.constant) for state in states]
        components = [norms.matrix @ state + norms.constant for state in states]
        return with_gauges(self.conditions, components, excess)


@dataclass(frozen=True, eq=False)
class SymbolicFlow:
    """The flow rule for CVXPY: ``limits`` that allow rates, their ``dissipation``, and lambda and y
    as unknowns; None where there are no rows."""

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
            for condition in (
                surface.conditions(own.contacts) if surface.name == Bounds.name else ()
            ):
                most[condition.contact] = number(condition.resistance.get(CONSTANT, 0.0))
        most = most[own.contact[self._compressions]]
        self._bounded = np.flatnonzero(np.isfinite(most))
        self._most = most[self._bounded]
        # So do rectangles that crush, where no conditions of the model's own say so.
        crushes = not own.conditions and is_weak(own.contacts).any()
        self._crushing = EffectiveRectangles.of(own.contacts) if crushes else None
        # Norm rows of conditions whose resistance grows with forces of any sign are coupled. Their
        # multipliers change rates that must agree exactly, so their flows are left as proposed and
        # the others make up for them.
        self._is_linear = np.zeros(self.resistance.size, dtype=bool)  # conditions without norms
        self._is_coupled = np.zeros(self.norms.size, dtype=bool)
        grows = self.resistance.matrix.tocoo()
        is_signed = np.zeros(self.resistance.size, dtype=bool)
        is_signed[grows.row[~self.model.nonneg[grows.col]]] = True
        for _, rows, by_norm in self.conditions:
            self._is_linear[rows] = not by_norm
            for row in chain(*by_norm):
                self._is_coupled[row] = is_signed[rows].any()
        # All y is determined where it alone resists the signed rates, with no more rows than these
        # are: B' y = -r has one solution then, and the least multipliers are its polar gauges.
        has_choice = self._is_linear.any() or self._is_coupled.any()
        self._is_unique = not has_choice and self.norms.size <= len(self._signed)
        self._no_flows = np.zeros(self.norms.size), np.zeros(self.resistance.size)

    def symbolic(self, rates: cp.Expression, unit: FloatArray | None = None) -> SymbolicFlow:
        """States for CVXPY what allows ``rates`` (p,) of the internal forces, and their
        dissipation.

        ``unit`` (n,) is the strength of each contact, a force: the dissipation is divided by it
        contact by contact, and so becomes an opening.
        """
        # rest = rates - R' lambda + B' y, and dissipation = c' lambda - b' y
        unknowns: list[Any] = []
        rest, dissipation = rates, cp.Constant(0.0)
        for sign, rows in ((1.0, self.resistance), (-1.0, self.norms)):
            if not rows.size:
                unknowns.append(None)
                continue
            unknown = cp.Variable(rows.size, nonneg=sign > 0.0)
            unknowns.append(unknown)
            rest = rest - sign * rows.transposed @ unknown
            per = 1.0 if unit is None else unit[rows.contact]
            dissipation = dissipation + sign * (rows.constant / per) @ unknown
        multipliers, flows = unknowns
        # polar_gauge(y) <= lambda, and an opening that is zero or not negative
        into = Constraints()
        for cone, at, by_norm in self.conditions:
            for norm in by_norm:
                cone.polar_epigraph(into, multipliers[at], [flows[row] for row in norm])
        if len(self._signed):
            into.zero(rest[self._signed])
        if len(self._compressions):
            into.nonneg(rest[self._compressions])
        return SymbolicFlow(into.all, dissipation, multipliers, flows)

    def shortfall(self, rates: FloatArray) -> Shortfall:
        """Returns the shortfall of relative rates (n, 6), with as little dissipation as the missing
        opening allows: exact where the conditions determine the flow, otherwise an upper bound."""
        inner = np.asarray(self.model.resultant_map.T @ rates.ravel())
        return self._completed(inner, *self._proposal(inner, is_cheap=True))

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

    def _completed(
        self, rates: FloatArray, flows: FloatArray, multipliers: FloatArray
    ) -> Shortfall:
        """Returns what rates (p,) lack, with proposed flows (q,) changed as little as makes them
        exact; ``multipliers`` (k,) are those of conditions without norms, zero elsewhere.

        Any lambda and y with polar_gauge(y) <= lambda prove a bound, but what they leave of the
        rates of signed forces must be zero: these forces have no known size or sign. Rows G of
        norms that are not coupled can see to that by themselves, since their multipliers do not
        touch signed forces: of all y that leave zero, y + G (G'G)^-1 (-rest - G' y) is the nearest
        one, with the rest that all other terms leave. Then the least multipliers that y permits are
        its polar gauges. What is negative of the rest along compressions is missing opening.
        """
        norms, resistance = self.norms, self.resistance
        # The rest of all terms but those of G, along signed forces.
        rest, coupled = rates, np.where(self._is_coupled, flows, 0.0)
        if multipliers.any():
            rest = rest - resistance.transposed @ multipliers
        others = rest
        if coupled.any():
            others = rest + norms.transposed @ coupled
            others = others - resistance.transposed @ self._least_multipliers(coupled)
        # The nearest flows, where rows of G resist at all, and their multipliers.
        uncoupled, is_idle, solve = self._uncoupled
        change = -others[self._signed] - uncoupled.T @ flows
        flows = flows + uncoupled @ np.where(is_idle, 0.0, solve(change))
        least = self._least_multipliers(flows)
        rest = rest - (resistance.transposed @ least - norms.transposed @ flows)
        multipliers = least + multipliers
        # Dissipation c' lambda - b' y, contact by contact.
        by_contact = np.zeros(self.model.count)
        np.add.at(by_contact, resistance.contact, resistance.constant * multipliers)
        np.add.at(by_contact, norms.contact, -norms.constant * flows)
        # The uniform opening of each contact that brings the rest along all compressions up to 0.
        missing = np.full(self.model.count, -np.inf)
        contact, opening = self.model.contact[self._compressions], rest[self._compressions]
        bounded = self._bounded
        np.add.at(by_contact, contact[bounded], self._most * np.maximum(-opening[bounded], 0.0))
        lacks = -opening / self._normal_per_unit
        lacks[bounded] = -np.inf
        np.maximum.at(missing, contact, lacks)
        if (crushing := self._crushing) is not None:
            missing[crushing.rows] = -np.inf
            by_contact[crushing.rows] += crushing.dissipation(*self._on_rectangles(opening))
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
        x = -np.asarray(place[6 * contact + COLUMN["M2"], at])
        y = np.asarray(place[6 * contact + COLUMN["M1"], at])

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
                gauge = cone.polar_gauge([flows[row] for row in norm])
                result[at] = np.maximum(result[at], gauge)
        return result

    @cached_property
    def _uncoupled(self) -> tuple[sp.csr_array, BoolArray, Callable[[FloatArray], FloatArray]]:
        """Rows G (q, signed forces) of norms, zero where coupled; which signed forces stand in none
        of them; and a solver of G'G, with 1 on the diagonal of these."""
        uncoupled = self.norms.matrix[:, self._signed]
        if self._is_coupled.any():
            uncoupled = uncoupled.multiply(~self._is_coupled[:, None]).tocsr()
        square = uncoupled.T @ uncoupled
        is_idle = square.diagonal() == 0.0
        if is_idle.any():
            square = square + sp.diags_array(is_idle.astype(float))
        return uncoupled, is_idle, splu(square.tocsc()).solve

    def _proposal(self, rates: FloatArray, is_cheap: bool) -> tuple[FloatArray, FloatArray]:
        """Returns flows (q,) where the conditions leave a choice, else zeros, and the multipliers
        (k,) >= 0 of conditions without norms: the cheap ones, with the least missing opening first
        and then the least dissipation, or those that leave most opening to spare."""
        scale = float(np.abs(rates).max())
        if self._is_unique or scale == 0.0:
            return self._no_flows
        # Rates of order 1, with dissipation as an opening: beside missing opening it has a price.
        strength = self._strength
        missing = cp.Variable(self.model.count)
        unit = np.where(strength > 0.0, strength, 1.0)
        flow = self.symbolic(rates / scale + self._uniform_opening @ missing, unit)
        if not is_cheap:  # missing may be negative: then it is opening to spare
            goal = cp.sum(missing) + flow.dissipation
        elif np.any(strength):  # least missing first, since its price is above what it can save
            goal = _PENALTY * cp.sum(cp.pos(missing)) + flow.dissipation
        else:  # without strength the dissipation is zero
            goal = cp.sum(missing)
        problem = cp.Problem(cp.Minimize(goal), flow.limits)
        if not run(problem, settings_for("CLARABEL"), ignore_dpp=True).has_values:
            return self._no_flows
        flows, multipliers = self._no_flows
        if flow.flows is not None:
            flows = scale * flow.flows.value
        if flow.multipliers is not None:
            multipliers = scale * np.maximum(flow.multipliers.value, 0.0) * self._is_linear
        return flows, multipliers

    @cached_property
    def _strength(self) -> FloatArray:
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
