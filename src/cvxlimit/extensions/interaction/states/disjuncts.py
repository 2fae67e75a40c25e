"""Disjuncts: states of a contact whose pressure centre is fixed, or confined to a small box.

With the pressure centre fixed the limits with interaction are convex. The forces of a contact are
taken as sums of forces of its disjuncts, which gives the convex hull of all their states (Balas'
perspective form): docs/evidence/interaction-bounds.md. Letters are those of :mod:`.support`: e is
the pressure centre, eps = abs(e), c the torsion arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.extensions.interaction.states.support import (
    box_corners,
    rectangle_arm,
    within_quadrants,
)
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.readings.pressure import half_extent, own_arm, polygon_arms


@dataclass(frozen=True, eq=False)
class Disjuncts:
    """The k disjuncts of all contacts; lengths are fractions of a contact's :func:`half_extent`.

    Attributes
    ----------
    contact : (k,) array of int
        Contact of each disjunct.
    centre : (k, 2) array
        Pressure centre e along t1 and t2.
    spread : (k, 2) array
        The centre may lie anywhere in centre +- spread; limits are those of eps = abs(centre) +
        spread.
    lever : (k, 2) array
        Point about which torsion is taken; NaN for the reading with independent signs.
    limited : (k,) array of bool
        Whether Eq. 27 holds besides Eq. 30.
    arm : (k,) array
        Torsion arm as a fraction of the contact's largest; NaN where it is that of the centre.
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
        """Whether torsion is taken about a lever, with its sign, (k,)."""
        return np.asarray(np.isfinite(self.lever).all(axis=1))

    def joined(self, *others: Disjuncts) -> Disjuncts:
        """Returns these disjuncts and those of ``others``."""
        columns = zip(*(vars(c).values() for c in (self, *others)), strict=True)
        return Disjuncts(*(np.concatenate(column) for column in columns))

    def without(self, contacts: IntArray) -> Disjuncts:
        """Returns the disjuncts of all but some ``contacts`` (m,)."""
        return self.take(~np.isin(self.contact, contacts))

    def take(self, kept: BoolArray) -> Disjuncts:
        """Returns the disjuncts that are ``kept``, (k,)."""
        return Disjuncts(*(values[kept] for values in vars(self).values()))

    @classmethod
    def none(cls) -> Disjuncts:
        """Returns no disjuncts."""
        return disjuncts_at_places(np.zeros(0, dtype=int), np.zeros((0, 2)))


def disjuncts_at_places(
    rows: IntArray,
    centre: FloatArray,
    spread: FloatArray | float = 0.0,
    lever: FloatArray | float = np.nan,
    is_limited: bool = False,
    arm: FloatArray | float = np.nan,
) -> Disjuncts:
    """Returns disjuncts of contacts ``rows`` (k,) at ``centre`` (k, 2); the other arguments are
    attributes of :class:`Disjuncts`, one for all or one each.
    """
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
    """Returns disjuncts pressed at ``centre``, or from -centre to centre where ``free`` (k, 2)."""
    spread = np.where(free, np.abs(centre), 0.0)
    return disjuncts_at_places(rows, np.where(free, 0.0, centre), spread, lever, is_limited, arm)


def corner_disjuncts(contacts: Contacts, chosen: BoolArray) -> Disjuncts:
    """Returns disjuncts pressed at each corner of the contacts that are ``chosen`` (n,)."""
    k = np.flatnonzero(chosen[contacts.corner_contact])
    j = contacts.corner_contact[k]
    place = contacts.corner_xy[k] / half_extent(contacts)[j]
    return disjuncts_at_places(j, place, lever=place)


def corner_places(boxes: FloatArray, side: FloatArray | float) -> tuple[IntArray, FloatArray]:
    """Returns the corners of ``boxes`` (n, 2, 2) cut at zero, each once: which box (k,), and where
    (k, 2); ``side`` is as for :func:`within_quadrants`."""
    rows, ends = within_quadrants(boxes, side)
    corners = box_corners(ends).reshape(-1, 2)
    once = np.unique(np.column_stack([np.tile(rows, 4), corners]), axis=0)
    return once[:, 0].astype(int), once[:, 1:]


def disjunct_arms(disjuncts: Disjuncts, contacts: Contacts) -> FloatArray:
    """Returns the arm c (k,) of disjuncts, in the unit of ``contacts``; exactly zero in corners."""
    # Arms of rectangles are in closed form; those stated, and those of polygons, replace them.
    half = half_extent(contacts)[disjuncts.contact]
    arm = rectangle_arm(half, half * (np.abs(disjuncts.centre) + disjuncts.spread))
    is_stated = np.isfinite(disjuncts.arm)
    arm[is_stated] = (disjuncts.arm * contacts.torsion_arm[disjuncts.contact])[is_stated]
    k = np.flatnonzero(~contacts.is_rectangle[disjuncts.contact] & ~is_stated)
    arm[k] = polygon_arms(contacts, disjuncts.contact[k], half[k] * disjuncts.centre[k])
    own = np.where(disjuncts.signed, np.inf, own_arm(contacts)[disjuncts.contact])
    least = 4.0 * ROUNDING * half.max(axis=1)  # bounds have a margin even in corners
    return np.where(arm > least, np.minimum(arm, own), 0.0)


def sheared(disjuncts: Disjuncts, arm: FloatArray) -> BoolArray:
    """Returns whether each disjunct can carry shear along t1 and t2, (k, 2). With unsigned torsion
    and no arm that is the one on which they press, as in a polygon's corner: eps2 abs(V1) + eps1
    abs(V2) + abs(MT) <= 0."""
    is_on_axis = np.abs(disjuncts.centre) + disjuncts.spread <= ROUNDING
    return np.asarray((disjuncts.signed | (arm > 0.0))[:, None] | is_on_axis[:, ::-1])
