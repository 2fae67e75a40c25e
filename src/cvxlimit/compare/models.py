"""What is compared: one class per kind of method. The registry of all of them is its own module.

A method's ``line`` says with which others it shares a line of the chart: the same solver at other
tolerances, the same polygon with other numbers of facets.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from cvxlimit.bracket import known
from cvxlimit.errors import ModelError
from cvxlimit.methods.convex import TOLERANCE
from cvxlimit.methods.solving import solve
from cvxlimit.methods.table import check_choice, chosen
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.problem import LimitProblem
from cvxlimit.proof.certificate import Certificate, Certifier
from cvxlimit.reductions.choice import MODELS
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import LimitState, SolverSettings, check_installed, settings_for
from cvxlimit.surfaces import Cone, YieldSurface, parse_cone
from cvxlimit.surfaces.coulomb import surfaces_of

PHASES = ("detect", "compile", "reparametrise", "solve", "certify")
"""What is timed apart: contact detection, building and canonicalising the problem, the same again
for changed Parameters, the solver, and the bracket."""


@dataclass(frozen=True)
class Measurement:
    """What one run of a method gave.

    Attributes
    ----------
    status : str
        The solver's, or the solution's.
    load_factor, lower, upper : float or None
        The method's own answer and bracket; None where it has none.
    seconds : mapping of phase to float
        Phases of :data:`PHASES` that the method has.
    total : float
        Wall-clock seconds from the scene to the answer.
    contacts : int
    memory : float or None
        Peak memory of the process, MB; filled in by :mod:`cvxlimit.compare.runs`.
    """

    status: str
    load_factor: float | None
    lower: float | None
    upper: float | None
    seconds: Mapping[str, float]
    total: float
    contacts: int
    memory: float | None = None


class Method(ABC):
    """One way from a scene to a load factor. Instances pickle: they run in their own process.

    Attributes
    ----------
    name : str
        Unique, in lower case, parts separated by ``/``.
    line : str
        Label of the chart's line that the method belongs to.
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


@dataclass
class Stopwatch:
    """Seconds since the last lap, by phase."""

    seconds: dict[str, float] = field(default_factory=dict)
    start: float = field(default_factory=time.perf_counter)

    def __post_init__(self) -> None:
        self.last = self.start

    def lap(self, phase: str) -> None:
        """Add the time since the last lap to ``phase``."""
        now = time.perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self.last
        self.last = now

    def move(self, seconds: float, source: str, target: str) -> None:
        """Book ``seconds`` of one phase under another."""
        self.seconds[source] -= seconds
        self.seconds[target] = self.seconds.get(target, 0.0) + seconds

    @property
    def total(self) -> float:
        """Seconds from the start to the last lap."""
        return self.last - self.start


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
        What is asked of the ladder; None is the package's default. For one solver its options say
        it, and this is for the record.
    interaction, moments, torsion_shear, flow : str
        As for :func:`cvxlimit.solve`; with any but the first of each, the ladder is always the
        package's own.
    model : str
        How much model, as for :func:`cvxlimit.solve`; one run of one solver has the full one.

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
        asked = self._asked
        if not (isinstance(asked, float) and 0.0 < asked < 1.0):
            raise ModelError(f"tolerance must be a number between 0 and 1, got {asked!r}")
        if self.solver is not None and self._is_solved:
            raise ModelError(
                f"model {self.name!r} has a solver and interaction: leave out the solver, since "
                "interaction, torsion_shear and flow always take the package's own"
            )
        check_choice("model", self.model, MODELS)
        older = {name: getattr(self, name) for name in ("interaction", "torsion_shear", "flow")}
        chosen(self.surface, None, older, {"moments": self._moments})
        if not self.line:
            object.__setattr__(self, "line", self.name)

    def axes(self) -> dict[str, str]:
        """See :class:`Method`."""
        return {
            "surface": surfaces_of(self.surface)[1],
            "formulation": self._stated,
            "solver": "ladder" if self.solver is None else str(self.solver),
            "tolerance": "" if self.solver and self.tolerance is None else f"{self._asked:g}",
            **super().axes(),
        }

    @property
    def _moments(self) -> str | None:
        """What solve is told: nothing where it would do nothing."""
        return None if self.interaction == "none" else self.moments

    @property
    def _is_solved(self) -> bool:
        """True for what only :func:`cvxlimit.solve` knows how to do."""
        usual = ("none", "linear", "associated")
        return (self.interaction, self.torsion_shear, self.flow) != usual

    @property
    def _stated(self) -> str:
        """The formulation, and how much of it where that is not the scene's choice."""
        name = _called(self.formulation)
        return name if self.model == "auto" else f"{name}, {self.model} model"

    @property
    def _asked(self) -> float:
        return TOLERANCE if self.tolerance is None else self.tolerance

    def measure(self, scene: Scene) -> Measurement:
        """See :class:`Method`."""
        if self._is_solved:
            return self._solved(scene)
        if self.solver is None:
            return self._analysed(scene)
        return self._run_once(scene, self.solver)

    def _solved(self, scene: Scene) -> Measurement:
        start = time.perf_counter()
        names = ("interaction", "torsion_shear", "flow", "model")
        options: dict[str, Any] = {name: getattr(self, name) for name in names}
        options["moments"] = self._moments
        return _measured(solve(scene, self.surface, tolerance=self._asked, **options), start)

    def _analysed(self, scene: Scene) -> Measurement:
        start = time.perf_counter()
        options: dict[str, Any] = {
            "tolerance": self._asked, "formulation": self.formulation, "model": self.model,
        }  # fmt: skip
        return _measured(solve(scene, self.surface, **options), start)

    def _run_once(self, scene: Scene, settings: SolverSettings) -> Measurement:
        check_installed(settings)
        watch = Stopwatch()
        contacts = scene.contacts
        watch.lap("detect")
        problem = LimitProblem(scene, surfaces_of(self.surface)[0], self.formulation)
        watch.lap("compile")
        state = problem.solve(settings)
        watch.lap("solve")
        watch.move(watch.seconds["solve"] - state.outcome.solve_seconds, "solve", "compile")
        bounds = Certifier(scene, problem.surfaces, self.formulation).of(state)
        watch.lap("certify")
        return packed(state, bounds, watch, len(contacts))


