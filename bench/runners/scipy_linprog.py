"""The same matrices in SciPy's linprog (HiGHS), default settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.baselines import ScipyLinprog

from cvxlimit.io import read_scene
from protocol import answer, dry, factor_or


def solve(file: Path) -> dict[str, Any]:
    """As :class:`benchmarks.baselines.ScipyLinprog` does."""
    dry(file)
    found = ScipyLinprog().measure(read_scene(file))
    return factor_or(found.status, found.load_factor)


answer(("scipy",), solve)
