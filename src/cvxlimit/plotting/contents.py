"""What a picture consists of, as data: :mod:`cvxlimit.plotting.drawing` makes a figure of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.plotting.annotations import Annotations, Decal, Marking, Shape, annotated
from cvxlimit.plotting.camera import Camera, camera_from, default_camera
from cvxlimit.plotting.look import block_colours, scene_joints, scene_title, title
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import Motion, motion, still
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

Viewer = tuple[float, float, float] | None


@dataclass(frozen=True)
class Bar:
    """A colour bar from 0 to 1: its colours, and what it measures."""

    stops: Sequence[str]
    label: str


@dataclass(frozen=True, eq=False)
class Lines:
    """Straight lines over the blocks: ends (k, 2, 3), widths (k,) in points, one colour; opacity
    (k,) of each if it differs, and heads at their second ends if they are arrows. With ``each``,
    the length of a unit of force, the legend states the largest."""

    ends: FloatArray
    widths: FloatArray
    colour: str
    label: str
    opacity: FloatArray | None = None
    heads: bool = False
    each: float | None = None


@dataclass(frozen=True, eq=False)
class Drawing:
    """What a figure consists of.

    Attributes
    ----------
    scene, moving, camera : Scene, Motion, Camera
        Where its blocks are drawn, and where they are seen from.
    heading, caption : str
        First line, and a second one in smaller letters.
    marking, notes : Marking or None, Annotations
        Joints to outline; arrows of loads, near misses, a refusal.
    colours : (n_blocks, 3) array or None
        Of blocks, in place of those of their speed.
    dots : (k, 3) array or None
        Pressure centres.
    decals, lines, shapes, bar : sequence of Decal, Lines or None, sequence of Shape, Bar or None
        Shapes are crushed zones and ties.
    blocks : str
        What the legend calls blocks that do not move.
    has_axes : bool
        False where places are not those of the scene.
    glass : bool
        True if only lines are drawn of blocks that are no supports.
    keys : sequence of (colour, text)
        Further entries of the legend.
    """

    scene: Scene
    moving: Motion
    camera: Camera
    heading: str = ""
    caption: str = ""
    marking: Marking | None = None
    notes: Annotations = field(default_factory=Annotations)
    colours: FloatArray | None = None
    decals: Sequence[Decal] = ()
    lines: Lines | None = None
    dots: FloatArray | None = None
    shapes: Sequence[Shape] = ()
    bar: Bar | None = None
    blocks: str = "block"
    has_axes: bool = True
    glass: bool = False
    keys: Sequence[tuple[str, str]] = ()


def camera_for(scene: Scene, moving: Motion, viewer: Viewer) -> Camera:
    """The camera in direction ``viewer``, or the one that shows the movement."""
    return default_camera(scene, moving) if viewer is None else camera_from(scene, viewer)


def at_rest(solution: Solution, viewer: Viewer, caption: str, **parts: Any) -> Drawing:
    scene = solution.scene
    camera = camera_for(scene, motion(scene, solution), viewer)
    pale = block_colours(scene, still(scene), stone=Style.pale)
    return Drawing(scene, still(scene), camera, title(solution), caption, colours=pale, **parts)


def scene_drawing(scene: Scene, viewer: Viewer, refusal: InputError | None) -> Drawing:
    """Returns what is drawn of a scene without an answer, with its ``refusal`` if there is one."""
    moving = still(scene)
    marking = None if refusal else scene_joints(scene)
    camera, notes = camera_for(scene, moving, viewer), annotated(scene, refusal)
    return Drawing(scene, moving, camera, scene_title(scene), marking=marking, notes=notes)
