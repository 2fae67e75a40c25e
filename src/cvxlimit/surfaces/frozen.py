"""Torsion-shear-bending (Eq. 30 and 32) with the eccentricities frozen: convex surfaces.

Each surface is stated twice: in force components, and for solvers in unknowns of its own, for which
the cone is that of the surface without interaction, abs(V) + abs(tau) <= mu N. The eccentricities
then stand in equilibrium instead of the condition. No row vanishes where a contact is pressed in a
corner (c = 0), of which Eq. 32 says nothing any more.

=======  ==================================================  ======  ===============================
letter   what it is                                          shape   in the code
=======  ==================================================  ======  ===============================
c_T      torsion arm (Eq. 16), a length                      (n,)    contacts.torsion_arm
c        torsion arm left by the eccentricity, over c_T      (n,)    Eccentricity.arm
e1, e2   pressure centre along t1 and t2, or its             (n,)    Eccentricity.e1, .e2
         magnitudes, over c_T
tau      torsion over c_T c, a force                         (n,)    unknown "tau"
mu       friction coefficient                                (n,)    contacts.friction
=======  ==================================================  ======  ===============================

In :class:`Pressed` centres and spreads are lengths, and so is e there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.surfaces.base import Coefficient, Condition, Norm, Unknowns, YieldSurface, product
from cvxlimit.surfaces.cones import Cone


@dataclass(frozen=True, eq=False)
class Eccentricity:
    """Where contacts are pressed, as fractions of c_T: the torsion arm c that is left, ``arm``
    (n,), and the pressure centre along t1 and t2 or its magnitudes, ``e1`` and ``e2`` (n,), which
    are the arms of V2 and of V1."""

    arm: FloatArray
    e1: FloatArray
    e2: FloatArray


class Frozen(YieldSurface):
    """A surface that depends on where contacts are pressed.

    ``shares`` are the coefficients by name that :meth:`unknowns` needs: arrays (n,), or CVXPY
    Parameters in their place.
    """

    shares: dict[str, Coefficient]


class Pressed(Frozen):
    """Contacts pressed at ``centre`` (n, 2), or up to ``spread`` (n, 2) from there:
    abs(M2 + e1 N) <= spread1 N, abs(M1 - e2 N) <= spread2 N.

    It is inside the true condition wherever torque and arm are those of its farthest point.
    """

    name = "pressed"

    def __init__(self, centre: FloatArray, spread: FloatArray | None = None) -> None:
        super().__init__()
        columns = {"centre": centre} if spread is None else {"centre": centre, "spread": spread}
        self.shares = {f"{k}{i + 1}": v[:, i] for k, v in columns.items() for i in (0, 1)}

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        s = self.shares
        turned = {"M2": {"N": s["centre1"]}, "M1": {"N": product(-1.0, s["centre2"])}}
        rows = [{name: 1.0, **row} for name, row in turned.items()]
        return [Condition([Norm(row)], {"N": r}) for row, r in zip(rows, self._reach, strict=True)]

    def unknowns(self, contacts: Contacts) -> Unknowns:
        """Returns unknowns p1 and p2 in place of M2 and M1: M2 = -e1 N + spread1 p1 with
        abs(p1) <= N, and M1 = e2 N + spread2 p2."""
        s = self.shares
        gives = {"M1": {"N": s["centre2"]}, "M2": {"N": product(-1.0, s["centre1"])}}
        if "spread1" not in s:
            return Unknowns(gives, [])
        gives = {"M1": gives["M1"] | {"p2": s["spread2"]}, "M2": gives["M2"] | {"p1": s["spread1"]}}
        return Unknowns(gives, [Condition([Norm({p: 1})], {"N": 1}) for p in ("p1", "p2")])

    @property
    def _reach(self) -> list[Coefficient]:
        """The spread along t1 and t2; zero without one."""
        return [self.shares.get(name, 0.0) for name in ("spread1", "spread2")]


class TorsionShearBending(Frozen):
    """abs(V1) e2 + abs(V2) e1 + abs(MT) <= c (mu N - abs(V)), independent signs (Eq. 32).

    Multiplied by c instead of divided, with Eq. 10 beside it: a contact pressed in a corner resists
    no torsion (c = 0), but slides as any other; without these rows solvers take friction off such
    contacts. ``shares`` are the coefficients in unknowns of its own, which :meth:`unknowns` needs:
    numbers, or CVXPY Parameters in their place.
    """

    name = "torsion-shear-bending"
    implies = frozenset({"sliding", "torsion", "torsion-shear"})

    def __init__(self, eccentricity: Eccentricity, cone: Cone | None = None) -> None:
        super().__init__(cone)
        self.eccentricity = eccentricity
        self.shares = {**self.shares_of(eccentricity)}

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        at = self.eccentricity
        norms = [
            Norm({"V1": 1}, {"V2": 1}, weight=at.arm),
            Norm({"V1": 1}, weight=at.e2),
            Norm({"V2": 1}, weight=at.e1),
            Norm({"MT": 1 / contacts.torsion_arm}),
        ]
        return [Condition(norms, {"N": product(contacts.friction, at.arm)}), _coulomb(contacts)]

    @classmethod
    def shares_of(cls, at: Eccentricity) -> dict[str, FloatArray]:
        """Returns c, k1 = e1 / (c + e1) and k2 = e2 / (c + e2), all in [0, 1] for any arm, zero
        included."""
        return {"arm": at.arm, "k1": _share(at.e1, at.arm), "k2": _share(at.e2, at.arm)}

    def unknowns(self, contacts: Contacts) -> Unknowns:
        """Returns unknowns v1, v2 and tau. V1 = (1 - k2) v1 with k2 = e2 / (c + e2), so that
        e2 abs(V1) / c is k2 abs(v1); V2 likewise."""
        arm, k1, k2 = (self.shares[name] for name in ("arm", "k1", "k2"))
        components = {
            "V1": {"v1": 1.0 - k2},
            "V2": {"v2": 1.0 - k1},
            "MT": {"tau": product(contacts.torsion_arm, arm)},
        }
        norms = [Norm({"V1": 1}, {"V2": 1}), Norm({"v1": k2}), Norm({"v2": k1}), Norm({"tau": 1})]
        return Unknowns(components, [Condition(norms, {"N": contacts.friction})])


class SignedTorsionShearBending(TorsionShearBending):
    """abs(MT - e1 V2 + e2 V1) <= c (mu N - abs(V)): static torsion about the pressure centre."""

    name = "torsion-shear-bending (signed)"
    implies = frozenset({"sliding"})

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        at = self.eccentricity
        torsion = {"MT": 1 / contacts.torsion_arm, "V2": -at.e1, "V1": at.e2}
        norms = [Norm({"V1": 1}, {"V2": 1}, weight=at.arm), Norm(torsion)]
        return [Condition(norms, {"N": product(contacts.friction, at.arm)}), _coulomb(contacts)]

    @classmethod
    def shares_of(cls, at: Eccentricity) -> dict[str, FloatArray]:
        """Returns the eccentricity as it is."""
        return {**vars(at)}

    def unknowns(self, contacts: Contacts) -> Unknowns:
        """Returns the unknown tau beside V1 and V2: MT = c_T (c tau + e1 V2 - e2 V1), so that the
        torsion about the pressure centre is c_T c tau."""
        each = {"tau": self.shares["arm"], "V2": self.shares["e1"], "V1": self.shares["e2"]}
        size, sign = contacts.torsion_arm, {"V1": -1.0}
        components = {
            "MT": {name: product(sign.get(name, 1.0) * size, k) for name, k in each.items()}
        }
        norms = [Norm({"V1": 1}, {"V2": 1}), Norm({"tau": 1})]
        return Unknowns(components, [Condition(norms, {"N": contacts.friction})])


class LimitedTorsionShearBending(SignedTorsionShearBending):
    """The same with Eq. 27 beside it: abs(MT) <= c mu N, torsion about the contact's own centre."""

    name = "torsion-shear-bending (with torsion-bending)"
    implies = frozenset({"sliding", "torsion"})

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        torsion = Norm({"MT": 1 / contacts.torsion_arm})
        most = {"N": product(contacts.friction, self.eccentricity.arm)}
        return [*super().conditions(contacts), Condition([torsion], most)]

    @classmethod
    def shares_of(cls, at: Eccentricity) -> dict[str, FloatArray]:
        """Returns c, k = e / (c + e), the direction (u1, u2) of the eccentricity e, and (r1, r2) =
        (1 - k) (u1, u2)."""
        size = np.hypot(at.e1, at.e2)
        k, unit = _share(size, at.arm), np.where(size > 0.0, size, 1.0)
        u1, u2 = np.where(size > 0.0, at.e1 / unit, 1.0), at.e2 / unit
        rest = 1.0 - k
        return {"arm": at.arm, "k": k, "u1": u1, "u2": u2, "r1": rest * u1, "r2": rest * u2}

    def unknowns(self, contacts: Contacts) -> Unknowns:
        """Returns unknowns for shear along the eccentricity and across it, and tau. The shear
        across is (1 - k) times its unknown, so that its torque over c is k times the unknown."""
        s = self.shares
        components = {
            "V1": {"along": s["u1"], "across": product(-1.0, s["r2"])},
            "V2": {"along": s["u2"], "across": s["r1"]},
            "MT": {"tau": product(contacts.torsion_arm, s["arm"])},
        }
        about = Norm({"tau": 1, "across": product(-1.0, s["k"])})
        most = {"N": contacts.friction}
        both = [
            Condition([Norm({"V1": 1}, {"V2": 1}), about], most),
            Condition([Norm({"tau": 1})], most),
        ]
        return Unknowns(components, both)


def _share(e: FloatArray, arm: FloatArray) -> FloatArray:
    """Returns e / (e + arm), and zero where both are zero."""
    total = e + arm
    return np.where(total > 0.0, e / np.where(total > 0.0, total, 1.0), 0.0)


def _coulomb(contacts: Contacts) -> Condition:
    """Returns abs(V) <= mu N."""
    return Condition([Norm({"V1": 1}, {"V2": 1})], {"N": contacts.friction})
