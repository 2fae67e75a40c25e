"""The package without each of its extensions: ``python .ci/without.py [NAME...]``.

In a copy an extension's folder is deleted, with its tests, and those of the core are run: what asks
for the extension is told in a sentence that it is not here, and left out; all else passes.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
EXTENSIONS = Path("src", "cvxlimit", "extensions")
CORE = ("base", "scene/test_scene.py", "methods/test_table.py", "methods/test_driver.py",
        "problem/test_problem.py", "results", "io/test_io.py", "solvers/test_program.py",
        "whole/test_imports.py", "whole/test_layout.py", "whole/test_names.py")  # fmt: skip
"""Tests of the core that ask at its doors, in a quarter of a minute for each extension."""


def passes_without(name: str) -> bool:
    """Whether the core's tests pass in a copy without an extension."""
    with tempfile.TemporaryDirectory() as folder:
        leave = shutil.ignore_patterns(".git", ".venv*", ".*_cache", "__pycache__", "site")
        copy = Path(folder, "copy")
        shutil.copytree(ROOT, copy, ignore=leave)
        shutil.rmtree(copy / EXTENSIONS / name)
        shutil.rmtree(copy / "tests" / "extensions" / name)
        command = [sys.executable, "-m", "pytest", "-q", "-n", "2"]
        environment = {**os.environ, "PYTHONPATH": str(copy / "src")}
        tests = [f"tests/{part}" for part in CORE]
        return subprocess.run([*command, *tests], cwd=copy, env=environment).returncode == 0


if __name__ == "__main__":
    names = sys.argv[1:] or sorted(
        path.parent.name for path in (ROOT / EXTENSIONS).glob("*/__init__.py")
    )
    failed = [name for name in names if not passes_without(name)]
    sys.exit(f"not without {', '.join(failed)}" if failed else 0)
