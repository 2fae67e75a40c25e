"""The convex problems that lead to a lower bound, solved and checked; no choice is made here.

The kinds of problems:

========  =====================================================================================
kind      what it is
========  =====================================================================================
safe      A step inside Eq. 30 (:mod:`majorants`). It contains the forces at which it is built,
          so that bounds do not fall.
frozen    Every contact is pressed exactly at a given centre, which is inside Eq. 30 as well.
long      A safe step with a tenth of its curvature.
penalty   A step that may exceed Eq. 30 at a price (penalty convex-concave procedure).
box       A problem over the convex hull of states pressed in a box around each contact's centre.
hull      The same over whole contacts.
========  =====================================================================================

Forces of the last four are bounds only where the checker accepts them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.interaction.halves import SymmetricHalf
from cvxlimit.extensions.interaction.relaxation.column_blocks import Halfway
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem
from cvxlimit.extensions.interaction.restriction.lower_bound import LowerBound, LowerBounds
from cvxlimit.extensions.interaction.restriction.pressed import PressedProblem
from cvxlimit.extensions.interaction.restriction.steps import SafeStep, StepState
from cvxlimit.extensions.interaction.settings import PROOF
from cvxlimit.extensions.interaction.states.disjuncts import Disjuncts
from cvxlimit.extensions.interaction.states.majorants import Point
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import Run, Solver
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.pressure import Pressure, half_extent
from cvxlimit.reductions.choice import Reductions
from cvxlimit.solution.bracket import known
from cvxlimit.solvers import LimitState, SolverSettings, ladder_for
from cvxlimit.surfaces import Conic

WARM_FROM = 200
"""Contacts from which on our own solver, which starts warm, takes steps first."""


@dataclass(frozen=True, eq=False)
class InnerIterate:
    """One solve: its ``kind`` as in the module's table, the solver's ``state``, and the ``bound``
    that the checker gave its forces; None without forces."""

    kind: str
    state: LimitState
    bound: LowerBound | None

    @property
    def load_factor(self) -> float:
        """The load factor that the solver returned; minus infinity without one."""
        return -np.inf if self.state.load_factor is None else self.state.load_factor

    @property
    def slack(self) -> float:
        """How much slack of Eq. 30 a penalty step has bought; zero for other kinds."""
        return self.state.slack if isinstance(self.state, StepState) else 0.0

    @property
    def lower(self) -> float:
        """The lower bound of the forces; minus infinity without one."""
        return -np.inf if self.bound is None else self.bound.value

    @property
    def is_safe(self) -> bool:
        """True if the checker accepts the forces."""
        return self.bound is not None and self.bound.is_accepted


class SafeProblems:
    """All problems of one run, whose bounds go to ``run.best``.

    Parameters
    ----------
    run : Run
        The run, whose reading of Eq. 30 the checker takes.
    max_iterations : int
        Most solves of a search.
    gain : float
        Smallest gain that counts, as a share of the load factor.
    reductions : Reductions or None
        Where they have a mirror plane, steps stay among symmetric states.
    moments : Moments or None
        A stricter reading for the problems; None takes the run's.
    """

    def __init__(
        self,
        run: Run,
        max_iterations: int = 24,
        gain: float = 1e-4,
        reductions: Reductions | None = None,
        moments: Moments | None = None,
    ) -> None:
        self.run, self.moments, self.contacts = run, moments or run.moments, run.contacts
        self.max_iterations, self.gain, self.reductions = max_iterations, gain, reductions
        self.start = "middle"
        # Ladders: for problems that only lead the way, for steps that start from the last one, and
        # for forces that count.
        self.leading = run.ladder or ladder_for("leading")
        is_warm = not run.ladder and len(run.contacts) >= WARM_FROM
        self.warm = ladder_for("steps") if is_warm else ()
        self.stepping = (*self.warm, *self.leading)
        self.tight = run.ladder or ladder_for("tight")
        with run.clock.phase("compile"):
            self.half = None if reductions is None else SymmetricHalf.of(reductions, self.moments)
            self.step = SafeStep(run.assemblage, self.moments, self.half)
            self.hull = HullProblem(run.assemblage, self.half)
            self.checker = LowerBounds(run.assemblage, run.moments)
        self.middle = Point.middle(self.contacts)
        self._last: tuple[InnerIterate, Solver] | None = None
        self._halfway: dict[str, Halfway] = {}

    def begin(self, start: str) -> float:
        """Begins a search from a named start, and returns the lower bound that it has to beat."""
        self.start, self._last = start, None
        return self.run.best.bracket.lower

    def safe(self, point: Point) -> InnerIterate:
        """Solves a safe step at a point, with one solver after the other until it is a bound."""
        return self.restricted(
            "safe", lambda settings: self.step.solve(point, settings), self.stepping
        )

    def leading_step(
        self, kind: str, point: Point, price: float | None = None, curvature: float = 1.0
    ) -> InnerIterate:
        """Solves a long or penalty step at a point: with a share of the ``curvature`` of a safe
        step, or with slack at a ``price``."""
        step = self.step
        return self.solved(kind, lambda r: step.solve(point, r, price, curvature), self.stepping)

    def frozen(self, centre: FloatArray) -> InnerIterate:
        """Solves the frozen problem at pressure centres (n, 2), fractions of the half extents."""
        frozen = self.pressed
        own = centre if self.half is None else centre[self.half.kept]
        at = Pressure.at(own * half_extent(frozen.contacts), frozen.contacts)
        # Further solvers have not been seen to help, and they cost as much as safe steps.
        inside = ladder_for("held centres") if self.warm else ()
        ladders = inside, self.tight[:1]
        return self.restricted(
            "frozen", lambda settings: frozen.solve(at, settings, True), *ladders
        )

    @cached_property
    def pressed(self) -> PressedProblem:
        """The frozen problem: stated once, its Parameters set to where contacts are pressed."""
        with self.run.clock.phase("compile"):
            restricted = None if self.half is None else self.half.reduction
            return PressedProblem(self.run.assemblage, Conic(), self.moments, restricted=restricted)

    def relaxed(self, kind: str, disjuncts: Disjuncts) -> InnerIterate:
        """Solves the problem over the hull of disjuncts, from where the last one of this kind was
        halfway."""
        return self.solved(
            kind, lambda settings: self._from_last(kind, disjuncts, settings), self.leading
        )

    def _from_last(self, kind: str, disjuncts: Disjuncts, settings: SolverSettings) -> LimitState:
        """Solves with one solver, and keeps the point halfway for the next problem of this kind."""
        state = self.hull.solve(disjuncts, settings, start=self._halfway.get(kind))
        if state.halfway is not None:
            self._halfway[kind] = state.halfway
        return state

    def restricted(
        self,
        kind: str,
        solver: Solver,
        before: Sequence[SolverSettings] = (),
        after: Sequence[SolverSettings] | None = None,
    ) -> InnerIterate:
        """Solves a problem whose forces should be a bound, with one solver after the other until
        the checker accepts them: first with the settings ``before``, then with those ``after``,
        which are the tight ones by default. Returns the last solve."""
        others = self.tight if after is None else after
        for settings in (*before, *(settings for settings in others if settings not in before)):
            iterate = self.solved(kind, solver, (settings,))
            if iterate.is_safe or iterate.state.outcome.claims_no_optimum:
                break
        if iterate.is_safe and iterate.lower >= self.run.best.bracket.lower:
            self._last = (iterate, solver) if settings not in self.tight else None
        return iterate

    def tightened(self) -> Iterator[InnerIterate]:
        """Yields the problem of the best bound solved tightly, if its loose solve cost much."""
        if self._last is None:
            return
        iterate, solver = self._last
        factor = iterate.load_factor
        if factor - iterate.lower > PROOF.most_of_width * self.gain * abs(factor):
            yield self.solved(iterate.kind, solver, self.tight)

    def solved(self, kind: str, solver: Solver, ladder: Sequence[SolverSettings]) -> InnerIterate:
        """Solves a problem down a ladder, has its forces checked, and notes both in the history."""
        state, settings = self.run.try_solvers(solver, ladder)
        bound, figures = None, {}
        if state.forces is not None and state.load_factor is not None:
            with self.run.clock.phase("certify"):
                bound = self.checker.of(state.forces, state.load_factor)
            self.run.best = bound.raising(self.run.best)
            figures = {
                "equilibrium_residual": known(bound.residual),
                "yield_excess": known(bound.excess),
            }
        label = f"{settings}, {kind} step from the {self.start}"
        self.run.note(state, label, **self.run.bounds, **figures)
        return InnerIterate(kind, state, bound)

    def point(self, forces: FloatArray, otherwise: Point | None = None) -> Point:
        """Returns the point at which to build a step at ``forces`` (n, 6), in the order V1, V2, N,
        M1, M2, MT. Contacts without compression keep their place in ``otherwise``."""
        point = self.step.point(forces, otherwise or self.middle, PROOF.accepted)
        return point.shrunk(states_of(self.moments).shrink)

    def fastest_twist(self, state: LimitState) -> float:
        """Returns the largest twist rate at a contact, scaled; at least the scaled load factor."""
        scaling = self.step.scaling
        floor = abs(state.load_factor or 1.0) / scaling.load_factor(1.0)
        if state.mechanism is None:
            return floor
        rates = state.mechanism / scaling.mechanism(np.ones(6))
        twist = self.step.statics.relative_rates(rates)[:, COLUMN["MT"]]
        return max(floor, float(np.abs(twist).max()))
