"""Time against true error, with the Pareto front: Matplotlib, imported when it is used."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from cvxlimit.extensions.studies.models import OWN, Row
from cvxlimit.plotting.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

LEAST = 1e-12
"""Errors below this are drawn there: a logarithmic axis has no zero."""


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points that no other one beats in both coordinates, by the first one."""
    front: list[int] = []
    best = np.inf
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if points[i][1] < best:
            front.append(i)
            best = points[i][1]
    return front


def on_front(rows: Sequence[Row]) -> set[str]:
    """Names of the methods on the Pareto front; methods whose truths differ have their own."""
    return {row.method for group in _by_truth(rows).values() for row in _front(group)}


def _by_truth(rows: Sequence[Row]) -> dict[str, list[Row]]:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        if row.has_point:
            truth = f"{row.moments} moments" if row.moments else "no interaction"
            groups.setdefault(truth, []).append(row)
    return groups


def _front(alike: Sequence[Row]) -> list[Row]:
    return [alike[i] for i in pareto_front([_point(row) for row in alike])]


def _point(row: Row) -> tuple[float, float]:
    return row.total or 0.0, max(row.error or 0.0, row.floor, LEAST)


def draw_time_against_error(axes: Axes, rows: Sequence[Row]) -> None:
    """One line per family of models, the Pareto front of several shaded behind them."""
    groups = _by_truth(rows)
    lines: dict[str, list[Row]] = {}
    for row in rows:
        if row.has_point:
            lines.setdefault(row.line, []).append(row)
    for order, (label, members) in enumerate(lines.items()):
        own = label.startswith(OWN)
        axes.plot(
            *zip(*map(_point, members), strict=True),
            **style(order, label),
            markersize=10 if own else 6,
            markeredgecolor="black" if own else "white",
            markeredgewidth=0.8,
            linewidth=1.2,
            label=label,
            zorder=4 if own else 3,
        )
    colours = cycle(Style.fronts)
    for colour, (truth, group) in zip(colours, groups.items(), strict=False):
        of_which = f", {truth}" if len(groups) > 1 else ""
        front = list(_front(group))
        if len({row.line for row in front}) > 1:  # of a single model it is that model's line
            axes.step(
                *zip(*map(_point, front), strict=True), where="post", color=colour,
                linewidth=6, alpha=0.35, label=f"Pareto front{of_which}", zorder=1,
            )  # fmt: skip
        if (floor := max(row.floor for row in group)) > LEAST:
            axes.axhline(
                floor, color=colour if of_which else Style.axis, linestyle=":", linewidth=1.0,
                zorder=1, label=f"resolution of the reference{of_which}",
            )  # fmt: skip
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel("total time (s)")
    axes.set_ylabel("true relative error of the load factor")
    few_ticks(axes.xaxis)
    axes.grid(True, which="major", color=Style.grid, linewidth=0.6)
    axes.set_axisbelow(True)


def few_ticks(axis: Axis) -> None:
    """Labels at 1, 2 and 5 times powers of ten of a logarithmic axis, or at these powers where
    there is no room; closer where these are less than three."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    low, high = axis.get_view_interval()
    figure: Any = axis.get_figure(root=True)
    inches = axis.axes.get_window_extent().size / figure.dpi
    most = 1.6 * inches[0] if axis is axis.axes.xaxis else 3.0 * inches[1]

    def inside(locator: LogLocator | MaxNLocator) -> list[float]:
        return [float(v) for v in locator.tick_values(low, high) if low <= v <= high]

    for steps in ((1.0, 2.0, 5.0), (1.0, 3.0), (1.0,)):
        found = inside(LogLocator(subs=steps, numticks=1000))
        if len(found) <= most:
            break
    if len(found) < 3:
        found = inside(MaxNLocator(max(2, min(5, int(most)))))
    axis.set_ticks(found, [f"{value:,.6g}" for value in found])
    axis.set_ticks([], minor=True)


def style(number: int, label: str) -> dict[str, Any]:
    """Returns marker and colour of a line; those of ``OWN`` are blue, and no colour comes twice."""
    colours = Style.methods[number : number + 1] or (Style.other,)
    colour = Style.blue if label.startswith(OWN) else colours[0]
    return {"marker": "os^Dv<>phXPd8"[number % 13], "color": colour}
