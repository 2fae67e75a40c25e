"""Runs in processes of their own: a crash or a timeout is a failed run with its reason.

Every run starts a fresh Python, so that its peak memory is its own, nothing is warm that another
run warmed, and compiled parts and kernels of BLAS can be chosen for it.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from cvxlimit.base.extras import needed
from cvxlimit.errors import ModelError
from cvxlimit.extensions.studies.comparison import run_here
from cvxlimit.extensions.studies.models import Model, Row
from cvxlimit.masonry import single_block
from cvxlimit.scene import Scene

T = TypeVar("T")

_TASK, _RESULT, _ERRORS = "task.pickle", "result.pickle", "errors.txt"
_SERVE = "import sys; from benchmarks.runs import serve; serve(sys.argv[1])"
_THREAD_VARIABLES = tuple(f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "RAYON"))

_OUT_OF_MEMORY = (
    "cannot allocate", "bad_alloc", "memory allocation", "memoryerror", "out of memory",
)  # fmt: skip
"""What libraries write before they give up, in lower case."""

_LOOK = 0.02
"""Seconds between two looks at a run's memory."""


@dataclass(frozen=True)
class Limits:
    """What one run may take.

    Attributes
    ----------
    seconds : float
        Wall-clock time, the process's start included.
    memory : float or None
        Resident memory in GB, where the operating system says what a process has.
    threads : int or None
        Threads of solvers and linear algebra; None leaves them to the machine.
    """

    seconds: float = 300.0
    memory: float | None = 12.0
    threads: int | None = 1


class Stopped(Exception):  # noqa: N818 - its text is a reason
    """A run that was stopped, crashed or raised; the text says why."""


def apart(call: Callable[[], T], limits: Limits, environment: Mapping[str, str] | None = None) -> T:
    """What a function of no arguments returns in a fresh process.

    Raises
    ------
    Stopped
        If it crashed, raised, or took more than it may.
    ModelError
        If it cannot be sent to another process.
    """
    with tempfile.TemporaryDirectory(prefix="cvxlimit-") as name:
        folder = Path(name)
        (folder / _TASK).write_bytes(_packed(call, "it"))
        code = _watched(folder, limits, environment or {})
        if not (folder / _RESULT).exists():
            raise Stopped(_crash(code, (folder / _ERRORS).read_text(errors="replace")))
        found: T = pickle.loads((folder / _RESULT).read_bytes())
        return found


def run_apart(method: Model, scene: Scene, limits: Limits) -> Row:
    """One run of ``method``, in a process that one block has warmed up before the clock starts."""
    _packed(method, f"model {method.name!r}")
    try:
        return apart(partial(_measured, method, scene), limits)
    except Stopped as stopped:
        return Row(reason=str(stopped))


def _measured(method: Model, scene: Scene) -> Row:
    with suppress(Exception):  # what is imported and compiled once is not timed
        method.measure(single_block())
    result = run_here(method, scene)
    return result if result.failed else replace(result, memory=peak_memory(os.getpid()))


def _watched(folder: Path, limits: Limits, own: Mapping[str, str]) -> int:
    """Run the task there; its exit code.

    Memory is looked at from outside. Were the address space limited instead, libraries would fail
    in ways of their own: OpenBLAS tries for a minute to start, which looks like a lack of time.
    """
    command = [sys.executable, "-W", "ignore", "-c", _SERVE, str(folder)]
    end = time.monotonic() + limits.seconds
    with (folder / _ERRORS).open("wb") as errors:
        process = subprocess.Popen(
            command, env={**_environment(limits), **own}, stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=errors,
        )  # fmt: skip
        try:
            while True:
                with suppress(subprocess.TimeoutExpired):
                    return process.wait(_LOOK)
                used = peak_memory(process.pid)
                if limits.memory is not None and used is not None and used > 1e3 * limits.memory:
                    raise Stopped(f"memory limit of {limits.memory:g} GB")
                if time.monotonic() > end:
                    raise Stopped(f"time limit of {limits.seconds:g} s")
        finally:
            process.kill()
            process.wait()


def _packed(content: object, what: str) -> bytes:
    """Classes and functions of a script or notebook go along by value."""
    cloudpickle = needed("cloudpickle", "frames", "models in processes of their own")
    try:
        result: bytes = cloudpickle.dumps(content)
    except Exception as error:  # pickling asks the object, which may raise what it likes
        raise ModelError(
            f"{what} cannot be sent to another process: {' '.join(str(error).split())[:160]}"
        ) from error
    return result


def _environment(limits: Limits) -> dict[str, str]:
    environment = dict(os.environ)
    environment["PYTHONPATH"] = os.pathsep.join(path or os.getcwd() for path in sys.path)
    for name in _THREAD_VARIABLES:
        if limits.threads is not None:
            environment[name] = str(limits.threads)
        else:
            environment.pop(name, None)
    return environment


def _crash(code: int, stderr: str) -> str:
    lines = stderr.strip().splitlines()
    last = f": {lines[-1][:160]}" if lines else ""
    if any(word in stderr.lower() for word in _OUT_OF_MEMORY):
        return f"out of memory{last}"
    if code < 0:
        with suppress(ValueError):
            return f"crashed with {signal.Signals(-code).name}{last}"
    return f"the process ended with code {code}{last}"


def serve(name: str) -> None:
    """The fresh process's side: read a task, run it, leave a result."""
    folder = Path(name)
    result = pickle.loads((folder / _TASK).read_bytes())()
    (folder / "partial").write_bytes(_packed(result, "the result"))
    (folder / "partial").rename(folder / _RESULT)


def peak_memory(process: int) -> float | None:
    """Peak resident memory of a process, MB; None where it cannot be known.

    From /proc, which Linux has: getrusage counts the parent's memory as well, from before the new
    program was loaded.
    """
    with suppress(OSError):
        for line in Path(f"/proc/{process}/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    return None
