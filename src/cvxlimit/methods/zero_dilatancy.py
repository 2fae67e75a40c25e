"""Friction that slides without opening: De Saxce's fixed point, and the members of its set.

With zero dilatancy there is no single load factor: a solution is a load factor with forces in
equilibrium that yield nowhere, and a mechanism that opens nowhere by sliding, on which friction
opposes slip and pressed contacts do not open. Every such solution is admissible in the associated
model as well, whose load factor is hence an upper bound; nothing is known about the lowest one but
that none lower was found.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.bracket import rounded
from cvxlimit.checks import count, ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods.central_path import CentralPath
from cvxlimit.methods.complementarity import FrictionSystem, has_equations
from cvxlimit.methods.convex import dead_load_falls
from cvxlimit.methods.driver import Answer, Method, Run, Steps
from cvxlimit.methods.solution_set import ExtremeForces, MechanismsOfForces, Verifier
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import ForceVariables
from cvxlimit.model.problem import LimitProblem, Terms
from cvxlimit.solution import Member, Status
from cvxlimit.solvers import LimitState, SolverSettings, clarabel_at


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


@dataclass(frozen=True)
class _Numbers:
    """What each number is for, and where it was measured."""

    natural: float = 4.0
    """Largest random price where no iterate has told its size yet, over friction at a rate at which
    the whole live load does power 1: blocks that wedge each other need some price to have a
    solution."""
    scales: tuple[float, ...] = (30.0, 5.0, 1.0)
    """Random prices over the last iterate's largest, in turn: on a wall of six blocks whose
    solutions a mixed-integer search knows, only prices far above found the lowest branch."""
    polish: int = 10
    """Iterates between attempts to solve the equations of the fixed point from where it is: an
    attempt takes as long as about five iterates."""
    widths: tuple[float, ...] = (0.1, 1.0)
    """How far from an iterate paths begin, in turn: near ones keep to its branch, far ones arrive
    more often."""
    steps: int = 400
    """Most steps of a path, each of which takes 0.02 (dome) to 0.14 (panel S12) of a first conic
    solve; of the paths that arrive most need 80 to 360."""
    promising: float = 100.0
    """Residual over the tolerance up to which a path's end is polished."""
    walk: int = 6
    """Steps of a walk between mechanisms and forces before it begins again at the lowest member."""


_N = _Numbers()


@dataclass(frozen=True)
class ZeroDilatancy(Method):
    """De Saxce's fixed point from several starts, and a search for low members from there.

    Each iterate maximises the load factor less a price on normal forces; the price follows the
    dilatancy of the mechanism. Now and then the fixed point's equations are solved from where it is
    (:mod:`~cvxlimit.methods.complementarity`). A start has come to an end when equilibrium, yield,
    flow and complementarity, recomputed outside the solver, are within the tolerance. On the
    mechanism of each solution the forces with the lowest and the highest load factor are sought;
    then, from the lowest, a mechanism that goes with its forces, the lowest forces on that, and so
    on. What passes the same checks is a solution as well.

    With surfaces other than the cone of Eq. 24, whose equations are not stated, the fixed point is
    on its own, and low members are sought on the mechanisms of the starts only.

    Attributes
    ----------
    tolerance : float
        Largest residual of a solution.
    starts : int
        The first is the associated solution, the others are random prices.
    damping : float
        Weight of the new price against the old one.
    max_iterations : int
        Per start.
    seed : int
        Of the random prices and mechanisms.
    descents : int
        Mechanisms tried on the way down; 0 for none.
    """

    name = "zero-dilatancy"
    axis = "flow"

    tolerance: float = 1e-6
    starts: int = 4
    damping: float = 0.8
    max_iterations: int = 150
    seed: int = 0
    descents: int = 24

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        count(self.starts, 1, "starts")
        if not 0.0 < self.damping <= 1.0:
            raise ModelError(f"damping must be above 0 and at most 1, got {self.damping!r}")
        count(self.max_iterations, 1, "max_iterations")
        count(self.descents, 0, "descents")

    def steps(self, run: Run) -> Steps:
        """Iterates of all starts, extremes on the mechanisms found, then tries further down."""
        if dead_load_falls(run):
            return Status.DEAD_LOAD_UNSTABLE
        return (yield from _Search(self, run).steps())


