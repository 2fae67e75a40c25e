"""Bound tightening: how far from its contact's middle pressure can act at a load factor."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.interaction.relaxation.hull import CopyColumns, HullProblem, stacked
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.solvers import SolverSettings
from cvxlimit.solvers.program import ConeProgram

FloatArray = NDArray[np.float64]


class Reach:
    """How far from its contact's middle pressure can act if a load factor is to be reached.

    The largest e = X / N over all states of a relaxation with a load factor of ``least`` or more
    is one convex problem: by homogeneity states may be scaled to N = 1 at the contact asked about,
    with the dead load scaled by t >= 0 (Charnes and Cooper). Its mechanism shows why pressure
    beyond cannot act: it bounds the load factor of all such states by ``least``.

    Parameters
    ----------
    problem : HullProblem
        Of a whole scene.
    copies : Copies
    least : float
        Load factor, in the user's units.
    """

    def __init__(self, problem: HullProblem, copies: Copies, least: float) -> None:
        self.problem = problem
        columns = CopyColumns(problem, copies)
        plain = columns.program()
        rows = plain.matrix.tocsr()
        zero, self.width = plain.zero, plain.matrix.shape[1] + 1
        dead = sp.csc_array(problem.dead[:, None])
        alpha = least / problem.scaling.load_factor(1.0)
        reached = [(np.array([0, 0, 1]), np.array([0, self.width - 1, self.width - 1]),
                    np.array([-1.0, alpha, -1.0]))]  # fmt: skip
        rest = sp.hstack([rows[zero:], sp.csc_array((rows.shape[0] - zero, 1))])
        self.matrix = sp.vstack(
            [sp.hstack([rows[:zero], dead]), stacked(reached, (2, self.width)), rest], format="csr"
        )
        self.counts = zero + 1, plain.nonneg + 2, plain.cones
        self.meaning = columns.meaning.tocsr()

    def furthest(
        self, contact: int, axis: int, sign: float, settings: SolverSettings
    ) -> tuple[float, FloatArray] | None:
        """Largest e1 or e2 (``axis``) times ``sign`` as a fraction, and its mechanism (free, 6).

        None if the solver has no answer, for contacts that do not press among them.
        """
        base = len(COMPONENTS) * contact
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
        at = float(-cost @ x) / float(self.problem.extent[contact, axis])
        return at, self.problem.mechanism(y[1:])
