"""Whether a mechanism, and the forces that go with it, are the only ones.

Any other mechanism of the same load factor complies with the same forces: nothing opens at a corner
that is pressed, and slip is a combination of the normals of conditions that are met. Any other
forces comply with the same mechanism: they press no corner that opens, and stay on the conditions
that slip, within flat parts of these. Both requirements are linear equations. The mechanism is the
only one if they have one solution up to a factor, and the forces are if no change of forces in
equilibrium complies.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.model.statics import DOF
from cvxlimit.proof.conditions import ConditionRows
from cvxlimit.solution.bracket import TOLERANCE
from cvxlimit.surfaces.cones import Cone

_ASIDE = 1e-4
"""Share of its size by which a vector is moved sideways to see whether a condition is flat
there."""

_BENT = float(np.sqrt(_ASIDE))
"""Change of a unit normal that means an edge, between :data:`_ASIDE`, as along a curved surface,
and 1."""

_DENSE = 1500
"""Number of rows up to which all eigenvalues are computed, in a second at most."""


def others(
    equilibrium: sp.csr_array, strength: ConditionRows, internal: FloatArray, rates: FloatArray,
    multipliers: FloatArray,
) -> tuple[bool, FloatArray]:  # fmt: skip
    """Returns whether there are other mechanisms of the same load factor, and a change (p,) of
    internal forces that complies with the mechanism and equilibrium.

    The change is random, with entries of about 1, or rounding where the forces are unique.
    ``equilibrium`` (6 free blocks, 6 n) multiplies contact forces, ``internal`` (p,) are forces of
    the model of ``strength``, ``rates`` (n, 6) are relative rates in the order V1 V2 N M1 M2 MT,
    and ``multipliers`` are those of the conditions.
    """
    # Moments are divided by a length, so that all rows and columns have units of force.
    model = strength.model
    length = model.contacts.typical_size
    unit = np.where(model.is_moment, length, 1.0)
    rows = np.tile(np.repeat([1.0, 1.0 / length], 3), equilibrium.shape[0] // DOF)
    resultants = (model.resultant_map @ sp.diags_array(unit)).tocsr()
    matrix = (sp.diags_array(rows) @ equilibrium @ resultants).tocsr()
    across = _across(strength, internal / unit, resultants.T @ rates.ravel(), multipliers, unit)
    # A mechanism complies where all rates but those along normals vanish: if it is alone, one
    # eigenvalue of this matrix is zero and the second is not.
    resisted = matrix @ across[0]
    square = resisted @ resisted.T
    if square.shape[0] <= _DENSE:
        low = np.linalg.eigvalsh(square.toarray())[[0, min(1, square.shape[0] - 1), -1]]
    else:
        largest = float(sp.linalg.norm(square, 1))
        low = np.append(sp.linalg.eigsh(square, 2, sigma=-(TOLERANCE**3) * largest)[0], largest)
    many = len(rows) > 1 and bool(low[1] <= TOLERANCE**2 * low[2])
    # A random change is projected onto what complies with the mechanism, then onto equilibrium;
    # three rounds of refinement, since the regularised solve is not exact.
    within = matrix @ across[1]
    trial = across[1] @ np.random.default_rng(0).standard_normal(len(unit))
    square = within @ within.T
    least = TOLERANCE**2 * float(square.diagonal().max())
    solve = splu((square + least * sp.eye_array(square.shape[0])).tocsc()).solve
    for _ in range(3):
        trial = trial - within.T @ solve(within @ trial)
    return many, unit * trial


def _across(
    strength: ConditionRows, internal: FloatArray, rates: FloatArray, multipliers: FloatArray,
    unit: FloatArray,
) -> tuple[sp.csr_array, sp.csr_array]:  # fmt: skip
    """Returns two projections (p, p) of internal forces, moments divided by a length.

    The first is perpendicular to the normals along which another mechanism's rates may differ, the
    second to the directions in which other forces may not differ.
    """
    # Internal forces of each contact, and the place of each among those of its contact.
    model, size, speed = strength.model, np.abs(internal).max(), np.abs(rates).max()
    order = np.argsort(model.contact, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(model.contact))[:-1])
    place = np.concatenate([np.arange(len(own)) for own in members])[np.argsort(order)]

    def row(matrix: sp.csr_array, i: int, j: int) -> FloatArray:
        """Returns row i of a matrix, restricted to the internal forces of contact j."""
        some = slice(matrix.indptr[i], matrix.indptr[i + 1])
        at, result = matrix.indices[some], np.zeros(len(members[j]))
        result[place[at]] = matrix.data[some] * unit[at]
        return result

    normals: list[list[FloatArray]] = [[] for _ in members]
    held: list[list[FloatArray]] = [[] for _ in members]
    # Nonnegative forces: one that vanishes may open in another mechanism, one that opens vanishes.
    opening = rates - (strength.resistance.transposed @ multipliers) * unit
    idle, opens = internal <= TOLERANCE * size, opening > TOLERANCE * speed
    for vectors, which in ((normals, idle), (held, opens)):
        for i in np.flatnonzero(model.nonneg & which).tolist():
            j = model.contact[i]
            vectors[j].append(np.eye(len(members[j]))[place[i]])
    # Conditions: the normals of those that are met, and of those that slip the normal itself and
    # the directions in which the surface is curved.
    values = strength.norms.matrix @ (internal * unit) + strength.norms.constant
    excess, contact = strength.excess(internal * unit), strength.resistance.contact
    for cone, where, by_norm in strength.conditions:
        moves = multipliers[where] > TOLERANCE * speed
        for k in np.flatnonzero(moves | (excess[where] >= -TOLERANCE * size)).tolist():
            j = contact[where.start + k]
            gradients: list[FloatArray] = [-row(strength.resistance.matrix, where.start + k, j)]
            for norm in by_norm:
                rows = norm[:, k].tolist()
                own = np.array([row(strength.norms.matrix, i, j) for i in rows])
                ways, bends = _gradients(cone, values[rows], TOLERANCE * size)
                gradients = [part + way @ own for part in gradients for way in ways]
                held[j] += [way @ own for way in bends if moves[k]]
            normals[j] += gradients
            if moves[k]:
                held[j].append(np.mean(gradients, axis=0))
    return _projection(members, normals), _projection(members, held)


def _projection(members: list[IntArray], across: list[list[FloatArray]]) -> sp.csr_array:
    """Returns the projection (p, p) onto what is perpendicular to some vectors of each contact."""
    blocks, index = [], []
    for own, vectors in zip(members, across, strict=True):
        block = np.eye(len(own))
        if vectors:
            _, size, ways = np.linalg.svd(np.array(vectors), full_matrices=False)
            ways = ways[size > TOLERANCE * size[0]]
            block -= ways.T @ ways
        blocks.append(block.ravel())
        index.append([np.repeat(own, len(own)), np.tile(own, len(own))])
    count = sum(map(len, members))
    at = np.concatenate(index, axis=1)
    return sp.csr_array((np.concatenate(blocks), (at[0], at[1])), shape=(count, count))


def _gradients(
    cone: Cone, at: FloatArray, least: float
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Returns the gradients of a cone's gauge at the vector ``at`` (m,), those on both sides where
    it lies on an edge, and the directions in which the gauge is not flat.

    A vector no longer than ``least`` is the tip, where every direction is an edge.
    """
    size, eye = float(np.linalg.norm(at)), np.eye(len(at))
    if size <= least:
        return [*eye, *-eye], list(eye)

    def gradient(where: FloatArray) -> FloatArray:
        step = TOLERANCE * size * eye
        ends = [cone.gauge(list(where[:, None] + way * step)) for way in (1.0, -1.0)]
        return np.asarray((ends[0] - ends[1]) / (2.0 * TOLERANCE * size))

    across = np.linalg.svd(at[None])[2][1:]
    ways, bends = [gradient(at)], []
    for way in across:
        ends = [gradient(at + turn * size * way) for turn in (_ASIDE, -_ASIDE)]
        turned = float(np.linalg.norm(ends[0] - ends[1]))
        if turned > _BENT:
            ways = [*ways[1:], *ends]
        if turned > TOLERANCE:
            bends.append(way)
    return ways, bends
