"""What charts share, and those of the suite: time against error, growth, where the time goes."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from benchmarks.machine import fitted_exponent
from cvxlimit.base.files import write_file
from cvxlimit.compare.chart import draw_time_against_error, few_ticks, style
from cvxlimit.compare.models import PHASES
from cvxlimit.plotting.chart import label_lines

if TYPE_CHECKING:
    from benchmarks.experiments.suite import Record

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


FIT_FROM = 400
"""Contacts from which growth is fitted: below, fixed costs hide it."""

OWN = r"cvxlimit/1e-\d+"
"""Names of the methods whose phases are shown."""

CHARTED = (
    "cvxlimit", "cvxlimit, octagon", "cone, Clarabel", "cone, QOCO", "cone, SCS",
    "cone, blockwise own Cholesky", "cone, blockwise CHOLMOD", "facets, circumscribed, Clarabel",
    "facets, inscribed, Clarabel", "literal transcription, octagon", "literal transcription, cone",
    "literal, cone, N and mm", "literal, octagon, N and mm",
)  # fmt: skip
"""Lines of a chart of time against error, where there are more than a reader can tell apart."""

AT = "/1e-8"
"""End of names of methods whose growth is drawn beside the package: one tolerance."""

PHASE_COLOURS = dict(
    zip(PHASES, ("#9aad00", "#f59e0b", "#e36fb0", "#134b73", "#4aa3a8"), strict=True)
)


PHASE_NAMES = {
    "detect": "finding contacts", "compile": "compiling", "reparametrise": "parameters",
    "solve": "solving", "certify": "certificate", "other": "rest",
}  # fmt: skip


def draw_all(records: Sequence[Record], folder: Path) -> list[Path]:
    """All charts that the records allow, one set per family; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for family in dict.fromkeys(record.family for record in records):
        members = [record for record in records if record.family == family]
        for kind, figure in _figures(family, members):
            about = "\n".join(wrap(members[-1].about, 105))
            figure.supxlabel(about, fontsize=LETTERS, color="#555")
            name = re.sub(r"[^a-z0-9]+", "-", family.lower()).strip("-")
            written.append(folder / f"{kind}-{name}.png")
            save(figure, written[-1])
    return written


def _figures(family: str, records: Sequence[Record]) -> Iterator[tuple[str, Figure]]:
    if studied := _studied(records):
        yield "time-against-error", time_against_error(family, studied)
    if grown := _grown(records):
        yield "growth", growth(family, grown)
        yield "phases", phases(family, grown)


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
    """One plot per studied scene, one above the other, every line named beside it."""
    every = {r.row.line for group in studied.values() for r in group if r.row.has_point}
    if len(every) > len(CHARTED):
        studied = {k: [r for r in v if r.row.line in CHARTED] for k, v in studied.items()}
    labels = dict.fromkeys(r.row.line for group in studied.values() for r in group)
    styles = {label: number for number, label in enumerate(labels)}
    high = max(3.6, 0.175 * len(labels))
    figure, plots = stacked(len(studied), high + 0.2)
    for axes, (scene, group) in zip(plots, studied.items(), strict=True):
        rows = [record.row for record in group]
        failed = sum(row.failed for row in rows)
        note = f"; {failed} of {len(rows)} methods failed" if failed else ""
        draw_time_against_error(axes, rows, "", styles)
        axes.set_title(f"{scene}{note}", fontsize=LETTERS + 1, loc="left")
    name_lines(figure, plots)
    _headline(figure, f"{family}: time against true error")
    return figure


def _headline(figure: Figure, text: str) -> None:
    """Left, where no names are."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=11)


def _grown(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Records by method, smallest first, for methods followed over two sizes or more."""
    followed = {record.row.method for record in records if record.purpose == "growth"}
    methods: dict[str, list[Record]] = {}
    for record in sorted(records, key=lambda record: record.row.contacts):
        if record.row.total is not None and (record.row.method in followed or not followed):
            methods.setdefault(record.row.method, []).append(record)
    return {name: found for name, found in methods.items() if len(found) > 1}


