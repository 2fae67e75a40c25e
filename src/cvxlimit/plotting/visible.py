"""What is seen of flat faces and of lines, exactly: for pictures that are drawn, not painted.

Of two faces one is nearer on one side of a straight line, that of equal distance. So what one hides
of another is a convex polygon, whatever their order, and also where blocks interpenetrate as they
do in a mechanism drawn large: there no order of painting is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from cvxlimit.base.arrays import ROUNDING, FloatArray, IntArray
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, cross
from cvxlimit.geometry.overlays import Regions, difference, intersections, union

GRID = 2e-5
"""Regions lie on a grid of so many sizes of the picture, a hundredth of a line's width."""


@dataclass(frozen=True, eq=False)
class Faces:
    """Convex faces as the camera sees them: ``corners`` (k, 3) of each are x to the right, y
    upwards and z towards the viewer."""

    corners: Sequence[FloatArray]

    @cached_property
    def size(self) -> float:
        if not len(self.corners):
            return 1.0
        return float(np.ptp(np.concatenate(self.corners)[:, :2], axis=0).max()) or 1.0

    @property
    def grid(self) -> float:
        return GRID * self.size

    @cached_property
    def planes(self) -> FloatArray:
        """Coefficients a, b, c (n, 3) of each face's plane z = a x + b y + c, where z points
        towards the viewer; NaN for faces that are seen edge-on."""
        result = np.full((len(self.corners), 3), np.nan)
        for i, polygon in enumerate(self.corners):
            spokes = polygon[1:] - polygon[0]
            normal = cross(spokes[:-1], spokes[1:]).sum(axis=0)
            if abs(normal[2]) > RELATIVE_TOLERANCE * np.linalg.norm(normal):
                slope = -normal[:2] / normal[2]
                middle = polygon.mean(axis=0)
                result[i] = *slope, middle[2] - slope @ middle[:2]
        return result

    @cached_property
    def flat(self) -> Regions:
        """The outline (n,) of each face on the picture; empty if it is seen edge-on."""
        if not len(self.corners):
            return np.empty(0, dtype=object)
        counts = [len(polygon) for polygon in self.corners]
        points = np.concatenate(self.corners)[:, :2]
        owner = np.repeat(np.arange(len(counts)), counts)
        hulls = shapely.convex_hull(shapely.multipoints(points, indices=owner))
        hidden = np.isnan(self.planes[:, 0]) | (shapely.area(hulls) < ROUNDING * self.size**2)
        hulls[hidden] = shapely.Polygon()
        return np.asarray(hulls)

    @cached_property
    def tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.flat)

    def nearness(self, face: IntArray, points: FloatArray) -> FloatArray:
        """How near to the viewer (p,) the planes of faces (p,) are at points (p, 2)."""
        a, b, c = self.planes[face].T
        return np.asarray(a * points[:, 0] + b * points[:, 1] + c)

    def visible(self) -> Regions:
        """The visible part (n,) of each face; of faces equally near, the first one is seen."""
        behind, parts = self._hidden()
        hiding: list[list[shapely.Geometry]] = [[] for _ in self.corners]
        for i, part in zip(behind.tolist(), parts, strict=True):
            hiding[i].append(part)
        # On a grid: slivers and spikes without width are gone, whose outlines would be seen.
        left = np.empty(len(self.corners), dtype=object)
        for i, (own, hidden) in enumerate(zip(self.flat, hiding, strict=True)):
            left[i] = difference(own, hidden, self.grid)
        return left

    def _hidden(self) -> tuple[IntArray, Regions]:
        """Numbers of faces (h,), and for each the part (h,) of it that some other face hides."""
        # The regions where two faces lie one behind the other.
        one, other = self.tree.query(self.flat, predicate="intersects")
        one, other = one[one < other], other[one < other]
        shared = intersections(self.flat[one], self.flat[other], self.grid)
        kept = shapely.area(shared) > ROUNDING * self.size**2
        one, other, shared = one[kept], other[kept], shared[kept]
        points, owner = shapely.get_coordinates(shared, return_index=True)
        # By how much the second face is nearer, at most and at least: a difference of two planes
        # has its extremes at corners.
        ahead = self.nearness(other[owner], points) - self.nearness(one[owner], points)
        most, least = np.full(len(one), -np.inf), np.full(len(one), np.inf)
        np.maximum.at(most, owner, ahead)
        np.minimum.at(least, owner, ahead)
        tie = ROUNDING**0.5 * self.size
        first, second = most <= tie, (least >= -tie) & (most > tie)
        behind = [other[first], one[second]]
        parts = [shared[first], shared[second]]
        # Faces that pass through each other: each hides the other on one side of a line.
        for pair in np.flatnonzero(~first & ~second).tolist():
            i, j = int(one[pair]), int(other[pair])
            plane = self.planes[j] - self.planes[i]
            corners = points[owner == pair]
            halves = [_half_plane(sign * plane, corners) for sign in (1.0, -1.0)]
            behind.append(np.array([i, j]))
            parts.append(intersections(shared[[pair, pair]], np.array(halves), self.grid))
        return np.concatenate(behind), np.concatenate(parts)

    def visible_lines(self, ends: FloatArray, lift: float) -> tuple[FloatArray, IntArray]:
        """The visible parts of lines with ``ends`` (m, 2, 3), which are drawn nearer to the viewer
        by ``lift``: ends (p, 2, 2) on the picture, and the number (p,) of the line of each."""
        # The stretch of each line in front of or behind each face that it crosses.
        lines = shapely.linestrings(ends[:, :, :2])
        line, face = self.tree.query(lines, predicate="intersects")
        cut = intersections(lines[line], self.flat[face], self.grid)
        length = shapely.length(lines)
        kept = shapely.length(cut) > 1e-9 * np.maximum(length[line], self.size * 1e-6)
        line, face, cut = line[kept], face[kept], cut[kept]
        points, owner = shapely.get_coordinates(cut, return_index=True)
        along = ends[line[owner], 1] - ends[line[owner], 0]
        t = np.einsum("ij,ij->i", points - ends[line[owner], 0, :2], along[:, :2])
        t /= np.einsum("ij,ij->i", along[:, :2], along[:, :2])
        depth = ends[line[owner], 0, 2] + t * along[:, 2] + lift
        ahead = self.nearness(face[owner], points) - depth
        # What lies behind the face, as ranges of the line's parameter from 0 to 1, is hidden.
        hidden: list[list[tuple[float, float]]] = [[] for _ in ends]
        starts = np.flatnonzero(np.r_[True, owner[1:] != owner[:-1]]) if len(owner) else owner
        for k, first in zip(line[owner[starts]].tolist(), starts.tolist(), strict=True):
            span = _positive(t[first : first + 2], ahead[first : first + 2])
            if span is not None:
                hidden[k].append(span)
        found = [(k, gap) for k, spans in enumerate(hidden) for gap in _gaps(spans)]
        number = np.array([k for k, _ in found], dtype=np.int64)
        shares = np.array([gap for _, gap in found]).reshape(-1, 2, 1)
        start, run = ends[number, :1, :2], ends[number, 1:, :2] - ends[number, :1, :2]
        return start + shares * run, number


