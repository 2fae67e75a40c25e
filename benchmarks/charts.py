"""The charts, from the results alone: time against error, growth, where the time goes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from benchmarks.results import Record, fitted_exponent
from cvxlimit.compare.chart import (
    draw_time_against_error,
    sparse,
    style,
)
from cvxlimit.compare.models import PHASES

FIT_FROM = 400
"""Contacts from which growth is fitted: below, fixed costs hide it."""

DEFAULT = "cvxlimit/1e-6"
"""The method whose phases are shown."""

PHASE_COLOURS = dict(
    zip(PHASES, ("#9aad00", "#f59e0b", "#e36fb0", "#134b73", "#4aa3a8"), strict=True)
)


def draw_all(records: Sequence[Record], about: dict[str, Any], folder: Path) -> list[Path]:
    """All charts that the records allow, one set per family; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for family in dict.fromkeys(record.family for record in records):
        members = [record for record in records if record.family == family]
        for kind, figure in _figures(family, members):
            _sign(figure, about)
            path = folder / f"{kind}-{_slug(family)}.png"
            FigureCanvasAgg(figure).print_figure(path, dpi=120)
            written.append(path)
    return written


def _figures(family: str, records: Sequence[Record]) -> Iterator[tuple[str, Figure]]:
    if studied := _studied(records):
        yield "time-against-error", time_against_error(family, studied)
    if grown := _grown(records):
        yield "growth", growth(family, grown)
        yield "phases", phases(family, grown)


