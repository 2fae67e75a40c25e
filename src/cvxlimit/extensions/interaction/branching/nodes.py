"""Nodes of branch and bound: boxes of pressure centres, relaxed, certified and split.

A node whose states cannot carry the dead load needs no special proof: its relaxation may take dead
load off at a price, and its mechanism then has a bound of minus that price.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.interaction.flow import InteractionFlow
from cvxlimit.extensions.interaction.relaxation.column_blocks import ColumnBlock, Halfway
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem, HullState
from cvxlimit.extensions.interaction.relaxation.upper import priced_disjuncts
from cvxlimit.extensions.interaction.settings import BRACKET, BRANCH
from cvxlimit.extensions.interaction.states.disjuncts import Disjuncts
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.extensions.interaction.states.support import Range, box_keys
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.proof.certificate import Certifier
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.pressure import centres
from cvxlimit.solvers import SolverSettings, ladder_for
from cvxlimit.solvers.ladders import MANY
from cvxlimit.surfaces import Rocking


@dataclass(frozen=True)
class Split:
    """The box of a ``contact`` cut along an ``axis`` into ``ranges``."""

    contact: int
    axis: int
    ranges: tuple[Range, ...]


@dataclass(frozen=True, eq=False)
class Node:
    """One box of pressure centres per contact, and what is known of the load factor within them.

    Attributes
    ----------
    bound : float
        A certified upper bound on the load factor.
    boxes : (n, 2, 2)
        Per contact and axis the two ends of the range, as fractions of the half extent.
    added : tuple of ColumnBlock
        Disjuncts that pricing has added to those of the boxes.
    forces, load_factor : (n, 6) or None, and float
        The answer of the relaxation.
    mechanism : (free blocks, 6) or None
        The mechanism that proves ``bound``.
    halfway : Halfway or None
        A point of the solver's from which the solves of its parts may start.
    """

    bound: float
    boxes: FloatArray
    added: tuple[ColumnBlock, ...] = ()
    forces: FloatArray | None = None
    load_factor: float = -np.inf
    mechanism: FloatArray | None = None
    halfway: Halfway | None = None

    def without(self, *contacts: int) -> tuple[ColumnBlock, ...]:
        """Returns the added disjuncts of all but these contacts."""
        return tuple(piece for piece in self.added if piece.members.contact[0] not in contacts)


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
    """The result of exploring nodes: the nodes still ``open``, the largest bound of those that were
    ``closed``, the number of ``solves``, and the names of all ``solvers`` that ran so far."""

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
        purpose = "nodes of many" if len(self.contacts) >= MANY else "nodes"
        closest = max(1e-8, BRANCH.precision * tolerance)
        self.ladder = tuple(ladder or ladder_for(purpose, closest))
        self.tight = tuple(ladder or ladder_for("tight"))
        self.flow = InteractionFlow(self.contacts, moments)
        self.certifier = Certifier(assemblage, (Rocking(),), flow=self.flow)
        if opening is not None:
            self.certifier.offer_opening_field(opening)
        self.statics = self.certifier.statics
        self.problem = HullProblem(assemblage)
        self.solves = 0
        self.solvers: set[str] = set()
        self.closed = -np.inf
        self.experience = Experience(len(self.contacts))
        self._pieces: dict[tuple[int, bytes], ColumnBlock] = {}

    def __call__(self, task: tuple[Sequence[Node], Goal]) -> Explored:
        """Explores nodes for a goal."""
        return explore(self, *task)

    def __reduce__(self) -> tuple[type[Relaxer], tuple[object, ...]]:
        """What another process makes it of anew: factorisations stay behind, and so do the ladder
        of tight solves, which the search keeps to its own process, and what was experienced."""
        assemblage, opening = self.certifier.assemblage, self.certifier.references.opening_field
        bare = replace(assemblage, balance=Balance.of(assemblage.statics), strengths={})
        return Relaxer, (bare, self.moments, self.ladder, opening)

    def begun(self) -> None:
        self.solves, self.closed = 0, -np.inf

    def explored(self, nodes: Sequence[Node], goal: Goal) -> Explored:
        still = tuple(node for node in nodes if node.bound > goal.cut)
        closed = max([self.closed, *(n.bound for n in nodes if n.bound <= goal.cut)])
        return Explored(still, closed, self.solves, frozenset(self.solvers))

    def evaluated(self, nodes: Sequence[Node], goal: Goal) -> list[Node]:
        """Returns the nodes after they were solved, certified and given the disjuncts they miss.
        All take each step together, since a call of NumPy takes hardly longer for several. Where a
        solver fails, bound and forces stay as they were."""
        every = self.pieces([node.boxes for node in nodes])
        parts = [_Part(self, *given, goal) for given in zip(nodes, every, strict=True)]
        left = parts
        for _ in range(BRANCH.rounds):
            left = [part for part in left if part.is_solved()]
            self._foresee(left)
            left = [part for part in left if part.misses()]
            self._add(left)
        for part in parts:
            if part.is_stuck:
                part.widen()
        return [part.node for part in parts]

    def _foresee(self, parts: Sequence[_Part]) -> None:
        """Compute the flow rule's answers for all mechanisms at once, before certificates ask."""
        powers = [float(self.statics.live @ part.mechanism.ravel()) for part in parts]
        asked = {
            part.flow: self.statics.relative_rates(part.mechanism / power)  # as certificates do
            for part, power in zip(parts, powers, strict=True)
            if power > 0.0
        }
        field = self.certifier.references.opening_field
        if len(asked) > 1:
            opening = None if field is None else self.statics.relative_rates(field)
            self.flow.ask_together(list(asked), list(asked.values()), opening)

    def _add(self, parts: Sequence[_Part]) -> None:
        """Give the nodes the disjuncts that they miss."""
        missed = Disjuncts.none().joined(*(part.missed for part in parts))
        if not len(missed):
            return
        part_of = np.repeat(np.arange(len(parts)), [len(part.missed) for part in parts])
        groups, unit = np.unique([part_of, missed.contact], axis=1, return_inverse=True)
        pieces = self.problem.column_blocks(missed, unit)
        for number, piece in zip(groups[0].tolist(), pieces, strict=True):
            node = parts[number].node
            parts[number].node = replace(node, added=(*node.added, piece))

    def pieces(self, every: Sequence[FloatArray]) -> list[list[ColumnBlock]]:
        """Returns the column blocks of several boxes (n, 2, 2); most are in the cache already."""
        number = np.arange(len(self.contacts))
        keys = [box_keys(boxes, number) for boxes in every]
        if len(self._pieces) > BRANCH.kept:
            self._pieces.clear()
        if new := [*dict.fromkeys(k for each in keys for k in each if k not in self._pieces)]:
            rows = np.array([j for j, _ in new])
            boxes = np.frombuffer(b"".join(ends for _, ends in new)).reshape(-1, 2, 2)
            disjuncts = states_of(self.moments).box_disjuncts(self.contacts.take(rows), boxes)
            unit = disjuncts.contact
            disjuncts = replace(disjuncts, contact=rows[unit])
            found = self.problem.column_blocks(disjuncts, unit, len(new))
            self._pieces.update(zip(new, found, strict=True))
        return [[self._pieces[key] for key in each] for each in keys]

    def solve(
        self,
        disjuncts: Disjuncts | Sequence[ColumnBlock],
        price: float | None,
        ladder: Sequence[SolverSettings] | None = None,
        start: Halfway | None = None,
        enough: float = -np.inf,
    ) -> HullState:
        for settings in ladder or self.ladder:
            self.solves += 1
            self.solvers.add(settings.name)
            state = self.problem.solve(disjuncts, settings, price, start, enough)
            if state.mechanism is not None or state.outcome.claims_no_optimum:
                break
        return state

    def speeds(self, mechanism: FloatArray) -> FloatArray:
        """Returns the speed of slip and twist of each contact (n,) at live power 1."""
        rates = self.statics.relative_rates(mechanism)
        speed: FloatArray = np.hypot(rates[:, 0], rates[:, 1])
        speed = speed + self.contacts.torsion_arm * np.abs(rates[:, COLUMN["MT"]])
        return speed / max(float(self.statics.live @ mechanism.ravel()), 1e-300)


