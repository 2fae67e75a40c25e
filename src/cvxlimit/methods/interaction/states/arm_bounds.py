"""Upper bounds on the torsion arm of a polygon pressed anywhere in a triangle.

The effective region about a pressure centre e is S(e) = {y : abs(n_i . y) <= b_i(e)} with one slab
per edge of the polygon, n_i its outward normal and b_i(e) >= 0 the distance of e from it, which is
linear in e. The arm c(e) = M(e) / A(e) is the mean of abs(y) over it, with M and A the integrals of
abs(y) and of 1. Three bounds t with c(e) <= sum of lambda_k t_k for e = sum of lambda_k e_k hold:

- *Parallelograms*. Two slabs alone bound y = b_i xi d_i + b_j eta d_j with xi, eta in [-1, 1],
  over which the mean of norms is convex in b, so in e: its values at the corners are a bound for
  it. The other slabs cut points away whose distance is b_l(e) or more; where that is no less than
  the mean, cutting does not raise it. Exact where they cut nothing, as near edges and corners.
- *Sectors*. In sector i of S(e0), seen from the origin, the radius at another e is at most
  b_i(e) / b_i(e0) times that at e0. So M(e) <= sum of M_i (b_i(e) / b_i(e0))^3, and by Brunn and
  Minkowski sqrt(A) is concave, A(e) >= (sum of lambda_k sqrt(A_k))^2. Then c(e) is below the sum
  of lambda_k t_k wherever the first is below the product of the second with it: both are cubics
  in lambda, compared by their Bernstein coefficients. The error falls with the square of the
  triangle's size, but for kinks.
- *Radii*. 2/3 of the largest radius of all S(e); loose, and always there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, combinations_with_replacement

import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.polygons import (
    area_and_centroid,
    effective_regions,
    mean_distance,
    mean_distance_on_segment,
)

_PARALLEL = 1e-9
"""Sine of the angle below which two slabs bound nothing together."""

_ROUNDING = 1e-9
"""Share of the polygon's size that is added to all bounds: areas and arms are rounded to less."""

_THIN = 1e-9
"""Area of an effective region, over the square of the polygon's size, below which it is no e0."""

_TRIPLES = np.array(list(combinations_with_replacement(range(3), 3)))
"""Bernstein coefficients of a cubic over a triangle, as triples of corners."""


@dataclass(frozen=True, eq=False)
class _Pressed:
    """A pressure centre (2,) with its effective region (k, 2), and that one's area and arm."""

    centre: FloatArray
    region: FloatArray
    area: float
    arm: float

    @classmethod
    def of(cls, centre: FloatArray, region: FloatArray) -> _Pressed:
        area = area_and_centroid(region)[0] if len(region) > 2 else 0.0
        return cls(centre, region, max(area, 0.0), mean_distance(region, centre))


