"""Methods that are compared, one class per kind, and the rows of their results."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

from cvxlimit.errors import ModelError
from cvxlimit.methods import driver
from cvxlimit.methods.driver import Clock
from cvxlimit.methods.solving import solve
from cvxlimit.methods.table import TABLE, check_choice, chosen
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.program import LimitProgram
from cvxlimit.proof.certificate import Certifier
from cvxlimit.readings.named import parse_moments
from cvxlimit.reductions.choice import MODELS
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import Bracket, known
from cvxlimit.solvers import (
    SolverSettings,
    blockwise,
    check_installed,
    default_ladder,
)
from cvxlimit.surfaces import Cone, Facets, YieldSurface
from cvxlimit.surfaces.coulomb import surfaces_of

PHASES = ("detect", "compile", "reparametrise", "solve", "certify")
"""Phases that are timed separately: contact detection, building and canonicalising the problem, the
same again for changed Parameters, the solver, and the bracket."""


@dataclass(frozen=True)
class Row:
    """One method on one scene: one run, or medians over several; None where there is no figure.

    ``error`` is relative to the reference, so that what a linearisation loses counts. Seconds by
    phase, and in ``total`` from the scene to the answer, contact detection included; memory in
    MB where runs have processes of their own. ``reason`` says why there is no answer, and is
    empty otherwise.
    """

    scene: str = ""
    blocks: int = 0
    contacts: int = 0
    method: str = ""
    line: str = ""
    surface: str = ""
    formulation: str = ""
    solver: str = ""
    tolerance: str = ""
    interaction: str = ""
    moments: str = ""
    parameters: str = ""
    status: str = "failed"
    reason: str = ""
    runs: int = 0
    load_factor: float | None = None
    lower: float | None = None
    upper: float | None = None
    error: float | None = None
    reference_lower: float | None = None
    reference_upper: float | None = None
    reference: str = ""
    detect: float | None = None
    compile: float | None = None
    reparametrise: float | None = None
    solve: float | None = None
    certify: float | None = None
    total: float | None = None
    total_min: float | None = None
    total_max: float | None = None
    memory: float | None = None
    facets: int | None = None

    @classmethod
    def of(cls, solution: Solution, started: float) -> Row:
        """Returns the row of one run that began at ``started``, by :func:`time.perf_counter`."""
        bracket = solution.bracket
        seconds: dict[str, Any] = {k: v for k, v in solution.seconds.items() if k in PHASES}
        return cls(
            status=str(solution.status), load_factor=solution.load_factor,
            lower=known(bracket.lower), upper=known(bracket.upper),
            total=time.perf_counter() - started, **seconds,
        )  # fmt: skip

    @property
    def failed(self) -> bool:
        return bool(self.reason)

    @property
    def has_point(self) -> bool:
        return self.total is not None and self.error is not None

    @property
    def truth(self) -> Bracket:
        """The reference's bracket; without bounds where one of them is missing."""
        ends = self.reference_lower, self.reference_upper
        return Bracket() if None in ends else Bracket(*ends)  # type: ignore[arg-type]

    @property
    def floor(self) -> float:
        """The reference's relative width: load factors inside it cannot be told apart."""
        return max(0.0, self.truth.width) if self.truth.has_both else 0.0


class Method(ABC):
    """One way from a scene to a load factor.

    ``name`` is unique, in lower case, parts separated by ``/``; ``line`` labels the chart's line
    that the method belongs to: the same solver at other tolerances, the same polygon with other
    numbers of facets.
    """

    name: str
    line: str
    interaction: str = "none"
    moments: str = "independent"

    @abstractmethod
    def measure(self, scene: Scene) -> Row:
        """Returns the row of one run, timed by phase; ``scene`` has not looked for contacts yet."""

    def axes(self) -> dict[str, Any]:
        """Returns the columns of the results that describe the method."""
        return {"interaction": self.interaction, "moments": self.moments}


