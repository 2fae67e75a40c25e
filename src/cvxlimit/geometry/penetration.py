"""Refusal of blocks that share volume: those in each other by more than their joint tolerance.

Of two blocks whose boxes share more than that,

1. a contact's plane separates two that are convex;
2. the plane of some face separates most others: their extents along its normal overlap by less;
3. what the rest share is computed (manifold3d), and how deep they are in each other there. Of two
   that are convex that is at most the least overlap along normals and across pairs of edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import manifold3d
import numpy as np

import cvxlimit.geometry.mesh as mesh
from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.facing import NUMBERS, THROUGH, Reach
from cvxlimit.geometry.nearmisses import NearMiss, rounded_up
from cvxlimit.geometry.shells import unpinched


@dataclass(frozen=True, eq=False)
class Body:
    """A block's triangles (t, 3, 3), and its solid about an ``origin`` near all that it meets."""

    triangles: FloatArray
    origin: FloatArray
    manifold: manifold3d.Manifold

    @classmethod
    def of(cls, block: Block, origin: FloatArray) -> Body:
        points, faces = unpinched(block.vertices, block.faces)
        corners, _ = mesh.triangulated(points, faces)
        shell = manifold3d.Mesh64(points - origin, corners.astype(np.uint64))
        return cls(points[corners], origin, manifold3d.Manifold(shell))


@dataclass(frozen=True, eq=False)
class Common:
    """What two bodies share: how deep (length) they are in each other, the centroid (3,) and
    corners (k, 3) of the deepest part, and the ``volume`` of all parts."""

    depth: float
    where: FloatArray
    corners: FloatArray
    volume: float

    @classmethod
    def of(cls, one: Body, other: Body) -> Common:
        """The depth is the larger of two measures. The volume over the widest view is right where a
        flat layer is shared; the largest distance of the part's corners from either surface is
        right where a corner is pushed into a face. Both are zero for parts without thickness, which
        Boolean operations leave where bodies merely touch.
        """
        depth, where, deepest, volume = 0.0, one.origin, np.empty((0, 3)), 0.0
        for part in (one.manifold ^ other.manifold).decompose():
            if part.is_empty() or not part.volume() > 0.0:
                continue
            shell = part.to_mesh64()
            corners = np.asarray(shell.vert_properties)[:, :3] + one.origin
            triangles = np.asarray(shell.tri_verts, dtype=np.int64)
            volume += float(part.volume())
            deep = max(_farthest(corners, x.triangles) for x in (one, other))
            deep = max(deep, float(part.volume()) / _widest_view(corners[triangles]))
            if deep > depth:
                _, where = mesh.volume_and_centroid(corners, triangles.tolist())
                depth, deepest = deep, corners
        return cls(depth, where, deepest, volume)


def _widest_view(triangles: FloatArray) -> float:
    """The largest area of a body's shadow, among those along the normals of its triangles."""
    vectors = mesh.polygon_vectors(triangles)
    area = np.linalg.norm(vectors, axis=1)
    real = area > mesh.SLIVER * area.max()
    directions = np.unique((vectors[real] / area[real, None]).round(3), axis=0)
    return float(0.5 * np.abs(directions @ vectors.T).sum(axis=1).max())


