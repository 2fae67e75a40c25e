"""Without interaction: one convex problem, its ladder, and proofs that no answer exists."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cvxlimit.bracket import known
from cvxlimit.checks import ratio
from cvxlimit.methods.bearing import borne
from cvxlimit.methods.driver import Answer, Progress, Rule, Run, drive, fallen
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.problem import LargestFactor, LargestSelfStress, LimitProblem, Objective
from cvxlimit.model.statics import Scaling
from cvxlimit.proof.certificate import REFERENCE, Certificate, Certifier
from cvxlimit.proof.strength import Strength
from cvxlimit.reductions.choice import Reductions
from cvxlimit.reductions.reduction import ReducedProblem, Reduction
from cvxlimit.scene import Load, Scene, check_scene
from cvxlimit.solution import Solution, Status
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.presets import needed_surfaces

FloatArray = NDArray[np.float64]

TOLERANCE = 1e-5
"""Default width of the bracket, relative to its upper end."""


_NO_FORCE = 1e8
"""Contact forces, over the dead load, beyond which it is rounding alone that could hold a block: a
mechanism that is exact has a missing opening of 1e-12 to 1e-10 of its rates, from a solver."""

_RUNGS_ASIDE = 2
"""Rungs of the ladder for a question on the way: with friction of 1e6 the first, QOCO, often fails
where the second, Clarabel, does not."""

_WHOLE = 1.0 - 1e-6
"""Share of the dead load that counts as all of it: solvers reach a limit of 1 to 1e-8."""


@dataclass(frozen=True)
class Convex(Rule):
    """One convex problem, solved until its bracket, recomputed outside the solver, is closed.

    Attributes
    ----------
    tolerance : float
        Relative width of the bracket.
    """

    name = "none"

    tolerance: float = TOLERANCE

    def __post_init__(self) -> None:
        ratio(self.tolerance, "tolerance")

    def start(self, run: Run) -> _Climb:
        """Compile."""
        run.tell(f"compiling {len(run.scene.free)} blocks x {len(run.contacts)} contacts")
        return _Climb(self, run)

    def step(self, run: Run, state: _Climb) -> _Climb:
        """One rung of the ladder, and the questions that come with it."""
        state.status = next(state.rungs)
        return state

    def is_done(self, run: Run, state: _Climb) -> Status | None:
        """When the bracket is closed, there is no answer, or no further solver."""
        return state.status

    def result(self, run: Run, state: _Climb) -> Answer:
        """The best bounds of all rungs, and what they rest on."""
        has_answer = state.status is None or state.status.has_answer
        return replace(run.best, note=_assumptions(run.best) if has_answer else state.note)


def analyse(
    scene: Scene,
    surface: str | Cone | Sequence[YieldSurface] = "conic",
    *,
    tolerance: float = TOLERANCE,
    ladder: Sequence[SolverSettings] | None = None,
    formulation: Formulation = corner_compressions,
    scaling: Scaling | None = None,
    progress: Progress | None = None,
    model: str = "auto",
) -> Solution:
    """Collapse load factor without interaction with bending, certified.

    Parameters are those of :func:`cvxlimit.solve`; ``formulation`` and ``scaling`` are for
    studies. Rungs of the ``ladder`` are climbed until the bracket, recomputed outside the solver,
    is within ``tolerance``; every rung is in the solution's history.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> solution = analyse(builtin_scene("single-block"))
    >>> str(solution.status), solution.gap < 1e-5
    ('certified', True)
    """
    rule = Convex(tolerance)
    check_scene(scene)
    whole = scene if scaling is None else Assemblage.of(scene, scaling)
    return drive(
        rule,
        Run(whole, surface, formulation=formulation, ladder=ladder, progress=progress, model=model),
    )


@dataclass(frozen=True, eq=False)
class _Fall:
    """Rates (free, 6) on which the dead load alone does work; contact forces that could stop it."""

    rates: FloatArray
    resistance: float

    @classmethod
    def of(cls, rates: FloatArray, found: Certificate) -> _Fall:
        """From the certificate with the dead load as live load; none could if it is proved."""
        if found.upper_is_proved or not found.missing_opening > 0.0:
            return cls(rates, np.inf)
        return cls(rates, 1.0 / found.missing_opening)


class _Climb:
    """The ladder under way: its rungs one by one, and how it ended."""

    def __init__(self, rule: Convex, run: Run) -> None:
        self.run, self.tolerance = run, rule.tolerance
        self.surfaces = needed_surfaces(run.surfaces)
        self.is_dead_load_solved = self.is_opening_solved = self.is_live_load_solved = False
        self._take(run.model)
        self.rungs = self._all()
        self.status: Status | None = None
        self.note = ""

    def _take(self, model: str) -> None:
        """How much model, whose certificate is that of the full scene in any case."""
        run = self.run
        with run.clock.phase("compile"):
            self.reductions = Reductions.of(run.assemblage, self.surfaces, run.formulation, model)
        with run.clock.phase("certify"):
            self.certifier = Certifier(self.reductions.assemblage, self.surfaces, run.formulation)
        self._compile(self.reductions.whole)

    def _compile(self, reduction: Reduction) -> None:
        run = self.run
        run.reductions = reduction.names
        with run.clock.phase("compile"):
            self.problem = self._compiled(reduction)
            self.ladder = run.ladder or self.problem.ladder(self.tolerance)

    def _compiled(self, reduction: Reduction) -> ReducedProblem:
        """The problem, compiled anew unless the run shares what is compiled with others."""
        assemblage, surfaces = self.reductions.assemblage, self.run.surfaces
        shared = self.run.repeats
        found = None if shared is None else shared.problem(assemblage, surfaces, reduction)
        return found or ReducedProblem(assemblage, surfaces, reduction)

    def _all(self) -> Iterator[Status | None]:
        with self.run.clock.phase("certify"):
            stands = self.certifier.witnesses.easy_dead_state is not None
        if not stands and self._falls(self._solve_dead_load()):
            yield Status.DEAD_LOAD_UNSTABLE
        if self.reductions.loaded is not None:
            self._compile(self.reductions.best(self.certifier.witnesses.easy_dead_state))
        yield from self._climbed()
        if self.run.reductions:  # none of it is believed: the full model has the last word
            self._take("full")
            yield from self._climbed()
        yield Status.LIVE_LOAD_HARMLESS if self._is_harmless() else Status.NOT_CERTIFIED

    def _climbed(self) -> Iterator[Status | None]:
        """All rungs in turn, until one has the answer."""
        for settings in self.ladder:
            state = self._attempt(settings)
            bracket = self.run.best.bracket
            if bracket.is_below_zero and self._falls(self._late_fall()):
                yield Status.DEAD_LOAD_UNSTABLE
            if bracket.is_within(self.tolerance):
                yield Status.CERTIFIED
            is_boundless = self.run.is_boundless(state.load_factor)
            if (state.outcome.claims_no_optimum or is_boundless) and self._is_harmless():
                yield Status.LIVE_LOAD_HARMLESS
            yield None

    def _attempt(self, settings: SolverSettings) -> LimitState:
        state = self.run.solve(self.problem.solve, settings)
        found = self._certificate(state)
        if not self.is_dead_load_solved and self._loses_below(found):
            self._solve_dead_load()
            found = self._certificate(state)
        if np.isfinite(found.upper) and not (found.upper_is_proved or self.is_opening_solved):
            self._solve_opening()
            found = self._certificate(state)
        run = self.run  # only now: a tighter bound with an assumption would hide the proved one
        run.best = run.best.raised(
            found.lower, found.lower_is_proved, state.load_factor, state.forces
        )
        run.best = run.best.lowered(found.upper, found.upper_is_proved, state.mechanism)
        figures = ("lower", "upper", "equilibrium_residual", "yield_excess", "flow_violation")
        self.run.note(state, settings, **{name: known(getattr(found, name)) for name in figures})
        return state

    def _loses_below(self, found: Certificate) -> bool:
        """True if forces are good for a bracket but for the reserve they are mixed with."""
        is_close = found.lower_is_proved and found.lower > 0.5 * found.upper > 0.0
        best = self.run.best.bracket.raised(found.lower, True).lowered(found.upper, False)
        return is_close and not best.is_within(self.tolerance)

    def _certificate(self, state: LimitState) -> Certificate:
        """The certificate of a state, with the reference states that are known by now."""
        self.run.tell("checking the bracket")
        with self.run.clock.phase("certify"):
            return self.certifier.of(state)

    def _falls(self, fall: _Fall | None) -> bool:
        """Note a fall, if there is one."""
        if fall is None:
            return False
        scene = self.run.scene
        self.note = f"{fallen(scene, fall.rates)}; {Status.DEAD_LOAD_UNSTABLE.advice}"
        most = fall.resistance / max(float(np.abs(scene.dead_forces[:, :3]).sum()), 1e-300)
        if most < _NO_FORCE:
            self.note += f" (contact forces beyond {most:.1g} times the dead load could hold it)"
        self.run.best = replace(self.run.best, forces=None, mechanism=fall.rates)
        return True

    def _late_fall(self) -> _Fall | None:
        """A mechanism that bounds the load factor below zero: the dead load does work on it.

        If the bound needs an assumption, the question is asked again for the dead load alone.
        """
        best = self.run.best
        if best.bracket.upper_is_proved and best.mechanism is not None:
            return _Fall(self.certifier.opened(best.mechanism), np.inf)
        return self._solve_dead_load()

    def _solve_dead_load(self) -> _Fall | None:
        """Give the certifier forces that carry the dead load well inside all surfaces.

        An interior-point solver ends in the middle of all such forces, far deeper inside than
        projections do. Where there are none, returns rates on which the dead load alone does
        work, allowed by the flow rule.

        Asks for the largest share t <= 1 of the dead load that can be carried. Without constants
        in the conditions it is 1 if the dead load stands and 0 if not, so an upper bound below
        1 / 2 is a proof; with them only one below 1 is.
        """
        self.is_dead_load_solved = True
        scene = self.run.scene
        if not np.any(scene.dead_forces):
            return None
        self.run.tell("checking that the dead load can stand")
        alone = scene.with_live(scene.dead).with_dead(Load())
        enough = 0.5 if self.certifier.strength.is_cone else _WHOLE
        surfaces, formulation = self.run.surfaces, self.run.formulation
        for state, certificate in self._shares(alone, "dead load alone", surfaces, formulation):
            forces = self.certifier.given(state)
            if forces is not None and state.load_factor and state.load_factor > enough:
                if self.certifier.offer_dead_state(forces / state.load_factor):
                    return None
            elif state.mechanism is not None and (bounds := certificate()).upper < enough:
                return _Fall.of(state.mechanism, bounds)
        return None

    def _solve_opening(self) -> None:
        """Give the certifier rates that open every contact, unless blocks wedge each other."""
        self.is_opening_solved = True
        self.run.tell("checking that blocks do not wedge each other")
        with self.run.clock.phase("compile"):
            problem = self._asked(self.reductions.assemblage, self.surfaces, LargestSelfStress())
        for settings in problem.ladder()[:_RUNGS_ASIDE]:
            state = self.run.solve(problem.solve, settings)
            self._note_aside(settings, "self-stress", state)
            if state.mechanism is not None and self.certifier.offer_opening_field(state.mechanism):
                return

    def _is_harmless(self) -> bool:
        """True if forces carry the live load alone, hence any multiple of it; asked once."""
        if self.is_live_load_solved:
            return False
        self.is_live_load_solved = True
        run, scene = self.run, self.run.scene
        run.tell("checking whether the live load does any harm")
        surfaces, formulation = self.certifier.strength.recession()
        loaded = self.reductions.assemblage.under(scene.with_dead(scene.live))
        alone = scene.with_dead(Load())
        for state, certificate in self._shares(alone, "live load alone", surfaces, formulation):
            given = self.certifier.given(state)
            if given is not None and state.load_factor and state.load_factor > 0.5:
                with run.clock.phase("certify"):
                    forces = borne(
                        loaded,
                        lambda reached: Strength(reached, surfaces, formulation),
                        given / state.load_factor,
                    )
                if forces is not None:
                    run.best = replace(run.best, forces=forces, mechanism=None)
                    self.note = Status.LIVE_LOAD_HARMLESS.advice
                    return True
            elif certificate().upper < 0.5:
                break
        return False

    def _shares(
        self,
        scene: Scene,
        what: str,
        surfaces: Sequence[YieldSurface],
        formulation: Formulation,
    ) -> Iterator[tuple[LimitState, Callable[[], Certificate]]]:
        """Climb the first rungs on the question which share <= 1 of the live load is carried.

        Certificates are computed when called for.
        """
        with self.run.clock.phase("compile"):
            assemblage = self.reductions.assemblage.under(scene)
            problem = self._asked(assemblage, surfaces, LargestFactor(most=1.0), formulation)
            certifier = Certifier(assemblage, problem.surfaces, formulation)

        def certified(state: LimitState) -> Certificate:
            with self.run.clock.phase("certify"):
                return certifier.of(state)

        for settings in self.ladder[:_RUNGS_ASIDE]:
            state = self.run.solve(problem.solve, settings)
            self._note_aside(settings, what, state)
            yield state, partial(certified, state)

    def _asked(
        self,
        assemblage: Assemblage,
        surfaces: Sequence[YieldSurface],
        objective: Objective,
        formulation: Formulation | None = None,
    ) -> LimitProblem | ReducedProblem:
        """A question on the way, about all parts of the scene."""
        if formulation is not None and formulation is not self.run.formulation:
            return LimitProblem(assemblage, surfaces, formulation, objective)
        return ReducedProblem(assemblage, surfaces, self.reductions.whole, objective)

    def _note_aside(self, settings: SolverSettings, what: str, state: LimitState) -> None:
        """A line of the history for a solve that is not about the load factor."""
        self.run.note(replace(state, load_factor=None), f"{settings}, {what}")


PROVED = "both bounds are proved, up to rounding"
"""The note of a solution whose bracket needs no assumption."""


def _assumptions(answer: Answer) -> str:
    assumed = []
    if not answer.bracket.lower_is_proved:
        assumed.append(
            f"no rate of the exact mechanism exceeds {REFERENCE:g} times the largest found"
        )
    if not answer.bracket.upper_is_proved:
        most = f"{REFERENCE:g} times the total load or the largest one found"
        assumed.append(f"no exact contact force exceeds {most}")
    return "the bracket holds if " + " and ".join(assumed) if assumed else PROVED
