"""Duals in the user's units.

Inside, a problem is scaled: a row of a constraint is its user's row over a unit, the force by which
all is scaled. A dual is what the objective gains per unit of the row, so that it becomes the user's
by division by that unit. Those of equilibrium become rates of blocks so, translations and
rotations: the mechanism.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.model.sinks import Constraints


class _Dual(cp.Variable):
    """A dual variable whose values are told in the solver's units, and kept in the user's."""

    def __init__(self, shape: Any, told: Callable[[Any], Any]) -> None:
        self._told = told
        super().__init__(shape)

    def save_value(self, val: Any, sparse_path: bool = False) -> None:
        super().save_value(None if val is None else self._told(val), sparse_path)


_OF_PROBLEM = "is_of_limit_problem"


def foreign(expression: Any, own: Collection[cp.Variable]) -> cp.Variable | None:
    """The first variable of an expression or a constraint that is an unknown of another limit
    problem than the one with the variables ``own``."""
    known = {variable.id for variable in own}
    others = [v for v in expression.variables() if v.id not in known and _OF_PROBLEM in vars(v)]
    return others[0] if others else None


class ScaledConstraints(Constraints):
    """Constraints in units of ``force``, whose duals are in the user's units, however they are
    solved; ``rates`` makes rates of blocks of the duals of equilibrium."""

    def __init__(self, force: float, rates: Callable[[FloatArray], FloatArray]) -> None:
        super().__init__()
        self._force, self._rates = force, rates

    def new(self, size: int | None = None, name: str | None = None, nonneg: bool = False) -> Any:
        unknown = super().new(size, name, nonneg)
        vars(unknown)[_OF_PROBLEM] = True
        return unknown

    def keep(self, constraint: Any) -> None:
        super().keep(constraint)
        if isinstance(constraint, cp.Constraint):
            told = self._rates if self.label == "equilibrium" else self._in_users_units
            constraint.dual_variables = [_Dual(v.shape, told) for v in constraint.dual_variables]

    def _in_users_units(self, dual: Any) -> Any:
        return np.asarray(dual, dtype=float) / self._force
