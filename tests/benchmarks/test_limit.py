"""The least that a solver could take: a table and a chart."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.experiment import experiments
from benchmarks.scenes import panel_of
from matplotlib.image import imread


def test_one_row_for_each_panel(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "limit.png"
    experiments()["limit"](["--sizes", "60", "100", "--picture", str(picture)])
    rows = [line.split("|")[1:-1] for line in capsys.readouterr().out.splitlines()[2:]]
    assert [int(row[0]) for row in rows] == [len(panel_of(size).contacts) for size in (60, 100)]
    assert {len(row) for row in rows} == {8}
    assert imread(picture)[..., :3].std() > 0.0
