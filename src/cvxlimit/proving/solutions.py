"""A solution proved again, from the forces x and the mechanism u that it holds and nothing else.

By weak duality each of them bounds the load factor alpha without the other. In this order:

1. *Load factor*: x carries it, A x + f_dead + alpha f_live = 0 (:meth:`ProvedAgain.held_checks`).
2. *Lower bound*: x is admissible. *Upper bound*: the flow rule allows u, and what contacts take up
   in it is all that they can. One certificate recomputes both (:mod:`cvxlimit.proof.certificate`).
   It mixes x and u with a little of two reference states, which the solution holds where they are
   not found again by projections; they are checked as x and u are, so that false ones cannot help.
   A bound may be neither better nor worse than the one that is found anew.
3. *What follows* from these: the solution is packed anew, and each entry is held against that
   (:func:`~cvxlimit.proof.checks.compared`). A status follows from the width of the bracket and
   the tolerance that was asked for, which is part of the claim. What nothing finds, how an answer
   was found for example, is named and claims nothing.

A number that comes out otherwise is not proved, whoever changed it. Where no load factor exists, x
shows that any multiple of the live load is carried, or u that the dead load falls. Methods with
bounds of their own add how these are proved, under ``cvxlimit.checks``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
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
from cvxlimit.methods.least_thrust import lower_bound, shown
from cvxlimit.methods.settlement import guided
from cvxlimit.methods.solving import TABLE
from cvxlimit.methods.wedging import start_of, without_limit
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.point_friction import PointFriction, at_centroids
from cvxlimit.model.statics import DOF
from cvxlimit.proof.admissible import carried_exactly
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.checks import (
    RESIDUAL,
    SLACK,
    Check,
    compared,
    follows,
    is_alike,
    proved,
    says,
    unseen,
)
from cvxlimit.proof.flow import ExactFlow
from cvxlimit.proof.strength import Strength
from cvxlimit.proving.prove import BOTH_CASES, Proof, Scenes, scene_of
from cvxlimit.readings.moments import Moments
from cvxlimit.reductions.choice import PLANAR_FROM, Reductions
from cvxlimit.scene import Scene
from cvxlimit.solution import LOAD_FACTOR, Solution, Status
from cvxlimit.solution.bracket import (
    TOLERANCE,
    Bracket,
    Evidence,
    Reference,
    rounded_down,
    rounded_up,
)
from cvxlimit.solution.kinematics import Dilatancy, sliding_joints
from cvxlimit.surfaces import Rocking
from cvxlimit.surfaces.coulomb import PARABOLIC, needed_surfaces, surfaces_named

EVIDENCE = {"forces", "mechanism", "internal", "reference", "lower_end", "beside"}
"""What proves claims. Any that proves them will do."""

RESTS_ON = {
    Status.DEAD_LOAD_UNSTABLE: {"mechanism", "internal"},
    Status.LIVE_LOAD_HARMLESS: {"forces", "lower_end", "internal", "beside"},
    Status.UNBOUNDED: {"forces", "lower_end", "internal", "beside"},
}
"""The evidence that is needed where no load factor exists."""

_OF_THE_SCENE = "contact_names", "units", "lumped", "torsion_shear"
"""Fields that follow from the scene, and that files of earlier versions lack."""

_FOUND = {
    "surface", "interaction", "flow", "moments", "blocks", "contacts", *_OF_THE_SCENE,
}  # fmt: skip
"""What follows from the scene and from the method; ``moments`` with interaction only."""

_CLAIMED = {
    "load_factor", "bracket", "status", "tolerance", "members", "quantity",
    "scene_name", "scene_digest", "solved_scene", "surfaces",
}  # fmt: skip
"""Fields with claims of their own, or that say which scene and which surfaces are meant."""


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
    said, names = solution, solution.of(scene).scene.contacts.names
    if solution.contact_names and tuple(solution.contact_names) != tuple(names):
        wrong = next(a for a, b in zip(solution.contact_names, names, strict=True) if a != b)
        raise InputError(
            f"the solution names contact {wrong!r}, but contacts of scene {scene.name!r} are "
            "others: it does not belong to this scene as it is detected here"
        )
    meant = surface_meant(solution, surface, solution.torsion_shear, solution.surfaces)
    given: Scene | Assemblage = scene
    if solution.quantity != LOAD_FACTOR and solution.status is not Status.DEAD_LOAD_UNSTABLE:
        if (pushed := _pushed(solution, scene)) is None:
            but = "neither a load factor nor a reaction with its mechanism and a state inside"
            return [Check(solution.quantity, False, but)]
        given, said = pushed
    again = ProvedAgain(said, Run(given, meant, formulation=formulation), moments)
    checks = [*again.checks(), *derived_checks(said, again.made())]
    if said is not solution:
        checks = [c if c.is_met and c.kind != "proved" else replace(c, claim=f"push, {c.claim}")
                  for c in checks]  # fmt: skip
        checks.append(unseen("mechanism", "along it the reaction is meant"))
    return checks


def _pushed(said: Solution, scene: Scene) -> tuple[Assemblage, Solution] | None:
    """The limit problem behind the reaction R = R0 - s alpha of supports that move, and what is
    said of alpha. The mechanism has the motion of the supports, scaled to a unit; the reference
    state gives R0."""
    (which, _, kind), (_, _, told) = (said.quantity.partition(x) for x in (" ", " of "))
    sign, names = {"least": 1.0, "largest": -1.0}.get(which, 0.0), told.split(", ")
    rates, state = said.mechanism or {}, (said.reference or Reference()).forces
    moved = {name: sign * rates[name] for name in scene.supports if name in rates}
    if said.load_factor is None or not sign or {*names} != {*moved}:
        return None
    if state is None or state.shape != (len(scene.contacts), DOF):
        return None
    shift, turn = np.split(moved[names[0]], 2)
    is_moment = kind.startswith("moment of ")
    size = np.linalg.norm(turn if is_moment else shift)
    if abs(size - 1.0) > SLACK and (is_moment or not turn.any()):
        return None
    aside, possible = guided(scene, moved, sign, state)
    bracket = (said.bracket.turned if sign > 0.0 else said.bracket).shifted(sign * possible)
    factor = sign * (possible - said.load_factor)
    return aside, replace(said, load_factor=factor, bracket=bracket)


def surface_meant(said: Any, given: Any, torsion_shear: str = "linear", own: Any = ()) -> Any:
    """The surfaces given, or else those that a solution or a domain names, or else its ``own``."""
    is_parabolic = torsion_shear == PARABOLIC and said.surface == "conic"
    name = PARABOLIC if is_parabolic else said.surface
    named = surfaces_named(name)
    found = named if named is None or name.endswith(")") else name
    meant = found or own if given is None else given
    return known_or_asked(meant, said.scene_name, "surface", said.surface)


def known_or_asked(found: Any, scene: str, option: str, name: str) -> Any:
    """What a solution or a domain of a scene names; raises InputError where it is one's own."""
    if not found:
        raise InputError(
            f"what is stored of scene {scene!r} rests on {option.removesuffix('s')}s of your own "
            f"({name}), which no file holds: give them as {option}=..."
        )
    return found


