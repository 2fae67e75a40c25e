"""Nodes of branch and bound: boxes of pressure centres, relaxed, certified and split.

A node whose states cannot carry the dead load needs no special proof: its relaxation may take dead
load off at a price, and its mechanism then has a bound of minus that price.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cvxlimit.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.interaction.readings.flow import InteractionFlow
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.relaxation.upper import missed_copies
from cvxlimit.methods.interaction.settings import BRANCH
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.methods.interaction.states.pressure import centres
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solvers import LimitState, SolverSettings, node_ladder, tight_ladder
from cvxlimit.surfaces import Rocking


@dataclass(frozen=True, eq=False)
class Node:
    """Boxes (n, 2, 2) of pressure centres: a certified ``bound`` with its ``mechanism``, the
    relaxation's ``forces`` and ``load_factor``, and copies ``added`` by pricing."""

    bound: float
    boxes: FloatArray
    added: Copies
    forces: FloatArray | None = None
    load_factor: float = -np.inf
    mechanism: FloatArray | None = None


@dataclass(frozen=True)
class Goal:
    """What a node is explored for: a ``lower`` bound on the load factor, the gap ``width`` that is
    asked for, the ``price`` of the dead load, and how many contacts are ``tried`` for a split."""

    lower: float
    width: float
    price: float | None = None
    tried: int = 1

    @property
    def cut(self) -> float:
        """Bound at which a node is closed: nearly all of the gap that is asked for, for ranges
        shrink the less the closer it is to the lower bound."""
        return self.lower + BRANCH.closed * self.width


@dataclass(frozen=True, eq=False)
class Explored:
    """What came of a node: those still open, the largest bound of what was closed, what it cost,
    and the names of the solvers that ran in its process so far."""

    open: tuple[Node, ...]
    closed: float
    solves: int
    solvers: frozenset[str]


