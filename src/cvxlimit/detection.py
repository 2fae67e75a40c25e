"""Contact detection: facing coplanar faces that overlap, found from geometry alone.

Only blocks near each other are looked at, and of those the faces whose boxes meet. Overlaps are
exact interval products for aligned rectangles and polygon clipping otherwise: near n log n.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvxlimit.blocks import RELATIVE_TOLERANCE, Block, Faces
from cvxlimit.contacts import Contacts
from cvxlimit.errors import InputError
from cvxlimit.nearby import nearby_pairs
from cvxlimit.penetration import check_no_interpenetration
from cvxlimit.polygons import area_and_centroid, convex_overlap

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class _FaceTable:
    """All faces, block by block; ``corners`` (f, k, 3) repeat a face's last corner up to k."""

    block: IntArray
    corners: FloatArray
    sides: IntArray
    normal: FloatArray
    size: FloatArray

    def take(self, rows: IntArray) -> _FaceTable:
        return _FaceTable(
            self.block[rows], self.corners[rows], self.sides[rows],
            self.normal[rows], self.size[rows],
        )  # fmt: skip


def detect_contacts(
    blocks: Sequence[Block],
    fixed: Collection[str] = (),
    friction: float = 0.6,
    tolerance: float = RELATIVE_TOLERANCE,
) -> Contacts:
    """Find all contacts between ``blocks``, except those between two ``fixed`` ones.

    Two faces are in contact when their planes coincide and face each other, within
    ``tolerance`` times the smaller block's size, and their overlap is a polygon whose mean
    width exceeds the same length. A pair of blocks may have several contacts.

    Raises
    ------
    InputError
        If blocks interpenetrate, or a block touches no other.

    Example
    -------
    >>> ground = Block.box("ground", (0, 0, -1), (1, 1, 0))
    >>> brick = Block.box("brick", (0, 0, 0), (1, 1, 1), density=1.0)
    >>> [c.name for c in detect_contacts([ground, brick], fixed=["ground"])]
    ['ground-brick']
    """
    is_fixed = np.array([b.id in fixed for b in blocks])
    sizes = np.array([b.size for b in blocks])
    near = nearby_pairs([b.vertices for b in blocks], tolerance * sizes)
    faces = _face_table(blocks, sizes)
    lower, upper = _facing_pairs(faces, *near, tolerance)
    contacts = _overlaps(faces.take(lower), faces.take(upper), blocks, friction, tolerance)
    check_no_interpenetration(blocks, *near, contacts, sizes, tolerance)
    _check_every_block_touches(blocks, contacts)
    return _select(contacts, ~(is_fixed[contacts.a] & is_fixed[contacts.b]))


def _face_table(blocks: Sequence[Block], sizes: FloatArray) -> _FaceTable:
    """Blocks with the same face lists (all bricks, say) are handled in one array operation."""
    same_faces: dict[Faces, list[int]] = defaultdict(list)
    for i, block in enumerate(blocks):
        same_faces[block.faces].append(i)
    width = max(len(face) for block_faces in same_faces for face in block_faces)
    parts = []
    for block_faces, members in same_faces.items():
        vertices = np.stack([blocks[i].vertices for i in members])
        for face in block_faces:
            padded = list(face) + [face[-1]] * (width - len(face))
            corners = vertices[:, padded]
            parts.append((np.array(members), corners, np.full(len(members), len(face))))
    owner = np.concatenate([p[0] for p in parts])
    rows = np.argsort(owner, kind="stable")
    owner = owner[rows]
    corners = np.concatenate([p[1] for p in parts])[rows]
    sides = np.concatenate([p[2] for p in parts])[rows]
    spokes = corners - corners[:, :1]
    area = np.cross(spokes[:, :-1], spokes[:, 1:]).sum(axis=1)
    normal = area / np.linalg.norm(area, axis=1)[:, None]
    return _FaceTable(owner, corners, sides, normal, sizes[owner])


