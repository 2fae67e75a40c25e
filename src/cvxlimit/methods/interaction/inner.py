"""Lower bounds on the load factor with interaction: safe convex problems from several starts.

Two kinds of convex problems lie inside Eq. 30, so that every answer is a lower bound:

- *hard* steps (:mod:`safe_step`), built at a point of all contacts. Built at
  the last one's forces they contain them, so bounds do not fall;
- *frozen* ones (signed moments, and contacts that are not rectangles): every contact is pressed
  exactly at a given centre, where Eq. 30 is convex as it stands, for any shape of contact.

Where they end depends on where they begin, and two ways lead to good beginnings:

- *soft* steps from the middle of all contacts (independent signs) may exceed Eq. 30 at a price
  that grows until nothing is bought; hard steps follow;
- *box* steps (signed moments) replace every contact's states by the convex hull of those pressed
  within a box about the last pressure centre. The first box is the whole contact, hence the
  global relaxation; boxes shrink to points, the hull to a frozen problem.

Soft and box steps are not safe, and are not reported as bounds unless the checker accepts them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cvxlimit.bracket import known
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import Run, Solver
from cvxlimit.methods.interaction.copies import Copies
from cvxlimit.methods.interaction.hull import HullProblem
from cvxlimit.methods.interaction.lower_bound import LowerBound, LowerBounds
from cvxlimit.methods.interaction.majorants import Point
from cvxlimit.methods.interaction.pressure import Pressure
from cvxlimit.methods.interaction.safe_step import SafeStep
from cvxlimit.methods.interaction.support import half_extent
from cvxlimit.solvers import LimitState, SolverSettings, default_ladder, settings_for

FloatArray = NDArray[np.float64]

_SOFT_STEPS = 4
"""Soft steps from the middle, at most; like the next five chosen on the tuff wall, S12 and S10."""

_PRICE, _PRICE_GROWTH = 0.7, 3.0
"""First price of slack, in units of the fastest twist at a contact (what a small slack is worth),
and its factor per step."""

_FIRST_BOX, _BOX_SHRINK = 1.2, 0.6
"""First box about given pressure centres, in half sides to either side, and the factor from box to
box."""

_FREEZE = 0.1
"""Boxes of this size or less are followed by a frozen problem at their pressure centres."""

_ROUGH, _TIGHT = 1e-6, 1e-9
"""Clarabel's tolerances for steps that only lead the way, and for bounds."""

_PRESSED = 1e-7
"""Compression, over the total load, from which a pressure centre means something."""

_SMALLEST_BOX = 1e-4
"""Boxes of pressure centres, in half sides, below which nothing is left to gain."""

_BOUGHT = 1e-5
"""Slack in all, over total load x contact size, that counts as none."""

_RETREATS = (0.005, 0.02, 0.05, 0.2, 1.0)
"""Where a hard step fails, or the checker refuses it, the next one is built nearer to the middle
by these shares."""


@dataclass(frozen=True, eq=False)
class InnerIterate:
    """One solve of the inner method.

    Attributes
    ----------
    kind : str
        ``"hard"`` or ``"frozen"`` (safe by construction), ``"soft"`` or ``"box"``.
    state : LimitState
    slack : float
        Violation bought by a soft step, over total load x contact size.
    bound : LowerBound or None
        What the checker made of the forces; None if there are none.
    """

    kind: str
    state: LimitState
    slack: float
    bound: LowerBound | None

    @property
    def lower(self) -> float:
        """The bound; -inf where the checker refused the forces."""
        return -np.inf if self.bound is None else self.bound.value

    @property
    def is_safe(self) -> bool:
        """True if the checker accepted the forces."""
        return self.bound is not None and self.bound.is_accepted


