"""What Parameters cost in CVXPY, with its own ordering of rows and with that of Blockwise.

The problem is a limit problem in shape, written in plain CVXPY: blocks in a strip, contacts
between them with a normal force, two shears and a torsion moment each, six equations per block,
friction as a Parameter with an entry per contact. With three vectors (``888x3``) strengths of
torsion and of compression are Parameters too. Every case runs in a process of its own, which tells
milliseconds of CPU of the first compile, of the first solve and of the next ones (medians of five)
without compiling, and the megabytes that compiling took beyond what was there.
"""

from __future__ import annotations

import resource
from collections.abc import Sequence
from functools import partial
from itertools import product
from statistics import median
from time import process_time
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from cvxpy.reductions.solvers.conic_solvers.clarabel_conif import CLARABEL

from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.runs import Limits, apart
from cvxlimit.solvers import Blockwise


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
    compiled, solves = 0.0, []
    for _ in range(6):
        start = process_time()
        problem.get_problem_data(SOLVERS[solver](), canon_backend=backend)
        if not solves:
            compiled = process_time() - start
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
        start = process_time()
        problem.solve(solver=SOLVERS[solver](), canon_backend=backend)
        solves.append(process_time() - start)
        given[0].value = 1.01 * given[0].value
    names = "compile", "solve", "re-solve", "megabytes"
    numbers = compiled, solves[0], median(solves[1:]), memory / 1024.0
    return dict(zip(names, numbers, strict=True))


@experiment(Part(1))
def parameters(cases: Sequence[str] = ("888x1", "888x3", "4859x3"), most: int = 1000) -> Lines:
    """What Parameters cost in CVXPY: contacts x vectors; its own way up to ``most`` contacts."""
    yield Head("contacts x vectors", "back end", "interface", "compile", "first solve", "re-solve",
               "MB")  # fmt: skip
    for case, backend, solver in product(cases, ("CPP", "COO"), SOLVERS):
        contacts, vectors = map(int, case.split("x"))
        if solver == OWN and contacts > most:
            continue
        call = partial(measured, contacts, vectors, solver, backend)
        *seconds, memory = apart(call, Limits()).values()
        cells = [f"{1000.0 * value:.1f}" for value in seconds]
        yield case, backend, solver, *cells, f"{memory:.0f}"
