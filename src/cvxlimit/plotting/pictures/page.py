"""The mechanism to turn, zoom and point at."""

from __future__ import annotations

from cvxlimit.plotting.pictures import webpage
from cvxlimit.plotting.registry import listed
from cvxlimit.solution import Solution


@listed
def page(solution: Solution) -> webpage.Page:
    """An interactive page in one file that works offline: turn, zoom, animate, point at things."""
    return webpage.page(solution.scene, solution)
