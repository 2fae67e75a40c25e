"""A solution of a limit problem that its user has changed: with a bracket, or with the reason why
there is none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from cvxpy.settings import OPTIMAL, OPTIMAL_INACCURATE

from cvxlimit.methods.convex import Convex, Inquiry
from cvxlimit.methods.driver import Answer, Run, Steps, drive
from cvxlimit.model.limits import broken
from cvxlimit.model.problem import LimitProblem
from cvxlimit.solution import Solution, Status
from cvxlimit.solvers import rungs_of


@dataclass(frozen=True)
class OneProblem(Convex):
    """The convex method on a problem that exists, whose solvers start from the solve before."""

    problem: LimitProblem | None = None

    def steps(self, run: Run) -> Steps:
        assert self.problem is not None
        if self.problem.has_own:
            return (yield from self._own(run, self.problem))
        inquiry = Inquiry(run, "full", self.tolerance, self.budget, self.problem)
        status = yield from inquiry.ladder_climbed()
        self.problem.reference = inquiry.certifier
        return status

    def _own(self, run: Run, problem: LimitProblem) -> Steps:
        """With limits or an aim of the user's: the first solver with an answer is believed."""
        for settings in run.ladder or problem.ladder(self.tolerance):
            state = run.solve(problem.run, settings)
            run.note(state, settings)
            yield
            if state.forces is not None and state.outcome.status in (OPTIMAL, OPTIMAL_INACCURATE):
                run.best = Answer(state.load_factor, run.best.bracket, state.forces, None)
                run.remarks = [f"no bracket: {problem.said_own} of one's own"]
                return Status.NOT_CERTIFIED
            if state.outcome.claims_no_optimum:
                named = broken(problem.problem, problem.limits)
                what = " and ".join(f"limit {name!r}" for name in named)
                run.remarks = [
                    f"{what} cannot hold under these loads at any load factor"
                    if named
                    else "the problem has no largest value, or no forces that satisfy it"
                ]
                return Status.NOT_CERTIFIED
        return Status.SOLVER_FAILED


def solved(
    problem: LimitProblem, solver: Any, tolerance: float, verbose: bool, options: dict[str, Any]
) -> Solution:
    """See :meth:`~cvxlimit.model.problem.LimitProblem.solve`."""
    rungs = rungs_of(solver, None)
    if options:
        rungs = tuple(
            replace(rung, options={**rung.options, **options})
            for rung in rungs or problem.ladder(tolerance)[:1]
        )
    run = Run(
        problem.at_present(), problem.surfaces, formulation=problem.formulation, ladder=rungs,
        verbose=verbose, model="full",
    )  # fmt: skip
    run.surface = problem.surface
    found = drive(OneProblem(tolerance=tolerance, problem=problem), run)
    found.__dict__["problem"] = problem
    return found
