"""How much of its strength a contact uses, by surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.pressure import least_carried
from cvxlimit.surfaces.base import (
    CONSTANT,
    Condition,
    YieldSurface,
    columns,
    condition_excess,
    evaluate,
    stated,
)
from cvxlimit.surfaces.cones import Cone


def utilisation(surface: YieldSurface, forces: FloatArray, contacts: Contacts) -> FloatArray:
    """Share (n,) of each contact's strength that forces (n, 6) use; 1 on the surface, 0 unused.

    A condition's resistance is what compression and constants give to it; used are its norms and
    what else stands in it with a sign. For sliding that is abs(V) / (mu N), for rocking the
    distance of the pressure centre from the contact's centre over that of the edge beyond it. The
    largest of a surface's conditions counts. NaN where a contact carries nothing.

    Example
    -------
    Half the sliding strength, and the pressure centre a quarter of the side off the centre:

    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.surfaces import Rocking, Sliding
    >>> contacts = builtin_scene("single-block").contacts
    >>> mu, l1 = contacts.friction[0], contacts.sides[0, 0]
    >>> forces = np.array([[0.5 * mu, 0.0, 1.0, 0.0, -0.25 * l1, 0.0]])
    >>> [utilisation(s, forces, contacts).round(12).tolist() for s in (Sliding(), Rocking())]
    [[0.5], [0.5]]
    """
    values = columns(forces)
    least = least_carried(forces)
    result = np.full(len(contacts), np.nan)
    for condition in stated(surface, contacts):
        at = np.arange(len(contacts)) if condition.contact is None else condition.contact
        np.fmax.at(result, at, _used(condition, surface.cone, values, least))
    return np.maximum(result, 0.0) + 0.0


def _used(
    condition: Condition, cone: Cone, values: Mapping[str, FloatArray], least: float
) -> FloatArray:
    given = {k: c for k, c in condition.resistance.items() if k in ("N", CONSTANT)}
    signed = {k: c for k, c in condition.resistance.items() if k not in given}
    used = condition_excess(replace(condition, resistance=signed), cone, values)
    available = evaluate(given, values, condition.contact)
    carries = available > least
    return np.where(carries, used, np.nan) / np.where(carries, available, 1.0)
