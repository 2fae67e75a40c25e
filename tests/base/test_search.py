"""A search over solves: a queue that grows by its answers, here and elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial

import pytest

from cvxlimit.base.search import processes, searched
from cvxlimit.errors import InputError, ModelError


def halves(number: int) -> list[int]:
    """Both parts of a number, in a process of any kind."""
    return [] if number < 2 else [number // 2, number - number // 2]


def split(executor: Executor | None, budget: int = 100) -> list[tuple[int, list[int]]]:
    """Splits 12 into ones: what comes next follows from the answers, until the budget is spent."""
    open_ones, answers = [12], list[tuple[int, list[int]]]()

    def following() -> int | None:
        return open_ones.pop(0) if open_ones and len(answers) < budget else None

    for number, parts in searched(halves, following, executor, at_once=2):
        answers.append((number, parts))
        open_ones += parts
    return answers


@pytest.mark.parametrize("made", [partial(ThreadPoolExecutor, 2), partial(processes, 2)])
def test_all_that_follows_is_answered_wherever_it_is(made: Callable[[], Executor]) -> None:
    here = split(None)
    assert len(here) == 23  # twelve ones, and eleven cuts between them
    with made() as executor:
        assert sorted(split(executor)) == sorted(here)


def test_a_budget_is_a_queue_that_ends() -> None:
    assert [number for number, _ in split(None, budget=3)] == [12, 6, 6]


def test_what_is_no_executor_or_cannot_be_sent_is_told() -> None:
    with pytest.raises(InputError, match=r"executor must be .*, got 2: write ProcessPoolExecutor"):
        split(2)  # type: ignore[arg-type]
    with ThreadPoolExecutor(1) as pool, pytest.raises(ModelError, match="cannot be sent"):
        next(searched((i for i in range(3)).__next__, lambda: None, pool))  # type: ignore
