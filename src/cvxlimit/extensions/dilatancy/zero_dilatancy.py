"""Friction that slides without opening: low members of its set of solutions.

A solution is a load factor with forces in equilibrium that exceed no yield condition, and a
mechanism on which friction opposes slip, pressed contacts do not open, and none opens by sliding.
There are many of them, the *members* of a set. The forces of each are admissible in the associated
model as well, whose load factor is therefore an upper bound of theirs.

The words used here: the *price* (n,) of compressions is what the associated model would open at
each contact, the *pair* is the two convex problems of :mod:`.pair`, the priced one and the one with
friction held, the *loss* is what its forces and mechanism lack of being a member, and the *cap* is
the largest load factor that forces may have.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import count, ratio
from cvxlimit.extensions.dilatancy.agreement import about_zero, agreement
from cvxlimit.extensions.dilatancy.least_thrust import affordable, is_covered, lower_bound
from cvxlimit.extensions.dilatancy.members import Verifier
from cvxlimit.extensions.dilatancy.pair import Pair, pressed
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex_search import ConvexSearch, standing
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.reductions.choice import BUDGET, searches_in_time
from cvxlimit.solution import Member, Search, Status
from cvxlimit.solution.bracket import rounded, rounded_down, rounded_up
from cvxlimit.solvers import LimitState


@dataclass(frozen=True)
class _Numbers:
    """The numbers of the search. Only which members it finds, and how fast, depends on them: every
    member is checked. They were chosen on random walls (:mod:`benchmarks.random_walls`)."""

    # Iterates of De Saxce before the first pair and where it stalls, if friction is a cone, and the
    # weights of new prices in them, in turn. Some errors keep their sign from one iterate to the
    # next, others change it: hence weights about 1, as Chebyshev's for eigenvalues from -1 to 0.6.
    # Where friction is linear there are finitely many mechanisms: pairs end in a few steps.
    iterates: int = 12
    weights: tuple[float, ...] = (0.6, 0.9, 1.6)
    # Tolerance of problems: at most this; over the loss to be lowered; where rounding begins.
    rough: float = 1e-4
    exact: float = 0.01
    finest: float = 1e-11
    # A try fails where a pair leaves more than this share of the loss, from this pair on: those
    # that end at a member take two to seven, others hardly change from the third on.
    leaves: float = 0.8
    from_pair: int = 3
    # Largest random prices, over the friction coefficient at a rate at which the whole live load
    # does power 1. Each finds members that the others do not.
    prices: tuple[float, ...] = (120.0, 20.0, 4.0)
    # Share of tries from random prices. The others start from the lowest member: kicks alone stay
    # in its neighbourhood, random prices alone are too far from everything.
    fresh: float = 0.25
    # Factor on a mechanism's prices at which forces on it are its lowest.
    higher: float = 1.003
    # Most that a member may lose, over the square of what it is lower by than the one before. Slip
    # that friction opposes at an angle loses the square of the angle and changes the load factor
    # by the angle itself: a cap close by would find that, and no member.
    sure: float = 0.01
    settled: float = 1e-10  # What a member loses that is settled.
    # Gap of the cap below the lowest member, over its load factor: the least, the first and the
    # largest one, and what a failure and a hit make of it.
    gaps: tuple[float, float, float] = (1e-3, 0.1, 0.3)
    narrower: float = 0.75
    wider: float = 1.5


_N = _Numbers()


@dataclass(frozen=True)
class ZeroDilatancy(Method):
    """Solutions without dilatancy, and several searches for low ones.

    Two convex problems alternate (:mod:`~cvxlimit.extensions.dilatancy.pair`): the load factor with
    friction held at the compressions of the last forces, whose mechanism slides without opening,
    and the load factor less a penalty on compressions: the dilatancy of the last mechanism. What
    forces and mechanism lose falls, and where it vanishes they are a member. A member is accepted
    if equilibrium, yield, flow and complementarity, recomputed outside the solver, are within the
    tolerance. A search then asks for forces below a cap, a little under its lowest member, again
    and again: from random penalties, or from its lowest member, changed at random.

    Associated friction bounds all solutions from above, and so does its proved upper bound here:
    the bracket of the answer is one of all of them, not of the lowest that was found.

    Attributes
    ----------
    tolerance : float
        Largest residual of a solution.
    seed : int
        Of the first search; the following ones have the following seeds.
    searches : int or None
        How many; None for as many as :func:`cvxlimit.explain` names.
    budget : int
        Problems that each search solves, each about a plain solve of the scene.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> found = solve(builtin_scene("arch"), method=ZeroDilatancy(searches=1, budget=40))
    >>> found.lower <= found.load_factor <= found.upper, found.gap < 1e-4
    (True, True)
    """

    name = "zero-dilatancy"
    answers = "friction that slides without opening: a set of solutions, the lowest found first"
    axis = "flow"
    takes, reduces = ("reactions", "cohesion", "strength"), False

    tolerance: float = 1e-6
    seed: int = 0
    searches: int | None = None
    budget: int = BUDGET

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")
        count(self.seed, 0, "seed")
        if self.searches is not None:
            count(self.searches, 1, "searches")
        count(self.budget, 1, "budget")

    def steps(self, run: Run) -> Steps:
        search = standing(run, run.model)
        if search is None:
            return Status.DEAD_LOAD_UNSTABLE
        return (yield from _Searches(self, run, search).steps())


CheckedState = tuple[Member, LimitState]
"""A member as it is reported, and the state with the forces and mechanism it was made of."""


class _Searches:
    """The searches of one run: ``members`` they found, what each has ``done``, and the ``smallest``
    loss of any pair, over the load factor."""

    def __init__(self, rule: ZeroDilatancy, run: Run, associated: ConvexSearch) -> None:
        self.rule, self.run, self.associated = rule, run, associated
        is_plane = associated.reductions.plane is not None
        self.number = rule.searches or searches_in_time(len(run.contacts), is_plane)
        self.members: list[CheckedState] = []
        self.done: list[Search] = []
        self.smallest = np.inf
        self.pair = Pair(run, associated)
        self.iterates = _N.iterates if self.pair.has_cones else 0
        with run.clock.phase("certify"):
            self.verifier = Verifier(run, associated.certifier, self.pair.slip)
        self.random = np.random.default_rng(rule.seed)
        self.begun = self.until = 0

    def steps(self) -> Steps:
        """Runs all searches, and returns the status of the run."""
        # The associated model: its upper bound, and the mechanism of the first member.
        yield from self.associated.steps()
        self._take_associated()
        self._begin()
        first = self._first(self.associated.run.best.mechanism)
        yield
        # A lower bound of all members. Where the first one meets it, there is nothing to search.
        self._bound_from_below()
        yield
        is_lowest = first is not None and self.run.best.bracket.is_within(self.rule.tolerance)
        for number in range(0 if is_lowest else self.number):
            if number > 0:
                self._begin()
            yield from self._searched(self.rule.seed + number, first)
        self._report()
        return Status.CONVERGED if self.members else Status.NOT_CONVERGED

    def _take_associated(self) -> None:
        aside, run = self.associated.run, self.run
        run.history += [
            replace(iterate, solver=f"{iterate.solver}, associated friction", lower=None)
            for iterate in aside.history
        ]
        bound = aside.best.bracket
        if np.isfinite(bound.upper):
            run.best = Answer(bracket=run.best.bracket.lowered(bound.upper, bound.upper_is_proved))
        self._report()

    def _begin(self) -> None:  # a search, whose budget counts from here
        self.begun, self.until = self.pair.solved, self.pair.solved + self.rule.budget

    def _first(self, mechanism: FloatArray | None) -> CheckedState | None:
        """Returns the member to which the associated mechanism leads, if there are both."""
        if mechanism is None:
            return None
        price, aim = self.pair.dilatancy(mechanism), self.rule.tolerance
        upper = self.run.best.bracket.upper
        cap = upper + self.run.scaling.unit(upper)  # out of the way
        begun = self._priced(price, cap, _N.rough)
        state = self._iterated(begun, price, cap, _N.rough)
        found = self._paired("associated", state, cap, aim, self.iterates)
        if found is None and not self.pair.has_cones:
            state = self.pair.rotated(begun, self.until - self.pair.solved, aim)
            found = self._paired("rotated cones", state, cap, aim)
        return None if found is None else self._settled(found, cap)

    def _searched(self, seed: int, first: CheckedState | None) -> Steps:
        run, lowest, tries = self.run, first, 0
        self.random = np.random.default_rng(seed)
        least, gap, largest = _N.gaps
        self.done.append(Search(seed, None if first is None else first[0].load_factor, 0, 0))
        while self.pair.solved < self.until:
            # The cap, below the lowest member of this search, or below all that there may be.
            tries += 1
            factor = run.best.bracket.upper if lowest is None else lowest[0].load_factor
            cap = factor - gap * run.scaling.unit(factor) if np.isfinite(factor) else np.inf
            # A try, from a random price or from the lowest member.
            if lowest is None or self.random.uniform() < _N.fresh:
                label, state = "random prices", self._priced(self._random_price(), cap, _N.rough)
            else:
                label, state = "lowest", self._kicked(lowest[1], cap)
            if lowest is None and tries % 2 and not self.pair.has_cones:
                most, label, cap = self.until - self.pair.solved, "rotated cones", factor
                state = self.pair.rotated(state, most, self.rule.tolerance)
            label = f"search {seed}, {label} {tries}"
            found = self._paired(label, state, cap, self._aim(gap))
            # After a hit lower forces on its mechanism, and a cap further down; after a failure one
            # nearer by, and from the least gap on all over again.
            if found is None:
                gap = gap * _N.narrower if gap > least else _N.gaps[1]
            else:
                gap = min(gap * _N.wider, largest)
                lowest = self._lowered(self._settled(found, cap))
            self._record(seed, lowest, found is not None)
            yield
        return Status.CONVERGED

    def _kicked(self, state: LimitState, cap: float) -> LimitState | None:
        """Returns forces near a member below a cap: its prices are up to twice as high, then
        friction is held at some share of the compressions found, at random contact by contact."""
        assert state.mechanism is not None
        price = self.pair.dilatancy(state.mechanism) * (1.0 + self._random_sizes(1.0))
        held = self._held(self._priced(price, cap, _N.rough), _N.rough, self._random_sizes(1.0))
        if held is None or held.mechanism is None:
            return None
        return self._priced(self.pair.dilatancy(held.mechanism), cap, _N.rough)

    def _settled(self, found: CheckedState, cap: float) -> CheckedState:
        """Returns the member next to one found that loses next to nothing, in place of that one, or
        the same where pairs do not lead to it. What it loses may be friction at an angle to slip,
        by the root of that: so much higher may the load factor be."""
        (member, state), settled = found, _N.settled
        factor, lost = member.load_factor, member.complementarity
        if lost <= settled or not self.pair.has_cones:
            return found
        assert state.mechanism is not None
        cap = min(cap, factor + np.sqrt(2.0 * lost) * self.run.scaling.unit(factor))
        forces = self._priced(self.pair.dilatancy(state.mechanism), cap, _N.exact * settled)
        finer = self._paired(member.start, forces, cap, settled)
        if finer is None:
            return found
        self.members.remove(found)
        return finer

    def _lowered(self, found: CheckedState) -> CheckedState:
        """Returns a member that is lower than one found: the lowest forces on its mechanism, then
        those on a mechanism of these forces, and so on, as long as that gains."""
        exact = _N.exact * self.rule.tolerance
        while self.pair.solved < self.until:
            member, state = found
            assert state.mechanism is not None
            price = _N.higher * self.pair.dilatancy(state.mechanism)
            forces = self._priced(price, member.load_factor, exact)
            held = self._held(forces, exact)
            if forces is None or held is None:
                break
            unit = self.run.scaling.unit(member.load_factor)
            gain = (member.load_factor - (forces.load_factor or 0.0)) / unit
            if gain <= self.rule.tolerance or self._loss(forces, held) > self._aim(gain):
                break
            lower = self._checked(replace(forces, mechanism=held.mechanism), member.start)
            if lower is None:
                break
            found = lower
            if gain < _N.gaps[0]:
                break
        return found

    def _paired(
        self,
        label: str,
        state: LimitState | None,
        cap: float,
        aim: float,
        iterates: int = 0,
    ) -> CheckedState | None:
        """Solves both problems of the pair in turn, below a cap, until forces and mechanism are a
        member that loses no more than ``aim``, and returns it. Where pairs stall come so many
        ``iterates`` of De Saxce. Returns None where pairs stall without any, if a solve fails, or
        when the budget is spent."""
        finest, loss, before, pairs = max(_N.exact * aim, _N.finest), 1.0, np.inf, 0
        while state is not None and self.pair.solved < self.until:
            # Friction held at the state's compressions: the loss, and a mechanism.
            exact = min(max(_N.exact * loss, finest), _N.rough)
            held = self._held(state, exact)
            if held is None or held.mechanism is None:
                return None
            loss, pairs = self._loss(state, held), pairs + 1
            # Within the tolerance it is checked; if the checker refuses it, solves become finer.
            if loss <= aim:
                both = replace(state, mechanism=held.mechanism)
                member = self._checked(both, label)
                if member is not None:
                    return member
                finest = max(0.1 * finest, _N.finest)
            self.smallest = min(self.smallest, loss)
            stalls = loss > _N.leaves * before
            if stalls and not iterates and pairs >= _N.from_pair:
                return None
            before = np.inf if stalls and iterates else loss
            # Forces at the mechanism's price.
            price = self.pair.dilatancy(held.mechanism)
            exact = min(max(_N.exact * loss, finest), _N.rough)
            state = self._priced(price, cap, exact)
            if stalls and iterates:
                state = self._iterated(state, price, cap, exact)
        return None

    def _iterated(
        self, state: LimitState | None, price: FloatArray, cap: float, tolerance: float
    ) -> LimitState | None:
        """Takes iterates of De Saxce from a state, in which prices (n,) follow the priced problem's
        own mechanism, damped. Returns the last state; None if a solve fails."""
        for k in range(self.iterates):
            if state is None or state.mechanism is None:
                return None
            w = _N.weights[k % len(_N.weights)]
            following = self.pair.dilatancy(state.mechanism)
            price = np.maximum((1.0 - w) * price + w * following, 0.0)
            state = self._priced(price, cap, tolerance)
        return state

    def _aim(self, gain: float) -> float:
        """Returns what a member may lose that is lower than another by so much of its load
        factor."""
        aim = self.rule.tolerance
        return min(aim, _N.sure * gain**2) if self.pair.has_cones else aim

    def _loss(self, state: LimitState, held: LimitState) -> float:
        """Returns what forces lose on the mechanism of friction held at them, over the load factor;
        below zero it is what both solves lack."""
        factor = state.load_factor or 0.0
        return abs((held.load_factor or 0.0) - factor) / self.run.scaling.unit(factor)

    def _random_price(self) -> FloatArray:
        unit = float(self.run.contacts.friction.max()) / self.run.scaling.live
        return self._random_sizes(self.random.choice(_N.prices) * unit)

    def _random_sizes(self, size: float) -> FloatArray:
        # from 0 to size, most of them small
        return np.asarray(size * self.random.uniform(size=len(self.run.contacts)) ** 2)

    def _priced(self, price: FloatArray, cap: float, tolerance: float) -> LimitState | None:
        state = self.pair.priced(price, tolerance, cap)
        return None if state.forces is None or state.load_factor is None else state

    def _held(
        self, state: LimitState | None, tolerance: float, less: FloatArray | float = 0.0
    ) -> LimitState | None:
        """Returns the state with friction held at the given state's compressions, ``less`` that
        share of them; None without a state, or if the solve fails."""
        if state is None:
            return None
        held = self.pair.held((1.0 - less) * pressed(state), tolerance)
        return None if held.mechanism is None or held.load_factor is None else held

    # Bounds, checks and reports

    def _bound_from_below(self) -> None:
        """Raises the run's lower bound by what least thrusts prove of all solutions. This may take
        as many problems as the search has taken so far."""
        run = self.run
        if not is_covered(run):
            return
        members = [member for member, _ in self.members]
        lowest = min((m.load_factor for m in members), default=run.best.bracket.upper)
        states = [] if self.verifier.strength.is_internal else members
        run.tell("bounding solutions without dilatancy from below")
        known = [(member.forces, member.load_factor) for member in states]
        bound = lower_bound(run, lowest, known, max(affordable(run), len(run.history)))
        if bound.load_factor > 0.0:
            bracket = run.best.bracket.raised(bound.load_factor, True)
            run.best = replace(run.best, bracket=bracket)
        self._report()

    def _checked(self, state: LimitState, label: str) -> CheckedState | None:
        """Checks a state's forces and mechanism. Returns the member and keeps it if its residual is
        within the tolerance; otherwise returns None."""
        with self.run.clock.phase("certify"):
            member = self.verifier.member(state, label, self.pair.solved - self.begun)
        if member is None or member.residual > self.rule.tolerance:
            return None
        self.members.append((member, state))
        self._report()
        return member, state

    def _record(self, seed: int, lowest: CheckedState | None, is_gain: bool) -> None:
        """Records how far the search under way has come, and tells it."""
        solves, before = self.pair.solved - self.begun, self.done[-1]
        factor = None if lowest is None else lowest[0].load_factor
        self.done[-1] = Search(seed, factor, solves, solves if is_gain else before.last_gain)
        far = f"search {len(self.done)} of {self.number}, {solves} of {self.rule.budget} solves"
        if self.run.best.load_factor is None:
            self.run.tell(f"{far}: no solution without dilatancy yet")
        else:
            self.run.tell(f"{far}: lowest so far {rounded(self.run.best.load_factor)}")
        self._report()

    def _report(self) -> None:
        """Writes the remarks and the answer of the run as they are now."""
        run, members = self.run, sorted((m for m, _ in self.members), key=lambda m: m.load_factor)
        bracket, remarks = run.best.bracket, []
        run.best = replace(run.best, searches=tuple(self.done))
        if members:
            best, state = min(self.members, key=lambda found: found[0].load_factor)
            internal = state.internal if self.verifier.strength.is_internal else None
            run.best = Answer(
                best.load_factor, bracket, best.forces, best.mechanism, tuple(members),
                internal=internal, searches=tuple(self.done),
            )  # fmt: skip
            span = " to ".join(rounded(m.load_factor) for m in (members[0], members[-1]))
            number = f"{len(members)} solutions" if len(members) > 1 else "one solution"
            worst = f"each to {max(m.residual for m in members):.0e} of its load factor"
            remarks.append(f"{number} without dilatancy found, {span}, {worst}")
            is_proved = best.load_factor <= bracket.lower + self.rule.tolerance * bracket.unit
            remarks.append("no solution is lower" if is_proved else agreement(self.done))
            remarks.append(about_zero(best.load_factor, members[-1].load_factor))
        else:
            least = f"the smallest loss was {self.smallest:.1e} of the load factor"
            remarks.append(
                "no solution without dilatancy was found, which does not say that there is none; "
                f"{least if np.isfinite(self.smallest) else 'no pair of problems was solved'}: "
                "search on with --searches, --seed or --budget"
            )
        named_ends = (
            (bracket.lower, f"none is below {rounded_down(bracket.lower)}, by least thrusts"),
            (bracket.upper, f"none above {rounded_up(bracket.upper)}, by associated friction"),
        )
        ends = " and ".join(words for end, words in named_ends if np.isfinite(end))
        if ends:
            remarks.append(f"the bracket is one of all solutions without dilatancy: {ends}")
        run.remarks = [*filter(None, remarks)]
