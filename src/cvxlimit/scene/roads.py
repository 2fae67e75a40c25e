"""Loads on a road: through the fill onto the faces below it, with what is lost beside them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.base.checks import finite_vector, not_negative, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.mesh import cut_off, fan
from cvxlimit.scene.bare_faces import seen_from_above, upwards
from cvxlimit.scene.loads import PointForce
from cvxlimit.scene.pressures import pressed
from cvxlimit.scene.scene import Scene
from cvxlimit.scene.surroundings import horizontal

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
    def _cells(self) -> tuple[list[str], IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Ids of blocks that are reached; of k strips of their faces the block's number, centre
        (k, 3), place along the axis, length along it, and width across."""
        finite_vector([self.level], 1, "level of a road")
        up, faces = upwards(self.scene), seen_from_above(self.scene, self.blocks)
        axis = horizontal(self.along, up)
        names = list(dict.fromkeys(face.block.id for face in faces))
        rows = []
        for face in faces:
            triangles = fan(face.corners, [range(len(face.corners))])[0]
            reach = face.corners @ axis
            ends = np.linspace(reach.min(), reach.max(), _STRIPS + 1)
            for low, high in pairwise(ends.tolist()):
                strip = cut_off(triangles, triangles @ axis - low)
                strip = cut_off(strip, high - strip @ axis)
                points, areas = pressed(strip)
                sizes = areas @ up
                plan = float(sizes.sum())
                if plan > 0.0:
                    centre = sizes @ points / plan
                    length = float(high - low)
                    rows.append((names.index(face.block.id), *centre, length, plan / length))
        table = np.array(rows)
        centres = table[:, 1:4]
        highest = float((centres @ up).max())
        if not self.level > highest - 1e-9 * abs(highest):
            raise InputError(
                f"the road at level {self.level:g} lies below a face that looks up, at "
                f"{highest:g}: raise the level"
            )
        return names, table[:, 0].astype(int), centres, centres @ axis, table[:, 4], table[:, 5]

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
        names, block, centres, place, size, width = self._cells
        up = upwards(self.scene)
        depth = np.maximum(self.level - centres @ up, 0.0)
        # beside the blocks the fill goes on at the depth that it has at their ends
        order = np.argsort(place)
        sides = []
        for end, way in ((order[0], -1.0), (order[-1], 1.0)):
            far = long + (2.0 * float(spread if spread != BOUSSINESQ else _CUT) + 1.0) * depth[end]
            steps = np.linspace(0.0, far, 200)
            edge = place[end] + way * 0.5 * size[end]
            own = edge + way * 0.5 * (steps[1:] + steps[:-1])
            sides.append((own, np.diff(steps), np.full(len(own), depth[end]), width[end]))
        share = self._share(place - middle, size, depth, long, spread) * width
        beside = sum(
            float((self._share(own - middle, step, deep, long, spread) * wide).sum())
            for own, step, deep, wide in sides
        )
        whole = float(share.sum()) + beside
        if not float(share.sum()) > 0.0:
            raise InputError(
                f"a road load at {middle:g} reaches no free block, which lie between "
                f"{place.min():.4g} and {place.max():.4g}: move it"
            )
        forces = total * share / whole
        points = []
        for k, name in enumerate(names):
            own = forces * (block == k)
            if (sum_of := float(own.sum())) > 0.0:
                where = own @ centres / sum_of
                points.append(PointForce(name, tuple(where.tolist()), tuple(-sum_of * up + 0.0)))
        return RoadLoad(tuple(points), total * beside / whole)

    def reaches(self, at: float, length: float = 0.3, spread: float | str = 0.5) -> bool:
        """True if some of a load at this place comes down on a block."""
        _, _, centres, place, size, _ = self._cells
        up = upwards(self.scene)
        depth = np.maximum(self.level - centres @ up, 0.0)
        return bool(self._share(place - at, size, depth, length, spread).any())

    @staticmethod
    def _share(
        off: FloatArray, size: FloatArray, depth: FloatArray, length: float, spread: float | str
    ) -> FloatArray:
        """Share of a load per width on strips of some size, ``off`` its middle: what is over it."""
        if spread == BOUSSINESQ:
            half = 0.5 * length + _CUT * depth
            safe = np.maximum(depth, 1e-12 * length)
            one, other = (np.arctan((off + s * 0.5 * length) / safe) for s in (1.0, -1.0))
            even = (one - other + np.sin(one) * np.cos(one) - np.sin(other) * np.cos(other)) / np.pi
            even = even / length
        else:
            half = 0.5 * length + float(spread) * depth
            even = 0.5 / half
        covered = np.minimum(off + 0.5 * size, half) - np.maximum(off - 0.5 * size, -half)
        return np.asarray(even * np.maximum(covered, 0.0))
