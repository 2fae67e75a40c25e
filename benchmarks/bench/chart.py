"""Models against experiments: how far each is from the test, and what it costs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

from benchmarks.bench.case import PLANE, ROOT, Case, cases
from benchmarks.charts import name_lines, save, stacked

PICTURE = ROOT / "docs" / "evidence" / "bench.png"

LOOKS = {
    "octagon": ("o", "#14476f"), "conic": ("s", "#2a8a8c"), "parabolic": ("D", "#5b8c2a"),
    "exact": ("^", "#9aad00"), "vertex-forces": ("v", "#9aa0ab"),
    "independent": ("P", "#d81e4a"), "signed": ("X", "#f59e0b"), "paper": ("*", "#7c3aed"),
    "zero-dilatancy": ("h", "#7a1010"),
}  # fmt: skip
"""Marker and colour of the models that are drawn."""

LEAST = 0.1
"""CPU seconds at which the axis begins."""


def draw(write: bool = False) -> Iterator[str]:
    """Models against experiments; write: into docs/evidence/bench.png. One plot for each specimen
    in space, and one for all arches, whose models hardly differ."""
    tested = [(each, each.record()) for each in cases() if tests(each.record())]
    space = [pair for pair in tested if len(pair[1]["models"]) > len(PLANE)]
    plane = [pair for pair in tested if pair not in space]
    figure, plots = stacked(len(space) + 1, 3.4)
    for axes, pair in zip(plots, space, strict=False):
        yield from specimen(axes, *pair)
    yield from arches(plots[-1], plane)
    name_lines(figure, plots[:-1])
    if write:
        yield save(figure, PICTURE)


def tests(record: Mapping[str, Any]) -> list[float]:
    """Measured values."""
    return [float(v["text"]) for v in record["values"] if v["kind"] == "test"]


def ends(bracket: Mapping[str, Any]) -> tuple[float, float] | None:
    """Of the bracket, or of the members that were found."""
    low, high = bracket.get("found", (bracket["lower"], bracket["upper"]))
    return None if low is None or high is None else (low, high)


def specimen(axes: Axes, each: Case, record: Mapping[str, Any]) -> Iterator[str]:
    """Every model: its bracket as a bar, at the CPU seconds it took."""
    (test,) = tests(record)
    for model, bracket in record["brackets"].items():
        found = ends(bracket)
        if found is None or model not in LOOKS:
            continue
        low, high = (100.0 * (end / test - 1.0) for end in found)
        marker, colour = LOOKS[model]
        axes.vlines(bracket["seconds"], low, high, color=colour, linewidth=3, alpha=0.6)
        axes.plot(
            bracket["seconds"], (low + high) / 2.0, marker, color=colour, label=model,
            markersize=11 if marker == "*" else 8, markeredgecolor="white",
        )  # fmt: skip
        yield f"{each.name:12} {model:16} {low:+.1f} to {high:+.1f} %, {bracket['seconds']} s"
    axes.axhline(0.0, color="#222", linewidth=1)
    axes.annotate("test", (LEAST, 0.0), (4, 4), textcoords="offset points")
    axes.set_xscale("log")
    axes.set_xlim(LEAST, 1000.0)
    axes.margins(y=0.1)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda seconds, _: f"{seconds:g}"))
    axes.set_xlabel("CPU seconds")
    axes.set_ylabel("distance from the test, %")
    contacts = record["scenes"][""]["contacts"]
    axes.set_title(f"{each.name}: {contacts:,} contacts, layout {record['layout']}, test {test:g}",
                   fontsize=10, loc="left")  # fmt: skip


def arches(axes: Axes, pairs: list[tuple[Case, dict[str, Any]]]) -> Iterator[str]:
    """Share of the measured load that dry, rigid blocks carry: mortar and fill are not in it."""
    marker, colour = LOOKS["conic"]
    for place, (each, record) in enumerate(pairs):
        bracket = record["brackets"]["conic"]
        shares = [100.0 * bracket["upper"] / test for test in tests(record)]
        axes.plot(shares, [place] * len(shares), marker=marker, color=colour, linestyle="",
                  markersize=8, markeredgecolor="white")  # fmt: skip
        words = " and ".join(f"{share:.2g} %" for share in shares)
        axes.annotate(f"{words}, {bracket['seconds']:.2g} s", (max(shares), place), (8, 5),
                      textcoords="offset points")  # fmt: skip
        yield f"{each.name:16} {words} of the test, {bracket['seconds']} s"
    axes.axvline(100.0, color="#222", linewidth=1)
    axes.annotate("test", (100.0, len(pairs) - 0.55), (-4, -12), textcoords="offset points",
                  ha="right")  # fmt: skip
    axes.set_yticks(range(len(pairs)), [each.name for each, _ in pairs])
    axes.set_ylim(-0.6, len(pairs) - 0.4)
    axes.set_xlim(0, 110)
    axes.set_xlabel("share of the measured load, %")
    axes.set_title(
        "arches in mortar or with fill (conic): must stay below", fontsize=10, loc="left"
    )
    axes.tick_params(labelsize=9)
    axes.grid(alpha=0.3)
