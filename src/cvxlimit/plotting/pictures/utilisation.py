"""How much of its strength each joint uses."""

from __future__ import annotations

import numpy as np

from cvxlimit.plotting.annotations import Marking
from cvxlimit.plotting.contents import Bar, Drawing, Viewer, at_rest
from cvxlimit.plotting.look import USE_STOPS, USE_TEXT, used_colour
from cvxlimit.plotting.registry import picture
from cvxlimit.plotting.strength import share_used
from cvxlimit.solution import Solution

LEVELS = 32
"""Colours that utilisation is told apart by: more than eyes can."""


@picture
def utilisation(
    solution: Solution, *, surface: str | None = None, viewer: Viewer = None
) -> Drawing:
    """How much of its strength each joint uses: joint lines from light (nothing) to dark (all).

    Parameters
    ----------
    solution, viewer
        As for :func:`mechanism`; a solution must have forces.
    surface : str or None
        ``"rocking"``, ``"sliding"``, ``"torsion"``, ``"torsion-shear"``, one of those that were
        solved with, and with interaction ``"torsion-shear-bending"`` (Eq. 30); None is the largest
        of those that were solved with.
    """
    scene = solution.drawn_scene
    used = share_used(solution, scene, surface)
    steps = np.clip(np.nan_to_num(used) * LEVELS, 0, LEVELS - 1).astype(np.int64)
    level = np.where(np.isnan(used), 0, 1 + steps)
    colours = {1 + i: used_colour((i + 0.5) / LEVELS) for i in range(LEVELS)}
    return at_rest(
        solution,
        viewer,
        f"strength in use at collapse, {surface or 'the most of all surfaces'}",
        marking=Marking(scene.contacts, level, colours),
        bar=Bar(USE_STOPS, USE_TEXT),
    )
