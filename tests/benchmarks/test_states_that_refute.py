"""The one state that seemed to refute a proved bound, looked at in exact arithmetic.

On an arch within 0.1 % of the least thickness, last forces of the fixed point, as Clarabel finds
them at 1e-9, carried 2.4e-10 more than a proved upper bound of 5.154e-4. They hold Eq. 9 to 3e-10
of the largest compression, as solvers' answers do, and that is what pays for it. All is
rational: an arch is a chain, so equilibrium, solved block by block in fractions, is exact.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pytest
from benchmarks.baselines import N
from benchmarks.stability import interacting
from benchmarks.stability.families import sample
from benchmarks.stability.truths import rocking
from numpy.typing import NDArray

from cvxlimit import FixedPoint, Solution, solve
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.proof.references import References
from cvxlimit.proof.strength import Strength
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES

Exact = list[Fraction]


@dataclass(frozen=True, eq=False)
class Arch:
    """The scene, the state that exceeds the bound, and the forces it is repaired with."""

    assemblage: Assemblage
    bounded: Solution
    state: interacting.State
    rest: NDArray[np.float64]


@pytest.fixture(scope="module")
def arch() -> Arch:
    scene = sample("thin-arches", 3).scene
    assemblage = Assemblage.of(scene)
    rest = References(assemblage, Strength(assemblage, DEFAULT_SURFACES)).dead_state
    assert rest is not None
    method = FixedPoint(0.8, max_iterations=12, moments="signed")
    found = solve(scene, method=method, ladder=[settings_for("CLARABEL", 1e-9)])
    assert found.load_factor is not None
    assert found.forces is not None
    state = interacting.State(found.load_factor, found.forces).mixed(1.0, rest, assemblage)
    bounded = solve(scene, model="least")  # planar, where any solver is near
    return Arch(assemblage, bounded, state, rest)


def exactly(state: interacting.State, assemblage: Assemblage) -> list[Exact]:
    """The state in exact equilibrium: the first contact's forces as they are, the others' follow.

    Coefficients and loads are the doubles of the scene's mechanics, taken for exact.
    """
    statics, alpha = assemblage.statics, Fraction(state.load_factor)
    assert list(statics.contacts.b[:-1]) == list(statics.contacts.a[1:])
    matrix = statics.matrix.toarray()
    forces = [[Fraction(float(x)) for x in state.forces[0]]]
    for block in range(len(statics.dead) // 6):
        rows = range(6 * block, 6 * block + 6)
        before, after = ([[Fraction(float(matrix[r, 6 * j + c])) for c in range(6)] for r in rows]
                         for j in (block, block + 1))  # fmt: skip
        right = [
            -Fraction(float(statics.dead[r])) - alpha * Fraction(float(statics.live[r]))
            - sum((a * x for a, x in zip(row, forces[-1], strict=True)), Fraction(0))
            for r, row in zip(rows, before, strict=True)
        ]  # fmt: skip
        forces.append(solved(after, right))
    return forces


def solved(matrix: list[Exact], right: Exact) -> Exact:
    """Gauss and Jordan's elimination in fractions."""
    rows = [[*row, b] for row, b in zip(matrix, right, strict=True)]
    for k in range(len(rows)):
        pivot = next(i for i in range(k, len(rows)) if rows[i][k])
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(len(rows)):
            if i != k and rows[i][k]:
                rows[i] = [x - rows[i][k] * y for x, y in zip(rows[i], rows[k], strict=True)]
    return [row[-1] for row in rows]


def outside(forces: list[Exact], contacts: Contacts) -> Iterator[Fraction]:
    """Eq. 9 at every edge of every contact: N times the centre's distance outside."""
    for j, x in enumerate(forces):
        for row in rocking(contacts, j):
            yield sum((Fraction(float(a)) * y for a, y in zip(row, x, strict=True)), Fraction(0))


def test_it_exceeds_the_bound_and_is_not_admissible(arch: Arch) -> None:
    """Exactly in equilibrium it is outside at some edge: it was never a state of Eq. 9."""
    assert arch.bounded.is_proved
    assert arch.state.load_factor > arch.bounded.upper * (1 + 1e-8)
    contacts = arch.assemblage.contacts
    beyond = max(outside(exactly(arch.state, arch.assemblage), contacts))
    size = float(np.abs(arch.state.forces[:, N]).max()) * float(np.sqrt(contacts.area.max()))
    assert 0 < beyond <= Fraction(interacting.NEARLY * size)


def test_what_it_exceeds_the_bound_by_is_the_power_of_that_violation(arch: Arch) -> None:
    """By virtual power the excess over the bound is what contact forces gain on the mechanism, and
    none that is inside gains anything."""
    statics, rates = arch.assemblage.statics, np.array(list(arch.bounded.mechanism.values()))
    forces = exactly(arch.state, arch.assemblage)
    slip = statics.relative_rates(rates)
    live = sum((Fraction(float(f)) * Fraction(float(u)) for f, u
                in zip(statics.live, rates.ravel(), strict=True)), Fraction(0))  # fmt: skip
    gains = [
        -sum((x * Fraction(float(r)) for x, r in zip(row, rate, strict=True)), Fraction(0))
        for row, rate in zip(forces, slip, strict=True)
    ]
    excess = Fraction(arch.state.load_factor) - Fraction(arch.bounded.upper)
    rows = [list(outside([x], arch.assemblage.contacts.take(np.array([j]))))
            for j, x in enumerate(forces)]  # fmt: skip
    from_outside = sum(g for g, row in zip(gains, rows, strict=True) if g > 0 and max(row) > 0)
    from_inside = sum(g for g, row in zip(gains, rows, strict=True) if g > 0 and max(row) <= 0)
    assert from_outside / live >= Fraction(99, 100) * excess
    assert from_inside / live <= Fraction(1, 100) * excess


def test_repaired_it_is_admissible_and_below_the_bound(arch: Arch) -> None:
    """With a millionth of the dead load's own forces mixed in it holds Eq. 9 exactly, and then it
    carries less than the bound: no margin is needed."""
    held = interacting.repaired(arch.state, arch.rest, arch.assemblage, "signed")
    assert held is not None
    forces = exactly(held, arch.assemblage)
    assert max(outside(forces, arch.assemblage.contacts)) < 0
    close = np.array([[float(x) for x in row] for row in forces])
    assert interacting.excess(close, arch.assemblage.contacts, "signed").max() < 0.0
    assert 0.999 * arch.bounded.lower < held.load_factor < arch.bounded.upper
