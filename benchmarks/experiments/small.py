"""Built-in scenes beside a plain cone program of eight lines.

What a user would write with CVXPY: Eq. 7, 9 and 24 for all contacts at once, its default solver,
and no proof. CPU milliseconds of one process with everything imported, from known contacts, medians
in turns; ours include the certificate.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from time import process_time

from benchmarks.baselines import eight_lines, program
from benchmarks.experiment import Head, Lines, Part, experiment
from cvxlimit import builtin_scene, solve
from cvxlimit.masonry import BUILTIN


@experiment(Part(1))
def small(scenes: Sequence[str] = tuple(BUILTIN), repeat: int = 5) -> Lines:
    """Built-in scenes, ours beside eight lines of CVXPY."""
    yield Head("scene", "contacts", "eight lines, ms", "cvxlimit, ms", "ratio",
               "eight lines off by", "bracket")  # fmt: skip
    for name in scenes:
        yield row(name, repeat)


def row(name: str, repeat: int) -> tuple[object, ...]:
    """Medians of a scene, after one run of each to warm up."""
    theirs, ours = [], []
    for _ in range(repeat + 1):
        scene = builtin_scene(name)
        start = process_time() if len(scene.contacts) else 0.0
        factor = float(eight_lines(program(scene), scene.contacts.torsion_arm).solve())
        middle = process_time()
        solution = solve(scene)
        ours.append(process_time() - middle)
        theirs.append(middle - start)
    spent = [1e3 * median(seconds[1:]) for seconds in (theirs, ours)]
    off = abs(factor / solution.load_factor - 1.0)
    return (
        name, f"{len(scene.contacts):,}", *(f"{t:.0f}" for t in spent),
        f"{spent[1] / spent[0]:.2f}", f"{off:.0e}", f"{solution.gap:.0e}",
    )  # fmt: skip
