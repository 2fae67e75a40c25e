"""Nodes explored in other processes."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace

from cvxlimit.base.arrays import FloatArray
from cvxlimit.methods.interaction.branching.nodes import Explored, Goal, Node, Relaxer, explore
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.readings.moments import Moments
from cvxlimit.solvers import SolverSettings


@dataclass(frozen=True, eq=False)
class Task:
    """A relaxer on its way to another process: what it is made of, and ``key``, its name."""

    key: str
    assemblage: Assemblage
    moments: Moments
    ladder: tuple[SolverSettings, ...]
    opening: FloatArray | None

    @classmethod
    def of(cls, key: str, relaxer: Relaxer, assemblage: Assemblage) -> Task:
        opening = relaxer.certifier.witnesses.opening_field
        # without factorisations, which do not travel
        bare = replace(assemblage, balance=Balance.of(assemblage.statics), repeats=None)
        return cls(key, bare, relaxer.moments, relaxer.ladder, opening)

    def __call__(self, nodes: Sequence[Node], goal: Goal) -> Explored:
        """Explore nodes in this process, which keeps the relaxer for the next ones."""
        relaxer = _known.get(self.key)
        if relaxer is None:
            relaxer = Relaxer(self.assemblage, self.moments, self.ladder, self.opening)
            _known.clear()
            _known[self.key] = relaxer
        return explore(relaxer, nodes, goal)


_known: dict[str, Relaxer] = {}
"""The relaxer of this process, one at a time."""


@contextmanager
def processes(workers: int) -> Iterator[Executor | None]:
    """So many processes for :class:`BranchAndBound`, none for one; Ctrl-C does not reach them."""
    if workers < 2:
        yield None
        return
    pool = ProcessPoolExecutor(workers, initializer=_deaf)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _deaf() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
