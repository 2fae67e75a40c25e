"""One limit problem for all rows of a structure: their numbers are its Parameters' values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.checks import is_number
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.statics import DOF
from cvxlimit.problem.program import UserProgram
from cvxlimit.problem.solving import solved_at
from cvxlimit.solution import Solution, Status
from cvxlimit.surfaces.coulomb import strength_key, surfaces_of

_STRENGTHS = ("friction", "cohesion", "compressive_strength")
"""Tension besides: it is a load, of which one problem of all rows would have to know."""

_NEAREST = 1000
"""Rows among which the next one is sought: the time for it grows with their number."""


def strengths_of(contacts: Contacts) -> tuple[str, ...]:
    """Names of the strengths that a problem's rows have entries for; the others are 0 or infinite
    everywhere."""
    given = {name: np.asarray(getattr(contacts, name)) for name in _STRENGTHS}
    return tuple(k for k, v in given.items() if k == "friction" or (np.isfinite(v) & (v > 0)).any())


@dataclass(frozen=True, eq=False)
class PatchedProblem:
    """The limit problem of a structure under some surfaces, with strengths and loads that are
    Parameters; ``strengths`` (n,) by name, ``loads`` (free blocks, 6) by ``"dead"`` and
    ``"live"``."""

    problem: UserProgram
    strengths: Mapping[str, cp.Parameter]
    loads: Mapping[str, cp.Parameter]

    @classmethod
    def of(cls, given: Assemblage, surface: Any) -> PatchedProblem | None:
        """Returns the problem, None where rows are not those of other values: for surfaces of one's
        own, and where some contacts are infinitely strong and others are not."""
        contacts = given.contacts
        if strength_key(surfaces_of(surface)[0], contacts) is None:
            return None
        own = {name: np.array(getattr(contacts, name)) for name in strengths_of(contacts)}
        if not all(np.isfinite(values).all() for values in own.values()):
            return None
        strengths = {k: cp.Parameter(len(v), name=k, value=v) for k, v in own.items()}
        acting = {"dead": given.statics.dead, "live": given.statics.live}
        loads = {
            name: cp.Parameter((len(load) // DOF, DOF), name=name, value=load.reshape(-1, DOF))
            for name, load in acting.items()
        }
        return cls(UserProgram(given, surface, {**strengths, **loads}), strengths, loads)

    def solve(self, given: Assemblage, **options: Any) -> Solution | None:
        """The solution for the mechanics ``given``, from the row before on; None where this has not
        decided it."""
        for name, parameter in self.strengths.items():
            parameter.value = np.array(getattr(given.contacts, name))
        self.loads["dead"].value = given.statics.dead.reshape(-1, DOF)
        self.loads["live"].value = given.statics.live.reshape(-1, DOF)
        found = solved_at(self.problem, given, **options)
        is_open = found.status in (
            Status.NOT_CERTIFIED, Status.SOLVER_FAILED, Status.CONTRADICTED,
        )  # fmt: skip
        return None if is_open else found


def nearest_first(variations: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Their names in such an order that the next one is near, in widths of all. The order given
    stays where the way along it is no more than twice as long, as it is in a grid."""
    names, columns = list(variations), dict.fromkeys(k for row in variations.values() for k in row)
    if not columns:
        return names
    places = [_places([row.get(name) for row in variations.values()]) for name in columns]
    points = np.stack(places, axis=1)
    left, order = np.lexsort(points.T[::-1]).tolist(), list[int]()
    while left:
        near = left[:_NEAREST]
        squares = ((points[near] - points[order[-1] if order else near[0]]) ** 2).sum(axis=1)
        order.append(left.pop(int(squares.argmin())))
    given, own = (
        float(np.sqrt((np.diff(way, axis=0) ** 2).sum(axis=1)).sum())
        for way in (points, points[order])
    )
    return names if given <= 2.0 * own else [names[i] for i in order]


def _places(values: Sequence[Any]) -> np.ndarray[Any, Any]:
    if all(is_number(value) and abs(value) < 1e300 for value in values):
        given = np.array(values, dtype=float)
        width = float(np.ptp(given))
        return (given - given.min()) / (width or 1.0)
    kinds = {text: i for i, text in enumerate(dict.fromkeys(map(repr, values)))}
    return np.array([kinds[repr(value)] for value in values]) / max(len(kinds) - 1, 1)
