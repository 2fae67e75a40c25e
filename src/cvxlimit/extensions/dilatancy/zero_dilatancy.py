"""Friction without dilatancy: the set of its solutions, and a search for low ones.

Friction that slides without opening is a non-associated flow rule. Its solutions, load factors with
forces and mechanisms, satisfy equilibrium, yield, flow and complementarity, but are not unique:
they are *members* of a set. The forces of each are admissible in the associated model as well,
whose load factor is therefore an upper bound of all. The stages are

1. the associated load factor, its proved upper bound and its mechanism;
2. the first solution: a descent (:mod:`.descent`) from that mechanism;
3. a lower bound of all solutions, by least thrusts (:mod:`.least_thrust`): where the first one
   meets it, there is nothing to search;
4. searches for lower solutions. Each tries, again and again, a descent below a limit of the load
   factor that lies under its lowest one by a gap: from random dilations, or from the lowest one
   changed at random. A hit is lowered along its mechanism, and widens the gap; a failure narrows
   it.

Only which solutions are found, and how fast, depends on the numbers here: every one is checked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import count, ratio
from cvxlimit.extensions.dilatancy.descent import ITERATES, ROUGH, Descent, Found
from cvxlimit.extensions.dilatancy.remarks import remarks
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex import ConvexSearch, standing
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.methods.least_thrust import affordable, is_covered, lower_bound
from cvxlimit.reductions.explaining import BUDGET, searches_in_time
from cvxlimit.solution import Search, Status
from cvxlimit.solution.bracket import Evidence, rounded
from cvxlimit.solution.records import APART
from cvxlimit.solvers import LimitState

RANDOM, FRESH = (120.0, 20.0, 4.0), 0.25
"""Largest random dilations, over the friction coefficient at a rate at which the whole live load
does power 1, each of which finds solutions that the others do not; and the share of tries from
them. The others start from the lowest solution: changes of that alone stay in its neighbourhood."""

LEAST, FIRST, LARGEST = APART, 0.1, 0.3
NARROWER, WIDER = 0.75, 1.5
"""Gap of the limit below the lowest solution, over its load factor: the least, the first and the
largest one, and what a failure and a hit make of it. They were chosen on random walls
(:mod:`benchmarks.random_walls`)."""


@dataclass(frozen=True)
class ZeroDilatancy(Method):
    """Solutions without dilatancy, and several searches for low ones.

    Two convex problems alternate (:mod:`~cvxlimit.extensions.dilatancy.descent`): the load factor
    with friction held at the compressions of the last forces, whose mechanism slides without
    opening, and the load factor less a penalty on compressions: the dilation of the last mechanism.
    Their complementarity residual falls, and where it vanishes they are a solution. It is accepted
    if equilibrium, yield, flow and complementarity, recomputed outside the solver, are within the
    tolerance. A search then asks for a solution a little below its lowest one, again and again:
    from random dilations, or from its lowest solution, changed at random.

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


