"""An interior-point solver that eliminates contacts and factorises what is left of the blocks.

A solver for CVXPY like any other, made for large assemblages: see :class:`Blockwise`.
"""

from cvxlimit.solvers.blockwise.interface import Blockwise

__all__ = ["Blockwise"]