def _facing_pairs(
    faces: _FaceTable, first: IntArray, second: IntArray, tolerance: float
) -> tuple[IntArray, IntArray]:
    """Pairs of faces on a common plane, from opposite sides, whose bounding boxes meet.

    The faces of each pair belong to a pair of ``first`` and ``second`` blocks.
    """
    margin = tolerance * faces.size[:, None]
    low, high = faces.corners.min(axis=1) - margin, faces.corners.max(axis=1) + margin
    start = np.flatnonzero(np.diff(faces.block, prepend=-1))
    block_low, block_high = np.minimum.reduceat(low, start), np.maximum.reduceat(high, start)
    pair, lower = _each_face(faces, start, first)
    other = second[pair]
    meet = ((low[lower] <= block_high[other]) & (block_low[other] <= high[lower])).all(axis=1)
    row, upper = _each_face(faces, start, other[meet])
    lower = lower[meet][row]
    opposite = np.einsum("fc,fc->f", faces.normal[lower], faces.normal[upper]) < 0.0
    lower, upper = lower[opposite], upper[opposite]
    meet = ((low[lower] <= high[upper]) & (low[upper] <= high[lower])).all(axis=1)
    lower, upper = lower[meet], upper[meet]
    length = tolerance * np.minimum(faces.size[lower], faces.size[upper])
    near = np.minimum(_gap(faces, lower, upper), _gap(faces, upper, lower)) <= length
    return lower[near], upper[near]


def _each_face(faces: _FaceTable, start: IntArray, blocks: IntArray) -> tuple[IntArray, IntArray]:
    """For each of ``blocks`` all its faces: places in ``blocks``, and faces from ``start``."""
    count = np.diff(start, append=len(faces.block))[blocks]
    place = np.repeat(np.arange(len(blocks)), count)
    within = np.arange(len(place)) - (np.cumsum(count) - count)[place]
    return place, start[blocks][place] + within


def _gap(faces: _FaceTable, plane: IntArray, other: IntArray) -> FloatArray:
    """Largest distance of the ``other`` faces' corners from the planes of the ``plane`` faces.

    Measured both ways the smaller is meant: a small face's plane, carried to the far corners of
    a large one, multiplies the rounding of its coordinates.
    """
    offset = faces.corners[other] - faces.corners[plane][:, :1]
    distance = np.abs(np.einsum("fkc,fc->fk", offset, faces.normal[plane]))
    result: FloatArray = distance.max(axis=1)
    return result


def _overlaps(
    lower: _FaceTable, upper: _FaceTable, blocks: Sequence[Block], friction: float, tol: float
) -> Contacts:
    """Contact polygons of facing pairs; ``lower`` belongs to block a and gives the normal."""
    t1 = _canonical(_unit(lower.corners[:, 1] - lower.corners[:, 0]))
    t2 = np.cross(lower.normal, t1)
    axes = np.stack([t1, t2, lower.normal], axis=1)
    base = lower.corners[:, 0]
    flat_lower = np.einsum("pkc,pic->pki", lower.corners - base[:, None], axes[:, :2])
    flat_upper = np.einsum("pkc,pic->pki", upper.corners - base[:, None], axes[:, :2])
    length = tol * np.minimum(lower.size, upper.size)
    boxes = _is_aligned_rectangle(flat_lower, lower) & _is_aligned_rectangle(flat_upper, upper)
    polygons: list[FloatArray] = [np.empty((0, 2))] * len(boxes)
    for j, corners in zip(
        np.flatnonzero(boxes), _rectangle_overlap(flat_lower[boxes], flat_upper[boxes]), strict=True
    ):
        polygons[j] = corners
    others = np.flatnonzero(~boxes)
    for j, corners in zip(
        others, convex_overlap(flat_lower[others], flat_upper[others]), strict=True
    ):
        polygons[j] = corners
    return _assemble(
        polygons, boxes, base, axes, lower.block, upper.block, blocks, friction, length
    )


def _is_aligned_rectangle(flat: FloatArray, faces: _FaceTable) -> NDArray[np.bool_]:
    """Four corners, all edges along the axes to 1e-9 of the block size."""
    corners = flat[:, :4]
    edges = np.roll(corners, -1, axis=1) - corners
    straight = np.abs(edges).min(axis=2).max(axis=1) <= 1e-9 * faces.size
    result: NDArray[np.bool_] = straight & (faces.sides == 4)
    return result


def _rectangle_overlap(first: FloatArray, second: FloatArray) -> FloatArray:
    low = np.maximum(first.min(axis=1), second.min(axis=1))
    high = np.maximum(np.minimum(first.max(axis=1), second.max(axis=1)), low)
    x0, y0, x1, y1 = low[:, 0], low[:, 1], high[:, 0], high[:, 1]
    return np.stack([x0, y0, x1, y0, x1, y1, x0, y1], axis=1).reshape(-1, 4, 2)


