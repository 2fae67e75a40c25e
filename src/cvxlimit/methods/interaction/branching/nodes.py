"""Nodes of branch and bound: boxes of pressure centres, relaxed and certified.

The relaxation is the convex hull of every contact's states in its box, with a mechanism that is
certified against the true states in the boxes. Copies on the edges of boxes are added where the
mechanism misses them. A node whose states cannot carry the dead load needs no special proof: its
relaxation may take dead load off at a price, and its mechanism then has a bound of minus that
price.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.interaction.readings.flow import InteractionFlow
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.relaxation.hull import HullProblem
from cvxlimit.methods.interaction.relaxation.upper import missed_copies
from cvxlimit.methods.interaction.settings import NODES
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.methods.interaction.states.support import half_extent, whole_boxes
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solvers import (
    LimitState,
    SolverSettings,
    node_ladder,
    tight_ladder,
)
from cvxlimit.surfaces import Rocking


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
        Gap that is asked for; bounds to ``lower`` + :attr:`NodeSettings.closed` of it close a node.
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
        shrink the less the closer it is to the lower bound."""
        return self.lower + NODES.closed * self.width


@dataclass(frozen=True, eq=False)
class Explored:
    """What came of a node: those still open, the largest bound of what was closed, and the cost.

    ``solvers`` are the names of those that ran in its process so far.
    """

    open: tuple[Node, ...]
    closed: float
    solves: int
    solvers: frozenset[str]


class Relaxer:
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

    def begun(self) -> None:
        """Count anew what the next node costs."""
        self.solves, self.closed = 0, -np.inf

    def explored(self, nodes: Sequence[Node], goal: Goal) -> Explored:
        """What came of a node that these stand for."""
        still = tuple(node for node in nodes if node.bound > goal.cut)
        closed = max([self.closed, *(n.bound for n in nodes if n.bound <= goal.cut)])
        return Explored(still, closed, self.solves, frozenset(self.solvers))

    def evaluated(self, node: Node, goal: Goal) -> Node:
        """Solve, certify, add copies; a solver's failure leaves the bound and forces as given."""
        flow = InteractionFlow(self.contacts, self.moments, node.boxes)
        certifier = self.certifier.with_flow(flow)
        first = self.moments.box_copies(self.contacts, node.boxes)
        worth = NODES.worth_a_copy * goal.width
        for _ in range(NODES.rounds):
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
        """Solvers in turn, until one has a mechanism or claims that there is none."""
        for settings in ladder or self.ladder:
            self.solves += 1
            self.solvers.add(settings.name)
            state = self.problem.solve(copies, settings, price, glued)
            if state.mechanism is not None or state.outcome.claims_no_optimum:
                break
        return state

    def safe(self, copies: Copies) -> LimitState:
        """States that are all admissible, solved tightly: their forces are what counts."""
        return self.solve(copies, None, ladder=self.tight)

    def speeds(self, mechanism: FloatArray) -> FloatArray:
        """Slip and twist of contacts (n,) for unit live power."""
        rates = self.statics.relative_rates(mechanism)
        speed: FloatArray = np.hypot(rates[:, 0], rates[:, 1])
        speed = speed + self.contacts.torsion_arm * np.abs(rates[:, COLUMN["MT"]])
        return speed / max(float(self.statics.live @ mechanism.ravel()), 1e-300)

    def centre(self, forces: FloatArray) -> FloatArray:
        """Pressure centres (n, 2) as fractions of the half extent."""
        at = Pressure.of(forces, self.contacts)
        return np.clip(np.stack([at.e1, at.e2], axis=1) / self.half, -1.0, 1.0)
