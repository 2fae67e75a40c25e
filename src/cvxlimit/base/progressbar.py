"""Progress of long work: a bar on stderr, in terminals and notebooks, and lines of a log."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

LOG = logging.getLogger("cvxlimit")
"""Says at level INFO what is being done and what every solve gave; silent unless it is asked."""

LOG.addHandler(logging.NullHandler())


@contextmanager
def progress_bar(
    title: str, steps: int, progress: bool | Callable[[str], None], done: int = 0
) -> Iterator[Callable[[str], None]]:
    """Inside ``with``, a function that is told what is finished, once per step.

    ``progress`` shows a bar on stderr or nothing, or is called with a line of text; the log
    has all lines.
    """
    numbers = count(done + 1)

    def say(text: str) -> None:
        LOG.info(text)
        if callable(progress):
            progress(text)

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
