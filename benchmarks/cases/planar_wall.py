"""A wall in running bond, twice as many courses as units, pushed in its plane."""

from math import sqrt

from benchmarks.cases import Case
from cvxlimit.masonry import running_bond, wall
from cvxlimit.scene import Scene


def build(contacts: int) -> Scene:
    """About ``contacts`` contacts: three per block."""
    units = max(2, round(sqrt(contacts / 6)))
    name = f"planar wall {units} x {2 * units}"
    return wall(running_bond(units, 2 * units), friction=0.65, name=name)


CASE = Case("planar-wall", "planar walls", build)
