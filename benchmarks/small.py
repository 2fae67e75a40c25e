"""``python -m benchmarks.small``: built-in scenes beside a plain cone program of eight lines.

What a user would write with CVXPY: Eq. 7, 9 and 24 for all contacts at once, its default solver,
and no proof. CPU milliseconds of one process with everything imported, from known contacts, medians
in turns; ours include the certificate.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from statistics import median
from time import process_time

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from benchmarks.baselines import M1, M2, MT, V1, V2, N, program
from cvxlimit import Scene, builtin_scene, solve
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.masonry import BUILTIN


def plain(scene: Scene) -> float:
    """The load factor of the eight lines."""
    data, contacts = program(scene), scene.contacts
    x, alpha = cp.Variable((len(contacts), 6)), cp.Variable()
    forces = cp.vec(x, order="C")
    equilibrium = data.equilibrium @ forces + data.dead + alpha * data.live == 0
    torsion = cp.multiply(1 / contacts.torsion_arm, cp.abs(x[:, MT]))
    sliding = cp.norm(x[:, [V1, V2]], axis=1) + torsion <= cp.multiply(contacts.friction, x[:, N])
    problem = cp.Problem(cp.Maximize(alpha), [equilibrium, edges(contacts) @ forces <= 0, sliding])
    return float(problem.solve())


def edges(contacts: Contacts) -> sp.csr_array:
    """Eq. 9 for any polygon: the pressure centre (-M2, M1) / N is inside every edge."""
    contact = contacts.corner_contact
    corner = np.arange(len(contact))
    last = corner + 1 == contacts.corner_start[contact + 1]
    after = np.where(last, contacts.corner_start[contact], corner + 1)
    (x, y), (dx, dy) = contacts.corner_xy.T, (contacts.corner_xy[after] - contacts.corner_xy).T
    values = np.concatenate([dx * y - dy * x, -dx, -dy])
    columns = np.concatenate([6 * contact + component for component in (N, M1, M2)])
    shape = (len(contact), 6 * len(contacts))
    return sp.csr_array((values, (np.tile(corner, 3), columns)), shape=shape)


def main(arguments: Sequence[str] | None = None) -> None:
    """One row per scene."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.small", description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=list(BUILTIN))
    parser.add_argument("--repeat", type=int, default=5)
    asked = parser.parse_args(arguments)
    say("scene", "contacts", "eight lines, ms", "cvxlimit, ms", "ratio", "compile", "solver",
        "certificate", "eight lines off by", "bracket")  # fmt: skip
    say(*["---"] * 10)
    for name in asked.scenes:
        say(*row(name, asked.repeat))


def say(*cells: object) -> None:
    """A line of a table, at once."""
    sys.stdout.write(f"| {' | '.join(map(str, cells))} |\n")
    sys.stdout.flush()


def row(name: str, repeat: int) -> tuple[object, ...]:
    """Medians of a scene, after one run of each to warm up."""
    theirs, ours, phases = [], [], []
    for _ in range(repeat + 1):
        scene = builtin_scene(name)
        start = process_time() if len(scene.contacts) else 0.0
        factor = plain(scene)
        middle = process_time()
        solution = solve(scene)
        ours.append(process_time() - middle)
        theirs.append(middle - start)
        phases.append(solution.seconds)
    spent = [1e3 * median(seconds[1:]) for seconds in (theirs, ours)]
    parts = [1e3 * median(p.get(k, 0.0) for p in phases[1:]) for k in PHASES]
    off = abs(factor / solution.load_factor - 1.0)
    return (
        name, f"{len(scene.contacts):,}", *(f"{t:.0f}" for t in spent),
        f"{spent[1] / spent[0]:.2f}", *(f"{t:.0f}" for t in parts), f"{off:.0e}",
        f"{solution.gap:.0e}",
    )  # fmt: skip


PHASES = ("compile", "solve", "certify")

if __name__ == "__main__":
    main()
