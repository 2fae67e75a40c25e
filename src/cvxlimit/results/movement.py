"""How a mechanism moves blocks and contacts: displacements, speeds, and what each contact does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.base.checks import finite_vector, of_type
from cvxlimit.errors import InputError, ModelError
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solution import Solution
from cvxlimit.solution.kinematics import (
    VISIBLE,
    ContactMotion,
    contact_motion,
    corner_speeds,
    relative_rates,
    velocity_of,
)

DEFORMATION = 0.09
"""Largest drawn corner displacement, as a fraction of the free blocks' size: clearly seen, and
small enough to recognise the structure."""

LARGEST_ROTATION = 0.4
"""Largest drawn rotation in radians. Linear rates make a block grow by sqrt(1 + r^2): 8 % here;
more would look like a drawing error when one small block topples off a large structure."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A mechanism made ready for drawing.

    Attributes
    ----------
    rates : (n_blocks, 6)
        ux, uy, uz, rx, ry, rz of all blocks in scene order; zero for supports.
    largest : float
        Largest corner speed of all blocks; 0 without a mechanism.
    speed : (n_blocks,)
        Largest corner speed of each block, relative to ``largest``.
    scale : float
        Drawn displacement per rate, see :data:`DEFORMATION`; 0 without a mechanism.
    contacts : ContactMotion
    is_solved : bool
        False for a scene that is drawn before it is solved.
    is_finite : bool
        True if ``rates`` are displacements: translations of centroids and rotation vectors, by
        which blocks are moved as they are, in place of rates that are drawn enlarged.
    """

    rates: FloatArray
    largest: float
    speed: FloatArray
    scale: float
    contacts: ContactMotion
    is_solved: bool = True
    is_finite: bool = False

    @property
    def moves(self) -> bool:
        """False when there is no mechanism to draw."""
        return self.largest > 0.0


def motion(scene: Scene, solution: Solution) -> Motion:
    """Rates, speeds, drawing scale and contact classification of ``solution``'s mechanism.

    Raises
    ------
    InputError
        If the mechanism's blocks are not the scene's free blocks, or there is no scene or solution.
    """
    check_scene(scene)
    of_type(solution, Solution, "solution must be a Solution", "solve(scene) makes one")
    rates = block_rates(scene, solution)
    contacts = partial(contact_motion, scene.contacts, relative_rates(scene, rates))
    speeds = corner_speeds(scene, rates)
    largest = float(speeds.max())
    if not largest > 0.0:
        return Motion(rates, 0.0, np.zeros(len(rates)), 0.0, contacts(0.0))
    turning = float(np.linalg.norm(rates[:, 3:], axis=1).max())
    scale = DEFORMATION * free_size(scene) / largest
    if scale * turning > LARGEST_ROTATION:
        scale = LARGEST_ROTATION / turning
    return Motion(rates, largest, speeds / largest, scale, contacts(VISIBLE * largest))


_NOTHING = np.empty(0)
_NO_CONTACTS = ContactMotion(_NOTHING, _NOTHING, _NOTHING, _NOTHING, np.empty(0, dtype=np.int64))


def still(scene: Scene) -> Motion:
    """A motion without movement. It does not ask for contacts, so that a scene whose geometry is
    refused can be drawn."""
    count = len(scene.blocks)
    return Motion(np.zeros((count, 6)), 0.0, np.zeros(count), 0.0, _NO_CONTACTS, is_solved=False)


def moved_by(scene: Scene, displacements: Mapping[str, FloatArray]) -> Motion:
    """The motion to a displaced configuration. ``displacements`` (6,) by block id are the
    translation of the centroid and the rotation vector; blocks that are not named stay. The speed
    of a block is the distance that its farthest corner moves."""
    ways = np.array([displacements.get(block.id, np.zeros(6)) for block in scene.blocks])
    corners = [block.vertices for block in scene.blocks]
    owner = np.repeat(np.arange(len(corners)), [*map(len, corners)])
    points = np.concatenate(corners)
    far = np.linalg.norm(points_moved(scene, ways, points, owner) - points, axis=1)
    speed = np.zeros(len(corners))
    np.maximum.at(speed, owner, far)
    largest = float(speed.max())
    share = speed / largest if largest > 0.0 else speed
    return Motion(ways, largest, share, 1.0, _NO_CONTACTS, is_finite=True)


def points_moved(scene: Scene, ways: FloatArray, points: FloatArray, block: IntArray) -> FloatArray:
    """Points (p, 3), each carried by a block (p,), after displacements (n_blocks, 6)."""
    centroids = np.array([each.centroid for each in scene.blocks])[block]
    turned = np.einsum("pij,pj->pi", rotation(ways[:, 3:])[block], points - centroids)
    return np.asarray(centroids + ways[block, :3] + turned)


def free_bounds(scene: Scene) -> FloatArray:
    """Lowest and highest x, y, z (2, 3) of all blocks that are not supports."""
    points = np.concatenate([scene.blocks[i].vertices for i in scene.free])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def free_size(scene: Scene) -> float:
    low, high = free_bounds(scene)
    return float(np.linalg.norm(high - low))


def displaced(scene: Scene, moving: Motion, points: FloatArray, block: IntArray) -> FloatArray:
    """Where points (p, 3) of blocks (p,) are drawn."""
    if moving.is_finite:
        return points_moved(scene, moving.rates, points, block)
    return points + moving.scale * velocity_of(scene, moving.rates, points, block)


def block_rates(scene: Scene, solution: Solution) -> FloatArray:
    """Rates ux, uy, uz, rx, ry, rz (n_blocks, 6) of the mechanism, in the order of the scene."""
    rates = np.zeros((len(scene.blocks), 6))
    if solution.mechanism is None:
        return rates
    free = [scene.blocks[i].id for i in scene.free]
    missing = sorted(set(free) - set(solution.mechanism))
    place = {block.id: i for i, block in enumerate(scene.blocks)}  # supports may settle
    strange = sorted(set(solution.mechanism) - set(place))
    if missing or strange:
        fault = f"lacks block {missing[0]!r}" if missing else f"names block {strange[0]!r}"
        raise InputError(
            f"the mechanism {fault}: the solution of {solution.scene_name!r} does not belong to "
            f"scene {scene.name!r}"
        )
    for name, own in solution.mechanism.items():
        rates[place[name]] = own
    if not np.isfinite(rates).all():
        bad = scene.blocks[int(np.flatnonzero(~np.isfinite(rates).all(axis=1))[0])]
        raise InputError(f"the mechanism's rates of block {bad.id!r} must be finite")
    return rates


def rotation(vector: FloatArray) -> FloatArray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3): Rodrigues' formula."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(np.asarray(vector), -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
    half = np.sinc(angle / (2.0 * np.pi))  # sinc keeps all digits near 0
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * half**2 * cross @ cross)


def motions_of(scene: Scene, moved: Sequence[Mapping[str, FloatArray]]) -> list[Motion]:
    """The motion to each configuration. All have the colours of the one that moved most, so that a
    block keeps its colour through a film."""
    motions = [moved_by(scene, each) for each in moved]
    largest = max(motions, key=lambda moving: moving.largest)
    return [replace(moving, speed=largest.speed) for moving in motions]


def checked_control(scene: Scene, control: Any) -> tuple[str, tuple[float, float, float]]:
    """A free block and the direction in which its displacement is told."""
    try:
        block, direction = control
    except (TypeError, ValueError) as error:
        raise ModelError(f"control must be (block id, direction), got {control!r}") from error
    free = [scene.blocks[i].id for i in scene.free]
    if block not in free:
        raise ModelError(f"control names {block!r}, which is no free block of {scene.name!r}")
    x, y, z = finite_vector(direction, 3, "direction of the control point").tolist()
    if not (x or y or z):
        raise ModelError("direction of the control point must not be zero, got (0, 0, 0)")
    return block, (x, y, z)
