"""The pages of the documentation keep their word: code, commands, links, and all public names.

The site itself is built by .ci/run, where warnings are errors.
"""

from __future__ import annotations

import importlib.util
import re
import shlex
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import cvxlimit
from cvxlimit import compare, errors, io, masonry, plotting, solvers, surfaces
from cvxlimit.cli.main import parsed

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(page for page in DOCS.rglob("*.md") if "_made" not in page.parts)
WITH_COMMANDS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES]


SNIPPET = re.compile(
    r"^```python\n(.*?)^```$(?:\n*^```text\n(.*?)^```$)?", re.DOTALL | re.MULTILINE
)
"""Code, and what it prints if a block of text follows it."""


def fenced(path: Path, language: str) -> list[str]:
    text = path.read_text("utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def snippets(page: Path) -> list[tuple[str, str]]:
    return SNIPPET.findall(page.read_text("utf-8"))


TUTORIALS = [page for page in PAGES if page.parent.name == "tutorials"]
"""Pages whose pieces of code belong together."""

CODE = [
    pytest.param([snippet], id=f"{page.stem}-{number}")
    for page in PAGES
    if page not in TUTORIALS
    for number, snippet in enumerate(snippets(page))
]
CODE += [pytest.param(snippets(page), id=page.stem) for page in TUTORIALS]


@pytest.mark.exhaustive_cases(
    "additions-3", "additions-4", "after-collapse-0", "after-collapse-2", "after-collapse-4",
    "after-collapse-5", "bridges-0", "choosing-0", "closing-0", "dilatancy-0", "first-steps-1",
    "from-rest-0", "from-rest-1",
    "geometry-1", "in-time-0", "in-time-1", "interaction-0", "pictures-0", "recipes-1", "recipes-5",
    "engineer", "researcher",
)  # fmt: skip
@pytest.mark.parametrize("code", CODE)
def test_code_runs_and_prints_what_the_page_shows(
    code: list[tuple[str, str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "docs"}
    for source, printed in code:
        if "from compas_dem" in source:
            pytest.importorskip("compas_dem")
        if "shake(" in source:
            pytest.importorskip("mujoco")
        exec(compile(source, "docs", "exec", dont_inherit=True), names)
        shown = capsys.readouterr().out
        assert not printed or shown == printed


def commands(program: str) -> list[str]:
    """Command lines of a program in the environment, continued lines joined."""
    lines = []
    for page in WITH_COMMANDS:
        for block in fenced(page, "sh"):
            lines += re.findall(rf"\.venv/bin/{program} (.*)", block.replace("\\\n", " "))
    return lines


def test_there_is_code_and_there_are_commands() -> None:
    assert len(CODE) > 15
    assert len(commands("cvxlimit")) > 10


@pytest.mark.parametrize("line", commands("cvxlimit"))
def test_the_command_line_knows_these_commands(line: str) -> None:
    """Typer only parses: what a command returns is the work to be done, which is not done here."""
    arguments = shlex.split(line, comments=True)
    if arguments[0].startswith("-") or "--help" in arguments:
        return
    assert callable(parsed(arguments))


@pytest.mark.parametrize("line", commands("python"))
def test_what_python_is_asked_to_run_is_there(line: str) -> None:
    words = shlex.split(line, comments=True)
    if words[0] == "-m" and words[1].split(".")[0] == "benchmarks":
        assert importlib.util.find_spec(words[1])
    elif words[0].endswith(".py"):
        assert (ROOT / words[0]).exists()


@pytest.mark.parametrize("page", PAGES, ids=[page.stem for page in PAGES])
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    links = re.findall(r"\]\((?![a-z]+:)([^)#\s]+)[^)]*\)", text)
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_every_picture_is_shown_somewhere() -> None:
    text = "".join(page.read_text("utf-8") for page in WITH_COMMANDS)
    text += " ".join(f"{kind}.png" for kind in plotting.PICTURES)  # docs/making.py shows those
    pictures = [path for path in DOCS.rglob("*.png") if "_made" not in path.parts]
    assert [path.name for path in pictures if path.name not in text] == []


@pytest.mark.parametrize(
    "module",
    [cvxlimit, compare, errors, io, masonry, plotting, solvers, surfaces],
    ids=lambda module: module.__name__,
)
def test_every_public_name_is_on_a_page(module: ModuleType) -> None:
    pages = "".join(page.read_text("utf-8") for page in DOCS.glob("api/*.md"))
    named = set(re.findall(r"^\.\. auto\w+:: (?:[\w.]+\.)?(\w+)$", pages, re.MULTILINE))
    for name in re.findall(r"^\.\. automodule:: (\S+)$", pages, re.MULTILINE):
        whole = import_module(name)
        named |= set(getattr(whole, "__all__", vars(whole)))
    names = {n for n in module_names(module) if not isinstance(getattr(module, n), ModuleType)}
    assert names - named <= {"__version__"}


def module_names(module: ModuleType) -> list[str]:
    return list(getattr(module, "__all__", [])) or [n for n in vars(module) if n[0] != "_"]


def links() -> ModuleType:
    spec = importlib.util.spec_from_file_location("links", DOCS / "links.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("text", "folder", "expected"),
    [
        ("[a](bracket.md#status)", "docs", "[a](/bracket.md#status)"),
        ("[a](../README.md#start)", "docs", "[a](/index.md)"),
        ("[a](docs/symbols.md)", ".", "[a](/symbols.md)"),
        ("[a](../notebooks/x.ipynb)", "docs", "[a](/_made/notebooks/x.ipynb)"),
        ("[a](../benchmarks/suite.py), [b](#here)", "docs", "a, [b](#here)"),
        (
            "![a](x.png) [b](https://example.org/x)",
            "docs",
            "![a](x.png) [b](https://example.org/x)",
        ),
        ("`[a](../README.md)`", "docs", "`[a](../README.md)`"),
        ("```\nf[0](x)\n```\n[a](x.md)", "docs", "```\nf[0](x)\n```\n[a](/x.md)"),
    ],
)
def test_links_of_the_sources_become_those_of_the_site(
    text: str, folder: str, expected: str
) -> None:
    assert links().for_site(text, folder) == expected