@dataclass(frozen=True)
class FrozenModel(Model):
    """The surface with interaction coefficients as CVXPY Parameters, solved twice.

    The first solve, at eccentricity zero, is the problem without interaction and gives the load
    factor; the second, at the first one's eccentricities, shows what changed Parameters cost.

    Attributes
    ----------
    parameters : str
        ``"dpp"``: compiled once with the Parameters in it; ``"recompiled"``: afresh every time.
    """

    parameters: str = "dpp"

    CHOICES: ClassVar[tuple[str, ...]] = ("dpp", "recompiled")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.surface, (str, Cone)):
            raise ModelError(f"surface must be a name or a cone, got {self.surface!r}")
        if self.parameters not in self.CHOICES:
            raise ModelError(
                f"parameters must be one of {', '.join(self.CHOICES)}, got {self.parameters!r}"
            )

    def axes(self) -> dict[str, str]:
        """See :class:`Method`."""
        return {**super().axes(), "parameters": self.parameters}

    def measure(self, scene: Scene) -> Measurement:
        """See :class:`Method`."""
        from cvxlimit.methods.fixed_point import FrozenProblem
        from cvxlimit.methods.interaction.readings.named import parse_moments
        from cvxlimit.methods.interaction.states.pressure import Pressure

        settings = self.solver or settings_for("CLARABEL", 1e-8)
        watch = Stopwatch()
        contacts = scene.contacts
        watch.lap("detect")
        frozen = FrozenProblem(scene, parse_cone(str(self.surface)), parse_moments(self.moments))
        frozen.ignore_dpp = self.parameters == "recompiled"
        centred = Pressure.of(np.zeros((len(contacts), 6)), contacts)
        watch.lap("compile")
        state = frozen.solve(centred, settings)
        watch.lap("solve")
        watch.move(watch.seconds["solve"] - state.outcome.solve_seconds, "solve", "compile")
        if state.forces is not None:
            again = frozen.solve(Pressure.of(state.forces, contacts), settings)
            watch.lap("reparametrise")
            watch.move(again.outcome.solve_seconds, "reparametrise", "solve")
        bounds = Certifier(scene, frozen.surfaces(centred)).certificate(
            state.forces, state.load_factor, state.mechanism
        )
        watch.lap("certify")
        return packed(state, bounds, watch, len(contacts))


def _called(formulation: Formulation) -> str:
    """Its name; of an object like a field of pressures, that of its class."""
    name: str = getattr(formulation, "__name__", type(formulation).__name__)
    return name.replace("_", " ")


def packed(state: LimitState, bounds: Certificate, watch: Stopwatch, contacts: int) -> Measurement:
    """A solver's answer and its bracket as a measurement."""
    return Measurement(
        state.outcome.status,
        state.load_factor,
        known(bounds.lower),
        known(bounds.upper),
        watch.seconds,
        watch.total,
        contacts,
    )


def _measured(solution: Solution, start: float) -> Measurement:
    return Measurement(
        str(solution.status),
        solution.load_factor,
        known(solution.lower),
        known(solution.upper),
        {k: v for k, v in solution.seconds.items() if k in PHASES},
        time.perf_counter() - start,
        solution.contacts,
    )
