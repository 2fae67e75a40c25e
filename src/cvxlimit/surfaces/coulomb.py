"""The paper's surfaces without interaction with bending: rocking, sliding, torsion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cvxlimit.geometry.contacts import Contacts
from cvxlimit.surfaces.base import (
    CONSTANT,
    Coefficient,
    Condition,
    LinearForm,
    Norm,
    YieldSurface,
)


class Rocking(YieldSurface):
    """The pressure centre stays inside the contact: no tension, infinite strength (Eq. 9).

    For a rectangle abs(M1) <= N l2 / 2 and abs(M2) <= N l1 / 2; here one row per edge of any
    convex polygon: with the edge's inward normal (a1, a2) and offset b,
    N + (-a1 M2 + a2 M1) / b >= 0, because the pressure centre is (-M2 / N, M1 / N).
    """

    name = "rocking"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        contact, inward, offset = contacts.edges
        inside = {"N": 1, "M2": -inward[:, 0] / offset, "M1": inward[:, 1] / offset}
        return [Condition((), inside, contact)]


def slip_resistance(contacts: Contacts) -> LinearForm:
    """mu N (Eq. 10), and c A where the scene has cohesion: the most that slip works against."""
    friction: dict[str, Coefficient] = {"N": contacts.friction}
    if np.any(contacts.cohesion):
        friction[CONSTANT] = contacts.cohesion * contacts.area
    return friction


class Sliding(YieldSurface):
    """abs(V) <= mu N (Eq. 10; Eq. 11 with facets); mu N + c A with cohesion c."""

    name = "sliding"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return [Condition([Norm({"V1": 1}, {"V2": 1})], slip_resistance(contacts))]


class Torsion(YieldSurface):
    """abs(MT) <= c_T mu N (Eq. 17), with c_T of Eq. 16; c_T (mu N + c A) with cohesion c."""

    name = "torsion"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return [Condition([Norm({"MT": 1 / contacts.torsion_arm})], slip_resistance(contacts))]


class TorsionShear(YieldSurface):
    """abs(MT) / c_T + abs(V) <= mu N (Eq. 24; Eq. 25 with facets); mu N + c A with cohesion c."""

    name = "torsion-shear"
    implies = frozenset({"sliding", "torsion"})

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        norms = [Norm({"MT": 1 / contacts.torsion_arm}), Norm({"V1": 1}, {"V2": 1})]
        return [Condition(norms, slip_resistance(contacts))]
