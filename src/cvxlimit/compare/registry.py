"""All methods by name: surfaces, formulations, solvers, tolerances, Parameters, interaction."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from fnmatch import fnmatchcase

import cvxpy as cp

from cvxlimit.compare.models import FrozenModel, Method, Model
from cvxlimit.compare.physics import Strengthened, Untied
from cvxlimit.errors import ModelError
from cvxlimit.model.crushing import PlasticField
from cvxlimit.model.formulations import corner_compressions, resultants, vertex_forces
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Rocking


@dataclass
class _Registry:
    methods: dict[str, Method] = field(default_factory=dict)

    def add(self, method: Method) -> None:
        if method.name in self.methods:
            raise ModelError(f"method {method.name!r} is registered twice")
        self.methods[method.name] = method


_FACTORISATIONS = {"superlu": "SuperLU", "cholmod": "CHOLMOD"}
"""Of the blockwise solver."""

_QDLDL = "Clarabel qdldl"
_CLARABEL_SOLVERS = ("faer", "mkl", "panua")
"""Clarabel's other linear solvers; builds without one refuse it, and that is a row as well."""

_CONIC_SOLVERS = {
    "SCS": (1e-3, 1e-4, 1e-5),
    "ECOS": (1e-6, 1e-8),
    "QOCO": (1e-6, 1e-8),
    "MOSEK": (1e-6, 1e-8),
    "GUROBI": (1e-6, 1e-8),
    "COPT": (1e-8,),
    "XPRESS": (1e-8,),
    "CUCLARABEL": (1e-8,),
}
_LINEAR_SOLVERS = ("MOSEK", "GUROBI", "CUOPT", "PDLP", "GLOP", "OSQP", "SCIPY", "GLPK")
_ALIASES = ("ECOS_BB", "GLPK_MI", "CLARABEL", "HIGHS")


def registry() -> dict[str, Method]:
    """All methods of the package by name; those whose solver is missing fail with that reason.

    >>> [name for name in registry() if name.startswith("octagon-inscribed")]
    ['octagon-inscribed/corners/clarabel-qdldl/1e-8']
    """
    made = _Registry()
    for asked in (None, 1e-6, 1e-8):
        name = "cvxlimit" if asked is None else f"cvxlimit/{_short(asked)}"
        full = f"cvxlimit/full{name.removeprefix('cvxlimit')}"
        made.add(Model(name, "cvxlimit, default settings (auto)", tolerance=asked))
        made.add(Model(full, "cvxlimit, full model", tolerance=asked, model="full"))
    made.add(Model("cvxlimit/octagon", "cvxlimit, octagon", surface="octagon"))
    _add_tolerances(made)
    _add_surfaces(made)
    _add_formulations(made)
    _add_blockwise(made)
    _add_solvers(made)
    for choice in FrozenModel.CHOICES:
        solver = settings_for("CLARABEL", 1e-8, _QDLDL)
        name, line = f"frozen/{choice}", "conic, Parameters, Clarabel qdldl"
        made.add(FrozenModel(name, line, solver=solver, tolerance=1e-8, parameters=choice))
    return made.methods


def interaction_registry() -> dict[str, Method]:
    """All methods for torsion-shear-bending interaction, by name."""
    made = _Registry()
    for kind, surfaces in (("fixed-point", ("conic", "octagon")), ("certified", ("conic",))):
        for moments in ("independent", "signed", "paper"):
            for surface in surfaces:
                name = f"{kind}/{moments}/{surface}"
                line = f"{kind}, {moments} moments"
                made.add(Model(name, line, surface, interaction=kind, moments=moments))
    return made.methods


