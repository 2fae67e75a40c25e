"""What contacts transmit and how much of their strength that uses, for pictures and tables; of all
states of force that carry a load factor that which uses the joints least."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import check_known
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import Stated, admissible
from cvxlimit.model.statics import ZERO
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.named import reading_of
from cvxlimit.readings.pressure import Pressure
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import TOLERANCE
from cvxlimit.surfaces import Cone, ParabolicTorsionShear, YieldSurface, utilisation
from cvxlimit.surfaces.base import stated
from cvxlimit.surfaces.coulomb import Rocking, Sliding, Torsion, TorsionShear, surfaces_named


@dataclass(frozen=True)
class LeastUse:
    """Least sum of N u^2 over all contacts, with u the share of strength in use.

    u N is the least compression under which a contact would still bear its shear and moments, so
    the sum is convex: that compression squared over N. Contacts are pressed by at most ``most``:
    blocks between supports could press each other without end, and use ever less of their strength.
    """

    surfaces: Sequence[YieldSurface]
    factor: float
    most: float

    def __call__(self, problem: Stated) -> Any:
        into, scaling = problem.into, problem.assemblage.scaling
        normal = problem.forces["N"]
        needed, use = into.new(normal.size), into.new(normal.size)
        into.zero(problem.factor - self.factor / scaling.load_factor(1.0))
        into.nonneg(normal - needed)
        into.nonneg(self.most / scaling.force - normal)
        into.cone(normal + use, [2.0 * needed, normal - use])
        alone = ChainMap({"N": needed}, problem.forces)
        for surface in self.surfaces:
            for condition in stated(surface, problem.assemblage.contacts):
                admissible(into, condition, alone, surface.cone)
        return -(np.ones(use.size) @ use)


def least_used(
    scene: Scene, surfaces: Sequence[YieldSurface], factor: float, forces: FloatArray
) -> FloatArray | None:
    """The state (n, 6) that uses the joints least at a load factor, or None if none was found.

    ``forces`` are a state that carries it; no contact is pressed by more than twice their largest
    compression. The load factor is less by a share that counts as none, so that rounding of it
    leaves forces to choose from: a contact at its strength then shows 1 to about as many digits as
    are printed. The width of a bracket is the excess and imbalance, over the largest compression,
    of forces that are good for a picture.
    """
    most = 2.0 * float(forces[:, 2].max(initial=0.0))
    if scene.contacts.is_point.any() or (forces[:, 2] < -TOLERANCE * most).any():
        return None  # what pulls, or has no friction, has no share of a compression
    assemblage, below = Assemblage.of(scene), (1.0 - ZERO) * factor
    problem = LimitProgram(assemblage, surfaces, goal=LeastUse(surfaces, below, most))
    for settings in problem.ladder():
        found = problem.run(settings).forces
        if found is not None and _is_good(assemblage, surfaces, below, found, most):
            return found
    return None


def _is_good(
    assemblage: Assemblage, surfaces: Sequence[YieldSurface], factor: float, forces: FloatArray,
    most: float,
) -> bool:  # fmt: skip
    rest = np.abs(assemblage.statics.residual(forces, factor)).max(initial=0.0)
    parts = [part for surface in surfaces for part in surface.excess(forces, assemblage.contacts)]
    excess = max(float(part.max(initial=0.0)) for part in parts)
    return bool(np.isfinite(forces).all() and max(float(rest), excess) <= TOLERANCE * most)


BENDING = "utilisation_torsion_shear_bending"
"""Column of Eq. 30."""

_WITH_BENDING = ("fixed-point", "certified")
"""Interactions whose solutions have a reading of Eq. 30."""


def utilisations(solution: Solution, scene: Scene) -> dict[str, FloatArray]:
    """Shares (n,) of strength in use: ``utilisation``, the largest, and one for each surface;
    NaN where a contact carries nothing. The largest is over the surfaces that were solved with
    (for the exact limit of torsion with shear the parabola inside it, of which a little more
    than all may be in use), with interaction over rocking and Eq. 30 as the solution reads it.
    Strength that a formulation states itself is no surface. Refused if the solution has lost
    surfaces of one's own."""
    contacts, forces = scene.contacts, contact_forces(scene, solution)
    solved = solved_with(solution)
    built_in = (Rocking(), Sliding(), Torsion(), TorsionShear())
    asked: dict[str, YieldSurface] = {_column(s.name): s for s in (*built_in, *solved)}
    counted = [_column(surface.name) for surface in solved]
    reading = reading_of(solution.moments) if solution.interaction in _WITH_BENDING else None
    if reading is not None:
        counted = [_column(Rocking.name), BENDING]
    names = [*asked, *counted]
    if forces is None:
        nothing = np.full(len(contacts), np.nan)
        return {"utilisation": nothing} | dict.fromkeys(names, nothing)
    found = {name: utilisation(surface, forces, contacts) for name, surface in asked.items()}
    if reading is not None:
        found[BENDING] = _with_bending(reading, solved[-1].cone, forces, contacts)
    return {"utilisation": np.fmax.reduce([found[name] for name in counted])} | found


