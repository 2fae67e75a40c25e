"""Solutions without dilatancy, and what least thrusts exclude, proved again: what the method adds
at ``cvxlimit.checks``.

A solution is one if equilibrium, yield, flow rule and complementarity leave no more than is
claimed; the bracket of all of them is that of associated friction above and of least thrusts below,
each shown by evidence of its own. For files of earlier versions, which hold none, both are solved
anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from cvxlimit.errors import ModelError
from cvxlimit.extensions.dilatancy.members import Verifier
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.methods.convex import ConvexSearch
from cvxlimit.model.statics import DOF
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check, follows, proved, unseen
from cvxlimit.proving.again import ProvedAgain, with_mortar
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import Evidence, rounded_down, rounded_up
from cvxlimit.solution.records import APART, RESIDUALS
from cvxlimit.solvers import LimitState, Outcome


def checks(again: ProvedAgain) -> Iterator[Check]:
    """Every claim of solutions without dilatancy: each member, and the bracket of all."""
    solution, members = again.solution, again.solution.members
    if again.solution.status is Status.DEAD_LOAD_UNSTABLE:
        yield again.falls()
        return
    if solution.load_factor is not None and not members:
        yield Check("load factor", False, "there is no solution that it is of")
    for i, member in enumerate(members):
        claim = f"solution {i} without dilatancy"
        own = Evidence(member.load_factor, with_mortar(member.forces, again.run), member.mechanism)
        if i == 0:
            claim = f"a solution without dilatancy at {rounded_down(member.load_factor)}"
            own = again.by
            yield from again.held_checks()
        is_first = member.load_factor >= members[0].load_factor
        if not is_first or abs((own.load_factor or 0.0) - member.load_factor) > again.near:
            yield Check(claim, False, "it is lower than the first, or not that of the forces")
        if i == 0 or len(member.forces):
            angle = None if i else member.angle
            yield from _member(again, claim, own, member.residual, angle)
    yield from _ends_of_all(again)
    if members:
        small = ", ".join(f"members.{each}" for each in RESIDUALS)
        yield unseen(f"members.start, members.iterations, {small}", "but for the largest of each")
    if lost := sum(not len(member.forces) for member in members[1:]):
        yield unseen(f"{lost} further solutions without dilatancy, members.load_factor",
                     "the file holds the forces of the lowest only")  # fmt: skip


def _member(
    again: ProvedAgain, claim: str, by: Evidence, most: float, angle: float | None = None
) -> Iterator[Check]:
    """That forces and mechanism are a solution without dilatancy, but for residuals and an angle
    that are claimed."""
    run, found = again.run, None
    shapes = [getattr(x, "shape", None) for x in (by.forces, by.rates)]
    if shapes == [(len(run.contacts), DOF), (len(run.scene.free), DOF)]:
        given = Outcome("given", 0.0, 0.0), by.load_factor, by.forces, by.rates, by.internal
        with suppress(ModelError):  # internal forces that belong to nothing
            found = Verifier(run).member(LimitState(*given), "given", 0)
    worst = np.inf if found is None else found.residual
    said = f"largest residual {worst:.1e}"
    yield proved(claim, worst <= most + SLACK, f"{said}, {most:.1e} claimed", said)
    if angle == 0.0:
        yield unseen("members.angle", "none where joints slip to and fro only")
    elif found is not None and angle is not None and found.angle is not None:
        is_met = abs(found.angle - angle) <= 0.1 * APART  # less than counts as settled
        yield follows(f"angle {angle:.1e}", is_met, f"it is {found.angle:.1e}")


def _ends_of_all(again: ProvedAgain) -> Iterator[Check]:
    """The bracket of all solutions without dilatancy."""
    held, by = again.solution.bracket, again.solution.beside.get("associated")
    if np.isfinite(held.upper):
        aside, slack, anew = again.run.auxiliary_run(), SLACK, ""
        if by is None:
            slack, anew = RESIDUAL, ", solved anew,"
            for _ in ConvexSearch(aside, again.run.model).steps():
                pass
        found = aside.best.bracket if by is None else again.bracket_by(by)
        is_met = abs(found.upper - held.upper) <= slack * max(again.unit, abs(held.upper))
        is_met &= found.upper_is_proved == held.upper_is_proved
        said = f"associated friction{anew} shows {rounded_up(found.upper, 9)}"
        yield proved(f"upper bound {rounded_up(held.upper, 9)}", is_met, said, said)
    yield from again.above_thrusts()


def slides(again: ProvedAgain, by: Evidence) -> Iterator[Check]:
    """That joints slide at a load factor, where any multiple is carried with dilatancy."""
    if by.load_factor is not None:
        claim = f"joints slide without dilatancy at {rounded_down(by.load_factor, 9)}"
        yield from _member(again, claim, by, ZeroDilatancy.tolerance)
