"""The command line: ``cvxlimit solve`` and ``cvxlimit scenes``.

Typer parses and nothing else: commands return the work to be done, and :func:`run` does it, so
that errors, Ctrl-C and exit codes are handled in one place. The summary goes to stdout; progress
and errors, one line each, go to stderr.
"""

from __future__ import annotations

import difflib
import importlib.util
import io
import os
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from pathlib import Path
from threading import Thread
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from cvxlimit.cli.explaining import explanation
from cvxlimit.cli.report import advice, history, is_eventful, listing, show, summary
from cvxlimit.errors import CvxlimitError, InputError, ModelError
from cvxlimit.io import read_scene, write_result
from cvxlimit.io.fields import one_line
from cvxlimit.masonry import BUILTIN, builtin_scene
from cvxlimit.methods.solving import INTERACTIONS, MODELS, MOMENTS, solve
from cvxlimit.plotting import plot
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.versions import __version__

Job = Callable[[], int]
Tell = Callable[[str], None]

_PICTURES = (".png", ".html", ".vtu")


class ExitCode(IntEnum):
    """What the shell gets to see."""

    SOLVED = 0
    INTERNAL_ERROR = 1
    BAD_INPUT = 2
    NO_ANSWER = 3
    NOT_GOOD_ENOUGH = 4
    INTERRUPTED = 130


@dataclass(frozen=True)
class Order:
    """What ``cvxlimit solve`` was asked to do."""

    scene: str
    surface: str
    interaction: str
    moments: str
    tolerance: float | None
    json: Path | None
    plot: Path | None
    model: str


app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Certified collapse loads of dry-jointed masonry. Start with: cvxlimit solve tuff-wall",
)


def _show_version(asked: bool) -> None:
    if asked:
        show(Text(f"cvxlimit {__version__}"))
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    """Options of ``cvxlimit`` itself; Typer shows the help of ``app``."""


@app.command(
    "solve",
    epilog=(
        "Exit code: 0 solved; 2 bad input; 3 no answer exists (the dead load cannot stand, or the "
        "live load does no harm); 4 not converged, or not certified to the tolerance."
    ),
)
def _solve_command(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="Scene file, or name of a built-in scene. A built-in name wins over a file of "
            "that name: write ./NAME for the file.",
            show_default=False,
        ),
    ],
    surface: Annotated[
        str,
        typer.Option(
            metavar="conic|octagon|K-gon",
            help="Yield surface: the exact cone, the paper's 8 facets, or any K, as in 16-gon. "
            "Facets are on the unsafe side; octagon-inscribed or 16-gon-inscribed on the safe one.",
        ),
    ] = "conic",
    interaction: Annotated[
        str,
        typer.Option(
            metavar="|".join(INTERACTIONS),
            help="How bending reduces torsion and shear strength: not at all, by the paper's "
            "iteration, or by the certified method.",
        ),
    ] = "none",
    moments: Annotated[
        str,
        typer.Option(
            metavar="|".join(MOMENTS),
            help="How the interaction adds moments: every sign on its own (the paper's), or "
            "static torsion about the pressure centre. Matters with an interaction only.",
        ),
    ] = "independent",
    json: Annotated[
        Path | None, typer.Option(metavar="OUT", help="Write the result to this JSON file.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.png|.html|.vtu",
            help="Draw the mechanism: a picture, an interactive page, or files for ParaView.",
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            metavar="WIDTH",
            help="Asked width of the bracket, relative to its larger bound; the fixed point stops "
            "at a change of this size. Unless given: 1e-5 without interaction, 1e-4 for the fixed "
            "point; the certified method goes as far as it can, and 0.05 counts as good.",
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            metavar="|".join(MODELS),
            help="How much model: no more than the scene needs, or all of it. The bounds are those "
            "of the full scene either way; cvxlimit explain SCENE says what is left out.",
        ),
    ] = "auto",
) -> Job:
    """Find the collapse load factor of a scene, with a bracket recomputed outside the solver."""
    order = Order(scene, surface, interaction, moments, tolerance, json, plot, model)
    return partial(_solve_job, order)


