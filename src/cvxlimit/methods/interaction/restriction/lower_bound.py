"""What forces prove: the lower bound that the independent checker accepts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.driver import Answer
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.settings import PROOF
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.problem import LargestFactor, LimitProblem
from cvxlimit.model.statics import block_sizes
from cvxlimit.proof.certificate import REFERENCE
from cvxlimit.proof.slater import Strength, Witnesses
from cvxlimit.scene import Scene
from cvxlimit.solvers import default_ladder
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES, Rocking


@dataclass(frozen=True, eq=False)
class LowerBound:
    """A lower bound on the load factor with interaction, and the forces that show it.

    Attributes
    ----------
    value : float
        -inf if the forces were refused.
    forces : (n, 6) array
        In the user's units.
    load_factor : float
        The one with which they are in equilibrium; ``value`` if that is proved.
    is_proved : bool
        True if they satisfy Eq. 9 and 30 and equilibrium to rounding; otherwise they do so
        within :attr:`ProofSettings.accepted` of the total load, and ``value`` is ``load_factor``
        less what that is worth if no rate of the exact mechanism exceeds ten times that of the
        block with the least live load, moving alone.
    excess, residual : float
        Largest excess of Eq. 9 and 30 and largest equilibrium residual, over the total load.
    """

    value: float
    forces: FloatArray
    load_factor: float
    is_proved: bool
    excess: float
    residual: float

    @property
    def is_accepted(self) -> bool:
        """True if the forces passed the checker, exactly or within its tolerance."""
        return bool(np.isfinite(self.value))

    def raising(self, answer: Answer) -> Answer:
        """``answer`` with this bound and its forces, if they are better."""
        return answer.raised(self.value, self.is_proved, self.load_factor, self.forces)


class LowerBounds:
    """The checker of one scene in one moment convention.

    The forces are brought into equilibrium (the least change). Where they do not pass exactly,
    they are mixed with a share t of a state that carries the dead load alone strictly inside
    Eq. 30: the mixture is in equilibrium with (1 - t) alpha, and is checked itself, since Eq. 30
    is not convex. Nothing of this asks where the forces came from.

    Parameters
    ----------
    scene : Scene or Assemblage
    moments : Moments
    """

    def __init__(self, scene: Scene | Assemblage, moments: Moments) -> None:
        self.assemblage, self.moments = Assemblage.of(scene), moments
        self.statics, self.scaling = self.assemblage.statics, self.assemblage.scaling

    def of(self, forces: FloatArray, load_factor: float) -> LowerBound:
        """The best bound that ``forces`` (n, 6) at ``load_factor`` give."""
        given = np.asarray(forces, dtype=float)
        if not (np.isfinite(given).all() and np.isfinite(load_factor)):
            return LowerBound(-np.inf, given, load_factor, False, np.inf, np.inf)
        balanced = self.balanced(given, load_factor)
        plain = self.checked(balanced, load_factor)
        if plain.is_proved or not np.isfinite(plain.excess):
            return plain
        is_close = plain.is_accepted and max(plain.excess, plain.residual) <= PROOF.close
        most = PROOF.most_spent if is_close else PROOF.shares[-1]
        for share in (share for share in PROOF.shares if share <= most):
            for reserve in self.reserves:
                mixed = (1.0 - share) * balanced + share * reserve
                bound = self.checked(mixed, (1.0 - share) * load_factor)
                if bound.is_proved:
                    return bound
        return plain

    @cached_property
    def reserves(self) -> tuple[FloatArray, ...]:
        """Forces (n, 6) that carry the dead load strictly inside Eq. 30; there may be none."""
        found = tuple(state for state in central_states(self.assemblage) if self._is_inside(state))
        return found or self._solved_state()

    def _solved_state(self) -> tuple[FloatArray, ...]:
        if not np.any(self.statics.dead):
            return ()
        alone = self.assemblage.alone(self.statics.dead)
        state = LimitProblem(alone, objective=LargestFactor(most=1.0)).solve(default_ladder()[0])
        if state.forces is None or not state.load_factor or state.load_factor < 0.5:
            return ()
        balanced = self.balanced(state.forces / state.load_factor, 0.0)
        return (balanced,) if self._is_inside(balanced) else ()

    def _is_inside(self, state: FloatArray) -> bool:
        finite = bool(np.isfinite(state).all())
        return finite and self._excess(state).max() < 0.0 and self._is_balanced(state, 0.0)

    def checked(self, forces: FloatArray, load_factor: float) -> LowerBound:
        """What the forces prove as they are."""
        if not np.isfinite(forces).all():
            return LowerBound(-np.inf, forces, load_factor, False, np.inf, np.inf)
        over = np.maximum(self._excess(forces), 0.0)
        rest = block_sizes(self.statics.residual(forces, load_factor), self.scaling.length)
        excess, residual = (float(v.max()) / self.scaling.force for v in (over, rest))
        proved = excess <= 0.0 and self._is_balanced(forces, load_factor)
        rate = REFERENCE * self.statics.rate_of_the_lightest(self.scaling.length)
        lost = 0.0 if proved else float(over.sum() + rest.sum()) * rate
        unit = self.scaling.unit(load_factor)
        is_near = max(excess, residual) <= PROOF.accepted and lost <= PROOF.most_lost * unit
        accepted = proved or is_near
        value = float(load_factor) - lost if accepted else -np.inf
        return LowerBound(value, forces, float(load_factor), proved, excess, residual)

    def is_admissible(self, forces: FloatArray, load_factor: float) -> bool:
        """Equilibrium, rocking and Eq. 30, but for rounding of the total load."""
        bound = self.checked(forces, load_factor)
        return max(bound.excess, bound.residual) <= PROOF.close

    def balanced(self, forces: FloatArray, load_factor: float) -> FloatArray:
        """The nearest forces (n, 6) in equilibrium at ``load_factor``."""
        return self.assemblage.balance.balanced(forces, load_factor, self.statics)

    def _excess(self, forces: FloatArray) -> FloatArray:
        return true_excess(forces, self.statics.contacts, self.moments)

    def _is_balanced(self, forces: FloatArray, load_factor: float) -> bool:
        return self.statics.is_balanced(forces, load_factor, self.scaling.length)


class TrueStrength(Strength):
    """Eq. 9 and 30 as they stand, for :func:`~cvxlimit.methods.admissible.carried_exactly`."""

    def __init__(self, assemblage: Assemblage, moments: Moments) -> None:
        super().__init__(assemblage, DEFAULT_SURFACES)
        self.moments = moments

    def excess(self, state: FloatArray) -> list[FloatArray]:
        """Per contact, as a force."""
        return [true_excess(state, self.contacts, self.moments)]

    @property
    def rows(self) -> list[IntArray]:
        """All contacts."""
        return [np.arange(len(self.contacts))]


def true_excess(forces: FloatArray, contacts: Contacts, moments: Moments) -> FloatArray:
    """By how much forces (n, 6) exceed Eq. 9 and 30, per contact."""
    return np.maximum(rocking_excess(forces, contacts), moments.excess(forces, contacts))


def rocking_excess(forces: FloatArray, contacts: Contacts) -> FloatArray:
    """Eq. 9 in force units (n,): how far pressure is outside the contact; tension counts too."""
    outside: FloatArray = -contacts.corner_minimum(-Rocking().excess(forces, contacts)[0])
    return np.maximum(outside, -forces[:, COLUMN["N"]])


def plain_witnesses(assemblage: Assemblage) -> Witnesses:
    """Reference states under the surfaces without interaction."""
    return Witnesses(assemblage, Strength(assemblage, DEFAULT_SURFACES))


def central_states(assemblage: Assemblage) -> Iterator[FloatArray]:
    """Forces (n, 6) that carry the dead load with little shear, and pressure near the centres."""
    whole = assemblage.contacts
    for friction, size in PROOF.reserves:
        smaller = replace(
            whole,
            friction=friction * whole.friction,
            corner_xy=size * whole.corner_xy,
            pieces={j: tuple(size * p for p in parts) for j, parts in whole.pieces.items()},
            sides=size * whole.sides,
            area=size**2 * whole.area,
        )
        statics = replace(assemblage.statics, contacts=smaller)
        balance = Balance(statics, corner_compressions(smaller))
        state = plain_witnesses(replace(assemblage, statics=statics, balance=balance)).dead_state
        if state is not None:
            yield state
