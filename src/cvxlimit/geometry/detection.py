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
from cvxlimit.geometry.facets import SAME_WAY, planes
from cvxlimit.geometry.facing import (
    FacetTable,
    Reach,
    Shapes,
    facet_table,
    facing_pairs,
    patches,
)
from cvxlimit.geometry.joints import Joints
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE
from cvxlimit.geometry.nearby import nearby_pairs
from cvxlimit.geometry.nearmisses import NearMiss, cure_of_all, rounded_up
from cvxlimit.geometry.penetration import Overlaps
from cvxlimit.geometry.strengths import DEFAULT_FRICTION

_AGREE = 0.5
"""Both sides of a joint agree on a curved shape where the angles between their faces are less than
half the angles between the faces and one plane (root mean squares over the joint's area). The ratio
is sqrt(3) / n for two meshes of one arc with n faces each, half a face apart; it is 2 for sides
that are rough on their own, and for a rough side on a plane."""


class CurvedJoints:
    """Replaces plane contacts by contacts between single faces where a joint is curved.

    The faces of a block are grouped on two levels: nearly coplanar neighbours are a *patch* (a row
    of ``table``), and patches that meet without a sharp edge are a *sheet*. What two patches share
    is one plane contact. That is right for rough faces, but not for a curved joint, as between the
    voussoirs of a vault: there both sides have the same shape, and each pair of faces is a contact.
    Which of the two holds is decided for each pair of sheets.
    """

    def __init__(self, blocks: Sequence[Block], table: FacetTable, reach: Reach) -> None:
        self.blocks, self.table, self.reach = blocks, table, reach

    def by_face(self, joints: Joints) -> Joints:
        """Returns the joints, with pairs of faces in place of pairs of patches wherever both sides
        have the same curved shape."""
        # 1. The pairs of sheets to look at: near each other, with patches of several faces.
        near = (joints.gaps[:, 0] <= joints.tolerance + joints.warped) & (
            joints.gaps[:, 1] >= -joints.tolerance - joints.warped
        )
        sheets = np.unique(joints.sheet[near & joints.lumped.any(axis=1)], axis=0)
        if not len(sheets):
            return joints
        # 2. Joints between their single faces: contacts where these are within the tolerance of
        # each other and the normals of both sides agree better than with one plane. ``pair`` (k,)
        # is the number of each joint's pair of sheets, ``agree`` one value per pair of sheets.
        faces = self._faces(joints, sheets)
        is_in, pair = _numbered(sheets, faces.sheet)
        faces, pair = faces.take(np.flatnonzero(is_in)), pair[is_in]
        agree = _agreed(faces, pair, len(sheets))
        none = np.zeros(len(pair), bool)
        faces = replace(faces, is_contact=faces.is_within & agree[pair], is_near_miss=none)
        # 3. A pair of sheets keeps its patches where the faces share less area, or too narrow one.
        # Areas differ by the cosine of the steepest face in a patch though nothing is missing.
        there, patch_pair = _numbered(sheets, joints.sheet)
        area = faces.overlap.area * faces.is_contact
        face_area = np.bincount(pair, area, len(sheets)).astype(float)
        area = joints.overlap.area * joints.is_contact
        patch_area = np.bincount(patch_pair[there], area[there], len(sheets))
        agree &= (face_area >= SAME_WAY * patch_area) & _is_wide(faces, pair, face_area)
        faces = faces.take(np.flatnonzero(faces.is_contact & agree[pair]))
        # 4. Elsewhere faces replace patches; patches that they cover by half are no near misses.
        there[there] = agree[patch_pair[there]]
        covered = there & (_area_of_patches(faces, joints) >= 0.5 * joints.overlap.area)
        remaining = replace(
            joints,
            is_contact=joints.is_contact & ~there,
            is_near_miss=joints.is_near_miss & ~covered,
        )
        return remaining.with_rows(faces)

    def _faces(self, joints: Joints, sheets: IntArray) -> Joints:
        """Joints between the single faces of the pairs of ``sheets`` (s, 2)."""
        patches = np.flatnonzero(np.isin(self.table.sheet, sheets))
        which = np.unique(self.table.block[patches])
        blocks = [self.blocks[i] for i in which.tolist()]
        patch_of: list[IntArray] = []  # per block: the row of each face's patch, or -1
        shapes: Shapes = defaultdict(list)
        for i, block in enumerate(blocks):
            patch_of.append(np.full(len(block.faces), -1))
            for k in patches[self.table.block[patches] == which[i]].tolist():
                patch_of[i][list(self.table.faces[k])] = k
            facets = planes(block.vertices, block.faces, np.flatnonzero(patch_of[i] >= 0))
            shapes[block.faces, facets].append(i)
        table = facet_table(blocks, shapes)
        patch = [patch_of[i][group[0]] for i, group in zip(table.block, table.faces, strict=True)]
        table = replace(table, sheet=self.table.sheet[patch], patch=self.table.patch[patch])
        tolerance = self.reach.tolerance[which]
        size, thickness = self.reach.size[which], self.reach.thickness[which]
        reach = Reach(size, thickness, tolerance, 3.0 * tolerance)  # both may be warped
        pairs = np.unique(np.stack([joints.a, joints.b], axis=1), axis=0)
        first, second = np.searchsorted(which, pairs[np.isin(pairs, which).all(axis=1)]).T
        faces = Joints.of(table, *facing_pairs(table, first, second, reach), reach)
        return replace(faces, a=which[faces.a], b=which[faces.b])


