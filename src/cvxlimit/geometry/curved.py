"""Curved joints: contacts between single faces where both sides have the same curved shape.

The faces of a block are grouped on two levels: nearly coplanar neighbours are a *patch* (a row of
the table of facets), and patches that meet without a sharp edge are a *sheet*. What two patches
share is one plane contact. That is right for rough faces, but not for a curved joint, as between
the voussoirs of a vault: there both sides have the same shape, and each pair of faces is a contact.
Which of the two holds is decided for each pair of sheets.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.facets import SAME_WAY, planes
from cvxlimit.geometry.facing import FacetTable, Reach, Shapes, facet_table, facing_pairs
from cvxlimit.geometry.joints import Joints
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE

_AGREE = 0.5
"""Both sides of a joint agree on a curved shape where the angles between their faces are less than
half the angles between the faces and one plane (root mean squares over the joint's area). The ratio
is sqrt(3) / n for two meshes of one arc with n faces each, half a face apart; it is 2 for sides
that are rough on their own, and for a rough side on a plane."""


def by_face(joints: Joints, blocks: Sequence[Block], table: FacetTable, reach: Reach) -> Joints:
    """Returns the joints between ``blocks``, whose patches are rows of ``table``, with pairs of
    faces in place of pairs of patches wherever both sides have the same curved shape."""
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
    faces = _by_single_faces(joints, sheets, blocks, table, reach)
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


def _by_single_faces(
    joints: Joints, sheets: IntArray, blocks: Sequence[Block], table: FacetTable, reach: Reach
) -> Joints:
    """Joints between the single faces of the pairs of ``sheets`` (s, 2)."""
    patches = np.flatnonzero(np.isin(table.sheet, sheets))
    which = np.unique(table.block[patches])
    some = [blocks[i] for i in which.tolist()]
    patch_of: list[IntArray] = []  # per block: the row of each face's patch, or -1
    shapes: Shapes = defaultdict(list)
    for i, block in enumerate(some):
        patch_of.append(np.full(len(block.faces), -1))
        for k in patches[table.block[patches] == which[i]].tolist():
            patch_of[i][list(table.faces[k])] = k
        facets = planes(block.vertices, block.faces, np.flatnonzero(patch_of[i] >= 0))
        shapes[block.faces, facets].append(i)
    single = facet_table(some, shapes)
    patch = [patch_of[i][group[0]] for i, group in zip(single.block, single.faces, strict=True)]
    single = replace(single, sheet=table.sheet[patch], patch=table.patch[patch])
    tolerance = reach.tolerance[which]
    size, thickness = reach.size[which], reach.thickness[which]
    own = Reach(size, thickness, tolerance, 3.0 * tolerance)  # both may be warped
    pairs = np.unique(np.stack([joints.a, joints.b], axis=1), axis=0)
    first, second = np.searchsorted(which, pairs[np.isin(pairs, which).all(axis=1)]).T
    faces = Joints.of(single, *facing_pairs(single, first, second, own), own)
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
