"""What contacts carry under a reading of Eq. 30: the sets that bounds are made of.

A reading (:mod:`cvxlimit.readings.moments`) says what the torque is; from that follow, in one
object per reading, support functions, disjuncts, where searches begin, and how branching cuts
ranges.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache
from typing import ClassVar

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
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
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.readings.moments import Moments


class States(ABC):
    """What contacts carry under a ``reading``; :func:`states_of` has those of a reading."""

    starts: tuple[str, ...]
    """Where searches for a lower bound begin unless they are told: relaxation, middle, boxes."""
    inscribed: Callable[[FloatArray], Rectangle]
    """A rectangle in a contact of another shape, of corners (k, 2), where Eq. 30 is as strict."""
    balance: ClassVar[float]
    """k^2 of the product bounds of safe steps, in units of (half side / friction)."""
    reach: ClassVar[float] = 0.0
    shrink: ClassVar[float] = 0.0
    """Safe steps are built ahead of the last forces by ``reach`` of the last move, while that
    gains, and nearer to the middle by ``shrink``: pressed in a corner or at full slip a contact's
    safe set has no interior, and solvers return inaccurate answers."""

    def __init__(self, reading: Moments) -> None:
        self.reading = reading

    @abstractmethod
    def support(self, asked: Asked) -> Support:
        """Largest power of true states on rectangles: see :mod:`~.states.support`."""

    @abstractmethod
    def cell_support(self, asked: Asked, cells: Cells) -> Support:
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
        is_tied = self.reading.slopes is not None
        free = free_sign(boxes[rows]) & contacts.is_rectangle[rows, None] & (not is_tied)
        about = self.reading.lever(centre) if is_tied else np.nan
        return spread_disjuncts(rows, centre, free, about, self.reading.is_limited, arm)

    @abstractmethod
    def safe_disjuncts(
        self, contacts: Contacts, centre: FloatArray, reach: float = 0.0
    ) -> Disjuncts:
        """One disjunct per contact whose states are all admissible, about ``centre`` (n, 2)."""

    def cells(self, contacts: Contacts, boxes: FloatArray) -> Cells:
        chosen = ~contacts.is_rectangle & ~self.has_corner_hull(contacts, boxes)
        return Cells.of(contacts, chosen, boxes, self.reading.largest_arm(contacts))

    def box_disjuncts(self, contacts: Contacts, boxes: FloatArray | None = None) -> Disjuncts:
        """The disjuncts every relaxation starts from, for boxes (n, 2, 2) of pressure centres."""
        boxes = whole_boxes(contacts) if boxes is None else boxes
        by_corners = self.has_corner_hull(contacts, boxes)
        others = np.flatnonzero(~contacts.is_rectangle & ~by_corners)
        rows, place = corners_in(contacts, others, boxes)
        found = corner_disjuncts(contacts, by_corners)
        found = found.joined(self.disjuncts_at(contacts, rows, place, boxes))
        # with independent signs one half of a range stands for both
        side = 0.0 if self.reading.slopes is not None else free_sign(boxes).astype(float)
        rows, place = corner_places(boxes, side)
        inside = (contacts.is_rectangle & ~by_corners)[rows]
        return found.joined(self.disjuncts_at(contacts, rows[inside], place[inside], boxes))

    def split(self, low: float, high: float, at: float, is_even: bool) -> list[Range]:
        """The ranges into which branching cuts [low, high] near ``at``: at zero first, unless that
        is far from it; ``is_even`` if the contact does the same on either side of the middle."""
        if low < 0.0 < high and abs(at) <= SUPPORT.narrowest * (high - low):
            return [(low, 0.0), (0.0, high)]
        reserve = SUPPORT.narrowest * (high - low)
        cut = float(np.clip(at, low + reserve, high - reserve))
        return [(low, cut), (cut, high)]

    def folded(self, box: FloatArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Ends (2, 2), and pressure centre (2,), of a box (2, 2) as branching sees them."""
        return box, centre


class IndependentStates(States):
    """Every sign on its own: disjuncts are spread over both signs where boxes allow both alike."""

    starts = ("relaxation", "middle", "boxes")
    inscribed = staticmethod(largest_centred)  # the torque depends on the contact's frame
    support = staticmethod(independent_support)
    cell_support = staticmethod(independent_cells)
    balance = 2.0
    reach = 1.0

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


class TiedStates(States):
    """Signs are tied: torsion about a lever."""

    balance = 1.0
    shrink = 0.005

    @property
    def starts(self) -> tuple[str, ...]:  # type: ignore[override]
        return ("relaxation",) if self.reading.is_about_centre else ("relaxation", "middle")

    @property
    def inscribed(self) -> Callable[[FloatArray], Rectangle]:  # type: ignore[override]
        """Anywhere where only the torque about the pressure centre counts, which has no frame."""
        is_free = self.reading.is_about_centre and not self.reading.is_limited
        return largest_anywhere if is_free else largest_centred

    def support(self, asked: Asked) -> Support:
        return levered_support(self.reading.lever, self.reading.is_limited, asked)

    def cell_support(self, asked: Asked, cells: Cells) -> Support:
        return levered_cells(self.reading.lever, self.reading.is_limited, asked, cells)

    def has_corner_hull(self, contacts: Contacts, boxes: FloatArray) -> BoolArray:
        """Whole contacts of any shape about the pressure centre, where it is the exact hull."""
        return is_whole(boxes) & (self.reading.is_about_centre and not self.reading.is_limited)

    def safe_disjuncts(
        self, contacts: Contacts, centre: FloatArray, reach: float = 0.0
    ) -> Disjuncts:
        """Up to ``reach`` from ``centre``, with the least arm there and with the torsion about any
        such point, abs(MT - d x V) + reach2 abs(V1) + reach1 abs(V2), bounded, since the lever
        moves no farther than the pressure centre; pressed exactly there on other polygons."""
        centre = np.clip(centre, -1.0, 1.0)
        around = np.minimum(reach, 0.5 * (1.0 - np.abs(centre))) * contacts.is_rectangle[:, None]
        every = np.arange(len(contacts))
        return disjuncts_at_places(
            every, centre, around, self.reading.lever(centre), self.reading.is_limited
        )


@cache
def states_of(reading: Moments) -> States:
    """The states of a reading."""
    return IndependentStates(reading) if reading.slopes is None else TiedStates(reading)
