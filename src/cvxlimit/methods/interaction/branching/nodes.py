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
from cvxlimit.methods.interaction.relaxation.hull import Halfway, HullProblem, HullState
from cvxlimit.methods.interaction.relaxation.upper import missed_copies
from cvxlimit.methods.interaction.settings import BRANCH
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.methods.interaction.states.pressure import centres
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solvers import SolverSettings, node_ladder, tight_ladder
from cvxlimit.surfaces import Rocking


@dataclass(frozen=True)
class Split:
    """The box of a ``contact`` cut along an ``axis`` at ``ends``. Every part has a bound, which
    holds in all nodes below the one where it was found."""

    contact: int
    axis: int
    ends: tuple[float, ...]
    bounds: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Node:
    """Boxes (n, 2, 2) of pressure centres: a certified ``bound`` with its ``mechanism``, the
    relaxation's ``forces`` and ``load_factor``, copies ``added`` by pricing, and splits that were
    tried above and are ``due``. ``is_missing`` is True if copies were added since it was solved;
    ``halfway`` is where the solver may start for its parts."""

    bound: float
    boxes: FloatArray
    added: Copies
    forces: FloatArray | None = None
    load_factor: float = -np.inf
    mechanism: FloatArray | None = None
    due: tuple[Split, ...] = ()
    is_missing: bool = False
    halfway: Halfway | None = None


