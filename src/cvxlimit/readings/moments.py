"""How Eq. 30 adds moments: one object per reading, which knows all that depends on it.

With tied signs that is a name and a lever (:class:`TiedMoments`), from which all else follows, so a
reading of one's own is as tight as those here. Further ones and all names are in :mod:`named`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import ClassVar

import numpy as np

from cvxlimit.base.arrays import ROUNDING, FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.readings.pressure import Pressure, own_arm
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.frozen import (
    Eccentricity,
    LimitedTorsionShearBending,
    SignedTorsionShearBending,
    TorsionShearBending,
)


class Moments(ABC):
    """A reading of Eq. 30: torque <= c (mu N - abs(V)) for the forces of a contact.

    Forces (n, 6) are V1, V2, N, M1, M2, MT, with N > 0 in compression; abs(V) = hypot(V1, V2), mu
    is ``contacts.friction`` and c the torsion arm ``Pressure.arm`` about the pressure centre
    (e1, e2) = (-M2, M1) / N; eps1 = abs(e1), eps2 = abs(e2). A reading says what the torque is.
    Derive a reading of one's own from :class:`TiedMoments`.
    """

    name: str
    """As in options and result files."""
    is_limited: bool = False
    """True if Eq. 27 stands beside Eq. 30: abs(MT) <= c mu N."""
    has_eq_24: ClassVar[bool] = False
    """True if Eq. 24 follows: what falls without interaction falls under the reading, too."""
    slopes: FloatArray | None = None
    """d_i / e_i (2, 2) of the lever about which torsion is taken, for each axis at positive and
    negative e_i; None for independent signs."""
    frozen: Callable[[Eccentricity, Cone], TorsionShearBending]
    """Eq. 32: the convex surface with the eccentricities frozen, and its cone."""
    caution: ClassVar[str] = ""
    """What every answer under this reading has to be read with; "" if nothing."""

    def __str__(self) -> str:
        return self.name

    @property
    def is_about_centre(self) -> bool:
        """True if torsion is taken about the pressure centre itself. Searches for a lower bound
        then go on by boxes of centres, which were better on all built-in panels, else by steps."""
        return self.slopes is not None and bool((self.slopes == 1.0).all())

    @property
    def stricter(self) -> tuple[Moments, ...]:
        """Readings whose admissible forces are all admissible here too: every sign on its own
        bounds any other choice of signs."""
        return () if self is INDEPENDENT else (INDEPENDENT,)

    @abstractmethod
    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        """Left side of Eq. 30 (n,), for forces (n, 6) that press ``at`` some centre."""

    @abstractmethod
    def lever(self, e: FloatArray) -> FloatArray:
        """Arms (..., 2) of V2 and V1 for pressure centres (..., 2)."""

    def largest_arm(self, contacts: Contacts) -> FloatArray:
        """The largest arm c (n,) there may be; infinite as a rule."""
        return np.full(len(contacts), np.inf)

    def excess(self, forces: FloatArray, contacts: Contacts) -> FloatArray:
        """Eq. 30 with its own eccentricities, not linearised: excess (n,) in force units.

        (torque - c (mu N - abs(V))) / c_T, with c_T of the whole contact; (abs(MT) - c mu N) / c_T
        where Eq. 27 stands beside it and is exceeded by more. Zero or less is admissible. Sliding
        is part of it; tension and rocking are checked elsewhere.
        """
        at = Pressure.of(forces, contacts)
        arm = np.minimum(at.arm, self.largest_arm(contacts))
        v1, v2, normal, mt = (forces[:, COLUMN[c]] for c in ("V1", "V2", "N", "MT"))
        spare = contacts.friction * normal - np.hypot(v1, v2)
        eq_30 = (self.torque(forces, at) - arm * spare) / contacts.torsion_arm
        if self.is_limited:
            eq_27 = (np.abs(mt) - arm * contacts.friction * normal) / contacts.torsion_arm
            eq_30 = np.maximum(eq_30, eq_27)
        return np.maximum(eq_30, -spare)

    def eccentricity(self, at: Pressure, contacts: Contacts) -> Eccentricity:
        """What :attr:`frozen` takes, over c_T; an effective area without extent counts as a little,
        so that the surface keeps an interior."""
        arm = np.minimum(at.arm, self.largest_arm(contacts)) / contacts.torsion_arm
        shears = self.lever(at.centre).T / contacts.torsion_arm
        return Eccentricity(np.maximum(arm, ROUNDING), *shears)


class Independent(Moments):
    """abs(V1) eps2 + abs(V2) eps1 + abs(MT): every sign on its own, the safe reading of Eq. 30.

    Only magnitudes of eccentricities count: disjuncts are spread over both signs where boxes allow
    both alike. The arm is no larger than that of the whole contact (:func:`own_arm`), so that
    Eq. 24 follows.
    """

    name = "independent"
    frozen = TorsionShearBending
    has_eq_24 = True
    largest_arm = staticmethod(own_arm)

    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        v1, v2, mt = (forces[:, COLUMN[c]] for c in ("V1", "V2", "MT"))
        return np.abs(v1 * at.e2) + np.abs(v2 * at.e1) + np.abs(mt)

    def lever(self, e: FloatArray) -> FloatArray:
        return np.abs(e)


class TiedMoments(Moments):
    """abs(MT - d1 V2 + d2 V1) for a lever d(e): a reading whose signs are tied.

    A reading of one's own is a ``name`` and a :meth:`lever`, and ``is_limited`` if Eq. 27 stands
    beside Eq. 30; all else follows from these. Give an instance as ``moments``.

    Example
    -------
    >>> class Halfway(TiedMoments):
    ...     name = "halfway"
    ...
    ...     def lever(self, e):
    ...         return 0.5 * e
    >>> from cvxlimit import builtin_scene, solve
    >>> found = solve(builtin_scene("single-block"), method="certified", moments=Halfway())
    >>> round(found.lower, 4), round(found.upper, 4)
    (0.4, 0.4)
    """

    @abstractmethod
    def lever(self, e: FloatArray) -> FloatArray:
        """The point (..., 2) about which Eq. 30 takes torsion, for pressure centres (..., 2).

        Linear in each quadrant; each component depends on its own eccentricity alone, and is no
        larger than that.
        """

    @cached_property
    def slopes(self) -> FloatArray:  # type: ignore[override]  # computed here, given elsewhere
        unit = self.lever(np.array([[1.0, 1.0], [-1.0, -1.0]])) * [[1.0, 1.0], [-1.0, -1.0]]
        tried = np.array([[0.5, -1.0], [-0.25, 0.5], [1.0, -0.125], [0.0, 1.0], [-1.0, 0.0]])
        expected = tried * np.where(tried > 0.0, unit[0], unit[1])
        found = np.asarray(self.lever(tried), dtype=float)
        is_other = np.abs(found - expected).max(axis=1) > 1e-12
        if is_other.any() or np.abs(unit).max() > 1.0:
            e, d = tried[is_other.argmax()], found[is_other.argmax()]
            raise ModelError(
                f"the lever of moments {self.name!r} must be linear in each quadrant of the "
                "pressure centre, each component in its own eccentricity alone and no larger than "
                f"that; got {d.tolist()} at {e.tolist()}"
            )
        return np.asarray(unit.T)

    @property
    def frozen(self) -> Callable[[Eccentricity, Cone], TorsionShearBending]:  # type: ignore[override]
        return LimitedTorsionShearBending if self.is_limited else SignedTorsionShearBending

    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        v1, v2, mt = (forces[:, COLUMN[c]] for c in ("V1", "V2", "MT"))
        d1, d2 = self.lever(at.centre).T
        return np.abs(mt - d1 * v2 + d2 * v1)


class Signed(TiedMoments):
    """abs(MT - e1 V2 + e2 V1): static torsion about the pressure centre."""

    name = "signed"

    def lever(self, e: FloatArray) -> FloatArray:
        return e


INDEPENDENT, SIGNED = Independent(), Signed()
