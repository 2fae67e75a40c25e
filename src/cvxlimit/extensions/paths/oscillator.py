"""The equivalent oscillator of a mechanism: which share of its mass takes part, and how it moves.

A mechanism moves weights P by horizontal rates dx along a push, and the control point by dx_C. The
oscillator of one degree of freedom with the same kinetic energy has the share e* of their mass, and
a displacement d that goes with that of the control point, d_C:

    e* = (sum P dx)^2 / (sum P  sum P dx^2),      d = d_C  sum P dx^2 / (dx_C  sum P dx).

Blocks that act as one count as one weight at their common centroid. Taken over whole bodies, whose
parts move by different amounts as they turn, sum P dx^2 is larger by their second moments.

The load factor, the weights and the rates of an oscillator are of one mechanism. A path has
friction at points and :func:`cvxlimit.solve` over whole joints, so that they may begin to move
otherwise; and what only slides takes part with all its mass, so that it may have the least
acceleration alpha / e* at a load factor that is not the least (:mod:`.sliding`). Then there are
several.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import first_twice
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.path import Path
from cvxlimit.extensions.paths.resting import REACH, Rest
from cvxlimit.extensions.paths.sliding import sliding
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, second_moments
from cvxlimit.model.statics import DOF
from cvxlimit.scene import Scene
from cvxlimit.solution.kinematics import VISIBLE, corner_speeds

_SAME = 5e-4
"""Share by which load factors, weights and e* of two mechanisms may differ that are one: what shows
as 0.1 %."""

OF_PATH = "of the path, friction at points"
OF_SOLVE = "of solve, friction over whole joints"
OF_SLIDING = "of what only slides"


@dataclass(frozen=True)
class Oscillator:
    """The equivalent oscillator of one mechanism.

    Attributes
    ----------
    of : str
        Whose mechanism it is, in words.
    alpha : float
        Load factor at which it begins to move.
    push : float
        Size of the live load, a horizontal acceleration, in multiples of gravity.
    weight : float
        Of the blocks that move, sum P.
    e_star : float
        Share of their mass that takes part.
    per_control : float
        Spectral displacement over that of the control point, d / d_C; NaN where that does not move
        along its direction.
    """

    of: str
    alpha: float
    push: float
    weight: float
    e_star: float
    per_control: float

    @property
    def share(self) -> float:
        """Spectral acceleration without confidence factor, over gravity: alpha / e*."""
        return self.push * self.alpha / self.e_star

    def is_like(self, other: Oscillator) -> bool:
        """Whether both have the same weights and the same share of them that takes part."""
        both = (self.weight / other.weight, self.e_star / other.e_star)
        return max(abs(each - 1.0) for each in both) <= _SAME


def oscillators(
    path: Path, groups: Iterable[Iterable[str]], own_inertia: bool
) -> tuple[Oscillator, ...]:
    """The equivalent oscillator of the mechanism by which a path begins to move; behind it that of
    :func:`cvxlimit.solve` if it is another, and that of what only slides if its acceleration is the
    least. ``groups`` of block ids act as one, ``own_inertia`` takes sum P dx^2 over whole bodies.

    Raises
    ------
    InputError
        For a path that starts displaced, a live load that is no horizontal acceleration, groups
        that do not move as one, and a control point that does not move along its direction.
    """
    scene, initial = path.scene, path.initial
    every = [[*group] for group in groups]
    if initial is None:
        raise InputError(
            f"the code check is of a mechanism at rest, and the path of {scene.name!r} starts "
            "displaced: follow the structure as it was before"
        )
    check_push(scene)
    rest = Rest(scene, REACH * scene.contacts.typical_size, path.flow, path.stretch)
    first, alone = float(path.load_factor[0]), initial.load_factor

    def one(of: str, alpha: float, rates: FloatArray) -> Oscillator:
        return _oscillator(path, of, alpha, rates, every, own_inertia)

    known, none = initial.mechanism or {}, np.zeros(DOF)
    rates = np.array([known.get(scene.blocks[i].id, none) for i in scene.free])
    at_rest, own = one(OF_SOLVE, alone or first, rates), rest.first_rates()
    begins = at_rest if own is None else one(OF_PATH, first, own)
    if begins.is_like(at_rest):  # one mechanism, of which solve has the finer rates
        begins = replace(at_rest, of=OF_PATH, alpha=first)
    if not begins.per_control > 0.0:
        block, direction = path.control or ("", ())
        raise InputError(
            f"control block {block!r} does not move along {direction} in the mechanism by which "
            "the path begins: follow the path with another control"
        )
    found = [begins]
    if not begins.is_like(at_rest) or abs(first - at_rest.alpha) > _SAME * abs(first):
        found.append(at_rest)
    # What slides: its blocks and groups each for themselves, and all of it as one body, which any
    # joint that is no stronger than others may cut at the same load factor.
    ids = [scene.blocks[i].id for i in scene.free]
    own_bodies = [[ids.index(name) for name in group] for group in every if group]
    bodies = (own_bodies, [[*range(len(ids))]])
    both = (sliding(rest.first_increment(), each) for each in bodies)
    slides = [one(OF_SLIDING, *mechanism) for mechanism in both if mechanism is not None]
    least = min(slides, key=lambda each: each.share, default=begins)
    if least.share < (1.0 - _SAME) * min(each.share for each in found):
        found.append(least)
    return tuple(found)


def _oscillator(
    path: Path, of: str, alpha: float, rates: FloatArray, groups: list[list[str]],
    own_inertia: bool,
) -> Oscillator:  # fmt: skip
    """The oscillator of a mechanism of ``rates`` (free blocks, 6)."""
    scene, (along, push) = path.scene, check_push(path.scene)
    free = [scene.blocks[i] for i in scene.free]
    every = np.zeros((len(scene.blocks), DOF))
    every[scene.free] = rates
    speed = corner_speeds(scene, every)[scene.free]
    weight = np.array([block.weight for block in free])

    # Weights P that move, and their mean rates dx along the push.
    bodies = _bodies(scene.name, free, rates, speed, groups)
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
        way = every[[each.id for each in scene.blocks].index(block), :3] @ direction
        control = float(way / np.linalg.norm(direction))
    per_control = second / (control * first) if control > 0.0 else np.nan
    e_star = first**2 / (total * second)
    return Oscillator(of, alpha, push, float(total), float(e_star), float(per_control))


def check_push(scene: Scene) -> tuple[FloatArray, float]:
    """Direction and size of the live load: a horizontal acceleration, in multiples of gravity.

    Raises
    ------
    InputError
        For any other live load.
    """
    live, down = scene.live, scene.dead.gravity
    push = np.array(live.acceleration or (0.0, 0.0, 0.0))
    size = float(np.linalg.norm(push))
    others = ("gravity", "forces", "points", "pressures", "weights", "growing")
    has = [name for name in others if getattr(live, name)]
    wrong = f"it has {', '.join(has)}" if has else ""
    if not wrong and not size > 0.0:
        wrong = "it has no acceleration"
    elif not wrong and down is None:
        wrong = "its dead load has no gravity"
    elif not wrong and abs(push @ down) > RELATIVE_TOLERANCE * size:
        wrong = f"its acceleration {tuple(push.round(6).tolist())} is not horizontal"
    if wrong:
        raise InputError(
            "the code check is of weights that are pushed sideways: the live load of scene "
            f"{scene.name!r} must be a horizontal acceleration and nothing else, and {wrong}: "
            "follow the path without a check, and put loads that stay into the dead load"
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
