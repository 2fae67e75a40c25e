"""Friction that slides without opening: De Saxce's fixed point, and the members of its set.

A solution is a load factor with forces in equilibrium that yield nowhere, and a mechanism on which
friction opposes slip, pressed contacts do not open, and none opens by sliding. There are many; each
is admissible in the associated model as well, whose load factor is hence an upper bound.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import count, ratio
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.convex import dead_load_falls
from cvxlimit.methods.dilatancy.central_path import followed
from cvxlimit.methods.dilatancy.complementarity import FrictionSystem, has_equations
from cvxlimit.methods.driver import Answer, Method, Run, Steps
from cvxlimit.model.flow import FlowRule, corner_openings
from cvxlimit.model.goals import Stated
from cvxlimit.model.problem import LimitProblem
from cvxlimit.model.statics import DOF
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solution import Member, Status
from cvxlimit.solution.bracket import rounded
from cvxlimit.solvers import LimitState, SolverSettings, clarabel_at
from cvxlimit.solvers import run as run_solver
from cvxlimit.surfaces.base import times


@dataclass(frozen=True)
class _Numbers:
    """Only what is found, and how fast, depends on them: members are checked."""

    # largest random price, over friction at a rate at which the whole live load does power 1, where
    # no iterate has told its size: blocks that wedge each other need some to have a solution
    natural: float = 4.0
    # random prices over the last iterate's largest, in turn: only far higher ones find the lowest
    # branch of a wall whose solutions are all known
    scales: tuple[float, ...] = (30.0, 5.0, 1.0)
    polish: int = 10  # iterates between polishes, each of which takes as long as five
    # how far from an iterate paths begin: near ones keep to its branch, far ones arrive more often
    widths: tuple[float, ...] = (0.1, 1.0)
    promising: float = 100.0  # residual over the tolerance up to which a path's end is polished
    walk: int = 6  # steps between mechanisms and forces before it begins again at the lowest
    price: float = 1000.0  # of power on a mechanism, in scaled load factors: above the multiplier
    nudge: float = 0.02  # size of random costs of normal forces, in load factors per total load
    little: float = 0.001  # size of random costs beside power at that price


_N = _Numbers()


@dataclass(frozen=True)
class ZeroDilatancy(Method):
    """De Saxce's fixed point from several starts, and a search for low members from there.

    Each iterate maximises the load factor less a penalty on normal forces, which follows the
    dilatancy of the mechanism; at intervals Newton's method is started from the iterate. A solution
    is accepted if equilibrium, yield, flow and complementarity, recomputed outside the solver, are
    within the tolerance. On the mechanism of each solution the lowest and the highest load factor
    are sought; then, from the lowest, a mechanism that goes with its forces, and so on.

    With surfaces other than the cone of Eq. 24, whose equations are not stated, the fixed point is
    on its own, and low members are sought on the mechanisms of the starts only.

    Attributes
    ----------
    tolerance : float
        Largest residual of a solution.
    starts : int
        The first is the associated solution, the others have random penalties.
    damping : float
        Weight of the new penalty against the old one.
    max_iterations : int
        Per start.
    seed : int
        Of the random penalties and mechanisms.
    descents : int
        Mechanisms tried in the search for low members; 0 for none.
    """

    name = "zero-dilatancy"
    answers = "friction that slides without opening: a set of solutions, the lowest found first"
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
            shape = (len(run.contacts), len(COMPONENTS))
            self.priced = PricedForces(cp.Parameter(), cp.Parameter(shape))
            self.problem = LimitProblem(run.assemblage, run.surfaces, goal=self.priced)
            self.verifier = Verifier(run)
            is_known = has_equations(run.surfaces) and not self.verifier.strength.is_internal
            self.system = FrictionSystem(run.assemblage) if is_known else None
        self.random = np.random.default_rng(rule.seed)
        self.ladder: tuple[SolverSettings, ...] = run.ladder or _LADDER

    def steps(self) -> Steps:
        prices = np.zeros(len(self.run.contacts))
        for start in range(self.rule.starts):
            found = yield from self._iterated(start, prices)
            self.failed += found is None
            self._keep(found)
            prices = self._drawn(_N.scales[(start + 1) % len(_N.scales)])
        for member in [member for member, _ in self.found]:
            for sign, which in ((-1.0, "lowest"), (1.0, "highest")):
                label = f"{which} on the mechanism of {member.start}"
                self._keep(self._on(member.mechanism, label, sign))
                yield
        yield from self._descents()
        self._report()
        return Status.CONVERGED if self.found else Status.NOT_CONVERGED

    def _keep(self, found: Found | None) -> None:
        if found is not None:
            self.found.append(found)
            self._report()

    def _drawn(self, scale: float) -> FloatArray:
        friction, live = self.run.contacts.friction, self.run.scaling.live
        natural = _N.natural * float(friction.max()) / live
        size = scale * (natural if self.typical is None else float(np.max(self.typical)))
        return size * self.random.uniform(0.0, 1.0, len(friction)) ** 2

    def _solved(
        self, sign: float, price: FloatArray, chance: FloatArray | float = 0.0
    ) -> tuple[LimitState, SolverSettings]:
        cost = self.run.scaling.live * price
        cost[:, COLUMN["N"]] += chance
        self.priced.sign.value, self.priced.price.value = sign, cost
        return self.run.try_solvers(self.problem.run, self.ladder)

    def _iterated(self, start: int, prices: FloatArray) -> Generator[None, None, Found | None]:
        w, label = self.rule.damping, f"random {start}" if start else "associated"
        price = np.zeros(self.priced.price.shape)
        for iteration in range(1, self.rule.max_iterations + 1):
            price[:, COLUMN["N"]] = prices
            state, rung = self._solved(1.0, price)
            member = self.verifier.member(state, label, iteration)
            self.run.note(state, rung, change=None if member is None else member.residual)
            if start == 0 and iteration == 1:
                self.associated = state.load_factor
            if member is None:
                return None
            found = member, state
            if iteration % _N.polish == 0:
                found = self._followed(self._polished(found), (start, iteration))
            self._report(found[0])
            self.typical = self.verifier.rates(found[0].mechanism)[1]
            if found[0].residual <= self.rule.tolerance:
                return found
            prices = (1.0 - w) * prices + w * self.typical
            yield
        return None

    def _better(self, found: Found, way: Callable[[LimitState], LimitState]) -> Found:
        before, state = found
        if state.internal is None:
            return found
        with self.run.clock.phase("solve"):
            near = way(state)
        member = self.verifier.member(near, before.start, before.iterations)
        if member is None or not member.residual < before.residual:
            return found
        return member, near

    def _polished(self, found: Found) -> Found:
        return found if self.system is None else self._better(found, self.system.polished)

    def _followed(self, found: Found, at: tuple[int, int]) -> Found:
        system, tolerance = self.system, self.rule.tolerance
        if system is None or found[0].residual <= tolerance:
            return found
        width = _N.widths[(at[1] // _N.polish - 1) % len(_N.widths)]
        random = np.random.default_rng((self.rule.seed, *at))
        better = self._better(found, lambda state: followed(system, state, width, random))
        is_near = tolerance < better[0].residual <= _N.promising * tolerance
        return self._polished(better) if better is not found and is_near else better

    def _descents(self) -> Generator[None]:
        if self.system is None or not self.found:
            return
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
            step = self._on(mechanism, f"descent {self.tried}", -1.0, nudged=tried % 2 == 1)
            yield
            if step is None:
                continue
            walk = step
            if step[0].load_factor < lowest[0].load_factor:
                self._keep(step)

    def _on(
        self, mechanism: FloatArray, label: str, sign: float, nudged: bool = False
    ) -> Found | None:
        """The lowest or highest load factor of forces that a mechanism goes with, a high price on
        what others lose; nudged, a nearly extreme one: as few contacts pressed as chance prefers.
        """
        n = len(self.run.contacts)
        chance = _N.nudge * self.random.uniform(size=n) ** 2 if nudged else 0.0
        state, rung = self._solved(sign, _N.price * self.verifier.work(mechanism), chance)
        state = replace(state, mechanism=mechanism)
        member = self.verifier.member(state, label, 1)
        residual = None if member is None else member.residual
        self.run.note(state, f"{rung}, {label}", change=residual)
        if member is None:
            return None
        found = member, state
        if member.residual > self.rule.tolerance:
            found = self._polished(found)
        return found if found[0].residual <= self.rule.tolerance else None

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
            remark = (
                "associated friction has no largest load factor here, which would bound "
                "zero-dilatancy solutions from above: solve with flow 'associated' first, it says "
                f"why; none was found from {tried}"
            )
        else:
            residual = "" if best is None else f", last residual {best.residual:.1e}"
            remark = f"no zero-dilatancy solution was found from {tried}{residual}{above}"
        self.run.remarks = [remark]
        if best is not None:
            self.run.best = Answer(
                best.load_factor, self.run.best.bracket, best.forces, best.mechanism, tuple(members)
            )


_OPENING = np.eye(len(COMPONENTS))[COLUMN["N"]]

_LADDER = clarabel_at(1e-10, 1e-8)
"""Residuals below 1e-6 of the load factor take rates and forces to 1e-8 or better."""


@dataclass(frozen=True, eq=False)
class PricedForces:
    """The load factor, up or down, less what forces cost: one compiled problem for all questions.

    With the price on every contact's normal force that its dilatancy would open, contacts slide
    without opening. With a high price on the power that forces lose on a mechanism, they go with
    it. ``price`` (n, 6) is scaled like the load factor.
    """

    sign: cp.Parameter
    price: cp.Parameter

    def __call__(self, stated: Stated) -> Any:
        n, goal = len(stated.assemblage.contacts), times(self.sign, stated.factor)
        for name, k in COLUMN.items():
            goal = goal - np.ones(n) @ times(self.price[:, k], stated.forces[name])
        return goal


class Verifier:
    """Checks of zero-dilatancy solutions in NumPy, outside any solver.

    Only friction does not open joints: rates to which the opening that goes with their slip is
    added must be those of the associated flow rule, under which stone crushes, mortar tears and
    ties yield. What strength takes up of power is known from these rates, and forces must do it.
    """

    def __init__(self, run: Run) -> None:
        self.statics, self.contacts = run.assemblage.statics, run.assemblage.contacts
        self.least = run.scaling.least
        self.flow = FlowRule(run.surfaces, self.contacts)
        self.certifier = Certifier(run.assemblage, run.surfaces)
        self.strength = self.certifier.strength

    def rates(self, mechanism: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Relative rates (n, 6), and the opening (n,) that dilatancy would add to them."""
        rates = self.statics.relative_rates(mechanism)
        missing = self.flow.shortfall(rates).missing
        opening = self.contacts.corner_minimum(corner_openings(rates, self.contacts))
        return rates, np.maximum(missing + opening, 0.0)

    def work(self, mechanism: FloatArray) -> FloatArray:
        """(n, 6): times forces, their power on a mechanism and what friction takes up of it."""
        rates, dilatancy = self.rates(mechanism)
        return rates + dilatancy[:, None] * _OPENING

    def member(self, state: LimitState, start: str, iterations: int) -> Member | None:
        """A solver's answer, balanced and scaled to live power 1, with all its residuals."""
        given, alpha = self.certifier.given(state), state.load_factor
        if given is None or state.mechanism is None or alpha is None:
            return None
        live = float(self.statics.live @ state.mechanism.ravel())
        if not live > 0.0:
            return None
        mechanism = state.mechanism / live
        rates, dilatancy = self.rates(mechanism)
        work = rates + dilatancy[:, None] * _OPENING
        balanced = self.strength.balanced(given, alpha, self.statics)
        forces = self.strength.forces(balanced)
        power = (forces * work).sum(axis=1)
        openings = corner_openings(rates, self.contacts)
        if self.strength.is_internal:
            found = self.strength.flow.shortfall(work)
            penetration = max(float(found.missing.max()), 0.0)
            lost = abs(float(power.sum()) + found.dissipation)
        else:
            penetration = max(-float(openings.min()), 0.0)
            mu, cohesion = self.contacts.friction, self.contacts.cohesion * self.contacts.area
            slip = np.where(mu > 0.0, dilatancy / np.where(mu > 0.0, mu, 1.0), 0.0)
            lost = float(np.abs(power + cohesion * slip).sum())
        equilibrium, excess = self.certifier.residuals(balanced, alpha)
        return Member(
            load_factor=alpha,
            start=start,
            iterations=iterations,
            equilibrium=equilibrium,
            yield_excess=excess,
            flow=penetration / max(np.abs(openings).max(), np.abs(rates[:, :2]).max()),
            complementarity=lost / max(abs(alpha), self.least),
            forces=forces,
            mechanism=mechanism,
        )


