"""The package without each of its extensions: ``python .ci/without.py [NAME...]``.

In a copy an extension's folder is deleted, with its tests, and those of the core are run: what asks
for the extension is told that it is missing (:class:`~cvxlimit.errors.MissingExtension`), and is
skipped; all else passes. Skips are counted: none, or many, would say that the check checks nothing.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
EXTENSIONS = Path("src", "cvxlimit", "extensions")
CORE = ("base", "scene/test_scene.py", "methods/test_table.py", "methods/test_driver.py",
        "problem/test_problem.py", "results", "io/test_io.py", "solvers/test_program.py",
        "whole/test_imports.py", "whole/test_layout.py", "whole/test_missing.py",
        "whole/test_names.py")  # fmt: skip
"""Tests of the core that ask at its doors, in a quarter of a minute for each extension."""

MOST = 0.1
"""Share of tests that may be skipped: those of the core that need one extension are fewer than one
in twenty for any, and more would say that something else is skipped for it."""


def failure_without(name: str) -> str:
    """What is wrong with the core's tests in a copy without an extension; empty if nothing is."""
    with tempfile.TemporaryDirectory() as folder:
        leave = shutil.ignore_patterns(".git", ".venv*", ".*_cache", "__pycache__", "site")
        copy = Path(folder, "copy")
        shutil.copytree(ROOT, copy, ignore=leave)
        shutil.rmtree(copy / EXTENSIONS / name)
        shutil.rmtree(copy / "tests" / "extensions" / name)
        command = [sys.executable, "-m", "pytest", "-rs", "-n", "2"]
        environment = {**os.environ, "PYTHONPATH": str(copy / "src")}
        tests = [f"tests/{part}" for part in CORE]
        done = subprocess.run(
            [*command, *tests], cwd=copy, env=environment, stdout=subprocess.PIPE, text=True
        )
    sys.stdout.write(done.stdout)
    told = rf"^SKIPPED \[(\d+)\] .*is of extension '{name}'"
    skipped = sum(map(int, re.findall(told, done.stdout, re.M)))
    passed = sum(map(int, re.findall(r"(\d+) passed", done.stdout)))
    sys.stdout.write(f"without {name}: {passed} passed, {skipped} skipped\n")
    if done.returncode:
        return f"{name}: tests fail"
    if not 0 < skipped <= MOST * passed:
        return f"{name}: {skipped} skipped beside {passed} passed, where some are, and few"
    return ""


if __name__ == "__main__":
    names = sys.argv[1:] or sorted(
        path.parent.name for path in (ROOT / EXTENSIONS).glob("*/__init__.py")
    )
    failures = [*filter(None, map(failure_without, names))]
    sys.exit("; ".join(failures) or 0)
