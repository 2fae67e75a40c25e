"""A solution of a limit problem that its user has changed: with a bracket, or with the reason why
there is none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from cvxpy.settings import OPTIMAL, OPTIMAL_INACCURATE

from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.convex_search import ConvexSearch
from cvxlimit.methods.driver import Run, Steps, drive
from cvxlimit.methods.wedging import judged
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.limits import broken
from cvxlimit.model.problem import LimitProblem
from cvxlimit.proof.own_limits import OwnCertifier
from cvxlimit.reductions.repeated import Repeats
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, known
from cvxlimit.solvers import LimitState, SolverSettings, asked_ladder


@dataclass(frozen=True)
class OneProblem(Convex):
    """The convex method on a problem that exists, whose solvers start from the solve before."""

    problem: LimitProblem | None = None

    def steps(self, run: Run) -> Steps:
        assert self.problem is not None
        if self.problem.has_own:
            return (yield from self._own(run, self.problem))
        search = ConvexSearch(run, "full", self.tolerance, self.budget, self.problem)
        status = yield from search.steps()
        self.problem.reference = search.certifier
        return judged(run) if status is Status.UNBOUNDED else status

    def _own(self, run: Run, problem: LimitProblem) -> Steps:
        """Solves with limits or an aim of the user's, with both bounds, where all of them are
        linear."""
        search = ConvexSearch(run, "full", self.tolerance, self.budget, problem)
        limits, proof, why = problem.linear_limits(), None, ""
        if isinstance(limits, str):
            why = f"no bracket for {problem.said_own}: {limits}"
        else:
            proof = OwnCertifier(search.certifier, limits)
        found = None
        for settings in run.ladder or problem.ladder(self.tolerance):
            state = run.solve(problem.run, settings)
            if state.forces is not None and state.outcome.status in (OPTIMAL, OPTIMAL_INACCURATE):
                found = self._bracketed(search, problem, proof, state)
                run.best = found if run.best.load_factor is None else _better(run.best, found)
            best = run.best.bracket
            run.note(state, settings, lower=known(best.lower), upper=known(best.upper))
            yield
            if state.outcome.claims_no_optimum and found is None:
                run.remarks = [_without_answer(problem)]
                return Status.NOT_CERTIFIED
            if best.is_within(self.tolerance) and best.is_proved:
                run.remarks = [f"with {problem.said_own}"]
                return Status.CERTIFIED
            if found is not None and (proof is None or not best.has_any):
                break  # another solver would not prove more
        if found is None:
            return Status.SOLVER_FAILED
        run.remarks = [why or (f"with {problem.said_own}" if run.best.bracket.has_any else
                               f"no bracket for {problem.said_own}: {_NO_PROOF}")]  # fmt: skip
        return Status.NOT_CERTIFIED

    def _bracketed(
        self,
        search: ConvexSearch,
        problem: LimitProblem,
        proof: OwnCertifier | None,
        state: LimitState,
    ) -> Answer:
        if proof is None:
            return Answer(problem.value(state), Bracket(), state.forces, None)
        mechanism, multipliers = state.mechanism, state.own.get("multipliers")
        if mechanism is not None and proof.has_aim:  # that of the load factor is in its units
            mechanism = mechanism * (problem.scaling.live / problem.scaling.force)
        certifier, factor = search.certifier, state.load_factor
        forces, reserve = certifier.given(state), certifier.witnesses.dead_state
        about = mechanism, multipliers
        known_state = None if reserve is None else (reserve, certifier.witnesses.factor)
        bracket = proof.bracket(forces, factor, known_state, *about)
        if not np.isfinite(bracket.upper) and multipliers is not None:
            search.solve_opening()
            bracket = proof.bracket(forces, factor, known_state, *about)
        # the dead load alone may break the limits, or carry another load factor than theirs
        others = _inside(search.run, problem)
        while not bracket.is_within(self.tolerance) and (near := next(others, None)) is not None:
            given, at = certifier.given(near), near.load_factor
            if given is not None and at is not None:
                other = proof.bracket(forces, factor, (given, at), *about)
                bracket = bracket.raised(other.lower, other.lower_is_proved)
        return Answer(problem.value(state), bracket, state.forces, mechanism)


def _inside(run: Run, problem: LimitProblem) -> Iterator[LimitState]:
    """States that may be strictly inside the limits: that of the solve before, which costs nothing
    and often still is where Parameters have changed little, and an answer without an aim, of the
    first solver that has one."""
    if problem.within is not None:
        yield problem.within
    inside = problem.inside()
    for settings in inside.ladder():
        problem.within = state = run.solve(inside.run, settings)
        if state.forces is not None or state.outcome.claims_no_optimum:
            break
    yield state


_NO_PROOF = "no state strictly inside them was found, or no mechanism that they allow"


def _better(before: Answer, found: Answer) -> Answer:
    new = found.bracket
    raised = before.raised(new.lower, new.lower_is_proved, found.load_factor, found.forces)
    return raised.lowered(new.upper, new.upper_is_proved, found.mechanism)


def _without_answer(problem: LimitProblem) -> str:
    named = broken(problem.problem, problem.limits)
    if not named:
        return "the problem has no largest value, or no forces that satisfy it"
    what = " and ".join(f"limit {name!r}" for name in named)
    return f"{what} cannot hold under these loads at any load factor"


def solved(
    problem: LimitProblem, solver: Any, tolerance: float, verbose: bool, options: dict[str, Any]
) -> Solution:
    """See :meth:`~cvxlimit.model.problem.LimitProblem.solve`."""
    ladder = asked_ladder(solver, None)
    if options:
        ladder = tuple(
            replace(settings, options={**settings.options, **options})
            for settings in ladder or problem.ladder(tolerance)[:1]
        )
    found = solved_at(problem, problem.at_present(), tolerance, ladder, verbose)
    found.__dict__["problem"] = problem
    return found


def solved_at(
    problem: LimitProblem, given: Assemblage, tolerance: float = TOLERANCE,
    ladder: Sequence[SolverSettings] | None = None, verbose: bool = False,
) -> Solution:  # fmt: skip
    """The solution where the Parameters' present values are those of the mechanics ``given``."""
    problem.shared = given.repeats or problem.shared or Repeats()
    given = replace(given, repeats=problem.shared)
    run = Run(
        given, problem.surfaces, formulation=problem.formulation, ladder=ladder, verbose=verbose,
        model="full",
    )  # fmt: skip
    run.surface = problem.surface
    found = drive(OneProblem(tolerance=tolerance, problem=problem), run)
    if problem.has_own:  # the mechanism is not that of the live load alone, or of no collapse
        note = found.note.removesuffix(str(found.dilatancy or "")).removesuffix("; ")
        found = replace(found, dilatancy=None, note=note)
    if problem.has_aim:
        found = replace(found, quantity="value of the aim", mechanism=None)
    return found
