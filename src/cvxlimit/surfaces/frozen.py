"""Torsion-shear-bending (Eq. 30 and 32) with the eccentricities frozen: convex surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cvxlimit.geometry.contacts import Contacts
from cvxlimit.surfaces.base import Coefficient, Condition, Norm, YieldSurface, product
from cvxlimit.surfaces.cones import Cone


@dataclass(frozen=True, eq=False)
class Eccentricity:
    """Where contacts press, as fractions of c_T: the effective torsion arm c, and the arms ``e1``
    of V2 and ``e2`` of V1, the pressure centre along t1 and t2 or its magnitudes."""

    arm: Coefficient
    e1: Coefficient
    e2: Coefficient


class TorsionShearBending(YieldSurface):
    """abs(V1) e2 + abs(V2) e1 + abs(MT) <= c (mu N - abs(V)), independent signs (Eq. 32).

    Multiplied by c instead of divided, with Eq. 10 beside it: a contact pressed in a corner resists
    no torsion (c = 0), but slides as any other; without these rows solvers take friction off such
    contacts. With auxiliaries for the absolute values only one row has coefficients that change,
    for the same set as the paper's 64 rows with all combinations of signs.
    """

    name = "torsion-shear-bending"
    implies = frozenset({"sliding", "torsion", "torsion-shear"})

    def __init__(self, eccentricity: Eccentricity, cone: Cone | None = None) -> None:
        super().__init__(cone)
        self.eccentricity = eccentricity

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        at = self.eccentricity
        norms = [
            Norm({"V1": 1}, {"V2": 1}, weight=at.arm),
            Norm({"V1": 1}, weight=at.e2),
            Norm({"V2": 1}, weight=at.e1),
            Norm({"MT": 1 / contacts.torsion_arm}),
        ]
        return [Condition(norms, {"N": product(contacts.friction, at.arm)}), _coulomb(contacts)]


class SignedTorsionShearBending(TorsionShearBending):
    """abs(MT - e1 V2 + e2 V1) <= c (mu N - abs(V)): static torsion about the pressure centre."""

    name = "torsion-shear-bending (signed)"
    implies = frozenset({"sliding"})

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        at = self.eccentricity
        torsion = {"MT": 1 / contacts.torsion_arm, "V2": product(-1.0, at.e1), "V1": at.e2}
        norms = [Norm({"V1": 1}, {"V2": 1}, weight=at.arm), Norm(torsion)]
        return [Condition(norms, {"N": product(contacts.friction, at.arm)}), _coulomb(contacts)]


class LimitedTorsionShearBending(SignedTorsionShearBending):
    """The same with Eq. 27 beside it: abs(MT) <= c mu N, torsion about the contact's own centre."""

    name = "torsion-shear-bending (with torsion-bending)"
    implies = frozenset({"sliding", "torsion"})

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        torsion = Norm({"MT": 1 / contacts.torsion_arm})
        most = {"N": product(contacts.friction, self.eccentricity.arm)}
        return [*super().conditions(contacts), Condition([torsion], most)]


def _coulomb(contacts: Contacts) -> Condition:
    return Condition([Norm({"V1": 1}, {"V2": 1})], {"N": contacts.friction})
