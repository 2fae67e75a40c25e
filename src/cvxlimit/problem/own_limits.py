"""Brackets of problems with a user's own limits and aim, in linear rows and second-order cones.

=================  ==========================================  ==========  ========================
letter             what it is                                  shape       in the code
=================  ==========================================  ==========  ========================
x                  contact forces, V1 V2 N M1 M2 MT            (n, 6)      ``x``, ``forces``
alpha              load factor                                 number      ``alpha``, ``factor``
a, g, C, b         limits: b - a x - g alpha - C z is 0, not   (k, ...)    ``limits.matrix``,
                   negative, or in a cone                                  ``.factor``,
                                                                           ``.unknowns``, ``.right``
z                  unknowns of limits alone: the user's, and   (m,)        ``others``
                   those CVXPY makes for norms
lambda             multipliers of the limits: any of           (k,)        ``lam``
                   equations, >= 0, or in the cone
c, h, d            aim c x + h alpha + d z, which is           (6 n,), 1,  ``of_forces``,
                   maximised                                   (m,)        ``of_factor``,
                                                                           ``of_others``
u                  rates of the free blocks                    (free, 6)   ``u``
R                  dissipation of relative rates under the     number      ``dissipation``
                   flow rule
A, f_D, f_L        equilibrium A x + f_D + alpha f_L = 0                   ``statics.matrix``,
                                                                           ``.dead``, ``.live``
=================  ==========================================  ==========  ========================

*From above.* For any u and lambda every state within strength and limits has

    c x + h alpha + d z  <=  R(A' u + a' lambda - c) - f_D u + lambda b

if h = f_L u + lambda g and d = C' lambda. For forces do at least -R on the rates in brackets; there
equilibrium gives (A' u) x = -f_D u - alpha f_L u, and the limits give lambda (b - a x - g alpha -
C z) >= 0. With c = 0, d = 0 and h = 1 that bounds the load factor. If an equation gives the load
factor, it bounds any sum of forces under that load. Multipliers of solvers satisfy d = C' lambda
nearly; those that count are changed a little until they do, up to rounding.

*From below.* Forces that exceed strength or limits are mixed with a reserve: a state that is
strictly inside where they exceed. Both are first put into equilibrium, and onto equations between
forces, by the least change.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cvxlimit.base.arrays import EPSILON, ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.model.statics import BALANCED, DOF, block_sizes
from cvxlimit.problem.limits import ContactLimits
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solution.bracket import Bracket

_CORRECTIONS = 20
"""Most rounds in which multipliers are brought into their cones and back to d = C' lambda: one or
two where no unknown stands in two cones, and a dozen in chains of cones, as of powers."""


class OwnState(NamedTuple):
    """Contact forces (n, 6), or internal ones, load factor, and other unknowns (m,) of limits."""

    forces: FloatArray
    factor: float
    others: FloatArray


class OwnCertifier:
    """Certifies forces, mechanisms and multipliers under a user's own limits.

    ``certifier`` is that of the scene without these limits. Bounds hold whatever the forces, the
    mechanism and the multipliers are, and are infinite where these prove nothing. Forces satisfy an
    equation of the load factor alone exactly, others as they satisfy equilibrium.
    """

    def __init__(self, certifier: Certifier, limits: ContactLimits) -> None:
        self.certifier, self.limits = certifier, limits
        # The aim c x + h alpha + d z + constant; without one the load factor alone.
        none = np.zeros(limits.unknowns.shape[1])
        self.of_forces, self.has_aim = np.zeros(limits.matrix.shape[1]), limits.aim is not None
        self.of_factor, self.of_others, self.constant = 1.0, none, 0.0
        if limits.aim is not None:
            row, self.of_factor, self.of_others, self.constant = limits.aim
            self.of_forces = row.toarray().ravel()
        self.statics, self.strength = certifier.statics, certifier.strength
        self._in_cone = np.zeros(len(limits.right), dtype=bool)
        for at in limits.cones:
            self._in_cone[at] = True
        on_forces = np.diff(limits.matrix.indptr) > 0
        on_forces |= limits.unknowns.any(axis=1) | self._in_cone
        is_idle, idle = self._idle()
        if len(idle):
            self.strength = self.strength.without(idle)
        is_equation = limits.is_equation & ~on_forces & (limits.factor != 0.0)
        self._factor_equations = np.flatnonzero(is_equation)  # of the load factor alone
        self._other_equations = np.flatnonzero(limits.is_equation & on_forces & ~is_idle)
        self._on_factor_alone = ~on_forces
        self._abs_matrix, self._abs_unknowns = abs(limits.matrix), np.abs(limits.unknowns)
        # Where an equation gives the load factor, limits on that alone hold or not, exactly.
        self._decided = np.flatnonzero(~on_forces & (len(self._factor_equations) > 0))
        self._misses = np.array([0.0 if self._holds(j) else np.inf for j in self._decided])

    def _idle(self) -> tuple[BoolArray, IntArray]:
        """The limits (k,) that let a contact have no compression, or a tie no pull, and these
        contacts: nothing is strictly inside there, but without their forces all holds."""
        limits, contacts = self.limits, self.strength.contacts
        start, is_alone = limits.matrix.indptr, np.diff(limits.matrix.indptr) == 1
        is_alone &= ~limits.unknowns.any(axis=1) & ~self._in_cone
        is_idle = is_alone & (limits.factor == 0.0) & (limits.right == 0.0)
        of = np.zeros(len(is_idle), dtype=int)
        of[is_idle], a = limits.matrix.indices[start[:-1][is_idle]], np.zeros(len(is_idle))
        a[is_idle] = limits.matrix.data[start[:-1][is_idle]]
        contact, column = np.divmod(of, DOF)
        is_idle &= limits.is_equation | (a * contacts.sense[contact] > 0.0)
        is_idle &= column == COLUMN["N"]
        return is_idle, np.unique(contact[is_idle])

    def _holds(self, j: np.intp) -> bool:
        """True if row j, of the load factor alone, holds at the one that an equation gives."""
        given, g, b = self._factor_equations[0], self.limits.factor, self.limits.right
        missed = Fraction(g[j]) * Fraction(b[given]) / Fraction(g[given]) - Fraction(b[j])
        return missed == 0 or bool(missed < 0 and not self.limits.is_equation[j])

    @property
    def load_factor(self) -> float | None:
        """The load factor that an equation gives, None where it is free."""
        if not len(self._factor_equations):
            return None
        j = self._factor_equations[0]
        return float(self.limits.right[j] / self.limits.factor[j])

    def _slacks(
        self, x: FloatArray, alpha: float, others: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The slack (k,) of each row, and the sum of the sizes of what it is the sum of."""
        limits, flat = self.limits, x.ravel()
        slack = limits.right - limits.matrix @ flat - limits.factor * alpha
        size = self._abs_matrix @ np.abs(flat) + np.abs(limits.factor * alpha)
        size += np.abs(limits.right) + self._abs_unknowns @ np.abs(others)
        return slack - limits.unknowns @ others, size

    def excess(self, x: FloatArray, alpha: float, others: FloatArray) -> FloatArray:
        """Returns by how much forces (n, 6) at alpha exceed each limit (k,), rounded up, that of a
        cone in its first row; zero or infinity for limits on a load factor that an equation gives,
        and -1 for equations between forces, which balanced states satisfy."""
        slack, size = self._slacks(x, alpha, others)
        excess = EPSILON * size - slack
        excess[self._other_equations] = -1.0
        excess[self._decided] = self._misses
        for at in self.limits.cones:
            bound, rows = slack[at][0], slack[at][1:]
            excess[at] = -1.0
            excess[at.start] = np.linalg.norm(rows) - bound + EPSILON * size[at].sum()
        return np.asarray(excess)

    def why_open(self, bracket: Bracket) -> str:
        """Why a bound is missing, in words."""
        why = []
        if not np.isfinite(bracket.lower):
            why.append(
                "no lower bound, since no forces were found strictly inside strength and limits: "
                "together they may leave no room, as where a limit holds friction at its limit"
            )
        if not np.isfinite(bracket.upper) and self.has_aim and self.load_factor is None:
            why.append("no upper bound, since no equation gives the load factor")
        elif not np.isfinite(bracket.upper):
            why.append("no upper bound, since no mechanism was found that limits and joints allow")
        return "; ".join(why)

    def upper(self, mechanism: FloatArray, multipliers: FloatArray) -> float:
        """Returns the upper bound on the aim that rates (free blocks, 6) and multipliers (k,)
        prove; infinite if they prove none."""
        u, limits = np.reshape(mechanism, (-1, DOF)), self.limits
        lam = self._in_dual_cone(multipliers)
        if lam is None or not np.isfinite(u).all():
            return np.inf
        if not self.has_aim:  # c = 0: with everything divided by it, f_L u + lambda g becomes h = 1
            power = float(self.statics.live @ u.ravel() + limits.factor @ lam)
            if not power > 0.0:
                return np.inf
            u, lam = u / power, lam / power
        rates = (limits.matrix.T @ lam - self.of_forces).reshape(-1, DOF)
        # a point has no force but its compression, whatever limits say of others
        rates[self.strength.contacts.is_point] *= np.arange(DOF) == COLUMN["N"]
        sizes = (self._abs_matrix.T @ np.abs(lam) + np.abs(self.of_forces)).reshape(-1, DOF)
        opened = self.certifier.opened(u, (rates, sizes))
        return self._bound(opened.rates, lam, opened.dissipation) if opened.is_allowed else np.inf

    def _in_dual_cone(self, multipliers: FloatArray) -> FloatArray | None:
        """Multipliers near these that a bound may use: not negative, or in their cone, and with
        d = C' lambda, up to rounding; None if none were found."""
        limits = self.limits
        if not np.isfinite(multipliers).all():
            return None
        lam = np.array(multipliers)
        for _ in range(_CORRECTIONS):
            # what a solver leaves of multipliers that are zero takes no part
            least = ROUNDING * np.abs(lam).max(initial=0.0)
            is_plain = ~limits.is_equation & ~self._in_cone
            lam[is_plain & (lam <= least)] = 0.0
            for at in limits.cones:
                lam[at.start] = max(lam[at.start], float(np.linalg.norm(lam[at][1:])))
                if lam[at.start] <= least:
                    lam[at] = 0.0
            if not limits.unknowns.shape[1]:
                return lam
            missing = self.of_others - limits.unknowns.T @ lam
            size = self._abs_unknowns.T @ np.abs(lam) + np.abs(self.of_others)
            if (np.abs(missing) <= EPSILON * size).all():
                return lam
            # the least change relative to what they are, of rows outside cones if these can do it
            for varied in (~self._in_cone, np.ones(len(lam), dtype=bool)):
                weight = np.where(varied, np.abs(lam), 0.0)
                by_weight = limits.unknowns.T * weight
                change = weight * np.linalg.lstsq(by_weight, missing, rcond=1e-12)[0]
                if (np.abs(missing - limits.unknowns.T @ change) <= EPSILON * size).all():
                    break
            lam = lam + change
        return None

    def _bound(self, opened_u: FloatArray, lam: FloatArray, dissipation: float) -> float:
        """Returns the upper bound from rates that the flow rule allows with the multipliers, and
        their dissipation; infinite where the condition h = f_L u + lambda g cannot be satisfied.

        Where an equation gives the load factor, its multiplier satisfies the condition. Else,
        without an aim, dividing everything by f_L u + lambda g does; that would change the given c
        of an aim as well, so an aim under a free load factor has no bound.
        """
        limits, flat = self.limits, opened_u.ravel()
        weight = float(self.statics.live @ flat + limits.factor @ lam)  # f_L u + lambda g
        magnitude = float(
            np.abs(self.statics.live) @ np.abs(flat) + np.abs(limits.factor * lam).sum()
        )
        rounding = EPSILON * magnitude
        if len(self._factor_equations):
            # Row j has no forces, so a' lambda and with it the dissipation do not change; only
            # lambda b does. An equation holds with a multiplier of any sign.
            j, lam = self._factor_equations[0], lam.copy()
            lam[j] += (self.of_factor - weight) / limits.factor[j]
            rounding *= abs(float(limits.right[j] / limits.factor[j]))
        elif self.has_aim or not weight > 2.0 * rounding:
            return np.inf
        # R - f_D u + lambda b, and how much of it rounding may have lost.
        terms = np.array([dissipation, -float(self.statics.dead @ flat), float(limits.right @ lam)])
        lost = float(np.abs(self.statics.dead) @ np.abs(flat) + np.abs(limits.right * lam).sum())
        bound, lost = float(terms.sum()), EPSILON * (lost + abs(dissipation))
        if len(self._factor_equations):
            return bound + self.constant + lost + rounding
        bound /= weight
        return bound + (lost + abs(bound) * rounding) / weight

    def lower(
        self, state: OwnState, reserve: OwnState, mechanism: FloatArray | None = None,
        multipliers: FloatArray | None = None,
    ) -> float:  # fmt: skip
        """Returns the lower bound on the aim from a state, mixed with a ``reserve`` as far as it
        exceeds strength or limits.

        It is -inf if the reserve is not strictly inside wherever the state is outside, or if the
        mixture is outside where the reserve is. What rounding in equilibrium may carry, measured by
        the mechanism if there is one, is taken off.
        """
        mixed = self._mixed(state, reserve)
        if mixed is None:
            return -np.inf
        forces, factor, others = mixed.forces.ravel(), mixed.factor, mixed.others
        value = float(self.of_forces @ forces) + self.of_factor * factor + self.constant
        value += float(self.of_others @ others)
        size = np.abs(self.of_forces) @ np.abs(forces) + np.abs(self.of_others) @ np.abs(others)
        return value - EPSILON * float(size) - self._hidden(mixed, mechanism, multipliers)

    def _balanced(self, given: OwnState) -> OwnState | None:
        """The state with the least change in equilibrium, and on equations between forces; None
        where it is not, up to rounding."""
        factor = given.factor if self.load_factor is None else self.load_factor
        state, others = given.forces, given.others
        if len(others) != self.limits.unknowns.shape[1]:
            return None
        state = self.strength.balanced(state, factor, self.statics)
        rows = self._other_equations
        along = self._along if len(rows) else None
        for _ in range(0 if along is None else 2):  # as for equilibrium
            assert along is not None
            by_forces, by_others, gain = along
            slack, _ = self._slacks(state, factor, others)
            share = np.linalg.lstsq(gain, slack[rows], rcond=1e-12)[0]
            state = state + (by_forces @ share).reshape(state.shape)
            others = others + by_others @ share
        slack, size = self._slacks(self.strength.forces(state), factor, others)
        is_on = (np.abs(slack[rows]) <= BALANCED * size[rows]).all()
        if not is_on or not self.certifier.is_balanced(state, factor):
            return None
        return OwnState(state, factor, others)

    @cached_property
    def _along(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Changes of forces (6 n, e) in equilibrium, and of other unknowns (m, e), one for each of
        the e equations between forces, and what each adds to each equation (e, e)."""
        balance, rows = self.strength.balance, self._other_equations
        if self.strength.is_internal or not balance.is_supported:
            return None
        of_forces, of_others = self.limits.matrix[rows], self.limits.unknowns[rows]
        given = balance.model.resultant_map
        internal = balance.weights[:, None] * (of_forces @ given).toarray().T
        for j in range(len(rows)):
            for _ in range(2):
                out = self.statics.matrix @ (given @ internal[:, j])
                internal[:, j] += balance.change(out)
        forces = given @ internal
        return forces, of_others.T, of_forces @ forces + of_others @ of_others.T

    def _mixed(self, state: OwnState, reserve: OwnState) -> OwnState | None:
        """Returns contact forces, load factor and other unknowns of the mixture of two states with
        the least share of the reserve that is within strength and limits; None if there is none."""
        strength = self.strength
        one, two = self._balanced(state), self._balanced(reserve)
        if one is None or two is None:
            return None
        # Excess is convex: at share s of the reserve it is at most (1 - s) y + s y_reserve. Where x
        # is outside, that is not positive from s = y / (y - y_reserve) on; where the reserve is
        # outside, which may break limits that x keeps, it is not positive up to that s.
        forces, reserve_forces = strength.forces(one.forces), strength.forces(two.forces)
        by_strength = strength.excess(one.forces), strength.excess(two.forces)
        by_limits = (
            self.excess(forces, one.factor, one.others),
            self.excess(reserve_forces, two.factor, two.others),
        )
        share, most = 0.0, 1.0
        for y, y_reserve in (by_strength, by_limits):
            is_over = y > 0.0
            if (y_reserve[is_over] >= 0.0).any():  # among them limits that exactly do not hold
                return None
            crosses = is_over | (y_reserve > 0.0)
            crossing = y[crosses] / (y - y_reserve)[crosses]
            share = max(share, float(crossing[is_over[crosses]].max(initial=0.0)))
            most = min(most, float(crossing[~is_over[crosses]].min(initial=1.0)))
        if share > most:
            return None
        return OwnState(
            forces + share * (reserve_forces - forces),
            one.factor + share * (two.factor - one.factor),
            one.others + share * (two.others - one.others),
        )

    def _hidden(
        self, mixed: OwnState, u: FloatArray | None, lam: FloatArray | None
    ) -> float:  # fmt: skip
        """Returns how much of the aim residuals that count as rounding may carry.

        `is_balanced` accepts residuals up to rounding. Times the rates of the mechanism u they are
        the aim that they could have produced, over f_L u + lambda g where there is no aim; so are
        those of equations times their multipliers.
        """
        if u is None or lam is None:
            return 0.0
        x, alpha, rows = mixed.forces, mixed.factor, self._other_equations
        u, length = np.reshape(u, (-1, DOF)), self.certifier.size  # moments over it are forces
        power = 1.0
        if not self.has_aim:
            power = float(self.statics.live @ u.ravel() + self.limits.factor @ lam)
        residual = block_sizes(self.statics.residual(x, alpha), length)
        residual += EPSILON * self.statics.acting(x, alpha, length)
        hidden = float(residual @ block_sizes(u, 1.0 / length))
        slack, size = (part[rows] for part in self._slacks(x, alpha, mixed.others))
        hidden += float(np.abs(lam[rows]) @ (np.abs(slack) + EPSILON * size))
        return hidden / power if power > 0.0 else 0.0

    def bracket(
        self, state: OwnState | None, reserve: OwnState | None, mechanism: FloatArray | None,
        multipliers: FloatArray | None,
    ) -> Bracket:  # fmt: skip
        """Returns both bounds on the aim; a side is infinite where something it needs is None.
        ``reserve`` is strictly inside where the state is outside."""
        lower, upper = -np.inf, np.inf
        if mechanism is not None and multipliers is not None:
            upper = self.upper(mechanism, multipliers)
        if not self.has_aim:  # limits on the load factor alone are bounds as they stand
            limits = self.limits
            at = self._on_factor_alone & (limits.factor > 0.0)
            upper = float((limits.right[at] / limits.factor[at]).min(initial=upper))
            if self.load_factor is not None:
                upper = min(upper, self.load_factor)
        if mechanism is not None and not (self.has_aim or np.isfinite(upper)):
            # without the limits, of which none may govern, blocks may be glued
            free = self.certifier.certificate(None, None, mechanism)
            upper = free.upper if free.upper_is_proved else np.inf
        if state is not None and reserve is not None:
            lower = self.lower(state, reserve, mechanism, multipliers)
        scaling = self.certifier.assemblage.scaling
        least = scaling.least
        if self.has_aim:  # in its own units: that of the largest force it counts
            sizes = np.abs(self.of_forces).reshape(-1, DOF) * np.repeat([1.0, scaling.length], 3)
            size = float(sizes.max()) * scaling.force / scaling.ratio + abs(self.of_factor)
            least *= size
        proofs = bool(np.isfinite(lower)), bool(np.isfinite(upper))
        return Bracket(lower, upper, *proofs, least)
