"""What is needed to publish: files that say the same, and placeholders that one edit fills."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from cvxlimit import __version__

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
RELEASE = re.sub(r"\.dev\d+$", "", __version__)

PLACEHOLDER = "example.org/cvxlimit"
PLACES = {
    ".github/ISSUE_TEMPLATE/config.yml",
    "CITATION.cff",
    "SUPPORT.md",
    "pyproject.toml",
    "recipe/meta.yaml",
}
"""Where the project's address has to be filled in:
``sed -i s#example.org/cvxlimit#ADDRESS#`` on these files; the DOI and the authors of CITATION.cff,
paper/paper.md and docs/citing.md follow with the first archived release."""


def text(name: str) -> str:
    return (ROOT / name).read_text("utf-8")


def files() -> list[str]:
    """Those of the sources, from git where there is one."""
    if (ROOT / ".git").exists():
        asked = ["git", "-C", str(ROOT), "ls-files"]
        return subprocess.run(asked, capture_output=True, check=True, text=True).stdout.split("\n")
    return sorted(PLACES)


def test_placeholders_are_in_the_places_named_and_nowhere_else() -> None:
    kinds = (".md", ".toml", ".yml", ".yaml", ".cff")
    found = {
        name
        for name in files()
        if name.endswith(kinds) and (ROOT / name).exists() and PLACEHOLDER in text(name)
    }
    assert found in (PLACES, set())  # before and after the edit


@pytest.mark.parametrize("name", ["CITATION.cff", "recipe/meta.yaml", "docs/citing.md"])
def test_files_name_this_release(name: str) -> None:
    assert re.search(rf'version\W+{re.escape(RELEASE)}["}}\s]', text(name))


def test_the_conda_recipe_needs_what_the_package_needs() -> None:
    run = text("recipe/meta.yaml").split("  run:\n")[1].split("\n\n")[0]
    named = {line.strip("- ").replace(" ", "") for line in run.splitlines()}
    assert named == {*PROJECT["dependencies"], f"python{PROJECT['requires-python']}"}


def test_hosted_checks_are_those_of_ci_run_on_three_versions_of_python() -> None:
    workflow = text(".github/workflows/ci.yml")
    assert re.findall(r"- run: (.*)", workflow) == [
        "bash .ci/run ${{ github.event_name == 'schedule' && 'nightly' || 'push' }}"
    ]
    (versions,) = re.findall(r"python: \[(.*)\]", workflow)
    assert len(versions.split(",")) == 3
    assert f'"{PROJECT["requires-python"].removeprefix(">=")}"' in versions


def test_issue_forms_ask_for_scene_and_version() -> None:
    forms = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
    faults = [f.read_text("utf-8") for f in forms if f.stem in ("fault", "wrong-bracket")]
    assert len(faults) == 2
    assert all("id: scene" in form and "id: version" in form for form in faults)


def test_the_paper_has_the_sections_asked_for_and_cites_what_it_lists() -> None:
    paper, library = text("paper/paper.md"), text("paper/paper.bib")
    assert re.findall(r"^# (.*)$", paper, re.MULTILINE) == [
        "Summary", "Statement of need", "State of the field", "Software design",
        "Research impact statement", "AI usage disclosure", "References",
    ]  # fmt: skip
    cited = set(re.findall(r"@(\w+\d{4})", paper))
    assert cited == set(re.findall(r"^@article\{(\w+),", library, re.MULTILINE))
    assert 750 <= len(paper.split("\n---\n")[1].split()) <= 1750


def test_the_code_of_conduct_and_support_are_there() -> None:
    assert "privately" in text("CODE_OF_CONDUCT.md")
    assert "--version" in text("SUPPORT.md")
