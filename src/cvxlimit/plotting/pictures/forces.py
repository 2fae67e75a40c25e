"""What each joint transmits."""

from __future__ import annotations

import numpy as np

from cvxlimit.geometry.pressure import pressure_centres
from cvxlimit.plotting.contents import DOTTED, FAINTEST, Drawing, Lines, Viewer, over_blocks
from cvxlimit.plotting.movement import free_size
from cvxlimit.plotting.registry import picture
from cvxlimit.plotting.strength import forces_of
from cvxlimit.solution import Solution

FORCE_COLOUR = "#1b5e9c"

LONGEST_FORCE = 0.16
"""Length of the largest resultant, relative to the free blocks' size."""


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
    return over_blocks(
        solution,
        viewer,
        f"forces in the joints; the longest line is {largest:.3g} {scene.units.force}",
        Lines(ends, 0.7 + 1.8 * size / largest, FORCE_COLOUR, "resultant"),
        place[size > DOTTED * largest],
    )
