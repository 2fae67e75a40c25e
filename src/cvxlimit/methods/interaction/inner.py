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

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.interaction.copies import Copies, box_copies, safe_copies
from cvxlimit.methods.interaction.hull import HullProblem
from cvxlimit.methods.interaction.lower_bound import LowerBound, LowerBounds
from cvxlimit.methods.interaction.pressure import Pressure
from cvxlimit.methods.interaction.safe_step import Point, SafeStep
from cvxlimit.methods.interaction.support import half_extent
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings, default_ladder, settings_for

FloatArray = NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True)
class InnerSettings:
    """Settings of the safe steps; the defaults were chosen on the tuff wall, S12 and S10.

    Attributes
    ----------
    most : int
        Solves in all.
    gain : float
        A climb of hard steps, or of frozen ones between boxes, ends when one gains less than
        this share of the load factor.
    soft_steps : int
        Soft steps of an independent-sign start from the middle, at most.
    price, price_growth : float
        First price of slack, in units of the fastest twist at a contact (what a small slack is
        worth), and its factor per step.
    box, box_shrink : float
        First box of a signed start about the given pressure centres, in half sides to either
        side, and the factor from box to box.
    freeze : float
        Boxes of this size or less are followed by a frozen problem at their pressure centres.
    reach : float
        Hard steps with independent signs are built ahead of the last one's forces by this share
        of the last move, as long as that gains.

    Example
    -------
    >>> InnerSettings(most=4).gain
    0.0001
    """

    most: int = 24
    gain: float = 1e-4
    soft_steps: int = 4
    price: float = 0.7
    price_growth: float = 3.0
    box: float = 1.2
    box_shrink: float = 0.6
    freeze: float = 0.1
    reach: float = 1.0

    def __post_init__(self) -> None:
        if self.most < 1:
            raise ModelError(f"most must be at least 1 solve, got {self.most!r}")
        if not 0.0 < self.box_shrink < 1.0:
            raise ModelError(f"box_shrink must be between 0 and 1, got {self.box_shrink!r}")
        if not self.price_growth > 1.0:
            raise ModelError(f"price_growth must be above 1, got {self.price_growth!r}")
        if not self.freeze > 0.0:
            raise ModelError(f"freeze must be positive, got {self.freeze!r}")


_ROUGH, _TIGHT = 1e-6, 1e-9
"""Clarabel's tolerances for steps that only lead the way, and for bounds."""

_PRESSED = 1e-7
"""Compression, over the total load, from which a pressure centre means something."""

_SMALLEST_BOX = 1e-4
"""Boxes of pressure centres, in half sides, below which nothing is left to gain."""

_BOUGHT = 1e-5
"""Slack in all, over total load x contact size, that counts as none."""

