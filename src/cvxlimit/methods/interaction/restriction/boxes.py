"""Boxes of pressure centres, one per contact, that follow a relaxation to admissible forces.

The convex hull of a contact's states pressed within a box holds states that are not admissible; the
smaller the box, the less they exceed Eq. 30. So boxes shrink where the forces of the last
relaxation exceed it, and only there: contacts that are admissible within a large box stay free to
follow the others. While the way is still open (*exploring*) they even grow.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.restriction.problems import InnerIterate, SafeProblems
from cvxlimit.methods.interaction.settings import BOXES, PROOF
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.methods.interaction.states.support import half_extent


class Boxes:
    """Boxes about the pressure centres of ``forces`` (n, 6), or about the contacts' centres.

    Attributes
    ----------
    centre : (n, 2) array
        As fractions of :func:`half_extent`.
    size : (n,) array
        To either side, likewise.
    excess, largest : float
        By how much the last forces exceed Eq. 30, summed over all contacts that have boxes and at
        the worst of them, over the total load.
    """

    def __init__(
        self,
        contacts: Contacts,
        moments: Moments,
        force: float,
        forces: FloatArray | None = None,
        size: float = BOXES.largest,
    ) -> None:
        self.contacts, self.moments, self.force = contacts, moments, force
        self.half = half_extent(contacts)
        self.centre = np.zeros((len(contacts), 2))
        self.size = np.full(len(contacts), size)
        self.excess = self.largest = np.inf
        if forces is not None:
            self.centre = self.centres(forces, self.centre)

    @classmethod
    def first(cls, problems: SafeProblems, forces: FloatArray | None) -> Boxes:
        """Those a search begins with: about ``forces``, or whole contacts."""
        size = BOXES.largest if forces is None else BOXES.first
        force = problems.step.scaling.force
        return cls(problems.contacts, problems.moments, force, forces, size)

    @property
    def copies(self) -> Copies:
        """The hull of all states within the boxes."""
        reach = self.size[:, None]
        ends = np.stack([self.centre - reach, self.centre + reach], axis=2)
        return self.moments.box_copies(self.contacts, np.clip(ends, -1.0, 1.0))

    def follow(self, forces: FloatArray, *, exploring: bool) -> None:
        """Move to the forces' pressure centres; shrink where they exceed Eq. 30."""
        over = np.maximum(self.moments.excess(forces, self.contacts), 0.0) / self.force
        over[~self.contacts.is_rectangle] = 0.0  # their boxes stay whole: cells take too long
        self.excess, self.largest = float(over.sum()), float(over.max())
        self.centre = self.centres(forces, self.centre)
        shrink, growth = (BOXES.shrink, BOXES.growth) if exploring else (BOXES.settle, 1.0)
        factor = np.where(over > BOXES.over, shrink, growth)
        self.size = np.minimum(factor * self.size, BOXES.largest)

    def centres(self, forces: FloatArray, otherwise: FloatArray) -> FloatArray:
        """Pressure centres (n, 2) as fractions of the half extent; idle contacts keep theirs."""
        at = Pressure.of(forces, self.contacts)
        centre = np.stack([at.e1, at.e2], axis=1) / self.half
        pressed = forces[:, [COLUMN["N"]]] > PROOF.pressed * self.force
        return np.where(pressed, np.clip(centre, -1.0, 1.0), otherwise)


def narrowing(problems: SafeProblems, start: FloatArray | None) -> Iterator[InnerIterate]:
    """Hulls over boxes alone, until the last one's forces nearly satisfy Eq. 30."""
    boxes = Boxes.first(problems, start)
    for number in range(1, BOXES.exploring + BOXES.settling + 1):
        iterate = problems.relaxed("box", boxes.copies)
        yield iterate
        if iterate.state.forces is None:
            return
        boxes.follow(iterate.state.forces, exploring=number < BOXES.exploring)
        if boxes.excess <= BOXES.settled and number >= BOXES.exploring:
            return


def settling(problems: SafeProblems, start: FloatArray | None) -> Iterator[InnerIterate]:
    """Hulls over boxes of pressure centres, and what is safe near the last ones."""
    boxes, best, nearly = Boxes.first(problems, start), -np.inf, BOXES.nearly
    explored, freezes = 0, True
    for _ in range(BOXES.exploring + BOXES.settling):
        copies = boxes.copies
        iterate = problems.relaxed("box", copies)
        yield iterate
        state = iterate.state
        if state.forces is None or state.load_factor is None:
            return
        explored += 1
        upper = problems.run.best.bracket.upper
        no_more = upper - state.load_factor < problems.gain * abs(upper)  # in any boxes
        exploring = explored < BOXES.exploring and not no_more
        explored = explored if exploring else BOXES.exploring
        boxes.follow(state.forces, exploring=exploring)
        if boxes.excess > nearly and not iterate.is_safe:
            continue
        lower = iterate.lower
        for nearby in _nearby(problems, boxes, copies, state.forces, freezes):
            yield nearby
            freezes = nearby.is_safe if nearby.kind == "frozen" else freezes
            lower = max(lower, nearby.lower)
        least = problems.gain * abs(lower)
        if lower - best < least or state.load_factor - lower < least:
            return
        best, nearly = max(best, lower), BOXES.retry * boxes.excess


def _nearby(
    problems: SafeProblems, boxes: Boxes, copies: Copies, forces: FloatArray, freezes: bool
) -> Iterator[InnerIterate]:
    """The frozen problem at the boxes' centres. Where that has no interior, as where forces are
    determinate: the box problem itself, tightly, if all that keeps its forces from being admissible
    is how it was solved; else a safe step at them."""
    if freezes:
        frozen = problems.frozen(boxes.centre)
        yield frozen
        if frozen.is_safe:
            return
    if boxes.largest <= BOXES.noise:
        tight = problems.restricted("box", lambda rung: problems.hull.solve(copies, rung))
        yield tight
        if tight.is_safe:
            return
    point = problems.point(forces)
    yield problems.restricted("safe", lambda rung: problems.step.solve(point, rung))
