"""The flow rule of torsion-shear-bending interaction: how far rates are from those it allows.

An upper bound on the load factor rests on a mechanism, and on the least work that admissible
forces can do on its relative rates q (6 per contact). Admissible forces X of a contact under a
reading of Eq. 26-30 are no convex set, but the largest power that they can have is a convex
function of the rates, their support function. With compression N = 1 it defines the *shortfall*

    s(q) = max of -X . q  over all admissible X with N = 1,   so that   X . q >= -s(q) N.

Rates with s <= 0 obey the flow rule, and contacts do no negative work on them. Where s > 0 a
contact would have to open by s more; certificates add as much of a field that opens all contacts,
and the bound rises by what that costs. The maximum over pressure centres e is derived in
docs/evidence/interaction-bounds.md and computed by
:mod:`~cvxlimit.extensions.interaction.states.support`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.extensions.interaction.states.settings import SUPPORT
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.extensions.interaction.states.support import (
    DIGITS,
    Asked,
    box_keys,
    corner_support,
    whole_boxes,
)
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.proof.flow import Shortfall
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.pressure import half_extent
from cvxlimit.solvers.running import Flows

_Worst = tuple[FloatArray, FloatArray, FloatArray]
"""Shortfalls (n,), the pressure centres (n, 2) that have them, and the arms (n,) there."""


@dataclass
class _OpeningField:
    """The rates (n, 6) of the field that opens contacts, and its shortfalls as far as they are
    known, by a contact's number and the box of its pressure centres."""

    rates: FloatArray = field(default_factory=lambda: np.zeros(0))
    missing: dict[tuple[int, bytes], float] = field(default_factory=dict)


