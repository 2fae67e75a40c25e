"""One search over many solves: a queue, a worker that answers its tasks, and where it does so.

The rows of a sweep are known from the start, the next direction of a load domain follows from the
answers so far, and nodes of branch and bound come from a heap. To a search each is a function that
says what is next as things stand. So a budget is a queue that ends, and the order is its own.

A *worker* is an object that is called with a task. Another process gets it pickled, once, and keeps
it for later tasks: what it has computed stays behind (``__getstate__``), and what it computes there
serves all of them.
"""

from __future__ import annotations

import hashlib
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

from cvxlimit.errors import InputError, ModelError

Task = TypeVar("Task")
Answer = TypeVar("Answer")


def searched(
    worker: Callable[[Task], Answer],
    following: Callable[[], Task | None],
    executor: Any = None,
    at_once: int = 256,
) -> Iterator[tuple[Task, Answer]]:
    """Yields tasks with their answers, as they come.

    Parameters
    ----------
    worker : callable
        Answers a task.
    following : callable
        Returns the next task, or None if there is none for now: it is asked again after an answer.
    executor : concurrent.futures.Executor, dask.distributed.Client, or None
        Where the worker is called; None is this process, one task after another.
    at_once : int
        Largest number of tasks that are under way elsewhere: beyond the workers of a large cluster,
        each only takes memory here.

    Raises
    ------
    InputError
        If ``executor`` is none.
    ModelError
        If the worker cannot be sent to another process, or a process dies.
    """
    if executor is None:
        while (task := following()) is not None:
            yield task, worker(task)
        return
    pool, sent = _pool(executor), _Sent.of(worker)
    running = dict[Future[Any], Task]()
    try:
        while True:
            while len(running) < at_once and (task := following()) is not None:
                running[pool.submit(sent, task)] = task
            if not running:
                return
            done = wait(running, return_when=FIRST_COMPLETED).done
            for future in sorted(done, key=lambda each: each.exception() is not None):
                yield running.pop(future), future.result()
    except BrokenProcessPool as error:
        raise ModelError(
            "a process of the pool died (out of memory?): what is stored in a path is kept, and "
            "the same call with a new executor goes on from there"
        ) from error
    finally:
        for future in running:
            future.cancel()


def _pool(executor: Any) -> Executor:
    """Returns an executor of :mod:`concurrent.futures`, which a Dask client provides."""
    if hasattr(executor, "get_executor"):
        executor = executor.get_executor(pure=False)
    if not isinstance(executor, Executor):
        raise InputError(
            "executor must be a concurrent.futures executor or a Dask client, got "
            f"{executor!r:.60}: write ProcessPoolExecutor(), or Client(cluster)"
        )
    return executor


@dataclass(frozen=True)
class _Sent:
    """A worker on its way: its pickle, and the digest that a process knows it by."""

    pickled: bytes
    name: str

    @classmethod
    def of(cls, worker: object) -> _Sent:
        """Returns the worker as bytes; by value where cloudpickle is installed, which takes
        functions that only this process has."""
        pickler = import_module("cloudpickle" if find_spec("cloudpickle") else "pickle")
        try:
            pickled = pickler.dumps(worker)
        except Exception as error:  # pickling asks the objects, which may raise what they like
            raise ModelError(
                "what is to be done cannot be sent to another process: "
                f"{' '.join(str(error).split())[:200]}"
            ) from error
        return cls(pickled, hashlib.blake2b(pickled, digest_size=12).hexdigest())

    def __call__(self, task: Any) -> Any:
        workers = vars(_here)
        if self.name not in workers:
            workers[self.name] = pickle.loads(self.pickled)
            if len(workers) > 2:  # this one, and one that overlaps with it
                del workers[next(iter(workers))]
        # Small blocks gain nothing from more threads of BLAS, which wait for each other on a busy
        # machine: with all cores taken, runs with four took 1.8 times as long as with one.
        with _blas().limit(limits=1, user_api="blas"):
            return workers[self.name](task)


_here = threading.local()
"""Workers of this thread by name: those of a cluster may be threads of one process."""


@cache
def _blas() -> ThreadpoolController:
    """Returns the controller of BLAS, made once: looking for libraries takes 3 ms, which is a tenth
    of a small problem."""
    return ThreadpoolController()


@contextmanager
def processes(workers: int) -> Iterator[Executor | None]:
    """Yields an executor with so many processes, or None for one worker, which is this process.
    Ctrl-C does not reach them."""
    if workers < 2:
        yield None
        return
    pool = ProcessPoolExecutor(workers, initializer=_leave_signals)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _leave_signals() -> None:
    """Makes this process ignore Ctrl-C, and end in silence at TERM, which its parent may catch."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
