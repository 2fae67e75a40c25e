"""Scenes with a mirror plane: half the model.

If a reflection carries blocks, loads and the admissible forces of every contact into those of its
partner, then with any solution its mirror image is one, and so, by convexity, is their mean: one
half of the contacts says it all. Contacts that are their own partners carry the symmetric part of
their forces, and blocks move like their partners. None of this holds with interaction; what does
is in :mod:`cvxlimit.extensions.interaction.halves`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.statics import BALANCED, DOF, Statics
from cvxlimit.surfaces.base import CONSTANT, Condition, LinearForm, YieldSurface, stated
from cvxlimit.surfaces.cones import Cone, Conic, Facets
from cvxlimit.surfaces.coulomb import Bounds, Rocking


@dataclass(frozen=True, eq=False)
class Mirror:
    """A plane of symmetry and the partners of blocks and contacts.

    Attributes
    ----------
    normal : (3,)
        Unit normal of the plane.
    blocks, contacts : (free blocks,) and (n,)
        The number of each one's mirror image, its own number where it is its own image.
    carried : (n, 6, 6)
        Maps forces V1 V2 N M1 M2 MT of a contact to those of its partner in the mirrored state.
    """

    normal: FloatArray
    blocks: IntArray
    contacts: IntArray
    carried: FloatArray

    @property
    def reflection(self) -> FloatArray:
        return reflected(self.normal)

    @property
    def forces(self) -> sp.csr_array:
        """The matrix (6 n, 6 n) that gives the forces of all contacts from those of the contacts
        with the lower number of a pair; of a contact that is its own partner it takes the symmetric
        part. Columns of the others are zero."""
        width = len(COMPONENTS)
        each = np.arange(len(self.contacts))
        first = np.flatnonzero(each <= self.contacts)
        own = self.contacts[first] == first
        unit = np.tile(np.eye(width), (len(first), 1, 1))
        unit[own] = 0.5 * (unit[own] + self.carried[first[own]])
        others = first[~own]
        entries = np.concatenate([unit, self.carried[others]])
        place = np.concatenate([first, self.contacts[others]]), np.concatenate([first, others])
        rows = width * place[0][:, None, None] + np.arange(width)[:, None]
        columns = width * place[1][:, None, None] + np.arange(width)
        index = tuple(np.broadcast_to(i, entries.shape).ravel() for i in (rows, columns))
        shape = (width * len(each), width * len(each))
        result = sp.csr_array((entries.ravel(), index), shape=shape)
        result.eliminate_zeros()
        return result


def find_mirror(
    statics: Statics, surfaces: Sequence[YieldSurface], across: FloatArray | None = None
) -> Mirror | None:
    """Returns a mirror plane of a scene under these surfaces, or None. ``across`` is the normal of
    a planar scene's plane, which is a mirror plane too, but halves nothing."""
    free = statics.centroids[statics.row_of_block >= 0]
    size = statics.contacts.extent
    for normal in _candidates(statics, free):
        if across is not None and abs(normal @ across) > BALANCED:
            continue
        mirror = _mirror(statics, normal, free, size)
        if mirror is not None and is_invariant(
            surfaces, statics.contacts, mirror.contacts, mirror.carried
        ):
            return mirror
    return None


def _candidates(statics: Statics, free: FloatArray) -> Iterator[FloatArray]:
    """Yields unit normals of possible mirror planes: across both loads, along the principal axes of
    the centroids ``free`` (free blocks, 3), along x, y and z."""
    dead, live = (f.reshape(-1, DOF)[:, :3].sum(axis=0) for f in (statics.dead, statics.live))
    spread = np.linalg.eigh(np.cov(free.T))[1].T if len(free) > 1 else np.eye(3)
    both = np.cross(dead, live)
    is_clear = np.linalg.norm(both) > 1e-9 * np.linalg.norm(dead) * np.linalg.norm(live)
    return directions([*([both] if is_clear else []), *spread, *np.eye(3)])


def _mirror(statics: Statics, normal: FloatArray, free: FloatArray, size: float) -> Mirror | None:
    """Returns the mirror with this normal if blocks, loads, contacts and corners have partners."""
    reflection = reflected(normal)
    turn = reflection[:3, :3]
    loads = [load.reshape(-1, DOF) for load in (statics.dead, statics.live)]
    offset = 2.0 * float((free @ normal).mean()) * normal
    near = BALANCED * size
    blocks = _partners(free, free @ turn + offset, near)
    if blocks is None or not all(
        are_loads_alike(load[blocks], load @ reflection, size, BALANCED) for load in loads
    ):
        return None
    contacts = statics.contacts
    partner = _partners(contacts.origin, contacts.origin @ turn + offset, near)
    if partner is None:
        return None
    local = contacts.axes[partner] @ turn @ np.swapaxes(contacts.axes, 1, 2)
    side = local[:, 2, 2]
    if np.abs(np.abs(side) - 1.0).max() > BALANCED or not _same_blocks(
        statics, blocks, partner, side > 0.0
    ):
        return None
    # corners of a contact have a place of their own along a fourth axis, far from those of others
    corners, owner = contacts.corner_points, size * contacts.corner_contact
    images = np.column_stack([corners @ turn + offset, size * partner[contacts.corner_contact]])
    if _partners(np.column_stack([corners, owner]), images, near) is None:
        return None
    carried = np.zeros((len(contacts), DOF, DOF))
    carried[:, :3, :3] = np.sign(side)[:, None, None] * local
    carried[:, 3:, 3:] = -carried[:, :3, :3]
    return Mirror(normal, blocks, partner, carried)


