"""The table of solvers: one row each, with all that this package knows about it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cache, cached_property
from importlib import import_module
from typing import Any

import cvxpy as cp
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from cvxpy.reductions.solvers.defines import SOLVER_MAP_CONIC, SOLVER_MAP_QP

from cvxlimit.base.checks import ratio
from cvxlimit.base.doors import Door
from cvxlimit.base.versions import __version__, version_of
from cvxlimit.errors import ModelError
from cvxlimit.solvers.matrices import Rescaled


@dataclass(frozen=True)
class Solver:
    """A solver by CVXPY's name.

    Attributes
    ----------
    comes_with : str
        What brings it.
    tolerances : tuple of str
        Options that hold its tolerances; empty if it has none that CVXPY passes on. On the ladder
        they are ``tight``, beside further ``options``.
    iterations : str
        Option that holds the most iterations it may take.
    is_tried : bool
        True if it is on the default ladder, below Clarabel, where it is installed.
    starts_warm : bool
        True if a problem solved again starts from the answer before.
    takes_matrices : bool
        True if CVXPY's interface to it needs nothing of a problem but its matrices and cones.
    splits_equations : bool
        True if CVXPY's interface to it takes equations and cones apart.
    distribution : str
        What it is installed as, if that is not its name in small letters.
    pace : (float, float)
        Seconds on one core: the first times the number of variables to the power of the second
        (docs/evidence/solvers.md). Without measurements it is Clarabel's.
    greets : str
        Place of what prints a banner on stdout when it is first made in a process, whatever its
        options say: ``"module:attribute"``.
    plug_in : subclass of cvxpy's ConicSolver, or None
        Its interface, if CVXPY does not know it by name.
    lacks : str
        Why it cannot be used here, if so.
    """

    name: str
    comes_with: str = "a package of its own"
    tolerances: tuple[str, ...] = ()
    tight: float = 1e-9
    options: Mapping[str, Any] = field(default_factory=dict)
    iterations: str = "max_iter"
    is_tried: bool = False
    starts_warm: bool = False
    takes_matrices: bool = False
    splits_equations: bool = False
    distribution: str = ""
    pace: tuple[float, float] = (3.2e-7, 1.6)
    greets: str = ""
    plug_in: type[ConicSolver] | None = None
    lacks: str = ""

    @property
    def has_cones(self) -> bool:
        """False if its interface to CVXPY takes no second-order cones."""
        interface = self.plug_in or SOLVER_MAP_CONIC.get(self.name)
        if interface is None:
            return self.name not in SOLVER_MAP_QP
        return cp.SOC in interface.SUPPORTED_CONSTRAINTS

    def at(
        self, tolerance: float | None = None, label: str = "", iterations: int | None = None,
        **options: Any,
    ) -> SolverSettings:  # fmt: skip
        """Settings as :func:`settings_for` makes them."""
        asked = self.tight if tolerance is None else tolerance
        budget = {} if iterations is None else {self.iterations: iterations}
        own = {**self.options, **dict.fromkeys(self.tolerances, asked), **budget, **options}
        settings = SolverSettings(self.name, own, label)
        settings.__dict__["row"] = self  # which need not be looked up
        return settings


_CLARABEL = ("tol_gap_abs", "tol_gap_rel", "tol_feas")
_OWN_LDL = {"direct_solve_method": "qdldl", "max_iter": 200}

_ROWS = (
    # Clarabel's own LDL is 2 to 8 times as fast on block assemblages as its default (faer). Looser
    # tolerances save little and cost the bracket (docs/evidence/solvers.md).
    Solver("CLARABEL", "cvxlimit", _CLARABEL, 1e-11, _OWN_LDL, takes_matrices=True),
    Solver("RESCALED", "cvxlimit", _CLARABEL, 1e-12, _OWN_LDL, distribution="clarabel",
           takes_matrices=True, plug_in=Rescaled),
    # At tolerances below 1e-8 its brackets are no narrower.
    Solver("QOCO", "cvxlimit[fast]", ("abstol", "reltol"), 1e-8, iterations="max_iters",
           takes_matrices=True, splits_equations=True, pace=(1.8e-7, 1.6)),
    Solver("MOSEK", tolerances=("eps",), is_tried=True),
    Solver("GUROBI", tolerances=("BarConvTol", "BarQCPConvTol"), is_tried=True,
           distribution="gurobipy"),
    Solver("ECOS", tolerances=("abstol", "reltol", "feastol"), tight=1e-10,
           options={"max_iters": 300}, iterations="max_iters", is_tried=True, takes_matrices=True,
           splits_equations=True),
    Solver("HIGHS", "cvxlimit", ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
           options={"time_limit": 60.0}, is_tried=True, distribution="highspy",
           greets="highspy:Highs"),
    # Iterations alone are no budget: 100,000 take more than eight minutes on 1,906 contacts with
    # interaction, and an answer this late has not been seen to be of use.
    Solver("SCS", "cvxlimit", ("eps_abs", "eps_rel"),
           options={"max_iters": 100_000, "time_limit_secs": 60.0}, iterations="max_iters",
           is_tried=True, takes_matrices=True),
    Solver("CVXOPT", tolerances=("abstol", "reltol", "feastol")),
    Solver("CUOPT", tolerances=("optimality",)),  # of cones CVXPY gets no duals
)  # fmt: skip

SOLVERS = Door("cvxlimit.solvers", {row.name: row for row in _ROWS})
"""All rows by name, those of the default ladder in its order; extensions add theirs. Rows of other
packages are found when they are named, and so are not on that ladder."""


@dataclass(frozen=True)
class SolverSettings:
    """A solver with its settings.

    ``name`` is CVXPY's name of it, ``options`` are its own, ``label`` is for the history. Its
    interface ``plug_in`` is needed where neither CVXPY nor this package knows it by name;
    ``verbose`` prints its log.

    >>> SolverSettings("CLARABEL", {"max_iter": 50}).name
    'CLARABEL'
    """

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""
    plug_in: type[ConicSolver] | None = None
    verbose: bool = False

    def __str__(self) -> str:
        return self.label or self.name

    @cached_property
    def row(self) -> Solver:
        """The solver's row in the table; one without a row has CVXPY's settings."""
        row = SOLVERS.get(self.name) if self.plug_in is None else None
        return row or Solver(self.name, plug_in=self.plug_in)


def settings_for(
    solver: str,
    tolerance: float | None = None,
    label: str = "",
    /,
    iterations: int | None = None,
    **options: Any,
) -> SolverSettings:
    """Returns settings of ``solver`` (CVXPY's name) at a ``tolerance``, whatever its options are
    called.

    Without a tolerance they are those of the ladder; ``iterations`` are the most it may take;
    ``options`` win over the table's.

    Raises
    ------
    ModelError
        If the tolerance is not a number between 0 and 1.

    >>> settings_for("SCS", 1e-4).options["eps_rel"]
    0.0001
    """
    asked = None if tolerance is None else ratio(tolerance, "tolerance")
    return SolverSettings(solver).row.at(asked, label, iterations, **options)


def check_installed(settings: SolverSettings) -> None:
    """Raises ModelError for a solver that CVXPY cannot find, and for our own where it is not
    compiled."""
    name, row = settings.name, settings.row
    SOLVERS.check(name)
    if row.plug_in is None and name not in installed():
        known = sorted({*SOLVERS, *SOLVER_MAP_CONIC, *SOLVER_MAP_QP})
        if name in known:
            raise ModelError(f"solver {name} is not installed; it comes with {row.comes_with}")
        near, here = " or ".join(get_close_matches(name.upper(), known, 3, 0.7)), ", ".join(able())
        hint = f"did you mean {near}?" if near else f"installed are {here}"
        raise ModelError(f"there is no solver {name!r}; {hint}")
    if row.lacks:
        raise ModelError(f"solver {name} is not here: {row.lacks}")


def options_of(solver: str) -> frozenset[str]:
    """Returns the names of a solver's options; none where only the solver knows them.

    >>> "max_iter" in options_of("CLARABEL")
    True
    """
    if own := getattr(SolverSettings(solver).row.plug_in, "OPTIONS", None):
        return frozenset(own)
    if solver == "RESCALED":
        return options_of("CLARABEL") | {"first"}
    holders = {
        "CLARABEL": lambda: import_module("clarabel").DefaultSettings(),
        "HIGHS": lambda: import_module("highspy").HighsOptions(),
        "QOCO": lambda: import_module("qoco").QOCO().ext.QOCOSettings(),
    }
    holder = holders[solver]() if solver in holders and solver in installed() else None
    return frozenset(name for name in dir(holder) if holder and not name.startswith("_"))


def able(with_cones: bool = False) -> list[str]:
    """Returns the names of solvers that can be put on a ladder here: of all, or only of those that
    take second-order cones."""
    names = {name for name, row in SOLVERS.items() if row.plug_in is not None} | installed()
    names -= {name for name, row in SOLVERS.items() if row.lacks}
    return sorted(n for n in names if SolverSettings(n).row.has_cones or not with_cones)


def versions(solvers: Iterable[str]) -> dict[str, str]:
    """Returns versions by distribution, of cvxlimit, CVXPY and the solvers with these names;
    ``"unknown"`` for one that is not installed as a distribution.

    >>> list(versions(["HIGHS", "CLARABEL", "BLOCKWISE"]))
    ['cvxlimit', 'cvxpy', 'blockwise', 'clarabel', 'highspy']
    """
    found = {}
    for name in solvers:
        row = SolverSettings(name).row
        distribution = row.distribution or row.name.lower()
        is_own = row.plug_in is not None and not row.distribution
        found[distribution] = __version__ if is_own else version_of(distribution)
    return {"cvxlimit": __version__, "cvxpy": version_of("cvxpy"), **dict(sorted(found.items()))}


@cache
def installed() -> frozenset[str]:
    """Returns the names of solvers for convex problems that CVXPY finds."""
    return frozenset(cp.installed_solvers()) & {*SOLVER_MAP_CONIC, *SOLVER_MAP_QP}