@dataclass(frozen=True, eq=False)
class ArmBounds:
    """Bounds on the arms of one convex polygon, corners (k, 2) counter-clockwise.

    Example
    -------
    >>> square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    >>> corner = np.array([[0.3, 0.3], [0.5, 0.3], [0.5, 0.5]])
    >>> ArmBounds(square).over(corner[None]).round(6).tolist()  # exact: a parallelogram
    [[0.153039, 0.1, 0.0]]
    """

    polygon: FloatArray

    @cached_property
    def size(self) -> float:
        """Largest side of a box about the polygon."""
        return float(np.ptp(self.polygon, axis=0).max())

    @cached_property
    def normals(self) -> FloatArray:
        """n_i (m, 2) of edges that have a length."""
        along = np.roll(self.polygon, -1, axis=0) - self.polygon
        length = np.linalg.norm(along, axis=1)
        kept = length > 0.0
        turned = np.stack([along[:, 1], -along[:, 0]], axis=1)[kept]
        result: FloatArray = turned / length[kept, None]
        return result

    @cached_property
    def offsets(self) -> FloatArray:
        """Largest n_i . x (m,) over the polygon."""
        result: FloatArray = (self.normals @ self.polygon.T).max(axis=1)
        return result

    @cached_property
    def _pairs(self) -> tuple[IntArray, FloatArray]:
        pairs, edges = [], []
        for i, j in combinations(range(len(self.normals)), 2):
            rows = self.normals[[i, j]]
            if abs(np.linalg.det(rows)) > _PARALLEL:
                pairs.append((i, j))
                edges.append(np.linalg.inv(rows).T)
        return np.array(pairs), np.array(edges)

    def widths(self, centres: FloatArray) -> FloatArray:
        """b (p, m) at centres (p, 2)."""
        result: FloatArray = np.maximum(self.offsets - centres @ self.normals.T, 0.0)
        return result

    def over(self, triangles: FloatArray) -> FloatArray:
        """t (p, 3) of triangles (p, 3, 2) of pressure centres in the polygon: the least found."""
        centres = np.concatenate([triangles, triangles.mean(axis=1, keepdims=True)], axis=1)
        regions = effective_regions(self.polygon, centres.reshape(-1, 2))
        pressed = [_Pressed.of(e, r) for e, r in zip(centres.reshape(-1, 2), regions, strict=True)]
        found = [self._over(pressed[k : k + 4]) for k in range(0, len(pressed), 4)]
        return np.array(found).reshape(-1, 3) + _ROUNDING * self.size

    def _over(self, pressed: Sequence[_Pressed]) -> FloatArray:
        widths = self.widths(np.array([at.centre for at in pressed]))
        corners = widths[:3]
        bounds = [*self._by_parallelograms(corners), self._by_radii(corners)]
        best: FloatArray = min(bounds, key=np.sum)
        if (best - [at.arm for at in pressed[:3]]).max() <= _ROUNDING * self.size:
            return best
        return min(best, self._by_sectors(pressed, widths), key=np.sum)

    def _by_parallelograms(self, widths: FloatArray) -> FloatArray:
        pairs, edges = self._pairs
        half = widths[:, pairs].transpose(1, 2, 0)[:, :, :, None] * edges[:, :, None, :]
        first, second = half[:, 0], half[:, 1]
        mean = _parallelogram_arm(first, second)
        reach = np.abs(first @ self.normals.T) + np.abs(second @ self.normals.T)
        idle = (reach <= widths * (1.0 + 1e-12)).all(axis=1)
        far = widths.min(axis=0) >= mean.max(axis=1)[:, None]
        own = np.zeros(idle.shape, dtype=bool)
        np.put_along_axis(own, pairs, True, axis=1)
        result: FloatArray = mean[(idle | far | own).all(axis=1)]
        return result

    def _by_radii(self, widths: FloatArray) -> FloatArray:
        pairs, edges = self._pairs
        most = widths.max(axis=0)
        half = most[pairs][:, :, None] * edges
        corners = np.concatenate([half.sum(axis=1), half[:, 0] - half[:, 1]])
        inside = (np.abs(corners @ self.normals.T) <= most + _ROUNDING * self.size).all(axis=1)
        radius = np.linalg.norm(corners[inside], axis=1).max(initial=0.0)
        return np.full(3, 2.0 / 3.0 * float(radius))

    def _by_sectors(self, pressed: Sequence[_Pressed], widths: FloatArray) -> FloatArray:
        arm = np.array([at.arm for at in pressed[:3]])
        root = np.sqrt([at.area for at in pressed[:3]])
        j, k, m = _TRIPLES.T
        weight = (root[k] * root[m] + root[j] * root[m] + root[j] * root[k]) / 3.0
        given = (
            arm[j] * root[k] * root[m] + arm[k] * root[j] * root[m] + arm[m] * root[j] * root[k]
        ) / 3.0
        margin = np.inf
        for at, there in zip(pressed, widths, strict=True):
            if at.area <= _THIN * self.size**2:
                continue
            slabs, moments = self._sectors(at.region - at.centre, there)
            ratio = widths[:3, slabs] / there[slabs]
            over = (ratio[j] * ratio[k] * ratio[m]) @ moments - given
            needed = np.divide(over, weight, out=np.full(len(over), np.inf), where=weight > 0.0)
            margin = min(margin, float(np.where(over > 0.0, needed, 0.0).max()))
        return arm + margin

    def _sectors(self, corners: FloatArray, widths: FloatArray) -> tuple[IntArray, FloatArray]:
        """Slabs (s,) behind the edges of S(e0), and M_i (s,) of the sectors; ``corners`` from
        e0."""
        ahead = np.roll(corners, -1, axis=0)
        middle = 0.5 * (corners + ahead)
        slab = np.abs(np.abs(middle @ self.normals.T) - widths).argmin(axis=1)
        doubled = np.abs(corners[:, 0] * ahead[:, 1] - corners[:, 1] * ahead[:, 0])
        return slab, doubled / 3.0 * mean_distance_on_segment(corners, ahead)


def _parallelogram_arm(first: FloatArray, second: FloatArray) -> FloatArray:
    """Mean distance from the centre of parallelograms with half sides (..., 2): their diagonals
    cut them into triangles of one area, each of whose mean is 2/3 of that on its outer side."""
    p, q = first + second, second - first
    result: FloatArray = (mean_distance_on_segment(p, q) + mean_distance_on_segment(q, -p)) / 3.0
    return result
