"""All methods by name: surfaces, formulations, solvers, tolerances, interaction, other physics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from functools import partial

import cvxpy as cp

from cvxlimit.compare.models import Method, Model
from cvxlimit.compare.physics import strengthened, untied
from cvxlimit.errors import ModelError
from cvxlimit.model.crushing import PlasticField
from cvxlimit.model.formulations import corner_compressions, resultants, vertex_forces
from cvxlimit.solvers import SolverSettings, settings_for
from cvxlimit.surfaces import Rocking

_QDLDL = "Clarabel qdldl"
_CLARABEL_SOLVERS = ("faer", "mkl", "panua")
"""Clarabel's other linear solvers; builds without one refuse it, and that is a row as well."""

_CONIC_SOLVERS = {
    "SCS": (1e-3, 1e-4, 1e-5), "ECOS": (1e-6, 1e-8), "QOCO": (1e-6, 1e-8), "MOSEK": (1e-6, 1e-8),
    "GUROBI": (1e-6, 1e-8), "COPT": (1e-8,), "XPRESS": (1e-8,), "CUCLARABEL": (1e-8,),
}  # fmt: skip
_LINEAR_SOLVERS = ("MOSEK", "GUROBI", "CUOPT", "PDLP", "GLOP", "OSQP", "SCIPY", "GLPK")
_ALIASES = ("ECOS_BB", "GLPK_MI", "CLARABEL", "HIGHS")


def registry() -> dict[str, Method]:
    """All methods of the package by name; those whose solver is missing fail with that reason.

    >>> [name for name in registry() if name.startswith("octagon-inscribed")]
    ['octagon-inscribed/corners/clarabel-qdldl/1e-8']
    """
    made = [*_ladders(), *_surfaces(), *_runs()]
    return {model.name: model for model in made}


def interaction_registry() -> dict[str, Method]:
    """All methods for torsion-shear-bending interaction, by name."""
    made = (
        Model(f"{kind}/{moments}/{surface}", f"{kind}, {moments} moments", surface,
              interaction=kind, moments=moments)
        for kind, surfaces in (("fixed-point", ("conic", "octagon")), ("certified", ("conic",)))
        for moments in ("independent", "signed", "paper")
        for surface in surfaces
    )  # fmt: skip
    return {model.name: model for model in made}


def physics_registry() -> dict[str, Method]:
    """Other models of the same contacts, by name, and the paper's to compare them with.

    Each has a load factor of its own: errors are differences from the paper's cone. Strengths are
    multiples of the mean pressure on supports; for a support that moves see
    :class:`~cvxlimit.compare.physics.Settlement`.

    >>> [name for name in physics_registry() if "/" not in name][:6]
    ['linear', 'parabolic', 'exact', 'vertex-forces', 'mortar', 'without-ties']
    """
    made = [
        Model("linear", "linear torsion-shear"),
        Model("parabolic", "parabolic torsion-shear", torsion_shear="parabolic"),
        Model("exact", "exact torsion-shear", torsion_shear="exact", tolerance=1e-3),
        Model("vertex-forces", "vertex forces", (Rocking(),), vertex_forces),
    ]
    field = PlasticField(corner_compressions)
    for times in (10.0, 100.0):
        weak = partial(strengthened, compressive_strength=times)
        name = f"crushing/{times:g}"
        made += [
            Model(name, "effective rectangle", change=weak),
            Model(f"{name}/field", "plastic field", formulation=field, change=weak),
        ]
    mortar = partial(strengthened, cohesion=0.2, tensile_strength=0.1)
    made += [
        Model("mortar", "mortar", change=mortar),
        Model("without-ties", "without ties", change=untied),
        Model("zero-dilatancy", "zero dilatancy", flow="zero-dilatancy", tolerance=1e-4),
        Model("gilbert", "Gilbert's scheme", flow="gilbert", tolerance=1e-3),
    ]
    return {model.name: model for model in made}


