"""Prose stays short and plain: words per page, rows per table, and a list of words."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from words import INSTEAD

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
USER = sorted(
    page
    for page in DOCS.rglob("*.md")
    if not {"_made", "api", "evidence"} & set(page.relative_to(DOCS).parts)
)
"""Pages that every reader meets; those of evidence and of the API are as long as they must be."""

REFERENCE = ("symbols", "conventions")
"""Pages whose tables are the reference itself."""

MOST_WORDS, MOST_IN_README, MOST_IN_ALL, MOST_ROWS = 1600, 850, 40_000, 6


def prose(page: Path) -> str:
    """Without code, tables, formulas and directives."""
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^\$\$.*?^\$\$$", "", text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"`[^`\n]+`", "", text)


@pytest.mark.parametrize("page", USER, ids=lambda page: page.stem)
def test_pages_are_short(page: Path) -> None:
    assert len(page.read_text("utf-8").split()) <= MOST_WORDS


def test_the_readme_and_all_pages_together_are_short() -> None:
    pages = [page for page in DOCS.rglob("*.md") if "_made" not in page.parts]
    assert len((ROOT / "README.md").read_text("utf-8").split()) <= MOST_IN_README
    assert sum(len(page.read_text("utf-8").split()) for page in pages) <= MOST_IN_ALL


@pytest.mark.parametrize(
    "page", [page for page in USER if page.stem not in REFERENCE], ids=lambda page: page.stem
)
def test_tables_are_short(page: Path) -> None:
    tables = re.findall(r"(?:^\|.*\n)+", page.read_text("utf-8"), re.MULTILINE)
    assert max((table.count("\n") - 2 for table in tables), default=0) <= MOST_ROWS


@pytest.mark.parametrize("page", [ROOT / "README.md", *USER], ids=lambda page: page.stem)
@pytest.mark.parametrize("words", INSTEAD)
def test_words_that_are_not_written(page: Path, words: str) -> None:
    found = re.findall(rf"[^.\n]*(?:{words})[^.\n]*", prose(page), re.IGNORECASE)
    assert not found, f"write instead: {INSTEAD[words]}"


@pytest.mark.parametrize("page", USER, ids=lambda page: page.stem)
def test_formulas_are_formulas(page: Path) -> None:
    """No subscripts written with underscores or Unicode in running text, no raw norms."""
    text = re.sub(r"\$[^$]+\$", "", prose(page))
    if page.stem not in REFERENCE:
        assert not re.findall(r"\bM_T|\bc_T|[A-Za-z][₀-₉]|\\\|", text)


@pytest.mark.parametrize("word", ["seismic", "overturn", "cite", "in-plane", "Windows", "conda"])
def test_what_readers_search_for_is_on_a_page(word: str) -> None:
    assert any(word in page.read_text("utf-8") for page in USER)
