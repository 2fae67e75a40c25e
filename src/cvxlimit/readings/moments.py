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

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.errors import ModelError
from cvxlimit.extensions.interaction.states.cells import (
    Cells,
    corners_in,
    independent_cells,
    levered_cells,
)
from cvxlimit.extensions.interaction.states.disjuncts import (
    Disjuncts,
    corner_disjuncts,
    corner_places,
    disjuncts_at_places,
    spread_disjuncts,
)
from cvxlimit.extensions.interaction.states.rectangles import (
    Rectangle,
    largest_anywhere,
    largest_centred,
)
from cvxlimit.extensions.interaction.states.settings import SUPPORT
from cvxlimit.extensions.interaction.states.support import (
    Asked,
    Range,
    Support,
    free_sign,
    independent_support,
    is_whole,
    levered_support,
    whole_boxes,
)
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
    starts: tuple[str, ...]
    """Where searches for a lower bound begin unless they are told: relaxation, middle, boxes."""
    is_limited: bool = False
    """True if Eq. 27 stands beside Eq. 30: abs(MT) <= c mu N."""
    has_eq_24: ClassVar[bool] = False
    """True if Eq. 24 follows: what falls without interaction falls under the reading, too."""
    slopes: FloatArray | None = None
    """d_i / e_i (2, 2) of the lever about which torsion is taken, for each axis at positive and
    negative e_i; None for independent signs."""
    frozen: Callable[[Eccentricity, Cone], TorsionShearBending]
    """Eq. 32: the convex surface with the eccentricities frozen, and its cone."""
    inscribed: Callable[[FloatArray], Rectangle]
    """A rectangle in a contact of another shape, of corners (k, 2), where Eq. 30 is as strict."""
    balance: ClassVar[float]
    """k^2 of the product bounds of safe steps, in units of (half side / friction)."""
    reach: ClassVar[float] = 0.0
    shrink: ClassVar[float] = 0.0
    """Safe steps are built ahead of the last forces by ``reach`` of the last move, while that
    gains, and nearer to the middle by ``shrink``: pressed in a corner or at full slip a contact's
    safe set has no interior, and solvers return inaccurate answers."""
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

    @abstractmethod
    def support(self, asked: Asked, halvings: int) -> Support:
        """Largest power of true states on rectangles: see :mod:`~.states.support`."""

    @abstractmethod
    def cell_support(self, asked: Asked, cells: Cells, halvings: int) -> Support:
        """The same on the triangles of polygons; contacts without any have none."""

    @abstractmethod
    def has_corner_hull(self, contacts: Contacts, boxes: FloatArray) -> BoolArray:
        """True (n,) for contacts whose states friction at the corners stands for."""

    def disjuncts_at(
        self,
        contacts: Contacts,
        rows: IntArray,
        centre: FloatArray,
        boxes: FloatArray,
        arm: FloatArray | float = np.nan,
    ) -> Disjuncts:
        """Disjuncts of contacts ``rows`` pressed at ``centre`` (k, 2), with their own arms or
        others (k,); with independent signs at both signs that a box allows alike."""
        is_tied = self.slopes is not None
        free = free_sign(boxes[rows]) & contacts.is_rectangle[rows, None] & (not is_tied)
        about = self.lever(centre) if is_tied else np.nan
        return spread_disjuncts(rows, centre, free, about, self.is_limited, arm)

    @abstractmethod
    def safe_disjuncts(
        self, contacts: Contacts, centre: FloatArray, reach: float = 0.0
    ) -> Disjuncts:
        """One disjunct per contact whose states are all admissible, about ``centre`` (n, 2)."""

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

    def cells(self, contacts: Contacts, boxes: FloatArray) -> Cells:
        chosen = ~contacts.is_rectangle & ~self.has_corner_hull(contacts, boxes)
        return Cells.of(contacts, chosen, boxes, self.largest_arm(contacts))

    def box_disjuncts(self, contacts: Contacts, boxes: FloatArray | None = None) -> Disjuncts:
        """The disjuncts every relaxation starts from, for boxes (n, 2, 2) of pressure centres."""
        boxes = whole_boxes(contacts) if boxes is None else boxes
        by_corners = self.has_corner_hull(contacts, boxes)
        others = np.flatnonzero(~contacts.is_rectangle & ~by_corners)
        rows, place = corners_in(contacts, others, boxes)
        found = corner_disjuncts(contacts, by_corners)
        found = found.joined(self.disjuncts_at(contacts, rows, place, boxes))
        # with independent signs one half of a range stands for both
        side = 0.0 if self.slopes is not None else free_sign(boxes).astype(float)
        rows, place = corner_places(boxes, side)
        inside = (contacts.is_rectangle & ~by_corners)[rows]
        return found.joined(self.disjuncts_at(contacts, rows[inside], place[inside], boxes))

    def split(self, low: float, high: float, at: float, is_even: bool) -> list[Range]:
        """The ranges into which branching cuts [low, high] near ``at``: at zero first, unless that
        is far from it; ``is_even`` if the contact does the same on either side of the middle."""
        if low < 0.0 < high and abs(at) <= SUPPORT.near_zero * (high - low):
            return [(low, 0.0), (0.0, high)]
        reserve = SUPPORT.narrowest * (high - low)
        cut = float(np.clip(at, low + reserve, high - reserve))
        return [(low, cut), (cut, high)]

    def folded(self, box: FloatArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Ends (2, 2), and pressure centre (2,), of a box (2, 2) as branching sees them."""
        return box, centre


class Independent(Moments):
    """abs(V1) eps2 + abs(V2) eps1 + abs(MT): every sign on its own, the safe reading of Eq. 30.

    Only magnitudes of eccentricities count: disjuncts are spread over both signs where boxes allow
    both alike. The arm is no larger than that of the whole contact (:func:`own_arm`), so that
    Eq. 24 follows.
    """

    name = "independent"
    starts = ("relaxation", "middle", "boxes")
    frozen = TorsionShearBending
    inscribed = staticmethod(largest_centred)  # the torque depends on the contact's frame
    has_eq_24 = True
    largest_arm = staticmethod(own_arm)
    support = staticmethod(independent_support)
    cell_support = staticmethod(independent_cells)
    balance = 2.0
    reach = 1.0

    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        v1, v2, mt = (forces[:, COLUMN[c]] for c in ("V1", "V2", "MT"))
        return np.abs(v1 * at.e2) + np.abs(v2 * at.e1) + np.abs(mt)

    def lever(self, e: FloatArray) -> FloatArray:
        return np.abs(e)

    def has_corner_hull(self, contacts: Contacts, boxes: FloatArray) -> BoolArray:
        """Polygons that press anywhere, where they are many: a hull that is larger than needed."""
        other = ~contacts.is_rectangle
        return other & is_whole(boxes) & (other.sum() > SUPPORT.most_whole)

    def safe_disjuncts(
        self, contacts: Contacts, centre: FloatArray, reach: float = 0.0
    ) -> Disjuncts:
        """Anywhere with abs(M2) <= eps1 N, abs(M1) <= eps2 N, where the true arm is no smaller and
        the true eccentricities no larger than the frozen ones; pressed exactly there on other
        polygons."""
        every, centre = np.arange(len(contacts)), np.clip(centre, -1.0, 1.0)
        return spread_disjuncts(every, centre, np.repeat(contacts.is_rectangle[:, None], 2, axis=1))

    def split(self, low: float, high: float, at: float, is_even: bool) -> list[Range]:
        """A range of both signs into its middle and what lies beyond, so that no other has both.
        On even contacts what lies beyond on either side stays one range: forces that press equally
        far out add up to one that presses nearer to the middle and satisfies Eq. 30 as they do. So
        signs need no branch of their own (docs/evidence/interaction-bounds.md)."""
        if low > high:
            return [(far, near) for near, far in super().split(high, low, at, is_even)]
        if not low < 0.0 < high:
            return super().split(low, high, at, is_even)
        reach, least = max(-low, high), SUPPORT.narrowest
        cut = float(np.clip(abs(at), least * reach, (1.0 - least) * reach))
        beyond = [ends for ends in ((low, -cut), (cut, high)) if ends[0] < ends[1]]
        if is_even and len(beyond) == 2:
            beyond = [(reach, cut)]
        return [(max(low, -cut), min(high, cut)), *beyond]

    def folded(self, box: FloatArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A range of both signs is one of magnitudes."""
        free = free_sign(box)[:, None]
        sizes = np.maximum(np.sort(box, axis=1), 0.0)
        return np.where(free, sizes, box), np.where(free[:, 0], np.abs(centre), centre)


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

    balance = 1.0
    shrink = 0.005

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
    def starts(self) -> tuple[str, ...]:  # type: ignore[override]
        return ("relaxation",) if self.is_about_centre else ("relaxation", "middle")

    @property
    def frozen(self) -> Callable[[Eccentricity, Cone], TorsionShearBending]:  # type: ignore[override]
        return LimitedTorsionShearBending if self.is_limited else SignedTorsionShearBending

    @property
    def inscribed(self) -> Callable[[FloatArray], Rectangle]:  # type: ignore[override]
        """Anywhere where only the torque about the pressure centre counts, which has no frame."""
        is_free = self.is_about_centre and not self.is_limited
        return largest_anywhere if is_free else largest_centred

    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        v1, v2, mt = (forces[:, COLUMN[c]] for c in ("V1", "V2", "MT"))
        d1, d2 = self.lever(at.centre).T
        return np.abs(mt - d1 * v2 + d2 * v1)

    def support(self, asked: Asked, halvings: int) -> Support:
        return levered_support(self.lever, self.is_limited, asked, halvings)

    def cell_support(self, asked: Asked, cells: Cells, halvings: int) -> Support:
        return levered_cells(self.lever, self.is_limited, asked, cells, halvings)

    def has_corner_hull(self, contacts: Contacts, boxes: FloatArray) -> BoolArray:
        """Whole contacts of any shape about the pressure centre, where it is the exact hull."""
        return is_whole(boxes) & (self.is_about_centre and not self.is_limited)

    def safe_disjuncts(
        self, contacts: Contacts, centre: FloatArray, reach: float = 0.0
    ) -> Disjuncts:
        """Up to ``reach`` from ``centre``, with the least arm there and with the torsion about any
        such point, abs(MT - d x V) + reach2 abs(V1) + reach1 abs(V2), bounded, since the lever
        moves no farther than the pressure centre; pressed exactly there on other polygons."""
        centre = np.clip(centre, -1.0, 1.0)
        around = np.minimum(reach, 0.5 * (1.0 - np.abs(centre))) * contacts.is_rectangle[:, None]
        every = np.arange(len(contacts))
        return disjuncts_at_places(every, centre, around, self.lever(centre), self.is_limited)


class Signed(TiedMoments):
    """abs(MT - e1 V2 + e2 V1): static torsion about the pressure centre."""

    name = "signed"

    def lever(self, e: FloatArray) -> FloatArray:
        return e


INDEPENDENT, SIGNED = Independent(), Signed()
