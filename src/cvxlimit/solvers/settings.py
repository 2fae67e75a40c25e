"""Settings of solvers, and the ladder that is climbed when an answer is not certified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee

from cvxlimit.solvers.sparse import best_backend

_CLARABEL = {"direct_solve_method": "qdldl"}
"""Clarabel's own LDL: on block assemblages 2 to 8 times faster than its default (faer)."""


def _clarabel(tolerance: float, **more: Any) -> dict[str, Any]:
    names = ("tol_gap_abs", "tol_gap_rel", "tol_feas")
    return {**_CLARABEL, **dict.fromkeys(names, tolerance), **more}


OPTIONS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "CLARABEL": _clarabel(1e-11, max_iter=200),
        "BLOCKWISE": {},
        "QOCO": {"abstol": 1e-8, "reltol": 1e-8},
        "ECOS": {"abstol": 1e-10, "reltol": 1e-10, "feastol": 1e-10, "max_iters": 300},
        "SCS": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iters": 100_000},
        "HIGHS": {},
        "MOSEK": {},
        "GUROBI": {"BarQCPConvTol": 1e-9},
    }
)
"""Tight settings per solver name, as CVXPY spells it.

Looser ones save little and cost the bracket: Clarabel at 1e-8 was 0 to 12 % faster than at 1e-10 on
panels of 886 to 7,219 contacts, with brackets 4e-6 to 1e-4 wide in place of 4e-8 to 3e-7."""

WORK: Mapping[tuple[str, bool], float] = MappingProxyType(
    {
        ("superlu", True): 4.5e8,
        ("cholmod", True): 1.4e8,
        ("superlu", False): 4e6,
        ("cholmod", False): 4e6,
    }
)
"""From how much work (:attr:`Shape.work`) on the blockwise solver comes first, by its factorisation
and whether the problem has second-order cones: about 5,000, 2,900, 500 and 500 contacts of a panel.
Measured with ``python -m benchmarks run --methods "*/corners/clarabel-qdldl/1e-8" "*/qoco/1e-8"
"*/blockwise-*/1e-8"``. From 2,900 to 5,000 contacts QOCO is up to 20 % faster with cones, but its
errors grow to 1e-6, those of the blockwise solver stay below 1e-8."""

_QUICK_BRACKET = 1e-6
"""Narrowest bracket that is asked of QOCO. At tolerances below 1e-8 its brackets are no narrower:
8e-7 in place of 5e-8 on the S12-class panel, 1e-6 in place of 2e-8 on one of 1,828 contacts."""

_LINEAR_ONLY = frozenset({"HIGHS", "GLOP", "PDLP", "SCIPY", "GLPK", "CBC"})


@dataclass(frozen=True)
class SolverSettings:
    """A solver by CVXPY's name, its options, and a label for the history.

    Example
    -------
    >>> SolverSettings("CLARABEL", {"max_iter": 50}).name
    'CLARABEL'
    """

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""

    def __str__(self) -> str:
        return self.label or self.name


def default_ladder() -> tuple[SolverSettings, ...]:
    """Rungs in order: Clarabel as a rule, then tighter, then every other installed solver."""
    rungs = [
        SolverSettings("CLARABEL", OPTIONS["CLARABEL"]),
        SolverSettings(
            "CLARABEL",
            _clarabel(1e-13, max_iter=500, reduced_tol_feas=1e-9, iterative_refinement_max_iter=50),
            "CLARABEL tight",
        ),
        SolverSettings(
            "CLARABEL",
            _clarabel(1e-12, max_iter=500, equilibrate_enable=False),
            "CLARABEL unequilibrated",
        ),
    ]
    others = [name for name in ("MOSEK", "GUROBI", "ECOS", "HIGHS", "SCS") if name in _installed()]
    return (*rungs, *(SolverSettings(name, OPTIONS[name]) for name in others))


def iterate_ladder() -> tuple[SolverSettings, ...]:
    """The ladder for iterations that feed on the forces of their last solve.

    Clarabel at 1e-9 comes first, whatever else is installed: which of many possible forces a
    solver picks depends on the solver, and at tighter tolerances on rounding. With twelve orders of
    the tuff wall's blocks, signed moments and old-value weight 0.8, the fixed point converged 12
    times at 1e-9, 10 times at 1e-11, and 8 times at 1e-8 and at 1e-10.

    Example
    -------
    >>> str(iterate_ladder()[0])
    'CLARABEL'
    """
    return (SolverSettings("CLARABEL", _clarabel(1e-9, max_iter=200)), *default_ladder())


@dataclass(frozen=True)
class Shape:
    """What a compiled problem looks like, as far as it matters for its solvers.

    Attributes
    ----------
    variables, equations : int
    front : float
        Mean width of the equations' profile in reverse Cuthill-McKee order: how much of the
        assemblage closes on itself. An arch of any length has a narrow one.
    is_conic : bool
        True with second-order cones.
    """

    variables: int
    equations: int
    front: float
    is_conic: bool

    @property
    def work(self) -> float:
        """Operations of a factorisation within the profile, up to a factor."""
        return self.equations * self.front**2

    @classmethod
    def of(cls, equations: sp.csr_array, is_conic: bool) -> Shape:
        """From the matrix (equations, variables) of a problem's equality constraints."""
        return cls(equations.shape[1], equations.shape[0], front_width(equations), is_conic)


def limit_ladder(shape: Shape, tolerance: float = 1e-5) -> tuple[SolverSettings, ...]:
    """The ladder for a limit problem: :func:`default_ladder` with two more solvers in it.

    The blockwise solver comes first where it was measured to be faster (:data:`WORK`). Elsewhere
    QOCO does, if it is installed: 1.2 to 1.8 times as fast as Clarabel on walls and panels to
    2,000 contacts, with brackets of 1e-8 to 1e-7. The blockwise solver is third there.

    Parameters
    ----------
    shape : Shape
    tolerance : float
        Width of the bracket that is asked for. Below 1e-6 QOCO would often run in vain.

    Example
    -------
    >>> arch = Shape(variables=140, equations=120, front=12.0, is_conic=True)
    >>> "CLARABEL" in [str(rung) for rung in limit_ladder(arch)[:3]]
    True
    """
    first, *others = default_ladder()
    own = SolverSettings("BLOCKWISE", OPTIONS["BLOCKWISE"])
    if shape.work >= WORK[best_backend(), shape.is_conic]:
        return (own, first, *others)
    if tolerance < _QUICK_BRACKET or "QOCO" not in _installed():
        return (first, own, *others)
    return (SolverSettings("QOCO", OPTIONS["QOCO"]), first, own, *others)


def front_width(equations: sp.csr_array) -> float:
    """Mean width of the profile of A A' in reverse Cuthill-McKee order."""
    pattern = abs(equations)
    square = (pattern @ pattern.T).tocsr()
    order = reverse_cuthill_mckee(square, symmetric_mode=True)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    entries = square.tocoo()
    first = np.arange(len(order))
    np.minimum.at(first, place[entries.row], place[entries.col])
    return float((np.arange(len(order)) - first).mean())


def is_conic(problem: cp.Problem) -> bool:
    """True if the problem has second-order cones."""
    return any(isinstance(constraint, cp.SOC) for constraint in problem.constraints)


def suits(settings: SolverSettings, problem: cp.Problem) -> bool:
    """False for solvers of linear problems when the problem has second-order cones."""
    return not (is_conic(problem) and settings.name in _LINEAR_ONLY)


@cache
def _installed() -> frozenset[str]:
    return frozenset(cp.installed_solvers())
