"""The relaxed limit problem: every contact's states are replaced by their convex hull.

With torsion-shear-bending interaction (Eq. 26-30) the admissible forces of a contact are a cone for
every fixed pressure centre e, but not their union over e. The convex hull of the union is the sum
of finitely many *disjuncts* k, parts X_k of the contact's force X with a pressure centre of their
own, so that the relaxation is one second-order cone program, whose load factor no admissible forces
exceed:

    max alpha   subject to   A X + f_dead + alpha f_live = 0,   X = sum over k of X_k,
                             X_k in the cone of disjunct k (:class:`StatedDisjuncts`).

The letters in the code (n contacts, of which the problem has m; force components are in the order
V1, V2, N, M1, M2, MT of :data:`~cvxlimit.geometry.contacts.COMPONENTS`):

============  =======================================  ==============  ============================
letter        what it is                               shape           in the code
============  =======================================  ==============  ============================
alpha         load factor                              number          load_factor
A             equilibrium, one row per motion          (rows, 6 m)     HullProblem.matrix
f_dead/live   loads, in the rows of A                  (rows,)         HullProblem.dead, .live
X             contact forces                           (6 m,)          StatedDisjuncts.forces
e             pressure centre along t1 and t2,         (k, 2)          half_sides * centre
              e1 = -M2 / N and e2 = M1 / N
s             spread: how far the centre may be off    (k, 2)          half_sides * spread
c             torsion arm left by Eq. 26, a length     (k,)            arm
d             lever of torsion, a length               (k, 2)          lever
mu            friction coefficient                     (k,)            friction
============  =======================================  ==============  ============================

The problem is stated to a sink, as all problems are. Branch and bound solves thousands of them,
which differ in the disjuncts of a contact or two: there is nothing for Parameters to patch, and so
the rows of a statement are cut into blocks of columns
(:mod:`~cvxlimit.extensions.interaction.relaxation.column_blocks`) that problems share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.extensions.interaction.halves import SymmetricHalf
from cvxlimit.extensions.interaction.relaxation.column_blocks import (
    ColumnBlock,
    Columns,
    Halfway,
    cut,
)
from cvxlimit.extensions.interaction.relaxation.stated import StatedDisjuncts
from cvxlimit.extensions.interaction.states.disjuncts import Disjuncts
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.formulations import resultants, times
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.sinks import Constraints, Form, Rows
from cvxlimit.readings.pressure import half_extent
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, SolverSettings, default_ladder
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces.coulomb import Rocking


@dataclass(frozen=True, eq=False)
class HullState(LimitState):
    """The answer of a relaxation. ``halfway`` is a point on the solver's way to the answer, from
    which a similar problem may start; None where the solver returned none."""

    halfway: Halfway | None = None


class HullProblem:
    """The relaxations of one scene, which differ in their disjuncts and share equilibrium.

    With the ``half`` of a symmetric scene the problems are those of that half; their answers are
    given for the whole scene.

    Attributes
    ----------
    matrix : (equations, 6 m) sparse array
        A: equilibrium of the m contacts that the problem has, six force components each.
    dead, live : (equations,) arrays
        f_dead and f_live. As ``matrix`` they are scaled; ``scaling`` goes back.
    contacts : Contacts
        All n contacts of the scene, scaled.
    number : (n,) array of int
        The place of each contact among those m.
    extent : (n, 2) array
        Half sides of the contacts, of which pressure centres are fractions.
    """

    def __init__(self, scene: Scene | Assemblage, half: SymmetricHalf | None = None) -> None:
        self.assemblage, self.half = Assemblage.of(scene), half
        whole = Reduction.none(self.assemblage.statics, resultants)
        reduction = whole if half is None else half.reduction(whole)
        plain = LimitProgram(self.assemblage, (Rocking(),), reduction=reduction)
        self.scaling, self.equilibrium = self.assemblage.scaling, plain.equilibrium
        # The formulation has one component of all contacts after the other; here all components of
        # a contact stand together.
        order = np.arange(self.equilibrium.matrix.shape[1]).reshape(len(COMPONENTS), -1).T.ravel()
        self.matrix = self.equilibrium.matrix.tocsc()[:, order]
        self.dead, self.live = map(self.equilibrium.of_load, plain.loads)
        self.contacts = self.assemblage.scaled.contacts
        self.extent, self.number = half_extent(self.contacts), np.arange(len(self.contacts))
        if half is not None:
            self.number = np.searchsorted(half.kept, self.number)
        self._load_blocks: dict[float | None, LoadBlock] = {}
        self._last: tuple[tuple[object, ...], Columns, ConeProgram] | None = None

    def solve(
        self,
        disjuncts: Disjuncts | Sequence[ColumnBlock],
        settings: SolverSettings | None = None,
        relief_price: float | None = None,
        start: Halfway | None = None,
        enough: float = -np.inf,
    ) -> HullState:
        """Solves the relaxation with one solver, whose failure is in the answer's outcome and
        raises nothing.

        With a ``relief_price`` any share r of the dead load may be taken off at that price, which
        is subtracted from the load factor: such a problem has a solution whatever the disjuncts.
        Our own solver begins at ``start``, and stops where it has proved that the load factor is
        below ``enough``.
        """
        # The next solver of a ladder gets the same problem, which is put together only once.
        content = relief_price, *([disjuncts] if isinstance(disjuncts, Disjuncts) else disjuncts)
        if self._last is None or self._last[0] != content:
            columns = self.columns(disjuncts, relief_price)
            self._last = content, columns, self.program(columns, relief_price)
        _, columns, program = self._last
        program = replace(program, enough=-enough / self.scaling.load_factor(1.0))
        cache: dict[str, Any] = {"starts": [] if start is None else [columns.start(start)]}
        outcome, x, y = program.solve(settings or default_ladder()[0], cache, is_warm=False)
        if x is None or y is None:
            return HullState(outcome, None, None, None)
        # Contact forces are the sums over disjuncts, and those of the other half mirror these.
        rows, unknowns, values = columns.forces()
        size = self.matrix.shape[1]
        forces = np.asarray(np.bincount(rows, values * x[unknowns], size), dtype=float)
        if self.half is not None:
            forces = self.half.forces @ forces
        middle = cache.get("middle")
        return HullState(
            outcome,
            self.scaling.load_factor(float(x[0])),
            self.scaling.forces(forces.reshape(-1, len(COMPONENTS))),
            self.equilibrium.mechanism(y),
            halfway=None if middle is None else Halfway(columns.members, middle),
        )

    def stated(
        self, disjuncts: Disjuncts, into: Constraints | Rows, relief_price: float | None = None
    ) -> Any:
        """States the whole problem to a sink, and returns what is to be maximised."""
        load, goal = self._stated_load(into, relief_price)
        stated = self._stated(disjuncts, into)
        into.zero(self.matrix @ stated.forces + (load + self.dead))
        return goal

    def column_blocks(
        self, disjuncts: Disjuncts, unit: IntArray | None = None, count: int | None = None
    ) -> list[ColumnBlock]:
        """Returns the columns of disjuncts, and the rows that are theirs alone, as one block for
        each of the units to which ``unit`` (k,) assigns the disjuncts; as a single block without.

        Units that have none get no block, unless the ``count`` of all is given.
        """
        # The disjuncts of the half that is left, and the units that these have.
        unit = np.zeros(len(disjuncts), dtype=int) if unit is None else unit
        if self.half is not None:
            kept = ~np.isin(disjuncts.contact, self.half.dropped)
            disjuncts, unit = disjuncts.take(kept), unit[kept]
        if count is None:
            units, unit = np.unique(unit, return_inverse=True)
            count = len(units)
        # All of them are stated at once, for calls of NumPy cost more than what they compute.
        into = Rows()
        stated = self._stated(disjuncts, into)
        into.zero(self.matrix @ stated.forces)
        entries = stated.forces.row, stated.forces.column, stated.forces.value
        return cut(into, stated.owners, entries, disjuncts.contact, unit, count)

    def columns(
        self, disjuncts: Disjuncts | Sequence[ColumnBlock], relief_price: float | None = None
    ) -> Columns:
        """Returns all columns of the problem: the load factor's, the relief's if there is one,
        and those of the disjuncts."""
        blocks = self.column_blocks(disjuncts) if isinstance(disjuncts, Disjuncts) else disjuncts
        return Columns([self._load_block(relief_price).block, *blocks], len(self.dead))

    def program(self, columns: Columns, relief_price: float | None = None) -> ConeProgram:
        """Returns the cone program of these columns."""
        return self._load_block(relief_price).program(columns)

    def _stated(self, disjuncts: Disjuncts, into: Constraints | Rows) -> StatedDisjuncts:
        count = self.matrix.shape[1] // len(COMPONENTS)
        return StatedDisjuncts(disjuncts, self.contacts, self.number, count, into)

    def _load_block(self, relief_price: float | None) -> LoadBlock:
        """Returns the block of the load, stated once for each price."""
        if relief_price not in self._load_blocks:
            into = Rows()
            load, goal = self._stated_load(into, relief_price)
            into.zero(load + self.dead)
            self._load_blocks[relief_price] = LoadBlock.of(into, goal)
        return self._load_blocks[relief_price]

    def _stated_load(self, into: Constraints | Rows, relief_price: float | None) -> tuple[Any, Any]:
        """States the load to a sink. Returns what stands beside f_dead in the equations,
        alpha f_live - r f_dead with 0 <= r <= 1, and what is maximised, alpha less the price of
        r."""
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
    """The part of a problem that belongs to no disjunct.

    Attributes
    ----------
    block : ColumnBlock
        The columns of the load factor and of the relief, the first of a program.
    cost : (1,) or (2,) array
        The cost of these columns.
    right : (rows,) array
        Right-hand sides of equilibrium and of the relief's limits.
    """

    block: ColumnBlock
    cost: FloatArray
    right: FloatArray

    @classmethod
    def of(cls, stated: Rows, goal: Form) -> LoadBlock:
        """Makes the block of a statement of one or two unknowns, the load factor and a relief."""
        none = np.zeros(0, dtype=int)
        owners, contact = [np.arange(stated.width)], np.full(stated.width, -1)
        (block,) = cut(stated, owners, (none, none, np.zeros(0)), contact, 0 * contact, 1)
        program = stated.written(goal).program
        return cls(block, program.cost, program.right)

    def program(self, columns: Columns) -> ConeProgram:
        """Returns the program of columns of which these are the first. Cost and right-hand sides
        are zero beyond this block, since disjuncts are cones."""
        equations = columns.equations
        cost, right = np.zeros(columns.columns), np.zeros(columns.lines + 3 * columns.cones)
        cost[: len(self.cost)] = self.cost
        right[: len(self.right) - equations] = self.right[equations:]
        right = np.concatenate([self.right[:equations], right])
        sizes = equations, columns.lines, (3,) * columns.cones
        return ConeProgram(cost, columns.matrix(), right, *sizes)
