"""Solvers: the table of them, the order in which they are tried, one run, a sparse factorisation.

To add one: if CVXPY knows it, write a row into :data:`~cvxlimit.solvers.table.SOLVERS`; it can be
put on a ladder even without. One that CVXPY does not know is a class of CVXPY's interface to
solvers, which may stand on a ladder itself, or in such a row.
"""

from typing import Any

from cvxlimit.solvers.ladders import (
    Ladder,
    Shape,
    asked_ladder,
    blockwise,
    default_ladder,
    ladder_for,
    ladder_of,
    limit_ladder,
)
from cvxlimit.solvers.running import LimitState, Outcome, run
from cvxlimit.solvers.table import (
    SOLVERS,
    Solver,
    SolverSettings,
    check_installed,
    installed,
    settings_for,
    versions,
)

__all__ = [
    "SOLVERS",
    "Ladder",
    "LimitState",
    "Outcome",
    "Shape",
    "Solver",
    "SolverSettings",
    "asked_ladder",
    "blockwise",
    "check_installed",
    "default_ladder",
    "installed",
    "ladder_for",
    "ladder_of",
    "limit_ladder",
    "run",
    "settings_for",
    "versions",
]


def __getattr__(name: str) -> Any:
    if name == "Blockwise" and "BLOCKWISE" in SOLVERS:  # of an extension
        return SOLVERS["BLOCKWISE"].plug_in
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
