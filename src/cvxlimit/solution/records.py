"""How an analysis ended, and what a solution is made of: iterates, members, the lower end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from cvxlimit.base.arrays import FloatArray
from cvxlimit.solution.bracket import Bracket, Reference, rounded


class Status(StrEnum):
    """How an analysis ended; :attr:`advice` gives likely causes and a cure."""

    CERTIFIED = "certified"
    NOT_CERTIFIED = "not certified"
    CONVERGED = "converged"
    NOT_CONVERGED = "not converged"
    CYCLING = "cycling"
    DIVERGED = "diverged"
    SOLVER_FAILED = "solver failed"
    CONTRADICTED = "bounds contradict each other"
    DEAD_LOAD_UNSTABLE = "dead load cannot stand"
    LIVE_LOAD_HARMLESS = "live load does no harm"
    UNBOUNDED = "no limit with dilatancy"
    REACHED = "reached from rest"
    NOT_REACHED = "end not reached from rest"
    ENDLESS = "no limit from rest"
    INTERRUPTED = "interrupted"

    @property
    def has_answer(self) -> bool:
        """False when no load factor exists at all."""
        return self not in (
            Status.DEAD_LOAD_UNSTABLE, Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED, Status.ENDLESS
        )  # fmt: skip

    @property
    def is_good(self) -> bool:
        """True when the answer keeps its promise: bracket closed, or iteration converged."""
        return self in (Status.CERTIFIED, Status.CONVERGED, Status.REACHED)

    @property
    def advice(self) -> str:
        """One sentence: the meaning, and what to do."""
        return _ADVICE[self]


_ADVICE = {
    Status.CERTIFIED: "the load factor lies between both bounds, recomputed outside the solver",
    Status.NOT_CERTIFIED: (
        "the bracket is wider than the tolerance: use its bounds, or ask for a wider tolerance; "
        "with interaction give it more time, without it try another surface or solver"
    ),
    Status.CONVERGED: "the iteration settled within its tolerance, which bounds nothing",
    Status.NOT_CONVERGED: (
        "the iteration did not settle, or settled where Coulomb's law is exceeded, and its last "
        "load factor is not an answer: for interaction with bending use method 'certified', for "
        "friction without dilatancy 'zero-dilatancy'"
    ),
    Status.CYCLING: (
        "the fixed point returns to the same load factors, and none of them is an answer: "
        "use method 'certified', or another old-value weight"
    ),
    Status.DIVERGED: (
        "the fixed point reached eccentricities at which no load factor exists: "
        "use method 'certified', or a larger old-value weight"
    ),
    Status.SOLVER_FAILED: (
        "every solver failed, which says nothing about the structure: try other solvers "
        "(solver, ladder), or leave the choice to the package"
    ),
    Status.CONTRADICTED: (
        "the lower one lies above the upper one, so that an assumption behind them fails and "
        "neither is used: try another surface or solver; with friction next to none, for example, "
        "rounding decides"
    ),
    Status.DEAD_LOAD_UNSTABLE: (
        "this was proved, and checked outside the solver: change the geometry, the supports, "
        "the friction or the dead load"
    ),
    Status.LIVE_LOAD_HARMLESS: (
        "forces that carry any multiple of it, with no more friction than joints have in every "
        "state of forces, were found and checked: change the direction of the live load"
    ),
    Status.UNBOUNDED: (
        "forces that carry any multiple of the live load were found and checked, but joints may "
        "be pressed so hard only because they would open as they slide: this says nothing of "
        "friction without dilatancy, which method 'zero-dilatancy' (--method zero-dilatancy) has"
    ),
    Status.REACHED: "blocks on elastic joints were pushed to the end of their curve: no bound",
    Status.NOT_REACHED: (
        "the way from rest was lost, or still rose at its last step: the load factor is the most "
        "that was carried on it; give more steps (steps, --steps), or another ratio"
    ),
    Status.ENDLESS: (
        "joints jam: from rest, the load rose beyond any that could be meant, which proves nothing "
        "of other states of forces: stone that crushes (compressive_strength) may set a limit"
    ),
    Status.INTERRUPTED: "the bracket is what was proved until then; let it run longer",
}


@dataclass(frozen=True)
class Iterate:
    """One solve: an attempt of the solver ladder, or an iterate of an interaction loop.

    Numbers that do not apply are None. ``equilibrium_residual`` and ``yield_excess`` are in
    units of the total load, ``flow_violation`` in units of the mechanism's largest rate;
    ``change`` is the convergence measure of Eq. 43.
    """

    load_factor: float | None
    seconds: float
    solver: str
    status: str
    lower: float | None = None
    upper: float | None = None
    change: float | None = None
    equilibrium_residual: float | None = None
    yield_excess: float | None = None
    flow_violation: float | None = None


IN_A_ROW = 5
"""Small changes in a row that count as converged: wandering iterations had three by chance."""


@dataclass(frozen=True)
class Iteration:
    """How far an iteration without bounds went: the paper's criterion, and a band.

    The band is how far the last iterates lie apart. It bounds neither the collapse load nor where
    the iteration goes on to, and another solver may have another one.

    Attributes
    ----------
    met_after : int or None
        Solves after which the load factor first changed by no more than the tolerance, which is
        where the paper stops (Eq. 43); None if it never did.
    met_at : float or None
        The load factor then.
    lowest, highest : float
        Load factors of the last iterates.
    last : int
        How many those are.

    Example
    -------
    >>> print(Iteration(22, 0.342684, 0.339134, 0.342684, 40))
    last 40 iterates 0.33913 to 0.34268; Eq. 43 met after 22 solves, at 0.34268; converged here \
