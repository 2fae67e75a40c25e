"""Joints: where facets of two blocks overlap, how far apart they are, and which are contacts."""

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
from cvxlimit.geometry.polygons import Outlines, outlines

_STEEPEST = 0.1
"""Sine of the angle between two facets in contact, at most: beyond, a normal force could not be
said to act along both normals to a tenth, however small the facets and the gap between them."""


@dataclass(frozen=True, eq=False)
class Joints:
    """Overlaps of facing facets with their frames, sorted by blocks ``a``, ``b`` (k,). ``gaps`` (k,
    2) is the least and the largest distance between the facets' planes over the overlap, ``sine``
    of the angle between them, ``allowed`` and ``near`` the pair's tolerance and reach. Facets are
    themselves off their planes: by how much, ``warped``, is allowed on top, or else two that meet
    perfectly would not be a joint. Of both facets (k, 2): the numbers of their ``faces``, whether
    these are in one plane to rounding (``flat``) or may be a shape (``lumped``), and the ``sheet``
    and the ``patch`` that they belong to. ``joined`` and ``missed`` are the contacts and the near
    misses among the rows."""

    a: IntArray
    b: IntArray
    found: Outlines
    origin: FloatArray
    axes: FloatArray
    gaps: FloatArray
    sine: FloatArray
    allowed: FloatArray
    warped: FloatArray
    near: FloatArray
    faces: NDArray[np.object_]
    flat: BoolArray
    lumped: BoolArray
    sheet: IntArray
    patch: IntArray
    joined: BoolArray
    missed: BoolArray

    @classmethod
    def of(cls, table: FacetTable, lower: IntArray, upper: IntArray, reach: Reach) -> Joints:
        """``lower`` belongs to block a and gives the normal."""
        key = table.facet[lower] * (int(table.facet[-1]) + 1) + table.facet[upper]
        _, first, pair = np.unique(key, return_index=True, return_inverse=True)
        one, other = table.take(lower[first]), table.take(upper[first])
        size = reach.size[one.block]
        axes, base = _frames(one, other)
        flat = [
            np.einsum("pkc,pic->pki", table.corners[rows] - base[pair][:, None], axes[pair, :2])
            for rows in (lower, upper)
        ]
        alone = np.bincount(pair)[pair] == 1
        boxes = alone & _is_aligned_rectangle(flat[0], table.sides[lower], size[pair])
        boxes &= _is_aligned_rectangle(flat[1], table.sides[upper], size[pair])
        allowed = np.minimum(reach.tolerance[one.block], reach.tolerance[other.block])
        found = outlines(flat[0], flat[1], boxes, pair, allowed)
        warped = one.off + other.off
        least = RELATIVE_TOLERANCE * np.minimum(size, reach.size[other.block])
        found = found.take(np.flatnonzero(found.width > least[found.pair]))
        found = found.take(np.lexsort((other.block[found.pair], one.block[found.pair])))
        j = found.pair
        gaps, middle = _gaps(found, one, other, axes, base)
        frames = axes[j]
        origin = base[j] + np.einsum("kp,kpc->kc", found.middle, frames[:, :2])
        origin += middle[:, None] * frames[:, 2]
        frames[:, :2] = found.turn @ frames[:, :2]
        near = np.minimum(reach.near[one.block], reach.near[other.block])
        sine = np.linalg.norm(np.cross(one.normal, other.normal), axis=1)

        def of_both(name: str) -> Any:
            return np.stack([getattr(side, name)[j] for side in (one, other)], axis=1)

        flat = of_both("bent") <= RELATIVE_TOLERANCE * reach.size[of_both("block")]
        none = np.zeros(len(j), dtype=bool)
        return cls(
            one.block[j], other.block[j], found, origin, frames, gaps, sine[j],
            allowed[j], warped[j], near[j] + warped[j], of_both("faces"), flat,
            of_both("lumped") & ~flat, of_both("sheet"), of_both("patch"), none, none,
        )._told_apart()  # fmt: skip

    def _told_apart(self) -> Joints:
        wide, close = self.found.width > self.allowed, self.is_close
        off = (np.abs(self.gaps) <= self.near[:, None]).all(axis=1)
        off &= self.gaps[:, 1] >= -self.allowed  # farther in: facets that look away from each other
        missed = wide & off & ~close
        missed |= close & ~wide & (self.found.width > self.allowed / NEAR)
        return replace(self, joined=close & wide, missed=missed)

    @property
    def is_within(self) -> BoolArray:
        """No farther apart, and no deeper in each other, than the tolerance."""
        within = np.abs(self.gaps) <= (self.allowed + self.warped)[:, None]
        return np.asarray(within.all(axis=1))

    @property
    def is_close(self) -> BoolArray:
        return self.is_within & (self.sine <= _STEEPEST)

    @property
    def corner_points(self) -> tuple[IntArray, FloatArray]:
        """The row of every corner of the overlaps, and where it is, (m,) and (m, 3)."""
        rows = np.repeat(
            np.arange(len(self.a)), np.diff(self.found.start, append=len(self.found.corners))
        )
        flat = np.einsum("mi,mic->mc", self.found.corners, self.axes[rows, :2])
        return rows, self.origin[rows] + flat

    def take(self, rows: IntArray) -> Joints:
        own: dict[str, Any] = {each.name: getattr(self, each.name) for each in fields(self)}
        found = own.pop("found").take(rows)
        return Joints(found=found, **{name: column[rows] for name, column in own.items()})

    def with_rows(self, others: Joints) -> Joints:
        """The rows of both, by blocks; within two blocks those of ``others`` come last."""
        names = [each.name for each in fields(self) if each.name != "found"]
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(others, name)]) for name in names
        }
        both = Joints(found=Outlines.joined([self.found, others.found]), **columns)
        return both.take(np.lexsort((both.b, both.a)))

    def contacts(self, blocks: Sequence[Block], friction: float) -> Contacts:
        j = np.flatnonzero(self.joined)
        found = self.found.take(j)
        a, b = self.a[j], self.b[j]
        return Contacts(
            names=_names(a, b, blocks),
            block_ids=tuple(block.id for block in blocks),
            a=a,
            b=b,
            origin=self.origin[j],
            axes=self.axes[j],
            corner_start=np.append(found.start, len(found.corners)).astype(np.int64),
            corner_xy=found.corners,
            sides=found.sides,
            area=found.area,
            friction=np.full(len(a), friction),
            pieces={k: p for k, p in enumerate(found.pieces.tolist()) if p is not None},
            **self._turns(blocks, j),
        )

    def _turns(self, blocks: Sequence[Block], rows: IntArray) -> dict[str, Any]:
        """How many faces are not in their contact's plane, and the largest angle to it."""
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
        close = self.is_close
        ends = np.append(self.found.start, len(self.found.corners))
        for j in np.flatnonzero(self.missed | self._is_leaning).tolist():
            low, high = self.gaps[j].tolist()
            size, allowed = max(high, -low), float(self.allowed[j])
            kind: Kind = "gap" if high > allowed else "overlap"
            if high - low > allowed:
                kind = "angle"
            if close[j]:
                size, kind = float(self.found.width[j]), "sliver"
            elif size <= allowed:
                continue  # too steep for a joint, and within the tolerance because they are small
            corners = self.found.corners[ends[j] : ends[j + 1]]
            yield NearMiss(
                a=blocks[self.a[j]].id,
                b=blocks[self.b[j]].id,
                kind=kind,
                size=size,
                allowed=allowed,
                place=self.origin[j],
                outline=self.origin[j] + corners @ self.axes[j, :2],
                gaps=(low, high),
                angle=float(np.arcsin(min(self.sine[j], 1.0))),
                cure=size - float(self.warped[j]) if self.sine[j] <= _STEEPEST else np.inf,
            )

    @property
    def _is_leaning(self) -> BoolArray:
        """Facets that meet, or nearly so, at one end, and are beyond all reach at the other, of
        blocks that are not joined otherwise."""
        low, high = self.gaps.T
        meets = (low >= -self.allowed) & (low <= self.near) & (high > self.near)
        wide = self.found.width > self.allowed
        count = int(self.b.max(initial=0)) + 1
        pair = self.a * count + self.b
        return np.asarray(meets & wide & ~np.isin(pair, pair[self.joined | self.missed]))