def growth(family: str, grown: dict[str, list[Record]]) -> Figure:
    """Total time and peak memory against contacts, with fitted exponents."""
    figure, plots = stacked(2, 3.5)
    for axes, column, label in (
        (plots[0], "total", "total time (s)"),
        (plots[1], "memory", "peak memory (MB)"),
    ):
        shown = {k: v for k, v in grown.items() if k.endswith(AT) or k.startswith("cvxlimit")}
        for number, (name, records) in enumerate((shown or grown).items()):
            _grow(axes, number, name, records, column)
        axes.set(xscale="log", yscale="log", ylabel=label, xlabel="contacts")
        if axes.lines:
            few_ticks(axes.xaxis)
            few_ticks(axes.yaxis)
    name_lines(figure, plots)
    _headline(figure, f"{family}: growth as contacts^p, fitted from {FIT_FROM} contacts on")
    return figure


def _grow(axes: Axes, number: int, name: str, records: Sequence[Record], column: str) -> None:
    points = [(r.row.contacts, getattr(r.row, column)) for r in records]
    points = [(size, value) for size, value in points if value is not None]
    if not points:
        return
    p, own = exponent(points), name.startswith("cvxlimit")
    label = _plain(records[0])
    axes.plot(
        *zip(*points, strict=True),
        **style(number, name),
        markersize=5,
        linewidth=2.4 if own else 1.2,
        label=label if p is None else f"{label}, p = {p:.2f}",
    )


def _plain(record: Record) -> str:
    """What a reader calls a method: its line, and the tolerance that was asked for."""
    asked = re.search(r"/(1e-\d+)$", record.row.method)
    return f"{record.row.line} to {asked[1]}" if asked else record.row.line


def exponent(points: Sequence[tuple[float, float]]) -> float | None:
    """Fitted growth above :data:`FIT_FROM` contacts; None for fewer than two sizes there."""
    large = [point for point in points if point[0] >= FIT_FROM]
    if len({size for size, _ in large}) < 2:
        return None
    sizes, values = zip(*large, strict=True)
    return fitted_exponent(sizes, values)


def phases(family: str, grown: dict[str, list[Record]]) -> Figure:
    """Above: shares of the package's own time by size and by the distance to the limit that was
    asked for; below: seconds by method at one size."""
    own = _own(grown)
    size = _common_size(grown)
    there = [r for g in grown.values() for r in g if r.row.contacts == size]
    counts = len(own), len(there)
    figure = figure_of(2.6 + 0.3 * sum(counts))
    above, below = figure.subplots(2, 1, height_ratios=[n + 1 for n in counts])
    names = [f"{r.row.contacts:,} contacts{_plain(r).removeprefix(r.row.line)}" for r in own]
    _bars(above, names, [_shares(r) for r in own])
    above.set(xlabel="share of the total time")
    above.set_title(own[0].row.line, fontsize=LETTERS + 1, loc="left")
    above.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0%}"))
    above.set_xlim(0.0, 1.0)
    _bars(below, [_plain(r) for r in there], [_seconds(r) for r in there])
    below.set(xlabel="total time (s)")
    below.set_title(f"methods with an answer, {size:,} contacts", fontsize=LETTERS + 1, loc="left")
    handles, labels = below.get_legend_handles_labels()
    figure.legend(
        handles, [PHASE_NAMES[label] for label in labels], loc="outside upper right",
        ncols=len(labels), frameon=False, fontsize=LETTERS, handlelength=1.0, columnspacing=1.0,
    )  # fmt: skip
    _headline(figure, f"{family}: where the time goes")
    return figure


def _own(grown: dict[str, list[Record]]) -> list[Record]:
    """Records of the package's own choice at every tolerance, by size; else of the first method."""
    chosen = [g for name, g in grown.items() if re.fullmatch(OWN, name)]
    found = [record for group in chosen or [next(iter(grown.values()))] for record in group]
    return sorted(found, key=lambda record: record.row.contacts)


def _bars(axes: Axes, names: Sequence[str], parts: Sequence[dict[str, float]]) -> None:
    start = [0.0] * len(names)
    for phase in (*PHASES, "other"):
        widths = [part.get(phase, 0.0) for part in parts]
        if not any(widths):
            continue
        axes.barh(
            range(len(names)), widths, left=start, height=0.7,
            color=PHASE_COLOURS.get(phase, "#bbbbbb"), label=phase,
        )  # fmt: skip
        start = [s + w for s, w in zip(start, widths, strict=True)]
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(labelsize=LETTERS)
    axes.xaxis.label.set_size(LETTERS)
    axes.yaxis.label.set_size(LETTERS)
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
    sizes = Counter(record.row.contacts for records in grown.values() for record in records)
    return max(size for size, count in sizes.items() if count >= 0.75 * max(sizes.values()))
