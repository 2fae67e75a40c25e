"""Pictures of what flows through joints: lines and dots over pale blocks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvxlimit.plotting.camera import thin_axis
from cvxlimit.plotting.contents import Drawing, Lines, Viewer, camera_for
from cvxlimit.plotting.look import PALE, block_colours, title
from cvxlimit.plotting.movement import motion, still
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

FloatArray = NDArray[np.float64]

FAINTEST = 0.004
"""Forces below this share of the largest are not drawn: a tenth of a line's width."""

DOTTED = 0.05
"""Pressure centres are marked where more than this share of the largest force passes: a wall of
many joints would be dots all over."""

_UPRIGHT = 0.1
"""A structure whose joints all lie within this (sine) of being across one plane is planar."""


def over_blocks(
    solution: Solution, viewer: Viewer, caption: str, lines: Lines, dots: FloatArray
) -> Drawing:
    """Blocks at rest behind lines and dots; a planar structure straight from the front."""
    scene = solution.drawn_scene
    return Drawing(
        scene,
        still(scene),
        camera_for(scene, motion(scene, solution), viewer or planar_front(scene)),
        title(solution),
        caption,
        colours=block_colours(scene, still(scene), stone=PALE),
        lines=lines,
        dots=dots,
    )


def planar_front(scene: Scene) -> Viewer:
    """Direction in which to look at a structure whose joints all lie across one plane."""
    thin = thin_axis(scene)
    across = np.abs(scene.contacts.axes[:, 2] @ thin).max(initial=0.0)
    push = np.abs(scene.live_forces[:, :3] @ thin).max(initial=0.0)
    is_planar = across < _UPRIGHT and push <= 1e-9 * np.abs(scene.live_forces).max(initial=0.0)
    return tuple((-thin).tolist()) if is_planar else None
