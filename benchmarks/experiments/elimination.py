"""What fewer variables than three per contact would cost.

In the plane a contact's forces have three components, so a problem with fewer
variables per contact must have lost equilibrium equations: each can be solved for one variable and
put into all rows where that occurs. Columns for it are chosen by QR with pivoting. What it costs is
the number of non-zero coefficients that are left.
"""

from __future__ import annotations

from collections.abc import Sequence

import cvxpy as cp
import numpy as np
import scipy.linalg

from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.scenes import wall_of
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.problem import LimitProblem
from cvxlimit.reductions.choice import Reductions
from cvxlimit.surfaces.coulomb import surfaces_of

_ZERO = 1e-9
"""Coefficients below this are rounding: those of a wall's equations are between 1e-2 and 1."""


@experiment(Part(1))
def elimination(units: Sequence[int] = (4, 8, 12)) -> Lines:
    """What fewer variables than three per contact would cost, on planar walls of so many units."""
    yield Head("contacts", "variables, full", "planar", "without equations", "coefficients, planar",
               "without equations")  # fmt: skip
    yield from map(row, units)


def row(units: int) -> tuple[str, ...]:
    """A wall so many units long and twice as many courses high."""
    assemblage = Assemblage.of(wall_of(units))
    surfaces = surfaces_of("conic")[0]
    found = Reductions.of(assemblage, surfaces)
    full, planar = (
        LimitProblem(assemblage, surfaces, reduction=reduction).problem.get_problem_data(
            cp.CLARABEL
        )[0]
        for reduction in (Reduction.none(assemblage.statics), found.best())
    )
    equations, rows = np.split(planar["A"].toarray(), [planar["dims"].zero])
    chosen = scipy.linalg.qr(equations, mode="r", pivoting=True)[1][: len(equations)]
    rest = np.setdiff1d(np.arange(equations.shape[1]), chosen)
    dependent = np.linalg.solve(equations[:, chosen], equations[:, rest])
    left = rows[:, rest] - rows[:, chosen] @ dependent
    numbers = (
        len(assemblage.contacts), full["A"].shape[1], equations.shape[1], len(rest),
        planar["A"].nnz, int((np.abs(left) > _ZERO).sum()),
    )  # fmt: skip
    return tuple(f"{n:,}" for n in numbers)