class InteractionFlow:
    """The flow rule of n contacts under a reading, in place of
    :class:`cvxlimit.proof.flow.FlowRule` in certificates of upper bounds.

    Parameters
    ----------
    contacts, moments
        The contacts, and the reading of their moments.
    boxes : (n, 2, 2) array, optional
        Only states whose pressure centres are in these boxes count: the lowest and the highest e1
        and e2, as fractions of :func:`half_extent`. All count without.
    is_coarse : bool
        True computes the shortfalls of :meth:`worst` closely only where they are positive, and then
        to ``precision`` of the largest power in play, where that is coarser than the reading's own.
    contact_number : (n,) array of int, optional
        Which contact of the scene each one is, where all of them come several times, one after
        another, with different boxes.
    """

    def __init__(
        self,
        contacts: Contacts,
        moments: Moments,
        boxes: FloatArray | None = None,
        is_coarse: bool = False,
        precision: float = 0.0,
        contact_number: IntArray | None = None,
    ) -> None:
        self.contacts, self.moments, self.is_coarse = contacts, moments, is_coarse
        self.precision = precision
        every = np.arange(len(contacts))
        self.contact_number = every if contact_number is None else contact_number
        self.half_sides = half_extent(contacts)
        self.boxes = whole_boxes(contacts) if boxes is None else boxes
        # Contacts by the way of their support function: friction at a polygon's corners, boxes of
        # centres on rectangles, triangles of centres on other polygons.
        has_corners = states_of(moments).has_corner_hull(contacts, self.boxes)
        self._corners = np.flatnonzero(~contacts.is_rectangle & has_corners)
        self._rectangles = np.flatnonzero(contacts.is_rectangle)
        self._cells = states_of(moments).cells(contacts, self.boxes)
        # Answers are kept: pricing asks again for the rates of the bound before it.
        self._last_rates, self._last_worst = np.zeros(0), (np.zeros(0),) * 3
        self._opening_field = _OpeningField()
        self._repeated: dict[int, tuple[IntArray, Contacts]] = {}

    def shortfall(self, rates: FloatArray, duals: Flows | None = None) -> Shortfall:
        """Returns the shortfalls of rates (n, 6). They exceed the exact ones by 1e-10 of the
        largest power at most; on very many polygons with independent signs, by what friction at
        the corners allows more."""
        return Shortfall(self.worst(rates)[0], np.zeros(0))

    def shortfall_bound(self, rates: FloatArray) -> FloatArray:
        """Returns upper bounds (n,) on shortfalls, without a search over pressure centres."""
        return self._support(-rates, halvings=0)[0]

    def worst(self, rates: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Returns the shortfalls (n,) of rates (n, 6), the pressure centres (n, 2) of the states
        that have them, as fractions, and the arms (n,) there, over the whole contact's. Centres are
        NaN where they are not known, arms where they are the centre's own."""
        if not np.array_equal(rates, self._last_rates):
            floor = rates[:, COLUMN["N"]] if self.is_coarse else None  # a shortfall of zero
            self._last_worst = self._support(-rates, floor)
            self._last_rates = rates.copy()
        return self._last_worst

    def opened(self, rates: FloatArray) -> Shortfall:
        """Returns the shortfalls of the field that opens all contacts, close everywhere, also where
        they are negative: that is what there is to spare. One field serves all mechanisms, and in
        boxes it has more to spare than on whole contacts, so that they are kept box by box."""
        known, once = self._opening_field, rates[: int(self.contact_number.max(initial=-1)) + 1]
        if not np.array_equal(once, known.rates):
            known.rates, known.missing = once.copy(), {}
        keys = box_keys(self.boxes, self.contact_number)
        if new := [k for k, key in enumerate(keys) if key not in known.missing]:
            rows = np.array(new)
            found = self.of(rows)._support(-rates[rows])[0].tolist()
            known.missing |= zip((keys[k] for k in new), found, strict=True)
        return Shortfall(np.array([known.missing[key] for key in keys]), np.zeros(0))

    def of(self, rows: IntArray) -> InteractionFlow:
        """Returns the rule of the contacts with numbers ``rows`` (k,)."""
        given = self.contacts.take(rows), self.moments, self.boxes[rows]
        return InteractionFlow(*given, self.is_coarse, self.precision)

    def within(self, boxes: FloatArray, precision: float = 0.0) -> InteractionFlow:
        """Returns the coarse rule of the same contacts with pressure centres in ``boxes``
        (n, 2, 2). Both rules share what they know of the opening field."""
        result = InteractionFlow(self.contacts, self.moments, boxes, True, precision)
        result._opening_field = self._opening_field
        return result

    def ask_together(
        self,
        flows: Sequence[InteractionFlow],
        rates: Sequence[FloatArray],
        opening: FloatArray | None,
    ) -> None:
        """Computes for several rules of these contacts in boxes what each of them will be asked
        for: the worst states of its own ``rates`` (n, 6), and the shortfalls of the ``opening``
        field (n, 6). One call takes hardly longer for all of them than for one."""
        # One rule of all contacts as many times as there are boxes for them.
        if len(flows) not in self._repeated:
            number = np.tile(self.contact_number, len(flows))
            self._repeated[len(flows)] = number, self.contacts.take(number)
        number, contacts = self._repeated[len(flows)]
        boxes, precision = np.concatenate([flow.boxes for flow in flows]), flows[0].precision
        all_flows = InteractionFlow(contacts, self.moments, boxes, True, precision, number)
        all_flows._opening_field = self._opening_field
        if opening is not None:
            all_flows.opened(np.tile(opening, (len(flows), 1)))
        # Each rule keeps its part as the answer to what it was asked last.
        found = (np.split(x, len(flows)) for x in all_flows.worst(np.concatenate(rates)))
        for flow, own_rates, missing, centre, arm in zip(flows, rates, *found, strict=True):
            flow._last_rates, flow._last_worst = own_rates.copy(), (missing, centre, arm)

    def _support(
        self, w: FloatArray, floor: FloatArray | None = None, halvings: int = DIGITS
    ) -> _Worst:
        """Returns the largest power (n,) of states with N = 1 on rates w (n, 6), where it lies
        (n, 2), and the arms (n,) there. The search over pressure centres halves pieces so many
        times at most; powers below ``floor`` (n,), those of N left out, need not be close."""
        power, centre = np.full(len(w), -np.inf), np.full((len(w), 2), np.nan)
        arm, friction = np.full(len(w), np.nan), self.contacts.friction
        least = np.full(len(w), -np.inf) if floor is None else floor
        precision = 0.0 if floor is None else self.precision
        asked = Asked(w, self.half_sides, friction, self.boxes, least, precision, halvings)
        if len(rows := self._corners):
            power[rows] = corner_support(w, self.contacts)[rows]
        if len(rows := self._rectangles):
            power[rows], centre[rows] = states_of(self.moments).support(asked.take(rows))
        if len(self._cells):
            rows = np.unique(self._cells.contact)
            most, where = states_of(self.moments).cell_support(asked, self._cells)
            # Equal polygons share their cells up to rounding: what a cell may end short of its
            # polygon adds to the power.
            moments = np.abs(w[:, COLUMN["M1"]]) + np.abs(w[:, COLUMN["M2"]])
            moments += friction * np.abs(w[:, COLUMN["MT"]])
            short = 2.0 ** (1 - SUPPORT.digits) * self.half_sides.max(axis=1) * moments
            power[rows], centre[rows] = (most + short)[rows], where[rows, :2]
            arm[rows] = (where[:, 2] / self.contacts.torsion_arm)[rows]
        return power + w[:, COLUMN["N"]], centre, arm
