"""One driver for all methods: clock, history, solver ladder, progress, interruption, packing.

A method is a :class:`Method`: settings in a frozen dataclass, and one generator, which solves
problem after problem. What is alike in all of them happens here, once:

1. :class:`Run`: the scene's contacts and mechanics, and the record of solves and the best answer;
2. :func:`drive`: the generator, to its end or to an interruption;
3. :func:`packed`: the best answer as a solution, with a note on what it rests on.
"""

from __future__ import annotations

import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.progressbar import LOG, Progress, told_to
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.methods.answer import Answer
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.crushing import about_cells
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.mortar import Mortar
from cvxlimit.model.statics import DOF, Scaling
from cvxlimit.proof.strength import ContactFlow
from cvxlimit.readings.moments import INDEPENDENT, Moments
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solution import Iterate, Solution, Status
from cvxlimit.solution.bracket import Bracket, known, rounded
from cvxlimit.solution.kinematics import Dilatancy
from cvxlimit.solvers import LimitState, Outcome, SolverSettings, ladder_of, versions
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.coulomb import refuse_lost_cohesion, surfaces_of, words_of

Solver = Callable[[SolverSettings], LimitState]
"""One run of one solver on a problem: ``LimitProgram(scene).run``, for example."""

BOUNDLESS = 1e6
"""Load factor, over dead load / live load of the loaded blocks, beyond which one asks whether the
live load does any harm: no loads are meant to be so large."""


class Clock:
    """Seconds by phase; phases inside phases count once, for the inner one."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(("detect", "compile", "solve", "certify"), 0.0)
        self.started = time.perf_counter()

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self.started

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time inside ``with`` to a phase, but for what is booked meanwhile."""
        start, booked = time.perf_counter(), sum(self.seconds.values())
        try:
            yield
        finally:
            inside = sum(self.seconds.values()) - booked
            self.seconds[name] += time.perf_counter() - start - inside


class ProgressLine(str):
    """A line of progress; ``has_bracket`` is true once the run would return one if interrupted."""

    has_bracket = False


