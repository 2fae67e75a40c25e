"""A progress bar on stderr for long work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn


@contextmanager
def progress_bar(
    title: str, steps: int, is_shown: bool, done: int = 0
) -> Iterator[Callable[[str], None]]:
    """Inside ``with``, a function that is told what is finished, once per step.

    >>> with progress_bar("counting", 2, is_shown=False) as advance:
    ...     advance("one")
    """
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    console = Console(stderr=True)
    with Progress(*columns, TimeElapsedColumn(), console=console, disable=not is_shown) as bar:
        task = bar.add_task(title, total=steps, completed=done)
        yield lambda what: bar.update(task, advance=1, description=f"{title}: {what:.40}")
