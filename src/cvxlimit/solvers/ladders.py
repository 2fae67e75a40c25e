"""Ladders: in which order solvers are tried, one for each purpose.

:data:`LADDERS` has them all; :func:`ladder_for` returns those of a purpose that are here. A ladder
is gone down until an answer is certified. Figures behind the orders and tolerances are in
docs/evidence/solvers.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from cvxpy.reductions.solvers.defines import SOLVER_MAP_CONIC

from cvxlimit.errors import ModelError
from cvxlimit.solvers.table import (
    SOLVERS,
    Solver,
    SolverSettings,
    check_installed,
    installed,
    settings_for,
)

Ladder = tuple[SolverSettings, ...]

ASKED = 0.0
"""Stands in a rung for the tolerance that the caller asks for."""

LEADING = 1e-6
"""Tolerance of problems that only lead the way, and the narrowest bracket that is asked of QOCO
with cones: it often fails below."""

MANY = 500
"""Contacts from which on nodes of branch and bound are left to our own solver and Clarabel."""


class Rung(NamedTuple):
    """A solver on a ladder. Without a ``tolerance`` it has that of its row in the table of solvers,
    without ``iterations`` as many as it takes; the ``label``, for the history, is given the
    tolerance."""

    solver: str
    tolerance: float | None = None
    iterations: int | None = None
    label: str = ""
    options: Mapping[str, Any] = MappingProxyType({})


_OWN, _CLARABEL, _QOCO = "BLOCKWISE", "CLARABEL", "QOCO"
_TOLD = {name: f"{name} {{:g}}" for name in (_OWN, _CLARABEL, _QOCO)}

LADDERS: Mapping[str, tuple[Rung, ...]] = {
    # Any problem: Clarabel, Clarabel in units of its own answer or of ours, which weights far apart
    # need, and Clarabel at tighter tolerances. Every other solver follows (default_ladder).
    "any": (
        Rung(_CLARABEL),
        Rung("RESCALED", label="CLARABEL rescaled"),
        Rung("RESCALED", label="BLOCKWISE rescaled", options={"first": _OWN}),
        Rung(
            _CLARABEL, 1e-13, 500, "CLARABEL tight",
            {"reduced_tol_feas": 1e-9, "iterative_refinement_max_iter": 50},
        ),
        Rung(_CLARABEL, 1e-12, 500, "CLARABEL unequilibrated", {"equilibrate_enable": False}),
    ),
    # Limit problems by size and kind (limit_ladder), those of any problem behind them. Ours is
    # exact in equilibrium and strictly inside, so that on large problems its gap is the bracket; on
    # smaller ones digits are cheap and Clarabel comes next, since contacts of weak stone may be too
    # large for it. On tiny ones QOCO opens strong stone where Clarabel fails.
    "large": (Rung(_OWN, ASKED), Rung(_OWN, label="BLOCKWISE tight"), Rung(_CLARABEL)),
    "medium": (Rung(_OWN, ASKED), Rung(_CLARABEL), Rung(_OWN, label="BLOCKWISE tight")),
    "small": (
        Rung(_QOCO, ASKED, options={"ir_tol": 1e-10, "max_ir_iters": 20}),
        Rung(_CLARABEL),
        Rung(_OWN),
    ),
    "tiny": (Rung(_CLARABEL), Rung(_QOCO, ASKED), Rung(_OWN)),
    "narrow": (Rung(_CLARABEL), Rung(_OWN)),
    # Forces that count to 1e-9 of the load; ours takes half to a third of Clarabel's time.
    "tight": (Rung(_OWN, 1e-9, 100), Rung(_CLARABEL, 1e-9, 100, _TOLD[_CLARABEL]), Rung(_CLARABEL)),
    # Fixed-point iterates feed on the forces of the last: always the same solver first, for which
    # of many possible forces are picked depends on it. Ours starts from the last, but takes linear
    # objectives only.
    "iterates": (Rung(_OWN, 1e-8, 100), Rung(_CLARABEL, 1e-9)),
    "quadratic iterates": (Rung(_CLARABEL, 1e-9),),
    # One of many problems whose answers are checked outside the solver: those not solved in 60
    # iterations were never solved later, and first-order methods keep one busy for minutes. Ours
    # takes as long in all at looser tolerances, and S12 ends 0.8 % wider.
    "leading": (
        Rung(_OWN, 1e-7, 60, _TOLD[_OWN]),
        Rung(_QOCO, LEADING, 60, _TOLD[_QOCO]),
        Rung(_CLARABEL, LEADING, 60, _TOLD[_CLARABEL]),
    ),
    # Safe steps, each from where the last one ended: strictly inside, so that bounds lose nothing.
    "steps": (Rung(_OWN, 5e-6, 60, _TOLD[_OWN]),),
    "held centres": (Rung(_OWN, 1e-8, 60, _TOLD[_OWN]),),
    # Nodes of branch and bound. One that carries nothing has no forces as its answer, on which
    # Clarabel fails; few refinements of QOCO's directions, since bounds are checked outside.
    "nodes": (
        Rung(_OWN, ASKED, 60),
        Rung(_QOCO, 1e-8, 60, options={"max_ir_iters": 1}),
        Rung(_CLARABEL, 1e-8),
        Rung(_OWN, 1e-8),
    ),
    "nodes of many": (Rung(_OWN, 1e-8, 100), Rung(_CLARABEL, 1e-8)),
    # Pairs of problems without dilatancy, each from the last one of its kind.
    "pairs": (Rung(_OWN, ASKED), Rung(_CLARABEL, ASKED, label=_TOLD[_CLARABEL])),
    # Iterates of paths, and their explicit steps, whose quadratic objectives Clarabel alone takes.
    "paths": (Rung(_OWN, ASKED), Rung(_CLARABEL, 1e-12)),
    "explicit steps": (Rung(_CLARABEL, 1e-9),),
}  # fmt: skip
"""The rungs of every purpose, in order."""


def ladder_for(purpose: str, tolerance: float | None = None) -> Ladder:
    """Returns the solvers of a purpose, a key of :data:`LADDERS`, that are here: installed, or
    compiled if they are ours. ``tolerance`` is that of rungs which leave it to the caller.

    >>> [str(settings) for settings in ladder_for("explicit steps")]
    ['CLARABEL']
    """
    found, here = list[SolverSettings](), _here()
    for rung in LADDERS[purpose]:
        if {rung.solver, rung.options.get("first", rung.solver)} <= here.keys():
            asked = tolerance if rung.tolerance == ASKED else rung.tolerance
            label = rung.label.format(asked)
            found.append(here[rung.solver].at(asked, label, rung.iterations, **rung.options))
    return tuple(found)


def _here() -> dict[str, Solver]:
    """The rows of solvers that can be used here, in the table's order."""
    names = installed()
    return {
        name: row
        for name, row in SOLVERS.items()
        if not row.lacks and (row.plug_in is not None or name in names)
    }


