"""What is drawn where scenes have strengths: crushed zones, and ties that yield.

A contact crushes where the pressure that its normal force and moments need is the strength: on the
effective rectangle around the pressure centre (Eq. 26), which no smaller one could bear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.geometry.pressure import pressure_centres
from cvxlimit.plotting.movement import Motion, contact_forces, displaced
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

CRUSHED_COLOUR, TIE_COLOUR, YIELDING_COLOUR = "#7a1010", "#5d6b82", "#0a7d4f"

_AT_STRENGTH = 1e-3
"""Share of the strength that may be missing where a contact or a tie counts as yielding."""


@dataclass(frozen=True, eq=False)
class Zone:
    """The effective rectangle of a contact that crushes, by its corners (4, 3)."""

    contact: int
    corners: FloatArray


def crushed_zones(scene: Scene, forces: FloatArray) -> list[Zone]:
    """Effective rectangles of contacts whose strength is used up, for forces (n, 6); only
    rectangular contacts have one."""
    c, normal = scene.contacts, forces[:, COLUMN["N"]]
    centre, _ = pressure_centres(c, forces)
    half = c.sides / 2.0 - np.abs(centre)
    is_limited = np.isfinite(c.compressive_strength)
    strength = np.where(is_limited, c.compressive_strength, 0.0)
    can_crush = is_limited & c.is_rectangle & ~np.isnan(half[:, 0])
    can_crush[len(c) - len(scene.ties) :] = False
    most = (1.0 - _AT_STRENGTH) * strength * 4.0 * half.prod(axis=1)
    is_full = (half <= 0.0).any(axis=1) | (normal >= most)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return [
        Zone(j, c.origin[j] + (centre[j] + signs * np.maximum(half[j], 0.0)) @ c.axes[j, :2])
        for j in np.flatnonzero(can_crush & is_full).tolist()
    ]


def yielding(scene: Scene, forces: FloatArray) -> NDArray[np.bool_]:
    """True (ties,) for ties whose tension is their yield force."""
    if not scene.ties:
        return np.zeros(0, dtype=bool)
    tension = -forces[-len(scene.ties) :, COLUMN["N"]]
    strength = np.array([tie.yield_force for tie in scene.ties])
    return np.asarray(tension >= (1.0 - _AT_STRENGTH) * strength)


@dataclass(frozen=True, eq=False)
class Shape:
    """A crushed zone, or a tie as a line: its ``points`` (k, 3), and how far the drawn mechanism
    ``moves`` them; what it is, and what the legend calls its kind."""

    points: FloatArray
    moves: FloatArray
    colour: str
    text: str
    label: str

    @property
    def is_zone(self) -> bool:
        return len(self.points) > 2


def shapes_of(scene: Scene, solution: Solution, moving: Motion) -> list[Shape]:
    forces = contact_forces(scene, solution)
    if forces is None:
        return []

    def shape(points: FloatArray, blocks: list[int], colour: str, text: str, label: str) -> Shape:
        moves = displaced(scene, moving, points, np.array(blocks)) - points
        return Shape(points, moves, colour, text, label)

    result = []
    contacts = scene.contacts
    for zone in crushed_zones(scene, forces):
        text = f"crushed zone of {contacts.names[zone.contact]}"
        blocks = [int(contacts.a[zone.contact])] * len(zone.corners)
        result.append(shape(zone.corners, blocks, CRUSHED_COLOUR, text, "crushed zone"))
    place = {block.id: i for i, block in enumerate(scene.blocks)}
    for tie, yields in zip(scene.ties, yielding(scene, forces), strict=True):
        points = np.array([tie.start, tie.end])
        colour = YIELDING_COLOUR if yields else TIE_COLOUR
        text = f"tie {tie.a}-{tie.b} {'yields at' if yields else 'below'} {tie.yield_force:g}"
        label = "tie yields" if yields else "tie"
        result.append(shape(points, [place[tie.a], place[tie.b]], colour, text, label))
    return result