@dataclass(frozen=True)
class Model(Method):
    """A choice of surface, formulation, solver and tolerance.

    Attributes
    ----------
    surface : str, Cone or sequence of YieldSurface
        As for :func:`cvxlimit.solve`: ``"conic"``, ``"octagon"``, ``"16-gon-inscribed"`` ...
    formulation : callable
        :func:`~cvxlimit.model.formulations.corner_compressions` or ``resultants``.
    solver : SolverSettings or None
        One run of one solver with its certificate; None is the package's own ladder of solvers,
        climbed until the bracket is within ``tolerance``.
    tolerance : float or None
        What is asked of the ladder; None is the default of :func:`cvxlimit.solve`. For one solver
        its options say it, and this is for the record.
    method, moments : str
        As for :func:`cvxlimit.solve`; with any method but the convex one the ladder is always the
        package's own.
    model : str
        How much model, as for :func:`cvxlimit.solve`; one run of one solver has the full one.
    change : callable or None
        From the scene to the one that is solved: with other strengths, without ties.

    Raises
    ------
    ModelError
        For anything that is none of these, and a solver together with another method.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.solvers import settings_for
    >>> octagon = Model("my octagon", surface="octagon", solver=settings_for("CLARABEL", 1e-8))
    >>> round(octagon.measure(builtin_scene("single-block")).load_factor, 6)
    0.4
    """

    name: str
    line: str = ""
    surface: str | Cone | Sequence[YieldSurface] = "conic"
    formulation: Formulation = corner_compressions
    solver: SolverSettings | None = None
    tolerance: float | None = None
    method: str = "convex"
    moments: str = "independent"
    model: str = "auto"
    change: Callable[[Scene], Scene] | None = None

    def __post_init__(self) -> None:
        surfaces_of(self.surface)
        if not callable(self.formulation):
            raise ModelError(
                f"formulation must be a function of contacts like "
                f"cvxlimit.model.formulations.resultants, got {self.formulation!r}"
            )
        if self.solver is not None and not isinstance(self.solver, SolverSettings):
            raise ModelError(
                f"solver must be SolverSettings, got {self.solver!r}: "
                "cvxlimit.solvers.settings_for('SCS', 1e-8) makes them"
            )
        check_choice("model", self.model, MODELS)
        parse_moments(self.moments)
        chosen = self._chosen()
        if chosen.name != "convex" and self.solver is not None:
            raise ModelError(
                f"model {self.name!r} has a solver and method {chosen.name!r}: leave out the "
                "solver, since all methods but 'convex' take the package's own"
            )
        is_reading = hasattr(chosen, "moments")
        object.__setattr__(self, "interaction", chosen.name if is_reading else "none")
        if not self.line:
            object.__setattr__(self, "line", self.name)

    def _chosen(self) -> driver.Method:
        check_choice("method", self.method, TABLE)
        moments = self.moments if hasattr(TABLE[self.method], "moments") else None
        settings = {"moments": moments, "tolerance": self.tolerance}
        return chosen(self.surface, self.method, settings)

    def axes(self) -> dict[str, Any]:
        surfaces, named = surfaces_of(self.surface)
        formulation = getattr(self.formulation, "__name__", type(self.formulation).__name__)
        how_much = "" if self.model == "auto" else f", {self.model} model"
        asked = getattr(self._chosen(), "tolerance", None)
        if self.solver is not None:
            asked = self.tolerance
        return {
            "surface": named,
            "formulation": formulation.replace("_", " ") + how_much,
            "solver": "ladder" if self.solver is None else str(self.solver),
            "tolerance": "" if asked is None else f"{asked:g}",
            "facets": next((s.cone.count for s in surfaces if isinstance(s.cone, Facets)), None),
            **super().axes(),
        }

    def measure(self, scene: Scene) -> Row:
        scene = scene if self.change is None else self.change(scene)
        if self.solver is not None:
            return self._run_once(scene, self.solver)
        started, method = time.perf_counter(), self._chosen()
        options = {"formulation": self.formulation, "model": self.model}
        return Row.of(solve(scene, self.surface, method, **options), started)  # type: ignore[arg-type]

    def _run_once(self, scene: Scene, settings: SolverSettings) -> Row:
        check_installed(settings)
        clock = Clock()
        with clock.phase("detect"):
            len(scene.contacts)
        with clock.phase("compile"):
            problem = LimitProgram(scene, self.surface, formulation=self.formulation)
            state = problem.run(settings)
            clock.seconds["solve"] += state.outcome.solve_seconds
        with clock.phase("certify"):
            bounds = Certifier(scene, problem.surfaces, self.formulation).of(state)
        seconds: dict[str, Any] = clock.seconds
        return Row(
            status=state.outcome.status, load_factor=state.load_factor, lower=known(bounds.lower),
            upper=known(bounds.upper), total=clock.elapsed, **seconds,
        )  # fmt: skip


WIDTH = 1e-8
"""Relative width that a reference without interaction must have."""


@dataclass(frozen=True)
class Reference(Method):
    """The bracket against which others are measured; ``load_factor`` is its middle."""

    interaction: str = "none"
    moments: str = "independent"

    name = line = "reference"

    def measure(self, scene: Scene) -> Row:
        started = time.perf_counter()
        if self.interaction != "none":
            solution = solve(scene, method="certified", moments=self.moments)  # type: ignore[arg-type]
            status = str(solution.status)
        else:  # two exact solvers as far as rounding lets them; all others if they fall short
            first, *others = default_ladder()
            solution = solve(scene, tolerance=1e-9, ladder=(first, *blockwise(1e-14)))
            if solution.gap > WIDTH and solution.status.has_answer:
                more = solve(scene, tolerance=WIDTH, ladder=others)
                solution = min(solution, more, key=attrgetter("gap"))
            status = f"{'proved' if solution.is_proved else 'bracketed'} to {solution.gap:.1e}"
        middle = 0.5 * (solution.lower + solution.upper) if solution.bracket.has_both else None
        return replace(Row.of(solution, started), status=status, load_factor=middle)
