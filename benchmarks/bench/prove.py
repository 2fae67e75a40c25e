"""Brackets of every model of a case, proved by the package and written into its record."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fnmatch import fnmatchcase
from math import cos, pi
from time import process_time
from typing import Any

import numpy as np

from benchmarks.bench.case import READINGS, STATES, Case, cases
from cvxlimit import Certified, Scene, Solution, Status, ZeroDilatancy, __version__, solve
from cvxlimit.model.formulations import vertex_forces
from cvxlimit.solution.bracket import known
from cvxlimit.surfaces import Rocking

OCTAGON = cos(pi / 8)
"""Of a regular octagon: from its centre to a side, over that to a corner."""

MANY = 500
"""Contacts from which the search without dilatancy gets one start, and exact torsion less care."""


def exact(scene: Scene) -> Solution:
    """Torsion and shear on their exact limit; 5e-3 wide where more would take minutes."""
    return solve(scene, method="exact", tolerance=1e-3 if len(scene.contacts) < MANY else 5e-3)


def at_vertices(scene: Scene) -> Solution:
    """Coulomb forces at the corners of every joint."""
    return solve(scene, [Rocking()], formulation=vertex_forces)


def on_octagons(scene: Scene) -> Solution:
    """The same on regular octagons about the cones, turned in any way: no less than the cone, no
    more than a cone through their corners."""
    pairs = {pair: friction / OCTAGON for pair, friction in scene.contact_friction.items()}
    wider = scene.with_friction(scene.friction / OCTAGON, pairs)
    inner, outer = at_vertices(scene), at_vertices(wider)
    if outer.status is Status.DEAD_LOAD_UNSTABLE or inner.load_factor is None:
        return outer
    upper = {"upper": outer.upper, "upper_is_proved": outer.bracket.upper_is_proved}
    status = inner.status if outer.status is Status.CERTIFIED else Status.NOT_CERTIFIED
    return replace(inner, status=status, bracket=replace(inner.bracket, **upper))


def interaction(moments: str) -> Callable[[Scene], Solution]:
    """The certified method, default settings: branch and bound on the smallest scenes only."""
    return lambda scene: solve(scene, method=Certified(moments=moments))


def members(scene: Scene) -> Solution:
    """Some solutions without dilatancy."""
    budget = 150 if len(scene.contacts) < MANY else 60
    return solve(scene, method=ZeroDilatancy(tolerance=1e-4, searches=1, budget=budget))


MODELS: dict[str, Callable[[Scene], Solution]] = {
    "octagon": lambda scene: solve(scene, "octagon"),
    "conic": solve,
    "parabolic": lambda scene: solve(scene, "parabolic"),
    "exact": exact,
    "vertex-forces": at_vertices,
    "vertex-octagon": on_octagons,
    **{reading: interaction(reading) for reading in READINGS},
    "zero-dilatancy": members,
}
"""Functions from a scene to a solution, by the name of the model."""


def all_of(case: str = "*", model: str = "*") -> Iterator[str]:
    """Brackets into the records; those that stand are kept."""
    for each in cases(case):
        record = each.record()
        for name in record["models"]:
            if not fnmatchcase(name, model) or name in record["brackets"]:
                continue
            found = proved(each, name)
            brackets = {**record["brackets"], name: found}
            record["brackets"] = {m: brackets[m] for m in record["models"] if m in brackets}
            each.write(record)
            ends = f"{found['lower']} {found['upper']} {found['status']}"
            yield f"{each.name:26} {name:16} {ends} {found['seconds']:.1f} s"


def proved(each: Case, model: str) -> dict[str, Any]:
    """The bracket of one model, in the unit of the case's quantity."""
    parameter = each.record()["quantity"]["parameter"]
    start = process_time()
    solutions = {role: MODELS[model](each.read(role)) for role in each.roles}
    seconds = round(process_time() - start, 2)
    about = {"seconds": seconds, "cvxlimit": __version__}
    if parameter is None:
        (solution,) = solutions.values()
        if model in READINGS:
            keep_state(each, model, solution)
        return {**bounds(solution, each.factor), **about}
    falls = solutions["falls"].status is Status.DEAD_LOAD_UNSTABLE
    stands = solutions["stands"].status is Status.CERTIFIED and solutions["stands"].lower > 0.0
    if falls and stands:
        low, high = sorted(parameter.values())
        return {"lower": low, "upper": high, "status": "certified", **about}
    open_ones = ", ".join(f"{role}: {solution.status}" for role, solution in solutions.items())
    return {"lower": None, "upper": None, "status": f"open, {open_ones}", **about}


def bounds(solution: Solution, factor: float) -> dict[str, Any]:
    """Lower and upper bound; for a method without, the lowest and highest member that was found."""

    def scaled(number: float | None) -> float | None:
        return None if number is None else float(f"{factor * number:.12g}")

    if solution.members:
        found = [member.load_factor for member in solution.members]
        return {"lower": None, "upper": None, "found": [scaled(min(found)), scaled(max(found))],
                "status": str(solution.status)}  # fmt: skip
    return {"lower": scaled(known(solution.lower)), "upper": scaled(known(solution.upper)),
            "status": str(solution.status)}  # fmt: skip


def keep_state(each: Case, model: str, solution: Solution) -> None:
    """The best state known, which proves the lower bound: forces [V1, V2, N, M1, M2, MT]."""
    if solution.forces is None or known(solution.lower) is None:
        return
    STATES.mkdir(exist_ok=True)
    np.savez_compressed(STATES / f"{each.name}.{model}.npz", load_factor=solution.load_factor,
                        forces=np.asarray(solution.forces))  # fmt: skip
