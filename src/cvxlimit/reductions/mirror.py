"""Scenes with a mirror plane: half the model.

Let a reflection carry blocks, contacts, strength and loads into each other. Then some optimum is
its own mirror image, and one half of the contacts says it all; contacts that are their own partners
carry the symmetric part of their forces, and blocks move like their partners. None of this holds
with interaction; what does is in :mod:`cvxlimit.methods.interaction.readings.halves`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.model.statics import DOF, Statics
from cvxlimit.reductions.invariance import are_loads_alike, directions, is_invariant, reflected
from cvxlimit.surfaces.base import YieldSurface

_SAME_PLACE = 1e-11
"""Distance over the size of the scene, and difference of loads over the largest, put down to
rounding: built-in scenes with a mirror plane, turned at random, stay below 1e-14."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """A plane of symmetry and what it makes of blocks and contacts.

    ``blocks`` (free blocks,) and ``contacts`` (n,) are the partners of each, itself on the plane;
    ``carried`` (n, 6, 6) forces of the partner per forces of the contact, for mirrored states.
    """

    normal: FloatArray
    blocks: IntArray
    contacts: IntArray
    carried: FloatArray

    @property
    def reflection(self) -> FloatArray:
        """(6, 6): what it makes of generalised forces and rates."""
        return reflected(self.normal)

    @property
    def forces(self) -> sp.csr_array:
        """Forces of all contacts (6 n, 6 n) per forces of those with the lower number of a pair.

        The symmetric part only where a contact is its own partner. Other columns are empty.
        """
        width = len(COMPONENTS)
        each = np.arange(len(self.contacts))
        first = np.flatnonzero(each <= self.contacts)
        own = self.contacts[first] == first
        unit = np.tile(np.eye(width), (len(first), 1, 1))
        unit[own] = 0.5 * (unit[own] + self.carried[first[own]])
        others = first[~own]
        entries = np.concatenate([unit, self.carried[others]])
        place = np.concatenate([first, self.contacts[others]]), np.concatenate([first, others])
        rows = width * place[0][:, None, None] + np.arange(width)[:, None]
        columns = width * place[1][:, None, None] + np.arange(width)
        index = tuple(np.broadcast_to(i, entries.shape).ravel() for i in (rows, columns))
        shape = (width * len(each), width * len(each))
        result = sp.csr_array((entries.ravel(), index), shape=shape)
        result.eliminate_zeros()
        return result


def find_mirror(
    statics: Statics, surfaces: Sequence[YieldSurface], across: FloatArray | None = None
) -> Mirror | None:
    """A mirror plane of a scene under given surfaces, or None.

    ``across`` is the normal of a planar scene's plane, which is a mirror plane that halves nothing.
    """
    free = statics.centroids[statics.row_of_block >= 0]
    size = float(np.ptp(statics.contacts.corner_points, axis=0).max())
    for normal in _candidates(statics, free):
        if across is not None and abs(normal @ across) > _SAME_PLACE:
            continue
        mirror = _mirror(statics, normal, free, size)
        if mirror is not None and is_invariant(
            surfaces, statics.contacts, mirror.contacts, mirror.carried
        ):
            return mirror
    return None


def _candidates(statics: Statics, free: FloatArray) -> Iterator[FloatArray]:
    dead, live = (f.reshape(-1, DOF)[:, :3].sum(axis=0) for f in (statics.dead, statics.live))
    spread = np.linalg.eigh(np.cov(free.T))[1].T if len(free) > 1 else np.eye(3)
    both = np.cross(dead, live)
    is_clear = np.linalg.norm(both) > 1e-9 * np.linalg.norm(dead) * np.linalg.norm(live)
    return directions([*([both] if is_clear else []), *spread, *np.eye(3)])


def _mirror(statics: Statics, normal: FloatArray, free: FloatArray, size: float) -> Mirror | None:
    reflection = reflected(normal)
    turn = reflection[:3, :3]
    loads = [load.reshape(-1, DOF) for load in (statics.dead, statics.live)]
    if any(  # the sum of what is symmetric is: seldom so, and quicker to see than partners
        np.abs(f.sum(axis=0) @ normal) > _SAME_PLACE * np.abs(f).sum()
        for f in (load[:, :3] for load in loads)
    ):
        return None
    offset = 2.0 * float((free @ normal).mean()) * normal
    near = _SAME_PLACE * size
    blocks = _partners(free, free @ turn + offset, near)
    if blocks is None or not all(
        are_loads_alike(load[blocks], load @ reflection, size, _SAME_PLACE) for load in loads
    ):
        return None
    contacts = statics.contacts
    partner = _partners(contacts.origin, contacts.origin @ turn + offset, near)
    if partner is None:
        return None
    local = contacts.axes[partner] @ turn @ np.swapaxes(contacts.axes, 1, 2)
    side = local[:, 2, 2]
    if np.abs(np.abs(side) - 1.0).max() > _SAME_PLACE or not _same_blocks(
        statics, blocks, partner, side > 0.0
    ):
        return None
    # corners of a contact have a place of their own along a fourth axis, far from those of others
    corners, owner = contacts.corner_points, size * contacts.corner_contact
    images = np.column_stack([corners @ turn + offset, size * partner[contacts.corner_contact]])
    if _partners(np.column_stack([corners, owner]), images, near) is None:
        return None
    carried = np.zeros((len(contacts), DOF, DOF))
    carried[:, :3, :3] = np.sign(side)[:, None, None] * local
    carried[:, 3:, 3:] = -carried[:, :3, :3]
    return Mirror(normal, blocks, partner, carried)


def _partners(places: FloatArray, images: FloatArray, near: float) -> IntArray | None:
    distance, found = map(np.asarray, cKDTree(places).query(images))
    if distance.max() > near or len(np.unique(found)) < len(places):
        return None
    return np.asarray(found)


def _same_blocks(
    statics: Statics, blocks: IntArray, partner: IntArray, is_kept: NDArray[np.bool_]
) -> bool:
    number, contacts = statics.row_of_block, statics.contacts
    image = np.append(blocks, -1)
    a, b = number[contacts.a], number[contacts.b]
    one, other = np.where(is_kept, image[a], image[b]), np.where(is_kept, image[b], image[a])
    return bool((a[partner] == one).all() and (b[partner] == other).all())
