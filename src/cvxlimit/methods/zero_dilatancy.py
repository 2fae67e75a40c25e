"""Friction that slides without opening: De Saxce's fixed point, and what is checked of it.

With zero dilatancy there is no single load factor: a solution is a load factor with forces in
equilibrium that yield nowhere, and a mechanism that opens nowhere by sliding, on which friction
opposes slip and pressed contacts do not open. Every such solution is admissible in the associated
model as well, whose load factor is hence an upper bound; nothing is known about the lowest one but
that none lower was found.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.bracket import rounded
from cvxlimit.checks import count, ratio
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.complementarity import FrictionSystem, has_equations
from cvxlimit.methods.driver import Answer, Rule, Run
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.flow import FlowRule, corner_openings
from cvxlimit.model.formulations import ForceVariables, corner_compressions
from cvxlimit.model.problem import LimitProblem, Terms
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solution import Member, Status
from cvxlimit.solvers import LimitState, SolverSettings, settings_for

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PricedPressure:
    """The load factor less a price on every contact's normal force; an objective.

    At its solution contacts slide as the flow rule says, but for an opening by the price: with the
    price that dilatancy would open, they slide without. The price is a Parameter, so that one
    compiled problem serves all iterates.
    """

    price: cp.Parameter

    def terms(self, assemblage: Assemblage, forces: ForceVariables, alpha: cp.Variable) -> Terms:
        """See :class:`~cvxlimit.model.problem.Objective`."""
        dead, live = assemblage.scaled.dead, alpha * assemblage.scaled.live
        return Terms(alpha - self.price @ forces.components["N"], dead, live)


@dataclass(frozen=True, eq=False)
class LowestOnMechanism:
    """Minus the load factor (or plus: the highest) among forces that a mechanism goes with.

    Attributes
    ----------
    sign : float
        -1 for the lowest, 1 for the highest.
    power : (n, 6)
        Linear in forces: what contacts do on the mechanism, and friction takes up. Not negative,
        and zero for forces that go with it.
        Scaled like the load factor.
    """

    sign: float
    power: FloatArray

    def terms(self, assemblage: Assemblage, forces: ForceVariables, alpha: cp.Variable) -> Terms:
        """See :class:`~cvxlimit.model.problem.Objective`."""
        dead, live = assemblage.scaled.dead, alpha * assemblage.scaled.live
        total = sum(
            self.power[:, column] @ forces.components[name] for name, column in COLUMN.items()
        )
        return Terms(self.sign * alpha - _PRICE * total, dead, live)


_NATURAL = 4.0
"""Largest random price where no iterate has told its size yet, over friction at a rate at which the
whole live load does power 1: blocks that wedge each other need some price to have a solution."""

_POLISH = 10
"""Iterates between attempts to solve the equations of the fixed point from where it is: an attempt
takes as long as about five iterates."""

_PRICE = 1e3
"""Of power on the mechanism, in scaled load factors: a penalty that is exact once it exceeds the
multiplier; solutions are checked in any case."""


class Verifier:
    """Checks of zero-dilatancy solutions in NumPy, outside any solver.

    Parameters
    ----------
    run : Run
        Whose scene and surfaces are meant.
    """

    def __init__(self, run: Run) -> None:
        self.assemblage = run.assemblage
        self.contacts = run.contacts
        self.flow = FlowRule(run.surfaces, self.contacts)
        self.certifier = Certifier(run.assemblage, run.surfaces)

    def dilatancy(self, rates: FloatArray) -> FloatArray:
        """Opening (n,) that the associated flow rule would go with slip and twist of (n, 6)."""
        missing = self.flow.shortfall(rates).missing
        opening = self.contacts.corner_minimum(corner_openings(rates, self.contacts))
        return np.maximum(missing + opening, 0.0)

    def member(self, state: LimitState, start: str, iterations: int) -> Member | None:
        """A solver's answer with all its residuals; None if there are no forces or rates.

        Forces are put into equilibrium first, the mechanism is scaled to live power 1.
        """
        if state.forces is None or state.mechanism is None or state.load_factor is None:
            return None
        statics, alpha = self.assemblage.statics, state.load_factor
        forces = self.assemblage.balance.balanced(state.forces, alpha, statics)
        live = float(statics.live @ state.mechanism.ravel())
        if not live > 0.0:
            return None
        mechanism = state.mechanism / live
        rates = statics.relative_rates(mechanism)
        openings = corner_openings(rates, self.contacts)
        penetration = np.maximum(-self.contacts.corner_minimum(openings), 0.0)
        power = (forces * self.work(rates)).sum(axis=1)
        taken_up = self.contacts.cohesion * self.contacts.area * self._gauge(rates)
        certificate = self.certifier.certificate(forces, alpha, None)
        unit = max(abs(alpha), self.assemblage.scaling.least)
        return Member(
            load_factor=alpha,
            start=start,
            iterations=iterations,
            equilibrium=certificate.equilibrium_residual,
            yield_excess=certificate.yield_excess,
            flow=float(penetration.max() / max(np.abs(openings).max(), np.abs(rates[:, :2]).max())),
            complementarity=float(np.abs(power + taken_up).sum() / unit),
            forces=forces,
            mechanism=mechanism,
        )

    def work(self, rates: FloatArray) -> FloatArray:
        """(n, 6): times forces, their power on ``rates`` and what friction takes up of it."""
        result = rates.copy()
        result[:, COLUMN["N"]] += self.dilatancy(rates)
        return result

    def _gauge(self, rates: FloatArray) -> FloatArray:
        mu = self.contacts.friction
        return np.where(mu > 0.0, self.dilatancy(rates) / np.where(mu > 0.0, mu, 1.0), 0.0)


@dataclass(frozen=True)
class ZeroDilatancy(Rule):
    """De Saxce's fixed point from several starts, and extremes on the mechanisms found.

    Each iterate maximises the load factor less a price on normal forces; the price follows the
    dilatancy of the mechanism. A start has come to an end when equilibrium, yield, flow and
    complementarity of its iterate, recomputed outside the solver, are within the tolerance. On
    the mechanism of each solution the forces with the lowest and the highest load factor are then
    sought; what passes the same checks is a solution as well.

    Attributes
    ----------
    tolerance : float
        Largest residual of a solution.
    starts : int
        The first is the associated solution, the others are random prices.
    damping : float
        Weight of the new price against the old one.
    most : int
        Iterations per start.
    seed : int
        Of the random prices.
    """

    name = "none"

    tolerance: float = 1e-6
    starts: int = 4
    damping: float = 0.8
    most: int = 150
    seed: int = 0

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        count(self.starts, 1, "starts")
        if not 0.0 < self.damping <= 1.0:
            raise ModelError(f"damping must be above 0 and at most 1, got {self.damping!r}")
        count(self.most, 1, "most")

    def start(self, run: Run) -> _Search:
        """Compile the one problem of all iterates."""
        run.flow = "zero-dilatancy"
        if run.formulation is not corner_compressions:
            raise ModelError("zero dilatancy brings its own formulation: leave formulation out")
        if np.isfinite(run.contacts.compressive_strength).any() or np.any(run.mortar.pull):
            raise ModelError(
                "zero dilatancy knows no strength of stone or mortar yet: leave "
                "compressive_strength and tensile_strength out"
            )
        return _Search(self, run)

    def step(self, run: Run, state: _Search) -> _Search:
        """One iterate of the present start, or the extremes on one mechanism."""
        state.advance()
        return state

    def is_done(self, run: Run, state: _Search) -> Status | None:
        """When all starts and mechanisms are through."""
        return state.status

    def result(self, run: Run, state: _Search) -> Answer:
        """The lowest solution found, with all others beside it; no bracket."""
        return state.answer()


@dataclass
class _Search:
    """Starts under way, and the solutions found."""

    rule: ZeroDilatancy
    run: Run
    members: list[Member] = field(default_factory=list)
    status: Status | None = None
    associated: float | None = None
    typical: FloatArray | None = None
    at_start: int = 0
    iterations: int = 0
    last: Member | None = None
    failed: int = 0

    def __post_init__(self) -> None:
        run = self.run
        with run.clock.phase("compile"):
            self.price = cp.Parameter(len(run.contacts), nonneg=True)
            self.problem = LimitProblem(
                run.assemblage, run.surfaces, objective=PricedPressure(self.price)
            )
            self.verifier = Verifier(run)
            is_known = has_equations(run.surfaces)
            self.system = FrictionSystem(run.assemblage) if is_known else None
        self.prices = np.zeros(len(run.contacts))
        self.random = np.random.default_rng(self.rule.seed)
        self.ladder: tuple[SolverSettings, ...] = run.ladder or _LADDER
        self.waiting: list[Member] = []

    def advance(self) -> None:
        """One convex problem."""
        if self.at_start < self.rule.starts:
            self._iterate()
        elif self.waiting:
            self._seek_extremes(self.waiting.pop(0))
        else:
            self.status = Status.CONVERGED if self.members else Status.NOT_CONVERGED

    def _iterate(self) -> None:
        self.iterations += 1
        self.price.value = self.run.scaling.live * self.prices
        state, rung = self.run.climb(self.problem.solve, self.ladder)
        member = self.verifier.member(state, self._label, self.iterations)
        self.run.note(state, rung, change=None if member is None else member.residual)
        if self.at_start == 0 and self.iterations == 1:
            self.associated = state.load_factor
        if member is None:
            self._next_start(None)
            return
        if self.iterations % _POLISH == 0:
            member = self._polished(state, member)
        self.last = member
        rates = self.run.assemblage.statics.relative_rates(member.mechanism)
        wanted = self.verifier.dilatancy(rates)
        self.typical = wanted
        if member.residual <= self.rule.tolerance:
            self._next_start(member)
        elif self.iterations >= self.rule.most:
            self._next_start(None)
        else:
            w = self.rule.damping
            self.prices = (1.0 - w) * self.prices + w * wanted

    def _polished(self, state: LimitState, member: Member) -> Member:
        """The root of the equations near an iterate, where that is better."""
        if self.system is None:
            return member
        with self.run.clock.phase("solve"):
            near = self.system.polished(state)
        found = self.verifier.member(near, self._label, self.iterations)
        return member if found is None or found.residual >= member.residual else found

    @property
    def _label(self) -> str:
        return "associated" if self.at_start == 0 else f"random {self.at_start}"

    def _next_start(self, member: Member | None) -> None:
        if member is None:
            self.failed += 1
        else:
            self.members.append(member)
            self.waiting.append(member)
        self.at_start += 1
        self.iterations = 0
        natural = _NATURAL * float(self.run.contacts.friction.max()) / self.run.scaling.live
        size = natural if self.typical is None else float(np.max(self.typical))
        self.prices = size * self.random.uniform(0.0, 1.0, len(self.prices)) ** 2

    def _seek_extremes(self, member: Member) -> None:
        """Forces with the lowest and the highest load factor on one mechanism."""
        rates = self.run.assemblage.statics.relative_rates(member.mechanism)
        power = self.run.scaling.live * self.verifier.work(rates)
        for sign, which in ((-1.0, "lowest"), (1.0, "highest")):
            with self.run.clock.phase("compile"):
                problem = LimitProblem(
                    self.run.assemblage,
                    self.run.surfaces,
                    objective=LowestOnMechanism(sign, power),
                )
            state, rung = self.run.climb(problem.solve, self.ladder)
            state = replace(state, mechanism=member.mechanism)
            label = f"{which} on the mechanism of {member.start}"
            found = self.verifier.member(state, label, 1)
            note = None if found is None else found.residual
            self.run.note(state, f"{rung}, {which} on mechanism", change=note)
            if found is not None and found.residual <= self.rule.tolerance:
                self.members.append(found)

    def answer(self) -> Answer:
        """Lowest member first."""
        self.members.sort(key=lambda member: member.load_factor)
        above = "" if self.associated is None else (
            f"; associated friction, {rounded(self.associated)}, bounds all of them from above"
        )  # fmt: skip
        tried = f"{self.rule.starts - self.failed} of {self.rule.starts} starts"
        if not self.members:
            residual = "" if self.last is None else f", last residual {self.last.residual:.1e}"
            return Answer(
                load_factor=None if self.last is None else self.last.load_factor,
                forces=None if self.last is None else self.last.forces,
                mechanism=None if self.last is None else self.last.mechanism,
                note=f"no zero-dilatancy solution was found from {tried}{residual}{above}",
            )
        lowest, highest = self.members[0], self.members[-1]
        span = f"from {rounded(lowest.load_factor)} to {rounded(highest.load_factor)}"
        return Answer(
            load_factor=lowest.load_factor,
            forces=lowest.forces,
            mechanism=lowest.mechanism,
            note=(
                f"{len(self.members)} zero-dilatancy solutions {span}, from {tried}{above}; "
                "whether there are lower ones is not known"
            ),
            members=tuple(self.members),
        )


_LADDER = tuple(
    settings_for("CLARABEL", tolerance, name)
    for tolerance, name in ((1e-10, "Clarabel tight"), (1e-8, "Clarabel"))
)
"""Residuals below 1e-6 of the load factor take rates and forces to 1e-8 or better."""
