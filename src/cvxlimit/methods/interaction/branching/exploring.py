"""What branch and bound does at one node: solve, certify, narrow, split. Runs in any process.

- *Relaxation*: the convex hull of every contact's states in its box, with a mechanism that is
  certified against the true states in the boxes. Copies on the edges of boxes are added where the
  mechanism misses them.
- *Narrowing*: how far from the middle of its contact can pressure act if the load factor is to
  exceed the bound that is known from below (:class:`~.nodes.Reach`)? What lies beyond is cut off
  after a certified bound has shown the same. Three rounds of it take the bound of an irregular
  wall of 22 contacts from 0.722 to 0.611 in 2 s, where splitting alone is at 0.635 after 5 s.
- *Splitting* where the relaxation's state violates Eq. 30 most, times the speed at which the
  contact moves. Of the first nodes' best contacts several are tried, and the one kept whose halves
  gain most.

A node whose states cannot carry the dead load needs no special proof: its relaxation may take
dead load off at a price, and its mechanism then has a bound of minus that price.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.interaction.readings.flow import InteractionFlow
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.relaxation.reach import Reach
from cvxlimit.methods.interaction.relaxation.upper import missed_copies
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.methods.interaction.states.support import half_extent, whole_boxes
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.statics import Scaling, Statics
from cvxlimit.proof.certificate import Certifier
from cvxlimit.scene import Scene
from cvxlimit.solvers import (
    LimitState,
    SolverSettings,
    node_ladder,
    tight_ladder,
)
from cvxlimit.surfaces import Rocking

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_NARROW = 1e-7
"""Ranges of this width are not split: solvers could not tell their halves apart."""

_WORTH_A_COPY = 0.05
"""Share of the tolerance that a node's bound must stand to lose for a solve with more copies."""

_SPEED_AT_REST = 1e-3
"""Share of the largest speed with which contacts at rest count: they may move next. With 0.1 they
hide what moves: a wall of 31 contacts stood at 2.90 % for 1,200 nodes, and closes in 2 with less.
With 0.02 two walls of 42 and 46 contacts were at 1.06 and 1.01 % after 60 CPU seconds; with 0.001
the second closes in 22, and one of 31 contacts is at 2.16 % after 25 in place of 1.81 after 20."""

_AT_REST, _MOVES, _LAYERS, _FAR = 0.1, 1e-3, 3, 3.0
"""A node's excess is at rest if it does less than this share of the gap in power; contacts move
that have this share of the largest speed; so many parts may be glued in turn, as long as what is
left collapses at less than so many times the node's bound."""

_ROUNDS = 3
"""Solves per node, with copies added."""

_CUT = 0.1
"""Least share of a range that narrowing must cut off to be worth a proof."""

_BEYOND = 1e-3
"""Narrowing leaves this share of a range beyond what a solver says is reached."""

_ATTEMPTS = 3
"""Solves per end of a range: where the proof fails, copies were missing."""

_GAIN = 0.1
"""Share of the gap that a round of narrowing must close for another one."""

_CLOSED = 0.9
"""Share of the gap asked for at which nodes are closed. Asked for 1 % on a wall of 22 contacts, 20
CPU seconds end at 1.16 % with it, and at 1.36 % with half."""

_TILT = 1e-6
"""Share of the node's own mechanism in a proof of narrowing, which alone may do no live work."""


@dataclass(frozen=True, eq=False)
class Node:
    """Boxes (n, 2, 2) of pressure centres and what is known about states in them.

    ``bound`` is certified; ``forces`` and ``load_factor`` are the relaxation's, ``mechanism`` is
    that of the bound, ``added`` are copies found by pricing.
    """

    bound: float
    boxes: FloatArray
    added: Copies
    forces: FloatArray | None = None
    load_factor: float = -np.inf
    mechanism: FloatArray | None = None


@dataclass(frozen=True)
class Goal:
    """What a node is explored for.

    Attributes
    ----------
    lower : float
        Lower bound on the load factor; nodes below need no answer.
    width : float
        Gap that is asked for; bounds to ``lower`` + :data:`_CLOSED` of it close a node.
    price : float or None
        Of the dead load.
    tried : int
        Contacts that are tried for a split.
    """

    lower: float
    width: float
    price: float | None = None
    tried: int = 1

    @property
    def cut(self) -> float:
        """Bound at which a node is closed: nearly all of the gap that is asked for, for ranges
        narrow the less the closer it is to the lower bound."""
        return self.lower + _CLOSED * self.width