class Run:
    """One analysis under way: the scene, and the record of its solves.

    Attributes
    ----------
    assemblage : Assemblage
        Of the scene, computed once.
    given : Scene
        The scene as it was given; mortar may have become loads in :attr:`scene`.
    contacts : Contacts
        Those of the scene as it was given.
    mortar : Mortar or None
        What makes forces of the scene as it was given from those of :attr:`scene`; None without
        tensile strength and least reactions.
    surfaces : tuple of YieldSurface, surface : str
        Those asked for, and the name that stands for all of them.
    moments : Moments
        How interaction adds moments.
    formulation : Formulation
    ladder : tuple of SolverSettings or None
        The solvers asked for, in their order; None leaves the choice to the method.
    verbose : bool
        Whether solvers' own logs are handed through.
    model : str
        How much model: one of :data:`~cvxlimit.reductions.choice.MODELS`.
    reductions : tuple of str
        Names of the reductions that the method used.
    clock : Clock
        Seconds of this run, by phase.
    history : list of Iterate
        A line for each solve, which :meth:`note` adds.
    best : Answer
        The best answer so far, which is returned if the run is interrupted.
    solvers : set of str, attempts : list of (SolverSettings, Outcome)
        The solvers that ran, and how each run ended.
    remarks : list of str
        Sentences of the solution's note.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.model.program import LimitProgram
    >>> run = Run(builtin_scene("single-block"))
    >>> state = run.solve(LimitProgram(run.assemblage).run, SolverSettings("CLARABEL"))
    >>> round(state.load_factor, 5), run.clock.seconds["solve"] > 0.0
    (0.4, True)
    """

    def __init__(
        self,
        scene: Scene | Assemblage,
        surface: str | Cone | Sequence[YieldSurface] = "conic",
        moments: Moments = INDEPENDENT,
        formulation: Formulation = corner_compressions,
        ladder: Sequence[str | SolverSettings] | str | SolverSettings | None = None,
        progress: Progress = None,
        model: str = "auto",
        verbose: bool = False,
    ) -> None:
        self.surfaces, self.surface = surfaces_of(surface)
        self.model = model
        self.reductions: tuple[str, ...] = ()
        self.moments, self.formulation = moments, formulation
        self.ladder = None if ladder is None else ladder_of(ladder)
        self.verbose = verbose
        self.progress = told_to(progress)
        self.clock = Clock()
        self.history: list[Iterate] = []
        self.solvers: set[str] = set()
        self.attempts: list[tuple[SolverSettings, Outcome]] = []
        self.remarks: list[str] = []
        # contacts, which scenes find when they are first asked for them
        self.tell("finding contacts")
        if not isinstance(scene, Assemblage):
            check_scene(scene)
        with self.clock.phase("detect"):
            self.contacts = scene.contacts
        if np.any(self.contacts.cohesion):
            refuse_lost_cohesion(self.surfaces, self.contacts)
        # mechanics: a scene whose mortar bears tension is solved as one without, under another load
        with self.clock.phase("compile"):
            self.assemblage = as_given = Assemblage.of(scene)
            self.given = as_given.scene
            self.mortar = Mortar.of(self.given) if self.contacts.pulls else None
            if self.mortar is not None:
                scaling = as_given.scaling if as_given is scene else None
                self.assemblage = Assemblage.of(self.mortar.scene, scaling)
        # nothing is known yet
        self.best = Answer(bracket=Bracket(least=self.scaling.least))

    @property
    def scene(self) -> Scene:
        """What is analysed."""
        return self.assemblage.scene

    @property
    def scaling(self) -> Scaling:
        """Units inside solvers."""
        return self.assemblage.scaling

    @property
    def cone(self) -> Cone:
        """The cone of the surface asked for, for methods that bring their own surfaces."""
        return self.surfaces[-1].cone

    def solve(self, solver: Solver, settings: SolverSettings) -> LimitState:
        """One run of one solver, on the clock: what the solver does not report as time of its own
        counts as compiling.

        Raises
        ------
        ModelError
            If no solver of the ladder asked for can take the first problem.
        """
        self.tell(f"solving with {settings}")
        with self.clock.phase("compile"):
            state = solver(replace(settings, verbose=True) if self.verbose else settings)
            self.clock.seconds["solve"] += state.outcome.solve_seconds
        if not state.outcome.refusal:
            self.solvers.add(settings.name)
            self.attempts.append((settings, state.outcome))
        # A refusal ends the run where none has run, and no solver asked for takes cones.
        elif self.ladder and not (self.attempts or any(s.row.has_cones for s in self.ladder)):
            raise ModelError(f"no solver asked for can solve this: {state.outcome.refusal}")
        return state

    def try_solvers(
        self, solver: Solver, ladder: Sequence[SolverSettings]
    ) -> tuple[LimitState, SolverSettings]:
        """Run the solvers of a ladder, one at least, until one has forces or claims that there is
        no optimum; returns its answer, or that of the last one, and its settings."""
        for settings in ladder:
            state = self.solve(solver, settings)
            if state.forces is not None or state.outcome.claims_no_optimum:
                break
        return state, settings

    def tell(self, message: str) -> None:
        """Report a step to the caller's ``progress`` and to the log."""
        LOG.info(message)
        if self.progress is not None:
            self.progress(message)

    def note(self, state: LimitState, solver: object, **figures: float | None) -> None:
        """A line of the history; ``figures`` are those of :class:`Iterate`."""
        outcome, factor = state.outcome, state.load_factor
        seconds = outcome.compile_seconds + outcome.solve_seconds
        self.history.append(Iterate(factor, seconds, str(solver), outcome.status, **figures))
        if self.progress is None and not LOG.isEnabledFor(logging.INFO):
            return
        bracket = self.best.bracket
        if bracket.contradicts:
            result = str(Status.CONTRADICTED)
        elif bracket.has_any:
            result = f"load factor in {bracket}"
        else:
            result = outcome.status if factor is None else f"iterate {rounded(factor, 5)}"
        line = ProgressLine(f"{result} (solve {len(self.history)}, {solver})")
        line.has_bracket = bracket.has_any
        self.tell(line)

    def change(self, state: LimitState) -> float | None:
        """Relative change of the load factor from the last one of the history (Eq. 43); None where
        one of them has none."""
        before = self.history[-1].load_factor if self.history else None
        factor = state.load_factor
        if before is None or factor is None:
            return None
        return abs(factor - before) / self.scaling.unit(factor)

    @property
    def load_factors(self) -> list[float | None]:
        """Those of the history."""
        return [iterate.load_factor for iterate in self.history]

    @property
    def failure(self) -> str:
        """How solvers ended since one of them last had an answer, in words."""
        ended: dict[str, str] = {}
        for settings, outcome in self.attempts:
            if outcome.has_values:
                ended.clear()
            else:
                ended[str(settings)] = outcome.status
        return "; ".join(f"solver {name}: {status}" for name, status in ended.items())

    @property
    def bounds(self) -> dict[str, float | None]:
        """The best bounds so far, for the history."""
        return {"lower": known(self.best.bracket.lower), "upper": known(self.best.bracket.upper)}

    def is_boundless(self, load_factor: float | None) -> bool:
        """True for a load factor beyond :data:`BOUNDLESS`: where there is no limit solvers return
        1e9 to 1e14."""
        return load_factor is not None and abs(load_factor) > BOUNDLESS * self.scaling.ratio

    def by_block(self, mechanism: FloatArray | None) -> dict[str, FloatArray] | None:
        """Rates (6,) of the free blocks by id, of a mechanism (free blocks, 6)."""
        if mechanism is None:
            return None
        ids = [self.scene.blocks[i].id for i in self.scene.free]
        return dict(zip(ids, np.reshape(mechanism, (-1, DOF)), strict=True))

    def auxiliary_run(self, assemblage: Assemblage | None = None) -> Run:
        """A run for a question aside: history, answer and remarks of its own; clock, solvers and
        attempts are this run's, since they count for the whole analysis."""
        result = copy(self)
        result.assemblage, result.history = assemblage or self.assemblage, []
        result.best, result.remarks = Answer(bracket=Bracket(least=result.scaling.least)), []
        return result


