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
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.convex_search import ConvexSearch
from cvxlimit.methods.dilatancy.tresca import HeldFormulation, Slip, tresca
from cvxlimit.methods.driver import Run
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.problem import LimitProblem
from cvxlimit.model.statement import LARGEST_FACTOR, Goal, Stated
from cvxlimit.proof.certificate import Certifier
from cvxlimit.reductions.choice import Reductions, contacts_of
from cvxlimit.solvers import LimitState, SolverSettings, blockwise, clarabel_at
from cvxlimit.surfaces.base import times
from cvxlimit.surfaces.coulomb import needed_surfaces


@dataclass(frozen=True, eq=False)
class Priced:
    """Goal: the load factor less what compressions cost, ``price`` (n,) scaled like it."""

    price: cp.Parameter

    def __call__(self, stated: Stated) -> Any:
        return stated.factor - np.ones(self.price.size) @ times(self.price, stated.forces["N"])


class Reduced:
    """The smallest model of a run, for problems with friction held; what a search for the load
    factor knows already is not sought again.

    A mirror is left out unless a symmetric answer will do: without dilatancy a symmetric structure
    may fall on one side.

    Attributes
    ----------
    kept : (k,) int array
        Contacts that it has.
    lift : (n, k) matrix
        Compressions of all contacts that those of the kept ones stand for.
    """

    def __init__(
        self, run: Run, search: ConvexSearch | None = None, is_symmetric: bool = False
    ) -> None:
        self.surfaces = needed_surfaces(run.surfaces)
        if search is None:
            found = Reductions.of(run.assemblage, self.surfaces, model=run.model)
        else:
            found = search.reductions
        found = found if is_symmetric else replace(found, mirror=None)
        self.assemblage, state = found.assemblage, None
        if found.loaded is not None:
            certifier = search.certifier if search else Certifier(found.assemblage, self.surfaces)
            state = certifier.witnesses.easy_dead_state
        self.reduction = found.best(state)
        n, names = len(run.contacts), self.reduction.names
        is_kept = np.ones(n, dtype=bool)
        if "parts" in names and found.loaded is not None:
            is_kept = contacts_of(run.assemblage.statics, found.loaded)
        if found.mirror is not None:
            is_kept = is_kept & (np.arange(n) <= found.mirror.contacts)
        self.kept, lift, at = np.flatnonzero(is_kept), self.reduction.forces, COLUMN["N"]
        each = slice(at, None, len(COMPONENTS))
        self.lift = sp.eye_array(n, format="csr") if lift is None else lift[each][:, each].tocsr()

    def problem(self, goal: Goal = LARGEST_FACTOR) -> LimitProblem:
        """With friction as it is."""
        return LimitProblem(self.assemblage, self.surfaces, reduction=self.reduction, goal=goal)

    def held(self, pressed: cp.Parameter, turned: float = 0.0) -> LimitProblem:
        """With friction held at compressions (k,); see :func:`~.tresca.held`."""
        reduction, own = self.reduction, self.reduction.formulation
        if own is not corner_compressions:
            reduction = replace(reduction, formulation=HeldFormulation(own, pressed, turned))
        surfaces = tresca(self.surfaces, pressed, turned)
        return LimitProblem(self.assemblage, surfaces, reduction=reduction)


class Pair:
    """Both problems of a run on the smallest model, each starting from its last answer.

    Attributes
    ----------
    solved : int
        How many problems were solved.
    slip : Slip
        The flow rule of resultants with friction held.
    has_cones : bool
        Whether friction, or anything else on the smallest model, is no linear limit.
    """

    def __init__(
        self, run: Run, search: ConvexSearch | None = None, is_symmetric: bool = False
    ) -> None:
        self.run, self.solved = run, 0
        with run.clock.phase("compile"):
            reduced = Reduced(run, search, is_symmetric)
            self._kept, self._lift = reduced.kept, reduced.lift
            self.slip = Slip(reduced.surfaces, run.assemblage.contacts)
            self._price, self._pressed = (cp.Parameter(len(self._kept)) for _ in range(2))
            self._priced = reduced.problem(Priced(self._price))
            self._held = reduced.held(self._pressed)
            self._price.value = np.zeros(len(self._kept))
            self.has_cones = self._priced.shape.cones > 0

    def priced(self, price: FloatArray, tolerance: float) -> LimitState:
        """Forces of the largest load factor less prices (n,) of compressions."""
        self._price.value = self.run.scaling.live * (self._lift.T @ price)
        state, settings = self._solved(self._priced, tolerance)
        self.run.note(state, f"{settings}, compressions priced")
        return state

    def held(self, pressed: FloatArray, tolerance: float) -> LimitState:
        """The load factor, and a mechanism, with friction held at compressions (n,)."""
        self._pressed.value = np.maximum(pressed, 0.0)[self._kept]
        state, settings = self._solved(self._held, tolerance)
        self.run.note(replace(state, load_factor=None), f"{settings}, friction held")
        return state

    def _solved(self, problem: LimitProblem, tolerance: float) -> tuple[LimitState, SolverSettings]:
        self.solved += 1
        return self.run.try_solvers(problem.run, self.run.ladder or ladder(tolerance))

    def dilatancy(self, mechanism: FloatArray) -> FloatArray:
        """The price (n,) of a mechanism: the opening that dilatancy would add at live power 1."""
        statics = self.run.assemblage.statics
        unit = mechanism / float(statics.live @ mechanism.ravel())
        return self.slip.dilatancy(self.slip.of(statics.relative_rates(unit)))


def ladder(tolerance: float) -> Sequence[SolverSettings]:
    """Our own solver, which starts warm, and Clarabel where it fails."""
    return (*blockwise(tolerance), *clarabel_at(tolerance))


def pressed(state: LimitState) -> FloatArray:
    """Compressions (n,) of a state with forces."""
    assert state.forces is not None
    return state.forces[:, COLUMN["N"]]
