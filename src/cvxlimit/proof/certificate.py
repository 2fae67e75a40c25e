"""The bracket of a load factor, recomputed in NumPy from the unscaled scene.

A solver's own claims (load factor, residuals, duality gap) are not used: solvers have returned load
factors wrong by 5 % with small residuals and no gap. Only its forces and its mechanism are used,
and neither is believed: what they violate is measured, repaired, and paid for with some of the
bound, but for what is left of equilibrium (*Rounding*).

*Weak duality.* Let forces x be admissible and balance the loads, A x + f_dead + alpha f_live = 0;
let the flow rule allow the relative rates A'u of a mechanism u with f_live . u = 1, in which
contacts take up no more than D. Admissible forces do no less than -D of work on them, so that

    alpha  =  alpha f_live . u  =  -x . A'u - f_dead . u  <=  D - f_dead . u.

Every such x proves a lower bound alpha, every such u the upper bound on the right.

*Reference states.* What a solver returns is nearly such x and u. Two states repair it, and cost
little of the bound (:mod:`cvxlimit.proof.references`):

- Forces that exceed a yield function by y are mixed with a *dead state* x_d, which balances
  the dead load strictly inside, with a reserve m there: (1 - t) x + t x_d is admissible for
  t = max y / (y + m), and (1 - t) alpha is a lower bound. Where the dead load stands only with a
  part alpha_d of the live load, x_d carries that, and (1 - t) alpha + t alpha_d is the bound.
- A mechanism whose contacts lack openings s is added to an *opening field* u_0, which opens every
  contact by r more than the flow rule asks for: u + t u_0 is allowed for t = max s / r
  (:mod:`cvxlimit.proof.opening`). The power of dead load and dissipation over that of the live load
  is the bound.

Without such a state (a dead load about to fall; blocks wedged between supports) violations are
weighted by :data:`REFERENCE` rates and forces, and the bound is not called proved. With one, no
proved bound is given up for a tighter assumed one: a pebble on a boulder breaks the assumption.

*Order.* :meth:`Certifier.certificate` takes the upper bound first: of u as it is, and, if that is
not proved, with blocks glued that u does not part. Then the lower one: of all contacts, and, if the
bracket is too wide, without those that carry next to nothing.

*Rounding.* The upper bound is raised by the rounding of the powers that it is made of. A lower one
counts as proved if its forces, put into equilibrium anew, and those of the dead state leave at no
block more than ``BALANCED`` = 1e-11 of what acts there. Such a residual r carries load too: with it

    alpha  <=  D - f_dead . u + r . u,

so that alpha - r . u is a lower bound, for the u at collapse, whose right side without r is the
largest load factor. The solver's u stands for that one: |r| |u|, block by block, is taken off, with
the rounding of the sums that r is. What this neglects is r times the error of u, a product of two
small numbers. Without a u nothing is taken off: the bound is then one to a residual of 1e-11.

Letters and arrays of this module, in the scene's own units:

- ``x``: a state, contact forces (n, 6) in the columns V1 V2 N M1 M2 MT of ``COMPONENTS`` with N > 0
  in compression, or internal forces (p,) where the formulation has conditions of its own;
- ``alpha``: a load factor; ``statics.dead`` and ``statics.live`` (6 free blocks,) are the loads;
- ``u``: a mechanism (free blocks, 6), velocities and rates of rotation at each centroid.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import EPSILON, FloatArray, IntArray
from cvxlimit.errors import ModelError
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.crushing import formulation_of
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.statics import BALANCED, DOF, block_sizes
from cvxlimit.proof.checks import SLACK
from cvxlimit.proof.flow import corner_openings, scaled
from cvxlimit.proof.gluing import glued, without_idle
from cvxlimit.proof.opening import OpenedMechanism, open_mechanism, spare_opening
from cvxlimit.proof.references import References
from cvxlimit.proof.strength import NOTHING, ContactFlow, Flow, Strength, finite
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import REFERENCE, TOLERANCE, Certificate, Reference
from cvxlimit.solvers import LimitState
from cvxlimit.solvers.running import Flows
from cvxlimit.surfaces.base import YieldSurface

_STUCK, _LOOSELY_STUCK = (1e-9, 1e-12), 1e-6
"""A contact whose relative rates are below this share of the mechanism's largest rate counts as
stuck, so that its two blocks are glued. Both shares are tried, since solvers leave up to 1e-11
where nothing moves; the loose one where neither of them proves a bound."""


class _Bound(NamedTuple):
    """One end of a bracket.

    ``errors`` are what the forces or the mechanism violated before repair. For a lower bound they
    are the residual of equilibrium and the yield excess, both over the total load; for an upper
    bound the largest missing opening of a contact, over the largest rate, and the sum of all.
    """

    value: float
    is_proved: bool = False
    errors: tuple[float, float] = (np.nan, np.nan)


_NO_LOWER, _NO_UPPER = _Bound(-np.inf), _Bound(np.inf)


class Certifier:
    """Certifies forces and mechanisms of one scene under given surfaces.

    Its reference states, ``references``, are sought when a bound needs them. States that are known
    already can be offered, which saves the search; each is checked first.

    Parameters
    ----------
    scene : Scene or Assemblage
    surfaces : sequence of YieldSurface
    formulation : Formulation
        Which forces are the unknowns. If it states conditions of its own, states x are its internal
        forces.
    flow : ContactFlow or None
        Replaces the flow rule of the surfaces in upper bounds; its shortfall must be sublinear.
    width : float
        Relative width of bracket that is wanted. Where the bracket is wider, a lower bound is also
        sought with the contacts left out that carry next to nothing.
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
        self.references = References(self.assemblage, self.strength)
        self.surfaces, self.formulation = tuple(surfaces), formulation
        self._can_reduce, self._width, self._flow = True, width, flow
        self.size = self.statics.contacts.typical_size

    def with_flow(self, flow: Flow) -> Certifier:
        """Returns a certifier under another flow rule, with the reference states of this one."""
        result = copy(self)
        result.strength = copy(self.strength)
        result.strength.flow = flow
        result._can_reduce = False
        result.references = copy(self.references)
        result.references.strength = result.strength
        return result

    def refer_to(self, given: Reference, has_live: bool = False) -> bool:
        """Take the reference states of a solution, or of the same blocks under other strengths and
        loads, as far as they are valid here: seeking them takes half of a certificate's time.
        Forces may carry a part of the live load too (``has_live``), which follows from them.
        Returns False where forces are given that are no dead state, and does not take them; raises
        ModelError as :meth:`offer_dead_state`.

        Nothing is believed: rates are checked wherever they are used; forces must be strictly
        inside, in equilibrium to rounding. What they leave unbalanced must be little of the loads
        too, and not of the forces alone: where blocks wedge each other, these have no limit.
        """
        self.references.borrowed_field = self._rates(given.rates)
        state, factor = self.strength.state(given.forces), 0.0
        if state is None:
            return given.forces is None
        if has_live:
            factor = self.strength.balancing(state, factor, self.statics)
        if not self.is_balanced(state, factor):  # it is under the load that it was found for
            state = self.strength.balanced(state, factor, self.statics)
        unbalanced = float(self._unbalanced(state, factor).max()) / self._total_load(factor)
        is_dead_state = unbalanced <= SLACK and self._reserve(state, factor) > 0.0
        if is_dead_state:
            self.references.dead_state, self.references.factor = state, factor
        return is_dead_state

    def offer_dead_state(self, forces: ArrayLike, factor: float = 0.0) -> bool:
        """Offer contact forces (n, 6) as the dead state; returns True if they prove to be one.

        They are put into equilibrium first, and must be strictly inside all surfaces after that.
        They replace the present state only if they have more reserve. Forces that carry ``factor``
        times the live load besides always replace it; the factor is first made to balance them.

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
        reserve = self._reserve(balanced, factor)
        present = None if factor else self.references.easy_dead_state
        if reserve > (0.0 if present is None else self._reserve(present, self.references.factor)):
            self.references.dead_state, self.references.factor = balanced, factor
        return reserve > 0.0

    def offer_opening_field(self, rates: ArrayLike) -> bool:
        """Offer block rates (free blocks, 6) as the opening field; returns True, and keeps them, if
        they open every contact. Raises ModelError as :meth:`offer_dead_state`."""
        given = self._rates(rates)
        opens = given is not None and bool(spare_opening(self.strength, given).min() > 0.0)
        if opens:
            self.references.opening_field = self.references.borrowed_field = given
        return opens

    def _reserve(self, state: FloatArray, factor: float) -> float:
        """Returns the least distance of a state from yield, as a force; negative outside, and where
        it does not balance the loads at ``factor``."""
        if not (np.isfinite(state).all() and self.is_balanced(state, factor)):
            return -np.inf
        excess = self.strength.excess(state)
        return -float(excess.max(initial=-np.inf, where=excess != -NOTHING))

    def certificate(
        self,
        forces: ArrayLike | None,
        load_factor: float | None,
        mechanism: ArrayLike | None,
        flows: Flows | None = None,
    ) -> Certificate:
        """Returns the bracket that contact forces (n, 6) at ``load_factor`` and a mechanism
        (free blocks, 6) prove; ``flows`` are a solver's duals that belong to it, if it gave some.

        Forces are internal ones (p,) where the formulation states conditions of its own. A side
        that is None, or not finite, has an infinite bound.

        Raises
        ------
        ModelError
            If an array does not have the scene's number of contacts or free blocks.
        """
        x, u = self.strength.state(forces), self._rates(mechanism)
        lower, upper = _NO_LOWER, _NO_UPPER
        rate = np.inf if u is None else self._largest_rate(u)
        # The upper bound: of the mechanism as it is, or with blocks glued that do not part.
        if u is not None:
            upper = self._upper(u, self._largest_force(x), rate, flows)
            if not upper.is_proved:
                upper = self._better_as_glued(upper, u, x, *_STUCK)
            if not upper.is_proved:
                upper = self._better_as_glued(upper, u, x, _LOOSELY_STUCK)
        # The lower bound: of all contacts, or without those that carry next to nothing.
        if x is not None and load_factor is not None and np.isfinite(load_factor):
            rate = max(rate, self.statics.rate_of_the_lightest(self.size))
            lower = self._lower(x, load_factor, rate, u)
            end = upper.value if np.isfinite(upper.value) else load_factor
            if not lower.is_proved or end - lower.value > self._width * abs(end):
                lower = self._better_without_idle(lower, x, load_factor, rate, u)
        # The bounds are near each other and still too far apart: where rates are large for a live
        # power of 1, slips by rounding are enough for that.
        is_near = lower.is_proved and upper.value > lower.value > 0.5 * upper.value
        room = self._width * abs(upper.value)
        if u is not None and is_near and upper.value - lower.value > room:
            upper = self._better_as_glued(upper, u, x, *_STUCK)
        return Certificate(
            lower.value, upper.value, lower.is_proved, upper.is_proved,
            self.assemblage.scaling.least, *lower.errors, *upper.errors,
        )  # fmt: skip

    def of(self, state: LimitState) -> Certificate:
        """Returns the bracket of a solver's answer."""
        return self.certificate(self.given(state), state.load_factor, state.mechanism, state.flows)

    def given(self, state: LimitState) -> FloatArray | None:
        """Returns the forces of a solver's answer as the state x that is checked."""
        return state.internal if self.strength.is_internal else state.forces

    def residuals(self, x: FloatArray, alpha: float) -> tuple[float, float]:
        """Returns the largest residual of equilibrium and the largest yield excess of a state, both
        over the total load."""
        load, residual = self._total_load(alpha), float(self._unbalanced(x, alpha).max())
        excess = float(self.strength.excess(x).max(initial=0.0))
        return residual / load, excess / load

    def _unbalanced(self, x: FloatArray, alpha: float) -> FloatArray:
        """Returns the size of what a state leaves unbalanced at each free block."""
        return block_sizes(self.statics.residual(self.strength.forces(x), alpha), self.size)

    def _rates(self, mechanism: ArrayLike | None) -> FloatArray | None:
        """Returns a mechanism (free blocks, 6), which may be given as one row; None if it is None
        or not finite."""
        if isinstance(mechanism, np.ndarray) and mechanism.size == len(self.statics.dead):
            mechanism = mechanism.reshape(-1, DOF)
        return finite(mechanism, (len(self.statics.dead) // DOF, DOF), "free block")

    def _lower(
        self, x: FloatArray, alpha: float, rate: float, u: FloatArray | None = None
    ) -> _Bound:
        """Returns the lower bound of a state x at alpha; ``rate`` is the largest that is assumed of
        a mechanism where nothing is proved, ``u`` the mechanism at collapse."""
        errors = self.residuals(x, alpha)
        x = self.strength.balanced(x, alpha, self.statics)
        if not np.isfinite(x).all():
            return _Bound(-np.inf, False, errors)

        # Without a dead state, what is violated is weighted by the largest rate.
        excess = self.strength.excess(x)
        dead_state, dead_factor = self.references.dead_state, self.references.factor
        is_balanced = self.is_balanced(x, alpha)
        if dead_state is None or not (is_balanced and self.is_balanced(dead_state, dead_factor)):
            violated = self._unbalanced(x, alpha).sum()
            violated += float(np.maximum(excess, 0.0).sum())
            error = violated * REFERENCE * rate if violated > 0.0 else 0.0
            return _Bound(alpha - error if np.isfinite(error) else -np.inf, False, errors)

        # The least share t of the dead state that brings the mixture inside all surfaces. That
        # of crushing is convex where rocking holds: it is asked again of that mixture.
        dead_excess, lower = self.strength.excess(dead_state), alpha
        for number in range(1 if self.strength.crushing is None else 2):
            if number > 0:
                excess = self.strength.excess(x)
            beyond = np.maximum(excess, 0.0)
            share = float((beyond / (beyond - dead_excess)).max(initial=0.0))
            x, lower = x + share * (dead_state - x), lower + share * (dead_factor - lower)

        # Residuals of the mixture that count as rounding may carry some of the load factor: no more
        # than their power in the mechanism at collapse, for which u stands (*Rounding* above).
        hidden, live = 0.0, 0.0 if u is None else float(self.statics.live @ u.ravel())
        if u is not None and live > 0.0:
            acting = self.statics.acting(self.strength.forces(x), lower, self.size)
            unbalanced = self._unbalanced(x, lower) + EPSILON * acting
            hidden = float(unbalanced @ block_sizes(u, 1.0 / self.size)) / live
        # The dead state alone proves its factor, so no more than down to that is taken off.
        lower = max(dead_factor, lower - hidden) if lower > dead_factor else lower - hidden
        # Where some forces are resisted by nothing, blocks may slide as one, each at a rate of 1
        # over the whole live load. Residuals of BALANCED carry this much then, if what acts on
        # blocks adds up to ten times the dead load of those pushed: a margin, on top of the above.
        if self.strength.balance.held is not None:
            unresisted = 10.0 * BALANCED * self.assemblage.scaling.ratio
            lower = max(dead_factor, lower - unresisted)
        return _Bound(lower, True, errors)

    def _better_without_idle(
        self, lower: _Bound, x: FloatArray, alpha: float, rate: float, u: FloatArray | None
    ) -> _Bound:
        """Returns the better of a lower bound and that with the contacts left out that carry next
        to nothing: forces that are admissible without some contacts are admissible with them."""
        if not self._can_reduce or self._flow is not None or self.strength.is_internal:
            return lower
        share = EPSILON**0.5  # of the largest force: half the digits of a number
        reduced = without_idle(self.assemblage, x, share)
        if reduced is None:
            return lower
        part, forces = reduced
        certifier = self._of_part(part)
        if certifier is None:
            return lower
        # The rates of the blocks that are left.
        if u is not None:
            u = u[np.sort(self.statics.row_of_block[part.statics.row_of_block >= 0])]
        return _better(lower, certifier._lower(forces, alpha, rate, u), 1.0)

    def _better_as_glued(
        self, upper: _Bound, u: FloatArray, x: FloatArray | None, *shares: float
    ) -> _Bound:
        """Returns the best of an upper bound and those of the mechanism with blocks glued that it
        moves apart by less than one of some ``shares`` of its largest rate.

        A mechanism of blocks glued together is one of the blocks themselves, so its bound holds
        for them. The contacts inside drop out, and with them slips that are rounding, and whatever
        wedges their blocks: the rest can often be opened where the whole cannot.
        """
        for share in shares:
            reduced = glued(self.assemblage, u, share) if self._can_reduce else None
            if reduced is None:
                continue
            bodies, rates, contacts = reduced
            certifier = self._of_part(bodies, contacts)
            if certifier is not None:
                force, rate = self._largest_force(x, contacts), certifier._largest_rate(rates)
                upper = _better(upper, certifier._upper(rates, force, rate), -1.0)
        return upper

    def _of_part(self, part: Assemblage, contacts: IntArray | None = None) -> Certifier | None:
        """Returns a certifier of a part of the assemblage, with these ``contacts`` (k,) of it; None
        if the surfaces cannot be stated there."""
        flow, formulation = None, self.formulation
        if contacts is not None:
            flow = None if self._flow is None else self._flow.of(contacts)
            formulation = formulation_of(formulation, contacts)
        try:
            result = Certifier(part, self.surfaces, formulation, flow)
        except (ModelError, ValueError):
            return None
        result.size, result._can_reduce = self.size, False
        return result

    def _largest_force(self, x: FloatArray | None, contacts: IntArray | None = None) -> float:
        """Returns the largest force at some contacts (k,), or at all. Blocks that wedge each other
        may press with far more than the loads, so that loads alone do not limit forces."""
        if x is None:
            return 0.0
        sizes = block_sizes(self.strength.forces(x), self.size)
        return float((sizes if contacts is None else sizes[contacts]).max(initial=0.0))

    def _upper(
        self, u: FloatArray, largest_force: float, largest_rate: float, flows: Flows | None = None
    ) -> _Bound:
        """Returns the upper bound of a mechanism u. ``largest_force`` is that of the forces at
        collapse, ``largest_rate`` that of u at live power 1."""
        live = float(self.statics.live @ u.ravel())
        if not live > 0.0:
            return _NO_UPPER
        u, flows = u / live, None if flows is None else scaled(flows, 1.0 / live)
        opened = open_mechanism(self.strength, self.references, u, duals=flows)
        errors, dissipation = (opened.violation / largest_rate, opened.missing), opened.dissipation

        # A mechanism that cannot be opened: missing openings are weighted by the largest force.
        if not opened.is_allowed:
            bound = dissipation - float(self.statics.dead @ u.ravel())
            force = REFERENCE * max(self._total_load(bound), largest_force)
            return _Bound(bound + opened.missing * force, False, errors)

        # The power of dissipation and dead load over that of the live load, and its rounding.
        u = opened.rates.ravel()
        live = float(self.statics.live @ u)
        live_error = EPSILON * float(np.abs(self.statics.live) @ np.abs(u))
        dead_error = EPSILON * float(np.abs(self.statics.dead) @ np.abs(u))
        if not live > 2.0 * live_error:
            return _Bound(np.inf, False, errors)
        bound = (dissipation - float(self.statics.dead @ u)) / live
        error = dead_error + EPSILON * abs(dissipation) + abs(bound) * live_error
        return _Bound(bound + error / live, True, errors)

    def opened(
        self, mechanism: FloatArray, own: tuple[FloatArray, FloatArray] | None = None
    ) -> OpenedMechanism:
        """Returns :func:`~cvxlimit.proof.opening.open_mechanism` with this certifier's fields."""
        return open_mechanism(self.strength, self.references, mechanism, own)

    def is_balanced(self, state: FloatArray, alpha: float) -> bool:
        """Returns True if a state balances the loads at ``alpha`` up to rounding."""
        return self.statics.is_balanced(self.strength.forces(state), alpha, self.size)

    def _total_load(self, alpha: float) -> float:
        """Returns the sum of the sizes of all loads at ``alpha``; the live load's if that is 0."""
        dead, live = self._loads
        return dead + abs(alpha) * live or live

    @cached_property
    def _loads(self) -> tuple[float, float]:
        """The sums of the sizes of dead and live load."""
        dead, live = (f.reshape(-1, DOF) for f in (self.statics.dead, self.statics.live))
        return float(block_sizes(dead, self.size).sum()), float(block_sizes(live, self.size).sum())

    def _largest_rate(self, mechanism: FloatArray) -> float:
        """Returns the largest rate of a block or corner opening at live power 1."""
        live = float(self.statics.live @ mechanism.ravel())
        if not live > 0.0:
            return np.inf
        relative = self.statics.relative_rates(mechanism)
        openings = np.abs(corner_openings(relative, self.statics.contacts)).max()
        largest = block_sizes(mechanism, 1.0 / self.size).max()
        return float(max(largest, openings)) / live


def _better(first: _Bound, second: _Bound, sign: float) -> _Bound:
    """Returns the better of two bounds: ``sign`` is 1.0 for lower bounds, -1.0 for upper ones. A
    second bound that is proved is better where the first one is not, at a cost of a tenth of the
    width of bracket that counts as certified."""
    gain = sign * (second.value - first.value)
    if first.is_proved == second.is_proved:
        return second if gain > 0.0 else first
    cost = 0.1 * TOLERANCE * abs(first.value) if np.isfinite(first.value) else 0.0
    return second if second.is_proved and gain >= -cost else first
