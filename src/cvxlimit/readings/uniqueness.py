"""Whether a mechanism, and the forces that go with it, are the only ones.

Another mechanism of the same load factor has rates that the forces at hand allow: nothing opens
where a corner is pressed, and slip goes along the normals of conditions that are met. Other forces
press no corner that opens, and stay on conditions that slip needs, on straight parts of these. Both
are linear: a mechanism is the only one if these equations have no second solution, and so are the
forces if no change in equilibrium is left.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.model.flow import StrengthRows
from cvxlimit.model.statics import DOF
from cvxlimit.solution.bracket import TOLERANCE
from cvxlimit.surfaces.cones import Cone

_ASIDE = 1e-4
"""By which share of its size a vector is turned to see whether a condition is straight there."""

_BENT = 1e-2
"""Change of a normal by which it has passed an edge: along a curve it is :data:`_ASIDE`."""

_DENSE = 1500
"""Rows up to which all singular values are computed; a second of work."""


def others(
    equilibrium: sp.csr_array, strength: StrengthRows, internal: FloatArray, rates: FloatArray,
    multipliers: FloatArray,
) -> tuple[bool, FloatArray]:  # fmt: skip
    """Whether there are other mechanisms of the same load factor, and a change (p,) of internal
    forces, at random, by which they would be others that go with it: its largest is a force of 1,
    or it is rounding where there are none.

    ``equilibrium`` (6 free blocks, 6 n) takes contact forces, ``internal`` (p,) are forces of the
    model of ``strength``, ``rates`` (n, 6) those of contacts, ``multipliers`` its conditions'.
    """
    model = strength.model
    length = model.contacts.typical_size
    unit = np.where(model.is_moment, length, 1.0)
    rows = np.tile(np.repeat([1.0, 1.0 / length], 3), equilibrium.shape[0] // DOF)
    gives = (model.resultant_map @ sp.diags_array(unit)).tocsr()
    matrix = (sp.diags_array(rows) @ equilibrium @ gives).tocsr()
    across = _across(strength, internal / unit, gives.T @ rates.ravel(), multipliers, unit)
    # rates, but for those along normals, vanish in the mechanism, and in no other if it is alone
    resisted = matrix @ across[0]
    square = resisted @ resisted.T
    if square.shape[0] <= _DENSE:
        low = np.linalg.eigvalsh(square.toarray())[[0, min(1, square.shape[0] - 1), -1]]
    else:
        largest = float(sp.linalg.norm(square, 1))
        low = np.append(sp.linalg.eigsh(square, 2, sigma=-(TOLERANCE**3) * largest)[0], largest)
    many = len(rows) > 1 and bool(low[1] <= TOLERANCE**2 * low[2])
    # any change of forces, as far as it stays on the faces and in equilibrium
    within = matrix @ across[1]
    trial = across[1] @ np.random.default_rng(0).standard_normal(len(unit))
    square = within @ within.T
    least = TOLERANCE**2 * float(square.diagonal().max())
    solve = splu((square + least * sp.eye_array(square.shape[0])).tocsc()).solve
    for _ in range(3):
        trial = trial - within.T @ solve(within @ trial)
    return many, unit * trial


def _across(
    strength: StrengthRows, internal: FloatArray, rates: FloatArray, multipliers: FloatArray,
    unit: FloatArray,
) -> tuple[sp.csr_array, sp.csr_array]:  # fmt: skip
    """Projections of internal forces, moments as forces, across the normals along which rates may
    differ, and across the directions in which forces may not."""
    model, size, speed = strength.model, np.abs(internal).max(), np.abs(rates).max()
    order = np.argsort(model.contact, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(model.contact))[:-1])
    place = np.concatenate([np.arange(len(own)) for own in members])[np.argsort(order)]

    def row(matrix: sp.csr_array, i: int, j: int) -> FloatArray:
        some = slice(matrix.indptr[i], matrix.indptr[i + 1])
        at, result = matrix.indices[some], np.zeros(len(members[j]))
        result[place[at]] = matrix.data[some] * unit[at]
        return result

    normals: list[list[FloatArray]] = [[] for _ in members]
    held: list[list[FloatArray]] = [[] for _ in members]
    opening = rates - (strength.resistance.transposed @ multipliers) * unit
    idle, opens = internal <= TOLERANCE * size, opening > TOLERANCE * speed
    for vectors, which in ((normals, idle), (held, opens)):
        for i in np.flatnonzero(model.nonneg & which).tolist():
            j = model.contact[i]
            vectors[j].append(np.eye(len(members[j]))[place[i]])
    values = strength.norms.matrix @ (internal * unit) + strength.norms.constant
    for (cone, where, groups), (excess, contact) in zip(
        strength.conditions, strength.excess(internal * unit), strict=True
    ):
        moves = multipliers[where] > TOLERANCE * speed
        for k in np.flatnonzero(moves | (excess >= -TOLERANCE * size)).tolist():
            j = contact[k]
            found: list[FloatArray] = [-row(strength.resistance.matrix, where.start + k, j)]
            for group in groups:
                rows = [part.start + k for part in group]
                own = np.array([row(strength.norms.matrix, i, j) for i in rows])
                ways, bends = _gradients(cone, values[rows], TOLERANCE * size)
                found = [part + way @ own for part in found for way in ways]
                held[j] += [way @ own for way in bends if moves[k]]
            normals[j] += found
            if moves[k]:
                held[j].append(np.mean(found, axis=0))
    return _projection(members, normals), _projection(members, held)


def _projection(members: list[IntArray], across: list[list[FloatArray]]) -> sp.csr_array:
    """On what is across some vectors of every contact."""
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
    """Gradients of a cone's gauge at a vector (m,), on both sides of an edge, and the directions in
    which it is not straight; a vector of the least size is none, where all directions are edges."""
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
