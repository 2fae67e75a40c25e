"""Nodes of branch and bound: boxes of pressure centres, relaxed, certified and split.

A node whose states cannot carry the dead load needs no special proof: its relaxation may take dead
load off at a price, and its mechanism then has a bound of minus that price.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice, pairwise, zip_longest

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
from cvxlimit.solvers import LimitState, SolverSettings, node_ladder
from cvxlimit.surfaces import Rocking


@dataclass(frozen=True)
class Split:
    """The box of a ``contact`` cut along an ``axis`` at ``ends``, for the pressure was ``at`` that
    place. Every part has a bound, which holds in all nodes below the one where it was found."""

    contact: int
    axis: int
    ends: tuple[float, ...]
    bounds: tuple[float, ...]
    at: float

    @property
    def nearest(self) -> list[int]:
        """Parts, nearest first."""
        inside = np.clip(self.at, self.ends[:-1], self.ends[1:])
        return [int(k) for k in np.argsort(np.abs(inside - self.at), kind="stable")]


@dataclass(frozen=True, eq=False)
class Node:
    """Boxes (n, 2, 2) of pressure centres: a certified ``bound`` with its ``mechanism``, the
    relaxation's ``forces`` and ``load_factor``, copies ``added`` by pricing, and splits that were
    tried above and are ``due``. ``is_missing`` is True if copies were added since it was solved."""

    bound: float
    boxes: FloatArray
    added: Copies
    forces: FloatArray | None = None
    load_factor: float = -np.inf
    mechanism: FloatArray | None = None
    due: tuple[Split, ...] = ()
    is_missing: bool = False


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
            state = self.solve(first.joined(node.added), goal.price)
            node = replace(node, is_missing=False)
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
    """Where to split, most promising first; none if nothing can. Contacts that carry most of the
    gap, and those with the largest excess: what moves in one of many mechanisms of a node may be at
    rest in the next. Each along both axes: which one gains is rarely seen beforehand."""
    if node.forces is None or node.mechanism is None:
        return _widest(relaxer, node)
    own = node.forces, node.mechanism, np.ones(len(relaxer.contacts), dtype=bool)
    beneath = _beneath(relaxer, node, own, goal)
    turns = [
        [(int(j), seen[0]) for j in np.argsort(-order) if order[j] > 0.0]
        for seen in ((own,) if beneath is own else (own, beneath))
        for order in (scores(relaxer, node.boxes, seen), _excess(relaxer, node.boxes, seen))
    ]
    first: dict[int, FloatArray] = {}
    for contact, forces in filter(None, chain.from_iterable(zip_longest(*turns))):
        first.setdefault(contact, forces)
    splits = (s for j, forces in first.items() for s in _places(relaxer, node, forces, j))
    tries = BRANCH.tries if relaxer.moments.slopes is None else BRANCH.tied_tries
    return list(islice(splits, tries)) or _widest(relaxer, node)


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


def _places(relaxer: Relaxer, node: Node, forces: FloatArray, contact: int) -> list[Split]:
    """Splits of a contact near where it is pressed, first that of more room to both sides."""
    centre = centres(forces, relaxer.contacts)[contact]
    high = node.boxes[contact, :, 1]
    low, centre = relaxer.moments.folded(node.boxes[contact], centre)
    inner = np.maximum((high - centre) * (centre - low), 0.0) + 1e-3 * (high - low) ** 2
    axes = [a for a in np.argsort(-inner).tolist() if high[a] - low[a] > BRANCH.narrowest]
    return [_cut(relaxer, node, contact, axis, float(centre[axis])) for axis in axes]


def _widest(relaxer: Relaxer, node: Node) -> list[Split]:
    width = np.ptp(node.boxes, axis=2)
    contact, axis = (int(i) for i in np.unravel_index(int(width.argmax()), width.shape))
    if width[contact, axis] <= BRANCH.narrowest:
        return []
    return [_cut(relaxer, node, contact, axis, float(node.boxes[contact, axis].mean()))]


def _cut(relaxer: Relaxer, node: Node, contact: int, axis: int, at: float) -> Split:
    low, high = node.boxes[contact, axis].tolist()
    ends = relaxer.moments.split(low, high, at)
    return Split(contact, axis, tuple(ends), (np.inf,) * (len(ends) - 1), at)


def explore(relaxer: Relaxer, node: Node, goal: Goal) -> Explored:
    """Split a node where that gains most. What else was tried is due in its parts: splits are tried
    once for several levels, and parts closed here need no problem there."""
    relaxer.begun()
    tried: list[tuple[float, Split, list[Node]]] = []
    worth = -np.inf
    for split in node.due[:1] or choices(relaxer, node, goal):
        parts = _parts(relaxer, node, split, goal, worth)
        bounds = tuple(part.bound for part in parts)
        found = _worth(node, bounds, goal)
        tried.append((found, replace(split, bounds=bounds), parts))
        worth = max(worth, found)
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


def _worth(node: Node, bounds: Sequence[float], goal: Goal) -> float:
    """Of a split: what its worst part gains, and a little for the others."""
    gains = node.bound - np.maximum(bounds, goal.cut)
    return float(gains.min() + 0.1 * gains.mean())


def _parts(relaxer: Relaxer, node: Node, split: Split, goal: Goal, least: float) -> list[Node]:
    """The parts of a node, those whose bound is not known to close them solved once, that of the
    present pressure centre first; no further ones where the split cannot be worth ``least``."""
    j, added = split.contact, node.added.without(np.array([split.contact]))
    parts = []
    for ends, bound in zip(pairwise(split.ends), split.bounds, strict=True):
        boxes = node.boxes.copy()
        boxes[j, split.axis] = ends
        parts.append(replace(node, boxes=boxes, added=added, bound=min(node.bound, bound)))
    hoped = [min(part.bound, goal.cut) for part in parts]
    for k in split.nearest:
        if parts[k].bound > goal.cut:
            parts[k] = relaxer.evaluated(parts[k], goal, 1)
        hoped[k] = parts[k].bound
        if _worth(node, hoped, goal) <= least:
            break
    return parts


def _settled(relaxer: Relaxer, part: Node, due: tuple[Split, ...], goal: Goal) -> Node:
    part = replace(part, due=due)
    if part.is_missing and part.bound > goal.cut:
        part = relaxer.evaluated(part, goal, BRANCH.rounds - 1)
    return part
