"""The certified answer with interaction: a bracket proved from below and from above.

With interaction (Eq. 26-30) the admissible forces of a contact are no convex set, so that no convex
problem has the load factor. What is proved is an interval that contains it:

    lower    forces in equilibrium that satisfy Eq. 30 exactly, at every contact
    upper    a mechanism, and the largest power of true states on it: the convex hull of every
             contact's states (:mod:`.flow`)

The stages, each of which ends the run where the bracket is as narrow as is asked:

1. forces in the scene's plane, if it has one, close the bracket by themselves;
2. a relaxation over the hull of states, refined round by round, bounds from above
   (:mod:`.relaxation.upper`);
3. whether the dead load stands at all, and whether any multiple of the live load is carried;
4. safe steps, convex problems inside Eq. 30, climb to a lower bound from several starts
   (:mod:`.restriction.inner`);
5. branch and bound over ranges of pressure centres narrows what is left (:mod:`.branching.search`);
6. the lower bound is proved beyond the rounding of the solvers (:mod:`.restriction.lower_bound`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cvxlimit.base.arrays import SMALL, FloatArray
from cvxlimit.base.checks import count, not_negative, ratio
from cvxlimit.base.search import processes
from cvxlimit.errors import ModelError
from cvxlimit.extensions.interaction.branching.progress import MORE_TIME, Progress, percent
from cvxlimit.extensions.interaction.branching.search import BranchAndBound
from cvxlimit.extensions.interaction.flow import InteractionFlow
from cvxlimit.extensions.interaction.halves import SymmetricHalf
from cvxlimit.extensions.interaction.relaxation.upper import UpperBound
from cvxlimit.extensions.interaction.restriction.carrying import carrying_forces
from cvxlimit.extensions.interaction.restriction.inner import InnerMethod
from cvxlimit.extensions.interaction.restriction.lower_bound import LowerBounds, basis, prove
from cvxlimit.extensions.interaction.settings import BRACKET
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex import dead_load_falls
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.methods.standing import fallen
from cvxlimit.methods.wedging import judged
from cvxlimit.model.program import LimitProgram
from cvxlimit.proof.strength import ContactFlow
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.named import parse_moments
from cvxlimit.reductions.choice import Reductions
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import Bracket
from cvxlimit.solvers import default_ladder, ladder_for

STARTS = ("relaxation", "middle", "boxes")
"""Names of the places where safe steps begin."""


@dataclass(frozen=True)
class Certified(Method):
    """The certified method.

    ``load_factor`` and ``forces`` of its solution are those behind the lower bound, ``mechanism``
    that of the upper one; the history has both bounds as they stood after every solve.

    Attributes
    ----------
    tolerance : float or None
        Relative width of the bracket at which to stop. None asks for 1 % (1e-4 on scenes of up to 6
        contacts) within the budget, and calls a bracket within 5 % certified.
    starts : tuple of {"relaxation", "middle", "boxes"} or None
        Where the safe steps begin: at the forces of the relaxation from above, at the middle of all
        contacts, or where boxes of pressure centres about the relaxation's shrink to. The problem
        has local optima, so several starts help (figures: docs/evidence/closing.md).
        None is all of them for independent signs, each while the bracket is wider than 0.5 % and
        boxes up to 500 contacts, and for signed moments the relaxation; where contacts are not all
        rectangles boxes come first, whatever the moments.
    solves : int
        Convex problems per start, at most.
    branching_seconds : float or None
        Time for branch and bound alone, in place of the budget; 0 is none. Unless it is given,
        branching ends earlier where it no longer narrows the bracket.
    workers : int
        Processes that branch and bound uses.
    executor : Executor or None
        Of :mod:`concurrent.futures`, in place of processes of its own (a Dask client's
        ``get_executor()``, for instance); ``workers`` nodes at a time.
    moments : str or Moments
        How Eq. 30 adds moments: see :func:`cvxlimit.solve`.
    budget : float or None
        Seconds of the whole run after which branch and bound ends, and each way to a proof is tried
        only once. It does not limit the relaxation and the searches for a lower bound, which come
        first. If it is None, branch and bound has 60 seconds of its own where a
        tolerance is asked for or the scene has up to 6 contacts; otherwise the budget is 10
        seconds, or 12 times what the first relaxation took if that is more.

    Example
    -------
    >>> Certified(tolerance=0.01).solves
    24
    """

    name, axis = "certified", "interaction"
    answers = "interaction with bending (Eq. 26-32), proved from below and from above"
    surfaces, takes = ("conic",), ()
    usual = BRACKET.good

    tolerance: float | None = None
    starts: tuple[str, ...] | None = None
    solves: int = 24
    branching_seconds: float | None = None
    workers: int = 1
    executor: Executor | None = None
    moments: str | Moments = "independent"
    budget: float | None = None

    def __post_init__(self) -> None:
        if isinstance(self.starts, str):
            object.__setattr__(self, "starts", (self.starts,))
        if self.starts is not None:
            is_sequence = isinstance(self.starts, Sequence) and len(self.starts) > 0
            if not is_sequence or any(start not in STARTS for start in self.starts):
                known = ", ".join(map(repr, STARTS))
                raise ModelError(f"starts must be among {known}, at least one, got {self.starts!r}")
        if self.tolerance is not None:
            ratio(self.tolerance, "tolerance")
        count(self.solves, 1, "solves")
        for name in ("budget", "branching_seconds"):
            if getattr(self, name) is not None:
                not_negative(getattr(self, name), name)
        count(self.workers, 1, "workers")

    def flow(self, contacts: Contacts) -> ContactFlow:
        return InteractionFlow(contacts, parse_moments(self.moments))

    def steps(self, run: Run) -> Steps:
        run.moments = parse_moments(self.moments)
        if run.moments.has_eq_24 and dead_load_falls(run):
            return Status.DEAD_LOAD_UNSTABLE
        proof = _Proof(self, run)
        status = yield from proof.steps()
        if status is Status.DEAD_LOAD_UNSTABLE:
            # Refuses a dead load that stands with a part of the live one.
            dead_load_falls(run.auxiliary_run())
        elif proof.is_standing_open:
            run.remarks.append(
                "neither forces that carry the dead load alone nor a proof that there are none "
                "were found: whether it stands is open"
            )
        return status

    def basis(self, run: Run) -> str:
        return basis(run.best.bracket, run.moments.caution)


class _Proof:
    """A certified run under way: :meth:`steps` has its stages, the methods after it each of them.

    ``is_standing_open`` is True where it is not known whether the dead load stands alone.
    """

    def __init__(self, settings: Certified, run: Run) -> None:
        self.settings, self.run = settings, run
        self.ladder = run.ladder or (*ladder_for("leading"), *default_ladder()[:2])
        with run.clock.phase("compile"):
            self.found = Reductions.of(run.assemblage, run.surfaces, model=run.model)
        self.is_standing_open = False
        self._first_relaxation = 0  # row of the history
        self._at_rest: FloatArray | None = None  # forces that carry the dead load alone
        self._proved: Answer | None = None  # the answer that has been proved, as far as it can be

    def steps(self) -> Steps:
        run = self.run
        with run.clock.phase("compile"):
            half = SymmetricHalf.of(self.found, run.moments)
        outer = UpperBound(run, half)
        # 1. Forces in the plane.
        if self._is_planar(outer):
            return Status.CERTIFIED
        # 2. The relaxation. Where a wide bracket is asked for, half of it is left to safe steps.
        run.reductions = () if half is None else ("symmetry",)
        tolerance = max(BRACKET.outer, 0.5 * (self.settings.tolerance or 0.0))
        self._first_relaxation = len(run.history)  # after planar problems
        yield from self._bound_from_above(outer, tolerance)
        # 3. Whether the dead load stands, and whether any multiple of the live load is carried.
        if self._cannot_stand():
            return Status.DEAD_LOAD_UNSTABLE
        is_boundless = run.is_boundless(run.best.bracket.upper)  # without any it is infinite
        if (is_boundless or outer.claims_no_optimum) and self._is_unbounded():
            return judged(run, is_plain=False)
        if run.best.mechanism is None:
            yield from self._borrow()
        else:
            # 4. Safe steps; where they end below zero, forces that carry the dead load alone.
            yield from self._bound_from_below(outer)
            if self._at_rest is not None and run.best.bracket.lower < 0.0:
                run.best = run.best.raised(0.0, True, 0.0, self._at_rest)
            # 5. and 6. Branch and bound, and the proof of the lower bound.
            yield from self._branch(outer)
            self._prove()
            if self._is_ruled_out(run.best.bracket):
                return Status.DEAD_LOAD_UNSTABLE
        # The lower bound may show that there is no limit, where the upper one did not.
        lower = run.best.bracket.lower
        if lower > 0.0 and run.is_boundless(lower) and self._is_unbounded():
            return judged(run, is_plain=False)
        good = run.best.bracket.is_within(self.settings.tolerance or BRACKET.good)
        return Status.CERTIFIED if good else Status.NOT_CERTIFIED

    def _is_planar(self, outer: UpperBound) -> bool:
        """True if forces in the scene's plane close the bracket: without torsion Eq. 30 asks for
        little more than friction. Bounds are checked as all others are."""
        run, found = self.run, self.found
        if found.plane is None:
            return False
        with run.clock.phase("compile"):
            problem = LimitProgram(found.assemblage, run.surfaces, reduction=found.best())
        state, settings = run.try_solvers(problem.run, run.ladder or problem.ladder())
        if state.forces is None or state.mechanism is None or state.load_factor is None:
            return False
        outer.offer(state.mechanism)
        with run.clock.phase("certify"):
            bounds = LowerBounds(run.assemblage, run.moments)
            run.best = bounds.of(state.forces, state.load_factor).raising(run.best)
        run.note(state, settings, **run.bounds)
        if not run.best.bracket.is_within(self.settings.tolerance or BRACKET.outer):
            return False
        run.reductions = found.best().names
        run.remarks = ["planar, without torsion"]
        return True

    def _bound_from_above(self, outer: UpperBound, tolerance: float) -> Iterator[None]:
        """The relaxation, refined round by round. Where that takes longer than the usual budget, a
        first lower bound is sought as soon as the upper one is near the relaxation's load factor;
        then the rounds go on."""
        run, rounds = self.run, outer.rounds(tolerance, self.ladder)
        for _ in rounds:
            yield None
            upper, state = run.best.bracket.upper, outer.state
            if run.clock.elapsed <= BRACKET.budget or run.is_boundless(upper):
                continue
            least = (1.0 - BRACKET.near) * upper
            if state is not None and 0.0 < least <= (state.load_factor or 0.0):
                for iterate in self.climbs.iterates(state.forces):
                    yield None
                    if iterate.is_safe:
                        break
                break
        yield from rounds
        yield None

    def _cannot_stand(self) -> bool:
        """True if it is proved that no true states carry the dead load, which a positive load
        factor does not rule out: pushed, a block may stay where it would slide down."""
        run, dead = self.run, self.run.assemblage.statics.dead
        if not np.any(dead):
            return False
        # States strictly inside Eq. 30 that are known to carry it.
        self._at_rest = next(iter(self.climbs.checker.reserves), None)
        if self._at_rest is not None:
            return False
        # As a live load it is carried as a whole or not at all, by homogeneity.
        alone = run.auxiliary_run(run.assemblage.alone(dead))
        UpperBound(alone).search(BRACKET.outer, self.ladder)
        if alone.best.bracket.upper < 0.5:
            rates = alone.best.mechanism
            run.best = replace(run.best, forces=None, mechanism=rates)
            if rates is not None:
                run.remarks = [fallen(run.scene, rates)]
            return True
        # Forces that carry it are sought, then a proof that there are none.
        self._at_rest = carrying_forces(run, dead, self.ladder)
        if self._at_rest is None and self._needs_live_load():
            return True
        self.is_standing_open = self._at_rest is None
        return False

    def _needs_live_load(self) -> bool:
        """True if branch and bound proves that the dead load needs some of the live load: that the
        largest factor of the reversed load is below zero."""
        run, statics = self.run, self.run.assemblage.statics
        back = run.auxiliary_run(run.assemblage.under(statics.dead, -statics.live))
        outer = UpperBound(back)
        outer.search(BRACKET.outer, self.ladder)
        is_small = len(run.contacts) <= BRACKET.few
        seconds = BRACKET.branching if is_small else BRACKET.standing * BRACKET.budget
        seconds = min(seconds, self._end)
        if outer.state is not None and np.isfinite(back.best.bracket.upper):
            until = run.clock.elapsed + seconds
            search = BranchAndBound(back, BRACKET.good, outer=outer, seconds=seconds)
            while search.can_go_on and run.clock.elapsed < until:
                if back.best.bracket.is_below_zero:
                    break
                search.step()
        if not self._is_ruled_out(back.best.bracket):
            return False
        run.best = replace(run.best, forces=None, mechanism=back.best.mechanism)
        return True

    def _is_unbounded(self) -> bool:
        """True if forces carry the live load alone, strictly inside Eq. 30: as that is homogeneous,
        every load factor beyond some finite one is then carried."""
        run = self.run
        forces = carrying_forces(run, run.assemblage.statics.live, self.ladder)
        if forces is None:
            run.remarks = [
                "no upper bound, and no forces were found that carry the live load alone: whether "
                "it does any harm is open"
            ]
            return False
        run.best = replace(run.best, forces=forces, mechanism=None)
        run.remarks = []
        return True

    @cached_property
    def climbs(self) -> InnerMethod:
        """The searches for a lower bound, whose problems are compiled when first asked for."""
        return InnerMethod(self.run, self.settings.solves, reductions=self.found)

    def _bound_from_below(self, outer: UpperBound) -> Iterator[None]:
        """Climbs from each start in turn, then under stricter readings of the moments."""
        run, state = self.run, outer.state
        for number, name in enumerate(self.settings.starts or self.climbs.starts):
            if number > 0 and self._is_within(BRACKET.narrow):
                break
            relaxed = state.forces if state else None
            yield from self._until_met(self.climbs.begun(name, relaxed))
        yield from self._borrow()
        run.remarks = run.remarks or ["no further progress from these starts"]

    def _borrow(self) -> Iterator[None]:
        """Climbs under stricter readings, whose forces are admissible here as well, while the
        bracket is wide."""
        for stricter in self.run.moments.stricter:
            if not self._is_within(BRACKET.outer):
                yield from self._until_met(self.climbs.from_stricter_reading(stricter))

    def _until_met(self, iterates: Iterator[object]) -> Iterator[None]:
        """Goes through iterates, each of which books its bounds, until the tolerance is met."""
        if self._is_met():
            return
        for _ in iterates:
            if self._is_met():
                self.run.remarks = ["the tolerance is met"]
                return
            yield None

    def _branch(self, outer: UpperBound) -> Iterator[None]:
        """Branch and bound, one step after another, unless the bracket is narrow or time is short.

        Where it has closed to the width asked for, the lower bound is proved; if the proof widens
        the bracket beyond what is wanted, the search goes on to a smaller width.
        """
        run, settings = self.run, self.settings
        width, asked = run.best.bracket.width, self._asked
        if settings.branching_seconds == 0.0:
            return
        if width <= asked:
            asked = self._width_after_proof()
            if width <= asked:
                return
        # Its seconds: those asked for, else what the budget leaves, else the usual ones.
        is_small = len(run.contacts) <= BRACKET.few
        if settings.branching_seconds is not None:
            seconds = settings.branching_seconds
        elif settings.budget is None and (settings.tolerance is not None or is_small):
            seconds = BRACKET.branching
        else:
            seconds = self._end - run.clock.elapsed
        if seconds < self._problem_seconds:
            run.remarks = [f"{percent(width)} wide after {run.clock.elapsed:.1f} s; {MORE_TIME}"]
            return
        progress = Progress(run, seconds, ends_idle=settings.branching_seconds is None)
        own = settings.executor
        with nullcontext(own) if own else processes(settings.workers) as executor:
            search = BranchAndBound(run, asked, executor, settings.workers, outer, seconds)
            while True:
                progress.look(search)
                run.remarks = [progress.said]
                # It has closed: it goes on only if the proof has widened the bracket too much.
                if not (search.can_go_on or progress.is_over):
                    search.tolerance = self._width_after_proof()
                if not search.can_go_on or progress.is_over or run.best.bracket.is_below_zero:
                    return
                yield None
                search.step()

    def _width_after_proof(self) -> float:
        """Proves the lower bound, and returns the relative width at which a search may end next.

        Where the proved bracket is as narrow as wanted it is kept, and the width is infinite.
        Otherwise the bracket before the proof comes back, which is of more use to a search, and the
        width is less than that bracket's, by more than the proof has cost.
        """
        run, before = self.run, self.run.best
        self._prove()
        cost = run.best.bracket.width - before.bracket.width
        if run.best.bracket.width <= self._wanted:
            return np.inf
        run.best = before
        return before.bracket.width - cost

    def _prove(self) -> None:
        """The lower bound proved, if that costs little; not again where nothing has changed since.
        A bracket that :meth:`_width_after_proof` has put back is proved again where it stays."""
        if self.run.best is not self._proved:
            prove(self.run, self._end, self._asked)
            self._proved = self.run.best

    def _is_ruled_out(self, bracket: Bracket) -> bool:
        """True if a bracket's upper bound is below zero and proved; the remarks say so then."""
        if not (bracket.is_below_zero and bracket.upper_is_proved):
            return False
        what = "no contact forces carry the dead load alone, at any eccentricities"
        self.run.remarks = [f"branch and bound proves that {what}"]
        return True

    @property
    def _wanted(self) -> float:
        """Relative width of the bracket that is wanted, its proof included."""
        is_small = len(self.run.contacts) <= BRACKET.few
        return self.settings.tolerance or (BRACKET.outer if is_small else BRACKET.wanted)

    @property
    def _asked(self) -> float:
        """Relative width at which branch and bound ends, unless a proof turns out to cost more."""
        return self.settings.tolerance or (1.0 - SMALL) * self._wanted

    @property
    def _end(self) -> float:
        """Seconds of the run at which its budget is spent."""
        settings, run = self.settings, self.run
        if settings.budget is not None:
            return settings.budget
        if settings.tolerance is not None or len(run.contacts) <= BRACKET.few:
            return np.inf
        return max(BRACKET.budget, BRACKET.relaxations * self._problem_seconds)

    @property
    def _problem_seconds(self) -> float:
        """Seconds of the first relaxation, which further problems are expected to take."""
        return self.run.history[self._first_relaxation].seconds

    def _is_met(self) -> bool:
        """True if the bracket is as narrow as the tolerance that was asked for, if one was."""
        return self.run.best.bracket.width <= (self.settings.tolerance or 0.0)

    def _is_within(self, width: float) -> bool:
        """True if no tolerance was asked for and the bracket is no wider than that."""
        return self.settings.tolerance is None and self.run.best.bracket.width <= width
