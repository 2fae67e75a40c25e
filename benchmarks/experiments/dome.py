"""Least thickness of a hemispherical dome under its own weight.

For ever finer blocks, over the mean radius, friction high enough to prevent sliding. Literature:
0.041 to 0.043, by how the lune is cut (Heyman and after him).
"""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter

from benchmarks.experiment import Head, Lines, Part, experiment
from cvxlimit import Load, Scene, Status, solve
from cvxlimit.errors import ModelError
from cvxlimit.masonry import dome

SIZES = (8, 12, 16, 24, 32)
"""Lunes, and as many courses."""

FRICTION = 1.5
"""No joint slides: the thrust would have to cross it 56 degrees off its normal."""


@experiment(Part(2, name="domes"), name="dome")
def domes(sizes: Sequence[int] = SIZES, oculus: float = 4.0, width: float = 1e-5) -> Lines:
    """Least thickness of a hemispherical dome, for ever finer blocks, bisected to a width."""
    yield Head("lunes and courses", "oculus, degrees", "falls at", "stands at", "s")
    for size in sizes:
        start = perf_counter()
        low, high = least_thickness(size, size, oculus, width)
        yield size, f"{oculus:g}", f"{low:.5f}", f"{high:.5f}", f"{perf_counter() - start:.1f}"


def least_thickness(
    lunes: int, courses: int, oculus: float, width: float, low: float = 0.035, high: float = 0.05
) -> tuple[float, float]:
    """Ratios at which the dome falls and stands, no more than ``width`` apart, by bisection."""
    for ratio, expected in ((low, False), (high, True)):
        if stands(crowned(lunes, courses, oculus, ratio)) is not expected:
            raise ModelError(f"the least thickness does not lie between {low:g} and {high:g}")
    while high - low > width:
        middle = (low + high) / 2.0
        if stands(crowned(lunes, courses, oculus, middle)):
            high = middle
        else:
            low = middle
    return low, high


def crowned(lunes: int, courses: int, oculus: float, ratio: float) -> Scene:
    """The dome with a live load of 1 on its top course, down.

    That load drives the mechanism of a thin dome, in which the crown sinks.
    """
    share = (0.0, 0.0, -1.0 / lunes, 0.0, 0.0, 0.0)
    live = Load(forces={f"d{courses}.{lune}": share for lune in range(1, lunes + 1)})
    return dome(lunes, courses, ratio, oculus=oculus, friction=FRICTION, live=live)


def stands(scene: Scene) -> bool:
    """Whether the dome carries its own weight, proved either way.

    It does if it carries something on its crown: not only under lift, as the lifted crown's
    factor, asked for too, is positive as well.
    """
    down = scene.live.forces
    up = {block: (0.0, 0.0, -force[2], 0.0, 0.0, 0.0) for block, force in down.items()}
    for loaded in (scene, scene.with_live(Load(forces=up))):
        solution = solve(loaded)
        if solution.status is Status.DEAD_LOAD_UNSTABLE:
            return False
        if solution.status is not Status.CERTIFIED or not solution.lower > 0.0:
            raise ModelError(f"{scene.name}: neither standing nor falling is proved: {solution}")
    return True
