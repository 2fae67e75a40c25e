"""Lower bounds on the load factor with interaction: safe convex problems from several starts.

Two kinds of convex problems lie inside Eq. 30, so that every answer is a lower bound:

- *hard* steps (:mod:`safe_step`), built at a point of all contacts. Built at
  the last one's forces they contain them, so bounds do not fall;
- *frozen* ones (signed moments, and contacts that are not rectangles): every contact is pressed
  exactly at a given centre, where Eq. 30 is convex as it stands, for any shape of contact.

Where they end depends on where they begin, and how fast on the length of their steps:

- *long* steps are hard ones with a tenth of their curvature: they may exceed Eq. 30 by a little,
  and lead as far as two or three hard ones;
- *soft* steps from the middle of all contacts (independent signs) may exceed Eq. 30 at a price
  that grows until nothing is bought; hard steps follow;
- *box* steps (signed moments) replace every contact's states by the convex hull of those pressed
  within a box about the last pressure centre (:mod:`boxes`).

Long, soft and box steps are not safe, and are not reported as bounds unless the checker accepts
them. All steps are solved loosely; what a bound lost by that is won back by one solve at the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy

import numpy as np
from numpy.typing import NDArray

from cvxlimit.bracket import known
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import Run, Solver
from cvxlimit.methods.interaction.climb.box_climb import BoxClimb, InnerIterate
from cvxlimit.methods.interaction.climb.lower_bound import LowerBounds
from cvxlimit.methods.interaction.climb.safe_step import SafeStep
from cvxlimit.methods.interaction.readings.halves import Half
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.relaxation.upper import UpperBound
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.methods.interaction.states.majorants import Point
from cvxlimit.reductions.choice import Reductions
from cvxlimit.solvers import (
    LimitState,
    SolverSettings,
    clarabel_at,
    leading_ladder,
    tight_ladder,
)

__all__ = ["InnerIterate", "InnerMethod"]

FloatArray = NDArray[np.float64]

_SOFT_STEPS = 4
"""Soft steps from the middle, at most; like the next two chosen on the tuff wall, S12 and S10."""

_PRICE, _PRICE_GROWTH = 0.7, 3.0
"""First price of slack, in units of the fastest twist at a contact (what a small slack is worth),
and its factor per step."""

_LONG, _LONG_STEPS = (0.1, 0.1, 0.1, 0.3), 1e-3
"""Curvature of long steps, and the gain below which they end. On S10 four of them lead where eight
hard ones ended; with none at all they oscillate."""

_INWARD = 0.05
"""Share by which climbs from a relaxation begin nearer to the middle: its forces lie on the rims of
contacts, and which of many solutions a solver picked decided where S12 ended, 0.12598 or 0.12604.
Moved in by 0.05 or 0.2 it was 0.12604 from all of five."""

MOST_BOXED = 500
"""Contacts up to which boxes of pressure centres are tried unasked: on the panels S12 (888
contacts) and S10 (1,906) they took as long as all before, and ended at or below it."""

_FROZEN = 1e-10
"""Tolerance of frozen problems: where no reserve is known, what forces exceed Eq. 30 by is taken
off the bound, 9e-5 of it on S12 at 1e-9 and 1e-5 at 1e-10, in the same time."""

_RELAXED = 1e-4
"""How far copies are added to a stricter reading's relaxation: as in a run of its own."""

_LEAST = 1e-7
"""Compression, over the total load, from which a pressure centre means something."""

_BOUGHT = 1e-5
"""Slack in all, over total load x contact size, that counts as none."""

_RETREATS = (0.005, 0.02, 0.05, 0.2, 1.0)
"""Where a hard step fails, or the checker refuses it, the next one is built nearer to the middle
by these shares."""

_LOST = 0.1
"""Share of the least gain that a loose solve may cost a bound without a tight one."""

