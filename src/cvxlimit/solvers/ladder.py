"""The ladder of solvers that is climbed when an answer is not certified, and who comes first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from types import MappingProxyType

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints import Inequality, NonNeg, NonPos
from scipy.sparse.csgraph import reverse_cuthill_mckee

from cvxlimit.errors import ModelError
from cvxlimit.solvers.running import PLUG_INS
from cvxlimit.solvers.sparse import best_backend
from cvxlimit.solvers.table import SOLVERS, SolverSettings, settings_for

Ladder = tuple[SolverSettings, ...]

WORK: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "conic": {"superlu": 4.5e8, "cholmod": 1.4e8, "beside QOCO": 1.4e8},
        "facets": {"superlu": 4e6, "cholmod": 4e6, "beside QOCO": 1.5e7},
        "lean": {"superlu": 4e8, "cholmod": 1.5e8, "beside QOCO": 9e8},
    }
)
"""From how much work (:attr:`Shape.work`) on the blockwise solver comes first, by the kind of
problem: by its factorisation where Clarabel is the other choice, and at least that much where QOCO
is installed. Seconds of one core (Clarabel 1e-11, QOCO, blockwise 1e-11 with CHOLMOD):

=================================== ======== ===== ======== =====
problem                             Clarabel QOCO  blockwise work
=================================== ======== ===== ======== =====
panel, octagon, 250 contacts            0.08  0.05     0.08 1.6e6
panel, octagon, 552 contacts            0.33  0.18     0.20 7.4e6
panel, octagon, 1,159 contacts          0.84  0.55     0.42 3.1e7
planar wall, planar, 3,408 contacts     0.83  0.46     1.09 2.4e7
planar wall, planar, 6,868 contacts     2.32  1.37     2.53 9.9e7
planar wall, planar, 21,480 contacts   16.0   9.5      9.95 9.5e8
=================================== ======== ===== ======== =====

With cones: about 5,000 and 2,900 contacts of a panel. From 2,900 to 5,000 contacts QOCO is up to
20 % faster with cones, but its errors grow to 1e-6, those of the blockwise solver stay below
1e-8."""

_QUICK_BRACKET = 1e-6
"""Narrowest bracket that is asked of QOCO with cones. At tolerances below 1e-8 its brackets are no
narrower: 8e-7 in place of 5e-8 on the S12-class panel, 1e-6 in place of 2e-8 on one of 1,828
contacts."""

_QOCO_LEAN = 1e-10
"""Tolerance of QOCO without cones and facets: planar walls of 3,408 and 6,868 contacts have
brackets of 2e-7 and 1e-7, against 5e-5 and 1e-5 at 1e-8, for a fifth more time."""

_TINY = 100
"""Variables up to which Clarabel comes first in any case: on planar stacks and arches of 4 to 88
variables it is 1 ms faster than QOCO, a twentieth of all."""


def default_ladder() -> Ladder:
    """Rungs in order: Clarabel as a rule, then in units of its own answer, which is what weights
    far apart need, then tighter, then every other installed solver."""
    rungs = [
        settings_for("CLARABEL"),
        settings_for("RESCALED", None, "CLARABEL rescaled"),
        settings_for("RESCALED", None, "BLOCKWISE rescaled", first="BLOCKWISE"),
        settings_for(
            "CLARABEL", 1e-13, "CLARABEL tight",
            max_iter=500, reduced_tol_feas=1e-9, iterative_refinement_max_iter=50,
        ),
        settings_for(
            "CLARABEL", 1e-12, "CLARABEL unequilibrated", max_iter=500, equilibrate_enable=False
        ),
    ]  # fmt: skip
    others = [row.name for row in SOLVERS.values() if row.is_tried and row.name in installed()]
    return (*rungs, *map(settings_for, others))


def ladder_of(rungs: Sequence[str | SolverSettings] | str | SolverSettings) -> Ladder:
    """A ladder of one's own: names of any installed solvers, or settings.

    Raises
    ------
    ModelError
        For names of solvers that CVXPY does not find, and what is no name at all.

    Example
    -------
    >>> [str(rung) for rung in ladder_of(["CLARABEL", settings_for("SCS", 1e-6, "SCS loose")])]
    ['CLARABEL', 'SCS loose']
    """
    given = [rungs] if isinstance(rungs, (str, SolverSettings)) else rungs
    if not isinstance(given, Sequence) or not given:
        raise ModelError(f"ladder must be a list of solvers, got {rungs!r}: write ['CLARABEL']")
    return tuple(_rung(rung) for rung in given)


def _rung(rung: str | SolverSettings) -> SolverSettings:
    if isinstance(rung, SolverSettings):
        return rung
    if not isinstance(rung, str):
        raise ModelError(
            f"a rung of the ladder must be a solver's name or SolverSettings, got {rung!r}"
        )
    check_installed(settings := settings_for(rung.upper()))
    return settings


def check_installed(settings: SolverSettings) -> None:
    """Refuse a solver that CVXPY cannot find, and a factorisation that is not installed.

    Raises
    ------
    ModelError
    """
    name, backend = settings.name, settings.options.get("backend", "")
    known = [*installed(), *PLUG_INS]
    if name not in known:
        close = get_close_matches(name.upper(), known, 1, 0.8)
        row = SOLVERS.get(name)
        hint = f"did you mean {close[0]}?" if close else "CVXPY finds it once it is"
        if row is not None:
            hint = f"it comes with {row.comes_with}"
        raise ModelError(f"solver {name} is not installed; {hint}")
    if backend == "cholmod" and best_backend() != backend:
        raise ModelError("CHOLMOD is not installed; it comes with the package cvxopt")


def iterate_ladder() -> Ladder:
    """The ladder for iterations that feed on the forces of their last solve.

    Clarabel at 1e-9 comes first, whatever else is installed: which of many possible forces a
    solver picks depends on the solver, and at tighter tolerances on rounding. With twelve orders of
    the tuff wall's blocks, signed moments and old-value weight 0.8, the fixed point converged 12
    times at 1e-9, after 25 to 42 iterations, between 0.3408 and 0.3415.

    Example
    -------
    >>> str(iterate_ladder()[0])
    'CLARABEL'
    """
    return (settings_for("CLARABEL", 1e-9), *default_ladder())


LEADING = 1e-6
"""Tolerance of problems that only lead the way: 25 % faster than 1e-8 on the relaxations and safe
steps of interaction on S12, with the bounds of the last ones as narrow."""

_LEADING_ITERATIONS = 60
"""Iterations such a problem may take; 20 to 35 are usual, and what is not solved after 60 will not
be: the answer reached then is checked like any other."""


def leading_ladder(tolerance: float = LEADING) -> Ladder:
    """The ladder for one of many problems whose answers are checked outside the solver.

    QOCO, where it is installed, is 1.2 to 1.6 times as fast as Clarabel here. Every rung has a
    budget of iterations, and there are no first-order methods: SCS with its 100,000 iterations kept
    one frozen problem of the S10 panel busy for more than eight minutes.

    Example
    -------
    >>> all({"max_iter", "max_iters"} & set(rung.options) for rung in leading_ladder())
    True
    """
    most = _LEADING_ITERATIONS
    clarabel = settings_for("CLARABEL", tolerance, f"CLARABEL {tolerance:g}", max_iter=most)
    if "QOCO" not in installed():
        return (clarabel,)
    return (settings_for("QOCO", tolerance, f"QOCO {tolerance:g}", max_iters=most), clarabel)


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
    rows : int
        Linear inequalities, signs of variables among them.
    """

    variables: int
    equations: int
    front: float
    is_conic: bool
    rows: int = 0

    @property
    def kind(self) -> str:
        """``"conic"``, ``"facets"`` or ``"lean"``: linear with less than 1.5 rows per variable.

        The octagon in space has 2.0, a planar scene 1.3.
        """
        if self.is_conic:
            return "conic"
        return "facets" if self.rows >= 1.5 * self.variables else "lean"

    @property
    def work(self) -> float:
        """Operations of a factorisation within the profile, up to a factor."""
        return self.equations * self.front**2

    @classmethod
    def of(cls, equations: sp.csr_array, problem: cp.Problem) -> Shape:
        """From the matrix (equations, variables) of equality constraints, and the whole problem."""
        front, conic = front_width(equations), is_conic(problem)
        return cls(equations.shape[1], equations.shape[0], front, conic, inequalities(problem))


