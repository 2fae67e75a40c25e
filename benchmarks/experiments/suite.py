"""Time against true error: many methods on a scene, every run in a process of its own.

Methods are those of :mod:`benchmarks.registry`, and what a user would write
without the package (:mod:`benchmarks.baselines`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from benchmarks.baselines import baselines
from benchmarks.charts import save, time_against_error
from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.machine import environment
from benchmarks.registry import choose, registry
from benchmarks.runs import Limits, run_apart
from benchmarks.scenes import scene_of
from cvxlimit.extensions.studies.comparison import side_by_side
from cvxlimit.extensions.studies.models import Row

REFERENCE_SECONDS = 1200.0
"""For a reference, without which there are no errors."""
PLAIN = ("cvxlimit*", "conic/*", "octagon*", "??-gon*", "literal/*")
"""The paper's problem without interaction, by all methods."""
FEW = '"cvxlimit*" "conic/corners/clarabel-qdldl/*" "conic/corners/qoco/*" '
FEW += '"conic/corners/blockwise/*" "literal/octagon/kN-m" "literal/conic/kN-m"'
"""Those that a reader can tell apart where nearly all are exact."""


@experiment(
    Part(7, "--scene s12-class --limit 15 --repeat 1 --docs docs/evidence", "chart-panel"),
    Part(3, f"--scene planar-wall-150 --limit 60 --docs docs/evidence --methods {FEW}",
         "chart-wall"),
)  # fmt: skip
def suite(
    scene: str = "s12-class", methods: Sequence[str] = (), repeat: int = 3, limit: float = 120.0,
    memory: float = 8.0, docs: Path | None = None,
) -> Lines:  # fmt: skip
    """Many methods on a scene, or those that match patterns: time against true error."""
    chosen = choose(methods or PLAIN, [*registry().values(), *baselines().values()])
    run = partial(run_apart, limits=Limits(limit, memory))
    refer = partial(run_apart, limits=Limits(max(limit, REFERENCE_SECONDS), memory))
    rows = side_by_side(chosen, scene_of(scene), repeat, run=run, refer=refer).rows
    yield Head("contacts", "method", "s", "error", "MB", "status")
    for row in rows:
        yield f"{row.contacts:,}", row.method, *cells(row)
    if docs is not None:
        figure = time_against_error(rows, signed(repeat))
        save(figure, docs / f"time-against-error-{scene}.png")


def signed(repeat: int) -> str:
    """Machine and versions, for the small print of a chart."""
    about = environment()
    names = ("cvxlimit", "cvxpy", "clarabel", "python")
    versions = ", ".join(f"{name} {about['versions'][name]}" for name in names)
    runs = f"medians of {repeat} runs, in turns" if repeat > 1 else "one run each"
    return f"{about['machine']['cpu']}, one thread per run; {versions}; {runs}"


def cells(row: Row) -> tuple[str, ...]:
    """Of the table."""
    if row.failed or row.total is None:
        return "", "", "", row.reason
    error = "" if row.error is None else f"{row.error:.1e}"
    return f"{row.total:.3f}", error, f"{row.memory or 0:.0f}", row.status
