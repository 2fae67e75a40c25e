"""Progress of long work is shown in notebooks with what the package brings."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Any

import pytest

from cvxlimit import builtin_scene, settlement, solve
from cvxlimit.base.progressbar import progress_bar, told_to
from cvxlimit.errors import ModelError


def test_the_bar_needs_no_widgets_and_warns_of_none(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with progress_bar("sweep", 2, True) as done:
            done("one")
            done("two")
    shown = capsys.readouterr().err
    assert "sweep" in shown
    assert "2/2" in shown


def calls(progress: object) -> list[Callable[[], object]]:
    """Long work of the core that reports its progress."""
    given: Any = {"progress": progress}

    def bar() -> None:
        with progress_bar("work", 1, given["progress"]) as done:
            done("one")

    stack = builtin_scene("stack")
    return [
        bar,
        lambda: solve(stack, **given),
        lambda: settlement(stack, stack.supports[0], (0, 0, -1), **given),
    ]


@pytest.mark.parametrize("progress", [True, False, None, print, lambda line: None])
def test_progress_is_taken_alike_everywhere(
    progress: object, capsys: pytest.CaptureFixture[str]
) -> None:
    for call in calls(progress):
        call()
        out, err = capsys.readouterr()
        assert bool(err) is (progress is True)
        assert bool(out) is (progress is print)


@pytest.mark.parametrize("progress", [1, 0, "yes", [], 2.5])
def test_what_is_no_progress_is_refused(progress: object) -> None:
    for call in calls(progress):
        with pytest.raises(ModelError, match="progress must be True, False or a function"):
            call()
    assert told_to(None) is None
