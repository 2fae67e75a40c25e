"""Programs at a terminal: what they show on stderr, and Ctrl-C as the terminal sends it."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

AMPLE = 600.0
"""Seconds that nothing here needs, however busy the machine is: a hang ends as a failure."""

CODES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
"""Colours and movements of the cursor."""


def listening() -> None:
    """Jobs that a shell starts in the background ignore Ctrl-C, and so do their children."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Terminal:
    """A Python program whose stderr is a terminal of its own, stdout a pipe.

    ``with Terminal("-m", "cvxlimit", "solve", "arch") as program`` ends it at the latest when the
    block does.
    """

    def __init__(self, *arguments: str, folder: Path | None = None) -> None:
        self._screen, side = os.openpty()
        self.shown = ""
        self.process = subprocess.Popen(
            [sys.executable, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=side,
            text=True,
            cwd=folder,
            start_new_session=True,
            preexec_fn=listening,
            env={**os.environ, "TERM": "xterm", "COLUMNS": "300", "NO_COLOR": "1"},
        )
        os.close(side)

    def __enter__(self) -> Terminal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.communicate()
        os.close(self._screen)

    def _read(self) -> bool:
        """Take what is shown by now; False once the program has closed its side."""
        if not select.select([self._screen], [], [], 0.05)[0]:
            return self.process.poll() is None
        try:
            found = os.read(self._screen, 65536)
        except OSError:  # how Linux says that nobody is on the other side
            return False
        self.shown = CODES.sub("", self.shown + found.decode(errors="replace"))
        return bool(found)

    def wait_for(self, pattern: str) -> None:
        """Until the pattern has been shown on stderr."""
        end = time.monotonic() + AMPLE
        while not re.search(pattern, self.shown):
            assert time.monotonic() < end, f"{pattern} was not shown: {self.shown[-300:]}"
            assert self._read(), f"ended before {pattern} was shown: {self.shown[-300:]}"

    def opens(self, pipe: Path) -> BinaryIO:
        """The writing side of a pipe, once the program reads; it must not end before."""
        while self.process.poll() is None:
            with suppress(OSError):  # as long as nobody reads
                return os.fdopen(os.open(pipe, os.O_WRONLY | os.O_NONBLOCK), "wb")
            self._read()
        raise AssertionError(f"ended before it opened {pipe.name}: {self.shown[-300:]}")

    def interrupt(self) -> None:
        """Ctrl-C: to all processes of the terminal."""
        os.killpg(self.process.pid, signal.SIGINT)

    def finish(self) -> tuple[int, str, str]:
        """Exit code, stdout, and what is left on the terminal at the end: its last lines."""
        end = time.monotonic() + AMPLE
        while self._read():
            assert time.monotonic() < end, f"did not end: {self.shown[-300:]}"
        out, _ = self.process.communicate(timeout=AMPLE)
        lines = [line.split("\r")[-1] for line in self.shown.replace("\r\n", "\n").split("\n")]
        return self.process.returncode, out, "\n".join(line for line in lines if line)
