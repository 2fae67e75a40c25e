"""Joints that are curved, crowned or dished: where both sides agree on a shape, it is kept.

Faces within the joint tolerance of a plane are taken as that plane, which is right for faces that
are warped, scanned or hammered: how those of one block are turned says nothing about how those of
the other are. Where both sides are turned alike, the turns are the joint's own, however small they
are against the tolerance, and the faces are contacts as they stand.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.facets import Facets, planes
from cvxlimit.geometry.facing import FacetTable, Reach, facet_table, facing_pairs
from cvxlimit.geometry.joints import Joints
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE

_AGREE = 0.5
"""Both sides agree on a shape where the angles between their faces are less than half the angles
between the faces and one plane (root mean squares over the joint's area). Two meshes of one arc
with n faces each, half a face apart, come to sqrt(3) / n; sides that are rough on their own, and
one rough side on a plane, to 2."""

_COVERED = 0.9
"""Faces as they are must bear on so much of what the patches bear on, or else patches stay; areas
differ by this cosine of the steepest face in a patch though nothing is missing."""


class Shapes:
    """The faces of blocks as they are, for joints whose patches (``table``) may be curved."""

    def __init__(self, blocks: Sequence[Block], table: FacetTable, reach: Reach) -> None:
        self.blocks, self.table, self.reach = blocks, table, reach

    def told(self, joints: Joints) -> Joints:
        """The joints, with pairs of faces in place of pairs of patches where both sides agree."""
        near = (joints.gaps[:, 0] <= joints.allowed + joints.warped) & (
            joints.gaps[:, 1] >= -joints.allowed - joints.warped
        )
        asked = np.unique(joints.sheet[near & joints.lumped.any(axis=1)], axis=0)
        if not len(asked):
            return joints
        faces = self._faces(joints, asked)
        number, key = _numbered(asked, faces.sheet)
        faces, key = faces.take(np.flatnonzero(number)), key[number]
        agreed = _agreed(faces, key, len(asked))
        faces = replace(
            faces, joined=faces.is_within & agreed[key], missed=np.zeros(len(key), bool)
        )
        there, own = _numbered(asked, joints.sheet)
        borne = np.bincount(key, faces.found.area * faces.joined, len(asked)).astype(float)
        patched = np.bincount(own[there], (joints.found.area * joints.joined)[there], len(asked))
        agreed &= (borne >= _COVERED * patched) & _is_wide(faces, key, borne)
        faces = faces.take(np.flatnonzero(faces.joined & agreed[key]))
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
    """Where the normals of both sides agree with each other better than with a mean one: variances
    over the faces that are within the tolerance of each other, weighted by area."""
    area = faces.found.area * faces.is_within
    whole = np.maximum(np.bincount(key, area, count), 1e-300)
    mean = [np.bincount(key, area * faces.axes[:, 2, c], count) / whole for c in range(3)]
    apart = np.bincount(key, area * faces.sine**2, count) / whole
    turned = 1.0 - np.square(mean).sum(axis=0)
    return np.asarray(apart <= (_AGREE**2) * turned + RELATIVE_TOLERANCE**2)


def _is_wide(faces: Joints, key: IntArray, borne: FloatArray) -> BoolArray:
    """Where the faces that bear are together wider than the tolerance: their area over their
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
