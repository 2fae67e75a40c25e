"""Friction that slides without opening: De Saxce's fixed point, and the members of its set.

With zero dilatancy there is no single load factor: a solution is a load factor with forces in
equilibrium that yield nowhere, and a mechanism that opens nowhere by sliding, on which friction
opposes slip and pressed contacts do not open. Every such solution is admissible in the associated
model as well, whose load factor is hence an upper bound; nothing is known about the lowest one but
that none lower was found.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.bracket import rounded
from cvxlimit.checks import count, ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods.central_path import CentralPath
from cvxlimit.methods.complementarity import FrictionSystem, has_equations
from cvxlimit.methods.driver import Answer, Rule, Run, check_formulation
from cvxlimit.methods.members import ExtremeForces, MechanismsOfForces, Verifier
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import ForceVariables
from cvxlimit.model.problem import LimitProblem, Terms
from cvxlimit.solution import Member, Status
from cvxlimit.solvers import LimitState, SolverSettings, clarabel_at

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


_NATURAL = 4.0
"""Largest random price where no iterate has told its size yet, over friction at a rate at which the
whole live load does power 1: blocks that wedge each other need some price to have a solution."""

_SCALES = (30.0, 5.0, 1.0)
"""Random prices over the last iterate's largest, in turn: on a wall of six blocks whose solutions a
mixed-integer search knows, only prices far above found the lowest branch."""

_POLISH = 10
"""Iterates between attempts to solve the equations of the fixed point from where it is: an attempt
takes as long as about five iterates."""

_WIDTHS = (0.1, 1.0)
"""How far from an iterate paths begin, in turn: near ones keep to its branch, far ones arrive more
often."""

_STEPS = 400
"""Most steps of a path, each of which takes 0.02 (dome) to 0.14 (panel S12) of a first conic
solve; of the paths that arrive most need 80 to 360."""

_PROMISING = 100.0
"""Residual over the tolerance up to which a path's end is polished."""

_WALK = 6
"""Steps of a walk between mechanisms and forces before it begins again at the lowest member."""


