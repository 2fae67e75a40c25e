"""Which joints and stones decide about the load factor."""

from __future__ import annotations

import numpy as np

import cvxlimit.plotting.look as look
from cvxlimit.plotting.annotations import Marking
from cvxlimit.plotting.contents import Bar, Drawing, Lines, Viewer, camera_for
from cvxlimit.plotting.registry import picture
from cvxlimit.results.movement import free_size, motion, still
from cvxlimit.results.sensitivity import NOTHING
from cvxlimit.solution import Solution

_LONGEST = 0.12
"""Of the structure's size: the arrow of the stone that counts most."""

_COLOUR = "#b3123c"
_FRICTION = "#8b2fc9"


@picture
def sensitivity(solution: Solution, *, viewer: Viewer = None) -> Drawing:
    """Which stones and joints decide: what the load factor gains by moves and by friction.

    Stones are the darker the more a move of theirs, the others staying, changes the load factor,
    and arrows say where to: along them it grows. Joints are outlined the wider the more friction in
    them counts. Less than 5 % of the most is not drawn.

    Parameters and errors as for :func:`mechanism`, and those of
    :meth:`cvxlimit.Solution.sensitivity`.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> type(solve(builtin_scene("arch")).plot("sensitivity", figsize=(3.4, 3.0))).__name__
    'SceneFigure'
    """
    scene, found = solution.scene, solution.sensitivity()
    moves = found.moves
    size = np.linalg.norm(moves, axis=1)
    most = float(size.max()) or 1.0
    drawn = np.flatnonzero(size > look.SLOW * most)
    centres = np.array([scene.blocks[i].centroid for i in drawn]).reshape(-1, 3)
    ends = np.stack([centres, centres + _LONGEST * free_size(scene) / most * moves[drawn]], axis=1)
    by_friction = np.abs(found.friction) * scene.contacts.friction / abs(found.factor or 1.0)
    largest = float(by_friction.max(initial=0.0))
    counts = (by_friction > look.SLOW * largest) & (largest > NOTHING)
    widths = look.THINNEST + (1.0 - look.THINNEST) * by_friction / (largest or 1.0)
    text = f"joint whose friction counts: {largest:.2g} % per 1 % at most"
    said = (
        f"derivatives by moves of single blocks: {size.max():.3g} per {scene.units.length} at most"
    )
    if counts.any():
        said += f"; 1 % more friction everywhere: {by_friction.sum():+.3g} %"
    return Drawing(
        scene,
        still(scene),
        camera_for(scene, motion(scene, solution), viewer),
        look.title(solution),
        said,
        colours=look.mixed(look.SPEED_STOPS, size / most),
        marking=Marking(scene.contacts, counts.astype(int), {1: _FRICTION}, {1: text}, widths),
        lines=Lines(ends, np.full(len(ends), 1.4), _COLOUR, "raises the load factor", heads=True),
        bar=Bar(look.SPEED_STOPS, "change by a move / largest"),
    )
