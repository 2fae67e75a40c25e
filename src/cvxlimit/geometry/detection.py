"""Contact detection: facets of different blocks that face each other within a joint tolerance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cvxlimit.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.checks import positive
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.facing import NEAR, FacetTable, Reach, facet_table, facing_pairs
from cvxlimit.geometry.mesh import unit
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.nearmisses import Kind, NearMiss
from cvxlimit.geometry.penetration import Overlaps
from cvxlimit.geometry.polygons import Outlines, outlines
from cvxlimit.geometry.polyhedra import RELATIVE_TOLERANCE
from cvxlimit.strengths import DEFAULT_FRICTION

_STEEPEST = 0.1
"""Sine of the angle between two facets in contact, at most: beyond, a normal force could not be
said to act along both normals to a tenth, however small the facets and the gap between them."""


_SIDE = 1e-6
"""Sides shorter than this share of a facet's longest say nothing about how it is turned."""


@dataclass(frozen=True, eq=False)
class Detection:
    """What was found between the blocks of a scene: contacts, and joints that are nearly there."""

    contacts: Contacts
    near_misses: tuple[NearMiss, ...]


def detect(
    blocks: Sequence[Block],
    fixed: Collection[str] = (),
    friction: float = DEFAULT_FRICTION,
    joint_tolerance: float | None = None,
    tied: Collection[str] = (),
) -> Detection:
    """Contacts between ``blocks``, except those between two ``fixed`` ones, and near misses.

    A block that touches no other is refused, unless it is one of those ``tied`` to another.

    Two facets are in contact when they face each other and, everywhere on their overlap, are no
    farther apart and no deeper in each other than ``joint_tolerance`` (length; None:
    :data:`~cvxlimit.geometry.polyhedra.JOINT_TOLERANCE` of the thinner block's mean thickness) and
    by how much they are warped, and the overlap is wider than that. What two blocks transmit
    through one plane, the mean one, is one contact, with notches, holes and several parts.
    """
    if joint_tolerance is not None:
        joint_tolerance = positive(joint_tolerance, "joint_tolerance")
    is_fixed = np.array([b.id in fixed for b in blocks])
    table, reach = facet_table(blocks, joint_tolerance)
    overlaps = Overlaps(blocks, reach.tolerance)
    parts: list[Contacts] = []
    misses: list[NearMiss] = []
    # Blocks in each other are refused in the portion of pairs where they are met first, so that
    # neither memory nor time grows with the number of such pairs.
    for near in nearby_pairs([b.vertices for b in blocks], reach.near):
        joints = _Joints.of(table, *facing_pairs(table, *near, reach), reach)
        parts.append(joints.contacts(blocks, friction))
        misses += [*joints.near_misses(blocks), *overlaps.check(*near, parts[-1])]
    if not parts:
        none = np.empty(0, dtype=np.int64)
        parts = [_Joints.of(table, none, none, reach).contacts(blocks, friction)]
    contacts = Contacts.joined(parts)
    if len(parts) > 1:
        contacts = contacts.take(np.lexsort((contacts.b, contacts.a)))
    is_tied = np.array([b.id in tied for b in blocks])
    _check_every_block_is_held(blocks, contacts, is_fixed, is_tied, misses)
    ids = {block.id for block, held in zip(blocks, is_fixed, strict=True) if held}
    both = is_fixed[contacts.a] & is_fixed[contacts.b]
    return Detection(
        contacts.take(np.flatnonzero(~both)) if both.any() else contacts,
        tuple(miss for miss in misses if not (miss.a in ids and miss.b in ids)),
    )


@dataclass(frozen=True, eq=False)
class _Joints:
    """Overlaps of facing facets with their frames, sorted by blocks ``a``, ``b`` (k,). ``gaps`` (k,
    2) is the least and the largest distance between the facets' planes over the overlap, ``sine``
    of the angle between them, ``allowed`` and ``near`` the pair's tolerance and reach. Facets are
    themselves off their planes: by how much, ``warped``, is allowed on top, or else two that meet
    perfectly would not be a joint."""

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

    @classmethod
    def of(cls, table: FacetTable, lower: IntArray, upper: IntArray, reach: Reach) -> _Joints:
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
        return cls(
            one.block[j], other.block[j], found, origin, frames, gaps, sine[j],
            allowed[j], warped[j], near[j] + warped[j],
        )  # fmt: skip

    @property
    def is_close(self) -> BoolArray:
        within = np.abs(self.gaps) <= (self.allowed + self.warped)[:, None]
        return np.asarray(within.all(axis=1) & (self.sine <= _STEEPEST))

    def contacts(self, blocks: Sequence[Block], friction: float) -> Contacts:
        j = np.flatnonzero(self.is_close & (self.found.width > self.allowed))
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
        )

    def near_misses(self, blocks: Sequence[Block]) -> Iterator[NearMiss]:
        wide = self.found.width > self.allowed
        close = self.is_close
        off = (np.abs(self.gaps) <= self.near[:, None]).all(axis=1)
        off &= self.gaps[:, 1] >= -self.allowed  # farther in: facets that look away from each other
        rows = (wide & off & ~close) | (close & ~wide & (self.found.width > self.allowed / NEAR))
        ends = np.append(self.found.start, len(self.found.corners))
        for j in np.flatnonzero(rows).tolist():
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
            )


def _frames(lower: FacetTable, upper: FacetTable) -> tuple[FloatArray, FloatArray]:
    normal = unit(lower.normal - upper.normal)
    base = lower.corners[:, 0]
    below = -_height(base, lower, normal)
    above = -_height(base, upper, normal)
    along = np.roll(lower.corners, -1, axis=1) - lower.corners
    along -= np.einsum("pkc,pc->pk", along, normal)[:, :, None] * normal[:, None]
    length = np.linalg.norm(along, axis=2)
    first = (length > _SIDE * length.max(axis=1)[:, None]).argmax(axis=1)
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


def _check_every_block_is_held(
    blocks: Sequence[Block],
    contacts: Contacts,
    is_fixed: BoolArray,
    is_tied: BoolArray,
    misses: Sequence[NearMiss],
) -> None:
    """Refuse loose blocks; of several a free one is named, as it is the one to move."""
    alone = np.setdiff1d(np.flatnonzero(~is_tied), [contacts.a, contacts.b])
    if not len(alone):
        return
    lonely = blocks[int(alone[np.argmin(is_fixed[alone])])]
    nearly = [miss for miss in misses if lonely.id in (miss.a, miss.b)]
    hint = f" ({min(nearly, key=lambda miss: miss.factor).sentence()})" if nearly else ""
    cure = ", give a larger joint_tolerance" if nearly else ""
    raise GeometryError(
        f"block {lonely.id!r} (centre {lonely.centroid.round(6).tolist()}) touches no other "
        f"block{hint}: move it so that a face meets another block's face{cure}, tie it to one, or "
        "remove it",
        points=lonely.vertices,
        blocks=(lonely.id,),
    )