class _Part:
    """A node that is being evaluated, with its pieces, its flow rule and its certifier."""

    mechanism: FloatArray

    def __init__(
        self, relaxer: Relaxer, node: Node, pieces: Sequence[ColumnBlock], goal: Goal
    ) -> None:
        self.relaxer, self.node, self.pieces, self.goal = relaxer, node, pieces, goal
        self.flow = relaxer.flow.within(node.boxes, goal.precision)
        self.certifier = relaxer.certifier.with_flow(self.flow)
        self.missed, self.is_stuck = Disjuncts.none(), False

    def is_solved(self) -> bool:
        """Solve the relaxation; returns True if it has an answer with a mechanism."""
        node, goal = self.node, self.goal
        pieces = [*self.pieces, *node.added]
        state = self.relaxer.solve(pieces, goal.price, start=node.halfway, enough=goal.cut)
        self.node = node = replace(node, halfway=state.halfway or node.halfway)
        if state.mechanism is None or state.load_factor is None:
            return False
        self.node = replace(node, forces=state.forces, load_factor=state.load_factor)
        self.mechanism = state.mechanism
        return True

    def misses(self) -> bool:
        """Certify the bound; returns True if disjuncts are missed that would lower it."""
        found = self.certifier.certificate(self.node.forces, None, self.mechanism).upper
        if found < self.node.bound:
            self.node = replace(self.node, bound=found, mechanism=self.mechanism)
        worth = BRACKET.worth_a_disjunct * self.goal.width
        is_close = found - self.node.load_factor <= worth
        self.is_stuck = not is_close and self.node.load_factor < self.goal.cut < self.node.bound
        if is_close or self.node.bound < self.goal.lower:
            return False
        self.missed = priced_disjuncts(self.flow, self.certifier, self.mechanism, worth)
        return len(self.missed) > 0

    def widen(self) -> None:
        """Take the bound of a mechanism of slightly wider boxes, if it is lower. Where statics hold
        a pressure centre at the end of its range no state is strictly inside, and mechanisms of any
        speed are optimal: what rounding leaves of those that solvers end at is worth more than the
        gap."""
        boxes = self.node.boxes
        reach = BRANCH.widened * np.ptp(boxes, axis=2, keepdims=True)
        outward = np.where(boxes[..., :1] > boxes[..., 1:], [1.0, -1.0], [-1.0, 1.0])
        wider = np.clip(boxes + reach * outward, -1.0, 1.0)
        (pieces,) = self.relaxer.pieces([wider])
        state = self.relaxer.solve([*pieces, *self.node.added], self.goal.price)
        if state.mechanism is not None:
            found = self.certifier.certificate(None, None, state.mechanism).upper
            if found < self.node.bound:
                self.node = replace(self.node, bound=found, mechanism=state.mechanism)


