"""Models against experiments: how far each is from the test, and what it costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from bench.case import HOME, PLANE, Case, cases

PICTURE = HOME.parent / "docs" / "evidence" / "bench.png"

LOOKS = {
    "octagon": ("o", "#14476f"), "conic": ("s", "#2a8a8c"), "parabolic": ("D", "#5b8c2a"),
    "exact": ("^", "#9aad00"), "vertex-forces": ("v", "#9aa0ab"),
    "independent": ("P", "#d81e4a"), "signed": ("X", "#f59e0b"), "paper": ("*", "#7c3aed"),
    "zero-dilatancy": ("h", "#7a1010"),
}  # fmt: skip
"""Marker and colour of the models that are drawn."""

LEAST = 0.1
"""CPU seconds at which the axis begins."""


def draw(is_written: bool, tell: Callable[[str], object]) -> None:
    """One plot for each specimen in space, and one for all arches, whose models hardly differ."""
    tested = [(each, each.record()) for each in cases() if tests(each.record())]
    space = [pair for pair in tested if len(pair[1]["models"]) > len(PLANE)]
    plane = [pair for pair in tested if pair not in space]
    figure = Figure(figsize=(5.4 * (len(space) + 1), 5.6), layout="constrained")
    plots = figure.subplots(1, len(space) + 1, squeeze=False)[0]
    drawn = [specimen(axes, *pair, tell) for axes, pair in zip(plots, space, strict=False)]
    arches(plots[-1], plane, tell)
    handles = [
        Line2D([], [], color=colour, marker=marker, markersize=9, linestyle="", label=model)
        for model, (marker, colour) in LOOKS.items() if any(model in found for found in drawn)
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False,
                  columnspacing=1.2, handletextpad=0.2)  # fmt: skip
    figure.suptitle("Models against experiments: proved brackets over the measured value")
    if is_written:
        FigureCanvasAgg(figure).print_figure(PICTURE, dpi=110)
        tell(str(PICTURE))


def tests(record: Mapping[str, Any]) -> list[float]:
    """Measured values."""
    return [float(v["text"]) for v in record["values"] if v["kind"] == "test"]


def ends(bracket: Mapping[str, Any]) -> tuple[float, float] | None:
    """Of the bracket, or of the members that were found."""
    low, high = bracket.get("found", (bracket["lower"], bracket["upper"]))
    return None if low is None or high is None else (low, high)


def specimen(
    axes: Axes, each: Case, record: Mapping[str, Any], tell: Callable[[str], object]
) -> list[str]:
    """Every model: its bracket as a bar, at the CPU seconds it took; the models that are drawn."""
    (test,) = tests(record)
    drawn = []
    for model, bracket in record["brackets"].items():
        found = ends(bracket)
        if found is None or model not in LOOKS:
            continue
        low, high = (100.0 * (end / test - 1.0) for end in found)
        marker, colour = LOOKS[model]
        axes.errorbar(
            bracket["seconds"], (low + high) / 2.0, yerr=(high - low) / 2.0, color=colour,
            marker=marker, markersize=15 if marker == "*" else 10, markeredgecolor="white",
            capsize=5, linestyle="",
        )  # fmt: skip
        tell(f"{each.name:12} {model:16} {low:+.1f} to {high:+.1f} %, {bracket['seconds']} s")
        drawn.append(model)
    axes.axhline(0.0, color="#222", linewidth=1)
    axes.annotate("test", (LEAST, 0.0), (4, 4), textcoords="offset points")
    axes.set_xscale("log")
    axes.set_xlim(LEAST, 1000.0)
    axes.margins(y=0.1)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda seconds, _: f"{seconds:g}"))
    axes.set_xlabel("CPU seconds")
    axes.set_ylabel("distance from the test, %")
    axes.grid(alpha=0.3)
    contacts = record["scenes"][""]["contacts"]
    axes.set_title(f"{each.name}: {contacts:,} contacts, layout {record['layout']}, test {test:g}",
                   fontsize="medium")  # fmt: skip
    return drawn


def arches(
    axes: Axes, pairs: list[tuple[Case, dict[str, Any]]], tell: Callable[[str], object]
) -> None:
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
        tell(f"{each.name:16} {words} of the test, {bracket['seconds']} s")
    axes.axvline(100.0, color="#222", linewidth=1)
    axes.annotate("test", (100.0, len(pairs) - 0.55), (-4, -12), textcoords="offset points",
                  ha="right")  # fmt: skip
    axes.set_yticks(range(len(pairs)), [each.name for each, _ in pairs])
    axes.set_ylim(-0.6, len(pairs) - 0.4)
    axes.set_xlim(0, 110)
    axes.set_xlabel("share of the measured load, %")
    axes.set_title("arches in mortar or with fill (conic): must stay below", fontsize="medium")
    axes.grid(alpha=0.3)