@dataclass(frozen=True)
class Goal:
    """What a node is explored for: a ``lower`` bound on the load factor, the gap ``width`` that is
    asked for, the ``price`` of the dead load, and the relative ``precision`` of powers in
    bounds."""

    lower: float
    width: float
    price: float | None = None
    precision: float = 0.0

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
    contacts, where one is known, ``tolerance`` the relative width at which nodes are closed."""

    def __init__(
        self,
        assemblage: Assemblage,
        moments: Moments,
        ladder: Sequence[SolverSettings] | None = None,
        opening: FloatArray | None = None,
        tolerance: float = 1e-4,
    ) -> None:
        self.moments, self.contacts = moments, assemblage.contacts
        self.ladder = tuple(ladder or node_ladder(len(self.contacts), tolerance))
        self.tight = tuple(ladder or tight_ladder())
        self.flow = InteractionFlow(self.contacts, moments)
        self.certifier = Certifier(assemblage, (Rocking(),), flow=self.flow)
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

    def evaluated(self, node: Node, goal: Goal, rounds: int = BRANCH.rounds) -> Node:
        """Solve, certify, add copies; a solver's failure leaves the bound and forces as given. A
        further round follows where the relaxation is low enough to close the node but the bound,
        for lack of copies, is not."""
        flow = self.flow.within(node.boxes, goal.precision)
        certifier = self.certifier.with_flow(flow)
        first = self.moments.box_copies(self.contacts, node.boxes)
        worth = BRANCH.worth_a_copy * goal.width
        for number in range(BRANCH.rounds):
            if number >= rounds and not node.load_factor <= goal.cut < node.bound:
                break
            copies, enough = first.joined(node.added), goal.cut - BRANCH.beneath * goal.width
            state = self.solve(copies, goal.price, start=node.halfway, enough=enough)
            node = replace(node, is_missing=False, halfway=state.halfway or node.halfway)
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
            node = replace(node, added=node.added.joined(missed), is_missing=True)
        return node

    def solve(
        self,
        copies: Copies,
        price: float | None,
        glued: IntArray | None = None,
        ladder: Sequence[SolverSettings] | None = None,
        start: Halfway | None = None,
        enough: float = -np.inf,
    ) -> HullState:
        for settings in ladder or self.ladder:
            self.solves += 1
            self.solvers.add(settings.name)
            state = self.problem.solve(copies, settings, price, glued, start, enough)
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
    speed = relaxer.speeds(seen[1])
    speed = speed + BRANCH.speed_at_rest * float(speed.max())
    return _excess(relaxer, boxes, seen) * speed


def _excess(relaxer: Relaxer, boxes: FloatArray, seen: _Seen) -> FloatArray:
    forces, _, free = seen
    width = np.ptp(boxes, axis=2).max(axis=1)
    # what is beyond that in a narrow box is the solver's, and no split takes it away
    most = width * np.maximum(forces[:, COLUMN["N"]], 0.0)
    excess = np.clip(relaxer.moments.excess(forces, relaxer.contacts), 0.0, most)
    return np.where(free & (width > BRANCH.narrowest), excess, 0.0)


def choices(relaxer: Relaxer, node: Node, goal: Goal) -> list[Split]:
    """Where to split; none if nothing can. The contact that carries most of the gap, and with
    independent signs also the one with the largest excess: what moves in one of many mechanisms of
    a node may be at rest in the next."""
    if node.forces is None or node.mechanism is None:
        return _widest(relaxer, node)
    every = np.ones(len(relaxer.contacts), dtype=bool)
    seen = _beneath(relaxer, node, (node.forces, node.mechanism, every), goal)
    orders = [scores(relaxer, node.boxes, seen)]
    if relaxer.moments.slopes is None:
        orders.append(_excess(relaxer, node.boxes, seen))
    best = dict.fromkeys(int(order.argmax()) for order in orders if order.max() > 0.0)
    return [_place(relaxer, node, seen[0], j) for j in best] or _widest(relaxer, node)


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


def _place(relaxer: Relaxer, node: Node, forces: FloatArray, contact: int) -> Split:
    centre = centres(forces, relaxer.contacts)[contact]
    high = node.boxes[contact, :, 1]
    low, centre = relaxer.moments.folded(node.boxes[contact], centre)
    inner = np.maximum((high - centre) * (centre - low), 0.0) + 1e-3 * (high - low) ** 2
    axis = int(inner.argmax())
    return _cut(relaxer, node, contact, axis, float(centre[axis]))


def _widest(relaxer: Relaxer, node: Node) -> list[Split]:
    width = np.ptp(node.boxes, axis=2)
    contact, axis = (int(i) for i in np.unravel_index(int(width.argmax()), width.shape))
    if width[contact, axis] <= BRANCH.narrowest:
        return []
    return [_cut(relaxer, node, contact, axis, float(node.boxes[contact, axis].mean()))]


def _cut(relaxer: Relaxer, node: Node, contact: int, axis: int, at: float) -> Split:
    low, high = node.boxes[contact, axis].tolist()
    ends = relaxer.moments.split(low, high, at)
    return Split(contact, axis, tuple(ends), (np.inf,) * (len(ends) - 1))


def explore(relaxer: Relaxer, node: Node, goal: Goal) -> Explored:
    """Split a node where that gains most. What else was tried is due in its parts: splits are tried
    once for several levels, and parts closed here need no problem there."""
    relaxer.begun()
    tried = []
    for split in node.due[:1] or choices(relaxer, node, goal):
        parts = _parts(relaxer, node, split, goal)
        bounds = tuple(part.bound for part in parts)
        gains = [node.bound - max(bound, goal.lower) for bound in bounds]
        worth = min(gains) + 0.1 * float(np.mean(gains))
        tried.append((worth, replace(split, bounds=bounds), parts))
        if max(bounds) <= goal.cut:
            break
    if not tried:
        relaxer.closed = node.bound
        return relaxer.explored([], goal)
    worth, best, parts = max(tried, key=lambda entry: entry[0])
    due = node.due[1:]
    if not node.due:
        others = sorted(tried, key=lambda entry: -entry[0])
        due = tuple(
            split for w, split, _ in others if split is not best and w > BRANCH.due * worth > 0.0
        )
    return relaxer.explored([_settled(relaxer, part, due, goal) for part in parts], goal)


def _parts(relaxer: Relaxer, node: Node, split: Split, goal: Goal) -> list[Node]:
    """The parts of a node, those whose bound is not known to close them solved once."""
    j, added = split.contact, node.added.without(np.array([split.contact]))
    parts = []
    for ends, bound in zip(pairwise(split.ends), split.bounds, strict=True):
        boxes = node.boxes.copy()
        boxes[j, split.axis] = ends
        part = replace(node, boxes=boxes, added=added, bound=min(node.bound, bound))
        is_open = part.bound > goal.cut
        parts.append(relaxer.evaluated(part, goal, 1) if is_open else part)
    return parts


def _settled(relaxer: Relaxer, part: Node, due: tuple[Split, ...], goal: Goal) -> Node:
    part = replace(part, due=due)
    if part.is_missing and part.bound > goal.cut:
        part = relaxer.evaluated(part, goal, BRANCH.rounds - 1)
    return part
