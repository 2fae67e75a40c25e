"""What charts share, and time against error."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.files import write_file
from cvxlimit.extensions.studies.chart import draw_time_against_error, few_ticks
from cvxlimit.extensions.studies.models import Row

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


def label_lines(axes: Axes, letters: float) -> None:
    """Every line's name beside it in its colour, in place of a legend: in a column on the right, no
    two over each other where the height allows it, with a hairline to the line's last point;
    ``letters`` are points. Call it when all is drawn and the limits are final."""
    figure: Any = axes.get_figure(root=True)
    named = [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")]
    seen = [line.get_transform().transform(line.get_xydata())[-1] for line in named]
    ends = axes.transData.inverted().transform(np.array(seen).reshape(-1, 2))
    shown = axes.transAxes.inverted().transform(np.array(seen).reshape(-1, 2))
    each = 1.25 * letters / 72.0 / (axes.get_position().height * figure.get_figheight())
    place = spread(shown[:, 1], min(each, 1.0 / max(len(named), 1)))
    for line, (x, y), at in zip(named, ends.tolist(), place.tolist(), strict=True):
        axes.annotate(
            str(line.get_label()), (x, y), (1.02, at), textcoords="axes fraction",
            color=line.get_color(), fontsize=letters, va="center", annotation_clip=False,
            parse_math=False, arrowprops={
                "arrowstyle": "-", "color": line.get_color(), "lw": 0.5, "alpha": 0.6,
                "shrinkA": 1, "shrinkB": 3, "relpos": (0, 0.5),
            },
        )  # fmt: skip


def spread(wanted: FloatArray, each: float) -> FloatArray:
    """Heights near those wanted, at least ``each`` apart, in their order and from 0 to 1."""
    order = np.argsort(wanted, kind="stable")
    result = np.clip(wanted, 0.0, 1.0)
    for one, other in pairwise(order):
        result[other] = max(result[other], result[one] + each)
    over = 1.0
    for k in order[::-1]:
        result[k] = min(result[k], over)
        over = result[k] - each
    return np.asarray(result)


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
