"""The documents beside the README keep their word, and all of them reach an index and the sdist."""

from __future__ import annotations

import importlib.util
import re
import tomllib
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import cvxlimit

ROOT = Path(__file__).parents[2]
README, CONTRIBUTING, ADDITIONS, SYMBOLS, CHANGELOG = (
    (ROOT / name).read_text("utf-8")
    for name in (
        "README.md",
        "CONTRIBUTING.md",
        "docs/additions.md",
        "docs/symbols.md",
        "CHANGELOG.md",
    )
)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
SEAMS = ("cone", "file format", "solver", "formulation", "outer loop")
ANOTHER = ROOT / "tests" / "kit" / "another"


def fenced(text: str, language: str = "python") -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def section(text: str, title: str) -> str:
    found = re.search(rf"^## An? {title}\n(.*?)(?=^##|\Z)", text, re.DOTALL | re.MULTILINE)
    assert found, f"no section on a {title}"
    return found[1]


@pytest.mark.parametrize("seam", SEAMS)
def test_one_example_per_seam_checks_its_answer(seam: str) -> None:
    """It runs with the code of all pages."""
    text = section(ADDITIONS, seam)
    (code,) = fenced(text)
    assert "\nassert " in code
    assert "In the package: " in text


def test_no_example_is_left_out() -> None:
    titles = re.findall(r"^## An? (.*)$", ADDITIONS, re.MULTILINE)
    assert sorted(titles) == sorted([*SEAMS, "package of your own"])


def test_the_package_of_ones_own_is_the_one_that_runs() -> None:
    """Its code and its entry points are the files that ``tests/base/test_doors.py`` loads."""
    text = section(ADDITIONS, "package of your own")
    shown = re.findall(r"^```{literalinclude} (\S+)$", text, re.MULTILINE)
    entries = ANOTHER / "cvxlimit_another-1.0.dist-info" / "entry_points.txt"
    found = [(ROOT / "docs" / path).resolve() for path in shown]
    assert found == [entries, ANOTHER / "cvxlimit_another.py"]


def exists(name: str) -> bool:
    """True if ``cvxlimit`` has this, as a module, an attribute or an annotated field."""
    *path, last = name.split(".")
    thing: Any = cvxlimit
    for part in path:
        thing = getattr(thing, part, None) or import_module(f"{thing.__name__}.{part}")
    return hasattr(thing, last) or last in getattr(thing, "__dataclass_fields__", {})


ROWS = [line.split(" | ") for line in SYMBOLS.splitlines() if line.startswith("| ")][1:]


@pytest.mark.parametrize("row", ROWS, ids=[row[0].strip("| ") for row in ROWS])
def test_symbols_are_called_so(row: list[str]) -> None:
    assert len(row) == 3
    options = ("method", "moments")
    for name in re.findall(r"`([^`]+)`", row[2]):
        assert name in options or exists(name), name


def test_the_check_of_names_can_fail() -> None:
    assert exists("Contacts.torsion_arm")
    assert exists("model.statics.Statics.matrix")
    assert not exists("Contacts.arm")
    assert not exists("models")


@pytest.mark.parametrize("name", ["CONTRIBUTING.md", "CHANGELOG.md", "docs/symbols.md"])
def test_links_lead_somewhere(name: str) -> None:
    file = ROOT / name
    links = re.findall(r"\]\(([^)#:]+)[^)]*\)", file.read_text("utf-8"))
    assert all((file.parent / link).exists() for link in links)


def test_files_named_for_contributors_exist() -> None:
    named = re.findall(r"`((?:src|tests|\.ci|docs)/[^`]*)`", CONTRIBUTING)
    assert len(named) > 5
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_the_changelog_begins_with_this_version() -> None:
    newest = re.findall(r"^## (\S+)", CHANGELOG, re.MULTILINE)[0]
    assert cvxlimit.__version__.split(".dev")[0] == newest


def test_the_paper_is_cited_in_full_and_alike() -> None:
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    for fact in (
        "Limit analysis by linear programming of 3D masonry structures with associative friction "
        "laws and torsion interaction effects",
        "Portioli", "Archive of Applied Mechanics", "83", "1415", "1438", "2013",
    ):  # fmt: skip
        assert fact in citation
        assert fact in " ".join(README.replace("\n> ", " ").split())


RELATIVE = r"\]\((?!https?:|#)[^)]+\)"


def on_an_index(address: str = "") -> str:
    """The README as Hatchling puts it into packages."""
    pytest.importorskip("hatchling")
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return str(module.on_an_index(README, address))


def rendered(text: str) -> str:
    """The HTML that package indexes make of it, cleaned as they do."""
    markdown = pytest.importorskip("readme_renderer.markdown")
    html = markdown.render(text)
    assert html
    return str(html)


@pytest.mark.parametrize("address", ["", "https://example.org/cvxlimit/v1"])
def test_nothing_on_a_package_index_points_nowhere(address: str) -> None:
    """Relative links do not work there; code is not touched."""
    assert re.search(RELATIVE, README)
    shown = on_an_index(address)
    assert not re.search(RELATIVE, shown)
    assert shown.count(address or "of the source distribution") == len(re.findall(RELATIVE, README))
    for language in ("sh", "python"):
        assert fenced(shown, language) == fenced(README, language)
    addresses = re.findall(r'(?:src|href)="([^"#]*)', rendered(shown))
    assert all(found.startswith("https://") for found in addresses if found)


def test_a_package_index_shows_every_picture_that_has_an_address() -> None:
    address = "https://example.org/cvxlimit/v1"
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README)
    assert pictures
    assert all((ROOT / picture).exists() for picture in pictures)
    shown = re.findall(r'<img[^>]* src="([^"]+)"', rendered(on_an_index(address)))
    assert shown == [f"{address}/{picture}" for picture in pictures]


def test_pictures_without_an_address_become_captions() -> None:
    assert "<img" not in rendered(on_an_index())
    for caption in re.findall(r"!\[([^\]]*)\]", README):
        assert f"{caption}: picture" in on_an_index()


def test_an_index_takes_out_pictures_written_into_the_text() -> None:
    """Why they are not: if that changes, they could be."""
    assert "data:" not in rendered("![x](data:image/png;base64,iVBORw0KGgo=)")


def test_an_address_that_no_index_shows_is_refused() -> None:
    with pytest.raises(ValueError, match="must begin with https://"):
        on_an_index("ftp://example.org")


def test_the_version_is_set_in_one_place() -> None:
    """Files that name it besides are compared with it: test_publishing.py."""
    assert "version" in PROJECT["project"]["dynamic"]
    assert PROJECT["tool"]["hatch"]["version"]["path"] == "src/cvxlimit/base/versions.py"
