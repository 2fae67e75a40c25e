"""What a solution says, against what is found again: bounds, status, units, share of dilatancy.

A status follows from the width of the bracket and the tolerance that was asked for, which is part
of the claim; the share of dilatancy from forces and mechanism. What a solution says besides (notes,
history, versions) is named, and not looked at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import SMALL
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.driver import Run
from cvxlimit.methods.solving import TABLE
from cvxlimit.model.statics import Scaling
from cvxlimit.proof.checks import SLACK, Check, follows, is_alike, unseen, unseen_fields
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket, rounded_down, rounded_up
from cvxlimit.solution.kinematics import Dilatancy

_OF_THE_SCENE = "units", "contact_names", "lumped"
_LOOKED_AT = {
    *_OF_THE_SCENE, "load_factor", "bracket", "forces", "mechanism", "lower_end", "quantity",
    "status", "tolerance", "dilatancy", "blocks", "contacts", "scene_digest", "surface",
    "interaction", "torsion_shear", "reference", "flow", "solved_scene", "surfaces", "scene_name",
}  # fmt: skip
"""Fields of a solution that are proved, follow from these, or say what was asked; any other one is
named as not looked at."""

_SHOWN_BY = {"lower": "forces", "upper": "mechanism"}


def bound_checks(said: Solution, scaling: Scaling, found: Bracket) -> Iterator[Check]:
    """Both bounds against those found."""
    for end, rounding in (("lower", rounded_down), ("upper", rounded_up)):
        value = float(getattr(said.bracket, end))
        proved = bool(getattr(said.bracket, f"{end}_is_proved"))
        if not np.isfinite(value):
            if said.status.is_good:
                yield Check(f"{end} bound", False, f"{said.status} without it")
            continue
        at, holds = float(getattr(found, end)), bool(getattr(found, f"{end}_is_proved"))
        claim, by = f"{end} bound {rounding(value, 9)}", f"the {_SHOWN_BY[end]}"
        is_near = abs(at - value) <= SLACK * max(abs(value), scaling.unit(value))
        if is_near and (holds or not proved):
            under = "" if proved else ", under the assumption of the note"
            yield Check(claim, True, f"by {by}{under}")
        elif is_near:
            yield Check(claim, False, "only with an assumption on sizes, and none is stated")
        elif end == "lower" and not np.isfinite(at):
            is_there = said.forces is not None
            yield Check(claim, False, "the forces are not admissible" if is_there else "no forces")
        else:
            shows = f"{by} {'show' if end == 'lower' else 'shows'} {rounding(at, 9)}"
            shows = shows if np.isfinite(at) else "no mechanism shows it"
            yield Check(claim, False, shows if end == "lower" else why_above(said, shows))


def why_above(said: Solution, shows: str) -> str:
    """Why an upper bound is not that of the mechanism."""
    if "branch and bound" in said.note:
        return f"{shows}; it rests on branch and bound, whose tree no file holds"
    return shows


def derived_checks(said: Solution, run: Run, answer: Answer) -> Iterator[Check]:
    """Every claim of a solution beside its proved numbers.

    ``said`` is the solution as it is held, ``run`` the run that it would be of, and ``answer`` has
    its forces and its mechanism, with the load factor that the forces carry.
    """
    yield status_check(said)
    for name in _OF_THE_SCENE:
        held, found = getattr(said, name), getattr(run.given, name, run.given.contacts.names)
        if not held and found:
            yield unseen(name, "the file has none")
        elif held or found:
            is_met = is_alike(held, found)
            claim = f"units {held.length}, {held.force}" if name == "units" else name
            yield follows(claim, is_met, "" if is_met else f"of the scene they are {found!s:.80}")
    yield from _dilatancy(said, run, answer)
    seen, is_fall = set(_LOOKED_AT), said.status is Status.DEAD_LOAD_UNSTABLE
    for name, is_seen in (
        ("tolerance", said.status.has_answer or said.lower_end is not None),
        ("moments", said.interaction != "none" or said.moments == run.moments.name),
        ("members", said.flow != "associated"),
        ("internal", said.internal is None or answer.internal is not None),
        ("forces", said.forces is None or not is_fall),
        ("mechanism", said.mechanism is None or said.status.has_answer or is_fall),
    ):
        seen = seen | {name} if is_seen else seen - {name}
    if not said.scene_digest and said.solved_scene is None:
        yield unseen("scene_digest", "the file has none")
    if said.scene_name != run.given.name:
        yield unseen("scene", f"of that name, {said.scene_name!r}")
    yield from unseen_fields(said, seen)


def words_of_method(name: str) -> dict[str, str]:
    """What a solution by the method of this name says of itself."""
    method = TABLE[name]
    usual = {"interaction": "none", "flow": "associated"}
    return usual | ({method.axis: method.name} if method.axis else {})


def status_check(said: Solution) -> Check:
    """Whether a status follows from the method, the bracket and the tolerance asked for."""
    status, ends = said.status, [said.bracket]
    claim, open_ends = f"status {str(status)!r}", (Status.NOT_CERTIFIED, Status.NOT_CONVERGED)
    if said.lower_end is not None:
        ends = (
            [said.lower_end.bracket] if not status.has_answer else [*ends, said.lower_end.bracket]
        )
    # No load factor: what proves that is a claim of its own.
    if not status.has_answer:
        is_free = said.load_factor is None and not said.upper < np.inf
        is_met = is_free and (said.lower_end is None or ends[0].is_within(_asked(said)))
        return follows(claim, is_met, "" if is_met else "with a load factor or an open end beside")
    if said.flow == "zero-dilatancy":
        worst = max((member.residual for member in said.members), default=np.inf)
        told = f"largest residual {worst:.1e}, {_asked(said):g} asked for"
        expected = Status.CONVERGED if worst <= _asked(said) else Status.NOT_CONVERGED
    elif said.flow != "associated" or said.interaction == "fixed-point":
        return unseen(claim, "an iteration's own")
    else:
        is_within = all(end.is_within(_asked(said)) for end in ends)
        wide = "" if is_within else f"width {max(abs(end.width) for end in ends):.2g}, "
        told = f"{wide}{_asked(said):g} asked for"
        expected = Status.CERTIFIED if is_within else Status.NOT_CERTIFIED
    # How a run was cut short is told by no number; that it found less than was asked for is.
    if status is Status.INTERRUPTED and (expected in open_ends or said.members):
        return unseen(claim, told)
    is_empty = said.load_factor is None and not said.bracket.has_any
    is_met = status is (Status.SOLVER_FAILED if is_empty and status is not expected else expected)
    if status is Status.NOT_CERTIFIED and (said.tolerance is None or not said.is_proved):
        is_met = said.flow == "associated"
    return follows(claim, is_met, told if is_met else f"{told}: {str(expected)!r}")


def _asked(said: Solution) -> float:
    """The tolerance asked for; that of the method where none was."""
    name = said.interaction if said.flow == "associated" else said.flow
    name = "exact" if said.torsion_shear == "exact" else "convex" if name == "none" else name
    method = TABLE.get(name)
    if said.tolerance is not None or method is None:
        return said.tolerance or TOLERANCE
    usual: Any = method.usual or getattr(method, "tolerance", TOLERANCE)
    return float(usual)


def _dilatancy(said: Solution, run: Run, answer: Answer) -> Iterator[Check]:
    """The share that forces and mechanism have, at the load factor told or at the one carried."""
    held, found, is_met = said.dilatancy, None, said.dilatancy is None
    if not (said.status.is_good or said.bracket.has_any) or not said.status.has_answer:
        yield from [unseen("dilatancy")] if held else []
        return
    for factor in (said.load_factor, answer.load_factor) if said.flow == "associated" else ():
        found = replace(answer, load_factor=factor).dilatancy_in(run.assemblage)
        if is_met := _is_same(held, found):
            break
    if held is None and is_met:
        return
    claim = "no share of dilatancy"
    if held is not None:
        size = f"{held.share:.3g}" if held.is_worth_a_word else f"below {SMALL:g}"
        claim = f"share of dilatancy {size}"
    shown = "there is none" if found is None else f"forces and mechanism have {found.share:.9g}"
    if found is not None and (is_met or (held and held.share == found.share)):
        shown = f"{len(found.sliding)} of {found.moving} joints slide" if found.sliding else ""
    yield follows(claim, is_met, shown)
    if held is not None:
        for check in unseen_fields(held, ("share", "sliding", "moving")):
            yield replace(check, claim=f"dilatancy.{check.claim}")


def _is_same(held: Dilatancy | None, found: Dilatancy | None) -> bool:
    """True if share and joints agree."""
    if found is None:
        return held is None
    if held is None:
        return not found.is_worth_a_word
    is_near = abs(held.share - found.share) <= SLACK * max(1.0, abs(found.share))
    return is_near and (held.sliding, held.moving) == (found.sliding, found.moving)
