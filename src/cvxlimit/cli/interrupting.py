"""Ctrl-C on the command line: long work in a thread, which gets to hear of it."""

from __future__ import annotations

import ctypes
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread, current_thread, main_thread
from typing import Generic, TypeVar

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from cvxlimit.base.lines import one_line
from cvxlimit.cli.shell import VOICE
from cvxlimit.methods.driver import ProgressLine

T = TypeVar("T")
Tell = Callable[[str], None]

_WAITING = "interrupted: waiting for the solver's run to end; Ctrl-C again ends at once"


class Work(Generic[T]):
    """Work in a thread of its own: solvers are native code, in which Python does not see Ctrl-C.

    :meth:`tell` is for the work, which says what it does, and by ``has_bracket`` of what it says
    that it would return something if it were interrupted now.
    """

    def __init__(self, work: Callable[[Tell], T]) -> None:
        self._reached, self._now, self.has_result = "", "reading the scene", False
        self._work, self._outcome, self._error = work, list[T](), list[BaseException]()
        self._thread, self._is_over = Thread(target=self._run, daemon=True), Event()

    def tell(self, message: str) -> None:
        """Notes where the work stands; nothing is shown from its thread, whose locks Ctrl-C may
        break."""
        if getattr(message, "has_bracket", False):
            self._reached, self._now, self.has_result = message, "", True
        else:
            self._now = message

    @property
    def message(self) -> str:
        return "; ".join(filter(None, (self._reached, self._now)))

    def _run(self) -> None:
        try:
            self._outcome.append(self._work(self.tell))
        except BaseException as error:
            self._error.append(error)
        finally:
            self._is_over.set()

    def result(self, look: Tell) -> T:
        """Do it, and ``look`` at every message.

        The first Ctrl-C is raised inside the work if that has something to return; otherwise, and
        the second time, it is raised here at once.
        """
        self._thread.start()
        is_stopped = False
        with _term_as_ctrl_c():
            while True:
                try:
                    while not self._is_over.wait(0.1) and self._thread.is_alive():
                        look(_WAITING if is_stopped else self.message)
                    break
                except KeyboardInterrupt:
                    if is_stopped or not self.has_result:
                        raise
                    is_stopped = True
                    self._stop()
        if self._error:
            raise self._error[0]
        if not self._outcome:
            raise KeyboardInterrupt
        return self._outcome[0]

    def _stop(self) -> None:
        identity = ctypes.c_ulong(self._thread.ident or 0)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(identity, ctypes.py_object(KeyboardInterrupt))


@contextmanager
def _term_as_ctrl_c() -> Iterator[None]:
    """Meanwhile TERM, by which batch systems end what takes too long, counts as Ctrl-C."""
    is_ours = current_thread() is main_thread() and hasattr(signal, "SIGTERM")
    if not is_ours or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def with_result(tell: Tell) -> Tell:
    """Returns what work tells that would return what it has at every message, if it were
    interrupted then."""

    def told(message: str) -> None:
        reached = ProgressLine(message)
        reached.has_bracket = True
        tell(reached)

    return told


def interruptible(work: Callable[[Tell], T]) -> T:
    waiting = Work(work)
    if sys.stderr is None or not sys.stderr.isatty() or VOICE.get():
        return waiting.result(lambda message: None)
    columns = SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(waiting.message, total=None)
        return waiting.result(lambda message: bar.update(task, description=one_line(message)))
