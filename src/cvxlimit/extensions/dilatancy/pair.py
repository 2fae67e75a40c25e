"""The two convex problems whose common answers are the solutions without dilatancy.

Take admissible forces x with the load factor alpha, and a mechanism u of live power 1 whose joints
do not penetrate. Their *loss* is what friction and cohesion dissipate, less the power of the loads:

    Phi(x, u) = sum over contacts of (mu N + c A) sigma - dead . u - alpha,
    sigma     = max(|slip|, c_T |twist|).

===========  ===============================================  =====  ===========================
letter       what it is                                       shape  in the code
===========  ===============================================  =====  ===========================
N            compression, positive under pressure             (n,)   forces[:, COLUMN["N"]]
mu, c, A     friction coefficient, cohesion, area             (n,)   contacts.friction and so on
c_T          torsion arm (Eq. 16)                             (n,)   contacts.torsion_arm
slip, twist  relative rates along t1 and t2, and about n      (n,)   statics.relative_rates
p            price: the opening that dilatancy would add      (n,)   Pair.dilatancy
===========  ===============================================  =====  ===========================

The loss is never negative, and zero exactly where x and u are a solution. Two convex problems on
one pattern lower it in turn. For fixed x the least loss over u is the load factor with friction
held at the compressions of x (:mod:`.tresca`), less alpha. For fixed u the least loss over x is at
the largest alpha - sum of p N, with the price p = mu sigma. The forces x belong to a solution if
and only if the load factor with their friction held is their own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.convex import ConvexSearch
from cvxlimit.methods.driver import Run
from cvxlimit.model.formulations import corner_compressions, times
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LARGEST_FACTOR, Goal, Stated
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.tresca import HeldFlow, HeldFormulation, tresca
from cvxlimit.reductions.choice import Reductions
from cvxlimit.solvers import LimitState, SolverSettings, ladder_for
from cvxlimit.surfaces.coulomb import needed_surfaces


@dataclass(frozen=True, eq=False)
class Priced:
    """The goal to maximise the load factor less compressions times their ``price`` (n,), the factor
    being ``most`` at most. Both are scaled as the problem is."""

    price: cp.Parameter
    most: cp.Parameter

    def __call__(self, stated: Stated) -> Any:
        stated.into.nonneg(-1.0 * (stated.factor - self.most))
        return stated.factor - np.ones(self.price.size) @ times(self.price, stated.forces["N"])


ETA, WEIGHT = 0.01, 0.6
"""How far Gilbert's cones are rotated beyond the vertical, and the weight of new compressions in
those that they are rotated about, as published (Gilbert, Casapulla and Ahmed 2006)."""

ROTATIONS = 30
"""Of his iterates from one start: 24 to 29 settle on two rings of 8 to 24 voussoirs."""

FINE = 1e-8
"""Tolerance of his problems, below any change at which the scheme stops."""

_NO_CAP = 100.0
"""Stands for no cap on the scaled load factor, that is so many times the weight of the blocks: all
that is priced has a finite optimum then, and solvers are not slowed down."""


class Reduced:
    """The smallest model of a run that has the same solutions.

    It takes the reductions of the ``search`` for the associated load factor where that is given. A
    mirror plane is used only if ``is_symmetric``, where a symmetric answer will do: without
    dilatancy a symmetric structure may fall on one side.

    Attributes
    ----------
    kept : (k,) int array
        Contacts that the model has, out of n.
    lift : (n, k) matrix
        Maps compressions of the kept contacts to those of all.
    """

    def __init__(
        self, run: Run, search: ConvexSearch | None = None, is_symmetric: bool = False
    ) -> None:
        self.surfaces = needed_surfaces(run.surfaces)
        if search is None:
            reductions = Reductions.of(run.assemblage, self.surfaces, model=run.model)
        else:
            reductions = search.reductions
        reductions = reductions if is_symmetric else replace(reductions, mirror=None)
        self.assemblage, state = reductions.assemblage, None
        # Unloaded parts may be left out only if a state of theirs carries their dead load.
        if reductions.loaded is not None:
            own = search.certifier if search else Certifier(reductions.assemblage, self.surfaces)
            state = own.references.easy_dead_state
        self.reduction = reductions.best(state)
        # Compressions of all contacts from those: the rows and columns of N in the map of forces.
        n, lift, at = len(run.contacts), self.reduction.forces, COLUMN["N"]
        self.kept = self.reduction.kept
        each = slice(at, None, len(COMPONENTS))
        self.lift = sp.eye_array(n, format="csr") if lift is None else lift[each][:, each].tocsr()

    def problem(self, goal: Goal = LARGEST_FACTOR) -> LimitProgram:
        """Returns the problem with friction as it is."""
        return LimitProgram(self.assemblage, self.surfaces, reduction=self.reduction, goal=goal)

    def held(self, pressed: cp.Parameter, tilt: float = 0.0) -> LimitProgram:
        """Returns the problem with friction held at compressions (k,) of the kept contacts;
        ``tilt`` as in :func:`~.tresca.held`."""
        reduction, own = self.reduction, self.reduction.formulation
        if own is not corner_compressions:
            reduction = replace(reduction, formulation=HeldFormulation(own, pressed, tilt))
        surfaces = tresca(self.surfaces, pressed, tilt)
        return LimitProgram(self.assemblage, surfaces, reduction=reduction)


class Pair:
    """Both problems of a run on the smallest model, each starting from its last answer.

    Attributes
    ----------
    solved : int
        How many problems were solved.
    slip : HeldFlow
        The flow rule of resultants with friction held.
    has_cones : bool
        Whether friction, or anything else on the smallest model, is no linear limit.
    """

    def __init__(
        self, run: Run, search: ConvexSearch | None = None, is_symmetric: bool = False
    ) -> None:
        self.run, self.solved = run, 0
        with run.clock.phase("compile"):
            self._reduced = reduced = Reduced(run, search, is_symmetric)
            self._kept, self._lift = reduced.kept, reduced.lift
            self.slip = HeldFlow(reduced.surfaces, run.assemblage.contacts)
            k = len(self._kept)
            goal = Priced(cp.Parameter(k, name="price"), cp.Parameter(name="most"))
            self._pressed = cp.Parameter(k, name="pressed")
            self._priced = reduced.problem(goal).at({"most": 1.0})
            self._held = reduced.held(self._pressed)
            self.has_cones = self._priced.shape.cones > 0

    def priced(self, price: FloatArray, tolerance: float, cap: float = np.inf) -> LimitState:
        """Solves for the largest load factor, up to a ``cap``, less prices (n,) times compressions,
        and returns the state."""
        unit = self.run.scaling.load_factor(1.0)
        scaled = self.run.scaling.live * (self._lift.T @ price)
        problem = self._priced.at({"most": min(cap / unit, _NO_CAP), "price": scaled})
        state, settings = self._solved(problem, tolerance)
        self.run.note(state, f"{settings}, compressions priced")
        return state

    def held(self, pressed: FloatArray, tolerance: float) -> LimitState:
        """Solves with friction held at compressions (n,), and returns the state with its load
        factor and mechanism."""
        problem = self._held.at({"pressed": np.maximum(pressed, 0.0)[self._kept]})
        state, settings = self._solved(problem, tolerance)
        self.run.note(replace(state, load_factor=None), f"{settings}, friction held")
        return state

    def rotated(self, state: LimitState | None, most: int, change: float) -> LimitState | None:
        """Takes Gilbert's iterates from a state, and returns the last: ``most`` of them, or until
        the load factor changes by no more than that share. Cones are rotated about compressions
        that follow the problem's own, damped. Returns None without a state, or if
        a solve fails."""
        if state is None:
            return None
        about = pressed(state)
        for _ in range(min(most, ROTATIONS)):
            before = state.load_factor
            inside = (1.0 + ETA) * np.maximum(about, 0.0)[self._kept]
            state, settings = self._solved(self._rotated.at({"pressed": inside}), FINE)
            self.run.note(replace(state, load_factor=None), f"{settings}, cones rotated")
            if state.forces is None or state.load_factor is None:
                return None
            about = about + WEIGHT * (pressed(state) - about)
            if before is not None and abs(state.load_factor - before) <= change * abs(before):
                break
        return state

    @cached_property
    def _rotated(self) -> LimitProgram:
        return self._reduced.held(self._pressed, ETA)

    def _solved(self, problem: LimitProgram, tolerance: float) -> tuple[LimitState, SolverSettings]:
        self.solved += 1
        return self.run.try_solvers(problem.run, self.run.ladder or ladder_for("pairs", tolerance))

    def dilatancy(self, mechanism: FloatArray) -> FloatArray:
        """Returns the price (n,) of a mechanism (free, 6): the opening that dilatancy would add to
        it at live power 1."""
        statics = self.run.assemblage.statics
        unit = mechanism / float(statics.live @ mechanism.ravel())
        return self.slip.dilatancy(self.slip.shortfall(statics.relative_rates(unit)))


def pressed(state: LimitState) -> FloatArray:
    """Returns the compressions (n,) of a state that has forces."""
    assert state.forces is not None
    return state.forces[:, COLUMN["N"]]
