"""A solution of a limit problem that its user has changed: with a bracket, or with the reason why
there is none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from cvxpy.settings import INFEASIBLE, OPTIMAL, OPTIMAL_INACCURATE, SOLVER_ERROR, UNBOUNDED

from cvxlimit.errors import ModelError
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex import Convex, ConvexSearch
from cvxlimit.methods.driver import Run, Steps, drive
from cvxlimit.methods.wedging import judged
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.problem.limits import smallest_conflict
from cvxlimit.problem.own_limits import OwnCertifier, OwnState
from cvxlimit.problem.program import UserProgram
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, known
from cvxlimit.solvers import LimitState, SolverSettings, asked_ladder
from cvxlimit.solvers.program import check_options
from cvxlimit.solvers.table import options_of
from cvxlimit.surfaces.coulomb import Bounds

_NOT_STORED = "result files keep no limits: once stored, these bounds cannot be proved again"


@dataclass(frozen=True)
class OneProblem(Convex):
    """The convex method on a problem that exists, whose solvers start from the solve before."""

    problem: UserProgram | None = None

    def steps(self, run: Run) -> Steps:
        assert self.problem is not None
        if self.problem.has_own:
            return (yield from self._own(run, self.problem))
        search = ConvexSearch(run, "full", self.tolerance, self.budget, self.problem)
        status = yield from search.steps()
        self.problem.reference = search.certifier.references.known
        return judged(run) if status is Status.UNBOUNDED else status

    def _own(self, run: Run, problem: UserProgram) -> Steps:
        """Solves with limits or an aim of the user's, with both bounds, where all of them are
        linear."""
        search = ConvexSearch(run, "full", self.tolerance, self.budget, problem)
        limits, proof, why = problem.contact_limits(), None, ""
        if isinstance(limits, str):
            why = f"no bracket: {limits}"
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
                run.remarks = [_without_answer(problem, state.outcome.status)]
                return Status.NOT_CERTIFIED
            if best.is_within(self.tolerance) and best.is_proved:
                run.remarks = [f"with {problem.said_own}", _NOT_STORED]
                return Status.CERTIFIED
            if found is not None and (proof is None or not best.has_any):
                break  # another solver would not prove more
        if found is None:
            return Status.SOLVER_FAILED
        why = why if proof is None else proof.why_open(run.best.bracket)
        stored = [_NOT_STORED] if run.best.bracket.has_any else []
        run.remarks = [f"with {problem.said_own}", why, *stored]
        return Status.NOT_CERTIFIED

    def _bracketed(
        self,
        search: ConvexSearch,
        problem: UserProgram,
        proof: OwnCertifier | None,
        state: LimitState,
    ) -> Answer:
        value = state.load_factor if problem.aim is None else problem.sense * problem.tell(state)
        if proof is None:
            return Answer(value, Bracket(), state.forces, None)
        mechanism, multipliers = state.mechanism, state.own.get("multipliers")
        certifier, about = search.certifier, (mechanism, multipliers)
        found, reserve = _own_state(certifier, state), None
        if (dead := certifier.references.dead_state) is not None:
            reserve = OwnState(dead, certifier.references.factor, np.zeros(0))
        bracket = proof.bracket(found, reserve, *about)
        if not np.isfinite(bracket.upper) and multipliers is not None:
            search.aside.opening_field()
            bracket = proof.bracket(found, reserve, *about)
        # the dead load alone may break the limits, or carry another load factor than theirs
        others = _inside(search.run, problem)
        while not bracket.is_within(self.tolerance) and (near := next(others, None)) is not None:
            other = proof.bracket(found, _own_state(certifier, near), *about)
            bracket = bracket.raised(other.lower, other.lower_is_proved)
        return Answer(value, bracket, state.forces, mechanism)


def _own_state(certifier: Certifier, state: LimitState) -> OwnState | None:
    forces, factor = certifier.given(state), state.load_factor
    if forces is None or factor is None:
        return None
    return OwnState(forces, factor, state.own.get("others", np.zeros(0)))


def _inside(run: Run, problem: UserProgram) -> Iterator[LimitState]:
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


def _better(before: Answer, found: Answer) -> Answer:
    new = found.bracket
    raised = before.raised(new.lower, new.lower_is_proved, found.load_factor, found.forces)
    return raised.lowered(new.upper, new.upper_is_proved, found.mechanism)


def _without_answer(problem: UserProgram, status: str) -> str:
    if status == UNBOUNDED:
        return f"there is no largest value: {problem.said_own} leave it free"
    named = [f"limit {name!r}" for name in smallest_conflict(problem.problem, problem.limits)]
    if not named:
        return "no forces were found that carry these loads"
    together = " together" if len(named) > 1 else ""
    return f"{' and '.join(named)} cannot hold{together} under these loads at any load factor"


_CVXPYS = {
    "gp": "the problem is convex as it stands",
    "qcp": "the problem is convex as it stands",
    "requires_grad": "solution.sensitivity() has derivatives, and limits their dual_value",
    "enforce_dpp": "",
    "ignore_dpp": "",
    "canon_backend": "",
}
"""Words of ``cp.Problem.solve``, and why some can mean nothing here; the others say how CVXPY
compiles, which has no part in the answer."""


def solved(
    problem: UserProgram, solver: Any, tolerance: float, verbose: bool, options: dict[str, Any]
) -> Solution:
    """See :meth:`~cvxlimit.LimitProblem.solve`."""
    ladder, own = None if solver is None else asked_ladder(solver, None), dict(options)
    for word, only in _CVXPYS.items():
        if own.pop(word, None) and only:
            raise ModelError(f"solve has no {word}=True: {only}; problem.problem.solve is CVXPY's")
    if own:
        tried = ladder or problem.ladder(tolerance)
        settings = next((each for each in tried if own.keys() <= options_of(each.name)), tried[0])
        check_options(settings, own, ("tolerance", "verbose", "warm_start", "solver", *_CVXPYS))
        ladder = (replace(settings, options={**settings.options, **own}),)
    problem.states = []
    try:
        found, best = _solved(problem, problem.at_present(), tolerance, ladder, verbose)
        _tell(problem, found, best)
    finally:
        problem.states = None
    if problem.sense < 0.0:
        factor = None if found.load_factor is None else -found.load_factor
        found = replace(found, load_factor=factor, bracket=found.bracket.turned)
    return found


def _tell(problem: UserProgram, found: Solution, best: Answer) -> None:
    """Leave the values of the answer in CVXPY's variables, duals and problem: those of the states
    whose forces and mechanism it has, and not of any that were asked for its bracket."""
    states = problem.states or []
    primal = [state for state in states if state.forces is not None and state.forces is best.forces]
    dual = [
        state
        for state in states
        if state.mechanism is not None and state.mechanism is best.mechanism
    ]
    has_values = found.load_factor is not None or found.status is Status.NOT_CERTIFIED
    if has_values and primal:
        status = OPTIMAL if found.status is Status.CERTIFIED else primal[0].outcome.status
        problem.tell(primal[0], (dual or primal)[0], status)
        return
    claims = [state.outcome.status for state in states if state.outcome.claims_no_optimum]
    ends = {Status.LIVE_LOAD_HARMLESS: UNBOUNDED, Status.DEAD_LOAD_UNSTABLE: INFEASIBLE}
    problem.tell_none(ends.get(found.status, "") or (claims or [SOLVER_ERROR])[-1])


def solved_at(
    problem: UserProgram, given: Assemblage, tolerance: float = TOLERANCE,
    ladder: Sequence[SolverSettings] | None = None,
) -> Solution:  # fmt: skip
    """The solution where the Parameters' present values are those of the mechanics ``given``."""
    return _solved(problem, given, tolerance, ladder)[0]


def _solved(
    problem: UserProgram, given: Assemblage, tolerance: float,
    ladder: Sequence[SolverSettings] | None = None, verbose: bool = False,
) -> tuple[Solution, Answer]:  # fmt: skip
    """The solution, and the answer that it was made of."""
    given = replace(given, strengths=problem.strengths)
    surfaces = [s for s in problem.surfaces if s.name != Bounds.name]  # others add what they need
    run = Run(
        given, surfaces, formulation=problem.formulation, ladder=ladder, verbose=verbose,
        model="full",
    )  # fmt: skip
    run.surface = problem.surface
    found = drive(OneProblem(tolerance=tolerance, problem=problem), run)
    if problem.has_own:  # the mechanism is not that of the live load alone, or of no collapse
        note = found.note.removesuffix(str(found.dilatancy or "")).removesuffix("; ")
        found = replace(found, dilatancy=None, note=note)
        found.__dict__["own_limits"] = problem.said_own
    if problem.aim is not None:
        found = replace(found, quantity="value of the aim", mechanism=None)
    return found, run.best