Steps = Generator[None, None, Status]
"""Problems solved one by one; what it returns is how the method ended."""


@dataclass(frozen=True)
class Method(ABC):
    """A method: settings, and one generator that solves problem after problem.

    To add one, subclass it as a frozen dataclass whose fields are the settings, and write
    :meth:`steps`. :func:`cvxlimit.solve` takes an instance as ``method`` and sets ``tolerance``
    and ``moments`` where they are fields.

    Attributes
    ----------
    name : str
        What the solution calls it.
    answers : str
        What it answers, in a line for lists of methods.
    axis : str
        Attribute of a solution that holds the name where the method answers another question than
        the plain one: ``"interaction"``, ``"flow"`` or ``"torsion_shear"``; else empty.
    surfaces : tuple of str
        Kinds of surfaces that it goes with: ``"conic"``, ``"facets"``, ``"parabolic"``, ``"own"``.
    takes : tuple of str
        What it takes besides dry contacts: keys of :data:`cvxlimit.methods.solving.EXTRAS`.
    reduces : bool
        Whether it takes less than all of the scene where that is enough.
    usual : float or None
        Width of a bracket that counts as closed where no tolerance is asked for, if that is not the
        default of the setting.
    """

    name: ClassVar[str]
    answers: ClassVar[str] = ""
    axis: ClassVar[str] = ""
    surfaces: ClassVar[tuple[str, ...]] = ("conic", "facets", "parabolic", "own")
    takes: ClassVar[tuple[str, ...]] = ("formulation", "reactions", "cohesion", "strength")
    reduces: ClassVar[bool] = True
    usual: ClassVar[float | None] = None

    @abstractmethod
    def steps(self, run: Run) -> Steps:
        """Yield after every problem that the run has solved; return how it ended.

        ``run.best`` always holds the best answer so far, with bounds only if they bound the answer
        asked for; ``run.remarks`` holds the sentences of the solution's note.
        """

    def flow(self, contacts: Contacts) -> ContactFlow | None:
        """The flow rule that upper bounds rest on, where it is not that of the surfaces."""
        return None

    def basis(self, run: Run) -> str:
        """What the bounds of ``run.best`` rest on, in a sentence."""
        basis, cells = run.best.bracket.basis, about_cells(run.formulation, run.contacts)
        return "; ".join(filter(None, (basis, cells)))


def drive(method: Method, run: Run) -> Solution:
    """Follow a method to its end.

    Interrupted (Ctrl-C), a run that has bounds or members returns them with
    :attr:`Status.INTERRUPTED <cvxlimit.solution.Status.INTERRUPTED>`; others leave the
    interruption to the caller.
    """
    steps = method.steps(run)
    try:
        while True:
            next(steps)
    except StopIteration as end:
        status = end.value
    except KeyboardInterrupt:
        if not (run.best.bracket.has_any or run.best.members):
            raise
        status = Status.INTERRUPTED
    return packed(method, run, status)


