"""A solution proved again, from the forces x and the mechanism u that it holds and nothing else.

By weak duality each of them bounds the load factor alpha without the other. In this order:

1. *Load factor*: x carries it, A x + f_dead + alpha f_live = 0 (:meth:`ProvedAgain.held_checks`).
2. *Lower bound*: x is admissible. *Upper bound*: the flow rule allows u, and what contacts take up
   in it is all that they can. One certificate recomputes both (:mod:`cvxlimit.proof.certificate`).
   It mixes x and u with a little of two reference states, which the solution holds where they are
   not found again by projections; they are checked as x and u are, so that false ones cannot help.
   A bound may be neither better nor worse than the one that is found anew.
3. *What follows* from these: the solution is packed anew, and each entry is held against that
   (:func:`~cvxlimit.proof.checks.compared`). A status follows from the width of the bracket and
   the tolerance that was asked for, which is part of the claim. What nothing finds, how an answer
   was found for example, is named and claims nothing.

A number that comes out otherwise is not proved, whoever changed it. Where no load factor exists, x
shows that any multiple of the live load is carried, or u that the dead load falls. Methods with
bounds of their own add how these are proved, under ``cvxlimit.checks``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cvxlimit.errors import InputError
from cvxlimit.io.results import result_from_dict
from cvxlimit.methods.driver import Run
from cvxlimit.methods.settlement import guided, quantity_of
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.statics import DOF
from cvxlimit.proof.checks import SLACK, Check, unseen
from cvxlimit.proving.again import ProvedAgain
from cvxlimit.proving.claims import derived_checks
from cvxlimit.proving.prove import BOTH_CASES, Proof, Scenes, scene_of
from cvxlimit.readings.moments import Moments
from cvxlimit.scene import Scene
from cvxlimit.solution import LOAD_FACTOR, Solution, Status
from cvxlimit.surfaces.coulomb import PARABOLIC, surfaces_named


def prove_result(what: Any, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    """A solution, or what a file of one holds; see :func:`cvxlimit.prove`."""
    solution = what if isinstance(what, Solution) else result_from_dict(what)
    given = scene_of(
        solution.scene_name, solution.scene_digest, scene or solution.solved_scene, BOTH_CASES
    )
    checks = solution_checks(solution, given, **own)
    return Proof(f"result of scene {solution.scene_name!r}", tuple(checks))


def solution_checks(
    solution: Solution, scene: Scene, surface: Any = None, moments: str | Moments | None = None,
    formulation: Formulation = corner_compressions,
) -> list[Check]:  # fmt: skip
    """Every claim of a solution about a scene, checked.

    ``surface`` and ``moments`` are needed where the solution names some of one's own.

    Raises
    ------
    InputError
        If the solution does not belong to the scene, or surfaces or moments are not known.
    """
    names = solution.of(scene).scene.contacts.names
    if solution.contact_names and tuple(solution.contact_names) != tuple(names):
        wrong = next(a for a, b in zip(solution.contact_names, names, strict=True) if a != b)
        raise InputError(
            f"the solution names contact {wrong!r}, but contacts of scene {scene.name!r} are "
            "others: it does not belong to this scene as it is detected here"
        )
    meant = surface_meant(solution, surface, solution.torsion_shear, solution.surfaces)
    # A reaction is proved by the load factor of a push, as a load factor is by itself.
    given: Scene | Assemblage = scene
    said = solution
    if solution.quantity != LOAD_FACTOR and solution.status is not Status.DEAD_LOAD_UNSTABLE:
        pushed = _pushed(solution, scene)
        if pushed is None:
            but = "neither a load factor nor a reaction with its mechanism and a state inside"
            return [Check(solution.quantity, False, but)]
        given, said = pushed
    again = ProvedAgain(said, Run(given, meant, formulation=formulation), moments)
    checks = [*again.checks(), *derived_checks(said, again.made())]
    if said is not solution:
        for i, check in enumerate(checks):
            if check.kind == "proved" or not check.is_met:
                checks[i] = replace(check, claim=f"push, {check.claim}")
        checks.append(unseen("mechanism", "along it the reaction is meant"))
    return checks


def _pushed(said: Solution, scene: Scene) -> tuple[Assemblage, Solution] | None:
    """The limit problem behind the reaction of supports that move, and what is said of its load
    factor alpha; None if the solution does not hold what makes it.

    The reaction is R = R0 - s alpha, s = 1 for the least and -1 for the largest one: alpha is the
    load factor of a push along the supports' motion, scaled to a unit, which the mechanism has, and
    R0 the reaction of the reference state.
    """
    claim, _, listed = said.quantity.partition(" of ")
    which, _, kind = claim.partition(" ")
    sign = {"least": 1.0, "largest": -1.0}.get(which)
    state = None if said.reference is None else said.reference.forces
    if said.load_factor is None or sign is None or kind not in ("reaction", "moment"):
        return None
    if state is None or state.shape != (len(scene.contacts), DOF):
        return None
    rates = said.mechanism or {}
    moved = {name: sign * rates[name] for name in scene.supports if name in rates}
    # These supports in the order in which they are listed; an id may have commas, and be the
    # beginning of another, which is meant where it fits.
    names = re.findall("|".join(sorted(map(re.escape, moved), key=len, reverse=True)), listed)
    if sorted(names) != sorted(moved) or said.quantity != quantity_of(which, kind, names):
        return None
    # The motion is a unit of the first one's way, or of its turn where a moment is meant.
    shift, turn = np.split(moved[names[0]], 2)
    size = np.linalg.norm(turn if kind == "moment" else shift)
    if abs(size - 1.0) > SLACK and (kind == "moment" or not turn.any()):
        return None
    aside, at_state = guided(scene, moved, sign, state)
    bracket = said.bracket.turned if sign > 0.0 else said.bracket
    factor = sign * (at_state - said.load_factor)
    return aside, replace(said, load_factor=factor, bracket=bracket.shifted(sign * at_state))


def surface_meant(said: Any, given: Any, torsion_shear: str = "linear", own: Any = ()) -> Any:
    """The surfaces ``given``, or those that a solution or a domain names, or else its ``own``."""
    if given is None:
        name = PARABOLIC if (torsion_shear, said.surface) == (PARABOLIC, "conic") else said.surface
        named = surfaces_named(name)
        # A choice like "octagon" goes on as it is, "rocking(conic)+sliding(octagon)" as surfaces.
        given = (named if named is None or name.endswith(")") else name) or own
    return known_or_asked(given, said.scene_name, "surface", said.surface)


def known_or_asked(found: Any, scene: str, option: str, name: str) -> Any:
    """What a solution or a domain of a scene names; raises InputError where it is one's own."""
    if not found:
        raise InputError(
            f"what is stored of scene {scene!r} rests on {option.removesuffix('s')}s of your own "
            f"({name}), which no file holds: give them as {option}=..."
        )
    return found
