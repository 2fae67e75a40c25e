"""What is drawn where scenes have strengths: crushed zones of contacts, and ties that yield.

Both come from a solution's contact forces alone. A contact crushes where the pressure that its
normal force and moments need is the strength: on the effective rectangle around the pressure
centre (Eq. 26), which no smaller one could bear.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.plotting.camera import Camera
from cvxlimit.plotting.movement import Motion, contact_forces, velocity_of
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]

CRUSHED_COLOUR, TIE_COLOUR, YIELDING_COLOUR = "#7a1010", "#5d6b82", "#0a7d4f"

_AT_STRENGTH = 1e-3
"""Share of the strength that may be missing where a contact or a tie counts as yielding."""

Overlay = Callable[["Axes", Camera], FloatArray]
"""Draws over a painted scene and returns the points (n, 2) that it takes."""


@dataclass(frozen=True, eq=False)
class Zone:
    """The effective rectangle of a contact that crushes, by its corners (4, 3)."""

    contact: int
    corners: FloatArray


def crushed_zones(scene: Scene, forces: FloatArray) -> list[Zone]:
    """Effective rectangles of contacts whose strength is used up, for forces (n, 6).

    Only rectangular contacts have one; ties have none.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> scene = builtin_scene("single-block").with_strength(compressive=200.0)
    >>> [zone.contact for zone in crushed_zones(scene, solve(scene).forces)]
    [0]
    """
    contacts = scene.contacts
    zones = []
    ties = len(scene.ties)
    for j in range(len(contacts) - ties):
        strength = float(contacts.compressive_strength[j])
        pressed = float(forces[j, COLUMN["N"]])
        if not (np.isfinite(strength) and contacts.is_rectangle[j] and pressed > 0.0):
            continue
        centre = np.array([-forces[j, COLUMN["M2"]], forces[j, COLUMN["M1"]]]) / pressed
        half = contacts.sides[j] / 2.0 - np.abs(centre)
        if (half > 0.0).all() and pressed < (1.0 - _AT_STRENGTH) * strength * 4.0 * half.prod():
            continue
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        flat = centre + signs * np.maximum(half, 0.0)
        points = contacts.origin[j] + flat @ contacts.axes[j, :2]
        zones.append(Zone(j, points))
    return zones


def yielding(scene: Scene, forces: FloatArray) -> NDArray[np.bool_]:
    """True (ties,) for ties whose tension is their yield force.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> scene = builtin_scene("single-block")
    >>> yielding(scene, solve(scene).forces).tolist()
    []
    """
    if not scene.ties:
        return np.zeros(0, dtype=bool)
    tension = -forces[-len(scene.ties) :, COLUMN["N"]]
    strength = np.array([tie.yield_force for tie in scene.ties])
    return np.asarray(tension >= (1.0 - _AT_STRENGTH) * strength)


def overlay(scene: Scene, solution: Solution, moving: Motion) -> Overlay | None:
    """What draws zones and ties where the mechanism has moved them; None if there are none."""
    forces = contact_forces(scene, solution)
    if forces is None:
        return None
    shapes = shapes_of(scene, forces, moving)
    if not shapes:
        return None

    def draw(axes: Axes, camera: Camera) -> FloatArray:
        taken = [np.empty((0, 2))]
        for shape in shapes:
            flat = camera.project(shape.points + shape.moves)[:, :2]
            if shape.is_zone:
                axes.fill(*flat.T, color=shape.colour, alpha=0.85, lw=2.0, zorder=6)
            else:
                axes.plot(*flat.T, "-o", color=shape.colour, lw=2.6, ms=4.0, zorder=6.5,
                          clip_on=False)  # fmt: skip
            taken.append(flat)
        _key(axes, sum(shape.is_zone for shape in shapes), yielding(scene, forces))
        return np.concatenate(taken)

    return draw


@dataclass(frozen=True, eq=False)
class Shape:
    """A crushed zone, or a tie as a line.

    Attributes
    ----------
    points, moves : (k, 3)
        Where it is, and how far the drawn mechanism takes it.
    colour, text : str
    is_zone : bool
    """

    points: FloatArray
    moves: FloatArray
    colour: str
    text: str
    is_zone: bool


def shapes_of(scene: Scene, forces: FloatArray, moving: Motion) -> list[Shape]:
    """Crushed zones, then ties, for forces (n, 6)."""

    def moves(points: FloatArray, blocks: list[int]) -> FloatArray:
        at = np.array(blocks)
        result: FloatArray = moving.scale * velocity_of(scene, moving.rates, points, at)
        return result

    result = []
    for zone in crushed_zones(scene, forces):
        text = f"crushed zone of {scene.contacts.names[zone.contact]}"
        shift = moves(zone.corners, [int(scene.contacts.a[zone.contact])] * len(zone.corners))
        result.append(Shape(zone.corners, shift, CRUSHED_COLOUR, text, True))
    place = {block.id: i for i, block in enumerate(scene.blocks)}
    for tie, yields in zip(scene.ties, yielding(scene, forces), strict=True):
        points = np.array([tie.start, tie.end])
        colour = YIELDING_COLOUR if yields else TIE_COLOUR
        text = f"tie {tie.a}-{tie.b} {'yields at' if yields else 'below'} {tie.yield_force:g}"
        shift = moves(points, [place[tie.a], place[tie.b]])
        result.append(Shape(points, shift, colour, text, False))
    return result


def _key(axes: Axes, zones: int, yields: NDArray[np.bool_]) -> None:
    """A line for each kind that is there, in the corner of the picture."""
    texts = [
        (CRUSHED_COLOUR, f"crushed zone ({zones})", zones),
        (YIELDING_COLOUR, f"tie yields ({int(yields.sum())})", int(yields.sum())),
        (TIE_COLOUR, f"tie ({int((~yields).sum())})", int((~yields).sum())),
    ]
    shown = [(colour, text) for colour, text, count in texts if count]
    for k, (colour, text) in enumerate(shown):
        axes.text(
            0.99, 0.99 - 0.045 * k, text, color=colour, fontsize=8.5, weight="bold",
            transform=axes.transAxes, ha="right", va="top", zorder=8,
        )  # fmt: skip
