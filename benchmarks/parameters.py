"""``python -m benchmarks.parameters``: what Parameters cost in CVXPY, with its own ordering of rows
and with that of :class:`~cvxlimit.solvers.Blockwise`.

The problem is a limit problem in shape, written in plain CVXPY: blocks in a strip, contacts
between them with a normal force, two shears and a torsion moment each, six equations per block,
friction as a Parameter with an entry per contact. With three vectors (``888x3``) strengths of
torsion and of compression are Parameters too. Every case runs in a process of its own, which tells
milliseconds of CPU of the first compile and of the next ones (medians of five), those of the first
solve and of the next ones without compiling, and the megabytes that compiling took beyond what was
there.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from collections.abc import Sequence
from itertools import product
from statistics import median
from time import process_time
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from cvxpy.reductions.solvers.conic_solvers.clarabel_conif import CLARABEL
from rich.console import Console

from cvxlimit.solvers import Blockwise

console = Console(highlight=False, soft_wrap=True)


class Reordered(CLARABEL):
    """Clarabel behind the same ordering of rows."""

    format_constraints = Blockwise.format_constraints

    def name(self) -> str:
        return "REORDERED"

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other)

    def __hash__(self) -> int:
        return hash(type(self))


OWN = "CVXPY's"
SOLVERS: dict[str, Any] = {
    OWN: lambda: "CLARABEL",
    "looked up": Reordered,
    "looked up, blockwise": Blockwise,
}


def limit_problem(contacts: int, vectors: int) -> tuple[cp.Problem, list[cp.Parameter]]:
    """Random geometry, the same for every call; feasible and bounded."""
    rng = np.random.default_rng(0)
    blocks, contact = contacts // 3, np.arange(contacts)
    ends = np.stack([contact // 3, contact // 3 + 1 + contact % 3], axis=1) % blocks
    entries = rng.normal(size=(contacts, 2, 6, 4))
    rows = np.broadcast_to((6 * ends[:, :, None] + np.arange(6))[..., None], entries.shape)
    columns = np.broadcast_to((4 * contact[:, None] + np.arange(4))[:, None, None], entries.shape)
    at = rows.ravel(), columns.ravel()
    matrix = sp.csr_array((entries.ravel(), at), shape=(6 * blocks, 4 * contacts))
    normal, shear = cp.Variable(contacts, nonneg=True), cp.Variable((contacts, 2))
    torsion, bound, level = cp.Variable(contacts), cp.Variable(contacts), cp.Variable()
    values = np.ones(contacts), np.full(contacts, 0.4), np.full(contacts, 5.0)
    given = [cp.Parameter(contacts, nonneg=True, value=v) for v in values[:vectors]]
    friction, arm, strength = [*given, *values[vectors:]]
    inside = np.tile([1.0, 0.0, 0.0, 0.0], contacts)
    unknown = cp.vec(cp.vstack([normal, shear.T, torsion]), order="F")
    limits = [
        matrix @ unknown + level * rng.normal(size=6 * blocks) == matrix @ inside,
        cp.SOC(bound, shear, axis=1),
        cp.multiply(friction, normal) - bound >= 0,
        cp.multiply(arm, normal) >= cp.abs(torsion),
        normal <= strength,
    ]
    return cp.Problem(cp.Maximize(level), limits), given


def measured(contacts: int, vectors: int, solver: str, backend: str) -> dict[str, float]:
    """Seconds and megabytes of one case, in this process."""
    limit_problem(9, vectors)[0].solve(solver=SOLVERS[solver](), canon_backend=backend)  # imports
    problem, given = limit_problem(contacts, vectors)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    compiles, solves = [], []
    for _ in range(6):
        start = process_time()
        problem.get_problem_data(SOLVERS[solver](), canon_backend=backend)
        compiles.append(process_time() - start)
        if not solves:
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
        start = process_time()
        problem.solve(solver=SOLVERS[solver](), canon_backend=backend)
        solves.append(process_time() - start)
        given[0].value = 1.01 * given[0].value
    rest = median(compiles[1:]), median(solves[1:])
    names = "compile", "again", "solve", "re-solve", "megabytes"
    numbers = compiles[0], rest[0], solves[0], rest[1], memory / 1024.0
    return dict(zip(names, numbers, strict=True))


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print a table of Markdown."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.parameters", description=__doc__)
    add = parser.add_argument
    add("cases", nargs="*", default=["888x1", "888x3", "4859x3"], help="contacts x vectors")
    add("--most", type=int, default=1000, help="contacts up to which CVXPY's own way is tried")
    add("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.one:
        contacts, vectors = map(int, options.cases[0].split("x"))
        console.print_json(json.dumps(measured(contacts, vectors, *options.one)))
        return
    names = "contacts x vectors | back end | interface | compile | again | first solve | re-solve"
    console.print(f"| {names} | MB |\n|{'---|' * 8}")
    for case, backend, solver in product(options.cases, ("CPP", "COO"), SOLVERS):
        if solver == OWN and int(case.split("x")[0]) > options.most:
            continue
        command = [sys.executable, "-m", "benchmarks.parameters", case, "--one", solver, backend]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        *seconds, memory = json.loads(done.stdout).values()
        cells = [f"{1000.0 * value:.1f}" for value in seconds] + [f"{memory:.0f}"]
        console.print(f"| {case} | {backend} | {solver} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
