"""An adversary of brackets with interaction: every lower bound is checked again, every upper bound
held against a search for better states.

Nothing here is of the package's ways to brackets. Equilibrium is written by hand, one contact at a
time (``hand_equilibrium``), Eq. 30 is its checker's. The search is a local ascent on the true,
nonconvex set: Eq. 30 is linearised by finite differences about a state, the convex problem within a
trust region is solved, and with the pressure centres it ends at frozen a further convex problem has
admissible states, if any; steps that do not gain halve the region. It starts at random pressure
centres, at those of the hull of all states, and at the best known.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import cvxpy as cp
import numpy as np
import pytest
from benchmarks.experiments.closing import FAMILIES
from numpy.typing import NDArray

from cvxlimit import Scene, solve
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.extensions.interaction.relaxation.upper import UpperBound
from cvxlimit.methods.driver import Run
from cvxlimit.readings.named import parse_moments
from cvxlimit.readings.pressure import Pressure, effective_arm
from cvxlimit.solvers import default_ladder
from helpers import hand_equilibrium, interaction_excess

FloatArray = NDArray[np.float64]

pytestmark = pytest.mark.exhaustive

CASES = [
    *(("walls", seed) for seed in (2, 4, 9, 11, 14, 17, 23, 24, 34, 35)),
    *(("prisms", seed) for seed in (0, 4, 15)),
    *(("drums", seed) for seed in (1, 2, 5)),
]
"""Walls of 14 to 30 contacts for the most part, among them two that stay open longest."""

SECONDS = 10.0
STARTS, STEPS = 3, 12
"""Random starts, and steps from each start."""

TRUSTED = 1e-7
"""Excess and residual over the total load up to which a state found counts; what that is worth is
far below the margin of the comparison."""


TIGHT = {"tol_feas": 1e-11, "tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10}
"""Of Clarabel: where a pressure centre is 1e-7 from an edge, a state solved to 1e-8 may exceed
Eq. 30 by more than what is trusted."""


class Adversary:
    """Searches one scene for states with a larger load factor."""

    def __init__(self, scene: Scene, moments: str) -> None:
        self.scene, self.moments, self.contacts = scene, moments, scene.contacts
        self.matrix, self.dead, self.live = hand_equilibrium(scene)
        self.load = float(np.abs(self.dead).sum())
        self.edges = [outward_of(self.contacts.corners_of(j)) for j in range(len(self.contacts))]
        self.linear, self.frozen = self._linear(), self._frozen()

    def _common(self) -> tuple[cp.Variable, cp.Variable, list[cp.Constraint]]:
        """Forces over the total load, load factor, equilibrium and friction."""
        forces, factor = cp.Variable((len(self.contacts), 6)), cp.Variable()
        applied = self.dead / self.load + factor * self.live / self.load
        limits = [
            self.matrix @ cp.vec(forces, order="C") + applied == 0.0,
            cp.norm(forces[:, :2], 2, axis=1) <= cp.multiply(self.contacts.friction, forces[:, 2]),
        ]
        return forces, factor, limits

    def _linear(self) -> cp.Problem:
        """Eq. 30 linearised about a state, within a region; pressure inside the contacts."""
        n = len(self.contacts)
        forces, factor, limits = self._common()
        self.at, self.slope = cp.Parameter((n, 6)), cp.Parameter((n, 6))
        self.value, self.region = cp.Parameter(n), cp.Parameter(nonneg=True)
        change = forces - self.at
        limits.append(self.value + cp.sum(cp.multiply(self.slope, forces), axis=1) <= 0.0)
        sizes = np.ones((n, 6))
        sizes[:, 3:] = np.sqrt(self.contacts.area)[:, None]
        limits.append(cp.abs(change) <= self.region * sizes)
        for j, outward in enumerate(self.edges):
            pressed = cp.hstack([-forces[j, 4], forces[j, 3]])
            limits.append(outward @ pressed <= forces[j, 2])
        self.linear_forces = forces
        return cp.Problem(cp.Maximize(factor), limits)

    def _frozen(self) -> cp.Problem:
        """Eq. 30 with M = N e."""
        n = len(self.contacts)
        forces, self.factor, limits = self._common()
        self.e = cp.Parameter((n, 2))
        self.eps, self.arm = cp.Parameter((n, 2), nonneg=True), cp.Parameter(n, nonneg=True)
        v1, v2, normal, twist = (forces[:, k] for k in (0, 1, 2, 5))
        if self.moments == "signed":
            torque = cp.abs(twist - cp.multiply(self.e[:, 0], v2) + cp.multiply(self.e[:, 1], v1))
        else:
            torque = cp.multiply(self.eps[:, 1], cp.abs(v1))
            torque = torque + cp.multiply(self.eps[:, 0], cp.abs(v2)) + cp.abs(twist)
        spare = cp.Variable(n, nonneg=True)
        limits += [
            cp.norm(forces[:, :2], 2, axis=1) + spare
            <= cp.multiply(self.contacts.friction, normal),
            torque <= cp.multiply(self.arm, spare),
            forces[:, 3] == cp.multiply(self.e[:, 1], normal),
            forces[:, 4] == -cp.multiply(self.e[:, 0], normal),
        ]
        self.frozen_forces = forces
        return cp.Problem(cp.Maximize(self.factor), limits)

    def best_from(self, forces: FloatArray) -> float:
        """The largest load factor of true states found from a state (n, 6), or -inf."""
        best, region = -np.inf, 0.1
        here = forces / self.load
        admissible = self.at_centres(here)
        if admissible is not None:
            best, here = admissible
        for _ in range(STEPS):
            self.value.value, self.slope.value = self._linearised(here)
            self.at.value, self.region.value = here, region
            if not _is_solved(self.linear) or self.linear_forces.value is None:
                region *= 3.0 if best == -np.inf else 0.5
                continue
            aimed = np.array(self.linear_forces.value)
            found = self.at_centres(aimed)
            if found is not None and found[0] > best + 1e-9:
                best, here = found
            elif best == -np.inf:
                here = aimed  # not admissible yet: on towards where the linearised states are
            else:
                region *= 0.4
        return best

    def at_centres(self, forces: FloatArray) -> tuple[float, FloatArray] | None:
        """True states with the pressure centres of forces (n, 6), checked.

        Else solved tighter, else with contacts that carry next to nothing pressed in their middle.
        """
        ways: list[tuple[float, dict[str, float]]] = [(0.0, {}), (0.0, TIGHT), (1e-5, TIGHT)]
        found = (self._at_centres(forces, epsilon, settings) for epsilon, settings in ways)
        return next(filter(None, found), None)

    def _at_centres(
        self, forces: FloatArray, epsilon: float, settings: dict[str, float]
    ) -> tuple[float, FloatArray] | None:
        at = Pressure.of(forces, self.contacts, epsilon)
        outer = np.maximum(self._reach(at.e1, at.e2), 1.0)  # Eq. 9: none beyond the contact
        e1, e2 = at.e1 / outer, at.e2 / outer
        self.e.value = np.stack([e1, e2], axis=1)
        self.eps.value = np.abs(self.e.value)
        self.arm.value = effective_arm(e1, e2, self.contacts)
        if not _is_solved(self.frozen, settings) or self.factor.value is None:
            return None
        factor, state = float(self.factor.value), np.array(self.frozen_forces.value)
        return (factor, state) if self.is_true(state * self.load, factor) else None

    def is_true(self, forces: FloatArray, factor: float, within: float = TRUSTED) -> bool:
        """Equilibrium and Eq. 9 by hand, Eq. 30 by the checker."""
        rest = self.matrix @ forces.ravel() + self.dead + factor * self.live
        excess = interaction_excess(forces, self.contacts, self.moments)
        normal = forces[:, 2]
        beyond = np.maximum(self._reach(-forces[:, 4], forces[:, 3]) - normal, -normal)
        worst = max(np.abs(rest).max(), excess.max(), beyond.max())
        return bool(worst <= within * self.load)

    def _reach(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """How far out points (n,) are in their contacts: 1 at the edge."""
        points = zip(self.edges, x, y, strict=True)
        return np.array([(outward @ [a, b]).max() for outward, a, b in points])

    def _linearised(self, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Excess of Eq. 30 as constant (n,) and slope (n, 6), by differences."""
        step = 1e-6
        value = interaction_excess(forces, self.contacts, self.moments)
        slope = np.zeros_like(forces)
        for column in range(6):
            moved = forces.copy()
            moved[:, column] += step
            slope[:, column] = (
                interaction_excess(moved, self.contacts, self.moments) - value
            ) / step
        slope = np.clip(slope, -1e3, 1e3)
        return value - (slope * forces).sum(axis=1), slope

    def starts(self, best: FloatArray) -> Iterator[FloatArray]:
        """The best forces known, those of the hull, and random ones."""
        yield best
        run = Run(self.scene, moments=parse_moments(self.moments))
        outer = UpperBound(run)
        outer.search(1e-4, default_ladder())
        if outer.state is not None and outer.state.forces is not None:
            yield outer.state.forces
        rng = np.random.default_rng(1)
        for _ in range(STARTS):
            forces = np.zeros_like(best)
            forces[:, 2] = self.load / len(best)
            for j in range(len(best)):
                corners = self.contacts.corners_of(j)
                e = rng.dirichlet(np.ones(len(corners))) @ corners
                forces[j, 3], forces[j, 4] = forces[j, 2] * e[1], -forces[j, 2] * e[0]
            yield forces


