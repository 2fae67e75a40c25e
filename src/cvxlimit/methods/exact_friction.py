"""Torsion with shear as it is (Eq. 18-21), bracketed by friction at points of the contacts."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.base.checks import count, ratio
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.aside import Aside
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.methods.standing import refuse_an_interval
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.point_friction import PointFriction
from cvxlimit.model.points import Placing, at_centroids, at_corners
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.flow import ExactFlow
from cvxlimit.proof.strength import ContactFlow
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import Bracket, Evidence
from cvxlimit.surfaces import Rocking
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES


@dataclass(frozen=True)
class ExactFriction(Method):
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
    max_iterations : int
        Refinements.
    """

    name = "exact"
    answers = "torsion with shear on the exact limit (Eq. 18-21), bracketed to 1e-3"
    axis = "torsion_shear"
    surfaces, takes, reduces = ("conic",), ("reactions", "cohesion", "strength"), False

    tolerance: float = 1e-3
    divisions: int = 2
    max_iterations: int = 6

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        count(self.divisions, 1, "divisions")
        count(self.max_iterations, 1, "max_iterations")

    def flow(self, contacts: Contacts) -> ContactFlow:
        return ExactFlow(contacts)

    def steps(self, run: Run) -> Steps:
        divisions = np.full(len(run.contacts), self.divisions)
        run.surfaces, flow = (Rocking(),), ExactFlow(run.contacts)
        certifier = Certifier(run.assemblage, (Rocking(),), flow=flow)
        for _ in range(self.max_iterations):
            inner, below = yield from self._side(run, at_centroids, divisions)
            outer, above = yield from self._side(run, at_corners, divisions)
            run.remarks = sorted({*below.remarks, *above.remarks})
            if not inner.has_answer and inner is outer:
                run.best = (above if inner is Status.DEAD_LOAD_UNSTABLE else below).best
                if inner is Status.UNBOUNDED and (forces := _within_the_line(run)) is not None:
                    run.best = replace(run.best, forces=forces)
                return inner
            cells = f"{divisions.min()} to {divisions.max()} cells across a contact"
            run.remarks = [*run.remarks, cells]
            found, bracket = below.best, below.best.bracket
            best = run.best.raised(
                bracket.lower, bracket.lower_is_proved, found.load_factor, found.forces
            )
            if best is not run.best:
                by = Evidence(found.load_factor, None, found.mechanism, found.internal,
                              found.reference, divisions)  # fmt: skip
                best = replace(best, beside={"points": by})
            with run.clock.phase("certify"):
                bracket = _lowered(above.best, certifier)
            outside = above.best.mechanism, above.best.reference
            run.best = best.lowered(bracket.upper, bracket.upper_is_proved, *outside)
            if run.best.bracket.is_within(self.tolerance):
                return Status.CERTIFIED
            differences = [
                _difference(run, found.best, placing, divisions, flow)
                for found, placing in ((below, at_centroids), (above, at_corners))
            ]
            # cells are halved where points and exact slip differ in power by more than their share
            share = 0.5 * self.tolerance * run.best.bracket.unit / len(divisions)
            chosen = np.maximum(*differences) > share
            divisions = np.where(chosen | (not chosen.any()), 2 * divisions, divisions)
        return Status.NOT_CERTIFIED

    def _side(
        self, run: Run, placing: Placing, divisions: IntArray
    ) -> Generator[None, None, tuple[Status, Run]]:
        auxiliary = run.auxiliary_run()
        auxiliary.surfaces, auxiliary.formulation = (Rocking(),), PointFriction(placing, divisions)
        status = yield from Convex(0.1 * self.tolerance).steps(auxiliary)
        if auxiliary.best.lower_end is not None:
            refuse_an_interval(auxiliary.best.lower_end.load_factor)
        is_inside = placing is at_centroids
        for iterate in auxiliary.history:
            side = f"{iterate.solver}, {'inside' if is_inside else 'outside'}"
            kept = {"upper": None} if is_inside else {"lower": None}
            run.history.append(replace(iterate, solver=side, **kept))  # type: ignore[arg-type]
        return status, auxiliary


def _within_the_line(run: Run) -> FloatArray | None:
    """Forces (n, 6) that carry the live load alone within the line of Eq. 24, inside the exact
    limit: anyone can check them, where those at points are lost with the points. None without."""
    aside = run.auxiliary_run()
    aside.surfaces, aside.formulation = DEFAULT_SURFACES, corner_compressions
    linear = Aside(aside, "full")
    return linear.carrying(run.assemblage.statics.live, *linear.certifier.strength.recession())


def _lowered(above: Answer, certifier: Certifier) -> Bracket:
    """The bracket of the outer problem, lowered by the exact flow rule if that needs no more
    assumptions."""
    found = certifier.certificate(None, None, above.mechanism)
    if above.bracket.upper_is_proved and not found.upper_is_proved:
        return above.bracket
    return above.bracket.lowered(found.upper, found.upper_is_proved)


def _difference(
    run: Run, answer: Answer, placing: Placing, divisions: IntArray, flow: ExactFlow
) -> FloatArray:
    if answer.mechanism is None or answer.forces is None:
        return np.full(len(divisions), np.inf)
    contacts = run.contacts
    rates = run.assemblage.statics.relative_rates(answer.mechanism)
    at_points = PointFriction(placing, divisions).points(contacts).mean_slip(rates)
    pressed = np.maximum(answer.forces[:, COLUMN["N"]], 0.0)
    resistance = contacts.friction * pressed + contacts.cohesion * contacts.area
    return np.asarray(np.abs(at_points - flow.mean_slip(rates)) * resistance)
