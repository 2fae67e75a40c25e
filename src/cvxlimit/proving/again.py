"""Forces and mechanism of a solution, and the certificate that they make without a solve.

:class:`ProvedAgain` first has the checks of the methods without interaction, then those of answers
without a load factor, then what every method's checks are made of; methods with bounds of their own
add theirs under ``cvxlimit.checks``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import Door
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.driver import Run, packed
from cvxlimit.methods.least_thrust import excluded_by, lower_bound
from cvxlimit.methods.solving import TABLE
from cvxlimit.methods.wedging import start_of, without_limit
from cvxlimit.model.point_friction import PointFriction, at_centroids, at_corners
from cvxlimit.model.statics import DOF
from cvxlimit.proof.admissible import carried_exactly
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check, is_alike, proved, unseen
from cvxlimit.proof.flow import ExactFlow
from cvxlimit.proof.strength import Strength
from cvxlimit.proving.claims import bound_checks, method_of
from cvxlimit.readings.moments import Moments
from cvxlimit.reductions.choice import PLANAR_FROM, Reductions
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, Evidence, Reference, rounded_down
from cvxlimit.solution.kinematics import Dilatancy, sliding_joints
from cvxlimit.surfaces import Rocking
from cvxlimit.surfaces.coulomb import needed_surfaces


def evidence_of(solution: Solution, run: Run) -> Evidence:
    """What the bracket of a solution is proved by, of the scene as it is solved, where mortar may
    have become a load; rates are None if they are not of its free blocks."""
    ids, own = [run.scene.blocks[i].id for i in run.scene.free], solution.mechanism
    rates = np.array([own[key] for key in ids]) if own and {*ids} == {*own} else None
    forces = with_mortar(solution.forces, run)
    return Evidence(solution.load_factor, forces, rates, solution.internal, solution.reference)


def with_mortar(forces: FloatArray | None, run: Run) -> FloatArray | None:
    """Forces (n, 6) of the scene as it is solved, from those of the scene as it was given; those of
    other shapes, as where a file holds none, as they are."""
    if forces is None or run.mortar is None or np.shape(forces) != (len(run.contacts), DOF):
        return forces
    forces = np.array(forces)
    forces[:, COLUMN["N"]] += run.mortar.pull
    return forces


@dataclass(eq=False)
class ProvedAgain:
    """A solution, and the run that it would be of, without any solve for its answer."""

    solution: Solution
    run: Run
    moments: str | Moments | None = None

    @cached_property
    def by(self) -> Evidence:
        """What it holds."""
        return evidence_of(self.solution, self.run)

    @cached_property
    def certifier(self) -> Certifier:
        """Of the answer without interaction, as a solve makes it."""
        run, surfaces = self.run, needed_surfaces(self.run.surfaces)
        planar_from = 0 if "planar" in self.solution.model else PLANAR_FROM
        found = Reductions.of(run.assemblage, surfaces, run.formulation, run.model, planar_from)
        width = self.solution.tolerance or TOLERANCE
        return Certifier(found.assemblage, surfaces, run.formulation, width=width)

    def checks(self) -> Iterator[Check]:
        """All claims that forces and mechanisms prove, by what kind of answer it is."""
        name = method_of(self.solution)
        own = {"convex": ProvedAgain._plain, "exact": ProvedAgain._exact}
        checks = own.get(name) or Door("cvxlimit.checks").get(name)
        if checks:
            yield from checks(self)
        elif name in TABLE and self.solution.status is Status.DEAD_LOAD_UNSTABLE:
            yield self.falls()
        elif name in TABLE:
            yield Check("load factor", False, f"method {name!r} gives no bounds that could be")
        else:
            Door("cvxlimit.methods").check(name)  # of an extension that is not here
            yield Check(f"method {name!r}", False, f"it is none of {', '.join(TABLE)}")

    def _plain(self) -> Iterator[Check]:
        """Without interaction: what forces and mechanism prove, and those of the lower end."""
        if not self.solution.status.has_answer:
            yield from self.without_answer(self.falls, self.harmless)
            yield from self.above_thrusts()  # nothing slides below
        else:
            yield from self.certified()
        if self.solution.lower_end is not None:
            for check in self._turned().certified():
                yield replace(check, claim=f"lower end, live load turned round: {check.claim}")

    def certified(self) -> Iterator[Check]:
        """The load factor and both bounds, by one certificate."""
        lacks = "; the file does not hold what its bounds refer to"
        yield from self.held_checks()
        found = self.bracket_by(self.by)
        yield from self.ends(found, lacks if self.solution.reference is None else "")

    def _turned(self) -> ProvedAgain:
        """The lower end of an interval as a largest load factor, of the live load turned round."""
        statics, end = self.run.assemblage.statics, self.solution.lower_end
        assert end is not None
        turned = replace(
            self.solution, load_factor=-end.load_factor, bracket=end.bracket.turned,
            forces=end.forces, mechanism=end.mechanism, internal=None,
            reference=end.reference and end.reference.turned,
        )  # fmt: skip
        live = self.run.assemblage.under(statics.dead, -statics.live)
        return ProvedAgain(turned, self.run.auxiliary_run(live))

    def _exact(self) -> Iterator[Check]:
        """The upper bound rests on a mechanism; the lower one on friction at points of contacts."""
        whole, contacts, by = self.run.assemblage, self.run.contacts, self.by
        if self.solution.status is Status.DEAD_LOAD_UNSTABLE:
            fine = np.full(len(contacts), 8)  # cells across, whose bound is no wider than a solve's
            yield self.falls(PointFriction(at_corners, fine))
            return
        if not self.solution.status.has_answer:
            # forces within the line of Eq. 24 are within the exact limit
            yield from self.without_answer(self.falls, self.harmless)
            return
        yield from self.held_checks()
        outside = Certifier(whole, (Rocking(),), flow=ExactFlow(contacts))
        found: Bracket = outside.certificate(None, None, by.rates)
        points = self.solution.beside.get("points")
        if points is not None and points.cells is not None and len(points.cells) == len(contacts):
            at_points = PointFriction(at_centroids, points.cells)
            inside = Certifier(whole, (Rocking(),), at_points)
            below = self.bracket_by(replace(points, forces=by.forces), inside)
            found = found.raised(below.lower, below.lower_is_proved)
            # Around the exact limit: with what the exact flow rule leaves out, as reactions.
            around = Certifier(whole, (Rocking(),), PointFriction(at_corners, points.cells))
            around.refer_to(by.reference or Reference())
            above = around.certificate(None, None, by.rates)
            found = found.lowered(above.upper, above.upper_is_proved)
        yield from self.ends(found)

    def bracket_by(self, by: Evidence, certifier: Certifier | None = None) -> Bracket:
        """What evidence proves without interaction; nothing if it is of other blocks. A bound
        depends a little on its reference states and on the load factor for which forces are
        balanced: where a state has little to spare, by some thousand times the change. So those
        held are taken, if they are what they should be; internal forces, if they add up to what
        contacts transfer."""
        certifier = certifier or self.certifier
        given, strength = by.reference or Reference(by.load_factor), certifier.strength
        with suppress(ModelError):  # of other blocks
            x = strength.state(by.internal if strength.is_internal else by.forces)
            if strength.is_internal and x is not None and by.forces is not None:
                off = np.abs(strength.forces(x) - by.forces).max()
                x = x if off <= SLACK * np.abs(by.forces).max() else None
            if certifier.refer_to(given, self.solution.lower_end is not None):
                return certifier.certificate(x, given.load_factor, by.rates)
        return Bracket()

    # Where no load factor exists

    def without_answer(
        self, falls: Callable[[], Check], harmless: Callable[[], Check]
    ) -> Iterator[Check]:
        """The check of a fall, or of a live load of which any multiple is carried."""
        if self.solution.status is Status.DEAD_LOAD_UNSTABLE:
            yield falls()
        elif self.solution.status in (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED):
            yield without_limit(harmless(), self.run, self.solution)

    def falls(self, at_points: PointFriction | None = None) -> Check:
        """Rates on which the dead load does more work than contacts can take up: by the surfaces
        and the formulation, or with friction at points."""
        whole, dead = self.certifier, self.run.assemblage.statics.dead
        surfaces = whole.surfaces if at_points is None else (Rocking(),)
        formulation = at_points or self.run.formulation
        alone = Certifier(whole.assemblage.alone(dead), surfaces, formulation)
        # below 1 some of the dead load falls; where it is carried whole or not at all, 1/2 tells
        enough = 0.5 if alone.strength.is_cone else 1.0 - RESIDUAL
        upper = alone.certificate(None, None, self.by.rates).upper
        said = f"the mechanism shows {upper:.3g} of it"
        return proved("the dead load cannot stand", upper < enough, said, "by the mechanism")

    def harmless(self, strength: Any = None, *within: Any) -> Check:
        """Forces that carry the live load alone, and any multiple of themselves, as they stand."""
        live, forces, is_met = self.run.assemblage.statics.live, self.by.forces, False
        whole = self.run.assemblage if strength else self.certifier.assemblage
        if forces is not None and self._left(live, forces) <= RESIDUAL / self.run.scaling.ratio:
            # the file holds what contacts transfer, and not internal forces that show it
            loaded = whole.under(live, live)
            own = Strength(loaded, *self.certifier.strength.recession())
            own = strength(loaded) if strength else own
            is_met = not own.is_internal and carried_exactly(own, forces, *within) is not None
        but, by = "the forces do not carry it alone", "forces carry it alone"
        return proved("the live load does no harm", is_met, but, by)

    def above_thrusts(self) -> Iterator[Check]:
        """Below which load factor nothing slides without dilatancy; where any multiple is carried
        with it, the solution that slides. Files of earlier versions hold no evidence of these: the
        bound is sought anew."""
        held, beside, run = self.solution.bracket, self.solution.beside, self.run.auxiliary_run()
        if np.isfinite(held.lower):
            by = {name: each for name, each in beside.items()
                  if each.until is not None or each.contacts is not None}  # fmt: skip
            slack, anew = (SLACK, "") if by else (RESIDUAL, ", found anew,")
            lower = -np.inf
            with suppress(ModelError):  # evidence of other blocks
                start = start_of(run, self.solution.lower_end)
                if by:
                    bound = excluded_by(run, by, start)
                else:
                    bound = lower_bound(run, held.lower).load_factor
                lower = bound if held.lower_is_proved else lower
            is_met = abs(lower - held.lower) <= slack * max(self.unit, abs(held.lower))
            said = f"least thrusts{anew} show {rounded_down(lower, 9)}"
            yield proved(f"lower bound {rounded_down(held.lower, 9)}", is_met, said, said)
        slides = beside.get("slides")
        if slides is not None:
            checks = Door("cvxlimit.checks").get("slides")
            if checks is None:
                yield unseen("dilatancy", "what proves the solution that slides is not here")
            else:
                yield from checks(self, slides)

    # What the checks of every method are made of

    def _left(self, load: FloatArray, forces: FloatArray) -> float:
        """The largest force out of balance under a load, and moment over the scene's length, over
        the total load."""
        left = np.abs(self.run.assemblage.statics.under(load, load).residual(forces, 0.0))
        left[:, 3:] /= self.run.scaling.length
        return float(left.max()) / self.run.scaling.force

    @property
    def unit(self) -> float:
        """What load factors near zero are compared by."""
        return self.run.scaling.unit(self.solution.load_factor or 0.0)

    @property
    def near(self) -> float:
        """What counts as the same load factor."""
        return SLACK * max(self.unit, abs(self.solution.load_factor or 0.0))

    @property
    def is_finite(self) -> bool:
        """Whether there are forces, all of them numbers."""
        return self.by.forces is not None and bool(np.isfinite(self.by.forces).all())

    def held_checks(self) -> Iterator[Check]:
        """That forces carry what they are said to, and that the mechanism has live power 1."""
        statics, scaling, by = self.run.assemblage.statics, self.run.scaling, self.by
        bracket, factor, live = self.solution.bracket, by.load_factor, statics.live
        if factor is not None:
            carried = left = np.nan
            if self.is_finite and by.forces is not None:
                # the load factor that they carry most nearly, and what they leave of the one said
                rest = statics.residual(by.forces, 0.0).ravel()
                carried = -float(rest @ live) / float(live @ live)
                left = self._left(statics.dead + factor * live, by.forces)
                left /= 1.0 + abs(factor) / scaling.ratio
            is_it = abs(carried - factor) <= max(self.near, 10.0 * RESIDUAL * abs(factor))
            is_met = is_it and left <= RESIDUAL and bracket.clipped(factor) == factor
            but = f"the forces carry {carried:.9g} but for {left:.1e} of the total load"
            but = but if is_it else f"{but}; its bracket is {bracket}"
            yield proved(f"load factor {factor:.9g}", is_met, but, "the forces carry it")
        if bracket.least and not is_alike(bracket.least, scaling.least):
            claim = f"least size {bracket.least:.7g} of the bracket"
            yield Check(claim, False, f"it is {scaling.least:.7g}")
        if by.rates is not None and self.solution.status.has_answer:
            power = float(live @ by.rates.ravel())
            if abs(power - 1.0) > 10.0 * RESIDUAL:
                yield Check("mechanism", False, f"its live power is {power:.7g} in place of 1")

    def ends(self, found: Bracket, lacks: str = "") -> Iterator[Check]:
        """Compares both bounds with those found."""
        return bound_checks(self.solution, found, self.unit, lacks)

    def made(self) -> Solution:
        """The solution that the forces and the mechanism held make at its load factor."""
        held, aside, by = self.solution, self.run.auxiliary_run(), self.by
        status, known = Status.CERTIFIED, None
        if not held.status.has_answer:
            status, known = held.status, self._without_limit()
        aside.best = Answer(by.load_factor, held.bracket, by.forces, by.rates, dilatancy=known)
        return packed((TABLE.get(method_of(held)) or Convex)(), aside, status)

    def _without_limit(self) -> Dilatancy | None:
        """What is known without dilatancy where any multiple is carried with it: that nothing
        slides below the lower bound, and what slides where, if the solution that does is held."""
        held, run = self.solution, self.run
        slides = held.beside.get("slides")
        if held.status is not Status.UNBOUNDED or (held.dilatancy is None and slides is None):
            return None
        known = held.dilatancy or Dilatancy(np.inf)
        joints, at = (known.sliding, known.moving), known.slides_at
        rates = None if slides is None else slides.rates
        if slides is not None and rates is not None and len(rates) == len(run.scene.free):
            relative = run.assemblage.statics.relative_rates(rates)
            joints, at = sliding_joints(run.scene, relative, rates), slides.load_factor
        safe = max(0.0, held.lower) if method_of(held) == "convex" else 0.0
        return Dilatancy(np.inf, *joints, safe, at)
