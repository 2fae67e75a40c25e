"""What users add to a limit problem: limits under names, and another aim."""

from __future__ import annotations

import reprlib
from copy import copy
from functools import cached_property
from typing import Any, Self

import cvxpy as cp
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.model.limits import LinearLimits, OwnLimits
from cvxlimit.model.statement import Statement
from cvxlimit.solvers import LimitState


class Changeable(Statement):
    """A limit problem to which limits are added; see
    :class:`~cvxlimit.LimitProblem`."""

    def __init__(self, *stated: Any) -> None:
        super().__init__(*stated)
        self.limits: dict[str, tuple[cp.Constraint, ...]] = {}
        self.aim: cp.Expression | None = None
        self.sense = 1.0  # of the aim: -1 for one that is minimised
        self._kept: dict[str, Any] = {}  # by solvers, for the next run
        self._values_before: FloatArray | None = None  # of coefficients, in the run before
        self.within: LimitState | None = None  # the limits, in a solve before
        self.states: list[LimitState] | None = None  # of runs, where one's values are asked for

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
    def has_own(self) -> bool:
        """True if limits were added, or something else is maximised."""
        return bool(self.limits) or self.aim is not None

    def inside(self) -> Self:
        """The same limits without an aim: an interior-point solver ends well inside them."""
        return self._inside

    @cached_property
    def _inside(self) -> Self:
        result = copy(self)
        result.states = None
        # of variables that the copy shares
        result.change(dict(self.limits), 0.0 * self._in_cvxpy[0].factor)
        return result

    @property
    def said_own(self) -> str:
        """What was added, for notes."""
        names = reprlib.repr(list(self.limits))[1:-1]
        parts = [f"limits {names}" if names else "", "an aim" if self.aim is not None else ""]
        return " and ".join(filter(None, parts))

    @cached_property
    def _own(self) -> OwnLimits | None:
        aim = None if self.aim is None else self.sense * self.aim
        return OwnLimits(self.limits, aim) if self.has_own else None

    def change(
        self,
        limits: dict[str, tuple[cp.Constraint, ...]],
        aim: cp.Expression | None,
        sense: float = 1.0,
    ) -> None:
        """Other limits, by name, and another aim, None for the load factor; it is maximised, or
        minimised where ``sense`` is -1."""
        self.limits, self.aim, self.sense = limits, aim, sense
        for name in ("problem", "_in_rows", "_own", "shape", "_inside"):
            self.__dict__.pop(name, None)
        self.forget()

    def forget(self) -> None:
        """Start the next solve as if there had been none."""
        self._kept, self._values_before, self.within = {}, None, None