def _numbered(rows: IntArray, pairs: IntArray) -> tuple[BoolArray, IntArray]:
    """Which of the pairs (k, 2) are among the sorted ``rows`` (s, 2), and the row of each."""
    base = int(max(rows.max(), pairs.max(initial=0))) + 1
    codes, codes_of_pairs = rows @ [base, 1], pairs @ [base, 1]
    place = np.minimum(np.searchsorted(codes, codes_of_pairs), len(codes) - 1)
    return codes[place] == codes_of_pairs, place


def _agreed(faces: Joints, pair: IntArray, count: int) -> BoolArray:
    """Returns for which of ``count`` pairs of sheets both sides agree on a curved shape.

    With n_a, n_b the unit normals of two faces (``faces.sine`` is that of the angle between them)
    and n their mean (``faces.axes[:, 2]``), they do where

        mean(sin^2(n_a, n_b)) <= _AGREE^2 (1 - |mean(n)|^2),

    with means over the faces within the tolerance of each other, weighted by area.
    ``pair`` (k,) is the number of each face's pair of sheets.
    """
    area = faces.overlap.area * faces.is_within
    total = np.maximum(np.bincount(pair, area, count), 1e-300)
    mean = [np.bincount(pair, area * faces.axes[:, 2, c], count) / total for c in range(3)]
    mean_sine2 = np.bincount(pair, area * faces.sine**2, count) / total
    spread = 1.0 - np.square(mean).sum(axis=0)
    return np.asarray(mean_sine2 <= (_AGREE**2) * spread + RELATIVE_TOLERANCE**2)


def _is_wide(faces: Joints, pair: IntArray, area: FloatArray) -> BoolArray:
    """Returns for which pairs of sheets the faces in contact are together wider than the tolerance:
    their ``area`` (count,) over their length. Single faces of a fine mesh may be narrower. ``pair``
    (k,) is the number of each face's pair of sheets."""
    faces, pair = faces.take(np.flatnonzero(faces.is_contact)), pair[faces.is_contact]
    tolerance, radius = np.zeros(len(area)), np.zeros(len(area))
    np.maximum.at(tolerance, pair, faces.tolerance)
    face, corners = faces.corner_points
    weight = faces.overlap.area / area[pair]
    middle = np.stack(
        [np.bincount(pair, weight * faces.origin[:, c], len(area)) for c in range(3)], axis=1
    )
    np.maximum.at(radius, pair[face], np.linalg.norm(corners - middle[pair[face]], axis=1))
    return np.asarray((area > 0.0) & (area > 2.0 * radius * tolerance))


def _area_of_patches(faces: Joints, joints: Joints) -> FloatArray:
    """Area (k,) of the contacts between single faces that lie in each joint's two patches."""
    pairs, inverse = np.unique(
        np.concatenate([joints.patch, faces.patch]), axis=0, return_inverse=True
    )
    area = np.bincount(inverse[len(joints.patch) :], faces.overlap.area, len(pairs))
    return np.asarray(area[inverse[: len(joints.patch)]])


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
    each pair of faces is a contact, see :class:`CurvedJoints`.

    Raises
    ------
    GeometryError
        If a block touches no other and is none of those ``tied`` to another, if blocks share
        volume, or if ``joint_tolerance`` is more than a free block is thick.
    """
    if joint_tolerance is not None:
        joint_tolerance = positive(joint_tolerance, "joint_tolerance")
    is_fixed = np.array([b.id in fixed for b in blocks])
    reach = Reach.of(blocks, joint_tolerance)
    limit = _limit(blocks, reach, is_fixed)
    table = patches(blocks, reach)
    curved = CurvedJoints(blocks, table, reach)
    overlaps = Overlaps(blocks, reach, limit)
    parts: list[Contacts] = []
    misses: list[NearMiss] = []
    for near in nearby_pairs([b.vertices for b in blocks], reach.near):
        joints = curved.by_face(Joints.of(table, *facing_pairs(table, *near, reach), reach))
        parts.append(joints.contacts(blocks, friction))
        misses += [*joints.near_misses(blocks), *overlaps.check(*near, parts[-1])]
    overlaps.refuse()
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
