"""Searches for a lower bound with interaction, from several starts.

Which problems there are is in :mod:`problems`. Where searches end depends on where they begin, and
how fast on the length of their steps: from a relaxation long steps lead before safe ones follow,
from the middle of all contacts penalty steps, and with torsion about the pressure centre boxes.
Problems are solved loosely; what a bound lost by that is won back by one solve at the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.methods.driver import Run
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.relaxation.upper import UpperBound
from cvxlimit.methods.interaction.restriction.boxes import Boxes, narrowing, settling
from cvxlimit.methods.interaction.restriction.problems import InnerIterate, SafeProblems
from cvxlimit.methods.interaction.settings import STEPS
from cvxlimit.methods.interaction.states.majorants import Point
from cvxlimit.reductions.choice import Reductions


class InnerMethod:
    """Searches of one run; :meth:`iterates` may be called for several starts.

    Bounds that the checker accepts go to ``run.best``, every solve into the run's history.

    Parameters
    ----------
    run : Run
    max_iterations : int
        Solves per start, at most.
    gain : float
        Safe steps, or frozen problems between boxes, end when one gains less than this share of
        the load factor.
    reductions : Reductions or None
        Those of the scene: where they have a mirror plane, steps stay among symmetric states.
    moments : Moments or None
        A reading that is stricter than the run's, to search in; None is the run's.

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
        max_iterations: int = 24,
        gain: float = 1e-4,
        reductions: Reductions | None = None,
        moments: Moments | None = None,
    ) -> None:
        self.run, self.max_iterations, self.reductions = run, max_iterations, reductions
        self.problems = SafeProblems(run, gain, reductions, moments)
        self.middle, self._mark = self.problems.middle, -np.inf

    def iterates(self, start: FloatArray | None = None) -> Iterator[InnerIterate]:
        """All solves in order, lazily; stop taking them when the bound is good enough.

        ``start`` (n, 6) are forces to begin at, those of a relaxation from above for example,
        whether or not they are admissible; None begins at the middle of the contacts.
        """
        self._mark = self.problems.begin("middle" if start is None else "relaxation")
        by_boxes = self.problems.moments.way == "boxes"
        way = self._settled(start) if by_boxes else self._stepped(start)
        yield from islice(way, self.max_iterations)
        yield from self.problems.tightened()

    def narrowed(self, start: FloatArray | None = None) -> Iterator[InnerIterate]:
        """Boxes about ``start`` (n, 6) that shrink until their forces nearly satisfy Eq. 30, and
        steps from there: slower than :meth:`iterates`, and on irregular walls often higher."""
        self._mark = self.problems.begin("boxes")
        yield from islice(self._narrowed(start), self.max_iterations)
        yield from self.problems.tightened()

    def borrowed(self, stricter: Moments) -> Iterator[InnerIterate]:
        """Solves in a stricter reading, whose forces are admissible in this one too, where they
        could be better than the best: its relaxation says so."""
        run, problems = self.run, self.problems
        problems.begin(f"{stricter} relaxation")
        relaxed = problems.relaxed("hull", stricter.box_copies(run.contacts))
        yield relaxed
        state = relaxed.state
        if state.forces is None or state.load_factor is None:
            return
        if state.load_factor <= run.best.bracket.lower:
            return
        other = InnerMethod(
            run, self.max_iterations, problems.gain, self.reductions, moments=stricter
        )
        aside = run.aside()
        aside.moments = stricter
        outer = UpperBound(aside, other.problems.half)
        outer.search(STEPS.relaxed, (*problems.leading, *problems.tight))
        near = outer.state.forces if outer.state else state.forces
        for start in (near, None):
            yield from other.iterates(start)
        if "boxes" in stricter.starts and len(run.contacts) <= STEPS.most_boxed:
            yield from other.narrowed(near)

    def _narrowed(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        point = self.middle
        for iterate in narrowing(self.problems, start):
            yield iterate
            state = iterate.state
            if state.forces is None or state.load_factor is None:
                break
            if state.load_factor <= self._mark:
                return
            point = self.problems.point(state.forces, point)
        yield from self.climb(point)

    def _stepped(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Safe steps, after others that lead there; they know rectangles only, so contacts of other
        shapes get a frozen problem at the end."""
        if start is None:
            yield from self._after_penalties()
        else:
            yield from self._after_long(self.problems.point(start).shrunk(STEPS.inward))
        best = self.run.best.forces
        if not (best is None or self.run.contacts.is_rectangle.all()):
            yield self.problems.frozen(Boxes.first(self.problems, best).centre)

    def _settled(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        point, has_bound = self.middle, False
        for iterate in settling(self.problems, start):
            yield iterate
            has_bound = has_bound or iterate.is_safe
            if iterate.state.forces is not None:
                point = self.problems.point(iterate.state.forces, point)
        if not has_bound:
            yield from self.climb(point)

    def climb(self, point: Point, reach: float | None = None) -> Iterator[InnerIterate]:
        """Safe steps, each at the last one's forces or ahead of them by ``reach`` (None: as the
        moments have it), until they gain little, or could not reach the best bound."""
        reach = self.problems.moments.reach if reach is None else reach
        best, before, retreats, gains = -np.inf, None, iter(STEPS.retreats), [np.inf]
        here = at = point
        while True:
            iterate = self.problems.safe(at)
            yield iterate
            forces = iterate.state.forces
            if forces is None or not iterate.is_safe:
                share = next(retreats, None)
                if share is None:
                    return
                here = here if forces is None else self.problems.point(forces, at)
                at, reach, before = here.shrunk(share), 0.0, None
                continue
            gain, best = iterate.lower - best, max(best, iterate.lower)
            gains.append(gain)
            if gain > 0.0:
                here = self.problems.point(forces, at)
            least, hope = self.problems.gain * abs(iterate.lower), _predicted(gains)
            if gain < least and (reach == 0.0 or (gain > 0.0 and hope < least)):
                return
            if best + STEPS.hope * hope < self._mark:
                return
            reach = reach if gain > 0.0 else 0.0
            at = here if before is None or reach == 0.0 else self._ahead(here, before, reach)
            before = here

    def _ahead(self, here: Point, before: Point, reach: float) -> Point:
        return here.moved(reach, before).inside(self.problems.step.statics.contacts)

    def _after_long(self, point: Point) -> Iterator[InnerIterate]:
        first = self.problems.safe(point)
        yield first
        if first.state.forces is not None and first.is_safe:
            point, best = self.problems.point(first.state.forces, point), first.lower
            for curvature in STEPS.long:
                iterate = self.problems.long(point, curvature)
                yield iterate
                state = iterate.state
                if state.forces is None or state.load_factor is None:
                    break
                point = self.problems.point(state.forces, point)
                if state.load_factor - best < STEPS.long_gain * abs(best):
                    break
                best = state.load_factor
        yield from self.climb(point)

    def _after_penalties(self) -> Iterator[InnerIterate]:
        """A safe step at the middle, whose mechanism prices slack, penalty steps at a price that
        grows until nothing is bought, then safe ones."""
        first = self.problems.safe(self.middle)
        yield first
        price = STEPS.price * self.problems.fastest_twist(first.state)
        point, last = self.middle, np.inf
        for number in range(STEPS.penalty_steps):
            iterate = self.problems.penalty(point, price)
            yield iterate
            if iterate.state.forces is None:
                break
            point = self.problems.point(iterate.state.forces, point)
            if iterate.slack <= STEPS.bought:
                break
            stuck = number > 0 and iterate.slack > 0.5 * last
            price *= STEPS.price_growth * (10.0 if stuck else 1.0)
            last = iterate.slack
        yield from self.climb(point)


def _predicted(gains: Sequence[float]) -> float:
    before, last = gains[-2], max(gains[-1], 0.0)
    ratio = last / before if 0.0 < before < np.inf else STEPS.first_ratio
    ratio = min(max(ratio, 0.0), 1.0)
    return np.inf if ratio >= 1.0 or not np.isfinite(last) else last * ratio / (1.0 - ratio)
