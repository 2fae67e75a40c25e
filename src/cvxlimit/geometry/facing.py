"""Facets of all blocks in one table, and pairs of them that face each other."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.facets import SAME_WAY, Facets
from cvxlimit.geometry.mesh import Faces, cross, padded, polygon_vectors
from cvxlimit.geometry.nearby import overlapping
from cvxlimit.geometry.polygons import members_of
from cvxlimit.geometry.polyhedra import JOINT_TOLERANCE

NEAR = 30.0
"""Joints that miss the joint tolerance by less than this factor are near misses."""

THROUGH = 0.3
"""A gap wider, and an overlap deeper, than this share of a block's mean thickness is no inexact
joint: with a tolerance that is coarse for thin blocks, the next block but one would be a near
miss."""


@dataclass(frozen=True, eq=False)
class Reach:
    """Lengths of each block, (n,) each: its ``size`` (diagonal of its box), its mean ``thickness``,
    its joint ``tolerance`` and ``near``, the distance up to which another block is a near miss."""

    size: FloatArray
    thickness: FloatArray
    tolerance: FloatArray
    near: FloatArray

    @classmethod
    def of(cls, blocks: Sequence[Block], joint_tolerance: float | None) -> Reach:
        """With one tolerance for all (length), or, for None, the default share of each block's
        thickness."""
        size, thickness = _extents(blocks)
        tolerance = JOINT_TOLERANCE * thickness
        if joint_tolerance is not None:
            tolerance = np.full(len(blocks), joint_tolerance)
        near = np.maximum(np.minimum(NEAR * tolerance, THROUGH * thickness), tolerance)
        return cls(size, thickness, tolerance, near)


@dataclass(frozen=True, eq=False)
class FacetTable:
    """Convex pieces of all facets, one row (of f) per piece, sorted by block and by facet.

    Attributes
    ----------
    block, facet : (f,)
        Numbers of the block and of the facet that the piece belongs to.
    corners : (f, k, 3), sides : (f,)
        Corners of the piece, whose last one is repeated up to k, and how many they really are.
    normal, point : (f, 3)
        Outward unit normal and a point of the facet's mean plane, equal for all its pieces.
    off, bent : (f,)
        Largest distance from that plane of the pieces' corners, and of all corners of the faces.
    faces : (f,) tuples of int
        Numbers of the block's faces that make up the facet.
    sheet, lumped : (f,)
        As in :class:`~cvxlimit.geometry.facets.Facets`; sheets are numbered over all blocks.
    patch : (f,)
        The facet itself; in a table of single faces, the facet of nearly coplanar faces that each
        was a part of.
    """

    block: IntArray
    facet: IntArray
    corners: FloatArray
    sides: IntArray
    normal: FloatArray
    point: FloatArray
    off: FloatArray
    bent: FloatArray
    faces: NDArray[np.object_]
    sheet: IntArray
    lumped: BoolArray
    patch: IntArray

    def take(self, rows: IntArray) -> FacetTable:
        return FacetTable(*(getattr(self, f.name)[rows] for f in fields(self)))


def patches(blocks: Sequence[Block], reach: Reach) -> FacetTable:
    """The facets of all blocks, grouped within their joint tolerances."""
    return facet_table(blocks, _shapes(blocks, reach.tolerance))


Shapes = dict[tuple[Faces, Facets], list[int]]
"""The numbers of the blocks that list the same faces and have the same facets. Facets alone do not
tell blocks alike: they number faces, which may be cut otherwise or have further vertices."""


def facet_table(blocks: Sequence[Block], shapes: Shapes) -> FacetTable:
    """The facets of all blocks in one table, as ``shapes`` has them; each block is listed once."""
    width = max(len(piece) for _, shape in shapes for piece in shape.pieces)
    parts = [_part(blocks, shape, np.array(which), width) for (_, shape), which in shapes.items()]
    columns = ([getattr(p, f.name) for p in parts] for f in fields(FacetTable))
    joined = FacetTable(*map(np.concatenate, columns))
    table = joined.take(np.argsort(joined.block, kind="stable"))
    new = np.flatnonzero(np.diff(table.facet, prepend=-1) | np.diff(table.block, prepend=-1))
    number = np.repeat(np.arange(len(new)), np.diff(new, append=len(table.facet)))
    sheet = np.unique(table.block * len(number) + table.sheet, return_inverse=True)[1]
    return replace(table, facet=number, sheet=sheet, patch=number)


def _same_faces(blocks: Sequence[Block]) -> dict[Faces, list[int]]:
    """The numbers of the blocks that list the same faces, so that they can be treated at once."""
    result: dict[Faces, list[int]] = defaultdict(list)
    for i, block in enumerate(blocks):
        result[block.faces].append(i)
    return result


def _extents(blocks: Sequence[Block]) -> tuple[FloatArray, FloatArray]:
    """Diagonal of the box (n,) and mean thickness 2 volume / surface (n,) of each block."""
    size, thickness = np.empty(len(blocks)), np.empty(len(blocks))
    for faces, which in _same_faces(blocks).items():
        points = _points(blocks, np.array(which))
        surface = np.linalg.norm(polygon_vectors(points[:, padded(faces)]), axis=2).sum(axis=1)
        size[which] = np.linalg.norm(np.ptp(points, axis=1), axis=1)
        thickness[which] = 2.0 * np.array([blocks[i].volume for i in which]) / surface
    return size, thickness


def _shapes(blocks: Sequence[Block], tolerance: FloatArray) -> Shapes:
    """The shapes of all blocks.

    Blocks with the same faces mostly have the same facets. So the facets of one block are tried on
    all others at once, beginning with "each face is a facet"; where they do not fit, the next block
    is grouped on its own and tried on the rest.
    """
    result: Shapes = defaultdict(list)
    for faces, which in _same_faces(blocks).items():
        shape, remaining = Facets.of_faces(faces), np.array(which)
        if all(blocks[i].bounds is not None for i in which):
            result[faces, shape] += which
            continue
        is_tried = len(faces) <= _FEW and all(blocks[i].is_convex for i in which)
        while len(remaining):
            if is_tried:
                fits = _fits(_points(blocks, remaining), shape, faces, tolerance[remaining])
                result[faces, shape] += remaining[fits].tolist()
                remaining = remaining[~fits]
            if len(remaining):
                first, remaining = int(remaining[0]), remaining[1:]
                shape = blocks[first].facets(float(tolerance[first]))
                result[faces, shape].append(first)
                is_tried = len(shape.faces) <= _FEW
    return {shape: which for shape, which in result.items() if which}


def _points(blocks: Sequence[Block], which: IntArray) -> FloatArray:
    return np.stack([blocks[i].vertices for i in which.tolist()])


_FEW = 32
"""So many facets are compared each with each; bodies with more are grouped one at a time."""


def _planes(
    points: FloatArray, shape: Facets, faces: Faces, width: int = 0
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """For n bodies of one shape with vertices ``points`` (n, v, 3) and p pieces, returns the
    columns corners (n, p, k, 3), normal and point (n, p, 3), off and bent (n, p) of
    :class:`FacetTable`. The normal is zero where a facet has no area."""
    # Each piece with its own area vector and mean corner.
    corners = points[:, padded(shape.pieces, width)]
    vectors = polygon_vectors(corners)
    middle = np.stack(
        [corners[:, i, : len(piece)].mean(axis=1) for i, piece in enumerate(shape.pieces)], axis=1
    )
    length = np.linalg.norm(vectors, axis=2)[:, :, None]
    begin = np.searchsorted(shape.facet, np.arange(len(shape.faces)))
    # Those of a facet: the sum of its pieces' vectors, and the mean of their corners by area.
    if len(shape.faces) < len(shape.pieces):
        whole = np.maximum(np.add.reduceat(length, begin, axis=1), 1e-300)
        middle = (np.add.reduceat(length * middle, begin, axis=1) / whole)[:, shape.facet]
        vectors = np.add.reduceat(vectors, begin, axis=1)[:, shape.facet]
        length = np.linalg.norm(vectors, axis=2)[:, :, None]
    normal = vectors / np.where(length > 0.0, length, 1.0)
    heights = np.einsum("nfkc,nfc->nfk", corners - middle[:, :, None], normal)
    off = np.maximum.reduceat(np.abs(heights).max(axis=2), begin, axis=1)
    # Corners of faces may be farther off: an outline is drawn straight across the end of a ridge.
    bent = off.copy()
    for number in (i for i, group in enumerate(shape.faces) if len(group) > 1):
        own = points[:, np.unique([k for i in shape.faces[number] for k in faces[i]])]
        own = own - middle[:, begin[number], None]
        height = np.einsum("nkc,nc->nk", own, normal[:, begin[number]])
        bent[:, number] = np.abs(height).max(axis=1)
    return corners, normal, middle, off[:, shape.facet], bent[:, shape.facet]


def _fits(points: FloatArray, shape: Facets, faces: Faces, tolerance: FloatArray) -> BoolArray:
    """Which of the bodies (n, v, 3) have exactly these facets: flat, convex, and no two of them
    nearly in one plane, which would be one facet."""
    corners, normal, middle, _, off = _planes(points, shape, faces)
    # A facet without a normal: the body lists the same faces but has another shape.
    result = (np.linalg.norm(normal, axis=2) > 0.0).all(axis=1)
    result &= (off <= tolerance[:, None]).all(axis=1)
    # Convex: no corner of a piece turns clockwise, seen against the normal.
    sizes = np.array([len(piece) for piece in shape.pieces])
    for size in np.unique(sizes).tolist():
        loops = corners[:, sizes == size, :size]
        along = np.roll(loops, -1, axis=2) - loops
        ahead = np.roll(along, -1, axis=2)
        turns = np.einsum("nfkc,nfc->nfk", cross(along, ahead), normal[:, sizes == size])
        scale = np.linalg.norm(along, axis=3) * np.linalg.norm(ahead, axis=3)
        result &= (turns >= -ROUNDING * scale).all(axis=(1, 2))
    # No two facets in one plane: their normals differ, or they are steps of a notch, parallel at
    # different levels.
    first = np.searchsorted(shape.facet, np.arange(len(shape.faces)))
    normal, middle = normal[:, first], middle[:, first]
    cosine = normal @ normal.transpose(0, 2, 1) - 2.0 * np.eye(normal.shape[1])
    level = np.einsum("nfc,ngc->nfg", normal, middle)
    apart = np.abs(level - np.einsum("nff->nf", level)[:, :, None]) > 2.0 * tolerance[:, None, None]
    steps = apart & (cosine > 1.0 - ROUNDING)
    return np.asarray(result & ((cosine <= SAME_WAY) | steps).all(axis=(1, 2)))


def _part(blocks: Sequence[Block], shape: Facets, which: IntArray, width: int) -> FacetTable:
    """The rows of the blocks ``which``, all of one shape; pieces have ``width`` corners."""
    own = blocks[which[0]].faces
    corners, normal, middle, off, bent = _planes(_points(blocks, which), shape, own, width)
    facet, faces = np.array(shape.facet), np.empty(len(shape.faces), dtype=object)
    faces[:] = shape.faces
    return FacetTable(
        np.repeat(which, len(shape.pieces)),
        np.tile(facet, len(which)),
        corners.reshape(-1, width, 3),
        np.tile([len(p) for p in shape.pieces], len(which)),
        normal.reshape(-1, 3),
        middle.reshape(-1, 3),
        off.reshape(-1),
        bent.reshape(-1),
        np.tile(faces[facet], len(which)),
        np.tile(np.array(shape.sheet)[facet], len(which)),
        np.tile(np.array(shape.lumped)[facet], len(which)),
        np.tile(facet, len(which)),
    )


def facing_pairs(
    table: FacetTable, first: IntArray, second: IntArray, reach: Reach
) -> tuple[IntArray, IntArray]:
    """Returns pairs of pieces, as rows (p,) of the table, that face each other: of the pairs of
    blocks ``first``, ``second``, with opposite normals, planes within reach and boxes that meet.
    They come in the order of the blocks' pairs and, within, of their facets."""
    # Boxes of pieces and of blocks, each grown by the block's reach.
    margin = reach.near[table.block][:, None]
    corners = np.moveaxis(table.corners, 1, 0)
    low, high = (reduce(end, corners) for end in (np.minimum, np.maximum))
    low, high = low - margin, high + margin
    start = np.flatnonzero(np.diff(table.block, prepend=-1))
    pieces = np.diff(start, append=len(table.block))
    block_low, block_high = np.minimum.reduceat(low, start), np.maximum.reduceat(high, start)
    # Every piece of the first block whose box meets that of the second, with every piece of the
    # second; in portions, so that memory does not grow with the number of pairs.
    most = NUMBERS // table.corners[0].size
    found = [np.empty((2, 0), dtype=np.int64)]
    for some in _portions(pieces[first], most):
        pair, lower = members_of(start, len(table.block), first[some])
        other = second[some][pair]
        meet = overlapping(low, high, lower, block_low, block_high, other)
        lower, other = lower[meet], other[meet]
        for few in _portions(pieces[other], most):
            row, upper = members_of(start, len(table.block), other[few])
            found.append(_facing(table, lower[few][row], upper, low, high, reach))
    lower, upper = np.concatenate(found, axis=1)
    return lower, upper


