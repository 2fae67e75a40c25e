"""A proof of a bound whose forces satisfy Eq. 30 only as well as a solver does.

Forces at full slip have no share of friction to spare, and mixing in a state that has some moves
pressure centres, about which the shear then turns by more than it gains: Eq. 30 is not convex. But
with the centres held it is. So the frozen problem at the forces' own centres is solved once more
with a little less friction, in a contact that is a little smaller, and its forces are put into
balance by changes that leave the centres where they are. What is left over is larger than what
solver and rounding leave, and the checker has the last word.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.bracket import Bracket
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.driver import Answer, Run
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.restriction.lower_bound import LowerBound, LowerBounds
from cvxlimit.methods.interaction.settings import PROOF
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.methods.interaction.states.support import half_extent
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.formulations import ForceModel, Part
from cvxlimit.solvers import clarabel_at


def prove(run: Run, checker: LowerBounds) -> None:
    """Give ``run.best`` a proved lower bound where it has none, if that costs little of its width.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> run = Run(builtin_scene("single-block"))
    >>> prove(run, LowerBounds(run.assemblage, run.moments))  # nothing to prove
    >>> run.best.bracket.lower
    -inf
    """
    best = run.best
    if best.forces is None or best.load_factor is None or best.bracket.lower_is_proved:
        return
    spare = max(PROOF.most_of_width * best.bracket.width, PROOF.most_spent) * best.bracket.unit
    for margin in PROOF.margins:
        with run.clock.phase("certify"):
            found = _proof(run, checker, best.forces, margin)
        if found is not None and found.is_proved:
            if found.value >= best.bracket.lower - spare:
                run.best = _with_bound(best, found)
            return


def _with_bound(best: Answer, found: LowerBound) -> Answer:
    bracket = replace(best.bracket, lower=found.value, lower_is_proved=True)
    return replace(best, bracket=bracket, load_factor=found.load_factor, forces=found.forces)


def _proof(run: Run, checker: LowerBounds, forces: FloatArray, margin: float) -> LowerBound | None:
    contacts, extent = run.contacts, half_extent(run.contacts)
    at = Pressure.of(forces, contacts)
    centre = np.stack([at.e1, at.e2], axis=1) / extent
    centre = np.clip(centre, margin - 1.0, 1.0 - margin)
    is_idle = forces[:, COLUMN["N"]] <= PROOF.idle * run.scaling.force
    copies = run.moments.safe_copies(contacts, centre).without(np.flatnonzero(is_idle))
    state = HullProblem(_slippery(run.assemblage, margin)).solve(copies, clarabel_at(1e-11)[0])
    if state.forces is None or state.load_factor is None:
        return None
    held = _held(contacts, centre * extent, np.flatnonzero(~is_idle))
    balance = Balance(run.assemblage.statics, held)
    try:
        balanced = balance.balanced(state.forces, state.load_factor, run.assemblage.statics)
    except RuntimeError:  # contacts that are held resist nothing in some way of moving
        return None
    return checker.checked(balanced, state.load_factor)


def _slippery(assemblage: Assemblage, margin: float) -> Assemblage:
    contacts = assemblage.contacts
    less = replace(contacts, friction=(1.0 - margin) * contacts.friction)
    return replace(assemblage, statics=replace(assemblage.statics, contacts=less))


def _held(contacts: Contacts, e: FloatArray, pressed: IntArray) -> ForceModel:
    e1, e2 = e[pressed].T
    parts = [
        Part("n", {"N": 1, "M1": e2, "M2": -e1}, pressed, nonneg=True),
        Part("v1", {"V1": 1, "MT": -e2}, pressed),
        Part("v2", {"V2": 1, "MT": e1}, pressed),
        Part("t", {"MT": 1}, pressed),
    ]
    return ForceModel(contacts, parts)


def basis(bracket: Bracket, *remarks: str) -> str:
    """How the bounds were proved, or under which assumption they hold; and what else is to say.

    Example
    -------
    >>> basis(Bracket(0.1, np.inf, True), "the time is up").split(";")[0]
    'lower bound proved: its forces satisfy Eq. 30 to rounding'
    """
    if not np.isfinite(bracket.lower):
        lower = "no forces were found that satisfy Eq. 30"
    elif bracket.lower_is_proved:
        lower = "lower bound proved: its forces satisfy Eq. 30 to rounding"
    else:
        lower = (
            f"lower bound not proved: its forces exceed Eq. 30 by up to {PROOF.accepted:.0e} of "
            "the total load; it holds if no block moves more than ten times as fast at collapse, "
            "per unit of work of the live load, as the block with the least live load would alone"
        )
    upper = (
        "upper bound proved against the hull of all true states"
        if bracket.upper_is_proved
        else "upper bound not proved: it holds if no contact bears more than ten times the total "
        "load, or ten times the largest force found"
    )
    return "; ".join(part for part in (lower, upper, *remarks) if part)
