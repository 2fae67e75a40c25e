"""What a solution says, against the one that its forces and its mechanism make: bounds, status,
units, share of dilatancy.

A bound is held against the one that was found anew. A status follows from the width of the bracket
and the tolerance that was asked for, which is part of the claim; the share of dilatancy from forces
and mechanism; units and names of joints from the scene. What a solution says besides (notes,
history, versions) is named, and not looked at.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import SMALL
from cvxlimit.methods.table import TABLE
from cvxlimit.proof.checks import SLACK, Check, follows, is_alike, proved, unseen, unseen_fields
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, rounded_down, rounded_up
from cvxlimit.solution.kinematics import Dilatancy

_OF_THE_SCENE = "units", "contact_names", "lumped"
_LOOKED_AT = {
    *_OF_THE_SCENE, "load_factor", "bracket", "forces", "mechanism", "lower_end", "quantity",
    "status", "tolerance", "dilatancy", "blocks", "contacts", "scene_digest", "surface",
    "interaction", "torsion_shear", "reference", "flow", "solved_scene", "surfaces", "scene_name",
    "moments", "members", "internal",
}  # fmt: skip
"""Fields of a solution that are proved, follow from these, or say what was asked; any other one is
named as not looked at."""


def bound_checks(said: Solution, found: Bracket, unit: float) -> Iterator[Check]:
    """Both bounds against those found; load factors near zero are compared by a ``unit``."""
    for end, evidence, rounding in (
        ("lower", "the forces show", rounded_down), ("upper", "the mechanism shows", rounded_up)
    ):  # fmt: skip
        value, at = getattr(said.bracket, end), getattr(found, end)
        is_proved, holds = (getattr(each, f"{end}_is_proved") for each in (said.bracket, found))
        if not np.isfinite(value):
            if said.status.is_good:
                yield Check(f"{end} bound", False, f"{said.status} without it")
            continue
        is_near = abs(at - value) <= SLACK * max(abs(value), unit)
        but = f"{evidence} {rounding(at, 9) if np.isfinite(at) else 'none'}"
        but += rests_on_a_tree(said) if end == "upper" else ""
        if is_near:
            but = "only with an assumption on sizes, and none is stated"
        under = "" if is_proved else ", under the assumption of the note"
        by = f"by {evidence.rsplit(' ', 1)[0]}{under}"
        claim = f"{end} bound {rounding(value, 9)}"
        yield proved(claim, is_near and (holds or not is_proved), but, by)


def rests_on_a_tree(said: Solution) -> str:
    """What is added where an upper bound is not that of the mechanism, in words."""
    is_so = "branch and bound" in said.note
    return "; it rests on branch and bound, whose tree no file holds" * is_so


def asked_checks(said: Solution, asked: Mapping[str, Any], by: str) -> Iterator[Check]:
    """What a solution says otherwise than what it is a solution of, which is called ``by``."""
    for name, value in asked.items():
        if (own := getattr(said, name)) != value:
            yield Check(f"{name} {value!r}", False, f"{by} {own!r}")


def derived_checks(said: Solution, found: Solution) -> Iterator[Check]:
    """Every claim of a solution beside its proved numbers, against the one that is ``found``: made
    anew of the scene, and of the forces and the mechanism held."""
    yield status_check(said)
    for name in _OF_THE_SCENE:
        own, other = getattr(said, name), getattr(found, name)
        if not own and other:
            yield unseen(name, "the file has none")
        elif own or other:
            claim = f"units {own.length}, {own.force}" if name == "units" else name
            yield follows(claim, is_alike(own, other), f"of the scene they are {other!s:.80}")
    yield from _dilatancy(said, found.dilatancy)
    # What is not looked at, always or in this case.
    is_fall = said.status is Status.DEAD_LOAD_UNSTABLE
    left = {
        "tolerance": not said.status.has_answer and said.lower_end is None,
        "moments": said.interaction == "none" and said.moments != found.moments,
        "members": said.flow == "associated",
        "internal": said.internal is not None and found.internal is None,
        "forces": said.forces is not None and is_fall,
        "mechanism": said.mechanism is not None and not (said.status.has_answer or is_fall),
    }
    yield from unseen_fields(said, _LOOKED_AT - {name for name, is_left in left.items() if is_left})
    if not said.scene_digest and said.solved_scene is None:
        yield unseen("scene_digest", "the file has none")
    if said.scene_name != found.scene_name:
        yield unseen("scene", f"of that name, {said.scene_name!r}")


def words_of_method(name: str) -> dict[str, str]:
    """What a solution by the method of this name says of itself."""
    method = TABLE[name]
    usual = {"interaction": "none", "flow": "associated"}
    return usual | ({method.axis: method.name} if method.axis else {})


def status_check(said: Solution) -> Check:
    """Whether a status follows from the method, the bracket and the tolerance asked for."""
    status, asked, end = said.status, _asked(said), said.lower_end
    claim, told = f"status {str(status)!r}", f"{asked:g} asked for"
    # No load factor: what proves that is a claim of its own.
    if not status.has_answer:
        is_met = said.load_factor is None and not said.upper < np.inf
        is_met &= end is None or end.bracket.is_within(asked)
        return follows(claim, is_met, "with a load factor or an open end beside")
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
    elif not is_reached:
        told = f"width {max(abs(bracket.width) for bracket in brackets):.2g}, {told}"
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
    name = said.interaction if said.flow == "associated" else said.flow
    name = "exact" if said.torsion_shear == "exact" else "convex" if name == "none" else name
    method = TABLE.get(name)
    if said.tolerance is not None or method is None:
        return said.tolerance or TOLERANCE
    usual: Any = method.usual or getattr(method, "tolerance", TOLERANCE)
    return float(usual)


def _dilatancy(said: Solution, found: Dilatancy | None) -> Iterator[Check]:
    """The share of the live load's work that forces and mechanism spend on opening joints."""
    own = said.dilatancy
    if not said.status.has_answer or not (said.status.is_good or said.bracket.has_any):
        yield from [unseen("dilatancy")] if own else []
        return
    if own is None:
        if found is not None and found.is_worth_a_word:
            yield follows("no share of dilatancy", False, f"it is {found.share:.9g}")
        return
    size = f"{own.share:.3g}" if own.is_worth_a_word else f"below {SMALL:g}"
    claim, but, by, is_met = f"share of dilatancy {size}", "there is none", "", False
    if found is not None:
        sliding = f"{len(found.sliding)} of {found.moving} joints slide"
        by = sliding if found.sliding else ""
        is_met = abs(own.share - found.share) <= SLACK * max(1.0, abs(found.share))
        but = sliding if is_met else f"forces and mechanism have {found.share:.9g}"
        is_met &= (own.sliding, own.moving) == (found.sliding, found.moving)
    yield follows(claim, is_met, but, by)
    for check in unseen_fields(own, ("share", "sliding", "moving")):
        yield replace(check, claim=f"dilatancy.{check.claim}")