def scores(relaxer: Relaxer, node: Node) -> FloatArray:
    """Returns how much of the gap each contact (n,) of a solved node carries: excess of Eq. 30
    times speed, of which those at rest have a share of the largest."""
    assert node.forces is not None
    assert node.mechanism is not None
    width = np.ptp(node.boxes, axis=2).max(axis=1)
    # what is beyond that in a narrow box is the solver's, and no split takes it away
    most = width * np.maximum(node.forces[:, COLUMN["N"]], 0.0)
    excess = np.clip(relaxer.moments.excess(node.forces, relaxer.contacts), 0.0, most)
    speed = relaxer.speeds(node.mechanism)
    speed = speed + BRANCH.at_rest * float(speed.max())
    return np.where(width > BRANCH.narrowest, excess, 0.0) * speed


class Experience:
    """How much of the gap splits at each of n contacts have closed so far, as a share of what there
    was, in the part where that was least (pseudo-costs: M. Benichou et al., 1971)."""

    def __init__(self, n: int) -> None:
        self.closed, self.splits = np.zeros((2, n))

    def learn(self, split: Split, before: float, parts: Sequence[float], goal: Goal) -> None:
        gap = before - goal.cut
        if 0.0 < gap < np.inf:
            left = (max(parts) - goal.cut) / gap
            self.closed[split.contact] += 1.0 - min(max(left, 0.0), 1.0)
            self.splits[split.contact] += 1.0

    @property
    def expected(self) -> FloatArray:
        """Shares (n,), from a prior that all contacts have in common."""
        mean = self.closed.sum() / max(self.splits.sum(), 1.0) or 1.0
        prior = BRANCH.prior
        return np.asarray((self.closed + prior * mean) / (self.splits + prior))


