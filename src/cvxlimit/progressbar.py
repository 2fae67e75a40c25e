"""A progress bar on stderr for long work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn


@contextmanager
def progress_bar(
    title: str, steps: int, progress: bool | Callable[[str], None], done: int = 0
) -> Iterator[Callable[[str], None]]:
    """Inside ``with``, a function that is told what is finished, once per step.

    ``progress`` shows a bar on stderr or nothing, or is called with a line of text.

    >>> with progress_bar("counting", 2, progress=print) as advance:
    ...     advance("one")
    counting: 1 of 2, one
    """
    if callable(progress):
        numbers = count(done + 1)
        if done:
            progress(f"{title}: {done} of {steps} found")
        yield lambda what: progress(f"{title}: {next(numbers)} of {steps}, {what:.60}")
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    console = Console(stderr=True)
    with Progress(*columns, TimeElapsedColumn(), console=console, disable=not progress) as bar:
        task = bar.add_task(title, total=steps, completed=done)
        yield lambda what: bar.update(task, advance=1, description=f"{title}: {what:.40}")
