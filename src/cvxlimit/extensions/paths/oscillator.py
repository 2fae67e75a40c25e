"""The equivalent oscillator of a mechanism: which share of its mass takes part, and how it moves.

A mechanism moves weights P by horizontal rates dx along a push, and the control point by dx_C. The
oscillator of one degree of freedom with the same kinetic energy has the share e* of their mass, and
a displacement d that goes with that of the control point, d_C:

    e* = (sum P dx)^2 / (sum P  sum P dx^2),      d = d_C  sum P dx^2 / (dx_C  sum P dx).

Blocks that act as one count as one weight at their common centroid. Taken over whole bodies, whose
parts move by different amounts as they turn, sum P dx^2 is larger by their second moments.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import first_twice
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.path import Path
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import second_moments
from cvxlimit.scene import Scene
from cvxlimit.solution.kinematics import VISIBLE, corner_speeds

_LEVEL = 1e-6
"""Share of the live load that may act along gravity: a direction in a scene file has seven digits
or more."""


@dataclass(frozen=True)
class Oscillator:
    """The equivalent oscillator of a path's initial mechanism.

    Attributes
    ----------
    push : float
        Size of the live load, a horizontal acceleration, in multiples of gravity.
    weight : float
        Of the blocks that move, sum P.
    e_star : float
        Share of their mass that takes part.
    per_control : float
        Spectral displacement over that of the control point, d / d_C.
    """

    push: float
    weight: float
    e_star: float
    per_control: float


def oscillator(path: Path, groups: Iterable[Iterable[str]], own_inertia: bool) -> Oscillator:
    """The equivalent oscillator of a path's mechanism at rest; ``groups`` of block ids act as one,
    and ``own_inertia`` takes sum P dx^2 over whole bodies.

    Raises
    ------
    InputError
        For a path that starts displaced, a live load that is no horizontal acceleration, groups
        that do not move as one, and a control point that does not move along its direction.
    """
    scene = path.scene
    if path.initial is None:
        raise InputError(
            f"the code check is of a mechanism at rest, and the path of {scene.name!r} starts "
            "displaced: follow the structure as it was before"
        )
    found, (along, push) = path.initial.mechanism or {}, _push(scene)
    free = [scene.blocks[i] for i in scene.free]
    every = np.array([found.get(block.id, np.zeros(6)) for block in scene.blocks])
    rates, speed = every[scene.free], corner_speeds(scene, every)[scene.free]
    weight = np.array([block.weight for block in free])

    # Weights P that move, and their mean rates dx along the push.
    bodies = _bodies(scene.name, free, rates, speed, [[*group] for group in groups])
    together = np.array([weight[own].sum() for own in bodies])
    rate = np.array([weight[own] @ rates[own, :3] @ along for own in bodies]) / together
    total, first, second = together.sum(), together @ rate, together @ rate**2
    if own_inertia:
        # Over a body (dx + q . r)^2, where q = along x rotation and r is the place about its
        # centroid, in place of dx^2 of its weight.
        over = 0.0
        for i in (i for own in bodies for i in own):
            q, arms = np.cross(along, rates[i, 3:]), free[i].vertices - free[i].centroid
            over += weight[i] / free[i].volume * float(q @ second_moments(arms, free[i].faces) @ q)
            over += weight[i] * float(rates[i, :3] @ along) ** 2
        second = over

    # The rate dx_C of what the path measures as its displacement.
    if path.control is None:
        control = float(sum(weight * (rates[:, :3] @ along)) / scene.total_weight)
    else:
        block, direction = path.control
        control = float(found[block][:3] @ direction / np.linalg.norm(direction))
        if not control > 0.0:
            raise InputError(
                f"control block {block!r} does not move along {direction} in the initial "
                "mechanism: follow the path with another control"
            )
    e_star = first**2 / (total * second)
    return Oscillator(push, float(total), float(e_star), float(second / (control * first)))


def _push(scene: Scene) -> tuple[FloatArray, float]:
    """Direction and size of the live load: a horizontal acceleration, in multiples of gravity."""
    live, down = scene.live, scene.dead.gravity
    parts = (live.gravity, live.forces, live.points, live.pressures, live.weights, live.growing)
    push = np.array(live.acceleration or (0.0, 0.0, 0.0))
    size = float(np.linalg.norm(push))
    if any(parts) or down is None or not size > 0.0 or abs(push @ down) > _LEVEL * size:
        raise InputError(
            "the code check is of weights that are pushed sideways: the live load of scene "
            f"{scene.name!r} must be a horizontal acceleration and nothing else, and its dead "
            f"load have a gravity, got {live!r:.80}"
        )
    return push / size, size


def _bodies(
    scene_name: str, free: list[Block], rates: FloatArray, speed: FloatArray,
    groups: list[list[str]],
) -> list[list[int]]:  # fmt: skip
    """Numbers of the free blocks that count as one weight each: those of every group, and all
    others alone; without those that stand still."""
    place = {block.id: i for i, block in enumerate(free)}
    for name in (every := [name for group in groups for name in group]):
        if name not in place:
            raise InputError(f"groups name {name!r}, which is no free block of {scene_name!r}")
    if (twice := first_twice(every)) is not None:
        raise InputError(f"block {twice!r} is in two groups: name it once")
    bodies = [[place[name] for name in group] for group in groups if group]
    for own in bodies:  # each must move as its first block does
        at = np.array([free[i].centroid - free[own[0]].centroid for i in own])
        lead, turned = rates[own[0]], rates[own, 3:] - rates[own[0], 3:]
        off = np.linalg.norm(rates[own, :3] - lead[:3] - np.cross(lead[3:], at), axis=1)
        off += np.linalg.norm(turned, axis=1) * [free[i].size for i in own]
        if (worst := float(off.max())) > VISIBLE * speed.max():
            raise InputError(
                f"blocks {free[own[0]].id!r} and {free[own[int(off.argmax())]].id!r} of a group do "
                f"not move as one in the initial mechanism: they part by {worst / speed.max():.1%} "
                "of its fastest corner; leave one out"
            )
    bodies += [[i] for name, i in place.items() if name not in every]
    return [own for own in bodies if speed[own].max() > VISIBLE * speed.max()]