def _slug(family: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", family.lower()).strip("-")


def _sign(figure: Figure, about: dict[str, Any]) -> None:
    """Machine and versions in small print at the bottom."""
    machine, versions = about.get("machine", {}), about.get("versions", {})
    names = ("cvxlimit", "cvxpy", "clarabel", "python")
    text = f"{machine.get('cpu', '')}, one thread per run; " + ", ".join(
        f"{name} {versions.get(name, '?')}" for name in names
    )
    repeat = about.get("options", {}).get("repeat", 1)
    runs = f"medians of {repeat} runs, in turns" if repeat > 1 else "one run each"
    figure.supxlabel(f"{text}; {runs}", fontsize=7, color="#555")


def _studied(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Records by scene and moments, where all methods ran and at least two have an error."""
    scenes: dict[str, list[Record]] = {}
    for record in records:
        if record.purpose == "study":
            scenes.setdefault(_scene_label(record), []).append(record)
    return {k: v for k, v in scenes.items() if sum(r.row.error is not None for r in v) > 1}


def _scene_label(record: Record) -> str:
    moments = f", {record.row.moments} moments" if record.row.interaction != "none" else ""
    return f"{record.case}, {record.row.contacts:,} contacts{moments}"


def time_against_error(family: str, studied: dict[str, list[Record]]) -> Figure:
    """One plot per studied scene, one legend for all of them, one entry per line."""
    columns = len(studied)
    figure = Figure(figsize=(5.6 * columns + 3.4, 6.4), layout="constrained")
    plots = figure.subplots(1, columns, squeeze=False)[0]
    labels = dict.fromkeys(r.row.line for group in studied.values() for r in group)
    styles = {label: number for number, label in enumerate(labels)}
    for axes, (scene, group) in zip(plots, studied.items(), strict=True):
        rows = [record.row for record in group]
        failed = sum(row.failed for row in rows)
        note = f"\n{failed} of {len(rows)} methods failed: see results.csv" if failed else ""
        draw_time_against_error(axes, rows, f"{scene}{note}", styles)
    handles = {label: h for axes in plots for h, label in zip(*_legend(axes), strict=True)}
    figure.legend(
        handles.values(), handles.keys(), loc="outside right center", fontsize=7.5, frameon=False
    )
    _headline(figure, f"{family}: time against true error")
    return figure


def _headline(figure: Figure, text: str) -> None:
    """Left, where no legend is."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=12)


def _legend(axes: Axes) -> tuple[list[Any], list[Any]]:
    handles, labels = axes.get_legend_handles_labels()
    return handles, labels


def _grown(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Records by method, smallest first, for methods followed over two sizes or more."""
    followed = {record.row.method for record in records if record.purpose == "growth"}
    methods: dict[str, list[Record]] = {}
    for record in sorted(records, key=lambda record: record.row.contacts):
        if record.row.total is not None and (record.row.method in followed or not followed):
            methods.setdefault(record.row.method, []).append(record)
    return {name: found for name, found in methods.items() if len(found) > 1}


def growth(family: str, grown: dict[str, list[Record]]) -> Figure:
    """Total time and peak memory against contacts, fitted exponents in the legends."""
    figure = Figure(figsize=(13.0, 6.8), layout="constrained")
    plots = figure.subplots(1, 2)
    for axes, column, label in (
        (plots[0], "total", "total time, seconds"),
        (plots[1], "memory", "peak memory of the process, MB"),
    ):
        for number, (name, records) in enumerate(grown.items()):
            _grow(axes, number, name, records, column)
        axes.set(xscale="log", yscale="log", ylabel=label, xlabel="contacts")
        axes.grid(True, color="#d9d9d9", linewidth=0.6)
        _plain_ticks(axes)
        axes.legend(
            fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.11), ncols=2, frameon=False
        )
    _headline(
        figure, f"{family}: growth with size (p: value ~ contacts^p from {FIT_FROM} contacts on)"
    )
    return figure


def _grow(axes: Axes, number: int, name: str, records: Sequence[Record], column: str) -> None:
    points = [(r.row.contacts, getattr(r.row, column)) for r in records]
    points = [(size, value) for size, value in points if value is not None]
    if not points:
        return
    p = exponent(points)
    axes.plot(
        *zip(*points, strict=True),
        **style(number, name),
        markersize=5,
        linewidth=2.4 if name.startswith("cvxlimit") else 1.2,
        label=name if p is None else f"{name}, p = {p:.2f}",
    )


def exponent(points: Sequence[tuple[float, float]]) -> float | None:
    """Fitted growth above :data:`FIT_FROM` contacts; None for fewer than two sizes there."""
    large = [point for point in points if point[0] >= FIT_FROM]
    if len({size for size, _ in large}) < 2:
        return None
    sizes, values = zip(*large, strict=True)
    return fitted_exponent(sizes, values)


def _plain_ticks(axes: Axes) -> None:
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    low, high = axes.get_ylim()
    few = high < 5.0 * low  # a range that 1, 2 and 5 may miss altogether
    axes.yaxis.set_minor_formatter(FuncFormatter(lambda v, _: f"{v:g}" if few else sparse(v)))


def phases(family: str, grown: dict[str, list[Record]]) -> Figure:
    """Left: shares of the package's own time by size; right: seconds by method at one size."""
    figure = Figure(figsize=(13.0, 5.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.3))
    own = grown.get(DEFAULT) or next(iter(grown.values()))
    _bars(left, [f"{r.row.contacts:,}" for r in own], [_shares(r) for r in own])
    left.set(xlabel="share of the total time", ylabel="contacts", title=own[0].row.method)
    left.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0%}"))
    left.set_xlim(0.0, 1.0)
    size = _common_size(grown)
    there = [(n, r) for n, g in grown.items() for r in g if r.row.contacts == size]
    _bars(right, [name for name, _ in there], [_seconds(r) for _, r in there])
    right.set(xlabel="seconds", title=f"methods with an answer at {size:,} contacts")
    figure.legend(*_legend(right), loc="outside upper right", ncols=len(PHASES) + 1, frameon=False)
    _headline(figure, f"{family}: where the time goes")
    return figure


def _bars(axes: Axes, names: Sequence[str], parts: Sequence[dict[str, float]]) -> None:
    start = [0.0] * len(names)
    for phase in (*PHASES, "other"):
        widths = [part.get(phase, 0.0) for part in parts]
        axes.barh(
            range(len(names)), widths, left=start, height=0.7,
            color=PHASE_COLOURS.get(phase, "#bbbbbb"), label=phase,
        )  # fmt: skip
        start = [s + w for s, w in zip(start, widths, strict=True)]
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()


def _seconds(record: Record) -> dict[str, float]:
    known = {phase: getattr(record.row, phase) or 0.0 for phase in PHASES}
    return {**known, "other": max(0.0, (record.row.total or 0.0) - sum(known.values()))}


def _shares(record: Record) -> dict[str, float]:
    seconds = _seconds(record)
    total = sum(seconds.values()) or 1.0
    return {phase: value / total for phase, value in seconds.items()}


def _common_size(grown: dict[str, list[Record]]) -> int:
    """The largest size at which three quarters of the methods have a figure."""
    counts: dict[int, int] = {}
    for records in grown.values():
        for record in records:
            size = record.row.contacts
            counts[size] = counts.get(size, 0) + 1
    enough = 0.75 * max(counts.values())
    return max(size for size, count in counts.items() if count >= enough)
