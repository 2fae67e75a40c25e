"""Live loads of which any multiple is carried: by what presses joints, or by dilatancy alone?"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import Run
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.problem import LimitProgram
from cvxlimit.model.statement import Stated
from cvxlimit.solution.kinematics import Dilatancy, sliding_joints
from cvxlimit.solvers import LimitState
from cvxlimit.surfaces.base import times
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES, strength_key

_AT_LIMIT = 1e-4
"""Reserve of friction, relative, below which joints slide for all that is known of friction; where
they do it comes out at 1e-9 in planes, and at 1e-5 in space after a few rounds."""

_ROUNDS = 8
"""Pairs of problems: their loss never rises, and three are enough as a rule."""


@dataclass(frozen=True, eq=False)
class _LeastPressed:
    """Goal: forces that carry the live load alone, of the least compression at given prices."""

    price: cp.Parameter

    def __call__(self, stated: Stated) -> Any:
        stated.into.zero(stated.factor - 1.0 / stated.assemblage.scaling.load_factor(1.0))
        pressure = stated.forces["N"]
        return -np.ones(pressure.size) @ times(self.price, pressure)


def carried_by_dilatancy(run: Run) -> Dilatancy | None:
    """How joints slide under the live load alone, if forces carry it only because they dilate.

    Associated friction lets joints press as hard as it takes, since they would open as they slide.
    Without dilatancy a structure is at collapse where its forces carry no more than they do with
    their own friction held fixed, mu N a number: mechanism and forces are then a solution without
    dilatancy. So forces are sought that press the joints as little as can be, at prices that follow
    the slips of that mechanism, each pair of problems losing less than the one before. Ending with
    no reserve of friction, they prove that the live load makes the joints slide; otherwise, that
    no such forces were found, as where the load presses joints itself: None. It is also None for
    surfaces of one's own, whose friction may be another, and for supports that are guided.
    """
    is_plain = run.formulation is corner_compressions
    has_friction = len(run.surfaces) > 1 or not is_plain  # at points: it is no surface then
    is_known = strength_key(run.surfaces, run.contacts) is not None
    if not (has_friction and is_known and run.assemblage.statics.guide is None):
        return None
    alone = run.assemblage.alone(run.assemblage.statics.live)
    contacts, mu = alone.contacts, alone.contacts.friction
    price, reserve = cp.Parameter(len(contacts), nonneg=True), np.inf
    with run.clock.phase("compile"):
        problem = LimitProgram(alone, DEFAULT_SURFACES, goal=_LeastPressed(price))
    price.value = np.ones(len(contacts))
    for _ in range(_ROUNDS):
        pressed = _solved(run, problem, "least compression under the live load")
        if pressed.forces is None:
            return None
        fixed = _with_friction_of(alone, np.maximum(pressed.forces[:, COLUMN["N"]], 0.0))
        found = _solved(run, LimitProgram(fixed, DEFAULT_SURFACES), "friction held fixed")
        if found.mechanism is None or found.load_factor is None or found.load_factor <= 0.0:
            return None
        relative = alone.statics.relative_rates(found.mechanism)
        if found.load_factor <= 1.0 + _AT_LIMIT:
            sliding, moving = sliding_joints(run.scene, relative, found.mechanism)
            return Dilatancy(np.inf, sliding, moving)
        if found.load_factor > (1.0 - _AT_LIMIT) * reserve:
            return None
        reserve = found.load_factor
        slip = np.maximum(
            np.hypot(relative[:, COLUMN["V1"]], relative[:, COLUMN["V2"]]),
            contacts.torsion_arm * np.abs(relative[:, COLUMN["MT"]]),
        )
        price.value = mu * slip / np.max(mu * slip, initial=1e-300)
    return None


def _solved(run: Run, problem: LimitProgram, what: str) -> LimitState:
    state, settings = run.try_solvers(problem.run, run.ladder or problem.ladder()[:2])
    run.note(replace(state, load_factor=None), f"{settings}, {what}")
    return state


def _with_friction_of(alone: Assemblage, pressure: FloatArray) -> Assemblage:
    """The same with cohesion in place of friction: as much as compressions (n,) mobilise."""
    contacts = alone.contacts
    cohesion = contacts.friction * pressure / contacts.area
    own = replace(contacts, friction=np.zeros(len(contacts)), cohesion=cohesion)
    statics = replace(alone.statics, contacts=own)
    statics.__dict__["matrix"] = alone.statics.matrix
    return replace(alone, statics=statics, repeats=None)