class _Searches:
    """The searches of one run, and what each of them has ``done``."""

    def __init__(self, rule: ZeroDilatancy, run: Run, associated: ConvexSearch) -> None:
        self.rule, self.run, self.associated = rule, run, associated
        is_plane = associated.reductions.plane is not None
        self.number = rule.searches or searches_in_time(len(run.contacts), is_plane)
        self.done: list[Search] = []
        self.descent = Descent(run, associated, rule.tolerance)
        self.random = np.random.default_rng(rule.seed)

    def steps(self) -> Steps:
        """Runs all stages, and returns the status of the run."""
        # The associated model: its upper bound, and the mechanism of the first solution.
        yield from self.associated.steps()
        aside, run = self.associated.run, self.run
        run.history += [
            replace(iterate, solver=f"{iterate.solver}, associated friction", lower=None)
            for iterate in aside.history
        ]
        bound = aside.best.bracket
        if np.isfinite(bound.upper):
            found = aside.best
            by = Evidence(found.load_factor, found.forces, found.mechanism, found.internal,
                          found.reference)  # fmt: skip
            bracket = run.best.bracket.lowered(bound.upper, bound.upper_is_proved)
            run.best = Answer(bracket=bracket, beside={"associated": by})
        self.descent.begin(self.rule.budget)
        first = None if aside.best.mechanism is None else self._first(aside.best.mechanism)
        self._report()
        yield
        # A lower bound of all solutions, and searches where the first one does not meet it.
        self._bound_from_below()
        yield
        is_lowest = first is not None and run.best.bracket.is_within(self.rule.tolerance)
        for number in range(0 if is_lowest else self.number):
            if number > 0:
                self.descent.begin(self.rule.budget)
            yield from self._searched(self.rule.seed + number, first)
        self._report()
        return Status.CONVERGED if self.descent.solutions else Status.NOT_CONVERGED

    def _first(self, mechanism: FloatArray) -> Found | None:
        """Returns the solution to which the associated mechanism leads, if it leads to one."""
        descent, upper = self.descent, self.run.best.bracket.upper
        dilation, aim = descent.pair.dilatancy(mechanism), self.rule.tolerance
        limit = upper + self.run.scaling.unit(upper)  # out of the way
        begun = descent.forces(dilation, limit, ROUGH)
        state = descent.fixed_point(begun, dilation, limit, ROUGH)
        iterates = ITERATES if descent.pair.has_cones else 0
        found = descent.solution("associated", state, limit, aim, iterates)
        if found is None and not descent.pair.has_cones:
            state = descent.pair.rotated(begun, descent.left, aim)
            found = descent.solution("rotated cones", state, limit, aim)
        return None if found is None else descent.settled(found, limit, ITERATES)

    def _bound_from_below(self) -> None:
        """Raises the run's lower bound by what least thrusts prove of all solutions. This may take
        as many problems as the search has taken so far."""
        run, descent = self.run, self.descent
        if not is_covered(run):
            return
        members = [found.member for found in descent.solutions]
        lowest = min((m.load_factor for m in members), default=run.best.bracket.upper)
        states = [] if descent.verifier.strength.is_internal else members
        run.tell("bounding solutions without dilatancy from below")
        known = [(member.forces, member.load_factor) for member in states]
        bound = lower_bound(run, lowest, known, max(affordable(run), len(run.history)))
        if bound.load_factor > 0.0:
            bracket = run.best.bracket.raised(bound.load_factor, True)
            beside = {**run.best.beside, **bound.evidence}
            run.best = replace(run.best, bracket=bracket, beside=beside)
        self._report()

    def _searched(self, seed: int, first: Found | None) -> Steps:
        """Searches for solutions below the first one, or for any, until the budget is spent."""
        run, descent, lowest, tries, gap = self.run, self.descent, first, 0, FIRST
        self.random = np.random.default_rng(seed)
        self.done.append(Search(seed, None if first is None else first.member.load_factor, 0, 0))
        while descent.left > 0:
            # The limit, below the lowest solution of this search, or below all that there may be.
            tries += 1
            factor = run.best.bracket.upper if lowest is None else lowest.member.load_factor
            limit = factor - gap * run.scaling.unit(factor) if np.isfinite(factor) else np.inf
            # A try, from random dilations or from the lowest solution.
            if lowest is None or self.random.uniform() < FRESH:
                label = "random prices"
                state = descent.forces(self._random_dilation(), limit, ROUGH)
            else:
                label, state = "lowest", self._changed(lowest.state, limit)
            if lowest is None and tries % 2 and not descent.pair.has_cones:
                label, limit = "rotated cones", factor
                state = descent.pair.rotated(state, descent.left, self.rule.tolerance)
            label = f"search {seed}, {label} {tries}"
            found = descent.solution(label, state, limit, descent.aim(gap))
            # After a hit lower forces on its mechanism, and a limit further down; after a failure
            # one nearer by, and from the least gap on all over again.
            # A hit is settled before it counts: friction at an angle to slip can feign one.
            lower = None if found is None else descent.settled(found, limit)
            is_gain = lower is not None and (lowest is None or _rank(lower) < _rank(lowest))
            if lower is None or not is_gain:
                gap = gap * NARROWER if gap > LEAST else FIRST
            else:
                gap = min(gap * WIDER, LARGEST)
                lowest = descent.settled(descent.lowered(lower, LEAST), limit)
            self._record(seed, lowest, is_gain)
            yield
        return Status.CONVERGED

    def _changed(self, state: LimitState, limit: float) -> LimitState | None:
        """Returns forces near a solution, below a limit: its dilations are up to twice as high,
        then friction is held at some share of the compressions found, at random contact by
        contact."""
        descent = self.descent
        dilation = descent.dilation(state) * (1.0 + self._random_sizes(1.0))
        forces = descent.forces(dilation, limit, ROUGH)
        held = descent.mechanism(forces, ROUGH, self._random_sizes(1.0))
        return None if held is None else descent.forces(descent.dilation(held), limit, ROUGH)

    def _random_dilation(self) -> FloatArray:
        unit = float(self.run.contacts.friction.max()) / self.run.scaling.live
        return self._random_sizes(self.random.choice(RANDOM) * unit)

    def _random_sizes(self, size: float) -> FloatArray:
        # from 0 to size, most of them small
        return np.asarray(size * self.random.uniform(size=len(self.run.contacts)) ** 2)

    def _record(self, seed: int, lowest: Found | None, is_gain: bool) -> None:
        """Records how far the search under way has come, and tells it."""
        solves, before = self.descent.solves, self.done[-1]
        factor = None if lowest is None else lowest.member.load_factor
        self.done[-1] = Search(seed, factor, solves, solves if is_gain else before.last_gain)
        self._report()
        best = self.run.best.load_factor
        known = "no solution without dilatancy yet" if best is None else ""
        self.run.tell(
            f"search {len(self.done)} of {self.number}, {solves} of {self.rule.budget} solves: "
            + (known or f"lowest so far {rounded(best or 0.0)}")
        )

    def _report(self) -> None:
        """Writes the answer and the remarks of the run as they are now."""
        run, bracket = self.run, self.run.best.bracket
        # Those whose friction is at an angle to slip count only where there are no others.
        every = self.descent.solutions
        solutions = [found for found in every if found.member.is_settled] or every
        members = sorted((found.member for found in solutions), key=lambda m: m.load_factor)
        run.best = replace(run.best, searches=tuple(self.done))
        if members:
            best, state = min(solutions, key=_rank)
            internal = state.internal if self.descent.verifier.strength.is_internal else None
            run.best = Answer(
                best.load_factor, bracket, best.forces, best.mechanism, tuple(members),
                internal=internal, searches=tuple(self.done), beside=run.best.beside,
            )  # fmt: skip
        smallest, near = self.descent.smallest, self.rule.tolerance * bracket.unit
        run.remarks = remarks(members, bracket, self.done, smallest, near)


def _rank(found: Found) -> tuple[bool, float]:
    """Returns what solutions are compared by: settled ones first, then low ones."""
    return not found.member.is_settled, found.member.load_factor
