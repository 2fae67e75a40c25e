"""How Eq. 30 adds moments: one object per reading, which knows all that depends on it.

Everything else in this package takes such an object. A further reading is one more class; those
with Eq. 27 beside Eq. 30, the paper's own among them, and all names are in :mod:`named`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Protocol

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.interaction.states.copies import (
    Copies,
    cell_copies,
    corner_copies,
    level_places,
    pinned_copies,
    spread_copies,
)
from cvxlimit.methods.interaction.states.majorants import (
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
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.methods.interaction.states.rectangles import (
    Rectangle,
    largest_anywhere,
    largest_centred,
)
from cvxlimit.methods.interaction.states.support import (
    Support,
    corner_support,
    free_sign,
    independent_support,
    is_whole,
    mixed_sign,
    signed_support,
    whole_boxes,
)
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.frozen import (
    Eccentricity,
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
    """Ways to admissible forces: see
    :class:`~cvxlimit.methods.interaction.climb.inner.InnerMethod`."""

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
    starts : tuple of {"relaxation", "middle", "boxes"}
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
    splits_polygons : bool
        True if bounds are known for contacts of other shapes that press in a box (:mod:`cells`).
    is_about_centre : bool
        True if torsion is taken about the pressure centre there.
    balance : float
        k^2 of the product bounds of safe steps, in units of (half side / friction).
    reach : float
        Safe steps are built ahead of the last forces by this share of the last move, while that
        gains.
    shrink : float
        Safe steps are built this share nearer to the middle than the last forces.
    caution : str
        What every answer under this reading has to be read with; "" if nothing.
    """

    name: str
    starts: ClassVar[tuple[str, ...]]
    frozen: Callable[[Eccentricity, Cone], YieldSurface]
    fields: Callable[[Components, FloatArray], tuple[Forces, list[cp.Constraint]]]
    rows: Callable[[Forces, Point, Plane, FloatArray, FloatArray], list[Row]]
    inscribed: Callable[[FloatArray], Rectangle]
    support: Callable[[FloatArray, FloatArray, FloatArray, FloatArray, int], Support]
    is_limited: ClassVar[bool] = False
    splits_polygons: ClassVar[bool] = False
    is_about_centre: ClassVar[bool] = True
    balance: ClassVar[float]
    reach: ClassVar[float] = 0.0
    shrink: ClassVar[float] = 0.0
    caution: ClassVar[str] = ""

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

    def polygon_copies(self, contacts: Contacts, boxes: FloatArray) -> Copies:
        """Those of contacts that are not rectangles: friction at their corners, or, where a box
        holds less than all and this reading splits polygons, the corners of cells."""
        boxed = ~contacts.is_rectangle & ~is_whole(boxes) & self.splits_polygons
        inside = cell_copies(contacts, boxed, boxes, self.is_about_centre)
        return corner_copies(contacts, ~contacts.is_rectangle & ~boxed).joined(inside)

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
    splits_polygons = True
    is_about_centre = False
    starts = ("relaxation", "middle", "boxes")
    frozen = TorsionShearBending
    fields = staticmethod(forces_with_sizes)
    rows = staticmethod(independent_rows)
    inscribed = staticmethod(largest_centred)  # the torque depends on the contact's frame
    support = staticmethod(independent_support)
    balance = 2.0
    reach = 1.0

    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
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
        return self.polygon_copies(contacts, boxes).joined(*inside)

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
    splits_polygons = True
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
        whole = contacts.is_rectangle & is_whole(boxes)
        mixed = mixed_sign(boxes)
        levels = [
            (boxes[..., 1], np.ones_like(mixed)),
            (boxes[..., 0], boxes[..., 1] > boxes[..., 0]),
            (np.zeros(mixed.shape), mixed),
        ]
        rectangles = contacts.is_rectangle & ~whole
        places = level_places(rectangles, levels)
        inside = (self.copies_at(rows, centre, boxes) for rows, centre in places)
        return corner_copies(contacts, whole).joined(self.polygon_copies(contacts, boxes), *inside)

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


INDEPENDENT, SIGNED = Independent(), Signed()