def _ladders() -> Iterator[Model]:
    for asked in (None, 1e-6, 1e-8):
        end = "" if asked is None else f"/{_short(asked)}"
        yield Model(f"cvxlimit{end}", "cvxlimit, default settings (auto)", tolerance=asked)
        yield Model(f"cvxlimit/full{end}", "cvxlimit, full model", tolerance=asked, model="full")
    yield Model("cvxlimit/octagon", "cvxlimit, octagon", "octagon")


def _surfaces() -> Iterator[Model]:
    solver = settings_for("CLARABEL", 1e-8, _QDLDL)
    for side in ("", "-inscribed"):
        for facets in (8, 16, 32, 64):
            surface = ("octagon" if facets == 8 else f"{facets}-gon") + side
            line = f"8 to 64 facets, {'inscribed' if side else 'circumscribed'}, {_QDLDL}"
            yield _run(surface, "clarabel-qdldl", solver, 1e-8, line)
    for surface in ("conic", "octagon"):
        name, line = f"{surface}/resultants/clarabel-qdldl/1e-8", f"{surface}, resultants, {_QDLDL}"
        yield Model(name, line, surface, resultants, solver, 1e-8)


def _runs() -> Iterator[Model]:
    """One run of one solver each."""
    for tolerance in (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-11):
        solver = settings_for("CLARABEL", tolerance, _QDLDL)
        yield _run("conic", "clarabel-qdldl", solver, tolerance, f"conic, {_QDLDL}")
    for surface in ("conic", "octagon"):
        for backend, spelt in (("superlu", "SuperLU"), ("cholmod", "CHOLMOD")):
            for tolerance in (1e-6, 1e-8, 1e-11):
                solver = settings_for("BLOCKWISE", tolerance, f"blockwise {spelt}", backend=backend)
                yield _run(surface, f"blockwise-{backend}", solver, tolerance)
    for method in _CLARABEL_SOLVERS:
        solver = settings_for("CLARABEL", 1e-8, f"Clarabel {method}", direct_solve_method=method)
        yield _run("conic", f"clarabel-{method}", solver, 1e-8)
    unknown = {*cp.installed_solvers()} - {*_CONIC_SOLVERS, *_LINEAR_SOLVERS, *_ALIASES}
    for name, tolerances in {**_CONIC_SOLVERS, **dict.fromkeys(sorted(unknown), (1e-8,))}.items():
        for tolerance in tolerances:
            yield _run("conic", name.lower(), settings_for(name, tolerance), tolerance)
    for algorithm in ("ipm", "simplex"):
        solver = settings_for("HIGHS", 1e-8, f"HiGHS {algorithm}", solver=algorithm)
        yield _run("octagon", f"highs-{algorithm}", solver, 1e-8)
    for name in _LINEAR_SOLVERS:
        yield _run("octagon", name.lower(), settings_for(name, 1e-8), 1e-8)


def _run(
    surface: str, solver_name: str, solver: SolverSettings, tolerance: float, line: str = ""
) -> Model:
    name = f"{surface}/corners/{solver_name}/{_short(tolerance)}"
    return Model(name, line or f"{surface}, {solver}", surface, solver=solver, tolerance=tolerance)


def _short(tolerance: float) -> str:
    return f"{tolerance:.0e}".replace("e-0", "e-")


def choose(names: Iterable[str], among: Sequence[Method]) -> list[Method]:
    """Methods whose names match one of the patterns (``*`` and ``?``), in registered order.

    Raises
    ------
    ModelError
        If a pattern matches nothing.

    Example
    -------
    >>> [m.name for m in choose(["cvxlimit*"], list(registry().values()))][:2]
    ['cvxlimit', 'cvxlimit/full']
    """
    patterns = list(names)
    for pattern in patterns:
        if not any(fnmatchcase(method.name, pattern) for method in among):
            known = [method.name for method in among]
            close = get_close_matches(pattern, known, 3, 0.4) or known[:3]
            raise ModelError(
                f"no method matches {pattern!r}: did you mean {' or '.join(close)}? "
                "cvxlimit.compare.registry.registry() has all names"
            )
    return [m for m in among if any(fnmatchcase(m.name, pattern) for pattern in patterns)]