class Relaxer:
    """All that nodes of one scene share; ``opening`` is a field (free blocks, 6) that opens all
    contacts, where one is known."""

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
        whole = InteractionFlow(self.contacts, moments)
        self.certifier = Certifier(assemblage, (Rocking(),), flow=whole)
        if opening is not None:
            self.certifier.offer_opening_field(opening)
        self.statics = self.certifier.statics
        self.problem = HullProblem(assemblage)
        self.solves = 0
        self.solvers: set[str] = set()
        self.closed = -np.inf

    def begun(self) -> None:
        self.solves, self.closed = 0, -np.inf

    def explored(self, nodes: Sequence[Node], goal: Goal) -> Explored:
        still = tuple(node for node in nodes if node.bound > goal.cut)
        closed = max([self.closed, *(n.bound for n in nodes if n.bound <= goal.cut)])
        return Explored(still, closed, self.solves, frozenset(self.solvers))

    def evaluated(self, node: Node, goal: Goal) -> Node:
        """Solve, certify, add copies; a solver's failure leaves the bound and forces as given."""
        flow = InteractionFlow(self.contacts, self.moments, node.boxes)
        certifier = self.certifier.with_flow(flow)
        first = self.moments.box_copies(self.contacts, node.boxes)
        worth = BRANCH.worth_a_copy * goal.width
        for _ in range(BRANCH.rounds):
            state = self.solve(first.joined(node.added), goal.price)
            if state.mechanism is None or state.load_factor is None:
                break
            node = replace(node, forces=state.forces, load_factor=state.load_factor)
            found = certifier.certificate(state.forces, None, state.mechanism).upper
            if found < node.bound:
                node = replace(node, bound=found, mechanism=state.mechanism)
            close = found - state.load_factor <= worth
            if close or node.bound < goal.lower:
                break
            missed = missed_copies(flow, certifier, state.mechanism, worth)
            if not len(missed):
                break
            node = replace(node, added=node.added.joined(missed))
        return node

    def solve(
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

    def speeds(self, mechanism: FloatArray) -> FloatArray:
        """Slip and twist of contacts (n,) for unit live power."""
        rates = self.statics.relative_rates(mechanism)
        speed: FloatArray = np.hypot(rates[:, 0], rates[:, 1])
        speed = speed + self.contacts.torsion_arm * np.abs(rates[:, COLUMN["MT"]])
        return speed / max(float(self.statics.live @ mechanism.ravel()), 1e-300)


_Seen = tuple[FloatArray, FloatArray, BoolArray]  # forces, mechanism, and the contacts that count


def scores(relaxer: Relaxer, boxes: FloatArray, seen: _Seen) -> FloatArray:
    """How much contacts (n,) carry of the gap: excess of Eq. 30 times speed."""
    forces, mechanism, free = seen
    speed = relaxer.speeds(mechanism)
    speed = speed + BRANCH.speed_at_rest * float(speed.max())
    width = np.ptp(boxes, axis=2).max(axis=1)
    # what is beyond that in a narrow box is the solver's, and no split takes it away
    most = width * np.maximum(forces[:, COLUMN["N"]], 0.0)
    excess = np.clip(relaxer.moments.excess(forces, relaxer.contacts), 0.0, most)
    return np.where(free & (width > BRANCH.narrowest), excess * speed, 0.0)


def choices(relaxer: Relaxer, node: Node, goal: Goal) -> list[tuple[int, int, float]]:
    """Contacts, axes and fractions at which to split, the best first; none if nothing can."""
    if node.forces is None or node.mechanism is None:
        return _widest(node)
    every = np.ones(len(relaxer.contacts), dtype=bool)
    seen = _beneath(relaxer, node, (node.forces, node.mechanism, every), goal)
    # the halves of contacts beneath others have one and the same bound at first
    tried = goal.tried if seen[2].all() else 1
    score = scores(relaxer, node.boxes, seen)
    best = [j for j in np.argsort(-score)[:tried].tolist() if score[j] > 0.0]
    return [_place(relaxer, node, seen[0], j) for j in best] or _widest(node)


def _beneath(relaxer: Relaxer, node: Node, seen: _Seen, goal: Goal) -> _Seen:
    """What tells where to split. Where a part of the scene collapses at a load factor that no split
    changes, all excess is at rest, and says nothing: with that part's contacts glued the rest shows
    how it would collapse."""
    for _ in range(BRANCH.layers):
        forces, mechanism, free = seen
        speed = relaxer.speeds(mechanism)
        excess = np.maximum(relaxer.moments.excess(forces, relaxer.contacts), 0.0)
        if float((excess * speed)[free].sum()) > BRANCH.at_rest * (node.bound - goal.lower):
            break
        glued = ~free | (speed > BRANCH.moves * float(speed.max()))
        copies = relaxer.moments.box_copies(relaxer.contacts, node.boxes).joined(node.added)
        state = relaxer.solve(copies, goal.price, np.flatnonzero(glued))
        factor = state.load_factor
        if state.forces is None or state.mechanism is None or factor is None:
            break
        if glued.all() or not node.bound - goal.width < factor < BRANCH.far * abs(node.bound):
            break
        seen = state.forces, state.mechanism, ~glued
    return seen


def _place(
    relaxer: Relaxer, node: Node, forces: FloatArray, contact: int
) -> tuple[int, int, float]:
    centre = centres(forces, relaxer.contacts)[contact]
    high = node.boxes[contact, :, 1]
    low, centre = relaxer.moments.folded(node.boxes[contact], centre)
    inner = np.maximum((high - centre) * (centre - low), 0.0) + 1e-3 * (high - low) ** 2
    axis = int(inner.argmax())
    return contact, axis, float(centre[axis])


def _widest(node: Node) -> list[tuple[int, int, float]]:
    width = np.ptp(node.boxes, axis=2)
    contact, axis = np.unravel_index(int(width.argmax()), width.shape)
    if width[contact, axis] <= BRANCH.narrowest:
        return []
    return [(int(contact), int(axis), float(node.boxes[contact, axis].mean()))]


def explore(relaxer: Relaxer, node: Node, goal: Goal) -> Explored:
    relaxer.begun()
    best: tuple[float, list[Node]] | None = None
    for contact, axis, at in choices(relaxer, node, goal):
        children, added = [], node.added.without(np.array([contact]))
        low, high = node.boxes[contact, axis]
        for ends in pairwise(relaxer.moments.split(low, high, at)):
            boxes = node.boxes.copy()
            boxes[contact, axis] = ends
            children.append(relaxer.evaluated(replace(node, boxes=boxes, added=added), goal))
        gains = [node.bound - max(child.bound, goal.lower) for child in children]
        gain = min(gains) + 0.1 * float(np.mean(gains))
        if best is None or gain > best[0]:
            best = gain, children
        if max(child.bound for child in children) <= goal.cut:
            break
    if best is None:
        relaxer.closed = node.bound
    return relaxer.explored(best[1] if best else [], goal)