def share_used(solution: Solution, scene: Scene, surface: str | None = None) -> FloatArray:
    forces_of(scene, solution)
    found = utilisations(solution, scene)
    if surface is None:
        return found["utilisation"]
    if (name := _column(surface)) not in found:
        known = [key.removeprefix("utilisation_") for key in found if key != "utilisation"]
        check_known(surface, known, "there is no surface")
    return found[name]


def least_used_state(
    solution: Solution, scene: Scene, load_factor: float | None = None
) -> tuple[Solution, str]:
    """The solution with the state of force that uses joints least, at its own load factor or at a
    smaller one, and what that is in words; its own forces where its set of states is not convex."""
    forces = forces_of(scene, solution)
    is_plain = solution.interaction == "none" and solution.torsion_shear != "exact"
    is_plain &= solution.quantity == "load factor" and 0.0 <= solution.lower < np.inf
    found = None
    if is_plain:
        factor = solution.lower if load_factor is None else load_factor
        found = least_used(scene, solved_with(solution), factor, forces)
    at = "at collapse" if load_factor is None else f"at load factor {load_factor:g}"
    if found is not None:
        return replace(solution, forces=found), f"{at}, in the state that uses joints least"
    if load_factor is not None:
        raise InputError(
            f"no state of forces of {solution.scene_name!r} was found at load factor "
            f"{load_factor:g}: ask for one from 0 to {solution.lower:g}, of a solution without "
            "interaction and ties"
        )
    return solution, f"{at}, in the state of forces that was found"


def contact_forces(scene: Scene, solution: Solution) -> FloatArray | None:
    """The solution's forces (n, 6), None if it has none; refused unless one row per contact."""
    if solution.forces is not None and solution.forces.shape != (len(scene.contacts), 6):
        raise InputError(
            f"the solution of {solution.scene_name!r} has forces of shape {solution.forces.shape}, "
            f"but scene {scene.name!r} has {len(scene.contacts)} contacts: it does not belong to it"
        )
    return solution.forces


def forces_of(scene: Scene, solution: Solution) -> FloatArray:
    found = contact_forces(scene, solution)
    if found is None:
        raise InputError(
            f"the solution of {solution.scene_name!r} has no contact forces ({solution.status})"
        )
    return found


def _with_bending(
    reading: Moments, cone: Cone, forces: FloatArray, contacts: Contacts
) -> FloatArray:
    """Share of Eq. 30's right side in use where each contact itself is pressed: the frozen surface
    (Eq. 32) of the forces' own eccentricities. Sliding counts as well: it is all that is left where
    nothing of the contact is effective, in its corners."""
    at = Pressure.of(forces, contacts)
    frozen = reading.frozen(reading.eccentricity(at, contacts), cone)
    sliding = utilisation(Sliding(cone), forces, contacts)
    return np.fmax(utilisation(frozen, forces, contacts), sliding)


def _column(surface: str) -> str:
    return "utilisation_" + str(surface).replace("-", "_").replace(" ", "_")


def solved_with(solution: Solution) -> tuple[YieldSurface, ...]:
    found = solution.surfaces or surfaces_named(solution.surface, solution.torsion_shear)
    if found is None:
        raise InputError(
            f"how much of its strength a joint of {solution.scene_name!r} uses cannot be told: of "
            f"the surfaces {solution.surface!r} only the names are left, and not all are built in; "
            "solution.of(scene, surfaces) gives them back"
        )
    if solution.torsion_shear == "exact":  # no surface states it: the parabola is just inside
        return *found, ParabolicTorsionShear()
    return found
