"""Whether strength and loads are indifferent to a reflection: what symmetry rests on.

If a reflection carries the admissible forces of every contact into those of its partner, then with
any solution its mirror image is one, and so, by convexity, is their mean.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import cvxpy as cp
import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.statics import DOF
from cvxlimit.surfaces.base import CONSTANT, Condition, LinearForm, YieldSurface, stated
from cvxlimit.surfaces.cones import Cone, Conic, Facets
from cvxlimit.surfaces.coulomb import Rocking

_SAME = 1e-11
"""Relative difference of coefficients that is put down to rounding: those of turned scenes differ
by up to 3e-13, a friction coefficient that was changed on purpose by far more."""


def is_invariant(
    surfaces: Sequence[YieldSurface], contacts: Contacts, partner: IntArray, carried: FloatArray
) -> bool:
    """True if admissible forces x of contact j give admissible forces Q_j x of its partner.

    ``carried`` (n, 6, 6) are Q_j. Rocking is left out: it is a matter of the contacts' corners.
    False also for conditions with rows of their own, coefficients in Parameters, cones that are not
    known.
    """
    return all(
        _carries(condition, surface.cone, contacts, partner, carried)
        for surface in surfaces
        if type(surface) is not Rocking
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
    image = rows[partner]
    image[:, :6] = np.einsum("ni,nik->nk", image[:, :6], carried)
    return image


def _same(one: FloatArray, other: FloatArray) -> bool:
    size = max(np.abs(one).max(initial=0.0), np.abs(other).max(initial=0.0))
    return bool(np.abs(one - other).max(initial=0.0) <= _SAME * size)


def _same_size(rows: FloatArray, images: FloatArray, cone: Cone) -> bool:
    if rows.shape[1] == 1:
        size = np.abs(rows).max(initial=0.0)
        apart = np.minimum(np.abs(rows - images).max(axis=2), np.abs(rows + images).max(axis=2))
        return bool(apart.max(initial=0.0) <= _SAME * size)
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
