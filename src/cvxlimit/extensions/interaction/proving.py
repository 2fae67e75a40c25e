"""Solutions with certified interaction, proved again: what the method adds at ``cvxlimit.checks``.

The lower bound rests on forces inside Eq. 30, to which reference states inside are sought anew; the
upper one on a mechanism of the convex relaxation. What branch and bound has raised further rests on
its tree, which no file holds: that is said.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from cvxlimit.extensions.interaction.relaxation.upper import UpperBound
from cvxlimit.extensions.interaction.restriction.lower_bound import (
    LowerBounds,
    TrueStrength,
    central_states,
)
from cvxlimit.methods.wedging import without_limit
from cvxlimit.proof.admissible import INSIDE, carried_exactly
from cvxlimit.proof.checks import Check, proved
from cvxlimit.proving.derived import rests_on_a_tree
from cvxlimit.proving.solutions import ProvedAgain, known_or_asked
from cvxlimit.readings.named import parse_moments, reading_of
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import Bracket


def checks(again: ProvedAgain) -> Iterator[Check]:
    """Every claim of a solution with certified interaction."""
    solution, run = again.solution, again.run
    name, given = solution.moments, again.moments
    found = reading_of(name) if given is None else parse_moments(given)
    run.moments = known_or_asked(found, solution.scene_name, "moments", name)
    if solution.status in (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED):
        yield without_limit(_harmless_inside(again), run, solution)
    elif solution.status is Status.DEAD_LOAD_UNSTABLE:
        yield _cannot_stand(again)
    else:
        yield from again.held_checks()
        yield from again.ends(_bracket_with_interaction(again))


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
    but = f"no proof{rests_on_a_tree(again.solution)}"
    return proved(check.claim, alone.best.bracket.upper < 0.5, but, "by the mechanism")


def _harmless_inside(again: ProvedAgain) -> Check:
    claim, run = "the live load does no harm", again.run
    live = run.assemblage.statics.live
    loaded = run.assemblage.under(live, live)
    strength = partial(TrueStrength, moments=run.moments)
    found = None
    if again.forces is not None and again.carries_live(again.forces):
        found = carried_exactly(loaded, strength, again.forces, INSIDE, central_states)
    by = "forces strictly inside Eq. 30 carry it alone"
    return proved(claim, found is not None, "the forces do not carry it alone", by)
