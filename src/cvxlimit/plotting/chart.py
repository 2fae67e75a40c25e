"""What all charts share: axes, sizes of letters, title, legend or names beside lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from cvxlimit.base.arrays import FloatArray
from cvxlimit.plotting.drawing import SceneFigure
from cvxlimit.plotting.sheet import KEYS, PAPER, Letters, Sheet, columns_of, lines_of, measured


@dataclass(frozen=True, eq=False)
class Chart:
    """Axes to draw into, those of the caller or in a figure of its own, and what it says of it."""

    figure: Any
    axes: Any
    sheet: Any

    @classmethod
    def of(
        cls, options: Mapping[str, Any], usual: tuple[float, float], projection: str | None = None
    ) -> Chart:
        """``options`` are those of :func:`cvxlimit.plotting.picture`, ``usual`` the inches of a
        figure that nobody gave a size."""
        sheet = Sheet(**options)
        if sheet.ax is not None:
            return cls(sheet.ax.get_figure(root=True), sheet.ax, sheet)
        figure = SceneFigure(figsize=sheet.size or usual, layout="constrained")
        return cls(figure, figure.add_subplot(projection=projection), sheet)

    @property
    def width(self) -> float:
        """Inches across the figure, or the axes if they are the caller's."""
        if self.sheet.ax is None:
            return float(self.figure.get_figwidth())
        return float(self.axes.get_window_extent().width / self.figure.dpi)

    def size(self, what: str) -> float:
        """Points of letters, such as those of ``"axes.labelsize"``, by Matplotlib's settings; in a
        narrow figure of one's own smaller, as those of all pictures."""
        letters = Letters(7.0 if self.sheet.ax is not None else self.width)
        return float(letters.setting(what))

    def write(self, title: str) -> None:
        """Title and sizes of letters."""
        title = title if self.sheet.title is None else self.sheet.title
        size = self.size("axes.titlesize")
        lines = lines_of(title, size, 0.8 * self.width)
        self.axes.set_title("\n".join(lines), fontsize=size, parse_math=False)
        for name in ("x", "y", "z"):
            if (axis := getattr(self.axes, f"{name}axis", None)) is not None:
                axis.label.set_size(self.size("axes.labelsize"))
                ticks = "ytick.labelsize" if name == "y" else "xtick.labelsize"
                axis.set_tick_params(labelsize=self.size(ticks))

    def write_legend(self) -> None:
        """Below what is drawn, or inside the caller's axes."""
        handles, labels = self.axes.get_legend_handles_labels()
        if not (self.sheet.legend and labels):
            return
        size = self.size("legend.fontsize")
        if self.sheet.ax is not None:  # with Matplotlib's own distance from their frame
            self.axes.legend(handles, labels, fontsize=size, frameon=False)
            return
        columns = columns_of(labels, size, self.width)
        self.figure.legend(
            handles, labels, loc="outside lower center", ncols=columns, fontsize=size, **KEYS
        )

    def name_lines(self) -> None:
        """Every line's name beside it, or below where a narrow figure has no room for that."""
        labels = self.axes.get_legend_handles_labels()[1]
        size = self.size("legend.fontsize")
        widest = max((measured(label, size) for label in labels), default=0.0)
        height = 1.45 * size * PAPER.point * len(labels)
        fits = widest <= 0.3 * self.width and height <= self.figure.get_figheight()
        if self.sheet.ax is None and not fits:
            self.write_legend()
        elif self.sheet.legend:
            self.figure.draw_without_rendering()  # names stand where the layout leaves the lines
            label_lines(self.axes, size)


def label_lines(axes: Axes, letters: float) -> None:
    """Every line's name beside it in its colour, in place of a legend: in a column on the right, no
    two over each other where the height allows it, with a hairline to the line's last point;
    ``letters`` are points. Call it when all is drawn and the limits are final."""
    figure: Any = axes.get_figure(root=True)
    named = [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")]
    seen = [line.get_transform().transform(line.get_xydata())[-1] for line in named]
    ends = axes.transData.inverted().transform(np.array(seen).reshape(-1, 2))
    shown = axes.transAxes.inverted().transform(np.array(seen).reshape(-1, 2))
    each = 1.25 * letters * PAPER.point / (axes.get_position().height * figure.get_figheight())
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
