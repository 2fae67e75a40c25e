"""Copies of contacts with frozen pressure centres: contact forces are sums over them.

The sum of copies is the convex hull of a contact's states (Balas' perspective form, one disjunct
each): docs/evidence/interaction-bounds.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvxlimit.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.methods.interaction.settings import SUPPORT
from cvxlimit.methods.interaction.states.pressure import own_arm, polygon_arms
from cvxlimit.methods.interaction.states.support import (
    box_corners,
    half_extent,
    rectangle_arm,
    within_quadrants,
)


@dataclass(frozen=True, eq=False)
class Copies:
    """Copies of contacts with frozen pressure centres, k of them.

    ``centre`` (k, 2) is a fraction of :func:`half_extent`; with ``spread`` (k, 2) it may lie
    anywhere in centre +- spread, and the copy is that of eps = abs(centre) + spread. Torsion is
    taken about ``lever`` (k, 2), a fraction too; NaN where every sign is on its own. ``limited``
    (k,) says where Eq. 27 stands beside Eq. 30; copies of one ``cell`` (k,) share it, those of none
    (-1) have it to themselves. ``arm`` (k,), over the contact's c_T, and ``drag``
    (k, 2), kappa, are NaN but where they are not those of the centre.
    """

    contact: IntArray
    centre: FloatArray
    spread: FloatArray
    lever: FloatArray
    limited: BoolArray
    arm: FloatArray
    drag: FloatArray
    cell: IntArray

    def __len__(self) -> int:
        return len(self.contact)

    @property
    def signed(self) -> BoolArray:
        return np.asarray(np.isfinite(self.lever).all(axis=1))

    def joined(self, *others: Copies) -> Copies:
        columns = zip(*(vars(c).values() for c in (self, *others)), strict=True)
        return Copies(*(np.concatenate(column) for column in columns))

    def without(self, contacts: IntArray) -> Copies:
        kept = ~np.isin(self.contact, contacts)
        return Copies(*(values[kept] for values in vars(self).values()))

    @classmethod
    def none(cls) -> Copies:
        return copies_of(np.zeros(0, dtype=int), np.zeros((0, 2)))


def copies_of(
    rows: IntArray,
    centre: FloatArray,
    spread: FloatArray | float = 0.0,
    lever: FloatArray | float = np.nan,
    is_limited: bool = False,
    arm: FloatArray | float = np.nan,
    drag: FloatArray | float = np.nan,
    cell: IntArray | int = -1,
) -> Copies:
    pairs = (np.broadcast_to(values, centre.shape) for values in (spread, lever, drag))
    spreads, levers, drags = pairs
    arms, limited = np.broadcast_to(arm, rows.shape), np.full(len(rows), is_limited)
    return Copies(
        rows, centre, spreads, levers, limited, arms, drags, np.broadcast_to(cell, rows.shape)
    )


def spread_copies(rows: IntArray, centre: FloatArray, free: BoolArray) -> Copies:
    """Copies with unsigned torsion: pressed from -centre to centre where ``free`` (k, 2)."""
    return copies_of(rows, np.where(free, 0.0, centre), np.where(free, np.abs(centre), 0.0))


def corner_copies(contacts: Contacts, chosen: BoolArray) -> Copies:
    """Friction at the corners of the contacts that are ``chosen`` (n,)."""
    k = np.flatnonzero(chosen[contacts.corner_contact])
    j = contacts.corner_contact[k]
    place = contacts.corner_xy[k] / half_extent(contacts)[j]
    return copies_of(j, place, lever=place)


def corner_places(boxes: FloatArray, side: FloatArray | float) -> tuple[IntArray, FloatArray]:
    """Corners of boxes (n, 2, 2) cut at zero, each once: which box (k,), and where (k, 2); ``side``
    as for :func:`within_quadrants`."""
    rows, ends = within_quadrants(boxes, side)
    corners = box_corners(ends).reshape(-1, 2)
    found = np.unique(np.column_stack([np.tile(rows, 4), corners]), axis=0)
    return found[:, 0].astype(int), found[:, 1:]


def copy_arms(copies: Copies, contacts: Contacts) -> FloatArray:
    """c (k,) of the copies, in the unit of ``contacts``; exactly zero in corners."""
    half = half_extent(contacts)[copies.contact]
    arm = rectangle_arm(half, half * (np.abs(copies.centre) + copies.spread))
    given = np.isfinite(copies.arm)
    arm[given] = (copies.arm * contacts.torsion_arm[copies.contact])[given]
    k = np.flatnonzero(~contacts.is_rectangle[copies.contact] & ~given)
    arm[k] = polygon_arms(contacts, copies.contact[k], half[k] * copies.centre[k])
    own = np.where(copies.signed | given, np.inf, own_arm(contacts)[copies.contact])
    return np.where(arm > SUPPORT.rounding * half.min(axis=1), np.minimum(arm, own), 0.0)
