"""The way to admissible forces with signed moments: boxes, and safe problems where they lead."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import Contacts
from cvxlimit.methods.driver import Run, Solver
from cvxlimit.methods.interaction.climb.boxes import Boxes
from cvxlimit.methods.interaction.climb.lower_bound import LowerBound
from cvxlimit.methods.interaction.climb.safe_step import SafeStep
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.methods.interaction.states.majorants import Point
from cvxlimit.solvers import LimitState, SolverSettings

FloatArray = NDArray[np.float64]

_FIRST_BOX = 0.8
"""First boxes about given pressure centres, in half sides to either side."""

_EXPLORING, _SETTLING = 8, 12
"""Boxes that explore, and those that only shrink: see :mod:`boxes`."""

_NEARLY = 3e-2
"""Excess of Eq. 30, summed over contacts and over the total load, from which frozen problems follow
boxes: on S12 the first bound is then 0.1 % below the last one. At 1e-2 it comes three boxes later,
and the last one is as good: 0.17449 after 21 solves and 12.6 s, 0.17448 after 25 and 15 s."""

_SETTLED = 1e-2
"""The same for climbs that follow boxes with independent signs; on 14 random walls they end 0.02 %
lower from 3e-2, and no higher from 1e-3."""

_RETRY = 0.5
"""Share of that excess at which safe problems are tried again after they gave no bound."""

_NOISE = 2e-5
"""Largest excess of a contact, over the total load, that may be due to loose solves alone."""


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


class Steps(Protocol):
    """What boxes need of :class:`cvxlimit.methods.interaction.climb.inner.InnerMethod`."""

    run: Run
    moments: Moments
    contacts: Contacts
    problem: SafeStep
    gain: float
    leading: tuple[SolverSettings, ...]

    @property
    def hull(self) -> HullProblem:
        """Problems over copies."""

    def copied(self, kind: str, copies: Copies, ladder: Sequence[SolverSettings]) -> InnerIterate:
        """The best over ``copies``."""

    def frozen(self, centre: FloatArray) -> InnerIterate:
        """Contacts pressed at ``centre`` (n, 2)."""

    def safe(self, kind: str, solver: Solver, before: Sequence[SolverSettings]) -> InnerIterate:
        """A safe problem, with each further rung where the checker refuses its forces."""

    def point(self, forces: FloatArray, otherwise: Point | None = None) -> Point:
        """Where to build a step at ``forces`` (n, 6)."""


class BoxClimb:
    """Box steps (:mod:`boxes`), and the safe problems that follow them, of one method.

    Parameters
    ----------
    to : Steps
        What solves the problems and keeps the bounds.
    """

    def __init__(self, to: Steps) -> None:
        self.to, self._freezes = to, True

    def boxes(self, forces: FloatArray | None) -> Boxes:
        """The first boxes: about ``forces`` (n, 6), or whole contacts."""
        force = self.to.problem.scaling.force
        if forces is None:
            return Boxes(self.to.contacts, self.to.moments, force)
        return Boxes(self.to.contacts, self.to.moments, force, forces, _FIRST_BOX)

    def narrowing(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Hulls over boxes alone, until the last one's forces nearly satisfy Eq. 30."""
        boxes = self.boxes(start)
        for number in range(1, _EXPLORING + _SETTLING + 1):
            iterate = self.to.copied("box", boxes.copies, self.to.leading)
            yield iterate
            if iterate.state.forces is None:
                return
            boxes.follow(iterate.state.forces, exploring=number < _EXPLORING)
            if boxes.excess <= _SETTLED and number >= _EXPLORING:
                return

    def iterates(self, start: FloatArray | None) -> Iterator[InnerIterate]:
        """Hulls over boxes of pressure centres, and what is safe near the last ones."""
        boxes, best, nearly, explored = self.boxes(start), -np.inf, _NEARLY, 0
        for _ in range(_EXPLORING + _SETTLING):
            copies = boxes.copies
            iterate = self.to.copied("box", copies, self.to.leading)
            yield iterate
            state = iterate.state
            if state.forces is None or state.load_factor is None:
                return
            explored += 1
            exploring = explored < _EXPLORING and not self._is_upper(state.load_factor)
            explored = explored if exploring else _EXPLORING
            boxes.follow(state.forces, exploring=exploring)
            if boxes.excess > nearly and not iterate.is_safe:
                continue
            lower = iterate.lower
            for nearby in self._nearby(boxes, copies, state.forces):
                yield nearby
                lower = max(lower, nearby.lower)
            least = self.to.gain * abs(lower)
            if lower - best < least or state.load_factor - lower < least:
                return
            best, nearly = max(best, lower), _RETRY * boxes.excess

    def _nearby(self, boxes: Boxes, copies: Copies, forces: FloatArray) -> Iterator[InnerIterate]:
        """The frozen problem at the boxes' centres. Where that has no interior, as where forces
        are determinate: the box problem itself, tightly, if all that keeps its forces from being
        admissible is how it was solved; else a hard step at them."""
        if self._freezes:
            frozen = self.to.frozen(boxes.centre)
            yield frozen
            self._freezes = frozen.is_safe
            if frozen.is_safe:
                return
        if boxes.largest <= _NOISE:
            tight = self.to.safe("box", lambda rung: self.to.hull.solve(copies, rung), ())
            yield tight
            if tight.is_safe:
                return
        point = self.to.point(forces)
        yield self.to.safe("hard", lambda rung: self.to.problem.solve(point, rung), ())

    def _is_upper(self, load_factor: float) -> bool:
        """True if no box could have more."""
        upper = self.to.run.best.bracket.upper
        return upper - load_factor < self.to.gain * abs(upper)
