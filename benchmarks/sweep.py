"""A sweep against a loop of single calls, and against a Dask cluster.

    .venv/bin/python -m benchmarks.sweep                 # 200 variations of the S12 panel, 2 cores
    .venv/bin/python -m benchmarks.sweep --cluster       # and once more on a local cluster

Wall-clock seconds depend on what else the machine does; CPU seconds do less, so both are given.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pandas as pd
from rich.console import Console

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


def on_a_cluster(grid: pd.DataFrame, workers: int) -> pd.DataFrame:
    """The sweep on a local Dask cluster, whose start counts."""
    from distributed import Client, LocalCluster

    cluster = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None)
    with cluster, Client(cluster) as client:
        return sweep(builtin_scene(SCENE), grid, executor=client, progress=False)


def timed(run: Callable[..., pd.DataFrame], *given: Any) -> tuple[pd.DataFrame, float, float]:
    """What it returns, wall-clock seconds, and CPU seconds with those of ended processes."""
    before, start = _cpu(), time.perf_counter()
    table = run(*given)
    return table, time.perf_counter() - start, _cpu() - before


def _cpu() -> float:
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in both)


def agreement(one: pd.DataFrame, other: pd.DataFrame) -> str:
    """Whether the brackets of all variations hold each other, and by how much factors differ."""
    overlap = (one["lower"] <= other["upper"]) & (other["lower"] <= one["upper"])
    change = (one["load_factor"] / other["load_factor"] - 1).abs().max()
    rows = f"{overlap.sum()} of {len(one)} rows"
    return f"brackets overlap in {rows}, load factors within {change:.1e}"


def main() -> None:
    """Run, and write what came out."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--number", type=int, default=200, help="variations")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--cluster", action="store_true", help="on a local Dask cluster as well")
    asked = parser.parse_args()
    console = Console(highlight=False, soft_wrap=True)
    grid = variations(asked.number)
    solve(builtin_scene(SCENE))  # imports and caches are nobody's
    single, wall, cpu = timed(loop, grid)
    console.print(f"loop of single calls: {wall:.1f} s, {cpu:.1f} s of CPU")
    swept, own_wall, own_cpu = timed(over_processes, grid, asked.workers)
    faster = f"{wall / own_wall:.2f} times as fast, {asked.workers * cpu / own_cpu:.2f} by CPU"
    console.print(
        f"sweep over {asked.workers} processes: {own_wall:.1f} s, {own_cpu:.1f} s of CPU: {faster}"
    )
    widest = f"widest bracket {swept['gap'].max():.1e}"
    console.print(f"  {swept['status'].value_counts().to_dict()}, {widest}")
    console.print(f"  against the loop: {agreement(single, swept)}")
    if asked.cluster:
        clustered, wall, _ = timed(on_a_cluster, grid, asked.workers)
        same = clustered.drop(columns="seconds").equals(swept.drop(columns="seconds"))
        console.print(f"sweep on a cluster of {asked.workers} workers: {wall:.1f} s")
        console.print(f"  {'the same table' if same else agreement(clustered, swept)}")


if __name__ == "__main__":
    main()
