"""The command line: ``cvxlimit solve`` and ``cvxlimit scenes``.

Typer parses and nothing else: commands return the work to be done, and :func:`run` does it, so
that errors, Ctrl-C and exit codes are handled in one place. The summary goes to stdout; progress
and errors, one line each, go to stderr.
"""

from __future__ import annotations

import io
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Thread
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from cvxlimit.cli.explaining import explain_command
from cvxlimit.cli.importing import import_command
from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.outputs import PICTURES, ExitCode, check_outputs, check_picture, check_suffix
from cvxlimit.cli.report import (
    advice,
    history,
    is_eventful,
    listing,
    show,
    summary,
    warn_of_near_misses,
)
from cvxlimit.cli.settling import settle_command
from cvxlimit.cli.showing import show_command
from cvxlimit.cli.sweeping import sweep_command
from cvxlimit.errors import CvxlimitError, InputError, ModelError
from cvxlimit.io import export, write_result
from cvxlimit.io.fields import one_line
from cvxlimit.io.geometry import EXPORTS
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.solving import FLOWS, INTERACTIONS, MODELS, MOMENTS, solve
from cvxlimit.plotting import plot
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.surfaces.presets import TORSION_SHEAR
from cvxlimit.versions import __version__

Job = Callable[[], int]
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Order:
    """What ``cvxlimit solve`` was asked to do."""

    scene: str
    surface: str
    interaction: str
    moments: str
    torsion_shear: str
    flow: str
    tolerance: float | None
    json: Path | None
    plot: Path | None
    export: Path | None
    model: str
    branching_seconds: float | None = None
    workers: int = 1

    @property
    def rule(self) -> str | Certified:
        """The interaction by name, or with what was asked for it."""
        if self.branching_seconds is None and self.workers == 1:
            return self.interaction
        if self.interaction != Certified.name:
            raise ModelError(
                "--branching-seconds and --workers go with --interaction certified, got "
                f"{self.interaction!r}"
            )
        return Certified(branching_seconds=self.branching_seconds, workers=self.workers)


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
            help="How the interaction adds moments: every sign on its own, the safe reading; "
            "static torsion about the pressure centre, without or with the paper's Eq. 27; or the "
            "paper's own reading, which depends on the contacts' axes. Matters with an interaction "
            "only.",
        ),
    ] = "independent",
    torsion_shear: Annotated[
        str,
        typer.Option(
            "--torsion-shear",
            metavar="|".join(TORSION_SHEAR),
            help="How torsion and shear share friction: on the paper's line, on a parabola nearer "
            "the exact limit at the same price, or on that limit, to a tolerance. Without "
            "interaction only.",
        ),
    ] = "linear",
    flow: Annotated[
        str,
        typer.Option(
            metavar="|".join(FLOWS),
            help="Whether sliding opens contacts: the associated rule has one load factor; without "
            "dilatancy there is a set of solutions, of which the lowest found is shown.",
        ),
    ] = "associated",
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
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.csv|.obj|.glb",
            help="Write the contacts with their forces (CSV), or the blocks, for other programs.",
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            metavar="WIDTH",
            help="Asked width of the bracket, relative to its larger bound; the fixed point stops "
            "at a change of this size. Unless given: 1e-5 without interaction, 1e-4 for the fixed "
            "point, 1e-3 for exact torsion-shear; the certified method goes as far as it can, and "
            "0.05 counts as good.",
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            metavar="|".join(MODELS),
            help="How much model: no more than the scene needs, all of it, or the least that is "
            "valid whether it pays or not. The bounds are those of the full scene in any case; "
            "cvxlimit explain SCENE says what is left out.",
        ),
    ] = "auto",
    branching_seconds: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help="Time for branch and bound, which narrows the certified interaction's bracket. "
            "Unless given: 60 where a tolerance is asked for, or a scene has few contacts.",
            show_default=False,
        ),
    ] = None,
    workers: Annotated[
        int, typer.Option(metavar="N", help="Processes that branch and bound uses.")
    ] = 1,
) -> Job:
    """Find the collapse load factor of a scene, with a bracket recomputed outside the solver."""
    order = Order(
        scene, surface, interaction, moments, torsion_shear, flow, tolerance, json, plot, export,
        model, branching_seconds, workers,
    )  # fmt: skip
    return partial(_solve_job, order)


app.command("explain")(explain_command)
app.command("import")(import_command)
app.command("show")(show_command)
app.command("settle")(settle_command)
app.command(
    "sweep",
    epilog="Exit code: 0 all variations solved; 2 bad input; 4 some are not, which are rows too.",
)(sweep_command)


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
    known = ("solve", "explain", "scenes", "import", "show", "settle", "sweep")
    return f"{arguments[0]} " if arguments[0] in known else ""


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
        scene = scene_named(order.scene)
        solution = _interruptible(lambda: _solved(scene, order, tell))
    written: list[str] = []
    try:
        _write(scene, solution, order, written)
    finally:  # hours of work are shown even if the disk is full by now
        origin = "built-in" if order.scene in BUILTIN else order.scene
        show(summary(solution, origin, order.tolerance, written))
        if is_eventful(solution):
            show(Text(), history(solution.history))
    warn_of_near_misses(scene)
    return _verdict(solution)


def _solved(scene: Scene, order: Order, tell: Tell | None) -> Solution:
    return solve(
        scene,
        order.surface,
        interaction=order.rule,
        moments=order.moments,
        torsion_shear=order.torsion_shear,
        flow=order.flow,
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
    inputs = {} if order.scene in BUILTIN else {order.scene: "the scene"}
    check_outputs({"--json": order.json, "--plot": order.plot, "--export": order.export}, inputs)
    if order.export is not None:
        check_suffix("--export", order.export, EXPORTS)
    if order.plot is not None:
        check_picture(order.plot, PICTURES)


def _write(scene: Scene, solution: Solution, order: Order, written: list[str]) -> None:
    if order.json is not None:
        write_result(solution, order.json)
        written.append(str(order.json))
    if order.plot is not None:
        written += [str(path) for path in plot(scene, solution, order.plot)]
    if order.export is not None:
        written += [str(path) for path in export(scene, order.export, solution)]


# --- cvxlimit scenes ----------------------------------------------------------------------------


def _scenes_job() -> ExitCode:
    show(listing({name: (build(), build.description) for name, build in BUILTIN.items()}))
    return ExitCode.SOLVED