@dataclass(frozen=True)
class ZeroDilatancy(Rule):
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
    most : int
        Iterations per start.
    seed : int
        Of the random prices and mechanisms.
    descents : int
        Mechanisms tried on the way down; 0 for none.
    """

    name = "none"

    tolerance: float = 1e-6
    starts: int = 4
    damping: float = 0.8
    most: int = 150
    seed: int = 0
    descents: int = 24

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        count(self.starts, 1, "starts")
        if not 0.0 < self.damping <= 1.0:
            raise ModelError(f"damping must be above 0 and at most 1, got {self.damping!r}")
        count(self.most, 1, "most")
        count(self.descents, 0, "descents")

    def start(self, run: Run) -> _Search:
        """Compile the one problem of all iterates."""
        run.flow = "zero-dilatancy"
        check_formulation(run, "zero dilatancy")
        return _Search(self, run)

    def step(self, run: Run, state: _Search) -> _Search:
        """One iterate of a start, the extremes on one mechanism, or one try further down."""
        state.advance()
        return state

    def is_done(self, run: Run, state: _Search) -> Status | None:
        """When all starts, mechanisms and descents are through."""
        return state.status

    def result(self, run: Run, state: _Search) -> Answer:
        """The lowest solution found, with all others beside it; no bracket."""
        return state.answer()


@dataclass
class _Search:
    """Starts under way, and the solutions found."""

    rule: ZeroDilatancy
    run: Run
    found: list[tuple[Member, LimitState]] = field(default_factory=list)
    status: Status | None = None
    associated: float | None = None
    typical: FloatArray | None = None
    at_start: int = 0
    iterations: int = 0
    last: Member | None = None
    failed: int = 0
    tried: int = 0
    walk: tuple[Member, LimitState] | None = None

    def __post_init__(self) -> None:
        run = self.run
        with run.clock.phase("compile"):
            self.price = cp.Parameter(len(run.contacts), nonneg=True)
            self.problem = LimitProblem(
                run.assemblage, run.surfaces, objective=PricedPressure(self.price)
            )
            self.verifier = Verifier(run)
            is_known = has_equations(run.surfaces) and not self.verifier.strength.is_internal
            self.system = FrictionSystem(run.assemblage) if is_known else None
            self.path = None if self.system is None else CentralPath(self.system)
            self.lowest = ExtremeForces(run, self.verifier, -1.0)
            self.highest = ExtremeForces(run, self.verifier, 1.0)
            self.mechanisms = (
                None if self.system is None else MechanismsOfForces(self.system, self.rule.seed)
            )
        self.prices = np.zeros(len(run.contacts))
        self.random = np.random.default_rng(self.rule.seed)
        self.ladder: tuple[SolverSettings, ...] = run.ladder or _LADDER
        self.waiting: list[Member] = []

    @property
    def members(self) -> list[Member]:
        """Solutions found, lowest first."""
        return sorted((member for member, _ in self.found), key=lambda m: m.load_factor)

    def advance(self) -> None:
        """One convex problem, or two."""
        if self.at_start < self.rule.starts:
            self._iterate()
        elif self.waiting:
            self._seek_extremes(self.waiting.pop(0))
        elif self.found and self.mechanisms is not None and self.tried < self.rule.descents:
            self._descend(self.mechanisms)
        else:
            self.status = Status.CONVERGED if self.found else Status.NOT_CONVERGED

    def _iterate(self) -> None:
        self.iterations += 1
        self.price.value = self.run.scaling.live * self.prices
        state, rung = self.run.try_solvers(self.problem.solve, self.ladder)
        member = self.verifier.member(state, self._label, self.iterations)
        self.run.note(state, rung, change=None if member is None else member.residual)
        if self.at_start == 0 and self.iterations == 1:
            self.associated = state.load_factor
        if member is None:
            self._next_start(None)
            return
        if self.iterations % _POLISH == 0:
            member, state = self._followed(*self._polished(member, state))
        self.last = member
        rates = self.run.assemblage.statics.relative_rates(member.mechanism)
        wanted = self.verifier.dilatancy(rates)
        self.typical = wanted
        if member.residual <= self.rule.tolerance:
            self._next_start((member, state))
        elif self.iterations >= self.rule.most:
            self._next_start(None)
        else:
            w = self.rule.damping
            self.prices = (1.0 - w) * self.prices + w * wanted

    def _polished(self, member: Member, state: LimitState) -> tuple[Member, LimitState]:
        """The root of the equations near a state, where that is better."""
        if self.system is None or state.internal is None:
            return member, state
        with self.run.clock.phase("solve"):
            near = self.system.polished(state)
        found = self.verifier.member(near, member.start, member.iterations)
        if found is None or found.residual >= member.residual:
            return member, state
        return found, near

    def _followed(self, member: Member, state: LimitState) -> tuple[Member, LimitState]:
        """The end of a path from a state to a solution, where the polish did not get there."""
        if self.path is None or state.internal is None or member.residual <= self.rule.tolerance:
            return member, state
        width = _WIDTHS[(self.iterations // _POLISH - 1) % len(_WIDTHS)]
        random = np.random.default_rng((self.rule.seed, self.at_start, self.iterations))
        with self.run.clock.phase("solve"):
            end = self.path.followed(state, width, random, _STEPS)
        found = self.verifier.member(end, member.start, member.iterations)
        if found is None or found.residual >= member.residual:
            return member, state
        if self.rule.tolerance < found.residual <= _PROMISING * self.rule.tolerance:
            return self._polished(found, end)
        return found, end

    @property
    def _label(self) -> str:
        return "associated" if self.at_start == 0 else f"random {self.at_start}"

    def _next_start(self, found: tuple[Member, LimitState] | None) -> None:
        if found is None:
            self.failed += 1
        else:
            self.found.append(found)
            self.waiting.append(found[0])
        self.at_start += 1
        self.iterations = 0
        natural = _NATURAL * float(self.run.contacts.friction.max()) / self.run.scaling.live
        size = natural if self.typical is None else float(np.max(self.typical))
        size *= _SCALES[self.at_start % len(_SCALES)]
        self.prices = size * self.random.uniform(0.0, 1.0, len(self.prices)) ** 2

    def _seek_extremes(self, member: Member) -> None:
        """Forces with the lowest and the highest load factor on one mechanism."""
        for extreme, which in ((self.lowest, "lowest"), (self.highest, "highest")):
            label = f"{which} on the mechanism of {member.start}"
            found = self._on(extreme, member.mechanism, label)
            if found is not None:
                self.found.append(found)

    def _descend(self, mechanisms: MechanismsOfForces) -> None:
        """A mechanism that goes with the forces of a member, and low forces on that.

        A walk of a few steps, each from where the last one led, begins at the lowest member and
        begins again when it comes below that.
        """
        lowest = min(self.found, key=lambda found: found[0].load_factor)
        if self.walk is None or self.tried % _WALK == 0:
            self.walk = lowest
        self.tried += 1
        with self.run.clock.phase("solve"):
            mechanism = mechanisms.of(self.walk[1], self.ladder[0])
        if mechanism is None:
            self.walk = None
            return
        label = f"descent {self.tried}"
        chance = None if self.tried % 2 else self.random
        step = self._on(self.lowest, mechanism, label, chance)
        if step is None:
            return
        self.walk = step
        if step[0].load_factor < lowest[0].load_factor:
            self.found.append(step)

    def _on(
        self,
        extreme: ExtremeForces,
        mechanism: FloatArray,
        label: str,
        chance: np.random.Generator | None = None,
    ) -> tuple[Member, LimitState] | None:
        """Extreme forces on a mechanism, if they pass all checks."""
        state, rung = extreme.on(mechanism, self.ladder, chance)
        member = self.verifier.member(state, label, 1)
        note = None if member is None else member.residual
        self.run.note(state, f"{rung}, {label}", change=note)
        if member is not None and member.residual > self.rule.tolerance:
            member, state = self._polished(member, state)
        is_good = member is not None and member.residual <= self.rule.tolerance
        return (member, state) if member is not None and is_good else None

    def answer(self) -> Answer:
        """Lowest member first."""
        members = self.members
        above = "" if self.associated is None else (
            f"; associated friction, {rounded(self.associated)}, bounds all of them from above"
        )  # fmt: skip
        tried = f"{self.rule.starts - self.failed} of {self.rule.starts} starts"
        if not members:
            if self.associated is None:
                return Answer(note=f"{_NO_ASSOCIATED}; none was found from {tried}")
            residual = "" if self.last is None else f", last residual {self.last.residual:.1e}"
            return Answer(
                load_factor=None if self.last is None else self.last.load_factor,
                forces=None if self.last is None else self.last.forces,
                mechanism=None if self.last is None else self.last.mechanism,
                note=f"no zero-dilatancy solution was found from {tried}{residual}{above}",
            )
        lowest, highest = members[0], members[-1]
        span = f"from {rounded(lowest.load_factor)} to {rounded(highest.load_factor)}"
        further = f" and {self.tried} tries further down" if self.tried else ""
        return Answer(
            load_factor=lowest.load_factor,
            forces=lowest.forces,
            mechanism=lowest.mechanism,
            note=(
                f"{len(members)} zero-dilatancy solutions {span}, from {tried}{further}{above}; "
                "whether there are lower ones is not known"
            ),
            members=tuple(members),
        )


_NO_ASSOCIATED = (
    "associated friction has no largest load factor here, which would bound zero-dilatancy "
    "solutions from above: solve with flow 'associated' first, it says why"
)

_LADDER = clarabel_at(1e-10, 1e-8)
"""Residuals below 1e-6 of the load factor take rates and forces to 1e-8 or better."""
