"""The certified answer with interaction: a bracket proved from below and from above.

The condition of Eq. 30 is not convex, so no single convex problem gives the collapse load factor.
Forces that satisfy it exactly bound the factor from below (:mod:`inner`), a mechanism checked
against the convex hull of every contact's true states bounds it from above (:mod:`hull`), and on
scenes of a few contacts branch and bound closes what is left (:mod:`branching`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cvxlimit.bracket import rounded_up
from cvxlimit.checks import count, not_negative, ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods.bearing import INSIDE, borne
from cvxlimit.methods.driver import Answer, Rule, Run, fallen
from cvxlimit.methods.interaction.branching import BranchAndBound
from cvxlimit.methods.interaction.hull import UpperBound
from cvxlimit.methods.interaction.inner import InnerMethod
from cvxlimit.methods.interaction.lower_bound import (
    ACCEPTED,
    LowerBounds,
    TrueStrength,
    central_states,
)
from cvxlimit.model.problem import LargestFactor, LimitProblem
from cvxlimit.reductions.choice import Reductions
from cvxlimit.reductions.reduction import ReducedProblem
from cvxlimit.scene import Load
from cvxlimit.solution import Status
from cvxlimit.solvers import SolverSettings, default_ladder, settings_for
from cvxlimit.surfaces.cones import Conic

FloatArray = NDArray[np.float64]

GOOD = 0.05
"""Relative width of the bracket that counts as an answer where no tolerance is asked for."""

_OUTER_TOLERANCE = 1e-4
"""Copies are added to contacts until that could lower the upper bound by no more than this; branch
and bound stops at it where no tolerance is asked for."""

_DEAD_TOLERANCE = 1e-5
"""The same for the question whether the dead load stands, where 1 / 2 decides."""

_QUICK = settings_for("CLARABEL", 1e-8, "CLARABEL 1e-08")
"""Enough for a bound that is certified anyway, and an eighth faster."""


@dataclass(frozen=True)
class Certified(Rule):
    """The certified method.

    ``load_factor`` and ``forces`` of its solution are those behind the lower bound, ``mechanism``
    that of the upper one; the history has both bounds as they stood after every solve.

    Attributes
    ----------
    tolerance : float or None
        Relative width of the bracket at which to stop. None narrows it as far as the other
        settings allow, and calls a bracket within 5 % certified.
    starts : tuple of {"relaxation", "middle"} or None
        Where the safe steps begin: at the forces of the relaxation from above, or at the middle
        of all contacts. The problem has local optima, so several starts help: with independent
        signs the tuff wall ends at 0.2579 from the relaxation and 0.2610 from the middle, S12 at
        0.12576 and 0.12562. None is both for independent signs, and for signed moments the
        relaxation, which was better on all built-in panels (tuff 0.3628 against 0.3602).
    solves : int
        Convex problems per start, at most.
    branching_contacts : int
        Scenes with no more contacts than this go on to branch and bound.
    branching_seconds : float
        Time for that.

    Example
    -------
    >>> Certified(tolerance=0.01).solves
    24
    """

    name = "certified"

    tolerance: float | None = None
    starts: tuple[str, ...] | None = None
    solves: int = 24
    branching_contacts: int = 6
    branching_seconds: float = 60.0

    def __post_init__(self) -> None:
        if isinstance(self.starts, str):
            object.__setattr__(self, "starts", (self.starts,))
        known = ("middle", "relaxation")
        if self.starts is not None and not (
            isinstance(self.starts, Sequence)
            and self.starts
            and all(start in known for start in self.starts)
        ):
            raise ModelError(
                f"starts must be 'middle' or 'relaxation', at least one, got {self.starts!r}"
            )
        if self.tolerance is not None:
            ratio(self.tolerance, "tolerance")
        count(self.solves, 1, "solves")
        count(self.branching_contacts, 0, "branching_contacts")
        not_negative(self.branching_seconds, "branching_seconds")

    def start(self, run: Run) -> _Proof:
        """Refuses faceted surfaces: the bounds are for the true condition, whose cone is circular.

        Raises
        ------
        ModelError
        """
        if not isinstance(run.cone, Conic):
            raise ModelError(
                f"the certified interaction bounds the true condition, not its {run.cone}: "
                "use surface 'conic', or the fixed point for facets"
            )
        return _Proof(self, run)

    def step(self, run: Run, state: _Proof) -> _Proof:
        """One solve, as a rule."""
        state.status = next(state.solves, None) or state.status
        return state

    def is_done(self, run: Run, state: _Proof) -> Status | None:
        """When the tolerance is met, or nothing is left to try."""
        return state.status

    def result(self, run: Run, state: _Proof) -> Answer:
        """The best of all solves, and what it rests on."""
        has_answer = state.status is None or state.status.has_answer
        return replace(run.best, note=state.basis() if has_answer else state.note)


class _Proof:
    """A certified run under way: its solves one by one, and how it ended."""

    def __init__(self, rule: Certified, run: Run) -> None:
        self.rule, self.run = rule, run
        self.solves = self._all()
        self.status: Status | None = None
        self.reason = self.note = ""

    def _all(self) -> Iterator[Status | None]:
        run = self.run
        outer = UpperBound(run)
        if self._is_planar(outer):
            yield Status.CERTIFIED
        # Where a wide bracket is asked for, half of it is left to the safe steps.
        tolerance = max(_OUTER_TOLERANCE, 0.5 * (self.rule.tolerance or 0.0))
        outer.search(tolerance, self._outer_ladder())
        yield None
        is_doubtful = run.best.mechanism is None or run.best.bracket.upper < 0.0
        if is_doubtful and self._cannot_stand():
            yield Status.DEAD_LOAD_UNSTABLE
        is_boundless = run.is_boundless(run.best.bracket.upper)  # without any it is infinite
        if is_boundless and self._is_harmless():
            yield Status.LIVE_LOAD_HARMLESS
        if run.best.mechanism is not None:
            yield from self._bound_from_below(outer)
            yield from self._branch()
            if run.best.bracket.is_below_zero and self._cannot_stand():
                yield Status.DEAD_LOAD_UNSTABLE
        good = run.best.bracket.is_within(self.rule.tolerance or GOOD)
        yield Status.CERTIFIED if good else Status.NOT_CERTIFIED

    def _is_planar(self, outer: UpperBound) -> bool:
        """True if the scene is planar and forces in its plane close the bracket.

        Torsion is zero there, so that Eq. 30 asks for little more than friction. Bounds are checked
        as all others are; nothing rests on the scene being planar.
        """
        run = self.run
        with run.clock.phase("compile"):
            found = Reductions.of(run.assemblage, run.surfaces, model=run.model)
            if found.plane is None:
                return False
            problem = ReducedProblem(found.assemblage, run.surfaces, found.whole)
        state, settings = run.climb(problem.solve, run.ladder or problem.ladder())
        if state.forces is None or state.mechanism is None or state.load_factor is None:
            return False
        outer.offer(state.mechanism)
        with run.clock.phase("certify"):
            bounds = LowerBounds(run.assemblage, run.moments)
            run.best = bounds.of(state.forces, state.load_factor).raising(run.best)
        run.note(state, settings, **run.bounds)
        if not run.best.bracket.is_within(self.rule.tolerance or _OUTER_TOLERANCE):
            return False
        run.reductions, self.reason = found.whole.names, "planar, without torsion"
        return True

    def _outer_ladder(self) -> tuple[SolverSettings, ...]:
        """A quick rung and the first regular ones: what they leave is far below the gap."""
        return self.run.ladder or (_QUICK, *default_ladder()[:2])

    def _bound_from_below(self, outer: UpperBound) -> Iterator[None]:
        run, method = self.run, InnerMethod(self.run, self.rule.solves)
        for name in self.rule.starts or run.moments.starts:
            at = outer.state.forces if name == "relaxation" and outer.state else None
            for _ in method.iterates(at):
                if run.best.bracket.width <= (self.rule.tolerance or 0.0):
                    self.reason = "the tolerance is met"
                    return
                yield None
        self.reason = "no further progress from these starts"

    def _branch(self) -> Iterator[None]:
        """Branch and bound on small scenes, where it closes the bracket."""
        run, asked = self.run, self.rule.tolerance or _OUTER_TOLERANCE
        is_small = len(run.contacts) <= self.rule.branching_contacts
        if not is_small or run.best.bracket.width <= asked:
            return
        end = run.clock.elapsed + self.rule.branching_seconds
        search = BranchAndBound(run, asked)
        while True:
            self.reason = f"branch and bound, {search.solves} problems"
            is_out_of_time = run.clock.elapsed > end
            if is_out_of_time or not search.can_go_on or run.best.bracket.is_below_zero:
                return
            yield None
            search.step()

    def _cannot_stand(self) -> bool:
        """True if no true states carry the dead load, with a mechanism that shows it.

        By homogeneity a load alone is carried as a whole or not at all; taken as live load it has
        a load factor of at most zero, or without bound. Where a single mechanism does not show it,
        an upper bound below zero does all the same: the dead load would be carried at zero.
        """
        run = self.run
        if not np.any(run.scene.dead_forces):
            return False
        alone = run.aside(run.scene.with_live(run.scene.dead).with_dead(Load()))
        UpperBound(alone).search(_DEAD_TOLERANCE, self._outer_ladder())
        if alone.best.bracket.upper < 0.5:
            rates = alone.best.mechanism
            run.best = replace(run.best, forces=None, mechanism=rates)
            if rates is not None:
                self.note = f"{fallen(run.scene, rates)}; {Status.DEAD_LOAD_UNSTABLE.advice}"
            return True
        bracket = run.best.bracket
        if not (bracket.is_below_zero and bracket.upper_is_proved):
            return False
        most = rounded_up(bracket.upper)
        self.note = f"{self.reason}: no load factor above {most} is carried at any eccentricities"
        return True

    def _is_harmless(self) -> bool:
        """True if forces carry the live load alone, strictly inside Eq. 30 where there are any.

        Eq. 30 is homogeneous: with them, every load factor beyond some finite one is carried.
        """
        run, scene = self.run, self.run.scene
        alone = run.assemblage.under(scene.with_dead(Load()))
        problem = LimitProblem(alone, objective=LargestFactor(most=1.0))
        state, _ = run.climb(problem.solve, self._outer_ladder())
        if state.forces is None or state.load_factor is None or state.load_factor < 0.5:
            return False
        with run.clock.phase("certify"):
            forces = borne(
                run.assemblage.under(scene.with_dead(scene.live)),
                lambda reached: TrueStrength(reached, run.moments),
                state.forces / state.load_factor,
                INSIDE,
                central_states,
            )
        if forces is None:
            return False
        run.best = replace(run.best, forces=forces, mechanism=None)
        self.note = Status.LIVE_LOAD_HARMLESS.advice
        return True

    def basis(self) -> str:
        """What the bounds rest on, in a sentence."""
        bracket = self.run.best.bracket
        if not np.isfinite(bracket.lower):
            lower = "no forces were found that satisfy Eq. 30"
        elif bracket.lower_is_proved:
            lower = "lower bound proved: its forces satisfy Eq. 30 to rounding"
        else:
            lower = (
                f"lower bound: its forces satisfy Eq. 30 to {ACCEPTED:.0e} of the total load, and "
                "what that is worth is taken off if no rate exceeds ten times the lightest block's"
            )
        upper = (
            "upper bound proved against the hull of all true states"
            if bracket.upper_is_proved
            else "upper bound if no contact force exceeds ten times the total load or the largest "
            "one found"
        )
        parts = [lower, upper, self.reason]
        if not self.run.contacts.is_rectangle.all():
            parts.append("contacts that are not rectangles: lower bound on inscribed rectangles")
        return "; ".join(part for part in parts if part)
