"""Copies of contacts with frozen pressure centres: contact forces are sums over them.

A contact's true states are a union over its pressure centre e of cones that are convex for fixed
e. Their convex hull is the sum of *copies*: parts (N_k, V_k) of the contact's force, each with its
own frozen pressure centre (Balas' perspective form, one disjunct each). With c_k = c(e_k) and
kappa = (eps2, eps1) / c,

    abs(V_k) + kappa . (abs(V1_k), abs(V2_k)) + tau_k <= mu N_k,   tau_k >= 0,
    abs(MT) <= sum c_k tau_k,   abs(M2) <= sum eps1_k N_k,   abs(M1) <= sum eps2_k N_k

for independent signs, and for signed moments abs(V_k) + tau_k <= mu N_k, M = sum N_k e_k and
abs(MT - sum e_k x V_k) <= sum c_k tau_k. A copy with c = 0 carries no shear with independent
signs, and abs(V_k) <= mu N_k at its corner with signed moments. With tied signs another lever d_k
stands for e_k in the torque, and where Eq. 27 stands beside Eq. 30 a copy has a torsion of its own:

    MT = sum d_k x V_k + t_k,   abs(t_k) <= c_k tau_k,   abs(d_k x V_k + t_k) <= c_k mu N_k.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cvxlimit.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.polygons import effective_region, mean_distance
from cvxlimit.methods.interaction.states.cells import Cells
from cvxlimit.methods.interaction.states.pressure import own_arm
from cvxlimit.methods.interaction.states.support import half_extent, rectangle_arm

Lever = Callable[[FloatArray], FloatArray]
"""From pressure centres (..., 2) to the points about which torsion is taken, (..., 2)."""

_POINT = 1e-9
"""Arms below this share of the half extent count as zero: the pressure centre is a corner."""


@dataclass(frozen=True, eq=False)
class Copies:
    """Copies of contacts with frozen pressure centres, k of them.

    Attributes
    ----------
    contact : (k,)
    centre, spread : (k, 2)
        Pressure centre as fractions of :func:`half_extent`; with spread it may lie anywhere in
        centre +- spread, and the copy is that of eps = abs(centre) + spread.
    lever : (k, 2)
        Point about which torsion is taken, as fractions too: with signed moments the centre;
        spread then costs torsion. NaN where every sign of the torque is on its own.
    limited : (k,) bool
        True where Eq. 27 stands beside Eq. 30.
    arm : (k,)
        c over the contact's c_T where it is not that of ``centre``; NaN elsewhere.
    drag : (k, 2)
        kappa where it is not that of ``centre``; NaN elsewhere.
    """

    contact: IntArray
    centre: FloatArray
    spread: FloatArray
    lever: FloatArray
    limited: BoolArray
    arm: FloatArray
    drag: FloatArray

    def __len__(self) -> int:
        return len(self.contact)

    @property
    def signed(self) -> BoolArray:
        """True (k,) where torsion is taken about a lever."""
        return np.asarray(np.isfinite(self.lever).all(axis=1))

    def joined(self, *others: Copies) -> Copies:
        """These and ``others``."""
        columns = zip(*(vars(c).values() for c in (self, *others)), strict=True)
        return Copies(*(np.concatenate(column) for column in columns))

    def without(self, contacts: IntArray) -> Copies:
        """Those of all other contacts."""
        kept = ~np.isin(self.contact, contacts)
        return Copies(*(values[kept] for values in vars(self).values()))

    @classmethod
    def none(cls) -> Copies:
        """No copies."""
        return copies_of(np.zeros(0, dtype=int), np.zeros((0, 2)))


def copies_of(
    rows: IntArray,
    centre: FloatArray,
    spread: FloatArray | float = 0.0,
    lever: FloatArray | float = np.nan,
    is_limited: bool = False,
    arm: FloatArray | float = np.nan,
    drag: FloatArray | float = np.nan,
) -> Copies:
    """Copies of contacts ``rows``: see :class:`Copies`."""
    pairs = (np.broadcast_to(values, centre.shape) for values in (spread, lever, drag))
    spreads, levers, drags = pairs
    arms, limited = np.broadcast_to(arm, rows.shape), np.full(len(rows), is_limited)
    return Copies(rows, centre, spreads, levers, limited, arms, drags)


def spread_copies(rows: IntArray, centre: FloatArray, free: BoolArray) -> Copies:
    """Copies with unsigned torsion: pressed from -centre to centre where ``free`` (k, 2)."""
    return copies_of(rows, np.where(free, 0.0, centre), np.where(free, np.abs(centre), 0.0))


def corner_copies(contacts: Contacts, chosen: BoolArray) -> Copies:
    """Friction at the corners of the contacts that are ``chosen`` (n,)."""
    k = np.flatnonzero(chosen[contacts.corner_contact])
    j = contacts.corner_contact[k]
    place = contacts.corner_xy[k] / half_extent(contacts)[j]
    return copies_of(j, place, lever=place)


def level_places(
    chosen: BoolArray, levels: Sequence[tuple[FloatArray, BoolArray]]
) -> Iterator[tuple[IntArray, FloatArray]]:
    """Contacts and pressure centres for all pairs of ``levels``: places (n, 2) along both axes,
    and where a contact has them."""
    for first, has_first in levels:
        for second, has_second in levels:
            rows = np.flatnonzero(chosen & has_first[:, 0] & has_second[:, 1])
            yield rows, np.stack([first[rows, 0], second[rows, 1]], axis=1)


def copy_arms(copies: Copies, contacts: Contacts) -> FloatArray:
    """c (k,) of the copies, in the unit of ``contacts``; exactly zero in corners."""
    half = half_extent(contacts)[copies.contact]
    arm = rectangle_arm(half, half * (np.abs(copies.centre) + copies.spread))
    given = np.isfinite(copies.arm)
    arm[given] = (copies.arm * contacts.torsion_arm[copies.contact])[given]
    for k in np.flatnonzero(~contacts.is_rectangle[copies.contact] & ~given):
        e = half[k] * copies.centre[k]
        arm[k] = mean_distance(effective_region(contacts.corners_of(copies.contact[k]), e), e)
    own = np.where(copies.signed | given, np.inf, own_arm(contacts)[copies.contact])
    return np.where(arm > _POINT * half.min(axis=1), np.minimum(arm, own), 0.0)


def cell_copies(found: Cells, contacts: Contacts, lever: Lever | None, is_limited: bool) -> Copies:
    """Copies at the corners of cells, which have their own arms."""
    j = found.contact
    place, arm = found.place / half_extent(contacts)[j], found.arm / contacts.torsion_arm[j]
    about = np.nan if lever is None else lever(place)
    return copies_of(j, place, 0.0, about, is_limited, arm, found.drag)
