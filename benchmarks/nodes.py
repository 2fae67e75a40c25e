"""``python -m benchmarks.nodes``: what a node of branch and bound costs, and what processes gain.

For irregular walls of several sizes: CPU milliseconds of one node's problem by solver and
tolerance, with the bound that its mechanism certifies; CPU milliseconds per node and the share of
it that is the solver's; and how far default settings come in this process and with two others.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console

from benchmarks.closing import irregular_wall
from cvxlimit import solve
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.driver import Run, drive
from cvxlimit.methods.interaction.branching.search import BranchAndBound
from cvxlimit.readings.flow import InteractionFlow
from cvxlimit.solvers import settings_for

console = Console(highlight=False, markup=False, soft_wrap=True)

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


def solvers(seed: int, repeats: int = 5) -> None:
    """One node's problem by each solver."""
    search = searched(seed)
    relaxer, rng = search.relaxer, np.random.default_rng(0)
    _, _, root = search.open[0]
    boxes = root.boxes.copy()
    boxes[:, :, 0] += 0.3 * rng.random(boxes.shape[:2])
    copies = relaxer.moments.box_copies(relaxer.contacts, boxes)
    flow = InteractionFlow(relaxer.contacts, relaxer.moments, boxes)
    certifier = relaxer.certifier.with_flow(flow)
    for name, tolerance in _SOLVERS:
        settings, start = settings_for(name, tolerance), time.process_time()
        for _ in range(repeats):
            state = relaxer.problem.solve(copies, settings, search.price)
        spent = 1e3 * (time.process_time() - start) / repeats
        bound = certifier.certificate(None, None, state.mechanism).upper
        console.print(
            f"wall {seed}, {len(relaxer.contacts)} contacts, {len(copies)} copies: {name} "
            f"{tolerance:g} {spent:.1f} ms, bound {bound:.5f}"
        )


def shares(seed: int, nodes: int = 40) -> None:
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
    console.print(
        f"wall {seed}: {done} nodes with {search.solves - problems} problems, "
        f"{1e3 * (time.process_time() - spent) / done:.0f} ms of CPU each, solver {share:.0%}"
    )


def workers(seed: int) -> None:
    """What the ten seconds of default settings come to, in one process and in two."""
    for count in (1, 2):
        found = solve(irregular_wall(seed), method=Certified(workers=count))
        parts = found.note.split("; ")
        done = next(part for part in parts if part.startswith("branch and bound"))
        console.print(f"wall {seed}, {count} at a time: {done}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print all three."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.nodes", description=__doc__)
    parser.add_argument("--walls", type=int, nargs="*", default=[14, 26, 18])
    parser.add_argument("--closing", type=int, nargs="*", default=[90003, 90015, 90048])
    asked = parser.parse_args(arguments)
    for seed in asked.walls:
        solvers(seed)
        shares(seed)
    for seed in asked.closing:
        workers(seed)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
