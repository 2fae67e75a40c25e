"""Points between displaced blocks, by exact geometry: places, normals, gaps and slips.

The gap of two planes is linear over their overlap, so that the overlap's corners say all: corners
of each facet over the other, and crossings of their edges. A corner's gap is its distance from the
other facet's plane, along that plane's own normal; that of crossing edges is along both edges'
common perpendicular. With other normals the iterates converge linearly, and a contact that appears
on the way costs 7e-5 of the load factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.paths.pairs import Facets, Pairs, Pose
from cvxlimit.paths.path import CLOSED, Points
from cvxlimit.scene import Scene

NEAR = 1e-9
"""Rounding of directions: what counts as parallel or normal."""

SETTLED = 1e-7
"""Movement over the contact size that iterates may leave at most. Flush blocks are flush to that,
and a corner that is as near to an edge lies on it: with less, rounding decides whether there is a
point more, with another normal, and forces on it cannot be found again."""

DEEP = 0.5
"""Share of the thinner block's thickness: what is deeper behind a facet is behind its block."""


@dataclass(frozen=True, eq=False)
class Start:
    """Where a step starts: the pose, the pairs of facets that may meet in it, and which of them
    (P,) touch at the start over an area. Slips count in these, where the gap was no wider than
    ``loose``: what slid in the step before has opened by as much."""

    facets: Facets
    pose: Pose
    pairs: Pairs
    touches: BoolArray
    loose: float

    @classmethod
    def at(cls, facets: Facets, pose: Pose, loose: float = 0.0) -> Self:
        pairs = facets.pairs(*facets.near(pose))
        loose = loose + CLOSED * facets.size
        start = cls(facets, pose, pairs, np.zeros(pairs.block.shape[1], dtype=bool), loose)
        found, pair, _ = _met(start, pose)
        start.touches[pair[found.gap <= loose]] = True
        return start

    @classmethod
    def first(cls, scene: Scene, reach: float) -> Self:
        """Pairs that face each other within the joint tolerance count as closed."""
        facets, pose = Facets(scene, reach), Pose.first(scene)
        a, b = facets.near(pose)
        start = cls(facets, pose, facets.pairs(a, b), np.zeros(len(a), dtype=bool), 0.0)
        found, pair, _ = _met(start, pose)
        most = np.zeros(len(a))
        np.maximum.at(most, pair, np.abs(found.gap))
        is_closed = (np.bincount(pair, minlength=len(a)) > 2) & (most <= facets.allowed(a, b))
        facets.close(a[is_closed], b[is_closed])
        return cls.at(facets, pose)

    def points(self, pose: Pose) -> Points:
        """All points at a pose, with slips since the start."""
        return _met(self, pose)[0]

    def numbered(self, pose: Pose) -> tuple[Points, IntArray]:
        """The same, and numbers (k,) that ascend, by which the step's next poses have them too."""
        points, _, number = _met(self, pose)
        return points, number


