"""A solution proved again, from the forces x and the mechanism u that it holds and nothing else.

By weak duality each of them bounds the load factor alpha without the other. In this order:

1. *Load factor*: x carries it, A x + f_dead + alpha f_live = 0 (:meth:`ProvedAgain.held_checks`).
2. *Lower bound*: x is admissible. *Upper bound*: the flow rule allows u, and what contacts take up
   in it is all that they can. One certificate recomputes both (:mod:`cvxlimit.proof.certificate`).
   It mixes x and u with a little of two reference states, which the solution holds where they are
   not found again by projections; they are checked as x and u are, so that false ones cannot help.
3. *What follows* from these: the solution is packed anew, and what it says besides is held against
   that (:mod:`cvxlimit.proving.derived`).

A number that comes out otherwise is not proved, whoever changed it. Where no load factor exists, x
shows that any multiple of the live load is carried, or u that the dead load falls. Methods with
bounds of their own add how these are proved, under ``cvxlimit.checks``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import Door
from cvxlimit.errors import InputError, ModelError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.io.results import result_from_dict
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.driver import Run, packed
from cvxlimit.methods.wedging import without_limit
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.point_friction import ExactFlow
from cvxlimit.proof.admissible import carried_exactly
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check, is_alike, proved
from cvxlimit.proof.strength import Strength
from cvxlimit.proving.derived import bound_checks, derived_checks
from cvxlimit.proving.prove import BOTH_CASES, Proof, Scenes, scene_of
from cvxlimit.readings.moments import Moments
from cvxlimit.reductions.choice import Reductions
from cvxlimit.scene import Scene
from cvxlimit.solution import LOAD_FACTOR, LowerEnd, Solution, Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, Reference
from cvxlimit.solvers import LimitState, Outcome
from cvxlimit.surfaces import Rocking, YieldSurface
from cvxlimit.surfaces.coulomb import needed_surfaces, surfaces_named, surfaces_of


def prove_result(what: Any, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    """A solution, or what a file of one holds; see :func:`cvxlimit.prove`."""
    solution = what if isinstance(what, Solution) else result_from_dict(what)
    given = scene_of(
        solution.scene_name, solution.scene_digest, scene or solution.solved_scene, BOTH_CASES
    )
    checks = solution_checks(solution, given, **own)
    return Proof(f"result of scene {solution.scene_name!r}", tuple(checks))


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
    held, names = solution.of(scene), scene.contacts.names
    if solution.contact_names and tuple(solution.contact_names) != tuple(names):
        wrong = next(a for a, b in zip(solution.contact_names, names, strict=True) if a != b)
        raise InputError(
            f"the solution names contact {wrong!r}, but contacts of scene {scene.name!r} are "
            "others: it does not belong to this scene as it is detected here"
        )
    if solution.quantity != LOAD_FACTOR:
        return [Check(solution.quantity, False, "only load factors can be proved again")]
    run = Run(held.scene, _surfaces(solution, surface), formulation=formulation)
    again = ProvedAgain(held, run, moments)
    return [*again.checks(), *derived_checks(solution, again.made())]


def _surfaces(solution: Solution, given: Any) -> Sequence[YieldSurface]:
    """The surfaces given, or else those that the solution names, or else those that it holds."""
    if given is not None:
        return surfaces_of(given)[0]
    is_exact, name = solution.torsion_shear == "exact", solution.surface
    named = surfaces_of(name)[0] if is_exact else surfaces_named(name, solution.torsion_shear)
    return known_or_asked(named or solution.surfaces, solution.scene_name, "surface", name)


def known_or_asked(found: Any, scene: str, option: str, name: str) -> Any:
    """What a solution or a domain of a scene names; raises InputError where it is one's own."""
    if not found:
        raise InputError(
            f"what is held of {scene!r} rests on {option.removesuffix('s')}s of one's own "
            f"({name}), which no file holds: give them as {option}=..."
        )
    return found


