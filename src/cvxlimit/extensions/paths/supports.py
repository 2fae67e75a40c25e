"""Supports that move: scenes in which they are free blocks on a guide, and where these fall.

A support that moves is taken as a block without weight on a guide, which leaves it the way w along
its motion alone; the live load is a unit push along that. Its load factor alpha is what has to
push, so that the structure's reaction along the motion is R = -alpha: at each configuration the
largest alpha is the least reaction, and the largest one is found with the push turned round.

Where no forces carry the dead load, whatever the reaction, there are rates u of all blocks with

    n_i . u > mu_i |s_i(u)| at every closed point,    f_live . u = 0,    f_dead . u > 0 :

no compression and friction do negative work on them, and the dead load's is positive.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import EPSILON, ROUNDING, FloatArray
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.increment import FINE, Increment
from cvxlimit.extensions.paths.loads import Loads
from cvxlimit.extensions.paths.pairs import Pose
from cvxlimit.model.sinks import Form, Rows
from cvxlimit.model.statics import DOF, Statics
from cvxlimit.results.movement import rotation
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import Load
from cvxlimit.scene.settling import SupportMotion, check_motions
from cvxlimit.solvers import ladder_for
from cvxlimit.solvers.program import ConeProgram


@dataclass(frozen=True, eq=False)
class SupportLoads(Loads):
    """The dead load, and a unit push of supports along their ``motions``; ``sign`` -1 is against
    them.

    The push does work 1 on the motion, so that w is how far the first support has moved, or the
    angle by which it has turned.
    """

    motions: tuple[SupportMotion, ...]
    sign: float = 1.0

    @property
    def size(self) -> float:
        return 1.0

    @cached_property
    def pace(self) -> float:
        """How far the farthest corner goes for each w (length), as if all went with the first
        motion: 1 of translations."""
        first, corners = self.motions[0], [self.scene.blocks[i].vertices for i in self.scene.free]
        way = np.cross(first.rotation, np.concatenate(corners) - np.array(first.about or 0.0))
        way = way + np.array(first.direction)
        return float(np.linalg.norm(way, axis=1).max()) / first.size

    @property
    def most(self) -> float:
        """A turn alone tells w by its angle: up to a quarter of a circle, no support goes on."""
        return np.inf if any(self.motions[0].direction) else np.pi / 2.0

    def moved(self, pose: Pose, d: FloatArray) -> Pose:
        """Returns the pose after displacements ``d`` (free blocks, 6), with supports on the exact
        way of their motion: points of its axis go straight on, all others round it."""
        ways = self._ways(pose)
        farther = float((ways * d).sum() / (ways**2).sum())
        return self.placed(pose.moved(self.scene.free, d), self._w(pose) + farther)

    def placed(self, pose: Pose, w: float) -> Pose:
        """Returns the pose with supports that have moved by ``w``."""
        shift, turn = pose.shift.copy(), pose.turn.copy()
        for motion, i in self._moving:
            share, c = w / self.motions[0].size, pose.centroid[i]
            about = c if motion.about is None else np.array(motion.about)
            turn[i] = rotation(share * np.array(motion.rotation))
            shift[i] = about + share * np.array(motion.direction) + turn[i] @ (c - about) - c
        return Pose(pose.centroid, shift, turn)

    def at(self, pose: Pose) -> tuple[FloatArray, FloatArray]:
        ways = self._ways(pose).ravel()
        return super().at(pose)[0], self.sign * ways / float(ways @ ways)

    def work(self, pose: Pose) -> tuple[float, float]:
        return super().work(pose)[0], self._w(pose)

    def guided(self, statics: Statics, pose: Pose) -> Statics:
        """Returns equilibrium without what guides take up."""
        return statics.guided(self._ways(pose))

    @cached_property
    def _moving(self) -> list[tuple[SupportMotion, int]]:
        """Every motion with the number of each of its blocks."""
        place = {block.id: i for i, block in enumerate(self.scene.blocks)}
        return [(motion, place[name]) for motion in self.motions for name in motion.supports]

    def _ways(self, pose: Pose) -> FloatArray:
        """Returns the rates (free blocks, 6) for each w at a pose."""
        ways = np.zeros((len(self.scene.blocks), DOF))
        for motion, i in self._moving:
            turn, c = np.array(motion.rotation), pose.centroid[i]
            arm = 0.0 if motion.about is None else pose.turn[i] @ (c - np.array(motion.about))
            ways[i] = [*(motion.direction + np.cross(turn, arm * np.ones(3))), *turn]
        return ways[self.scene.free] / self.motions[0].size

    def _w(self, pose: Pose) -> float:
        """Returns how far the first support has moved: the way of the axis, or the angle."""
        first, i = self._moving[0]
        if not any(first.direction):
            turn = Rotation.from_matrix(pose.turn[i]).as_rotvec()
            return float(turn @ first.rotation) / first.size
        about = np.array([pose.centroid[i] if first.about is None else first.about])
        way = (pose.placed(np.array([i]), about) - about)[0]
        return float(way @ first.direction) / first.size


def loads_of(scene: Scene, motions: Sequence[SupportMotion]) -> Loads:
    """Returns the loads of a scene, in which supports may move along a guide."""
    return SupportLoads(scene, tuple(motions)) if motions else Loads(scene)


def guided(scene: Scene, motions: Sequence[SupportMotion]) -> Scene:
    """The scene with supports that move as free blocks without weight, pushed along their motion.

    Raises
    ------
    InputError
        For a block that is no support.
    """
    check_motions(motions, scene.supports, scene.name)
    rates = rates_of(scene, motions)
    others = tuple(name for name in scene.supports if name not in rates)
    ways = {motion.direction for motion in motions}
    if not others and len(ways) == 1 and not any(any(motion.rotation) for motion in motions):
        raise InputError(
            f"all supports of scene {scene.name!r} move alike ({', '.join(rates)}), and nothing "
            "moves against anything: name those that move against the others, or turn them"
        )
    whole = sum(float(way @ way) for way in rates.values())
    light = EPSILON * scene.total_weight / len(rates)
    blocks = tuple(
        replace(block, density=light / block.volume) if block.id in rates else block
        for block in scene.blocks
    )
    push = Load(forces={name: tuple(way / whole) for name, way in rates.items()})
    return scene._copy(blocks=blocks, supports=others, live=push, settling=())


def standing(scene: Scene, motions: Sequence[SupportMotion]) -> Scene:
    """A scene whose supports that move are supports once more, under its dead load."""
    names = (name for motion in motions for name in motion.supports)
    live = Load(acceleration=(1, 0, 0))  # which does not matter
    return scene._copy(supports=(*scene.supports, *names), live=live, settling=tuple(motions))


def rates_of(scene: Scene, motions: Sequence[SupportMotion]) -> dict[str, FloatArray]:
    """Ways (6,) of supports at first, in the unit of the first motion."""
    blocks = {block.id: block for block in scene.blocks}
    return {
        name: motion.rates(blocks[name]) / motions[0].size
        for motion in motions
        for name in motion.supports
    }


def falling(given: Increment) -> FloatArray | None:
    """Returns rates (free blocks, 6) that prove that no forces at closed points carry the dead
    load, whatever the reaction of the supports that move; None where none are found."""
    scaling = given.assemblage.scaling
    scaled = scaling.apply(given.assemblage.statics)
    into, u, opening = opened(given, scaled)
    into.nonneg(opening - 10.0 * ROUNDING * np.ones(len(given.points)))
    into.zero(sp.csr_array(scaled.live[None]) @ u)
    return next((x for x in _rates(given, into.written(scaled.dead[None] @ u).program)
                 if is_falling(given, x)), None)  # fmt: skip


def opening_field(given: Increment) -> FloatArray | None:
    """Returns rates (free blocks, 6) that open all points beyond friction times slip, the one that
    opens least as far as blocks that go no farther than others allow; None where no solver has
    any."""
    into, _, opening = opened(given, given.assemblage.scaling.apply(given.assemblage.statics))
    least = into.new()
    into.nonneg(opening - np.ones((len(given.points), 1)) @ least)
    return next(_rates(given, into.written(least).program), None)


def opened(given: Increment, scaled: Statics) -> tuple[Rows, Form, Form]:
    """Returns a sink in which blocks go by rates u of 1 at most, in units of the scaling; u; and by
    how much these open points beyond friction times slip (k,)."""
    points, k, into = given.points, len(given.points), Rows()
    rates = scaled.matrix.T.tocsr()
    normal, *along = (rates[DOF * np.arange(k) + column] for column in (2, 0, 1))
    u, slip = into.new(len(scaled.dead)), into.new(k)
    into.cone(slip, [each @ u for each in along])
    for sign in (1.0, -1.0):
        into.nonneg(sign * u + 1.0)
    return into, u, normal @ u - points.friction * slip


def _rates(given: Increment, program: ConeProgram) -> Iterator[FloatArray]:
    """Yields the rates (free blocks, 6) of what one solver after the other finds."""
    scaling, count = given.assemblage.scaling, len(given.assemblage.statics.dead)
    for settings in ladder_for("paths", FINE):
        _, x, _ = program.solve(settings)
        if x is not None:
            yield scaling.mechanism(x[:count].reshape(-1, DOF)) * scaling.live


def is_falling(given: Increment, rates: FloatArray) -> bool:
    """Whether rates (free blocks, 6) prove that no forces carry the dead load: in plain NumPy."""
    statics, points = given.assemblage.statics, given.points
    size = given.assemblage.scaling.length
    own = rates if statics.guide is None else (statics.guide @ rates.ravel()).reshape(-1, DOF)
    fastest = float(np.abs(own * np.repeat([1.0, size], 3)).max(initial=0.0)) or 1.0
    own = own / fastest
    moves = statics.relative_rates(own)[:, :3]
    opens = moves[:, 2] - points.friction * np.linalg.norm(moves[:, :2], axis=1)
    weight = float(np.abs(statics.dead).sum())
    is_still = abs(statics.live @ own.ravel()) <= ROUNDING
    falls = statics.dead @ own.ravel() > ROUNDING * weight
    return bool((opens > 0.0).all() and is_still and falls)
