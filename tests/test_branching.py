"""Branch and bound closes small scenes; its bounds are checked without it."""

from __future__ import annotations

import cvxpy as cp
import numpy as np
import pytest
from helpers import hand_equilibrium
from scipy.optimize import minimize
from test_hull import DETERMINATE, MOMENTS, TOP_TWIST, exact, hexagons

from cvxlimit import Block, Load, Scene, builtin_scene
from cvxlimit.interaction.branching import Bracket, branch_and_bound
from cvxlimit.interaction.hull import global_upper_bound
from cvxlimit.interaction.pressure import interaction_excess
from cvxlimit.masonry import single_block, stack
from cvxlimit.polygons import torsion_arm

TOLERANCE = 1e-4


def assert_bracket(bracket: Bracket, scene: Scene, moments: str) -> None:
    """Closed, proved, and the forces hold what they promise: equilibrium and Eq. 30 to 1e-9."""
    assert bracket.is_closed
    assert bracket.is_proved
    assert bracket.lower <= bracket.upper <= bracket.lower * (1.0 + 1.01 * TOLERANCE)
    assert bracket.forces is not None
    matrix, dead, live = hand_equilibrium(scene)
    load = np.abs(dead).sum()
    residual = matrix @ bracket.forces.ravel() + dead + bracket.lower * live
    assert np.abs(residual).max() <= 2e-9 * load
    assert interaction_excess(bracket.forces, scene.contacts, moments).max() <= 2e-9 * load
    lowers = [h.lower for h in bracket.history if h.lower is not None]
    uppers = [h.upper for h in bracket.history if h.upper is not None]
    assert lowers == sorted(lowers)
    assert uppers == sorted(uppers, reverse=True)


@pytest.mark.parametrize("moments", MOMENTS)
@pytest.mark.parametrize("name", ["one block", "one slender block", "two blocks"])
def test_the_known_load_factor_is_bracketed(name: str, moments: str) -> None:
    scene = DETERMINATE[name]
    bracket = branch_and_bound(scene, moments, TOLERANCE)
    assert_bracket(bracket, scene, moments)
    assert bracket.lower - 1e-8 <= exact(name, moments) <= bracket.upper + 1e-8


@pytest.mark.parametrize("moments", MOMENTS)
def test_three_blocks(moments: str) -> None:
    live = Load(acceleration=(0.5, 1.0, 0.0), forces={"b3": (0.0, 0.0, 0.0, 0.0, 0.0, 4.0)})
    scene = stack(3, (1.0, 0.6, 0.5), shift=(0.05, 0.1), friction=0.6, live=live)
    bracket = branch_and_bound(scene, moments, TOLERANCE)
    assert_bracket(bracket, scene, moments)
    assert bracket.upper <= global_upper_bound(scene, moments).upper + 1e-9


def bridge() -> Scene:
    """A beam on two piers, pushed sideways and twisted: two contacts, statically indeterminate."""
    piers = (
        Block.box("left", (0.0, 0.0, -1.0), (0.3, 0.4, 0.0)),
        Block.box("right", (1.4, 0.1, -1.0), (2.0, 0.4, 0.0)),
    )
    beam = Block.box("beam", (0.0, 0.0, 0.0), (2.0, 0.4, 0.3), density=20.0)
    live = Load(acceleration=(0.2, 1.0, 0.0), forces={"beam": (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)})
    return Scene((*piers, beam), ("left", "right"), live, friction=0.6)


class Frozen:
    """Pressure centres in, load factor out: Eq. 30 with M = N e, one small convex problem."""

    def __init__(self, scene: Scene, moments: str) -> None:
        self.half = scene.contacts.sides / 2.0
        n = len(self.half)
        matrix, dead, live = hand_equilibrium(scene)
        force, self.alpha = cp.Variable((n, 6)), cp.Variable()
        self.e1, self.e2, self.arm = (cp.Parameter(n) for _ in range(3))
        v1, v2, normal, mt = (force[:, k] for k in (0, 1, 2, 5))
        size = cp.norm(force[:, :2], 2, axis=1)
        if moments == "signed":
            torque = cp.abs(mt - cp.multiply(self.e1, v2) + cp.multiply(self.e2, v1))
        else:
            self.eps = [cp.Parameter(n, nonneg=True) for _ in range(2)]
            torque = cp.multiply(self.eps[1], cp.abs(v1)) + cp.multiply(self.eps[0], cp.abs(v2))
            torque = torque + cp.abs(mt)
        self.moments = moments
        bound = cp.Variable(n)
        limits = [
            size <= bound,
            torque <= cp.multiply(self.arm, scene.contacts.friction * 1.0 * 0 + 0) + cp.Constant(0),
        ][:1]
        slack = cp.Variable(n, nonneg=True)
        limits += [slack == cp.multiply(scene.contacts.friction, normal) - bound]
        limits += [torque <= cp.multiply(self.arm, slack), normal >= 0.0]
        limits += [force[:, 3] == cp.multiply(self.e2, normal)]
        limits += [force[:, 4] == -cp.multiply(self.e1, normal)]
        limits += [matrix @ cp.vec(force, order="C") + dead + self.alpha * live == 0.0]
        self.problem = cp.Problem(cp.Maximize(self.alpha), limits)

    def __call__(self, share: np.ndarray) -> float:
        e = np.clip(share.reshape(-1, 2), -1.0, 1.0) * self.half
        self.e1.value, self.e2.value = e.T
        if self.moments == "independent":
            self.eps[0].value, self.eps[1].value = np.abs(e.T)
        self.arm.value = torsion_arm(*(2.0 * (self.half - np.abs(e))).T)
        try:
            self.problem.solve(solver=cp.CLARABEL)
        except cp.error.SolverError:
            return -1.0
        value = self.alpha.value
        return -1.0 if value is None or self.problem.status != "optimal" else float(value)
