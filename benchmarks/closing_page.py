"""``python -m benchmarks.closing_page``: tables and picture of docs/evidence/closing.md.

Rows are those of :mod:`benchmarks.closing` in docs/evidence/closing.jsonl.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks import closing
from benchmarks.closing import Row, stored

DOCS = Path(__file__).parent.parent / "docs" / "evidence"
ROWS = DOCS / "closing.jsonl"

COLOURS = {"independent": "#0072b2", "signed": "#d55e00"}
"""Wong's, told apart by colour-blind readers too."""

NAMES = {"independent": "independent signs", "signed": "signed moments"}

MOMENTS_AFTER = (1.0, 5.0, 20.0, 60.0)
"""CPU seconds at which shares are told."""

FAMILIES = {"random-wall": "walls", "prisms": "prisms", "drums": "drums"}


ASKED = (("walls", 60), ("prisms", 20), ("drums", 20))
"""Scenes of each family, from a first seed on at which no setting was chosen."""

FIRST = 90_000


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what is missing if asked to, print both tables, draw the picture."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.closing_page", description=__doc__)
    parser.add_argument("--measure", action="store_true", help="with default settings")
    refuted = 0
    if parser.parse_args(arguments).measure:
        for (name, number), moments in itertools.product(ASKED, COLOURS):
            asked = f"--family {name} --scenes {number} --first {FIRST} --moments {moments}"
            refuted |= closing.main([*asked.split(), "--default", "--out", str(ROWS)])
    rows = [r for r in stored(ROWS) if r.has_answer]
    for title, lines in (("shares", shares(rows)), ("walls", walls(rows))):
        sys.stdout.write("\n".join([f"### {title}", *lines, ""]))
    figure = picture([r for r in rows if family(r) == "walls"])
    figure.savefig(DOCS / "closing.png", dpi=190)
    return refuted


def family(row: Row) -> str:
    """Of a scene, by its name."""
    return FAMILIES.get(row.scene.rsplit("-", 1)[0], row.scene)


def shares(rows: Sequence[Row]) -> list[str]:
    """Lines of the table of families."""
    ends = " | ".join(f"after {t:g} s" for t in MOMENTS_AFTER)
    lines = [
        f"| scenes | moments | number | contacts | {ends} | at the end within 5 % | within 1 % | "
        "both bounds proved | CPU s, median | all |",
        "|" + " --- |" * (9 + len(MOMENTS_AFTER)),
    ]
    for kind in dict.fromkeys(family(r) for r in rows):
        for moments in COLOURS:
            group = [r for r in rows if family(r) == kind and r.moments == moments]
            if not group:
                continue
            widths = np.array([r.width for r in group])
            then = " | ".join(
                f"{np.mean([r.width_at(t) <= 0.01 for r in group]):.0%}" for t in MOMENTS_AFTER
            )
            counts, seconds = [r.contacts for r in group], [r.seconds for r in group]
            lines.append(
                f"| {kind} | {moments} | {len(group)} | {min(counts)} to {max(counts)} | {then} | "
                f"{np.mean(widths <= 0.05):.1%} | {np.mean(widths <= 0.01):.1%} | "
                f"{sum(r.is_proved for r in group)} | {np.median(seconds):.1f} | "
                f"{sum(seconds):.0f} |"
            )
    return lines


def walls(rows: Sequence[Row]) -> list[str]:
    """Lines of the table of walls, both conventions side by side."""
    lines = [
        "| wall | contacts | friction | independent | width | CPU s | signed | width | CPU s |",
        "|" + " --- |" * 9,
    ]
    known = {(r.scene, r.moments): r for r in rows if family(r) == "walls"}
    for scene in sorted({s for s, _ in known}, key=lambda s: int(s.rsplit("-", 1)[1])):
        found = [known.get((scene, moments)) for moments in COLOURS]
        first = next(r for r in found if r is not None)
        cells = [c for r in found for c in (_cells(r) if r else ("does no harm", "", ""))]
        lines.append(
            f"| {scene.rsplit('-', 1)[1]} | {first.contacts} | {first.friction:.2f} | "
            + " | ".join(cells)
            + " |"
        )
    return lines


def _cells(row: Row) -> tuple[str, str, str]:
    bracket = f"[{row.lower:.4g}, {row.upper:.4g}]"
    return bracket, f"{100.0 * row.width:.2f} %", f"{row.seconds:.1f}"


def picture(rows: Sequence[Row]) -> Figure:
    """Width against time, a line per wall, and how many walls were within a width when."""
    figure = Figure(figsize=(7.7, 6.6), layout="constrained")
    axes = figure.subplots(2, 2, sharey="row")
    for column, (moments, colour) in enumerate(COLOURS.items()):
        group = [r for r in rows if r.moments == moments]
        _draw_lines(axes[0, column], group, colour)
        axes[0, column].set_title(
            f"{len(group)} irregular walls, {NAMES[moments]}", loc="left", fontsize=10
        )
        _draw_shares(axes[1, column], group)
    axes[0, 0].set_ylabel("width of the bracket (%)")
    axes[1, 0].set_ylabel("walls within that width (%)")
    return figure


def _draw_lines(axes: Axes, rows: Sequence[Row], colour: str) -> None:
    for row in rows:
        lines = [t for t in row.trace if np.isfinite(t[1]) and t[2] > 0.0]
        times = [max(t[0], 0.05) for t in lines] + [row.seconds]
        widths = [max(100.0 * (t[2] - t[1]) / t[2], 0.02) for t in lines]
        axes.step(times, [*widths, widths[-1]], where="post", color=colour, alpha=0.45, lw=1.1)
        axes.plot(times[-1], widths[-1], "o", color=colour, ms=3.5)
    for limit in (1.0, 5.0):
        axes.axhline(limit, color="#222222", lw=0.8, ls="--")
        axes.annotate(f"{limit:g} %", (30.0, limit), (0, 2), textcoords="offset points")
    axes.set(xscale="log", yscale="log", xlim=(0.05, 80.0), ylim=(0.015, 60.0))
    axes.set_xlabel("CPU seconds")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_major_formatter("{x:g}")


def _draw_shares(axes: Axes, rows: Sequence[Row]) -> None:
    for number, seconds in enumerate(MOMENTS_AFTER):
        widths = np.sort([100.0 * r.width_at(seconds) for r in rows])
        share = 100.0 * np.arange(1, len(widths) + 1) / len(widths)
        shade = 0.75 - 0.25 * number
        axes.step(
            np.maximum(widths, 0.02), share, where="post", color=(shade,) * 3,
            label=f"after {seconds:g} s",
        )  # fmt: skip
    axes.set(xscale="log", xlim=(0.015, 60.0), ylim=(0.0, 102.0))
    axes.set_xlabel("width of the bracket (%); 0.02 stands for less")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.legend(loc="lower right", frameon=False, fontsize=9)


if __name__ == "__main__":
    raise SystemExit(main())
