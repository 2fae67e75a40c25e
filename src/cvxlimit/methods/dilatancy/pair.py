"""The two convex problems whose common answers are the solutions without dilatancy.

Of admissible forces x, load factor alpha and a mechanism u of live power 1 that opens no joint the
wrong way, the loss

    Phi(x, u) = sum (mu N + c A) sigma - dead . u - alpha,   sigma = max(|slip|, c_T |twist|),

is never negative, and zero exactly where x and u are a solution. For fixed x the least over u is
the load factor with friction held at the compressions of x (:mod:`.tresca`), less alpha. For fixed
u the least over x maximises alpha - sum p N at the *price* p = mu sigma. Both are convex, on one
pattern, so alternating them never raises the loss; and an x belongs to a solution if and only if
the load factor with its friction held is its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.dilatancy.tresca import HeldFormulation, Slip, tresca
from cvxlimit.methods.driver import Run
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.goals import Stated
from cvxlimit.model.problem import LimitProblem
from cvxlimit.proof.certificate import Certifier
from cvxlimit.reductions.choice import Reductions, contacts_of
from cvxlimit.solvers import LimitState, SolverSettings, clarabel_at, settings_for
from cvxlimit.surfaces.base import times
from cvxlimit.surfaces.coulomb import needed_surfaces


@dataclass(frozen=True, eq=False)
class Priced:
    """Goal: the load factor less what compressions cost, ``price`` (n,) scaled like it."""

    price: cp.Parameter

    def __call__(self, stated: Stated) -> Any:
        return stated.factor - np.ones(self.price.size) @ times(self.price, stated.forces["N"])


class Pair:
    """Both problems of a run on the smallest model, each starting from its last answer.

    A mirror is left out: without dilatancy a symmetric structure may fall on one side.

    Attributes
    ----------
    slip : Slip
        Of contacts in their corner compressions.
    solved : int
        How many problems were solved.
    """

    def __init__(self, run: Run) -> None:
        self.run, self.solved = run, 0
        surfaces = needed_surfaces(run.surfaces)
        with run.clock.phase("compile"):
            found = replace(Reductions.of(run.assemblage, surfaces, model=run.model), mirror=None)
            self.assemblage, statics = found.assemblage, run.assemblage.statics
            self.certifier = Certifier(found.assemblage, surfaces)
            stands = found.loaded is not None and self.certifier.witnesses.easy_dead_state
            reduction = found.best(stands if stands is not False else None)
            n = len(run.contacts)
            self._kept = np.arange(n)
            if "parts" in reduction.names and found.loaded is not None:
                self._kept = np.flatnonzero(contacts_of(statics, found.loaded))
            self.slip = Slip(surfaces, run.assemblage.contacts)
            self._price, self._pressed = (cp.Parameter(len(self._kept)) for _ in range(2))
            whole = found.assemblage
            goal = Priced(self._price)
            self._priced = LimitProblem(whole, surfaces, reduction=reduction, goal=goal)
            own = reduction.formulation
            if own is not corner_compressions:
                own = HeldFormulation(own, self._pressed)
            self._held = LimitProblem(
                whole,
                tresca(surfaces, self._pressed),
                reduction=replace(reduction, formulation=own),
            )

    def priced(self, price: FloatArray, tolerance: float) -> LimitState:
        """Forces of the largest load factor less prices (n,) of compressions."""
        self._price.value = self.run.scaling.live * price[self._kept]
        return self._solved(self._priced, tolerance)

    def held(self, pressed: FloatArray, tolerance: float) -> LimitState:
        """The load factor, and a mechanism, with friction held at compressions (n,)."""
        self._pressed.value = np.maximum(pressed, 0.0)[self._kept]
        return self._solved(self._held, tolerance)

    def _solved(self, problem: LimitProblem, tolerance: float) -> LimitState:
        self.solved += 1
        state, _ = self.run.try_solvers(problem.run, self.run.ladder or ladder(tolerance))
        return state

    def dilatancy(self, mechanism: FloatArray) -> FloatArray:
        """The price (n,) of a mechanism: the opening that dilatancy would add at live power 1."""
        statics = self.run.assemblage.statics
        unit = mechanism / float(statics.live @ mechanism.ravel())
        return self.slip.dilatancy(self.slip.of(statics.relative_rates(unit)))


def ladder(tolerance: float) -> Sequence[SolverSettings]:
    return (settings_for("BLOCKWISE", tolerance), *clarabel_at(tolerance))


def pressed(state: LimitState) -> FloatArray:
    assert state.forces is not None
    return state.forces[:, COLUMN["N"]]
