"""Where the paper's fixed point goes, by solver and compiler.

A row per scene and reading (``--moments``), a column per solver: solves until the paper's criterion
(Eq. 43), the load factor then, and the band of the iterates. Every run is a process of its own,
with the compiled parts and without them (``--compiled yes no``); with nothing compiled the default
solver is Clarabel. The last column has the range that
all bands of the row share, or how far the two farthest are apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import product

from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.runs import Limits, apart
from benchmarks.scenes import scene_of
from cvxlimit import solve
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.solution import Iteration
from cvxlimit.solvers.table import able

SCENES = ("tuff-wall", "facade", "s12-panel")
SOLVERS = {"BLOCKWISE": "our own", "CLARABEL": "Clarabel", "QOCO": "QOCO"}

SAME = 1e-6
"""Relative distance of bands that are one value but for what solvers leave of it."""


@experiment(
    Part(3, "--scenes tuff-wall facade"),
    Part(1, "--scenes tuff-wall --moments paper independent signed --surface octagon "
         "--solvers BLOCKWISE CLARABEL", "bands-octagon"),
)  # fmt: skip
def bands(
    scenes: Sequence[str] = SCENES, moments: Sequence[str] = ("signed",), surface: str = "conic",
    solvers: Sequence[str] = tuple(SOLVERS), compiled: Sequence[str] = ("yes", "no"),
) -> Lines:  # fmt: skip
    """Where the paper's fixed point goes, by solver and compiler."""
    known = [name for name in solvers if name in able()]
    choices = [each for each in product(known, compiled) if each != ("BLOCKWISE", "no")]
    yield Head("scene, moments", *(headed(*choice) for choice in choices), "overlap")
    for name, reading in product(scenes, moments):
        found = [alone(name, reading, *choice, surface) for choice in choices]
        yield f"{name}, {reading}", *map(told, found), overlap(found)


def headed(solver: str, compiled: str) -> str:
    """A column's head."""
    return SOLVERS[solver] + ("" if compiled == "yes" else ", nothing compiled")


def measured(name: str, moments: str, solver: str, surface: str = "conic") -> Iteration:
    """Where the fixed point goes on a scene, by default settings."""
    found = solve(scene_of(name), surface, FixedPoint(moments=moments), ladder=[solver]).iteration
    assert found is not None
    return found


def alone(name: str, moments: str, solver: str, compiled: str, surface: str = "conic") -> Iteration:
    """The same in a process of its own, whose compiled parts are chosen at its start."""
    call = partial(measured, name, moments, solver, surface)
    return apart(call, Limits(1200.0), {"CVXLIMIT_COMPILED": compiled})


def told(found: Iteration) -> str:
    """Solves until the criterion, the load factor then, and the band."""
    met = "" if found.met_at is None else f"{found.met_at:.4f} after {found.met_after}; "
    return f"{met}{found.lowest:.4f} to {found.highest:.4f}"


def overlap(found: Sequence[Iteration]) -> str:
    """What all bands have in common, or how far the two farthest are apart."""
    low, high = max(each.lowest for each in found), min(each.highest for each in found)
    apart = (low - high) / abs(low)
    if apart <= 0.0:
        return f"{low:.4f} to {high:.4f}"
    return f"{low:.4f}" if apart <= SAME else f"none, {100.0 * apart:.2g} % apart"
