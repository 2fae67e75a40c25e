"""A sweep on a Dask cluster: the same table, and nothing lost with a worker that is killed."""

from __future__ import annotations

import os
import signal
import threading
import time

import pytest

from cvxlimit import Scene, builtin_scene, sweep
from cvxlimit.studies import varied

distributed = pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.exhaustive,  # it starts five processes
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


def slowly(friction: float, tilt: float) -> Scene:
    """Slow enough for a worker to be killed in the middle."""
    time.sleep(0.1)
    return varied(builtin_scene("stack"), friction=friction, tilt=tilt)


def test_a_killed_worker_loses_nothing(tmp_path) -> None:
    grid = {"friction": [0.3, 0.35, 0.4, 0.5, -1.0], "tilt": [0.0, 2.0, 4.0, 6.0]}
    here = sweep(slowly, grid, progress=False)
    cluster = distributed.LocalCluster(
        n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None,
        silence_logs=60,
    )  # fmt: skip
    with cluster, distributed.Client(cluster) as client:
        pids = list(client.run(os.getpid).values())
        half = tmp_path / "s"

        def kill_one() -> None:
            while not list(half.glob("part-*.parquet")):  # the sweep is under way
                time.sleep(0.02)
            os.kill(pids[0], signal.SIGKILL)

        killer = threading.Thread(target=kill_one)
        killer.start()
        there = sweep(slowly, grid, executor=client, path=half, progress=False)
        killer.join()
        assert pids[0] not in client.run(os.getpid).values()
    assert len(there) == 20
    assert there.drop(columns="seconds").equals(here.drop(columns="seconds"))
