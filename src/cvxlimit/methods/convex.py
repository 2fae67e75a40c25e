"""Without interaction: one convex problem, its bracket closed."""

from __future__ import annotations

from dataclasses import dataclass

from cvxlimit.base.checks import not_negative, ratio
from cvxlimit.methods.convex_search import ConvexSearch
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.methods.wedging import judged
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import TOLERANCE


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
    axis = ""

    tolerance: float = TOLERANCE
    budget: float = 120.0

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        not_negative(self.budget, "budget")

    def steps(self, run: Run) -> Steps:
        run.tell(f"compiling {len(run.scene.free)} blocks x {len(run.contacts)} contacts")
        search = ConvexSearch(run, run.model, self.tolerance, self.budget)
        status = yield from search.steps()
        return judged(run) if status is Status.UNBOUNDED else status
