"""Bound tightening: ranges of pressure centres that cannot reach the lower bound are cut off.

A node of branch and bound allows each contact a *range* of pressure centres along each side. A
convex problem (:class:`Reach`) finds how far pressure can act from the middle of a contact if the
load factor is to be at least the lower bound. Beyond it the range is cut off, after the certified
bound of a mechanism has shown the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.interaction.branching.nodes import Explored, Goal, Node, Relaxer, scores
from cvxlimit.extensions.interaction.relaxation.column_blocks import ColumnBlock, Columns, stacked
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem, LoadBlock
from cvxlimit.extensions.interaction.relaxation.upper import priced_disjuncts
from cvxlimit.extensions.interaction.settings import BRACKET, BRANCH, PROOF
from cvxlimit.extensions.interaction.states.disjuncts import Disjuncts
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.model.formulations import times
from cvxlimit.model.sinks import Rows
from cvxlimit.readings.pressure import centres
from cvxlimit.solvers import SolverSettings


def tightened_root(
    relaxer: Relaxer, node: Node, goal: Goal, has_time: Callable[[], bool] = lambda: True
) -> Explored:
    """Tightens the root round by round, as long as a round gains enough and ``has_time`` is true,
    and returns it as explored. Without a lower bound nothing is cut."""
    relaxer.begun()
    while node.bound > goal.cut > -np.inf and has_time():
        gap = node.bound - goal.cut
        node = _Tightening(relaxer, node, goal).tightened(has_time)
        if gap - (node.bound - goal.cut) < BRANCH.cut * gap:
            break
    return relaxer.explored([node], goal)


class _Tightening:
    """One round of tightening, over all ranges of a node at contacts that carry its gap.

    ``boxes`` (n, 2, 2) are the ranges so far: contact, side of the contact, low and high end.
    """

    def __init__(self, relaxer: Relaxer, node: Node, goal: Goal) -> None:
        self.relaxer, self.node, self.goal = relaxer, node, goal
        self.boxes, self._is_missing = node.boxes.copy(), False

    def tightened(self, has_time: Callable[[], bool]) -> Node:
        """Returns the node with its ranges cut and its relaxation solved again."""
        relaxer, node = self.relaxer, self.node
        if node.forces is None or node.mechanism is None:
            return node
        self._state_reach()
        # Contacts that carry the gap, those with the highest score first.
        centre = centres(node.forces, relaxer.contacts)
        score = scores(relaxer, node)
        rows = [j for j in np.argsort(-score).tolist() if score[j] > 0.0]
        # Each end of their ranges that is far enough from the pressure centre is moved inwards.
        for j, axis, side in product(rows, (0, 1), (0, 1)):
            if not has_time():
                break
            low, high = self.boxes[j, axis]
            sign = 2.0 * side - 1.0
            if sign * (self.boxes[j, axis, side] - centre[j, axis]) >= BRANCH.cut * (high - low):
                self.boxes[j, axis, side] = self._reached(j, axis, sign)
        if np.array_equal(self.boxes, node.boxes):
            return self.node
        # The relaxation of the smaller ranges, without disjuncts that belong to the larger ones.
        changed = np.flatnonzero((self.boxes != node.boxes).any(axis=(1, 2)))
        added = self.node.without(*changed.tolist())
        (solved,) = relaxer.evaluated(
            [replace(self.node, boxes=self.boxes, added=added)], self.goal
        )
        return solved

    def _state_reach(self) -> None:
        """States the problem of how far pressure can act, for the node's disjuncts."""
        (pieces,) = self.relaxer.pieces([self.node.boxes])
        self.reach = Reach(self.relaxer.problem, [*pieces, *self.node.added], self.goal.cut)

    def _reached(self, j: int, axis: int, sign: float) -> float:
        """Returns the end of contact j's range along ``axis``, at its low (``sign`` -1) or high (1)
        side, after cutting off what a certified bound allows; the present end if nothing is."""
        relaxer, boxes, side = self.relaxer, self.boxes, int(sign > 0.0)
        present, width = float(boxes[j, axis, side]), float(np.ptp(boxes[j, axis]))
        for _ in range(BRANCH.attempts):
            relaxer.solves += 1
            # How far pressure can act, and a little more.
            furthest = self.reach.furthest(j, axis, sign, relaxer.ladder[0])
            if furthest is None:
                break
            at = sign * (furthest[0] + BRANCH.beyond * width)
            if sign * (present - at) < BRANCH.cut * width:
                break
            # The slab beyond is cut off if the mechanism proves that it may be. If instead the
            # mechanism shows disjuncts that were missing, the problem is stated again with them.
            slab = boxes.copy()
            slab[j, axis, 1 - side] = at
            if self._is_shut(slab, furthest[1], j):
                return at
            if not self._is_missing:
                break
            self._state_reach()
        return present

    def _is_shut(self, slab: FloatArray, mechanism: FloatArray, j: int) -> bool:
        """Returns True if a mechanism (free, 6) proves that states pressed in ``slab`` (n, 2, 2) do
        not reach the lower bound; otherwise adds disjuncts of contacts but j that it missed."""
        relaxer, node, goal = self.relaxer, self.node, self.goal
        flow = relaxer.flow.within(slab, goal.precision)
        certifier = relaxer.certifier.with_flow(flow)
        assert node.mechanism is not None
        # The mechanism may do no live work by itself: a little of the node's is added to it.
        tilt = PROOF.margin * np.abs(mechanism).max() / np.abs(node.mechanism).max()
        rates = mechanism + tilt * node.mechanism
        bound = certifier.certificate(node.forces, None, rates).upper
        if bound <= goal.cut + 0.1 * goal.width:
            relaxer.closed = max(relaxer.closed, bound)
            return True
        # Not proved: disjuncts on which this mechanism does more power than those of the problem.
        power, new = float(relaxer.statics.live @ rates.ravel()), Disjuncts.none()
        if power > 0.0:
            worth = BRACKET.worth_a_disjunct * goal.width
            new = priced_disjuncts(flow, certifier, rates / power, worth).without(np.array([j]))
        self._is_missing = len(new) > 0
        if self._is_missing:
            added = (*node.added, *relaxer.problem.column_blocks(new, new.contact))
            self.node = replace(node, added=added)
        return False


