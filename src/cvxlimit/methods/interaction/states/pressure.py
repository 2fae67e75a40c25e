"""Where contacts press: plain NumPy on forces in the user's units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.polygons import effective_region, mean_distance, torsion_arm


@dataclass(frozen=True, eq=False)
class Pressure:
    """Pressure centres and effective torsion arms of all contacts (Eq. 26 and 31).

    ``e1``, ``e2``, ``arm`` have shape (n,), in the unit of length; contacts without compression
    count as pressed at their centre, where they carry nothing anyway.
    """

    e1: FloatArray
    e2: FloatArray
    arm: FloatArray

    @classmethod
    def of(cls, forces: FloatArray, contacts: Contacts, epsilon: float = 0.0) -> Pressure:
        """From forces (n, 6), with N + ``epsilon`` for N in Eq. 31.

        Centres outside the contact are taken to its nearest edge. A force ``epsilon`` above zero
        takes contacts that carry next to nothing for pressed near their centres: bounds are for
        the true centres, without it.
        """
        normal, m1, m2 = (forces[:, COLUMN[c]] for c in ("N", "M1", "M2"))
        pressed = normal > 0.0
        safe = np.where(pressed, normal + epsilon, 1.0)
        e1 = np.where(pressed, -m2 / safe, 0.0)
        e2 = np.where(pressed, m1 / safe, 0.0)
        return cls(e1, e2, effective_arm(e1, e2, contacts))


def effective_arm(e1: FloatArray, e2: FloatArray, contacts: Contacts) -> FloatArray:
    """c_T (n,) of the effective regions around pressure centres (e1, e2).

    For a rectangle the effective area of Eq. 26; for other convex polygons P the region
    P ∩ (2 e - P), which is the same for a rectangle, and the mean distance from e over it.
    """
    l1, l2 = contacts.sides.T
    with np.errstate(invalid="ignore"):
        arm = torsion_arm(
            np.maximum(l1 - 2.0 * np.abs(e1), 0.0), np.maximum(l2 - 2.0 * np.abs(e2), 0.0)
        )
    for j in np.flatnonzero(~contacts.is_rectangle).tolist():
        centre = np.array([e1[j], e2[j]])
        arm[j] = mean_distance(effective_region(contacts.corners_of(j), centre), centre)
    return arm


def own_arm(contacts: Contacts) -> FloatArray:
    """Largest arm (n,) that independent signs grant a contact: c_T of the contact itself where it
    is not convex, infinite elsewhere.

    Contacts that are not convex rock about their hull, and effective regions are the hull's; the
    hull's mean distance may exceed the contact's, which Eq. 24 has. With this limit independent
    signs, the safe reading, imply Eq. 24 there as they do on rectangles.
    """
    most = np.full(len(contacts), np.inf)
    outlines = [j for j in contacts.pieces if not contacts.is_rectangle[j]]
    most[outlines] = contacts.torsion_arm[outlines]
    return most
