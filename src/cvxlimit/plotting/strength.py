"""What contacts transmit and how much of their strength that uses: for pictures and tables."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.plotting.movement import contact_forces
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.surfaces import Rocking, Sliding, Torsion, TorsionShear, YieldSurface, utilisation
from cvxlimit.surfaces.presets import surfaces_of
from cvxlimit.surfaces.utilisation import CARRIES

FloatArray = NDArray[np.float64]


def pressure_centres(contacts: Contacts, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where forces (n, 6) press: (n, 2) in the contact's plane, and (n, 3) in space.

    (e1, e2) = (-M2, M1) / N; NaN where a contact carries nothing.
    """
    normal = forces[:, 2]
    carries = normal > CARRIES * float(np.abs(forces[:, :3]).max(initial=0.0))
    safe = np.where(carries, normal, np.nan)
    centre = np.stack([-forces[:, 4], forces[:, 3]], axis=1) / safe[:, None]
    return centre, contacts.origin + np.einsum("nk,nkx->nx", centre, contacts.axes[:, :2])


def utilisations(solution: Solution, scene: Scene) -> dict[str, FloatArray]:
    """Shares (n,) of strength in use: ``utilisation``, the largest, and one for each surface.

    The largest is over the surfaces that were solved with where their name says what they are,
    and over the paper's (rocking, torsion with shear) otherwise; interaction with bending has
    none of its own. NaN where a contact carries nothing.
    """
    contacts, forces = scene.contacts, contact_forces(scene, solution)
    solved = _solved_with(solution)
    asked = {_column(s): s for s in (Rocking(), Sliding(), Torsion(), TorsionShear(), *solved)}
    if forces is None:
        nothing = np.full(len(contacts), np.nan)
        return {"utilisation": nothing} | dict.fromkeys(asked, nothing)
    found = {name: utilisation(surface, forces, contacts) for name, surface in asked.items()}
    largest = np.fmax.reduce([found[_column(surface)] for surface in solved])
    return {"utilisation": largest} | found


def _column(surface: YieldSurface) -> str:
    return "utilisation_" + surface.name.replace("-", "_").replace(" ", "_")


def _solved_with(solution: Solution) -> tuple[YieldSurface, ...]:
    try:
        return surfaces_of(solution.surface, solution.torsion_shear)[0]
    except ModelError:  # a list of surfaces of one's own: their names do not bring them back
        return Rocking(), TorsionShear()
