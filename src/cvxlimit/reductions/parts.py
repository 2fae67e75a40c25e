"""Parts of a scene that do not matter for the load factor.

Supports part a scene: blocks that are linked through contacts with free blocks only stand or fall
together, whatever the others do. A part without live load carries its dead load at every load
factor in the same way; it must stand, and that is all. One without any load needs no forces.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cvxlimit.model.statics import DOF, Statics


def loaded_blocks(statics: Statics) -> NDArray[np.bool_]:
    """True (free blocks,) for those in a part with live load.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> bool(loaded_blocks(Statics.of(builtin_scene("stack"))).all())
    True
    """
    is_live = np.any(statics.live.reshape(-1, DOF), axis=1)
    if is_live.all():
        return is_live
    number = statics.row_of_block
    a, b = number[statics.contacts.a], number[statics.contacts.b]
    linked = (a >= 0) & (b >= 0)
    shape = (len(is_live), len(is_live))
    graph = sp.coo_array((np.ones(linked.sum()), (a[linked], b[linked])), shape=shape)
    part = connected_components(graph, directed=False)[1]
    return np.asarray(np.isin(part, part[is_live]))


def contacts_of(statics: Statics, blocks: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """True (n,) for contacts of the given free blocks."""
    member = np.append(blocks, False)
    number, contacts = statics.row_of_block, statics.contacts
    return np.asarray(member[number[contacts.a]] | member[number[contacts.b]])
