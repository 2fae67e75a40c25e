"""An interior-point solver that eliminates contacts and factorises what is left of the blocks.

A solver for CVXPY like any other, made for assemblages: see :class:`Blockwise`.
"""

from cvxlimit.solvers.interior.interface import Blockwise

__all__ = ["Blockwise"]
