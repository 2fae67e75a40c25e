"""How the structure falls, and where its joints open and slide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cvxlimit.base.checks import positive
from cvxlimit.plotting.annotations import annotated, shapes_of, without_live_load
from cvxlimit.plotting.contents import Bar, Drawing, Viewer, at_rest, camera_for
from cvxlimit.plotting.look import SLOW, SPEED_TEXT, moving_joints, title
from cvxlimit.plotting.registry import picture
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import Motion, motion
from cvxlimit.scene import Scene
from cvxlimit.solution import LOAD_FACTOR, Solution
from cvxlimit.solution.kinematics import ContactKind

CRACK = 1.8
"""Factor on the widths of lines in the crack pattern: nothing is displaced there, so that lines
alone show where joints gape."""


@picture
def mechanism(solution: Solution, *, magnification: float = 1.0, viewer: Viewer = None) -> Drawing:
    """How the structure falls: displaced blocks by speed, and what the joints do.

    Joints that open, slide or twist are outlined, the wider the faster; the slow ones are not, so
    that many small slips do not hide what fails. The caption says which count as slow.

    Parameters
    ----------
    solution : Solution
        With its scene.
    magnification : float
        Times the displacements that are drawn otherwise, a small share of the structure's size:
        rates have no size of their own. What the largest one comes to is said on the picture.
    viewer : (3,) or None
        Direction from the scene towards the viewer; chosen from the movement if None.

    Raises
    ------
    InputError
        For a solution without its scene, or a magnification that is not above 0.
    """
    return mechanism_of(solution.scene, solution, magnification, viewer)


def mechanism_of(
    scene: Scene, solution: Solution, magnification: float = 1.0, viewer: Viewer = None
) -> Drawing:
    """As :func:`mechanism`, of a scene that need not be the one the solution carries: other
    pictures start from this one."""
    moving = motion(scene, solution)
    moving = replace(moving, scale=positive(magnification, "magnification") * moving.scale)
    length = moving.scale * moving.largest
    is_load = solution.quantity == LOAD_FACTOR
    what = "collapse mechanism" if is_load else "movement as the supports give way"
    notes = annotated(scene) if is_load else without_live_load(annotated(scene))
    caption = (
        f"{what}; largest displacement drawn {length:.3g} {scene.units.length}; "
        f"joints above {100 * SLOW:g} % of the largest rate"
        f"{_dilatancy_caption(solution, moving)}"
    )
    return Drawing(
        scene,
        moving,
        camera_for(scene, moving, viewer),
        title(solution),
        caption if moving.moves else "",
        marking=moving_joints(scene, moving),
        notes=notes,
        bar=Bar(Style.speed, SPEED_TEXT) if moving.moves else None,
        blocks="block (no mechanism)",
        shapes=shapes_of(scene, solution, moving),
    )


def _dilatancy_caption(solution: Solution, moving: Motion) -> str:
    """What the caption adds where joints slide and, by the associated flow rule, open as well:
    that such openings are drawn too, and whether less may be carried without them."""
    slides = np.isin(moving.contacts.kind, (ContactKind.SLIDES, ContactKind.TWISTS))
    if solution.flow != "associated" or not slides.any():
        return ""
    is_unsafe = solution.dilatancy is not None and solution.dilatancy.is_worth_a_word
    unsafe = ": without it less may be carried (--method zero-dilatancy)"
    return "; opening by dilatancy drawn" + (unsafe if is_unsafe else "")


@picture
def cracks(solution: Solution, *, viewer: Viewer = None) -> Drawing:
    """The crack pattern: joints that open, slide and twist, on the undeformed structure.

    Lines are the wider the faster the joints move; slow ones have none, as the caption says.
    Parameters and errors as for :func:`mechanism`.
    """
    scene = solution.scene
    said = f"crack pattern: lines by rate, above {100 * SLOW:g} % of the largest"
    marking = moving_joints(scene, motion(scene, solution), CRACK)
    return at_rest(solution, viewer, said, marking=marking)
