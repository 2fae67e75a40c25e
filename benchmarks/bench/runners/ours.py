"""The package, and programs on its scenes: ``ours.py NAME SCENE.json RESULT.json ...``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.baselines import Literal, ScipyLinprog, eight_lines, program
from benchmarks.stability.truths import arm

from cvxlimit import Status, solve
from cvxlimit.io import read_scene
from protocol import answer, dry, factor_or


def package(file: Path) -> dict[str, Any]:
    """The package itself, default settings: the factor, or what the status says."""
    found = solve(read_scene(file))
    if found.load_factor is None:
        if found.status is Status.DEAD_LOAD_UNSTABLE:
            return {"answer": "falls"}
        raise ValueError(str(found.status))
    return {"load_factor": found.load_factor}


def plain_cvxpy(file: Path) -> dict[str, Any]:
    """What anyone writes first: the cone of Eq. 24 in eight lines of CVXPY, default solver."""
    dry(file)
    data = program(read_scene(file))
    arms = [arm(data.contacts.corners_of(j)) for j in range(len(data.contacts))]
    problem = eight_lines(data, np.array(arms))
    problem.solve()
    is_known = problem.value is not None and np.isfinite(problem.value)
    return factor_or(problem.status, float(problem.value) if is_known else None)


def paper_octagon(file: Path) -> dict[str, Any]:
    """The paper's problem written literally: Eq. 9, 25 and 39 in CVXPY, default solver."""
    return measured(Literal(), file)


def scipy_linprog(file: Path) -> dict[str, Any]:
    """The same matrices in SciPy's linprog (HiGHS), default settings."""
    return measured(ScipyLinprog(), file)


def measured(method: Literal, file: Path) -> dict[str, Any]:
    """What a baseline of the benchmarks answers."""
    dry(file)
    found = method.measure(read_scene(file))
    return factor_or(found.status, found.load_factor)


PROGRAMS = {
    "package": (package, ("cvxlimit", "cvxpy")),
    "plain_cvxpy": (plain_cvxpy, ("cvxpy", "clarabel")),
    "paper_octagon": (paper_octagon, ("cvxpy", "clarabel")),
    "scipy_linprog": (scipy_linprog, ("scipy",)),
}
"""What runs, and the packages whose versions count."""

run, packages = PROGRAMS[sys.argv.pop(1)]
answer(packages, run)