def _met(begin: Start, pose: Pose) -> tuple[Points, IntArray, IntArray]:
    """The points, and of each the pair, and the number among all corners and crossings."""
    facets, pairs, start, size = begin.facets, begin.pairs, begin.pose, begin.facets.size
    normal = np.stack([pose.turned(pairs.block[k], pairs.normal[k]) for k in (0, 1)])
    plane = np.stack([pose.placed(pairs.block[k], pairs.plane[k]) for k in (0, 1)])
    mean = _unit(normal[0] - normal[1])
    basis = _tangents(mean)
    tail, along = list[FloatArray](), list[FloatArray]()
    flat_tail, flat_head = list[FloatArray](), list[FloatArray]()
    for k, pair in enumerate(pairs.pair):
        ends = [pose.placed(pairs.block[k][pair], x[k]) for x in (pairs.tail, pairs.head)]
        tail.append(ends[0])
        along.append(ends[1] - ends[0])
        for flat, x in ((flat_tail, ends[0]), (flat_head, ends[1])):
            flat.append(np.einsum("eix,ex->ei", basis[pair], x - plane[0][pair]))
    i, j = pairs.couples
    near, edges = SETTLED * size, (i, j)
    is_over = [
        _inside(flat_tail[k], edges[k], flat_tail[1 - k][edges[1 - k]],
                flat_head[1 - k][edges[1 - k]], near)
        for k in (0, 1)
    ]  # fmt: skip
    # A corner of a at one of b's where the planes are parallel is the same point once more.
    apart = np.linalg.norm(tail[0][i] - tail[1][j], axis=1)
    is_same = (apart <= near) & is_over[1][j]
    is_same &= (np.einsum("px,px->p", normal[0], normal[1]) < NEAR - 1.0)[pairs.pair[0][i]]
    is_over[0][i[is_same]] = False
    flat_along = [head - tail for head, tail in zip(flat_head, flat_tail, strict=True)]
    s, t = _crossings(flat_tail[0][i], flat_along[0][i], flat_tail[1][j], flat_along[1][j], near)
    crossed = np.flatnonzero(np.isfinite(s))
    i, j = i[crossed], j[crossed]
    s, t = s[crossed, None], t[crossed, None]

    corner = [np.flatnonzero(over) for over in is_over]
    pair_of = [pairs.pair[0][corner[0]], pairs.pair[1][corner[1]], pairs.pair[0][i]]
    crossing = tail[0][i] + s * along[0][i], tail[1][j] + t * along[1][j]
    crossed_by = _ways(pairs, pose, (i, j), normal, (along[0][i], along[1][j]), mean)
    ways = -normal[1][pair_of[0]], normal[0][pair_of[1]]
    at = [tail[0][corner[0]], tail[1][corner[1]], 0.5 * (crossing[0] + crossing[1])]
    n = np.concatenate([*ways, crossed_by])
    above = np.concatenate([
        plane[1][pair_of[0]] - at[0], at[1] - plane[0][pair_of[1]], crossing[1] - crossing[0],
    ])  # fmt: skip
    gap = np.einsum("kx,kx->k", above, n)
    pair, x = np.concatenate(pair_of), np.concatenate(at)
    a, b = pairs.block[:, pair]
    is_kept = gap >= -DEEP * np.minimum(facets.thickness[a], facets.thickness[b])
    kept = np.flatnonzero(is_kept & (_widths(pair, x, basis) > CLOSED * size)[pair])
    a, b, x, n, gap, pair = a[kept], b[kept], x[kept], n[kept], gap[kept], pair[kept]

    # Of b against a since the start, as the block sees it that the normal belongs to.
    slid = start.placed(a, pose.origin(a, x)) - start.placed(b, pose.origin(b, x))
    owner = np.where(kept < len(at[0]), b, a)
    slid = pose.turned(owner, np.einsum("kji,kj->ki", start.turn[owner], slid))
    was_closed = np.abs(gap - np.einsum("kx,kx->k", slid, n)) <= begin.loose
    was_closed &= begin.touches[pair]
    tangents = _tangents(n)
    slip = np.where(was_closed[:, None], np.einsum("kix,kx->ki", tangents, slid), 0.0)
    axes = np.concatenate([tangents, n[:, None]], axis=1)
    more = np.cumsum([0, *map(len, tail)])
    number = np.concatenate([more[0] + corner[0], more[1] + corner[1], more[2] + crossed])[kept]
    return Points(a, b, x, axes, gap, slip, facets.friction(a, b)), pair, number


def _ways(
    pairs: Pairs, pose: Pose, at: tuple[IntArray, IntArray], normal: FloatArray,
    along: tuple[FloatArray, FloatArray], mean: FloatArray,
) -> FloatArray:  # fmt: skip
    """Directions (k, 3) of the gaps at crossing edges ``at`` of both sides, the same for every pair
    of facets that these edges belong to: the edges' common perpendicular, where it lies between
    the normals of the two faces at each edge. Where it lies beyond one of them, the edges cross on
    that face, and its normal it is: an edge that slides on a face keeps one normal. Beyond faces of
    both sides nothing touches there, and the pair's mean normal says how far the facets are apart.
    """
    pair = pairs.pair[0][at[0]]
    across = np.cross(*along)
    towards = np.copysign(1.0, np.einsum("kx,kx->k", across, mean[pair]))
    way = _unit(across) * towards[:, None]
    chosen, is_beyond = way.copy(), np.zeros((2, len(way)), dtype=bool)
    for k, sign in ((0, 1.0), (1, -1.0)):
        own = normal[k][pair]
        beside = pose.turned(pairs.block[k][pair], pairs.beside[k][at[k]])
        least = NEAR * np.linalg.norm(along[k], axis=1)
        inwards = np.cross(own, along[k]), np.cross(along[k], beside)
        for face, inward in zip((own, beside), inwards, strict=True):
            beyond = sign * np.einsum("kx,kx->k", way, inward) > least
            chosen[beyond] = sign * face[beyond]
            is_beyond[k] |= beyond
    is_apart = is_beyond.all(axis=0) | (np.einsum("kx,kx->k", chosen, mean[pair]) <= 0.0)
    return np.where(is_apart[:, None], mean[pair], chosen)


