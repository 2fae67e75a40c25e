"""What the shell sees of any command: its exit code, text on stdout, complaints of a line.

Nothing heavy is imported here: ``cvxlimit --help`` needs no more.
"""

from __future__ import annotations

import sys
from contextvars import ContextVar
from enum import IntEnum

from rich.console import Console, RenderableType

from cvxlimit.base.lines import one_line

VOICE = ContextVar("voice", default=0)
"""How much a command says: -1 nothing but errors, 1 every step as well."""


class ExitCode(IntEnum):
    """What the shell gets to see."""

    SOLVED = 0
    INTERNAL_ERROR = 1
    BAD_INPUT = 2
    NO_ANSWER = 3
    NOT_GOOD_ENOUGH = 4
    INTERRUPTED = 130


def complain(message: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"cvxlimit: {one_line(message)}\n")


def refuse(code: ExitCode, message: str) -> ExitCode:
    complain(message)
    return code


def show(*renderables: RenderableType) -> None:
    """Print to stdout as it is: ids and paths are no markup, lines end where their text does."""
    if sys.stdout is None or VOICE.get() < 0:
        return
    width = None if sys.stdout.isatty() else 1000  # nothing wraps in files and pipes
    console = Console(markup=False, emoji=False, highlight=False, width=width)
    with console.capture() as capture:
        for renderable in renderables:
            console.print(renderable)
    sys.stdout.writelines(f"{line.rstrip()}\n" for line in capture.get().splitlines())
    sys.stdout.flush()
