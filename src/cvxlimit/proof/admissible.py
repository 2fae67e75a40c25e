"""Forces that carry a load exactly, from nearly exact ones.

A solver leaves noise on blocks that a load does not reach. So contacts that carry next to nothing
carry nothing, which is admissible everywhere, and the others are put into balance without them.
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
"""Excess, as a share of the forces on the less loaded block of the contact, that is put down to the
solver where forces are on the boundary of a surface and cannot be anywhere else."""

INSIDE = -ROUNDING
"""The same for forces that must be strictly inside: for conditions that are not convex, to which
small forces are added."""

_CUTS, _CUT = 6, 3.0
"""Forces are cut at their largest gaps, so many at most, each by more than this factor: enough for
all of 162 walls and rows of boxes with some blocks pressed down."""


def carried_exactly(
    assemblage: Assemblage,
    strength_of: Callable[[Assemblage], Strength],
    state: FloatArray,
    most: float = ON_BOUNDARY,
    others: Callable[[Assemblage], Iterable[FloatArray]] = lambda reached: (),
) -> FloatArray | None:
    """Contact forces (n, 6) near a state that carry the dead load of ``assemblage``, or None: in
    equilibrium to rounding, with no more excess than ``most``, a share of the forces on a contact's
    less loaded block. ``others`` are states of the contacts that are left, tried next.
    """
    whole = strength_of(assemblage)
    if whole.state(state) is None:
        return None
    length = whole.contacts.typical_size
    owner = whole.model.contact if whole.is_internal else np.arange(len(whole.contacts))
    for kept in _cuts(block_sizes(whole.forces(state), length)):
        bears = np.any(assemblage.statics.dead.reshape(-1, DOF), axis=1)
        is_whole = len(kept) == len(assemblage.contacts)
        reached = assemblage if is_whole else with_contacts(assemblage, kept, bears)
        if not reached.balance.is_supported:
            continue
        strength = strength_of(reached)
        given = strength.balanced(state[np.isin(owner, kept)], 0.0, reached.statics)
        for found in chain([given], others(reached)):
            if _is_borne(strength, found, most, length):
                result = np.zeros((len(whole.contacts), DOF))
                result[kept] = strength.forces(found)
                return result
    return None


def _cuts(size: FloatArray) -> Iterator[IntArray]:
    order = np.argsort(size)
    ranked = np.maximum(size[order], 1e-300)
    gap = ranked[1:] / ranked[:-1]
    yield np.arange(len(size))
    for k in np.argsort(-gap)[:_CUTS]:
        if gap[k] > _CUT:
            yield np.sort(order[k + 1 :])


def _is_borne(strength: Strength, state: FloatArray, most: float, length: float) -> bool:
    statics, forces = strength.assemblage.statics, strength.forces(state)
    if not (np.isfinite(forces).all() and statics.is_balanced(forces, 0.0, length)):
        return False
    contacts, number = statics.contacts, statics.row_of_block
    acting = np.append(statics.acting(forces, 0.0, length), np.inf)
    least = np.minimum(acting[number[contacts.a]], acting[number[contacts.b]])
    found = zip(strength.excess(state), strength.rows, strict=True)
    return all((y <= most * least[rows]).all() for y, rows in found)
