"""Progress of long work: a bar on stderr, in terminals and notebooks, and lines of a log."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from typing import TypeAlias

from cvxlimit.errors import ModelError

LOG = logging.getLogger("cvxlimit")
"""Says at level INFO what is being done and what every solve gave; silent unless it is asked."""

LOG.addHandler(logging.NullHandler())

Progress: TypeAlias = "bool | Callable[[str], None] | None"
"""How long work reports, everywhere alike: True on stderr, False or None not at all, or a function
that is called with one line of text at every step."""


def told_to(progress: Progress) -> Callable[[str], None] | None:
    """The function that is called with every line; None where nobody wants to know.

    Raises
    ------
    ModelError
        For what is no :data:`Progress`.
    """
    if progress is True:
        return _on_stderr
    if progress is None or progress is False:
        return None
    if not callable(progress):
        raise ModelError(
            f"progress must be True, False or a function of one line of text, got {progress!r:.60}"
        )
    return progress


def heard_by(progress: Progress) -> Callable[[str], None]:
    """The function that tells every line to the log, and to who wants to know."""
    tell = told_to(progress)

    def say(line: str) -> None:
        LOG.info(line)
        if tell is not None:
            tell(line)

    return say


def _on_stderr(line: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"{line}\n")


@contextmanager
def progress_bar(
    title: str, steps: int, progress: Progress, done: int = 0
) -> Iterator[Callable[[str], None]]:
    """Inside ``with``, a function that is told what is finished, once per step.

    A bar is shown on stderr where ``progress`` is True; the log has all lines.
    """
    numbers, say = count(done + 1), heard_by(None if progress is True else progress)

    def line(what: str) -> None:
        say(f"{title}: {next(numbers)} of {steps}, {what:.60}")

    if done:
        say(f"{title}: {done} of {steps} found")
    if progress is not True:
        yield line
        return
    from tqdm import tqdm  # only who looks at a bar needs it

    with tqdm(desc=title, total=steps, initial=done) as bar:

        def advance(what: str) -> None:
            line(what)
            bar.set_postfix_str(f"{what:.40}", refresh=False)
            bar.update()

        yield advance
