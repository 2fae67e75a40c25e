"""Solvers: the table of them, the order in which they are tried, one run, and one of our own.

To add one: if CVXPY knows it, write a row into :data:`~cvxlimit.solvers.table.SOLVERS`; it can be
put on a ladder even without. One that CVXPY does not know is a class for
:data:`cvxlimit.solvers.running.PLUG_INS`, like :class:`Blockwise`.
"""

from cvxlimit.solvers.blockwise import Blockwise
from cvxlimit.solvers.ladder import (
    Shape,
    check_installed,
    default_ladder,
    installed,
    is_conic,
    iterate_ladder,
    ladder_of,
    leading_ladder,
    limit_ladder,
    suits,
)
from cvxlimit.solvers.running import LimitState, Outcome, run
from cvxlimit.solvers.table import SOLVERS, Solver, SolverSettings, settings_for

__all__ = [
    "SOLVERS",
    "Blockwise",
    "LimitState",
    "Outcome",
    "Shape",
    "Solver",
    "SolverSettings",
    "check_installed",
    "default_ladder",
    "installed",
    "is_conic",
    "iterate_ladder",
    "ladder_of",
    "leading_ladder",
    "limit_ladder",
    "run",
    "settings_for",
    "suits",
]
