"""Eq. 30 written down once more, and searches that try to refute certified brackets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.baselines import M1, M2, MT, V1, V2, N
from benchmarks.stability.truths import Line, rocking
from cvxlimit.errors import CvxlimitError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.methods.solving import solve
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.proof.references import References
from cvxlimit.proof.strength import Strength
from cvxlimit.scene import Scene
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES

FloatArray = NDArray[np.float64]

GRID = 4_000
"""Load factors tried along a line of determinate forces, as many again close to the limit without
interaction: Eq. 30 is not convex, and what it allows may have an island of 1e-6 there. Where the
largest good one lies between two of them it is found by bisection."""

WEIGHTS = (0.0, 0.5, 0.8)
"""Old-value weights of the fixed points whose last forces are tried as states."""


def arms(l1: FloatArray, l2: FloatArray) -> FloatArray:
    """c_T of rectangles by half sides, as in textbooks; zero sides are lines and points."""
    a, b = np.maximum(l1, 1e-12) / 2.0, np.maximum(l2, 1e-12) / 2.0
    logs = a * a / b * np.arcsinh(b / a) + b * b / a * np.arcsinh(a / b)
    return np.asarray(np.hypot(a, b) / 3.0 + logs / 6.0)


def excess(forces: FloatArray, contacts: Contacts, moments: str) -> FloatArray:
    """Eq. 30 on rectangles, as a force: the moment's excess over c_T of the whole contact.

    ``forces`` is (..., contacts, 6); tension and centres outside count with Eq. 9 (the caller's).
    """
    f = [forces[..., k] for k in range(6)]
    n = np.maximum(f[N], 1e-300)
    e1, e2 = -f[M2] / n, f[M1] / n
    l1, l2 = contacts.sides.T
    c = arms(np.maximum(l1 - 2 * np.abs(e1), 0.0), np.maximum(l2 - 2 * np.abs(e2), 0.0))
    if moments == "signed":
        torque = np.abs(f[MT] - e1 * f[V2] + e2 * f[V1])
    else:
        torque = np.abs(f[V1] * e2) + np.abs(f[V2] * e1) + np.abs(f[MT])
    shear = np.hypot(f[V1], f[V2])
    rest = contacts.friction * f[N] - shear
    return np.asarray(
        np.maximum((torque - c * rest) / arms(l1, l2), shear - contacts.friction * f[N])
    )


def worst(forces: FloatArray, contacts: Contacts, moments: str) -> float:
    """Largest excess of Eq. 9 and 30 over all contacts, over the largest compression."""
    outside = [float((rocking(contacts, j) @ x).max()) / np.sqrt(contacts.area[j])
               for j, x in enumerate(forces)]  # fmt: skip
    most = max(float(excess(forces, contacts, moments).max()), *outside)
    return most / max(float(np.abs(forces[:, N]).max()), 1e-300)


def closed_form(scene: Scene, moments: str) -> float | None:
    """The largest load factor of a determinate scene of rectangles, along its line of forces."""
    line = Line.of(scene)
    if line is None or not line.contacts.is_rectangle.all():
        return None
    low, high = line.interval(0.0 if moments == "signed" else 1.0)
    if not (low < 0.0 < high < np.inf):
        return None

    def good(alpha: FloatArray) -> FloatArray:
        forces = line.x + alpha[:, None, None] * line.y
        size = np.abs(forces[..., N]).max(axis=-1)
        return np.asarray(excess(forces, line.contacts, moments).max(axis=-1) <= 1e-12 * size)

    even = np.linspace(0.0, high, GRID)[:-1]
    grid = np.unique(np.concatenate([even, high * (1.0 - np.geomspace(1e-12, 1e-3, GRID))]))
    inside = np.flatnonzero(good(grid))
    if not len(inside):
        return None
    k = int(inside[-1])
    return (
        float(grid[k])
        if k == len(grid) - 1
        else _bisected(good, float(grid[k]), float(grid[k + 1]))
    )


def _bisected(good: Callable[[FloatArray], FloatArray], low: float, high: float) -> float:
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if good(np.array([middle]))[0] else (low, middle)
    return low


SPARE = 1e-13
"""What states must keep of Eq. 9 and 30, over the largest compression: a hundred times the rounding
of forces that are summed up in doubles. States that hold them to 1e-9 "within rounding" do not
count: one carried 2.4e-10 more than a proved upper bound, and it is those 1e-9 that pay for it
(``tests/benchmarks/test_states_that_refute.py`` shows it in exact arithmetic)."""

NEARLY = 1e-9
"""What solvers leave of Eq. 9 and 30: a state this close is worth being repaired."""


@dataclass(frozen=True, eq=False)
class State:
    """Forces (contacts, 6) in equilibrium at a load factor."""

    load_factor: float
    forces: FloatArray

    def mixed(self, share: float, rest: FloatArray, assemblage: Assemblage) -> State:
        """A share of it with forces that carry the dead load alone, put into equilibrium."""
        alpha = share * self.load_factor
        forces = share * self.forces + (1.0 - share) * rest
        return State(alpha, assemblage.balance.balanced(forces, alpha, assemblage.statics))

    def excess(self, assemblage: Assemblage, moments: str) -> float:
        """Largest violation of equilibrium, Eq. 9 and 30, over the largest compression."""
        contacts = assemblage.contacts
        rest = np.abs(assemblage.statics.residual(self.forces, self.load_factor)).max()
        size = max(float(np.abs(self.forces[:, N]).max()), 1e-300)
        return worst(self.forces, contacts, moments) if rest <= SPARE * size else np.inf


def found_states(scene: Scene, moments: str) -> Iterator[State]:
    """States found without the certified method, which Eq. 9 and 30 above allow with some to spare.

    Last forces of fixed points, mixed with forces that carry the dead load alone: the largest
    share of the first that is allowed nearly, and then what it takes to be allowed.
    """
    if not scene.contacts.is_rectangle.all():
        return
    assemblage = Assemblage.of(scene)
    rest = References(assemblage, Strength(assemblage, DEFAULT_SURFACES)).dead_state
    if rest is None:
        return
    for weight in WEIGHTS:
        try:
            found = solve(scene, method=FixedPoint(weight, max_iterations=12), moments=moments)
        except CvxlimitError:
            continue
        factor = found.history[-1].load_factor  # of the last forces, converged or not
        if found.forces is None or factor is None:
            continue
        state = State(factor, found.forces)
        for share in np.linspace(1.0, 0.05, 40):
            nearly = state.mixed(float(share), rest, assemblage)
            if nearly.excess(assemblage, moments) <= NEARLY:
                if (held := repaired(nearly, rest, assemblage, moments)) is not None:
                    yield held
                break


def repaired(state: State, rest: FloatArray, assemblage: Assemblage, moments: str) -> State | None:
    """The state with as much of the dead load's own forces as makes it hold with some to spare."""
    for taken in (0.0, *np.geomspace(1e-12, 0.1, 45)):
        better = state.mixed(1.0 - float(taken), rest, assemblage)
        if better.excess(assemblage, moments) <= -SPARE:
            return better
    return None
