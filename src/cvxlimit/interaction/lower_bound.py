"""What forces prove: the lower bound that the independent checker accepts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cvxlimit.contacts import COLUMN, Contacts
from cvxlimit.interaction.pressure import interaction_excess
from cvxlimit.scene import Scene
from cvxlimit.statics import DOF, Scaling, Statics
from cvxlimit.surfaces.coulomb import Rocking, TorsionShear
from cvxlimit.witnesses import Witnesses

FloatArray = NDArray[np.float64]

ACCEPTED = 1e-9
"""Equilibrium residual and excess of Eq. 9 and 30, over the total load, that count as none."""

_SHARES = (0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5)
"""Shares of the dead-load state mixed in, smallest first, to be strictly admissible."""

_BALANCED = 1e-11
"""Equilibrium residual of a block that counts as rounding, as a share of the forces acting on it."""


@dataclass(frozen=True, eq=False)
class LowerBound:
    """A lower bound on the load factor with interaction, and the forces that show it.

    Attributes
    ----------
    value : float
        -inf if the forces were refused.
    forces : (n, 6) array
        In equilibrium with ``value`` times the live load; user's units.
    is_proved : bool
        True if they satisfy Eq. 9 and 30 and equilibrium to rounding; otherwise they do so
        within :data:`ACCEPTED` of the total load.
    excess, residual : float
        Largest excess of Eq. 9 and 30 and largest equilibrium residual, over the total load.
    """

    value: float
    forces: FloatArray
    is_proved: bool
    excess: float
    residual: float

    @property
    def is_accepted(self) -> bool:
        """True if the forces passed the checker, exactly or within its tolerance."""
        return bool(np.isfinite(self.value))


class LowerBounds:
    """The checker of one scene in one moment convention.

    The forces are brought into equilibrium (the least change), then mixed with a share t of a
    state that carries the dead load alone strictly inside Eq. 30: the mixture is in equilibrium
    with (1 - t) alpha, and is checked itself, since Eq. 30 is not convex. Nothing of this asks
    where the forces came from.

    Parameters
    ----------
    scene : Scene
    moments : str
        ``"independent"`` or ``"signed"``.
    """

    def __init__(self, scene: Scene, moments: str) -> None:
        self.moments = moments
        self.statics = Statics.of(scene)
        self.scaling = Scaling.of(scene)
        self.witnesses = Witnesses(self.statics, (Rocking(), TorsionShear()))

    def of(self, forces: FloatArray, load_factor: float) -> LowerBound:
        """The best bound that ``forces`` (n, 6) at ``load_factor`` give."""
        balanced = self.witnesses.balanced(np.asarray(forces, dtype=float), load_factor)
        plain = self._checked(balanced, load_factor)
        if not plain.is_accepted or plain.is_proved or self.reserve is None:
            return plain
        for share in _SHARES[1:]:
            mixed = (1.0 - share) * balanced + share * self.reserve
            bound = self._checked(mixed, (1.0 - share) * load_factor)
            if bound.is_proved:
                return bound
        return plain

    @cached_property
    def reserve(self) -> FloatArray | None:
        """Forces (n, 6) that carry the dead load strictly inside Eq. 30, or None."""
        state = self.witnesses.dead_state
        if state is None or self._excess(state).max() >= 0.0:
            return None
        return state if self._is_balanced(state, 0.0) else None

    def _checked(self, forces: FloatArray, load_factor: float) -> LowerBound:
        if not (np.isfinite(forces).all() and np.isfinite(load_factor)):
            return LowerBound(-np.inf, forces, False, np.inf, np.inf)
        excess = max(float(self._excess(forces).max()), 0.0) / self.scaling.force
        residual = self.statics.residual(forces, load_factor)
        residual = float(self._generalised(residual).max()) / self.scaling.force
        accepted = max(excess, residual) <= ACCEPTED
        proved = excess <= 0.0 and self._is_balanced(forces, load_factor)
        value = float(load_factor) if accepted else -np.inf
        return LowerBound(value, forces, accepted and proved, excess, residual)

    def _excess(self, forces: FloatArray) -> FloatArray:
        contacts = self.statics.contacts
        return np.maximum(
            rocking_excess(forces, contacts), interaction_excess(forces, contacts, self.moments)
        )

    def _is_balanced(self, forces: FloatArray, load_factor: float) -> bool:
        acting = abs(self.statics.matrix) @ np.abs(forces).ravel()
        acting += np.abs(self.statics.dead) + np.abs(load_factor * self.statics.live)
        residual = self._generalised(self.statics.residual(forces, load_factor))
        return bool((residual <= _BALANCED * self._generalised(acting.reshape(-1, DOF))).all())

    def _generalised(self, residual: FloatArray) -> FloatArray:
        """Size (free blocks,) of force residuals (free blocks, 6), moments over the size."""
        moments = np.linalg.norm(residual[:, 3:], axis=1)
        result: FloatArray = np.linalg.norm(residual[:, :3], axis=1) + moments / self.scaling.length
        return result


def rocking_excess(forces: FloatArray, contacts: Contacts) -> FloatArray:
    """Eq. 9 in force units (n,): how far pressure is outside the contact; tension counts too."""
    contact, _, offset = contacts.edges
    moments = Rocking().excess(forces, contacts)[0] / offset
    outside: FloatArray = -contacts.corner_minimum(-moments)
    return np.maximum(outside, -forces[:, COLUMN["N"]])


def proved_lower_bound(
    scene: Scene, forces: FloatArray, load_factor: float, moments: str
) -> tuple[float, FloatArray, bool, float]:
    """Bound, checked forces (n, 6), whether it is proved to rounding, and the excess left.

    See :class:`LowerBounds`, which keeps its factorisation for the next forces.
    """
    bound = LowerBounds(scene, moments).of(forces, load_factor)
    return bound.value, bound.forces, bound.is_proved, bound.excess
