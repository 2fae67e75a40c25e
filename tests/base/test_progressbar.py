"""Progress of long work is shown in notebooks with what the package brings."""

from __future__ import annotations

import sys
import warnings

import pytest

from cvxlimit.base.progressbar import progress_bar


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
