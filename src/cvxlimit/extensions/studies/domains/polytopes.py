"""Polytopes of one to three dimensions: the hull of what is carried, and what half-spaces leave."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from cvxlimit.base.arrays import ROUNDING, FloatArray
from cvxlimit.geometry.polygons import clipped

FLAT = 1e-7
"""Extent, over the natural size of load factors, below which a set counts as flat: ten times what
solvers leave of a load factor that is zero."""

ROUNDED = 1e-12
"""Share of a direction's length that counts as rounding."""

_FAR = 1e4
"""Length, over the window's, at which rays end where a hull of points is made of them."""


@dataclass(frozen=True, eq=False)
class Inner:
    """Convex hull of points (n, k), and of all rays (m, k) from them, in the plane it spans.

    Attributes
    ----------
    origin : (k,), basis : (k, r)
        The plane: r is smaller than k where the hull is flat.
    normals : (f, k), offsets : (f,)
        The hull is normals @ x <= offsets within the plane: no facet where it has no end.
    """

    points: FloatArray
    rays: FloatArray
    origin: FloatArray
    basis: FloatArray
    normals: FloatArray
    offsets: FloatArray

    @classmethod
    def of(cls, points: FloatArray, rays: FloatArray, window: float) -> Inner:
        """The hull; ``window`` is the largest factor that matters."""
        ends = (points[:, None] + _FAR * window * rays).reshape(-1, points.shape[1])
        every = np.vstack([points, ends])
        origin = points.mean(axis=0)
        near = np.vstack([points - origin, rays])
        spread, axes = np.linalg.svd(near, full_matrices=False)[1:]
        basis = axes[spread > FLAT].T
        far = 2.0 * window * np.sqrt(points.shape[1])
        normals, offsets = _facets((every - origin) @ basis, (points - origin) @ basis, far)
        return cls(points, rays, origin, basis, normals @ basis.T,
                   offsets + normals @ (basis.T @ origin))  # fmt: skip

    @property
    def is_flat(self) -> bool:
        """True if it spans less than the space."""
        return self.basis.shape[1] < len(self.origin)

    @cached_property
    def across(self) -> FloatArray:
        """Orthonormal directions (k - r, k) that the hull has no extent in."""
        own = np.hstack([self.basis, np.eye(len(self.origin))])
        return np.linalg.qr(own)[0][:, self.basis.shape[1] : len(self.origin)].T

    def margin(self, point: FloatArray) -> float:
        """How far inside all facets a point of the plane is; negative outside, and off it."""
        if np.abs(self.across @ (point - self.origin)).max(initial=0.0) > FLAT:
            return -np.inf
        return float((self.offsets - self.normals @ point).min(initial=np.inf))

    def holds(self, point: FloatArray) -> bool:
        """True if a point is inside all facets, and in the plane up to rounding."""
        step = point - self.origin
        off = np.abs(self.across @ step).max(initial=0.0) <= ROUNDED * np.abs(step).max()
        return bool(off and (self.normals @ point <= self.offsets).all())

    def holds_ray(self, direction: FloatArray) -> bool:
        """True if rays along ``direction`` never leave."""
        if not len(self.rays):
            return False
        least = ROUNDED * np.linalg.norm(direction)
        off = np.abs(self.across @ direction).max(initial=0.0)
        return bool(off <= least and (self.normals @ direction <= least).all())

    def reach(self, start: FloatArray, direction: FloatArray) -> tuple[float, float]:
        """Least and largest t with start + t direction inside; (inf, -inf) if there is none."""
        away, off = self.across @ direction, self.across @ (start - self.origin)
        if np.abs(away).max(initial=0.0) > ROUNDED * np.abs(direction).max():
            t = float(-(away @ off) / (away @ away))
            return (t, t) if self.margin(start + t * direction) >= 0.0 else (np.inf, -np.inf)
        if np.abs(off).max(initial=0.0) > FLAT:
            return np.inf, -np.inf
        if not self.basis.shape[1]:
            return 0.0, 0.0
        low, high = _interval(self.normals, self.offsets, start, direction)
        if low <= high:
            high = np.inf if self.holds_ray(direction) else high
            low = -np.inf if self.holds_ray(-direction) else low
        return low, high


