"""What is said of surfaces that admit nothing or anything, where solvers alone say how it ends."""

from __future__ import annotations

import numpy as np
from cvxpy.settings import UNBOUNDED

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import BOUNDLESS, Run
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.surfaces.base import YieldSurface


def unlimited(run: Run) -> str:
    """A sentence on the shear or torsion that no surface limits, empty where all are, and where a
    formulation may limit them."""
    if run.formulation is not corner_compressions:
        return ""
    free = [
        name for name in ("V1", "V2", "MT") if not any(_limits(s, run, name) for s in run.surfaces)
    ]
    if not free:
        return ""
    names = " and ".join(filter(None, [", ".join(free[:-1]), free[-1]]))
    return f"no surface limits {names}"


def without_answer(run: Run) -> str:
    """A sentence on what solvers say where nothing is proved of it; empty if they say nothing."""
    claims = [outcome.status for _, outcome in run.attempts if outcome.claims_no_optimum]
    if not claims:
        return ""
    nothing = next(filter(None, (_nothing(surface, run) for surface in run.surfaces)), "")
    if claims[-1] == UNBOUNDED and not nothing:
        said = "solvers find forces for any load factor, which was not proved"
        return "; ".join(filter(None, [said, unlimited(run)]))
    said = "solvers find no forces within the surfaces that carry these loads"
    return "; ".join(filter(None, [f"{said}, which was not proved", nothing]))


def _limits(surface: YieldSurface, run: Run, component: str) -> bool:
    """True if a surface refuses a large force or torsion at some joint, of either sign."""
    contacts, weight = run.contacts, run.scaling.force
    forces = np.zeros((len(contacts), len(COLUMN)))
    forces[:, COLUMN["N"]] = weight
    for sign in (1.0, -1.0):
        forces[:, COLUMN[component]] = sign * BOUNDLESS * weight * run.scaling.length
        if any((y > 0.0).any() for y in surface.excess(forces, contacts)):
            return True
    return False


def _nothing(surface: YieldSurface, run: Run) -> str:
    """A sentence if a surface admits no compression at some joint, however large or small."""
    contacts, weight = run.contacts, run.scaling.force
    forces = np.zeros((len(contacts), len(COLUMN)))
    refused: list[np.ndarray] = []
    for share in (1.0 / BOUNDLESS, 1.0, BOUNDLESS):
        forces[:, COLUMN["N"]] = share * weight
        excess = np.full(len(contacts), -np.inf)
        for y in surface.excess(forces, contacts):
            if len(y) == len(contacts):
                excess = np.maximum(excess, y)
        refused.append(excess > 0.0)
    every = np.all(refused, axis=0) & ~contacts.is_point
    if not every.any():
        return ""
    name = contacts.names[int(np.argmax(every))]
    return f"surface {surface.name!r} admits no compression at contact {name!r}, however large"
