"""Strictly feasible (Slater) states of a load alone: harmless live loads, dead loads that stand.

Eq. 30 is homogeneous: forces that carry a load alone, strictly inside, carry any multiple of it
with any other forces added far out, so a live load carried alone does no harm, and a dead load
carried alone stands. What is asked of a convex step is then the largest share t <= 1 of the load;
its rows are cones, so that share is 0 or 1, and where it is 0 the step was built at a wrong place.
Penalty steps find a better one: they may buy what is missing, at a price that grows.

Forces found are checked outside the solver
(:func:`cvxlimit.methods.admissible.carried_exactly`); where none are found nothing is claimed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cvxlimit.arrays import FloatArray
from cvxlimit.methods.admissible import INSIDE, carried_exactly
from cvxlimit.methods.driver import Run
from cvxlimit.methods.interaction.restriction.lower_bound import TrueStrength, central_states
from cvxlimit.methods.interaction.restriction.safe_step import SafeStep, StepState
from cvxlimit.methods.interaction.settings import PROOF, STEPS
from cvxlimit.methods.interaction.states.majorants import Point
from cvxlimit.model.problem import LargestFactor, LimitProblem
from cvxlimit.solvers import LimitState, SolverSettings

_SHRINK = 0.005
"""Steps are built this share nearer to the middle than the last forces."""

_CARRIED = 0.5
"""Share of the load from which it counts as carried: it is 0 or 1 but for rounding."""


def carrying_forces(
    run: Run, load: FloatArray, ladder: Sequence[SolverSettings]
) -> FloatArray | None:
    """Contact forces (n, 6) strictly inside Eq. 9 and 30 that carry a load alone, or None.

    They are in equilibrium to rounding, checked contact by contact. None is no proof that there
    are none.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.solvers import default_ladder
    >>> run = Run(builtin_scene("stack"))
    >>> weight = carrying_forces(run, run.assemblage.statics.dead, default_ladder())
    >>> bool(abs(weight[0, 2] - run.scaling.force) < 1e-9 * run.scaling.force)
    True
    >>> carrying_forces(run, run.assemblage.statics.live, default_ladder()) is None
    True
    """
    loaded = run.assemblage.under(load, load)
    for forces in _candidates(run, load, ladder):
        with run.clock.phase("certify"):
            found = carried_exactly(
                loaded,
                lambda reached: TrueStrength(reached, run.moments),
                forces,
                INSIDE,
                central_states,
            )
        if found is not None:
            return found
    return None


def _candidates(
    run: Run, load: FloatArray, ladder: Sequence[SolverSettings]
) -> Iterator[FloatArray]:
    """Forces that carry the load: without interaction, then by steps from there and the middle."""
    alone = run.assemblage.alone(load)
    problem = LimitProblem(alone, objective=LargestFactor(most=1.0))
    plain, _ = run.try_solvers(problem.solve, ladder)
    if (forces := _carried(plain)) is not None:
        yield forces
    with run.clock.phase("compile"):
        step = SafeStep(alone, run.moments)
    middle = Point.middle(step.statics.contacts)
    if forces is not None:
        yield from _stepped(run, step, step.point(forces, middle, PROOF.pressed), ladder)
    yield from _stepped(run, step, middle, ladder)


def _stepped(
    run: Run, step: SafeStep, point: Point, ladder: Sequence[SolverSettings]
) -> Iterator[FloatArray]:
    for price in STEPS.prices:
        at = point.shrunk(_SHRINK)

        def solver(rung: SolverSettings, at: Point = at, price: float | None = price) -> StepState:
            return step.solve(at, rung, price, most=1.0)

        state, _ = run.try_solvers(solver, ladder)
        if (forces := _carried(state)) is not None:
            yield forces
            point = step.point(forces, point, PROOF.pressed)


def _carried(state: LimitState) -> FloatArray | None:
    if state.forces is None or not state.load_factor or state.load_factor < _CARRIED:
        return None
    return state.forces / state.load_factor