def _facets(along: FloatArray, points: FloatArray, far: float) -> tuple[FloatArray, FloatArray]:
    """Facets of the hull of what is ``along`` the plane (n, r) as normals @ z <= offsets, a little
    inside it, moved back to the ``points`` (m, r).

    Facets that are ``far`` beyond all points are where rays end: they are left out, and the set
    goes on. A facet that is near them though no point lies on it comes from rays that are opposite
    but for rounding: rounding proves nothing, and the set ends at the points.
    """
    if along.shape[1] == 0:
        return np.zeros((0, 0)), np.zeros(0)
    if along.shape[1] == 1:
        normals, offsets = np.array([[1.0], [-1.0]]), np.array([along.max(), -along.min()])
    else:
        equations = np.unique(ConvexHull(along).equations, axis=0)
        normals, offsets = equations[:, :-1], -equations[:, -1]
    most = (points @ normals.T).max(axis=0)
    is_near = offsets - most <= far
    normals, offsets = normals[is_near], np.minimum(offsets, most)[is_near]
    return normals, offsets - ROUNDING * np.abs(offsets)


def ring(
    normals: FloatArray,
    offsets: FloatArray,
    low: FloatArray,
    high: FloatArray,
    flat: Inner | None = None,
) -> FloatArray:
    """Corners (n, 2), in order, of normals @ x <= offsets in the plane within low <= x <= high; of
    a hull that is ``flat``, those within it."""
    (a, c), (b, d) = low, high
    corners = np.array([[a, c], [b, c], [b, d], [a, d]])
    if flat is not None and flat.is_flat:
        far = np.abs([low - flat.origin, high - flat.origin]).max() * 2.0
        corners = flat.origin + far * np.vstack([flat.basis.T, -flat.basis.T, 0.0 * low])
        sides = np.vstack([np.eye(2), -np.eye(2)])
        normals, offsets = np.vstack([normals, sides]), np.concatenate([offsets, high, -low])
    found, count = corners[None], np.array([len(corners)])
    for normal, offset in zip(normals, offsets, strict=True):
        found, count = clipped(found, count, offset - found @ normal)
    return np.asarray(found[0, : count[0]])


def _interval(
    normals: FloatArray, offsets: FloatArray, start: FloatArray, direction: FloatArray
) -> tuple[float, float]:
    """Ends of the t with normals @ (start + t direction) <= offsets; a direction that is along one
    of these but for rounding is not ended by it."""
    speed, room = normals @ direction, offsets - normals @ start
    speed[np.abs(speed) <= ROUNDED * np.linalg.norm(direction)] = 0.0
    if (room[speed == 0.0] < 0.0).any():
        return np.inf, -np.inf
    ahead, behind = speed > 0.0, speed < 0.0
    low = float((room[behind] / speed[behind]).max(initial=-np.inf))
    return low, float((room[ahead] / speed[ahead]).min(initial=np.inf))


@dataclass(frozen=True, eq=False)
class Outer:
    """What half-spaces normals (h, k) @ x <= offsets (h,) leave, with unit normals."""

    normals: FloatArray
    offsets: FloatArray

    def reach(self, start: FloatArray, direction: FloatArray) -> tuple[float, float]:
        """Least and largest t with start + t direction inside; (inf, -inf) if there is none."""
        return _interval(self.normals, self.offsets, start, direction)

    def excludes(self, point: FloatArray) -> bool:
        """True if a point is outside one of them, by more than rounding."""
        spare = ROUNDED * np.linalg.norm(point)
        return bool((self.normals @ point > self.offsets + spare).any())

    def within(self, low: FloatArray, high: FloatArray) -> Outer:
        """The same within low <= x <= high."""
        each = np.eye(self.normals.shape[1])
        sides = np.vstack([self.normals, each, -each])
        return Outer(sides, np.concatenate([self.offsets, high, -low]))

    def corners(self, inner: Inner, centre: FloatArray) -> FloatArray:
        """Corners (n, k) of what is left in the plane of ``inner``, around a point inside it."""
        normals = self.normals @ inner.basis
        size = np.linalg.norm(normals, axis=1)
        cut = size > FLAT
        normals = normals[cut] / size[cut, None]
        room = (self.offsets - self.normals @ centre)[cut] / size[cut]
        room = np.maximum(room, FLAT * np.abs(room).max(initial=0.0))  # as seen from the centre
        if normals.shape[1] == 0:
            return np.zeros((0, len(centre)))
        if normals.shape[1] == 1:
            low, high = _interval(normals, room, np.zeros(1), np.ones(1))
            found = np.array([[low], [high]])
        else:
            cuts = np.hstack([normals, -room[:, None]])
            try:
                found = HalfspaceIntersection(cuts, np.zeros(normals.shape[1])).intersections
            except QhullError:
                found = HalfspaceIntersection(
                    cuts, np.zeros(normals.shape[1]), qhull_options="QJ"
                ).intersections
        found = found[np.isfinite(found).all(axis=1)]
        return np.asarray(centre + found @ inner.basis.T)
