"""What charts share, and time against error."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import wrap

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cvxlimit.base.files import write_file
from cvxlimit.extensions.compare.chart import draw_time_against_error, few_ticks
from cvxlimit.extensions.compare.models import Row
from cvxlimit.plotting.chart import label_lines

__all__ = ["few_ticks", "figure_of", "name_lines", "save", "stacked", "top_legend"]

WIDTH, DPI, LETTERS = 7.7, 190, 9.0
"""Inches in which a page shows a chart, pixels of each, and points of its smallest letters."""

COLOURS = ("#134b73", "#4aa3a8", "#c77f00", "#d62246", "#5b8c2a", "#7c3aed", "#7a1010", "#9aa0ab")


def figure_of(height: float) -> Figure:
    """As wide as a page, so many inches high."""
    return Figure(figsize=(WIDTH, height), layout="constrained")


def stacked(number: int, height: float) -> tuple[Figure, Sequence[Axes]]:
    """So many plots, one above the other."""
    figure = figure_of(0.5 + height * number)
    return figure, figure.subplots(number, 1, squeeze=False)[:, 0]


def name_lines(figure: Figure, plots: Iterable[Axes]) -> None:
    """Names on the right of all plots' lines, for which the layout makes room."""
    for axes in plots:
        axes.tick_params(labelsize=LETTERS)
        axes.xaxis.label.set_size(LETTERS)
        axes.yaxis.label.set_size(LETTERS)
        axes.grid(True, color="#d9d9d9", linewidth=0.6)
    figure.draw_without_rendering()
    for axes in plots:
        label_lines(axes, LETTERS)


def top_legend(figure: Figure, axes: Axes, columns: int) -> None:
    """What the labels of one plot mean, above all plots."""
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=columns,
                  fontsize=LETTERS, frameon=False, handlelength=1.0)  # fmt: skip


def save(figure: Figure, path: Path) -> str:
    """Write a picture, whole or not at all, and return its path."""
    picture = io.BytesIO()
    FigureCanvasAgg(figure).print_figure(picture, dpi=DPI, format="png")
    write_file(path, picture.getvalue())
    return str(path)


CHARTED = (
    "cvxlimit", "cvxlimit, octagon", "cone, Clarabel", "cone, QOCO", "cone, SCS",
    "cone, blockwise own Cholesky", "facets, circumscribed, Clarabel",
    "facets, inscribed, Clarabel", "literal transcription, octagon", "literal transcription, cone",
    "literal, cone, N and mm", "literal, octagon, N and mm",
)  # fmt: skip
"""Lines of a chart of time against error, where there are more than a reader can tell apart."""


def time_against_error(rows: Sequence[Row], about: str) -> Figure:
    """Every line named beside it, with the small print below."""
    failed = sum(row.failed for row in rows)
    if len({row.line for row in rows if row.has_point}) > len(CHARTED):
        rows = [row for row in rows if row.line in CHARTED]
    figure = figure_of(4.3)
    axes = figure.subplots()
    draw_time_against_error(axes, rows)
    note = f"; {failed} methods failed" if failed else ""
    title = f"{rows[0].scene}, {rows[0].contacts:,} contacts: time against true error{note}"
    axes.set_title(title, fontsize=LETTERS + 1, loc="left")
    name_lines(figure, [axes])
    figure.supxlabel("\n".join(wrap(about, 105)), fontsize=LETTERS, color="#555")
    return figure