def _turn(block: Block, group: Sequence[int], normal: FloatArray) -> tuple[int, float]:
    """How many of a block's faces are turned from a plane, and by how much the most turned one."""
    corners, face = fan(block.vertices, [block.faces[i] for i in group])
    vectors = polygon_vectors(corners)
    area = np.linalg.norm(vectors, axis=1)
    real = area > 0.0
    angle = 2.0 * np.arcsin(
        0.5 * np.linalg.norm(unit(vectors[real]) - normal, axis=1).clip(max=2.0)
    )
    falling = np.argsort(-angle)
    share = np.cumsum(area[real][falling]) / area.sum()
    largest = float(angle[falling[np.searchsorted(share, SLIVER)]])
    return len(np.unique(face[real][angle > RELATIVE_TOLERANCE])), largest


def _frames(lower: FacetTable, upper: FacetTable) -> tuple[FloatArray, FloatArray]:
    normal = unit(lower.normal - upper.normal)
    base = lower.corners[:, 0]
    below = -_height(base, lower, normal)
    above = -_height(base, upper, normal)
    along = np.roll(lower.corners, -1, axis=1) - lower.corners
    along -= np.einsum("pkc,pc->pk", along, normal)[:, :, None] * normal[:, None]
    length = np.linalg.norm(along, axis=2)
    first = (length > RELATIVE_TOLERANCE * length.max(axis=1)[:, None]).argmax(axis=1)
    rows = np.arange(len(along))
    t1 = unit(along[rows, first])
    t1 *= np.sign(t1[rows, np.abs(t1).argmax(axis=1)])[:, None]  # the larger component is positive
    axes = np.stack([t1, np.cross(normal, t1), normal], axis=1)
    return axes, base + 0.5 * (below + above)[:, None] * normal


