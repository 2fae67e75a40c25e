"""Brackets for limits and aims of one's own: linear ones, by the inequalities of virtual work.

To a x + g alpha <= b belongs a multiplier lambda >= 0, of either sign for an equation. For any
block rates u, and with R the dissipation of the flow rule, every state that keeps to the limits has

    c x + k alpha  <=  R(A' u + a' lambda - c) - f_D u + lambda b
                       if   k = f_L u + lambda g,

for A x + f_D + alpha f_L = 0 does no work on u, and the forces that are left do at least -R. With
c = 0 and k = 1 that bounds the load factor, whatever limits there are; with the load factor given
by an equation it bounds any force, or sum of forces, under that load. From below, forces in exact
equilibrium that exceed strength or limits are mixed with a state that is strictly inside both.
"""

from __future__ import annotations

import numpy as np

from cvxlimit.base.arrays import EPSILON, FloatArray
from cvxlimit.model.limits import LinearLimits
from cvxlimit.model.statics import DOF, block_sizes
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solution.bracket import Bracket


class OwnCertifier:
    """Certifies forces, mechanisms and multipliers under limits of one's own.

    ``certifier`` is that of the scene without them. Nothing that a solver says is trusted: bounds
    hold whatever forces, mechanism and multipliers are, and are infinite where these show nothing.
    Equations of the load factor alone are kept to exactly; others have no bound from below.
    """

    def __init__(self, certifier: Certifier, limits: LinearLimits) -> None:
        self.certifier, self.limits = certifier, limits
        # the weights c of forces and k of the load factor in what is maximised, and its constant
        row, self.of_factor, self.constant = limits.aim or (None, 1.0, 0.0)
        self.of_forces = np.zeros(limits.matrix.shape[1])
        if row is not None:
            self.of_forces = row.toarray().ravel()
        self.has_aim = row is not None
        self.statics, self.strength = certifier.statics, certifier.strength
        on_forces = np.diff(limits.matrix.indptr) > 0
        self._given = np.flatnonzero(limits.is_equation & ~on_forces & (limits.factor != 0.0))
        self._has_other_equations = bool((limits.is_equation & on_forces).any())
        self._matrix_sizes = abs(limits.matrix)

    @property
    def load_factor(self) -> float | None:
        """The load factor that an equation gives, None where it is free."""
        if not len(self._given):
            return None
        j = self._given[0]
        return float(self.limits.right[j] / self.limits.factor[j])

    def excess(self, x: FloatArray, alpha: float) -> FloatArray:
        """Returns by how much forces (n, 6) exceed each limit (k,), rounding against them; zero for
        the equation that gives the load factor, which is kept to."""
        limits, flat = self.limits, x.ravel()
        size = self._matrix_sizes @ np.abs(flat) + np.abs(limits.factor * alpha)
        size += np.abs(limits.right)
        over = limits.matrix @ flat + limits.factor * alpha - limits.right + EPSILON * size
        over[self._given[:1]] = 0.0
        return np.asarray(over)

    def upper(self, mechanism: FloatArray, multipliers: FloatArray) -> float:
        """No state within the limits has more: from rates (free blocks, 6) and multipliers (k,)."""
        u, limits = np.reshape(mechanism, (-1, DOF)), self.limits
        lam = np.where(limits.is_equation, multipliers, np.maximum(multipliers, 0.0))
        if not (np.isfinite(u).all() and np.isfinite(lam).all()):
            return np.inf
        if not self.has_aim:
            power = float(self.statics.live @ u.ravel() + limits.factor @ lam)
            if not power > 0.0:
                return np.inf
            u, lam = u / power, lam / power
        rates = (limits.matrix.T @ lam - self.of_forces).reshape(-1, DOF)
        sizes = (self._matrix_sizes.T @ np.abs(lam) + np.abs(self.of_forces)).reshape(-1, DOF)
        opened = self.certifier.opened(u, (rates, sizes))
        return self._bound(opened.rates, lam, opened.dissipation) if opened.is_allowed else np.inf

    def _bound(self, u: FloatArray, lam: FloatArray, dissipation: float) -> float:
        """Returns the bound that follows from rates and multipliers with this dissipation: the load
        factor's weight is made k."""
        limits, flat = self.limits, u.ravel()
        weight = float(self.statics.live @ flat + limits.factor @ lam)
        size = float(np.abs(self.statics.live) @ np.abs(flat) + np.abs(limits.factor * lam).sum())
        rounding = EPSILON * size
        if len(self._given):
            j, lam = self._given[0], lam.copy()
            lam[j] += (self.of_factor - weight) / limits.factor[j]
            rounding *= abs(float(limits.right[j] / limits.factor[j]))
        elif self.has_aim or not weight > 2.0 * rounding:
            return np.inf
        terms = np.array([dissipation, -float(self.statics.dead @ flat), float(limits.right @ lam)])
        lost = float(np.abs(self.statics.dead) @ np.abs(flat) + np.abs(limits.right * lam).sum())
        bound, lost = float(terms.sum()), EPSILON * (lost + abs(dissipation))
        if len(self._given):
            return bound + self.constant + lost + rounding
        bound /= weight
        return bound + (lost + abs(bound) * rounding) / weight

    def lower(
        self, x: FloatArray, alpha: float, reserve: FloatArray, known: float,
        mechanism: FloatArray | None = None, multipliers: FloatArray | None = None,
    ) -> float:  # fmt: skip
        """A state within the limits has at least this: of forces (n, 6) at a load factor, mixed
        with a ``reserve`` at load factor ``known`` as far as they exceed strength or limits.

        Without a reserve that is strictly inside where forces are outside there is no bound. What
        rounding in equilibrium may carry in the mechanism, if there is one, is taken off.
        """
        mixed = self._mixed(x, alpha, reserve, known)
        if mixed is None:
            return -np.inf
        forces, factor = mixed[0].ravel(), mixed[1]
        value = float(self.of_forces @ forces) + self.of_factor * factor + self.constant
        value -= EPSILON * float(np.abs(self.of_forces) @ np.abs(forces))
        return value - self._hidden(*mixed, mechanism, multipliers)

    def _mixed(
        self, x: FloatArray, alpha: float, reserve: FloatArray, known: float
    ) -> tuple[FloatArray, float] | None:
        given, strength = self.load_factor, self.strength
        if self._has_other_equations or len(self._given) > 1:
            return None
        if given is not None:
            alpha = known = given
        x, inside = (
            strength.balanced(s, a, self.statics) for s, a in ((x, alpha), (reserve, known))
        )
        certifier = self.certifier
        if not (certifier.is_balanced(x, alpha) and certifier.is_balanced(inside, known)):
            return None
        forces, kept = strength.forces(x), strength.forces(inside)
        pairs = [*zip(strength.excess(x), strength.excess(inside), strict=True)]
        share = 0.0
        for over, spare in [*pairs, (self.excess(forces, alpha), self.excess(kept, known))]:
            at = over > 0.0
            if (spare[at] >= 0.0).any():
                return None
            share = max(share, float((over[at] / (over[at] - spare[at])).max(initial=0.0)))
        return forces + share * (kept - forces), alpha + share * (known - alpha)

    def _hidden(
        self, x: FloatArray, alpha: float, u: FloatArray | None, lam: FloatArray | None
    ) -> float:
        """What residuals that count as rounding may carry: their power in the mechanism."""
        if u is None or lam is None:
            return 0.0
        u, size = np.reshape(u, (-1, DOF)), self.certifier.size
        power = 1.0
        if not self.has_aim:
            power = float(self.statics.live @ u.ravel() + self.limits.factor @ lam)
        rest = block_sizes(self.statics.residual(x, alpha), size)
        rest += EPSILON * self.statics.acting(x, alpha, size)
        hidden = float(rest @ block_sizes(u, 1.0 / size))
        return hidden / power if power > 0.0 else 0.0

    def bracket(
        self, x: FloatArray | None, alpha: float | None, reserve: tuple[FloatArray, float] | None,
        mechanism: FloatArray | None, multipliers: FloatArray | None,
    ) -> Bracket:  # fmt: skip
        """Returns both bounds of the aim; infinite where something is missing."""
        lower, upper = -np.inf, np.inf
        if mechanism is not None and multipliers is not None:
            upper = self.upper(mechanism, multipliers)
        if x is not None and alpha is not None and reserve is not None:
            lower = self.lower(x, alpha, *reserve, mechanism, multipliers)
        least = self.certifier.assemblage.scaling.least
        proofs = bool(np.isfinite(lower)), bool(np.isfinite(upper))
        return Bracket(lower, upper, *proofs, least)
