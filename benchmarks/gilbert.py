"""Gilbert's scheme for friction without dilatancy: cones rotated about the last normal forces.

Gilbert, Casapulla and Ahmed (2006) solve associated problems whose friction hardly grows with the
normal force, so that sliding closes joints by a little instead of opening them, and move these
cones towards the normal forces found. It is what zero dilatancy is compared with, which starts
from such iterates where its own pairs of problems find nothing, and no method of the package: its
stop says nothing about Coulomb's law, and its load factor is no bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import count, positive, ratio
from cvxlimit.errors import ModelError
from cvxlimit.extensions.dilatancy.pair import ETA, FINE, WEIGHT, Reduced
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex import standing
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import rounded
from cvxlimit.solvers import ladder_for


@dataclass(frozen=True)
class Gilbert(Method):
    """Gilbert's scheme, with a check of its answer.

    It stops when the load factor does not change any more, as published, which says nothing about
    Coulomb's law at the normal forces found: that is checked outside the solver, and an answer
    whose forces exceed it is not called converged.

    Attributes
    ----------
    tolerance : float
        Relative change of the load factor at which the scheme stops.
    excess : float
        By how much Coulomb's law may be exceeded in an answer, over the mean weight of a block.
    eta : float
        How far cones are rotated beyond the vertical.
    weight : float
        Weight of the new normal forces against the old ones.
    cohesion : float
        Fictitious cohesion: a force per contact, over the mean weight of a block.
    max_iterations : int
        Most problems after the first, associated one.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> solution = solve(builtin_scene("ferris-tin-loi-1"), method=Gilbert())
    >>> round(solution.load_factor, 2)  # published: 0.639918
    0.64
    """

    name = "gilbert"
    answers = "Gilbert's scheme for one solution without dilatancy, with a check of its friction"
    axis = "flow"
    surfaces, takes, reduces = ("conic", "facets"), ("reactions",), False

    tolerance: float = 1e-3
    excess: float = 1e-2
    eta: float = ETA
    weight: float = WEIGHT
    cohesion: float = 1e-5
    max_iterations: int = 200

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        positive(self.excess, "excess")
        positive(self.eta, "eta")
        if not 0.0 < self.weight <= 1.0:
            raise ModelError(f"weight must be above 0 and at most 1, got {self.weight!r}")
        positive(self.cohesion, "cohesion")
        count(self.max_iterations, 1, "max_iterations")

    def steps(self, run: Run) -> Steps:
        contacts, unit = run.contacts, run.scaling.force / len(run.scene.free)
        search = standing(run, run.model)
        if search is None:
            return Status.DEAD_LOAD_UNSTABLE
        # The associated problem, and the scheme's with friction held and cones rotated by eta.
        with run.clock.phase("compile"):
            reduced = Reduced(run, search)
            held = cp.Parameter(len(reduced.kept))
            problem, scheme = reduced.problem(), reduced.held(held, self.eta)
            mu = np.where(contacts.friction > 0.0, contacts.friction, np.inf)
            fictitious = self.cohesion * unit / mu  # A compression: friction makes a force of it.
        pressed: FloatArray | None = None
        for number in range(self.max_iterations + 1):
            state, settings = run.try_solvers(problem.run, run.ladder or ladder_for("pairs", FINE))
            change = run.change(state)
            run.note(state, settings, change=change)
            if state.forces is None or state.load_factor is None:
                claims = state.outcome.claims_no_optimum
                return Status.NOT_CONVERGED if claims else Status.SOLVER_FAILED
            # How far the answer exceeds Coulomb's law at its own normal forces.
            over = [y.max() for s in run.surfaces for y in s.excess(state.forces, contacts)]
            excess = max(float(max(over)), 0.0) / unit
            run.best = Answer(state.load_factor, run.best.bracket, state.forces, state.mechanism)
            run.remarks = [self._remark(run, change, excess)]
            if number > 1 and change is not None and change <= self.tolerance:
                return Status.CONVERGED if excess <= self.excess else Status.NOT_CONVERGED
            # The next cones are rotated about a mean of the last normal forces and those before.
            normal = state.forces[:, COLUMN["N"]]
            pressed = normal if pressed is None else pressed + self.weight * (normal - pressed)
            held.value = ((1.0 + self.eta) * pressed + fictitious)[reduced.kept]
            problem = scheme
            yield
        return Status.NOT_CONVERGED

    def _remark(self, run: Run, change: float | None, excess: float) -> str:
        """Returns the remark: how far the scheme came, and what its answer is worth."""
        return (
            f"Gilbert's scheme after {len(run.history)} problems, last change "
            f"{change or 1.0:.1e}: Coulomb's law is exceeded by {excess:.2g} mean block weights; "
            f"associated friction gives {rounded(run.load_factors[0] or np.nan)}"
        )
