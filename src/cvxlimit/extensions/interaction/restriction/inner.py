"""Searches for a lower bound: from a relaxation long steps lead before safe ones follow, from the
middle of all contacts penalty steps, and with torsion about the pressure centre boxes.

Problems are solved loosely; what a bound lost by that is won back by one solve at the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from itertools import islice

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.interaction.relaxation.upper import UpperBound
from cvxlimit.extensions.interaction.restriction.problems import InnerIterate, SafeProblems
from cvxlimit.extensions.interaction.settings import BRACKET, CLIMB, PROOF
from cvxlimit.extensions.interaction.states.disjuncts import Disjuncts
from cvxlimit.extensions.interaction.states.majorants import Point
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.extensions.interaction.states.support import whole_boxes
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.pressure import centres
from cvxlimit.solution.bracket import TOLERANCE
from cvxlimit.solvers.ladders import LEADING, MANY

WHOLE = 2.0
"""Half width of a box that is the whole contact, from wherever in it the pressure acts."""


class Boxes:
    """Boxes of pressure centres about those of ``forces`` (n, 6), or of whole contacts.

    The smaller a box, the less states in its hull exceed Eq. 30. So boxes shrink where the last
    relaxation's forces exceed it, and only there; while the way is open (*exploring*) others even
    grow. ``centre`` (n, 2) and ``size`` (n,) to either side are fractions of :func:`half_extent`;
    ``excess`` and ``largest`` that of the last forces, over ``force``, in all and at the worst.
    """

    def __init__(
        self,
        contacts: Contacts,
        moments: Moments,
        force: float,
        forces: FloatArray | None,
        first: float = CLIMB.first,
    ) -> None:
        self.contacts, self.moments, self.force = contacts, moments, force
        self.size = np.full(len(contacts), WHOLE if forces is None else first)
        self.centre = np.zeros((len(contacts), 2))
        self.excess = self.largest = np.inf
        if forces is not None:
            self._move(forces)

    @property
    def disjuncts(self) -> Disjuncts:
        reach = self.size[:, None]
        ends = np.stack([self.centre - reach, self.centre + reach], axis=2)
        return states_of(self.moments).box_disjuncts(self.contacts, np.clip(ends, -1.0, 1.0))

    def follow(self, forces: FloatArray, *, exploring: bool) -> None:
        over = np.maximum(self.moments.excess(forces, self.contacts), 0.0) / self.force
        self.excess, self.largest = float(over.sum()), float(over.max())
        self._move(forces)
        shrink, growth = (CLIMB.shrink, CLIMB.growth) if exploring else (CLIMB.settle, 1.0)
        factor = np.where(over > LEADING, shrink, growth)
        self.size = np.minimum(factor * self.size, WHOLE)

    def _move(self, forces: FloatArray) -> None:
        pressed = forces[:, [COLUMN["N"]]] > PROOF.accepted * self.force  # idle ones keep theirs
        self.centre = np.where(pressed, centres(forces, self.contacts), self.centre)


class InnerMethod(SafeProblems):
    """Searches of one run, each of ``max_iterations`` solves at most; :meth:`iterates` may be
    called for several starts. Boxes about one begin with a half width of ``first``."""

    _mark = -np.inf
    first: float = CLIMB.first

    def within(self, first: float) -> InnerMethod:
        """The same searches, in boxes of another half width at first."""
        result = copy(self)
        result.first = first
        return result

    @property
    def has_others(self) -> bool:
        """True where contacts are not all rectangles."""
        return not self.run.contacts.is_rectangle.all()

    @property
    def starts(self) -> tuple[str, ...]:
        """Where searches begin unless they are told. Safe steps know rectangles only, so boxes come
        first where contacts have other shapes."""
        every, count = states_of(self.moments).starts, len(self.run.contacts)
        if self.has_others and count > BRACKET.few:
            return tuple(dict.fromkeys(("boxes", *every)))
        return tuple(s for s in every if s != "boxes" or count <= MANY)

    def begun(self, start: str, relaxed: FloatArray | None) -> Iterator[InnerIterate]:
        """The search from one of the ``starts``; ``relaxed`` are a relaxation's forces."""
        if start == "boxes":
            return self.narrowed(relaxed)
        return self.iterates(None if start == "middle" else relaxed)

    def iterates(self, start: FloatArray | None = None) -> Iterator[InnerIterate]:
        """All solves, lazily, from forces (n, 6), admissible or not, or the contacts' middle.
        With Eq. 27 frozen problems rarely have states; on polygons boxes lead farther."""
        way = self._stepped(start)
        if self.moments.is_about_centre and self.contacts.is_rectangle.all():
            is_limited = self.moments.is_limited
            way = self._narrowed(start, *CLIMB.limited) if is_limited else self._settled(start)
        return self._search("middle" if start is None else "relaxation", way)

    def narrowed(self, start: FloatArray | None = None) -> Iterator[InnerIterate]:
        """Boxes that shrink until their forces nearly satisfy Eq. 30, and steps from there: slower
        than :meth:`iterates`, and on irregular walls often higher."""
        schedule = CLIMB.others if self.has_others else ()
        return self._search("boxes", self._narrowed(start, *schedule))

    def from_stricter_reading(self, stricter: Moments) -> Iterator[InnerIterate]:
        run = self.run
        self.begin(f"{stricter} relaxation")
        whole = whole_boxes(run.contacts)
        relaxed = self.relaxed("hull", states_of(stricter).box_disjuncts(run.contacts, whole))
        yield relaxed
        near = relaxed.state.forces
        if near is None or relaxed.load_factor <= run.best.bracket.lower:
            return
        other = InnerMethod(run, self.max_iterations, self.gain, self.reductions, stricter)
        auxiliary = run.auxiliary_run()
        auxiliary.moments = stricter
        outer = UpperBound(auxiliary, other.half)
        outer.search(BRACKET.outer, (*self.leading, *self.tight))
        near = outer.state.forces if outer.state else near
        for start in other.starts:
            yield from other.begun(start, near)

    def _search(self, start: str, way: Iterator[InnerIterate]) -> Iterator[InnerIterate]:
        self._mark = self.begin(start)
        yield from islice(way, self.max_iterations)
        yield from self.tightened()

    def _boxes(self, start: FloatArray | None) -> Boxes:
        return Boxes(self.contacts, self.moments, self.step.scaling.force, start, self.first)

    def _narrowed(
        self,
        start: FloatArray | None,
        exploring: int = CLIMB.exploring,
        settling: int = CLIMB.settling,
    ) -> Iterator[InnerIterate]:
        boxes, point, best = self._boxes(start), self.middle, -np.inf
        settled = CLIMB.frozen if self.has_others else CLIMB.settled
        for number in range(1, exploring + settling + 1):
            iterate = self.relaxed("box", boxes.disjuncts)
            yield iterate
            forces = iterate.state.forces
            if forces is None:
                break
            if iterate.load_factor <= self._mark:
                return
            point = self.point(forces, point)
            boxes.follow(forces, exploring=number < exploring)
            if number < exploring or boxes.excess > settled:
                continue
            if not self.has_others:
                break
            frozen = self.frozen(boxes.centre)
            yield frozen
            if frozen.is_safe and frozen.lower - best < self.gain * abs(frozen.lower):
                return
            best = max(best, frozen.lower)
        yield from self.improve(point)

    def _stepped(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Safe steps, after others that lead there; they know rectangles only, so contacts of other
        shapes get a frozen problem at the end."""
        if start is None:
            yield from self._after_penalties()
        else:
            yield from self._after_long(self.point(start).shrunk(CLIMB.inward))
        best = self.run.best.forces
        if best is not None and self.has_others:
            yield self.frozen(self._boxes(best).centre)

    def _settled(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Yields the solves of :meth:`_settling`; safe steps follow where none of them had a
        bound."""
        point, has_bound = self.middle, False
        for iterate in self._settling(start):
            yield iterate
            has_bound = has_bound or iterate.is_safe
            if iterate.state.forces is not None:
                point = self.point(iterate.state.forces, point)
        if not has_bound:
            yield from self.improve(point)

    def _settling(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        boxes = self._boxes(start)
        best, nearly, explored, freezes = -np.inf, CLIMB.nearly, 0, True
        for _ in range(CLIMB.exploring + CLIMB.settling):
            disjuncts = boxes.disjuncts
            iterate = self.relaxed("box", disjuncts)
            yield iterate
            forces, factor = iterate.state.forces, iterate.load_factor
            if forces is None:
                return
            upper = self.run.best.bracket.upper
            no_more = upper - factor < self.gain * abs(upper)  # in any boxes
            exploring = explored + 1 < CLIMB.exploring and not no_more
            explored = explored + 1 if exploring else CLIMB.exploring
            boxes.follow(forces, exploring=exploring)
            if boxes.excess > nearly and not iterate.is_safe:
                continue
            lower = iterate.lower
            for nearby in self._nearby(boxes, disjuncts, forces, freezes):
                yield nearby
                freezes = nearby.is_safe if nearby.kind == "frozen" else freezes
                lower = max(lower, nearby.lower)
            least = self.gain * abs(lower)
            if lower - best < least or factor - lower < least:
                return
            best, nearly = max(best, lower), boxes.excess

    def _nearby(
        self, boxes: Boxes, disjuncts: Disjuncts, forces: FloatArray, freezes: bool
    ) -> Iterator[InnerIterate]:
        """The frozen problem at the boxes' centres. Where that has no interior, as where forces are
        determinate: the box problem itself, tightly, if all that keeps its forces from being
        admissible is how it was solved; else a safe step at them."""
        if freezes:
            frozen = self.frozen(boxes.centre)
            yield frozen
            if frozen.is_safe:
                return
        if boxes.largest <= TOLERANCE:
            tight = self.restricted("box", lambda settings: self.hull.solve(disjuncts, settings))
            yield tight
            if tight.is_safe:
                return
        point = self.point(forces)
        yield self.restricted("safe", lambda settings: self.step.solve(point, settings), self.warm)

    def improve(self, point: Point, reach: float | None = None) -> Iterator[InnerIterate]:
        """Safe steps, each at the last one's forces or ahead of them by ``reach`` (None: as the
        moments have it), until they gain little, or could not reach the best bound."""
        reach = states_of(self.moments).reach if reach is None else reach
        best, before, retreats, gains = -np.inf, None, iter(CLIMB.retreats), [np.inf]
        here = at = point
        while True:
            iterate = self.safe(at)
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
            if best + hope < self._mark:
                return
            reach, at = reach if gain > 0.0 else 0.0, here
            if before is not None and reach > 0.0:
                at = here.moved(reach, before).inside(self.step.statics.contacts)
            before = here

    def _after_long(self, point: Point) -> Iterator[InnerIterate]:
        """A safe step at a point; if it has a bound, long steps with a share of the curvature while
        they gain enough; then safe steps from where they end."""
        first = self.safe(point)
        yield first
        if first.state.forces is not None and first.is_safe:
            point, best = self.point(first.state.forces, point), first.lower
            for curvature in CLIMB.long:
                iterate = self.leading_step("long", point, curvature=curvature)
                yield iterate
                if iterate.state.forces is None:
                    break
                point = self.point(iterate.state.forces, point)
                if iterate.load_factor - best < self.gain * abs(best):
                    break
                best = iterate.load_factor
        yield from self.improve(point)

    def _after_penalties(self) -> Iterator[InnerIterate]:
        """A safe step at the middle, whose mechanism prices slack, penalty steps at a price that
        grows until nothing is bought, then safe ones."""
        first = self.safe(self.middle)
        yield first
        price = CLIMB.price * self.fastest_twist(first.state)
        point, last = self.middle, np.inf
        for number in range(CLIMB.penalty_steps):
            iterate = self.leading_step("penalty", point, price)
            yield iterate
            if iterate.state.forces is None:
                break
            point = self.point(iterate.state.forces, point)
            if iterate.slack <= TOLERANCE:
                break
            stuck = number > 0 and iterate.slack > 0.5 * last
            price *= PROOF.growth * (10.0 if stuck else 1.0)
            last = iterate.slack
        yield from self.improve(point)


def _predicted(gains: Sequence[float]) -> float:
    """Returns how much further steps may gain in all, if gains go on to shrink by the last
    ratio."""
    before, last = gains[-2], max(gains[-1], 0.0)
    if not 0.0 < before < np.inf:
        before = 2.0 * last  # nothing to go by: as if gains were halved each time
    if not last < before < np.inf:
        return 0.0 if last == 0.0 else np.inf
    return last**2 / (before - last)  # the sum of a geometric series
