"""Loads on a road: through the fill onto the faces below it, with what is lost beside them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector, not_negative, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.mesh import cut_off
from cvxlimit.scene.loads import PointForce
from cvxlimit.scene.pressures import pressed
from cvxlimit.scene.scene import Scene
from cvxlimit.surroundings.bare_faces import down, horizontal, seen_from_above, upwards

_STRIPS = 6
"""Strips of a face, on each of which a spread load is even: forces on a voussoir come out to a
thousandth of what 50 strips give."""

BOUSSINESQ = "boussinesq"
"""Spread as in an elastic half-space below a strip, cut off at 30 degrees from the load's edges."""

_CUT = np.tan(np.radians(30.0))


@dataclass(frozen=True)
class RoadLoad:
    """What :meth:`Road.load` returns: ``points``, one force for each block that is reached, to be
    given to a :class:`~cvxlimit.Load`, and the force ``lost`` beside all free blocks."""

    points: tuple[PointForce, ...]
    lost: float


@dataclass(frozen=True, eq=False)
class _Strips:
    """Strips of faces below a road, across it, k in all: the ``block`` (k,) that each belongs to,
    its ``centre`` (k, 3), the ``depth`` (k,) of the fill over it, where along the road it begins
    and ends (``low``, ``high``; (k,)), and how wide it is in plan."""

    block: NDArray[np.str_]
    centre: FloatArray
    depth: FloatArray
    low: FloatArray
    high: FloatArray
    width: FloatArray