_SIGNED_SHRINK = 0.005
"""Signed steps are built this share nearer to the middle than the last forces: pressed in a corner
or at full slip a contact's safe set has no interior, and solvers return inaccurate answers."""

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
    solver : str
    state : LimitState
        Load factor, forces, mechanism; compile and solve seconds are in ``state.outcome``.
    slack : float
        Violation bought by a soft step, over total load x contact size.
    bound : LowerBound or None
        What the checker made of the forces; None if there are none.
    """

    kind: str
    solver: str
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
    """Safe steps of one scene; :meth:`iterates` may be called for several starts.

    Parameters
    ----------
    scene : Scene
    moments : str
        ``"independent"`` or ``"signed"``.
    settings : InnerSettings
    ladder : sequence of SolverSettings or None
        For safe problems, climbed where one fails; None is Clarabel at 1e-9 for hard steps, then
        the default, and the default for frozen ones.
    progress : callable or None

    Attributes
    ----------
    best : LowerBound or None
        The largest accepted bound so far.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> method = InnerMethod(builtin_scene("single-block"), "signed")
    >>> found = [iterate.lower for iterate in method.iterates()]
    >>> round(method.best.value, 5)
    0.4
    """

    def __init__(
        self,
        scene: Scene,
        moments: str,
        settings: InnerSettings | None = None,
        ladder: Sequence[SolverSettings] | None = None,
        progress: Progress | None = None,
    ) -> None:
        if moments not in _BALANCE:
            raise ModelError(f"moments must be 'independent' or 'signed', got {moments!r}")
        self.scene, self.moments = scene, moments
        self.settings = settings or InnerSettings()
        self.ladder = tuple(ladder or (_clarabel(_TIGHT), *default_ladder()))
        self.frozen_ladder = tuple(ladder or default_ladder())
        self.tell = progress or (lambda message: None)
        self.step = SafeStep(scene, moments, _BALANCE[moments])
        self.checker = LowerBounds(scene, moments)
        self.middle = Point.middle(self.step.statics.contacts)
        self.best: LowerBound | None = None
        self._solves = 0

    def iterates(self, start: FloatArray | None = None) -> Iterator[InnerIterate]:
        """All solves in order, lazily; stop taking them when the bound is good enough.

        ``start`` (n, 6) are forces to begin at, those of a relaxation from above for example,
        whether or not they are admissible; None begins at the middle of the contacts.
        """
        self._solves = 0
        ways = self._signed_ways(start) if self.moments == "signed" else self._ways(start)
        for iterate in ways:
            yield iterate
            if self._solves >= self.settings.most:
                return

    def _ways(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        yield from self._softened() if start is None else self._climb(self._point(start))
        if self.best is not None and not self.scene.contacts.is_rectangle.all():
            yield self._frozen(self._centre(self.best.forces, self._no_centre))

    def _signed_ways(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Boxes and frozen problems; hard steps only where those gave no bound."""
        point, has_bound = self.middle, False
        for iterate in self._boxed(start):
            yield iterate
            has_bound = has_bound or iterate.is_safe
            if iterate.state.forces is not None:
                point = self._point(iterate.state.forces, point)
        if not has_bound:
            yield from self._climb(point)

    def _climb(self, point: Point) -> Iterator[InnerIterate]:
        """Hard steps, each at the last one's forces or ahead of them, until they gain little."""
        reach = self.settings.reach if self.moments == "independent" else 0.0
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
            if gain < self.settings.gain * abs(iterate.lower):
                if reach == 0.0:
                    return
                reach = 0.0
            at = here if before is None or reach == 0.0 else self._ahead(here, before, reach)
            before = here

    def _ahead(self, here: Point, before: Point, reach: float) -> Point:
        return here.moved(reach, before).inside(self.step.statics.contacts)

    def _softened(self) -> Iterator[InnerIterate]:
        """A hard step at the middle, whose mechanism prices slack, then soft ones, then a climb."""
        first = self._hard(self.middle)
        yield first
        price = self.settings.price * self._fastest_twist(first.state)
        point, last = self.middle, np.inf
        for number in range(self.settings.soft_steps):
            iterate = self._soft(point, price)
            yield iterate
            if iterate.state.forces is None:
                break
            point = self._point(iterate.state.forces, point)
            if iterate.slack <= _BOUGHT:
                break
            stuck = number > 0 and iterate.slack > 0.5 * last
            price *= self.settings.price_growth * (10.0 if stuck else 1.0)
            last = iterate.slack
        yield from self._climb(point)

    def _boxed(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Hulls over shrinking boxes of pressure centres, and frozen problems at the last ones."""
        contacts, centre = self.scene.contacts, self._no_centre
        size, best = 1.0, -np.inf
        if start is not None:
            centre, size = self._centre(start, centre), self.settings.box
        while size > _SMALLEST_BOX:
            ends = np.stack([centre - size, centre + size], axis=2)
            copies = box_copies(contacts, self.moments, np.clip(ends, -1.0, 1.0))
            iterate = self._copied("box", copies, (_clarabel(_ROUGH),))
            yield iterate
            if iterate.state.forces is None:
                return
            centre = self._centre(iterate.state.forces, centre)
            if size <= self.settings.freeze:
                iterate = self._frozen(centre)
                yield iterate
                if iterate.lower - best < self.settings.gain * abs(iterate.lower):
                    return
                best = max(best, iterate.lower)
            size *= self.settings.box_shrink

    def _hard(self, point: Point) -> InnerIterate:
        for solver in self.ladder:
            state = self.step.solve(point, solver, None)
            if state.forces is not None or state.outcome.claims_no_optimum:
                break
        return self._booked("hard", solver, state, 0.0)

    def _soft(self, point: Point, price: float) -> InnerIterate:
        state = self.step.solve(point, _clarabel(_ROUGH), price)
        return self._booked("soft", _clarabel(_ROUGH), state, state.slack)

    def _frozen(self, centre: FloatArray) -> InnerIterate:
        copies = safe_copies(self.scene.contacts, self.moments, centre)
        return self._copied("frozen", copies, self.frozen_ladder)

    def _copied(self, kind: str, copies: Copies, ladder: Sequence[SolverSettings]) -> InnerIterate:
        for solver in ladder:
            state = self._hull.solve(copies, solver)
            if state.forces is not None or state.outcome.claims_no_optimum:
                break
        return self._booked(kind, solver, state, 0.0)

    @cached_property
    def _hull(self) -> HullProblem:
        return HullProblem(self.scene)

    def _booked(
        self, kind: str, solver: SolverSettings, state: LimitState, slack: float
    ) -> InnerIterate:
        bound = None
        if state.forces is not None and state.load_factor is not None:
            bound = self.checker.of(state.forces, state.load_factor)
            if bound.is_accepted and (self.best is None or bound.value > self.best.value):
                self.best = bound
        self._solves += 1
        iterate = InnerIterate(kind, str(solver), state, slack, bound)
        safe = f"at least {iterate.lower:.6f}" if iterate.is_safe else "not a bound"
        self.tell(f"{kind} step {self._solves}: {safe}")
        return iterate

    def _point(self, forces: FloatArray, otherwise: Point | None = None) -> Point:
        point = self.step.point(forces, otherwise or self.middle, _PRESSED)
        return point.shrunk(_SIGNED_SHRINK) if self.moments == "signed" else point

    def _centre(self, forces: FloatArray, otherwise: FloatArray) -> FloatArray:
        """Pressure centres (n, 2) as fractions of the half extent; idle contacts keep theirs."""
        contacts = self.scene.contacts
        at = Pressure.of(forces, contacts)
        centre = np.stack([at.e1, at.e2], axis=1) / half_extent(contacts)
        pressed = forces[:, [COLUMN["N"]]] > _PRESSED * self.step.scaling.force
        return np.where(pressed, np.clip(centre, -1.0, 1.0), otherwise)

    @cached_property
    def _no_centre(self) -> FloatArray:
        return np.zeros((len(self.scene.contacts), 2))

    def _fastest_twist(self, state: LimitState) -> float:
        """Largest twist rate at a contact, scaled; at least the scaled load factor."""
        scaling = self.step.scaling
        floor = abs(state.load_factor or 1.0) / scaling.load_factor(1.0)
        if state.mechanism is None:
            return floor
        rates = self.step.statics.relative_rates(state.mechanism / scaling.mechanism(_ONES))
        return max(floor, float(np.abs(rates[:, COLUMN["MT"]]).max()))


_BALANCE = {"independent": 2.0, "signed": 1.0}
"""k^2 of the product bounds by moment convention, over (half side / friction)."""

_ONES = np.ones(6)


def _clarabel(tolerance: float) -> SolverSettings:
    return settings_for("CLARABEL", tolerance, f"CLARABEL {tolerance:g}", max_iter=100)


def safe_iterates(
    scene: Scene,
    moments: str,
    settings: InnerSettings | None = None,
    start: FloatArray | None = None,
    ladder: Sequence[SolverSettings] | None = None,
    progress: Progress | None = None,
) -> Iterator[InnerIterate]:
    """All iterates of :class:`InnerMethod` from one start, lazily."""
    yield from InnerMethod(scene, moments, settings, ladder, progress).iterates(start)