def as_solved(solution: Solution, run: Run) -> tuple[FloatArray | None, FloatArray | None]:
    """The forces (n, 6) of a solution and its rates (free blocks, 6), None if they are not of these
    blocks: of the scene as it is solved, where mortar may have become a load."""
    forces, rates = solution.forces, solution.mechanism
    if forces is not None and run.mortar is not None:
        forces = np.array(forces)
        forces[:, COLUMN["N"]] += run.mortar.pull
    ids = [run.scene.blocks[i].id for i in run.scene.free]
    is_whole = rates is not None and set(ids) == set(rates)
    return forces, np.array([rates[key] for key in ids]) if rates and is_whole else None


@dataclass(eq=False)
class ProvedAgain:
    """A solution, and the run that it would be of, without any solve for its answer.

    ``forces`` (n, 6) and ``mechanism`` (free blocks, 6) are those held, of the scene as it is
    solved; None where the solution has none.
    """

    solution: Solution
    run: Run
    moments: str | Moments | None = None

    def __post_init__(self) -> None:
        self.forces, self.mechanism = as_solved(self.solution, self.run)
        self.is_finite = self.forces is not None and bool(np.isfinite(self.forces).all())

    @cached_property
    def certifier(self) -> Certifier:
        """Of the answer without interaction, as a solve makes it."""
        run, surfaces = self.run, needed_surfaces(self.run.surfaces)
        whole = Reductions.of(run.assemblage, surfaces, run.formulation, run.model).assemblage
        width = self.solution.tolerance or TOLERANCE
        return Certifier(whole, surfaces, run.formulation, width=width)

    def made(self) -> Solution:
        """The solution that the forces and the mechanism held make at its load factor."""
        held, aside = self.solution, self.run.auxiliary_run()
        internal = held.internal if self.certifier.strength.is_internal else None
        aside.best = Answer(
            held.load_factor, held.bracket, self.forces, self.mechanism, internal=internal
        )
        return packed(Convex(), aside, Status.CERTIFIED)

    def checks(self) -> Iterator[Check]:
        """All claims that forces and mechanisms prove, by what kind of answer it is."""
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
        for check in self.ends(certifier.certificate(None, None, self.mechanism)):
            held = "the file holds what contacts transfer, and not friction at their points"
            yield replace(check, found=held) if check.claim.startswith("lower") else check

    # Without interaction

    def _plain(self) -> Iterator[Check]:
        end = self.solution.lower_end
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

    def _turned(self, end: LowerEnd) -> ProvedAgain:
        """The lower end of an interval as a largest load factor, of the live load turned round."""
        statics, held = self.run.assemblage.statics, end.bracket
        proofs = held.upper_is_proved, held.lower_is_proved
        turned = replace(
            self.solution,
            load_factor=-end.load_factor,
            forces=end.forces,
            internal=None,
            bracket=Bracket(-held.upper, -held.lower, *proofs, held.least),
            mechanism=end.mechanism,
            reference=None if end.reference is None else end.reference.turned,
        )
        live = self.run.assemblage.under(statics.dead, -statics.live)
        return ProvedAgain(turned, self.run.auxiliary_run(live))

    def _certified(self) -> Iterator[Check]:
        """The load factor and both bounds, by one certificate. A bound depends a little on the
        states that it refers to, and on the load factor for which forces are put into balance, by
        some thousand times a change of it where a state has little to spare: those that are held
        are taken if they are what they should be."""
        yield from self.held_checks()
        held, lacks = self.solution, "; the file does not hold what its bounds refer to"
        given = held.reference or Reference(held.load_factor)
        try:
            is_taken = self.certifier.refer_to(given, held.lower_end is not None)
        except ModelError:  # of another shape
            is_taken = False
        if not is_taken:
            yield Check("states that bounds refer to", False, "they are none of this scene")
            return
        state = self.state_of(given.load_factor, self._internal())
        for check in self.ends(self.certifier.of(state)):
            is_old = held.reference is None and not check.is_met
            yield replace(check, found=check.found + lacks) if is_old else check

    def state_of(self, factor: float | None, internal: FloatArray | None) -> LimitState:
        """What is held as if a solver had given it."""
        given = Outcome("given", 0.0, 0.0)
        return LimitState(given, factor, self.forces, self.mechanism, internal)

    def _internal(self) -> FloatArray | None:
        """The internal forces held, if they add up to what contacts transfer."""
        internal, strength = self.solution.internal, self.certifier.strength
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
        whole = self.certifier
        certifier = Certifier(whole.assemblage.alone(dead), whole.surfaces, self.run.formulation)
        # a share of the dead load below what is all of it, or below half where it is all or nothing
        enough = 0.5 if certifier.strength.is_cone else 1.0 - RESIDUAL
        upper = certifier.certificate(None, None, self.mechanism).upper
        return Check(claim, upper < enough, "by the mechanism")

    def _harmless(self) -> Check:
        """Forces that carry the live load alone, and any multiple of themselves, as they stand."""
        claim, live = "the live load does no harm", self.run.assemblage.statics.live
        if self.forces is None:
            return Check(claim, False, "there are no forces that show it")
        surfaces, formulation = self.certifier.strength.recession()
        loaded = self.certifier.assemblage.under(live, live)
        strength_of = partial(Strength, surfaces=surfaces, formulation=formulation)
        if strength_of(loaded).is_internal:
            return Check(claim, False, "the file holds what contacts transfer, and not the "
                         "pressures on them that show it")  # fmt: skip
        is_carried = self.carries_live(self.forces)
        is_carried &= carried_exactly(loaded, strength_of, self.forces) is not None
        return proved(claim, is_carried, "the forces do not carry it alone",
                      "forces carry it alone")  # fmt: skip

    def carries_live(self, forces: FloatArray) -> bool:
        """True if forces as they stand are in equilibrium with the live load alone."""
        live, scaling = self.run.assemblage.statics.live, self.run.scaling
        return self._left(live, forces) <= RESIDUAL * scaling.force / scaling.ratio

    def _left(self, load: FloatArray, forces: FloatArray) -> float:
        """The largest force out of balance under a load, and moment over the scene's length."""
        statics = self.run.assemblage.statics
        left = np.abs(statics.under(load, load).residual(forces, 0.0))
        left[:, 3:] /= self.run.scaling.length
        return float(left.max())

    # What all have

    @property
    def unit(self) -> float:
        """What load factors near zero are compared by."""
        return self.run.scaling.unit(self.solution.load_factor or 0.0)

    @property
    def near(self) -> float:
        """What counts as the same load factor."""
        return SLACK * max(self.unit, abs(self.solution.load_factor or 0.0))

    def held_checks(self) -> Iterator[Check]:
        """That forces carry what they are said to, and that the mechanism is of live power 1."""
        solution, statics, scaling = self.solution, self.run.assemblage.statics, self.run.scaling
        bracket, factor, live = solution.bracket, solution.load_factor, statics.live
        claim = f"load factor {factor or 0.0:.9g}"
        if factor is not None and (self.forces is None or not self.is_finite):
            yield Check(claim, False, "there are no forces that carry it")
        elif factor is not None and self.forces is not None:
            # the load factor that they carry most nearly, and what they leave of the one claimed
            rest = statics.residual(self.forces, 0.0).ravel()
            carried = -float(rest @ live) / float(live @ live)
            left = self._left(statics.dead + factor * live, self.forces)
            left /= scaling.force * (1.0 + abs(factor) / scaling.ratio)
            is_other = abs(carried - factor) > max(self.near, 10.0 * RESIDUAL * abs(factor))
            but = f"residual {left:.1e} of the total load"
            but = f"the forces carry {carried:.9g}" if is_other else but
            yield proved(claim, not is_other and left <= RESIDUAL, but, "the forces carry it")
            if bracket.clipped(factor) != factor:
                yield Check(claim, False, f"it is outside of its bracket {bracket}")
        if bracket.least and not is_alike(bracket.least, own := scaling.least):
            claim = f"least size {bracket.least:.7g} of the bracket"
            yield Check(claim, False, f"it is {own:.7g}")
        if self.mechanism is not None and solution.status.has_answer:
            power = float(live @ self.mechanism.ravel())
            if abs(power - 1.0) > 10.0 * RESIDUAL:
                yield Check("mechanism", False, f"its live power is {power:.7g} in place of 1")

    def ends(self, found: Bracket) -> Iterator[Check]:
        """Compares both bounds with those found."""
        return bound_checks(self.solution, found, self.unit)
