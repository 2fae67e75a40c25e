"""``python -m benchmarks.elimination``: what fewer variables than three per contact would cost.

Planar walls. In the plane a contact's forces have three components, so a problem with fewer
variables per contact must have lost equilibrium equations: each can be solved for one variable and
put into all rows where that occurs. Columns for it are chosen by QR with pivoting. What it costs is
the number of non-zero coefficients that are left.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import cvxpy as cp
import numpy as np
import scipy.linalg
from rich.console import Console

from cvxlimit.masonry import running_bond, wall
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.problem import LimitProblem
from cvxlimit.reductions.choice import Reductions
from cvxlimit.surfaces.coulomb import surfaces_of

HEAD = (
    "| contacts | variables, full | planar | without equations | coefficients, planar | "
    "without equations |\n" + "|---" * 6 + "|"
)

_ZERO = 1e-9
"""Coefficients below this are rounding: those of a wall's equations are between 1e-2 and 1."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.elimination", description=__doc__)
    parser.add_argument("--units", type=int, nargs="+", default=[4, 8, 12])
    console = Console(highlight=False, soft_wrap=True)
    console.print(HEAD)
    for units in parser.parse_args(arguments).units:
        console.print(row(units))


def row(units: int) -> str:
    """A wall so many units long and twice as many courses high."""
    assemblage = Assemblage.of(wall(running_bond(units, 2 * units), friction=0.65))
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
    return "| " + " | ".join(f"{n:,}" for n in numbers) + " |"


if __name__ == "__main__":
    main()
