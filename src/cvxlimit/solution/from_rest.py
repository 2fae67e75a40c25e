"""A way from rest to collapse: its states, what may be to come, and where else it may end."""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import median

from cvxlimit.base.arrays import FloatArray
from cvxlimit.solution.bracket import rounded


@dataclass(frozen=True)
class Step:
    """A state on the way, in equilibrium.

    Attributes
    ----------
    displacement : float
        Of the live load since rest, over what it would be at this load factor if all joints stayed
        as they are at rest: 1 where nothing has slipped or opened yet.
    load_factor : float
    sliding, open : int
        How many joints slide, and are open, at some point at least.
    equilibrium : float
        Largest force that a block lacks, over those that act on it.
    yield_excess : float
        Largest shear beyond friction at a point, over the total of compressions.
    against : float
        Power of friction that slips have not gone against in this step, over what they have.
    forces : (contacts, 6) array or None
        User's units; files do not hold them.
    """

    displacement: float
    load_factor: float
    sliding: int
    open: int
    equilibrium: float
    yield_excess: float
    against: float
    forces: FloatArray | None = field(default=None, repr=False, compare=False)


WIDE = 0.02
"""Spread, over the load factor, beyond which ways do not agree on a number: ratios, points and
steps make one or two per cent where the curve ends sharply."""


@dataclass(frozen=True)
class Trial:
    """The same way with something else: what, the load factor reached, None without one, and how it
    ended."""

    what: str
    load_factor: float | None
    end: str


@dataclass(frozen=True)
class FromRest:
    """What is known of a way from rest besides the load factor reached.

    Attributes
    ----------
    end : str
        How it ended, in words.
    to_come : float or None
        Load factor that the last state's compressions would let it reach: an estimate of what is
        still to come, no bound.
    limit : float or None
        Proved upper bound of the load factor if joints open as they slide.
    steps : tuple of Step
        The curve.
    spread : tuple of Trial
        Other stiffness ratios, and half the step.
    bedding : float or None
        Typical initial gap of joints in ``draws``.
    draws : tuple of Trial
        The same with beds that are not true, each at random.
    slipped, opened : (contacts,) array or None
        Load factor at which each joint first slid and opened, at some point at least: 0 at rest,
        NaN where it never did. Files do not hold them.
    """

    end: str
    to_come: float | None
    limit: float | None
    steps: tuple[Step, ...] = field(default=(), repr=False)
    spread: tuple[Trial, ...] = ()
    bedding: float | None = None
    draws: tuple[Trial, ...] = field(default=(), repr=False)
    slipped: FloatArray | None = field(default=None, repr=False, compare=False)
    opened: FloatArray | None = field(default=None, repr=False, compare=False)

    def undecided(self, factor: float) -> str:
        """Where ways of one scene end, if they do not agree on a number; else nothing."""
        found = [factor, *(x.load_factor for x in self.spread if x.load_factor is not None)]
        low, high = min(found), max(found)
        is_one = high - low <= WIDE * abs(high)
        return "" if is_one else f"{rounded(low, 4)} to {rounded(high, 4)}"

    @property
    def spread_text(self) -> str:
        """Where it ends besides, in words."""
        return _ends(self.spread)

    @property
    def draws_text(self) -> str:
        """Where it ends with beds that are not true, in words."""
        found = sorted(x.load_factor for x in self.draws if x.load_factor is not None)
        if not found:
            return ""
        ends = f"{rounded(found[0], 4)} and {rounded(found[-1], 4)}"
        text = f"{len(found)} of {len(self.draws)} draws end between {ends}, "
        text += f"half of them below {rounded(median(found), 4)}"
        return "; ".join(filter(None, (text, self.lost_text)))

    @property
    def lost_text(self) -> str:
        """How many draws have no load factor, and why."""
        reasons = [x.end for x in self.draws if x.load_factor is None]
        return "; ".join(f"{reasons.count(x)} {x}" for x in dict.fromkeys(reasons))


def _ends(trials: tuple[Trial, ...]) -> str:
    found = [x.load_factor for x in trials if x.load_factor is not None]
    if not found:
        return ""
    span = dict.fromkeys(rounded(x, 4) for x in (min(found), max(found)))
    lost = len(trials) - len(found)
    return " to ".join(span) + (f"; {lost} of {len(trials)} without a number" if lost else "")
