"""Tests stand where what they test stands, and those of the package need nothing beside it."""

from __future__ import annotations

import re
from pathlib import Path

TESTS = Path(__file__).parents[1]
PACKAGE = TESTS.parent / "src" / "cvxlimit"
OTHERS = {"bench", "benchmarks", "documents", "kit", "whole"}
"""Folders that mirror none of the package's."""

BENCHES = ("bench", "benchmarks")


def test_folders_and_files_mirror_the_source() -> None:
    files = [path.relative_to(TESTS) for path in TESTS.rglob("test_*.py")]
    assert len(files) > 50
    folders = {file.parent for file in files if file.parts[0] not in OTHERS}
    assert [folder for folder in folders if not (PACKAGE / folder).is_dir()] == []
    single = [file for file in files if len(file.parts) == 1]
    modules = [PACKAGE / file.name.removeprefix("test_") for file in single]
    assert [module.name for module in modules if not module.exists()] == []


def test_tests_of_the_package_import_no_benchmarks_and_no_other_test() -> None:
    found = [
        (path.name, line)
        for path in TESTS.rglob("*.py")
        for line in re.findall(r"^\s*(?:from|import) (\w+)", path.read_text("utf-8"), re.M)
        if line.startswith("test_")
        or (line in BENCHES and path.relative_to(TESTS).parts[0] not in BENCHES)
    ]
    assert found == []