class Reach:
    """How far from its contact's middle pressure can act if a load factor is to be reached.

    The pressure centre of a contact is e1 = -M2 / N along t1 and e2 = M1 / N along t2. Its largest
    value over all states of a relaxation with a load factor of ``least`` or more is one convex
    problem: by homogeneity states may be scaled to N = 1 at this contact, with the dead load scaled
    by a ``share`` >= 0 (Charnes and Cooper). The problem's mechanism bounds the load factor of all
    states pressed farther out by ``least``.
    """

    def __init__(
        self, problem: HullProblem, disjuncts: Disjuncts | Sequence[ColumnBlock], least: float
    ) -> None:
        # The scaled loads: live loads times a factor, dead loads times the share, and
        # factor >= least * share.
        self.problem, into = problem, Rows()
        factor, share = into.new(), into.new()
        into.zero(times(problem.live, factor) + times(problem.dead, share))
        into.nonneg(share)
        into.nonneg(factor - least / problem.scaling.load_factor(1.0) * share)
        load = LoadBlock.of(into, 0.0 * factor)
        pieces = problem.column_blocks(disjuncts) if isinstance(disjuncts, Disjuncts) else disjuncts
        joined = Columns([load.block, *pieces], len(problem.dead))
        self.plain = load.program(joined)
        self.resultant_map = sp.csr_array(
            stacked([joined.forces()], (problem.matrix.shape[1], joined.columns))
        )

    def furthest(
        self, contact: int, axis: int, sign: float, settings: SolverSettings
    ) -> tuple[float, FloatArray] | None:
        """Returns the largest e1 (``axis`` 0) or e2 (1) of a contact times ``sign``, as a fraction
        of the half extent, and the problem's mechanism (free, 6); None without an answer, as for
        contacts without compression."""
        base, plain = len(COMPONENTS) * int(self.problem.number[contact]), self.plain
        normal = self.resultant_map[[base + COLUMN["N"]]]
        if not normal.nnz:
            return None
        # Goal: sign times e1 = -M2 or e2 = M1, with the row N = 1 before all others.
        moment, turn = (("M2", -1.0), ("M1", 1.0))[axis]
        cost = -sign * turn * self.resultant_map[[base + COLUMN[moment]]].toarray()[0]
        program = replace(
            plain,
            cost=cost,
            matrix=sp.vstack([normal, plain.matrix], format="csc"),
            right=np.append(1.0, plain.right),
            zero=plain.zero + 1,
        )
        _, x, y = program.solve(settings)
        if x is None or y is None:
            return None
        at = float(-cost @ x) / float(self.problem.extent[contact, axis])
        return at, self.problem.equilibrium.mechanism(y[1:])
