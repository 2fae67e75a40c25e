"""Points between displaced blocks, by exact geometry: places, normals, gaps and slips.

The gap of two planes is linear over their overlap, so that the overlap's corners say all: corners
of each facet over the other, and crossings of their edges. A corner's gap is its distance from the
other facet's plane, along that plane's own normal; that of crossing edges is along both edges'
common perpendicular. With other normals the iterates converge linearly, and a contact that appears
on the way costs 7e-5 of the load factor.

Arrays are over P pairs of facets, E edges of one side's outlines, and k points. Normals point from
block a into block b, gaps are positive where the blocks are apart, and lengths are in the scene's
unit.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.extensions.paths.bonds import Bonds, tangents
from cvxlimit.extensions.paths.configuration import Points
from cvxlimit.extensions.paths.pairs import CLOSED, Facets, Pairs, Pose
from cvxlimit.scene import Scene

SETTLED = 1e-7
"""Largest movement, over the contact size, that iterates may leave. Flush blocks are flush to that
tolerance, and a corner that is as near to an edge lies on it: with a smaller one, rounding would
decide whether there is one more point, with another normal, whose forces no later iterate has."""

DEEP = 0.5
"""Share of the thinner block's thickness: points deeper behind a facet lie behind its block."""


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a step.

    Attributes
    ----------
    facets : Facets
    pose : Pose
        Where the blocks are at the start; slips are measured from it.
    pairs : Pairs
        Pairs of facets that may meet during the step.
    touches : (P,) array of bool
        Which of them touch over an area at the start. Slips count in these alone, where the gap was
        at most ``loose``.
    loose : float
        Gap (length) by which joints that slid in the step before have opened.
    bonds : Bonds or None
        Cohesion and ties that hold.
    """

    facets: Facets
    pose: Pose
    pairs: Pairs
    touches: BoolArray
    loose: float
    bonds: Bonds | None = None

    @classmethod
    def at(cls, facets: Facets, pose: Pose, loose: float = 0.0, bonds: Bonds | None = None) -> Self:
        """Returns the start of a step from a ``pose``, whose joints have opened by ``loose``."""
        pairs = facets.pairs(*facets.near(pose))
        loose = loose + CLOSED * facets.size
        start = cls(facets, pose, pairs, np.zeros(pairs.block.shape[1], dtype=bool), loose, bonds)
        found, pair, _ = _met(start, pose)
        start.touches[pair[found.gap <= loose]] = True
        return start

    @classmethod
    def first(cls, scene: Scene, reach: float, moving: Collection[str] = ()) -> Self:
        """Returns the start from the scene as given, where pairs of facets that face each other
        within the joint tolerance count as closed, and those that are no contact of the scene,
        since they meet in a sliver, are left out; ``reach`` (length) is how far apart facets may
        be to meet, and ``moving`` are supports among the free blocks."""
        facets, pose = Facets(scene, reach, moving), Pose.first(scene)
        a, b = facets.near(pose)
        start = cls(facets, pose, facets.pairs(a, b), np.zeros(len(a), dtype=bool), 0.0)
        found, pair, _ = _met(start, pose)
        most = np.zeros(len(a))
        np.maximum.at(most, pair, np.abs(found.gap))
        is_closed = (np.bincount(pair, minlength=len(a)) > 2) & (most <= facets.allowed(a, b))
        facets.close(a[is_closed], b[is_closed])
        a, b = a[is_closed], b[is_closed]
        is_sliver = ~_are_contacts(facets, a, b)
        facets.leave_out(a[is_sliver], b[is_sliver])
        return cls.at(facets, pose)

    def points(self, pose: Pose) -> Points:
        """Returns all points at a pose, with slips since the start."""
        return self.numbered(pose)[0]

    def at_rest(self) -> Points:
        """Returns the closed points of joints that are contacts of the scene, and of bars, where
        blocks are at first: edges and corners that touch beside them bear from the first step
        on."""
        points, pair, _ = _met(self, self.pose)
        kept = (points.gap <= CLOSED * self.facets.size) & self.pairs.is_closed[pair]
        points = points.take(kept)
        return points if self.bonds is None else self.bonds.on(points, kept[kept], self.pose)

    def numbered(self, pose: Pose) -> tuple[Points, IntArray]:
        """Returns all points at a pose, and ascending numbers (k,) that name the same points at
        other poses of the step."""
        points, pair, number = _met(self, pose)
        if self.bonds is not None:
            points = self.bonds.on(points, self.touches[pair], pose)
        return points, number


def _are_contacts(facets: Facets, a: IntArray, b: IntArray) -> BoolArray:
    """Returns which pairs of facets (k,) meet, where blocks are at first, in a contact of a scene:
    between the same blocks, and somewhere on the same place."""
    contacts, near = facets.scene.contacts, facets.allowed(a, b)
    found = np.zeros(len(a), dtype=bool)
    blocks = np.sort(np.stack([contacts.a, contacts.b]), axis=0)
    start = contacts.corner_start
    for i, (one, other) in enumerate(
        np.sort([facets.block[a], facets.block[b]], axis=0).T.tolist()
    ):
        corners = [facets.tail[slice(*facets.start[k : k + 2])] for k in (a[i], b[i])]
        for j in np.flatnonzero((blocks[0] == one) & (blocks[1] == other)).tolist():
            if start[j] == start[j + 1]:
                continue
            # On the contact's plane both facets and its corners have boxes that meet.
            axes, flat = contacts.axes[j], contacts.corner_xy[start[j] : start[j + 1]]
            own = [(x - contacts.origin[j]) @ axes.T for x in corners]
            low = np.max([flat.min(0), *(x[:, :2].min(0) for x in own)], axis=0)
            high = np.min([flat.max(0), *(x[:, :2].max(0) for x in own)], axis=0)
            off = max(np.abs(x[:, 2]).min() for x in own)
            found[i] |= bool((high - low > near[i]).all() and off <= near[i])
    return found


class _Edges(NamedTuple):
    """The edges of one side's outlines: tails and directions in space (E, 3), and tails and heads
    in the mean planes of their pairs (E, 2)."""

    tail: FloatArray
    along: FloatArray
    flat_tail: FloatArray
    flat_head: FloatArray

    @classmethod
    def of(
        cls, pairs: Pairs, side: int, pose: Pose, origin: FloatArray, basis: FloatArray
    ) -> _Edges:  # fmt: skip
        """Returns those of a side at a pose, in planes through an ``origin`` (P, 3)."""
        pair = pairs.pair[side]
        block = pairs.block[side][pair]
        tail, head = (pose.placed(block, x[side]) for x in (pairs.tail, pairs.head))
        flat = (np.einsum("eix,ex->ei", basis[pair], x - origin[pair]) for x in (tail, head))
        return cls(tail, head - tail, *flat)


def _met(begin: Start, pose: Pose) -> tuple[Points, IntArray, IntArray]:
    """Returns the points at a pose, and for each its pair and its number among all corners and
    crossings."""
    # Planes of both facets of each pair, and a mean plane in which outlines are compared.
    facets, pairs, size = begin.facets, begin.pairs, begin.facets.size
    normal = np.stack([pose.turned(pairs.block[k], pairs.normal[k]) for k in (0, 1)])
    plane = np.stack([pose.placed(pairs.block[k], pairs.plane[k]) for k in (0, 1)])
    mean = _unit(normal[0] - normal[1])
    basis = tangents(mean)
    one, other = (_Edges.of(pairs, k, pose, plane[0], basis) for k in (0, 1))

    # Points of the overlap: corners of either side over the other facet, and crossings of edges.
    is_parallel = np.einsum("px,px->p", normal[0], normal[1]) < ROUNDING - 1.0
    corner = _corners(pairs, one, other, is_parallel, SETTLED * size)
    crossed, s, t = _crossings(pairs, one, other, SETTLED * size)
    i, j = (edges[crossed] for edges in pairs.couples)

    # Their places, normals and gaps: corners of a, corners of b, crossings, in this order.
    pair_of = [pairs.pair[0][corner[0]], pairs.pair[1][corner[1]], pairs.pair[0][i]]
    crossing = one.tail[i] + s * one.along[i], other.tail[j] + t * other.along[j]
    crossed_by, is_apart = _ways(pairs, pose, (i, j), normal, (one.along[i], other.along[j]), mean)
    at = [one.tail[corner[0]], other.tail[corner[1]], 0.5 * (crossing[0] + crossing[1])]
    n = np.concatenate([-normal[1][pair_of[0]], normal[0][pair_of[1]], crossed_by])
    above = np.concatenate([
        plane[1][pair_of[0]] - at[0], at[1] - plane[0][pair_of[1]], crossing[1] - crossing[0],
    ])  # fmt: skip
    gap = np.einsum("kx,kx->k", above, n)
    pair, x = np.concatenate(pair_of), np.concatenate(at)

    # Points behind a block, of overlaps without width, and overlaps where nothing touches are left
    # out.
    a, b = pairs.block[:, pair]
    is_kept = gap >= -DEEP * np.minimum(facets.thickness[a], facets.thickness[b])
    is_kept[len(x) - len(crossed) :] &= ~is_apart | (gap[len(x) - len(crossed) :] >= 0.0)
    kept = np.flatnonzero(is_kept & (_widths(pair, x, basis) > pairs.least)[pair])
    a, b, x, n, gap, pair = a[kept], b[kept], x[kept], n[kept], gap[kept], pair[kept]
    more = np.cumsum([0, len(one.tail), len(other.tail)])
    number = np.concatenate([more[0] + corner[0], more[1] + corner[1], more[2] + crossed])[kept]
    owner = np.where(kept < len(at[0]), b, a)  # of the block that the normal belongs to
    axes = np.concatenate([tangents(n), n[:, None]], axis=1)
    slip = _slips(begin, pose, (a, b, owner), x, axes, gap)
    slip[~begin.touches[pair]] = 0.0
    return Points(a, b, x, axes, gap, slip, facets.friction(a, b)), pair, number


def _slips(
    begin: Start, pose: Pose, blocks: tuple[IntArray, IntArray, IntArray], x: FloatArray,
    axes: FloatArray, gap: FloatArray,
) -> FloatArray:  # fmt: skip
    """Returns slips (k, 2) of block b against a since the start, in the frame of the owner of the
    normal, at points that were closed then; ``blocks`` are a, b and the owner of each."""
    start, (a, b, owner) = begin.pose, blocks
    slid = start.placed(a, pose.origin(a, x)) - start.placed(b, pose.origin(b, x))
    slid = pose.turned(owner, np.einsum("kji,kj->ki", start.turn[owner], slid))
    was_closed = np.abs(gap - np.einsum("kx,kx->k", slid, axes[:, 2])) <= begin.loose
    return np.where(was_closed[:, None], np.einsum("kix,kx->ki", axes[:, :2], slid), 0.0)


def _ways(
    pairs: Pairs, pose: Pose, at: tuple[IntArray, IntArray], normal: FloatArray,
    along: tuple[FloatArray, FloatArray], mean: FloatArray,
) -> tuple[FloatArray, BoolArray]:  # fmt: skip
    """Returns the directions (k, 3) of gaps at crossing edges, numbered ``at`` on either side.

    A direction is the edges' common perpendicular where it lies between the normals of the two
    faces at each edge, whichever pair of facets the edges are seen from. Where it lies beyond one
    of these faces, the edges cross on that face and its normal is taken, so that an edge that
    slides on a face keeps one normal. Where it lies beyond faces of both sides nothing touches, as
    is said beside, and the pair's ``mean`` normal tells how far the facets are apart.
    """
    pair = pairs.pair[0][at[0]]
    across = np.cross(*along)
    towards = np.copysign(1.0, np.einsum("kx,kx->k", across, mean[pair]))
    way = _unit(across) * towards[:, None]
    chosen, is_beyond = way.copy(), np.zeros((2, len(way)), dtype=bool)
    for k, sign in ((0, 1.0), (1, -1.0)):
        own = normal[k][pair]
        beside = pose.turned(pairs.block[k][pair], pairs.beside[k][at[k]])
        least = ROUNDING * np.linalg.norm(along[k], axis=1)
        inwards = np.cross(own, along[k]), np.cross(along[k], beside)
        for face, inward in zip((own, beside), inwards, strict=True):
            beyond = sign * np.einsum("kx,kx->k", way, inward) > least
            chosen[beyond] = sign * face[beyond]
            is_beyond[k] |= beyond
    is_apart = is_beyond.all(axis=0) | (np.einsum("kx,kx->k", chosen, mean[pair]) <= 0.0)
    return np.where(is_apart[:, None], mean[pair], chosen), is_apart


def _widths(pair: IntArray, x: FloatArray, basis: FloatArray) -> FloatArray:
    """Returns the smaller standard deviation (P,) of each pair's points ``x`` (k, 3) in its plane.

    It is rounding for blocks that pass each other edge by edge, whose overlap has no width.
    """
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
    """Returns which of the corners (c, 2) lie in an outline, or within ``near`` (length) of it.

    Edges from ``tail`` to ``head`` (e, 2) are those of the outline in which corner ``of`` (e,) is
    looked for. A ray from a corner inside crosses it an odd number of times, provided that edges
    that meet have exactly the same end.
    """
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


def _corners(
    pairs: Pairs, one: _Edges, other: _Edges, is_parallel: BoolArray, near: float
) -> list[IntArray]:  # fmt: skip
    """Returns the numbers of the corners of either side that lie over the other facet. A corner of
    a at one of b's is the same point once more where the planes of their pair are parallel (P,)."""
    i, j = pairs.couples
    is_over = [
        _inside(one.flat_tail, i, other.flat_tail[j], other.flat_head[j], near),
        _inside(other.flat_tail, j, one.flat_tail[i], one.flat_head[i], near),
    ]
    apart = np.linalg.norm(one.tail[i] - other.tail[j], axis=1)
    is_same = (apart <= near) & is_over[1][j] & is_parallel[pairs.pair[0][i]]
    is_over[0][i[is_same]] = False
    return [np.flatnonzero(over) for over in is_over]