Found = tuple[Member, LimitState]


class _Search:
    """Starts under way, and the solutions found."""

    def __init__(self, rule: ZeroDilatancy, run: Run) -> None:
        self.rule, self.run = rule, run
        self.found: list[Found] = []
        self.associated: float | None = None
        self.typical: FloatArray | None = None
        self.failed = self.tried = 0
        with run.clock.phase("compile"):
            self.price = cp.Parameter(len(run.contacts), nonneg=True)
            objective = PricedPressure(self.price)
            self.problem = LimitProblem(run.assemblage, run.surfaces, objective=objective)
            self.verifier = Verifier(run)
            is_known = has_equations(run.surfaces) and not self.verifier.strength.is_internal
            self.system = FrictionSystem(run.assemblage) if is_known else None
            self.path = None if self.system is None else CentralPath(self.system)
            self.lowest = ExtremeForces(run, self.verifier, -1.0)
            self.highest = ExtremeForces(run, self.verifier, 1.0)
        self.random = np.random.default_rng(rule.seed)
        self.ladder: tuple[SolverSettings, ...] = run.ladder or _LADDER

    def steps(self) -> Steps:
        prices = np.zeros(len(self.run.contacts))
        for start in range(self.rule.starts):
            label = "associated" if start == 0 else f"random {start}"
            found = yield from self._iterated(start, label, prices)
            self.failed += found is None
            if found is not None:
                self._keep(found)
            prices = self._drawn(_N.scales[(start + 1) % len(_N.scales)])
        for member in [member for member, _ in self.found]:
            for extreme, which in ((self.lowest, "lowest"), (self.highest, "highest")):
                label = f"{which} on the mechanism of {member.start}"
                found = self._on(extreme, member.mechanism, label)
                if found is not None:
                    self._keep(found)
                yield
        yield from self._descents()
        self._report()
        return Status.CONVERGED if self.found else Status.NOT_CONVERGED

    def _keep(self, found: Found) -> None:
        self.found.append(found)
        self._report()

    def _drawn(self, scale: float) -> FloatArray:
        friction, live = self.run.contacts.friction, self.run.scaling.live
        natural = _N.natural * float(friction.max()) / live
        size = scale * (natural if self.typical is None else float(np.max(self.typical)))
        return size * self.random.uniform(0.0, 1.0, len(friction)) ** 2

    def _iterated(
        self, start: int, label: str, prices: FloatArray
    ) -> Generator[None, None, Found | None]:
        w = self.rule.damping
        for iteration in range(1, self.rule.max_iterations + 1):
            self.price.value = self.run.scaling.live * prices
            state, rung = self.run.try_solvers(self.problem.solve, self.ladder)
            member = self.verifier.member(state, label, iteration)
            self.run.note(state, rung, change=None if member is None else member.residual)
            if start == 0 and iteration == 1:
                self.associated = state.load_factor
            if member is None:
                return None
            if iteration % _N.polish == 0:
                member, state = self._polished(member, state)
                member, state = self._followed(member, state, (start, iteration))
            self._report(member)
            rates = self.run.assemblage.statics.relative_rates(member.mechanism)
            self.typical = self.verifier.dilatancy(rates)
            if member.residual <= self.rule.tolerance:
                return member, state
            prices = (1.0 - w) * prices + w * self.typical
            yield
        return None

    def _polished(self, member: Member, state: LimitState) -> tuple[Member, LimitState]:
        if self.system is None or state.internal is None:
            return member, state
        with self.run.clock.phase("solve"):
            near = self.system.polished(state)
        found = self.verifier.member(near, member.start, member.iterations)
        if found is None or found.residual >= member.residual:
            return member, state
        return found, near

    def _followed(self, member: Member, state: LimitState, at: tuple[int, int]) -> Found:
        if self.path is None or state.internal is None or member.residual <= self.rule.tolerance:
            return member, state
        width = _N.widths[(at[1] // _N.polish - 1) % len(_N.widths)]
        random = np.random.default_rng((self.rule.seed, *at))
        with self.run.clock.phase("solve"):
            end = self.path.followed(state, width, random, _N.steps)
        found = self.verifier.member(end, member.start, member.iterations)
        if found is None or found.residual >= member.residual:
            return member, state
        if self.rule.tolerance < found.residual <= _N.promising * self.rule.tolerance:
            return self._polished(found, end)
        return found, end

    def _descents(self) -> Steps:
        if self.system is None or not self.found:
            return Status.NOT_CONVERGED
        with self.run.clock.phase("compile"):
            mechanisms = MechanismsOfForces(self.system, self.rule.seed)
        walk: Found | None = None
        for tried in range(self.rule.descents):
            lowest = min(self.found, key=lambda found: found[0].load_factor)
            walk = lowest if walk is None or tried % _N.walk == 0 else walk
            self.tried += 1
            with self.run.clock.phase("solve"):
                mechanism = mechanisms.of(walk[1], self.ladder[0])
            if mechanism is None:
                walk = None
                continue
            chance = self.random if tried % 2 else None
            step = self._on(self.lowest, mechanism, f"descent {self.tried}", chance)
            yield
            if step is None:
                continue
            walk = step
            if step[0].load_factor < lowest[0].load_factor:
                self._keep(step)
        return Status.CONVERGED

    def _on(
        self,
        extreme: ExtremeForces,
        mechanism: FloatArray,
        label: str,
        chance: np.random.Generator | None = None,
    ) -> tuple[Member, LimitState] | None:
        state, rung = extreme.on(mechanism, self.ladder, chance)
        member = self.verifier.member(state, label, 1)
        note = None if member is None else member.residual
        self.run.note(state, f"{rung}, {label}", change=note)
        if member is not None and member.residual > self.rule.tolerance:
            member, state = self._polished(member, state)
        is_good = member is not None and member.residual <= self.rule.tolerance
        return (member, state) if member is not None and is_good else None

    def _report(self, last: Member | None = None) -> None:
        members = sorted((member for member, _ in self.found), key=lambda m: m.load_factor)
        best = members[0] if members else None if self.associated is None else last
        above = "" if self.associated is None else (
            f"; associated friction, {rounded(self.associated)}, bounds all of them from above"
        )  # fmt: skip
        tried = f"{self.rule.starts - self.failed} of {self.rule.starts} starts"
        if members:
            span = " to ".join(rounded(m.load_factor) for m in (members[0], members[-1]))
            further = f" and {self.tried} tries further down" if self.tried else ""
            remark = (
                f"{len(members)} zero-dilatancy solutions from {span}, "
                f"from {tried}{further}{above}; whether there are lower ones is not known"
            )
        elif self.associated is None:
            remark = f"{_NO_ASSOCIATED}; none was found from {tried}"
        else:
            residual = "" if best is None else f", last residual {best.residual:.1e}"
            remark = f"no zero-dilatancy solution was found from {tried}{residual}{above}"
        self.run.remarks = [remark]
        if best is not None:
            self.run.best = Answer(
                best.load_factor, self.run.best.bracket, best.forces, best.mechanism, tuple(members)
            )


_NO_ASSOCIATED = (
    "associated friction has no largest load factor here, which would bound zero-dilatancy "
    "solutions from above: solve with flow 'associated' first, it says why"
)

_LADDER = clarabel_at(1e-10, 1e-8)
"""Residuals below 1e-6 of the load factor take rates and forces to 1e-8 or better."""
