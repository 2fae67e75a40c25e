"""Readings of Eq. 30 with Eq. 27 beside it, the paper's own among them; all readings by name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.interaction.readings.moments import INDEPENDENT, SIGNED, Moments, Signed, Ways
from cvxlimit.methods.interaction.readings.tied import (
    TiedRows,
    limited_signed_rows,
    limited_support,
    polygon_support,
)
from cvxlimit.methods.interaction.states.copies import (
    Copies,
    corner_copies,
    level_places,
    pinned_copies,
)
from cvxlimit.methods.interaction.states.majorants import forces_with_sizes, plain_forces
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.methods.interaction.states.rectangles import largest_centred
from cvxlimit.methods.interaction.states.support import Support, whole_boxes
from cvxlimit.surfaces.frozen import Eccentricity, LimitedTorsionShearBending

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class SignedTorsionBending(Signed):
    """Signed moments with Eq. 27 beside Eq. 30: abs(MT) <= c mu N, about the contact's own centre.

    The paper updates both in every iteration (its section 4). Statics does not ask for the second:
    torsion about the pressure centre is what friction resists.
    """

    name = "signed-torsion-bending"
    splits_polygons = False
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
    caution = (
        "the paper's reading depends on the contacts' axes, which the paper does not state: others "
        "give other factors; moments 'independent' and 'signed' do not depend on them"
    )

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

MOMENTS = {m.name: m for m in (INDEPENDENT, SIGNED, SignedTorsionBending(), Paper())}
"""By name, as options and files have them."""


def reading_of(name: str) -> Moments | None:
    """The reading that a solution or a result file names, None for one that is not known here.

    Example
    -------
    >>> str(reading_of(Paper((1, -1)).name))
    'paper (+V1 -V2)'
    """
    every = [*MOMENTS.values(), *map(Paper, _AXES)]
    return next((reading for reading in every if reading.name == name), None)


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
