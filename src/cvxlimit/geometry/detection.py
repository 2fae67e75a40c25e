"""Contact detection: facets of different blocks that face each other within a joint tolerance."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.base.checks import positive
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.facets import SAME_WAY, Facets, planes
from cvxlimit.geometry.facing import FacetTable, Reach, facet_table, facing_pairs, patches
from cvxlimit.geometry.joints import Joints
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.nearmisses import NearMiss
from cvxlimit.geometry.penetration import Overlaps
from cvxlimit.geometry.strengths import DEFAULT_FRICTION

_AGREE = 0.5
"""Both sides agree on a shape where the angles between their faces are less than half the angles
between the faces and one plane (root mean squares over the joint's area). Two meshes of one arc
with n faces each, half a face apart, come to sqrt(3) / n; sides that are rough on their own, and
one rough side on a plane, to 2."""


class Shapes:
    """The faces of blocks as they are, for joints that may be curved.

    Detection lumps the nearly coplanar faces of a block into *patches*, the rows of ``table``, and
    takes what two patches share as one plane contact. Where a joint is curved, as between the
    voussoirs of a vault, both sides have the same shape and every pair of faces is a contact; where
    sides are rough, each in its own way, the mean plane is right. The patches of a *sheet* go over
    into each other without a sharp edge, and shapes are compared sheet by sheet.
    """

    def __init__(self, blocks: Sequence[Block], table: FacetTable, reach: Reach) -> None:
        self.blocks, self.table, self.reach = blocks, table, reach

    def by_face(self, joints: Joints) -> Joints:
        """Returns the joints, with pairs of faces in place of pairs of patches wherever both sides
        agree on a shape that is no plane."""
        # Pairs of sheets that come near each other and have patches of several faces.
        near = (joints.gaps[:, 0] <= joints.allowed + joints.warped) & (
            joints.gaps[:, 1] >= -joints.allowed - joints.warped
        )
        asked = np.unique(joints.sheet[near & joints.lumped.any(axis=1)], axis=0)
        if not len(asked):
            return joints
        # Their faces, one by one: they bear where they are within the tolerance of each other and
        # their normals agree better than with one plane.
        faces = self._faces(joints, asked)
        number, key = _numbered(asked, faces.sheet)
        faces, key = faces.take(np.flatnonzero(number)), key[number]
        agreed = _agreed(faces, key, len(asked))
        faces = replace(
            faces, joined=faces.is_within & agreed[key], missed=np.zeros(len(key), bool)
        )
        # Sheets keep their patches where faces would bear less area than these, or too narrow one.
        there, own = _numbered(asked, joints.sheet)
        borne = np.bincount(key, faces.found.area * faces.joined, len(asked)).astype(float)
        patched = np.bincount(own[there], (joints.found.area * joints.joined)[there], len(asked))
        # Areas differ by the cosine of the steepest face in a patch though nothing is missing.
        agreed &= (borne >= SAME_WAY * patched) & _is_wide(faces, key, borne)
        faces = faces.take(np.flatnonzero(faces.joined & agreed[key]))
        # Faces take the place of the patches of sheets that agree; what they cover is not missed.
        there[there] = agreed[own[there]]
        covered = there & (_area_of_patches(faces, joints) >= 0.5 * joints.found.area)
        kept = replace(joints, joined=joints.joined & ~there, missed=joints.missed & ~covered)
        return kept.with_rows(faces)

    def _faces(self, joints: Joints, asked: IntArray) -> Joints:
        """Overlaps of the faces in such sheets, as they are."""
        there = np.flatnonzero(np.isin(self.table.sheet, asked))
        which = np.unique(self.table.block[there])
        blocks = [self.blocks[i] for i in which.tolist()]
        row: list[IntArray] = []  # of the table of patches, of every face of each block
        shapes: dict[Facets, list[int]] = defaultdict(list)
        for i, block in enumerate(blocks):
            row.append(np.full(len(block.faces), -1))
            for k in there[self.table.block[there] == which[i]].tolist():
                row[i][list(self.table.faces[k])] = k
            own = planes(block.vertices, block.faces, np.flatnonzero(row[i] >= 0))
            shapes[own].append(i)
        fine = facet_table(blocks, shapes)
        owner = [row[i][group[0]] for i, group in zip(fine.block, fine.faces, strict=True)]
        fine = replace(fine, sheet=self.table.sheet[owner], patch=self.table.patch[owner])
        tolerance = self.reach.tolerance[which]
        reach = Reach(self.reach.size[which], tolerance, 3.0 * tolerance)  # both may be warped
        pairs = np.unique(np.stack([joints.a, joints.b], axis=1), axis=0)
        first, second = np.searchsorted(which, pairs[np.isin(pairs, which).all(axis=1)]).T
        found = Joints.of(fine, *facing_pairs(fine, first, second, reach), reach)
        return replace(found, a=which[found.a], b=which[found.b])


def _numbered(asked: IntArray, pairs: IntArray) -> tuple[BoolArray, IntArray]:
    """Which of the pairs (k, 2) are among those ``asked`` for (sorted), and as which."""
    base = int(max(asked.max(), pairs.max(initial=0))) + 1
    names, own = asked @ [base, 1], pairs @ [base, 1]
    place = np.minimum(np.searchsorted(names, own), len(names) - 1)
    return names[place] == own, place


def _agreed(faces: Joints, key: IntArray, count: int) -> BoolArray:
    """Tells where the normals of both sides agree with each other better than with a mean one:
    mean sin^2(n_a, n_b) <= _AGREE^2 (1 - |mean n|^2), means over the faces that are within the
    tolerance of each other, weighted by area."""
    area = faces.found.area * faces.is_within
    whole = np.maximum(np.bincount(key, area, count), 1e-300)
    mean = [np.bincount(key, area * faces.axes[:, 2, c], count) / whole for c in range(3)]
    apart = np.bincount(key, area * faces.sine**2, count) / whole
    turned = 1.0 - np.square(mean).sum(axis=0)
    return np.asarray(apart <= (_AGREE**2) * turned + RELATIVE_TOLERANCE**2)


def _is_wide(faces: Joints, key: IntArray, borne: FloatArray) -> BoolArray:
    """Tells where the faces that bear are together wider than the tolerance: their area over their
    length. Each for itself may be narrower, as those of a fine mesh are."""
    faces, key = faces.take(np.flatnonzero(faces.joined)), key[faces.joined]
    allowed, reach = np.zeros(len(borne)), np.zeros(len(borne))
    np.maximum.at(allowed, key, faces.allowed)
    of, corners = faces.corner_points
    weight = faces.found.area / borne[key]
    middle = np.stack(
        [np.bincount(key, weight * faces.origin[:, c], len(borne)) for c in range(3)], axis=1
    )
    np.maximum.at(reach, key[of], np.linalg.norm(corners - middle[key[of]], axis=1))
    return np.asarray((borne > 0.0) & (borne > 2.0 * reach * allowed))


def _area_of_patches(faces: Joints, joints: Joints) -> FloatArray:
    """Area of the contacts between faces of each pair of patches."""
    names, inverse = np.unique(
        np.concatenate([joints.patch, faces.patch]), axis=0, return_inverse=True
    )
    area = np.bincount(inverse[len(joints.patch) :], faces.found.area, len(names))
    return np.asarray(area[inverse[: len(joints.patch)]])


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
        joints = shapes.by_face(Joints.of(table, *facing_pairs(table, *near, reach), reach))
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
