"""Dead and live load on displaced blocks, and the work that they do on the way there.

w is the mean displacement of the live load: the work that it has done along its first directions,
over the sum of the sizes of its forces (:attr:`Loads.size`). :class:`SupportLoads
<cvxlimit.extensions.paths.supports.SupportLoads>` pushes supports instead, by the same methods.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.paths.bars import Bars
from cvxlimit.extensions.paths.pairs import Pose
from cvxlimit.model.statics import DOF, Statics
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import Actions, Load


@dataclass(frozen=True, eq=False)
class Loads:
    """Dead and live load of a scene on displaced blocks; points of action move with the blocks.

    Forces keep their direction, except pressures, which stay on the faces that they were found on:
    as large as they were, they turn with them. What ties and reactions push with at least is a part
    of the dead load.
    """

    scene: Scene

    pace: ClassVar[Any] = 1.0
    """How far blocks go for each w (length)."""

    most: ClassVar[Any] = np.inf
    """The largest w."""

    @cached_property
    def _actions(self) -> tuple[list[tuple[Actions, bool]], list[tuple[Actions, bool]]]:
        """Actions of the dead and of the live load on free blocks, and whether they turn with
        these: pressures do, and stand apart."""
        free = [self.scene.blocks[i] for i in self.scene.free]

        def parts(load: Load) -> list[tuple[Actions, bool]]:
            found = [(replace(load, pressures=()).actions(free), False)]
            if load.pressures:
                found.append((Load(pressures=load.pressures).actions(free), True))
            return found

        return parts(self.scene.dead), parts(self.scene.live)

    @cached_property
    def size(self) -> float:
        """Sum of the sizes of the live load's forces, by which its work is divided for w; for
        moments alone their sum over the contact size."""
        live = [actions for actions, _ in self._actions[1]]
        force = sum(float(np.linalg.norm(actions.force, axis=1).sum()) for actions in live)
        moment = sum(float(np.linalg.norm(actions.moment, axis=1).sum()) for actions in live)
        return force or moment / self.scene.contacts.typical_size

    @cached_property
    def _bars(self) -> Bars:
        return Bars(self.scene)

    def at(self, pose: Pose) -> tuple[FloatArray, FloatArray]:
        """Returns the dead and the live load (6 free blocks,) about the moved centroids."""
        loads = []
        for parts in self._actions:
            load = np.zeros((len(self.scene.free), DOF))
            for actions, turns in parts:
                block = self.scene.free[actions.block]
                arm = pose.placed(block, actions.at) - pose.middle[block]
                force, moment = actions.force, actions.moment
                if turns:
                    force, moment = pose.turned(block, force), pose.turned(block, moment)
                turning = moment + np.cross(arm, force)
                np.add.at(load, actions.block, np.concatenate([force, turning], axis=1))
            loads.append(load)
        dead, live = loads
        if self._bars.contacts.least.any():
            dead = dead + self._bars.least_load(pose)[self.scene.free]
        return dead.ravel(), live.ravel()

    def work(self, pose: Pose) -> tuple[float, float]:
        """Returns the work of the dead and of the live load from the first pose to this one, along
        the directions that they had at first; that of moments is taken on the rotation vectors."""
        works = []
        for parts in self._actions:
            work = 0.0
            for actions, _ in parts:
                block = self.scene.free[actions.block]
                way = pose.placed(block, actions.at) - actions.at
                work += float((actions.force * way).sum())
                if actions.moment.any():
                    turn = Rotation.from_matrix(pose.turn[block]).as_rotvec()
                    work += float((actions.moment * turn).sum())
            works.append(work)
        dead, live = works
        least = self._bars.contacts.least
        if least.any():
            dead -= float(least @ (self._bars.at(pose)[2] - self._bars.first))
        return dead, live

    def turning_work(self, one: Pose, other: Pose) -> tuple[float, float]:
        """Returns what the work of the dead and of the live load from one pose to another gains by
        their turning with the faces: on the way they have the mean of the directions at both
        ends."""
        works = []
        for parts in self._actions:
            work = 0.0
            for actions, turns in parts:
                if turns:
                    block, force = self.scene.free[actions.block], actions.force
                    way = other.placed(block, actions.at) - one.placed(block, actions.at)
                    mean = 0.5 * (one.turned(block, force) + other.turned(block, force))
                    work += float(((mean - force) * way).sum())
            works.append(work)
        return works[0], works[1]

    def push(self, w: float, start: Pose, pose: Pose) -> float:
        """Returns by how much the live load has yet to move until its mean displacement is ``w``,
        times the load. A load that turns does more work along its own directions than along the
        first ones: in the same ratio as since the ``start`` of the step."""
        done = self.work(pose)[1]
        left = w * self.size - done
        if not any(turns for _, turns in self._actions[1]):
            return left
        along = done - self.work(start)[1]
        own = along + self.turning_work(start, pose)[1]
        return left * own / along if own * along > 0.0 else left

    def moved(self, pose: Pose, d: FloatArray) -> Pose:
        """Returns the pose after finite displacements ``d`` (free blocks, 6)."""
        return pose.moved(self.scene.free, d)

    def placed(self, pose: Pose, w: float) -> Pose:
        """Returns the pose with blocks on guides where these have them at ``w``: there are none."""
        return pose

    def guided(self, statics: Statics, pose: Pose) -> Statics:
        """Returns equilibrium without what guides take up: there are none."""
        return statics
