"""Disjuncts of contacts with frozen pressure centres: contact forces are sums over them.

The sum of disjuncts is the convex hull of a contact's states (Balas' perspective form, one disjunct
each): docs/evidence/interaction-bounds.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.readings.states.pressure import own_arm, polygon_arms
from cvxlimit.readings.states.support import (
    box_corners,
    half_extent,
    rectangle_arm,
    within_quadrants,
)


@dataclass(frozen=True, eq=False)
class Disjuncts:
    """Disjuncts of contacts with frozen pressure centres, k of them.

    ``centre`` (k, 2) is a fraction of :func:`half_extent`; with ``spread`` (k, 2) it may lie
    anywhere in centre +- spread, and the disjunct is that of eps = abs(centre) + spread. Torsion is
    taken about ``lever`` (k, 2), a fraction too; NaN where every sign is on its own. ``limited``
    (k,) says where Eq. 27 stands beside Eq. 30. ``arm`` (k,) is NaN but where it is not that of the
    centre.
    """

    contact: IntArray
    centre: FloatArray
    spread: FloatArray
    lever: FloatArray
    limited: BoolArray
    arm: FloatArray

    def __len__(self) -> int:
        return len(self.contact)

    @property
    def signed(self) -> BoolArray:
        return np.asarray(np.isfinite(self.lever).all(axis=1))

    def joined(self, *others: Disjuncts) -> Disjuncts:
        columns = zip(*(vars(c).values() for c in (self, *others)), strict=True)
        return Disjuncts(*(np.concatenate(column) for column in columns))

    def without(self, contacts: IntArray) -> Disjuncts:
        return self.take(~np.isin(self.contact, contacts))

    def take(self, kept: BoolArray) -> Disjuncts:
        return Disjuncts(*(values[kept] for values in vars(self).values()))

    @property
    def names(self) -> list[bytes]:
        """Names each disjunct by its contact, and where that presses."""
        table = np.column_stack([self.contact, self.centre, self.spread])
        return table.view(f"V{table.itemsize * table.shape[1]}").ravel().tolist()

    @classmethod
    def none(cls) -> Disjuncts:
        return disjuncts_at_places(np.zeros(0, dtype=int), np.zeros((0, 2)))


def disjuncts_at_places(
    rows: IntArray,
    centre: FloatArray,
    spread: FloatArray | float = 0.0,
    lever: FloatArray | float = np.nan,
    is_limited: bool = False,
    arm: FloatArray | float = np.nan,
) -> Disjuncts:
    spreads, levers = (np.broadcast_to(values, centre.shape) for values in (spread, lever))
    arms, limited = np.broadcast_to(arm, rows.shape), np.full(len(rows), is_limited)
    return Disjuncts(rows, centre, spreads, levers, limited, arms)


def spread_disjuncts(
    rows: IntArray,
    centre: FloatArray,
    free: BoolArray,
    lever: FloatArray | float = np.nan,
    is_limited: bool = False,
    arm: FloatArray | float = np.nan,
) -> Disjuncts:
    """Disjuncts pressed at ``centre``, or from -centre to centre where ``free`` (k, 2)."""
    spread = np.where(free, np.abs(centre), 0.0)
    return disjuncts_at_places(rows, np.where(free, 0.0, centre), spread, lever, is_limited, arm)


def corner_disjuncts(contacts: Contacts, chosen: BoolArray) -> Disjuncts:
    """Friction at the corners of the contacts that are ``chosen`` (n,)."""
    k = np.flatnonzero(chosen[contacts.corner_contact])
    j = contacts.corner_contact[k]
    place = contacts.corner_xy[k] / half_extent(contacts)[j]
    return disjuncts_at_places(j, place, lever=place)


def corner_places(boxes: FloatArray, side: FloatArray | float) -> tuple[IntArray, FloatArray]:
    """Corners of boxes (n, 2, 2) cut at zero, each once: which box (k,), and where (k, 2); ``side``
    as for :func:`within_quadrants`."""
    rows, ends = within_quadrants(boxes, side)
    corners = box_corners(ends).reshape(-1, 2)
    found = np.unique(np.column_stack([np.tile(rows, 4), corners]), axis=0)
    return found[:, 0].astype(int), found[:, 1:]


def disjunct_arms(disjuncts: Disjuncts, contacts: Contacts) -> FloatArray:
    """c (k,) of the disjuncts, in the unit of ``contacts``; exactly zero in corners."""
    half = half_extent(contacts)[disjuncts.contact]
    arm = rectangle_arm(half, half * (np.abs(disjuncts.centre) + disjuncts.spread))
    given = np.isfinite(disjuncts.arm)
    arm[given] = (disjuncts.arm * contacts.torsion_arm[disjuncts.contact])[given]
    k = np.flatnonzero(~contacts.is_rectangle[disjuncts.contact] & ~given)
    arm[k] = polygon_arms(contacts, disjuncts.contact[k], half[k] * disjuncts.centre[k])
    own = np.where(disjuncts.signed, np.inf, own_arm(contacts)[disjuncts.contact])
    least = 4.0 * ROUNDING * half.max(axis=1)  # bounds have a margin even in corners
    return np.where(arm > least, np.minimum(arm, own), 0.0)


def sheared(disjuncts: Disjuncts, arm: FloatArray) -> BoolArray:
    """Along which axes (k, 2) disjuncts shear. With unsigned torsion and no arm that is the one on
    which they press, as in a polygon's corner: eps2 abs(V1) + eps1 abs(V2) + abs(MT) <= 0."""
    is_on_axis = np.abs(disjuncts.centre) + disjuncts.spread <= ROUNDING
    return np.asarray((disjuncts.signed | (arm > 0.0))[:, None] | is_on_axis[:, ::-1])
