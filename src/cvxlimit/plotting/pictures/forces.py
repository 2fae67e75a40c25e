"""What each joint transmits, and how compression flows from joint to joint."""

from __future__ import annotations

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import pressure_centres
from cvxlimit.plotting.camera import thin_axis
from cvxlimit.plotting.contents import Drawing, Lines, Viewer, at_rest
from cvxlimit.plotting.movement import free_size
from cvxlimit.plotting.registry import picture
from cvxlimit.plotting.strength import forces_of
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

FORCE_COLOUR, THRUST_COLOUR = "#1b5e9c", "#123f6b"

LONGEST_FORCE = 0.16
"""Length of the largest resultant, relative to the free blocks' size."""

FAINTEST = 0.004
"""Forces below this share of the largest are not drawn: a tenth of a line's width."""

DOTTED = 0.05
"""Pressure centres are marked where more than this share of the largest force passes: a wall of
many joints would be dots all over."""

_UPRIGHT = 0.1
"""A structure whose joints all lie within this (sine) of being across one plane is planar."""


@picture
def forces(solution: Solution, *, viewer: Viewer = None) -> Drawing:
    """Resultants: the force that each joint transmits, through its pressure centre.

    Parameters and errors as for :func:`mechanism`; besides, a solution must have forces. Planar
    structures are seen straight from the front unless ``viewer`` says otherwise.
    """
    scene = solution.drawn_scene
    found = forces_of(scene, solution)
    _, place = pressure_centres(scene.contacts, found)
    vectors = np.einsum("nk,nkx->nx", found[:, :3], scene.contacts.axes)
    size = np.linalg.norm(vectors, axis=1)
    largest = float(size.max(initial=0.0)) or 1.0
    shown = np.flatnonzero((size > FAINTEST * largest) & np.isfinite(place).all(axis=1))
    place, size = place[shown], size[shown]
    half = 0.5 * LONGEST_FORCE * free_size(scene) * vectors[shown] / largest
    ends = np.stack([place - half, place + half], axis=1)
    return at_rest(
        solution,
        _front(scene, viewer),
        f"forces in the joints; the longest line is {largest:.3g} {scene.units.force}",
        lines=Lines(ends, 0.7 + 1.8 * size / largest, FORCE_COLOUR, "resultant"),
        dots=place[size > DOTTED * largest],
    )


@picture
def thrust(solution: Solution, *, viewer: Viewer = None) -> Drawing:
    """Thrust lines: how compression flows from joint to joint through the pressure centres.

    Where a block has two loaded joints the line joins their pressure centres, as in an arch; where
    it has more, lines meet in the mean of them, weighted by force. Lines are as wide as the force.
    Parameters and errors as for :func:`forces`.
    """
    scene = solution.drawn_scene
    found = forces_of(scene, solution)
    ends, size = thrust_lines(scene, found)
    largest = float(size.max(initial=0.0)) or 1.0
    _, place = pressure_centres(scene.contacts, found)
    return at_rest(
        solution,
        _front(scene, viewer),
        f"thrust lines at collapse; the widest line carries {largest:.3g} {scene.units.force}",
        lines=Lines(ends, 0.5 + 3.5 * size / largest, THRUST_COLOUR, "thrust"),
        dots=place[found[:, 2] > DOTTED * float(found[:, 2].max(initial=0.0))],
    )


def thrust_lines(scene: Scene, found: FloatArray) -> tuple[FloatArray, FloatArray]:
    contacts = scene.contacts
    _, place = pressure_centres(contacts, found)
    normal = found[:, 2]
    loaded = np.flatnonzero(
        (normal > FAINTEST * float(normal.max(initial=0.0))) & np.isfinite(place).all(axis=1)
    )
    ends: list[FloatArray] = []
    size: list[float] = []
    for block in scene.free.tolist():
        own = loaded[(contacts.a[loaded] == block) | (contacts.b[loaded] == block)]
        if len(own) == 2:
            ends.append(place[own])
            size.append(float(normal[own].mean()))
        elif len(own):
            hub = normal[own] @ place[own] / normal[own].sum()
            ends += [np.stack([place[j], hub]) for j in own.tolist()]
            size += normal[own].tolist()
    return np.array(ends).reshape(-1, 2, 3), np.array(size)


def _front(scene: Scene, viewer: Viewer) -> Viewer:
    thin = thin_axis(scene)
    across = np.abs(scene.contacts.axes[:, 2] @ thin).max(initial=0.0)
    push = np.abs(scene.live_forces[:, :3] @ thin).max(initial=0.0)
    is_planar = across < _UPRIGHT and push <= 1e-9 * np.abs(scene.live_forces).max(initial=0.0)
    return viewer or (tuple((-thin).tolist()) if is_planar else None)
