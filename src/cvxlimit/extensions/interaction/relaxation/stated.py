"""The cones of disjuncts, as conditions on unknowns of their own.

A disjunct has the pressure centre e, the spread s by which its centre may be off, the arm c of
Eq. 26, and the lever d about which torsion is taken; friction is mu. Its unknowns are N, V1, V2,
torsion's share tau of friction, the parts m1, m2 and t of moments that are free within bounds, and
a1 >= abs(V1), a2 >= abs(V2):

    M1 = e2 N + m1,  abs(m1) <= s2 N,      M2 = -e1 N + m2,  abs(m2) <= s1 N,
    MT = d1 V2 - d2 V1 + t,  abs(t) <= c tau,                             (Eq. 30)
    abs(V) + (eps2 a1 + eps1 a2) / c + tau <= mu N,   tau >= 0,   N >= 0,
    abs(MT) <= c mu N  where the disjunct is ``limited``                    (Eq. 27)

with eps = s, and eps = abs(e) + s and d = 0 where torsion has every sign on its own. Unknowns that
would be zero are left out. No row has unknowns of two disjuncts, so that solvers which eliminate by
blocks have small ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.extensions.interaction.states.disjuncts import Disjuncts, disjunct_arms, sheared
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.formulations import times
from cvxlimit.model.sinks import Constraints, Rows, gathered, stacked
from cvxlimit.readings.pressure import half_extent


class StatedDisjuncts:
    """Disjuncts of ``contacts`` stated to a sink, for a problem that has ``count`` contacts, each
    in the place that ``number`` (n,) gives it.

    Attributes
    ----------
    owners : list of int arrays
        The disjuncts of all unknowns, one array for each time that some were made.
    forces : form
        The forces (6 m,) of the problem's contacts.
    """

    def __init__(
        self,
        disjuncts: Disjuncts,
        contacts: Contacts,
        number: IntArray,
        count: int,
        into: Constraints | Rows,
    ) -> None:
        self.disjuncts, self.into = disjuncts, into
        self.owners: list[IntArray] = []
        self._added: list[tuple[str, IntArray, Any, FloatArray | float]] = []
        self.friction = contacts.friction[disjuncts.contact]
        self.half_sides = half_extent(contacts)[disjuncts.contact]
        self.arm = disjunct_arms(disjuncts, contacts)
        # Which disjuncts can carry shear, and torsion beside that of shear.
        self.along = sheared(disjuncts, self.arm)
        self.shears = np.flatnonzero(self.along.any(axis=1))
        self.twists = np.flatnonzero(self.arm > 0.0)
        compression = self._compression()
        shear, lever = self._shear()
        tau = self._torsion(compression, shear, lever)
        self._friction(compression, shear, tau)
        # The forces of contacts: sums over all contributions.
        components, owners, forms, weights = zip(*self._added, strict=True)
        first = len(COMPONENTS) * number[disjuncts.contact]
        rows = [first[k] + COLUMN[c] for c, k in zip(components, owners, strict=True)]
        values = [np.full(len(k), w) for w, k in zip(weights, owners, strict=True)]
        size, every = len(COMPONENTS) * count, np.concatenate(rows)
        self.forces = gathered(stacked(forms), every, size, np.concatenate(values))

    def _compression(self) -> Any:
        """States N at e, and bending m1, m2 within the spread; returns N."""
        every, disjuncts = np.arange(len(self.disjuncts)), self.disjuncts
        compression = self._new(every)
        e1, e2 = (self.half_sides * disjuncts.centre).T
        for component, place in (("N", 1.0), ("M1", e2), ("M2", -e1)):
            self._add(component, every, compression, place)
        # N >= 0 is a row only where no friction cone says so.
        is_loose = np.ones(len(every), dtype=bool)
        is_loose[self.shears] = self.friction[self.shears] <= 0.0
        self.into.nonneg(compression[is_loose])
        for axis, moment in enumerate(("M2", "M1")):
            reach = (self.half_sides * disjuncts.spread)[:, axis]
            k = np.flatnonzero(reach > 0.0)
            self._free_part(moment, k, times(reach[k], compression[k]))
        return compression

    def _shear(self) -> tuple[tuple[Any, Any], FloatArray]:
        """States shear and its torsion about the lever; returns its components V1, V2 of the
        disjuncts that have some, and their levers (k, 2)."""
        k, limited = self.shears, self.disjuncts.limited
        is_signed = self.disjuncts.signed[:, None]
        lever = np.where(is_signed, self.half_sides * self.disjuncts.lever, 0.0)[k]
        # Without an arm Eq. 27 leaves shear along the lever only: that is one unknown in this
        # direction, for two rows that say so would leave solvers no interior.
        length = np.hypot(lever[:, 0], lever[:, 1])
        is_led = limited[k] & (self.arm[k] <= 0.0) & (length > 0.0)
        direction = lever / np.where(length > 0.0, length, 1.0)[:, None]
        first, second = np.where(is_led[:, None], direction, self.along[k]).T
        lever[is_led] = 0.0
        shear = self._new(k), self._new(k)
        self._add("V1", k, shear[0], first)
        self._add("V2", k, shear[0], np.where(is_led, second, 0.0))
        self._add("V2", k, shear[1], np.where(is_led, 0.0, second))
        self._add("MT", k, shear[0], -lever[:, 1])
        self._add("MT", k, shear[1], lever[:, 0])
        return shear, lever

    def _torsion(self, compression: Any, shear: tuple[Any, Any], lever: FloatArray) -> Any:
        """States torsion t beside that of shear, at most c tau, and Eq. 27; returns tau."""
        twists, arm = self.twists, self.arm
        tau = self._new(twists)
        self.into.nonneg(tau)
        most, is_limited = times(arm[twists], tau), self.disjuncts.limited[twists]
        self._free_part("MT", twists[~is_limited], most[~is_limited])
        # Eq. 27: with what shear does about the lever it is at most c mu N.
        limited = np.flatnonzero((self.disjuncts.limited & (arm > 0.0))[self.shears])
        k, (d1, d2) = self.shears[limited], lever[limited].T
        part = self._free_part("MT", twists[is_limited], most[is_limited])
        torsion = times(d1, shear[1][limited]) - times(d2, shear[0][limited])
        torsion = torsion + gathered(part, np.searchsorted(k, twists[is_limited]), len(k))
        self._within(torsion, times(arm[k] * self.friction[k], compression[k]))
        return tau

    def _friction(self, compression: Any, shear: tuple[Any, Any], tau: Any) -> None:
        """States that shear is within what tau and the eccentricities leave of mu N."""
        k, arm, centre = self.shears, self.arm, self.disjuncts.centre
        rest = times(self.friction[k], compression[k])
        rest = rest - gathered(tau, np.searchsorted(k, self.twists), len(k))
        for axis, other in ((0, 1), (1, 0)):
            fixed = np.where(self.disjuncts.signed[k], 0.0, np.abs(centre[k, other]))
            eps = self.half_sides[k, other] * (fixed + self.disjuncts.spread[k, other])
            weight = eps / np.where(arm[k] > 0.0, arm[k], 1.0)
            rows = np.flatnonzero(weight > 0.0)
            size = self._new(k[rows])
            self._within(shear[axis][rows], size)
            rest = rest - gathered(size, rows, len(k), weight[rows])
        if len(k):
            self.into.cone(rest, shear)

    def _new(self, k: IntArray) -> Any:
        """Returns a new unknown for each of the disjuncts k."""
        self.owners.append(k)
        return self.into.new(len(k))

    def _within(self, form: Any, most: Any) -> None:
        """States that the size of a form is at most ``most``."""
        self.into.nonneg(most - form)
        self.into.nonneg(most + form)

    def _add(self, component: str, k: IntArray, form: Any, weight: FloatArray | float) -> None:
        """Adds weight times the form to a force component of the contacts of disjuncts k."""
        self._added.append((component, k, form, weight))

    def _free_part(self, component: str, k: IntArray, most: Any) -> Any:
        """Adds an unknown of its own to a force component, of a size of ``most`` at most."""
        part = self._new(k)
        self._add(component, k, part, 1.0)
        self._within(part, most)
        return part
