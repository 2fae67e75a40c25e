"""One step from rest, in CVXPY: the convex problem that the engine solves in displacements.

With N and T the compressions and shears of points, g their gaps at the start of the step, T' their
shears then, r = mu N' the friction held and dw the push,

    min  1/2 sum N^2 / kn + g . N + 1/2 sum |T - T'|^2 / ks - dw alpha
    s.t. A x(N, T) + dead + alpha live = 0,    N >= 0,    |T| <= r

g, T', r and dw are Parameters. The dual of equilibrium is the displacement of the step, which gives
the next gaps; friction is renewed, r = mu N, until it agrees (:mod:`.engine` says the same the
other way round).
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from cvxlimit.base.checks import positive
from cvxlimit.extensions.incremental.placing import points_of
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.model.statics import Statics
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solution import Solution

PRESSED = 1e-7
"""Share of the largest compression from which a point is pressed: solvers leave 1e-9 elsewhere."""


class ElasticStep:
    """A step from rest, for scenes without cohesion, strengths and reactions.

    Attributes
    ----------
    N : Variable (p,), T : Variable (p, 2)
        Compressions and shears of all points, over ``force``.
    factor : Variable
        The load factor.
    gaps, before, radius, push : Parameter (p,), (p, 2), (p,), ()
        Gaps and shears at the start, friction held, and the push along the live load.
    problem : Problem
        The step; ``rest`` is the one under the dead load, with friction mu N in place of
        ``radius``.
    contact : (p,) array
        Of which contact each point is.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> step = ElasticStep(builtin_scene("single-block"))
    >>> step.start()
    >>> round(step.advance(100.0), 4)
    0.4
    """

    def __init__(self, scene: Scene, ratio: float = 0.4) -> None:
        check_scene(scene)
        positive(ratio, "ratio")
        contacts, statics = scene.contacts, Statics.of(scene)
        found = [points_of(contacts, j) for j in range(len(contacts))]
        self.contact = np.repeat(np.arange(len(found)), [len(share) for _, share in found])
        x, y = np.concatenate([at for at, _ in found]).T
        area = np.concatenate([share for _, share in found]) * contacts.area[self.contact]
        self.kn = area / contacts.area.mean()
        self.ks = ratio * self.kn
        self.mu = contacts.friction[self.contact]
        self.force = float(np.abs(scene.dead_forces[:, :3]).sum()) / len(scene.free)
        # contact forces of those at points, and what these do to the blocks
        p, one = len(area), np.ones_like(area)
        parts = [{"N": one, "M1": y, "M2": -x}, {"V1": one, "MT": -y}, {"V2": one, "MT": x}]
        place = 6 * self.contact
        self.maps = []
        for part in parts:
            rows = np.concatenate([place + COLUMN[name] for name in part])
            columns = np.tile(np.arange(p), len(part))
            entries = np.concatenate([*part.values()])
            self.maps.append(sp.csr_array((entries, (rows, columns)), (6 * len(contacts), p)))
        self.blocks = [statics.matrix @ each for each in self.maps]
        dead, live = statics.dead / self.force, statics.live / self.force
        self.N, self.T, self.factor = cp.Variable(p), cp.Variable((p, 2)), cp.Variable()
        self.gaps, self.before = cp.Parameter(p), cp.Parameter((p, 2))
        self.radius, self.push = cp.Parameter(p, nonneg=True), cp.Parameter(nonneg=True)
        n, t = (
            self.blocks[0] @ self.N,
            self.blocks[1] @ self.T[:, 0] + self.blocks[2] @ self.T[:, 1],
        )
        self.equilibrium = n + t + dead + self.factor * live == 0
        sliding = cp.norm(self.T, axis=1)
        normal = cp.sum_squares(cp.multiply(self.kn**-0.5, self.N)) / 2
        sheared = cp.multiply((self.ks**-0.5)[:, None] * np.ones((1, 2)), self.T - self.before)
        energy = normal + self.gaps @ self.N + cp.sum_squares(sheared) / 2
        self.rest = cp.Problem(
            cp.Minimize(energy),
            [
                self.equilibrium,
                self.N >= 0,
                self.factor == 0,
                sliding <= cp.multiply(self.mu, self.N),
            ],
        )
        self.problem = cp.Problem(
            cp.Minimize(energy - self.push * self.factor),
            [self.equilibrium, self.N >= 0, sliding <= self.radius],
        )

    def start(self, solver: str = "CLARABEL") -> None:
        """Solve for the state at rest, and begin from it."""
        self.gaps.value, self.before.value = np.zeros(len(self.kn)), np.zeros((len(self.kn), 2))
        self.rest.solve(solver=solver)
        self._keep()

    def advance(self, push: float, solver: str = "CLARABEL", renewals: int = 30) -> float:
        """Push on, friction renewed until it agrees to a thousandth, and return the load factor.

        ``push`` is in units of ``force`` over the stiffness of a joint of mean area.
        """
        self.push.value = push
        compressions = self.N.value
        for number in range(renewals):
            self.radius.value = self.mu * np.maximum(compressions, 0.0)
            self.problem.solve(solver=solver)
            change = np.abs(self.N.value - compressions).sum()
            compressions = self.N.value if number < 5 else (self.N.value + compressions) / 2.0
            if change <= 1e-3 * np.abs(compressions).sum():
                break
        self._keep()
        return float(self.factor.value)

    def _keep(self) -> None:
        """Takes the state as the next start: gaps by the dual of equilibrium, or by compressions,
        which have more digits."""
        open_gaps = self.gaps.value + self.blocks[0].T @ self.equilibrium.dual_value
        is_pressed = self.N.value > PRESSED * self.N.value.max()
        gaps = np.where(is_pressed, -self.N.value / self.kn, np.maximum(open_gaps, 0.0))
        self.gaps.value, self.before.value = gaps, self.T.value


def step_of(solution: Solution) -> ElasticStep:
    """The step of a solution's scene, begun at rest: see :attr:`cvxlimit.Solution.problem`."""
    step = ElasticStep(solution.scene)
    step.start()
    return step
