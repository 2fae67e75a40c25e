"""Jumps between two configurations of a path: where they may be, and between which w they are.

Where no equilibrium follows near by, the structure jumps to one farther off. The iterates of a step
find that one as they find any other, so that a jump shows by how far blocks have moved, and by the
work: the dead load has not risen by what the load factors at both ends stand for.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.paths.pairs import CLOSED
from cvxlimit.extensions.paths.resting import At, Failed, Rest

_AHEAD = 1.5
"""Blocks that go so many times as far as at the pace before may have jumped, if nothing slides."""

JUMP = 4.0
"""The same where joints slide, which change their pace as they like; and how many times as fast as
on the whole way blocks move in a snap."""

_WORK = 0.01
"""Work that is missing from a step without a jump, over that of the first load factor, at most."""

_HALVINGS, _SPREAD = 4, 0.25
"""Halvings after which a change that spreads over all sixteenths of a step is told from a jump: the
sixteenth with most has less than this share of it."""


def may_have_jumped(rest: Rest, here: At, there: At, pace: float) -> bool:
    """Returns whether blocks moved much farther than at the ``pace`` so far, or the dead load's
    rise differs from the work that the load factors at both ends stand for."""
    ahead = JUMP if there.slides else _AHEAD
    if rest.distance(here, there) > ahead * pace * (there.shown.w - here.shown.w):
        return True
    if there.slides:  # what slides changes direction without a jump
        return False
    more, farther = work_beside(rest, here, there)
    rise = rest.loads.work(here.pose)[0] - rest.loads.work(there.pose)[0] + more
    way = rest.loads.size * (there.shown.w - here.shown.w) + farther
    area = 0.5 * way * (here.shown.load_factor + there.shown.load_factor)
    return abs(rise - area) > _WORK * way * rest.unit


def work_beside(rest: Rest, one: At, other: At) -> tuple[float, float]:
    """Returns the energy that is taken up between two configurations besides the dead load's work
    along its first directions, and what the live load does besides its own: loads that turn, and
    ties and reactions that give way."""
    dead, live = rest.loads.turning_work(one.pose, other.pose)
    yields = one.bonds.yielded(other.bonds) if one.bonds and other.bonds else 0.0
    return yields - dead, live


def jump_between(rest: Rest, here: At, there: At, finest: float) -> tuple[list[At], At] | None:
    """Returns the configurations that lead from ``here`` to a jump, the last one before it behind,
    and the first after it, nearer than ``finest`` (w); None if there is no jump.

    The half in which more happens is halved again. Smooth changes spread over all sixteenths.
    """

    def happens(one: At, other: At) -> FloatArray:
        fall = abs(one.shown.load_factor - other.shown.load_factor)
        return np.array([fall, rest.distance(one, other)])

    low, high, passed = here, there, list[At]()
    whole, halvings = np.maximum(happens(low, high), 1e-300), 0
    while high.shown.w - low.shown.w > finest or halvings < _HALVINGS:
        middle = rest.settle(low, 0.5 * (low.shown.w + high.shown.w))
        if isinstance(middle, Failed):
            return None
        below, above = happens(low, middle) / whole, happens(middle, high) / whole
        if below.sum() > above.sum():
            high = middle
        else:
            low = middle
            passed.append(middle)
        halvings += 1
        if halvings >= _HALVINGS and (happens(low, high) / whole).max() < _SPREAD:
            return None
    # Slips and seats count from configurations that the path keeps: it keeps all that led there
    # where these two do not say by themselves what has happened on the way.
    if low is here:
        return [], high
    slides = any(each.slides for each in (there, *passed))
    if not slides and not _seats_are_lost(rest.size, here, low, high):
        return [low], high
    last = rest.settle(low, high.shown.w)
    return None if isinstance(last, Failed) else (passed, last)


def _seats_are_lost(size: float, *each: At) -> bool:
    """Returns whether seats have moved farther between configurations than these show."""
    for one, other in pairwise(each):
        if one.bonds and other.bonds:
            off = one.bonds.after(other.pose).seat - other.bonds.seat
            if (abs(off) > CLOSED * size).any():
                return True
    return False
