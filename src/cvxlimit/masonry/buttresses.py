"""Flying buttresses: a leaning arch between a wall and a free-standing pier."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cvxlimit.base.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.strengths import DEFAULT_FRICTION
from cvxlimit.masonry.arches import Ring
from cvxlimit.masonry.sizes import (
    Span,
    brick,
    count,
    ground_below,
    is_negligible,
    pile,
    prism,
    scene_of,
)
from cvxlimit.scene import Load, Scene


def flying_buttress(
    voussoirs: int = 8,
    thickness: float = 0.5,
    *,
    span: float = 3.0,
    embrace: float = 60.0,
    head: float = 7.0,
    pier_width: float = 1.5,
    pinnacle: float = 1.5,
    wall_width: float = 1.0,
    wall_height: float = 9.0,
    course: float = 0.75,
    width: float = 0.6,
    density: float = 22.0,
    friction: float = DEFAULT_FRICTION,
    live: Load | None = None,
    name: str = "flying-buttress",
) -> Scene:
    r"""A flyer in the plane (x, z) between a pier and a wall that is pushed against it::

                               +---+  wall_height
                               |   |
        +--+ pinnacle    _ - ~ |   |
        |  |        _ - '   _-~|   |  <== thrust (live load)
        |  |    _ -'    _ -'   |   |
        |  |_.-'    _ -'       |---|- - head
        |    \   .-'           |   |
        |     \-'   flyer      |   |      the flyer is a ring over ``embrace``: its upper
        +------+               |   |      joint stands upright on the wall, its lower one
        |      |<--- span ---->|   |      lies on the inclined face of the skewback
        | pier |               |   |
      ==+======+===============+===+==  ground, top at z = 0

    The ring's inner side starts from the pier's inner face and is level where it meets the wall:
    its inner radius is ``span / sin(embrace)``. The wall stands on its own. Blocks are named
    ``v1`` ... from pier to wall, ``p1`` ... and ``w1`` ... from the bottom, ``skewback`` and
    ``pinnacle``.

    Parameters
    ----------
    voussoirs : int
        In the flyer.
    thickness, span : float
        Of the flyer, along its radius; clear distance between pier and wall (x), m.
    embrace : float
        Angle between the flyer's end joints, degrees, below 90.
    head : float
        Height of the flyer's inner side at the wall, m.
    pier_width, wall_width, wall_height : float
        Along x, and above the ground, m; the flyer must meet the wall below its top.
    pinnacle : float
        Height of the pinnacle above the skewback, m; 0 for none.
    course : float
        Height of the blocks of pier and wall, m; they are made equal, so it is met nearly.
    width : float
        Of everything, out of the plane (y), m.
    density, friction, live, name
        As for :func:`~cvxlimit.masonry.wall`; the load: a thrust of 1 kN on the wall towards the
        pier (-x), at the middle of the flyer's upper joint, unless given: the load factor is the
        thrust in kN.

    Raises
    ------
    InputError
        For sizes that are not positive, an embrace angle of 90 degrees or more, a flyer that
        starts below the ground or ends above the wall, or a pier too narrow for its foot.

    Example
    -------
    >>> scene = flying_buttress(4)
    >>> [scene.blocks[i].id for i in scene.free if scene.blocks[i].id[0] not in "wp"]
    ['skewback', 'v1', 'v2', 'v3', 'v4']
    """
    number, weight = count(voussoirs, "voussoirs"), positive(density, "density of the buttress")
    sides = (0.0, positive(width, "width"))
    names = ("thickness", "span", "embrace", "head")
    flyer = _Flyer(*map(positive, (thickness, span, embrace, head), names))
    broad, tall = positive(pier_width, "pier_width"), positive(wall_height, "wall_height")
    step = positive(course, "course")
    flyer.check(broad, tall)
    ring = flyer.ring(number)
    shoulder = float(ring.joints(sides)[0, 1, 2])
    pier = _pier(flyer, shoulder, sides, broad, step, pinnacle, weight)
    reach = (flyer.span, flyer.span + positive(wall_width, "wall_width"))
    wall = pile("w", reach, sides, np.linspace(0.0, tall, _courses(tall, step) + 1), weight)
    ground = ground_below([*pier, *wall], depth=step)
    thrust = _thrust(wall, flyer.head + flyer.thickness / 2.0)
    blocks = (ground, *pier, *ring.voussoirs(sides, weight), *wall)
    return scene_of(blocks, thrust, live, friction, name)


@dataclass(frozen=True)
class _Flyer:
    """The ring's sizes; its lower inner corner is at x = 0, the wall at x = span."""

    thickness: float
    span: float
    embrace: float
    head: float

    @property
    def inner(self) -> float:
        return self.span / float(np.sin(np.radians(self.embrace)))

    @property
    def foot(self) -> float:
        return self.head - self.inner * (1.0 - float(np.cos(np.radians(self.embrace))))

    @property
    def setback(self) -> float:
        return self.thickness * float(np.sin(np.radians(self.embrace)))

    def check(self, pier_width: float, wall_height: float) -> None:
        if self.embrace >= 90.0:
            raise InputError(f"embrace must be below 90 degrees, got {self.embrace:g}")
        if is_negligible(self.foot, self.thickness):
            raise InputError(
                f"head must be above {self.head - self.foot:g}, got {self.head:g}: the flyer's "
                "foot would be below the ground"
            )
        if not is_negligible(self.head + self.thickness - wall_height, self.thickness):
            raise InputError(
                "wall_height must be no less than head and thickness together, "
                f"{self.head + self.thickness:g}, got {wall_height:g}"
            )
        if is_negligible(pier_width - self.setback, self.thickness):
            raise InputError(
                f"pier_width must be above {self.setback:g}, over which the flyer's foot reaches "
                f"back, got {pier_width:g}"
            )

    def ring(self, voussoirs: int) -> Ring:
        angles = np.pi / 2.0 + np.linspace(np.radians(self.embrace), 0.0, voussoirs + 1)
        centre = (self.span, self.head - self.inner)
        return Ring(angles, self.inner + self.thickness / 2.0, self.thickness, centre)


def _courses(height: float, course: float) -> int:
    return max(1, round(height / course))


def _pier(
    flyer: _Flyer, shoulder: float, sides: Span, broad: float, step: float, pinnacle: float,
    density: float,
) -> list[Block]:  # fmt: skip
    """Courses up to the skewback, on which the flyer stands, and the pinnacle at its back."""
    below = _courses(flyer.foot, step)
    levels = np.linspace(0.0, flyer.foot, below + 1)
    base = levels[-2]
    outline = [
        (-broad, base), (0.0, base), (0.0, flyer.foot),
        (-flyer.setback, shoulder), (-broad, shoulder),
    ]  # fmt: skip
    skewback = prism("skewback", outline, sides, density)
    blocks = [*pile("p", (-broad, 0.0), sides, levels[:-1], density), skewback]
    if pinnacle != 0.0:
        top = shoulder + positive(pinnacle, "pinnacle")
        back = (-broad, -flyer.setback)
        blocks.append(brick("pinnacle", back, 0, sides, (shoulder, top), density))
    return blocks


def _thrust(wall: Sequence[Block], height: float) -> Load:
    """1 kN along -x at ``height``: force and moment about the centroid of the block there."""
    block = next(b for b in wall if height <= b.vertices[:, 2].max())
    return Load(forces={block.id: (-1.0, 0.0, 0.0, 0.0, block.centroid[2] - height, 0.0)})
