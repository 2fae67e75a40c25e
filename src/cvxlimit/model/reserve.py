"""Of all states of force that carry a load factor, that which uses the joints least."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.goals import Stated
from cvxlimit.model.problem import LimitProblem
from cvxlimit.scene import Scene
from cvxlimit.surfaces.base import YieldSurface, admissible, stated


@dataclass(frozen=True)
class _Numbers:
    """The load factor is less by the share ``below``, so that rounding of it leaves forces to
    choose from; a contact at its strength then shows 1 to about as many digits as are printed.
    ``admissible`` is the excess and imbalance, over the largest compression, of forces that are
    good for a picture."""

    below: float = 1e-6
    admissible: float = 1e-5


_N = _Numbers()


@dataclass(frozen=True)
class LeastUse:
    """Least sum of N u^2 over all contacts, with u the share of strength in use.

    u N is the least compression under which a contact would still bear its shear and moments, so
    the sum is convex: that compression squared over N. Contacts are pressed by at most ``most``:
    blocks between supports could press each other without end, and use ever less of their strength.
    """

    surfaces: Sequence[YieldSurface]
    factor: float
    most: float

    def __call__(self, problem: Stated) -> Any:
        into, scaling = problem.into, problem.assemblage.scaling
        normal = problem.forces["N"]
        needed, use = into.new(normal.size), into.new(normal.size)
        into.zero(problem.factor - self.factor / scaling.load_factor(1.0))
        into.nonneg(normal - needed)
        into.nonneg(self.most / scaling.force - normal)
        into.cone(normal + use, [2.0 * needed, normal - use])
        alone = ChainMap({"N": needed}, problem.forces)
        for surface in self.surfaces:
            for condition in stated(surface, problem.assemblage.contacts):
                admissible(into, condition, alone, surface.cone)
        return -(np.ones(use.size) @ use)


def least_used(
    scene: Scene, surfaces: Sequence[YieldSurface], factor: float, forces: FloatArray
) -> FloatArray | None:
    """The state (n, 6) that uses the joints least at a load factor, or None if none was found.

    ``forces`` are a state that carries it; no contact is pressed by more than twice their largest
    compression.
    """
    most = 2.0 * float(forces[:, 2].max(initial=0.0))
    if scene.ties or (forces[:, 2] < -_N.admissible * most).any():
        return None  # what pulls has no share of a compression
    assemblage, below = Assemblage.of(scene), (1.0 - _N.below) * factor
    problem = LimitProblem(assemblage, surfaces, goal=LeastUse(surfaces, below, most))
    for settings in problem.ladder():
        found = problem.run(settings).forces
        if found is not None and _is_good(assemblage, surfaces, below, found, most):
            return found
    return None


def _is_good(
    assemblage: Assemblage, surfaces: Sequence[YieldSurface], factor: float, forces: FloatArray,
    most: float,
) -> bool:  # fmt: skip
    rest = np.abs(assemblage.statics.residual(forces, factor)).max(initial=0.0)
    parts = [part for surface in surfaces for part in surface.excess(forces, assemblage.contacts)]
    excess = max(float(part.max(initial=0.0)) for part in parts)
    return bool(np.isfinite(forces).all() and max(float(rest), excess) <= _N.admissible * most)
