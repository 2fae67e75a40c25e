"""The table of solvers: one row each, with all that this package knows about it.

To add one that CVXPY knows, write a row (without one it runs with its own default settings). One
that CVXPY does not know is a class in :data:`cvxlimit.solvers.running.PLUG_INS` besides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from cvxlimit.checks import ratio


@dataclass(frozen=True)
class Solver:
    """A solver by CVXPY's name.

    Attributes
    ----------
    name : str
    licence : str
        As it matters to those who install it.
    comes_with : str
        What to install: nothing besides the package, one of its extras, or a package of its own.
    tolerances : tuple of str
        Options that hold its tolerances; empty if it has none that CVXPY passes on.
    tight : float
        What is asked of them on the ladder.
    options : mapping
        Further options, with reasons in the rows below.
    has_cones : bool
        False if it solves linear problems only.
    is_tried : bool
        True if it is on the default ladder, below Clarabel, where it is installed.
    """

    name: str
    licence: str
    comes_with: str
    tolerances: tuple[str, ...] = ()
    tight: float = 1e-9
    options: Mapping[str, Any] = field(default_factory=dict)
    has_cones: bool = True
    is_tried: bool = False


_CORE = "cvxlimit"
_ALONE = "a package of its own"

_ROWS = (
    # Clarabel's own LDL is 2 to 8 times as fast on block assemblages as its default (faer). Looser
    # tolerances save little and cost the bracket: 1e-8 was 0 to 12 % faster than 1e-10 on panels of
    # 886 to 7,219 contacts, with brackets 4e-6 to 1e-4 wide in place of 4e-8 to 3e-7.
    Solver("CLARABEL", "Apache-2.0", _CORE, ("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-11,
           {"direct_solve_method": "qdldl", "max_iter": 200}),
    Solver("BLOCKWISE", "MIT", _CORE, ("tolerance",), 1e-11),
    Solver("RESCALED", "MIT", _CORE, ("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-12,
           {"direct_solve_method": "qdldl", "max_iter": 200}),
    # At tolerances below 1e-8 its brackets are no narrower.
    Solver("QOCO", "BSD-3-Clause", "cvxlimit[fast]", ("abstol", "reltol"), 1e-8),
    Solver("MOSEK", "commercial", _ALONE, ("eps",), 1e-9, is_tried=True),
    Solver("GUROBI", "commercial", _ALONE, ("BarConvTol", "BarQCPConvTol"), 1e-9, is_tried=True),
    Solver("ECOS", "GPL-3.0", _ALONE, ("abstol", "reltol", "feastol"), 1e-10,
           {"max_iters": 300}, is_tried=True),
    Solver("HIGHS", "MIT", _CORE, ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
           1e-9, {"time_limit": 60.0}, has_cones=False, is_tried=True),
    # Iterations alone are no budget: 100,000 take more than eight minutes on 1,906 contacts with
    # interaction, and an answer this late has not been seen to be of use.
    Solver("SCS", "MIT", _CORE, ("eps_abs", "eps_rel"), 1e-9,
           {"max_iters": 100_000, "time_limit_secs": 60.0}, is_tried=True),
    Solver("MOREAU", "Apache-2.0", _ALONE),
    Solver("COPT", "commercial", _ALONE),
    Solver("XPRESS", "commercial", _ALONE),
    Solver("CUCLARABEL", "Apache-2.0", _ALONE),
    Solver("CUOPT", "Apache-2.0", _ALONE, ("optimality",), has_cones=False),
    Solver("CVXOPT", "GPL-3.0", "cvxlimit[fast]", ("abstol", "reltol", "feastol")),
    Solver("GLPK", "GPL-3.0", "cvxlimit[fast]", has_cones=False),
    Solver("GLOP", "Apache-2.0", _ALONE, has_cones=False),
    Solver("PDLP", "Apache-2.0", _ALONE, has_cones=False),
    Solver("CBC", "EPL-2.0", _ALONE, has_cones=False),
    Solver("SCIPY", "BSD-3-Clause", _CORE, has_cones=False),
    Solver("OSQP", "Apache-2.0", _CORE, has_cones=False),
)  # fmt: skip

SOLVERS: Mapping[str, Solver] = MappingProxyType({row.name: row for row in _ROWS})
"""All rows by name, those of the default ladder in its order."""


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


def settings_for(
    solver: str, tolerance: float | None = None, label: str = "", /, **options: Any
) -> SolverSettings:
    """Settings of ``solver`` (CVXPY's name) at ``tolerance``, whatever it calls its options.

    Without a tolerance they are those of the ladder; ``options`` win over the table's.

    Raises
    ------
    ModelError
        If the tolerance is not a number between 0 and 1.

    >>> settings_for("SCS", 1e-4).options["eps_rel"]
    0.0001
    """
    row = SOLVERS.get(solver, Solver(solver, "", ""))
    asked = row.tight if tolerance is None else ratio(tolerance, "tolerance")
    own = {**row.options, **dict.fromkeys(row.tolerances, asked), **options}
    return SolverSettings(solver, own, label)
