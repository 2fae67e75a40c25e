"""How Eq. 30 adds moments: one object per reading, which knows all that depends on it.

Everything else in this package takes such an object. A further reading is one more class.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, ClassVar, Protocol

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.interaction.copies import (
    Copies,
    corner_copies,
    level_places,
    pinned_copies,
    spread_copies,
)
from cvxlimit.methods.interaction.majorants import (
    Components,
    Forces,
    Plane,
    Point,
    Row,
    forces_with_sizes,
    independent_rows,
    plain_forces,
    signed_rows,
)
from cvxlimit.methods.interaction.pressure import Pressure
from cvxlimit.methods.interaction.rectangles import Rectangle, largest_anywhere, largest_centred
from cvxlimit.methods.interaction.support import (
    Support,
    corner_support,
    free_sign,
    independent_support,
    mixed_sign,
    signed_support,
    whole_boxes,
)
from cvxlimit.methods.interaction.tied import (
    TiedRows,
    limited_signed_rows,
    limited_support,
    polygon_support,
)
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.frozen import (
    Eccentricity,
    LimitedTorsionShearBending,
    SignedTorsionShearBending,
    TorsionShearBending,
)

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_SMALLEST_ARM = 1e-9
"""An effective area without extent counts as this fraction of c_T: the frozen surface keeps an
interior, and nothing is allowed there that a solver could tell from nothing."""

_NARROWEST_CHILD = 0.2
"""Least share of a range that a child gets, so that ranges shrink whatever the forces say."""


class Ways(Protocol):
    """Ways to admissible forces: see :class:`cvxlimit.methods.interaction.inner.InnerMethod`."""

    def stepped(self, start: FloatArray | None) -> Iterator[Any]:
        """Steps inside Eq. 30, from given forces (n, 6) or from the middle."""

    def boxed(self, start: FloatArray | None) -> Iterator[Any]:
        """Hulls over shrinking boxes of pressure centres, and frozen problems at their ends."""


class Moments(ABC):
    """A reading of Eq. 30: torque of a contact's forces <= c (mu N - abs(V)).

    Attributes
    ----------
    name : str
        As in options and result files.
    starts : tuple of {"relaxation", "middle"}
        Where climbs to a lower bound begin unless they are told.
    frozen : callable
        Eq. 32: the convex surface with the eccentricities frozen, and its cone.
    fields, rows : callable
        What safe steps are written in (:mod:`majorants`), and their rows, convex and inside Eq. 30.
    inscribed : callable
        A rectangle in a contact of another shape (corners (k, 2)) on which Eq. 30 is as strict or
        stricter.
    support : callable
        Largest power of true states on rectangles (:mod:`support`).
    is_limited : bool
        True if Eq. 27 stands beside Eq. 30: abs(MT) <= c mu N.
    balance : float
        k^2 of the product bounds of safe steps, in units of (half side / friction).
    reach : float
        Safe steps are built ahead of the last forces by this share of the last move, while that
        gains.
    shrink : float
        Safe steps are built this share nearer to the middle than the last forces.
    """

    name: str
    starts: ClassVar[tuple[str, ...]]
    frozen: Callable[[Eccentricity, Cone], YieldSurface]
    fields: Callable[[Components, FloatArray], tuple[Forces, list[cp.Constraint]]]
    rows: Callable[[Forces, Point, Plane, FloatArray, FloatArray], list[Row]]
    inscribed: Callable[[FloatArray], Rectangle]
    support: Callable[[FloatArray, FloatArray, FloatArray, FloatArray, int], Support]
    is_limited: ClassVar[bool] = False
    balance: ClassVar[float]
    reach: ClassVar[float] = 0.0
    shrink: ClassVar[float] = 0.0

    def __str__(self) -> str:
        return self.name

    @property
    def stricter(self) -> tuple[Moments, ...]:
        """Readings whose admissible forces are all admissible here too: every sign on its own
        bounds any other choice of signs."""
        return () if self is INDEPENDENT else (INDEPENDENT,)

    @abstractmethod
    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        """Left side of Eq. 30 (n,), for forces (n, 6) that press ``at`` some centre."""

    def excess(self, forces: FloatArray, contacts: Contacts) -> FloatArray:
        """Eq. 30 with its own eccentricities, not linearised: excess (n,) in force units.

        (torque - c (mu N - abs(V))) / c_T, with c_T of the whole contact; (abs(MT) - c mu N) / c_T
        where Eq. 27 stands beside it and is exceeded by more. Zero or less is admissible. Sliding
        is part of it; tension and rocking are checked elsewhere.
        """
        at = Pressure.of(forces, contacts)
        v1, v2, normal, mt = (forces[:, COLUMN[c]] for c in ("V1", "V2", "N", "MT"))
        spare = contacts.friction * normal - np.hypot(v1, v2)
        eq_30 = (self.torque(forces, at) - at.arm * spare) / contacts.torsion_arm
        if self.is_limited:
            eq_27 = (np.abs(mt) - at.arm * contacts.friction * normal) / contacts.torsion_arm
            eq_30 = np.maximum(eq_30, eq_27)
        return np.maximum(eq_30, -spare)

    def parameters(self, contacts: int) -> Eccentricity:
        """What :meth:`frozen` takes, as Parameters of so many contacts."""
        return Eccentricity(
            cp.Parameter(contacts, nonneg=True), cp.Parameter(contacts), cp.Parameter(contacts)
        )

    def eccentricity(self, at: Pressure, contacts: Contacts) -> Eccentricity:
        """What :meth:`frozen` takes, over c_T."""
        arm = np.maximum(at.arm / contacts.torsion_arm, _SMALLEST_ARM)
        return Eccentricity(arm, at.e1 / contacts.torsion_arm, at.e2 / contacts.torsion_arm)

    def polygon_power(self, w: FloatArray, contacts: Contacts, rows: IntArray) -> FloatArray:
        """An upper bound (k,) on the power of true states with N = 1, but for w_N, for rates w
        (k, 6) of contacts ``rows`` that are not rectangles: friction at their corners."""
        return corner_support(w, contacts, rows)

    @abstractmethod
    def ways(self, to: Ways, start: FloatArray | None) -> Iterator[Any]:
        """The way to admissible forces from a relaxation's forces (n, 6), or from the middle."""

    @abstractmethod
    def copies_at(self, rows: IntArray, centre: FloatArray, boxes: FloatArray) -> Copies:
        """Copies of contacts ``rows`` pressed at ``centre`` (k, 2)."""

    @abstractmethod
    def box_copies(self, contacts: Contacts, boxes: FloatArray | None = None) -> Copies:
        """The copies every relaxation starts from, for boxes (n, 2, 2) of pressure centres."""

    @abstractmethod
    def safe_copies(self, contacts: Contacts, centre: FloatArray, reach: float = 0.0) -> Copies:
        """One copy per contact whose states are all admissible, about ``centre`` (n, 2)."""

    @abstractmethod
    def split(self, low: float, high: float, at: float) -> list[float]:
        """Ends of the ranges into which branching cuts [low, high] near ``at``."""

    def folded(self, box: FloatArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Low ends and pressure centre (2,) as branching sees them in a box (2, 2)."""
        return box[:, 0], centre


class Independent(Moments):
    """abs(V1) eps2 + abs(V2) eps1 + abs(MT): every sign on its own, the safe reading of Eq. 30.

    Only magnitudes of eccentricities count.
    """

    name = "independent"
    starts = ("relaxation", "middle")
    frozen = TorsionShearBending
    fields = staticmethod(forces_with_sizes)
    rows = staticmethod(independent_rows)
    inscribed = staticmethod(largest_centred)  # the torque depends on the contact's frame
    support = staticmethod(independent_support)
    balance = 2.0
    reach = 1.0

    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        """See the class."""
        v1, v2, mt = (forces[:, COLUMN[c]] for c in ("V1", "V2", "MT"))
        return np.abs(v1 * at.e2) + np.abs(v2 * at.e1) + np.abs(mt)

    def parameters(self, contacts: int) -> Eccentricity:
        """Magnitudes."""
        return Eccentricity(*(cp.Parameter(contacts, nonneg=True) for _ in range(3)))

    def eccentricity(self, at: Pressure, contacts: Contacts) -> Eccentricity:
        """Magnitudes."""
        return super().eccentricity(Pressure(np.abs(at.e1), np.abs(at.e2), at.arm), contacts)

    def ways(self, to: Ways, start: FloatArray | None) -> Iterator[Any]:
        """Steps."""
        return to.stepped(start)

    def copies_at(self, rows: IntArray, centre: FloatArray, boxes: FloatArray) -> Copies:
        """Spread over both signs where boxes allow both alike."""
        return spread_copies(rows, centre, free_sign(boxes[rows]))

    def box_copies(self, contacts: Contacts, boxes: FloatArray | None = None) -> Copies:
        """Ends of boxes, and zero where it lies between them; even ranges have one end."""
        boxes = whole_boxes(contacts) if boxes is None else boxes
        free = free_sign(boxes)
        top = np.abs(boxes).max(axis=2)
        levels = [
            (np.where(free, top, boxes[..., 1]), np.ones_like(free)),
            (boxes[..., 0], ~free & (boxes[..., 1] > boxes[..., 0])),
            (np.zeros_like(top), mixed_sign(boxes)),
        ]
        places = level_places(contacts.is_rectangle, levels)
        inside = (self.copies_at(rows, centre, boxes) for rows, centre in places)
        return corner_copies(contacts, ~contacts.is_rectangle).joined(*inside)

    def safe_copies(self, contacts: Contacts, centre: FloatArray, reach: float = 0.0) -> Copies:
        """Anywhere with abs(M2) <= eps1 N, abs(M1) <= eps2 N, where the true arm is no smaller and
        the true eccentricities no larger than the frozen ones; pressed exactly there on other
        polygons."""
        every, centre = np.arange(len(contacts)), np.clip(centre, -1.0, 1.0)
        return spread_copies(every, centre, np.repeat(contacts.is_rectangle[:, None], 2, axis=1))

    def split(self, low: float, high: float, at: float) -> list[float]:
        """A range of both signs into its middle and what lies beyond, so that no other has both."""
        if not low < 0.0 < high:
            return _halved(low, high, at)
        reach = max(-low, high)
        cut = float(np.clip(abs(at), _NARROWEST_CHILD * reach, (1.0 - _NARROWEST_CHILD) * reach))
        return [low, *([-cut] if -cut > low else []), *([cut] if cut < high else []), high]

    def folded(self, box: FloatArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A range of both signs is one of magnitudes."""
        free = free_sign(box)
        return np.where(free, 0.0, box[:, 0]), np.where(free, np.abs(centre), centre)


class Signed(Moments):
    """abs(MT - e1 V2 + e2 V1): static torsion about the pressure centre."""

    name = "signed"
    starts: ClassVar[tuple[str, ...]] = ("relaxation",)
    frozen = SignedTorsionShearBending
    fields = staticmethod(plain_forces)
    rows = staticmethod(signed_rows)
    inscribed = staticmethod(largest_anywhere)  # torque about the pressure centre has no frame
    support = staticmethod(signed_support)
    balance = 1.0
    shrink = 0.005
    """Pressed in a corner or at full slip a contact's safe set has no interior, and solvers return
    inaccurate answers."""

    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        """See the class."""
        v1, v2, mt = (forces[:, COLUMN[c]] for c in ("V1", "V2", "MT"))
        return np.abs(mt - at.e1 * v2 + at.e2 * v1)

    def ways(self, to: Ways, start: FloatArray | None) -> Iterator[Any]:
        """Boxes: better than safe steps on all built-in panels."""
        return to.boxed(start)

    def copies_at(self, rows: IntArray, centre: FloatArray, boxes: FloatArray) -> Copies:
        """Torsion about the centre itself."""
        return pinned_copies(rows, centre)

    def box_copies(self, contacts: Contacts, boxes: FloatArray | None = None) -> Copies:
        """Corners of boxes, and their corners at zero; friction at the corners of whole contacts,
        whatever their shape."""
        boxes = whole_boxes(contacts) if boxes is None else boxes
        whole = ~contacts.is_rectangle | (np.abs(boxes) >= 1.0).all(axis=(1, 2))
        mixed = mixed_sign(boxes)
        levels = [
            (boxes[..., 1], np.ones_like(mixed)),
            (boxes[..., 0], boxes[..., 1] > boxes[..., 0]),
            (np.zeros(mixed.shape), mixed),
        ]
        places = level_places(~whole, levels)
        inside = (self.copies_at(rows, centre, boxes) for rows, centre in places)
        return corner_copies(contacts, whole).joined(*inside)

    def safe_copies(self, contacts: Contacts, centre: FloatArray, reach: float = 0.0) -> Copies:
        """Up to ``reach`` from ``centre``, with the least arm there and with the torsion about any
        such point, abs(MT - centre x V) + reach2 abs(V1) + reach1 abs(V2), bounded; pressed
        exactly there on other polygons."""
        centre = np.clip(centre, -1.0, 1.0)
        around = np.minimum(reach, 0.5 * (1.0 - np.abs(centre))) * contacts.is_rectangle[:, None]
        return pinned_copies(np.arange(len(contacts)), centre, around)

    def split(self, low: float, high: float, at: float) -> list[float]:
        """At zero first, where the range has both signs."""
        return [low, 0.0, high] if low < 0.0 < high else _halved(low, high, at)


def _halved(low: float, high: float, at: float) -> list[float]:
    reserve = _NARROWEST_CHILD * (high - low)
    return [low, float(np.clip(at, low + reserve, high - reserve)), high]


class SignedTorsionBending(Signed):
    """Signed moments with Eq. 27 beside Eq. 30: abs(MT) <= c mu N, about the contact's own centre.

    The paper updates both in every iteration (its section 4). Statics does not ask for the second:
    torsion about the pressure centre is what friction resists. It is here because the iteration
    then no longer jumps above its first factor.
    """

    name = "signed-torsion-bending"
    is_limited = True
    frozen = LimitedTorsionShearBending
    fields = staticmethod(plain_forces)
    rows = staticmethod(limited_signed_rows)

    def support(
        self,
        w: FloatArray,
        half: FloatArray,
        friction: FloatArray,
        boxes: FloatArray,
        halvings: int,
    ) -> Support:
        """With Eq. 27, for the reading's lever."""
        return limited_support(self.lever, w, half, friction, boxes, halvings)

    def lever(self, e: FloatArray) -> FloatArray:
        """The point (..., 2) about which Eq. 30 takes torsion, for pressure centres (..., 2)."""
        return e

    def copies_at(self, rows: IntArray, centre: FloatArray, boxes: FloatArray) -> Copies:
        """Torsion about the lever, and Eq. 27."""
        return pinned_copies(rows, centre, lever=self.lever(centre), is_limited=True)

    def safe_copies(self, contacts: Contacts, centre: FloatArray, reach: float = 0.0) -> Copies:
        """As with signed moments: the lever moves no farther than the pressure centre."""
        pinned = super().safe_copies(contacts, centre, reach)
        limited = np.ones(len(pinned), dtype=bool)
        return replace(pinned, lever=self.lever(pinned.centre), limited=limited)

    def box_copies(self, contacts: Contacts, boxes: FloatArray | None = None) -> Copies:
        """Corners of boxes, and their corners at zero, also for whole contacts: what friction in
        their corners does is limited by Eq. 27. Corners of polygons as with signed moments."""
        boxes = whole_boxes(contacts) if boxes is None else boxes
        has_zero = (boxes[..., 0] < 0.0) & (boxes[..., 1] > 0.0)
        levels = [
            (boxes[..., 1], np.ones_like(has_zero)),
            (boxes[..., 0], boxes[..., 1] > boxes[..., 0]),
            (np.zeros(has_zero.shape), has_zero),
        ]
        places = level_places(contacts.is_rectangle, levels)
        inside = (self.copies_at(rows, centre, boxes) for rows, centre in places)
        return corner_copies(contacts, ~contacts.is_rectangle).joined(*inside)


class Paper(SignedTorsionBending):
    """abs(MT + s1 abs(e2) V1 + s2 abs(e1) V2) with tied signs, and Eq. 27 beside it.

    Eq. 30 as the paper prints it carries the superscript "tsb,1,2": two functions, like Eq. 24 and
    27, so that its signs change together, with absolute eccentricities. Its iteration then meets
    the paper's last column. It is not indifferent to the frame: a contact's axes turned by 180
    degrees about its normal change the signs of V1 and V2 but not of MT. ``signs`` = (s1, s2) says
    which of the four choices is meant, for all contacts alike; which one the paper's authors made
    is not known, and none is right. Independent signs contain all of them and are the safe reading;
    signed moments are statics.

    Every state that is admissible with independent signs is so here, for any signs:
    abs(MT) + abs(e2 V1) + abs(e1 V2) <= c (mu N - abs(V)) implies both conditions.

    Example
    -------
    >>> Paper().name, Paper((1, -1)).name
    ('paper', 'paper (+V1 -V2)')
    """

    name = "paper"
    starts = ("relaxation", "middle")
    fields = staticmethod(forces_with_sizes)
    inscribed = staticmethod(largest_centred)  # the torque depends on the contact's frame

    def __init__(self, signs: tuple[int, int] = (1, 1)) -> None:
        if tuple(signs) not in _AXES:
            raise ModelError(f"signs must be two of 1 and -1, got {signs!r}")
        self.signs = signs
        self.rows = TiedRows(signs)
        if signs != (1, 1):
            self.name = "paper ({}V1 {}V2)".format(*("+" if s > 0 else "-" for s in signs))

    def lever(self, e: FloatArray) -> FloatArray:
        """(-s2 abs(e1), s1 abs(e2)): MT - d1 V2 + d2 V1 is then the torque."""
        return np.abs(e) * np.array([-self.signs[1], self.signs[0]])

    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        """See the class."""
        v1, v2, mt = (forces[:, COLUMN[c]] for c in ("V1", "V2", "MT"))
        one, two = self.signs
        return np.abs(mt + one * np.abs(at.e2) * v1 + two * np.abs(at.e1) * v2)

    def eccentricity(self, at: Pressure, contacts: Contacts) -> Eccentricity:
        """The lever."""
        d1, d2 = self.lever(np.stack([at.e1, at.e2], axis=1)).T
        return super().eccentricity(Pressure(d1, d2, at.arm), contacts)

    def polygon_power(self, w: FloatArray, contacts: Contacts, rows: IntArray) -> FloatArray:
        """With the largest arm a contact of that size may have: friction at the corners bounds
        torsion about the pressure centre, not about another point."""
        return polygon_support(self.lever, w, contacts, rows)

    def ways(self, to: Ways, start: FloatArray | None) -> Iterator[Any]:
        """Steps."""
        return to.stepped(start)


_AXES = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Choices of signs: turning a contact's axes by 180 degrees, or mirroring one of them."""

INDEPENDENT, SIGNED = Independent(), Signed()

MOMENTS = {m.name: m for m in (INDEPENDENT, SIGNED, SignedTorsionBending(), Paper())}
"""By name, as options and files have them."""


def parse_moments(moments: str | Moments) -> Moments:
    """The reading of this name; one of your own is returned as it is.

    Raises
    ------
    ModelError
        If there is none of this name.

    Example
    -------
    >>> str(parse_moments("signed"))
    'signed'
    """
    if isinstance(moments, Moments):
        return moments
    if moments not in MOMENTS:
        raise ModelError(f"moments must be one of {', '.join(MOMENTS)}, got {moments!r}")
    return MOMENTS[moments]
