"""Members of the set of zero-dilatancy solutions: how they are checked, and the ways between them.

A member is a load factor, forces and a mechanism. Of the forces that go with a mechanism the lowest
and the highest load factor are one convex problem, and so is a mechanism that goes with forces:
from one to the other leads down to low members.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cvxpy as cp
import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.complementarity import FrictionSystem
from cvxlimit.methods.driver import Run
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.flow import FlowRule, corner_openings
from cvxlimit.model.formulations import ForceVariables
from cvxlimit.model.problem import LimitProblem, Terms
from cvxlimit.model.statics import DOF
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solution import Member
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.solvers.running import run as run_solver


@dataclass(frozen=True)
class _Numbers:
    """What each number is for, and where it was measured."""

    price: float = 1000.0
    """Of power on a mechanism, in scaled load factors: a penalty that is exact once it exceeds the
    multiplier; solutions are checked in any case."""
    nudge: float = 0.02
    """Size of random costs of normal forces, in load factors per total load."""
    little: float = 0.001
    """Size of random costs, beside power at ``price``."""


_N = _Numbers()


class Verifier:
    """Checks of zero-dilatancy solutions in NumPy, outside any solver.

    Only friction does not open joints: rates to which the opening that goes with their slip is
    added must be those of the associated flow rule, under which stone crushes, mortar tears and
    ties yield. What strength takes up of power is known from these rates, and forces must do it.

    Parameters
    ----------
    run : Run
        Whose scene and surfaces are meant.
    """

    def __init__(self, run: Run) -> None:
        self.assemblage = run.assemblage
        self.contacts = run.assemblage.contacts
        self.flow = FlowRule(run.surfaces, self.contacts)
        self.certifier = Certifier(run.assemblage, run.surfaces)
        self.strength = self.certifier.strength

    def dilatancy(self, rates: FloatArray) -> FloatArray:
        """Opening (n,) that the associated flow rule would go with slip and twist of (n, 6)."""
        missing = self.flow.shortfall(rates).missing
        opening = self.contacts.corner_minimum(corner_openings(rates, self.contacts))
        return np.maximum(missing + opening, 0.0)

    def member(self, state: LimitState, start: str, iterations: int) -> Member | None:
        """A solver's answer with all its residuals; None if there are no forces or rates.

        Forces are put into equilibrium first, the mechanism is scaled to live power 1.
        """
        given, alpha = self.certifier.given(state), state.load_factor
        if given is None or state.mechanism is None or alpha is None:
            return None
        statics = self.assemblage.statics
        balanced = self.strength.balanced(given, alpha, statics)
        live = float(statics.live @ state.mechanism.ravel())
        if not live > 0.0:
            return None
        mechanism = state.mechanism / live
        rates = statics.relative_rates(mechanism)
        openings = corner_openings(rates, self.contacts)
        forces = self.strength.forces(balanced)
        power = (forces * self.work(rates)).sum(axis=1)
        penetration, lost = self._flow(rates, openings, power)
        certificate = self.certifier.certificate(balanced, alpha, None)
        unit = max(abs(alpha), self.assemblage.scaling.least)
        return Member(
            load_factor=alpha,
            start=start,
            iterations=iterations,
            equilibrium=certificate.equilibrium_residual,
            yield_excess=certificate.yield_excess,
            flow=penetration / max(np.abs(openings).max(), np.abs(rates[:, :2]).max()),
            complementarity=lost / unit,
            forces=forces,
            mechanism=mechanism,
        )

    def _flow(
        self, rates: FloatArray, openings: FloatArray, power: FloatArray
    ) -> tuple[float, float]:
        if self.strength.is_internal:
            found = self.strength.flow.shortfall(self.work(rates))
            return max(float(found.missing.max()), 0.0), abs(float(power.sum()) + found.dissipation)
        penetration = np.maximum(-self.contacts.corner_minimum(openings), 0.0)
        taken_up = self.contacts.cohesion * self.contacts.area * self._gauge(rates)
        return float(penetration.max()), float(np.abs(power + taken_up).sum())

    def work(self, rates: FloatArray) -> FloatArray:
        """(n, 6): times forces, their power on ``rates`` and what friction takes up of it."""
        result = rates.copy()
        result[:, COLUMN["N"]] += self.dilatancy(rates)
        return result

    def _gauge(self, rates: FloatArray) -> FloatArray:
        mu = self.contacts.friction
        return np.where(mu > 0.0, self.dilatancy(rates) / np.where(mu > 0.0, mu, 1.0), 0.0)


@dataclass(frozen=True, eq=False)
class _OnMechanism:
    """Plus or minus the load factor, less the power that forces have on a mechanism.

    ``power`` (n, 6) is linear in forces: what contacts do, and friction takes up. Not negative, and
    zero for forces that go with the mechanism. ``chance`` (n,) is a little cost of normal forces.
    Parameters, scaled like the load factor.
    """

    sign: float
    power: cp.Parameter
    chance: cp.Parameter

    def terms(self, assemblage: Assemblage, forces: ForceVariables, alpha: cp.Variable) -> Terms:
        dead, live = assemblage.scaled.dead, alpha * assemblage.scaled.live
        total = sum(
            self.power[:, column] @ forces.components[name] for name, column in COLUMN.items()
        )
        little = self.chance @ forces.components["N"]
        return Terms(self.sign * alpha - _N.price * total - little, dead, live)


class ExtremeForces:
    """The lowest or highest load factor among forces that a mechanism goes with.

    Parameters
    ----------
    run : Run
    verifier : Verifier
    sign : float
        -1 for the lowest, 1 for the highest.
    """

    def __init__(self, run: Run, verifier: Verifier, sign: float) -> None:
        self.run, self.verifier = run, verifier
        self.power = cp.Parameter((len(run.contacts), len(COMPONENTS)))
        self.chance = cp.Parameter(len(run.contacts), nonneg=True)
        objective = _OnMechanism(sign, self.power, self.chance)
        self.problem = LimitProblem(run.assemblage, run.surfaces, objective=objective)

    def on(
        self,
        mechanism: FloatArray,
        ladder: Sequence[SolverSettings],
        random: np.random.Generator | None = None,
    ) -> tuple[LimitState, SolverSettings]:
        """Forces on a mechanism (free blocks, 6), which the state keeps, and what found them.

        With ``random``, some that are nearly extreme: as few contacts pressed as chance prefers.
        """
        n = len(self.run.contacts)
        self.chance.value = (
            np.zeros(n) if random is None else _N.nudge * random.uniform(size=n) ** 2
        )
        rates = self.run.assemblage.statics.relative_rates(mechanism)
        self.power.value = self.run.scaling.live * self.verifier.work(rates)
        state, rung = self.run.try_solvers(self.problem.solve, ladder)
        return replace(state, mechanism=mechanism), rung


class MechanismsOfForces:
    """Mechanisms that go with given forces: as few contacts opening and sliding as chance prefers.

    min  (random costs of openings and slips) + power of the forces on the mechanism,
    openings >= 0, slips <= multipliers, live power 1:  for linear yield surfaces a vertex, which
    moves so little that other forces go with it as well.

    Parameters
    ----------
    system : FrictionSystem
    seed : int
        Of the random costs.
    """

    def __init__(self, system: FrictionSystem, seed: int) -> None:
        self.system, self.random = system, np.random.default_rng(seed)
        rates, live = system.matrix.T.tocsr(), system.assemblage.scaled.live
        motion = cp.Variable(len(live))
        n = len(system.assemblage.contacts)
        slid = cp.Variable(n)
        opening = (system.corner @ rates) @ motion
        slips = [(system.slid[k::3] @ rates) @ motion for k in range(3)]
        self._motion = motion
        self._on_opening = cp.Parameter(system.corner.shape[0], nonneg=True)
        self._on_slid = cp.Parameter(n, nonneg=True)
        self._on_slips = [cp.Parameter(n) for _ in slips]
        cost = self._on_opening @ opening + self._on_slid @ slid
        cost += sum(price @ slip for price, slip in zip(self._on_slips, slips, strict=True))
        limits = [
            opening >= 0.0,
            cp.SOC(slid, cp.vstack(slips[:2]), axis=0),
            slid >= slips[2],
            slid >= -slips[2],
            live @ motion == 1.0,
        ]
        self._problem = cp.Problem(cp.Minimize(cost), limits)

    def of(self, state: LimitState, settings: SolverSettings) -> FloatArray | None:
        """One mechanism (free blocks, 6); None if the solver finds none."""
        inner = self.system.scaled_forces(state)
        pressed = np.maximum(self.system.corner @ inner, 0.0)
        self._on_opening.value = _N.price * pressed + self._chance(len(pressed))
        limit = np.maximum(self.system.limit @ inner + self.system.cohesion, 0.0)
        self._on_slid.value = _N.price * limit + self._chance(len(limit))
        for k, price in enumerate(self._on_slips):
            price.value = _N.price * (self.system.slid[k::3] @ inner)
        outcome = run_solver(self._problem, settings)
        if not outcome.has_values or self._motion.value is None:
            return None
        motion = np.asarray(self._motion.value).reshape(-1, DOF)
        return self.system.assemblage.scaling.mechanism(motion)

    def _chance(self, count: int) -> FloatArray:
        return _N.little * self.random.uniform(0.0, 1.0, count) ** 2