def _unit(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return result


def _canonical(vectors: FloatArray) -> FloatArray:
    """Turn each vector so that its largest component is positive."""
    largest = np.abs(vectors).argmax(axis=1)
    sign = np.sign(vectors[np.arange(len(vectors)), largest])
    result: FloatArray = vectors * sign[:, None]
    return result


def _assemble(
    polygons: list[FloatArray],
    aligned: NDArray[np.bool_],
    base: FloatArray,
    axes: FloatArray,
    a: IntArray,
    b: IntArray,
    blocks: Sequence[Block],
    friction: float,
    length: FloatArray,
) -> Contacts:
    """Keep overlaps of non-negligible width, centre them, recognise rectangles."""
    kept, area, centre, sides, corners = [], [], [], [], []
    frames = axes.copy()
    for j in np.lexsort((b, a)):
        polygon = polygons[j]
        if len(polygon) < 3:
            continue
        if aligned[j]:
            extent = polygon[2] - polygon[0]
            surface, middle = float(extent.prod()), 0.5 * (polygon[0] + polygon[2])
            width = float(extent.min())
        else:
            surface, middle = area_and_centroid(polygon)
            perimeter = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).sum()
            width = 2.0 * surface / float(perimeter)
        if width <= length[j]:
            continue
        local = polygon - middle
        if aligned[j]:
            side = extent
        else:
            local, side, turn = _along_own_sides(local)
            frames[j, :2] = turn @ frames[j, :2]
        kept.append(j)
        area.append(surface)
        centre.append(base[j] + middle @ axes[j, :2])
        sides.append(side)
        corners.append(local)
    index = np.array(kept, dtype=np.int64)
    counts = [len(c) for c in corners]
    return Contacts(
        names=_names(a[index], b[index], blocks),
        block_ids=tuple(block.id for block in blocks),
        a=a[index],
        b=b[index],
        origin=np.array(centre).reshape(-1, 3),
        axes=frames[index],
        corner_start=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        corner_xy=np.concatenate(corners) if corners else np.empty((0, 2)),
        sides=np.array(sides).reshape(-1, 2),
        area=np.array(area),
        friction=np.full(len(index), friction),
    )


def _along_own_sides(corners: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Turn a centred polygon so that t1 runs along its longest edge.

    Returns the turned corners, (l1, l2) if it is a rectangle to 1e-9 of its size else NaN,
    and the rotation (2, 2) that maps old to new plane axes.
    """
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(edges, axis=1)
    longest = edges[int(np.flatnonzero(lengths >= (1.0 - 1e-9) * lengths.max())[0])]
    c, s = longest / np.linalg.norm(longest)
    turn = np.array([[c, s], [-s, c]])
    turned = corners @ turn.T
    extent = np.ptp(turned, axis=0)
    steps = np.roll(turned, -1, axis=0) - turned
    square = len(corners) == 4 and np.abs(steps).min(axis=1).max() <= 1e-9 * extent.max()
    return turned, extent if square else np.full(2, np.nan), turn


def _names(a: IntArray, b: IntArray, blocks: Sequence[Block]) -> tuple[str, ...]:
    seen: Counter[tuple[int, int]] = Counter()
    names = []
    for i, k in zip(a.tolist(), b.tolist(), strict=True):
        seen[i, k] += 1
        repeat = f"#{seen[i, k]}" if seen[i, k] > 1 else ""
        names.append(f"{blocks[i].id}-{blocks[k].id}{repeat}")
    return tuple(names)


def _select(contacts: Contacts, keep: NDArray[np.bool_]) -> Contacts:
    if keep.all():
        return contacts
    counts = np.diff(contacts.corner_start)
    return Contacts(
        names=tuple(n for n, k in zip(contacts.names, keep, strict=True) if k),
        block_ids=contacts.block_ids,
        a=contacts.a[keep],
        b=contacts.b[keep],
        origin=contacts.origin[keep],
        axes=contacts.axes[keep],
        corner_start=np.concatenate([[0], np.cumsum(counts[keep])]),
        corner_xy=contacts.corner_xy[np.repeat(keep, counts)],
        sides=contacts.sides[keep],
        area=contacts.area[keep],
        friction=contacts.friction[keep],
    )


def _check_every_block_touches(blocks: Sequence[Block], contacts: Contacts) -> None:
    touched = np.zeros(len(blocks), dtype=bool)
    touched[contacts.a] = True
    touched[contacts.b] = True
    if not touched.all():
        lonely = blocks[int(np.flatnonzero(~touched)[0])]
        raise InputError(
            f"block {lonely.id!r} (centre {lonely.centroid.round(6).tolist()}) touches no other "
            "block: move it so that a face meets another block's face, or remove it"
        )
