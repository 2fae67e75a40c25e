"""Where joints open and slide, on the undeformed structure."""

from __future__ import annotations

from cvxlimit.plotting.contents import Drawing, Viewer, camera_for
from cvxlimit.plotting.joints import moving_joints
from cvxlimit.plotting.look import PALE, block_colours, title
from cvxlimit.plotting.movement import motion, still
from cvxlimit.plotting.registry import picture
from cvxlimit.solution import Solution

CRACK = 2.2
"""Width of the widest crack, in lines of the mechanism's widest joint: nothing gapes there to be
seen by."""


@picture
def cracks(solution: Solution, *, viewer: Viewer = None) -> Drawing:
    """The crack pattern: joints that open, slide and twist, on the undeformed structure.

    Lines are as wide as the joints move. Parameters and errors as for :func:`mechanism`.
    """
    scene = solution.drawn_scene
    moving = motion(scene, solution)
    return Drawing(
        scene,
        still(scene),
        camera_for(scene, moving, viewer),
        title(solution),
        "crack pattern: joint lines as wide as they move in the mechanism",
        marking=moving_joints(scene, moving, CRACK),
        colours=block_colours(scene, still(scene), stone=PALE),
    )
