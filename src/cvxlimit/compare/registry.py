"""All methods by name: surfaces, formulations, solvers, tolerances, interaction, other physics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from difflib import get_close_matches
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

import cvxpy as cp

from cvxlimit.compare.models import Method, Model
from cvxlimit.errors import ModelError
from cvxlimit.model.crushing import PlasticField
from cvxlimit.model.formulations import corner_compressions, resultants, vertex_forces
from cvxlimit.scene import Scene
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Facets, Rocking
from cvxlimit.surfaces.coulomb import surfaces_of

_QDLDL = "Clarabel qdldl"
_SAID = {"conic": "cone", "octagon": "octagon"}
"""Surfaces as lines of charts call them."""

_SURFACES = ("conic", "parabolic", "octagon", "octagon-inscribed", "16-gon")
"""Some that are meant where a name is mistyped."""

_CONIC_SOLVERS = ("ECOS", "QOCO", "MOSEK", "GUROBI")
_FINE_ONLY = ("COPT", "XPRESS", "CUCLARABEL")
_LINEAR_SOLVERS = ("MOSEK", "GUROBI", "CUOPT", "PDLP", "GLOP", "OSQP", "SCIPY", "GLPK")
_OTHERS = ("SCS", "ECOS_BB", "GLPK_MI", "CLARABEL", "HIGHS")


def registry() -> dict[str, Method]:
    """All methods of the package by name; those whose solver is missing fail with that reason.

    >>> [name for name in registry() if name.startswith("octagon-inscribed")]
    ['octagon-inscribed/corners/clarabel-qdldl/1e-8']
    """
    fine, several = (1e-8,), (1e-6, 1e-8, 1e-11)
    made = []
    for asked in (None, 1e-6, 1e-8):
        end = "" if asked is None else f"/{_short(asked)}"
        made += [
            Model(f"cvxlimit{end}", "cvxlimit", tolerance=asked),
            Model(f"cvxlimit/full{end}", "cvxlimit, full model", tolerance=asked, model="full"),
        ]
    for side, kind in (("", "circumscribed"), ("-inscribed", "inscribed")):
        for polygon in ("octagon", "16-gon", "32-gon", "64-gon"):
            line = f"facets, {kind}, Clarabel"
            made += _runs(polygon + side, "clarabel-qdldl", "CLARABEL", fine, _QDLDL, line)
    solver = settings_for("CLARABEL", 1e-8, _QDLDL)
    for surface in ("conic", "octagon"):
        name, line = f"{surface}/resultants/clarabel-qdldl/1e-8", f"{_SAID[surface]}, resultants"
        made.append(Model(name, line, surface, resultants, solver, 1e-8))
    tried = (1e-2, 1e-3, 1e-4, *several)
    made += _runs("conic", "clarabel-qdldl", "CLARABEL", tried, _QDLDL)
    for surface in ("conic", "octagon"):
        for backend, spelt in (("supernodal", "own Cholesky"), ("superlu", "SuperLU")):
            short, label = f"blockwise-{backend}", f"blockwise {spelt}"
            made += _runs(surface, short, "BLOCKWISE", several, label, backend=backend)
    for way in ("faer", "mkl", "panua"):  # builds without one refuse it, and that is a row as well
        label = f"Clarabel {way}"
        made += _runs("conic", f"clarabel-{way}", "CLARABEL", fine, label, direct_solve_method=way)
    made += _runs("conic", "scs", "SCS", (1e-3, 1e-4, 1e-5))
    for name in _CONIC_SOLVERS:
        made += _runs("conic", name.lower(), name, (1e-6, 1e-8))
    known = {*_CONIC_SOLVERS, *_FINE_ONLY, *_LINEAR_SOLVERS, *_OTHERS}
    for name in (*_FINE_ONLY, *sorted({*cp.installed_solvers()} - known)):
        made += _runs("conic", name.lower(), name, fine)
    for way in ("ipm", "simplex"):
        made += _runs("octagon", f"highs-{way}", "HIGHS", fine, f"HiGHS {way}", solver=way)
    for name in _LINEAR_SOLVERS:
        made += _runs("octagon", name.lower(), name, fine)
    return {model.name: model for model in made}


def _runs(
    surface: str, short: str, solver: str, tolerances: Iterable[float], label: str = "",
    line: str = "", /, **options: Any,
) -> Iterator[Model]:  # fmt: skip
    for tolerance in tolerances:
        settings = settings_for(solver, tolerance, label, **options)
        name = f"{surface}/corners/{short}/{_short(tolerance)}"
        line = line or f"{_SAID[surface]}, {str(settings).removesuffix(' qdldl')}"
        yield Model(name, line, surface, solver=settings, tolerance=tolerance)


def _short(tolerance: float) -> str:
    return f"{tolerance:.0e}".replace("e-0", "e-")


def interaction_registry() -> dict[str, Method]:
    made = (
        Model(f"{kind}/{moments}/{surface}", f"{kind}, {moments} moments", surface,
              method=kind, moments=moments)
        for kind, surfaces in (("fixed-point", ("conic", "octagon")), ("certified", ("conic",)))
        for moments in ("independent", "signed", "paper")
        for surface in surfaces
    )  # fmt: skip
    return {model.name: model for model in made}


def physics_registry() -> dict[str, Method]:
    """Other models of the same contacts, by name, and the paper's to compare them with.

    Each has a load factor of its own: errors are differences from the paper's cone. Strengths are
    multiples of the mean pressure on supports.
    """
    made = [
        Model("linear", "linear torsion-shear"),
        Model("parabolic", "parabolic torsion-shear", surface="parabolic"),
        Model("exact", "exact torsion-shear", method="exact", tolerance=1e-3),
        Model("vertex-forces", "vertex forces", (Rocking(),), vertex_forces),
    ]
    field = PlasticField(corner_compressions)
    for times in (10.0, 100.0):
        weak = partial(_strengthened, compressive_strength=times)
        name = f"crushing/{times:g}"
        made += [
            Model(name, "effective rectangle", change=weak),
            Model(f"{name}/field", "plastic field", formulation=field, change=weak),
        ]
    mortar = partial(_strengthened, cohesion=0.2, tensile_strength=0.1)
    made += [
        Model("mortar", "mortar", change=mortar),
        Model("without-ties", "without ties", change=lambda scene: replace(scene, ties=())),
        Model("zero-dilatancy", "zero dilatancy", method="zero-dilatancy", tolerance=1e-4),
        Model("gilbert", "Gilbert's scheme", method="gilbert", tolerance=1e-3),
    ]
    return {model.name: model for model in made}


def _strengthened(scene: Scene, **strengths: float) -> Scene:
    """With cohesion and strengths as multiples of the mean pressure on the supports, so that one
    model means the same on small and on large scenes."""
    contacts = scene.contacts
    fixed = {i for i, block in enumerate(scene.blocks) if block.id in scene.supports}
    rests = [a in fixed or b in fixed for a, b in zip(contacts.a, contacts.b, strict=True)]
    pressure = float(scene.total_weight / contacts.area[rests].sum())
    return scene.with_joints(**{name: times * pressure for name, times in strengths.items()})


def of_surface(name: str) -> Model | None:
    """The package's default on a surface that :func:`~cvxlimit.solve` and sweeps take by name,
    ``"16-gon"`` or ``"cvxlimit/16-gon"``; None for other names.

    >>> of_surface("cvxlimit/octagon").surface, of_surface("cvxlimit/full")
    ('octagon', None)
    """
    surface = name.removeprefix("cvxlimit/")
    try:
        surfaces, known = surfaces_of(surface)
    except ModelError:
        return None
    count = next((s.cone.count for s in surfaces if isinstance(s.cone, Facets)), None)
    side = "inside" if known.endswith("-inscribed") else "outside"
    line = f"cvxlimit, {known}" if count is None else f"facets {side} the cone"
    return Model(name, line, surface)


def of_facets(facets: Sequence[int]) -> list[Method]:
    """The cone, and polygons with so many facets outside and inside it."""
    sides = ("", "-inscribed")
    made = [of_surface(f"{Facets.circumscribed(k)}{side}") for side in sides for k in facets]
    return [Model("conic", "cvxlimit, conic"), *filter(None, made)]


def choose(names: Iterable[str], among: Sequence[Method]) -> list[Method]:
    """Methods whose names match one of the patterns (``*`` and ``?``), in registered order, or are
    those of surfaces."""
    patterns = list(names)
    own = {method.name for method in among}
    if len(patterns) == 1 and patterns[0] not in own and (made := of_surface(patterns[0])):
        return [made]
    for pattern in patterns:
        if not any(fnmatchcase(method.name, pattern) for method in among):
            known = [method.name for method in among]
            close = [name for name in known if pattern in name][:3]
            surfaces = get_close_matches(pattern, _SURFACES, 1)
            close = close or surfaces or get_close_matches(pattern, known, 3, 0.4) or known[:3]
            raise ModelError(
                f"no method matches {pattern!r}: did you mean {' or '.join(close)}? "
                "* and ? stand for any letters; cvxlimit.compare.registry() has all names"
            )
    return [m for m in among if any(fnmatchcase(m.name, pattern) for pattern in patterns)]
