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

from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import RELATIVE_TOLERANCE, Block, Faces
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.overlaps import members_of, outlines
from cvxlimit.geometry.penetration import check_no_interpenetration

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
    sizes = _sizes(blocks)
    near = nearby_pairs([b.vertices for b in blocks], tolerance * sizes)
    faces = _face_table(blocks, sizes)
    lower, upper = _facing_pairs(faces, *near, tolerance)
    contacts = _contacts(faces.take(lower), faces.take(upper), blocks, friction, tolerance)
    check_no_interpenetration(blocks, *near, contacts, sizes, tolerance)
    _check_every_block_touches(blocks, contacts, is_fixed)
    return _select(contacts, ~(is_fixed[contacts.a] & is_fixed[contacts.b]))


def _sizes(blocks: Sequence[Block]) -> FloatArray:
    """``size`` of every block, all at once."""
    count = np.array([len(b.vertices) for b in blocks])
    points, begin = np.concatenate([b.vertices for b in blocks]), np.cumsum(count) - count
    extents = np.maximum.reduceat(points, begin) - np.minimum.reduceat(points, begin)
    return np.asarray(np.linalg.norm(extents, axis=1))


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
    pair, lower = members_of(start, len(faces.block), first)
    other = second[pair]
    meet = ((low[lower] <= block_high[other]) & (block_low[other] <= high[lower])).all(axis=1)
    row, upper = members_of(start, len(faces.block), other[meet])
    lower = lower[meet][row]
    opposite = np.einsum("fc,fc->f", faces.normal[lower], faces.normal[upper]) < 0.0
    lower, upper = lower[opposite], upper[opposite]
    meet = ((low[lower] <= high[upper]) & (low[upper] <= high[lower])).all(axis=1)
    lower, upper = lower[meet], upper[meet]
    length = tolerance * np.minimum(faces.size[lower], faces.size[upper])
    near = np.minimum(_gap(faces, lower, upper), _gap(faces, upper, lower)) <= length
    return lower[near], upper[near]


def _gap(faces: _FaceTable, plane: IntArray, other: IntArray) -> FloatArray:
    """Largest distance of the ``other`` faces' corners from the planes of the ``plane`` faces.

    Measured both ways the smaller is meant: a small face's plane, carried to the far corners of
    a large one, multiplies the rounding of its coordinates.
    """
    offset = faces.corners[other] - faces.corners[plane][:, :1]
    distance = np.abs(np.einsum("fkc,fc->fk", offset, faces.normal[plane]))
    result: FloatArray = distance.max(axis=1)
    return result


def _contacts(
    lower: _FaceTable, upper: _FaceTable, blocks: Sequence[Block], friction: float, tol: float
) -> Contacts:
    """Contacts of facing pairs, by blocks; ``lower`` belongs to block a and gives the normal."""
    t1 = _canonical(_unit(lower.corners[:, 1] - lower.corners[:, 0]))
    t2 = np.cross(lower.normal, t1)
    axes = np.stack([t1, t2, lower.normal], axis=1)
    base = lower.corners[:, 0]
    flat_lower = np.einsum("pkc,pic->pki", lower.corners - base[:, None], axes[:, :2])
    flat_upper = np.einsum("pkc,pic->pki", upper.corners - base[:, None], axes[:, :2])
    boxes = _is_aligned_rectangle(flat_lower, lower) & _is_aligned_rectangle(flat_upper, upper)
    found = outlines(flat_lower, flat_upper, boxes)
    length = tol * np.minimum(lower.size, upper.size)
    found = found.take(np.flatnonzero(found.width > length[found.pair]))
    found = found.take(np.lexsort((upper.block[found.pair], lower.block[found.pair])))
    a, b = lower.block[found.pair], upper.block[found.pair]
    frames = axes[found.pair]
    origin = base[found.pair] + np.einsum("kp,kpc->kc", found.middle, frames[:, :2])
    frames[:, :2] = found.turn @ frames[:, :2]
    return Contacts(
        names=_names(a, b, blocks),
        block_ids=tuple(block.id for block in blocks),
        a=a,
        b=b,
        origin=origin,
        axes=frames,
        corner_start=np.append(found.start, len(found.corners)).astype(np.int64),
        corner_xy=found.corners,
        sides=found.sides,
        area=found.area,
        friction=np.full(len(a), friction),
        cohesion=np.zeros(len(a)),
    )


def _is_aligned_rectangle(flat: FloatArray, faces: _FaceTable) -> NDArray[np.bool_]:
    """Four corners, all edges along the axes to 1e-9 of the block size."""
    corners = flat[:, :4]
    edges = np.roll(corners, -1, axis=1) - corners
    straight = np.abs(edges).min(axis=2).max(axis=1) <= 1e-9 * faces.size
    result: NDArray[np.bool_] = straight & (faces.sides == 4)
    return result


def _unit(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return result


def _canonical(vectors: FloatArray) -> FloatArray:
    """Turn each vector so that its largest component is positive."""
    largest = np.abs(vectors).argmax(axis=1)
    sign = np.sign(vectors[np.arange(len(vectors)), largest])
    result: FloatArray = vectors * sign[:, None]
    return result


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
        cohesion=contacts.cohesion[keep],
    )


def _check_every_block_touches(
    blocks: Sequence[Block], contacts: Contacts, is_fixed: NDArray[np.bool_]
) -> None:
    """Refuse loose blocks; of several a free one is named, as it is the one to move."""
    touched = np.zeros(len(blocks), dtype=bool)
    touched[contacts.a] = True
    touched[contacts.b] = True
    if not touched.all():
        alone = np.flatnonzero(~touched)
        lonely = blocks[int(alone[np.argmin(is_fixed[alone])])]
        raise InputError(
            f"block {lonely.id!r} (centre {lonely.centroid.round(6).tolist()}) touches no other "
            "block: move it so that a face meets another block's face, or remove it"
        )