_HOPE, _FIRST_RATIO = 2.0, 0.7
"""A start is given up when twice the gain predicted for it would not reach the best bound. Gains of
hard steps fall by 0.4 to 0.7 per step; until there are two the slower is assumed."""


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
    reductions : Reductions or None
        Those of the scene: where they have a mirror plane, steps stay among symmetric states.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> run = Run(builtin_scene("single-block"))
    >>> found = [iterate.lower for iterate in InnerMethod(run).iterates()]
    >>> round(run.best.bracket.lower, 5)
    0.4
    """

    def __init__(
        self,
        run: Run,
        most: int = 24,
        gain: float = 1e-4,
        reductions: Reductions | None = None,
    ) -> None:
        self.run, self.moments, self.reductions = run, run.moments, reductions
        self.contacts = run.contacts
        self.most, self.gain = most, gain
        self.leading = run.ladder or leading_ladder()
        self.tight = run.ladder or tight_ladder()
        with run.clock.phase("compile"):
            self.half = self._half(run.moments)
            self.problem = SafeStep(run.assemblage, run.moments, self.half)
            self.checker = LowerBounds(run.assemblage, run.moments)
        self.middle = Point.middle(self.contacts)
        self._start = "middle"
        self._mark = -np.inf
        self._last: tuple[InnerIterate, str, Solver] | None = None

    def iterates(self, start: FloatArray | None = None) -> Iterator[InnerIterate]:
        """All solves in order, lazily; stop taking them when the bound is good enough.

        ``start`` (n, 6) are forces to begin at, those of a relaxation from above for example,
        whether or not they are admissible; None begins at the middle of the contacts.
        """
        self._start = "middle" if start is None else "relaxation"
        self._mark, self._last = self.run.best.bracket.lower, None
        for number, iterate in enumerate(self._way(start), 1):
            yield iterate
            if number >= self.most:
                break
        yield from self._tightened()

    def _way(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        return self.boxed(start) if self.moments.way == "boxes" else self.stepped(start)

    def narrowed(self, start: FloatArray | None = None) -> Iterator[InnerIterate]:
        """Boxes about ``start`` (n, 6) that shrink until their forces nearly satisfy Eq. 30, and a
        climb from there: slower than :meth:`iterates`, and on irregular walls often higher."""
        self._start, self._mark, self._last = "boxes", self.run.best.bracket.lower, None
        for number, iterate in enumerate(self._narrowed(start), 1):
            yield iterate
            if number >= self.most:
                break
        yield from self._tightened()

    def _narrowed(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        boxes, point = BoxClimb(self), self.middle
        for iterate in boxes.narrowing(start):
            yield iterate
            state = iterate.state
            if state.forces is None or state.load_factor is None:
                break
            if state.load_factor <= self._mark:
                return
            point = self.point(state.forces, point)
        yield from self.climb(point)

    def borrowed(self, stricter: Moments) -> Iterator[InnerIterate]:
        """Solves in a stricter reading, whose forces are admissible in this one too, where they
        could be better than the best: its relaxation says so."""
        run = self.run
        copies = stricter.box_copies(self.contacts)
        self._start, self._mark = f"{stricter} relaxation", run.best.bracket.lower
        relaxed = self.copied("hull", copies, self.leading)
        yield relaxed
        state = relaxed.state
        if state.forces is None or state.load_factor is None:
            return
        if state.load_factor <= run.best.bracket.lower:
            return
        aside = run.aside()
        aside.moments = stricter
        half = self._half(stricter)
        outer = UpperBound(aside, half)
        outer.search(_RELAXED, (*self.leading, *self.tight))
        other = copy(self)
        other.moments, other.half = stricter, half
        other.problem = SafeStep(run.assemblage, stricter, half)
        near = outer.state.forces if outer.state else state.forces
        for start in (near, None):
            yield from other.iterates(start)
        if "boxes" in stricter.starts and len(self.contacts) <= MOST_BOXED:
            yield from other.narrowed(near)

    def stepped(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Hard steps, after soft ones without a start; they know rectangles only, so contacts of
        other shapes get a frozen problem at the end."""
        if start is None:
            yield from self._softened()
        else:
            yield from self._lengthened(self.point(start).shrunk(_INWARD))
        best = self.run.best.forces
        if not (best is None or self.contacts.is_rectangle.all()):
            yield self.frozen(BoxClimb(self).boxes(best).centre)

    def boxed(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Boxes and frozen problems; hard steps only where those gave no bound."""
        point, has_bound = self.middle, False
        for iterate in BoxClimb(self).iterates(start):
            yield iterate
            has_bound = has_bound or iterate.is_safe
            if iterate.state.forces is not None:
                point = self.point(iterate.state.forces, point)
        if not has_bound:
            yield from self.climb(point)

    def climb(self, point: Point, reach: float | None = None) -> Iterator[InnerIterate]:
        """Hard steps, each at the last one's forces or ahead of them by ``reach`` (None: as the
        moments have it), until they gain little, or could not reach the best bound."""
        reach = self.moments.reach if reach is None else reach
        best, before, retreats, gains = -np.inf, None, iter(_RETREATS), [np.inf]
        here = at = point
        while True:
            iterate = self.hard(at)
            yield iterate
            forces = iterate.state.forces
            if forces is None or not iterate.is_safe:
                share = next(retreats, None)
                if share is None:
                    return
                here = here if forces is None else self.point(forces, at)
                at, reach, before = here.shrunk(share), 0.0, None
                continue
            gain, best = iterate.lower - best, max(best, iterate.lower)
            gains.append(gain)
            if gain > 0.0:
                here = self.point(forces, at)
            least, hope = self.gain * abs(iterate.lower), _predicted(gains)
            if gain < least and (reach == 0.0 or (gain > 0.0 and hope < least)):
                return
            if best + _HOPE * hope < self._mark:
                return
            reach = reach if gain > 0.0 else 0.0
            at = here if before is None or reach == 0.0 else self._ahead(here, before, reach)
            before = here

    def _ahead(self, here: Point, before: Point, reach: float) -> Point:
        return here.moved(reach, before).inside(self.problem.statics.contacts)

    def _lengthened(self, point: Point) -> Iterator[InnerIterate]:
        """A hard step, for an early bound, then long ones while they gain, then a climb."""
        first = self.hard(point)
        yield first
        if first.state.forces is not None and first.is_safe:
            point, best = self.point(first.state.forces, point), first.lower
            for curvature in _LONG:
                iterate = self._long(point, curvature)
                yield iterate
                state = iterate.state
                if state.forces is None or state.load_factor is None:
                    break
                point = self.point(state.forces, point)
                if state.load_factor - best < _LONG_STEPS * abs(best):
                    break
                best = state.load_factor
        yield from self.climb(point)

    def _softened(self) -> Iterator[InnerIterate]:
        """A hard step at the middle, whose mechanism prices slack, then soft ones, then a climb."""
        first = self.hard(self.middle)
        yield first
        price = _PRICE * self._fastest_twist(first.state)
        point, last = self.middle, np.inf
        for number in range(_SOFT_STEPS):
            iterate = self._soft(point, price)
            yield iterate
            if iterate.state.forces is None:
                break
            point = self.point(iterate.state.forces, point)
            if iterate.slack <= _BOUGHT:
                break
            stuck = number > 0 and iterate.slack > 0.5 * last
            price *= _PRICE_GROWTH * (10.0 if stuck else 1.0)
            last = iterate.slack
        yield from self.climb(point)

    def hard(self, point: Point) -> InnerIterate:
        """A hard step built at ``point``."""
        return self.safe("hard", lambda rung: self.problem.solve(point, rung), self.leading)

    def _long(self, point: Point, curvature: float) -> InnerIterate:
        return self._solved(
            "long", lambda rung: self.problem.solve(point, rung, None, curvature), self.leading
        )

    def _soft(self, point: Point, price: float) -> InnerIterate:
        return self._solved(
            "soft", lambda rung: self.problem.solve(point, rung, price), self.leading
        )

    def frozen(self, centre: FloatArray) -> InnerIterate:
        """Contacts pressed at ``centre`` (n, 2), in fractions of the half extent."""
        copies = self.moments.safe_copies(self.contacts, centre)
        first = self.run.ladder or clarabel_at(_FROZEN)
        return self.safe("frozen", lambda rung: self.hull.solve(copies, rung), first[:1])

    def copied(self, kind: str, copies: Copies, ladder: Sequence[SolverSettings]) -> InnerIterate:
        """The best over ``copies``, which are as safe as they are."""
        return self._solved(kind, lambda rung: self.hull.solve(copies, rung), ladder)

    @property
    def hull(self) -> HullProblem:
        """Problems over copies."""
        return HullProblem(self.run.assemblage, self.half)

    def _half(self, moments: Moments) -> Half | None:
        return None if self.reductions is None else Half.of(self.reductions, moments)

    def safe(self, kind: str, solver: Solver, before: Sequence[SolverSettings]) -> InnerIterate:
        """A safe problem, with each further rung where the checker refuses its forces: first with
        those given, then tightly."""
        for rung in (*before, *(rung for rung in self.tight if rung not in before)):
            iterate = self._solved(kind, solver, (rung,))
            if iterate.is_safe or iterate.state.outcome.claims_no_optimum:
                break
        if iterate.is_safe and iterate.lower >= self.run.best.bracket.lower:
            self._last = (iterate, kind, solver) if rung in self.leading else None
        return iterate

    def _tightened(self) -> Iterator[InnerIterate]:
        """The problem of the best bound once more, if solving it loosely cost something."""
        if self._last is None:
            return
        iterate, kind, solver = self._last
        factor = iterate.state.load_factor
        if factor is not None and factor - iterate.lower > _LOST * self.gain * abs(factor):
            yield self._solved(kind, solver, self.tight)

    def _solved(self, kind: str, solver: Solver, ladder: Sequence[SolverSettings]) -> InnerIterate:
        """Solve, check, keep the bound if it is better, and note all of it."""
        state, rung = self.run.try_solvers(solver, ladder)
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

    def point(self, forces: FloatArray, otherwise: Point | None = None) -> Point:
        """Where to build a step at ``forces`` (n, 6); idle contacts keep their place."""
        point = self.problem.point(forces, otherwise or self.middle, _LEAST)
        return point.shrunk(self.moments.shrink)

    def _fastest_twist(self, state: LimitState) -> float:
        """Largest twist rate at a contact, scaled; at least the scaled load factor."""
        scaling = self.problem.scaling
        floor = abs(state.load_factor or 1.0) / scaling.load_factor(1.0)
        if state.mechanism is None:
            return floor
        rates = self.problem.statics.relative_rates(state.mechanism / scaling.mechanism(_ONES))
        return max(floor, float(np.abs(rates[:, COLUMN["MT"]]).max()))


_ONES = np.ones(6)


def _predicted(gains: Sequence[float]) -> float:
    """What is still to be gained, if gains go on to fall as the last two did."""
    before, last = gains[-2], max(gains[-1], 0.0)
    ratio = last / before if 0.0 < before < np.inf else _FIRST_RATIO
    ratio = min(max(ratio, 0.0), 1.0)
    return np.inf if ratio >= 1.0 or not np.isfinite(last) else last * ratio / (1.0 - ratio)