def method_of(said: Solution) -> str:
    """Name of the method that a solution is by."""
    if said.flow != "associated":
        return said.flow
    if said.interaction != "none":
        return said.interaction
    return "exact" if said.torsion_shear == "exact" else "convex"


def asked_checks(
    said: Solution, surface: Mapping[str, str], method: str = "", **asked: Any
) -> Iterator[Check]:
    """That a solution is of what was asked: the words of its surface, its method by name, and other
    fields."""
    if method:
        own, usual = TABLE[method], {"interaction": "none", "flow": "associated"}
        asked = usual | ({own.axis: own.name} if own.axis else {}) | asked
    asked = {**surface} | asked
    return compared(asked, {name: getattr(said, name) for name in asked})


def evidence_of(solution: Solution, run: Run) -> Evidence:
    """What the bracket of a solution is proved by, of the scene as it is solved, where mortar may
    have become a load; rates are None if they are not of its free blocks."""
    ids, own = [run.scene.blocks[i].id for i in run.scene.free], solution.mechanism
    rates = np.array([own[key] for key in ids]) if own and {*ids} == {*own} else None
    forces = with_mortar(solution.forces, run)
    return Evidence(solution.load_factor, forces, rates, solution.internal, solution.reference)


def with_mortar(forces: FloatArray | None, run: Run) -> FloatArray | None:
    """Forces (n, 6) of the scene as it is solved, from those of the scene as it was given."""
    if forces is None or run.mortar is None:
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
        own = {"convex": ProvedAgain._plain, "exact": ProvedAgain._exact}.get(name)
        if checks := own or Door("cvxlimit.checks").get(name):
            yield from checks(self)
        elif name in TABLE:
            yield Check("load factor", False, f"method {name!r} gives no bounds that could be")
        else:
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
        yield from self.ends(self.bracket_by(self.by), lacks * (self.solution.reference is None))

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
        yield from self.held_checks()
        whole, contacts, by = self.run.assemblage, self.run.contacts, self.by
        outside = Certifier(whole, (Rocking(),), flow=ExactFlow(contacts))
        found: Bracket = outside.certificate(None, None, by.rates)
        points = self.solution.beside.get("points")
        if points is not None and points.cells is not None and len(points.cells) == len(contacts):
            at_points = PointFriction(at_centroids, points.cells)
            inside = Certifier(whole, (Rocking(),), at_points)
            below = self.bracket_by(replace(points, forces=by.forces), inside)
            found = found.raised(below.lower, below.lower_is_proved)
        yield from self.ends(found)

    def bracket_by(self, by: Evidence, certifier: Certifier | None = None) -> Bracket:
        """What evidence proves without interaction; nothing if it is of other blocks. A bound
        depends a little on its reference states and on the load factor for which forces are
        balanced: where a state has little to spare, by some thousand times the change. So those
        held are taken, if they are what they should be; internal forces, if they add up to what
        contacts transfer."""
        own, given = certifier or self.certifier, by.reference or Reference(by.load_factor)
        with suppress(ModelError):  # of other blocks
            strength = own.strength
            x = strength.state(by.internal if strength.is_internal else by.forces)
            if strength.is_internal and x is not None and by.forces is not None:
                off = np.abs(strength.forces(x) - by.forces).max()
                x = x if off <= SLACK * np.abs(by.forces).max() else None
            if own.refer_to(given, self.solution.lower_end is not None):
                return own.certificate(x, given.load_factor, by.rates)
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

    def falls(self) -> Check:
        """Rates on which the dead load does more work than contacts can take up."""
        whole, dead = self.certifier, self.run.assemblage.statics.dead
        alone = Certifier(whole.assemblage.alone(dead), whole.surfaces, self.run.formulation)
        # below 1 some of the dead load falls; where it is carried whole or not at all, 1/2 tells
        enough = 0.5 if alone.strength.is_cone else 1.0 - RESIDUAL
        upper = alone.certificate(None, None, self.by.rates).upper
        said = f"the mechanism shows {upper:.3g} of it"
        return proved("the dead load cannot stand", upper < enough, said, "by the mechanism")

    def harmless(self, strength: Any = None, *within: Any) -> Check:
        """Forces that carry the live load alone, and any multiple of themselves, as they stand."""
        live, forces, is_met = self.run.assemblage.statics.live, self.by.forces, False
        whole = self.run.assemblage if strength else self.certifier.assemblage
        surfaces, formulation = self.certifier.strength.recession()
        strength = strength or partial(Strength, surfaces=surfaces, formulation=formulation)
        if forces is not None and self._left(live, forces) <= RESIDUAL / self.run.scaling.ratio:
            # the file holds what contacts transfer, and not internal forces that show it
            loaded = whole.under(live, live)
            is_met = not strength(loaded).is_internal
            is_met = is_met and carried_exactly(loaded, strength, forces, *within) is not None
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
            lower, slack, anew = -np.inf, SLACK if by else RESIDUAL, "" if by else ", found anew,"
            with suppress(ModelError):  # evidence of other blocks
                start = start_of(run, self.solution.lower_end)
                bound = shown(run, by, start) if by else lower_bound(run, held.lower).load_factor
                lower = bound if held.lower_is_proved else lower
            is_met = abs(lower - held.lower) <= slack * max(self.unit, abs(held.lower))
            said = f"least thrusts{anew} show {rounded_down(lower, 9)}"
            yield proved(f"lower bound {rounded_down(held.lower, 9)}", is_met, said, said)
        if (slides := beside.get("slides")) is not None:
            checks = Door("cvxlimit.checks").get("slides")
            lost = unseen("dilatancy", "what proves the solution that slides is not here")
            yield from checks(self, slides) if checks is not None else [lost]

    # What all have

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
        if bracket.least and not is_alike(bracket.least, own := scaling.least):
            yield Check(f"least size {bracket.least:.7g} of the bracket", False, f"it is {own:.7g}")
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


