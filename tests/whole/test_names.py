"""Names that type checkers know are those that the package takes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from cvxlimit.methods.solving import TABLE, MethodName
from cvxlimit.readings.named import MOMENTS, MomentsName
from cvxlimit.surfaces.coulomb import SURFACES, SurfaceName, surfaces_of


def test_names_are_those_of_the_tables() -> None:
    assert set(TABLE) <= set(get_args(MethodName))
    assert get_args(MomentsName) == tuple(MOMENTS)
    assert set(SURFACES) < set(get_args(SurfaceName))
    for name in get_args(SurfaceName):
        assert surfaces_of(name)[1] == re.sub("^8-gon", "octagon", name)


@pytest.mark.exhaustive
def test_misspelt_names_fail_in_mypy(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    file = tmp_path / "user.py"
    wrong = ["method='exakt'", "moments='sined'", "surface='octogon'",
             "model='ful'"]  # fmt: skip
    right = ["method='certified'", "method='exact'", "surface='octagon-inscribed'"]
    head = "from cvxlimit import builtin_scene, solve\nscene = builtin_scene('arch')\n"
    file.write_text(head + "\n".join(f"solve(scene, {option})" for option in right + wrong))
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(file)],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    found = [int(line.split(":")[1]) for line in done.stdout.splitlines() if "user.py" in line]
    assert sorted(set(found)) == list(range(6, 10)), done.stdout
