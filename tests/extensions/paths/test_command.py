"""``cvxlimit pushover``: what it shows and writes, its exit codes, and a path that goes on."""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cvxlimit import Block, Load, Scene
from cvxlimit.cli import main as cli
from cvxlimit.extensions.paths import command as following
from cvxlimit.io import read_path, write_scene
from turning import wall

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run in a folder with the scene of a wall in two courses."""
    monkeypatch.chdir(tmp_path)
    write_scene(wall(2), "wall.json")

    def call(*arguments: str) -> tuple[int, str, str]:
        code = cli.run(["pushover", *arguments])
        captured = capsys.readouterr()
        return int(code), captured.out, captured.err

    return call


def test_a_path_is_shown_written_and_drawn(run: Run) -> None:
    code, out, err = run(
        "wall.json", "--step", "0.08", "--control", "c1:1,0,0", "--json", "path.json",
        "--csv", "path.csv", "--plot", "path.html", "--code-check", "1.0",
    )  # fmt: skip
    assert (code, err) == (0, "")
    for said in (
        r"on the path +0\.2000000 at rest", r"end +zero: ", r"written +path\.csv", "joints rock",
        "not that the structure gets there", r"T_SLC +1\.9\d+ s", "compared with the code in force",
    ):  # fmt: skip
        assert re.search(said, out), said
    path = read_path("path.json")
    assert path.control == ("c1", (1.0, 0.0, 0.0))
    rows = list(csv.DictReader(Path("path.csv").read_text("utf-8").splitlines()))
    assert [float(row["load_factor"]) for row in rows] == path.load_factor.tolist()
    assert "undeformed" in Path("path.html").read_text("utf-8")
    assert cli.run(["prove", "path.json"]) == 0


def test_a_path_of_a_file_goes_on(run: Run) -> None:
    asked = ["wall.json", "--step", "0.08", "--until", "0.1", "--json", "half.json"]
    code, out, err = run(*asked, "-v")
    assert code == 0
    assert re.search(r" w = 0: load factor 0\.2, after \d+ s\n", err)
    assert "reached: the load factor has come down to 0.1" in out
    assert "zero" not in out  # which is not reached
    code, out, _ = run("half.json", "--json", "whole.json")
    assert code == 0
    assert read_path("whole.json").d0 == pytest.approx(0.2, abs=1e-8)
    assert "0.09852" in out  # where it was broken off


def assert_refused(outcome: tuple[int, str, str], phrase: str, code: int = 2) -> None:
    assert outcome[0] == code, outcome
    assert re.fullmatch(r"cvxlimit: [^\n]+\n", outcome[2]), outcome[2]
    assert phrase in outcome[2]


def test_what_no_end_of_a_path_could_have_is_refused_before_it(run: Run, monkeypatch) -> None:
    """A check of a path that is not followed to 0, and what needs a solution at rest of one that
    starts displaced."""
    monkeypatch.setattr(following, "pushover", lambda *_, **__: pytest.fail("it was followed"))
    asked = ("wall.json", "--csv", "path.csv", "--code-check", "1.0", "--until", "0.1")
    assert_refused(run(*asked), "leave out --until")
    leaning = replace(wall(2), live=Load(acceleration=(-1, 0, 0)))
    leaning = leaning.with_dead(Load(gravity=(0, 0, -1), acceleration=(0.3, 0, 0)))
    write_scene(leaning, "leaning.json")
    for more in (("--code-check", "1.0"), ("--report", "page.html")):
        assert_refused(run("leaning.json", "--csv", "path.csv", *more), "starts displaced")
    assert not Path("path.csv").exists()


def test_a_path_whose_first_load_factor_is_zero_has_widths(run: Run) -> None:
    write_scene(wall(2).with_friction(0.0), "smooth.json")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        code, out, err = run("smooth.json")
    assert (code, err) == (0, "")
    assert re.search(r"configurations, widest \d", out)
    assert_refused(run("wall.json", "--step", "100"), "step must be no longer than all blocks")


def test_what_cannot_be_asked_is_refused_and_nothing_is_written(run: Run) -> None:
    for arguments, phrase in (
        (["--control", "c1"], "BLOCK:X,Y,Z is meant"),
        (["--control", "c1:1,0"], "must be three numbers"),
        (["--control", "c9:1,0,0"], "'c9', which is no free block"),
        (["--flow", "dry"], "flow must be one of"),
        (["--step", "-1"], "step must be above 0"),
        (["--plot", "path.vtu"], "the name must end in .png"),
        (["--json", "wall.json"], "this is the file of the scene"),
    ):
        assert_refused(run("wall.json", *arguments), phrase)
    Path("other.json").write_text('{"format": "cvxlimit-path", "version": 1}')
    assert_refused(run("other.json"), "other.json: the path lacks the key 'scene'")
    assert sorted(path.name for path in Path().iterdir()) == ["other.json", "wall.json"]


def test_a_scene_without_a_path_has_a_code_of_its_own(run: Run) -> None:
    ground = Block.box("ground", (-1, -1, -1), (1, 2, 0))
    over = Block.box("tower", (0.6, 0, 0), (1.8, 1, 4), density=20.0)
    push = Load(acceleration=(1, 0, 0))
    write_scene(Scene([ground, over], ["ground"], push), "falling.json")
    assert_refused(run("falling.json"), "the dead load does not stand alone", 3)
    write_scene(wall(1).with_live(Load(acceleration=(0, 0, -1))), "harmless.json")
    assert_refused(run("harmless.json"), "the live load does no harm", 3)


def test_a_path_that_was_broken_off_is_told_and_kept(run: Run, monkeypatch: Any) -> None:
    whole = following.pushover

    def broken(*given: Any, **options: Any) -> Any:
        found = whole(*given, **options)
        return replace(found, status="interrupted", reason="interrupted: what was found until then")

    monkeypatch.setattr(following, "pushover", broken)
    outcome = run("wall.json", "--step", "0.08", "--until", "0.1", "--json", "path.json")
    assert_refused(outcome, "interrupted: what was found", 4)
    assert read_path("path.json").status == "interrupted"


def test_a_bracket_that_is_too_wide_is_told(run: Run, monkeypatch: Any) -> None:
    whole = following.pushover

    def wide(*given: Any, **options: Any) -> Any:
        found = whole(*given, **options)
        last = found[len(found) - 1]
        bracket = replace(last.bracket, lower=last.bracket.lower - 1e-3)
        last = replace(last, bracket=bracket)
        return replace(found, configurations=(*found.configurations[:-1], last))

    monkeypatch.setattr(following, "pushover", wide)
    outcome = run("wall.json", "--step", "0.08", "--until", "0.1")
    assert_refused(outcome, "1 have brackets wider than 1e-05 of the first load factor", 4)