means 5 times in a row
    """

    met_after: int | None
    met_at: float | None
    lowest: float
    highest: float
    last: int

    @property
    def band(self) -> str:
        """Its ends in words, rounded to the nearest: they are no bounds."""
        if self.last == 1:
            return f"last iterate {rounded(self.lowest, 5)}"
        ends = f"{rounded(self.lowest, 5)} to {rounded(self.highest, 5)}"
        return f"last {self.last} iterates {ends}"

    @property
    def width(self) -> float:
        """The band's width over its larger end."""
        return (self.highest - self.lowest) / max(abs(self.lowest), abs(self.highest), 1e-300)

    @property
    def stop(self) -> str:
        """Where the paper stops, in words."""
        if self.met_after is None or self.met_at is None:
            return "Eq. 43, where the paper stops, was not met"
        met = f"Eq. 43 met after {self.met_after} solves, at {rounded(self.met_at, 5)}"
        return f"{met}; converged here means {IN_A_ROW} times in a row"

    def __str__(self) -> str:
        return f"{self.band}; {self.stop}"


RESIDUALS = ("equilibrium", "yield_excess", "flow", "complementarity")
"""How well a solution without dilatancy keeps its conditions."""


@dataclass(frozen=True, eq=False)
class Member:
    """One of several solutions, where the answer is a set: friction without dilatancy.

    Attributes
    ----------
    load_factor : float
    start : str
        How it was found, in ``iterations`` convex problems.
    equilibrium, yield_excess : float
        Largest residual and excess, in units of the total load.
    flow : float
        Largest penetration at a corner over the largest opening or slip.
    complementarity : float
        Power of contact forces that friction does not account for, over the load factor's.
    forces : (contacts, 6) array, mechanism : (free blocks, 6) array
        User's units; live power 1.
    angle : float or None
        Between friction and slip, in radians, over all joints that slide: the cosine is the power
        that friction does over what it would do against the slip. It is times the share of the
        load factor's power that friction could do, where that is less than all: about so large a
        share of the load factor is not known, where complementarity is but half the square of it.
        Zero where joints can slip to and fro only; None in files of version 0.2.0.
    """

    load_factor: float
    start: str
    iterations: int
    equilibrium: float
    yield_excess: float
    flow: float
    complementarity: float
    forces: FloatArray = field(repr=False)
    mechanism: FloatArray = field(repr=False)
    angle: float | None = None

    @property
    def residual(self) -> float:
        """The largest of the four."""
        return max(getattr(self, name) for name in RESIDUALS)

    @property
    def is_settled(self) -> bool:
        """Whether the angle moves the load factor by less than a tenth of what searches tell
        apart."""
        return self.angle is None or self.angle <= 0.1 * APART


APART = 1e-3
"""Relative difference of load factors that searches tell apart: each asks for members that are
lower than its lowest by as much at least."""


@dataclass(frozen=True)
class Search:
    """One of several searches for low members.

    Attributes
    ----------
    seed : int
        Of its random numbers.
    load_factor : float or None
        Of the lowest member that it found; None if it found none.
    solves : int
        How many convex problems it solved.
    last_gain : int
        After how many of them it found that member: late ones suggest that there are lower members.
    """

    seed: int
    load_factor: float | None
    solves: int
    last_gain: int


def ended_apart(searches: Sequence[Search]) -> bool:
    """Whether several searches ended at load factors that they tell apart, or one at none.

    >>> ended_apart([Search(0, 0.5, 300, 20), Search(1, 0.5001, 300, 90)])
    False
    >>> ended_apart([Search(0, 0.5, 300, 20), Search(1, 0.51, 300, 90)])
    True
    """
    found = [search.load_factor for search in searches if search.load_factor is not None]
    if len(found) < len(searches):
        return bool(found)
    return bool(found) and max(found) - min(found) > APART * max(map(abs, found))


@dataclass(frozen=True, eq=False)
class LowerEnd:
    """The lower end of an interval of load factors: the dead load does not stand with less of the
    live load.

    Attributes
    ----------
    load_factor : float
    bracket : Bracket
        Of this end: forces show that ``upper`` is carried, the mechanism that no factor below
        ``lower`` is.
    forces : (contacts, 6) array or None
        At this end, as :attr:`Solution.forces`.
    mechanism : mapping of block id to (6,) array, or None
        Rates with which blocks fall below it, scaled to live power -1.
    reference : Reference or None
        As :attr:`Solution.reference`.
    """

    load_factor: float
    bracket: Bracket
    forces: FloatArray | None = field(default=None, repr=False)
    mechanism: Mapping[str, FloatArray] | None = field(default=None, repr=False)
    reference: Reference | None = field(default=None, repr=False)

    @property
    def lower(self) -> float:
        """No factor below it is carried; -inf without a bound."""
        return self.bracket.lower

    @property
    def upper(self) -> float:
        """It is carried; inf without a bound."""
        return self.bracket.upper
