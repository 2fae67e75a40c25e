"""Strictly feasible (Slater) states of a load alone: harmless live loads, dead loads that stand.

Forces found are checked outside the solver; where none are found nothing is claimed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from cvxlimit.base.arrays import FloatArray
from cvxlimit.methods.driver import Run
from cvxlimit.methods.interaction.restriction.lower_bound import (
    TrueStrength,
    carried,
    central_states,
)
from cvxlimit.methods.interaction.restriction.steps import SafeStep
from cvxlimit.methods.interaction.settings import CLIMB, PROOF
from cvxlimit.model.problem import LimitProblem
from cvxlimit.model.statement import LargestFactor
from cvxlimit.proof.admissible import INSIDE, carried_exactly
from cvxlimit.readings.states.majorants import Point
from cvxlimit.solvers import SolverSettings


def carrying_forces(
    run: Run, load: FloatArray, ladder: Sequence[SolverSettings]
) -> FloatArray | None:
    """Contact forces (n, 6) strictly inside Eq. 9 and 30 that carry a load alone, in equilibrium to
    rounding; None is no proof that there are none."""
    loaded = run.assemblage.under(load, load)
    for forces in _candidates(run, load, ladder):
        with run.clock.phase("certify"):
            strength = partial(TrueStrength, moments=run.moments)
            found = carried_exactly(loaded, strength, forces, INSIDE, central_states)
        if found is not None:
            return found
    return None


def _candidates(
    run: Run, load: FloatArray, ladder: Sequence[SolverSettings]
) -> Iterator[FloatArray]:
    alone = run.assemblage.alone(load)
    problem = LimitProblem(alone, goal=LargestFactor(most=1.0))
    plain, _ = run.try_solvers(problem.run, ladder)
    if (forces := carried(plain)) is not None:
        yield forces
    with run.clock.phase("compile"):
        step = SafeStep(alone, run.moments)
    middle = Point.middle(step.statics.contacts)
    if forces is not None:
        yield from _stepped(run, step, step.point(forces, middle, PROOF.accepted), ladder)
    yield from _stepped(run, step, middle, ladder)


def _stepped(
    run: Run, step: SafeStep, point: Point, ladder: Sequence[SolverSettings]
) -> Iterator[FloatArray]:
    for price in CLIMB.prices:
        at = point.shrunk(CLIMB.retreats[0])
        state, _ = run.try_solvers(partial(step.solve, at, price=price, most=1.0), ladder)
        if (forces := carried(state)) is not None:
            yield forces
            point = step.point(forces, point, PROOF.accepted)