def packed(method: Method, run: Run, status: Status) -> Solution:
    """The run's best answer as a solution."""
    best, status = _claimed(run, status)
    # which question that answers: surface, flow rule, interaction, one of which the method names
    question: dict[str, Any] = {"interaction": "none", **words_of(run.surfaces, run.surface)}
    if method.axis:
        question[method.axis] = method.name
    is_unproved = status.has_answer and not (status.is_good or best.bracket.has_any)
    is_unasked = method.axis == "flow" or is_unproved
    dilatancy = None if is_unasked else best.dilatancy_in(run.assemblage)
    return Solution(
        **question,
        scene_name=run.scene.name,
        moments=run.moments.name,
        blocks=len(run.scene.free),
        contacts=len(run.contacts),
        load_factor=best.load_factor,
        bracket=best.bracket,
        status=status,
        history=tuple(run.history),
        seconds={**run.clock.seconds, "total": run.clock.elapsed},
        forces=best.forces,
        mechanism=run.by_block(best.mechanism),
        note=_note(method, run, status, dilatancy),
        versions=versions(run.solvers),
        members=best.members,
        searches=best.searches,
        dilatancy=dilatancy,
        iteration=best.iteration,
        from_rest=best.from_rest,
        internal=best.internal,
        lower_end=best.lower_end,
        reference=best.reference,
        beside=best.beside,
        model=run.reductions,
        solved_scene=run.given,
        surfaces=run.surfaces,
        tolerance=getattr(method, "tolerance", None),
    )


def _claimed(run: Run, status: Status) -> tuple[Answer, Status]:
    """What is claimed of the best answer, and how the run ended: bounds overrule what the method
    says, and so do solvers that all failed."""
    # where no load factor exists, one up to which all is safe without dilatancy may be left
    best, has_answer = run.best, status.has_answer
    if not has_answer:
        safe = 0.0 if best.dilatancy is None else best.dilatancy.safe
        bracket = Bracket().raised(safe, True) if safe > 0.0 else Bracket()
        best = replace(best, load_factor=None, bracket=bracket, reference=None)
    # forces of the scene as it was given: mortar's tension may have become a load in the other
    if run.mortar is not None:
        best = best.with_forces(run.mortar.original)
    brackets = [best.bracket] if best.lower_end is None else [best.bracket, best.lower_end.bracket]
    if any(bracket.contradicts for bracket in brackets):
        # neither bound is one, nor is what it rests on; solutions found on the way stay
        status, least = Status.CONTRADICTED, Bracket(least=best.bracket.least)
        kept = best if best.members else Answer(searches=best.searches)
        best = replace(kept, bracket=least, lower_end=None, reference=None)
    elif has_answer and best.load_factor is None and not best.bracket.has_any and run.attempts:
        # a solver has said something if it returned values or claims that there is no optimum
        ends = [end.has_values or end.claims_no_optimum for _, end in run.attempts]
        status = status if any(ends) else Status.SOLVER_FAILED
    # a load factor that nothing supports stays in the history alone; others are within the bracket
    if not (status.is_good or best.bracket.has_any or best.members or best.from_rest):
        best = replace(best, load_factor=None)
    if best.load_factor is not None:
        best = replace(best, load_factor=best.bracket.clipped(best.load_factor))
    return best, status


def _note(method: Method, run: Run, status: Status, dilatancy: Dilatancy | None) -> str:
    """The solution's note: how it ended, what the bounds rest on, and what to know besides."""
    # without an answer the remarks say why, and advice is left out where there is more to tell
    if not status.has_answer:
        is_told = run.best.lower_end is not None or dilatancy is not None
        sentences = [*run.remarks, "" if is_told else status.advice]
    elif status is Status.SOLVER_FAILED:
        sentences = [run.failure, status.advice]
    elif status is Status.CONTRADICTED:
        sentences = [f"{status}: {status.advice}"]
    else:
        basis = method.basis(run) if run.best.bracket.has_any else ""
        sentences = [basis, *run.remarks]
        # what to do comes first, or last where it is known how far an iteration went; no advice to
        # use the method that has just failed
        is_its_own = f"'{method.name}'" in status.advice
        if not (status.is_good or status is Status.NOT_CERTIFIED or is_its_own):
            place = 0 if run.best.iteration is None else len(sentences)
            sentences.insert(place, status.advice)
    # what detection has left out or simplified, where that may have decided
    if status is Status.DEAD_LOAD_UNSTABLE and run.given.near_misses:
        cure = "if such a joint bears, give a joint_tolerance that joins it"
        sentences.append(f"{run.given.near_miss_note}: {cure}")
    sentences += run.given.doubts
    lumped = run.given.lumped
    sentences.append(str(lumped) if lumped is not None and lumped.is_worth_a_word else "")
    sentences.append("" if dilatancy is None else str(dilatancy))
    return "; ".join(filter(None, sentences))
