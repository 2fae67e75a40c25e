"""Smaller assemblages on which a bound of the whole can be proved.

Blocks that move as one are glued into one body: what a mechanism of the bodies proves, it proves
for the blocks. Contacts that carry next to nothing are left out: what forces prove without them,
they prove with them. Bounds that rest on an assumption for the whole are often proved there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.statics import DOF, Statics


def glued(
    assemblage: Assemblage, mechanism: FloatArray, share: float
) -> tuple[Assemblage, FloatArray, IntArray] | None:
    """Returns the assemblage of the bodies that arise when blocks are glued which a mechanism
    (free blocks, 6) moves apart by less than a ``share`` of its largest rate; the rates (bodies, 6)
    of each body's first block; and the contacts (k,) between bodies.

    Returns None if nothing is glued, or everything to the supports, and for guides, which are no
    contacts.
    """
    statics = assemblage.statics
    if statics.guide is not None:
        return None
    # the body of each block: 0 is that of the supports
    body = _bodies(statics, mechanism, share)
    body_of_block = np.where(statics.row_of_block < 0, 0, body[statics.row_of_block + 1])
    a, b = statics.contacts.a, statics.contacts.b
    moving = np.flatnonzero(body_of_block[a] != body_of_block[b])
    if not len(moving) or len(moving) == len(statics.contacts):
        return None
    first = np.unique(body, return_index=True)[1][1:] - 1  # a free block of each body
    centre = statics.centroids[statics.row_of_block >= 0]
    origin = np.vstack([np.zeros(3), centre[first]])
    bodies = Statics(
        contacts=statics.contacts.take(moving),
        centroids=np.where(body_of_block[:, None] > 0, origin[body_of_block], statics.centroids),
        row_of_block=body_of_block - 1,
        dead=_moved(statics.dead, body[1:], centre, origin),
        live=_moved(statics.live, body[1:], centre, origin),
    )
    return assemblage.of_less(bodies), mechanism[first], moving


def without_idle(
    assemblage: Assemblage, forces: FloatArray, share: float
) -> tuple[Assemblage, FloatArray] | None:
    """Returns the assemblage without the contacts whose forces (n, 6) are below a ``share`` of the
    largest and without blocks that no contact touches any more, and the forces that are left.

    Returns None if no contact is left out, if some block would lack any support, as one that bears
    a load would, and for guides.
    """
    statics = assemblage.statics
    if statics.guide is not None:
        return None
    contacts = statics.contacts
    reach = np.repeat([float(np.abs(contacts.corner_xy).max()), 1.0], 3)
    size = np.abs(forces * reach).max(axis=1)
    busy = np.flatnonzero(size > share * size.max(initial=0.0))
    if not len(busy) or len(busy) == len(contacts):
        return None
    loads = np.stack([statics.dead, statics.live]).reshape(2, -1, DOF)
    less = with_contacts(assemblage, busy, (loads != 0.0).any(axis=(0, 2)))
    return (less, forces[busy]) if less.balance.is_supported else None


def with_contacts(assemblage: Assemblage, kept: IntArray, blocks: BoolArray) -> Assemblage:
    """Returns the assemblage of the contacts ``kept`` (k,) alone, with the free blocks that these
    touch or for which ``blocks`` (free blocks,) is True."""
    statics = assemblage.statics
    contacts, number = statics.contacts.take(kept), statics.row_of_block
    rows = np.concatenate([number[contacts.a], number[contacts.b]])
    is_kept = blocks.copy()
    is_kept[rows[rows >= 0]] = True
    dof, guide = np.repeat(is_kept, DOF), statics.guide
    smaller = replace(
        statics,
        contacts=contacts,
        row_of_block=np.where((number >= 0) & is_kept[number], np.cumsum(is_kept)[number] - 1, -1),
        dead=statics.dead[dof],
        live=statics.live[dof],
        guide=None if guide is None else guide[dof][:, dof],
    )
    return assemblage.of_less(smaller)


def _bodies(statics: Statics, mechanism: FloatArray, share: float) -> IntArray:
    """Returns the number of the body (1 + free blocks,) that the supports, as one, and each free
    block belong to."""
    contacts = statics.contacts
    reach = np.repeat([1.0, float(np.abs(contacts.corner_xy).max())], 3)
    apart = np.abs(statics.relative_rates(mechanism) * reach).max(axis=1)
    stuck = apart <= share * np.abs(mechanism * reach).max()
    row = np.where(statics.row_of_block < 0, 0, statics.row_of_block + 1)
    ends = row[contacts.a][stuck], row[contacts.b][stuck]
    count = len(mechanism) + 1
    links = sp.coo_array((np.ones(len(ends[0])), ends), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1])


def _moved(load: FloatArray, body: IntArray, centre: FloatArray, origin: FloatArray) -> FloatArray:
    """Returns the loads (6 bodies,) on bodies, about their ``origin``, from those on blocks, about
    their ``centre``."""
    each = load.reshape(-1, DOF).copy()
    each[:, 3:] += np.cross(centre - origin[body], each[:, :3])
    total = np.zeros((len(origin), DOF))
    np.add.at(total, body, each)
    return total[1:].ravel()