# What a solution says, against the one that is found


def bound_checks(said: Solution, found: Bracket, unit: float, lacks: str = "") -> Iterator[Check]:
    """Both bounds against those found; load factors near zero are compared by a ``unit``."""
    is_told = said.bracket.least > 0.0  # files of earlier versions do not say what bounds rest on
    for end, by, rounding in ("lower", "forces", rounded_down), ("upper", "mechanism", rounded_up):
        names, both = (end, f"{end}_is_proved"), (said.bracket, found)
        (value, holds), (at, is_proved) = ([getattr(x, name) for name in names] for x in both)
        if not np.isfinite(value):
            if said.status.is_good:
                yield Check(f"{end} bound", False, f"{said.status} without it")
            continue
        is_met = abs(at - value) <= SLACK * max(abs(value), unit)
        is_met = is_met and (holds == is_proved or not is_told)
        assumed = "" if is_proved else ", under the assumption of the note"
        but = f"by the {by} it is {rounding(at, 9)}{assumed}{lacks}"
        but += rests_on_a_tree(said) if end == "upper" else ""
        yield proved(f"{end} bound {rounding(value, 9)}", is_met, but, f"by the {by}{assumed}")


def rests_on_a_tree(said: Solution) -> str:
    """What is added where an upper bound is not that of the mechanism, in words."""
    is_so = "branch and bound" in said.note
    return "; it rests on branch and bound, whose tree no file holds" * is_so


