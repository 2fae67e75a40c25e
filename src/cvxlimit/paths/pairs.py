"""Pairs of facets that may meet: what persists while blocks move, where contacts come and go."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.facets import planes
from cvxlimit.geometry.facing import patches
from cvxlimit.geometry.mesh import area_vectors
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.polygons import members_of
from cvxlimit.paths.path import rotation
from cvxlimit.scene import Scene

OPPOSED = -0.5
"""Cosine between normals of facets that may meet, at most: within 60 degrees of face to face."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Where all blocks (B,) are: x -> centroid + shift + turn @ (x - centroid) of their places at
    first."""

    centroid: FloatArray
    shift: FloatArray
    turn: FloatArray

    @classmethod
    def first(cls, scene: Scene) -> Self:
        centroid = np.array([block.centroid for block in scene.blocks])
        return cls(centroid, np.zeros_like(centroid), np.tile(np.eye(3), (len(centroid), 1, 1)))

    @property
    def middle(self) -> FloatArray:
        """Centroids where they are now (B, 3)."""
        return self.centroid + self.shift

    def placed(self, block: IntArray, x: FloatArray) -> FloatArray:
        """Where points x (k, 3) of blocks (k,) are that were there at first."""
        arm = np.einsum("kij,kj->ki", self.turn[block], x - self.centroid[block])
        return np.asarray(self.middle[block] + arm)

    def origin(self, block: IntArray, x: FloatArray) -> FloatArray:
        """Where points of blocks were at first that are at x (k, 3) now."""
        arm = np.einsum("kji,kj->ki", self.turn[block], x - self.middle[block])
        return np.asarray(self.centroid[block] + arm)

    def turned(self, block: IntArray, vector: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("kij,kj->ki", self.turn[block], vector))

    def moved(self, blocks: IntArray, d: FloatArray) -> Pose:
        """After finite displacements d (k, 6) of some blocks: rotated by exp, then shifted."""
        shift, turn = self.shift.copy(), self.turn.copy()
        shift[blocks] += d[:, :3]
        turn[blocks] = rotation(d[:, 3:]) @ turn[blocks]
        return Pose(self.centroid, shift, turn)


@dataclass(frozen=True, eq=False)
class Pairs:
    """P pairs of facets, a and b, where the blocks were at first.

    ``normal`` and ``plane`` (2, P, 3) are of both sides' planes, ``block`` (2, P) their blocks. The
    E edges of each side's outlines stand pair by pair, each of its ``pair`` (E,), from a corner
    ``tail`` (E, 3) to the next, ``head``, counter-clockwise from outside, holes the other way;
    ``beside`` is the normal of the face beyond the edge.
    """

    block: IntArray
    normal: FloatArray
    plane: FloatArray
    tail: tuple[FloatArray, FloatArray]
    head: tuple[FloatArray, FloatArray]
    beside: tuple[FloatArray, FloatArray]
    pair: tuple[IntArray, IntArray]

    @cached_property
    def couples(self) -> tuple[IntArray, IntArray]:
        """Every edge of side a with every edge of side b of the same pair."""
        begin = np.searchsorted(self.pair[1], np.arange(self.block.shape[1]))
        return members_of(begin, len(self.pair[1]), self.pair[0])


class Facets:
    """Planar facets of all blocks of a scene, of any polygons, where the blocks are at first."""

    def __init__(self, scene: Scene, reach: float) -> None:
        self.scene, self.reach, self.size = scene, reach, scene.contacts.typical_size
        self.vertices = [block.vertices for block in scene.blocks]
        fixed = set(scene.supports)
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
        self.tolerance = patches(scene.blocks, scene.joint_tolerance)[1].tolerance
        self.closed = np.zeros(0, np.int64)
        self.thickness = np.array([block.thickness for block in scene.blocks])

    def close(self, a: IntArray, b: IntArray) -> None:
        """Count gaps of these pairs of facets (k,), (k,) from their common plane."""
        self.closed = self._key(a, b)

    def _key(self, a: IntArray, b: IntArray) -> IntArray:
        return a * len(self.block) + b

    def allowed(self, a: IntArray, b: IntArray) -> FloatArray:
        """Joint tolerance of pairs of facets."""
        return np.minimum(self.tolerance[self.block[a]], self.tolerance[self.block[b]])

    def friction(self, a: IntArray, b: IntArray) -> FloatArray:
        """Of pairs of blocks (k,), (k,): the scene's, or that of the pair."""
        result = np.full(len(a), float(self.scene.friction))
        number = {block.id: i for i, block in enumerate(self.scene.blocks)}
        for names, value in self.scene.contact_friction.items():
            one, other = (number[name] for name in names)
            result[((a == one) & (b == other)) | ((a == other) & (b == one))] = value
        return result

    def near(self, pose: Pose) -> tuple[IntArray, IntArray]:
        """Facets (k,), (k,) of different blocks, normals opposed, boxes within reach of each other,
        neither wholly behind the other's plane."""
        placed = [pose.placed(np.full(len(v), i), v) for i, v in enumerate(self.vertices)]
        margin = np.full(len(placed), 0.5 * self.reach)
        begin = np.searchsorted(self.block, np.arange(len(placed)))
        normal = pose.turned(self.block, self.normal)
        edge_block = np.repeat(self.block, np.diff(self.start))
        corners = pose.placed(edge_block, self.tail)
        low = np.minimum.reduceat(corners, self.start[:-1])
        high = np.maximum.reduceat(corners, self.start[:-1])
        found = [np.zeros((2, 0), np.int64)]
        for one, other in nearby_pairs(placed, margin):
            free = ~(self.is_fixed[one] & self.is_fixed[other])
            of, a = members_of(begin, len(self.block), one[free])
            of_a, b = members_of(begin, len(self.block), other[free][of])
            a = a[of_a]
            is_near = np.einsum("kx,kx->k", normal[a], normal[b]) <= OPPOSED
            a, b = a[is_near], b[is_near]
            is_near = (low[a] <= high[b] + self.reach).all(1)
            is_near &= (low[b] <= high[a] + self.reach).all(1)
            found.append(np.stack([a[is_near], b[is_near]]))
        a, b = np.concatenate(found, axis=1)
        is_before = self._before(a, b, normal, corners) & self._before(b, a, normal, corners)
        is_before |= np.isin(self._key(a, b), self.closed)
        return a[is_before], b[is_before]

    def _before(
        self, a: IntArray, b: IntArray, normal: FloatArray, corners: FloatArray
    ) -> BoolArray:
        """Where some corner of facet b is before the plane of a, by more than rounding behind."""
        of, place = members_of(self.start[:-1], len(self.tail), b)
        depth = np.einsum("ex,ex->e", corners[place] - corners[self.start[a[of]]], normal[a[of]])
        most = np.full(len(a), -np.inf)
        np.maximum.at(most, of, depth)
        return np.asarray(most >= -self.allowed(a, b))

    def pairs(self, a: IntArray, b: IntArray) -> Pairs:
        """Outlines of pairs of facets; of those closed at first, on their common plane."""
        both = (a, b)
        normal = np.stack([self.normal[a], self.normal[b]])
        plane = np.stack([self.plane[a], self.plane[b]])
        is_closed = np.isin(self._key(a, b), self.closed)
        common = normal[0] - normal[1]
        common /= np.linalg.norm(common, axis=1)[:, None]
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
        return Pairs(block, normal, plane, tails, heads, others, pairs)


def _outlines(block: Block) -> list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Tails and heads (k, 3) of the edges around each planar facet, the normals of the faces beyond
    them, and its own: edges between two faces of one plane cancel."""
    flat = planes(block.vertices, block.faces, np.arange(len(block.faces)))
    vectors, found = area_vectors(block.vertices, block.faces), []
    edges = [list(zip(f, (*f[1:], f[0]), strict=True)) for f in block.faces]
    face = {edge: i for i, own in enumerate(edges) for edge in own}
    for group in flat.faces:
        kept = [(t, h) for i in group for t, h in edges[i] if face.get((h, t)) not in group]
        normal = vectors[list(group)].sum(axis=0)
        beyond = np.array([vectors[face[h, t]] if (h, t) in face else -normal for t, h in kept])
        tail, head = np.moveaxis(block.vertices[np.array(kept)], 1, 0)
        beyond /= np.linalg.norm(beyond, axis=1)[:, None]
        found.append((tail, head, beyond, normal / np.linalg.norm(normal)))
    return found
