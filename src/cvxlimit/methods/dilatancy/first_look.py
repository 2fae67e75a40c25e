"""A first look at what an associated answer owes to dilatancy, at the price of three solves."""

from __future__ import annotations

from dataclasses import replace

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.dilatancy.pair import Pair, pressed
from cvxlimit.methods.driver import Run, dilatancy_in
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.solution.kinematics import Dilatancy

_TOLERANCE = 1e-5
"""Of the three problems: what a first look lacks is 1e-4 of the load factor and more."""


def without_dilatancy(run: Run) -> Dilatancy | None:
    """Dilatancy in a run's best answer, and where it is worth a word what is left without it.

    Friction held at the compressions of the answer gives a mechanism that slides without opening,
    the price of its dilatancy other forces, and friction held at theirs what these lack. Not for
    runs among many of one geometry, whose answers are single numbers.
    """
    found = dilatancy_in(run, run.best)
    if found is None or not found.is_worth_a_word or run.formulation is not corner_compressions:
        return found
    is_one = run.repeats is None and run.best.lower_end is None
    if not is_one or found.is_all or run.best.forces is None:
        return found
    run.tell("looking at the load factor without dilatancy")
    pair = Pair(run.auxiliary_run(), is_symmetric=True)
    first = pair.held(run.best.forces[:, COLUMN["N"]], _TOLERANCE)
    if first.mechanism is None:
        return found
    forces = pair.priced(pair.dilatancy(first.mechanism), _TOLERANCE)
    if forces.forces is None or forces.load_factor is None:
        return found
    held = pair.held(pressed(forces), _TOLERANCE)
    if held.load_factor is None:
        return found
    lacks = (held.load_factor - forces.load_factor) / run.scaling.unit(forces.load_factor)
    return replace(found, nearly=forces.load_factor, lacks=max(lacks, 0.0))
