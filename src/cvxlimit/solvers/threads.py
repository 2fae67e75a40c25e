"""Threads of BLAS."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """Returns a context in which BLAS has one thread. Small blocks gain nothing from more, which
    wait for each other on a busy machine: with all cores taken, runs with four threads took 1.8
    times as long as with one."""
    return _controller().limit(limits=1, user_api="blas")


@cache
def _controller() -> ThreadpoolController:
    """Returns the controller of BLAS, made once: looking for libraries takes 3 ms, which is a tenth
    of a small problem."""
    return ThreadpoolController()
