"""The paper's tuff wall (5.1.1) at other sizes: held at one end, pushed out of its plane."""

from math import sqrt

from benchmarks.cases import Case
from cvxlimit.masonry import running_bond, wall
from cvxlimit.scene import Load, Scene


def build(contacts: int) -> Scene:
    """About ``contacts`` contacts: three per block. The paper's wall has 146."""
    units = max(2, round(sqrt(contacts / 9)))
    return wall(
        running_bond(units, 3 * units),
        unit=(0.1, 0.1, 0.05),
        density=12.1,
        friction=0.51,
        side_supports=("start",),
        live=Load(acceleration=(0.0, 1.0, 0.0)),
        name=f"propped wall {units} x {3 * units}",
    )


CASE = Case("propped-wall", "propped walls", build)
