"""From a scene to a certified solution: the ladder of solvers, and proofs that no answer exists."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cvxlimit.checks import ratio
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.problem import LargestFactor, LargestSelfStress, LimitProblem
from cvxlimit.model.statics import DOF, Scaling
from cvxlimit.proof.certificate import REFERENCE, Certificate, Certifier
from cvxlimit.scene import Load, Scene, check_scene
from cvxlimit.solution import PROVED, Iterate, Solution, Status
from cvxlimit.solvers import LimitState, SolverSettings, suits
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.presets import surfaces_of

FloatArray = NDArray[np.float64]
Progress = Callable[[str], None]

TOLERANCE = 1e-5
"""Default width of the bracket, relative to its upper end."""

_WHOLE = 1.0 - 1e-6
"""Share of the dead load that counts as all of it: solvers reach a limit of 1 to 1e-8."""

ROUNDING = 1e-9
"""Relative disagreement of two bounds that is put down to rounding."""


@dataclass
class Clock:
    """Seconds by phase."""

    seconds: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("detect", "compile", "solve", "certify"), 0.0)
    )
    started: float = field(default_factory=time.perf_counter)

    def measure(self, phase: str, since: float) -> None:
        """Add the time since ``since`` to a phase."""
        self.seconds[phase] += time.perf_counter() - since

    def report(self) -> dict[str, float]:
        """All phases and the total."""
        return {**self.seconds, "total": time.perf_counter() - self.started}


def analyse(
    scene: Scene,
    surface: str | Cone | Sequence[YieldSurface] = "conic",
    *,
    tolerance: float = TOLERANCE,
    ladder: Sequence[SolverSettings] | None = None,
    formulation: Formulation = corner_compressions,
    scaling: Scaling | None = None,
    progress: Progress | None = None,
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
    check_scene(scene)
    ratio(tolerance, "tolerance")
    tell = progress or (lambda message: None)
    surfaces, name = surfaces_of(surface)
    clock = Clock()
    tell("finding contacts")
    start = time.perf_counter()
    contacts = scene.contacts
    clock.measure("detect", start)
    tell(f"compiling {len(scene.free)} blocks x {len(contacts)} contacts")
    start = time.perf_counter()
    assemblage = Assemblage.of(scene, scaling)
    problem = LimitProblem(assemblage, surfaces, formulation)
    clock.measure("compile", start)
    ladder = ladder or problem.ladder(tolerance)
    run = _Run(assemblage, name, problem, surfaces, formulation, tolerance, ladder, clock, tell)
    return run.solution()


@dataclass(frozen=True, eq=False)
class _Fall:
    """Rates (free, 6) on which the dead load alone does work; whether that needs no assumption."""

    rates: FloatArray
    is_proved: bool


class _Run:
    """State of one analysis: attempts so far and the best bracket."""

    def __init__(
        self,
        assemblage: Assemblage,
        name: str,
        problem: LimitProblem,
        surfaces: tuple[YieldSurface, ...],
        formulation: Formulation,
        tolerance: float,
        ladder: Sequence[SolverSettings],
        clock: Clock,
        tell: Progress,
    ) -> None:
        self.assemblage, self.scene, self.name = assemblage, assemblage.scene, name
        self.problem, self.surfaces, self.formulation = problem, surfaces, formulation
        self.tolerance, self.clock, self.tell = tolerance, clock, tell
        self.ladder = [settings for settings in ladder if suits(settings, problem.problem)]
        start = time.perf_counter()
        self.certifier = Certifier(assemblage, problem.surfaces, formulation)
        clock.measure("certify", start)
        self.history: list[Iterate] = []
        self.is_dead_load_solved = self.is_opening_solved = False
        self.lower: tuple[float, bool, LimitState | None] = (-np.inf, False, None)
        self.upper: tuple[float, bool, LimitState | None] = (np.inf, False, None)

    def solution(self) -> Solution:
        start = time.perf_counter()
        stands = self.certifier.witnesses.easy_dead_state is not None
        self.clock.measure("certify", start)
        if not stands:
            fall = self._solve_dead_load()
            if fall is not None:
                return self._without_answer(Status.DEAD_LOAD_UNSTABLE, fall=fall)
        asked = False
        for settings in self.ladder:
            state = self._attempt(settings)
            if self._is_closed():
                return self._finished(Status.CERTIFIED)
            if state.outcome.claims_no_optimum and not asked:
                asked = True
                forces = self._forces_for_live_load_alone()
                if forces is not None:
                    return self._without_answer(Status.LIVE_LOAD_HARMLESS, forces=forces)
        forces = None if asked else self._forces_for_live_load_alone()
        if forces is not None:
            return self._without_answer(Status.LIVE_LOAD_HARMLESS, forces=forces)
        return self._finished(Status.NOT_CERTIFIED)

    def _attempt(self, settings: SolverSettings) -> LimitState:
        self.tell(f"solving with {settings}")
        state = self.problem.solve(settings)
        self._book(state)
        certificate = self._certified(state)
        if not (self._is_closed() or self.is_dead_load_solved) and self._loses_below(certificate):
            self._solve_dead_load()
            certificate = self._certified(state)
        if np.isfinite(certificate.upper) and not (
            certificate.upper_is_proved or self.is_opening_solved
        ):
            self._solve_opening()
            certificate = self._certified(state)
        self.history.append(_iterate(settings, state, certificate))
        return state

    def _certified(self, state: LimitState) -> Certificate:
        """The certificate of a state; its bounds are kept where they are better."""
        self.tell("checking the bracket")
        start = time.perf_counter()
        c = self.certifier.of(state)
        self.clock.measure("certify", start)
        if c.lower > self.lower[0]:
            self.lower = (c.lower, c.lower_is_proved, state)
        proved = c.upper_is_proved and not self.upper[1]
        if c.upper < self.upper[0] * (1.0 + proved * ROUNDING):
            self.upper = (c.upper, c.upper_is_proved, state)
        return c

    def _loses_below(self, certificate: Certificate) -> bool:
        """True if forces are good for a bracket but for the reserve they are mixed with."""
        return certificate.lower_is_proved and certificate.lower > 0.5 * certificate.upper > 0.0

    def _book(self, state: LimitState) -> None:
        self.clock.seconds["compile"] += state.outcome.compile_seconds
        self.clock.seconds["solve"] += state.outcome.solve_seconds

    def _is_closed(self) -> bool:
        """Bracket within the tolerance; one that holds zero is measured by a natural unit."""
        lower, upper = self.lower[0], self.upper[0]
        if not (np.isfinite(lower) and np.isfinite(upper)):
            return False
        return abs(upper - lower) <= self.tolerance * self._unit() and not self._contradicts()

    def _unit(self) -> float:
        if self.lower[0] > 0.0:
            return max(self.upper[0], self.lower[0])
        return self.problem.scaling.unit(self.lower[0], self.upper[0])

    def _contradicts(self) -> bool:
        """Lower bound above the upper one by more than rounding."""
        return self.lower[0] - self.upper[0] > ROUNDING * self._unit()

    def _finished(self, status: Status) -> Solution:
        lower, lower_proved, static = self.lower
        upper, upper_proved, kinematic = self.upper
        note = _assumptions(lower_proved, upper_proved)
        if self._contradicts():
            status = Status.NOT_CERTIFIED
            note = "the bounds contradict each other, so an assumption behind them fails; " + note
        factor = None if static is None else static.load_factor
        if factor is not None:
            factor = float(np.clip(factor, lower, max(lower, upper)))
        return self._solution(
            status,
            factor,
            (lower, upper),
            None if static is None else static.forces,
            None if kinematic is None else kinematic.mechanism,
            note,
        )

    def _without_answer(
        self,
        status: Status,
        forces: FloatArray | None = None,
        fall: _Fall | None = None,
    ) -> Solution:
        note = status.advice
        if fall is None:
            return self._solution(status, None, (-np.inf, np.inf), forces, None, note)
        power = (fall.rates * self.scene.dead_forces).sum(axis=1)
        falling = self.scene.blocks[self.scene.free[int(power.argmax())]]
        note = f"block {falling.id!r} falls; {note}"
        if not fall.is_proved:
            note += f" (it would stand on contact forces beyond {REFERENCE:g} times the total load)"
        return self._solution(status, None, (-np.inf, np.inf), forces, fall.rates, note)

    def _solution(
        self,
        status: Status,
        factor: float | None,
        bounds: tuple[float, float],
        forces: FloatArray | None,
        mechanism: FloatArray | None,
        note: str,
    ) -> Solution:
        return Solution(
            scene=self.scene.name,
            surface=self.name,
            interaction="none",
            moments="independent",
            blocks=len(self.scene.free),
            contacts=len(self.scene.contacts),
            load_factor=factor,
            lower=bounds[0],
            upper=bounds[1],
            status=status,
            history=tuple(self.history),
            seconds=self.clock.report(),
            forces=forces,
            mechanism=by_block(self.scene, mechanism),
            note=note,
        )

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
        if not np.any(self.scene.dead_forces):
            return None
        self.tell("checking that the dead load can stand")
        alone = self.scene.with_live(self.scene.dead).with_dead(Load())
        enough = 0.5 if self.certifier.strength.is_cone else _WHOLE
        for state, certificate in self._shares(alone, "dead load alone", self.surfaces):
            forces = self.certifier.given(state)
            if forces is not None and state.load_factor and state.load_factor > enough:
                if self.certifier.offer_dead_state(forces / state.load_factor):
                    return None
            elif state.mechanism is not None and (bounds := certificate()).upper < enough:
                return _Fall(state.mechanism, bounds.upper_is_proved)
        return None

    def _solve_opening(self) -> None:
        """Give the certifier rates that open every contact, unless blocks wedge each other."""
        self.is_opening_solved = True
        self.tell("checking that blocks do not wedge each other")
        start = time.perf_counter()
        problem = LimitProblem(
            self.assemblage, self.surfaces, self.formulation, LargestSelfStress()
        )
        self.clock.measure("compile", start)
        state = problem.solve()
        self._book(state)
        self._note_aside(problem.ladder()[0], "self-stress", state)
        if state.mechanism is not None:
            self.certifier.offer_opening_field(state.mechanism)

    def _forces_for_live_load_alone(self) -> FloatArray | None:
        """Forces (contacts, 6) that carry the live load alone, hence any multiple of it."""
        self.tell("checking whether the live load does any harm")
        alone = self.scene.with_dead(Load())
        surfaces = self.certifier.strength.recession()
        loaded = self.assemblage.under(self.scene.with_dead(self.scene.live))
        certifier = Certifier(loaded, surfaces, self.formulation)
        for state, certificate in self._shares(alone, "live load alone", surfaces):
            given = certifier.given(state)
            if given is not None and state.load_factor and state.load_factor > 0.5:
                forces = given / state.load_factor
                if certifier.bears(forces):
                    return certifier.strength.forces(forces)
            elif certificate().upper < 0.5:
                break
        return None

    def _shares(
        self, scene: Scene, what: str, surfaces: Sequence[YieldSurface]
    ) -> Iterator[tuple[LimitState, Callable[[], Certificate]]]:
        """Climb the first rungs on the question which share <= 1 of the live load is carried.

        Certificates are computed when called for.
        """
        start = time.perf_counter()
        assemblage = self.assemblage.under(scene)
        reach = LargestFactor(most=1.0)
        problem = LimitProblem(assemblage, surfaces, self.formulation, reach)
        self.clock.measure("compile", start)
        certifier = Certifier(assemblage, problem.surfaces, self.formulation)

        def certified(state: LimitState) -> Certificate:
            start = time.perf_counter()
            result = certifier.of(state)
            self.clock.measure("certify", start)
            return result

        for settings in self.ladder[:2]:
            state = problem.solve(settings)
            self._book(state)
            self._note_aside(settings, what, state)
            yield state, partial(certified, state)

    def _note_aside(self, settings: SolverSettings, what: str, state: LimitState) -> None:
        """A line of the history for a solve that is not about the load factor."""
        seconds = state.outcome.compile_seconds + state.outcome.solve_seconds
        name, status = f"{settings}, {what}", state.outcome.status
        self.history.append(Iterate(load_factor=None, seconds=seconds, solver=name, status=status))


def _iterate(settings: SolverSettings, state: LimitState, certificate: Certificate) -> Iterate:
    def known(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    return Iterate(
        load_factor=state.load_factor,
        seconds=state.outcome.compile_seconds + state.outcome.solve_seconds,
        solver=str(settings),
        status=state.outcome.status,
        lower=known(certificate.lower),
        upper=known(certificate.upper),
        equilibrium_residual=known(certificate.equilibrium_residual),
        yield_excess=known(certificate.yield_excess),
        flow_violation=known(certificate.flow_violation),
    )


def _assumptions(lower_is_proved: bool, upper_is_proved: bool) -> str:
    assumed = []
    if not lower_is_proved:
        assumed.append(
            f"no rate of the exact mechanism exceeds {REFERENCE:g} times the largest found"
        )
    if not upper_is_proved:
        most = f"{REFERENCE:g} times the total load or the largest one found"
        assumed.append(f"no exact contact force exceeds {most}")
    if not assumed:
        return PROVED
    return "the bracket holds if " + " and ".join(assumed)


def by_block(scene: Scene, mechanism: FloatArray | None) -> dict[str, FloatArray] | None:
    """A mechanism (free, 6) as rates by block id."""
    if mechanism is None:
        return None
    rows = np.asarray(mechanism).reshape(-1, DOF)
    return {scene.blocks[i].id: rates for i, rates in zip(scene.free, rows, strict=True)}