def _portions(sizes: IntArray, most: int) -> Iterator[slice]:
    """Runs of rows whose ``sizes`` add up to no more than ``most``, or single rows that do not.

    >>> list(_portions(np.array([3, 3, 9, 1]), 6))
    [slice(0, 2, None), slice(2, 3, None), slice(3, 4, None)]
    """
    ends = np.cumsum(sizes)
    begin = 0
    while begin < len(ends):
        before = ends[begin] - sizes[begin]
        end = max(begin + 1, int(np.searchsorted(ends, before + most, side="right")))
        yield slice(begin, end)
        begin = end


NUMBERS = 2**21
"""Numbers in an array of rows of corners: 16 MB, of which some six are alive at a time."""


def _facing(
    table: FacetTable,
    lower: IntArray,
    upper: IntArray,
    low: FloatArray,
    high: FloatArray,
    reach: Reach,
) -> IntArray:
    """The pairs (2, p) that face each other; cheap conditions first, each on what is left."""
    facing = np.einsum("fc,fc->f", table.normal[lower], table.normal[upper]) <= -SAME_WAY
    lower, upper = lower[facing], upper[facing]
    meet = overlapping(low, high, lower, low, high, upper)
    lower, upper = lower[meet], upper[meet]
    length = np.minimum(reach.near[table.block[lower]], reach.near[table.block[upper]])
    near = _within(table, lower, upper, length) & _within(table, upper, lower, length)
    return np.stack([lower[near], upper[near]])


def _within(table: FacetTable, plane: IntArray, other: IntArray, length: FloatArray) -> BoolArray:
    """True (p,) where a piece ``other`` comes within a ``length`` of the plane of ``plane``."""
    offset = table.corners[other] - table.point[plane][:, None]
    height = np.einsum("fkc,fc->fk", offset, table.normal[plane])
    return np.asarray((height.min(axis=1) <= length) & (height.max(axis=1) >= -length))
