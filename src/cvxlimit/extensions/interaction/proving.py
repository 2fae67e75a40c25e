"""Solutions with certified interaction, proved again."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from cvxlimit.errors import InputError
from cvxlimit.extensions.interaction.relaxation.upper import UpperBound
from cvxlimit.extensions.interaction.restriction.lower_bound import (
    LowerBounds,
    TrueStrength,
    central_states,
)
from cvxlimit.methods.wedging import without_limit
from cvxlimit.proof.admissible import INSIDE, carried_exactly
from cvxlimit.proof.checks import Check
from cvxlimit.proving.derived import why_above
from cvxlimit.proving.solutions import ProvedAgain
from cvxlimit.readings.named import parse_moments, reading_of
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import Bracket


def checks(again: ProvedAgain) -> Iterator[Check]:
    """Every claim of a solution with certified interaction."""
    solution, run = again.solution, again.run
    reading = reading_of(solution.moments) if again.moments is None else None
    if reading is None and again.moments is None:
        raise InputError(
            f"the solution of {solution.scene_name!r} rests on moments of one's own "
            f"({solution.moments!r}), which no file holds: give them as moments=..."
        )
    run.moments = reading or parse_moments(again.moments or "")
    if solution.status in (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED):
        yield without_limit(_harmless_inside(again), run, solution)
    elif solution.status is Status.DEAD_LOAD_UNSTABLE:
        yield _cannot_stand(again)
    else:
        yield from again.held_checks()
        yield from again.ends([_bracket_with_interaction(again)])


def _bracket_with_interaction(again: ProvedAgain) -> Bracket:
    run, solution = again.run.auxiliary_run(), again.solution
    if again.mechanism is not None:
        UpperBound(run).offer(again.mechanism)
    if again.forces is not None and solution.load_factor is not None:
        bounds = LowerBounds(run.assemblage, run.moments)
        run.best = bounds.checked(again.forces, solution.load_factor).raising(run.best)
    return run.best.bracket


def _cannot_stand(again: ProvedAgain) -> Check:
    run, dead = again.run, again.run.assemblage.statics.dead
    check = again.falls()
    if check.is_met and run.moments.has_eq_24:  # what falls without interaction falls with it
        return check
    alone = run.auxiliary_run(run.assemblage.alone(dead))
    if again.mechanism is not None:
        UpperBound(alone).offer(again.mechanism)
    is_met = alone.best.bracket.upper < 0.5
    found = "by the mechanism" if is_met else why_above(again.solution, "no proof")
    return Check(check.claim, is_met, found)


def _harmless_inside(again: ProvedAgain) -> Check:
    claim, run = "the live load does no harm", again.run
    live = run.assemblage.statics.live
    loaded = run.assemblage.under(live, live)
    strength = partial(TrueStrength, moments=run.moments)
    found = None
    if again.forces is not None and again.carries_live(again.forces):
        found = carried_exactly(loaded, strength, again.forces, INSIDE, central_states)
    return Check(claim, found is not None, "forces strictly inside Eq. 30 carry it alone"
                 if found is not None else "the forces do not carry it alone")  # fmt: skip
