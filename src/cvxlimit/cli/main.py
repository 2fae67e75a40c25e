"""The command line: ``cvxlimit`` with its commands, each in a module beside this one.

What a command needs is imported when it is asked for, so that help and version come at once.

Typer parses and nothing else: commands return the work to be done, and :func:`run` does it, so
that errors, Ctrl-C and exit codes are handled in one place. The summary goes to stdout; progress
and errors, one line each, go to stderr.
"""

from __future__ import annotations

import ast
import io
import json
import os
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from multiprocessing import active_children
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.text import Text

from cvxlimit.base.doors import Door
from cvxlimit.base.versions import __version__
from cvxlimit.cli.options import Job, typer_command
from cvxlimit.cli.shell import ExitCode, refuse, show
from cvxlimit.errors import CvxlimitError, InputError, ModelError, NoAnswerError

app = typer.Typer(
    context_settings={"help_option_names": ["-h", "--help"]},
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
            "--version",
            "-V",
            callback=_show_version,
            is_eager=True,
            help="Show the version and exit.",
        ),
    ] = False,
) -> None:
    """Options of ``cvxlimit`` itself; Typer shows the help of ``app``."""


@app.command("scenes")
def _scenes_command(
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of scene files instead.")
    ] = False,
) -> Job:
    """List the built-in scenes."""
    return partial(_list, schema)


COMMANDS = Door("cvxlimit.commands")


def add(name: str) -> None:
    """Register a command from its door: a record of options, or, from other distributions, a
    function for Typer."""
    made = COMMANDS[name]
    command = typer_command(made) if isinstance(made, type) else made
    app.command(name, epilog=getattr(command, "epilog", None))(command)
    _LOADED.add(name)


def _summary(place: str) -> str:
    """The docstring of a command, from the text of its module, which is not imported."""
    module, _, attribute = place.partition(":")
    file = Path(__file__).parents[1].joinpath(*module.split(".")[1:]).with_suffix(".py")
    tree = ast.parse(file.read_text("utf-8"))
    kinds = (ast.ClassDef, ast.FunctionDef)
    made = next(n for n in tree.body if isinstance(n, kinds) and n.name == attribute)
    return (ast.get_docstring(made) or "").split("\n\n")[0]


_LOADED = {"scenes"}
"""Commands that Typer knows in full; of the others it has the name and a summary only."""

for _name, _place in COMMANDS.places.items():
    app.command(_name, help=_summary(_place))(lambda: None)


def main(when_imported: Callable[[], object] = lambda: None) -> NoReturn:
    """Runs the command, and calls ``when_imported`` once all that it needs is imported."""
    code = run(sys.argv[1:], when_imported)
    workers = active_children()
    if workers:  # left by an interrupted pool, whose thread would report their end as an error
        threading.excepthook = lambda _: None
        for process in workers:
            process.kill()
            process.join()
        sys.stdout.flush()
    if workers or code == ExitCode.INTERRUPTED:
        # The solver's thread may still be in native code, which aborts when Python is shut down.
        os._exit(code)
    sys.exit(code)


def run(arguments: Sequence[str], when_imported: Callable[[], object] = lambda: None) -> int:
    """Do what the arguments ask and return the exit code; nothing is raised."""
    _survive_any_encoding()
    try:
        return _dispatch(list(arguments) or ["--help"], when_imported)
    except NoAnswerError as error:
        return refuse(ExitCode.NO_ANSWER, str(error))
    except (InputError, ModelError) as error:
        return refuse(ExitCode.BAD_INPUT, str(error))
    except CvxlimitError as error:
        return refuse(ExitCode.NOT_GOOD_ENOUGH, str(error))
    except BrokenPipeError:
        _discard_stdout()
        return ExitCode.INTERNAL_ERROR
    except OSError as error:
        _discard_stdout()
        return refuse(
            ExitCode.BAD_INPUT, f"{error.filename or 'standard output'}: {error.strerror}"
        )
    except KeyboardInterrupt:
        return refuse(ExitCode.INTERRUPTED, "interrupted")
    except MemoryError:
        return refuse(ExitCode.INTERNAL_ERROR, "not enough memory for this scene")
    except Exception as error:
        return _internal(error)


def parsed(arguments: Sequence[str]) -> Any:
    """The work that arguments ask for, not done yet; Typer's errors are raised."""
    name = arguments[0]
    if name in ("--help", "-h"):
        for other in {*COMMANDS.names}.difference(_known()):
            app.command(other, help=f"Of another package: cvxlimit {other} --help.")(lambda: None)
    if not name.startswith("-") and name not in _LOADED:
        COMMANDS.check(name)
        if name in COMMANDS:
            add(name)
    command: Any = typer.main.get_command(app)
    return command.main(args=list(arguments), prog_name="cvxlimit", standalone_mode=False)


def _dispatch(arguments: list[str], when_imported: Callable[[], object]) -> int:
    try:
        job = parsed(arguments)
    except Exception as error:
        # Typer's usage errors have no public class that is the same in all its versions.
        if not hasattr(error, "format_message"):
            raise
        reason = " ".join(error.format_message().split()).rstrip(".")
        meant, is_unreadable, _ = reason.partition(", unable to parse")
        reason = meant + _given(error, arguments) if is_unreadable else reason
        if getattr(error, "option_name", None) == "--friction":
            reason = "friction is the scene's: set it there, or cvxlimit sweep --vary friction=0.5"
        return refuse(ExitCode.BAD_INPUT, f"{reason}; see cvxlimit {_helped(arguments)}--help")
    when_imported()
    return int(job()) if callable(job) else ExitCode.SOLVED


def _given(error: Exception, arguments: Sequence[str]) -> str:
    """What was typed for an option that could not be read: Typer names the option only."""
    options = getattr(getattr(error, "param", None), "opts", ())
    typed = dict(pairwise(word for argument in arguments for word in argument.split("=", 1)))
    return next((f", got {typed[name]!r}" for name in options if name in typed), "")


def _helped(arguments: Sequence[str]) -> str:
    return f"{arguments[0]} " if arguments[0] in _known() else ""


def _known() -> list[str | None]:
    return [command.name for command in app.registered_commands]


def _internal(error: Exception) -> ExitCode:
    if os.environ.get("CVXLIMIT_DEBUG") == "1":
        traceback.print_exception(error)
        return ExitCode.INTERNAL_ERROR
    return refuse(
        ExitCode.INTERNAL_ERROR,
        "internal error, please report it, with your scene, where you got cvxlimit "
        f"({type(error).__name__}: {error}); CVXLIMIT_DEBUG=1 shows where",
    )


def _survive_any_encoding() -> None:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _discard_stdout() -> None:
    """Let Python's last flush of a closed pipe or a full disk go nowhere."""
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _list(schema: bool) -> ExitCode:
    from cvxlimit.cli.report import listing
    from cvxlimit.io import json_schema
    from cvxlimit.masonry import BUILTIN

    if schema:
        typer.echo(json.dumps(json_schema("scene"), indent=1))
    else:
        show(listing({name: (build(), build.description) for name, build in BUILTIN.items()}))
    return ExitCode.SOLVED
