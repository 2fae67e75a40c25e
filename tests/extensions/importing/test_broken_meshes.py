"""Broken geometry through the command line: exit 2, one line that names it, nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest

from broken_meshes import BROKEN
from cvxlimit.cli.main import run
from cvxlimit.io import fields

pytest.importorskip("trimesh")

ASKED = ["--length-unit", "m", "--up", "z", "--density", "20", "--friction", "0.7"]
ASKED += ["--supports", "lowest", "--live", "1,0,0", "--output", "scene.json"]


def refused(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, folder: Path
) -> str:
    monkeypatch.chdir(folder)
    code = run(["import", name, *ASKED])
    shown = capsys.readouterr()
    assert code == 2, shown.err
    assert shown.out == ""
    assert shown.err.startswith("cvxlimit: ")
    assert shown.err.count("\n") == 1
    assert "internal error" not in shown.err
    assert len(shown.err) < 1000
    return shown.err


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files_are_refused_in_one_line(
    case: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    name, content, phrase = BROKEN[case]
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    assert phrase in refused(name, capsys, monkeypatch, tmp_path)
    assert list(tmp_path.iterdir()) == [path]


def test_there_are_fifty() -> None:
    assert len(BROKEN) >= 50


def test_a_huge_file_is_refused_by_its_size(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A sparse file of a terabyte: not a byte more is read than allowed."""
    with (tmp_path / "huge.obj").open("wb") as file:
        file.truncate(2**40)
    monkeypatch.setattr(fields, "LARGEST_FILE", 2**20)
    assert "huge.obj: the file is larger than 1 MiB" in refused(
        "huge.obj", capsys, monkeypatch, tmp_path
    )


def test_a_missing_file_and_a_strange_folder(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert "none.obj: there is no such file" in refused("none.obj", capsys, monkeypatch, tmp_path)
    (tmp_path / "empty").mkdir()
    assert "holds no geometry" in refused("empty", capsys, monkeypatch, tmp_path)


def test_a_picture_of_the_culprit(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The refused block is drawn, red, with rings; the scene file is not written."""
    name, content, _ = BROKEN["open"]
    assert isinstance(content, str)
    (tmp_path / name).write_text(content)
    monkeypatch.chdir(tmp_path)
    assert run(["import", name, *ASKED, "--plot", "culprit.html"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    page = (tmp_path / "culprit.html").read_text("utf-8")
    assert f"refused: {name}: block" in page
    assert '"id":["brick"]' in page
    assert '"marks":[{"at":' in page
    assert not (tmp_path / "scene.json").exists()
