"""A first look at what an associated answer owes to dilatancy, at the price of three solves."""

from __future__ import annotations

from dataclasses import replace

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.dilatancy.pair import Pair, pressed
from cvxlimit.methods.driver import Progress, Run
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import TOLERANCE


def first_look(solution: Solution, progress: Progress | None = None) -> Solution:
    """:meth:`cvxlimit.Solution.first_look`.

    Friction held at the compressions of the answer gives a mechanism that slides without opening,
    the price of its dilatancy other forces, and friction held at theirs what these lack.
    """
    found, forces = solution.dilatancy, solution.forces
    words = solution.interaction, solution.flow, solution.torsion_shear
    is_one = words == ("none", "associated", "linear") and solution.lower_end is None
    if found is None or not found.is_worth_a_word or found.is_all or not is_one or forces is None:
        return solution
    run = Run(solution.scene, solution.surfaces or solution.surface, progress=progress)
    run.tell("looking at the load factor without dilatancy")
    pair = Pair(run, is_symmetric=True)
    compressions = forces[:, COLUMN["N"]] + (0.0 if run.mortar is None else run.mortar.pull)
    first = pair.held(compressions, TOLERANCE)
    if first.mechanism is None:
        return solution
    state = pair.priced(pair.dilatancy(first.mechanism), TOLERANCE)
    if state.forces is None or state.load_factor is None:
        return solution
    held = pair.held(pressed(state), TOLERANCE)
    if held.load_factor is None:
        return solution
    lacks = max((held.load_factor - state.load_factor) / run.scaling.unit(state.load_factor), 0.0)
    looked = replace(found, nearly=state.load_factor, lacks=lacks)
    note = solution.note.removesuffix(str(found)) + str(looked)
    return replace(solution, dilatancy=looked, note=note)
