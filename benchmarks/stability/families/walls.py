"""Walls and panels: what the methods were made for."""

from __future__ import annotations

import numpy as np

from benchmarks.stability.families.sample import Family, Sample, direction
from cvxlimit.errors import InputError
from cvxlimit.masonry import panel, wall
from cvxlimit.scene import Load


def bonded(rng: np.random.Generator, units: int, courses: int) -> list[list[float]]:
    """A running bond whose head joints wander, with an opening in most walls."""
    rows = []
    low = int(rng.integers(1, max(2, courses - 2)))
    hole = range(low, low + int(rng.integers(0, max(1, courses - low))))
    for row in range(courses):
        inner = np.arange(1, units) if row % 2 == 0 else np.arange(units) + 0.5
        ends = [0.0, *(inner + rng.uniform(-0.15, 0.15, len(inner))).tolist(), float(units)]
        lengths = np.diff(ends).tolist()
        if row in hole and row < courses - 1:
            lengths[len(lengths) // 2] *= -1.0
        rows.append(lengths)
    return rows


def _wall(rng: np.random.Generator, scale: int) -> Sample:
    """Openings may leave a course without bearing: such a wall falls, and that is an answer."""
    while True:
        units, courses = int(rng.integers(2, 5)) + scale - 1, int(rng.integers(3, 6)) + scale - 1
        sides = tuple(s for s in ("start", "end") if rng.random() < 0.3)
        try:
            scene = wall(
                bonded(rng, units, courses),
                unit=(0.4, 0.2, 0.2),
                friction=float(rng.uniform(0.2, 0.9)),
                side_supports=sides,
                live=Load(acceleration=direction(rng)),
            )
            len(scene.contacts)
        except InputError:  # an opening so wide that a block hangs in the air
            continue
        return Sample(scene, knob=f"friction {scene.friction:.2f}")


def _panel(rng: np.random.Generator, scale: int) -> Sample:
    courses = int(rng.integers(2, 6)) + scale - 1
    turns = [float(rng.choice([0.0, 0.12, 0.16])) for _ in "lr"]
    scene = panel(
        float(rng.choice([0.16, 0.24])) * scale,
        courses,
        left_return=turns[0],
        right_return=turns[1],
        friction=float(rng.uniform(0.3, 0.9)),
        live=Load(acceleration=direction(rng)),
    )
    return Sample(scene, knob=f"{sum(t > 0 for t in turns)} returns")


FAMILIES = (
    Family("walls", "running-bond walls with openings, pushed in any direction of space", _wall),
    Family("panels", "panels with no, one or two returns, pushed in any direction", _panel),
)
