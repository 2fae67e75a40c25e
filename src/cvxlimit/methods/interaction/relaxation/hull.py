"""Limit problems over disjuncts of contacts, as arrays: the convex hull of every contact's states.

One writing serves the relaxations of a whole run and the thousands of small problems of branch and
bound, where compiling by CVXPY would take longer than solving. The formulas are those of
:mod:`~cvxlimit.readings.states.disjuncts`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.interaction.relaxation.column_blocks import (
    ColumnBlock,
    Columns,
    Entry,
    Halfway,
    Key,
    cut,
)
from cvxlimit.model.assemblage import Assemblage, Equilibrium
from cvxlimit.readings.halves import SymmetricHalf
from cvxlimit.readings.states.disjuncts import Disjuncts, disjunct_arms, sheared
from cvxlimit.readings.states.support import half_extent
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings, default_ladder
from cvxlimit.solvers.program import ConeProgram


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
        self.scaling, statics = self.assemblage.scaling, self.assemblage.scaled
        self.contacts, self.extent = statics.contacts, half_extent(statics.contacts)
        matrix, loads = statics.matrix, np.stack([statics.dead, statics.live])
        self.forces = None if half is None else half.forces_of_all
        if half is not None:
            matrix = matrix @ half.forces_of_all
        rates = None if half is None else half.rates
        self.equilibrium = Equilibrium.of(matrix, loads, self.scaling, rates)
        self.matrix = self.equilibrium.matrix.tocsc()
        self.dead, self.live = map(self.equilibrium.of_load, loads)

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
        joined = self.joined(disjuncts, relief_price)
        enough = -enough / self.scaling.load_factor(1.0)
        program = self.program(joined, relief_price, enough)
        cache = {"start": None if start is None else joined.start(start)}
        outcome, x, y = program.solve(settings or default_ladder()[0], cache, is_warm=False)
        if x is None or y is None:
            return HullState(outcome, None, None, None)
        rows, columns, values = joined.forces()
        size = len(COMPONENTS) * len(self.contacts)
        forces = np.asarray(np.bincount(rows, values * x[columns], size), dtype=float)
        if self.forces is not None:
            forces = self.forces @ forces
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
        return DisjunctColumns(self, disjuncts).pieces(unit, keys)

    def joined(
        self, disjuncts: Disjuncts | Sequence[ColumnBlock], relief_price: float | None = None
    ) -> Columns:
        """Their columns; the load factor is the first one, the relief the second."""
        pieces = self.pieces(disjuncts) if isinstance(disjuncts, Disjuncts) else disjuncts
        return Columns([self._loads[relief_price is not None], *pieces], len(self.dead))

    def program(
        self, joined: Columns, relief_price: float | None = None, enough: float = np.inf
    ) -> ConeProgram:
        cost, right = np.zeros(joined.columns), np.zeros(joined.lines + 3 * joined.cones)
        cost[0] = -1.0
        if relief_price is not None:
            cost[1] = relief_price / self.scaling.load_factor(1.0)
            right[1] = 1.0
        right, cones = np.concatenate([-self.dead, right]), (3,) * joined.cones
        given = cost, joined.matrix(), right, len(self.dead), joined.lines, cones
        return ConeProgram(*given, enough=enough)

    @cached_property
    def _loads(self) -> tuple[ColumnBlock, ColumnBlock]:
        """The columns of the load factor, and of it and the relief, which is from 0 to 1."""
        every, (zero, none) = np.arange(len(self.dead)), np.split(np.zeros(1, dtype=int), [1])
        loads = [(every, 0 * every, self.live), (every, 0 * every + 1, -self.dead)]
        limits = [(zero, zero + 1, -np.ones(1)), (zero + 1, zero + 1, np.ones(1))]
        no_forces = [(none, none, np.zeros(0))]
        plain, relieved = (
            cut([(-1, key)], 0 * np.arange(n), [b"load", b"relief"][:n], len(every),
                ([np.arange(n)], [np.ones(1, dtype=int)] * m or [none], [none]),
                (loads[:n], limits[:m], []), no_forces)
            for key, n, m in ((b"load", 1, 0), (b"loads", 2, 2))
        )  # fmt: skip
        return plain[0], relieved[0]


class DisjunctColumns:
    """Columns and rows of disjuncts.

    Variables are per disjunct N, V1, V2 (where it shears), tau (where its arm is not zero), bounds
    on abs(V1) and abs(V2) (where they drag on torsion), a torsion of its own (where Eq. 27 limits
    it), and its share of what of M2, M1 and MT is free within bounds. No row has variables of two
    disjuncts, so that solvers which eliminate by blocks have small ones.
    """

    def __init__(self, problem: HullProblem, disjuncts: Disjuncts) -> None:
        self.problem, self.disjuncts = problem, disjuncts
        self.half = problem.extent[disjuncts.contact]
        self.arm = disjunct_arms(disjuncts, problem.contacts)
        self.friction = problem.contacts.friction[disjuncts.contact]
        self.width = self.nonneg = 0
        self.gives: list[Entry] = []
        self.signs: list[Entry] = []
        self.along = sheared(disjuncts, self.arm)
        self.shears = np.flatnonzero(self.along.any(axis=1))
        self.column_of: list[IntArray] = []
        self.row_of: list[IntArray] = []
        self.twists = np.flatnonzero(self.arm > 0.0)
        self._add_compression()
        self._add_shear()
        self._add_torsion()
        self.drag = [self._drag(axis) for axis in (0, 1)]

    def _add_compression(self) -> None:
        disjuncts, every = self.disjuncts, np.arange(len(self.disjuncts))
        self.pressed = self._new(every)
        e1, e2 = (self.half * disjuncts.centre).T
        for component, value in (("N", 1.0), ("M1", e2), ("M2", -e1)):
            self._give(component, disjuncts.contact, self.pressed, value)
        idle = np.ones(len(every), dtype=bool)
        idle[self.shears] = self.friction[self.shears] <= 0.0  # elsewhere its cone says N >= 0
        self._at_most_zero(every[idle], (self.pressed[idle], -1.0))
        for axis, moment in enumerate(("M2", "M1")):
            reach = (self.half * disjuncts.spread)[:, axis]
            spread = np.flatnonzero(reach > 0.0)
            self._add_bounded(moment, spread, reach[spread], self.pressed[spread])

    def _add_shear(self) -> None:
        k, signed = self.shears, self.disjuncts.signed[:, None]
        self.about = np.where(signed, self.half * self.disjuncts.lever, 0.0)[k]
        self.shear = self._new(k), self._new(k)
        contact = self.disjuncts.contact[k]
        # Without an arm Eq. 27 leaves shear along the lever only; two rows that say so would leave
        # solvers no interior.
        size = np.hypot(self.about[:, 0], self.about[:, 1])
        is_led = self.disjuncts.limited[k] & (self.arm[k] <= 0.0) & (size > 0.0)
        ahead = self.about / np.where(size > 0.0, size, 1.0)[:, None]
        first, second = np.where(is_led[:, None], ahead, self.along[k]).T
        self.about[is_led] = 0.0
        self._give("V1", contact, self.shear[0], first)
        self._give("V2", contact, self.shear[0], np.where(is_led, second, 0.0))
        self._give("V2", contact, self.shear[1], np.where(is_led, 0.0, second))
        self._give("MT", contact, self.shear[0], -self.about[:, 1])
        self._give("MT", contact, self.shear[1], self.about[:, 0])

    def _add_torsion(self) -> None:
        self.tau = self._new(self.twists)
        self._at_most_zero(self.twists, (self.tau, -1.0))
        own = self.disjuncts.limited[self.twists]
        free = self.twists[~own]
        self._add_bounded("MT", free, self.arm[free], self.tau[~own])
        self._limit_torsion(self.twists[own], self.tau[own])

    def _limit_torsion(self, twists: IntArray, tau: IntArray) -> None:
        """Eq. 27: torsion of their own for limited disjuncts, which with what their shear does
        about the contact's centre is at most c mu N."""
        limited = np.flatnonzero((self.disjuncts.limited & (self.arm > 0.0))[self.shears])
        k, about = self.shears[limited], self.about[limited]
        own = self._new(twists)
        self._give("MT", self.disjuncts.contact[twists], own, 1.0)
        place = np.searchsorted(k, twists)
        for sign in (1.0, -1.0):
            self._at_most_zero(twists, (own, sign), (tau, -self.arm[twists]))
            rows = self._at_most_zero(
                k,
                (self.shear[0][limited], -sign * about[:, 1]),
                (self.shear[1][limited], sign * about[:, 0]),
                (self.pressed[k], -self.arm[k] * self.friction[k]),
            )
            self.signs.append((rows[place], own, np.full(len(own), sign)))

    def _drag(self, axis: int) -> Entry:
        k, disjuncts = self.shears, self.disjuncts
        fixed = np.where(disjuncts.signed[k], 0.0, np.abs(disjuncts.centre[k, 1 - axis]))
        eps = self.half[k, 1 - axis] * (fixed + disjuncts.spread[k, 1 - axis])
        weight = eps / np.where(self.arm[k] > 0.0, self.arm[k], 1.0)
        rows = np.flatnonzero(weight > 0.0)
        size = self._new(k[rows])
        for sign in (1.0, -1.0):
            self._at_most_zero(k[rows], (self.shear[axis][rows], sign), (size, -1.0))
        return rows, size, weight[rows]

    def _add_bounded(self, component: str, k: IntArray, reach: FloatArray, size: IntArray) -> None:
        part = self._new(k)
        self._give(component, self.disjuncts.contact[k], part, 1.0)
        for sign in (1.0, -1.0):
            self._at_most_zero(k, (part, sign), (size, -reach))

    def _new(self, k: IntArray) -> IntArray:
        """Columns of the disjuncts k."""
        self.column_of.append(k)
        self.width += len(k)
        return np.arange(self.width - len(k), self.width)

    def _give(
        self, component: str, contact: IntArray, columns: IntArray, values: FloatArray | float
    ) -> None:
        rows = len(COMPONENTS) * contact + COLUMN[component]
        self.gives.append((rows, columns, np.broadcast_to(values, rows.shape)))

    def _at_most_zero(self, k: IntArray, *terms: tuple[IntArray, FloatArray | float]) -> IntArray:
        """Rows of the disjuncts k."""
        self.row_of.append(k)
        count = len(k)
        rows = self.nonneg + np.arange(count)
        self.signs += [(rows, columns, np.broadcast_to(v, count)) for columns, v in terms]
        self.nonneg += count
        return rows

    def pieces(self, unit: IntArray, keys: Sequence[Key] | None) -> list[ColumnBlock]:
        """One for each unit (k,) of disjuncts; see :meth:`HullProblem.pieces`."""
        names, kinds = self.disjuncts.names, (self.column_of, self.row_of, [self.shears])
        if keys is None:
            order = np.argsort(unit, kind="stable")
            starts = np.searchsorted(unit[order], np.unique(unit))
            parts = [part.tolist() for part in np.split(order, starts[1:])]
            contact = self.disjuncts.contact
            keys = [(int(contact[k[0]]), b"".join([names[i] for i in k])) for k in parts if k]
        entries = [self._equilibrium()], self.signs, self._cones()
        return cut(keys, unit, names, len(self.problem.dead), kinds, entries, self.gives)

    def _equilibrium(self) -> Entry:
        """The equations' matrix times that of contact forces, without making that: a product of
        sparse matrices takes SciPy several times as long."""
        matrix = self.problem.matrix
        rows, columns, values = (np.concatenate(part) for part in zip(*self.gives, strict=True))
        start, count = matrix.indptr[rows], np.diff(matrix.indptr)[rows]
        end = np.cumsum(count)
        at = np.arange(count.sum()) + np.repeat(start - end + count, count)
        found = matrix.data[at] * np.repeat(values, count)
        return matrix.indices[at], np.repeat(columns, count), found

    def _cones(self) -> list[Entry]:
        k = self.shears
        top, one = 3 * np.arange(len(k)), np.ones(len(k))
        cones = [(top, self.pressed[k], -self.friction[k])]
        cones += [(top + 1, self.shear[0], -one), (top + 2, self.shear[1], -one)]
        place = np.searchsorted(k, self.twists)
        cones.append((top[place], self.tau, np.ones(len(place))))
        return cones + [(top[at], size, weight) for at, size, weight in self.drag]
