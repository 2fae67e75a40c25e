"""All methods by name: surfaces, formulations, solvers, tolerances, interaction, other physics."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

from cvxlimit.base.checks import meant
from cvxlimit.errors import ModelError
from cvxlimit.extensions.studies.models import Model, Row
from cvxlimit.methods.driver import Clock
from cvxlimit.model.crushing import PlasticField
from cvxlimit.model.formulations import (
    Formulation,
    corner_compressions,
    resultants,
    vertex_forces,
)
from cvxlimit.model.program import LimitProgram
from cvxlimit.proof.certificate import Certifier
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import known
from cvxlimit.solvers import SolverSettings, check_installed, installed, settings_for
from cvxlimit.solvers.table import SOLVERS
from cvxlimit.surfaces import Rocking

_QDLDL = "Clarabel qdldl"
_SAID = {"conic": "cone"}
"""Surfaces that lines of charts call otherwise."""

_APART = {"CLARABEL", "BLOCKWISE", "RESCALED", "HIGHS", "SCS", "GLPK_MI"}
"""Solvers that stand in the registry by themselves, or not at all."""


class Alone(Model):
    """One run of one solver on the full model, timed by phase with its certificate."""

    def __init__(
        self, name: str, line: str, surface: str, solver: SolverSettings,
        formulation: Formulation = corner_compressions,
    ) -> None:  # fmt: skip
        super().__init__(name, line, surface=surface, solver=solver, formulation=formulation)

    def measure(self, scene: Scene) -> Row:
        """See :class:`Model`."""
        surface, solver, formulation = self.options.values()
        check_installed(solver)
        clock = Clock()
        with clock.phase("detect"):
            len(scene.contacts)
        with clock.phase("compile"):
            problem = LimitProgram(scene, surface, formulation=formulation)
            state = problem.run(solver)
            clock.seconds["solve"] += state.outcome.solve_seconds
        with clock.phase("certify"):
            bounds = Certifier(scene, problem.surfaces, formulation).of(state)
        seconds: dict[str, Any] = clock.seconds
        return Row(
            status=state.outcome.status, load_factor=state.load_factor, lower=known(bounds.lower),
            upper=known(bounds.upper), total=clock.elapsed, **seconds,
        )  # fmt: skip


class Changed(Model):
    """The scene is changed before it is solved: with other strengths, without ties."""

    def __init__(
        self, name: str, line: str, change: Callable[[Scene], Scene], **options: Any
    ) -> None:
        super().__init__(name, line, **options)
        self.change = change

    def measure(self, scene: Scene) -> Row:
        """See :class:`Model`."""
        return super().measure(self.change(scene))


def registry() -> dict[str, Model]:
    """All methods of the package by name; those whose solver is missing fail with that reason.

    Models of other physics have load factors of their own: errors are differences from the paper's
    cone. Their strengths are multiples of the mean pressure on supports.

    >>> [name for name in registry() if name.startswith("octagon-inscribed")]
    ['octagon-inscribed/corners/clarabel-qdldl/1e-8']
    """
    models = [*_ladders(), *_solvers(), *_with_interaction(), *_other_physics()]
    return {model.name: model for model in models}


def _ladders() -> Iterator[Model]:
    for asked in (None, 1e-6, 1e-8):
        end = "" if asked is None else f"/{_short(asked)}"
        within = {} if asked is None else {"tolerance": asked}
        yield Model(f"cvxlimit{end}", "cvxlimit", **within)
        yield Model(f"cvxlimit/full{end}", "cvxlimit, full model", **within, model="full")


def _solvers() -> Iterator[Model]:
    """One run of one solver each: polygons, formulations, tolerances, ways to factorise."""
    fine, several = (1e-8,), (1e-6, 1e-8, 1e-11)
    for side, kind in (("", "circumscribed"), ("-inscribed", "inscribed")):
        for polygon in ("octagon", "16-gon", "32-gon", "64-gon"):
            line = f"facets, {kind}, Clarabel"
            yield from _runs(polygon + side, "clarabel-qdldl", "CLARABEL", fine, _QDLDL, line)
    solver = settings_for("CLARABEL", 1e-8, _QDLDL)
    for surface in ("conic", "octagon"):
        name, line = f"{surface}/resultants/clarabel-qdldl/1e-8", f"{_called(surface)}, resultants"
        yield Alone(name, line, surface, solver, resultants)
        yield from _runs(surface, "blockwise", "BLOCKWISE", several, "blockwise")
    tried = (1e-2, 1e-3, 1e-4, *several)
    yield from _runs("conic", "clarabel-qdldl", "CLARABEL", tried, _QDLDL)
    label = "Clarabel faer"
    yield from _runs("conic", "clarabel-faer", "CLARABEL", fine, label, direct_solve_method="faer")
    yield from _runs("conic", "scs", "SCS", (1e-3, 1e-4, 1e-5))
    for way in ("ipm", "simplex"):
        yield from _runs("octagon", f"highs-{way}", "HIGHS", fine, f"HiGHS {way}", solver=way)
    for name in sorted({*SOLVERS, *installed()} - _APART):
        surface = "conic" if SolverSettings(name).row.has_cones else "octagon"
        yield from _runs(surface, name.lower(), name, (1e-6, 1e-8))


def _runs(
    surface: str, short: str, solver: str, tolerances: Iterable[float], label: str = "",
    line: str = "", /, **options: Any,
) -> Iterator[Model]:  # fmt: skip
    for tolerance in tolerances:
        settings = settings_for(solver, tolerance, label, **options)
        name = f"{surface}/corners/{short}/{_short(tolerance)}"
        line = line or f"{_called(surface)}, {str(settings).removesuffix(' qdldl')}"
        yield Alone(name, line, surface, settings)


def _called(surface: str) -> str:
    return _SAID.get(surface, surface)


def _short(tolerance: float) -> str:
    return f"{tolerance:.0e}".replace("e-0", "e-")


def _with_interaction() -> Iterator[Model]:
    for kind, surfaces in (("fixed-point", ("conic", "octagon")), ("certified", ("conic",))):
        for moments in ("independent", "signed", "paper"):
            for surface in surfaces:
                line = f"{kind}, {moments} moments"
                name = f"{kind}/{moments}/{surface}"
                yield Model(name, line, surface=surface, method=kind, moments=moments)


def _other_physics() -> Iterator[Model]:
    yield Model("linear", "linear torsion-shear")
    yield Model("parabolic", "parabolic torsion-shear", surface="parabolic")
    yield Model("exact", "exact torsion-shear", method="exact", tolerance=1e-3)
    forces = {"surface": (Rocking(),), "formulation": vertex_forces}
    yield Model("vertex-forces", "vertex forces", **forces)
    field = PlasticField(corner_compressions)
    for times in (10.0, 100.0):
        weak, name = partial(strengthened, compressive_strength=times), f"crushing/{times:g}"
        yield Changed(name, "effective rectangle", weak)
        yield Changed(f"{name}/field", "plastic field", weak, formulation=field)
    mortar = partial(strengthened, cohesion=0.2, tensile_strength=0.1)
    yield Changed("mortar", "mortar", mortar)
    yield Changed("without-ties", "without ties", untied)
    yield Model("zero-dilatancy", "zero dilatancy", method="zero-dilatancy", tolerance=1e-4)
    yield Model("incremental", "from rest", method="incremental")


def strengthened(scene: Scene, **strengths: float) -> Scene:
    """With cohesion and strengths as multiples of the mean pressure on the supports, so that one
    model means the same on small and on large scenes.
    """
    contacts = scene.contacts
    fixed = {i for i, block in enumerate(scene.blocks) if block.id in scene.supports}
    rests = [a in fixed or b in fixed for a, b in zip(contacts.a, contacts.b, strict=True)]
    pressure = float(scene.total_weight / contacts.area[rests].sum())
    return scene.with_joints(**{name: times * pressure for name, times in strengths.items()})


def untied(scene: Scene) -> Scene:
    return replace(scene, ties=())


def choose(names: Iterable[str], among: Sequence[Model]) -> list[Model]:
    """Models whose names match one of the patterns (``*`` and ``?``), in registered order."""
    patterns = list(names)
    own = {method.name for method in among}
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in own):
            raise ModelError(
                f"no method matches {pattern!r}: * and ? stand for any letters, and "
                f"benchmarks.registry.registry() has all names{meant(pattern, own, before='; ')}"
            )
    return [m for m in among if any(fnmatchcase(m.name, pattern) for pattern in patterns)]