@dataclass(frozen=True, eq=False)
class Road:
    """A level road over the free blocks of a scene, and the fill between.

    Loads go through the fill onto the faces that look up, spread along the axis ``along``; across
    it they are even over the width. A face's share is what the spread load has over it.

    Attributes
    ----------
    scene : Scene
        Its dead load's gravity says where down is.
    level : float
        Height of the road's surface.
    along : (3,)
        Horizontal axis of the road.
    blocks : collection of str, optional
        The only blocks that loads reach; unless given, all free ones.

    Raises
    ------
    InputError
        If the road is not above all faces that look up, or an argument is wrong.

    Example
    -------
    An axle of 100 kN over the middle of a beam of 4 m, 0.5 m below the road; and half on it:

    >>> from cvxlimit.masonry import stack
    >>> road = Road(stack(1, size=(4.0, 1.0, 0.5)), level=1.0)
    >>> round(sum(point.force[2] for point in road.load(2.0, 100.0).points), 6)
    -100.0
    >>> round(road.load(0.0, 100.0).lost, 6)
    50.0
    """

    scene: Scene
    level: float
    along: ArrayLike = (1.0, 0.0, 0.0)
    blocks: Collection[str] | None = None

    @cached_property
    def _up(self) -> FloatArray:
        return upwards(self.scene)

    @cached_property
    def _strips(self) -> _Strips:
        finite_vector([self.level], 1, "level of a road")
        faces, axis = seen_from_above(self.scene, self.blocks), horizontal(self.along, self._up)
        block, rows = list[str](), []
        for face in faces:
            triangles, reach = face.triangles, face.corners @ axis
            ends = np.linspace(reach.min(), reach.max(), _STRIPS + 1)
            for low, high in pairwise(ends.tolist()):
                strip = cut_off(triangles, triangles @ axis - low)
                strip = cut_off(strip, high - strip @ axis)
                points, areas = pressed(strip)
                sizes = areas @ self._up
                plan = float(sizes.sum())
                if plan > 0.0:
                    block.append(face.block.id)
                    rows.append((*(sizes @ points / plan), low, high, plan / (high - low)))
        centre, (low, high, width) = np.array(rows)[:, :3], np.array(rows)[:, 3:].T
        heights = centre @ self._up
        highest = float(heights.max())
        if not self.level > highest - 1e-9 * abs(highest):
            raise InputError(
                f"the road at level {self.level:g} lies below a face that looks up, at "
                f"{highest:g}: raise the level"
            )
        depth = np.maximum(self.level - heights, 0.0)
        return _Strips(np.array(block), centre, depth, low, high, width)

    @property
    def cover(self) -> float:
        """Least depth of the fill over the faces that loads reach."""
        faces = seen_from_above(self.scene, self.blocks)
        return self.level - max(float((face.corners @ self._up).max()) for face in faces)

    @property
    def width(self) -> float:
        """Largest width, across the road, of the faces that loads reach."""
        return float(self._strips.width.max())

    def depth(self, at: float) -> float:
        """Depth of the fill at a place along the axis; beside the blocks, that at their end."""
        middles = 0.5 * (self._strips.low + self._strips.high)
        order = np.argsort(middles)
        return float(np.interp(at, middles[order], self._strips.depth[order]))

    def load(
        self, at: float, force: float, length: float = 0.3, spread: float | str = 0.5
    ) -> RoadLoad:
        """Returns a load of ``force``, downwards, with its middle at the place ``at`` along the
        axis (from the origin), ``length`` long on the road.

        ``spread`` is by how much it grows on either side per depth, 0.5 for 1 in 2, or
        ``"boussinesq"``: as in an elastic half-space, cut off at 30 degrees.

        Raises
        ------
        InputError
            For numbers that are not positive, and a load that reaches no block at all.
        """
        total, long = positive(force, "force of a road load"), positive(length, "length of a load")
        (middle,) = finite_vector([at], 1, "place of a road load").tolist()
        if spread != BOUSSINESQ:
            spread = not_negative(spread, f"spread of a road load (or {BOUSSINESQ!r})")
        under = self._strips
        low, high = under.low - middle, under.high - middle
        on = under.width * _share(low, high, under.depth, long, spread)
        if not float(on.sum()) > 0.0:
            raise InputError(
                f"a road load at {middle:g} reaches no free block, which lie between "
                f"{under.low.min():.4g} and {under.high.max():.4g}: move it"
            )
        # Beside the blocks the fill goes on, as deep and as wide as it is at their ends.
        first, last = int(low.argmin()), int(high.argmax())
        starts, stops = np.array([-np.inf, high[last]]), np.array([low[first], np.inf])
        own = under.depth[[first, last]], under.width[[first, last]]
        beside = float(own[1] @ _share(starts, stops, own[0], long, spread))
        whole = float(on.sum()) + beside
        forces, points = total * on / whole, list[PointForce]()
        for name in dict.fromkeys(under.block.tolist()):
            points += down(name, under.centre, forces * (under.block == name), self._up)
        return RoadLoad(tuple(points), total * beside / whole)

    def reaches(self, at: float, length: float = 0.3, spread: float | str = 0.5) -> bool:
        """True if some of a load at this place comes down on a block."""
        under = self._strips
        return bool(_share(under.low - at, under.high - at, under.depth, length, spread).any())


def _share(
    low: FloatArray, high: FloatArray, depth: FloatArray, length: float, spread: float | str
) -> FloatArray:
    """Share of a load per width that comes down between two places, from its middle, at a depth.

    Spread 1 in n it is even over the length that it has reached. In an elastic half-space under a
    strip of the load's length L the pressure at a place x and a depth z is

        (f(x + L / 2) - f(x - L / 2)) / (pi L),   f(s) = atan(s / z) + s z / (s^2 + z^2),

    whose integral over x has s atan(s / z) in place of f(s).
    """
    tan = _CUT if spread == BOUSSINESQ else float(spread)
    half = 0.5 * length + tan * depth
    low, high = np.clip(low, -half, half), np.clip(high, -half, half)
    if spread != BOUSSINESQ:
        return np.asarray((high - low) * (0.5 / half))
    deep = np.maximum(depth, 1e-12 * length)
    ends = np.stack([low, high]) + 0.5 * length * np.array([1.0, -1.0])[:, None, None]
    whole = ends * np.arctan(ends / deep)  # of both ends of the load (rows), at both places
    return np.asarray((whole[0, 1] - whole[0, 0] - whole[1, 1] + whole[1, 0]) / (np.pi * length))
