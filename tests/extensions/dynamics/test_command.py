"""``cvxlimit shake`` and ``cvxlimit export``: what they show and write, and their exit codes."""

from __future__ import annotations

from pathlib import Path

import pytest

from cvxlimit.cli import main as cli


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "give one of --pulse SHAPE:A:T and --record FILE.csv"),
        (["--pulse", "sine:0.5"], "SHAPE:A:T is meant"),
        (["--pulse", "sin:0.5:1"], "did you mean 'sine'?"),
        (["--record", "a.csv"], "say the --unit"),
        (["--record", "a.csv", "--unit", "g"], "a.csv: cannot be read"),
        (["--pulse", "sine:0.5:1", "--plot", "a.txt"], "a.txt"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert cli.run(["shake", "single-block", *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_it_falls_and_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    files = ["--csv", "a.csv", "--plot", "a.gif", "--frame", "a.png"]
    assert cli.run(["shake", "single-block", "--pulse", "sine:0.5:1", *files]) == 0
    assert "falls in all 4 runs" in capsys.readouterr().out
    assert (tmp_path / "a.gif").read_bytes().startswith(b"GIF8")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    header, *rows = (tmp_path / "a.csv").read_text("utf-8").splitlines()
    assert header == "step (s),time constant (s),time (s),displacement (m)"
    assert float(rows[0].split(",")[3]) == 0.0


def test_a_pulse_of_300_without_a_unit_is_asked_about(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    for unit, said in (([], "half-sine:300:0.1: the largest acceleration is 300 g, and"),
                       (["--unit", "gal"], ""), (["--unit", "g"], "")):  # fmt: skip
        assert cli.run(["shake", "single-block", "--pulse", "half-sine:300:0.1", *unit]) in (0, 4)
        assert said in (err := capsys.readouterr().err)
        assert bool(said) is ("in gal?" in err)


def test_blocks_that_still_move_are_not_good_enough(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    arguments = ["--pulse", "sine:0.46:1", "--after", "0.05"]
    assert cli.run(["shake", "single-block", *arguments]) == 4
    assert "falls in none of 4 runs, and still moves" in capsys.readouterr().err


def test_export_writes_any_form(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["export", "single-block", "--format", "mjcf"]) == 0
    assert "<freejoint" in (tmp_path / "single-block.mjcf").read_text("utf-8")
    assert cli.run(["export", "single-block", "--format", "obj", "-o", "b.obj"]) == 0
    assert cli.run(["export", "single-block", "--format", "dae"]) == 2
    assert "must be one of obj, glb, csv, mjcf" in capsys.readouterr().err
