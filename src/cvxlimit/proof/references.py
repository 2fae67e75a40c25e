"""Reference states, strictly inside (Slater's condition): they make bounds of nearly exact answers.

- A *dead state*: forces strictly inside all surfaces that balance the dead load. It proves that the
  dead load stands, and a share of it mixed into other forces absorbs small yield excess.
- An *opening field*: block rates (free blocks, 6) that open every contact by more than the flow
  rule asks for. A share of it added to a mechanism absorbs small violations of the flow rule.

Both lie in a linear set and inside a convex one, and are found by projections onto these in turn:

- a dead state among the internal forces z (p,) of ``Balance.model`` (compressions at the corners of
  contacts, shear and torsion) that balance the dead load, B z + f_dead = 0, and those inside all
  surfaces. One sparse factorisation of B W B' gives the first projection; the second moves each
  contact towards compression alone, by no more than it needs (:meth:`References._pushed_inside`);
- an opening field among the rates B'u that block rates u make, by least squares with the same
  factorisation, and those that open every contact (:meth:`References._opened`).

Steps overshoot, and those for a dead state are accelerated. What projections do not find a solver
may, and a file may hold: such states are given from outside. Who uses a state checks it; nothing of
a proof rests on how it was found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.statics import DOF
from cvxlimit.proof.conditions import ConditionRows
from cvxlimit.proof.strength import NOTHING, Strength
from cvxlimit.solution.bracket import Reference
from cvxlimit.surfaces.coulomb import bounded


@dataclass(frozen=True)
class _Settings:
    """The chosen figures of the projections, each with its reason."""

    overshoot: float = 1.9
    """Factor on each step of the alternating projections, between 1 and 2: a dead state of the tuff
    wall takes 16 iterations with 1.9 and 20 with 1.0."""
    memory: int = 3
    """Steps that are combined with the last one (:class:`_AndersonAcceleration`): a dead state of
    the tuff wall takes 16 iterations with 3, 23 with 2 and 40 with none, an arch 4 in place of
    28."""
    parallel: float = 1e-12
    """Steps whose relative difference is below the root of this count as one step."""
    spare: float = 0.2
    """Share of the yield function's range that a dead state is to keep in reserve: with 0.1 states
    end so near the surfaces that friction of 1e-6 to 1e6 costs 2e-5 of the load factor."""
    opening_iterations: int = 50
    """Most iterations for an opening field. They aim at opening rates of 1 with ``spare`` more, and
    with this and ``overshoot`` take half the iterations of plain projections. Where they find no
    field, a solver is asked (:func:`~cvxlimit.model.statement.largest_self_stress`)."""
    attempts: tuple[tuple[float, int], ...] = ((0.1, 60), (0.1, 100), (0.01, 100), (0.0001, 60))
    """Attempts at a dead state, in order: the least corner compression, as a share of a fair one
    (:meth:`References._fair_compressions`), and the iterations allowed. The first is the easy
    one."""
    least_iterations: int = 25
    """Iterations of the first attempt on the smallest scenes, and one more for every four contacts.
    With more, Clarabel would have carried the dead load of an arch before projections do."""
    patience: int = 8
    """The first attempt ends where so many iterations leave more than half of what was missing: on
    a flying buttress, whose stones do not come to rest by projections, a solver needs no longer."""


_SETTINGS = _Settings()


class _AndersonAcceleration:
    """Anderson's acceleration of a fixed-point iteration z -> g(z): the next z is the combination
    of the last images g(z) whose steps g(z) - z cancel best (D. G. Anderson, Iterative procedures
    for nonlinear integral equations, 1965). The weights of the combination add up to one, so that
    it is in equilibrium with a load if all images are.
    """

    def __init__(self) -> None:
        self.history = list[tuple[FloatArray, FloatArray]]()  # images and steps, oldest first

    def next(self, z: FloatArray, image: FloatArray) -> FloatArray:
        """Returns the z (p,) that follows from the present one and its image g(z)."""
        step, history = image - z, self.history
        self.history = [*history[1 - _SETTINGS.memory :], (image, step)]
        if not history:
            return image
        change = np.stack([other - step for _, other in history])
        normal = change @ change.T
        normal[np.diag_indices(len(history))] += _SETTINGS.parallel * normal.trace() + NOTHING
        weights = np.linalg.solve(normal, -change @ step)
        return image + weights @ np.stack([other - image for other, _ in history])


class References:
    """The dead state and the opening field of one assemblage, sought when they are asked for.

    The dead state carries the dead load and ``factor`` times the live load; ``factor`` is 0.0
    unless the dead load stands only with a part of the live load. ``borrowed_field`` is an opening
    field from outside, as of another assemblage with the same blocks, tried first.

    Projections work for corner compressions only. Where a formulation has internal forces of its
    own, states have to be offered from outside.
    """

    def __init__(self, assemblage: Assemblage, strength: Strength) -> None:
        self.assemblage, self.strength = assemblage, strength
        self.statics, self._count = assemblage.statics, strength.model.count
        self._balance = strength.balance
        self._can_project = self._balance.is_supported and not strength.is_internal
        self._dead_state: FloatArray | None = None
        self.borrowed_field: FloatArray | None = None
        self.factor = 0.0
        self._attempts_made = 0
        rates, dead = self._balance.rates, self.statics.dead
        self._dead = dead if rates is None else np.asarray(rates @ dead)

    @property
    def dead_state(self) -> FloatArray | None:
        """A state that carries the dead load strictly inside all surfaces, or None."""
        return self._find_within(len(_SETTINGS.attempts))

    @dead_state.setter
    def dead_state(self, forces: FloatArray) -> None:
        self._dead_state = forces

    def given(self, load_factor: float | None) -> Reference:
        """The states known so far, beside the load factor of forces that are checked with them."""
        return replace(self.known, load_factor=load_factor)

    @property
    def known(self) -> Reference:
        """The states that have been found or given so far."""
        field = self.borrowed_field  # projections would find the other one again
        field = self.__dict__.get("opening_field") if field is None else field
        return Reference(None, self._dead_state, field)

    def opening_fields(self) -> Iterator[FloatArray]:
        """Yields candidates for the opening field: the borrowed one, then this assemblage's own."""
        if self.borrowed_field is not None:
            yield self.borrowed_field
        if self.opening_field is not None:
            yield self.opening_field

    @property
    def easy_dead_state(self) -> FloatArray | None:
        """The dead state if a few projections find it, else None: a solver may then be quicker."""
        return self._find_within(1)

    def _find_within(self, attempts: int) -> FloatArray | None:
        """Returns the dead state, which is sought in so many attempts at most; None without one."""
        can_search = self._can_project and np.any(self.statics.dead)
        while can_search and self._dead_state is None and self._attempts_made < attempts:
            share, iterations = _SETTINGS.attempts[self._attempts_made]
            patience = iterations
            if self._attempts_made == 0:  # a solver's whole answer is quicker than more
                few = _SETTINGS.least_iterations + self._count // 4
                iterations, patience = min(iterations, few), _SETTINGS.patience
            self._attempts_made += 1
            self._dead_state = self._find_dead_state(share, iterations, patience)
        return self._dead_state

    def _find_dead_state(self, share: float, iterations: int, patience: int) -> FloatArray | None:
        """Returns contact forces (n, 6) of a dead state with at least a ``share`` of the fair
        compression at corners, or None.

        The search ends after so many ``iterations``, or as soon as ``patience`` of them leave more
        than half of the compression that was missing.
        """
        model, contacts = self._balance.model, self.statics.contacts
        compression = share * self._fair_compressions()
        # Start from forces in equilibrium; push them inside the surfaces and put them back into
        # equilibrium, in turn.
        z, missing = self._put_into_balance(np.zeros(len(self._balance.weights))), list[float]()
        acceleration = _AndersonAcceleration()
        for _ in range(iterations):
            # Has the search come to a stand?
            short = 0.1 * compression - z[model.nonneg]
            missing.append(float(short.max(initial=0.0)))
            if len(missing) > patience and 0.0 < 0.5 * missing[-1 - patience] < missing[-1]:
                return None
            # Is the state strictly inside? Then it only remains to balance it to rounding.
            if missing[-1] <= 0.0 and self._yield[0](z).max(initial=-1.0) < 0.0:
                z = self._put_into_balance(self._put_into_balance(z))
                forces, length = model.forces(z), contacts.typical_size
                if self.strength.excess(forces).max() < 0.0:
                    # where some forces are held at zero, some load may be carried by nothing
                    is_balanced = self._balance.held is None
                    is_balanced = is_balanced or self.statics.is_balanced(forces, 0.0, length)
                    return forces if is_balanced else None
            # One step: both projections, the first with an overshoot, and the acceleration.
            pushed = z + _SETTINGS.overshoot * (self._pushed_inside(z, compression) - z)
            z = acceleration.next(z, self._put_into_balance(pushed))
        return None

    def _fair_compressions(self) -> FloatArray:
        """Returns a fair compression for each corner of a contact: that from the lighter of its two
        blocks if the load of a block were spread over all its corners."""
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
        fair = np.asarray(lighter[model.contact[model.nonneg]])
        most = self._most_compressions
        return fair if most is None else np.minimum(fair, 0.5 * most)

    @cached_property
    def _most_compressions(self) -> FloatArray | None:
        """The bounds of compressions where reactions have some, else infinite; None without any."""
        model, at = self._balance.model, bounded(self.statics.contacts)
        if not len(at):
            return None
        most = np.full(self._count, np.inf)
        most[at] = self.statics.contacts.most[at]
        return np.asarray(most[model.contact[model.nonneg]])

    def _put_into_balance(self, z: FloatArray) -> FloatArray:
        """Returns internal forces with the least change that balances the dead load."""
        balance = self._balance
        return z + balance.along(balance.matrix @ z + self._dead)

    def _pushed_inside(self, z: FloatArray, compression: FloatArray) -> FloatArray:
        """Returns internal forces with at least these compressions at corners, moved inside the
        surfaces: towards compressions alone, and where those are outside, towards compressions that
        are the same at all corners of a contact."""
        model = self._balance.model
        is_compression = model.nonneg
        pushed = z.copy()
        pushed[is_compression] = np.maximum(z[is_compression], compression)
        if (most := self._most_compressions) is not None:  # of reactions, at least half of that
            pushed[is_compression] = np.minimum(
                pushed[is_compression], (1.0 - _SETTINGS.spare) * most
            )
        without_shear = np.where(is_compression, pushed, 0.0)
        pushed, is_inside = self._moved_towards(without_shear, pushed)
        if is_inside:
            return pushed
        uniform = without_shear.copy()
        contact = model.contact[is_compression]
        means = np.bincount(contact, without_shear[is_compression]) / np.bincount(contact)
        uniform[is_compression] = means[contact]
        return self._moved_towards(uniform, pushed)[0]

    def _moved_towards(self, inner: FloatArray, z: FloatArray) -> tuple[FloatArray, bool]:
        """Returns z moved towards ``inner`` contact by contact, just until it keeps a reserve, and
        whether ``inner`` is strictly inside itself."""
        excess, contact = self._yield
        y, y_inner = excess(z), excess(inner)
        goal = _SETTINGS.spare * y_inner
        beyond = (y_inner < 0.0) & (y > goal)
        needed = np.where(beyond, y - goal, 0.0) / np.where(beyond, y - y_inner, 1.0)
        share = np.zeros(self._count)
        np.maximum.at(share, contact, needed)
        is_inside = bool(y_inner.max(initial=-1.0) < 0.0)
        return z + share[self._balance.model.contact] * (inner - z), is_inside

    @cached_property
    def _yield(self) -> tuple[Callable[[FloatArray], FloatArray], IntArray]:
        """The yield functions (k,) of a state of internal forces, and the contact (k,) of every
        entry: rows on internal forces, but :meth:`Strength.excess` where some forces are
        resisted by nothing, or stone crushes, which only that takes into account."""
        strength, model = self.strength, self._balance.model
        if self._balance.held is None and strength.crushing is None:
            if self._balance.rates is None and isinstance(strength.flow, ConditionRows):
                rows: ConditionRows = strength.flow
            else:
                rows = ConditionRows(strength.surfaces, model)
            return rows.excess, rows.resistance.contact
        # Conditions at corners are left out: they hold where compressions are positive. The last
        # of excess are those of points, whose forces are compressions alone here, and of crushing.
        conditions = [condition for condition, _ in strength.conditions]
        crushes = 0 if strength.crushing is None else len(strength.crushing.rows)
        kept = np.arange(len(strength.rows)) >= len(strength.rows) - crushes
        sizes = [len(condition.rows(self._count)) for condition in conditions]
        kept[: sum(sizes)] = np.repeat([c.contact is None for c in conditions], sizes)

        return lambda z: strength.excess(model.forces(z))[kept], strength.rows[kept]

    @cached_property
    def opening_field(self) -> FloatArray | None:
        """Block rates (free blocks, 6) that open every contact by more than the flow rule asks for,
        or None: where contacts hold each other in self-stress there is no such field."""
        if not self._can_project:
            return None
        # Projections of rates of internal forces (p,), in turn: onto those that block rates make,
        # by least squares, and onto those that open every contact.
        matrix, weights = self._balance.matrix, self._balance.weights
        target = np.where(self._balance.model.nonneg, 1.0, 0.0)
        for _ in range(_SETTINGS.opening_iterations):
            solution = self._balance.solve(matrix @ (weights * target))
            ways = self._balance.rates
            rates = np.asarray(solution if ways is None else ways.T @ solution).reshape(-1, DOF)
            missing = self.strength.flow.shortfall_bound(self.statics.relative_rates(rates))
            if missing.max() < 0.0:
                return rates
            if np.isnan(missing).any() or np.isposinf(missing).any():
                return None
            target = self._opened(np.asarray(self._balance.transposed @ solution), missing)
        return None

    def _opened(self, rates: FloatArray, missing: FloatArray) -> FloatArray:
        """Returns rates of internal forces (p,) with every contact opened by what it is missing
        (n,) and slips made smaller by friction times that: the nearest that are allowed,
        overshot."""
        model, contacts = self._balance.model, self.statics.contacts
        mu, contact = contacts.friction, model.contact
        opening = _SETTINGS.overshoot * np.maximum(missing + _SETTINGS.spare, 0.0) / (1.0 + mu**2)
        arm = np.where(model.is_moment, contacts.torsion_arm[contact], 1.0)
        slips = np.where(model.nonneg, 0.0, arm * rates)
        slip = np.sqrt(np.bincount(contact, slips**2, self._count))
        share = np.maximum(1.0 - mu * opening / np.where(slip > 0.0, slip, np.inf), 0.0)
        return np.where(model.nonneg, rates + opening[contact], share[contact] * rates)
