"""Forces that carry a load exactly, from nearly exact ones: the blocks it does not reach stay idle.

A live load that forces carry on their own does no harm: any multiple of it is carried. A solver's
forces for that leave noise on blocks which the load does not reach; where nothing else loads these
blocks, no balance of theirs could be told from noise. So contacts that carry next to nothing carry
nothing, which is admissible everywhere, and the others are put into balance without them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.model.statics import DOF, Statics, block_sizes
from cvxlimit.proof.witnesses import Witnesses
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.coulomb import Rocking

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Excess = Callable[[FloatArray, Contacts], FloatArray]
"""By how much forces (n, 6) exceed what contacts bear, per contact, as a force; <= 0 is inside."""

BORNE = 1e-8
"""Excess, as a share of the forces on the less loaded block of the contact, that is put down to the
solver where forces are on the boundary of a surface and cannot be anywhere else."""

INSIDE = -1e-9
"""The same for forces that must be strictly inside: for conditions that are not convex, to which
small forces are added."""

_CUTS, _CUT = 6, 3.0
"""Forces are cut at their largest gaps, so many at most, each by more than this factor."""


def borne(
    statics: Statics,
    surfaces: Sequence[YieldSurface],
    excess: Excess,
    forces: FloatArray,
    others: Callable[[Statics], Iterable[FloatArray]] = lambda reached: (),
    most: float = BORNE,
) -> FloatArray | None:
    """Forces (n, 6) near given ones that carry the dead load of ``statics``, or None.

    In equilibrium to rounding, with no more ``excess`` than this share of the forces on a contact's
    less loaded block. ``others`` are tried where those given do not pass: states of the contacts
    that are left, in balance.
    """
    length = float(np.median(np.sqrt(statics.contacts.area)))
    for kept in _cuts(block_sizes(forces, length)):
        reached = _reached(statics, kept)
        witnesses = Witnesses(reached, surfaces)
        if not witnesses.is_supported:
            continue
        for state in chain([witnesses.balanced(forces[kept], 0.0)], others(reached)):
            allowed = most * _least_acting(reached, state, length)
            is_inside = bool((excess(state, reached.contacts) <= allowed).all())
            if is_inside and reached.is_balanced(state, 0.0, length):
                result = np.zeros_like(forces)
                result[kept] = state
                return result
    return None


def _cuts(size: FloatArray) -> Iterator[IntArray]:
    """All contacts, then those above the widest gaps between sizes (n,) of their forces."""
    order = np.argsort(size)
    ranked = np.maximum(size[order], 1e-300)
    gap = ranked[1:] / ranked[:-1]
    yield np.arange(len(size))
    for k in np.argsort(-gap)[:_CUTS]:
        if gap[k] > _CUT:
            yield np.sort(order[k + 1 :])


def _reached(statics: Statics, kept: IntArray) -> Statics:
    """Contacts ``kept``, and the free blocks that they or the load touch."""
    contacts, number = statics.contacts.only(kept), statics.row_of_block
    rows = np.concatenate([number[contacts.a], number[contacts.b]])
    is_reached = np.any(statics.dead.reshape(-1, DOF), axis=1)
    is_reached[rows[rows >= 0]] = True
    new = np.cumsum(is_reached) - 1
    number = np.where((number >= 0) & is_reached[number], new[number], -1)
    dof = np.repeat(is_reached, DOF)
    return replace(
        statics,
        contacts=contacts,
        row_of_block=number,
        dead=statics.dead[dof],
        live=statics.live[dof],
    )


def _least_acting(statics: Statics, forces: FloatArray, length: float) -> FloatArray:
    """Forces on the less loaded block of every contact (n,)."""
    contacts, number = statics.contacts, statics.row_of_block
    acting = np.append(statics.acting(forces, 0.0, length), np.inf)
    return np.minimum(acting[number[contacts.a]], acting[number[contacts.b]])


def surface_excess(surfaces: Sequence[YieldSurface]) -> Excess:
    """The largest excess over all conditions of some surfaces."""

    def excess(forces: FloatArray, contacts: Contacts) -> FloatArray:
        worst = rocking_excess(forces, contacts)
        for surface in surfaces:
            if surface.name == Rocking.name:
                continue
            for condition, y in zip(
                surface.conditions(contacts), surface.excess(forces, contacts), strict=True
            ):
                rows = np.arange(len(contacts)) if condition.contact is None else condition.contact
                np.maximum.at(worst, rows, y)
        return worst

    return excess


def rocking_excess(forces: FloatArray, contacts: Contacts) -> FloatArray:
    """Eq. 9 in force units (n,): how far pressure is outside the contact; tension counts too."""
    _, _, offset = contacts.edges
    moments = Rocking().excess(forces, contacts)[0] / offset
    outside: FloatArray = -contacts.corner_minimum(-moments)
    return np.maximum(outside, -forces[:, COLUMN["N"]])
