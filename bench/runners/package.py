"""The package itself, default settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cvxlimit import Status, solve
from cvxlimit.io import read_scene
from protocol import answer


def ours(file: Path) -> dict[str, Any]:
    """Factor and bracket, or what the status says."""
    found = solve(read_scene(file))
    if found.load_factor is None:
        if found.status is Status.DEAD_LOAD_UNSTABLE:
            return {"answer": "falls"}
        raise ValueError(str(found.status))
    return {"load_factor": found.load_factor}


answer(("cvxlimit", "cvxpy"), ours)
