"""Contact detection: facets of different blocks that face each other within a joint tolerance."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from cvxlimit.base.arrays import BoolArray
from cvxlimit.base.checks import positive
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.facing import facing_pairs, patches
from cvxlimit.geometry.joints import Joints
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.nearmisses import NearMiss
from cvxlimit.geometry.penetration import Overlaps
from cvxlimit.geometry.shapes import Shapes
from cvxlimit.geometry.strengths import DEFAULT_FRICTION


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
    through one plane, the mean one, is one contact, with notches, holes and several parts. Where
    the faces of both sides agree on a shape that is none, each pair of them is a contact.
    """
    if joint_tolerance is not None:
        joint_tolerance = positive(joint_tolerance, "joint_tolerance")
    is_fixed = np.array([b.id in fixed for b in blocks])
    table, reach = patches(blocks, joint_tolerance)
    shapes = Shapes(blocks, table, reach)
    overlaps = Overlaps(blocks, reach.tolerance)
    parts: list[Contacts] = []
    misses: list[NearMiss] = []
    # Blocks in each other are refused in the portion of pairs where they are met first, so that
    # neither memory nor time grows with the number of such pairs.
    for near in nearby_pairs([b.vertices for b in blocks], reach.near):
        joints = shapes.told(Joints.of(table, *facing_pairs(table, *near, reach), reach))
        parts.append(joints.contacts(blocks, friction))
        misses += [*joints.near_misses(blocks), *overlaps.check(*near, parts[-1])]
    if not parts:
        none = np.empty(0, dtype=np.int64)
        parts = [Joints.of(table, none, none, reach).contacts(blocks, friction)]
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
    nearest = min(nearly, key=lambda miss: miss.factor, default=None)
    hint = f" ({nearest.sentence()})" if nearest else ""
    cure = ", give a larger joint_tolerance" if nearest and nearest.can_be_joined else ""
    raise GeometryError(
        f"block {lonely.id!r} (centre {lonely.centroid.round(6).tolist()}) touches no other "
        f"block{hint}: move it so that a face meets another block's face{cure}, tie it to one, or "
        "remove it",
        points=lonely.vertices,
        blocks=(lonely.id,),
    )
