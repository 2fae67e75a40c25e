"""Friction that slides without opening: low and high members of its set of solutions.

A solution is a load factor with forces in equilibrium that exceed no yield condition, and a
mechanism on which friction opposes slip, pressed contacts do not open, and none opens by sliding.
There are many solutions. The forces of each are admissible in the associated model as well, whose
load factor is therefore an upper bound of theirs.

The words used here: the *price* (n,) of compressions is what the associated model would open at
each contact, and the *pair* is the two convex problems of :mod:`.pair`, the priced one and the one
with friction held. A *walk* is a sequence of pairs that leads down or up from a solution.
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
    """The numbers of the search. Only which solutions it finds, and how fast, depends on them:
    every solution is checked."""

    # Iterates of De Saxce before the first pair, and the weights of new prices in them, in turn.
    # Where friction is a cone, some errors keep their sign from one iterate to the next, others
    # change it: weights about 1, as Chebyshev's for eigenvalues from -1 to 0.6, take a third of the
    # problems off that 0.8 alone needs on large walls. Where friction is linear there are finitely
    # many mechanisms: pairs end in a few steps, while iterates swing to and fro, and with a weight
    # of 0.8 for three times as long in a large wall.
    cones: tuple[int, tuple[float, ...]] = (12, (0.6, 0.9, 1.6))
    linear: tuple[int, tuple[float, ...]] = (2, (0.5,))
    # Iterates of De Saxce where pairs stall: as many as at first where friction is a cone.
    own: int = 12
    # Tolerance of iterates. They need not be exact, since the next one corrects them.
    rough: float = 1e-4
    # Pairs stall where one leaves more than this share of the loss: in space the loss then falls by
    # a tenth a pair, and by a half or more in twelve iterates.
    stalls: float = 0.7
    exact: float = 0.01  # Tolerance of pairs, over the loss that they are to lower.
    finest: float = 1e-11  # The smallest tolerance of all: rounding begins there.
    # Largest random price where no iterate has shown its size, over the friction coefficient at a
    # rate at which the whole live load does power 1: blocks that wedge each other have a solution
    # only at some price.
    natural: float = 4.0
    # Scales of random prices over the last iterate's largest, in turn. Only far higher ones find
    # the lowest branch of a wall whose solutions are all known.
    scales: tuple[float, ...] = (30.0, 5.0, 1.0)
    # Sizes of pushes in walks, in turn. A push is three things: by how much prices are too high on
    # the way down and too low on the way up; random prices of compressions added to them, in load
    # factors per total load; and the share by which held friction is less at random. Small pushes
    # find the lowest members known of walls in the plane, from six seeds of six; large ones find
    # lower members in space.
    pushes: tuple[float, ...] = (0.03, 0.1)
    walk: int = 6  # Pairs of a walk before it ends at a solution.


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
        Most problems per start.
    seed : int
        Seed of the random penalties.
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
        """Returns what the bounds rest on. A lower bound by products is left out, since the remark
        that names it says so."""
        bracket = run.best.bracket
        proved = bracket if bracket.lower_is_proved else replace(bracket, lower=-np.inf)
        return proved.basis


CheckedState = tuple[Member, LimitState]
"""A solution as it is reported, and the state with the forces and mechanism it was made of."""


class _Search:
    """The search of one run: ``solutions`` are all that it found, ``failed`` starts found none,
    ``tried`` pairs were solved in walks, and ``typical`` (n,) is the last price of a pair. Of De
    Saxce's iterates ``first`` precede the first pair; ``damping`` are their weights, in turn."""

    def __init__(self, rule: ZeroDilatancy, run: Run, associated: ConvexSearch) -> None:
        self.rule, self.run, self.associated = rule, run, associated
        self.solutions: list[CheckedState] = []
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
        """Runs the whole search, problem by problem, and returns the status of the run."""
        # The associated model: its upper bound, and the mechanism of the first start.
        mechanism = yield from self._associated()
        # Solutions from that mechanism and from random prices.
        for start in range(self.rule.starts):
            if start == 0 and mechanism is not None:
                solution = yield from self._started("associated", self._price(mechanism), True)
            else:
                price = self._random_price(_N.scales[max(start - 1, 0) % len(_N.scales)])
                solution = yield from self._started(f"random {start}", price, False)
            self.failed += solution is None
        # A lower bound of all solutions; where the lowest found does not meet it, walks seek lower
        # and higher ones.
        self._bound_from_below()
        yield
        if self.solutions and not self.run.best.bracket.is_within(self.rule.tolerance):
            yield from self._walked(1.0, self.rule.descents)
            yield from self._walked(-1.0, self.rule.descents // 2)
        if self.solutions and self.rule.products is not None:
            self._bound_by_products(self.rule.products)
        self._report()
        return Status.CONVERGED if self.solutions else Status.NOT_CONVERGED

    def _associated(self) -> Generator[None, None, FloatArray | None]:
        """Solves the associated model, whose upper bound holds for all solutions, and returns its
        mechanism (free, 6); None if it has none."""
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
        """Raises the run's lower bound by what least thrusts prove of all solutions. This may take
        as long as the search has taken so far."""
        run = self.run
        if not is_covered(run):
            return
        lowest = self._extreme(1.0)[0].load_factor if self.solutions else run.best.bracket.upper
        states = (
            ()
            if self.verifier.strength.is_internal
            else tuple((member.forces, member.load_factor) for member, _ in self.solutions)
        )
        run.tell("bounding solutions without dilatancy from below")
        bound = lower_bound(run, lowest, states, max(PATIENCE, run.clock.elapsed))
        if bound.load_factor > 0.0:
            bracket = run.best.bracket.raised(bound.load_factor, True)
            run.best = replace(run.best, bracket=bracket)
        self._report()

    def _bound_by_products(self, settings: Lifted) -> None:
        """Raises the run's lower bound by what products of forces and rates show, without proof."""
        run, start = self.run, max(self.run.best.bracket.lower, 0.0)
        run.tell("bounding solutions by products of forces and rates")
        lowest = self._extreme(1.0)[0].load_factor
        for self.products in lifted_bound(run, start, lowest, settings):
            if self.products.is_bound:
                bracket = run.best.bracket.raised(self.products.load_factor, False)
                run.best = replace(run.best, bracket=bracket)
            self._report()

    def _started(
        self, label: str, price: FloatArray, iterates: bool
    ) -> Generator[None, None, CheckedState | None]:
        """Returns the solution that a start at a price (n,) leads to, through iterates of De Saxce
        where ``iterates`` is true; None if it leads to none."""
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
        """Takes so many iterates of De Saxce from a state, in which prices (n,) follow the priced
        problem's own mechanism, damped. Returns the last state; None if a solve fails."""
        for k in range(number):
            w = self.damping[k % len(self.damping)]
            if state.mechanism is None:
                return None
            price = np.maximum((1.0 - w) * price + w * self._price(state.mechanism), 0.0)
            following = self._priced(price, tolerance)
            if following is None:
                return None
            state = following
            yield
        return state

    def _paired(
        self, label: str, state: LimitState, most: int
    ) -> Generator[None, None, CheckedState | None]:
        """Solves both problems of the pair in turn, until forces and mechanism lose no more than
        the tolerance, and returns the solution. Returns None if a solve fails, or when the run has
        solved ``most`` problems of pairs."""
        begun, aim = self.pair.solved, self.rule.tolerance
        finest = max(_N.exact * aim, _N.finest)
        loss, before = 1.0, np.inf
        while self.pair.solved < most:
            # Friction held at the state's compressions: the loss, and a mechanism.
            exact = min(max(_N.exact * loss, finest), _N.rough)
            held = self._held(state, exact)
            if held is None or held.mechanism is None or state.load_factor is None:
                return None
            unit = self.run.scaling.unit(state.load_factor)
            loss = ((held.load_factor or 0.0) - state.load_factor) / unit
            # Within the tolerance it is checked; if the checker refuses it, solves become finer.
            if loss <= aim:
                both = replace(state, mechanism=held.mechanism)
                solution = self._checked(both, label, self.pair.solved - begun)
                if solution is not None:
                    return solution
                finest, loss = max(0.1 * finest, _N.finest), min(loss, finest)
            # Forces at the mechanism's price; where pairs stall, iterates of De Saxce from there.
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

    def _walked(self, sign: float, number: int) -> Generator[None]:
        """Walks in ``number`` pairs in all, down (``sign`` 1) or up (``sign`` -1).

        A walk alternates between forces that are extreme on a mechanism and a mechanism of these
        forces; every second pair is random by a little. It ends at a solution. Solutions that it
        passes on the way are kept if they are more extreme than all before: the lowest ones are
        found like this, since the next step leaves a mechanism's extreme forces again.
        """
        aim = self.rule.tolerance
        exact = _N.exact * aim
        for walk in range(-(-number // _N.walk)):
            begun = self.pair.solved
            # Walks begin at the most extreme solution and at random prices in turn, every fourth of
            # the former at any solution: otherwise a chance find would hold all of them.
            state: LimitState | None = self._extreme(sign)[1]
            if walk % 8 == 6:
                state = self.solutions[self.random.integers(len(self.solutions))][1]
            label = f"{'descent' if sign > 0.0 else 'ascent'} {walk + 1}"
            if walk % 2 == 1:
                scale = _N.scales[walk // 2 % len(_N.scales)]
                forces = self._priced(self._random_price(scale), _N.rough)
                state = self._with_mechanism(forces, exact)
            size = _N.pushes[walk // 2 % len(_N.pushes)]
            for step in range(min(_N.walk, number - walk * _N.walk)):
                if state is None or state.mechanism is None:
                    break
                self.tried += 1
                # Forces that are extreme on the mechanism: its price a little too high for low
                # ones, too low for high ones.
                price = (1.0 + sign * size) * self._price(state.mechanism)
                push = size if step % 2 == 1 else 0.0
                unit = self.run.scaling.unit(state.load_factor or 0.0) / self.run.scaling.force
                forces = self._priced(price + self._random_sizes(push * unit), exact)
                # A mechanism of these forces.
                state = self._with_mechanism(forces, exact, 1.0 - self._random_sizes(push))
                # Without random changes both may be a solution, kept if it is the most extreme.
                if state is not None and push == 0.0:
                    factor, most = state.load_factor or 0.0, self._extreme(sign)[0].load_factor
                    if sign * (most - factor) > aim * self.run.scaling.unit(most):
                        self._checked(state, label, self.pair.solved - begun)
                yield
            # The solution at the end of the walk.
            if state is not None:
                most = self.pair.solved + self.rule.max_iterations // 4
                yield from self._paired(label, state, most)

    def _with_mechanism(
        self, forces: LimitState | None, tolerance: float, share: FloatArray | float = 1.0
    ) -> LimitState | None:
        """Returns a state with forces and the mechanism of friction held at a ``share`` of their
        compressions; None if there are no forces, or a solve fails."""
        held = None if forces is None else self._held(forces, tolerance, share)
        return None if forces is None or held is None else replace(forces, mechanism=held.mechanism)

    def _extreme(self, sign: float) -> CheckedState:
        """Returns the lowest solution (``sign`` 1) or the highest (``sign`` -1)."""
        return min(self.solutions, key=lambda solution: sign * solution[0].load_factor)

    def _price(self, mechanism: FloatArray) -> FloatArray:
        """Returns the price (n,) of a mechanism (free, 6)."""
        return self.pair.dilatancy(mechanism)

    def _random_price(self, scale: float) -> FloatArray:
        """Returns random prices (n,) of a scale over the typical one: mostly small, some large."""
        natural = _N.natural * float(self.run.contacts.friction.max()) / self.run.scaling.live
        return self._random_sizes(scale * (natural if self.typical is None else self.typical.max()))

    def _random_sizes(self, size: float) -> FloatArray:
        """Returns random numbers (n,) from 0 to ``size``, most of them small."""
        return np.asarray(size * self.random.uniform(size=len(self.run.contacts)) ** 2)

    def _priced(self, price: FloatArray, tolerance: float) -> LimitState | None:
        """Returns the state of the priced problem; None if the solve fails."""
        state = self.pair.priced(price, tolerance)
        return None if state.forces is None else state

    def _held(
        self, state: LimitState, tolerance: float, share: FloatArray | float = 1.0
    ) -> LimitState | None:
        """Returns the state with friction held at a ``share`` of the given state's compressions;
        None if the solve fails."""
        held = self.pair.held(share * pressed(state), tolerance)
        return None if held.mechanism is None or held.load_factor is None else held

    # Checks and reports

    def _checked(self, state: LimitState, label: str, iterations: int) -> CheckedState | None:
        """Checks a state's forces and mechanism. Returns the solution and keeps it if its residual
        is within the tolerance; otherwise returns None."""
        with self.run.clock.phase("certify"):
            member = self.verifier.member(state, label, iterations)
        if member is None or member.residual > self.rule.tolerance:
            return None
        self.solutions.append((member, state))
        self._report()
        return member, state

    def _report(self) -> None:
        """Writes the remark and the answer of the run as they are now."""
        # The bounds of all solutions, in words.
        members = sorted((member for member, _ in self.solutions), key=lambda m: m.load_factor)
        bracket = self.run.best.bracket
        by = "least thrusts"
        if self.products is not None and self.products.is_bound:
            by = f"products of forces and rates ({self.products})"
        named_ends = (
            (bracket.lower, f"none is below {rounded_down(bracket.lower)}, by {by}"),
            (bracket.upper, f"none above {rounded_up(bracket.upper)}, by associated friction"),
        )
        ends = " and ".join(words for end, words in named_ends if np.isfinite(end))
        above = f"; the bracket is one of all solutions without dilatancy: {ends}" if ends else ""
        # The solutions found, and whether there may be lower ones.
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
        # The answer: the lowest solution, with all of them as members.
        if members:
            best, state = self._extreme(1.0)
            internal = state.internal if self.verifier.strength.is_internal else None
            self.run.best = Answer(
                best.load_factor, bracket, best.forces, best.mechanism, tuple(members),
                internal=internal,
            )  # fmt: skip
