"""Friction that slides without opening: low and high members of its set of solutions.

A solution is a load factor with forces in equilibrium that yield nowhere, and a mechanism on which
friction opposes slip, pressed contacts do not open, and none opens by sliding. There are many; each
is admissible in the associated model as well, whose load factor is hence an upper bound.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import count, ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex_search import ConvexSearch, standing
from cvxlimit.methods.dilatancy.least_thrust import PATIENCE, is_covered, lower_bound
from cvxlimit.methods.dilatancy.lifted import Lifted, LiftedBound, lifted_bound
from cvxlimit.methods.dilatancy.members import Verifier
from cvxlimit.methods.dilatancy.pair import Pair, pressed
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.solution import Member, Status
from cvxlimit.solution.bracket import rounded, rounded_down, rounded_up
from cvxlimit.solvers import LimitState


@dataclass(frozen=True)
class _Numbers:
    """Only what is found, and how fast, depends on them: members are checked."""

    # iterates with the price problem's own mechanism before the first pair, and how new prices
    # weigh in them, in turn. Where friction is a cone, some errors keep their sign from one iterate
    # to the next, others change it: weights about 1, as Chebyshev's for eigenvalues from -1 to 0.6,
    # take a third of the problems off that 0.8 alone needs on large walls. Where it is linear there
    # are finitely many mechanisms, among which pairs end in a few steps and iterates swing to and
    # fro; a weight of 0.8 swings on for three times as long in a large wall
    cones: tuple[int, tuple[float, ...]] = (12, (0.6, 0.9, 1.6))
    linear: tuple[int, tuple[float, ...]] = (2, (0.5,))
    own: int = 12  # where pairs stall: as many as between cones at first
    rough: float = 1e-4  # tolerance of iterates: they need not be exact, the next one corrects them
    stalls: float = 0.7  # share of the loss that a pair leaves where pairs do not pay any more:
    # in space the loss then falls by a tenth a pair, and twelve own iterates by a half or more
    exact: float = 0.01  # tolerance of pairs over the loss that they are to lower
    finest: float = 1e-11  # of all tolerances: rounding begins there
    # largest random price, over friction at a rate at which the whole live load does power 1, where
    # no iterate has told its size: blocks that wedge each other need some to have a solution
    natural: float = 4.0
    # random prices over the last iterate's largest, in turn: only far higher ones find the lowest
    # branch of a wall whose solutions are all known
    scales: tuple[float, ...] = (30.0, 5.0, 1.0)
    # of walks, in turn: how much prices are too high for low members, too low for high ones; random
    # prices of compressions besides, in load factors per total load; and the share by which held
    # friction is less at random. Small ones find the lowest members known of walls in the plane,
    # from six seeds of six, large ones lower members in space
    pushes: tuple[float, ...] = (0.03, 0.1)
    walk: int = 6  # pairs of a descent before it ends at a solution


_N = _Numbers()


@dataclass(frozen=True)
class ZeroDilatancy(Method):
    """Solutions without dilatancy from several starts, and a search for low and high ones.

    Two convex problems alternate (:mod:`~cvxlimit.methods.dilatancy.pair`): the load factor with
    friction held at the compressions of the last forces, whose mechanism slides without opening,
    and the load factor less a penalty on compressions: the dilatancy of the last mechanism.
    What forces and mechanism lose never rises; where it stalls, De Saxce's iterates, damped, come
    between. A solution is accepted if equilibrium, yield, flow and complementarity, recomputed
    outside the solver, are within the tolerance. From the lowest one, penalties a little too
    high lead to the lowest forces on its mechanism, friction held to another mechanism of theirs,
    and so on; from the highest one likewise upwards.

    Associated friction bounds all solutions from above, and so does its proved upper bound here:
    the bracket of the answer is one of all of them, not of the lowest that was found.

    Attributes
    ----------
    tolerance : float
        Largest residual of a solution.
    starts : int
        The first is the associated solution, the others have random penalties.
    damping : float or None
        Weight of the new penalty against the old one, in iterates with their own mechanism; None
        takes 0.6, 0.9 and 1.6 in turn where friction is a cone, and 0.5 where it is linear.
    max_iterations : int
        Problems per start.
    seed : int
        Of the random penalties.
    descents : int
        Pairs of problems tried in the search for low members, and half as many for high ones; 0
        for none.
    products : Lifted or None
        Seek a second lower bound, for scenes in a plane up to some 45 contacts; None does not.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> found = solve(builtin_scene("arch"), method=ZeroDilatancy(starts=1))
    >>> found.lower <= found.load_factor <= found.upper, found.gap < 1e-4
    (True, True)
    """

    name = "zero-dilatancy"
    answers = "friction that slides without opening: a set of solutions, the lowest found first"
    axis = "flow"

    tolerance: float = 1e-6
    starts: int = 4
    damping: float | None = None
    max_iterations: int = 150
    seed: int = 0
    descents: int = 120
    products: Lifted | None = None

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        count(self.starts, 1, "starts")
        if self.damping is not None and not 0.0 < self.damping <= 1.0:
            raise ModelError(f"damping must be above 0 and at most 1, got {self.damping!r}")
        count(self.max_iterations, 1, "max_iterations")
        count(self.descents, 0, "descents")

    def steps(self, run: Run) -> Steps:
        search = standing(run, run.model)
        if search is None:
            return Status.DEAD_LOAD_UNSTABLE
        return (yield from _Search(self, run, search).steps())

    def basis(self, run: Run) -> str:
        """What the bounds rest on; that by products says so where it is named."""
        bracket = run.best.bracket
        told = bracket if bracket.lower_is_proved else replace(bracket, lower=-np.inf)
        return told.basis


Found = tuple[Member, LimitState]
"""A member, and its forces and mechanism."""


class _Search:
    """Starts under way, and the solutions found."""

    def __init__(self, rule: ZeroDilatancy, run: Run, associated: ConvexSearch) -> None:
        self.rule, self.run, self.associated = rule, run, associated
        self.found: list[Found] = []
        self.typical: FloatArray | None = None
        self.failed = self.tried = 0
        self.products: LiftedBound | None = None
        self.pair = Pair(run, associated)
        self.first, damping = _N.cones if self.pair.has_cones else _N.linear
        self.damping = damping if rule.damping is None else (rule.damping,)
        with run.clock.phase("certify"):
            self.verifier = Verifier(run, associated.certifier, self.pair.slip)
        self.random = np.random.default_rng(rule.seed)

    def steps(self) -> Steps:
        mechanism = yield from self._associated()
        for start in range(self.rule.starts):
            if start == 0 and mechanism is not None:
                found = yield from self._started("associated", self._price(mechanism), True)
            else:
                price = self._drawn(_N.scales[max(start - 1, 0) % len(_N.scales)])
                found = yield from self._started(f"random {start}", price, False)
            self.failed += found is None
        self._bound_from_below()
        yield
        if self.found and not self.run.best.bracket.is_within(self.rule.tolerance):
            yield from self._walked(1.0, self.rule.descents)
            yield from self._walked(-1.0, self.rule.descents // 2)
        if self.found and self.rule.products is not None:
            self._bound_by_products(self.rule.products)
        self._report()
        return Status.CONVERGED if self.found else Status.NOT_CONVERGED

    def _associated(self) -> Generator[None, None, FloatArray | None]:
        """The mechanism of the associated model, whose upper bound holds for all solutions."""
        yield from self.associated.steps()
        aside = self.associated.run
        self.run.history += [
            replace(iterate, solver=f"{iterate.solver}, associated friction", lower=None)
            for iterate in aside.history
        ]
        bound = aside.best.bracket
        if np.isfinite(bound.upper):
            bracket = self.run.best.bracket.lowered(bound.upper, bound.upper_is_proved)
            self.run.best = Answer(bracket=bracket)
        self._report()
        return aside.best.mechanism

    def _bound_from_below(self) -> None:
        """What least thrusts prove, for as long as has been searched so far."""
        run = self.run
        if not is_covered(run):
            return
        lowest = self._extreme(1.0)[0].load_factor if self.found else run.best.bracket.upper
        states = (
            ()
            if self.verifier.strength.is_internal
            else tuple((member.forces, member.load_factor) for member, _ in self.found)
        )
        run.tell("bounding solutions without dilatancy from below")
        found = lower_bound(run, lowest, states, max(PATIENCE, run.clock.elapsed))
        if found.load_factor > 0.0:
            bracket = run.best.bracket.raised(found.load_factor, True)
            run.best = replace(run.best, bracket=bracket)
        self._report()

    def _bound_by_products(self, settings: Lifted) -> None:
        """What products of forces and rates show besides."""
        run, start = self.run, max(self.run.best.bracket.lower, 0.0)
        run.tell("bounding solutions by products of forces and rates")
        lowest = self._extreme(1.0)[0].load_factor
        for self.products in lifted_bound(run, start, lowest, settings):
            if self.products.is_bound:
                bracket = run.best.bracket.raised(self.products.load_factor, False)
                run.best = replace(run.best, bracket=bracket)
            self._report()

    # One solution

    def _started(
        self, label: str, price: FloatArray, iterates: bool
    ) -> Generator[None, None, Found | None]:
        before = self.pair.solved
        state: LimitState | None = self._priced(price, _N.rough)
        if iterates and state is not None:
            state = yield from self._iterated(state, price, self.first, _N.rough)
        if state is None:
            return None
        return (yield from self._paired(label, state, before + self.rule.max_iterations))

    def _iterated(
        self, state: LimitState, price: FloatArray, number: int, tolerance: float
    ) -> Generator[None, None, LimitState | None]:
        """De Saxce's iterates: prices follow the price problem's own mechanism, damped."""
        for k in range(number):
            w = self.damping[k % len(self.damping)]
            if state.mechanism is None:
                return None
            price = np.maximum((1.0 - w) * price + w * self._price(state.mechanism), 0.0)
            found = self._priced(price, tolerance)
            if found is None:
                return None
            state = found
            yield
        return state

    def _paired(
        self, label: str, state: LimitState, most: int
    ) -> Generator[None, None, Found | None]:
        """Both problems in turn, until forces and mechanism lose no more than the tolerance; at
        ``most`` so many problems in all."""
        begun, aim = self.pair.solved, self.rule.tolerance
        finest = max(_N.exact * aim, _N.finest)
        loss, before = 1.0, np.inf
        while self.pair.solved < most:
            exact = min(max(_N.exact * loss, finest), _N.rough)
            held = self._held(state, exact)
            if held is None or held.mechanism is None or state.load_factor is None:
                return None
            unit = self.run.scaling.unit(state.load_factor)
            loss = ((held.load_factor or 0.0) - state.load_factor) / unit
            if loss <= aim:
                both = replace(state, mechanism=held.mechanism)
                if (found := self._checked(both, label, self.pair.solved - begun)) is not None:
                    return found
                finest, loss = max(0.1 * finest, _N.finest), min(loss, finest)
            price = self._price(held.mechanism)
            self.typical = price
            exact = min(max(_N.exact * loss, finest), _N.rough)
            stalls = loss > _N.stalls * before
            before = np.inf if stalls else loss
            following = self._priced(price, exact)
            if stalls and following is not None:
                following = yield from self._iterated(following, price, _N.own, exact)
            if following is None:
                return None
            state = following
            yield
        return None

    # Low and high ones

    def _walked(self, sign: float, number: int) -> Generator[None]:
        """Walks of so many pairs in all, down (``sign`` 1) or up: forces that are extreme on a
        mechanism, a mechanism of theirs, and so on, every second of both random by a little.
        They begin at the extreme solution and at random prices in turn, every fourth of the former
        at any solution, and end at one: from the extreme one alone, a chance find holds them.
        Others that they pass are kept if they are more extreme than all before: there the lowest
        ones are found, since a mechanism's extreme forces are left again by the next step."""
        aim = self.rule.tolerance
        exact = _N.exact * aim
        for walk in range(-(-number // _N.walk)):
            begun = self.pair.solved
            state: LimitState | None = self._extreme(sign)[1]
            if walk % 8 == 6:
                state = self.found[self.random.integers(len(self.found))][1]
            label = f"{'descent' if sign > 0.0 else 'ascent'} {walk + 1}"
            if walk % 2 == 1:
                scale = _N.scales[walk // 2 % len(_N.scales)]
                state = self._with_mechanism(self._priced(self._drawn(scale), _N.rough), exact)
            size = _N.pushes[walk // 2 % len(_N.pushes)]
            for step in range(min(_N.walk, number - walk * _N.walk)):
                if state is None or state.mechanism is None:
                    break
                self.tried += 1
                price = (1.0 + sign * size) * self._price(state.mechanism)
                push = size if step % 2 == 1 else 0.0
                unit = self.run.scaling.unit(state.load_factor or 0.0) / self.run.scaling.force
                forces = self._priced(price + self._chance(push * unit), exact)
                state = self._with_mechanism(forces, exact, 1.0 - self._chance(push))
                if state is not None and push == 0.0:  # friction is held as it is
                    factor, most = state.load_factor or 0.0, self._extreme(sign)[0].load_factor
                    if sign * (most - factor) > aim * self.run.scaling.unit(most):
                        self._checked(state, label, self.pair.solved - begun)
                yield
            if state is not None:
                most = self.pair.solved + self.rule.max_iterations // 4
                yield from self._paired(label, state, most)

    def _with_mechanism(
        self, forces: LimitState | None, tolerance: float, share: FloatArray | float = 1.0
    ) -> LimitState | None:
        held = None if forces is None else self._held(forces, tolerance, share)
        return None if forces is None or held is None else replace(forces, mechanism=held.mechanism)

    def _extreme(self, sign: float) -> Found:
        return min(self.found, key=lambda found: sign * found[0].load_factor)

    # Both problems

    def _price(self, mechanism: FloatArray) -> FloatArray:
        return self.pair.dilatancy(mechanism)

    def _drawn(self, scale: float) -> FloatArray:
        """Random prices: mostly small, some large."""
        natural = _N.natural * float(self.run.contacts.friction.max()) / self.run.scaling.live
        return self._chance(scale * (natural if self.typical is None else self.typical.max()))

    def _chance(self, size: float) -> FloatArray:
        return np.asarray(size * self.random.uniform(size=len(self.run.contacts)) ** 2)

    def _priced(self, price: FloatArray, tolerance: float) -> LimitState | None:
        state = self.pair.priced(price, tolerance)
        return None if state.forces is None else state

    def _held(
        self, state: LimitState, tolerance: float, share: FloatArray | float = 1.0
    ) -> LimitState | None:
        found = self.pair.held(share * pressed(state), tolerance)
        return None if found.mechanism is None or found.load_factor is None else found

    # What is said

    def _checked(self, state: LimitState, label: str, iterations: int) -> Found | None:
        """Forces and a mechanism, kept if they are a solution."""
        with self.run.clock.phase("certify"):
            member = self.verifier.member(state, label, iterations)
        if member is None or member.residual > self.rule.tolerance:
            return None
        self.found.append((member, state))
        self._report()
        return member, state

    def _report(self) -> None:
        members = sorted((member for member, _ in self.found), key=lambda m: m.load_factor)
        bracket = self.run.best.bracket
        by = "least thrusts"
        if self.products is not None and self.products.is_bound:
            by = f"products of forces and rates ({self.products})"
        ends = (
            (bracket.lower, f"none is below {rounded_down(bracket.lower)}, by {by}"),
            (bracket.upper, f"none above {rounded_up(bracket.upper)}, by associated friction"),
        )
        said = " and ".join(words for end, words in ends if np.isfinite(end))
        above = f"; the bracket is one of all solutions without dilatancy: {said}" if said else ""
        tried = f"{self.rule.starts - self.failed} of {self.rule.starts} starts"
        if members:
            span = " to ".join(rounded(m.load_factor) for m in (members[0], members[-1]))
            further = f" and {self.tried} tries further down and up" if self.tried else ""
            is_lowest = members[0].load_factor <= bracket.lower + self.rule.tolerance * bracket.unit
            unknown = "" if is_lowest else "; whether there are lower ones is not known"
            remark = (
                f"{len(members)} zero-dilatancy solutions from {span}, "
                f"from {tried}{further}{above}{unknown}"
            )
        else:
            remark = f"no zero-dilatancy solution was found from {tried}{above}"
        self.run.remarks = [remark]
        if self.products is not None and not self.products.is_bound:
            self.run.remarks.append(f"no bound by products: {self.products}")
        if members:
            best, state = self._extreme(1.0)
            internal = state.internal if self.verifier.strength.is_internal else None
            self.run.best = Answer(
                best.load_factor, bracket, best.forces, best.mechanism, tuple(members),
                internal=internal,
            )  # fmt: skip
