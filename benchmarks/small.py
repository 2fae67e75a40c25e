"""Certified default solves of all built-in scenes beside the plain cone of eight lines of CVXPY.

    .venv/bin/python -m benchmarks.small [--repeat 5] [SCENE ...]

Warm process, contacts known, CPU milliseconds, medians, the two in turns. The plain cone is what
anyone writes first, on arrays: it certifies nothing, and knows no planar or symmetric scenes.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from statistics import median

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from benchmarks.baselines import M1, M2, MT, N, program
from cvxlimit import Scene, builtin_scene, solve
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.masonry.builtin import BUILTIN


def plain_cone(scene: Scene) -> float:
    """Load factor of Eq. 7, 9 and 24 as plain vectorised CVXPY, default solver and settings."""
    data, contacts = program(scene), scene.contacts
    x, alpha = cp.Variable((len(contacts), 6)), cp.Variable()
    force = cp.vec(x, order="C")
    twist = cp.multiply(1 / contacts.torsion_arm, cp.abs(x[:, MT]))
    strength = cp.multiply(contacts.friction, x[:, N])
    balance = data.equilibrium @ force + data.dead + alpha * data.live == 0
    limits = [edges(contacts) @ force <= 0, cp.norm(x[:, :2], axis=1) + twist <= strength]
    problem = cp.Problem(cp.Maximize(alpha), [balance, *limits])
    problem.solve()
    return float(problem.value)


def edges(contacts: Contacts) -> sp.csr_array:
    """Rocking, one row per edge: the pressure centre is on the inner side of each."""
    j, first = contacts.corner_contact, np.arange(len(contacts.corner_contact))
    is_last = np.append(j[1:] != j[:-1], True)
    after = np.where(is_last, contacts.corner_start[j], first + 1)
    (x, y), (dx, dy) = contacts.corner_xy.T, (contacts.corner_xy[after] - contacts.corner_xy).T
    columns = np.concatenate([6 * j + N, 6 * j + M1, 6 * j + M2])
    values = np.concatenate([dx * y - dy * x, -dx, -dy])
    shape = len(j), 6 * len(contacts)
    return sp.csr_array((values, (np.tile(first, 3), columns)), shape=shape)


def milliseconds(run: Callable[[], object]) -> tuple[float, object]:
    """CPU time of one run, and what came out."""
    start = time.process_time()
    found = run()
    return 1e3 * (time.process_time() - start), found


def main() -> None:
    """Print a line per scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=list(BUILTIN))
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    for name in options.scenes:
        took: dict[str, list[float]] = {"plain": [], "own": []}
        for _ in range(options.repeat + 1):
            scene = builtin_scene(name)
            size = len(scene.contacts)
            spent, factor = milliseconds(lambda s=scene: plain_cone(s))  # type: ignore[misc]
            took["plain"].append(spent)
            spent, found = milliseconds(lambda s=scene: solve(s))  # type: ignore[misc]
            took["own"].append(spent)
        plain, own = (median(times[1:]) for times in took.values())  # the first warms up
        sys.stdout.write(
            f"{name:17} {size:5} contacts: plain {plain:7.1f} ms, certified {own:7.1f} ms, "
            f"{plain / own:4.1f} times; {factor:.6f}, {found}\n"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    main()
