"""Ladders: in which order solvers are tried, one for each purpose.

A ladder is gone down until an answer is certified. Figures behind the orders and tolerances here
are in docs/evidence/solvers.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from cvxpy.reductions.solvers.defines import SOLVER_MAP_CONIC

from cvxlimit.errors import ModelError
from cvxlimit.solvers.table import (
    SOLVERS,
    SolverSettings,
    check_installed,
    installed,
    settings_for,
)

Ladder = tuple[SolverSettings, ...]


@dataclass(frozen=True)
class LadderNumbers:
    """The numbers behind the ladders; where each was measured is in docs/evidence/solvers.md."""

    # Tolerance of QOCO on lean problems (:class:`Shape`), and residual of its search directions on
    # others, ...
    finest: float = 1e-10
    refinements: int = 20  # ... which it refines in at most so many rounds.
    # Tolerance of forces that count to 1e-9 of the load, of fixed-point iterates by Clarabel, and
    # of the blockwise solver on small problems. There digits are cheap and Clarabel comes next:
    # contacts of weak stone may be too large for the blockwise solver.
    tight: float = 1e-9
    tight_iterations: int = 100  # Most iterations at that tolerance.
    # Tolerance of nodes of branch and bound, and of fixed-point iterates by the solver that starts
    # warm, ...
    node: float = 1e-8
    # ... or this share of the width at which nodes are closed: at 1e-2 splits followed noise.
    node_share: float = 1e-4
    # Rounds of refinement of QOCO's directions in nodes: few, since bounds are checked outside.
    node_refinements: int = 1
    # Tolerance of problems that only lead the way, and the narrowest bracket that is asked of QOCO
    # with cones.
    leading: float = 1e-6
    # Most iterations of such problems: those not solved in 60 were never solved later.
    leading_iterations: int = 60
    leads_from: int = 500  # From so many contacts on the blockwise solver leads the way, ...
    # ... at this tolerance: looser ones take as long in all, and S12 ends 0.8 % wider.
    leads: float = 1e-7
    steps: float = 5e-6  # Tolerance of safe steps by the solver that starts warm, ...
    steps_from: int = 200  # ... which comes first from so many contacts on.
    enough: float = 1 / 3  # Gap of the blockwise solver, over the width of the bracket asked for.


NUMBERS = LadderNumbers()

BLOCKWISE_FROM = {"conic": 100, "facets": 500, "lean": 1_000}
"""From how many variables on the blockwise solver comes first, by the kind of problem. From the
most of them on a problem is large; up to the fewest it is tiny, and Clarabel comes before QOCO."""


def blockwise(
    tolerance: float | None = None, label: str = "", iterations: int | None = None
) -> Ladder:
    """Returns a ladder with our own solver alone, or an empty one where it is not here or was not
    compiled."""
    row = SOLVERS.get("BLOCKWISE")
    if row is None or row.lacks:
        return ()
    return (row.at(tolerance, label, iterations),)


def default_ladder(is_conic: bool = True) -> Ladder:
    """Returns solvers in order: Clarabel, Clarabel in units of its own answer, which weights far
    apart need, Clarabel at tighter tolerances, and every other installed solver that takes the
    problem."""
    clarabel = SOLVERS["CLARABEL"]
    others = [row for row in SOLVERS.values() if row.is_tried and row.name in installed()]
    return (
        clarabel.at(),
        settings_for("RESCALED", None, "CLARABEL rescaled"),
        *(settings_for("RESCALED", None, f"{own} rescaled", first=str(own)) for own in blockwise()),
        clarabel.at(
            1e-13, "CLARABEL tight", 500, reduced_tol_feas=1e-9, iterative_refinement_max_iter=50
        ),
        clarabel.at(1e-12, "CLARABEL unequilibrated", 500, equilibrate_enable=False),
        *(row.at() for row in others if row.has_cones or not is_conic),
    )


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


def clarabel_at(*tolerances: float, iterations: int | None = None) -> Ladder:
    """Returns Clarabel at each tolerance, for loops that compare one solve with the next."""
    return tuple(
        settings_for("CLARABEL", asked, f"CLARABEL {asked:g}", iterations=iterations)
        for asked in tolerances
    )


def iterate_ladder(is_linear: bool = True) -> Ladder:
    """The ladder for iterations that feed on the forces of their last solve: always the same solver
    first, whatever else is installed, for which of many possible forces are picked depends on it.
    Our own starts from the solve before; it takes linear objectives only.
    """
    own = blockwise(NUMBERS.node, iterations=NUMBERS.tight_iterations) if is_linear else ()
    return (*own, settings_for("CLARABEL", NUMBERS.tight), *default_ladder())


def leading_ladder(contacts: int = 0, tolerance: float = NUMBERS.leading) -> Ladder:
    """The ladder for one of many problems on so many contacts whose answers are checked outside the
    solver: a budget of iterations, and no first-order methods, which keep one problem busy for
    minutes.
    """
    most = NUMBERS.leading_iterations
    own = blockwise(NUMBERS.leads, f"BLOCKWISE {NUMBERS.leads:g}", most)
    clarabel = clarabel_at(tolerance, iterations=most)
    if "QOCO" not in installed():
        return (*own, *clarabel)
    qoco = settings_for("QOCO", tolerance, f"QOCO {tolerance:g}", iterations=most)
    return (*own, qoco, *clarabel)


def warm_ladder(contacts: int, tolerance: float = NUMBERS.steps) -> Ladder:
    """Returns the first solver for steps that each start where the last one ended: our own solver,
    on many contacts. Its answers are strictly inside, so that bounds lose nothing.
    """
    most = NUMBERS.leading_iterations
    own = blockwise(tolerance, f"BLOCKWISE {tolerance:g}", most)
    return own if contacts >= NUMBERS.steps_from else ()


def node_ladder(contacts: int = 0, tolerance: float = 1e-4) -> Ladder:
    """Returns the ladder for nodes of branch and bound that are closed at a relative width of
    ``tolerance``.

    On many contacts it is our own solver, then Clarabel. On fewer it is our own solver, QOCO where
    it is installed, Clarabel, and our own solver again, more tightly: a node that carries nothing
    has no forces as its answer, on which Clarabel fails.
    """
    most, few = NUMBERS.leading_iterations, NUMBERS.node_refinements
    clarabel = settings_for("CLARABEL", NUMBERS.node)
    if contacts >= NUMBERS.leads_from:
        return (*blockwise(NUMBERS.node, iterations=NUMBERS.tight_iterations), clarabel)
    asked = max(NUMBERS.node, NUMBERS.node_share * tolerance)
    qoco = settings_for("QOCO", NUMBERS.node, iterations=most, max_ir_iters=few)
    first, last = blockwise(asked, iterations=most), blockwise(NUMBERS.node)
    return (*first, *((qoco,) if "QOCO" in installed() else ()), clarabel, *last)


def tight_ladder() -> Ladder:
    """Returns the ladder for forces that count to 1e-9 of the load. Our own solver comes first,
    which takes half to a third of Clarabel's time."""
    most = NUMBERS.tight_iterations
    own = blockwise(NUMBERS.tight, iterations=most)
    return (*own, *clarabel_at(NUMBERS.tight, iterations=most), *default_ladder()[:1])


