"""A brick panel with two returns, pushed out of plane; 5,560 blocks at the largest size."""

from math import sqrt

from benchmarks.cases import Case
from cvxlimit.masonry import panel
from cvxlimit.scene import Scene

_BRICK = 0.08
"""Length of a brick, m; fronts and returns are multiples of half of it."""


def build(contacts: int) -> Scene:
    """About ``contacts`` contacts; 16,452 gives exactly 16,452."""
    scale = sqrt(contacts / 16_452)
    front = max(2 * _BRICK, _whole(2.4 * scale))
    side = max(_BRICK, _whole(1.6 * scale))
    courses = max(2, round(80 * scale))
    return panel(
        front, courses, left_return=side, right_return=side, name=f"panel {front:.2f} x {courses}"
    )


def _whole(length: float) -> float:
    return round(2 * length / _BRICK) * _BRICK / 2


CASE = Case("panel", "panels", build, study=())