def _widths(pair: IntArray, x: FloatArray, basis: FloatArray) -> FloatArray:
    """Least spread of the points x (k, 3) of each pair, (P,): blocks that pass each other edge by
    edge overlap by nothing but rounding."""
    flat = np.einsum("kix,kx->ik", basis[pair], x)
    count = np.maximum(np.bincount(pair, minlength=len(basis)), 1)
    flat -= np.stack([np.bincount(pair, f, len(basis)) / count for f in flat])[:, pair]
    xx, xy, yy = (
        np.bincount(pair, flat[i] * flat[j], len(basis)) / count
        for i, j in ((0, 0), (0, 1), (1, 1))
    )
    half = 0.5 * (xx + yy)
    larger = half + np.sqrt(np.maximum(half**2 - (xx * yy - xy**2), 0.0))
    least = (xx * yy - xy**2) / np.where(larger > 0.0, larger, 1.0)
    return np.sqrt(np.maximum(least, 0.0))


def _inside(
    corner: FloatArray, of: IntArray, tail: FloatArray, head: FloatArray, near: float
) -> BoolArray:
    """Which of the corners (c, 2) lie in an outline or near it; edges (e, 2) are those of the
    outline that corner ``of`` (e,) is looked for in. A ray crosses it an odd number of times, if
    edges that meet have the very same end."""
    to_tail, to_head = tail - corner[of], head - corner[of]
    along = head - tail
    is_across = (to_tail[:, 1] > 0.0) != (to_head[:, 1] > 0.0)
    rise = np.where(is_across, along[:, 1], 1.0)
    is_across &= to_tail[:, 0] - to_tail[:, 1] * along[:, 0] / rise > 0.0
    count = np.bincount(of[is_across], minlength=len(corner))
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    share = np.clip(-(to_tail * along).sum(axis=1) / square, 0.0, 1.0)[:, None]
    is_near = np.linalg.norm(to_tail + share * along, axis=1) <= near
    return np.asarray((count % 2 == 1) | (np.bincount(of[is_near], minlength=len(corner)) > 0))


def _crossings(
    tail: FloatArray, along: FloatArray, other: FloatArray, beside: FloatArray, near: float
) -> tuple[FloatArray, FloatArray]:
    """Where edges (e, 2) cross inside both, as shares of their lengths; NaN elsewhere. Crossings
    near an end are corners that :func:`_inside` has."""
    lengths = np.linalg.norm(along, axis=1), np.linalg.norm(beside, axis=1)
    turn, offset = _cross(along, beside), other - tail
    is_plain = np.abs(turn) > NEAR * lengths[0] * lengths[1]
    divisor = np.where(is_plain, turn, 1.0)
    s, t = _cross(offset, beside) / divisor, _cross(offset, along) / divisor
    for share, length in zip((s, t), lengths, strict=True):
        is_plain &= (share * length > near) & ((1.0 - share) * length > near)
    return np.where(is_plain, s, np.nan), t


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1)[..., None])


def _tangents(n: FloatArray) -> FloatArray:
    """Two unit vectors (k, 2, 3) across each normal (k, 3), right-handed with it."""
    least = np.eye(3)[np.abs(n).argmin(axis=1)]
    first = _unit(np.cross(least, n))
    return np.stack([first, np.cross(n, first)], axis=1)