def blockwise(tolerance: float | None = None) -> Ladder:
    """Returns a ladder with our own solver alone, or an empty one where it is not here or was not
    compiled."""
    return (row.at(tolerance),) if (row := _here().get(_OWN)) else ()


def default_ladder(is_conic: bool = True) -> Ladder:
    """Returns the solvers for any problem: Clarabel with several settings, and then every other
    installed solver that takes the problem."""
    others = [row for row in _here().values() if row.is_tried]
    return (
        *ladder_for("any"),
        *(row.at() for row in others if row.has_cones or not is_conic),
    )


@dataclass(frozen=True)
class Shape:
    """The size of a compiled problem, as far as it matters for its solvers.

    ``variables``, ``equations`` and ``cones`` (second-order) are counted, and ``rows``: linear
    inequalities, signs among them.
    """

    variables: int
    equations: int
    cones: int
    rows: int

    @property
    def kind(self) -> str:
        """The kind of problem: ``"conic"`` with cones, ``"lean"`` if it is linear with less than
        1.5 rows per variable, otherwise ``"facets"``.

        The octagon in space has 2.0, a planar scene 1.3.
        """
        if self.cones:
            return "conic"
        return "facets" if self.rows >= 1.5 * self.variables else "lean"


BLOCKWISE_FROM = {"conic": 100, "facets": 500, "lean": 1_000}
"""From how many variables on the blockwise solver comes first, by the kind of problem. From the
most of them on a problem is large; up to the fewest it is tiny."""