def physics_registry() -> dict[str, Method]:
    """Other models of the same contacts, by name, and the paper's to compare them with.

    Each has a load factor of its own: errors are differences from the paper's cone. Strengths are
    multiples of the mean pressure on supports; for a support that moves see
    :class:`~cvxlimit.compare.physics.Settlement`.

    >>> [name for name in physics_registry() if "/" not in name][:6]
    ['linear', 'parabolic', 'exact', 'vertex-forces', 'mortar', 'without-ties']
    """
    made = _Registry()
    made.add(Model("linear", "linear torsion-shear"))
    made.add(Model("parabolic", "parabolic torsion-shear", torsion_shear="parabolic"))
    made.add(Model("exact", "exact torsion-shear", torsion_shear="exact", tolerance=1e-3))
    made.add(Model("vertex-forces", "vertex forces", (Rocking(),), vertex_forces))
    for times in (10.0, 100.0):
        name = f"crushing/{times:g}"
        made.add(Strengthened(name, "effective rectangle", compressive=times))
        field = PlasticField(corner_compressions)
        made.add(
            Strengthened(f"{name}/field", "plastic field", formulation=field, compressive=times)
        )
    made.add(Strengthened("mortar", "mortar", cohesion=0.2, tensile=0.1))
    made.add(Untied("without-ties", "without ties"))
    made.add(Model("zero-dilatancy", "zero dilatancy", flow="zero-dilatancy", tolerance=1e-4))
    made.add(Model("gilbert", "Gilbert's scheme", flow="gilbert", tolerance=1e-3))
    return made.methods


def _add_tolerances(made: _Registry) -> None:
    for tolerance in (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-11):
        solver = settings_for("CLARABEL", tolerance, _QDLDL)
        name = f"conic/corners/clarabel-qdldl/{_short(tolerance)}"
        made.add(Model(name, f"conic, {_QDLDL}", solver=solver, tolerance=tolerance))


def _add_surfaces(made: _Registry) -> None:
    for side in ("", "-inscribed"):
        for facets in (8, 16, 32, 64):
            surface = ("octagon" if facets == 8 else f"{facets}-gon") + side
            line = f"8 to 64 facets, {'inscribed' if side else 'circumscribed'}, {_QDLDL}"
            solver = settings_for("CLARABEL", 1e-8, _QDLDL)
            name = f"{surface}/corners/clarabel-qdldl/1e-8"
            made.add(Model(name, line, surface, solver=solver, tolerance=1e-8))


def _add_formulations(made: _Registry) -> None:
    for surface in ("conic", "octagon"):
        solver = settings_for("CLARABEL", 1e-8, _QDLDL)
        name = f"{surface}/resultants/clarabel-qdldl/1e-8"
        line = f"{surface}, resultants, {_QDLDL}"
        made.add(Model(name, line, surface, resultants, solver, 1e-8))


def _add_blockwise(made: _Registry) -> None:
    for surface in ("conic", "octagon"):
        for backend, spelt in _FACTORISATIONS.items():
            label = f"blockwise {spelt}"
            for tolerance in (1e-6, 1e-8, 1e-11):
                solver = settings_for("BLOCKWISE", tolerance, label, backend=backend)
                name = f"{surface}/corners/blockwise-{backend}/{_short(tolerance)}"
                line = f"{surface}, {label}"
                made.add(Model(name, line, surface, solver=solver, tolerance=tolerance))


def _add_solvers(made: _Registry) -> None:
    for method in _CLARABEL_SOLVERS:
        label = f"Clarabel {method}"
        solver = settings_for("CLARABEL", 1e-8, label, direct_solve_method=method)
        name = f"conic/corners/clarabel-{method}/1e-8"
        made.add(Model(name, f"conic, {label}", solver=solver, tolerance=1e-8))
    for solver_name, tolerances in {**_CONIC_SOLVERS, **_unknown_solvers()}.items():
        for tolerance in tolerances:
            solver = settings_for(solver_name, tolerance)
            name = f"conic/corners/{solver_name.lower()}/{_short(tolerance)}"
            made.add(Model(name, f"conic, {solver_name}", solver=solver, tolerance=tolerance))
    for algorithm in ("ipm", "simplex"):
        solver = settings_for("HIGHS", 1e-8, f"HiGHS {algorithm}", solver=algorithm)
        name, line = f"octagon/corners/highs-{algorithm}/1e-8", f"octagon, HiGHS {algorithm}"
        made.add(Model(name, line, "octagon", solver=solver, tolerance=1e-8))
    for solver_name in _LINEAR_SOLVERS:
        solver = settings_for(solver_name, 1e-8)
        name, line = f"octagon/corners/{solver_name.lower()}/1e-8", f"octagon, {solver_name}"
        made.add(Model(name, line, "octagon", solver=solver, tolerance=1e-8))


def _unknown_solvers() -> dict[str, tuple[float, ...]]:
    """Installed solvers that nobody here has heard of, with their own default settings."""
    known = {*_CONIC_SOLVERS, *_LINEAR_SOLVERS, *_ALIASES}
    return {name: (1e-8,) for name in cp.installed_solvers() if name not in known}


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
