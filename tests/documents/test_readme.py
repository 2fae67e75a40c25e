"""The README keeps its word: its code runs, its commands are those of .ci/run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text("utf-8")


def fenced(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)


PYTHON = fenced("python")
COMMANDS = [
    line for block in fenced("sh") for line in block.splitlines() if line.startswith("python3")
]


@pytest.mark.parametrize("code", PYTHON, ids=range(len(PYTHON)))
def test_code_runs_on_its_own(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {"__name__": "readme"})


def test_there_is_code() -> None:
    assert len(PYTHON) >= 3


def test_two_commands_for_a_fresh_machine_and_both_are_in_ci() -> None:
    assert len(COMMANDS) == 2
    assert "cvxlimit solve tuff-wall" in COMMANDS[0]
    assert "pytest" in COMMANDS[1]
    script = (ROOT / ".ci" / "run").read_text("utf-8").splitlines()
    assert all(command in script for command in COMMANDS)
    # what the second command leaves out, by halves: odd and even days
    assert '.venv/bin/pytest -n 2 -m exhaustive --part "$half"' in script


def test_the_site_is_built_in_ci_by_the_command_given() -> None:
    (command,) = [
        line for block in fenced("sh") for line in block.splitlines() if "sphinx-build" in line
    ]
    assert "-W" in command  # warnings are errors
    assert command in (ROOT / ".ci" / "run").read_text("utf-8").splitlines()


def test_files_and_folders_named_in_the_readme_exist() -> None:
    named = re.findall(r"`((?:src|tests|\.ci|docs)/[^`]*)`", README)
    named += re.findall(r"\]\(([^)#:]+)\)", README)
    assert len(named) > 5
    missing = [name for name in named if not (ROOT / name).exists()]
    assert not missing


def test_picture_is_small() -> None:
    assert (ROOT / "docs" / "tuff-wall.png").stat().st_size < 300_000