def _height(points: FloatArray, facets: FacetTable, normal: FloatArray) -> FloatArray:
    """How far points (p, 3) lie above the planes of facets (p,), along ``normal`` (p, 3)."""
    above = np.einsum("pc,pc->p", points - facets.point, facets.normal)
    return np.asarray(above / np.einsum("pc,pc->p", facets.normal, normal))


def _gaps(
    found: Outlines, lower: FacetTable, upper: FacetTable, axes: FloatArray, base: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Least and largest distance (k, 2) of facet pairs over their overlaps, and how high (k,) the
    mean plane lies above ``base``'s at the overlap's centroid."""
    k = np.repeat(np.arange(len(found.pair)), np.diff(found.start, append=len(found.corners)))
    j = found.pair
    turned = np.einsum("mi,mij->mj", found.corners, found.turn[k])
    flat = np.concatenate([found.middle[k] + turned, found.middle])
    pair = np.concatenate([j[k], j])
    points = base[pair] + np.einsum("mi,mic->mc", flat, axes[pair, :2])
    normal = axes[pair, 2]
    up, low = (-_height(points, side.take(pair), normal) for side in (upper, lower))
    gap, middle = (up - low)[: len(k)], (0.5 * (up + low))[len(k) :]
    if not len(j):
        return np.empty((0, 2)), middle
    return np.stack(
        [np.minimum.reduceat(gap, found.start), np.maximum.reduceat(gap, found.start)], axis=1
    ), middle


def _is_aligned_rectangle(flat: FloatArray, sides: IntArray, size: FloatArray) -> BoolArray:
    corners = flat[:, :4]
    edges = np.roll(corners, -1, axis=1) - corners
    straight = np.abs(edges).min(axis=2).max(axis=1) <= 1e-9 * size
    return np.asarray(straight & (sides == 4))


def _names(a: IntArray, b: IntArray, blocks: Sequence[Block]) -> tuple[str, ...]:
    ids, pairs = [block.id for block in blocks], list(zip(a.tolist(), b.tolist(), strict=True))
    names = [f"{ids[i]}-{ids[k]}" for i, k in pairs]
    if len(set(pairs)) < len(pairs):
        seen: Counter[tuple[int, int]] = Counter()
        for j, pair in enumerate(pairs):
            seen[pair] += 1
            names[j] += f"#{seen[pair]}" if seen[pair] > 1 else ""
    return tuple(names)
