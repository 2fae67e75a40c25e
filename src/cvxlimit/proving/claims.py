"""What a solution says, held against what is found anew of its forces and its mechanism.

The bounds against those of a certificate (:func:`bound_checks`), the status against the width of
the bracket and the tolerance asked for (:func:`status_check`), every other entry against the same
solution packed anew (:func:`derived_checks`). What proves nothing and follows from nothing is named
as not looked at.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cvxlimit.methods.solving import TABLE
from cvxlimit.proof.checks import SLACK, Check, compared, follows, proved, says, unseen
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, rounded_down, rounded_up
from cvxlimit.solution.kinematics import Dilatancy

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
        if own.axis:
            usual[own.axis] = own.name
        asked = usual | asked
    asked = {**surface} | asked
    return compared(asked, {name: getattr(said, name) for name in asked})


def bound_checks(said: Solution, found: Bracket, unit: float, lacks: str = "") -> Iterator[Check]:
    """Both bounds against those found; load factors near zero are compared by a ``unit``. ``lacks``
    is what to say besides of one that is not found."""
    is_told = said.bracket.least > 0.0  # files of earlier versions do not say what bounds rest on
    for end, by, rounded in (("lower", "forces", rounded_down), ("upper", "mechanism", rounded_up)):
        value, is_said = getattr(said.bracket, end), getattr(said.bracket, f"{end}_is_proved")
        at, is_proved = getattr(found, end), getattr(found, f"{end}_is_proved")
        if not np.isfinite(value):
            if said.status.is_good:
                yield Check(f"{end} bound", False, f"{said.status} without it")
            continue
        is_met = abs(at - value) <= SLACK * max(abs(value), unit)
        is_met = is_met and (is_said == is_proved or not is_told)
        assumed = "" if is_proved else ", under the assumption of the note"
        but = f"by the {by} it is {rounded(at, 9)}{assumed}{lacks}"
        if end == "upper":
            but += rests_on_a_tree(said)
        yield proved(f"{end} bound {rounded(value, 9)}", is_met, but, f"by the {by}{assumed}")


def rests_on_a_tree(said: Solution) -> str:
    """What is added where an upper bound is not that of the mechanism, in words."""
    if "branch and bound" not in said.note:
        return ""
    return "; it rests on branch and bound, whose tree no file holds"


def derived_checks(said: Solution, found: Solution) -> Iterator[Check]:
    """Every claim of a solution beside its proved numbers, against the one that is ``found``: made
    anew of the scene, and of the forces and the mechanism held."""
    yield status_check(said)
    own, anew = said.dilatancy, {name: getattr(found, name) for name in _FOUND}
    anew["dilatancy"] = _as_near(own, found.dilatancy)
    # What is left out of the comparison, and what is named as not looked at: by name, why.
    left_out, unseen_why = EVIDENCE | _CLAIMED, dict[str, str]()
    # Files of earlier versions lack what follows from the scene, and its digest.
    for name in _OF_THE_SCENE:
        if says(anew[name]) and not says(getattr(said, name)):
            left_out.add(name)
            unseen_why[name] = "the file has none"
    if not said.scene_digest and said.solved_scene is None:
        unseen_why["scene_digest"] = "the file has none"
    if said.scene_name != found.scene_name:
        unseen_why["scene"] = f"of that name, {said.scene_name!r}"
    # Moments mean nothing without interaction.
    if said.interaction == "none":
        left_out.add("moments")
        if said.moments != found.moments:
            unseen_why["moments"] = ""
    # Without a load factor there is one bound at most, and evidence of no other claim.
    if not said.status.has_answer:
        anew["bracket"] = found.bracket
        left_out.remove("bracket")
        idle = (EVIDENCE | {"members"}) - RESTS_ON.get(said.status, EVIDENCE)
        unseen_why |= {name: "nothing rests on it" for name in idle if says(getattr(said, name))}
        if said.tolerance is not None and said.lower_end is None:
            unseen_why["tolerance"] = ""
        if own is not None and own.slides_at is not None and "slides" not in said.beside:
            unseen_why["dilatancy"] = "the file does not hold the solution that slides"
    elif own is not None and not (said.status.is_good or said.bracket.has_any):
        left_out.add("dilatancy")
        unseen_why["dilatancy"] = ""
    yield from compared(said, anew, left_out)
    yield from (unseen(name, why) for name, why in sorted(unseen_why.items()))


def status_check(said: Solution) -> Check:
    """Whether a status follows from the method, the bracket and the tolerance asked for."""
    status, asked, end = said.status, _tolerance_of(said), said.lower_end
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


def _tolerance_of(said: Solution) -> float:
    """The tolerance asked for; that of the method where none was."""
    method = TABLE.get(method_of(said))
    usual = getattr(method, "usual", None) or getattr(method, "tolerance", None)
    return said.tolerance or usual or TOLERANCE


def _as_near(own: Dilatancy | None, found: Dilatancy | None) -> Dilatancy | None:
    """The dilatancy that is ``found``, with the share that is held if it is near; none where none
    is held and it is too little to be told."""
    if found is None or (own is None and not (found.is_worth_a_word or found.is_all)):
        return None
    if own is None or own.share == found.share:  # shares may both be infinite
        return found
    is_near = abs(own.share - found.share) <= SLACK * max(1.0, abs(own.share))
    return replace(found, share=own.share) if is_near else found
