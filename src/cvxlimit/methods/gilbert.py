"""Gilbert's scheme for friction without dilatancy: cones rotated about the last normal forces.

Gilbert, Casapulla and Ahmed (2006) solve associated problems whose friction hardly grows with the
normal force N,

    abs(V) + abs(MT) / c_T <= c0 + (1 + eta) mu N_k - eta mu N,

so that sliding closes joints by a little instead of opening them, and move N_k towards the normal
forces found. Here beside De Saxce's fixed point, for comparison.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.bracket import rounded
from cvxlimit.checks import count, positive, ratio
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.driver import Answer, Rule, Run, check_dry
from cvxlimit.model.problem import LimitProblem
from cvxlimit.solution import Status
from cvxlimit.solvers import LimitState, SolverSettings, clarabel_at
from cvxlimit.surfaces import Condition, Norm, Rocking, YieldSurface
from cvxlimit.surfaces.base import CONSTANT
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.presets import DEFAULT_SURFACES

FloatArray = NDArray[np.float64]

_LADDER = clarabel_at(1e-8, 1e-6)


class RotatedCones(YieldSurface):
    """abs(V) + abs(MT) / c_T <= held - eta mu N, with ``held`` (n,) an array or a Parameter."""

    name = "rotated cones"

    def __init__(self, held: FloatArray | cp.Parameter, eta: float, cone: Cone) -> None:
        super().__init__(cone)
        self.held, self.eta = held, eta

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        norms = [Norm({"MT": 1 / contacts.torsion_arm}), Norm({"V1": 1}, {"V2": 1})]
        return [Condition(norms, {"N": -self.eta * contacts.friction, CONSTANT: self.held})]


@dataclass(frozen=True)
class Gilbert(Rule):
    """Gilbert's scheme, with what its answer is worth.

    It stops when the load factor does not change any more, as published, which says nothing about
    Coulomb's law at the normal forces found: that is checked outside the solver, and an answer
    whose forces exceed it is not called converged.

    Attributes
    ----------
    tolerance : float
        Change of the load factor, relative, at which it stops.
    excess : float
        By how much Coulomb's law may be exceeded in an answer, over the mean weight of a block.
    eta : float
        How far cones are rotated beyond the vertical.
    weight : float
        Of the new normal forces against the old ones.
    cohesion : float
        Fictitious, a force per contact over the mean weight of a block.
    most : int
        Iterations.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> solution = solve(builtin_scene("ferris-tin-loi-1"), flow="gilbert")
    >>> round(solution.load_factor, 2)  # published: 0.639918
    0.64
    """

    name = "none"

    tolerance: float = 1e-3
    excess: float = 1e-2
    eta: float = 0.01
    weight: float = 0.6
    cohesion: float = 1e-5
    most: int = 200

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        positive(self.excess, "excess")
        positive(self.eta, "eta")
        if not 0.0 < self.weight <= 1.0:
            raise ModelError(f"weight must be above 0 and at most 1, got {self.weight!r}")
        positive(self.cohesion, "cohesion")
        count(self.most, 1, "most")

    def start(self, run: Run) -> _Scheme:
        """The associated problem, and the one problem of all iterates."""
        run.flow = "gilbert"
        check_dry(run, "Gilbert's scheme")
        if np.any(run.contacts.cohesion):
            raise ModelError("Gilbert's scheme brings its own cohesion: take it out of the scene")
        if {type(s) for s in run.surfaces} != {type(s) for s in DEFAULT_SURFACES}:
            raise ModelError("Gilbert's scheme goes with surface 'conic' or facets, as a name")
        return _Scheme(self, run)

    def step(self, run: Run, state: _Scheme) -> _Scheme:
        """One convex problem."""
        state.advance()
        return state

    def is_done(self, run: Run, state: _Scheme) -> Status | None:
        """When the load factor has settled; whether that is an answer, Coulomb's law decides."""
        return state.status

    def result(self, run: Run, state: _Scheme) -> Answer:
        """The last iterate and by how much it exceeds Coulomb's law; no bracket."""
        return state.answer()


@dataclass
class _Scheme:
    """Normal forces under way."""

    rule: Gilbert
    run: Run
    status: Status | None = None
    pressure: FloatArray | None = None
    factors: list[float] = field(default_factory=list)
    last: LimitState | None = None
    excess: float = np.inf

    def __post_init__(self) -> None:
        run = self.run
        with run.clock.phase("compile"):
            self.held = cp.Parameter(len(run.contacts))
            rotated = RotatedCones(self.held, self.rule.eta, run.surfaces[-1].cone)
            self.first = LimitProblem(run.assemblage, run.surfaces)
            self.problem = LimitProblem(run.assemblage, (Rocking(), rotated))
        dead = run.scene.dead_forces[:, :3]
        self.unit = float(np.linalg.norm(dead, axis=1).mean())

    def advance(self) -> None:
        """The associated problem first, then one with cones rotated about its normal forces."""
        state, rung = self._solved()
        forces = state.forces
        if forces is None or state.load_factor is None:
            self.run.note(state, rung)
            self.status = Status.NOT_CONVERGED
            return
        self.last = state
        over = [y.max() for s in self.run.surfaces for y in s.excess(forces, self.run.contacts)]
        self.excess = max(float(max(over)), 0.0) / self.unit
        pressed = forces[:, COLUMN["N"]]
        w = self.rule.weight
        before = self.pressure
        self.pressure = pressed if before is None else (1.0 - w) * before + w * pressed
        self.factors.append(state.load_factor)
        self.run.note(state, rung, change=self._change)
        change = self._change
        if len(self.factors) > 2 and change is not None and change <= self.rule.tolerance:
            is_good = self.excess <= self.rule.excess
            self.status = Status.CONVERGED if is_good else Status.NOT_CONVERGED
        elif len(self.factors) > self.rule.most:
            self.status = Status.NOT_CONVERGED

    def _solved(self) -> tuple[LimitState, SolverSettings]:
        problem = self.first
        if self.pressure is not None:
            friction = self.run.contacts.friction
            held = (1.0 + self.rule.eta) * friction * self.pressure
            self.held.value = held + self.rule.cohesion * self.unit
            problem = self.problem
        return self.run.try_solvers(problem.solve, self.run.ladder or _LADDER)

    @property
    def _change(self) -> float | None:
        if len(self.factors) < 2:
            return None
        before, now = self.factors[-2:]
        return abs(now - before) / self.run.scaling.unit(now)

    def answer(self) -> Answer:
        """The last iterate, and what it is worth."""
        if self.last is None:
            return Answer(note="no solver found forces")
        note = (
            f"Gilbert's scheme after {len(self.factors)} problems, last change "
            f"{self._change or 1.0:.1e}: Coulomb's law is exceeded by "
            f"{self.excess:.2g} mean block weights; associated friction gives "
            f"{rounded(self.factors[0])}"
        )
        last = self.last
        return Answer(
            load_factor=last.load_factor,
            forces=last.forces,
            mechanism=last.mechanism,
            note=note,
        )
