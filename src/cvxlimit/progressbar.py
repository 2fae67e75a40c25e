"""A progress bar on stderr for long work, in terminals and notebooks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count


@contextmanager
def progress_bar(
    title: str, steps: int, progress: bool | Callable[[str], None], done: int = 0
) -> Iterator[Callable[[str], None]]:
    """Inside ``with``, a function that is told what is finished, once per step.

    ``progress`` shows a bar on stderr or nothing, or is called with a line of text.
    """
    if callable(progress):
        numbers = count(done + 1)
        if done:
            progress(f"{title}: {done} of {steps} found")
        yield lambda what: progress(f"{title}: {next(numbers)} of {steps}, {what:.60}")
        return
    if not progress:
        yield lambda what: None
        return
    from tqdm import tqdm  # only who looks at a bar needs it

    with tqdm(desc=title, total=steps, initial=done) as bar:

        def advance(what: str) -> None:
            bar.set_postfix_str(f"{what:.40}", refresh=False)
            bar.update()

        yield advance
