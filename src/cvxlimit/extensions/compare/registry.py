"""All methods by name: surfaces, formulations, solvers, tolerances, interaction, other physics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import partial
from typing import Any, get_args

from cvxlimit.base.checks import meant
from cvxlimit.errors import ModelError
from cvxlimit.extensions.compare.models import Method, Model
from cvxlimit.model.crushing import PlasticField
from cvxlimit.model.formulations import corner_compressions, resultants, vertex_forces
from cvxlimit.scene import Scene
from cvxlimit.solvers import SolverSettings, installed, settings_for
from cvxlimit.solvers.table import SOLVERS
from cvxlimit.surfaces import Facets, Rocking
from cvxlimit.surfaces.coulomb import SurfaceName, surfaces_of

_QDLDL = "Clarabel qdldl"
_SAID = {"conic": "cone"}
"""Surfaces that lines of charts call otherwise."""

_APART = {"CLARABEL", "BLOCKWISE", "RESCALED", "HIGHS", "SCS", "GLPK_MI"}
"""Solvers that stand in the registry by themselves, or not at all."""


def registry() -> dict[str, Method]:
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
        yield Model(f"cvxlimit{end}", "cvxlimit", tolerance=asked)
        yield Model(f"cvxlimit/full{end}", "cvxlimit, full model", tolerance=asked, model="full")


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
        yield Model(name, line, surface, resultants, solver, 1e-8)
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
        yield Model(name, line, surface, solver=settings, tolerance=tolerance)


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
                yield Model(name, line, surface, method=kind, moments=moments)


def _other_physics() -> Iterator[Model]:
    yield Model("linear", "linear torsion-shear")
    yield Model("parabolic", "parabolic torsion-shear", surface="parabolic")
    yield Model("exact", "exact torsion-shear", method="exact", tolerance=1e-3)
    yield Model("vertex-forces", "vertex forces", (Rocking(),), vertex_forces)
    field = PlasticField(corner_compressions)
    for times in (10.0, 100.0):
        weak, name = partial(strengthened, compressive_strength=times), f"crushing/{times:g}"
        yield Model(name, "effective rectangle", change=weak)
        yield Model(f"{name}/field", "plastic field", formulation=field, change=weak)
    mortar = partial(strengthened, cohesion=0.2, tensile_strength=0.1)
    yield Model("mortar", "mortar", change=mortar)
    yield Model("without-ties", "without ties", change=untied)
    yield Model("zero-dilatancy", "zero dilatancy", method="zero-dilatancy", tolerance=1e-4)


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


def of_surface(name: str) -> Model | None:
    """The package's default on a surface that :func:`~cvxlimit.solve` and sweeps take by name,
    ``"16-gon"`` or ``"cvxlimit/16-gon"``; None for other names.

    >>> of_surface("cvxlimit/octagon").surface, of_surface("cvxlimit/full")
    ('octagon', None)
    """
    surface = name.removeprefix("cvxlimit/")
    try:
        surfaces, named = surfaces_of(surface)
    except ModelError:
        return None
    has_facets = any(isinstance(s.cone, Facets) for s in surfaces)
    side = "inside" if named.endswith("-inscribed") else "outside"
    return Model(name, f"facets {side} the cone" if has_facets else f"cvxlimit, {named}", surface)


def of_facets(facets: Sequence[int]) -> list[Method]:
    """The cone, and polygons with so many facets outside and inside it."""
    sides = ("", "-inscribed")
    models = [of_surface(f"{Facets.circumscribed(k)}{side}") for side in sides for k in facets]
    return [Model("conic", "cvxlimit, conic"), *filter(None, models)]


def choose(names: Iterable[str], among: Sequence[Method]) -> list[Method]:
    """Methods whose names match one of the patterns (``*`` and ``?``), in registered order, or are
    those of surfaces."""
    patterns = list(names)
    own = {method.name for method in among}
    if len(patterns) == 1 and patterns[0] not in own and (made := of_surface(patterns[0])):
        return [made]
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in own):
            known = (*own, *get_args(SurfaceName))
            raise ModelError(
                f"no method matches {pattern!r}: * and ? stand for any letters, and "
                f"cvxlimit.compare.registry() has all names{meant(pattern, known, before='; ')}"
            )
    return [m for m in among if any(fnmatchcase(m.name, pattern) for pattern in patterns)]
