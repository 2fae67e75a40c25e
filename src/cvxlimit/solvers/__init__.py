"""Solvers: their settings, the order in which they are tried, one run, and a plug-in of our own.

To add one: if CVXPY knows it, it is on the ladder already when it is installed; settings that it
needs go into :data:`OPTIONS`. One that CVXPY does not know is a class for
:data:`cvxlimit.solvers.running.PLUG_INS`, like :class:`Blockwise`.
"""

from cvxlimit.solvers.blockwise import Blockwise
from cvxlimit.solvers.running import LimitState, Outcome, run
from cvxlimit.solvers.settings import (
    OPTIONS,
    Shape,
    SolverSettings,
    default_ladder,
    is_conic,
    iterate_ladder,
    limit_ladder,
    suits,
)

__all__ = [
    "OPTIONS",
    "Blockwise",
    "LimitState",
    "Outcome",
    "Shape",
    "SolverSettings",
    "default_ladder",
    "is_conic",
    "iterate_ladder",
    "limit_ladder",
    "run",
    "suits",
]