def limit_ladder(shape: Shape, tolerance: float = 1e-5) -> Ladder:
    """The ladder for a limit problem: :func:`default_ladder` with two more solvers in it.

    The blockwise solver comes first where it was measured to be faster (:data:`WORK`). Elsewhere
    QOCO does, if it is installed: 1.2 to 1.8 times as fast as Clarabel on walls and panels to
    2,000 contacts, with brackets of 1e-8 to 1e-7. The blockwise solver is third there.

    Parameters
    ----------
    shape : Shape
    tolerance : float
        Width of the bracket that is asked for. Below 1e-6 QOCO would often run in vain with cones.

    Example
    -------
    >>> arch = Shape(variables=140, equations=120, front=12.0, is_conic=True)
    >>> "CLARABEL" in [str(rung) for rung in limit_ladder(arch)[:3]]
    True
    """
    first, *others = default_ladder()
    own, kind = settings_for("BLOCKWISE"), shape.kind
    can_take_it = kind == "lean" or tolerance >= _QUICK_BRACKET
    has_qoco = "QOCO" in installed() and can_take_it
    least = WORK[kind][best_backend()]
    if has_qoco:
        least = max(least, WORK[kind]["beside QOCO"])
    if shape.work >= least:
        return (own, first, *others)
    if not has_qoco:
        return (first, own, *others)
    quick = settings_for("QOCO", _QOCO_LEAN if kind == "lean" else None)
    if shape.variables <= _TINY:  # second: it opens blocks with strong stone where Clarabel fails
        return (first, quick, own, *others)
    return (quick, first, own, *others)


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


def inequalities(problem: cp.Problem) -> int:
    """Number of linear inequalities, signs of variables among them."""
    rows = sum(c.size for c in problem.constraints if isinstance(c, (Inequality, NonPos, NonNeg)))
    return int(rows + sum(v.size for v in problem.variables() if v.attributes["nonneg"]))


def is_conic(problem: cp.Problem) -> bool:
    """True if the problem has second-order cones."""
    return any(isinstance(constraint, cp.SOC) for constraint in problem.constraints)


def suits(settings: SolverSettings, problem: cp.Problem) -> bool:
    """False for solvers of linear problems when the problem has second-order cones."""
    row = SOLVERS.get(settings.name)
    return row is None or row.has_cones or not is_conic(problem)


@cache
def installed() -> frozenset[str]:
    """Names of the solvers that CVXPY finds."""
    return frozenset(cp.installed_solvers())
