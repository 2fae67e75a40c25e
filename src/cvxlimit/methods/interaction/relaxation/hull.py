"""Limit problems over disjuncts of contacts: the convex hull of every contact's states.

Disjuncts are stated to a sink, as all problems are, and the rows are cut into pieces: one writing
serves the relaxations of a whole run and the thousands of small problems of branch and bound, which
have other rows and columns from one to the next, so that there is nothing for Parameters to patch.
The formulas are those of :mod:`~cvxlimit.readings.states.disjuncts`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.interaction.relaxation.column_blocks import (
    ColumnBlock,
    Columns,
    Halfway,
    Key,
    cut,
)
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.formulations import resultants
from cvxlimit.model.problem import LimitProblem
from cvxlimit.model.sinks import Constraints, Form, Rows, gathered, stacked
from cvxlimit.readings.halves import SymmetricHalf
from cvxlimit.readings.states.disjuncts import Disjuncts, disjunct_arms, sheared
from cvxlimit.readings.states.support import half_extent
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings, default_ladder
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces.base import times
from cvxlimit.surfaces.coulomb import Rocking


@dataclass(frozen=True, eq=False)
class HullState(LimitState):
    """An answer, and a point on the way to it where the solver gave one."""

    halfway: Halfway | None = None


class HullProblem:
    """Limit problems over disjuncts of one scene's contacts; equilibrium is kept from one to the
    next. With a ``half`` of a symmetric scene problems are restricted to it; answers are of the
    whole.
    """

    def __init__(self, scene: Scene | Assemblage, half: SymmetricHalf | None = None) -> None:
        self.assemblage, self.half = Assemblage.of(scene), half
        whole = Reduction.none(self.assemblage.statics, resultants)
        reduction = whole if half is None else half.reduction(whole)
        plain = LimitProblem(self.assemblage, (Rocking(),), reduction=reduction)
        self.scaling, self.equilibrium = self.assemblage.scaling, plain.equilibrium
        # all components of a contact together, where the formulation has one of all contacts
        order = np.arange(self.equilibrium.matrix.shape[1]).reshape(len(COMPONENTS), -1).T.ravel()
        self.matrix = self.equilibrium.matrix.tocsc()[:, order]
        self.dead, self.live = map(self.equilibrium.of_load, plain.loads)
        self.contacts = self.assemblage.scaled.contacts
        self.extent, self.number = half_extent(self.contacts), np.arange(len(self.contacts))
        if half is not None:
            self.number = np.searchsorted(half.kept, self.number)
        self._loads: dict[float | None, LoadBlock] = {}
        self._last: tuple[tuple[object, ...], Columns, ConeProgram] | None = None

    def solve(
        self,
        disjuncts: Disjuncts | Sequence[ColumnBlock],
        settings: SolverSettings | None = None,
        relief_price: float | None = None,
        start: Halfway | None = None,
        enough: float = -np.inf,
    ) -> HullState:
        """One run of one solver; never raises for what the solver does. Any share of the dead load
        may be taken off at ``relief_price``. Our own solver begins at the ``start``, and ends where
        the load factor is below ``enough`` for certain."""
        asked = relief_price, *([disjuncts] if isinstance(disjuncts, Disjuncts) else disjuncts)
        if self._last is None or self._last[0] != asked:  # else another solver on the same problem
            joined = self.joined(disjuncts, relief_price)
            self._last = asked, joined, self.program(joined, relief_price)
        _, joined, program = self._last
        program = replace(program, enough=-enough / self.scaling.load_factor(1.0))
        cache: dict[str, Any] = {"starts": [] if start is None else [joined.start(start)]}
        outcome, x, y = program.solve(settings or default_ladder()[0], cache, is_warm=False)
        if x is None or y is None:
            return HullState(outcome, None, None, None)
        rows, columns, values = joined.forces()
        size = self.matrix.shape[1]
        forces = np.asarray(np.bincount(rows, values * x[columns], size), dtype=float)
        if self.half is not None:
            forces = self.half.forces @ forces
        middle = cache.get("middle")
        return HullState(
            outcome,
            self.scaling.load_factor(float(x[0])),
            self.scaling.forces(forces.reshape(-1, len(COMPONENTS))),
            self.equilibrium.mechanism(y),
            halfway=None if middle is None else Halfway(joined.members, middle),
        )

    def pieces(
        self, disjuncts: Disjuncts, unit: IntArray | None = None, keys: Sequence[Key] | None = None
    ) -> list[ColumnBlock]:
        """A piece for each unit of disjuncts, by the number of their units (k,); one for all of
        them if these are not said. Units without disjuncts have ``keys`` to say whose they are."""
        unit = np.zeros(len(disjuncts), dtype=int) if unit is None else unit
        if self.half is not None:
            kept = ~np.isin(disjuncts.contact, self.half.dropped)
            disjuncts, unit = disjuncts.take(kept), unit[kept]
        if keys is None:
            _, unit = np.unique(unit, return_inverse=True)
        into = Rows()
        given = DisjunctForces(self, disjuncts, into)
        into.zero(self.matrix @ given.forces)
        if keys is None:
            order = np.argsort(unit, kind="stable")
            starts = np.searchsorted(unit[order], np.unique(unit))
            parts = [part.tolist() for part in np.split(order, starts[1:])]
            names, contact = disjuncts.names, disjuncts.contact
            keys = [(int(contact[k[0]]), b"".join([names[i] for i in k])) for k in parts if k]
        kinds, forces = (given.column_of, given.row_of, [given.shears]), given.forces
        entries = forces.row, forces.column, forces.value
        return cut(keys, unit, disjuncts.names, kinds, into, entries)

    def stated(
        self, disjuncts: Disjuncts, into: Constraints | Rows, relief_price: float | None = None
    ) -> Any:
        """The problem, stated to a sink; what is maximised."""
        load, goal = self._load(into, relief_price)
        into.zero(self.matrix @ DisjunctForces(self, disjuncts, into).forces + (load + self.dead))
        return goal

    def joined(
        self, disjuncts: Disjuncts | Sequence[ColumnBlock], relief_price: float | None = None
    ) -> Columns:
        """Their columns; the load factor is the first one, the relief the second."""
        pieces = self.pieces(disjuncts) if isinstance(disjuncts, Disjuncts) else disjuncts
        return Columns([self.load(relief_price).piece, *pieces], len(self.dead))

    def program(self, joined: Columns, relief_price: float | None = None) -> ConeProgram:
        return self.load(relief_price).program(joined)

    def load(self, relief_price: float | None) -> LoadBlock:
        """The columns of the load factor, and of a relief, and their rows."""
        if relief_price not in self._loads:
            into = Rows()
            load, goal = self._load(into, relief_price)
            into.zero(load + self.dead)
            self._loads[relief_price] = LoadBlock.of(into, goal)
        return self._loads[relief_price]

    def _load(self, into: Constraints | Rows, relief_price: float | None) -> tuple[Any, Any]:
        """The load on the equations but for what is dead, and what is maximised: the load factor,
        less the price of a relief from 0 to 1."""
        factor = into.new()
        load = times(self.live, factor)
        if relief_price is None:
            return load, factor
        relief = into.new()
        into.nonneg(relief)
        into.nonneg(1.0 - relief)
        price = relief_price / self.scaling.load_factor(1.0)
        return load - times(self.dead, relief), factor - price * relief


@dataclass(frozen=True, eq=False)
class LoadBlock:
    """What no disjuncts have a part in: a piece that comes first, its cost and right-hand side."""

    piece: ColumnBlock
    cost: FloatArray
    right: FloatArray

    @classmethod
    def of(cls, stated: Rows, goal: Form) -> LoadBlock:
        """Makes the block of one or two unknowns, and limits of the second."""
        every, none = np.arange(stated.width), np.zeros(0, dtype=int)
        lines = [np.ones(form.size, dtype=int) for form in stated.linear] or [none]
        key, names = b"load" * stated.width, [b"load", b"relief"][: stated.width]
        given = [every], lines, [none]
        (piece,) = cut([(-1, key)], 0 * every, names, given, stated, (none, none, np.zeros(0)))
        program = stated.written(goal).program
        return cls(piece, program.cost, program.right)

    def program(self, joined: Columns) -> ConeProgram:
        """Returns the program of all pieces, of which this is the first."""
        cost, right = np.zeros(joined.columns), np.zeros(joined.lines + 3 * joined.cones)
        cost[: len(self.cost)] = self.cost
        equations = joined.equations
        right[: len(self.right) - equations] = self.right[equations:]
        right = np.concatenate([self.right[:equations], right])
        sizes = equations, joined.lines, (3,) * joined.cones
        return ConeProgram(cost, joined.matrix(), right, *sizes)


class DisjunctForces:
    """Disjuncts, stated to a sink; ``forces`` are those of contacts (6 n,).

    Unknowns are per disjunct N, V1, V2 (where it shears), tau (where its arm is not zero), bounds
    on abs(V1) and abs(V2) (where they drag on torsion), a torsion of its own (where Eq. 27 limits
    it), and its share of what of M2, M1 and MT is free within bounds. No row has unknowns of two
    disjuncts, so that solvers which eliminate by blocks have small ones. ``column_of`` and
    ``row_of`` say of which disjuncts unknowns and limits are, in the order in which they were
    stated, cones apart.
    """

    def __init__(
        self, problem: HullProblem, disjuncts: Disjuncts, into: Constraints | Rows
    ) -> None:
        self.disjuncts, self.into = disjuncts, into
        self.number, self.size = problem.number[disjuncts.contact], problem.matrix.shape[1]
        self.half = problem.extent[disjuncts.contact]
        self.arm = disjunct_arms(disjuncts, problem.contacts)
        self.friction = problem.contacts.friction[disjuncts.contact]
        self.along = sheared(disjuncts, self.arm)
        self.shears = np.flatnonzero(self.along.any(axis=1))
        self.twists = np.flatnonzero(self.arm > 0.0)
        self.column_of: list[IntArray] = []
        self.row_of: list[IntArray] = []
        self._given: list[tuple[str, IntArray, Any, FloatArray | float]] = []
        self._add_compression()
        self._add_shear()
        self._add_torsion()
        self._add_friction()

    @property
    def forces(self) -> Any:
        """Sums over disjuncts."""
        components, disjuncts, forms, weights = zip(*self._given, strict=True)
        start = len(COMPONENTS) * self.number
        at = [start[k] + COLUMN[c] for c, k in zip(components, disjuncts, strict=True)]
        each = [np.full(len(k), w) for w, k in zip(weights, disjuncts, strict=True)]
        return gathered(stacked(forms), np.concatenate(at), self.size, np.concatenate(each))

    def _add_compression(self) -> None:
        disjuncts, every = self.disjuncts, np.arange(len(self.disjuncts))
        self.pressed = self._new(every)
        e1, e2 = (self.half * disjuncts.centre).T
        for component, value in (("N", 1.0), ("M1", e2), ("M2", -e1)):
            self._give(component, every, self.pressed, value)
        idle = np.ones(len(every), dtype=bool)
        idle[self.shears] = self.friction[self.shears] <= 0.0  # elsewhere its cone says N >= 0
        self._nonneg(every[idle], self.pressed[idle])
        for axis, moment in enumerate(("M2", "M1")):
            reach = (self.half * disjuncts.spread)[:, axis]
            k = np.flatnonzero(reach > 0.0)
            self._add_bounded(moment, k, times(reach[k], self.pressed[k]))

    def _add_shear(self) -> None:
        k, signed = self.shears, self.disjuncts.signed[:, None]
        self.about = np.where(signed, self.half * self.disjuncts.lever, 0.0)[k]
        self.shear = self._new(k), self._new(k)
        # Without an arm Eq. 27 leaves shear along the lever only; two rows that say so would leave
        # solvers no interior.
        size = np.hypot(self.about[:, 0], self.about[:, 1])
        is_led = self.disjuncts.limited[k] & (self.arm[k] <= 0.0) & (size > 0.0)
        ahead = self.about / np.where(size > 0.0, size, 1.0)[:, None]
        first, second = np.where(is_led[:, None], ahead, self.along[k]).T
        self.about[is_led] = 0.0
        self._give("V1", k, self.shear[0], first)
        self._give("V2", k, self.shear[0], np.where(is_led, second, 0.0))
        self._give("V2", k, self.shear[1], np.where(is_led, 0.0, second))
        self._give("MT", k, self.shear[0], -self.about[:, 1])
        self._give("MT", k, self.shear[1], self.about[:, 0])

    def _add_torsion(self) -> None:
        self.tau = self._new(self.twists)
        self._nonneg(self.twists, self.tau)
        most, own = times(self.arm[self.twists], self.tau), self.disjuncts.limited[self.twists]
        self._add_bounded("MT", self.twists[~own], most[~own])
        # Eq. 27: torsion of their own for limited disjuncts, which with what their shear does about
        # the contact's centre is at most c mu N
        limited = np.flatnonzero((self.disjuncts.limited & (self.arm > 0.0))[self.shears])
        k, (about1, about2) = self.shears[limited], self.about[limited].T
        part = self._add_bounded("MT", self.twists[own], most[own])
        turned = times(about1, self.shear[1][limited]) - times(about2, self.shear[0][limited])
        turned = turned + gathered(part, np.searchsorted(k, self.twists[own]), len(k))
        self._within(k, turned, times(self.arm[k] * self.friction[k], self.pressed[k]))

    def _add_friction(self) -> None:
        k, disjuncts = self.shears, self.disjuncts
        rest = times(self.friction[k], self.pressed[k])
        rest = rest - gathered(self.tau, np.searchsorted(k, self.twists), len(k))
        for axis in (0, 1):
            fixed = np.where(disjuncts.signed[k], 0.0, np.abs(disjuncts.centre[k, 1 - axis]))
            eps = self.half[k, 1 - axis] * (fixed + disjuncts.spread[k, 1 - axis])
            weight = eps / np.where(self.arm[k] > 0.0, self.arm[k], 1.0)
            rows = np.flatnonzero(weight > 0.0)
            size = self._new(k[rows])
            self._within(k[rows], self.shear[axis][rows], size)
            rest = rest - gathered(size, rows, len(k), weight[rows])
        if len(k):
            self.into.cone(rest, self.shear)

    def _add_bounded(self, component: str, k: IntArray, most: Any) -> Any:
        """A part of a force component of its own for disjuncts k, at most so large."""
        part = self._new(k)
        self._give(component, k, part, 1.0)
        self._within(k, part, most)
        return part

    def _within(self, k: IntArray, form: Any, most: Any) -> None:
        self._nonneg(k, most - form)
        self._nonneg(k, most + form)

    def _new(self, k: IntArray) -> Any:
        """Unknowns of the disjuncts k."""
        self.column_of.append(k)
        return self.into.new(len(k))

    def _nonneg(self, k: IntArray, form: Any) -> None:
        self.row_of.append(k)
        self.into.nonneg(form)

    def _give(self, component: str, k: IntArray, form: Any, value: FloatArray | float) -> None:
        self._given.append((component, k, form, value))
