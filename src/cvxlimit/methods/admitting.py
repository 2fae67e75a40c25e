"""Why solvers find no forces, or forces for any load factor, in words that name the surface.

A yield surface of one's own may be misstated. One that admits no compression N at some contact
(friction with a wrong sign) leaves no forces at all; where none limits the shear V1, V2 or the
torsion MT, any live load may be carried. Neither is what a solver's status says, so both are sought
by probes: forces of one component, far smaller and far larger than the loads, are put into the
surfaces' yield functions at every contact. What is found is a sentence of the note, no proof.
"""

from __future__ import annotations

import numpy as np
from cvxpy.settings import UNBOUNDED

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import BOUNDLESS, Run
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.surfaces.base import YieldSurface, stated


def unlimited(run: Run) -> str:
    """A sentence on the shear or torsion that no surface limits, empty where all are, and where a
    formulation may limit them."""
    if run.formulation is not corner_compressions:
        return ""
    each = {name: any(_limits(s, run, name) for s in run.surfaces) for name in ("V1", "V2", "MT")}
    free = [name for name, is_limited in each.items() if not is_limited]
    names = " and ".join(filter(None, [", ".join(free[:-1]), *free[-1:]]))
    return f"no surface limits {names}" if free else ""


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
    large = BOUNDLESS * weight * (run.scaling.length if component == "MT" else 1.0)
    for sign in (1.0, -1.0):
        forces[:, COLUMN[component]] = sign * large
        if any((y > 0.0).any() for y in surface.excess(forces, contacts)):
            return True
    return False


def _nothing(surface: YieldSurface, run: Run) -> str:
    """A sentence if a surface admits no compression at some joint, however large or small."""
    contacts, weight = run.contacts, run.scaling.force
    forces = np.zeros((len(contacts), len(COLUMN)))
    conditions, every = stated(surface, contacts), ~contacts.is_point
    for share in (1.0 / BOUNDLESS, 1.0, BOUNDLESS):
        forces[:, COLUMN["N"]] = share * weight
        refused = np.zeros(len(contacts), dtype=bool)
        for condition, y in zip(conditions, surface.excess(forces, contacts), strict=True):
            refused[condition.rows(len(contacts))[y > 0.0]] = True
        every &= refused
    if not every.any():
        return ""
    name = contacts.names[int(np.argmax(every))]
    return f"surface {surface.name!r} admits no compression at contact {name!r}, however large"
