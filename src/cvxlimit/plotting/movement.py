"""How a mechanism moves blocks and contacts: displacements, speeds, and what each contact does."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.checks import of_type
from cvxlimit.errors import InputError
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solution import Solution

DEFORMATION = 0.09
"""Largest drawn corner displacement, as a fraction of the free blocks' size: clearly seen, and
small enough to recognise the structure."""

LARGEST_ROTATION = 0.4
"""Largest drawn rotation in radians. Linear rates make a block grow by sqrt(1 + r^2): 8 % here;
more would look like a drawing error when one small block topples off a large structure."""

VISIBLE = 0.01
"""Contact rates below this fraction of the largest corner speed are not marked: at the drawn
scale they come to a thousandth of the structure's size, one pixel of the picture. The flow-rule
error of a certified mechanism is orders of magnitude smaller."""


FACET_DILATION = 2.0**0.5
"""Sliding on K circumscribed facets dilates up to 1 / cos(pi / K) more than on the cone; K >= 4."""


class ContactKind(IntEnum):
    """What a contact does in a mechanism."""

    CLOSED = 0
    OPENS = 1
    SLIDES = 2
    TWISTS = 3


@dataclass(frozen=True, eq=False)
class ContactMotion:
    """Relative rates (block b against block a) at n contacts with m corners in all.

    Attributes
    ----------
    opening : (m,)
        Rate along the contact normal at every corner; positive opens.
    slip : (n,)
        Largest rate in the contact plane over the corners.
    twist : (n,)
        Rotation rate about the contact normal, signed.
    widest : (n,)
        Largest opening over the corners.
    kind : (n,)
        :class:`ContactKind` codes.
    """

    opening: FloatArray
    slip: FloatArray
    twist: FloatArray
    widest: FloatArray
    kind: IntArray


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
    """

    rates: FloatArray
    largest: float
    speed: FloatArray
    scale: float
    contacts: ContactMotion
    is_solved: bool = True

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
    rates = _block_rates(scene, solution)
    speeds = np.array([
        np.linalg.norm(r[:3] + np.cross(r[3:], b.vertices - b.centroid), axis=1).max()
        for b, r in zip(scene.blocks, rates, strict=True)
    ])  # fmt: skip
    largest = float(speeds.max())
    if not largest > 0.0:
        return Motion(rates, 0.0, np.zeros(len(rates)), 0.0, contact_motion(scene, rates, 0.0))
    turning = float(np.linalg.norm(rates[:, 3:], axis=1).max())
    scale = DEFORMATION * free_size(scene) / largest
    if scale * turning > LARGEST_ROTATION:
        scale = LARGEST_ROTATION / turning
    return Motion(
        rates, largest, speeds / largest, scale, contact_motion(scene, rates, VISIBLE * largest)
    )


def still(scene: Scene) -> Motion:
    """No movement; nothing is asked about contacts, so that a refused scene can be drawn."""
    nothing = np.empty(0)
    contacts = ContactMotion(nothing, nothing, nothing, nothing, np.empty(0, dtype=np.int64))
    count = len(scene.blocks)
    return Motion(np.zeros((count, 6)), 0.0, np.zeros(count), 0.0, contacts, is_solved=False)


def free_bounds(scene: Scene) -> FloatArray:
    points = np.concatenate([scene.blocks[i].vertices for i in scene.free])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def free_size(scene: Scene) -> float:
    low, high = free_bounds(scene)
    return float(np.linalg.norm(high - low))


def velocity_of(scene: Scene, rates: FloatArray, points: FloatArray, block: IntArray) -> FloatArray:
    """Rate u + r x (p - centroid) of ``points`` (p, 3), each carried by a ``block`` (p,)."""
    centroids = np.array([b.centroid for b in scene.blocks])[block]
    return np.asarray(rates[block, :3] + np.cross(rates[block, 3:], points - centroids))


def side_rates(scene: Scene, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    c = scene.contacts
    one, other = (
        velocity_of(scene, rates, c.corner_points, block[c.corner_contact]) for block in (c.a, c.b)
    )
    return one, other


def displaced(scene: Scene, moving: Motion, points: FloatArray, block: IntArray) -> FloatArray:
    return points + moving.scale * velocity_of(scene, moving.rates, points, block)


def contact_motion(scene: Scene, rates: FloatArray, threshold: float) -> ContactMotion:
    """Relative rates at all contacts, and what each does.

    It is closed when no corner's rate exceeds ``threshold``. Associated sliding dilates: a slip s
    lifts the contact by friction times s. A contact slides or twists when its slip is at least the
    opening that this leaves unexplained, and some corner opens by no more than the dilation (times
    :data:`FACET_DILATION`). Any other that moves opens. It twists, and does not slide, when the
    centre it turns about is no farther off than a corner.
    """
    c = scene.contacts
    j = c.corner_contact
    one, other = side_rates(scene, rates)
    local = np.einsum("mik,mk->mi", c.axes[j], other - one)
    opening = local[:, 2]
    slip = -c.corner_minimum(-np.linalg.norm(local[:, :2], axis=1))
    twist = np.einsum("nk,nk->n", c.axes[:, 2], rates[c.b, 3:] - rates[c.a, 3:])
    turn = twist[j, None] * np.stack([-c.corner_xy[:, 1], c.corner_xy[:, 0]], axis=1)
    centre_slip = np.linalg.norm((local[:, :2] - turn)[c.corner_start[:-1]], axis=1)
    dilation = c.friction * np.maximum(centre_slip, c.torsion_arm * np.abs(twist))
    widest = -c.corner_minimum(-opening)
    reach = -c.corner_minimum(-np.linalg.norm(c.corner_xy, axis=1))
    carried = c.corner_minimum(opening) <= FACET_DILATION * dilation + threshold
    shears = (slip > threshold) & (slip >= widest - dilation) & carried
    kind = np.full(len(c), ContactKind.CLOSED, dtype=np.int64)
    kind[widest > threshold] = ContactKind.OPENS
    kind[shears] = ContactKind.SLIDES
    kind[shears & (centre_slip <= np.abs(twist) * reach)] = ContactKind.TWISTS
    return ContactMotion(opening, slip, twist, widest, kind)


def contact_forces(scene: Scene, solution: Solution) -> FloatArray | None:
    """The solution's forces (n, 6), None if it has none; refused unless one row per contact."""
    if solution.forces is not None and solution.forces.shape != (len(scene.contacts), 6):
        raise InputError(
            f"the solution of {solution.scene!r} has forces of shape {solution.forces.shape}, "
            f"but scene {scene.name!r} has {len(scene.contacts)} contacts: it does not belong to it"
        )
    return solution.forces


def _block_rates(scene: Scene, solution: Solution) -> FloatArray:
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
            f"the mechanism {fault}: the solution of {solution.scene!r} does not belong to "
            f"scene {scene.name!r}"
        )
    for name, own in solution.mechanism.items():
        rates[place[name]] = own
    if not np.isfinite(rates).all():
        bad = scene.blocks[int(np.flatnonzero(~np.isfinite(rates).all(axis=1))[0])]
        raise InputError(f"the mechanism's rates of block {bad.id!r} must be finite")
    return rates
