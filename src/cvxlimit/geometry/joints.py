"""Joints: where facets of two blocks overlap, how far apart they are, and which are contacts.

Two facets that face each other have one plane between them, midway, and their outlines overlap in
it. The gap between them is linear over the overlap. With the joint tolerance d and the overlap's
width w, its area over half its outline's length, a joint is

- a contact where the gap is between -d and d all over it, w > d, and the facets are not steep;
- a near miss where it would be one but for w, or for a gap that is out by some times d;
- nothing to be told otherwise.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.facing import NEAR, FacetTable, Reach
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, SLIVER, fan, polygon_vectors, unit
from cvxlimit.geometry.nearmisses import Kind, NearMiss
from cvxlimit.geometry.outlines import Outlines, outlines

_STEEPEST = 0.1
"""Sine of the angle between two facets in contact, at most: beyond, a normal force could not be
said to act along both normals to a tenth, however small the facets and the gap between them."""


@dataclass(frozen=True, eq=False)
class Joints:
    """Overlaps of facets of two blocks that face each other; some are contacts, some near misses.

    There is one row per overlap, k in all, sorted by block ``a``, then ``b``. Lengths are in the
    scene's unit.

    Attributes
    ----------
    a, b : (k,)
        Numbers of the two blocks.
    overlap : Outlines
        The outline that the two facets share, in the plane of the contact.
    origin : (k, 3), axes : (k, 3, 3)
        Centroid of the overlap, and the rows t1, t2, n of its frame; n points from a into b.
    gaps : (k, 2)
        Smallest and largest distance between the two facets' planes over the overlap; negative
        where the blocks lie in each other.
    sine : (k,)
        Sine of the angle between the two facets.
    tolerance, near : (k,)
        Joint tolerance of the pair, and the distance up to which it is a near miss.
    warped : (k,)
        How far the corners of both facets are off their mean planes. It is allowed on top of the
        tolerance, or else two warped facets that meet perfectly would not be a joint.
    faces, flat, lumped, sheet, patch : (k, 2)
        Of the facets of a and of b: the numbers of the block's faces that they consist of, whether
        these lie in one plane to rounding, and three columns of
        :class:`~cvxlimit.geometry.facing.FacetTable`.
    is_contact, is_near_miss : (k,)
        Which of the rows are contacts, and which are nearly so.
    """

    a: IntArray
    b: IntArray
    overlap: Outlines
    origin: FloatArray
    axes: FloatArray
    gaps: FloatArray
    sine: FloatArray
    tolerance: FloatArray
    warped: FloatArray
    near: FloatArray
    faces: NDArray[np.object_]
    flat: BoolArray
    lumped: BoolArray
    sheet: IntArray
    patch: IntArray
    is_contact: BoolArray
    is_near_miss: BoolArray

    @classmethod
    def of(cls, table: FacetTable, lower: IntArray, upper: IntArray, reach: Reach) -> Joints:
        """Overlaps of the pieces ``lower`` (p,) of blocks a with the pieces ``upper`` (p,) of
        blocks b, which are rows of ``table``."""
        # Pieces of the same two facets share one plane, the mean of both facets' planes.
        facet_pair = table.facet[lower] * (int(table.facet[-1]) + 1) + table.facet[upper]
        _, first, pair = np.unique(facet_pair, return_index=True, return_inverse=True)
        low, up = table.take(lower[first]), table.take(upper[first])
        size = reach.size[low.block]
        axes, base = _frames(low, up)
        # Both pieces in the coordinates of that plane; aligned rectangles overlap without rounding.
        flat = [
            np.einsum("pkc,pic->pki", table.corners[rows] - base[pair][:, None], axes[pair, :2])
            for rows in (lower, upper)
        ]
        single = np.bincount(pair)[pair] == 1
        boxes = single & _is_aligned_rectangle(flat[0], table.sides[lower], size[pair])
        boxes &= _is_aligned_rectangle(flat[1], table.sides[upper], size[pair])
        tolerance = np.minimum(reach.tolerance[low.block], reach.tolerance[up.block])
        overlap = outlines(flat[0], flat[1], boxes, pair, tolerance)
        warped = low.off + up.off
        # Overlaps as narrow as rounding go; the others are sorted by their blocks.
        least = RELATIVE_TOLERANCE * np.minimum(size, reach.size[up.block])
        overlap = overlap.take(np.flatnonzero(overlap.width > least[overlap.pair]))
        overlap = overlap.take(np.lexsort((up.block[overlap.pair], low.block[overlap.pair])))
        j = overlap.pair
        # The frame of a contact: its centroid, and axes along its own sides.
        gaps, height = _gaps(overlap, low, up, axes, base)
        frame = axes[j]
        origin = base[j] + np.einsum("kp,kpc->kc", overlap.middle, frame[:, :2])
        origin += height[:, None] * frame[:, 2]
        frame[:, :2] = overlap.turn @ frame[:, :2]
        near = np.minimum(reach.near[low.block], reach.near[up.block])
        sine = np.linalg.norm(np.cross(low.normal, up.normal), axis=1)

        def of_both(name: str) -> Any:
            return np.stack([getattr(side, name)[j] for side in (low, up)], axis=1)

        flat = of_both("bent") <= RELATIVE_TOLERANCE * reach.size[of_both("block")]
        none = np.zeros(len(j), dtype=bool)
        return cls(
            low.block[j], up.block[j], overlap, origin, frame, gaps, sine[j],
            tolerance[j], warped[j], near[j] + warped[j], of_both("faces"), flat,
            of_both("lumped") & ~flat, of_both("sheet"), of_both("patch"), none, none,
        )._classified()  # fmt: skip

    def _classified(self) -> Joints:
        """The same rows, with ``is_contact`` and ``is_near_miss`` filled in."""
        wide, close = self.overlap.width > self.tolerance, self.is_close
        within_reach = (np.abs(self.gaps) <= self.near[:, None]).all(axis=1)
        # Facets that are deeper in each other look away from each other, from opposite sides.
        within_reach &= self.gaps[:, 1] >= -self.tolerance
        is_near_miss = wide & within_reach & ~close
        is_near_miss |= close & ~wide & (self.overlap.width > self.tolerance / NEAR)
        return replace(self, is_contact=close & wide, is_near_miss=is_near_miss)

    @property
    def is_within(self) -> BoolArray:
        """True (k,) where the facets are nowhere farther apart, and nowhere deeper in each other,
        than the tolerance."""
        within = np.abs(self.gaps) <= (self.tolerance + self.warped)[:, None]
        return np.asarray(within.all(axis=1))

    @property
    def is_close(self) -> BoolArray:
        """True (k,) for facets within the tolerance that are not too steep to each other."""
        return self.is_within & (self.sine <= _STEEPEST)

    @property
    def corner_points(self) -> tuple[IntArray, FloatArray]:
        """The row (m,) that each corner of the overlaps belongs to, and its place (m, 3)."""
        rows = np.repeat(
            np.arange(len(self.a)), np.diff(self.overlap.start, append=len(self.overlap.corners))
        )
        flat = np.einsum("mi,mic->mc", self.overlap.corners, self.axes[rows, :2])
        return rows, self.origin[rows] + flat

    def take(self, rows: IntArray) -> Joints:
        own: dict[str, Any] = {each.name: getattr(self, each.name) for each in fields(self)}
        overlap = own.pop("overlap").take(rows)
        return Joints(overlap=overlap, **{name: column[rows] for name, column in own.items()})

    def with_rows(self, others: Joints) -> Joints:
        """The rows of both, sorted by blocks; between the same blocks ``others`` come last."""
        names = [each.name for each in fields(self) if each.name != "overlap"]
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(others, name)]) for name in names
        }
        both = Joints(overlap=Outlines.joined([self.overlap, others.overlap]), **columns)
        return both.take(np.lexsort((both.b, both.a)))

    def contacts(self, blocks: Sequence[Block], friction: float) -> Contacts:
        """The rows that are contacts, all with one coefficient of friction."""
        j = np.flatnonzero(self.is_contact)
        overlap = self.overlap.take(j)
        a, b = self.a[j], self.b[j]
        return Contacts(
            names=_names(a, b, blocks),
            block_ids=tuple(block.id for block in blocks),
            a=a,
            b=b,
            origin=self.origin[j],
            axes=self.axes[j],
            corner_start=np.append(overlap.start, len(overlap.corners)).astype(np.int64),
            corner_xy=overlap.corners,
            sides=overlap.sides,
            area=overlap.area,
            friction=np.full(len(a), friction),
            pieces={k: p for k, p in enumerate(overlap.pieces.tolist()) if p is not None},
            **self._turns(blocks, j),
        )

    def _turns(self, blocks: Sequence[Block], rows: IntArray) -> dict[str, Any]:
        """For the contacts ``rows``, how many faces do not lie in the contact's plane (``lumped``)
        and the largest angle between one of them and it (``turned``, radians)."""
        lumped, turned = np.zeros(len(rows), dtype=np.int64), 0.5 * np.arcsin(self.sine[rows])
        turned[turned <= RELATIVE_TOLERANCE] = 0.0
        for k in np.flatnonzero(~self.flat[rows].all(axis=1) | (turned > 0.0)).tolist():
            for side, block in enumerate((self.a[rows[k]], self.b[rows[k]])):
                group = self.faces[rows[k], side]
                if self.flat[rows[k], side]:
                    lumped[k] += len(group) if turned[k] else 0
                    continue
                normal = self.axes[rows[k], 2] * (1.0, -1.0)[side]
                count, angle = _turn(blocks[block], group, normal)
                lumped[k] += count
                turned[k] = max(turned[k], angle)
        return {"lumped": lumped, "turned": turned}

    def near_misses(self, blocks: Sequence[Block]) -> Iterator[NearMiss]:
        """Each near miss with the reason why it is no contact: gap, overlap, angle or width."""
        close = self.is_close
        ends = np.append(self.overlap.start, len(self.overlap.corners))
        for j in np.flatnonzero(self.is_near_miss | self._is_leaning).tolist():
            low, high = self.gaps[j].tolist()
            size, tolerance = max(high, -low), float(self.tolerance[j])
            kind: Kind = "gap" if high > tolerance else "overlap"
            if high - low > tolerance:
                kind = "angle"
            if close[j]:
                size, kind = float(self.overlap.width[j]), "sliver"
            elif size <= tolerance:
                continue  # too steep for a joint, and within the tolerance because they are small
            corners = self.overlap.corners[ends[j] : ends[j + 1]]
            yield NearMiss(
                a=blocks[self.a[j]].id,
                b=blocks[self.b[j]].id,
                kind=kind,
                size=size,
                allowed=tolerance,
                place=self.origin[j],
                outline=self.origin[j] + corners @ self.axes[j, :2],
                gaps=(low, high),
                angle=float(np.arcsin(min(self.sine[j], 1.0))),
                cure=size - float(self.warped[j]) if self.sine[j] <= _STEEPEST else np.inf,
            )

    @property
    def _is_leaning(self) -> BoolArray:
        """True (k,) for facets that meet, or nearly so, at one end and are out of reach at the
        other, where their two blocks have no contact and no near miss besides."""
        low, high = self.gaps.T
        meets = (low >= -self.tolerance) & (low <= self.near) & (high > self.near)
        wide = self.overlap.width > self.tolerance
        count = int(self.b.max(initial=0)) + 1
        pair = self.a * count + self.b
        return np.asarray(meets & wide & ~np.isin(pair, pair[self.is_contact | self.is_near_miss]))


def _turn(block: Block, group: Sequence[int], normal: FloatArray) -> tuple[int, float]:
    """How many of the faces ``group`` of a block are not parallel to a plane, and the largest angle
    (radians) that is not one of slivers, which are :data:`SLIVER` of the area."""
    corners, face = fan(block.vertices, [block.faces[i] for i in group])
    vectors = polygon_vectors(corners)
    area = np.linalg.norm(vectors, axis=1)
    has_area = area > 0.0
    angle = 2.0 * np.arcsin(
        0.5 * np.linalg.norm(unit(vectors[has_area]) - normal, axis=1).clip(max=2.0)
    )
    steepest_first = np.argsort(-angle)
    area_share = np.cumsum(area[has_area][steepest_first]) / area.sum()
    largest = float(angle[steepest_first[np.searchsorted(area_share, SLIVER)]])
    return len(np.unique(face[has_area][angle > RELATIVE_TOLERANCE])), largest


def _frames(lower: FacetTable, upper: FacetTable) -> tuple[FloatArray, FloatArray]:
    """Axes t1, t2, n (p, 3, 3) and a point (p, 3) of the plane midway between two facets."""
    normal = unit(lower.normal - upper.normal)
    corner = lower.corners[:, 0]
    to_lower = -_height(corner, lower, normal)
    to_upper = -_height(corner, upper, normal)
    # t1 runs along the first edge of the lower facet that is not short.
    along = np.roll(lower.corners, -1, axis=1) - lower.corners
    along -= np.einsum("pkc,pc->pk", along, normal)[:, :, None] * normal[:, None]
    length = np.linalg.norm(along, axis=2)
    first = (length > RELATIVE_TOLERANCE * length.max(axis=1)[:, None]).argmax(axis=1)
    rows = np.arange(len(along))
    t1 = unit(along[rows, first])
    t1 *= np.sign(t1[rows, np.abs(t1).argmax(axis=1)])[:, None]  # the larger component is positive
    axes = np.stack([t1, np.cross(normal, t1), normal], axis=1)
    return axes, corner + 0.5 * (to_lower + to_upper)[:, None] * normal


def _height(points: FloatArray, facets: FacetTable, normal: FloatArray) -> FloatArray:
    """How far (p,) points (p, 3) lie above the planes of facets (p,), along ``normal`` (p, 3)."""
    above = np.einsum("pc,pc->p", points - facets.point, facets.normal)
    return np.asarray(above / np.einsum("pc,pc->p", facets.normal, normal))


def _gaps(
    overlap: Outlines, lower: FacetTable, upper: FacetTable, axes: FloatArray, base: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest distance (k, 2) between two facets over their overlap, and the height
    (k,) of their mean plane above the point ``base`` (p, 3), at the overlap's centroid."""
    k = np.repeat(np.arange(len(overlap.pair)), np.diff(overlap.start, append=len(overlap.corners)))
    j = overlap.pair
    turned = np.einsum("mi,mij->mj", overlap.corners, overlap.turn[k])
    # Distances are linear over the overlap: its corners have the extremes. Centroids come last.
    flat = np.concatenate([overlap.middle[k] + turned, overlap.middle])
    pair = np.concatenate([j[k], j])
    points = base[pair] + np.einsum("mi,mic->mc", flat, axes[pair, :2])
    normal = axes[pair, 2]
    up, low = (-_height(points, side.take(pair), normal) for side in (upper, lower))
    gap, middle = (up - low)[: len(k)], (0.5 * (up + low))[len(k) :]
    if not len(j):
        return np.empty((0, 2)), middle
    return np.stack(
        [np.minimum.reduceat(gap, overlap.start), np.maximum.reduceat(gap, overlap.start)], axis=1
    ), middle


def _is_aligned_rectangle(flat: FloatArray, sides: IntArray, size: FloatArray) -> BoolArray:
    """Which polygons (p, k, 2) of ``sides`` (p,) corners are rectangles along the two axes."""
    corners = flat[:, :4]
    edges = np.roll(corners, -1, axis=1) - corners
    straight = np.abs(edges).min(axis=2).max(axis=1) <= 1e-9 * size
    return np.asarray(straight & (sides == 4))


def _names(a: IntArray, b: IntArray, blocks: Sequence[Block]) -> tuple[str, ...]:
    """Names "a-b" of contacts; further ones of the same two blocks are "a-b#2", "a-b#3" ..."""
    ids, pairs = [block.id for block in blocks], list(zip(a.tolist(), b.tolist(), strict=True))
    names = [f"{ids[i]}-{ids[k]}" for i, k in pairs]
    if len(set(pairs)) < len(pairs):
        seen: Counter[tuple[int, int]] = Counter()
        for j, pair in enumerate(pairs):
            seen[pair] += 1
            names[j] += f"#{seen[pair]}" if seen[pair] > 1 else ""
    return tuple(names)
