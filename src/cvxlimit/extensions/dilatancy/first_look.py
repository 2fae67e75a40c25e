"""A first look at what an associated answer owes to dilatancy, at the price of three solves."""

from __future__ import annotations

from dataclasses import replace

from cvxlimit.extensions.dilatancy.pair import Pair, pressed
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import Progress, Run
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import TOLERANCE


def first_look(solution: Solution, progress: Progress | None = None) -> Solution:
    """Does the work of :meth:`cvxlimit.Solution.first_look`, and returns the solution with what it
    shows, or as it was where there is nothing to look at or a solve fails.

    Friction held at the compressions of the answer gives a mechanism that slides without opening.
    At the price of this mechanism's dilatancy there are other forces, whose load factor is nearly
    one without dilatancy. Friction held at their compressions shows by how much it is not.
    """
    # Only plain associated answers to which dilatancy may matter are looked at.
    dilatancy, forces = solution.dilatancy, solution.forces
    words = solution.interaction, solution.flow, solution.torsion_shear
    is_one = words == ("none", "associated", "linear") and solution.lower_end is None
    if dilatancy is None or not dilatancy.is_worth_a_word or dilatancy.is_all:
        return solution
    if not is_one or forces is None:
        return solution
    run = Run(solution.scene, solution.surfaces or solution.surface, progress=progress)
    run.tell("looking at the load factor without dilatancy")
    pair = Pair(run, is_symmetric=True)
    compressions = forces[:, COLUMN["N"]] + (0.0 if run.mortar is None else run.mortar.pull)
    # First solve: a mechanism that slides without opening.
    first = pair.held(compressions, TOLERANCE)
    if first.mechanism is None:
        return solution
    # Second solve: forces at its price.
    state = pair.priced(pair.dilatancy(first.mechanism), TOLERANCE)
    if state.forces is None or state.load_factor is None:
        return solution
    # Third solve: what these forces lack.
    held = pair.held(pressed(state), TOLERANCE)
    if held.load_factor is None:
        return solution
    lacks = max((held.load_factor - state.load_factor) / run.scaling.unit(state.load_factor), 0.0)
    looked = replace(dilatancy, nearly=state.load_factor, lacks=lacks)
    note = solution.note.removesuffix(str(dilatancy)) + str(looked)
    return replace(solution, dilatancy=looked, note=note)
