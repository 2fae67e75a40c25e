"""A sweep against a loop of single calls.

Wall-clock seconds depend on what else the machine does; CPU seconds do less, so both are given.
"""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pandas as pd

from benchmarks.experiment import Head, Lines, Part, experiment
from cvxlimit import builtin_scene, solve, sweep
from cvxlimit.studies import varied

SCENE = "s12-panel"


def variations(number: int) -> pd.DataFrame:
    """Friction from 0.5 to 0.9 in steps, under a load in ten directions up to 45 degrees off."""
    frictions = max(1, number // 10)
    rows = [
        {"direction": 5.0 * j, "friction": 0.5 + 0.4 * i / max(1, frictions - 1)}
        for j in range(10)
        for i in range(frictions)
    ]
    return pd.DataFrame(rows[:number])


def loop(grid: pd.DataFrame) -> pd.DataFrame:
    """Single calls, one after the other."""
    found = (solve(varied(builtin_scene(SCENE), **row)) for row in grid.to_dict("records"))
    figures = [(s.load_factor, s.lower, s.upper) for s in found]
    table = pd.DataFrame(figures, columns=["load_factor", "lower", "upper"])
    return pd.concat([grid, table], axis=1)


def over_processes(grid: pd.DataFrame, workers: int) -> pd.DataFrame:
    """The sweep, over processes that are started for it."""
    with ProcessPoolExecutor(workers, mp_context=get_context("fork")) as pool:
        return sweep(builtin_scene(SCENE), grid, executor=pool, progress=False)


def timed(run: Callable[..., pd.DataFrame], *given: Any) -> tuple[pd.DataFrame, float, float]:
    """What it returns, wall-clock seconds, and CPU seconds with those of ended processes."""
    before, start = _cpu(), time.perf_counter()
    table = run(*given)
    return table, time.perf_counter() - start, _cpu() - before


def _cpu() -> float:
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in both)


@experiment(Part(2), name="sweep")
def swept(number: int = 200, workers: int = 2) -> Lines:
    """So many variations of the S12 panel: a loop of single calls, and a sweep over processes."""
    grid = variations(number)
    solve(builtin_scene(SCENE))  # imports and caches are nobody's
    single, wall, cpu = timed(loop, grid)
    found, own_wall, own_cpu = timed(over_processes, grid, workers)
    yield Head("", "clock, s", "CPU, s", "by clock", "by CPU")
    yield "loop of single calls", f"{wall:.1f}", f"{cpu:.1f}", "1", "1"
    faster = f"{wall / own_wall:.2f} times", f"{workers * cpu / own_cpu:.2f} times as fast"
    yield f"sweep over {workers} processes", f"{own_wall:.1f}", f"{own_cpu:.1f}", *faster
    yield Head("rows", "widest bracket", "brackets that overlap", "load factors within")
    overlap = (single["lower"] <= found["upper"]) & (found["lower"] <= single["upper"])
    change = (single["load_factor"] / found["load_factor"] - 1).abs().max()
    counts = ", ".join(f"{n} {status}" for status, n in found["status"].value_counts().items())
    yield counts, f"{found['gap'].max():.1e}", f"{overlap.sum()} of {len(single)}", f"{change:.1e}"
