"""Poses of blocks, and pairs of facets that may meet: they persist while contacts come and go."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.facets import planes
from cvxlimit.geometry.facing import Reach
from cvxlimit.geometry.mesh import area_vectors
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.polygons import members_of
from cvxlimit.results.movement import rotation
from cvxlimit.scene import Scene

CLOSED = 1e-6
"""Gap, over the contact size, up to which a point is closed; overlaps that are wider count."""

OPPOSED = -0.5
"""Largest cosine between normals of facets that may meet: they face each other within 60
degrees."""


@dataclass(frozen=True, eq=False)
class Pose:
    """The places of all B blocks: x -> centroid + shift + turn @ (x - centroid), from where they
    were at first.

    ``centroid`` (B, 3) are the first centroids, ``shift`` (B, 3) their translations and ``turn``
    (B, 3, 3) rotation matrices.
    """

    centroid: FloatArray
    shift: FloatArray
    turn: FloatArray

    @classmethod
    def first(cls, scene: Scene) -> Self:
        """Returns the pose of the scene as given."""
        centroid = np.array([block.centroid for block in scene.blocks])
        return cls(centroid, np.zeros_like(centroid), np.tile(np.eye(3), (len(centroid), 1, 1)))

    @property
    def middle(self) -> FloatArray:
        """The centroids (B, 3) in this pose."""
        return self.centroid + self.shift

    def placed(self, block: IntArray, x: FloatArray) -> FloatArray:
        """Returns where points of blocks (k,) are in this pose that were at ``x`` (k, 3) at
        first."""
        arm = np.einsum("kij,kj->ki", self.turn[block], x - self.centroid[block])
        return np.asarray(self.middle[block] + arm)

    def origin(self, block: IntArray, x: FloatArray) -> FloatArray:
        """Returns where points of blocks (k,) were at first that are at ``x`` (k, 3) in this
        pose."""
        arm = np.einsum("kji,kj->ki", self.turn[block], x - self.middle[block])
        return np.asarray(self.centroid[block] + arm)

    def turned(self, block: IntArray, vector: FloatArray) -> FloatArray:
        """Returns vectors (k, 3) of blocks (k,) rotated with them."""
        return np.asarray(np.einsum("kij,kj->ki", self.turn[block], vector))

    def moved(self, blocks: IntArray, d: FloatArray) -> Pose:
        """Returns the pose after finite displacements ``d`` (k, 6) of some blocks: translations of
        their centroids and rotation vectors."""
        shift, turn = self.shift.copy(), self.turn.copy()
        shift[blocks] += d[:, :3]
        turn[blocks] = rotation(d[:, 3:]) @ turn[blocks]
        return Pose(self.centroid, shift, turn)

    def since(self, other: Pose, blocks: IntArray) -> FloatArray:
        """Returns the displacements (k, 6) of some blocks that lead here from another pose."""
        turn = self.turn[blocks] @ np.swapaxes(other.turn[blocks], 1, 2)
        way = self.shift[blocks] - other.shift[blocks]
        return np.concatenate([way, Rotation.from_matrix(turn).as_rotvec()], axis=1)


@dataclass(frozen=True, eq=False)
class Pairs:
    """The P pairs of facets, a and b, with the blocks where they were at first.

    ``normal`` and ``plane`` (2, P, 3) are of both sides' planes, ``block`` (2, P) their blocks. The
    E edges of each side's outlines stand pair by pair, each of its ``pair`` (E,), from a corner
    ``tail`` (E, 3) to the next, ``head``, counter-clockwise from outside, holes the other way;
    ``beside`` is the normal of the face beyond the edge. Overlaps count that are wider than
    ``least`` (P,), as a standard deviation (length); ``is_closed`` (P,) tells the contacts of the
    scene.
    """

    block: IntArray
    normal: FloatArray
    plane: FloatArray
    tail: tuple[FloatArray, FloatArray]
    head: tuple[FloatArray, FloatArray]
    beside: tuple[FloatArray, FloatArray]
    pair: tuple[IntArray, IntArray]
    least: FloatArray
    is_closed: BoolArray

    @cached_property
    def couples(self) -> tuple[IntArray, IntArray]:
        """Numbers (k,), (k,) of every edge of side a with every edge of side b of the same pair."""
        begin = np.searchsorted(self.pair[1], np.arange(self.block.shape[1]))
        return members_of(begin, len(self.pair[1]), self.pair[0])


class Facets:
    """The F planar facets of all blocks of a scene, with the blocks where they are at first.

    Attributes
    ----------
    block : (F,) array of int
        Block of each facet.
    normal, plane : (F, 3) arrays
        Outward normal, and a point of the plane.
    start : (F + 1,) array of int
        Number of each facet's first edge.
    tail, head, beside : (E, 3) arrays
        Ends of every edge, and the normal of the face beyond it.
    reach : float
        How far apart facets may be to meet (length).
    closed : array of int
        Keys of the pairs of facets whose gaps are counted from their common plane.
    slivers : array of int
        Keys of those that meet at first in a joint too narrow to be a contact of the scene, until
        they meet in one that is wider than the joint tolerance.
    """

    def __init__(self, scene: Scene, reach: float, moving: Collection[str] = ()) -> None:
        self.scene, self.reach, self.size = scene, reach, scene.contacts.typical_size
        self.vertices = [block.vertices for block in scene.blocks]
        fixed = {*scene.supports, *moving}  # contacts between supports do not count
        self.is_fixed = np.array([block.id in fixed for block in scene.blocks])
        outlines = [_outlines(block) for block in scene.blocks]
        self.block = np.repeat(np.arange(len(outlines)), [len(o) for o in outlines])
        loops = [facet for block in outlines for facet in block]
        self.start = np.cumsum([0, *(len(loop[0]) for loop in loops)])
        self.tail, self.head, self.beside = (
            np.concatenate([loop[i] for loop in loops]) for i in range(3)
        )
        self.normal = np.array([loop[3] for loop in loops])
        self.plane = np.add.reduceat(self.tail, self.start[:-1]) / np.diff(self.start)[:, None]
        self.tolerance = Reach.of(scene.blocks, scene.joint_tolerance).tolerance
        self.closed = self.slivers = np.zeros(0, np.int64)
        self.thickness = np.array([block.thickness for block in scene.blocks])

    def close(self, a: IntArray, b: IntArray) -> None:
        """Count the gaps of pairs of facets ``a`` and ``b`` (k,) from their common plane from now
        on."""
        self.closed = self._key(a, b)

    def leave_out(self, a: IntArray, b: IntArray) -> None:
        """Leave pairs of facets ``a`` and ``b`` (k,) out as long as they meet in slivers."""
        self.slivers = self._key(a, b)

    def sliver_blocks(self) -> tuple[IntArray, IntArray]:
        """Returns the blocks (k,), (k,) that meet in slivers."""
        a, b = np.divmod(self.slivers, len(self.block))
        return self.block[a], self.block[b]

    def _key(self, a: IntArray, b: IntArray) -> IntArray:
        """Returns one number (k,) for each pair of facets."""
        return a * len(self.block) + b

    def allowed(self, a: IntArray, b: IntArray) -> FloatArray:
        """Returns the joint tolerances (k,) of pairs of facets (length)."""
        return np.minimum(self.tolerance[self.block[a]], self.tolerance[self.block[b]])

    def friction(self, a: IntArray, b: IntArray) -> FloatArray:
        """Returns the friction (k,) of pairs of blocks: the pair's own, or else the scene's."""
        result = np.full(len(a), float(self.scene.friction))
        number = {block.id: i for i, block in enumerate(self.scene.blocks)}
        for names, value in self.scene.contact_friction.items():
            one, other = (number[name] for name in names)
            result[((a == one) & (b == other)) | ((a == other) & (b == one))] = value
        return result

    def near(self, pose: Pose) -> tuple[IntArray, IntArray]:
        """Returns the pairs of facets (k,), (k,) of different blocks that may meet at a pose.

        Their normals are opposed, their bounding boxes within reach of each other, and neither lies
        wholly behind the other's plane.
        """
        placed = [pose.placed(np.full(len(v), i), v) for i, v in enumerate(self.vertices)]
        margin = np.full(len(placed), 0.5 * self.reach)
        begin = np.searchsorted(self.block, np.arange(len(placed)))
        normal = pose.turned(self.block, self.normal)
        edge_block = np.repeat(self.block, np.diff(self.start))
        corners = pose.placed(edge_block, self.tail)
        low = np.minimum.reduceat(corners, self.start[:-1])
        high = np.maximum.reduceat(corners, self.start[:-1])
        # Blocks near each other, then their facets by normals and boxes, then by planes.
        pairs = [np.zeros((2, 0), np.int64)]
        for one, other in nearby_pairs(placed, margin):
            free = ~(self.is_fixed[one] & self.is_fixed[other])
            of, a = members_of(begin, len(self.block), one[free])
            of_a, b = members_of(begin, len(self.block), other[free][of])
            a = a[of_a]
            is_near = np.einsum("kx,kx->k", normal[a], normal[b]) <= OPPOSED
            a, b = a[is_near], b[is_near]
            is_near = (low[a] <= high[b] + self.reach).all(1)
            is_near &= (low[b] <= high[a] + self.reach).all(1)
            pairs.append(np.stack([a[is_near], b[is_near]]))
        a, b = np.concatenate(pairs, axis=1)
        is_before = self._before(a, b, normal, corners) & self._before(b, a, normal, corners)
        is_before |= np.isin(self._key(a, b), self.closed)
        return a[is_before], b[is_before]

    def _before(
        self, a: IntArray, b: IntArray, normal: FloatArray, corners: FloatArray
    ) -> BoolArray:
        """Returns where (k,) some corner of facet b lies before the plane of a, within the
        tolerance."""
        of, place = members_of(self.start[:-1], len(self.tail), b)
        depth = np.einsum("ex,ex->e", corners[place] - corners[self.start[a[of]]], normal[a[of]])
        most = np.full(len(a), -np.inf)
        np.maximum.at(most, of, depth)
        return np.asarray(most >= -self.allowed(a, b))

    def pairs(self, a: IntArray, b: IntArray) -> Pairs:
        """Returns the outlines of pairs of facets; those of closed pairs are moved to the common
        plane."""
        both = (a, b)
        normal = np.stack([self.normal[a], self.normal[b]])
        plane = np.stack([self.plane[a], self.plane[b]])
        is_closed = np.isin(self._key(a, b), self.closed)
        common = normal[0] - normal[1]
        length = np.linalg.norm(common, axis=1)
        common /= np.where(length > 0.0, length, 1.0)[:, None]  # of closed pairs alone it counts
        middle = 0.5 * (plane[0] + plane[1])
        sides = []
        for side in (0, 1):
            pair, place = members_of(self.start[:-1], len(self.tail), both[side])
            tail, head = self.tail[place], self.head[place]
            onto = common if side == 0 else -common
            normal[side][is_closed], plane[side][is_closed] = onto[is_closed], middle[is_closed]
            for corners in (tail, head):
                off = np.einsum("ex,ex->e", corners - plane[side][pair], normal[side][pair])
                corners -= off[:, None] * normal[side][pair]
            sides.append((tail, head, self.beside[place], pair))
        block = np.stack([self.block[a], self.block[b]])
        tails, heads, others, pairs = zip(*sides, strict=True)
        # Half the width is the standard deviation of points at both ends of it.
        is_sliver = np.isin(self._key(a, b), self.slivers)
        least = np.where(is_sliver, 0.5 * self.allowed(a, b), CLOSED * self.size)
        return Pairs(block, normal, plane, tails, heads, others, pairs, least, is_closed)


def _outlines(block: Block) -> list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Returns for each planar facet the tails and heads (k, 3) of its edges, the normals (k, 3) of
    the faces beyond them, and its own normal (3,).

    A facet may be made of several faces of one plane; edges between these are left out.
    """
    flat = planes(block.vertices, block.faces, np.arange(len(block.faces)))
    vectors, result = area_vectors(block.vertices, block.faces), []
    edges = [list(zip(f, (*f[1:], f[0]), strict=True)) for f in block.faces]
    face = {edge: i for i, own in enumerate(edges) for edge in own}
    for group in flat.faces:
        outer = [(t, h) for i in group for t, h in edges[i] if face.get((h, t)) not in group]
        normal = vectors[list(group)].sum(axis=0)
        beyond = np.array([vectors[face[h, t]] if (h, t) in face else -normal for t, h in outer])
        tail, head = np.moveaxis(block.vertices[np.array(outer)], 1, 0)
        beyond /= np.linalg.norm(beyond, axis=1)[:, None]
        result.append((tail, head, beyond, normal / np.linalg.norm(normal)))
    return result
