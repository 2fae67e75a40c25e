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
from cvxlimit.methods.driver import Run
from cvxlimit.proof.admissible import INSIDE
from cvxlimit.proof.checks import Check, proved
from cvxlimit.proving.again import ProvedAgain
from cvxlimit.proving.claims import rests_on_a_tree
from cvxlimit.proving.solutions import known_or_asked
from cvxlimit.readings.named import parse_moments, reading_of
from cvxlimit.solution.bracket import Bracket


def checks(again: ProvedAgain) -> Iterator[Check]:
    """Every claim of a solution with certified interaction."""
    solution, run = again.solution, again.run
    name, given = solution.moments, again.moments
    found = reading_of(name) if given is None else parse_moments(given)
    run.moments = known_or_asked(found, solution.scene_name, "moments", name)
    if not solution.status.has_answer:
        strength = partial(TrueStrength, moments=run.moments)
        harmless = partial(again.harmless, strength, INSIDE, central_states)
        yield from again.without_answer(partial(_falls, again), harmless)
    else:
        yield from again.held_checks()
        yield from again.ends(_bracket(again, run.auxiliary_run()))


def _bracket(again: ProvedAgain, run: Run) -> Bracket:
    """What the mechanism proves of a run, and the forces with interaction."""
    by = again.by
    if by.rates is not None:
        UpperBound(run).offer(by.rates)
    if by.forces is not None and by.load_factor is not None:
        bounds = LowerBounds(run.assemblage, run.moments)
        run.best = bounds.checked(by.forces, by.load_factor).raising(run.best)
    return run.best.bracket


def _falls(again: ProvedAgain) -> Check:
    """What falls without interaction falls with it, and more does."""
    run, check = again.run, again.falls()
    if check.is_met and run.moments.has_eq_24:
        return check
    alone = run.auxiliary_run(run.assemblage.alone(run.assemblage.statics.dead))
    but = f"no proof{rests_on_a_tree(again.solution)}"
    is_met = _bracket(again, alone).upper < 0.5
    return proved(check.claim, is_met, but, "by the mechanism")