class InnerMethod:
    """Safe steps of one run; :meth:`iterates` may be called for several starts.

    Bounds that the checker accepts go to ``run.best``, every solve into the run's history.

    Parameters
    ----------
    run : Run
        Its ladder is for safe problems, climbed where one fails; None is Clarabel at 1e-9 for hard
        steps, then the default, and the default for frozen ones.
    most : int
        Solves per start, at most.
    gain : float
        A climb of hard steps, or of frozen ones between boxes, ends when one gains less than
        this share of the load factor.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> run = Run(builtin_scene("single-block"))
    >>> found = [iterate.lower for iterate in InnerMethod(run).iterates()]
    >>> round(run.best.bracket.lower, 5)
    0.4
    """

    def __init__(self, run: Run, most: int = 24, gain: float = 1e-4) -> None:
        self.run, self.moments = run, run.moments
        self.contacts = run.contacts
        self.most, self.gain = most, gain
        self.ladder = run.ladder or (_clarabel(_TIGHT), *default_ladder())
        self.frozen_ladder = run.ladder or default_ladder()
        with run.clock.phase("compile"):
            self.problem = SafeStep(run.assemblage, run.moments)
            self.checker = LowerBounds(run.assemblage, run.moments)
        self.middle = Point.middle(self.contacts)
        self._start = "middle"

    def iterates(self, start: FloatArray | None = None) -> Iterator[InnerIterate]:
        """All solves in order, lazily; stop taking them when the bound is good enough.

        ``start`` (n, 6) are forces to begin at, those of a relaxation from above for example,
        whether or not they are admissible; None begins at the middle of the contacts.
        """
        self._start = "middle" if start is None else "relaxation"
        for number, iterate in enumerate(self.moments.ways(self, start), 1):
            yield iterate
            if number >= self.most:
                return

    def stepped(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Hard steps, after soft ones without a start; they know rectangles only, so contacts of
        other shapes get a frozen problem at the end."""
        yield from self._softened() if start is None else self.climb(self._point(start))
        best = self.run.best.forces
        if not (best is None or self.contacts.is_rectangle.all()):
            yield self._frozen(self._centre(best, self._no_centre))

    def boxed(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Boxes and frozen problems; hard steps only where those gave no bound."""
        point, has_bound = self.middle, False
        for iterate in self._boxes(start):
            yield iterate
            has_bound = has_bound or iterate.is_safe
            if iterate.state.forces is not None:
                point = self._point(iterate.state.forces, point)
        if not has_bound:
            yield from self.climb(point)

    def climb(self, point: Point, reach: float | None = None) -> Iterator[InnerIterate]:
        """Hard steps, each at the last one's forces or ahead of them by ``reach`` (None: as the
        moments have it), until they gain little."""
        reach = self.moments.reach if reach is None else reach
        best, before, retreats = -np.inf, None, iter(_RETREATS)
        here = at = point
        while True:
            iterate = self._hard(at)
            yield iterate
            forces = iterate.state.forces
            if forces is None or not iterate.is_safe:
                share = next(retreats, None)
                if share is None:
                    return
                here = here if forces is None else self._point(forces, at)
                at, reach, before = here.shrunk(share), 0.0, None
                continue
            gain, best = iterate.lower - best, max(best, iterate.lower)
            if gain > 0.0:
                here = self._point(forces, at)
            if gain < self.gain * abs(iterate.lower):
                if reach == 0.0:
                    return
                reach = 0.0
            at = here if before is None or reach == 0.0 else self._ahead(here, before, reach)
            before = here

    def _ahead(self, here: Point, before: Point, reach: float) -> Point:
        return here.moved(reach, before).inside(self.problem.statics.contacts)

    def _softened(self) -> Iterator[InnerIterate]:
        """A hard step at the middle, whose mechanism prices slack, then soft ones, then a climb."""
        first = self._hard(self.middle)
        yield first
        price = _PRICE * self._fastest_twist(first.state)
        point, last = self.middle, np.inf
        for number in range(_SOFT_STEPS):
            iterate = self._soft(point, price)
            yield iterate
            if iterate.state.forces is None:
                break
            point = self._point(iterate.state.forces, point)
            if iterate.slack <= _BOUGHT:
                break
            stuck = number > 0 and iterate.slack > 0.5 * last
            price *= _PRICE_GROWTH * (10.0 if stuck else 1.0)
            last = iterate.slack
        yield from self.climb(point)

    def _boxes(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Hulls over shrinking boxes of pressure centres, and frozen problems at the last ones."""
        contacts, centre = self.contacts, self._no_centre
        size, best = 1.0, -np.inf
        if start is not None:
            centre, size = self._centre(start, centre), _FIRST_BOX
        while size > _SMALLEST_BOX:
            ends = np.stack([centre - size, centre + size], axis=2)
            copies = self.moments.box_copies(contacts, np.clip(ends, -1.0, 1.0))
            iterate = self._copied("box", copies, (_clarabel(_ROUGH),))
            yield iterate
            if iterate.state.forces is None:
                return
            centre = self._centre(iterate.state.forces, centre)
            if size <= _FREEZE:
                iterate = self._frozen(centre)
                yield iterate
                if iterate.lower - best < self.gain * abs(iterate.lower):
                    return
                best = max(best, iterate.lower)
            size *= _BOX_SHRINK

    def _hard(self, point: Point) -> InnerIterate:
        return self._solved("hard", lambda rung: self.problem.solve(point, rung, None), self.ladder)

    def _soft(self, point: Point, price: float) -> InnerIterate:
        return self._solved(
            "soft", lambda rung: self.problem.solve(point, rung, price), (_clarabel(_ROUGH),)
        )

    def _frozen(self, centre: FloatArray) -> InnerIterate:
        copies = self.moments.safe_copies(self.contacts, centre)
        return self._copied("frozen", copies, self.frozen_ladder)

    def _copied(self, kind: str, copies: Copies, ladder: Sequence[SolverSettings]) -> InnerIterate:
        return self._solved(kind, lambda rung: self._hull.solve(copies, rung), ladder)

    @cached_property
    def _hull(self) -> HullProblem:
        return HullProblem(self.run.assemblage)

    def _solved(self, kind: str, solver: Solver, ladder: Sequence[SolverSettings]) -> InnerIterate:
        """Solve, check, keep the bound if it is better, and note all of it."""
        state, rung = self.run.climb(solver, ladder)
        bound, figures = None, {}
        if state.forces is not None and state.load_factor is not None:
            with self.run.clock.phase("certify"):
                bound = self.checker.of(state.forces, state.load_factor)
            self.run.best = bound.raising(self.run.best)
            figures = {
                "equilibrium_residual": known(bound.residual),
                "yield_excess": known(bound.excess),
            }
        label = f"{rung}, {kind} step from the {self._start}"
        self.run.note(state, label, **self.run.bounds, **figures)
        return InnerIterate(kind, state, getattr(state, "slack", 0.0), bound)

    def _point(self, forces: FloatArray, otherwise: Point | None = None) -> Point:
        point = self.problem.point(forces, otherwise or self.middle, _PRESSED)
        return point.shrunk(self.moments.shrink)

    def _centre(self, forces: FloatArray, otherwise: FloatArray) -> FloatArray:
        """Pressure centres (n, 2) as fractions of the half extent; idle contacts keep theirs."""
        contacts = self.contacts
        at = Pressure.of(forces, contacts)
        centre = np.stack([at.e1, at.e2], axis=1) / half_extent(contacts)
        pressed = forces[:, [COLUMN["N"]]] > _PRESSED * self.problem.scaling.force
        return np.where(pressed, np.clip(centre, -1.0, 1.0), otherwise)

    @cached_property
    def _no_centre(self) -> FloatArray:
        return np.zeros((len(self.contacts), 2))

    def _fastest_twist(self, state: LimitState) -> float:
        """Largest twist rate at a contact, scaled; at least the scaled load factor."""
        scaling = self.problem.scaling
        floor = abs(state.load_factor or 1.0) / scaling.load_factor(1.0)
        if state.mechanism is None:
            return floor
        rates = self.problem.statics.relative_rates(state.mechanism / scaling.mechanism(_ONES))
        return max(floor, float(np.abs(rates[:, COLUMN["MT"]]).max()))


_ONES = np.ones(6)


def _clarabel(tolerance: float) -> SolverSettings:
    return settings_for("CLARABEL", tolerance, f"CLARABEL {tolerance:g}", max_iter=100)
