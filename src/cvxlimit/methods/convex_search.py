"""The load factor without interaction: solvers in turn, and proofs that no answer exists.

Solvers are tried until the bracket, which is recomputed outside them, is narrow enough. What is
asked beside the load factor, of problems of their own:

- Does the dead load stand alone? Forces that carry it are the reference state of lower bounds.
- If it does not: does it stand with a part of the live load? Then there are two ends to find.
- Do contacts wedge each other? Rates that open them all are the opening field of upper bounds.
- Do forces carry the live load alone? Then they carry any multiple of it, and there is no limit.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from functools import partial
from operator import attrgetter

import numpy as np
from cvxpy.settings import OPTIMAL_INACCURATE

from cvxlimit.base.arrays import FloatArray
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.driver import Run, Steps
from cvxlimit.methods.standing import (
    SOLVERS_ASIDE,
    Held,
    about_the_lower_end,
    fallen,
    held,
    lower_end,
    refuse_an_interval,
    told,
)
from cvxlimit.model.assemblage import Reduction
from cvxlimit.model.formulations import Formulation
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LargestFactor, largest_self_stress
from cvxlimit.proof.admissible import carried_exactly
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.checks import RESIDUAL
from cvxlimit.proof.strength import Strength
from cvxlimit.reductions.choice import Reductions
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, Certificate, known
from cvxlimit.solvers import LimitState, SolverSettings, settings_for
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.coulomb import needed_surfaces

LOOSE = 0.1
"""Tolerance of the first solver for a load alone: whether it stands shows far from the optimum."""


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
    held_by = search.held_by_live_load()
    refuse_an_interval(held_by.factor)
    run.best, run.remarks = search.run.best, search.run.remarks
    if held_by.remark:
        run.remarks.append(held_by.remark)
    return None


class ConvexSearch:
    """What is asked of a scene without interaction: the load factor, and what loads do alone.

    How the methods call each other::

        steps
          dead_load_is_unstable    forces that carry the dead load alone, or a mechanism
          (it stands)  _solve_with_fallback
                         _solvers_in_turn, with the reduced model, then with the full one
                           _attempt    one solver, its certificate, what it adds to run.best
                         _is_unbounded    whether there is a limit at all
          (it falls)   _interval
                         held_by_live_load    a part of the live load that holds the dead load
                         _solve_with_fallback, for the live load and for its opposite

    Between them ``certifier`` keeps the reference states, ``run`` the best answer and the remarks;
    ``asked`` keeps a side question, which costs a solve, from being put twice.

    Solvers see so much ``model``; the certificate is that of the full scene in any case. For
    ``tolerance`` and ``budget`` see :class:`~cvxlimit.methods.convex.Convex`. A ``problem``
    is solved in place of a new one, with the reference states of its last certificate; it comes
    with ``model="full"``, since there is no other problem to fall back to.
    """

    def __init__(
        self,
        run: Run,
        model: str,
        tolerance: float = TOLERANCE,
        budget: float = np.inf,
        problem: LimitProgram | None = None,
    ) -> None:
        self.run, self.tolerance, self.budget = run, tolerance, budget
        self._given = problem
        self.surfaces = needed_surfaces(run.surfaces)
        self.asked: set[str] = set()
        self.without_duals: list[str] = []
        self.reference: tuple[FloatArray, float] | None = None
        self._use_model(model)

    def _use_model(self, model: str) -> None:
        """Sets reductions, certifier and problem for so much ``model``."""
        run = self.run
        with run.clock.phase("compile"):
            self.reductions = Reductions.of(run.assemblage, self.surfaces, run.formulation, model)
        with run.clock.phase("certify"):
            self.certifier = Certifier(
                self.reductions.assemblage, self.surfaces, run.formulation, width=self.tolerance
            )
            if self.reference is not None:
                self.certifier.offer_dead_state(*self.reference)
            if self._given is not None and self._given.reference is not None:
                self.certifier.refer_to(self._given.reference)
        self._build_problem(None)

    def _build_problem(self, dead_state: FloatArray | None) -> None:
        """Sets the problem with the smallest model. Parts without live load are left out of it only
        if ``dead_state``, forces (n, 6) that carry the dead load, shows that they stand."""
        run, reductions = self.run, self.reductions
        if self._given is not None:
            self.problem = self._given
            return
        with run.clock.phase("compile"):
            reduction = reductions.best(dead_state)
            run.reductions = reduction.names
            self.problem = LimitProgram(reductions.assemblage, run.surfaces, reduction=reduction)

    @property
    def ladder(self) -> Sequence[SolverSettings]:
        """Solvers in the order in which they are tried."""
        with self.run.clock.phase("compile"):
            return self.run.ladder or self.problem.ladder(self.tolerance)

    def steps(self) -> Steps:
        """Finds the load factor, or how it ends without one: see :class:`Method`."""
        if self.dead_load_is_unstable():
            return (yield from self._interval())
        if self.reductions.loaded is not None:  # the others are left out, as far as they stand
            self._build_problem(self.certifier.witnesses.easy_dead_state)
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
        is_unbounded = not has_limit and self._is_unbounded()
        return Status.UNBOUNDED if is_unbounded else Status.NOT_CERTIFIED

    def held_by_live_load(self) -> Held:
        """Finds with which part of the live load the dead load stands that does not stand alone."""
        reductions = self.reductions
        return held(
            self.run, reductions.assemblage, self.surfaces, reductions.best(), self.certifier
        )

    def _interval(self) -> Steps:
        """Finds both ends of the interval of load factors, where the dead load does not stand
        alone.

        The lower end is minus the largest factor of the live load turned round. Both brackets refer
        to one state inside, which carries a load factor of its own. If that is negative all are,
        since 0 is not one of them: no part of the live load helps then.
        """
        # The fall that led here is recorded in the run: its sentence is the last remark.
        run, (alone,) = self.run, self.run.remarks[-1:]
        before, held_by = (run.best, run.remarks), self.held_by_live_load()
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
        reversed_search = ConvexSearch(reversed_run, run.model, self.tolerance, self.budget)
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
        for settings in self.ladder:
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
        takes = pace * self.problem.shape.variables**growth
        if takes < spent or spent + takes < self.budget:
            return False
        run.tell(f"{settings} is left out: about {takes:.0f} s, beyond the budget")
        return True

    def _attempt(self, settings: SolverSettings) -> LimitState:
        """Runs one solver, and adds what its certificate proves to the best answer."""
        run = self.run
        state = run.solve(self.problem.run, settings)
        if state.forces is not None and state.mechanism is None:
            self.without_duals.append(settings.name)
        bounds = self.bracketed(state)
        # only the last certificate: `bracketed` may find the proof of a bound by reference states,
        # and a tighter one with an assumption, kept from before, would hide it
        internal = state.internal if self.certifier.strength.is_internal else None
        factor, forces = state.load_factor, state.forces
        by = self.certifier.witnesses.given(factor)
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
            self._dead_load_alone()
            bounds = self._certificate(state)
        # rates that open every contact prove an upper bound that rests on an assumption so far
        if np.isfinite(bounds.upper) and not bounds.upper_is_proved and self._is_new("opening"):
            self.solve_opening()
            bounds = self._certificate(state)
        return bounds

    def _is_new(self, question: str) -> bool:
        """True if the question has not been asked yet; it has been from now on."""
        is_new = question not in self.asked
        self.asked.add(question)
        return is_new

    def _certificate(self, state: LimitState, certifier: Certifier | None = None) -> Certificate:
        self.run.tell("checking the bracket")
        with self.run.clock.phase("certify"):
            return (certifier or self.certifier).of(state)

    def dead_load_is_unstable(self) -> bool:
        """True if the dead load cannot stand alone; its mechanism is in the run then. Solvers are
        asked only where projections find no forces that carry it, and once."""
        with self.run.clock.phase("certify"):
            stands = self.certifier.witnesses.easy_dead_state is not None
        if stands or not self._is_new("dead load"):
            return False
        return self._record_fall(*self._dead_load_alone())

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
        """As :meth:`_dead_load_alone`, after an upper bound below zero: if it is proved, the dead
        load does work on its mechanism; if it needs an assumption, the dead load is asked for."""
        best = self.run.best
        if best.bracket.upper_is_proved and best.mechanism is not None:
            return self.certifier.opened(best.mechanism).rates, np.inf
        self.asked.add("dead load")
        return self._dead_load_alone()

    def _dead_load_alone(self) -> tuple[FloatArray | None, float]:
        """Give the certifier forces that carry the dead load: an interior-point solver ends far
        deeper inside all surfaces than projections do. Where there are none, returns rates on which
        the dead load alone does work, and the contact forces that could hold it all the same,
        infinite if that is proved.

        Asks for the largest share t <= 1 of it. Without constants in the conditions that is 1 or 0,
        so an upper bound below 1 / 2 is a proof; with them only one below 1 is.
        """
        dead = self.run.assemblage.statics.dead
        if not np.any(dead):
            return None, np.inf
        run, what = self.run, "dead load alone"
        run.tell("checking that the dead load can stand")
        # limits of 1 come out to 1e-8
        enough = 0.5 if self.certifier.strength.is_cone else 1.0 - RESIDUAL
        with run.clock.phase("compile"):
            whole, reduction = self.reductions.assemblage, self.reductions.best()
            problem = LimitProgram(
                whole.alone(dead), run.surfaces, reduction=reduction, goal=LargestFactor(most=1.0)
            )
        for state, certificate in self._shares(problem, what, run.formulation):
            forces = self.certifier.given(state)
            if forces is not None and state.load_factor and state.load_factor > enough:
                if self.certifier.offer_dead_state(forces / state.load_factor):
                    break
            elif state.mechanism is not None and (bounds := certificate()).upper < enough:
                is_proved = bounds.upper_is_proved or not bounds.missing_opening > 0.0
                return state.mechanism, np.inf if is_proved else 1.0 / bounds.missing_opening
        return None, np.inf

    def solve_opening(self) -> None:
        """Give the certifier rates that open every contact, unless blocks wedge each other. They
        are the duals of the largest self-stress: where contacts cannot press each other without a
        load, some rates open them all."""
        run, reductions = self.run, self.reductions
        run.tell("checking that blocks do not wedge each other")
        with run.clock.phase("compile"):
            goal, whole = largest_self_stress, reductions.best()
            problem = LimitProgram(reductions.assemblage, self.surfaces, goal=goal, reduction=whole)
        for settings in problem.ladder()[:SOLVERS_ASIDE]:
            state = run.solve(partial(problem.run, has_rows=False), settings)
            run.note(replace(state, load_factor=None), f"{settings}, self-stress")
            if state.mechanism is not None and self.certifier.offer_opening_field(state.mechanism):
                return

    def _is_unbounded(self) -> bool:
        """True if forces carry the live load alone, hence any multiple of it; asked once."""
        if not self._is_new("live load"):
            return False
        live = self.run.assemblage.statics.live
        if (forces := self.carrying(live, *self.certifier.strength.recession())) is not None:
            self.run.best = replace(self.run.best, forces=forces, mechanism=None)
        return forces is not None

    def carrying(
        self, load: FloatArray, surfaces: Sequence[YieldSurface], formulation: Formulation
    ) -> FloatArray | None:
        """Forces (n, 6) that carry a ``load`` alone, recomputed outside the solver, or None."""
        run, loaded = self.run, self.reductions.assemblage.under(load, load)
        with run.clock.phase("compile"):
            alone, reduction = loaded.alone(load), self.reductions.best()
            if formulation is not run.formulation:
                reduction = Reduction.none(alone.statics, formulation)
            goal = LargestFactor(most=1.0)
            problem = LimitProgram(alone, surfaces, reduction=reduction, goal=goal)
        # has_rows: where a load grazes, CVXPY's rows show all of 295 scenes to solvers, ours 293
        for state, certificate in self._shares(problem, "load alone", formulation, has_rows=False):
            carrying = self.certifier.given(state)
            if carrying is not None and state.load_factor and state.load_factor > 0.5:
                with run.clock.phase("certify"):
                    strength_of = partial(Strength, surfaces=surfaces, formulation=formulation)
                    forces = carried_exactly(loaded, strength_of, carrying / state.load_factor)
                if forces is not None:
                    return forces
            elif certificate().upper < 0.5:
                break
        return None

    def _shares(
        self, problem: LimitProgram, what: str, formulation: Formulation, has_rows: bool = True
    ) -> Iterator[tuple[LimitState, Callable[[], Certificate]]]:
        """Which share <= 1 of a load alone is carried: yields the state of each of the first
        solvers, and what makes its certificate. ``has_rows`` is as for :meth:`LimitProgram.run`."""
        run = self.run

        def certificate(state: LimitState) -> Certificate:
            return self._certificate(
                state, Certifier(problem.assemblage, problem.surfaces, formulation)
            )

        solvers = self.ladder
        if solvers[0].name == "BLOCKWISE" and not run.ladder and self.certifier.strength.is_cone:
            solvers = (settings_for("BLOCKWISE", LOOSE), *solvers)
        for settings in solvers[:SOLVERS_ASIDE]:
            state = run.solve(partial(problem.run, has_rows=has_rows), settings)
            run.note(replace(state, load_factor=None), f"{settings}, {what}")
            yield state, partial(certificate, state)
