"""The page on interaction: made from results, and from one command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from benchmarks.experiment import experiments as commands
from benchmarks.experiments.interaction import (
    READINGS,
    TABLES,
    Experiment,
    brackets,
    end,
    readings,
    run,
    runs,
    scene_of,
    spread,
    stopped,
)
from benchmarks.rows import Measured, Row, code

from cvxlimit import __version__
from cvxlimit.cli.main import run as run_cli


def result(factors: list[float], lower: float | None = None, upper: float | None = None) -> Row:
    """As if measured."""
    return {
        "status": "not converged", "load_factor": factors[-1], "lower": lower, "upper": upper,
        "seconds": 2.0, "contacts": 888, "factors": factors, "band": [min(factors), factors[-1]],
    }  # fmt: skip


def test_experiments_are_told_apart_and_name_what_exists() -> None:
    every = list(runs())
    assert len({e.key for e in every}) == len(every)
    assert {e.moments for e in every} <= {*READINGS, "none"}
    axes = {e.moments for e in every if e.part == "tables" and e.scene == "s12-panel"}
    assert len([name for name in axes if name.startswith("paper")]) == 4


def test_other_orders_are_the_same_wall() -> None:
    one, other = (scene_of(Experiment("orders", "tuff-wall", "paper", order=k)) for k in (-1, 3))
    assert [b.id for b in one.blocks] != [b.id for b in other.blocks]
    assert {b.id for b in one.blocks} == {b.id for b in other.blocks}
    assert len(one.contacts) == len(other.contacts)


def test_figures_of_the_tables() -> None:
    """0.137 is the paper's and 0.1411 3 % above it; 0.09 is 10 % below 0.1. A table says what ended
    an iteration: the paper's criterion wherever it was met first, or the last solve there was."""
    pairs = [
        (
            Experiment("tables", "s12-panel", "paper", surface="octagon"),
            result([0.18, 0.1, 0.137, 0.1411]),
        ),
        (
            Experiment("brackets", "s12-panel", "paper", "certified"),
            result([0.11], lower=0.1, upper=0.11),
        ),
        (Experiment("brackets", "s12-panel", "paper"), result([0.18, 0.09])),
    ]
    _, row, _ = spread(pairs)
    assert row[2:] == ("+3.0 %", "0.1411", "0 of 1")
    _, _, row, *_ = readings(pairs)
    assert row[3:] == ("0.1411", "+3.0 %", "4 solves", "0.1000 to 0.1411", "[0.1000, 0.1100]")
    met = result([0.18, 0.1370, 0.13700001, 0.1411])
    assert (end(met), stopped(met)) == (0.13700001, "Eq. 43 after 3")
    assert any("9.1 %" in row and "-10.0 %" in row for row in brackets(pairs))


@pytest.mark.exhaustive
def test_one_command_measures_and_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Results are kept, and not measured again by the same code; what other code left is measured,
    and printed only where it is asked for, with its version and day."""
    out, options = tmp_path / "rows.jsonl", ["--scenes", "single-block", "--docs", str(tmp_path)]
    for _ in range(2):
        commands()["interaction"]([*options, "--out", str(out)])
    found = [row["result"] for row in Measured(out, "key")]
    assert len(out.read_text("utf-8").splitlines()) == len(found) == 7
    assert np.allclose([row["load_factor"] for row in found], 0.4, rtol=1e-4)
    text = out.read_text("utf-8")
    out.write_text(text.replace(code(), "of another"), "utf-8")
    assert not list(Measured(out, "key"))
    shown = capsys.readouterr().out
    commands()["interaction"](["--kept", str(out)])
    kept = capsys.readouterr().out
    assert f"measured with cvxlimit {__version__} on 20" in kept
    assert "nothing is measured now" in kept
    assert "| independent | built-in scenes | 1 | 0 % |" in shown
    assert "| single-block |" not in shown  # one number to four digits, by both
    assert all(f"### {title}\n" in shown for title in TABLES)
    assert (tmp_path / "interaction.png").exists()


def test_time_is_kept() -> None:
    """Interrupted before its first solve ends, a run says so."""
    stopped = run(Experiment("brackets", "stack", "signed"), -1.0)
    assert "load_factor" not in stopped
    assert "stopped" in stopped["status"]


def test_the_command_line_knows_the_readings(tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    for moments in ("paper", "signed-torsion-bending"):
        options = ["--method", "certified", "--moments", moments, "--json", str(out)]
        assert run_cli(["solve", "single-block", *options]) == 0
        document = json.loads(out.read_text(encoding="utf-8"))
        assert document["moments"] == moments
        assert document["lower"] <= 0.4 + 1e-6
        assert document["upper"] >= 0.4 - 1e-6
        assert ("contacts' axes" in document["note"]) is (moments == "paper")
