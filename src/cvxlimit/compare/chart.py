"""Time against true error, with the Pareto front: Matplotlib, imported when it is used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from cvxlimit.compare.models import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OWN = "cvxlimit"
"""Lines whose names begin like this are drawn larger: the package's default."""

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
            truth = "no interaction" if row.interaction == "none" else f"{row.moments} moments"
            groups.setdefault(truth, []).append(row)
    return groups


def _front(alike: Sequence[Row]) -> list[Row]:
    return [alike[i] for i in pareto_front([_point(row) for row in alike])]


def _point(row: Row) -> tuple[float, float]:
    return row.total or 0.0, max(row.error or 0.0, row.floor, LEAST)


def draw_time_against_error(
    axes: Axes, rows: Sequence[Row], title: str = "", styles: Mapping[str, int] | None = None
) -> None:
    """One line per method family, the Pareto front shaded behind them, into ``axes``.

    ``styles`` numbers the lines' markers and colours, for several plots with one legend.
    """
    groups = _by_truth(rows)
    lines: dict[str, list[Row]] = {}
    for row in rows:
        if row.has_point:
            lines.setdefault(row.line, []).append(row)
    for order, (label, members) in enumerate(lines.items()):
        own = label.startswith(OWN)
        axes.plot(
            *zip(*map(_point, members), strict=True),
            **style(order if styles is None else styles[label], label),
            markersize=10 if own else 6,
            markeredgecolor="black" if own else "white",
            markeredgewidth=0.8,
            linewidth=1.2,
            label=label,
            zorder=4 if own else 3,
        )
    colours = cycle(("#4aa3a8", "#c77dba", "#c9a227"))
    for colour, (truth, group) in zip(colours, groups.items(), strict=False):
        of_which = f", {truth}" if len(groups) > 1 else ""
        axes.step(
            *zip(*map(_point, _front(group)), strict=True), where="post", color=colour,
            linewidth=6, alpha=0.35, label=f"Pareto front{of_which}", zorder=1,
        )  # fmt: skip
        if (floor := max(row.floor for row in group)) > LEAST:
            axes.axhline(
                floor, color=colour if of_which else "#888888", linestyle=":", linewidth=1.0,
                zorder=1, label=f"resolution of the reference{of_which}",
            )  # fmt: skip
    axes.set(xscale="log", yscale="log", title=title)
    axes.set_xlabel("total time, seconds (detection, compile, solve, certificate)")
    axes.set_ylabel("true relative error of the load factor")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(sparse)
    axes.grid(True, which="major", color="#d9d9d9", linewidth=0.6)
    axes.set_axisbelow(True)


def style(number: int, label: str) -> dict[str, Any]:
    others = (
        "#d62246", "#2a9d5c", "#f59e0b", "#8b2fc9", "#12a4b4", "#7a5230", "#e36fb0", "#6b7280",
        "#9aad00", "#3b5bdb", "#b45309",
    )  # fmt: skip
    colour = "#134b73" if label.startswith(OWN) else others[number % len(others)]
    return {"marker": "os^Dv<>phXPd8"[number % 13], "color": colour}


def sparse(value: float, position: float | None = None) -> str:
    digit = round(value / 10.0 ** np.floor(np.log10(value)))
    return f"{value:g}" if digit in (2, 5) else ""
