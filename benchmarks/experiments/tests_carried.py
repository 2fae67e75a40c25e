"""Load factors beside what two panels of the paper carried in the test.

The layouts are inferred from the paper's counts of blocks and contacts. No measured load chooses a
setting: every method is asked as it is by default, but that there is one search without dilatancy,
where more would find a state that is a little lower.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from benchmarks.charts import LETTERS, figure_of, save
from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.experiments.interaction import PAPER
from benchmarks.scenes import scene_of
from cvxlimit import Certified, Incremental, Solution, ZeroDilatancy, solve
from cvxlimit.plotting.style import Style

FIRST: dict[str, tuple[float, float | None]] = {
    "s12-panel": (0.186, None),
    "s10-panel": (0.262, 23.0),
}
"""The paper's first iterate, and the minutes that it took; those of S12 are not in the text."""

COMPUTED = {
    "octagon": lambda scene: solve(scene, "octagon"),
    "cone": solve,
    "interaction, certified": lambda scene: solve(scene, method=Certified()),
    "lowest found without dilatancy": lambda scene: solve(scene, method=ZeroDilatancy(searches=1)),
    "from rest": lambda scene: solve(scene, method=Incremental()),
}
"""What is asked of a scene, by its name in the table."""


@dataclass(frozen=True)
class Beside:
    """A load factor beside a measured one, and what it took."""

    what: str
    load_factor: float | None
    test: float
    seconds: float | None
    about: str = ""

    @property
    def error(self) -> float | None:
        """How far above what was carried, in per cent; negative on the safe side."""
        return None if self.load_factor is None else 100.0 * (self.load_factor / self.test - 1.0)


@experiment(Part(15, "--docs docs/figures"), name="tests")
def carried(
    scenes: tuple[str, ...] = tuple(FIRST), kinds: tuple[str, ...] = tuple(COMPUTED),
    docs: Path | None = None,
) -> Lines:  # fmt: skip
    """Time against error, measured by what the panels of the paper carried in the test."""
    solve(scene_of("single-block"))  # what is loaded once
    found: dict[str, list[Beside]] = {}
    yield Head("panel, test", "what", "load factor", "over the test", "CPU time", "it says")
    for name in scenes:
        title, _, test, _ = PAPER[name]
        for number, row in enumerate(rows_of(name, kinds)):
            found.setdefault(name, []).append(row)
            factor = "-" if row.load_factor is None else f"{row.load_factor:.4f}"
            apart = "-" if row.error is None else f"{row.error:+.0f} %"
            yield (f"{title.split()[0]}, {test:.3f}" if number == 0 else "", row.what, factor,
                   apart, _took(row.seconds), row.about)  # fmt: skip
    if docs is not None:
        save(chart(found), docs / "tests.png")


def rows_of(name: str, kinds: tuple[str, ...]) -> Iterator[Beside]:
    """What the paper printed, and what is computed here."""
    _, last, test, minutes = PAPER[name]
    first, early = FIRST[name]
    assert test is not None
    yield Beside("paper, first iterate", first, test, None if early is None else 60.0 * early)
    yield Beside("paper, last iterate", last, test, 60.0 * minutes)
    for what in kinds:
        scene = scene_of(name)
        start = process_time()
        solution = COMPUTED[what](scene)
        seconds = process_time() - start
        yield Beside(what, solution.load_factor, test, seconds, _said(solution))


def _said(solution: Solution) -> str:
    """How the answer stands, and the bracket that holds it where there is a number."""
    status, way = str(solution.status), solution.from_rest
    if way is not None:
        return f"{status}, {way.end}" + (f"; spread {way.spread_text}" if way.spread_text else "")
    if not solution.bracket.has_both:
        return f"{status}, proved to be at most {solution.upper:.4f}"
    return f"{status}, [{solution.lower:.4f}, {solution.upper:.4f}]"


def _took(seconds: float | None) -> str:
    if seconds is None:
        return "not in the text"
    return f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds / 60.0:.1f} min"


MARKS = {
    "paper, first iterate": ("o", Style.thin, 8),
    "paper, last iterate": ("o", Style.violet, 8),
    "octagon": ("s", Style.amber, 8),
    "cone": ("D", Style.blue, -18),
    "interaction, certified": ("P", Style.teal, -18),
    "lowest found without dilatancy": ("v", Style.brown, 8),
    "from rest": ("*", Style.red, -20),
}
"""Mark and colour of each, and how many points above it its error is written."""


def chart(found: dict[str, list[Beside]]) -> Figure:
    """A plot for each panel, with the test as its line of no error."""
    figure = figure_of(3.9)
    plots = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    shown: dict[str, Any] = {}
    for axes, (name, rows) in zip(plots, found.items(), strict=True):
        axes.axhline(0.0, color="black", linewidth=1.2)
        for row in rows:
            if row.error is None or row.seconds is None:
                continue
            mark, colour, above = MARKS[row.what]
            is_paper = row.what.startswith("paper")
            shown[row.what] = axes.scatter(
                row.seconds, row.error, marker=mark, s=70 if mark != "*" else 170, zorder=3,
                facecolor="white" if is_paper else colour, edgecolor=colour, linewidth=1.5,
            )  # fmt: skip
            axes.annotate(f"{row.error:+.0f} %", (row.seconds, row.error), (0, above), ha="center",
                          textcoords="offset points", fontsize=LETTERS)  # fmt: skip
        axes.set(xscale="log", xlim=(0.015, 3e4), xlabel="time, s")
        axes.set_title(f"{PAPER[name][0].split()[0]}: the test carried {rows[0].test:.3f}",
                       fontsize=LETTERS + 1, loc="left")  # fmt: skip
        axes.tick_params(labelsize=LETTERS)
        axes.xaxis.label.set_size(LETTERS)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,g}"))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:+.0f} %" if y else "0"))
        axes.grid(True, color="#d9d9d9", linewidth=0.6)
        axes.margins(y=0.18)
    plots[0].set_ylabel("load factor over the test's", fontsize=LETTERS)
    names = [what for what in MARKS if what in shown]
    figure.legend([shown[what] for what in names], names, loc="outside upper center", ncols=4,
                  fontsize=LETTERS, frameon=False, handlelength=1.0)  # fmt: skip
    return figure
