"""What is compared: one class per kind of method, timed by phase."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from cvxlimit.bracket import known
from cvxlimit.checks import ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods import driver
from cvxlimit.methods.driver import Clock
from cvxlimit.methods.interaction.readings.named import parse_moments
from cvxlimit.methods.solving import solve
from cvxlimit.methods.table import Surface, check_choice, chosen
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.problem import LimitProblem
from cvxlimit.proof.certificate import Certifier
from cvxlimit.reductions.choice import MODELS
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import SolverSettings, check_installed
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.coulomb import surfaces_of

PHASES = ("detect", "compile", "reparametrise", "solve", "certify")
"""What is timed apart: contact detection, building and canonicalising the problem, the same again
for changed Parameters, the solver, and the bracket."""


@dataclass(frozen=True)
class Measurement:
    """What one run of a method gave: its own answer and bracket, None where it has none.

    ``seconds`` are those of :data:`PHASES` that it has, ``total`` from the scene to the answer;
    ``memory`` is the peak in MB, where the run had a process of its own.
    """

    status: str
    load_factor: float | None
    lower: float | None
    upper: float | None
    seconds: Mapping[str, float]
    total: float
    contacts: int
    memory: float | None = None

    @classmethod
    def of(cls, solution: Solution, started: float) -> Measurement:
        return cls(
            str(solution.status), solution.load_factor, known(solution.lower),
            known(solution.upper), {k: v for k, v in solution.seconds.items() if k in PHASES},
            time.perf_counter() - started, solution.contacts,
        )  # fmt: skip


class Method(ABC):
    """One way from a scene to a load factor.

    Attributes
    ----------
    name : str
        Unique, in lower case, parts separated by ``/``.
    line : str
        Label of the chart's line that the method belongs to: the same solver at other tolerances,
        the same polygon with other numbers of facets.
    is_load_factor : bool
        False for what is no load factor and has no reference to measure its error against.
    """

    name: str
    line: str
    interaction: str = "none"
    moments: str = "independent"
    is_load_factor: ClassVar[bool] = True

    @abstractmethod
    def measure(self, scene: Scene) -> Measurement:
        """Run once, timed by phase; ``scene`` has not looked for contacts yet."""

    def axes(self) -> dict[str, str]:
        """Columns of the results that describe the method."""
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
    interaction, moments, torsion_shear, flow : str
        As for :func:`cvxlimit.solve`; with any but the first of each, the ladder is always the
        package's own.
    model : str
        How much model, as for :func:`cvxlimit.solve`; one run of one solver has the full one.
    change : callable or None
        From the scene to the one that is solved: with other strengths, without ties.

    Raises
    ------
    ModelError
        For anything that is none of these, and a solver together with interaction.

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
    interaction: str = "none"
    moments: str = "independent"
    torsion_shear: str = "linear"
    flow: str = "associated"
    model: str = "auto"
    change: Callable[[Scene], Scene] | None = None

    def __post_init__(self) -> None:
        for what in ("name", "line"):
            text = getattr(self, what)
            if not isinstance(text, str) or not (text or what == "line"):
                raise ModelError(f"{what} of a model must be a text, got {text!r}")
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
        if self.tolerance is not None:
            ratio(self.tolerance, "tolerance")
        check_choice("model", self.model, MODELS)
        parse_moments(self.moments)
        if self._chosen()[1].name != "convex" and self.solver is not None:
            raise ModelError(
                f"model {self.name!r} has a solver and interaction: leave out the solver, since "
                "interaction, torsion_shear and flow always take the package's own"
            )
        if not self.line:
            object.__setattr__(self, "line", self.name)

    def _chosen(self) -> tuple[Surface, driver.Method]:
        older = {name: getattr(self, name) for name in ("interaction", "torsion_shear", "flow")}
        moments = None if self.interaction == "none" else self.moments
        settings = {"moments": moments, "tolerance": self.tolerance}
        return chosen(self.surface, None, older, settings)

    def axes(self) -> dict[str, str]:
        formulation = getattr(self.formulation, "__name__", type(self.formulation).__name__)
        how_much = "" if self.model == "auto" else f", {self.model} model"
        asked = getattr(self._chosen()[1], "tolerance", None)
        if self.solver is not None:
            asked = self.tolerance
        return {
            "surface": surfaces_of(self.surface)[1],
            "formulation": formulation.replace("_", " ") + how_much,
            "solver": "ladder" if self.solver is None else str(self.solver),
            "tolerance": "" if asked is None else f"{asked:g}",
            **super().axes(),
        }

    def measure(self, scene: Scene) -> Measurement:
        scene = scene if self.change is None else self.change(scene)
        if self.solver is not None:
            return self._run_once(scene, self.solver)
        started, (surface, method) = time.perf_counter(), self._chosen()
        options = {"formulation": self.formulation, "model": self.model}
        return Measurement.of(solve(scene, surface, method, **options), started)  # type: ignore[arg-type]

    def _run_once(self, scene: Scene, settings: SolverSettings) -> Measurement:
        check_installed(settings)
        clock = Clock()
        with clock.phase("detect"):
            contacts = scene.contacts
        with clock.phase("compile"):
            problem = LimitProblem(scene, surfaces_of(self.surface)[0], self.formulation)
            state = problem.solve(settings)
            clock.seconds["solve"] += state.outcome.solve_seconds
        with clock.phase("certify"):
            bounds = Certifier(scene, problem.surfaces, self.formulation).of(state)
        return Measurement(
            state.outcome.status, state.load_factor, known(bounds.lower), known(bounds.upper),
            clock.seconds, clock.elapsed, len(contacts),
        )  # fmt: skip
