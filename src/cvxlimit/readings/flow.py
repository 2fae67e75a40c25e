"""The flow rule of torsion-shear-bending interaction, for certificates of upper bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.model.flow import Shortfall
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.settings import SUPPORT
from cvxlimit.readings.states.support import (
    Asked,
    box_keys,
    corner_support,
    half_extent,
    whole_boxes,
)


@dataclass
class _Opened:
    """What a field (n, 6) misses of opening contacts, by their number and their box."""

    rates: FloatArray = field(default_factory=lambda: np.zeros(0))
    missing: dict[tuple[int, bytes], float] = field(default_factory=dict)


class InteractionFlow:
    """Stands for :class:`cvxlimit.model.flow.FlowRule` in certificates of upper bounds.

    The shortfall s(q) = max of -X . q over true states X with N = 1 is sublinear, and forces do at
    least -s N of work on rates q. ``boxes`` (n, 2, 2) are the pressure centres considered: lowest
    and highest e1 and e2 as fractions of :func:`half_extent`, None is all. Where it ``is_coarse``
    shortfalls are enclosed closely only if something is missing, and then to ``precision`` of the
    largest power in play, if that is coarser. ``number`` (n,) is whose disjuncts contacts are where
    all of a scene come several times, one after another.
    """

    def __init__(
        self,
        contacts: Contacts,
        moments: Moments,
        boxes: FloatArray | None = None,
        is_coarse: bool = False,
        precision: float = 0.0,
        number: IntArray | None = None,
    ) -> None:
        self.contacts, self.moments, self.is_coarse = contacts, moments, is_coarse
        self.precision = precision
        self.number = np.arange(len(contacts)) if number is None else number
        self._asked, self._worst = np.zeros(0), (np.zeros(0),) * 3
        self._opened = _Opened()
        self._repeated: dict[int, tuple[IntArray, Contacts]] = {}
        self.half = half_extent(contacts)
        self.boxes = whole_boxes(contacts) if boxes is None else boxes
        has_corners = moments.has_corner_hull(contacts, self.boxes)
        self._corners = np.flatnonzero(~contacts.is_rectangle & has_corners)
        self._rectangles = np.flatnonzero(contacts.is_rectangle)
        self._cells = moments.cells(contacts, self.boxes)

    def shortfall(self, rates: FloatArray) -> Shortfall:
        """Above the exact one by 1e-10 of the largest power at most; with independent signs on
        very many polygons by what friction at the corners allows more."""
        return Shortfall(self.worst(rates)[0], np.zeros(0))

    def opened(self, rates: FloatArray) -> Shortfall:
        """The same, exact everywhere; kept, for one field opens every mechanism. In boxes it opens
        much more than of the whole, which decides how good bounds are."""
        known, once = self._opened, rates[: int(self.number.max(initial=-1)) + 1]
        if not np.array_equal(once, known.rates):
            known.rates, known.missing = once.copy(), {}
        keys = box_keys(self.boxes, self.number)
        if new := [k for k, key in enumerate(keys) if key not in known.missing]:
            rows = np.array(new)
            found = self.of(rows)._support(-rates[rows], SUPPORT.halvings)[0].tolist()
            known.missing |= zip((keys[k] for k in new), found, strict=True)
        return Shortfall(np.array([known.missing[key] for key in keys]), np.zeros(0))

    def shortfall_bound(self, rates: FloatArray) -> FloatArray:
        return self._support(-rates, 0)[0]

    def worst(self, rates: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Shortfall (n,), the pressure centres (n, 2) that have it, and their arms (n,) over c_T;
        NaN where not known, or the centre's own. Kept, for what is missed is asked for after the
        bound."""
        if not np.array_equal(rates, self._asked):
            floor = rates[:, COLUMN["N"]] if self.is_coarse else None
            self._worst = self._support(-rates, SUPPORT.halvings, floor)
            self._asked = rates.copy()
        return self._worst

    def within(self, boxes: FloatArray, precision: float = 0.0) -> InteractionFlow:
        """The rule in boxes, for one of many mechanisms: coarse. Of a field that was opened in
        other boxes only what has changed is computed."""
        result = InteractionFlow(self.contacts, self.moments, boxes, True, precision)
        result._opened = self._opened
        return result

    def together(
        self,
        flows: Sequence[InteractionFlow],
        every: Sequence[FloatArray],
        opening: FloatArray | None,
    ) -> None:
        """Ask several flows of these contacts for what they will be asked for: shortfalls of
        ``every`` one's rates (n, 6), and what all make of an ``opening`` field's; a call takes
        hardly longer for all than for one."""
        if len(flows) not in self._repeated:
            number = np.tile(self.number, len(flows))
            self._repeated[len(flows)] = number, self.contacts.take(number)
        number, contacts = self._repeated[len(flows)]
        boxes, precision = np.concatenate([flow.boxes for flow in flows]), flows[0].precision
        whole = InteractionFlow(contacts, self.moments, boxes, True, precision, number)
        whole._opened = self._opened
        if opening is not None:
            whole.opened(np.tile(opening, (len(flows), 1)))
        found = (np.split(x, len(flows)) for x in whole.worst(np.concatenate(every)))
        for flow, rates, *worst in zip(flows, every, *found, strict=True):
            flow._asked, flow._worst = rates, (worst[0], worst[1], worst[2])

    def of(self, rows: IntArray) -> InteractionFlow:
        """The rule of some contacts (k,)."""
        given = self.contacts.take(rows), self.moments, self.boxes[rows]
        return InteractionFlow(*given, self.is_coarse, self.precision)

    def _support(
        self, w: FloatArray, halvings: int, floor: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        power, centre = np.full(len(w), -np.inf), np.full((len(w), 2), np.nan)
        arm, friction = np.full(len(w), np.nan), self.contacts.friction
        least = np.full(len(w), -np.inf) if floor is None else floor
        precision = 0.0 if floor is None else self.precision
        asked = Asked(w, self.half, friction, self.boxes, least, precision)
        if len(rows := self._corners):
            power[rows] = corner_support(w, self.contacts)[rows]
        if len(rows := self._rectangles):
            power[rows], centre[rows] = self.moments.support(asked.take(rows), halvings)
        if len(self._cells):
            rows = np.unique(self._cells.contact)
            most, where = self.moments.cell_support(asked, self._cells, halvings)
            power[rows], centre[rows] = (most + self._rounding(w))[rows], where[rows, :2]
            arm[rows] = (where[:, 2] / self.contacts.torsion_arm)[rows]
        return power + w[:, COLUMN["N"]], centre, arm

    def _rounding(self, w: FloatArray) -> FloatArray:
        """What power may gain where a polygon's cells end short of it."""
        turned = np.abs(w[:, COLUMN["M1"]]) + np.abs(w[:, COLUMN["M2"]])
        turned += self.contacts.friction * np.abs(w[:, COLUMN["MT"]])
        return np.asarray(2.0 ** (1 - SUPPORT.digits) * self.half.max(axis=1) * turned)
