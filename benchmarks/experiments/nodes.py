"""What a node of branch and bound costs, and what processes gain.

For irregular walls of several sizes: CPU milliseconds of one node's problem by solver and
tolerance, with the bound that its mechanism certifies; CPU milliseconds per node and the share of
it that is the solver's; and how far default settings come in this process and with two others.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.scenes import irregular_wall
from cvxlimit import solve
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.driver import Run, drive
from cvxlimit.methods.interaction.branching.search import BranchAndBound
from cvxlimit.readings.flow import InteractionFlow
from cvxlimit.solvers import settings_for

_TOLERANCE = 0.0099
_SOLVERS = (
    ("CLARABEL", 1e-8), ("CLARABEL", 1e-6), ("QOCO", 1e-8), ("QOCO", 1e-6), ("BLOCKWISE", 1e-8),
    ("BLOCKWISE", 1e-4),
)  # fmt: skip


def searched(seed: int, **where: Any) -> BranchAndBound:
    """A search on a wall whose climbs are over."""
    run = Run(irregular_wall(seed))
    drive(Certified(tolerance=_TOLERANCE, branching_seconds=0.0), run)
    return BranchAndBound(run, _TOLERANCE, **where)


def solvers(seed: int, repeats: int = 5) -> Lines:
    """One node's problem by each solver."""
    search = searched(seed)
    relaxer, rng = search.relaxer, np.random.default_rng(0)
    _, _, root = search.open[0]
    boxes = root.boxes.copy()
    boxes[:, :, 0] += 0.3 * rng.random(boxes.shape[:2])
    disjuncts = relaxer.moments.box_disjuncts(relaxer.contacts, boxes)
    flow = InteractionFlow(relaxer.contacts, relaxer.moments, boxes)
    certifier = relaxer.certifier.with_flow(flow)
    for name, tolerance in _SOLVERS:
        settings, start = settings_for(name, tolerance), time.process_time()
        for _ in range(repeats):
            state = relaxer.problem.solve(disjuncts, settings, search.price)
        spent = 1e3 * (time.process_time() - start) / repeats
        bound = certifier.certificate(None, None, state.mechanism).upper
        about = seed, len(relaxer.contacts), len(disjuncts)
        yield *about, name, f"{tolerance:g}", f"{spent:.1f}", f"{bound:.5f}"


def shares(seed: int, nodes: int = 40) -> tuple[object, ...]:
    """What one node costs, and how much of that is the solver's."""
    search = searched(seed)
    search.step()  # narrowing
    solver, plain = [0.0], search.relaxer.problem.solve

    def timed(*given: Any) -> Any:
        state = plain(*given)
        solver[0] += state.outcome.solve_seconds
        return state

    vars(search.relaxer.problem)["solve"] = timed
    before, spent, start = search.nodes, time.process_time(), time.perf_counter()
    problems = search.solves
    while search.can_go_on and search.nodes < before + nodes:
        search.step()
    done = max(search.nodes - before, 1)
    share = solver[0] / (time.perf_counter() - start)
    each = f"{1e3 * (time.process_time() - spent) / done:.0f}"
    return seed, done, search.solves - problems, each, f"{share:.0%}"


def workers(seed: int) -> Lines:
    """What the ten seconds of default settings come to, in one process and in two."""
    for count in (1, 2):
        found = solve(irregular_wall(seed), method=Certified(workers=count))
        parts = found.note.split("; ")
        done = next(part for part in parts if part.startswith("branch and bound"))
        yield seed, count, done


@experiment(Part(5))
def nodes(
    walls: Sequence[int] = (14, 26, 18), closing: Sequence[int] = (90003, 90015, 90048)
) -> Lines:
    """What a node of branch and bound costs, and what processes gain."""
    yield Title("solvers")
    yield Head("wall", "contacts", "disjuncts", "solver", "tolerance", "ms", "bound")
    for seed in walls:
        yield from solvers(seed)
    yield Title("shares")
    yield Head("wall", "nodes", "problems", "CPU ms per node", "the solver's share")
    yield from map(shares, walls)
    yield Title("processes")
    yield Head("wall", "at a time", "what ten seconds come to")
    for seed in closing:
        yield from workers(seed)
