"""The bracket of a load factor, recomputed in NumPy from the unscaled scene.

Nothing a solver says enters here: only forces and mechanism do, and the bounds hold whatever they
are. Solvers have returned load factors wrong by 5 % with small residuals and no duality gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import EPSILON, FloatArray, IntArray
from cvxlimit.errors import ModelError
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.flow import corner_openings
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.statics import DOF, block_sizes
from cvxlimit.proof.gluing import glued, without_idle
from cvxlimit.proof.slater import Witnesses
from cvxlimit.proof.strength import NOTHING, ContactFlow, Flow, Strength, finite
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import REFERENCE, TOLERANCE, Certificate
from cvxlimit.solvers import LimitState
from cvxlimit.surfaces.base import YieldSurface


@dataclass(frozen=True)
class _Numbers:
    """What each number is for, and where it was measured."""

    stuck: tuple[float, ...] = (1e-09, 1e-12)
    """Relative rates at a contact, over the mechanism's largest, up to which its blocks may be
    meant to move as one; both are tried. Solvers leave up to 1e-11 where nothing moves."""
    loose: float = 1e-06
    """The same where nothing else proves a bound."""
    gripping: float = 100.0
    """Friction from which that matters: the flow rule asks for an opening of friction times the
    slip, so that slips by rounding cost some of the bracket."""
    unresisted: float = 1e-10
    """Load factor, over the natural one, that rounding in equilibrium may hide where nothing
    resists: ten times what counts as balanced. The dead-load state itself carries zero."""
    price: float = 1e-06
    """What a proof may cost where a bound with an assumption is tighter, relative: a tenth of the
    width of bracket that counts as certified."""


_N = _Numbers()


_Bound = tuple[float, bool, float, float]


class Opened(NamedTuple):
    """A mechanism that the flow rule allows, or as near to it as is known.

    ``rates`` (free blocks, 6) dissipate at most ``dissipation``. What was given lacks ``missing``
    of opening in all contacts, ``violation`` in one at most.
    """

    rates: FloatArray
    dissipation: float
    is_allowed: bool
    missing: float
    violation: float


class Certifier:
    """Certifies forces and mechanisms of one scene under given surfaces.

    *Lower bound.* The forces x at load factor alpha are first brought into exact equilibrium (the
    least change). If they then exceed a yield function by y, and the dead-load state x_d (exactly
    in equilibrium, strictly inside) keeps a reserve m there, the mixture (1 - t) x + t x_d with
    t = max y / (y + m) is admissible, so (1 - t) alpha is a lower bound. Where the dead load stands
    only together with a part of the live load, x_d carries a factor alpha_d of its own, and
    (1 - t) alpha + t alpha_d is the bound.

    *Upper bound.* The mechanism u, scaled to live power 1, misses openings s at contacts. If a
    field u_0 opens every contact with r to spare, u + t u_0 with t = max s / r is admissible,
    and the ratio of dead to live power bounds the load factor. Surfaces with constants (cohesion)
    add their dissipation to the dead load's power.

    Where x_d or u_0 do not exist (a dead load about to fall; blocks wedged between supports),
    the violations are weighted by :data:`REFERENCE` forces and rates, and the certificate says
    that the bound rests on that assumption. Where they do exist the proof is never given up for
    a tighter bound with the assumption, which a pebble on a boulder breaks.

    ``formulation`` matters where it states conditions of its own: forces are then its internal
    ones. ``flow`` replaces the flow rule in upper bounds; any sublinear shortfall does. Where the
    bracket is wider than the relative ``width`` that is wanted, the lower bound is sought without
    the contacts that carry next to nothing as well.
    """

    def __init__(
        self,
        scene: Scene | Assemblage,
        surfaces: Sequence[YieldSurface],
        formulation: Formulation = corner_compressions,
        flow: ContactFlow | None = None,
        width: float = TOLERANCE,
    ) -> None:
        if isinstance(surfaces, str):
            raise ModelError(
                "surfaces must be a list of YieldSurface objects, as [Rocking(), TorsionShear()], "
                f"got the name {surfaces!r}"
            )
        self.assemblage = Assemblage.of(scene)
        self.statics = self.assemblage.statics
        if flow is None:
            self.strength = Strength.shared(self.assemblage, surfaces, formulation)
        else:
            self.strength = Strength(self.assemblage, surfaces, formulation, flow)
        self.witnesses = Witnesses(self.assemblage, self.strength)
        self.surfaces, self.formulation = tuple(surfaces), formulation
        self._can_reduce, self._width, self._flow = True, width, flow
        self.size = self.statics.contacts.typical_size

    def with_flow(self, flow: Flow) -> Certifier:
        """The same under another flow rule; reference states are kept, not sought again."""
        result = copy(self)
        result.strength = copy(self.strength)
        result.strength.flow = flow
        result._can_reduce = False
        result.witnesses = copy(self.witnesses)
        result.witnesses.strength = result.strength
        return result

    def start_from(self, before: Certifier) -> None:
        """Take over reference states of the same blocks under other strengths and loads, as far as
        they still prove anything: seeking them takes half of a certificate's time."""
        dead, field = before.witnesses.known_dead_state, before.witnesses.known_opening_field
        if dead is not None:
            is_same = np.array_equal(self.statics.dead, before.statics.dead)  # and balanced already
            balanced = dead if is_same else self.strength.balanced(dead, 0.0, self.statics)
            is_sound = np.isfinite(balanced).all() and self.is_balanced(balanced, 0.0)
            if is_sound and self._reserve(balanced) > 0.0:
                self.witnesses.dead_state = balanced
        self.witnesses.borrowed_field = field  # whether it opens here is checked where it is used

    def offer_dead_state(self, forces: ArrayLike, factor: float = 0.0) -> bool:
        """True if forces (n, 6) carry the dead load strictly inside; the best so far are kept.

        They are not trusted: they are put into equilibrium, and must be inside after that. Where
        they carry ``factor`` times the live load besides, this factor is put into balance with them
        and replaces whatever was known.

        Raises
        ------
        ModelError
            If there is not one row per contact.
        """
        given = self.strength.state(forces)
        if given is None:
            return False
        if factor:
            factor = self.strength.balancing(given, factor, self.statics)
        balanced = self.strength.balanced(given, factor, self.statics)
        if not (np.isfinite(balanced).all() and self.is_balanced(balanced, factor)):
            return False
        reserve = self._reserve(balanced)
        present = None if factor else self.witnesses.easy_dead_state
        if reserve > (0.0 if present is None else self._reserve(present)):
            self.witnesses.dead_state, self.witnesses.factor = balanced, factor
        return reserve > 0.0

    def offer_opening_field(self, rates: ArrayLike) -> bool:
        """True if block rates (free, 6) open every contact; then they are kept.

        Raises
        ------
        ModelError
            If there is not one row per free block.
        """
        given = self._rates(rates)
        opens = given is not None and bool(self._spare_opening(given).min() > 0.0)
        if opens:
            self.witnesses.opening_field = given
        return opens

    def _spare_opening(self, rates: FloatArray) -> FloatArray:
        """What rates open contacts more than the flow rule asks for, (n,), less rounding.

        Nothing is spare where no surface resists some of the slip.
        """
        found = self.strength.flow.opened(self.statics.relative_rates(rates))
        spare: FloatArray = -found.missing - self._rounding(rates)
        return np.where(_is_resisted(found.unresisted, rates), spare, -np.inf)

    def _reserve(self, forces: FloatArray) -> float:
        """Least distance from yield, as a force; negative outside."""
        found = np.concatenate(self.strength.excess(forces))
        return -float(found.max(initial=-np.inf, where=found != -NOTHING))

    def certificate(
        self, forces: ArrayLike | None, load_factor: float | None, mechanism: ArrayLike | None
    ) -> Certificate:
        """The bracket from forces (n, 6) at ``load_factor`` and a mechanism (free blocks, 6).

        Forces are internal ones (p,) where the formulation states conditions of its own. Either
        side may be None: its bound is then infinite. Numbers that are not finite give infinite
        bounds as well.

        Raises
        ------
        ModelError
            If an array does not have the scene's number of contacts or free blocks.
        """
        x = self.strength.state(forces)
        u = self._rates(mechanism)
        lower: _Bound = (-np.inf, False, np.nan, np.nan)
        upper: _Bound = (np.inf, False, np.nan, np.nan)
        rate = self._largest_rate(u) if u is not None else np.inf
        if u is not None:
            upper = self._upper(u, self._largest_force(x), rate)
            if not upper[1] or self.statics.contacts.friction.max() > _N.gripping:
                for share in _N.stuck:
                    upper = _better(upper, self._upper_as_glued(u, x, share), -1.0)
                if not upper[1]:
                    upper = _better(upper, self._upper_as_glued(u, x, _N.loose), -1.0)
        if x is not None and load_factor is not None and np.isfinite(load_factor):
            rate = max(rate, self.statics.rate_of_the_lightest(self.size))
            lower = self._lower(x, load_factor, rate, u)
            end = upper[0] if np.isfinite(upper[0]) else load_factor
            if not lower[1] or end - lower[0] > self._width * abs(end):
                lower = _better(lower, self._lower_without_idle(x, load_factor, rate, u), 1.0)
        return Certificate(
            lower[0], upper[0], lower[1], upper[1], self.assemblage.scaling.least,
            lower[2], lower[3], upper[2], upper[3],
        )  # fmt: skip

    def of(self, state: LimitState) -> Certificate:
        """The bracket of a solver's answer."""
        return self.certificate(self.given(state), state.load_factor, state.mechanism)

    def given(self, state: LimitState) -> FloatArray | None:
        """The forces of a solver's answer, in the form that is checked."""
        return state.internal if self.strength.is_internal else state.forces

    def residuals(self, x: FloatArray, alpha: float) -> tuple[float, float]:
        """Largest residual of equilibrium and yield excess of a state, over the total load."""
        load = self._total_load(alpha)
        rest = block_sizes(self.statics.residual(self.strength.forces(x), alpha), self.size)
        excess = max(0.0, *(float(y.max()) for y in self.strength.excess(x)))
        return float(rest.max()) / load, excess / load

    def _rates(self, mechanism: ArrayLike | None) -> FloatArray | None:
        if isinstance(mechanism, np.ndarray) and mechanism.size == len(self.statics.dead):
            mechanism = mechanism.reshape(-1, DOF)
        return finite(mechanism, (len(self.statics.dead) // DOF, DOF), "free block")

    def _lower(
        self, x: FloatArray, alpha: float, rate: float, u: FloatArray | None = None
    ) -> _Bound:
        residual, excess = self.residuals(x, alpha)
        x = self.strength.balanced(x, alpha, self.statics)
        if not np.isfinite(x).all():
            return -np.inf, False, residual, excess
        # without a reserve what is left over is weighted by the largest rate there may be
        rest = block_sizes(self.statics.residual(self.strength.forces(x), alpha), self.size).sum()
        found = self.strength.excess(x)
        over = sum(float(np.maximum(y, 0.0).sum()) for y in found)
        error = (rest + over) * REFERENCE * rate if rest + over > 0.0 else 0.0
        assumed = alpha - error if np.isfinite(error) else -np.inf
        reserve, known = self.witnesses.dead_state, self.witnesses.factor
        is_balanced = self.is_balanced(x, alpha)
        if reserve is None or not (is_balanced and self.is_balanced(reserve, known)):
            return assumed, False, residual, excess
        # so much of the reserve brings the mixture inside all surfaces
        share = 0.0
        for y, inside in zip(found, self.strength.excess(reserve), strict=True):
            beyond = np.maximum(y, 0.0)
            share = max(share, float((beyond / (beyond - inside)).max()))
        lower = alpha + share * (known - alpha)
        # The load factor that residuals of the mixture which count as rounding may carry: what they
        # do in a mechanism, which is how fast the largest load factor changes with loads.
        hidden, live = 0.0, 0.0 if u is None else float(self.statics.live @ u.ravel())
        if u is not None and live > 0.0:
            forces = self.strength.forces(x + share * (reserve - x))
            idle = block_sizes(self.statics.residual(forces, lower), self.size)
            idle += EPSILON * self.statics.acting(forces, lower, self.size)
            hidden = float(idle @ block_sizes(u, 1.0 / self.size)) / live
        lower = max(known, lower - hidden) if lower > known else lower - hidden
        if self.strength.balance.held is not None:  # no reserve takes up what nothing resists
            lower = max(known, lower - _N.unresisted * self.assemblage.scaling.ratio)
        return lower, True, residual, excess

    def _lower_without_idle(
        self, x: FloatArray, alpha: float, rate: float, u: FloatArray | None
    ) -> _Bound:
        can = self._can_reduce and self._flow is None and not self.strength.is_internal
        share = EPSILON**0.5  # half the digits; a bound with fewer contacts is one with all of them
        given = without_idle(self.assemblage, x, share) if can else None
        smaller = None if given is None else self._of_less(given[0])
        if given is None or smaller is None:
            return -np.inf, False, np.nan, np.nan
        if u is not None:
            u = u[np.sort(self.statics.row_of_block[given[0].statics.row_of_block >= 0])]
        return smaller._lower(given[1], alpha, rate, u)

    def _of_less(self, less: Assemblage, contacts: IntArray | None = None) -> Certifier | None:
        flow = None if self._flow is None or contacts is None else self._flow.of(contacts)
        try:
            result = Certifier(less, self.surfaces, self.formulation, flow)
        except (ModelError, ValueError):
            return None
        result.size, result._can_reduce = self.size, False
        return result

    def _largest_force(self, x: FloatArray | None, contacts: IntArray | None = None) -> float:
        """Returns the largest force at some contacts (k,), or all: blocks that wedge each other may
        press with far more than the loads, and it shows."""
        if x is None:
            return 0.0
        sizes = block_sizes(self.strength.forces(x), self.size)
        return float((sizes if contacts is None else sizes[contacts]).max(initial=0.0))

    def _upper_as_glued(self, u: FloatArray, x: FloatArray | None, share: float) -> _Bound:
        """The bound of the same mechanism with blocks glued that hardly move against each other.

        A mechanism of blocks glued together is one of the blocks themselves, so its bound holds
        for them. The contacts inside drop out, and with them what rounding makes of their slips,
        and whatever wedges their blocks: what is left can often be opened where the whole cannot.
        """
        given = glued(self.assemblage, u, share) if self._can_reduce else None
        smaller = None if given is None else self._of_less(given[0], given[2])
        if given is None or smaller is None:
            return np.inf, False, np.nan, np.nan
        _, rates, contacts = given
        force = self._largest_force(x, contacts)
        return smaller._upper(rates, force, smaller._largest_rate(rates))

    def _upper(self, u: FloatArray, force: float, largest: float) -> _Bound:
        live = float(self.statics.live @ u.ravel())
        if not live > 0.0:
            return np.inf, False, np.nan, np.nan
        u = u / live
        opened = self.opened(u)
        violation, missing = opened.violation / largest, opened.missing
        dissipation = opened.dissipation
        # what is missing is weighted by the largest force there may be, unless it can be opened
        if not opened.is_allowed:
            bound = dissipation - float(self.statics.dead @ u.ravel())
            force = REFERENCE * max(self._total_load(bound), force)
            return bound + missing * force, False, violation, missing
        # what dissipation and dead load take of the live power, and what rounding may hide
        u = opened.rates.ravel()
        live = float(self.statics.live @ u)
        live_error, dead_error = (
            EPSILON * float(np.abs(f) @ np.abs(u)) for f in (self.statics.live, self.statics.dead)
        )
        if not live > 2.0 * live_error:
            return np.inf, False, violation, missing
        bound = (dissipation - float(self.statics.dead @ u)) / live
        error = dead_error + EPSILON * abs(dissipation) + abs(bound) * live_error
        return bound + error / live, True, violation, missing

    def opened(
        self, mechanism: FloatArray, own: tuple[FloatArray, FloatArray] | None = None
    ) -> Opened:
        """A mechanism (free blocks, 6) with its contacts opened until the flow rule allows it.

        As it is where no field is known that opens every contact. ``own`` are rates (n, 6) of
        contacts that no block rates make, as limits of one's own do, and the sizes (n, 6) of what
        they are sums of.
        """
        relative, rounding = self.statics.relative_rates(mechanism), self._rounding(mechanism)
        sizes = mechanism.ravel()
        if own is not None:
            relative, sizes = relative + own[0], np.append(sizes, own[1])
            rounding = rounding + EPSILON * (own[1] * self.strength.rate_sizes).sum(axis=1)
        found = self.strength.flow.shortfall(relative)
        missing = found.missing + rounding
        # a field that opens every contact, and its share that makes up for what is missing
        field, share = None, 0.0
        asks = missing > 0.0  # a contact without any state misses -inf and has inf to spare
        if not asks.any():
            field = np.zeros((len(self.statics.dead) // DOF, DOF))
        for known in self.witnesses.opening_fields() if field is None else ():
            spare = self._spare_opening(known)
            if spare.min() > 0.0:
                field, share = known, float(np.max(missing[asks] / spare[asks], initial=0.0))
                break
        is_allowed = field is not None and _is_resisted(found.unresisted, sizes)
        rates, dissipation = mechanism, found.dissipation
        if field is not None and is_allowed:
            rates = mechanism + share * field
            if share > 0.0 and not self.strength.is_cone:
                opened = self.strength.flow.opened(self.statics.relative_rates(field))
                dissipation += share * opened.dissipation
        lacks = float(np.maximum(missing, 0.0).sum() + np.abs(found.unresisted).sum())
        return Opened(rates, dissipation, is_allowed, lacks, max(float(missing.max()), 0.0))

    def _rounding(self, u: FloatArray) -> FloatArray:
        """What rounding may hide in the openings (n,) of rates u: a bound must not rest on it."""
        size = (self.statics.sizes.T @ np.abs(u).ravel()).reshape(-1, DOF)
        return np.asarray(EPSILON * (size * self.strength.rate_sizes).sum(axis=1))

    def is_balanced(self, state: FloatArray, alpha: float) -> bool:
        """True if the state balances the loads at ``alpha`` up to rounding."""
        return self.statics.is_balanced(self.strength.forces(state), alpha, self.size)

    def _total_load(self, alpha: float) -> float:
        dead, live = (
            float(block_sizes(f.reshape(-1, DOF), self.size).sum())
            for f in (self.statics.dead, self.statics.live)
        )
        return dead + abs(alpha) * live or live

    def _largest_rate(self, mechanism: FloatArray) -> float:
        live = float(self.statics.live @ mechanism.ravel())
        if not live > 0.0:
            return np.inf
        relative = self.statics.relative_rates(mechanism)
        openings = np.abs(corner_openings(relative, self.statics.contacts)).max()
        largest = block_sizes(mechanism, 1.0 / self.size).max()
        return float(max(largest, openings)) / live


def _better(first: _Bound, second: _Bound, sign: float) -> _Bound:
    """The better one (larger times ``sign``); the second also if proved at little cost."""
    gain = sign * (second[0] - first[0])
    if first[1] == second[1]:
        return second if gain > 0.0 else first
    price = _N.price * abs(first[0]) if np.isfinite(first[0]) else 0.0
    return second if second[1] and gain >= -price else first


def _is_resisted(unresisted: FloatArray, rates: FloatArray) -> bool:
    """True if yield surfaces take up all slip and twist of block ``rates``, up to rounding."""
    return not np.abs(unresisted).max(initial=0.0) > 1e-15 * np.abs(rates).max()
