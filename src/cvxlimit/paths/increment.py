"""The one convex problem of an iterate: forces at points, with gaps and slips in the objective.

    max  alpha Delta - sum (g_i n_i + tau_i . v_i)   s.t.   A(q) x + f_dead + alpha f_live = 0,
                                                           |v_i| <= mu_i n_i

Its dual moves the blocks by d so that the live load moves on by Delta, no point is overrun, and the
dead load rises as little as it can: g_i + (A'd)_n >= mu_i |tau_i + (A'd)_t|.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.formulations import ForceModel, Part
from cvxlimit.model.goals import LARGEST_FACTOR, Goal, Stated
from cvxlimit.model.problem import LimitProblem
from cvxlimit.model.sinks import gathered
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.paths.pairs import Pose
from cvxlimit.paths.path import Points
from cvxlimit.scene import Scene
from cvxlimit.solvers import Outcome, settings_for
from cvxlimit.surfaces import Rocking
from cvxlimit.surfaces.base import Condition, Norm, product, times

LADDER = (settings_for("BLOCKWISE", 1e-12), settings_for("CLARABEL", 1e-12))
"""A point that should carry nothing carries at most this over its gap, which is what keeps the
load factor of a hinge from being exact."""

ROUGH = (settings_for("BLOCKWISE", 1e-7), *LADDER[1:])
"""For iterates that are far off."""


def point_forces(contacts: Contacts) -> ForceModel:
    """Compression n and friction mu v at every point, each within its own cone, |v| <= n: with
    friction of 1e-9, |v| <= mu n would lose n >= 0."""
    each, mu = np.arange(len(contacts)), contacts.friction
    parts = [Part("n", {"N": 1}, each, nonneg=True), Part("v1", {"V1": mu}, each),
             Part("v2", {"V2": mu}, each)]  # fmt: skip
    return ForceModel(contacts, parts, [Condition([Norm({"v1": 1}, {"v2": 1})], {"n": 1}, each)])


@dataclass(frozen=True, eq=False)
class Loads:
    """Dead and live load of a scene on displaced blocks; points of action move with the blocks."""

    scene: Scene

    @cached_property
    def _actions(self) -> list[Any]:
        free = [self.scene.blocks[i] for i in self.scene.free]
        return [load.actions(free) for load in (self.scene.dead, self.scene.live)]

    def at(self, pose: Pose) -> tuple[FloatArray, FloatArray]:
        """(6 free blocks,) of the dead and of the live load, about the moved centroids."""
        found = []
        for what in self._actions:
            block = self.scene.free[what.block]
            arm = pose.placed(block, what.at) - pose.middle[block]
            turning = what.moment + np.cross(arm, what.force)
            load = np.zeros((len(self.scene.free), DOF))
            np.add.at(load, what.block, np.concatenate([what.force, turning], axis=1))
            found.append(load.ravel())
        return found[0], found[1]

    def work(self, pose: Pose) -> tuple[float, float]:
        """Of the dead and of the live load on the way from the blocks' first places; of moments,
        which do not turn with the blocks, on the rotation vectors."""
        found = []
        for what in self._actions:
            block = self.scene.free[what.block]
            way = pose.placed(block, what.at) - what.at
            work = float((what.force * way).sum())
            if what.moment.any():
                turn = Rotation.from_matrix(pose.turn[block]).as_rotvec()
                work += float((what.moment * turn).sum())
            found.append(work)
        return found[0], found[1]

    @cached_property
    def size(self) -> float:
        """Sum of the live load's forces: its work over this is w. Of moments alone, over the
        contact size."""
        live = self._actions[1]
        force = float(np.linalg.norm(live.force, axis=1).sum())
        moment = float(np.linalg.norm(live.moment, axis=1).sum())
        return force or moment / self.scene.contacts.typical_size


@dataclass(frozen=True, eq=False)
class Found:
    """Answer of an increment: the load factor, forces (k, 3) at the points, and the displacement d
    (free blocks, 6) to the next iterate; None for all where the solver has no answer."""

    outcome: Outcome
    load_factor: float
    forces: FloatArray
    d: FloatArray


class Increment:
    """Mechanics of one iterate: blocks at a pose, points, loads.

    ``push`` is by how much the live load has yet to move, times the load: a number, or a CVXPY
    Parameter, as ``gap`` (k,) and ``slip`` (k, 2) in ``goal`` may be.
    """

    def __init__(self, scene: Scene, points: Points, pose: Pose, loads: Loads) -> None:
        self.points, n = points, len(points)
        size = scene.contacts.typical_size
        contacts = Contacts(
            names=tuple(f"point {i}" for i in range(n)),
            block_ids=scene.contacts.block_ids,
            a=points.a,
            b=points.b,
            origin=points.at,
            axes=points.axes,
            corner_start=np.arange(n + 1),
            corner_xy=np.zeros((n, 2)),
            sides=np.full((n, 2), np.nan),
            area=np.full(n, size**2),
            friction=points.friction,
        )
        contacts.__dict__["torsion_arm"] = np.full(n, size)
        number = np.full(len(scene.blocks), -1)
        number[scene.free] = np.arange(len(scene.free))
        statics = Statics(contacts, pose.middle, number, *loads.at(pose))
        dead, live = (load.reshape(-1, DOF) for load in (statics.dead, statics.live))
        scaling = Scaling.under(size, dead, live)
        self.assemblage = Assemblage(
            scene._with_contacts(contacts), statics, scaling, Balance.of(statics)
        )

    def problem(self, goal: Goal = LARGEST_FACTOR) -> LimitProblem:
        return LimitProblem(self.assemblage, [Rocking()], formulation=point_forces, goal=goal)

    def goal(self, push: Any, gap: Any, slip: tuple[Any, Any]) -> Callable[[Stated], Any]:
        """What is maximised, over units of force and length, to either sink."""
        scaling, mu = self.assemblage.scaling, self.points.friction
        unit = scaling.length

        def stated(found: Stated) -> Any:
            factor = scaling.load_factor(1.0) / (scaling.force * unit)
            goal = times(factor * push, found.factor)
            at = np.zeros(len(mu), np.int64)
            given: Any = zip(("n", "v1", "v2"), (gap, *slip), (1.0, mu, mu), strict=True)
            for name, lack, weight in given:
                own = found.forces[name]
                goal = goal - gathered(times(product(weight / unit, lack), own), at, 1)
            return goal

        return stated

    def solve(self, push: float | None, is_rough: bool = False) -> Found | Outcome:
        """The answer, or what the last solver said where none has one; with nothing to ``push``
        towards, the largest load factor, whose d is a rate."""
        gap, slip = self.points.gap, self.points.slip
        goal = LARGEST_FACTOR if push is None else self.goal(push, gap, (slip[:, 0], slip[:, 1]))
        problem = self.problem(goal)
        scaling, mu = self.assemblage.scaling, self.points.friction
        for settings in ROUGH if is_rough else LADDER:
            state = problem.run(settings)
            if state.mechanism is not None and state.internal is not None:
                n, v1, v2 = state.internal.reshape(3, -1)
                forces = np.stack([n, mu * v1, mu * v2], axis=1)
                d = state.mechanism * (scaling.live * scaling.length)
                return Found(state.outcome, float(state.load_factor or 0.0), forces, d)
            if state.outcome.claims_no_optimum:
                break
        return state.outcome
