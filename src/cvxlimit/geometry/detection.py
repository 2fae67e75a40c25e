"""Contact detection: facets of different blocks that face each other within a joint tolerance.

A contact is all that two blocks share in one plane; which facets share one is said at
:func:`detect`. It goes on in these stages:

1. Faces of each block are grouped into planar facets, which are cut into convex pieces.
2. Pairs of blocks that come near each other, and pairs of their pieces that face each other.
3. Joints: where two facets overlap in the plane midway between them, and the gap there says
   whether that is a contact, a near miss, or neither.
4. Where a joint is curved, contacts between single faces take the place of those of facets.
5. Blocks that share volume are refused, those that touch no other, and those that meet in points.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from cvxlimit.base.arrays import BoolArray
from cvxlimit.base.checks import positive
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.curved import by_face
from cvxlimit.geometry.facing import Reach, facing_pairs, patches
from cvxlimit.geometry.joints import Joints
from cvxlimit.geometry.mesh import polygon_vectors
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.nearmisses import NearMiss, cure_of_all, rounded_up
from cvxlimit.geometry.penetration import Overlaps
from cvxlimit.geometry.strengths import DEFAULT_FRICTION, Pair


@dataclass(frozen=True, eq=False)
class Detection:
    """Contacts between the blocks of a scene, and joints that miss being one by little."""

    contacts: Contacts
    near_misses: tuple[NearMiss, ...]


def detect(
    blocks: Sequence[Block],
    fixed: Collection[str] = (),
    friction: float = DEFAULT_FRICTION,
    joint_tolerance: float | None = None,
    tied: Collection[str] = (),
) -> Detection:
    """Finds the contacts between ``blocks``, except those between two ``fixed`` ones, and the near
    misses.

    Two facets are in contact when they face each other, their distance is everywhere on their
    overlap within ``joint_tolerance`` (length; None:
    :data:`~cvxlimit.geometry.polyhedra.JOINT_TOLERANCE` of the thinner block's mean thickness) plus
    their own warp, and the overlap is wider than that. All that two blocks share in one plane, the
    mean one, is one contact, which may have notches, holes and several parts. On a curved joint
    each pair of faces is a contact, see :mod:`.curved`.

    Raises
    ------
    GeometryError
        If a block touches no other and is none of those ``tied`` to another, if blocks share
        volume, if most of those that meet do so in points, or if ``joint_tolerance`` is more than
        a free block is thick.
    """
    if joint_tolerance is not None:
        joint_tolerance = positive(joint_tolerance, "joint_tolerance")
    is_fixed = np.array([b.id in fixed for b in blocks])
    reach = Reach.of(blocks, joint_tolerance)
    limit = _limit(blocks, reach, is_fixed)
    table = patches(blocks, reach)
    overlaps = Overlaps(blocks, reach, limit)
    parts: list[Contacts] = []
    misses: list[NearMiss] = []
    for near in nearby_pairs([b.vertices for b in blocks], reach.near):
        joints = Joints.of(table, *facing_pairs(table, *near, reach), reach)
        joints = by_face(joints, blocks, table, reach)
        parts.append(joints.contacts(blocks, friction))
        misses += [*joints.near_misses(blocks), *overlaps.check(*near, parts[-1])]
    overlaps.refuse()
    contacts = Contacts.joined(parts)
    is_tied = np.array([b.id in tied for b in blocks])
    _check_faces_meet(blocks, contacts, misses)
    _check_every_block_is_held(blocks, contacts, is_fixed, is_tied, misses)
    ids = {block.id for block, held in zip(blocks, is_fixed, strict=True) if held}
    both = is_fixed[contacts.a] & is_fixed[contacts.b]
    return Detection(
        contacts.take(np.flatnonzero(~both)) if both.any() else contacts,
        tuple(miss for miss in misses if not (miss.a in ids and miss.b in ids)),
    )


def _limit(blocks: Sequence[Block], reach: Reach, is_fixed: BoolArray) -> float:
    """The mean thickness (length) of the thinnest free block, infinite without any: a joint
    tolerance beyond it would join other blocks through it, and is refused."""
    thickness = np.where(is_fixed, np.inf, reach.thickness)
    thinnest = int(thickness.argmin())
    limit, tolerance = float(thickness[thinnest]), float(reach.tolerance[thinnest])
    if tolerance >= limit:
        block = blocks[thinnest]
        raise GeometryError(
            f"joint_tolerance {tolerance:.4g} is no less than the mean thickness of block "
            f"{block.id!r}, {limit:.3g}, so that others would be joined through it: give the width "
            f"of the widest gap; unless given, it is {block.joint_tolerance:.3g} there",
            points=block.vertices,
            blocks=(block.id,),
        )
    return limit


_FEW = 2
"""Pairs of blocks that may lean on each other as they are drawn; hulls do so by the dozen."""


def _check_faces_meet(
    blocks: Sequence[Block], contacts: Contacts, misses: Sequence[NearMiss]
) -> None:
    """Refuses blocks most of which meet in points: faces at an angle that pass each other closely,
    with more of them there than in the joints, as hulls of scanned stones have them."""
    joined, apart = defaultdict[Pair, float](float), defaultdict[Pair, float](float)
    for a, b, area in zip(contacts.a.tolist(), contacts.b.tolist(), contacts.area, strict=True):
        joined[blocks[a].id, blocks[b].id] += float(area)
    for miss in misses:
        if miss.kind == "angle":
            apart[miss.a, miss.b] += float(np.linalg.norm(polygon_vectors(miss.outline)))
    pointed = [pair for pair in apart if apart[pair] > joined[pair]]
    meeting = len({*joined, *apart})
    if len(pointed) > max(_FEW, meeting / 2):
        raise GeometryError(
            f"the blocks do not touch in faces: at {len(pointed)} of the {meeting} pairs that meet "
            "more of the faces passes at an angle than lies in a joint, as hulls of scanned stones "
            "do, and no load factor would mean anything: give neighbours faces that match, for "
            "example by cutting both along one plane",
            points=np.array([miss.place for miss in misses if miss.kind == "angle"]),
            blocks=tuple(dict.fromkeys(name for pair in pointed for name in pair)),
        )


def _check_every_block_is_held(
    blocks: Sequence[Block],
    contacts: Contacts,
    is_fixed: BoolArray,
    is_tied: BoolArray,
    misses: Sequence[NearMiss],
) -> None:
    """Refuses blocks without contact; of several a free one is named, as it is the one to move."""
    loose = np.setdiff1d(np.flatnonzero(~is_tied), [contacts.a, contacts.b])
    if not len(loose):
        return
    named = blocks[int(loose[np.argmin(is_fixed[loose])])]
    own_misses = [miss for miss in misses if named.id in (miss.a, miss.b)]
    nearest = min(own_misses, key=lambda miss: miss.factor, default=None)
    hint = f" ({nearest.sentence()})" if nearest else ""
    cure, (enough, count) = "", cure_of_all(misses)
    if nearest and nearest.kind == "sliver":
        cure = "give a smaller joint_tolerance, "
    elif nearest and nearest.can_be_joined:
        cure = f"give a joint_tolerance of {rounded_up(enough)}, "
        cure += f"which joins all {count} that are nearly there, " if count > 1 else ""
    raise GeometryError(
        f"block {named.id!r} (centre {named.centroid.round(6).tolist()}) touches no other "
        f"block{hint}: {cure}move it so that a face meets another block's face, tie it to one, or "
        "remove it",
        points=named.vertices,
        blocks=(named.id,),
    )
