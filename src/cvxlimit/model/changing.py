"""What users add to a limit problem: limits under names, and another aim."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Any, Self

import cvxpy as cp
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.model.limits import LinearLimits, OwnLimits
from cvxlimit.model.statement import Statement
from cvxlimit.solvers import LimitState


class Changeable(Statement):
    """A limit problem to which limits are added; see
    :class:`~cvxlimit.model.problem.LimitProblem`."""

    def __init__(self, *stated: Any) -> None:
        super().__init__(*stated)
        self._limits: dict[str, tuple[cp.Constraint, ...]] = {}
        self._aim: cp.Expression | None = None
        self._kept: dict[str, Any] = {}  # by solvers, for the next run
        self._values_before: FloatArray | None = None  # of coefficients, in the run before
        self.within: LimitState | None = None  # the limits, in a solve before

    def linear_limits(self) -> LinearLimits | str:
        """What was added, as rows on contact forces and load factor at the Parameters' present
        values, for proofs; or a sentence on why it is none of that kind. The multipliers of a state
        are its ``own["multipliers"]``: what the objective gains per unit of ``right``."""
        if self._own is None:
            return "nothing was added"
        stated, _ = self._in_cvxpy
        if self._written[0] or self.reduction.forces is not None:
            return "limits have a bracket on full models without unknowns of their own only"
        starts = self.model.start.values()
        internal = {v.id: at for v, at in zip(stated.internal, starts, strict=True)}
        units, load = self.scaling.force * self._unit, self.scaling.load_factor(1.0)
        forces = sp.csr_array(self.model.resultant_map @ sp.diags_array(units))
        return self._own.linear(internal, forces, stated.factor.id, load)

    @property
    def limits(self) -> dict[str, tuple[cp.Constraint, ...]]:
        """Limits that were added, by name."""
        return dict(self._limits)

    @property
    def has_own(self) -> bool:
        """True if limits were added, or something else is maximised."""
        return bool(self._limits) or self._aim is not None

    @property
    def has_aim(self) -> bool:
        """True if something other than the load factor is maximised."""
        return self._aim is not None

    def value(self, state: LimitState) -> float | None:
        """What is maximised, in the state of the last run."""
        value = None if self._aim is None else self._aim.value
        return state.load_factor if value is None else float(value)

    def inside(self) -> Self:
        """The same limits without an aim: an interior-point solver ends well inside them."""
        return self._inside

    @cached_property
    def _inside(self) -> Self:
        nothing = 0.0 * self._in_cvxpy[0].factor  # of variables that the copy shares
        result = copy(self)
        result._limits = dict(self._limits)
        result.maximise(nothing)
        return result

    @property
    def said_own(self) -> str:
        """What was added, for notes."""
        names = ", ".join(map(repr, self._limits))
        parts = [f"limits {names}" if names else "", "an aim" if self._aim is not None else ""]
        return " and ".join(filter(None, parts))

    @cached_property
    def _own(self) -> OwnLimits | None:
        return OwnLimits(self._limits, self._aim) if self._limits or self._aim is not None else None

    def _changed(self) -> None:
        for name in ("problem", "_in_rows", "_own", "_shared", "shape", "_inside"):
            self.__dict__.pop(name, None)
        self._kept, self._values_before, self.within = {}, None, None

    def add(self, name: str, *limits: cp.Constraint) -> None:
        """Add limits under a name: CVXPY constraints on :attr:`N`, :attr:`V1` ... :attr:`factor`,
        in the user's units; variables and Parameters of one's own may stand in them.

        Raises
        ------
        ModelError
            For a name that is taken, and for what is no constraint, or not convex.

        Example
        -------
        >>> from cvxlimit import LimitProblem, builtin_scene
        >>> problem = LimitProblem(builtin_scene("single-block"))
        >>> problem.add("weak joint", problem.V1 >= -1.0, problem.V1 <= 1.0)
        >>> round(problem.run().load_factor, 5)
        0.3125
        """
        if name in self._limits or name in self.constraints:
            raise ModelError(
                f"there is a limit {name!r} already: remove it first, or choose a name"
            )
        for limit in limits:
            if not isinstance(limit, cp.Constraint):
                raise ModelError(
                    f"limit {name!r} must be a CVXPY constraint, as problem.N <= 3, got {limit!r}"
                )
            if not limit.is_dcp():
                raise ModelError(f"limit {name!r} is not convex by CVXPY's rules (DCP): {limit}")
        self._limits[name] = limits
        self._changed()

    def remove(self, name: str) -> None:
        """Take away the limits that were added under a name.

        Raises
        ------
        ModelError
            If there are none.
        """
        if name not in self._limits:
            names = ", ".join(map(repr, self._limits)) or "none"
            raise ModelError(f"there is no added limit {name!r}: there are {names}")
        del self._limits[name]
        self._changed()

    def maximise(self, expression: cp.Expression | float | None) -> None:
        """Maximise a concave expression in place of the load factor; None goes back to that. Fix
        the load factor by a limit, ``problem.add("load", problem.factor == 1)``, for the largest
        force under given loads.

        Raises
        ------
        ModelError
            For an expression that CVXPY does not find concave.
        """
        aim = None if expression is None else cp.Constant(0.0) + expression
        if aim is not None and not (aim.is_scalar() and aim.is_concave()):
            raise ModelError(f"only one number that is concave can be maximised, got {expression}")
        self._aim = aim
        self._changed()
