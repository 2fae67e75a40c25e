"""The hull problem of one scene, written as arrays: what branch and bound solves at every node.

The same problem as :class:`~cvxlimit.methods.interaction.relaxation.hull.HullProblem`, which
CVXPY compiles.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.interaction.states.copies import Copies, copy_arms
from cvxlimit.methods.interaction.states.support import half_extent
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.statics import DOF
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.solvers.program import ConeProgram

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class NodeProblem:
    """Limit problems over copies of one scene's contacts; equilibrium is kept from one to the next.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.methods.interaction.readings.moments import SIGNED
    >>> from cvxlimit.solvers import settings_for
    >>> assemblage = Assemblage.of(builtin_scene("single-block"))
    >>> copies = SIGNED.box_copies(assemblage.contacts)
    >>> state = NodeProblem(assemblage).solve(copies, settings_for("CLARABEL"))
    >>> round(state.load_factor, 4)
    0.4
    """

    def __init__(self, assemblage: Assemblage) -> None:
        self.assemblage, self.scaling = assemblage, assemblage.scaling
        self.statics = assemblage.scaled
        self.contacts = self.statics.contacts
        self.half = half_extent(self.contacts)
        matrix, loads = self.statics.matrix, abs(self.statics.dead) + abs(self.statics.live)
        self.rows = np.flatnonzero((abs(matrix).sum(axis=1) > 0.0) | (loads > 0.0))
        self.matrix = matrix[self.rows].tocsc()

    def solve(
        self, copies: Copies, settings: SolverSettings, relief_price: float | None = None
    ) -> LimitState:
        """See :meth:`~cvxlimit.methods.interaction.relaxation.hull.HullProblem.solve`."""
        layout = _Layout(self, copies, relief_price)
        outcome, x, y = layout.program().solve(settings)
        if x is None or y is None:
            return LimitState(outcome, None, None, None)
        mechanism = np.zeros(len(self.statics.dead))
        mechanism[self.rows] = y
        forces = np.asarray(layout.meaning @ x).reshape(-1, len(COMPONENTS))
        return LimitState(
            outcome,
            self.scaling.load_factor(float(x[0])),
            self.scaling.forces(forces),
            self.scaling.mechanism(mechanism.reshape(-1, DOF)),
        )


class Reach:
    """How far from its contact's middle pressure can act if a load factor is to be reached.

    The largest e = X / N over all states of a relaxation with a load factor of ``least`` or more
    is one convex problem: by homogeneity states may be scaled to N = 1 at the contact asked about,
    with the dead load scaled by t >= 0 (Charnes and Cooper). Its mechanism shows why pressure
    beyond cannot act: it bounds the load factor of all such states by ``least``.

    Parameters
    ----------
    problem : NodeProblem
    copies : Copies
    least : float
        Load factor, in the user's units.
    """

    def __init__(self, problem: NodeProblem, copies: Copies, least: float) -> None:
        self.problem = problem
        layout = _Layout(problem, copies, None)
        plain = layout.program()
        rows = plain.matrix.tocsr()
        zero, self.width = plain.zero, plain.matrix.shape[1] + 1
        dead = sp.csc_array(problem.statics.dead[problem.rows][:, None])
        alpha = least / problem.scaling.load_factor(1.0)
        reached = [(np.array([0, 0, 1]), np.array([0, self.width - 1, self.width - 1]),
                    np.array([-1.0, alpha, -1.0]))]  # fmt: skip
        rest = sp.hstack([rows[zero:], sp.csc_array((rows.shape[0] - zero, 1))])
        self.matrix = sp.vstack(
            [sp.hstack([rows[:zero], dead]), _matrix(reached, (2, self.width)), rest], format="csr"
        )
        self.counts = zero + 1, plain.nonneg + 2, plain.cones
        self.meaning = layout.meaning.tocsr()

    def furthest(
        self, contact: int, axis: int, sign: float, settings: SolverSettings
    ) -> tuple[float, FloatArray] | None:
        """Largest e1 or e2 (``axis``) times ``sign`` as a fraction, and its mechanism (free, 6).

        None if the solver has no answer, for contacts that do not press among them.
        """
        problem, base = self.problem, len(COMPONENTS) * contact
        normal = self.meaning[[base + COLUMN["N"]]]
        if not normal.nnz:
            return None
        moment, turn = (("M2", -1.0), ("M1", 1.0))[axis]
        cost = np.zeros(self.width)
        cost[:-1] = -sign * turn * self.meaning[[base + COLUMN[moment]]].toarray()[0]
        unit = sp.hstack([normal, sp.csr_array((1, 1))])
        matrix = sp.vstack([unit, self.matrix], format="csc")
        right = np.zeros(matrix.shape[0])
        right[0] = 1.0
        _, x, y = ConeProgram(cost, matrix, right, *self.counts).solve(settings)
        if x is None or y is None:
            return None
        mechanism = np.zeros(len(problem.statics.dead))
        mechanism[problem.rows] = y[1:]
        rates = problem.scaling.mechanism(mechanism.reshape(-1, DOF))
        return float(-cost @ x) / float(problem.half[contact, axis]), rates


class _Layout:
    """Columns and rows of one problem; the formulas are those of :mod:`copies`.

    Variables are the load factor, the relief, and per copy N, V1, V2 (where it shears), tau (where
    its arm is not zero), bounds on abs(V1) and abs(V2) (where they drag on torsion), and per
    contact what of M2, M1 and MT is free within bounds.
    """

    def __init__(self, problem: NodeProblem, copies: Copies, price: float | None) -> None:
        self.problem, self.copies = problem, copies
        contacts = problem.contacts
        self.half = problem.half[copies.contact]
        self.arm = copy_arms(copies, contacts)
        self.friction = contacts.friction[copies.contact]
        self.price = price
        self.width = 1 if price is None else 2
        self.entries: list[tuple[IntArray, IntArray, FloatArray]] = []
        self.signs: list[tuple[IntArray, IntArray, FloatArray]] = []
        self.nonneg = 0
        self._add_variables()

    def _add_variables(self) -> None:
        copies, half = self.copies, self.half
        every = np.arange(len(copies))
        self.pressed = self._new(len(copies))
        e1, e2 = (half * copies.centre).T
        self._force("N", every, self.pressed, 1.0)
        self._force("M1", every, self.pressed, e2)
        self._force("M2", every, self.pressed, -e1)
        self.shears = np.flatnonzero(copies.signed | (self.arm > 0.0))
        self.twists = np.flatnonzero(self.arm > 0.0)
        shears = self.shears
        about = np.where(copies.signed[:, None], half * copies.lever, 0.0)[shears]
        self.v1, self.v2 = self._new(len(shears)), self._new(len(shears))
        self._force("V1", shears, self.v1, 1.0)
        self._force("V2", shears, self.v2, 1.0)
        self._force("MT", shears, self.v1, -about[:, 1])
        self._force("MT", shears, self.v2, about[:, 0])
        self.tau = self._new(len(self.twists))
        idle = np.ones(len(copies), dtype=bool)
        idle[shears] = self.friction[shears] <= 0.0
        self._bounded_below(self.pressed[idle])
        self._bounded_below(self.tau)
        for axis, moment in enumerate(("M2", "M1")):
            reach = (half * copies.spread)[:, axis]
            spread = np.flatnonzero(reach > 0.0)
            self._add_bounded(moment, spread, reach[spread], self.pressed[spread])
        own = copies.limited[self.twists]
        twists = self.twists[~own]
        self._add_bounded("MT", twists, self.arm[twists], self.tau[~own])
        self._limit_torsion(about, self.twists[own], self.tau[own])
        self.drag = self._drags()

    def _limit_torsion(self, about: FloatArray, twists: IntArray, tau: IntArray) -> None:
        """Eq. 27: torsion of their own for limited copies, which with what their shear does about
        the contact's centre is at most c mu N."""
        limited = np.flatnonzero(self.copies.limited[self.shears])
        k = self.shears[limited]
        own = self._new(len(twists))
        self._force("MT", twists, own, 1.0)
        place = np.searchsorted(k, twists)
        for sign in (1.0, -1.0):
            self._row(len(twists), (own, sign), (tau, -self.arm[twists]))
            rows = self.nonneg + np.arange(len(k))
            self.signs.append((rows, self.v1[limited], -sign * about[limited, 1]))
            self.signs.append((rows, self.v2[limited], sign * about[limited, 0]))
            self.signs.append((rows[place], own, np.full(len(own), sign)))
            self.signs.append((rows, self.pressed[k], -self.arm[k] * self.friction[k]))
            self.nonneg += len(k)

    def _drags(self) -> list[tuple[IntArray, IntArray, FloatArray]]:
        """kappa . (abs(V1), abs(V2)): places among the copies that shear, columns, weights."""
        k = self.shears
        fixed = np.where(self.copies.signed[k][:, None], 0.0, np.abs(self.copies.centre[k]))
        eps = self.half[k] * (fixed + self.copies.spread[k])
        given = np.isfinite(self.copies.drag[k]).all(axis=1) & ~self.copies.signed[k]
        found = []
        for axis, shear in enumerate((self.v1, self.v2)):
            weight = eps[:, 1 - axis] / np.where(self.arm[k] > 0.0, self.arm[k], 1.0)
            weight = np.where(given, self.copies.drag[k, axis], weight)
            rows = np.flatnonzero(weight > 0.0)
            size = self._new(len(rows))
            for sign in (1.0, -1.0):
                self._row(len(rows), (shear[rows], sign), (size, -1.0))
            found.append((rows, size, weight[rows]))
        return found

    def _add_bounded(self, component: str, k: IntArray, reach: FloatArray, size: IntArray) -> None:
        """A free part of a contact's force component, between +- sums of reach * size."""
        rows, place = np.unique(self.copies.contact[k], return_inverse=True)
        part = self._new(len(rows))
        base = len(COMPONENTS) * rows + COLUMN[component]
        self.entries.append((base, part, np.ones(len(rows))))
        for sign in (1.0, -1.0):
            self.signs.append((self.nonneg + np.arange(len(rows)), part, np.full(len(rows), sign)))
            self.signs.append((self.nonneg + place, size, -reach))
            self.nonneg += len(rows)

    def _new(self, count: int) -> IntArray:
        self.width += count
        return np.arange(self.width - count, self.width)

    def _force(
        self, component: str, k: IntArray, columns: IntArray, values: FloatArray | float
    ) -> None:
        rows = len(COMPONENTS) * self.copies.contact[k] + COLUMN[component]
        self.entries.append((rows, columns, np.broadcast_to(values, rows.shape)))

    def _row(self, count: int, *terms: tuple[IntArray, FloatArray | float]) -> None:
        rows = self.nonneg + np.arange(count)
        self.signs += [(rows, columns, np.broadcast_to(v, count)) for columns, v in terms]
        self.nonneg += count

    def _bounded_below(self, columns: IntArray) -> None:
        self._row(len(columns), (columns, -1.0))

    @property
    def meaning(self) -> sp.csc_array:
        """Contact forces (6 n,) from the variables."""
        size = len(COMPONENTS) * len(self.problem.contacts)
        return _matrix(self.entries, (size, self.width))

    def program(self) -> ConeProgram:
        """Equations of equilibrium, inequalities, and one cone per copy that shears."""
        problem, shears = self.problem, self.shears
        statics, rows = problem.statics, problem.rows
        balance = problem.matrix @ self.meaning
        loads = [(np.arange(len(rows)), np.zeros(len(rows), dtype=int), statics.live[rows])]
        cost = np.zeros(self.width)
        cost[0] = -1.0
        bound = np.zeros(self.nonneg)
        if self.price is not None:
            unit = problem.scaling.load_factor(1.0)
            cost[1] = self.price / unit
            loads.append((np.arange(len(rows)), np.ones(len(rows), dtype=int), -statics.dead[rows]))
            relief = np.array([1])
            for sign in (-1.0, 1.0):
                self._row(1, (relief, sign))
            bound = np.concatenate([bound, [0.0, 1.0]])
        equations = balance + _matrix(loads, balance.shape)
        tops = 3 * np.arange(len(shears))
        mu = self.friction[shears]
        cones = [(tops, self.pressed[shears], -mu), (tops + 1, self.v1, -np.ones(len(shears)))]
        cones.append((tops + 2, self.v2, -np.ones(len(shears))))
        place = np.searchsorted(shears, self.twists)
        cones.append((tops[place], self.tau, np.ones(len(place))))
        cones += [(tops[at], size, weight) for at, size, weight in self.drag]
        matrix = sp.vstack(
            [
                equations,
                _matrix(self.signs, (self.nonneg, self.width)),
                _matrix(cones, (3 * len(shears), self.width)),
            ],
            format="csc",
        )
        right = np.concatenate([-statics.dead[rows], bound, np.zeros(3 * len(shears))])
        return ConeProgram(cost, matrix, right, len(rows), self.nonneg, (3,) * len(shears))


def _matrix(
    entries: list[tuple[IntArray, IntArray, FloatArray]], shape: tuple[int, int]
) -> sp.csc_array:
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    result = sp.csc_array((values, (rows, columns)), shape)
    result.eliminate_zeros()
    return result
