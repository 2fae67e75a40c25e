"""``python -m benchmarks.limit``: how far the solver is from the least it could take.

Panels with two returns, asked for 1e-6. The least is one factorisation for every iteration of a
good start: as many as the same panel takes with friction 1 % higher, from a point on the way to the
first answer. CPU seconds of the solver alone, one run each; ``--picture FILE`` draws them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any
from unittest.mock import patch

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich.console import Console
from threadpoolctl import threadpool_limits

from benchmarks.cases.panel import build
from benchmarks.engine import arrays
from cvxlimit.solvers.extensions import BATCH
from cvxlimit.solvers.interior.elimination import NewtonSystem

console = Console(highlight=False, soft_wrap=True)

SIZES = (500, 1_900, 5_000, 9_000, 16_500, 50_000)
TOLERANCE = 1e-6
LINES = {
    "solver": "#134b73",
    "all its factorisations": "#4aa3a8",
    "one for every iteration of a good start": "#c77f00",
}


@dataclass(frozen=True)
class Row:
    """One panel: seconds of its solver, of one factorisation, and iterations cold and warm."""

    contacts: int
    seconds: float
    factorisation: float
    cold: int
    warm: int

    @property
    def drawn(self) -> tuple[float, float, float]:
        """Seconds of the lines in their order."""
        return self.seconds, self.cold * self.factorisation, self.warm * self.factorisation

    def __str__(self) -> str:
        seconds, all_, least = self.drawn
        return (
            f"| {self.contacts:,} | {seconds:.2f} | {self.cold} | {self.factorisation:.3f} "
            f"| {all_ / seconds:.0%} | {self.warm} | {least:.2f} | {seconds / least:.1f} |"
        )


@contextmanager
def factorisations() -> Iterator[list[float]]:
    """CPU seconds of every factorisation from here on."""
    spent: list[float] = []
    plain = NewtonSystem.factorise

    def timed(self: NewtonSystem, *given: Any) -> None:
        start = process_time()
        plain(self, *given)
        spent.append(process_time() - start)

    with patch.object(NewtonSystem, "factorise", timed):
        yield spent


def measured(size: int) -> Row:
    """One panel of about so many contacts."""
    scene, way = build(size), "NumPy" if BATCH is None else "compiled"
    program = arrays(scene, "conic", way)()
    start = process_time()
    with factorisations() as spent:
        found = program.minimise(TOLERANCE, 200)
    seconds = process_time() - start
    stiffer = scene.with_joints(friction=1.01 * float(scene.contacts.friction.max()))
    warm = arrays(stiffer, "conic", way)().minimise(TOLERANCE, 200, found.middle)
    number = len(scene.contacts)
    return Row(number, seconds, median(spent), found.iterations, warm.iterations)


def drawn(rows: Sequence[Row]) -> Figure:
    """Seconds against contacts."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", xlabel="contacts", ylabel="CPU seconds")
    for number, (name, colour) in enumerate(LINES.items()):
        values = [row.drawn[number] for row in rows]
        axes.plot([row.contacts for row in rows], values, "o-", color=colour, label=name)
    axes.legend(frameon=False)
    return figure


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print a table, and draw it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.limit", description=__doc__)
    parser.add_argument("sizes", nargs="*", type=int, default=SIZES, help="contacts, about")
    parser.add_argument("--picture", type=Path)
    asked = parser.parse_args(arguments)
    head = "contacts | solver, s | iterations | one factorisation, s | their share | "
    console.print(f"| {head}iterations, good start | least, s | solver over least |")
    console.print("| --- |" + " --- |" * 7)
    rows = []
    with threadpool_limits(1):
        for size in asked.sizes:
            rows.append(measured(size))
            console.print(str(rows[-1]))
    if asked.picture is not None:
        drawn(rows).savefig(asked.picture, dpi=150)


if __name__ == "__main__":
    main()
