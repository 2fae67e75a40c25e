"""States strictly inside that carry one load alone.

They show that a live load is harmless, or that a structure stands under its dead load. Their forces
are checked outside the solver. Where no such state is found nothing is claimed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.interaction.restriction.lower_bound import (
    TrueStrength,
    carried,
    central_states,
)
from cvxlimit.extensions.interaction.restriction.steps import SafeStep
from cvxlimit.extensions.interaction.settings import CLIMB, PROOF
from cvxlimit.extensions.interaction.states.majorants import Point
from cvxlimit.methods.driver import Run
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LargestFactor
from cvxlimit.proof.admissible import INSIDE, carried_exactly
from cvxlimit.solvers import SolverSettings


def carrying_forces(
    run: Run, load: FloatArray, ladder: Sequence[SolverSettings]
) -> FloatArray | None:
    """Returns contact forces (n, 6), in the order V1, V2, N, M1, M2, MT, that are strictly inside
    Eq. 9 and 30 and carry a ``load`` (6 per free block) alone, in equilibrium to rounding. None is
    no proof that there are none."""
    loaded = run.assemblage.under(load, load)
    for forces in _candidates(run, load, ladder):
        with run.clock.phase("certify"):
            strength = TrueStrength(loaded, run.moments)
            exact = carried_exactly(strength, forces, INSIDE, central_states)
        if exact is not None:
            return exact
    return None


def _candidates(
    run: Run, load: FloatArray, ladder: Sequence[SolverSettings]
) -> Iterator[FloatArray]:
    """Yields contact forces (n, 6) that might do, by problems that cost more and more."""
    # Forces without interaction.
    alone = run.assemblage.alone(load)
    problem = LimitProgram(alone, goal=LargestFactor(most=1.0))
    plain, _ = run.try_solvers(problem.run, ladder)
    if (forces := carried(plain)) is not None:
        yield forces
    # Steps with interaction, from those forces and from pressure in the middle of every contact.
    with run.clock.phase("compile"):
        step = SafeStep(alone, run.moments)
    middle = Point.middle(step.statics.contacts)
    if forces is not None:
        yield from _stepped(run, step, step.point(forces, middle, PROOF.accepted), ladder)
    yield from _stepped(run, step, middle, ladder)


def _stepped(
    run: Run, step: SafeStep, point: Point, ladder: Sequence[SolverSettings]
) -> Iterator[FloatArray]:
    """Yields the forces (n, 6) of steps from a point, each step with a higher price of slack and
    from the forces of the last one that carried the load."""
    for price in CLIMB.prices:
        at = point.shrunk(CLIMB.retreats[0])
        state, _ = run.try_solvers(partial(step.solve, at, price=price, most=1.0), ladder)
        if (forces := carried(state)) is not None:
            yield forces
            point = step.point(forces, point, PROOF.accepted)