@dataclass(frozen=True)
class Shape:
    """The size of a compiled problem, as far as it matters for its solvers.

    ``variables``, ``equations`` and ``cones`` (second-order) are counted, and ``rows``: linear
    inequalities, signs among them.
    """

    variables: int
    equations: int
    cones: int
    rows: int = 0

    @property
    def kind(self) -> str:
        """The kind of problem: ``"conic"`` with cones, ``"lean"`` if it is linear with less than
        1.5 rows per variable, otherwise ``"facets"``.

        The octagon in space has 2.0, a planar scene 1.3.
        """
        if self.cones:
            return "conic"
        return "facets" if self.rows >= 1.5 * self.variables else "lean"


def limit_ladder(shape: Shape, tolerance: float = 1e-5) -> Ladder:
    """Returns the ladder for a limit problem: :func:`default_ladder` with two more solvers in it.

    The blockwise solver comes first from as many variables on as it was measured to be faster,
    third elsewhere; there QOCO leads, if it is installed. ``tolerance`` is the width of the bracket
    that is asked for: with cones QOCO often fails below 1e-6.
    """
    # Large problems: the blockwise solver first.
    first, *others = default_ladder(shape.cones > 0)
    own, kind = blockwise(), shape.kind
    if own and shape.variables >= BLOCKWISE_FROM[kind]:
        # Its iterates satisfy equilibrium and are strictly inside, so that its gap is the bracket.
        asked, tight = NUMBERS.enough * tolerance, replace(own[0], label="BLOCKWISE tight")
        if shape.variables >= max(BLOCKWISE_FROM.values()):
            return (*blockwise(asked), tight, first, *others)
        return (*blockwise(min(asked, NUMBERS.tight)), first, tight, *others)
    # Smaller ones without QOCO, or with a bracket that it often fails to reach: Clarabel first.
    if not ("QOCO" in installed() and (kind == "lean" or tolerance >= NUMBERS.leading)):
        return (first, *own, *others)
    # Others: QOCO first, unless the problem is tiny: there it opens strong stone where Clarabel
    # fails.
    lean = NUMBERS.finest if kind == "lean" else None
    if shape.variables <= BLOCKWISE_FROM["conic"]:
        return (first, settings_for("QOCO", lean), *own, *others)
    refined: dict[str, Any] = {"ir_tol": NUMBERS.finest, "max_ir_iters": NUMBERS.refinements}
    quick = settings_for("QOCO", lean, **refined)
    return (quick, first, *own, *others)
