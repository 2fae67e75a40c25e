"""Processes that explore or solve beside this one."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager


@contextmanager
def processes(workers: int) -> Iterator[Executor | None]:
    """Yields an executor with so many processes, or None for one worker, which is this process.
    Ctrl-C does not reach them."""
    if workers < 2:
        yield None
        return
    pool = ProcessPoolExecutor(workers, initializer=_ignore_interrupts)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _ignore_interrupts() -> None:
    """Makes this process ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
