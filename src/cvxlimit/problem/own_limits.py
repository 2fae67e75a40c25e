"""Brackets of problems with a user's own linear limits and own linear aim.

=================  ==========================================  ==========  ========================
letter             what it is                                  shape       in the code
=================  ==========================================  ==========  ========================
x                  contact forces, V1 V2 N M1 M2 MT            (n, 6)      ``x``, ``forces``
alpha              load factor                                 number      ``alpha``, ``factor``
a, g, b            limits a x + g alpha <= b, or = b           (m, ...)    ``limits.matrix``,
                                                                           ``.factor``, ``.right``
lambda             multipliers of the limits, >= 0 but for     (m,)        ``lam``
                   those of equations
c, k               aim c x + k alpha, which is maximised       (6 n,), 1   ``of_forces``,
                                                                           ``of_factor``
u                  rates of the free blocks                    (free, 6)   ``u``
R                  dissipation of relative rates under the     number      ``dissipation``
                   flow rule
A, f_D, f_L        equilibrium A x + f_D + alpha f_L = 0                   ``statics.matrix``,
                                                                           ``.dead``, ``.live``
=================  ==========================================  ==========  ========================

*From above.* For any u and lambda every state within strength and limits has

    c x + k alpha  <=  R(A' u + a' lambda - c) - f_D u + lambda b    if  k = f_L u + lambda g.

For forces do at least -R on the rates in brackets; there equilibrium gives (A' u) x =
-f_D u - alpha f_L u, and the limits give lambda (a x) <= lambda (b - g alpha). With c = 0 and k = 1
that bounds the load factor. If an equation gives the load factor, it bounds any sum of forces under
that load.

*From below.* Forces in exact equilibrium that exceed strength or limits are mixed with a reserve: a
state that is strictly inside where they exceed.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from cvxlimit.base.arrays import EPSILON, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.model.statics import DOF, block_sizes
from cvxlimit.problem.limits import LinearLimits
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solution.bracket import Bracket


class OwnCertifier:
    """Certifies forces, mechanisms and multipliers under a user's own limits.

    ``certifier`` is that of the scene without these limits. Bounds hold whatever the forces, the
    mechanism and the multipliers are, and are infinite where these prove nothing. Forces satisfy an
    equation of the load factor alone exactly; with other equations there is no bound from below.
    """

    def __init__(self, certifier: Certifier, limits: LinearLimits) -> None:
        self.certifier, self.limits = certifier, limits
        # The aim c x + k alpha + constant; without one the load factor alone.
        row, self.of_factor, self.constant = limits.aim or (None, 1.0, 0.0)
        self.of_forces = np.zeros(limits.matrix.shape[1])
        if row is not None:
            self.of_forces = row.toarray().ravel()
        self.has_aim = row is not None
        self.statics, self.strength = certifier.statics, certifier.strength
        is_idle, idle = self._idle()
        if len(idle):
            self.strength = self.strength.without(idle)
        on_forces = np.diff(limits.matrix.indptr) > 0
        is_equation = limits.is_equation & ~on_forces & (limits.factor != 0.0)
        self._factor_equations = np.flatnonzero(is_equation)  # of the load factor alone
        self._other_equations = np.flatnonzero(limits.is_equation & on_forces & ~is_idle)
        self._abs_matrix = abs(limits.matrix)
        # Where an equation gives the load factor, limits on that alone hold or not, exactly.
        self._decided = np.flatnonzero(~on_forces & (len(self._factor_equations) > 0))
        self._misses = np.array([0.0 if self._holds(j) else np.inf for j in self._decided])

    def _idle(self) -> tuple[BoolArray, IntArray]:
        """The limits (m,) that let a contact have no compression, or a tie no pull, and these
        contacts (k,): nothing is strictly inside there, but without their forces all holds."""
        limits, contacts = self.limits, self.strength.contacts
        start, is_alone = limits.matrix.indptr, np.diff(limits.matrix.indptr) == 1
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

    def excess(self, x: FloatArray, alpha: float) -> FloatArray:
        """Returns by how much forces (n, 6) at alpha exceed each limit (m,), rounded up; zero or
        infinity for limits on a load factor that an equation gives."""
        limits, flat = self.limits, x.ravel()
        magnitude = self._abs_matrix @ np.abs(flat) + np.abs(limits.factor * alpha)
        magnitude += np.abs(limits.right)
        excess = limits.matrix @ flat + limits.factor * alpha - limits.right + EPSILON * magnitude
        excess[self._decided] = self._misses
        return np.asarray(excess)

    def why_open(self, bracket: Bracket) -> str:
        """Why a bound is missing, in words."""
        why = []
        if not np.isfinite(bracket.lower) and len(self._other_equations):
            name = self.limits.names[self._other_equations[0]]
            why.append(f"no lower bound, since forces miss the equation {name!r} by rounding")
        elif not np.isfinite(bracket.lower):
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
        """Returns the upper bound on the aim that rates (free blocks, 6) and multipliers (m,)
        prove; infinite if they prove none."""
        u, limits = np.reshape(mechanism, (-1, DOF)), self.limits
        lam = np.where(limits.is_equation, multipliers, np.maximum(multipliers, 0.0))
        if not (np.isfinite(u).all() and np.isfinite(lam).all()):
            return np.inf
        if not self.has_aim:  # c = 0: with everything divided by it, f_L u + lambda g becomes k = 1
            power = float(self.statics.live @ u.ravel() + limits.factor @ lam)
            if not power > 0.0:
                return np.inf
            u, lam = u / power, lam / power
        rates = (limits.matrix.T @ lam - self.of_forces).reshape(-1, DOF)
        sizes = (self._abs_matrix.T @ np.abs(lam) + np.abs(self.of_forces)).reshape(-1, DOF)
        opened = self.certifier.opened(u, (rates, sizes))
        return self._bound(opened.rates, lam, opened.dissipation) if opened.is_allowed else np.inf

    def _bound(self, opened_u: FloatArray, lam: FloatArray, dissipation: float) -> float:
        """Returns the upper bound from rates that the flow rule allows with the multipliers, and
        their dissipation; infinite where the condition k = f_L u + lambda g cannot be satisfied.

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
        self, x: FloatArray, alpha: float, reserve: FloatArray, reserve_factor: float,
        mechanism: FloatArray | None = None, multipliers: FloatArray | None = None,
    ) -> float:  # fmt: skip
        """Returns the lower bound on the aim from a state x at alpha, mixed with the state
        ``reserve`` at load factor ``reserve_factor`` as far as x exceeds strength or limits.

        It is -inf if the reserve is not strictly inside wherever x is outside, or if the mixture is
        outside where the reserve is. What rounding in equilibrium may carry, measured by the
        mechanism if there is one, is taken off.
        """
        mixed = self._mixed(x, alpha, reserve, reserve_factor)
        if mixed is None:
            return -np.inf
        forces, factor = mixed[0].ravel(), mixed[1]  # admissible, and in equilibrium
        value = float(self.of_forces @ forces) + self.of_factor * factor + self.constant
        value -= EPSILON * float(np.abs(self.of_forces) @ np.abs(forces))
        return value - self._hidden(*mixed, mechanism, multipliers)

    def _mixed(
        self, x: FloatArray, alpha: float, reserve: FloatArray, reserve_factor: float
    ) -> tuple[FloatArray, float] | None:
        """Returns contact forces (n, 6) and load factor of the mixture of two states with the least
        share of the reserve that is within strength and limits; None if there is none."""
        if len(self._other_equations):
            return None
        # Both states in equilibrium with their loads, at the load factor of an equation if any.
        certifier, strength = self.certifier, self.strength
        if self.load_factor is not None:
            alpha = reserve_factor = self.load_factor
        x, reserve = (
            strength.balanced(state, factor, self.statics)
            for state, factor in ((x, alpha), (reserve, reserve_factor))
        )
        is_balanced = certifier.is_balanced
        if not (is_balanced(x, alpha) and is_balanced(reserve, reserve_factor)):
            return None
        # Excess is convex: at share s of the reserve it is at most (1 - s) y + s y_reserve. Where x
        # is outside, that is not positive from s = y / (y - y_reserve) on; where the reserve is
        # outside, which may break limits that x keeps, it is not positive up to that s.
        forces, reserve_forces = strength.forces(x), strength.forces(reserve)
        by_strength = zip(strength.excess(x), strength.excess(reserve), strict=True)
        by_limits = self.excess(forces, alpha), self.excess(reserve_forces, reserve_factor)
        share, most = 0.0, 1.0
        for y, y_reserve in [*by_strength, by_limits]:
            is_over = y > 0.0
            if (y_reserve[is_over] >= 0.0).any():  # among them limits that exactly do not hold
                return None
            crosses = is_over | (y_reserve > 0.0)
            crossing = y[crosses] / (y - y_reserve)[crosses]
            share = max(share, float(crossing[is_over[crosses]].max(initial=0.0)))
            most = min(most, float(crossing[~is_over[crosses]].min(initial=1.0)))
        if share > most:
            return None
        factor = alpha + share * (reserve_factor - alpha)
        return forces + share * (reserve_forces - forces), factor

    def _hidden(
        self, x: FloatArray, alpha: float, u: FloatArray | None, lam: FloatArray | None
    ) -> float:
        """Returns how much of the aim residuals that count as rounding may carry.

        `is_balanced` accepts residuals up to rounding. Times the rates of the mechanism u they are
        the aim that they could have produced, over f_L u + lambda g where there is no aim.
        """
        if u is None or lam is None:
            return 0.0
        u, length = np.reshape(u, (-1, DOF)), self.certifier.size  # moments over it are forces
        power = 1.0
        if not self.has_aim:
            power = float(self.statics.live @ u.ravel() + self.limits.factor @ lam)
        residual = block_sizes(self.statics.residual(x, alpha), length)
        residual += EPSILON * self.statics.acting(x, alpha, length)
        hidden = float(residual @ block_sizes(u, 1.0 / length))
        return hidden / power if power > 0.0 else 0.0

    def bracket(
        self, x: FloatArray | None, alpha: float | None, reserve: tuple[FloatArray, float] | None,
        mechanism: FloatArray | None, multipliers: FloatArray | None,
    ) -> Bracket:  # fmt: skip
        """Returns both bounds on the aim; a side is infinite where something it needs is None.
        ``reserve`` is a state, and its load factor: strictly inside where x is outside."""
        lower, upper = -np.inf, np.inf
        if mechanism is not None and multipliers is not None:
            upper = self.upper(mechanism, multipliers)
        if x is not None and alpha is not None and reserve is not None:
            lower = self.lower(x, alpha, *reserve, mechanism, multipliers)
        scaling = self.certifier.assemblage.scaling
        least = scaling.least
        if self.has_aim:  # in its own units: that of the largest force it counts
            sizes = np.abs(self.of_forces).reshape(-1, DOF) * np.repeat([1.0, scaling.length], 3)
            size = float(sizes.max()) * scaling.force / scaling.ratio + abs(self.of_factor)
            least *= size
        proofs = bool(np.isfinite(lower)), bool(np.isfinite(upper))
        return Bracket(lower, upper, *proofs, least)