def choice(relaxer: Relaxer, node: Node) -> Split | None:
    """Chooses where to split: at the contact that carries most of the gap, as far as splits there
    have closed any. Those at rest count for much: what moves in one of many mechanisms of a node
    may be at rest in the next."""
    if node.forces is None or node.mechanism is None:
        return _widest(relaxer, node)
    score = scores(relaxer, node) * relaxer.experience.expected
    if not score.max() > 0.0:
        return _widest(relaxer, node)
    return _place(relaxer, node, node.forces, int(score.argmax()))


def _place(relaxer: Relaxer, node: Node, forces: FloatArray, contact: int) -> Split:
    """Returns the split of a contact's box near the pressure centre of the forces (n, 6)."""
    centre = centres(forces, relaxer.contacts)[contact]
    box, centre = states_of(relaxer.moments).folded(node.boxes[contact], centre)
    low, high = box.T
    inner = np.maximum((high - centre) * (centre - low), 0.0) + 1e-3 * (high - low) ** 2
    axis = int(inner.argmax())
    near, far = sorted((low[axis], high[axis]), key=lambda end: abs(end - centre[axis]))
    # statics may hold a centre where it is: at the end of a range no state is strictly inside
    at = centre[axis] + BRANCH.beside_centre * (far - near)
    return _cut(relaxer, node, contact, axis, float(at))


def _widest(relaxer: Relaxer, node: Node) -> Split | None:
    """Returns the split of the widest range in its middle; None if none is left to be split."""
    width = np.ptp(node.boxes, axis=2)
    contact, axis = (int(i) for i in np.unravel_index(int(width.argmax()), width.shape))
    if width[contact, axis] <= BRANCH.narrowest:
        return None
    return _cut(relaxer, node, contact, axis, float(node.boxes[contact, axis].mean()))


def _cut(relaxer: Relaxer, node: Node, contact: int, axis: int, at: float) -> Split:
    low, high = node.boxes[contact, axis].tolist()
    is_even = bool(relaxer.contacts.is_rectangle[contact])
    return Split(contact, axis, tuple(states_of(relaxer.moments).split(low, high, at, is_even)))


def explore(relaxer: Relaxer, nodes: Sequence[Node], goal: Goal) -> Explored:
    """Split nodes and solve their parts."""
    relaxer.begun()
    splits = [(node, choice(relaxer, node)) for node in nodes]
    done = [node.bound for node, split in splits if split is None]
    relaxer.closed = max(done, default=-np.inf)
    cuts = [(node, split, [*_parts(node, split)]) for node, split in splits if split is not None]
    found = relaxer.evaluated([part for *_, parts in cuts for part in parts], goal)
    left = iter(found)
    for node, split, parts in cuts:
        bounds = [part.bound for part in islice(left, len(parts))]
        relaxer.experience.learn(split, node.bound, bounds, goal)
    return relaxer.explored(found, goal)


def _parts(node: Node, split: Split) -> Iterator[Node]:
    added = node.without(split.contact)
    for ends in split.ranges:
        boxes = node.boxes.copy()
        boxes[split.contact, split.axis] = ends
        yield replace(node, boxes=boxes, added=added)
