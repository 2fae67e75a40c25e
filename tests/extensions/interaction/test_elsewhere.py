"""Branch and bound whose nodes are explored elsewhere: by a Dask client's executor."""

from __future__ import annotations

import pytest

from cvxlimit import Status, solve
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.masonry import random_wall

distributed = pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.exhaustive,  # it starts processes, and branches for minutes
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


def test_a_dask_clients_executor() -> None:
    """The same bracket, to the tolerance of both, with nodes explored by two workers."""
    scene = random_wall(1)
    alone = solve(scene, method=Certified(tolerance=0.02, branching_seconds=120.0))
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None,
        silence_logs=60,
    )  # fmt: skip
    with cluster, distributed.Client(cluster) as client:
        rule = Certified(
            tolerance=0.02, branching_seconds=120.0, workers=2, executor=client.get_executor()
        )
        shared = solve(scene, method=rule)
        explored = client.run(lambda dask_worker: dask_worker.state.executed_count)
    assert shared.status is Status.CERTIFIED
    assert shared.bracket.is_within(0.02)
    assert shared.bracket.is_proved
    assert max(alone.lower, shared.lower) <= min(alone.upper, shared.upper)
    assert len(explored) == 2  # each worker explored nodes of the scene
    assert min(explored.values()) > 0
