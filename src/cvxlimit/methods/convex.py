"""Without interaction: one convex problem, its bracket closed.

Solvers are tried until the bracket, which is recomputed outside them, is narrow enough. Stages, and
the methods of :class:`ConvexSearch` that they are::

    steps
      dead_load_is_unstable    forces that carry the dead load alone, or a mechanism
      (it stands)  _solve_with_fallback
                     _solvers_in_turn, with the reduced model, then with the full one
                       _attempt    one solver, its certificate, what it adds to run.best
                     _is_unbounded    whether there is a limit at all
      (it falls)   _interval
                     a part of the live load that holds the dead load
                     _solve_with_fallback, for the live load and for its opposite

Questions beside the load factor, of problems of their own, are put by
:class:`~cvxlimit.methods.aside.Aside`: loads alone, and whether contacts wedge each other.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np
from cvxpy.settings import OPTIMAL_INACCURATE

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import not_negative, ratio
from cvxlimit.methods.admitting import without_answer
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.aside import Aside
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.methods.standing import (
    about_the_lower_end,
    fallen,
    lower_end,
    refuse_an_interval,
    told,
)
from cvxlimit.methods.wedging import judged
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statics import DOF
from cvxlimit.reductions.choice import PLANAR_FROM
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, Certificate, known
from cvxlimit.solvers import LimitState, SolverSettings


@dataclass(frozen=True)
class Convex(Method):
    """One convex problem, solved until its bracket, recomputed outside the solver, is closed.

    Attributes
    ----------
    tolerance : float
        Relative width of the bracket.
    budget : float
        Seconds. Where a bracket is in hand, a further solver that is expected to take longer than
        all before it is only tried if it would end within them.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> solution = solve(builtin_scene("single-block"), method=Convex(tolerance=1e-6))
    >>> str(solution.status), solution.gap < 1e-6
    ('certified', True)
    """

    name = "convex"
    answers = "the load factor without interaction: one convex problem, its bracket closed"

    tolerance: float = TOLERANCE
    budget: float = 120.0

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        not_negative(self.budget, "budget")

    def steps(self, run: Run) -> Steps:
        run.tell(f"compiling {len(run.scene.free)} blocks x {len(run.contacts)} contacts")
        # solvers that take no cones need the plane of a planar scene, which has none
        has_cones = run.ladder is None or any(each.row.has_cones for each in run.ladder)
        least = PLANAR_FROM if has_cones else 0
        search = ConvexSearch(run, run.model, self.tolerance, self.budget, planar_from=least)
        status = yield from search.steps()
        return judged(run) if status is Status.UNBOUNDED else status


class ConvexSearch:
    """The search for the load factor of a scene without interaction.

    ``certifier`` keeps the reference states, ``run`` the best answer and the remarks; ``asked``
    keeps a question ``aside``, which costs a solve, from being put twice.

    Solvers see so much ``model``; the certificate is that of the full scene in any case. For
    ``tolerance`` and ``budget`` see :class:`Convex`, for ``planar_from`` :class:`Aside`. A
    ``problem`` is solved in place of a new one, with the reference states of its last certificate;
    it comes with ``model="full"``, since there is no other problem to fall back to.
    """

    def __init__(
        self,
        run: Run,
        model: str,
        tolerance: float = TOLERANCE,
        budget: float = np.inf,
        problem: LimitProgram | None = None,
        planar_from: int = 0,
    ) -> None:
        self.run, self.tolerance, self.budget = run, tolerance, budget
        self._given, self._planar_from = problem, planar_from
        self.asked: set[str] = set()
        self.without_duals: list[str] = []
        self.reference: tuple[FloatArray, float] | None = None
        self._use_model(model)

    def _use_model(self, model: str) -> None:
        """Sets problem, certifier and the questions aside for so much ``model``."""
        self.aside = Aside(self.run, model, self.tolerance, self._given, self._planar_from)
        self.reductions, self.certifier = self.aside.reductions, self.aside.certifier
        with self.run.clock.phase("certify"):
            if self.reference is not None:
                self.certifier.offer_dead_state(*self.reference)
            if self._given is not None and self._given.reference is not None:
                self.certifier.refer_to(self._given.reference)

    def steps(self) -> Steps:
        """Finds the load factor, or how it ends without one: see :class:`Method`."""
        if self.dead_load_is_unstable():
            return (yield from self._interval())
        if self.reductions.loaded is not None:  # the others are left out, as far as they stand
            stands = self.certifier.references.easy_dead_state
            self.aside.problem = self.aside.smallest_problem(stands)
        status = yield from self._solve_with_fallback()
        return (yield from self._interval()) if status is Status.DEAD_LOAD_UNSTABLE else status

    def _solve_with_fallback(self) -> Steps:
        """Tries all solvers with the model that suffices, then with the full one."""
        status = yield from self._solvers_in_turn()
        if status is None and self.run.reductions:  # none of it is believed: the full model decides
            self._use_model("full")
            status = yield from self._solvers_in_turn()
        if status is not None:
            return status
        best = self.run.best.bracket
        has_limit = best.upper_is_proved and not self.run.is_boundless(best.upper)
        if not has_limit and self._is_unbounded():
            return Status.UNBOUNDED
        if not best.has_any:
            self.run.remarks = [*self.run.remarks, *filter(None, [without_answer(self.run)])]
        return Status.NOT_CERTIFIED

    def _interval(self) -> Steps:
        """Finds both ends of the interval of load factors, where the dead load does not stand
        alone.

        The lower end is minus the largest factor of the live load turned round. Both brackets refer
        to one state inside, which carries a load factor of its own. If that is negative all are,
        since 0 is not one of them: no part of the live load helps then.
        """
        # The fall that led here is recorded in the run: its sentence is the last remark.
        run, (alone,) = self.run, self.run.remarks[-1:]
        before, held_by = (run.best, run.remarks), self.aside.held_by_live_load()
        if held_by.state is None or not held_by.factor > 0.0:
            run.remarks = [alone, held_by.remark] if held_by.remark else [alone]
            return Status.DEAD_LOAD_UNSTABLE
        # The upper end: the run begins anew, since the mechanism of the fall is none of this end.
        run.best, run.remarks = Answer(bracket=Bracket(least=run.scaling.least)), []
        self.refer_to(held_by.state, held_by.factor)
        status_up = yield from self._solve_with_fallback()
        # The lower end, with the live load turned round.
        dead, live = run.assemblage.statics.dead, run.assemblage.statics.live
        reversed_run = run.auxiliary_run(run.assemblage.under(dead, -live))
        reversed_search = ConvexSearch(
            reversed_run, run.model, self.tolerance, self.budget, planar_from=self._planar_from
        )
        reversed_search.refer_to(held_by.state, -held_by.factor)
        status_down = yield from reversed_search._solve_with_fallback()
        run.history += [about_the_lower_end(iterate) for iterate in reversed_run.history]
        lower = lower_end(reversed_run, held_by.factor)
        if run.best.bracket.upper < lower.bracket.lower - run.scaling.least:
            run.best, run.remarks = before  # each end excludes what the other one leaves
            return Status.DEAD_LOAD_UNSTABLE
        # Both ends in one answer; without an upper end there is no load factor to report.
        best = run.best
        if status_up is Status.UNBOUNDED:
            best = Answer(forces=best.forces)
        run.best = replace(best, lower_end=lower)
        run.remarks = [told(run.best, reversed_run.best.bracket, alone), *run.remarks]
        settled = Status.CERTIFIED, Status.UNBOUNDED
        is_settled = status_up in settled and status_down in settled
        return status_up if is_settled else Status.NOT_CERTIFIED

    def refer_to(self, state: FloatArray, factor: float) -> None:
        """Take a state inside, which carries the dead load with ``factor`` times the live load, in
        place of one that carries it alone."""
        self.asked.add("dead load")
        self.reference = state, factor
        self.certifier.offer_dead_state(state, factor)

    def _solvers_in_turn(self) -> Generator[None, None, Status | None]:
        """Tries the ladder until a solver settles how it ends; None where none does."""
        is_cut, stalled = False, set[str]()
        for settings in self.aside.ladder:
            # with a bracket in hand, leave out what would not narrow it, or not in time
            has_bracket = self.run.best.bracket.has_both
            if has_bracket and settings.name in stalled:
                continue
            if has_bracket and not self.run.ladder and self._is_too_long(settings):
                is_cut = True
                continue
            state = self._attempt(settings)
            if settings.name == "BLOCKWISE" and state.outcome.status == OPTIMAL_INACCURATE:
                stalled.add(settings.name)  # by rounding, on a way that no tolerance changes
            # below zero the dead load alone is not carried; only an interval may have its end there
            bracket = self.run.best.bracket
            is_alone = self.reference is None
            if is_alone and bracket.is_below_zero and self._record_fall(*self._fall_below_zero()):
                return Status.DEAD_LOAD_UNSTABLE
            if bracket.is_within(self.tolerance):
                return Status.CERTIFIED
            is_boundless = self.run.is_boundless(state.load_factor)
            if (state.outcome.claims_no_optimum or is_boundless) and self._is_unbounded():
                return Status.UNBOUNDED
            yield
        # Why it is not settled: one or the other, since it takes both bounds to leave a solver out.
        if self.without_duals and not np.isfinite(self.run.best.bracket.upper):
            who = " and ".join(dict.fromkeys(self.without_duals))
            self.run.remarks = [
                f"{who} returned forces without duals: there is no mechanism, and no upper bound; "
                "another solver has them"
            ]
        if is_cut:
            more = f"more than the budget of {self.budget:g} s may narrow the bracket"
            self.run.remarks = [more]
        return None

    def _is_too_long(self, settings: SolverSettings) -> bool:
        """True for a solver that would take longer than all so far and end beyond the budget."""
        run, spent = self.run, self.run.clock.elapsed
        pace, growth = settings.row.pace
        takes = pace * self.aside.problem.shape.variables**growth
        if takes < spent or spent + takes < self.budget:
            return False
        run.tell(f"{settings} is left out: about {takes:.0f} s, beyond the budget")
        return True

    def _attempt(self, settings: SolverSettings) -> LimitState:
        """Runs one solver, and adds what its certificate proves to the best answer."""
        run = self.run
        state = run.solve(self.aside.problem.run, settings)
        if state.forces is not None and state.mechanism is None:
            self.without_duals.append(settings.name)
        bounds = self.bracketed(state)
        # only the last certificate: `bracketed` may find the proof of a bound by reference states,
        # and a tighter one with an assumption, kept from before, would hide it
        internal = state.internal if self.certifier.strength.is_internal else None
        factor, forces = state.load_factor, state.forces
        by = self.certifier.references.given(factor)
        best = run.best.raised(bounds.lower, bounds.lower_is_proved, factor, forces, internal, by)
        run.best = best.lowered(bounds.upper, bounds.upper_is_proved, state.mechanism, by)
        figures = ("lower", "upper", "equilibrium_residual", "yield_excess", "flow_violation")
        values = map(known, attrgetter(*figures)(bounds))
        run.note(state, settings, **dict(zip(figures, values, strict=True)))
        return state

    def bracketed(self, state: LimitState) -> Certificate:
        """The certificate of an answer; reference states are sought where it needs them."""
        bounds = self._certificate(state)
        # Mixed with the reference state, a bound loses more the less reserve that has: one deeper
        # inside may narrow the bracket. Of `best` only the width counts here.
        is_close = bounds.lower_is_proved and bounds.lower > 0.5 * bounds.upper > 0.0
        best = self.run.best.bracket.raised(bounds.lower, is_proved=True)
        best = best.lowered(bounds.upper, is_proved=False)
        if is_close and not best.is_within(self.tolerance) and self._is_new("dead load"):
            self.aside.dead_load_alone()
            bounds = self._certificate(state)
        # rates that open every contact prove an upper bound that rests on an assumption so far
        if np.isfinite(bounds.upper) and not bounds.upper_is_proved and self._is_new("opening"):
            self.aside.opening_field()
            bounds = self._certificate(state)
        return bounds

    def _is_new(self, question: str) -> bool:
        """True if the question has not been asked yet; it has been from now on."""
        is_new = question not in self.asked
        self.asked.add(question)
        return is_new

    def _certificate(self, state: LimitState) -> Certificate:
        self.run.tell("checking the bracket")
        with self.run.clock.phase("certify"):
            return self.certifier.of(state)

    def dead_load_is_unstable(self) -> bool:
        """True if the dead load cannot stand alone; its mechanism is in the run then. Solvers are
        asked only where projections find no forces that carry it, and once."""
        with self.run.clock.phase("certify"):
            stands = self.certifier.references.easy_dead_state is not None
        if stands or not self._is_new("dead load"):
            return False
        return self._record_fall(*self.aside.dead_load_alone())

    def _record_fall(self, rates: FloatArray | None, resistance: float) -> bool:
        """Leaves a mechanism of the dead load, rates (free blocks, 6), in the run, with a remark
        that says what falls; False if there is none."""
        if rates is None:
            return False
        run = self.run
        run.best = replace(run.best, forces=None, mechanism=rates)
        run.remarks = [fallen(run.scene, rates, resistance)]
        return True

    def _fall_below_zero(self) -> tuple[FloatArray | None, float]:
        """As :meth:`Aside.dead_load_alone`, after an upper bound below zero: if it is proved, the
        dead load does work on its mechanism; if it needs an assumption, the dead load is asked
        for."""
        best = self.run.best
        if best.bracket.upper_is_proved and best.mechanism is not None:
            return self.certifier.opened(best.mechanism).rates, np.inf
        self.asked.add("dead load")
        return self.aside.dead_load_alone()

    def _is_unbounded(self) -> bool:
        """True if forces carry the live load alone, hence any multiple of it; asked once."""
        if not self._is_new("live load"):
            return False
        # Surfaces that refuse joints that bear nothing may admit nothing at all.
        contacts, live = self.run.contacts, self.run.assemblage.statics.live
        bare = (s.excess(np.zeros((len(contacts), DOF)), contacts) for s in self.run.surfaces)
        refuses = any((y > 0.0).any() for excess in bare for y in excess)
        if refuses and self.certifier.references.dead_state is None:
            return False
        if (forces := self.aside.carrying(live, *self.certifier.strength.recession())) is not None:
            self.run.best = replace(self.run.best, forces=forces, mechanism=None)
        return forces is not None


def dead_load_falls(run: Run) -> bool:
    """True if the dead load cannot stand; see :func:`standing`."""
    return standing(run, "full") is None


def standing(run: Run, model: str) -> ConvexSearch | None:
    """What asks for the load factor with so much ``model``, in a run aside, if the dead load
    stands. If it does not, the run has the mechanism, and says so. A positive load factor would
    not show it: pushed, a block may stay on a slope that is too steep.

    Raises
    ------
    ModelError
        If it stands together with a part of the live load: the answer is an interval then.
    """
    search = ConvexSearch(run.auxiliary_run(), model)
    if not search.dead_load_is_unstable():
        return search
    held_by = search.aside.held_by_live_load()
    refuse_an_interval(held_by.factor)
    run.best, run.remarks = search.run.best, search.run.remarks
    run.history += search.run.history
    if held_by.remark:
        run.remarks.append(held_by.remark)
    return None
