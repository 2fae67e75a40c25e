"""The convex problems that lead to a lower bound, solved and checked; no choice is made here.

Two kinds lie inside Eq. 30 (restrictions of it), so that every answer is a lower bound:

- *safe* steps (:mod:`safe_step`), built at a point of all contacts. Built at the last one's forces
  they contain them, so bounds do not fall;
- *frozen* ones: every contact is pressed exactly at a given centre, where Eq. 30 is convex as it
  stands, for any shape of contact.

The others lead the way, and are no bounds unless the checker accepts their forces:

- *long* steps are safe ones with a tenth of their curvature: they may exceed Eq. 30 by a little,
  and lead as far as two or three safe ones;
- *penalty* steps (of the penalty convex-concave procedure) may exceed Eq. 30 at a price;
- *box* and *hull* steps replace every contact's states by the convex hull of those pressed within
  a box (:mod:`boxes`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.bracket import known
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import Run, Solver
from cvxlimit.methods.interaction.readings.halves import Half
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.restriction.lower_bound import LowerBound, LowerBounds
from cvxlimit.methods.interaction.restriction.safe_step import SafeStep
from cvxlimit.methods.interaction.settings import PROOF, STEPS
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


@dataclass(frozen=True, eq=False)
class InnerIterate:
    """One solve on the way to a lower bound.

    Attributes
    ----------
    kind : {"safe", "frozen", "long", "penalty", "box", "hull"}
    state : LimitState
    slack : float
        Violation bought by a penalty step, over total load x contact size.
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


class SafeProblems:
    """All problems of one run under one reading; bounds go to ``run.best``.

    Parameters
    ----------
    run : Run
        Its ladder is for safe problems, gone down where one fails; None is loose solvers, then
        tight ones.
    gain : float
        Gain in the load factor, as a share of it, that counts.
    reductions : Reductions or None
        Those of the scene: where they have a mirror plane, steps stay among symmetric states.
    moments : Moments or None
        A reading that is stricter than the run's, whose checker has the last word; None is that.
    """

    def __init__(
        self,
        run: Run,
        gain: float,
        reductions: Reductions | None = None,
        moments: Moments | None = None,
    ) -> None:
        self.run, self.moments, self.contacts = run, moments or run.moments, run.contacts
        self.gain, self.start = gain, "middle"
        self.leading = run.ladder or leading_ladder()
        self.tight = run.ladder or tight_ladder()
        with run.clock.phase("compile"):
            self.half = None if reductions is None else Half.of(reductions, self.moments)
            self.step = SafeStep(run.assemblage, self.moments, self.half)
            self.hull = HullProblem(run.assemblage, self.half)
            self.checker = LowerBounds(run.assemblage, run.moments)
        self.middle = Point.middle(self.contacts)
        self._last: tuple[InnerIterate, str, Solver] | None = None

    def begin(self, start: str) -> float:
        """Note where a search begins; the bound that it has to beat."""
        self.start, self._last = start, None
        return self.run.best.bracket.lower

    def safe(self, point: Point) -> InnerIterate:
        """A safe step built at ``point``."""
        return self.restricted("safe", lambda rung: self.step.solve(point, rung), self.leading)

    def long(self, point: Point, curvature: float) -> InnerIterate:
        """A safe step with a share of its ``curvature``."""
        return self.solved(
            "long", lambda rung: self.step.solve(point, rung, None, curvature), self.leading
        )

    def penalty(self, point: Point, price: float) -> InnerIterate:
        """A step that may exceed Eq. 30 at a ``price``."""
        return self.solved(
            "penalty", lambda rung: self.step.solve(point, rung, price), self.leading
        )

    def frozen(self, centre: FloatArray) -> InnerIterate:
        """Contacts pressed at ``centre`` (n, 2), in fractions of the half extent."""
        copies = self.moments.safe_copies(self.contacts, centre)
        first = self.run.ladder or clarabel_at(STEPS.frozen)
        return self.restricted("frozen", lambda rung: self.hull.solve(copies, rung), first[:1])

    def relaxed(self, kind: str, copies: Copies) -> InnerIterate:
        """The best over ``copies``, which are as safe as they are."""
        return self.solved(kind, lambda rung: self.hull.solve(copies, rung), self.leading)

    def restricted(
        self, kind: str, solver: Solver, before: Sequence[SolverSettings] = ()
    ) -> InnerIterate:
        """A problem that should be safe, with each further rung where the checker refuses its
        forces: first with those given, then tightly."""
        for rung in (*before, *(rung for rung in self.tight if rung not in before)):
            iterate = self.solved(kind, solver, (rung,))
            if iterate.is_safe or iterate.state.outcome.claims_no_optimum:
                break
        if iterate.is_safe and iterate.lower >= self.run.best.bracket.lower:
            self._last = (iterate, kind, solver) if rung in self.leading else None
        return iterate

    def tightened(self) -> Iterator[InnerIterate]:
        """The problem of the best bound once more, if solving it loosely cost something."""
        if self._last is None:
            return
        iterate, kind, solver = self._last
        factor = iterate.state.load_factor
        if factor is not None and factor - iterate.lower > STEPS.lost * self.gain * abs(factor):
            yield self.solved(kind, solver, self.tight)

    def solved(self, kind: str, solver: Solver, ladder: Sequence[SolverSettings]) -> InnerIterate:
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
        label = f"{rung}, {kind} step from the {self.start}"
        self.run.note(state, label, **self.run.bounds, **figures)
        return InnerIterate(kind, state, getattr(state, "slack", 0.0), bound)

    def point(self, forces: FloatArray, otherwise: Point | None = None) -> Point:
        """Where to build a step at ``forces`` (n, 6); idle contacts keep their place."""
        point = self.step.point(forces, otherwise or self.middle, PROOF.pressed)
        return point.shrunk(self.moments.shrink)

    def fastest_twist(self, state: LimitState) -> float:
        """Largest twist rate at a contact, scaled; at least the scaled load factor."""
        scaling = self.step.scaling
        floor = abs(state.load_factor or 1.0) / scaling.load_factor(1.0)
        if state.mechanism is None:
            return floor
        rates = state.mechanism / scaling.mechanism(np.ones(6))
        twist = self.step.statics.relative_rates(rates)[:, COLUMN["MT"]]
        return max(floor, float(np.abs(twist).max()))
