"""Torsion with shear as it is (Eq. 18-21), bracketed by friction at points of the contacts."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cvxlimit.bracket import Bracket
from cvxlimit.checks import count, ratio
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.analysis import Convex
from cvxlimit.methods.driver import Answer, Rule, Run
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.point_friction import ExactFlow, PointFriction
from cvxlimit.model.points import Placing, at_centroids, at_corners
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solution import Status
from cvxlimit.surfaces import Rocking

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class ExactFriction(Rule):
    """The exact limit of contacts pressed uniformly, to a tolerance.

    Two convex problems per step: friction at cells' centroids is inside the exact set, so its lower
    bound holds; friction at cells' corners is outside, so its upper bound does. The mechanism is
    then checked against the exact flow rule, in closed form. Cells are halved at the contacts
    whose slip the two see differently, until the bracket is closed.

    Attributes
    ----------
    tolerance : float
        Relative width of the bracket.
    divisions : int
        Cells across a contact at the start.
    most : int
        Steps before giving up.
    """

    name = "none"

    tolerance: float = 1e-3
    divisions: int = 2
    most: int = 6

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        count(self.divisions, 1, "divisions")
        count(self.most, 1, "most")

    def start(self, run: Run) -> _Refinement:
        """Coarse cells everywhere."""
        run.torsion_shear = "exact"
        if run.formulation is not corner_compressions:
            raise ModelError(
                "exact torsion-shear brings its own formulation: leave formulation out"
            )
        return _Refinement(self, run)

    def step(self, run: Run, state: _Refinement) -> _Refinement:
        """Both problems at the present cells, and finer ones where they differ."""
        state.advance()
        return state

    def is_done(self, run: Run, state: _Refinement) -> Status | None:
        """When the bracket is closed, or there is no answer."""
        return state.status

    def result(self, run: Run, state: _Refinement) -> Answer:
        """The best bounds of both sides."""
        cells = f"{state.divisions.min()} to {state.divisions.max()} cells across a contact"
        return replace(run.best, note="; ".join([*state.notes, cells]))


class _Refinement:
    """Cells per contact, and what came out so far."""

    def __init__(self, rule: ExactFriction, run: Run) -> None:
        self.rule, self.run = rule, run
        self.divisions = np.full(len(run.contacts), rule.divisions)
        self.status: Status | None = None
        self.notes: list[str] = []
        self.steps = 0

    def advance(self) -> None:
        """One step."""
        self.steps += 1
        inner, below = self._side(at_centroids)
        outer, above = self._side(at_corners)
        self.notes = sorted({a.note for a in (below, above) if a.note})
        ends = (Status.DEAD_LOAD_UNSTABLE, Status.LIVE_LOAD_HARMLESS)
        if inner in ends and inner is outer:
            self.status = inner
            self.run.best = below if inner is Status.LIVE_LOAD_HARMLESS else above
            return
        best, bracket = self.run.best, below.bracket
        best = best.raised(bracket.lower, bracket.lower_is_proved, below.load_factor, below.forces)
        bracket = self._exactly(above)
        self.run.best = best.lowered(bracket.upper, bracket.upper_is_proved, above.mechanism)
        if self.run.best.bracket.is_within(self.rule.tolerance):
            self.status = Status.CERTIFIED
        elif self.steps >= self.rule.most:
            self.status = Status.NOT_CERTIFIED
        else:
            self._refine(below, above)

    def _side(self, placing: Placing) -> tuple[Status, Answer]:
        """The convex problem with friction at points, from one side."""
        run = copy(self.run)
        run.surfaces, run.formulation = (Rocking(),), PointFriction(placing, self.divisions)
        run.best, run.history = Answer(bracket=Bracket(least=run.scaling.least)), []
        rule = Convex(0.1 * self.rule.tolerance)
        state = rule.start(run)
        while (status := rule.is_done(run, state)) is None:
            state = rule.step(run, state)
        side = "inside" if placing is at_centroids else "outside"
        for iterate in run.history:
            one = replace(iterate, solver=f"{iterate.solver}, {side}")
            is_inside = placing is at_centroids
            self.run.history.append(
                replace(one, upper=None) if is_inside else replace(one, lower=None)
            )
        return status, rule.result(run, state)

    def _exactly(self, above: Answer) -> Bracket:
        """The bracket of the outer problem, lowered by the exact flow rule if that needs no more
        assumptions."""
        with self.run.clock.phase("certify"):
            found = self._certifier.certificate(None, None, above.mechanism)
        if above.bracket.upper_is_proved and not found.upper_is_proved:
            return above.bracket
        return above.bracket.lowered(found.upper, found.upper_is_proved)

    @cached_property
    def _certifier(self) -> Certifier:
        flow = ExactFlow(self.run.contacts)
        return Certifier(self.run.assemblage, (Rocking(),), flow=flow)

    def _refine(self, below: Answer, above: Answer) -> None:
        """Halve cells where points and exact slip differ in power by more than their share."""
        differences = [self._difference(below, at_centroids), self._difference(above, at_corners)]
        difference = np.maximum(*differences)
        bracket = self.run.best.bracket
        share = 0.5 * self.rule.tolerance * bracket.unit / len(difference)
        chosen = difference > share
        if not chosen.any():
            chosen[:] = True
        self.divisions = np.where(chosen, 2 * self.divisions, self.divisions)

    def _difference(self, answer: Answer, placing: Placing) -> FloatArray:
        """Power (n,), per load factor, by which friction at points errs on the mechanism."""
        if answer.mechanism is None or answer.forces is None:
            return np.full(len(self.divisions), np.inf)
        contacts = self.run.contacts
        rates = self.run.assemblage.statics.relative_rates(answer.mechanism)
        at_points = PointFriction(placing, self.divisions).points(contacts).mean_slip(rates)
        slip = np.abs(at_points - ExactFlow(contacts).mean_slip(rates))
        pressed = np.maximum(answer.forces[:, COLUMN["N"]], 0.0)
        resistance = contacts.friction * pressed + contacts.cohesion * contacts.area
        return np.asarray(slip * resistance)