@app.command("explain")
def _explain_command(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE", help="Scene file, or name of a built-in scene.", show_default=False
        ),
    ],
    surface: Annotated[
        str, typer.Option(metavar="conic|octagon|K-gon", help="Yield surface, as for solve.")
    ] = "conic",
    model: Annotated[
        str, typer.Option(metavar="|".join(MODELS), help="How much model, as for solve.")
    ] = "auto",
) -> Job:
    """Say how much model a scene gets, which solver, and how long it will take; solve nothing."""
    return partial(_explain_job, scene, surface, model)


@app.command("scenes")
def _scenes_command() -> Job:
    """List the built-in scenes."""
    return _scenes_job


def main() -> NoReturn:
    """Run the command line of the process and end it."""
    code = run(sys.argv[1:])
    if code == ExitCode.INTERRUPTED:
        # The solver's thread may still be in native code, which aborts when Python is shut down.
        os._exit(code)
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Do what the arguments ask and return the exit code; nothing is raised."""
    _survive_any_encoding()
    try:
        return _dispatch(list(arguments) or ["--help"])
    except (InputError, ModelError) as error:
        return _refuse(ExitCode.BAD_INPUT, str(error))
    except CvxlimitError as error:
        return _refuse(ExitCode.NOT_GOOD_ENOUGH, str(error))
    except BrokenPipeError:
        _discard_stdout()
        return ExitCode.INTERNAL_ERROR
    except OSError as error:
        _discard_stdout()
        return _refuse(
            ExitCode.BAD_INPUT, f"{error.filename or 'standard output'}: {error.strerror}"
        )
    except KeyboardInterrupt:
        return _refuse(ExitCode.INTERRUPTED, "interrupted")
    except MemoryError:
        return _refuse(ExitCode.INTERNAL_ERROR, "not enough memory for this scene")
    except Exception as error:
        return _internal(error)


def _dispatch(arguments: list[str]) -> int:
    command: Any = typer.main.get_command(app)
    try:
        job = command.main(args=arguments, prog_name="cvxlimit", standalone_mode=False)
    except Exception as error:
        # Typer's usage errors have no public class that is the same in all its versions.
        if not hasattr(error, "format_message"):
            raise
        reason = " ".join(error.format_message().split()).rstrip(".")
        return _refuse(ExitCode.BAD_INPUT, f"{reason}; see cvxlimit {_helped(arguments)}--help")
    return int(job()) if callable(job) else ExitCode.SOLVED


def _helped(arguments: Sequence[str]) -> str:
    return f"{arguments[0]} " if arguments[0] in ("solve", "explain", "scenes") else ""


def _refuse(code: ExitCode, message: str) -> ExitCode:
    if sys.stderr is not None:
        sys.stderr.write(f"cvxlimit: {one_line(message)}\n")
    return code


def _internal(error: Exception) -> ExitCode:
    if os.environ.get("CVXLIMIT_DEBUG") == "1":
        traceback.print_exception(error)
        return ExitCode.INTERNAL_ERROR
    return _refuse(
        ExitCode.INTERNAL_ERROR,
        f"internal error, please report it with your scene ({type(error).__name__}: {error}); "
        "CVXLIMIT_DEBUG=1 shows where",
    )


def _survive_any_encoding() -> None:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _discard_stdout() -> None:
    """Let Python's last flush of a closed pipe or a full disk go nowhere."""
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


# --- cvxlimit solve -----------------------------------------------------------------------------


def _solve_job(order: Order) -> ExitCode:
    _check_outputs(order)
    with _progress() as tell:
        scene = _scene(order.scene)
        solution = _interruptible(lambda: _solved(scene, order, tell))
    written: list[str] = []
    try:
        _write(scene, solution, order, written)
    finally:  # hours of work are shown even if the disk is full by now
        origin = "built-in" if order.scene in BUILTIN else order.scene
        show(summary(solution, origin, order.tolerance, written))
        if is_eventful(solution):
            show(Text(), history(solution.history))
    return _verdict(solution)


