"""How compression flows."""

from __future__ import annotations

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.pressure import pressure_centres
from cvxlimit.plotting.contents import DOTTED, FAINTEST, Drawing, Lines, Viewer, over_blocks
from cvxlimit.plotting.registry import picture
from cvxlimit.plotting.strength import forces_of
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

THRUST_COLOUR = "#123f6b"


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
    return over_blocks(
        solution,
        viewer,
        f"thrust lines at collapse; the widest line carries {largest:.3g} {scene.units.force}",
        Lines(ends, 0.5 + 3.5 * size / largest, THRUST_COLOUR, "thrust"),
        place[found[:, 2] > DOTTED * float(found[:, 2].max(initial=0.0))],
    )


def thrust_lines(scene: Scene, found: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ends (k, 2, 3) and compressions (k,) of the thrust lines of contact forces (n, 6)."""
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