def limit_ladder(shape: Shape, tolerance: float = 1e-5) -> Ladder:
    """Returns the ladder for a limit problem, whose bracket is to be within ``tolerance``.

    The blockwise solver comes first from as many variables on as it was measured to be faster,
    third elsewhere; there QOCO leads, if it is installed and can be asked for such a bracket.
    """
    size, kind, asked = shape.variables, shape.kind, (1.0 / 3.0) * tolerance
    if blockwise() and size >= BLOCKWISE_FROM[kind]:
        is_large = size >= max(BLOCKWISE_FROM.values())
        first = ladder_for("large", asked) if is_large else ladder_for("medium", min(asked, 1e-9))
    elif kind != "lean" and tolerance < LEADING:
        first = ladder_for("narrow")
    else:
        is_tiny = size <= BLOCKWISE_FROM["conic"]
        first = ladder_for("tiny" if is_tiny else "small", 1e-10 if kind == "lean" else None)
    return (*first, *default_ladder(shape.cones > 0)[1:])


def ladder_of(
    solvers: Sequence[str | SolverSettings | type[ConicSolver]] | str | SolverSettings,
) -> Ladder:
    """Returns a user's ladder, of names of installed solvers, settings, or interfaces of one's own.

    Raises
    ------
    ModelError
        For a solver that CVXPY does not find, or an entry that is no solver.
    """
    entries = [solvers] if isinstance(solvers, (str, SolverSettings)) else solvers
    if not isinstance(entries, Sequence) or not entries:
        raise ModelError(f"ladder must be a list of solvers, got {solvers!r}: write ['CLARABEL']")
    ladder: list[SolverSettings] = []
    for entry in entries:
        if isinstance(entry, str):
            check_installed(settings := settings_for(entry.upper()))
            ladder.append(settings)
        elif isinstance(entry, type) and issubclass(entry, ConicSolver):
            name = str(entry().name())
            is_known = type(SOLVER_MAP_CONIC.get(name)) is entry
            ladder.append(settings_for(name) if is_known else SolverSettings(name, plug_in=entry))
        elif isinstance(entry, SolverSettings):
            ladder.append(entry)
        else:
            raise ModelError(
                f"an entry of the ladder must be a solver's name or SolverSettings, got {entry!r}"
            )
    return tuple(ladder)


def asked_ladder(solver: Any, ladder: Any) -> Ladder | None:
    """Returns the ladder that a call asks for by ``solver`` (one) or ``ladder`` (several); None if
    it gives neither.

    Raises
    ------
    ModelError
        If both are given, or several solvers as one.

    >>> [str(entry) for entry in asked_ladder("clarabel", None)]
    ['CLARABEL']
    """
    if solver is None:
        return None if ladder is None else ladder_of(ladder)
    if ladder is not None:
        raise ModelError("solver and ladder both say who is to solve this: leave one out")
    if isinstance(solver, (list, tuple)):
        raise ModelError(f"solver must be one solver, got {solver!r}: write ladder={solver!r}")
    if not isinstance(solver, (str, SolverSettings, type)):
        raise ModelError(f"solver must be a name, got {solver!r}: write solver='CLARABEL'")
    return ladder_of([solver])