def outward_of(corners: FloatArray) -> FloatArray:
    """Normals (k, 2) of the edges of a convex polygon about the origin, over their distance."""
    along = np.roll(corners, -1, axis=0) - corners
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.asarray(normal / (normal * corners).sum(axis=1, keepdims=True))


def _is_solved(problem: cp.Problem, settings: dict[str, float] | None = None) -> bool:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Solution may be inaccurate")
        try:
            problem.solve(solver=cp.CLARABEL, **settings or {})
        except cp.SolverError:
            return False
    return problem.status in ("optimal", "optimal_inaccurate")


@pytest.mark.parametrize("moments", ["independent", "signed"])
@pytest.mark.parametrize(("family", "seed"), CASES)
def test_bounds_survive(family: str, seed: int, moments: str) -> None:
    scene = FAMILIES[family](seed)
    rule = Certified(tolerance=0.0099, branching_seconds=SECONDS)
    solution = solve(scene, method=rule, moments=moments)
    assert solution.forces is not None
    adversary = Adversary(scene, moments)
    assert adversary.is_true(solution.forces, solution.load_factor)
    assert solution.lower <= solution.load_factor * (1.0 + 1e-12)
    found = [adversary.best_from(start) for start in adversary.starts(solution.forces)]
    assert found[0] >= solution.lower * (1.0 - 1e-2)  # the adversary can find good states
    assert max(found) <= solution.upper * (1.0 + 1e-6)


@pytest.mark.parametrize(("seed", "moments"), [(90017, "signed"), (90004, "independent")])
def test_prisms_close_from_below(seed: int, moments: str) -> None:
    """Safe forces alone end 3 % below the load factor of these: what closes them is the way from
    there to a node's own forces."""
    found = solve(FAMILIES["prisms"](seed), method="certified", moments=moments)
    assert found.bracket.is_within(1.01e-4)
