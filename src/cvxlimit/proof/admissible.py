"""Contact forces in exact equilibrium with a load, from a solver's nearly exact ones.

A solver leaves noise on blocks that a load does not reach. So contacts that carry next to nothing
are set to carry nothing, which is admissible everywhere, and the forces of the others are put into
equilibrium without them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import chain

import numpy as np

from cvxlimit.base.arrays import ROUNDING, FloatArray, IntArray
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.statics import DOF, block_sizes
from cvxlimit.proof.gluing import with_contacts
from cvxlimit.proof.strength import Strength

ON_BOUNDARY = 1e-8
"""Yield excess, as a share of the forces on the less loaded of a contact's two blocks, that is put
down to the solver where forces have to be on the boundary of a surface."""

INSIDE = -ROUNDING
"""The same for forces that must be strictly inside, since small forces are added to them under
conditions that are not convex."""

_MOST_CUTS, _LEAST_GAP = 6, 3.0
"""Contacts are divided into those that carry and those that do not at the largest gaps in the sizes
of their forces: at so many gaps at most, each wider than this factor. That is enough for all of 162
walls and rows of boxes with some blocks pressed down."""


def carried_exactly(
    whole: Strength,
    state: FloatArray,
    most: float = ON_BOUNDARY,
    others: Callable[[Assemblage], Iterable[FloatArray]] = lambda part: (),
) -> FloatArray | None:
    """Returns contact forces (n, 6) near ``state`` that carry the dead load of an assemblage, in
    equilibrium to rounding; None if none are found.

    Parameters
    ----------
    whole : Strength
        That of the assemblage.
    state : (n, 6) or (p,)
        Nearly exact forces: contact forces, or internal ones as the strength has them.
    most : float
        Largest yield excess, as a share of the forces on a contact's less loaded block.
    others : function of an assemblage
        Yields further states of the part that carries, tried after the balanced one.
    """
    if whole.state(state) is None:
        return None
    assemblage, length = whole.assemblage, whole.contacts.typical_size
    contact_of_row = whole.model.contact if whole.is_internal else np.arange(len(whole.contacts))
    is_loaded = np.any(assemblage.statics.dead.reshape(-1, DOF), axis=1)
    for carrying in _carrying_contacts(block_sizes(whole.forces(state), length)):
        is_whole = len(carrying) == len(assemblage.contacts)
        part = assemblage if is_whole else with_contacts(assemblage, carrying, is_loaded)
        if not part.balance.is_supported:
            continue
        strength = whole if is_whole else whole.of(part, carrying)
        rows = np.isin(contact_of_row, carrying)
        balanced = strength.balanced(state[rows], 0.0, part.statics)
        for candidate in chain([balanced], others(part)):
            if _carries(strength, candidate, most, length):
                forces = np.zeros((len(whole.contacts), DOF))
                forces[carrying] = strength.forces(candidate)
                return forces
    return None


def _carrying_contacts(size: FloatArray) -> Iterator[IntArray]:
    """Yields the contacts that may be meant to carry, from the sizes (n,) of their forces: first
    all, then those above a gap, widest gap first."""
    order = np.argsort(size)
    ranked = np.maximum(size[order], 1e-300)
    gap = ranked[1:] / ranked[:-1]
    yield np.arange(len(size))
    for k in np.argsort(-gap)[:_MOST_CUTS]:
        if gap[k] > _LEAST_GAP:
            yield np.sort(order[k + 1 :])


def _carries(strength: Strength, state: FloatArray, most: float, length: float) -> bool:
    """Returns True if a state balances the dead load with no more excess than ``most``."""
    statics, forces = strength.assemblage.statics, strength.forces(state)
    if not (np.isfinite(forces).all() and statics.is_balanced(forces, 0.0, length)):
        return False
    a, b = (statics.row_of_block[block] for block in (statics.contacts.a, statics.contacts.b))
    acting = np.append(statics.acting(forces, 0.0, length), np.inf)  # supports, -1, are the last
    least = np.minimum(acting[a], acting[b])
    return bool((strength.excess(state) <= most * least[strength.rows]).all())
