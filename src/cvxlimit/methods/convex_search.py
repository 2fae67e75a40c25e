"""The load factor without interaction: solvers in turn, and proofs that no answer exists."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter

import numpy as np
from cvxpy.settings import OPTIMAL_INACCURATE

from cvxlimit.base.arrays import FloatArray
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.checks import RESIDUAL
from cvxlimit.methods.driver import Run, Steps
from cvxlimit.methods.standing import (
    SOLVERS_ASIDE,
    Held,
    about_the_lower_end,
    held,
    lower_end,
    refuse_an_interval,
    told,
)
from cvxlimit.methods.wedging import carried_by_dilatancy
from cvxlimit.model.assemblage import Reduction
from cvxlimit.model.formulations import Formulation
from cvxlimit.model.problem import LimitProblem
from cvxlimit.model.statement import LargestFactor, largest_self_stress
from cvxlimit.proof.admissible import carried_exactly
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.strength import Strength
from cvxlimit.reductions.choice import Reductions
from cvxlimit.scene import Scene
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, Certificate, known
from cvxlimit.solvers import LimitState, SolverSettings, settings_for
from cvxlimit.surfaces.coulomb import needed_surfaces


@dataclass(frozen=True)
class _Numbers:
    """Of questions beside the load factor."""

    # contact forces, over the dead load, beyond which it is rounding alone that could hold a block:
    # solvers leave missing openings of 1e-12 to 1e-10 of the rates in exact mechanisms
    no_force: float = 1e8
    # whether a load stands shows far from the optimum: forces inside are all that is asked of them
    loose: float = 0.1


_N = _Numbers()


_Ends = Generator[None, None, Status | None]


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
    if not search.dead_load_falls():
        return search
    end = search.held()
    refuse_an_interval(end.factor)
    run.best, run.remarks = search.run.best, search.run.remarks
    if end.remark:
        run.remarks.append(end.remark)
    return None


def fallen(scene: Scene, rates: FloatArray) -> str:
    """What happens to the free block on which the dead load does the most work, at rates (n, 6)."""
    row = int((rates * scene.dead_forces).sum(axis=1).argmax())
    block, velocity = scene.blocks[scene.free[row]].id, rates[row, :3]
    gravity = np.array(scene.dead.gravity or (0.0, 0.0, 0.0))
    rises = float(velocity @ gravity) < -0.5 * float(np.linalg.norm(velocity))
    return f"block {block!r} is lifted" if rises else f"block {block!r} falls"


class ConvexSearch:
    """What is asked of a scene without interaction: the load factor, and what loads do alone. The
    certificate is that of the full scene however much ``model`` there is. A ``problem`` that exists
    is solved in place of a new one, and keeps the reference states of its last certificate.
    """

    def __init__(
        self,
        run: Run,
        model: str,
        tolerance: float = TOLERANCE,
        budget: float = np.inf,
        problem: LimitProblem | None = None,
    ) -> None:
        self.run, self.tolerance, self.budget = run, tolerance, budget
        self._given = problem
        self.surfaces = needed_surfaces(run.surfaces)
        self.asked: set[str] = set()
        self.without_duals: list[str] = []
        self.reference: tuple[FloatArray, float] | None = None
        self._take(model)

    def _take(self, model: str) -> None:
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
                self.certifier.start_from(self._given.reference)
        self._state(None)

    def _state(self, dead_state: FloatArray | None) -> None:
        run, reductions = self.run, self.reductions
        with run.clock.phase("compile"):
            reduction = reductions.best(dead_state)
            run.reductions = reduction.names
            self.problem = self._given or LimitProblem(
                reductions.assemblage, run.surfaces, reduction=reduction, repeats=run.repeats
            )

    @property
    def ladder(self) -> Sequence[SolverSettings]:
        with self.run.clock.phase("compile"):
            return self.run.ladder or self.problem.ladder(self.tolerance)

    def steps(self) -> Steps:
        """All solvers with the model that suffices, then with the full one."""
        if self.dead_load_falls():
            return (yield from self._between())
        if self.reductions.loaded is not None:  # the others are left out, as far as they stand
            self._state(self.certifier.witnesses.easy_dead_state)
        status = yield from self._bounded()
        return (yield from self._between()) if status is Status.DEAD_LOAD_UNSTABLE else status

    def _bounded(self) -> Steps:
        status = yield from self._solvers_in_turn()
        if status is None and self.run.reductions:  # none of it is believed: the full model decides
            self._take("full")
            status = yield from self._solvers_in_turn()
        if status is not None:
            return status
        best = self.run.best.bracket
        is_harmful = best.upper_is_proved and not self.run.is_boundless(best.upper)
        harmless = not is_harmful and self._is_harmless()
        return Status.LIVE_LOAD_HARMLESS if harmless else Status.NOT_CERTIFIED

    def held(self) -> Held:
        """Finds with which part of the live load the dead load stands that does not stand alone."""
        reductions = self.reductions
        return held(
            self.run, reductions.assemblage, self.surfaces, reductions.best(), self.certifier
        )

    def _between(self) -> Steps:
        """Finds both ends of the interval of load factors, where the dead load does not stand
        alone.

        The lower end is minus the largest factor of the live load turned round. Both brackets refer
        to one state inside, which carries a load factor of its own. If that is negative all are,
        since 0 is not: no part of the live load helps then.
        """
        run, (alone,) = self.run, self.run.remarks[-1:]
        falls, held_by = (run.best, run.remarks), self.held()
        if held_by.state is None or not held_by.factor > 0.0:
            run.remarks = [alone, held_by.remark] if held_by.remark else [alone]
            return Status.DEAD_LOAD_UNSTABLE
        run.best, run.remarks = Answer(bracket=Bracket(least=run.scaling.least)), []
        self.refer_to(held_by.state, held_by.factor)
        upper = yield from self._bounded()
        dead, live = run.assemblage.statics.dead, run.assemblage.statics.live
        turned = run.auxiliary_run(run.assemblage.under(dead, -live))
        back = ConvexSearch(turned, run.model, self.tolerance, self.budget)
        back.refer_to(held_by.state, -held_by.factor)
        lower = yield from back._bounded()
        run.history += [about_the_lower_end(iterate) for iterate in turned.history]
        end = lower_end(turned, held_by.factor)
        if run.best.bracket.upper < end.bracket.lower - run.scaling.least:
            run.best, run.remarks = falls  # each end excludes what the other one leaves
            return Status.DEAD_LOAD_UNSTABLE
        has_end = upper is not Status.LIVE_LOAD_HARMLESS
        best = run.best
        if not has_end:
            best = Answer(forces=best.forces, dilatancy=best.dilatancy)
        run.best = replace(best, lower_end=end)
        run.remarks = [told(run.best, turned.best.bracket, alone), *run.remarks]
        ends = upper, lower
        if all(end in (Status.CERTIFIED, Status.LIVE_LOAD_HARMLESS) for end in ends):
            return upper
        return Status.NOT_CERTIFIED

    def refer_to(self, state: FloatArray, factor: float) -> None:
        """Take a state inside, which carries the dead load with ``factor`` times the live load, in
        place of one that carries it alone."""
        self.asked.add("dead load")
        self.reference = state, factor
        self.certifier.offer_dead_state(state, factor)

    def _solvers_in_turn(self) -> _Ends:
        is_cut, stalled = False, set[str]()
        for settings in self.ladder:
            has_bracket = self.run.best.bracket.has_both
            if has_bracket and settings.name in stalled:
                continue
            if has_bracket and not self.run.ladder and self._is_too_long(settings):
                is_cut = True
                continue
            state = self._attempt(settings)
            if settings.name == "BLOCKWISE" and state.outcome.status == OPTIMAL_INACCURATE:
                stalled.add(settings.name)  # by rounding, on a way that no tolerance changes
            bracket = self.run.best.bracket
            is_alone = self.reference is None
            if is_alone and bracket.is_below_zero and self._falls(*self._late_fall()):
                return Status.DEAD_LOAD_UNSTABLE
            if bracket.is_within(self.tolerance):
                return Status.CERTIFIED
            is_boundless = self.run.is_boundless(state.load_factor)
            if (state.outcome.claims_no_optimum or is_boundless) and self._is_harmless():
                return Status.LIVE_LOAD_HARMLESS
            yield
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
        run, spent = self.run, self.run.clock.elapsed
        pace, growth = settings.row.pace
        takes = pace * self.problem.shape.variables**growth
        if takes < spent or spent + takes < self.budget:
            return False
        run.tell(f"{settings} is left out: about {takes:.0f} s, beyond the budget")
        return True

    def _attempt(self, settings: SolverSettings) -> LimitState:
        run = self.run
        state = run.solve(self.problem.run, settings)
        if state.forces is not None and state.mechanism is None:
            self.without_duals.append(settings.name)
        bounds = self.bracketed(state)
        # only now: a tighter bound with an assumption would hide the proved one
        internal = state.internal if self.certifier.strength.is_internal else None
        factor, forces = state.load_factor, state.forces
        best = run.best.raised(bounds.lower, bounds.lower_is_proved, factor, forces, internal)
        run.best = best.lowered(bounds.upper, bounds.upper_is_proved, state.mechanism)
        figures = ("lower", "upper", "equilibrium_residual", "yield_excess", "flow_violation")
        values = map(known, attrgetter(*figures)(bounds))
        run.note(state, settings, **dict(zip(figures, values, strict=True)))
        return state

    def bracketed(self, state: LimitState) -> Certificate:
        """The bracket of an answer, and of states to refer to that are sought where it needs
        them."""
        bounds = self._certificate(state)
        # a proved lower bound loses too much: a state deeper inside may narrow the bracket
        is_close = bounds.lower_is_proved and bounds.lower > 0.5 * bounds.upper > 0.0
        best = self.run.best.bracket.raised(bounds.lower, True).lowered(bounds.upper, False)
        if is_close and not best.is_within(self.tolerance) and self._is_new("dead load"):
            self._dead_load_alone()
            bounds = self._certificate(state)
        if np.isfinite(bounds.upper) and not bounds.upper_is_proved and self._is_new("opening"):
            self.solve_opening()
            bounds = self._certificate(state)
        return bounds

    def _is_new(self, question: str) -> bool:
        is_new = question not in self.asked
        self.asked.add(question)
        return is_new

    def _certificate(self, state: LimitState, certifier: Certifier | None = None) -> Certificate:
        self.run.tell("checking the bracket")
        with self.run.clock.phase("certify"):
            return (certifier or self.certifier).of(state)

    def dead_load_falls(self) -> bool:
        with self.run.clock.phase("certify"):
            stands = self.certifier.witnesses.easy_dead_state is not None
        return not stands and self._is_new("dead load") and self._falls(*self._dead_load_alone())

    def _falls(self, rates: FloatArray | None, resistance: float) -> bool:
        if rates is None:
            return False
        scene, run = self.run.scene, self.run
        sentence = fallen(scene, rates)
        most = resistance / max(float(np.abs(scene.dead_forces[:, :3]).sum()), 1e-300)
        if most < _N.no_force:
            sentence += f" (contact forces beyond {most:.1g} times the dead load could hold it)"
        run.best, run.remarks = replace(run.best, forces=None, mechanism=rates), [sentence]
        return True

    def _late_fall(self) -> tuple[FloatArray | None, float]:
        """A mechanism that bounds the load factor below zero: the dead load does work on it, and is
        asked for alone if the bound needs an assumption."""
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
            problem = self.problem
            # forces that carry some of it already, or loads that are not the scene's
            if problem.reduction.given_forces is not None or self._given is not None:
                whole = self.reductions.best()
                problem = LimitProblem(self.reductions.assemblage, run.surfaces, reduction=whole)
            problem = problem.dead_alone()
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
        """Give the certifier rates that open every contact, unless blocks wedge each other."""
        run, reductions = self.run, self.reductions
        run.tell("checking that blocks do not wedge each other")
        with run.clock.phase("compile"):
            goal, whole = largest_self_stress, reductions.best()
            problem = LimitProblem(reductions.assemblage, self.surfaces, goal=goal, reduction=whole)
        for settings in problem.ladder()[:SOLVERS_ASIDE]:
            state = run.solve(partial(problem.run, has_rows=False), settings)
            run.note(replace(state, load_factor=None), f"{settings}, self-stress")
            if state.mechanism is not None and self.certifier.offer_opening_field(state.mechanism):
                return

    def _is_harmless(self) -> bool:
        """True if forces carry the live load alone, hence any multiple of it; asked once."""
        if not self._is_new("live load"):
            return False
        run, live = self.run, self.run.assemblage.statics.live
        run.tell("checking whether the live load does any harm")
        surfaces, formulation = self.certifier.strength.recession()
        loaded = self.reductions.assemblage.under(live, live)
        with run.clock.phase("compile"):
            alone, reduction = loaded.alone(live), self.reductions.best()
            if formulation is not run.formulation:
                reduction = Reduction.none(alone.statics, formulation)
            # Where a load grazes, forces are inside by 1e-8, and the order of rows decides whether
            # solvers find such: CVXPY's did on 295 of 295 scenes, the other on 293.
            goal = LargestFactor(most=1.0)
            problem = LimitProblem(alone, surfaces, reduction=reduction, goal=goal)
        for state, certificate in self._shares(problem, "live load alone", formulation, False):
            carrying = self.certifier.given(state)
            if carrying is not None and state.load_factor and state.load_factor > 0.5:
                with run.clock.phase("certify"):
                    strength_of = partial(Strength, surfaces=surfaces, formulation=formulation)
                    forces = carried_exactly(loaded, strength_of, carrying / state.load_factor)
                if forces is not None:
                    dilatancy = carried_by_dilatancy(run)
                    run.best = replace(run.best, forces=forces, mechanism=None, dilatancy=dilatancy)
                    return True
            elif certificate().upper < 0.5:
                break
        return False

    def _shares(
        self, problem: LimitProblem, what: str, formulation: Formulation, has_rows: bool = True
    ) -> Iterator[tuple[LimitState, Callable[[], Certificate]]]:
        """Which share <= 1 of a load alone is carried, by the first solvers; its certificate."""
        run = self.run

        def certificate(state: LimitState) -> Certificate:
            return self._certificate(
                state, Certifier(problem.assemblage, problem.surfaces, formulation)
            )

        solvers = self.ladder
        if solvers[0].name == "BLOCKWISE" and not run.ladder and self.certifier.strength.is_cone:
            solvers = (settings_for("BLOCKWISE", _N.loose), *solvers)
        for settings in solvers[:SOLVERS_ASIDE]:
            state = run.solve(partial(problem.run, has_rows=has_rows), settings)
            run.note(replace(state, load_factor=None), f"{settings}, {what}")
            yield state, partial(certificate, state)