def _partners(places: FloatArray, images: FloatArray, near: float) -> IntArray | None:
    """Returns which of the places (n, k) each image (n, k) is at; None if one is at none."""
    tree = cKDTree(places, balanced_tree=False, compact_nodes=False)
    distance, found = map(np.asarray, tree.query(images, distance_upper_bound=2.0 * near))
    if distance.max() > near or not np.bincount(found, minlength=len(places)).all():
        return None
    return np.asarray(found)


def _same_blocks(
    statics: Statics, blocks: IntArray, partner: IntArray, is_kept: NDArray[np.bool_]
) -> bool:
    number, contacts = statics.row_of_block, statics.contacts
    image = np.append(blocks, -1)
    a, b = number[contacts.a], number[contacts.b]
    one, other = np.where(is_kept, image[a], image[b]), np.where(is_kept, image[b], image[a])
    return bool((a[partner] == one).all() and (b[partner] == other).all())


def is_invariant(
    surfaces: Sequence[YieldSurface], contacts: Contacts, partner: IntArray, carried: FloatArray
) -> bool:
    """True if admissible forces x of contact j give admissible forces Q_j x of its partner.

    ``carried`` (n, 6, 6) are Q_j. Rocking is left out: it is a matter of the contacts' corners.
    False also for conditions with rows of their own, coefficients in Parameters, cones that are not
    known.
    """
    alike = (getattr(contacts, name) for name in ("least", "most", "sense"))
    return all(np.array_equal(each[partner], each) for each in alike) and all(
        _carries(condition, surface.cone, contacts, partner, carried)
        for surface in surfaces
        if type(surface) not in (Rocking, Bounds)
        for condition in stated(surface, contacts)
    )


def _carries(
    condition: Condition, cone: Cone, contacts: Contacts, partner: IntArray, carried: FloatArray
) -> bool:
    if condition.contact is not None:
        return False
    resistance = coefficients(condition.resistance, len(contacts))
    if resistance is None or not _same(_images(resistance, partner, carried), resistance):
        return False
    for norm in condition.norms:
        rows = [coefficients(form, len(contacts)) for form in norm.weighted_rows]
        known = [row for row in rows if row is not None]
        if len(known) < len(rows):
            return False
        images = [_images(row, partner, carried) for row in known]
        if not _same_size(np.stack(known, axis=1), np.stack(images, axis=1), cone):
            return False
    return True


def reflected(normals: FloatArray) -> FloatArray:
    """What reflections with normals (..., 3) make of generalised forces and rates, (..., 6, 6):
    moments are axial vectors."""
    turn = np.eye(3) - 2.0 * normals[..., :, None] * normals[..., None, :]
    result = np.zeros((*normals.shape[:-1], DOF, DOF))
    result[..., :3, :3], result[..., 3:, 3:] = turn, -turn
    return result


def are_loads_alike(load: FloatArray, image: FloatArray, size: float, share: float) -> bool:
    """True if loads (free blocks, 6) differ by no more than a share of the largest; ``size`` is
    that of the scene, by which moments are divided."""
    unit = np.repeat([1.0, size], 3)
    return bool((np.abs(load - image) <= share * np.abs(load / unit).max() * unit).all())


def directions(vectors: Iterable[FloatArray]) -> Iterator[FloatArray]:
    """Unit vectors along all of those given that are not zero, each once: v and -v are the same."""
    tried: list[FloatArray] = []
    for vector in vectors:
        unit = vector / (np.linalg.norm(vector) or 1.0)
        unit = np.where(np.abs(unit) < 1e-15, 0.0, unit)
        unit = unit * np.sign(unit[np.argmax(np.abs(unit))])
        if unit.any() and not any(np.abs(unit - other).max() < 1e-9 for other in tried):
            tried.append(unit)
            yield unit


def coefficients(form: LinearForm, contacts: int) -> FloatArray | None:
    """A linear form at every contact as rows (n, 7), the constant last; None with Parameters."""
    result = np.zeros((contacts, len(COMPONENTS) + 1))
    for name, value in form.items():
        if isinstance(value, cp.Expression):
            return None
        result[:, len(COMPONENTS) if name == CONSTANT else COLUMN[name]] += value
    return result


def _images(rows: FloatArray, partner: IntArray, carried: FloatArray) -> FloatArray:
    """Returns the linear forms (n, 7) of the partners, as forms on the contacts' own forces."""
    image = rows[partner]
    image[:, :6] = np.einsum("ni,nik->nk", image[:, :6], carried)
    return image


def _same(one: FloatArray, other: FloatArray) -> bool:
    size = max(np.abs(one).max(initial=0.0), np.abs(other).max(initial=0.0))
    return bool(np.abs(one - other).max(initial=0.0) <= BALANCED * size)


def _same_size(rows: FloatArray, images: FloatArray, cone: Cone) -> bool:
    if rows.shape[1] == 1:
        size = np.abs(rows).max(initial=0.0)
        apart = np.minimum(np.abs(rows - images).max(axis=2), np.abs(rows + images).max(axis=2))
        return bool(apart.max(initial=0.0) <= BALANCED * size)
    if isinstance(cone, Conic):
        one, other = (np.einsum("nki,nkj->nij", r, r) for r in (rows, images))
        return _same(one, other)
    if not isinstance(cone, Facets) or rows.shape[1] != 2:
        return False
    turned = images @ np.linalg.pinv(rows)
    if not _same(turned @ rows, images):
        return False
    found = np.unique(np.round(turned, 9), axis=0)
    return all(_is_symmetry(cone, turn) for turn in found)


def _is_symmetry(cone: Facets, turn: FloatArray) -> bool:
    normals = cone.normals
    apart = np.abs((normals @ turn)[:, None] - normals[None]).max(axis=2).min(axis=1)
    return bool(apart.max() <= 1e-8)
