"""The convex step of one scene: a limit problem whose coefficients say where it is built.

Majorants (:mod:`~cvxlimit.extensions.interaction.states.majorants`) are a yield surface in forces
and in bounds on their sizes. Its coefficients are Parameters: at another point, at another price or
with other curvature, the rows are the same but for their numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
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
from cvxlimit.model.formulations import ForceModel, Part, corner_compressions, times
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import Stated
from cvxlimit.readings.moments import Moments
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.surfaces.base import Condition, LinearForm, Norm, YieldSurface
from cvxlimit.surfaces.coulomb import Rocking


@dataclass(frozen=True, eq=False)
class StepState(LimitState):
    """A step's answer, with the total slack that it bought, over total load x contact size."""

    slack: float = 0.0


class SafeStep:
    """Solves the convex problem of a step at a point, in one reading of Eq. 30.

    Unknown are internal forces, bounds on sizes, slack if it has a price, and the load factor. With
    a ``half`` of a symmetric scene the problem is that of the half, and answers are those of the
    whole. ``stated`` keeps each problem that was stated, by whether slack has a price and whether
    the load factor has a bound; at another point only its Parameters change.
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
        self.stated: dict[tuple[bool, bool], LimitProgram] = {}
        self._cache: dict[str, Any] = {}

    def solve(
        self,
        point: Point,
        settings: SolverSettings,
        price: float | None = None,
        curvature: float = 1.0,
        most: float | None = None,
    ) -> StepState:
        """Returns the state with the largest load factor, at most ``most``, less ``price`` times
        slack. Without a price there is no slack: then every answer is safe with the full
        ``curvature`` 1.0 of the rows; with a share of it steps are longer."""
        state = self.at(point, price, curvature, most).run(settings, has_rows=True)
        if state.forces is None:
            return StepState(state.outcome, None, None, None, slack=np.inf)
        forces = self.rectangles.outward(state.forces / self.scaling.forces(np.ones(6)))
        return StepState(
            state.outcome,
            state.load_factor,
            self.scaling.forces(forces),
            state.mechanism,
            slack=0.0 if price is None else float(state.own["slack"].sum()),
        )

    def at(
        self,
        point: Point,
        price: float | None = None,
        curvature: float = 1.0,
        most: float | None = None,
    ) -> LimitProgram:
        """Returns the problem with its Parameters set to the values for a point."""
        key = price is not None, most is not None
        if key not in self.stated:
            self.stated[key] = self._statement(*key)
        unit = self.scaling.load_factor(1.0)
        values: dict[str, Any] = {"price": price or 0.0, "most": (most or 0.0) / unit}
        for i, form in enumerate(_forms(self._rows(point, curvature, has_slack=key[0]))):
            values |= {f"form {i}, {component}": k for component, k in form.items()}
        return self.stated[key].at(values)

    def point(self, forces: FloatArray, otherwise: Point, least: float) -> Point:
        """Returns the point of forces (n, 6), in the columns V1 V2 N M1 M2 MT; ``otherwise`` for
        contacts that carry less than ``least``."""
        inner = self.rectangles.inward(forces / self.scaling.forces(np.ones_like(forces)))
        return Point.of(inner, self.statics.contacts, otherwise, least)

    def _statement(self, has_price: bool, has_most: bool) -> LimitProgram:
        """States a problem, coefficients that differ from contact to contact being Parameters."""
        # with a share of the curvature rows have all components that they ever have
        rows = self._rows(Point.middle(self.statics.contacts), 0.5, has_price)
        named = (_named(form, f"form {i}") for i, form in enumerate(_forms(rows)))
        surface = _Majorants([*self._bounds(), *_stated(rows, named)])
        goal = _LessSlack(
            cp.Parameter(name="price") if has_price else None,
            cp.Parameter(name="most") if has_most else None,
        )
        names = (*self._sizes, *(["slack"] if has_price else []))
        given = Reduction.none(self.assemblage.statics, partial(_with_parts, names=names))
        given = given if self.half is None else self.half.reduction(given)
        problem = LimitProgram(self.assemblage, (Rocking(), surface), reduction=given, goal=goal)
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

    def _rows(self, point: Point, curvature: float, has_slack: bool) -> list[Condition]:
        """Eq. 30 at a point, and Eq. 27 where it stands beside it."""
        f, moments, contacts = self._forces, self.moments, self.own.contacts
        slack = Linear({"slack": 1.0} if has_slack else {})
        here = Point(point.centre[self.kept], point.shear[self.kept])
        arm = np.maximum(contacts.friction, SUPPORT.friction) * contacts.torsion_arm
        arm = np.where(arm > 0.0, arm, 1.0)  # of the torque that contacts resist, per compression
        found, balance = [], states_of(moments).balance
        for row in StepRows(f, here, self.own, moments.slopes, moments.is_limited, balance).rows():
            if not row.squares:
                found.append(Condition([], slack - row.linear))
                continue
            longer = row if curvature == 1.0 else row.lengthened(f.N, curvature)
            bound, *rest = longer.cone(f.N, slack, arm)
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


@dataclass(frozen=True, eq=False)
class _LessSlack:
    """The load factor, at most ``most``, less ``price`` x slack."""

    price: cp.Parameter | None
    most: cp.Parameter | None

    def __call__(self, stated: Stated) -> Any:
        if self.most is not None:
            stated.into.nonneg(-stated.factor + self.most)
        if self.price is None:
            return stated.factor
        slack = stated.own["slack"] = stated.forces["slack"]
        return stated.factor - times(self.price, np.ones(slack.size) @ slack)


def _with_parts(contacts: Contacts, names: Sequence[str]) -> ForceModel:
    """Corner compressions, and unknowns that give no forces."""
    model, every = corner_compressions(contacts), np.arange(len(contacts))
    parts = [Part(name, {}, every, nonneg=name == "slack") for name in names]
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
