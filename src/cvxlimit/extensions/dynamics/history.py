"""One run of a scene in MuJoCo, and what is kept of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector
from cvxlimit.errors import InputError, SolverError
from cvxlimit.extensions.dynamics.record import Record
from cvxlimit.geometry.polyhedra import JOINT_TOLERANCE
from cvxlimit.results.movement import rotation
from cvxlimit.scene import Scene

Ending = Literal["falls", "stands", "moves"]

REST = 1e-3
"""Speed of corners, over the root of size times g, below which a block is at rest."""


@dataclass(frozen=True, eq=False)
class TimeHistory:
    """The motion of the blocks in one run.

    Attributes
    ----------
    step, time_constant : float
        Of the integration, and of the contacts (``solref``), s; the stiffness of a contact goes
        with the inverse square of its time constant.
    times : (k,) array
        In s.
    displacements : (k, n, 6) array
        Of the n free blocks against the ground: translation of the centroid in the scene's unit of
        length, and rotation vector.
    ending : {"falls", "stands", "moves"}
        ``falls``: a block sank by half its size or turned by more than 45 degrees, where the run
        ends; ``stands``: all were at rest in the end; ``moves``: neither until the time was up.
    fallen : tuple of str
        The blocks that fell first.
    deepest : float
        Deepest penetration of two blocks on the way, in the scene's unit of length.
    """

    step: float
    time_constant: float
    times: FloatArray
    displacements: FloatArray
    ending: Ending
    fallen: tuple[str, ...]
    deepest: float


class Motion:
    """One run: the engine's model and state, and what is kept of its motion."""

    def __init__(
        self, mujoco: Any, model: Any, scene: Scene, length: float,
        start: Mapping[str, Sequence[float]] | None,
    ) -> None:  # fmt: skip
        self.mujoco, self.model, self.length = mujoco, model, length
        self.blocks = [scene.blocks[i] for i in scene.free]
        self.rows = scene.free + 1  # the world is MuJoCo's body 0
        self.data = mujoco.MjData(model)
        self.home = self.data.qpos.reshape(-1, 7).copy()
        ids = [block.id for block in self.blocks]
        for name, given in (start or {}).items():
            if name not in ids:
                raise InputError(f"start names {name!r}, which is no free block of {scene.name!r}")
            way = finite_vector(given, 6, f"start of block {name!r}")
            place = self.data.qpos.reshape(-1, 7)[ids.index(name)]
            place[:3] += length * way[:3]
            angle = float(np.linalg.norm(way[3:]))
            place[3:] = [np.cos(angle / 2), *(0.5 * np.sinc(angle / (2 * np.pi)) * way[3:])]
        mujoco.mj_forward(model, self.data)
        self.down = np.array(model.opt.gravity)
        self.heights = self._heights()
        self.deepest = 0.0
        self.times, self.states = [0.0], [self._state()]
        self.check_start(scene)

    def check_start(self, scene: Scene) -> None:
        contact = self.data.contact
        if not len(contact.dist):
            return
        worst, smallest = int(np.argmin(contact.dist)), min(block.size for block in self.blocks)
        depth = -float(contact.dist[worst]) / self.length
        if depth > JOINT_TOLERANCE * smallest:
            a, b = (
                scene.blocks[int(self.model.geom_bodyid[g]) - 1].id for g in contact.geom[worst]
            )
            raise InputError(
                f"blocks {a!r} and {b!r} start {depth:.3g} {scene.units.length} deep in each "
                "other, and would be thrown apart: move one of them"
            )

    def run(
        self, record: Record, along: FloatArray, until: float, kept: int, fall: float, g: float
    ) -> TimeHistory:
        """Runs up to the end, and returns the motion; ``kept`` steps between two states that are
        kept, ``fall`` the root of the smallest block's size over ``g``, a time."""
        model, data, mujoco = self.model, self.data, self.mujoco
        step, quiet, before, steps = float(model.opt.timestep), 0.0, 0.0, 0
        while steps * step < until:
            for _ in range(kept):
                # The mean over the step, so that no jump or peak of the record is lost.
                now = record.velocity((steps + 1) * step)
                model.opt.gravity[:] = self.down - (now - before) / step * along
                mujoco.mj_step(model, data)
                before, steps = now, steps + 1
            self.times.append(steps * step)
            self.states.append(self._state())
            if len(data.contact.dist):
                self.deepest = max(self.deepest, -float(data.contact.dist.min()))
            if any(warning.number for warning in data.warning) or not np.isfinite(data.qpos).all():
                raise SolverError(
                    f"the run with a step of {step:.2g} s diverged at {steps * step:.3g} s: give a "
                    "shorter step"
                )
            fallen = self._fallen()
            if fallen:
                return self._history("falls", fallen)
            quiet = quiet + kept * step if self._speed() < REST * fall * g else 0.0
            if steps * step > record.duration and quiet > fall:
                break
        return self._history("stands" if quiet > 0.0 else "moves", ())

    def _history(self, ending: Ending, fallen: tuple[str, ...]) -> TimeHistory:
        step, constant = self.model.opt.timestep, self.model.geom_solref[0, 0]
        return TimeHistory(
            float(step), float(constant), np.array(self.times), np.array(self.states), ending,
            fallen, self.deepest / self.length,
        )  # fmt: skip

    def _state(self) -> FloatArray:
        place = self.data.qpos.reshape(-1, 7)
        real, turn = place[:, 3], place[:, 4:]
        size = np.linalg.norm(turn, axis=1)
        angle = 2.0 * np.arctan2(size, np.abs(real)) * np.where(real < 0.0, -1.0, 1.0)
        share = np.divide(angle, size, out=np.full(len(size), 2.0), where=size > 0.0)
        shift = (place[:, :3] - self.home[:, :3]) / self.length
        return np.concatenate([shift, share[:, None] * turn], axis=1)

    def _heights(self) -> FloatArray:
        """Of the centroids over their places at rest, against gravity."""
        down = self.down / max(float(np.linalg.norm(self.down)), 1e-300)
        return -(self.data.qpos.reshape(-1, 7)[:, :3] @ down) / self.length

    def _fallen(self) -> tuple[str, ...]:
        """Blocks that sank by half their size, or whose own vertical leans by more than 45
        degrees."""
        sunk = self.heights - self._heights()
        down = self.down / max(float(np.linalg.norm(self.down)), 1e-300)
        lean = rotation(self.states[-1][:, 3:]) @ down @ down
        sizes = np.array([block.size for block in self.blocks])
        over = (sunk > 0.5 * sizes) | ((lean < np.sqrt(0.5)) & bool(self.down.any()))
        return tuple(block.id for block, is_over in zip(self.blocks, over, strict=True) if is_over)

    def _speed(self) -> float:
        """Largest speed of a block: of its centroid, and half its size times its turning."""
        rates = self.data.qvel.reshape(-1, 6)
        sizes = self.length * np.array([block.size for block in self.blocks])
        turning = np.linalg.norm(rates[:, 3:], axis=1)
        return float((np.linalg.norm(rates[:, :3], axis=1) + 0.5 * sizes * turning).max())
