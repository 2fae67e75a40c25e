"""The paper's problem written literally: Eq. 9, 25 and 39 in CVXPY, default solver."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.baselines import Literal

from cvxlimit.io import read_scene
from protocol import answer, dry, factor_or


def solve(file: Path) -> dict[str, Any]:
    """As :class:`benchmarks.baselines.Literal` does."""
    dry(file)
    found = Literal().measure(read_scene(file))
    return factor_or(found.status, found.load_factor)


answer(("cvxpy", "clarabel"), solve)
