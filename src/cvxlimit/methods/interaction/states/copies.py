"""Copies of contacts with frozen pressure centres, and contact forces as sums over them.

A contact's true states are a union over its pressure centre e of cones that are convex for fixed
e. Their convex hull is the sum of *copies*: parts (N_k, V_k) of the contact's force, each with its
own frozen pressure centre (Balas' perspective form). With c_k = c(e_k), kappa = (eps2, eps1) / c,

    abs(V_k) + kappa . (abs(V1_k), abs(V2_k)) + tau_k <= mu N_k,   tau_k >= 0,
    abs(MT) <= sum c_k tau_k,   abs(M2) <= sum eps1_k N_k,   abs(M1) <= sum eps2_k N_k

for independent signs, and for signed moments abs(V_k) + tau_k <= mu N_k, M = sum N_k e_k and
abs(MT - sum e_k x V_k) <= sum c_k tau_k. A copy with c = 0 carries no shear with independent
signs, and abs(V_k) <= mu N_k at its corner with signed moments. With tied signs another lever d_k
stands for e_k in the torque, and where Eq. 27 stands beside Eq. 30 a copy has a torsion of its own:

    MT = sum d_k x V_k + t_k,   abs(t_k) <= c_k tau_k,   abs(d_k x V_k + t_k) <= c_k mu N_k.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.geometry.polygons import effective_region, mean_distance
from cvxlimit.methods.interaction.states.cells import cells
from cvxlimit.methods.interaction.states.support import half_extent, rectangle_arm
from cvxlimit.model.formulations import ForceVariables

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

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
    signed : (k,) bool
        True where the torsion is taken about ``lever``; spread then costs torsion.
    lever : (k, 2)
        Point about which it is taken, as fractions too: with signed moments the centre.
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
    signed: NDArray[np.bool_]
    lever: FloatArray
    limited: NDArray[np.bool_]
    arm: FloatArray
    drag: FloatArray

    def __len__(self) -> int:
        return len(self.contact)

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
        return pinned_copies(np.zeros(0, dtype=int), np.zeros((0, 2)))


def pinned_copies(
    rows: IntArray,
    centre: FloatArray,
    around: FloatArray | float = 0.0,
    lever: FloatArray | None = None,
    is_limited: bool = False,
) -> Copies:
    """Copies of contacts ``rows`` with torsion about ``centre`` (k, 2), up to ``around`` it.

    ``lever`` (k, 2) is the point about which torsion is taken, where that is another one;
    ``is_limited`` puts Eq. 27 beside Eq. 30.
    """
    spread = np.broadcast_to(around, centre.shape)
    about = centre if lever is None else lever
    signed, limited = np.ones(len(rows), dtype=bool), np.full(len(rows), is_limited)
    return Copies(rows, centre, spread, signed, about, limited, *_as_pressed(rows))


def spread_copies(rows: IntArray, centre: FloatArray, free: NDArray[np.bool_]) -> Copies:
    """Copies with unsigned torsion: pressed from -centre to centre where ``free`` (k, 2)."""
    none = np.zeros(len(rows), dtype=bool)
    return Copies(
        rows,
        np.where(free, 0.0, centre),
        np.where(free, np.abs(centre), 0.0),
        none,
        np.zeros(centre.shape),
        none,
        *_as_pressed(rows),
    )


def _as_pressed(rows: IntArray) -> tuple[FloatArray, FloatArray]:
    return np.full(len(rows), np.nan), np.full((len(rows), 2), np.nan)


def cell_copies(
    contacts: Contacts, chosen: NDArray[np.bool_], boxes: FloatArray, signed: bool
) -> Copies:
    """Copies at the corners of the cells (:mod:`cells`) of ``chosen`` (n,) polygons in boxes."""
    half, found = half_extent(contacts), [Copies.none()]
    for j in np.flatnonzero(chosen).tolist():
        low, high = (half[j] * boxes[j, :, side] for side in (0, 1))
        part = cells(contacts.corners_of(j), low, high)
        k, place = len(part.arm), part.place / half[j]
        found.append(
            Copies(
                np.full(k, j),
                place,
                np.zeros((k, 2)),
                np.full(k, signed),
                place,
                np.zeros(k, dtype=bool),
                part.arm / contacts.torsion_arm[j],
                part.drag,
            )
        )
    return found[0].joined(*found[1:])


def corner_copies(contacts: Contacts, chosen: NDArray[np.bool_]) -> Copies:
    """Friction at the corners of the contacts that are ``chosen`` (n,)."""
    k = np.flatnonzero(chosen[contacts.corner_contact])
    j = contacts.corner_contact[k]
    return pinned_copies(j, contacts.corner_xy[k] / half_extent(contacts)[j])


def level_places(
    chosen: NDArray[np.bool_], levels: Sequence[tuple[FloatArray, NDArray[np.bool_]]]
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
    return np.where(arm > _POINT * half.min(axis=1), arm, 0.0)


def copy_forces(copies: Copies, contacts: Contacts) -> ForceVariables:
    """Variables and constraints of all copies; contact forces are sums over them."""
    return _CopyForces(copies, contacts).model()


class _CopyForces:
    """Builds the model of :func:`copy_forces`, variable by variable."""

    def __init__(self, copies: Copies, contacts: Contacts) -> None:
        self.copies, self.contacts = copies, contacts
        self.half = half_extent(contacts)[copies.contact]
        self.arm = copy_arms(copies, contacts)
        self.friction = contacts.friction[copies.contact]
        self.shears = np.flatnonzero(copies.signed | (self.arm > 0.0))
        self.twists = np.flatnonzero(self.arm > 0.0)
        self.compression = cp.Variable(len(copies), name="N")
        self.maps: list[tuple[cp.Variable, sp.csr_array]] = []
        self.constraints: list[cp.Constraint] = []

    def model(self) -> ForceVariables:
        """The forces of all contacts as sums over their copies."""
        self._add_compression()
        for axis, moment in enumerate(("M2", "M1")):
            self._add_spread(axis, moment)
        self._add_tangential()
        return ForceVariables(self.maps, {}, self.constraints)

    def _add_compression(self) -> None:
        k = np.arange(len(self.copies))
        e1, e2 = (self.half * self.copies.centre).T
        self._map(self.compression, [("N", k, k, np.ones(len(k))), ("M1", k, k, e2),
                                     ("M2", k, k, -e1)])  # fmt: skip
        implied = np.zeros(len(k), dtype=bool)
        implied[self.shears] = self.friction[self.shears] > 0.0
        if not implied.all():
            self.constraints.append(self.compression[np.flatnonzero(~implied)] >= 0.0)

    def _add_spread(self, axis: int, moment: str) -> None:
        """abs(moment) <= sum of spread N, for contacts with spread along ``axis``."""
        reach = (self.half * self.copies.spread)[:, axis]
        k = np.flatnonzero(reach > 0.0)
        self._add_bounded(moment, k, reach[k], self.compression[k] if len(k) else None)

    def _add_tangential(self) -> None:
        k = self.shears
        shear = cp.Variable((len(k), 2), name="V") if len(k) else None
        if shear is None:
            return
        along, arms = np.arange(len(k)), self._lever(k)
        self._map(shear, [
            ("V1", k, along, np.ones(len(k))), ("V2", k, along + len(k), np.ones(len(k))),
            ("MT", k, along, -arms[:, 1]), ("MT", k, along + len(k), arms[:, 0]),
        ])  # fmt: skip
        remaining = cp.multiply(self.friction[k], self.compression[k])
        remaining -= self._torsion(shear) + self._drag(shear)
        self.constraints.append(cp.SOC(remaining, shear, axis=1))

    def _lever(self, k: IntArray) -> FloatArray:
        """Where the torsion of copies ``k`` is taken about, (len(k), 2), in the unit of length."""
        signed = self.copies.signed[k][:, None]
        return np.where(signed, self.half[k] * self.copies.lever[k], 0.0)

    def _torsion(self, shear: cp.Variable) -> cp.Expression:
        """tau of the copies that shear, and the contacts' torsion bounded by it."""
        rows, limited = len(self.shears), self.copies.limited[self.twists]
        if not len(self.twists):
            self._limit_torsion(shear, None)
            return cp.Constant(np.zeros(rows))
        share = cp.Variable(len(self.twists), nonneg=True, name="tau")
        free, own = np.flatnonzero(~limited), np.flatnonzero(limited)
        if len(free):
            self._add_bounded("MT", self.twists[free], self.arm[self.twists[free]], share[free])
        self._limit_torsion(shear, share[own] if len(own) else None)
        return _places(np.searchsorted(self.shears, self.twists), rows) @ share

    def _limit_torsion(self, shear: cp.Variable, share: cp.Expression | None) -> None:
        """Eq. 27: torsion of their own for limited copies, which with what their shear does about
        the contact's centre is at most c mu N."""
        k = self.shears[self.copies.limited[self.shears]]
        if not len(k):
            return
        at, lever = np.searchsorted(self.shears, k), self._lever(k)
        total = cp.multiply(lever[:, 0], shear[at, 1]) - cp.multiply(lever[:, 1], shear[at, 0])
        if share is not None:
            twists = self.twists[self.copies.limited[self.twists]]
            own, each = cp.Variable(len(twists), name="t"), np.arange(len(twists))
            self._map(own, [("MT", twists, each, np.ones(len(twists)))])
            bound = cp.multiply(self.arm[twists], share)
            self.constraints += [own <= bound, -own <= bound]
            total = total + _places(np.searchsorted(k, twists), len(k)) @ own
        most = cp.multiply(self.arm[k] * self.friction[k], self.compression[k])
        self.constraints += [total <= most, -total <= most]

    def _drag(self, shear: cp.Variable) -> cp.Expression:
        """kappa . (abs(V1), abs(V2)): torsion whose sign or pressure centre is free, (rows,)."""
        k = self.shears
        fixed = np.where(self.copies.signed[k][:, None], 0.0, np.abs(self.copies.centre[k]))
        eps = self.half[k] * (fixed + self.copies.spread[k])
        total = cp.Constant(np.zeros(len(k)))
        given = np.isfinite(self.copies.drag[k]).all(axis=1) & ~self.copies.signed[k]
        for column in (0, 1):
            weight = eps[:, 1 - column] / np.where(self.arm[k] > 0.0, self.arm[k], 1.0)
            weight = np.where(given, self.copies.drag[k, column], weight)
            rows = np.flatnonzero(weight > 0.0)
            if len(rows):
                size = cp.Variable(len(rows))
                part = shear[rows, column]
                self.constraints += [part <= size, -part <= size]
                total = total + _places(rows, len(k), weight[rows]) @ size
        return total

    def _add_bounded(
        self, component: str, k: IntArray, reach: FloatArray, size: cp.Expression | None
    ) -> None:
        """A free part of a force component, between +- sums of reach * size over the copies k."""
        if size is None:
            return
        rows, place = np.unique(self.copies.contact[k], return_inverse=True)
        part = cp.Variable(len(rows))
        each = np.arange(len(rows))
        self.maps.append(
            (part, self._columns([(component, rows, each, np.ones(len(rows)))], len(rows)))
        )
        bound = sp.csr_array((reach, (place, np.arange(len(k)))), (len(rows), len(k))) @ size
        self.constraints += [part <= bound, -part <= bound]

    def _map(self, variable: cp.Variable, entries: list[_Entry]) -> None:
        by_contact = [(c, self.copies.contact[k], column, v) for c, k, column, v in entries]
        self.maps.append((variable, self._columns(by_contact, variable.size)))

    def _columns(self, entries: list[_Entry], size: int) -> sp.csr_array:
        rows = np.concatenate([len(COMPONENTS) * j + COLUMN[c] for c, j, _, _ in entries])
        columns = np.concatenate([column for _, _, column, _ in entries])
        values = np.concatenate([v for _, _, _, v in entries])
        matrix = sp.csr_array(
            (values, (rows, columns)), (len(COMPONENTS) * len(self.contacts), size)
        )
        matrix.eliminate_zeros()
        return matrix


_Entry = tuple[str, IntArray, IntArray, FloatArray]
"""Component, copies (or contacts), columns of the variable, coefficients."""


def _places(at: IntArray, rows: int, values: FloatArray | float = 1.0) -> sp.csr_array:
    """Matrix (rows, len(at)) that puts entry i, times its value, into row ``at[i]``."""
    entries = np.broadcast_to(np.asarray(values, dtype=float), at.shape)
    return sp.csr_array((entries, (at, np.arange(len(at)))), (rows, len(at)))