def _half_plane(plane: FloatArray, points: FloatArray) -> shapely.Geometry:
    """The half where a x + b y + c > 0, as a square that is large beside ``points``."""
    a, b, c = plane
    normal = np.array([a, b]) / np.hypot(a, b)
    middle = points.mean(axis=0)
    foot = middle - normal * (a * middle[0] + b * middle[1] + c) / np.hypot(a, b)
    reach = 4.0 * np.linalg.norm(np.ptp(points, axis=0))
    side = reach * np.array([-normal[1], normal[0]])
    inward = reach * normal
    return shapely.Polygon([foot - side, foot + side, foot + side + inward, foot - side + inward])


def _positive(t: FloatArray, ahead: FloatArray) -> tuple[float, float] | None:
    """Returns where between two parameters a linear function is positive."""
    if (ahead <= 0.0).all():
        return None
    if (ahead < 0.0).any():
        zero = t[0] + (t[1] - t[0]) * ahead[0] / (ahead[0] - ahead[1])
        t = np.array([zero, t[int(ahead[1] > 0.0)]])
    return float(t.min()), float(t.max())


def _gaps(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """What intervals leave of that from 0 to 1."""
    result, reached = [], 0.0
    for low, high in sorted(spans):
        if low > reached + 1e-6:
            result.append((reached, low))
        reached = max(reached, high)
    return [*result, (reached, 1.0)] if reached < 1.0 - 1e-6 else result


def outlines(regions: Regions, patch: IntArray, grid: float) -> list[FloatArray]:
    """Returns where surfaces end, as closed lines (k, 2): those of faces of one ``patch`` have none
    between them."""
    order = np.argsort(patch, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(patch[order])) + 1) if len(order) else []
    return [ring for own in groups for ring in rings(union(regions[own], grid))]


def rings(region: shapely.Geometry) -> list[FloatArray]:
    """Closed lines around a region, holes among them; outer ones run against the clock."""
    parts = shapely.get_parts(region)
    areas = shapely.orient_polygons(
        parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    )
    return [shapely.get_coordinates(ring) for ring in shapely.get_rings(areas)]