class MechanismsOfForces:
    """Mechanisms that go with given forces: as few contacts opening and sliding as chance prefers.

    min  (random costs of openings and slips) + power of the forces on the mechanism,
    openings >= 0, slips <= multipliers, live power 1:  for linear yield surfaces a vertex, which
    moves so little that other forces go with it as well.
    """

    def __init__(self, system: FrictionSystem, seed: int) -> None:
        self.system, self.random = system, np.random.default_rng(seed)
        n, self._motion = len(system.cohesion), cp.Variable(len(system.live))
        self._on_opening = cp.Parameter(system.opening.shape[0], nonneg=True)
        self._on_slid, self._on_slips = cp.Parameter(n, nonneg=True), cp.Parameter(3 * n)
        opening, slips = system.opening @ self._motion, system.slip @ self._motion
        slid = cp.Variable(n)
        cost = self._on_opening @ opening + self._on_slid @ slid + self._on_slips @ slips
        limits = [
            opening >= 0.0,
            cp.SOC(slid, cp.vstack([slips[0::3], slips[1::3]]), axis=0),
            slid >= cp.abs(slips[2::3]),
            system.live @ self._motion == 1.0,
        ]
        self._problem = cp.Problem(cp.Minimize(cost), limits)

    def of(self, state: LimitState, settings: SolverSettings) -> FloatArray | None:
        given = self.system.point(state)
        pressed = np.maximum(given.pressed, 0.0)
        self._on_opening.value = _N.price * pressed + self._chance(len(pressed))
        limit = np.maximum(self.system.limit @ given.pressed + self.system.cohesion, 0.0)
        self._on_slid.value = _N.price * limit + self._chance(len(limit))
        self._on_slips.value = _N.price * given.friction.ravel()
        outcome = run_solver(self._problem, settings)
        if not outcome.has_values or self._motion.value is None:
            return None
        motion = np.asarray(self._motion.value).reshape(-1, DOF)
        return self.system.assemblage.scaling.mechanism(motion)

    def _chance(self, count: int) -> FloatArray:
        return _N.little * self.random.uniform(0.0, 1.0, count) ** 2
