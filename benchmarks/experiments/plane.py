"""From how many contacts on the plane of a planar scene pays.

One problem in space and in its plane, by turns: CPU milliseconds from known contacts to the
certificate, medians.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from statistics import median
from time import process_time
from unittest.mock import patch

import numpy as np

from benchmarks.experiment import Head, Lines, Part, experiment
from cvxlimit import Block, Load, Scene, solve
from cvxlimit.masonry import arch, running_bond, wall
from cvxlimit.methods import convex

PUSH = Load(acceleration=(1, 0, 0))


def bond(contacts: int, friction: float) -> Scene:
    """A wall of twice as many courses as units in one."""
    units = max(2, round((contacts / 6.0) ** 0.5))
    courses = running_bond(units, 2 * units)
    return wall(courses, unit=(0.4, 0.2, 0.2), density=20.0, friction=friction, live=PUSH)


def pile(contacts: int) -> Scene:
    """Blocks on one another, each a little aside."""
    ground, edges = Block.box("ground", (-1, 0, -1), (2, 1, 0)), np.random.default_rng(0)
    at = np.cumsum(edges.uniform(-0.02, 0.02, contacts))
    blocks = [
        Block.box(f"b{i}", (x, 0, 0.3 * i), (x + 1.0, 1, 0.3 * i + 0.3), density=20.0)
        for i, x in enumerate(at.tolist())
    ]
    return Scene([ground, *blocks], ["ground"], PUSH, friction=0.5)


FAMILIES: Mapping[str, tuple[Callable[[int], Scene], tuple[int, ...]]] = {
    "wall, friction 0.6": (lambda n: bond(n, 0.6), (20, 100, 200, 300, 400, 600, 1_200, 5_000)),
    "wall, friction 0.3": (lambda n: bond(n, 0.3), (20, 100, 200, 300, 400, 600, 1_200, 5_000)),
    "arch": (lambda n: arch(n - 1, live=PUSH), (20, 100, 200, 300, 400)),
    "pile": (pile, (20, 100, 200, 300, 400)),
}


@experiment(Part(2))
def plane(runs: int = 9) -> Lines:
    """One solve in space over one in the plane."""
    yield Head("planar scene", "contacts", "in space, ms", "in the plane, ms", "ratio",
               "factors differ by")  # fmt: skip
    for name, (made, sizes) in FAMILIES.items():
        for size in sizes:
            scene = made(size)
            number = len(scene.contacts)
            spent, factors = times(scene, max(3, min(runs, 3_000 // number)))
            full, lean = spent["full"], spent["auto"]
            yield (
                name, f"{number:,}", f"{1e3 * full:.1f}", f"{1e3 * lean:.1f}", f"{full / lean:.2f}",
                f"{abs(factors['full'] / factors['auto'] - 1.0):.0e}",
            )  # fmt: skip


def times(scene: Scene, runs: int) -> tuple[dict[str, float], dict[str, float]]:
    """CPU seconds, medians, and load factors of both models."""
    spent: dict[str, list[float]] = {"full": [], "auto": []}
    factors = dict[str, float]()
    with patch.object(convex, "PLANAR_FROM", 0):
        for _ in range(runs):
            for model, seconds in spent.items():
                start = process_time()
                factors[model] = float(solve(scene, model=model).load_factor)  # type: ignore[arg-type]
                seconds.append(process_time() - start)
    return {model: median(seconds) for model, seconds in spent.items()}, factors
