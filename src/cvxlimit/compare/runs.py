"""Runs in processes of their own: a crash or a timeout is a failed run with its reason.

Every run starts a fresh Python, so that its peak memory is its own and nothing is warm that
another method warmed; the process itself is warmed up on one block before the clock starts, and
what that left is collected: a full collection of all imported objects takes Python 30 ms, and
would fall into whichever phase comes first.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from cvxlimit.compare.models import Measurement, Method
from cvxlimit.errors import CvxlimitError, ModelError
from cvxlimit.extras import needed
from cvxlimit.masonry import single_block
from cvxlimit.scene import Scene

_TASK, _RESULT = "task.pickle", "result.pickle"
_SERVE = "import sys; from cvxlimit.compare.runs import serve; serve(sys.argv[1])"
_THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "RAYON_NUM_THREADS",
)

_OUT_OF_MEMORY = (
    "cannot allocate",
    "bad_alloc",
    "memory allocation",
    "memoryerror",
    "out of memory",
)
"""What libraries write before they give up, in lower case."""


@dataclass(frozen=True)
class Limits:
    """What one run may take.

    Attributes
    ----------
    seconds : float
        Wall-clock time, the process's start included.
    memory : float or None
        Address space in GB, where the operating system can limit it.
    threads : int or None
        Threads of solvers and linear algebra; None leaves them to the machine.
    """

    seconds: float = 300.0
    memory: float | None = 12.0
    threads: int | None = 1

    def __post_init__(self) -> None:
        for name in ("seconds", "memory"):
            value = getattr(self, name)
            good = isinstance(value, (int, float)) and value > 0.0
            if not good and (name == "seconds" or value is not None):
                raise ModelError(f"{name} of a run must be a number above 0, got {value!r}")
        whole = isinstance(self.threads, int) and not isinstance(self.threads, bool)
        if self.threads is not None and not (whole and self.threads > 0):
            raise ModelError(
                f"threads must be a whole number above 0 or None, got {self.threads!r}"
            )


@dataclass(frozen=True)
class Failure:
    """A run without an answer, and why."""

    reason: str
    is_timeout: bool = False


@dataclass(frozen=True)
class _Task:
    method: Method
    scene: Scene
    memory: float | None


def run_apart(method: Method, scene: Scene, limits: Limits) -> Measurement | Failure:
    """One run of ``method`` in a fresh process.

    Raises
    ------
    ModelError
        If the method cannot be sent to another process.
    """
    with tempfile.TemporaryDirectory(prefix="cvxlimit-") as folder:
        _write_task(Path(folder), _Task(method, scene, limits.memory))
        command = [sys.executable, "-W", "ignore", "-c", _SERVE, folder]
        try:
            done = subprocess.run(
                command,
                env=_environment(limits),
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=limits.seconds,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return Failure(f"time limit of {limits.seconds:g} s", is_timeout=True)
        result = Path(folder) / _RESULT
        if not result.exists():
            return Failure(_crash(done.returncode, done.stderr.decode(errors="replace"), limits))
        found: Measurement | Failure = pickle.loads(result.read_bytes())
        return found


def _write_task(folder: Path, task: _Task) -> None:
    (folder / _TASK).write_bytes(_packed(task, task.method))


def check_portable(method: Method) -> None:
    """Refuse a method that cannot be sent to another process.

    Raises
    ------
    ModelError
    """
    _packed(method, method)


def _packed(content: _Task | Method, method: Method) -> bytes:
    """Classes and functions of a script or notebook go along by value."""
    cloudpickle = needed("cloudpickle", "frames", "models in processes of their own")
    try:
        result: bytes = cloudpickle.dumps(content)
    except Exception as error:  # pickling asks the object, which may raise what it likes
        raise ModelError(
            f"model {method.name!r} cannot be sent to another process: "
            f"{' '.join(str(error).split())[:160]}"
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


def _crash(code: int, stderr: str, limits: Limits) -> str:
    lines = stderr.strip().splitlines()
    last = f": {lines[-1][:160]}" if lines else ""
    if limits.memory is not None and any(word in stderr.lower() for word in _OUT_OF_MEMORY):
        return f"memory limit of {limits.memory:g} GB{last}"
    if code < 0:
        with suppress(ValueError):
            return f"crashed with {signal.Signals(-code).name}{last}"
    return f"the process ended with code {code}{last}"


def serve(folder: str) -> None:
    """The fresh process's side: read a task, run it, leave a result."""
    task: _Task = pickle.loads((Path(folder) / _TASK).read_bytes())
    _limit_memory(task.memory)
    result = _guarded(task)
    partial = Path(folder) / "partial"
    partial.write_bytes(pickle.dumps(result))
    partial.rename(Path(folder) / _RESULT)


def _guarded(task: _Task) -> Measurement | Failure:
    """Whatever a solver throws becomes the reason of a failed run."""
    with suppress(Exception):
        task.method.measure(single_block())
    gc.collect()
    try:
        measurement = task.method.measure(task.scene)
    except MemoryError:
        return Failure(f"memory limit of {task.memory:g} GB" if task.memory else "out of memory")
    except CvxlimitError as error:
        return Failure(str(error))
    except Exception as error:
        return Failure(f"{type(error).__name__}: {' '.join(str(error).split())[:160]}")
    if measurement.load_factor is None:
        return Failure(f"no load factor: {measurement.status}")
    return replace(measurement, memory=peak_memory())


def _limit_memory(gigabytes: float | None) -> None:
    if gigabytes is None or sys.platform != "linux":
        return
    import resource

    limit = int(gigabytes * 1e9)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def peak_memory() -> float | None:
    """Peak resident memory of this process, MB; None where it cannot be known.

    On Linux from /proc: getrusage there counts the parent's memory as well, from before the
    new program was loaded.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