def _farthest(points: FloatArray, triangles: FloatArray) -> float:
    """The largest distance of points (k, 3) from a surface of triangles (t, 3, 3). Distant
    triangles are looked at only if none is near, since two curved sides share many small parts."""
    extent = np.ptp(points, axis=0)
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    farthest = np.inf
    for reach in (float(extent.min()), float(np.linalg.norm(extent)), np.inf):
        near = (low <= points.max(axis=0) + reach) & (high >= points.min(axis=0) - reach)
        some = triangles[near.all(axis=1)]
        if len(some):
            parts = np.array_split(points, 1 + 3 * points.size * len(some) // NUMBERS)
            farthest = max(float(_distances(part, some).min(axis=1).max()) for part in parts)
        if farthest <= reach:
            break
    return farthest


def _distances(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Distances (k, t) of points from triangles: from its plane if a point's foot lies within the
    triangle, else from its nearest side."""
    along = np.roll(triangles, -1, axis=1) - triangles
    offset = points[:, None, None] - triangles
    share = np.einsum("ptsk,tsk->pts", offset, along) / np.einsum("tsk,tsk->ts", along, along)
    nearest = triangles + np.clip(share, 0.0, 1.0)[..., None] * along
    aside = np.linalg.norm(points[:, None, None] - nearest, axis=3).min(axis=2)
    normal = mesh.unit(mesh.cross(along[:, 0], along[:, 1]))
    turns = np.einsum("ptsk,tk->pts", mesh.cross(along[None], offset), normal)
    height = np.abs(np.einsum("ptk,tk->pt", offset[:, :, 0], normal))
    return np.where((turns >= 0.0).all(axis=2), height, aside)


@dataclass(frozen=True, eq=False)
class Overlap:
    """Two blocks that share more volume than the ``allowed`` depth (length); ``needed`` is the
    joint tolerance that allows it, and ``are_same`` says that they are one body twice."""

    a: Block
    b: Block
    allowed: float
    depth: float
    needed: float
    common: Common
    are_same: bool

    @property
    def is_deep(self) -> bool:
        """True if it is no inexact joint."""
        return self.depth > THROUGH * min(self.a.thickness, self.b.thickness)

    def near_miss(self) -> NearMiss:
        where, corners = self.common.where, self.common.corners
        return NearMiss(self.a.id, self.b.id, "overlap", self.depth, self.allowed, where, corners)


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Refuses blocks that share more volume than their joint tolerance allows: all that are found,
    in one sentence. ``limit`` is the largest joint tolerance (length) that may be asked for, and
    ``bodies`` are those of the blocks, by number, that were needed so far."""

    blocks: Sequence[Block]
    reach: Reach
    limit: float
    found: list[Overlap] = field(default_factory=list)
    bodies: dict[int, Body] = field(default_factory=dict)

    def check(self, first: IntArray, second: IntArray, contacts: Contacts) -> list[NearMiss]:
        """Looks for blocks that share volume, among the pairs (``first``, ``second``) that may.
        Overlaps that are too shallow to refuse are returned."""
        low, high = self._boxes
        margin = np.minimum(self.reach.tolerance[first], self.reach.tolerance[second])
        shared = np.minimum(high[first], high[second]) - np.maximum(low[first], low[second])
        count = len(self.blocks)
        touching = np.isin(first * count + second, contacts.a * count + contacts.b)
        convex = self._is_convex[first] & self._is_convex[second]
        looked = np.flatnonzero((shared.min(axis=1) > margin) & ~(touching & convex))
        misses, deep = list[NearMiss](), sum(overlap.is_deep for overlap in self.found)
        for j in looked.tolist():
            overlap = self._of(int(first[j]), int(second[j]), float(margin[j]))
            if overlap is None:
                continue
            if overlap.needed <= overlap.allowed:
                misses.append(overlap.near_miss())
                continue
            self.found.append(overlap)
            deep += overlap.is_deep
            if deep >= _MOST_DEEP:
                self.refuse("at least ")
        return misses

    def refuse(self, at_least: str = "") -> None:
        """Raises GeometryError if overlaps were found, which names the deepest."""
        if not self.found:
            return
        twice = [overlap for overlap in self.found if overlap.are_same]
        worst = twice[0] if twice else max(self.found, key=lambda overlap: overlap.depth)
        number = f"{at_least}{len(twice or self.found)} pairs"
        if twice:
            more = f"; {number} are" if len(twice) > 1 else ""
            fault = (
                f"are the same body twice, in the same place (centre "
                f"{mesh.place(worst.a.centroid)}): remove one of them{more}"
            )
        else:
            more, which = f", the most of {number}" if len(self.found) > 1 else "", "one of them"
            which = "them" if more else which
            # as wide as is usual for the thickest two blocks, lest joints between these be lost
            enough = max(overlap.needed for overlap in self.found)
            enough = max(enough, float(np.sort(self.reach.tolerance)[-2]))
            cure = f"move or cut {which}"
            if enough < self.limit and not any(overlap.is_deep for overlap in self.found):
                cure += f", or raise joint_tolerance to {rounded_up(enough)}"
                cure += ", which takes all," if more else ""
                cure += " if the model is no more exact"
            fault = (
                f"interpenetrate by about {worst.depth:.3g} near {mesh.place(worst.common.where)}, "
                f"beyond their joint tolerance of {worst.allowed:.3g}{more}: {cure}"
            )
        ids = worst.a.id, worst.b.id
        raise GeometryError(
            f"blocks {ids[0]!r} and {ids[1]!r} {fault}", points=worst.common.corners, blocks=ids
        )

    def _of(self, i: int, k: int, allowed: float) -> Overlap | None:
        """None if blocks i and k overlap by no more than ``allowed`` (length)."""
        a, b = self.blocks[i], self.blocks[k]
        directions = np.concatenate([a.normals, -b.normals])
        overlaps = (a.vertices @ directions.T).max(0) - (b.vertices @ directions.T).min(0)
        if overlaps.min() <= allowed:
            return None
        common = Common.of(self._body(i), self._body(k))
        depth, is_convex = common.depth, a.is_convex and b.is_convex
        if is_convex:  # an edge that runs across a face has no corner in it, and half its thickness
            depth = max(depth, min(float(overlaps.min()), _overlap_across_edges(a, b)))
        if depth <= allowed:
            return None
        # The same body: what only one of them holds is a layer of the default joint tolerance,
        # however their vertices are listed and their faces cut.
        layer = min(x.joint_tolerance * x.surface for x in (a, b))
        are_same = a.volume + b.volume - 2.0 * common.volume <= layer
        needed = depth if is_convex else depth / _REFUSED
        return Overlap(a, b, allowed, depth, needed, common, are_same)

    @cached_property
    def _boxes(self) -> tuple[FloatArray, FloatArray]:
        count = np.array([len(b.vertices) for b in self.blocks])
        points = np.concatenate([b.vertices for b in self.blocks])
        begin = np.cumsum(count) - count
        return np.minimum.reduceat(points, begin), np.maximum.reduceat(points, begin)

    @cached_property
    def _is_convex(self) -> BoolArray:
        return np.array([b.is_convex for b in self.blocks])

    def _body(self, i: int) -> Body:
        if i not in self.bodies:
            low, high = self._boxes
            middle = 0.5 * (low.min(axis=0) + high.max(axis=0))
            self.bodies[i] = Body.of(self.blocks[i], middle)
        return self.bodies[i]


_REFUSED = 2.0
"""Overlaps of bodies that are not convex are refused beyond so many tolerances: where two planes
meet, corners of joints that overlap by one tolerance each lie deeper than either."""


_MOST_DEEP = 100
"""So many overlaps that no inexact joint has are counted: where a program has lost the placements
of blocks nearly all pairs overlap, and neither time nor memory may grow with their number."""


_MOST_EDGES = 150
"""Of convex bodies with more edges no planes through pairs of them are tried: 20 ms for 90 x 90."""


def _overlap_across_edges(a: Block, b: Block) -> float:
    """Least overlap over the planes along an edge of each; -inf where those are too many."""
    first, second = _edge_directions(a), _edge_directions(b)
    if max(len(first), len(second)) > _MOST_EDGES:
        return -np.inf
    directions = np.cross(first[:, None], second).reshape(-1, 3)
    length = np.linalg.norm(directions, axis=1)
    directions = directions[length > 1e-9] / length[length > 1e-9, None]
    one, other = a.vertices @ directions.T, b.vertices @ directions.T
    overlaps = np.minimum(one.max(0) - other.min(0), other.max(0) - one.min(0))
    return float(overlaps.min(initial=np.inf))


def _edge_directions(block: Block) -> FloatArray:
    table = mesh.EdgeTable.of(block.faces)
    sides = table.start < table.end  # each edge once: its faces go along it both ways
    return mesh.unit(block.vertices[table.end[sides]] - block.vertices[table.start[sides]])