def _crossings(
    pairs: Pairs, one: _Edges, other: _Edges, near: float
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Returns which couples of edges cross in their mean plane, and where (k, 1), as shares of both
    lengths.

    Crossings ``near`` an end (length) are left out: :func:`_inside` counts the corner there.
    """
    i, j = pairs.couples
    tail, head = one.flat_tail[i], one.flat_head[i]
    along, beside = head - tail, other.flat_head[j] - other.flat_tail[j]
    lengths = np.linalg.norm(along, axis=1), np.linalg.norm(beside, axis=1)
    turn, offset = _cross(along, beside), other.flat_tail[j] - tail
    is_plain = np.abs(turn) > ROUNDING * lengths[0] * lengths[1]
    divisor = np.where(is_plain, turn, 1.0)
    s, t = _cross(offset, beside) / divisor, _cross(offset, along) / divisor
    for share, length in zip((s, t), lengths, strict=True):
        is_plain &= (share * length > near) & ((1.0 - share) * length > near)
    crossed = np.flatnonzero(is_plain)
    return crossed, s[crossed, None], t[crossed, None]


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Returns the third component (k,) of the cross products of plane vectors (k, 2)."""
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def _unit(vectors: FloatArray) -> FloatArray:
    """Returns vectors (..., 3) divided by their lengths."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1)[..., None])
