"""Strictly feasible (Slater) states, which turn nearly exact answers into proved bounds.

Forces strictly inside all surfaces that balance the dead load prove that it stands, and absorb
small yield excess; rates that strictly open every contact absorb small violations of the flow rule.
Both are found by alternating projections with one sparse factorisation; who uses them checks them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.flow import StrengthRows
from cvxlimit.model.statics import DOF
from cvxlimit.proof.strength import NOTHING, Strength


@dataclass(frozen=True)
class _Numbers:
    """What each number is for, and where it was measured."""

    overshoot: float = 1.9
    """Relaxation of the alternating projections, between 1 and 2: a dead state of the tuff wall
    takes 16 iterations with 1.9 and 20 with 1.0."""
    memory: int = 3
    """Steps that are combined with the last one (:class:`_Accelerated`): a dead state of the tuff
    wall takes 16 iterations with 3, 23 with 2 and 40 with none, an arch 4 in place of 28."""
    parallel: float = 1e-12
    """Steps that differ by the root of this, relatively, count as one."""
    spare: float = 0.2
    """Share of the yield function's range that a dead-load state is to keep in reserve: with 0.1
    states end so near the surfaces that friction of 1e-6 to 1e6 costs 2e-5 of the load factor."""
    opening_iterations: int = 50
    """Opening fields aim at rates of 1; with as much to spare and relaxed so, projections take half
    the iterations of plain ones. Where they do not end, a solver does
    (:func:`~cvxlimit.model.statement.largest_self_stress`)."""
    attempts: tuple[tuple[float, int], ...] = ((0.1, 60), (0.1, 100), (0.01, 100), (0.0001, 60))
    """Least corner compression, as a share of what the lighter of the two blocks would give if its
    load were spread over its contacts, and iterations allowed for it. The first is the easy one."""
    few: int = 25
    """Iterations of the first attempt on the smallest scenes, and one more for every four contacts:
    beyond, Clarabel has carried the dead load of an arch before projections do."""
    patience: int = 8
    """The first attempt ends where so many iterations leave more than half of what was missing: on
    a flying buttress, whose stones never come to rest so, a solver needs no longer than eight."""
    most_states: int = 100
    """States that scenes of one geometry share: 50 kB each with 1,000 contacts."""


_N = _Numbers()


class _Accelerated:
    """Alternating projections x -> g(x) by Anderson's acceleration: the next x is the combination
    of the last images g whose steps g - x cancel best (D. G. Anderson, Iterative procedures for
    nonlinear integral equations, 1965). Shares add up to one, so that images in equilibrium with a
    load have combinations that are.
    """

    def __init__(self) -> None:
        self.before = list[tuple[FloatArray, FloatArray]]()

    def next(self, x: FloatArray, image: FloatArray) -> FloatArray:
        step, before = image - x, self.before
        self.before = [*before[1 - _N.memory :], (image, step)]
        if not before:
            return image
        change = np.stack([other - step for _, other in before])
        square = change @ change.T
        square[np.diag_indices(len(before))] += _N.parallel * square.trace() + NOTHING
        share = np.linalg.solve(square, -change @ step)
        return image + share @ np.stack([other - image for other, _ in before])


class Witnesses:
    """Reference states of one assemblage under its dead load.

    The dead state carries ``factor`` times the live load besides: nothing, unless the dead load
    does not stand alone.

    Projections know plain corner compressions only; other states come from a solver or not at all.
    """

    def __init__(self, assemblage: Assemblage, strength: Strength) -> None:
        self.assemblage, self.strength = assemblage, strength
        self.statics = assemblage.statics
        self._balance = strength.balance
        self._can_project = self._balance.is_supported and not strength.is_internal
        self._dead_state: FloatArray | None = None
        self.borrowed_field: FloatArray | None = None
        self.factor = 0.0
        self._attempted = 0
        rates, dead = self._balance.rates, self.statics.dead
        self._dead = dead if rates is None else np.asarray(rates @ dead)

    @property
    def dead_state(self) -> FloatArray | None:
        """A state that carries the dead load strictly inside all surfaces, or None."""
        return self._sought(len(_N.attempts))

    @dead_state.setter
    def dead_state(self, forces: FloatArray) -> None:
        self._dead_state = forces

    @property
    def known_dead_state(self) -> FloatArray | None:
        """The same as far as it is known already."""
        return self._dead_state

    @property
    def known_opening_field(self) -> FloatArray | None:
        """Rates that open every contact, as far as they are known already."""
        found: FloatArray | None = self.__dict__.get("opening_field", self.borrowed_field)
        return found

    def opening_fields(self) -> Iterator[FloatArray]:
        """Rates that may open every contact: those borrowed, then those sought for this one."""
        if self.borrowed_field is not None:
            yield self.borrowed_field
        if self.opening_field is not None:
            yield self.opening_field

    @property
    def easy_dead_state(self) -> FloatArray | None:
        """The same, if a few projections find it; a solver may be quicker where they do not."""
        return self._sought(1)

    def _sought(self, attempts: int) -> FloatArray | None:
        possible = self._can_project and np.any(self.statics.dead)
        while possible and self._dead_state is None and self._attempted < attempts:
            share, iterations = _N.attempts[self._attempted]
            if self._attempted == 0:  # a solver's whole answer is quicker than more
                iterations = min(iterations, _N.few + len(self.statics.contacts) // 4)
            self._attempted += 1
            self._dead_state = self._remembered(
                ("dead state", share, iterations, self.statics.dead.tobytes()),
                partial(
                    self._find_dead_state,
                    share,
                    iterations,
                    _N.patience if self._attempted == 1 else iterations,
                ),
            )
        return self._dead_state

    def _remembered(
        self, what: tuple[object, ...], seek: Callable[[], FloatArray | None]
    ) -> FloatArray | None:
        states = getattr(self.assemblage.repeats, "states", None)
        if states is None or self.strength.about is None:
            return seek()
        key = what, self.strength.about
        if key not in states:
            if len(states) >= _N.most_states:
                states.clear()
            states[key] = seek()
        return states[key]

    def _find_dead_state(self, share: float, iterations: int, patience: int) -> FloatArray | None:
        """Returns a dead state with at least a ``share`` of fair compressions at corners, None as
        soon as ``patience`` iterations leave more than half of what was missing."""
        # fair is what the lighter of the two blocks gives, its load spread over all its corners
        contacts, number = self.statics.contacts, self.statics.row_of_block
        force = np.linalg.norm(self.statics.dead.reshape(-1, DOF)[:, :3], axis=1)
        force = np.where(force > 0.0, force, force.mean() or np.linalg.norm(self.statics.dead))
        corners = np.diff(contacts.corner_start)
        around = np.zeros(len(force) + 1)
        for side in (contacts.a, contacts.b):
            np.add.at(around, number[side], corners)
        spread = np.append(force / around[:-1], np.inf)
        lighter = np.minimum(spread[number[contacts.a]], spread[number[contacts.b]])
        model = self._balance.model
        compression = share * lighter[model.contact[model.nonneg]]
        # from forces in equilibrium inside the surfaces, and back into equilibrium, in turn
        z, missing = self._carried(np.zeros(len(self._balance.weights))), list[float]()
        accelerated = _Accelerated()
        for _ in range(iterations):
            short = 0.1 * compression - z[model.nonneg]
            missing.append(float(short.max(initial=0.0)))
            if len(missing) > patience and 0.0 < 0.5 * missing[-1 - patience] < missing[-1]:
                return None
            if missing[-1] <= 0.0 and all(y.max() < 0.0 for y, _ in self._excess(z)):
                z = self._carried(self._carried(z))  # to rounding of each block's own forces
                forces, length = model.forces(z), contacts.typical_size
                if all(y.max() < 0.0 for y in self.strength.excess(forces)):
                    is_all = self._balance.held is None  # else some load may be carried by nothing
                    is_all = is_all or self.statics.is_balanced(forces, 0.0, length)
                    return forces if is_all else None
            further = z + _N.overshoot * (self._pushed_inside(z, compression) - z)
            z = accelerated.next(z, self._carried(further))
        return None

    def _carried(self, z: FloatArray) -> FloatArray:
        balance = self._balance
        return z + balance.along(balance.matrix @ z + self._dead)

    def _pushed_inside(self, z: FloatArray, compression: FloatArray) -> FloatArray:
        model = self._balance.model
        pressed = model.nonneg
        pushed = z.copy()
        pushed[pressed] = np.maximum(z[pressed], compression)
        plain = np.where(pressed, pushed, 0.0)
        pushed, is_inside = self._blended(pushed, plain)
        if is_inside:
            return pushed
        centred = plain.copy()
        at = model.contact[pressed]
        centred[pressed] = (np.bincount(at, plain[pressed]) / np.bincount(at))[at]
        return self._blended(pushed, centred)[0]

    def _blended(self, z: FloatArray, inner: FloatArray) -> tuple[FloatArray, bool]:
        """Returns a state as far from ``inner`` towards z as leaves a reserve, and whether
        ``inner`` has one."""
        share, is_inside = np.zeros(len(self.statics.contacts)), True
        for (y, contact), (y_inner, _) in zip(self._excess(z), self._excess(inner), strict=True):
            goal = _N.spare * y_inner
            beyond = (y_inner < 0.0) & (y > goal)
            needed = np.where(beyond, y - goal, 0.0) / np.where(beyond, y - y_inner, 1.0)
            np.maximum.at(share, contact, needed)
            is_inside = is_inside and bool(y_inner.max(initial=-1.0) < 0.0)
        return z + share[self._balance.model.contact] * (inner - z), is_inside

    def _excess(self, z: FloatArray) -> list[tuple[FloatArray, IntArray]]:
        if self._rows is not None:
            return self._rows.excess(z)
        found = self.strength.excess(self._balance.model.forces(z))
        each = zip(found, self.strength.rows, self.strength.conditions, strict=True)
        # those of corners hold where compressions are positive
        return [(y, rows) for y, rows, (c, _) in each if c.contact is None]

    @cached_property
    def _rows(self) -> StrengthRows | None:
        """Returns the rows, None where some forces are resisted by nothing, of which only states
        know."""
        if self._balance.held is not None:
            return None
        flow = self.strength.flow
        if self._balance.rates is None and isinstance(flow, StrengthRows):
            return flow
        return StrengthRows(self.strength.surfaces, self._balance.model)

    @cached_property
    def opening_field(self) -> FloatArray | None:
        """Block rates (free, 6) that open every contact beyond the flow rule's need, or None: where
        contacts hold each other in self-stress there is no such field."""
        if not self._can_project:
            return None
        return self._remembered(("opening field",), self._find_opening_field)

    def _find_opening_field(self) -> FloatArray | None:
        matrix, weights = self._balance.matrix, self._balance.weights
        target = np.where(self._balance.model.nonneg, 1.0, 0.0)
        for _ in range(_N.opening_iterations):
            rates = self._balance.solve(matrix @ (weights * target))
            ways = self._balance.rates
            motion = np.asarray(rates if ways is None else ways.T @ rates).reshape(-1, DOF)
            missing = self.strength.flow.shortfall_bound(self.statics.relative_rates(motion))
            if missing.max() < 0.0:
                return motion
            if not np.isfinite(missing).all():
                return None
            target = self._opened(np.asarray(self._balance.transposed @ rates), missing)
        return None

    def _opened(self, rates: FloatArray, missing: FloatArray) -> FloatArray:
        model, contacts = self._balance.model, self.statics.contacts
        mu, at = contacts.friction, model.contact
        lack = _N.overshoot * np.maximum(missing + _N.spare, 0.0) / (1.0 + mu**2)
        arm = np.where(model.is_moment, contacts.torsion_arm[at], 1.0)
        slips = np.where(model.nonneg, 0.0, arm * rates)
        size = np.sqrt(np.bincount(at, slips**2, len(contacts)))
        kept = np.maximum(1.0 - mu * lack / np.where(size > 0.0, size, np.inf), 0.0)
        return np.where(model.nonneg, rates + lack[at], kept[at] * rates)