def _solved(scene: Scene, order: Order, tell: Tell | None) -> Solution:
    return solve(
        scene,
        order.surface,
        interaction=order.interaction,
        moments=order.moments,
        tolerance=order.tolerance,
        progress=tell,
        model=order.model,
    )


def _verdict(solution: Solution) -> ExitCode:
    status = solution.status
    if status.is_good:
        return ExitCode.SOLVED
    code = ExitCode.NOT_GOOD_ENOUGH if status.has_answer else ExitCode.NO_ANSWER
    return _refuse(code, f"{status}: {advice(solution)}")


def _scene(name: str) -> Scene:
    """A built-in name wins; whatever else is a file."""
    if name in BUILTIN:
        return builtin_scene(name)
    looks_like_file = Path(name).suffix or Path(name).name != name
    if looks_like_file or os.path.exists(name):
        return read_scene(name)
    close = difflib.get_close_matches(name, BUILTIN, n=1)
    cure = f"did you mean {close[0]!r}?" if close else "cvxlimit scenes lists the built-in ones"
    raise InputError(f"there is no built-in scene and no file {name!r}; {cure}")


def _interruptible(work: Callable[[], Solution]) -> Solution:
    """Run in a thread: solvers are native code, during which Python does not see Ctrl-C."""
    future: Future[Solution] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:
            future.set_exception(error)

    Thread(target=run, daemon=True).start()
    return future.result()


@contextmanager
def _progress() -> Iterator[Tell | None]:
    """A spinner with the last message and the time; silence where stderr is no terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield None
        return
    columns = SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading the scene", total=None)
        yield lambda message: bar.update(task, description=one_line(message))


# --- output files -------------------------------------------------------------------------------


def _check_outputs(order: Order) -> None:
    """Refuse before the long work what is known to fail after it."""
    outputs = [(o, p) for o, p in (("--json", order.json), ("--plot", order.plot)) if p is not None]
    seen = {} if order.scene in BUILTIN else {os.path.realpath(order.scene): "the scene"}
    for option, path in outputs:
        reason = _obstacle(path)
        if reason:
            raise InputError(f"{option} {path}: {reason}")
        taken = seen.setdefault(os.path.realpath(path), option)
        if taken != option:
            raise InputError(f"{option} {path}: this is the file of {taken}; choose another name")
    if order.plot is not None:
        _check_picture(order.plot)


def _check_picture(path: Path) -> None:
    suffix = path.suffix.lower()
    if suffix not in _PICTURES:
        raise InputError(f"--plot {path}: the name must end in {', '.join(_PICTURES)}")
    if suffix == ".png" and importlib.util.find_spec("matplotlib") is None:
        raise ModelError(
            f"--plot {path}: pictures need Matplotlib: pip install 'cvxlimit[plot]' "
            "(.html and .vtu work without it)"
        )


def _obstacle(path: Path) -> str:
    """Why no file can be written there; empty if nothing speaks against it."""
    if os.path.isdir(path):
        return "this is a folder; name a file in it"
    if not os.path.isdir(path.parent):
        return f"there is no folder {str(path.parent)!r}; create it first"
    try:
        if os.path.exists(path) and not os.path.isfile(path):  # a device or a pipe
            return "" if os.access(path, os.W_OK) else "it cannot be written to; choose another"
        with suppress(FileNotFoundError):
            os.stat(path)
        with tempfile.TemporaryFile(dir=path.parent):
            return ""
    except OSError as error:
        return f"no file can be written there ({error.strerror}); choose another place"


def _write(scene: Scene, solution: Solution, order: Order, written: list[str]) -> None:
    if order.json is not None:
        write_result(solution, order.json)
        written.append(str(order.json))
    if order.plot is not None:
        written += [str(path) for path in plot(scene, solution, order.plot)]


# --- cvxlimit explain and cvxlimit scenes ---------------------------------------------------------


def _explain_job(scene: str, surface: str, model: str) -> ExitCode:
    show(explanation(_scene(scene), surface, model))
    return ExitCode.SOLVED


def _scenes_job() -> ExitCode:
    show(listing({name: (build(), build.description) for name, build in BUILTIN.items()}))
    return ExitCode.SOLVED
