"""Limit problems of scenes that differ in friction and loads only: compiled once, as Parameters.

CVXPY's compile is then a product with a sparse matrix. For a scene that is solved once it does not
pay: compiling with Parameters takes longer. docs/evidence/models.md has figures.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from cvxlimit.arrays import FloatArray
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.problem import LimitProblem, Terms
from cvxlimit.model.variables import ForceVariables
from cvxlimit.solvers import Ladder, limit_ladder
from cvxlimit.strengths import PROPERTIES
from cvxlimit.surfaces import Rocking, TorsionShear, YieldSurface

_KINDS = (Rocking, TorsionShear)
"""Surfaces whose rows are linear in friction, and say all by their type and cone."""

_KEPT = 4
"""Compiled problems kept: one per pattern of the loads, as a rule two."""


class _Entries:
    """A load vector whose entries that are not zero are Parameters."""

    def __init__(self, load: FloatArray) -> None:
        self.at = np.flatnonzero(load)
        self.parameter = cp.Parameter(max(len(self.at), 1), value=np.zeros(max(len(self.at), 1)))
        spread = (np.ones(len(self.at)), (self.at, np.arange(len(self.at))))
        shape = (len(load), self.parameter.size)
        self.expression = sp.csr_array(spread, shape=shape) @ self.parameter

    def set(self, load: FloatArray) -> None:
        self.parameter.value = load[self.at] if len(self.at) else np.zeros(1)


class RepeatedProblem(LimitProblem):
    """The full model's limit problem, of whichever assemblage it was last given.

    Its Parameters are the friction and the loads; it is an objective of its own kind.
    """

    def __init__(self, assemblage: Assemblage, surfaces: Sequence[YieldSurface]) -> None:
        contacts, scaled = assemblage.contacts, assemblage.scaled
        is_uniform = np.ptp(contacts.friction) == 0.0
        self.friction = cp.Parameter(() if is_uniform else len(contacts), nonneg=True)
        self.loads = _Entries(scaled.dead), _Entries(scaled.live)
        friction = self.friction * np.ones(len(contacts)) if is_uniform else self.friction
        symbolic = copy(contacts)
        object.__setattr__(symbolic, "friction", friction)
        reduction = replace(Reduction.none(assemblage.statics), contacts=symbolic)
        super().__init__(assemblage, surfaces, objective=self, reduction=reduction)
        self.renew(assemblage)

    def terms(self, assemblage: Assemblage, forces: ForceVariables, alpha: cp.Variable) -> Terms:
        dead, live = self.loads
        return Terms(alpha, dead.expression, alpha * live.expression)

    def ladder(self, tolerance: float = 1e-5) -> Ladder:
        """The usual solvers; QOCO first no tighter than it has to be."""
        return limit_ladder(self.shape, tolerance, is_repeated=True)

    def renew(self, assemblage: Assemblage) -> RepeatedProblem:
        self.assemblage, self.scaling = assemblage, assemblage.scaling
        friction = assemblage.contacts.friction
        self.friction.value = float(friction[0]) if self.friction.ndim == 0 else friction
        for entries, load in zip(
            self.loads, (assemblage.scaled.dead, assemblage.scaled.live), strict=True
        ):
            entries.set(load)
        return self


class Repeats:
    """What problems of one geometry share: compiled problems, and ``states`` of
    :class:`~cvxlimit.proof.slater.Witnesses`, by the loads and strengths they are for.
    """

    def __init__(self) -> None:
        self.states: dict[object, FloatArray | None] = {}
        self._known: dict[object, RepeatedProblem] = {}

    def problem(
        self, assemblage: Assemblage, surfaces: Sequence[YieldSurface], reduction: Reduction
    ) -> LimitProblem | None:
        """The compiled problem with the numbers of an assemblage, None if it is not of this kind.

        What decides about its rows is the same whoever was solved before, so that its answers are.
        """
        contacts = reduction.contacts
        is_plain = not reduction.names and reduction.formulation is corner_compressions
        limited = any(
            (getattr(contacts, name) != each.default).any()
            for name, each in PROPERTIES.items()
            if name != "friction"  # the one whose numbers are renewed
        )
        if not is_plain or limited or not all(type(s) in _KINDS for s in surfaces):
            return None
        scaled = assemblage.scaled
        key = (
            tuple((type(s).__name__, str(s.cone)) for s in surfaces),
            assemblage.scaling.length,
            float(np.ptp(contacts.friction)) == 0.0,
            *(np.flatnonzero(load).tobytes() for load in (scaled.dead, scaled.live)),
        )
        known = self._known.get(key)
        if known is not None:
            return known.renew(assemblage)
        if len(self._known) >= _KEPT:
            self._known.clear()
        self._known[key] = RepeatedProblem(assemblage, surfaces)
        return self._known[key]
