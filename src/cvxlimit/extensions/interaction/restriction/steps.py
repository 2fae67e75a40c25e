"""The convex step of one scene: a limit problem whose coefficients say where it is built.

Majorants (:mod:`~cvxlimit.extensions.interaction.states.majorants`) are a yield surface in forces
and in bounds on their sizes. Its coefficients are Parameters: at another point the rows are the
same but for their numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.interaction.halves import SymmetricHalf
from cvxlimit.extensions.interaction.states.majorants import Forces, Linear, Point, StepRows
from cvxlimit.extensions.interaction.states.rectangles import Rectangles
from cvxlimit.extensions.interaction.states.settings import SUPPORT
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.geometry.contacts import COMPONENTS, Contacts
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.formulations import ForceModel, Part, corner_compressions
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LargestFactor
from cvxlimit.readings.moments import Moments
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.surfaces.base import Condition, LinearForm, Norm, YieldSurface
from cvxlimit.surfaces.coulomb import Rocking


class SafeStep:
    """Solves the convex problem of a step at a point, in one reading of Eq. 30.

    Unknown are internal forces, bounds on sizes, and the load factor. With a ``half`` of a
    symmetric scene the problem is that of the half, and answers are those of the whole. ``stated``
    keeps each problem that was stated, by the bound of the load factor; at another point only its
    Parameters change.
    """

    def __init__(
        self, scene: Scene | Assemblage, moments: Moments, half: SymmetricHalf | None = None
    ) -> None:
        whole = Assemblage.of(scene)
        self.moments, self.scaling, self.half = moments, whole.scaling, half
        largest = moments.largest_arm(whole.contacts)
        rectangles = Rectangles.of(whole.contacts, states_of(moments).inscribed, largest)
        self.rectangles = rectangles.scaled(1.0 / self.scaling.length)
        statics = replace(whole.statics, contacts=rectangles.contacts)
        self.assemblage = replace(whole, statics=statics, strengths={})
        self.statics = self.assemblage.scaled
        self.kept = np.arange(len(whole.contacts)) if half is None else half.kept
        self.own = self.rectangles.take(self.kept)
        slopes, sizes = moments.slopes, ("m1", "m2", "u", "s1", "s2", "t")
        is_tied = slopes is not None and bool((slopes[:, 0] == slopes[:, 1]).all())
        self._sizes = sizes[: 6 if slopes is None else 3 if is_tied else 5]
        self._forces = self._forms(self._sizes)
        self.stated: dict[float | None, LimitProgram] = {}
        self._cache: dict[str, Any] = {}

    def solve(
        self, point: Point, settings: SolverSettings, most: float | None = None
    ) -> LimitState:
        """Returns the state with the largest load factor, at most ``most``."""
        state = self.at(point, most).run(settings, has_rows=True)
        if state.forces is None:
            return LimitState(state.outcome, None, None, None)
        forces = self.rectangles.outward(state.forces / self.scaling.forces(np.ones(6)))
        forces = self.scaling.forces(forces)
        return LimitState(state.outcome, state.load_factor, forces, state.mechanism)

    def at(self, point: Point, most: float | None = None) -> LimitProgram:
        """Returns the problem with its Parameters set to the values for a point."""
        if most not in self.stated:
            self.stated[most] = self._statement(most)
        values: dict[str, Any] = {}
        for i, form in enumerate(_forms(self._rows(point))):
            values |= {f"form {i}, {component}": k for component, k in form.items()}
        return self.stated[most].at(values)

    def point(self, forces: FloatArray, otherwise: Point, least: float) -> Point:
        """Returns the point of forces (n, 6), in the columns V1 V2 N M1 M2 MT; ``otherwise`` for
        contacts that carry less than ``least``."""
        inner = self.rectangles.inward(forces / self.scaling.forces(np.ones_like(forces)))
        return Point.of(inner, self.statics.contacts, otherwise, least)

    def _statement(self, most: float | None) -> LimitProgram:
        """States a problem, coefficients that differ from contact to contact being Parameters."""
        rows = self._rows(Point.middle(self.statics.contacts))
        named = (_named(form, f"form {i}") for i, form in enumerate(_forms(rows)))
        surface = _Majorants([*self._bounds(), *_stated(rows, named)])
        given = Reduction.none(self.assemblage.statics, partial(_with_parts, names=self._sizes))
        given = given if self.half is None else self.half.reduction(given)
        problem = LimitProgram(
            self.assemblage, (Rocking(), surface), reduction=given, goal=LargestFactor(most)
        )
        problem._kept = self._cache
        return problem

    def _forms(self, names: Sequence[str]) -> Forces[Linear]:
        """Forces by component, moments over the unit of length, and bounds by name."""
        one = {name: Linear({name: 1.0}) for name in (*COMPONENTS, *names)}
        m1, m2, mt = (one[name] / self.scaling.length for name in ("M1", "M2", "MT"))
        m, s = ([one[n] for n in names if n[0] == kind] for kind in "ms")
        return Forces(one["N"], [one["V1"], one["V2"]], [-m2, m1], mt, m, one["u"], s, one.get("t"))

    def _bounds(self) -> Iterator[Condition]:
        f = self._forces
        yield Condition([], self.own.contacts.friction * f.N - f.u)
        yield Condition([Norm(*f.V)], f.u)
        sizes = [*zip(f.X, f.m, strict=True), *zip(f.V[: len(f.s)], f.s, strict=True)]
        sizes += [] if f.t is None else [(f.MT, f.t)]
        yield from (Condition([Norm(value)], bound) for value, bound in sizes)

    def _rows(self, point: Point) -> list[Condition]:
        """Eq. 30 at a point, and Eq. 27 where it stands beside it."""
        f, moments, contacts = self._forces, self.moments, self.own.contacts
        here = Point(point.centre[self.kept], point.shear[self.kept])
        arm = np.maximum(contacts.friction, SUPPORT.friction) * contacts.torsion_arm
        arm = np.where(arm > 0.0, arm, 1.0)  # of the torque that contacts resist, per compression
        found, balance = [], states_of(moments).balance
        for row in StepRows(f, here, self.own, moments.slopes, moments.is_limited, balance).rows():
            if not row.squares:
                found.append(Condition([], -row.linear))
                continue
            bound, *rest = row.cone(f.N, arm)
            found.append(Condition([Norm(*rest)], bound))
        return found


class _Majorants(YieldSurface):
    """Conditions of a step."""

    name = "safe step"

    def __init__(self, stated: Sequence[Condition]) -> None:
        super().__init__()
        self._stated = stated

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return self._stated


def _with_parts(contacts: Contacts, names: Sequence[str]) -> ForceModel:
    """Corner compressions, and unknowns that give no forces."""
    model, every = corner_compressions(contacts), np.arange(len(contacts))
    parts = [Part(name, {}, every) for name in names]
    return replace(model, parts=[*model.parts, *parts])


def _forms(conditions: Sequence[Condition]) -> Iterator[LinearForm]:
    return chain.from_iterable(condition.forms() for condition in conditions)


def _named(form: LinearForm, name: str) -> LinearForm:
    """The form with Parameters in place of what differs from contact to contact."""
    return {
        component: cp.Parameter(np.shape(k), name=f"{name}, {component}") if np.ndim(k) else k
        for component, k in form.items()
    }


def _stated(rows: Sequence[Condition], forms: Iterator[LinearForm]) -> Iterator[Condition]:
    """The conditions with other forms."""
    for row in rows:
        resistance = next(forms)
        norms = [Norm(*(next(forms) for _ in norm.rows)) for norm in row.norms]
        yield Condition(norms, resistance)
