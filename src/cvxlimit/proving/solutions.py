"""A solution proved again, from the forces and the mechanism that it holds and nothing else.

Every number of a solution that anybody may rest on is computed anew for the scene: the load factor
from what the forces carry, the lower bound from the forces, the upper bound from the mechanism. A
number that comes out otherwise is not proved, whoever changed it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import Door
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex_search import ConvexSearch
from cvxlimit.methods.driver import Run
from cvxlimit.methods.wedging import without_limit
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.point_friction import ExactFlow
from cvxlimit.model.statics import Statics
from cvxlimit.proof.admissible import carried_exactly
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check
from cvxlimit.proof.strength import Strength
from cvxlimit.proving.derived import bound_checks, derived_checks
from cvxlimit.readings.moments import Moments
from cvxlimit.scene import Scene
from cvxlimit.solution import LOAD_FACTOR, LowerEnd, Solution, Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket
from cvxlimit.solvers import LimitState, Outcome
from cvxlimit.surfaces import Rocking, YieldSurface
from cvxlimit.surfaces.coulomb import needed_surfaces, surfaces_named, surfaces_of


def solution_checks(
    solution: Solution,
    scene: Scene,
    surface: Any = None,
    moments: str | Moments | None = None,
    formulation: Formulation = corner_compressions,
) -> list[Check]:
    """Every claim of a solution about a scene, checked.

    ``surface`` and ``moments`` are needed where the solution names some of one's own.

    Raises
    ------
    InputError
        If the solution does not belong to the scene, or surfaces or moments are not known.
    """
    held = solution.of(scene)
    names = scene.contacts.names
    if solution.contact_names and tuple(solution.contact_names) != tuple(names):
        wrong = next(a for a, b in zip(solution.contact_names, names, strict=True) if a != b)
        raise InputError(
            f"the solution names contact {wrong!r}, but contacts of scene {scene.name!r} are "
            "others: it does not belong to this scene as it is detected here"
        )
    if solution.quantity != LOAD_FACTOR:
        return [Check(solution.quantity, False, "only load factors can be proved again")]
    again = ProvedAgain(held, _surfaces(solution, surface), moments, formulation)
    checks = [*again.checks()]
    answer = Answer(again.carried, forces=solution.forces, mechanism=again.mechanism)
    if again.strength.is_internal:
        answer = replace(answer, internal=solution.internal)
    return [*checks, *derived_checks(solution, again.run, answer)]


def _surfaces(solution: Solution, given: Any) -> Sequence[YieldSurface]:
    """The surfaces given, or else those that the solution names, or else those that it holds."""
    if given is not None:
        return surfaces_of(given)[0]
    is_exact, name = solution.torsion_shear == "exact", solution.surface
    named = surfaces_of(name)[0] if is_exact else surfaces_named(name, solution.torsion_shear)
    if not (found := named or solution.surfaces):
        raise InputError(
            f"the solution of {solution.scene_name!r} rests on surfaces of one's own "
            f"({solution.surface}), which no file holds: give them as surface=[...]"
        )
    return found


class ProvedAgain:
    """A solution, and the run that it would be of, without any solve for its answer."""

    def __init__(
        self,
        solution: Solution,
        surfaces: Sequence[YieldSurface],
        moments: str | Moments | None,
        formulation: Formulation,
    ) -> None:
        self.run = Run(solution.scene, surfaces, formulation=formulation)
        self.moments = moments
        self.reference: tuple[FloatArray | None, float] | None = None
        self._take(solution)

    @cached_property
    def strength(self) -> Strength:
        """Of the scene as it is solved."""
        surfaces = needed_surfaces(self.run.surfaces)
        return Strength.shared(self.run.assemblage, surfaces, self.run.formulation)

    def _take(self, solution: Solution) -> None:
        self.solution, rates = solution, solution.mechanism
        self.__dict__.pop("carried", None)  # of another end
        ids = [self.run.scene.blocks[i].id for i in self.run.scene.free]
        is_whole = rates is not None and set(ids) == set(rates)
        self.mechanism = np.array([rates[key] for key in ids]) if rates and is_whole else None
        self.forces = solution.forces
        if self.forces is not None and self.run.mortar is not None:
            self.forces = np.array(self.forces)
            self.forces[:, COLUMN["N"]] += self.run.mortar.pull

    def _turned(self, end: LowerEnd) -> ProvedAgain:
        """The lower end of an interval as a largest load factor, of the live load turned round."""
        again, statics = copy(self), self.run.assemblage.statics
        state, factor = self._state_between
        again.reference = state, -factor
        again.run = self.run.auxiliary_run(self.run.assemblage.under(statics.dead, -statics.live))
        held = end.bracket
        proofs = held.upper_is_proved, held.lower_is_proved
        again._take(
            replace(
                self.solution,
                load_factor=-end.load_factor,
                forces=end.forces,
                internal=None,
                bracket=Bracket(-held.upper, -held.lower, *proofs, held.least),
                mechanism=end.mechanism,
                lower_end=None,
            )
        )
        return again

    @cached_property
    def _state_between(self) -> tuple[FloatArray | None, float]:
        """Forces inside that carry the dead load with a part of the live load, and that part."""
        search = ConvexSearch(self.run.auxiliary_run(), self.run.model)
        if not search.dead_load_is_unstable():
            return None, 0.0
        found = search.held_by_live_load()
        return found.state, found.factor

    def checks(self) -> Iterator[Check]:
        """All claims, by what kind of answer it is."""
        solution = self.solution
        is_associated = solution.flow == "associated"
        name = solution.interaction if is_associated else solution.flow
        if is_associated and solution.torsion_shear == "exact":
            yield from self._exact()
        elif name == "none":
            yield from self._plain()
        elif (checks := Door("cvxlimit.checks").get(name)) is not None:
            yield from checks(self)
        else:
            yield Check("load factor", False, f"method {name!r} gives no bounds that could be")

    def _exact(self) -> Iterator[Check]:
        """The upper bound rests on a mechanism; the lower one on friction at points of contacts."""
        yield from self.held_checks()
        flow = ExactFlow(self.run.contacts)
        certifier = Certifier(self.run.assemblage, (Rocking(),), flow=flow)
        for check in self.ends([certifier.certificate(None, None, self.mechanism)]):
            held = "the file holds what contacts transfer, and not friction at their points"
            yield replace(check, found=held) if check.claim.startswith("lower") else check

    # Without interaction

    def _plain(self) -> Iterator[Check]:
        end = self.solution.lower_end
        if end is not None:
            self.reference = self._state_between
            if self.reference[0] is None:
                yield Check("interval", False, "no forces carry the dead load with a part of the "
                            "live load, or it stands alone")  # fmt: skip
                return
        if self.solution.status is Status.DEAD_LOAD_UNSTABLE:
            yield self.falls()
        elif self.solution.status in (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED):
            yield without_limit(self._harmless(), self.run, self.solution)
            # nothing slides below it
            if (above_thrusts := Door("cvxlimit.readings").get("above_thrusts")) is not None:
                yield from above_thrusts(self, self.run.auxiliary_run())
        else:
            yield from self._certified()
        if end is not None:
            for check in self._turned(end)._certified():
                yield replace(check, claim=f"lower end, live load turned round: {check.claim}")

    def _certified(self) -> Iterator[Check]:
        """The load factor and both bounds. A bound depends a little on the states that it refers
        to, and these on how narrow a bracket was wanted; and on the load factor for which forces
        are put into balance, by some thousand times a change of it where a state has little to
        spare. Those of the result are clipped by its bracket, those of its history are not. So
        several are tried, and one has to be as it is held."""
        yield from self.held_checks()
        factors, found = (self.solution.load_factor, self.carried, *self._told), list[Bracket]()
        for factor, tolerance in product(
            dict.fromkeys(factors), (self.solution.tolerance or TOLERANCE, 1.0, SLACK)
        ):
            found.append(self._bracket(factor, tolerance))
            if all(check.is_met for check in self.ends(found)):
                break
        yield from self.ends(found)

    @property
    def _told(self) -> list[float | None]:
        """Load factors from which the history had the lower bound, near what the forces carry."""
        lower, near = self.solution.bracket.lower, self.carried or 0.0
        told = [i.load_factor for i in self.solution.history if i.lower == lower]
        return [t for t in told if t is not None and abs(t - near) <= self.near]

    def _bracket(self, factor: float | None, tolerance: float) -> Bracket:
        search = ConvexSearch(self.run.auxiliary_run(), self.run.model, tolerance)
        if self.reference is None:
            search.dead_load_is_unstable()  # which leaves forces that carry it
        elif self.reference[0] is not None:
            search.refer_to(self.reference[0], self.reference[1])
        return search.bracketed(self.state_of(factor, self._internal(search.certifier.strength)))

    def state_of(self, factor: float | None, internal: FloatArray | None) -> LimitState:
        given = Outcome("given", 0.0, 0.0)
        return LimitState(given, factor, self.forces, self.mechanism, internal)

    def _internal(self, strength: Strength) -> FloatArray | None:
        """The internal forces held, if they add up to what contacts transfer."""
        internal = self.solution.internal
        if not strength.is_internal or internal is None or self.forces is None:
            return None
        if len(internal) != strength.model.resultant_map.shape[1]:
            return None
        off = np.abs(strength.forces(internal) - self.forces).max()
        return internal if off <= SLACK * np.abs(self.forces).max() else None

    def falls(self) -> Check:
        """Rates on which the dead load does more work than contacts can take up."""
        claim, dead = "the dead load cannot stand", self.run.assemblage.statics.dead
        if self.mechanism is None:
            return Check(claim, False, "there is no mechanism that shows it")
        search = ConvexSearch(self.run.auxiliary_run(), self.run.model)
        loaded = search.reductions.assemblage.alone(dead)
        certifier = Certifier(loaded, search.surfaces, self.run.formulation)
        # a share of the dead load below what is all of it, or below half where it is all or nothing
        enough = 0.5 if certifier.strength.is_cone else 1.0 - RESIDUAL
        upper = certifier.certificate(None, None, self.mechanism).upper
        return Check(claim, upper < enough, "by the mechanism")

    def _harmless(self) -> Check:
        claim, live = "the live load does no harm", self.run.assemblage.statics.live
        if self.forces is None:
            return Check(claim, False, "there are no forces that show it")
        search = ConvexSearch(self.run.auxiliary_run(), self.run.model)
        surfaces, formulation = search.certifier.strength.recession()
        loaded = search.reductions.assemblage.under(live, live)
        strength_of = partial(Strength, surfaces=surfaces, formulation=formulation)
        if strength_of(loaded).is_internal:
            return Check(claim, False, "the file holds what contacts transfer, and not the "
                         "pressures on them that show it")  # fmt: skip
        is_carried = self.carries_live(self.forces)
        is_carried &= carried_exactly(loaded, strength_of, self.forces) is not None
        return Check(claim, is_carried, "forces carry it alone" if is_carried else
                     "the forces do not carry it alone")  # fmt: skip

    def carries_live(self, forces: FloatArray) -> bool:
        """True if forces as they stand are in equilibrium with the live load alone."""
        statics, scaling = self.run.assemblage.statics, self.run.scaling
        left = self._left(statics.under(statics.live, statics.live), forces, 0.0)
        return left <= RESIDUAL * scaling.force / scaling.ratio

    def _left(self, statics: Statics, forces: FloatArray, factor: float) -> float:
        """The largest force out of balance, and moment over the scene's length."""
        left = np.abs(statics.residual(forces, factor))
        left[:, 3:] /= self.run.scaling.length
        return float(left.max())

    # What all have

    @property
    def near(self) -> float:
        """What counts as the same load factor."""
        factor = self.solution.load_factor
        scale = self.run.scaling.unit(factor or 0.0)
        return SLACK * max(scale, abs(factor or 0.0))

    @cached_property
    def carried(self) -> float | None:
        """The load factor that the forces carry, as nearly as they carry any."""
        if self.forces is None or not np.isfinite(self.forces).all():
            return None
        statics = self.run.assemblage.statics
        rest = statics.residual(self.forces, 0.0).ravel()
        return -float(rest @ statics.live) / float(statics.live @ statics.live)

    def held_checks(self) -> Iterator[Check]:
        """That forces carry what they are said to, and that the mechanism is of live power 1."""
        solution, statics = self.solution, self.run.assemblage.statics
        factor, forces = solution.load_factor, self.forces
        if factor is not None:
            claim = f"load factor {factor:.9g}"
            if forces is None or not np.isfinite(forces).all():
                yield Check(claim, False, "there are no forces that carry it")
            else:
                carried, left = self.carried or 0.0, self._left(statics, forces, factor)
                total = self.run.scaling.force * (1.0 + abs(factor) / self.run.scaling.ratio)
                is_met = left <= RESIDUAL * total
                said = "" if is_met else f"residual {left / total:.1e} of the total load"
                if abs(carried - factor) > max(self.near, 10.0 * RESIDUAL * abs(factor)):
                    is_met, said = False, f"the forces carry {carried:.9g}"
                yield Check(claim, is_met, said or "the forces carry it")
                if solution.bracket.clipped(factor) != factor:
                    yield Check(claim, False, f"it is outside of its bracket {solution.bracket}")
        least, own = solution.bracket.least, self.run.scaling.least
        if not (least == 0.0 or abs(least - own) <= SLACK * own):
            yield Check(f"least size {least:.7g} of the bracket", False, f"it is {own:.7g}")
        if self.mechanism is not None and solution.status.has_answer:
            power = float(statics.live @ self.mechanism.ravel())
            if abs(power - 1.0) > 10.0 * RESIDUAL:
                yield Check("mechanism", False, f"its live power is {power:.7g} in place of 1")

    def ends(self, found: Sequence[Bracket]) -> Iterator[Check]:
        """Compares both bounds with those found."""
        return bound_checks(self.solution, self.run.scaling, found)
