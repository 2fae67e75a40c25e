"""``python -m benchmarks.bands``: where the paper's fixed point goes, by solver, kernel, compiler.

A row per scene and reading (``--moments``), a column per solver: solves until the paper's criterion
(Eq. 43), the load factor then, and the band of the iterates. Every run is a process of its own,
with the compiled parts and without them (``--compiled yes no``), and under other kernels of BLAS
where ``--kernels`` names some. The last column has the range that all bands of the row share, or
how far the two farthest are apart.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from itertools import product

from rich.console import Console

from cvxlimit import builtin_scene, solve
from cvxlimit.masonry import BUILTIN
from cvxlimit.masonry.walls import random_wall
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.readings.named import MOMENTS
from cvxlimit.scene import Scene
from cvxlimit.solution import Iteration
from cvxlimit.solvers import installed

console = Console(highlight=False, soft_wrap=True)

SCENES = ("tuff-wall", "facade", "s12-panel", "s10-panel")
SOLVERS = {"BLOCKWISE": "our own", "CLARABEL": "Clarabel", "QOCO": "QOCO"}

SAME = 1e-6
"""Relative distance of bands that are one value but for what solvers leave of it."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print a table of Markdown."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bands", description=__doc__)
    parser.add_argument(
        "scenes", nargs="*", default=SCENES, help="built-in scenes, or random-wall-SEED"
    )
    parser.add_argument("--moments", nargs="+", default=["signed"], choices=MOMENTS)
    parser.add_argument("--solvers", nargs="+", default=[*SOLVERS], choices=SOLVERS)
    parser.add_argument("--compiled", nargs="+", default=["yes", "no"], choices=("yes", "no"))
    parser.add_argument("--kernels", nargs="+", default=[""], help="of OpenBLAS: Haswell, Zen ...")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    unknown = [n for n in options.scenes if n not in BUILTIN and not n.startswith("random-wall-")]
    if unknown:
        parser.error(f"there is no scene {unknown[0]!r}")
    if options.one:
        name, moments, solver = options.scenes[0], options.moments[0], options.solvers[0]
        console.print(json.dumps(vars(measured(name, moments, solver))))
        return
    solvers = [name for name in options.solvers if name in installed() or name == "BLOCKWISE"]
    choices = [*product(solvers, options.compiled, options.kernels)]
    heads = ["scene, moments", *(headed(*choice) for choice in choices), "overlap"]
    console.print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for name, moments in product(options.scenes, options.moments):
        found = [apart(name, moments, *choice) for choice in choices]
        cells = [f"{name}, {moments}", *map(told, found), overlap(found)]
        console.print(f"| {' | '.join(cells)} |")


def headed(solver: str, compiled: str, kernel: str) -> str:
    """A column's head."""
    without = "" if compiled == "yes" else ", nothing compiled"
    return SOLVERS[solver] + without + (f", {kernel}" if kernel else "")


def measured(name: str, moments: str, solver: str) -> Iteration:
    """Where the fixed point goes on a scene, by default settings."""
    found = solve(scene_of(name), "conic", FixedPoint(moments=moments), ladder=[solver]).iteration
    assert found is not None
    return found


def scene_of(name: str) -> Scene:
    """A built-in scene, or ``random-wall-SEED``."""
    if name in BUILTIN:
        return builtin_scene(name)
    return random_wall(int(name.rsplit("-", 1)[1]))


def apart(name: str, moments: str, solver: str, compiled: str, kernel: str = "") -> Iteration:
    """The same in a process of its own, whose compiled parts and kernel are chosen at its start."""
    command = [sys.executable, "-m", "benchmarks.bands", name, "--one"]
    command += ["--moments", moments, "--solvers", solver]
    own = {"CVXLIMIT_COMPILED": compiled} | ({"OPENBLAS_CORETYPE": kernel} if kernel else {})
    done = subprocess.run(
        command, env={**os.environ, **own}, check=True, capture_output=True, text=True
    )
    return Iteration(**json.loads(done.stdout))


def told(found: Iteration) -> str:
    """Solves until the criterion, the load factor then, and the band."""
    met = "" if found.met_at is None else f"{found.met_at:.4f} after {found.met_after}; "
    return f"{met}{found.lowest:.4f} to {found.highest:.4f}"


def overlap(found: Sequence[Iteration]) -> str:
    """What all bands have in common, or how far the two farthest are apart."""
    low, high = max(each.lowest for each in found), min(each.highest for each in found)
    apart = (low - high) / abs(low)
    if apart <= 0.0:
        return f"{low:.4f} to {high:.4f}"
    return f"{low:.4f}" if apart <= SAME else f"none, {100.0 * apart:.2g} % apart"


if __name__ == "__main__":
    main()