def derived_checks(said: Solution, found: Solution) -> Iterator[Check]:
    """Every claim of a solution beside its proved numbers, against the one that is ``found``: made
    anew of the scene, and of the forces and the mechanism held."""
    yield status_check(said)
    own, anew = said.dilatancy, {name: getattr(found, name) for name in _FOUND}
    anew["dilatancy"] = _as_near(own, found.dilatancy)
    # what files of earlier versions lack, and what means nothing or rests on nothing there
    lost = [name for name in _OF_THE_SCENE if says(anew[name]) and not says(getattr(said, name))]
    told, named = EVIDENCE | _CLAIMED | {*lost}, dict.fromkeys(lost, "the file has none")
    if not said.scene_digest and said.solved_scene is None:
        named["scene_digest"] = "the file has none"
    if said.scene_name != found.scene_name:
        named["scene"] = f"of that name, {said.scene_name!r}"
    if said.interaction == "none":
        told.add("moments")
        named |= {"moments": ""} if said.moments != found.moments else {}
    if not said.status.has_answer:  # there is one bound at most, and evidence of no other claim
        anew["bracket"], told = found.bracket, told - {"bracket"}
        idle = (EVIDENCE | {"members"}) - RESTS_ON.get(said.status, EVIDENCE)
        named |= {name: "nothing rests on it" for name in idle if says(getattr(said, name))}
        if said.tolerance is not None and said.lower_end is None:
            named["tolerance"] = ""
        if own is not None and own.slides_at is not None and "slides" not in said.beside:
            named["dilatancy"] = "the file does not hold the solution that slides"
    elif own is not None and not (said.status.is_good or said.bracket.has_any):
        told, named = told | {"dilatancy"}, named | {"dilatancy": ""}
    yield from compared(said, anew, told)
    yield from (unseen(name, why) for name, why in sorted(named.items()))


def status_check(said: Solution) -> Check:
    """Whether a status follows from the method, the bracket and the tolerance asked for."""
    status, asked, end = said.status, _asked(said), said.lower_end
    claim, told = f"status {str(status)!r}", f"{asked:g} asked for"
    # No load factor: what proves that is a claim of its own.
    if not status.has_answer:
        is_met = said.load_factor is None and not said.upper < np.inf
        is_met &= end is None or end.bracket.is_within(asked)
        return follows(claim, is_met, "with a load factor or an open end beside")
    if status is Status.CONTRADICTED:
        return follows(claim, not said.bracket.has_any, "with a bound beside")
    # Otherwise it tells whether what was asked for has been reached.
    brackets = [said.bracket] if end is None else [said.bracket, end.bracket]
    is_reached = all(bracket.is_within(asked) for bracket in brackets)
    expected = Status.CERTIFIED if is_reached else Status.NOT_CERTIFIED
    if said.flow == "zero-dilatancy":
        worst = max((member.residual for member in said.members), default=np.inf)
        told, is_reached = f"largest residual {worst:.1e}, {told}", worst <= asked
        expected = Status.CONVERGED if is_reached else Status.NOT_CONVERGED
    elif said.flow != "associated" or said.interaction == "fixed-point":
        return unseen(claim, "an iteration's own")
    # How a run was cut short is told by no number; that it found less than was asked for is.
    if status is Status.INTERRUPTED and (not is_reached or said.members):
        return unseen(claim, told)
    if said.load_factor is None and not said.bracket.has_any and status is not expected:
        expected = Status.SOLVER_FAILED
    is_met = status is expected
    if status is Status.NOT_CERTIFIED and (said.tolerance is None or not said.is_proved):
        is_met = said.flow == "associated"
    return follows(claim, is_met, f"{told}: {str(expected)!r}", told)


def _asked(said: Solution) -> float:
    """The tolerance asked for; that of the method where none was."""
    method = TABLE.get(method_of(said))
    usual: Any = method and (method.usual or getattr(method, "tolerance", None))
    return said.tolerance or usual or TOLERANCE


def _as_near(own: Dilatancy | None, found: Dilatancy | None) -> Dilatancy | None:
    """The share of dilatancy that is found, with the number that is held if it is near; none where
    none is held and it is too little to be told."""
    if own is None or found is None:
        return found if found is not None and (found.is_worth_a_word or found.is_all) else None
    off = 0.0 if own.share == found.share else abs(own.share - found.share)
    return replace(found, share=own.share) if off <= SLACK * max(1.0, abs(own.share)) else found
