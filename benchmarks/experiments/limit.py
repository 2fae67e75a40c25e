"""How far the solver is from the least it could take.

Panels with two returns, asked for 1e-6. The least is one factorisation for every iteration of a
good start: as many as the same panel takes with friction 1 % higher, from a point on the way to the
first answer. CPU seconds of the solver alone, one run each; ``--picture FILE`` draws them.
"""

from __future__ import annotations

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
from threadpoolctl import threadpool_limits

from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.experiments.engine import arrays
from benchmarks.scenes import panel_of
from cvxlimit.solvers.extensions import BATCH
from cvxlimit.solvers.interior.elimination import NewtonSystem

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

    @property
    def cells(self) -> tuple[object, ...]:
        """Of its row in the table."""
        seconds, all_, least = self.drawn
        return (
            f"{self.contacts:,}", f"{seconds:.2f}", self.cold, f"{self.factorisation:.3f}",
            f"{all_ / seconds:.0%}", self.warm, f"{least:.2f}", f"{seconds / least:.1f}",
        )  # fmt: skip


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
    scene, way = panel_of(size), "NumPy" if BATCH is None else "compiled"
    program = arrays(scene, "conic", way)()
    start = process_time()
    with factorisations() as spent:
        found = program.minimise(TOLERANCE, 200)
    seconds = process_time() - start
    stiffer = scene.with_joints(friction=1.01 * float(scene.contacts.friction.max()))
    warm = arrays(stiffer, "conic", way)().minimise(TOLERANCE, 200, [found.middle])
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


@experiment(Part(4, "--picture docs/evidence/limit.png"))
def limit(sizes: Sequence[int] = SIZES, picture: Path | None = None) -> Lines:
    """How far the solver is from the least it could take, on panels of so many contacts."""
    yield Head("contacts", "solver, s", "iterations", "one factorisation, s", "their share",
               "iterations, good start", "least, s", "solver over least")  # fmt: skip
    rows = []
    with threadpool_limits(1):
        for size in sizes:
            rows.append(measured(size))
            yield rows[-1].cells
    if picture is not None:
        drawn(rows).savefig(picture, dpi=150)