@dataclass(frozen=True, eq=False)
class Explored:
    """What came of a node: those still open, the largest bound of what was closed, and the cost.

    ``solvers`` are the names of those that ran in its process so far.
    """

    open: tuple[Node, ...]
    closed: float
    solves: int
    solvers: frozenset[str]


class Explorer:
    """All that nodes of one scene share.

    Parameters
    ----------
    assemblage : Assemblage
    moments : Moments
    ladder : sequence of SolverSettings or None
        Tried in turn; None is :func:`node_ladder`.
    opening : (free blocks, 6) array or None
        A field that opens all contacts, where one is known.
    """

    def __init__(
        self,
        assemblage: Assemblage,
        moments: Moments,
        ladder: Sequence[SolverSettings] | None = None,
        opening: FloatArray | None = None,
    ) -> None:
        self.moments, self.contacts = moments, assemblage.contacts
        self.ladder = tuple(ladder or node_ladder())
        self.tight = tuple(ladder or tight_ladder())
        self.half = half_extent(self.contacts)
        whole = InteractionFlow(self.contacts, moments)
        self.certifier = Certifier(assemblage, (Rocking(),), flow=whole)
        if opening is not None:
            self.certifier.offer_opening_field(opening)
        self.statics = self.certifier.statics
        self.problem = HullProblem(assemblage)
        self.solves = 0
        self.solvers: set[str] = set()
        self.closed = -np.inf

    def root(self, goal: Goal) -> Node:
        """All pressure centres."""
        empty = Node(np.inf, whole_boxes(self.contacts), Copies.none())
        return self.evaluated(empty, goal)

    def narrowed_root(self, root: Node, goal: Goal) -> Explored:
        """The root after narrowing as long as that gains; without a lower bound nothing is cut."""
        self.solves, self.closed = 0, -np.inf
        node = root
        while node.bound > goal.cut > -np.inf:
            gap = node.bound - goal.cut
            node = self._narrowed(node, goal)
            if gap - (node.bound - goal.cut) < _GAIN * gap:
                break
        return self._explored([node], goal)

    def explore(self, node: Node, goal: Goal) -> Explored:
        """Split a node."""
        self.solves, self.closed = 0, -np.inf
        best: tuple[float, list[Node]] | None = None
        for contact, axis, at in self._choices(node, goal):
            children = [
                self.evaluated(replace(node, boxes=boxes, added=added), goal)
                for boxes, added in self._parts(node, contact, axis, at)
            ]
            gains = [node.bound - max(child.bound, goal.lower) for child in children]
            gain = min(gains) + 0.1 * float(np.mean(gains))
            if best is None or gain > best[0]:
                best = gain, children
            if max(child.bound for child in children) <= goal.cut:
                break
        if best is None:
            self.closed = node.bound
        return self._explored(best[1] if best else [], goal)

    def _explored(self, nodes: Sequence[Node], goal: Goal) -> Explored:
        still = tuple(node for node in nodes if node.bound > goal.cut)
        closed = max([self.closed, *(n.bound for n in nodes if n.bound <= goal.cut)])
        return Explored(still, closed, self.solves, frozenset(self.solvers))

    def evaluated(self, node: Node, goal: Goal) -> Node:
        """Solve, certify, add copies; a solver's failure leaves the bound and forces as given."""
        flow = InteractionFlow(self.contacts, self.moments, node.boxes)
        certifier = self.certifier.with_flow(flow)
        first = self.moments.box_copies(self.contacts, node.boxes)
        for _ in range(_ROUNDS):
            state = self._solve(first.joined(node.added), goal.price)
            if state.mechanism is None or state.load_factor is None:
                break
            node = replace(node, forces=state.forces, load_factor=state.load_factor)
            found = certifier.certificate(state.forces, None, state.mechanism).upper
            if found < node.bound:
                node = replace(node, bound=found, mechanism=state.mechanism)
            close = found - state.load_factor <= _WORTH_A_COPY * goal.width
            if close or node.bound < goal.lower:
                break
            missed = missed_copies(flow, certifier, state.mechanism, _WORTH_A_COPY * goal.width)
            if not len(missed):
                break
            node = replace(node, added=node.added.joined(missed))
        return node

    def _solve(
        self,
        copies: Copies,
        price: float | None,
        glued: IntArray | None = None,
        ladder: Sequence[SolverSettings] | None = None,
    ) -> LimitState:
        for settings in ladder or self.ladder:
            self.solves += 1
            self.solvers.add(settings.name)
            state = self.problem.solve(copies, settings, price, glued)
            if state.mechanism is not None or state.outcome.claims_no_optimum:
                break
        return state

    def safe(self, copies: Copies) -> LimitState:
        """States that are all admissible, solved tightly: their forces are what counts."""
        return self._solve(copies, None, ladder=self.tight)

    def _narrowed(self, node: Node, goal: Goal) -> Node:
        """Ranges of all contacts that carry the gap, without what cannot reach the bound."""
        if node.forces is None or node.mechanism is None:
            return node
        copies = self.moments.box_copies(self.contacts, node.boxes)
        reach = Reach(self.problem, copies.joined(node.added), goal.cut)
        centre = self.centre(node.forces)
        boxes = node.boxes.copy()
        for j in np.flatnonzero(self._scores(node) > 0.0).tolist():
            for axis in (0, 1):
                for side, sign in ((0, -1.0), (1, 1.0)):
                    low, high = boxes[j, axis]
                    if sign * (boxes[j, axis, side] - centre[j, axis]) < _CUT * (high - low):
                        continue
                    node, reach, at = self._reached(node, reach, goal, boxes, (j, axis, sign))
                    boxes[j, axis, side] = at
        if np.array_equal(boxes, node.boxes):
            return node
        changed = np.flatnonzero((boxes != node.boxes).any(axis=(1, 2)))
        return self.evaluated(replace(node, boxes=boxes, added=node.added.without(changed)), goal)

    def _reached(
        self, node: Node, reach: Reach, goal: Goal, boxes: FloatArray, end: tuple[int, int, float]
    ) -> tuple[Node, Reach, float]:
        """Where an end of a range may be cut, after proof; with copies that were missed."""
        j, axis, sign = end
        side = int(sign > 0.0)
        present, width = float(boxes[j, axis, side]), float(np.ptp(boxes[j, axis]))
        assert node.mechanism is not None
        for _ in range(_ATTEMPTS):
            self.solves += 1
            found = reach.furthest(j, axis, sign, self.ladder[0])
            if found is None:
                break
            at = sign * (found[0] + _BEYOND * width)
            if sign * (present - at) < _CUT * width:
                break
            slab = boxes.copy()
            slab[j, axis, 1 - side] = at
            flow = InteractionFlow(self.contacts, self.moments, slab)
            certifier = self.certifier.with_flow(flow)
            tilt = _TILT * np.abs(found[1]).max() / np.abs(node.mechanism).max()
            rates = found[1] + tilt * node.mechanism
            bound = certifier.certificate(node.forces, None, rates).upper
            if bound <= goal.cut + 0.1 * goal.width:
                self.closed = max(self.closed, bound)
                return node, reach, at
            power = float(self.statics.live @ rates.ravel())
            if not power > 0.0:
                break
            worth = _WORTH_A_COPY * goal.width
            new = missed_copies(flow, certifier, rates / power, worth).without(np.array([j]))
            if not len(new):
                break
            node = replace(node, added=node.added.joined(new))
            copies = self.moments.box_copies(self.contacts, node.boxes).joined(node.added)
            reach = Reach(self.problem, copies, goal.cut)
        return node, reach, present

    def _scores(self, node: Node, free: NDArray[np.bool_] | None = None) -> FloatArray:
        """How much contacts (n,), or those that are ``free``, carry of the gap: excess of Eq. 30
        times speed."""
        assert node.forces is not None
        assert node.mechanism is not None
        speed = self._speeds(node.mechanism)
        speed = speed + _SPEED_AT_REST * float(speed.max())
        width = np.ptp(node.boxes, axis=2).max(axis=1)
        # what is beyond that in a narrow box is the solver's, and no split takes it away
        most = width * np.maximum(node.forces[:, COLUMN["N"]], 0.0)
        excess = np.clip(self.moments.excess(node.forces, self.contacts), 0.0, most)
        counts = width > _NARROW
        return np.where(counts if free is None else counts & free, excess * speed, 0.0)

    def _speeds(self, mechanism: FloatArray) -> FloatArray:
        """Slip and twist of contacts (n,) for unit live power."""
        rates = self.statics.relative_rates(mechanism)
        speed: FloatArray = np.hypot(rates[:, 0], rates[:, 1])
        speed = speed + self.contacts.torsion_arm * np.abs(rates[:, COLUMN["MT"]])
        return speed / max(float(self.statics.live @ mechanism.ravel()), 1e-300)

    def _choices(self, node: Node, goal: Goal) -> list[tuple[int, int, float]]:
        """Contacts, axes and fractions at which to split, the best first; none if nothing can."""
        if node.forces is None or node.mechanism is None:
            return self._widest(node)
        tried = goal.tried
        seen, free = self._beneath(node, goal)
        if not free.all():
            tried = 1  # the halves of such contacts have one and the same bound at first
        scores = self._scores(seen, free)
        best = [j for j in np.argsort(-scores)[:tried].tolist() if scores[j] > 0.0]
        return [self._place(seen, j) for j in best] or self._widest(node)

    def _beneath(self, node: Node, goal: Goal) -> tuple[Node, NDArray[np.bool_]]:
        """The node with forces and mechanism that tell what to split, and the contacts that count.

        Where a part of the scene collapses at a load factor that no split changes, all excess is
        at rest, and says nothing. With the contacts of that part glued the rest shows how it
        would collapse.
        """
        free = np.ones(len(self.contacts), dtype=bool)
        seen = node
        for _ in range(_LAYERS):
            assert seen.forces is not None
            assert seen.mechanism is not None
            speed = self._speeds(seen.mechanism)
            excess = np.maximum(self.moments.excess(seen.forces, self.contacts), 0.0)
            if float((excess * speed)[free].sum()) > _AT_REST * (node.bound - goal.lower):
                return seen, free
            glued = ~free | (speed > _MOVES * float(speed.max()))
            copies = self.moments.box_copies(self.contacts, node.boxes).joined(node.added)
            state = self._solve(copies, goal.price, np.flatnonzero(glued))
            factor = state.load_factor
            if state.forces is None or state.mechanism is None or factor is None:
                break
            if glued.all() or not node.bound - goal.width < factor < _FAR * abs(node.bound):
                break
            seen, free = replace(node, forces=state.forces, mechanism=state.mechanism), ~glued
        return (node, np.ones(len(free), dtype=bool)) if seen is node else (seen, free)

    def _place(self, node: Node, contact: int) -> tuple[int, int, float]:
        assert node.forces is not None
        centre = self.centre(node.forces)[contact]
        high = node.boxes[contact, :, 1]
        low, centre = self.moments.folded(node.boxes[contact], centre)
        inner = np.maximum((high - centre) * (centre - low), 0.0) + 1e-3 * (high - low) ** 2
        axis = int(inner.argmax())
        return contact, axis, float(centre[axis])

    def _widest(self, node: Node) -> list[tuple[int, int, float]]:
        width = np.ptp(node.boxes, axis=2)
        contact, axis = np.unravel_index(int(width.argmax()), width.shape)
        if width[contact, axis] <= _NARROW:
            return []
        return [(int(contact), int(axis), float(node.boxes[contact, axis].mean()))]

    def _parts(
        self, node: Node, contact: int, axis: int, at: float
    ) -> list[tuple[FloatArray, Copies]]:
        """Boxes with one range cut, and the copies that stay in them."""
        low, high = node.boxes[contact, axis]
        added = node.added.without(np.array([contact]))
        parts = []
        for ends in pairwise(self.moments.split(low, high, at)):
            boxes = node.boxes.copy()
            boxes[contact, axis] = ends
            parts.append((boxes, added))
        return parts

    def centre(self, forces: FloatArray) -> FloatArray:
        """Pressure centres (n, 2) as fractions of the half extent."""
        at = Pressure.of(forces, self.contacts)
        return np.clip(np.stack([at.e1, at.e2], axis=1) / self.half, -1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Task:
    """An explorer on its way to another process: what it is made of, and ``key``, its name."""

    key: str
    scene: Scene
    statics: Statics
    scaling: Scaling
    moments: Moments
    ladder: tuple[SolverSettings, ...]
    opening: FloatArray | None

    @classmethod
    def of(cls, key: str, explorer: Explorer, assemblage: Assemblage) -> Task:
        """For the same scene, moments and solvers."""
        opening = explorer.certifier.witnesses.opening_field
        return cls(
            key, assemblage.scene, assemblage.statics, assemblage.scaling, explorer.moments,
            explorer.ladder, opening,
        )  # fmt: skip

    def __call__(self, node: Node, goal: Goal) -> Explored:
        """Explore a node in this process, which keeps the explorer for the next one."""
        explorer = _known.get(self.key)
        if explorer is None:
            balance = Balance(self.statics, corner_compressions(self.statics.contacts))
            assemblage = Assemblage(self.scene, self.statics, self.scaling, balance)
            explorer = Explorer(assemblage, self.moments, self.ladder, self.opening)
            _known.clear()
            _known[self.key] = explorer
        return explorer.explore(node, goal)


_known: dict[str, Explorer] = {}
"""The explorer of this process, one at a time."""
