"""Models against experiments: how far each is from the test, and what it costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from bench.case import HOME, Case, cases

PICTURE = HOME.parent / "docs" / "evidence" / "bench.png"

LOOKS = {
    "octagon": ("o", "#14476f"), "conic": ("s", "#2a8a8c"), "parabolic": ("D", "#5b8c2a"),
    "exact": ("^", "#9aad00"), "vertex-forces": ("v", "#9aa0ab"),
    "independent": ("P", "#d81e4a"), "signed": ("X", "#f59e0b"), "paper": ("*", "#7c3aed"),
    "zero-dilatancy": ("h", "#7a1010"),
}  # fmt: skip
"""Marker and colour of every model."""

PLANAR = ("conic", "octagon", "vertex-forces")
"""Models that say the same where nothing twists or slides: one mark, the cone's."""


def draw(is_written: bool, tell: Callable[[str], object]) -> None:
    """One plot for each specimen in space, and one for all arches."""
    tested = [(each, each.record()) for each in cases() if tests(each.record())]
    space = [pair for pair in tested if len(pair[1]["models"]) > len(PLANAR)]
    plane = [pair for pair in tested if pair not in space]
    figure = Figure(figsize=(5.0 * (len(space) + 1), 5.2), layout="constrained")
    plots = figure.subplots(1, len(space) + 1, squeeze=False)[0]
    for axes, (each, record) in zip(plots, space, strict=False):
        specimen(axes, each, record, tell)
    arches(plots[-1], plane, tell)
    pairs = (pair for p in plots for pair in zip(*p.get_legend_handles_labels(), strict=True))
    handles = {label: handle for handle, label in pairs}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=9,
                  frameon=False, fontsize=9)  # fmt: skip
    figure.suptitle(
        "Models against experiments: proved brackets over the measured value", fontsize=12
    )
    if is_written:
        FigureCanvasAgg(figure).print_figure(PICTURE, dpi=110)
        tell(str(PICTURE))


def tests(record: Mapping[str, Any]) -> list[float]:
    """Measured values."""
    return [float(v["text"]) for v in record["values"] if v["kind"] == "test"]


def ends(bracket: Mapping[str, Any]) -> tuple[float, float] | None:
    """Of the bracket, or of the members that were found."""
    pair = (bracket["lower"], bracket["upper"])
    low, high = bracket.get("found", pair)
    return None if low is None or high is None else (low, high)


def specimen(
    axes: Axes, each: Case, record: Mapping[str, Any], tell: Callable[[str], object]
) -> None:
    """Every model: its bracket as a bar, at the CPU seconds it took."""
    (test,) = tests(record)
    for model, bracket in record["brackets"].items():
        found = ends(bracket)
        if found is None:
            continue
        low, high = (100.0 * (end / test - 1.0) for end in found)
        middle, (marker, colour) = (low + high) / 2.0, LOOKS[model]
        axes.errorbar(
            max(bracket["seconds"], 0.01), middle, yerr=(high - low) / 2.0, color=colour,
            marker=marker, markersize=8, capsize=4, linestyle="", label=model,
        )  # fmt: skip
        tell(f"{each.name:12} {model:16} {low:+.1f} to {high:+.1f} %, {bracket['seconds']} s")
    axes.axhline(0.0, color="#222", linewidth=1)
    axes.set_xscale("log")
    axes.set_xlim(0.1, 200.0)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda seconds, _: f"{seconds:g}"))
    axes.set_xlabel("CPU seconds")
    axes.set_ylabel("from the test, %")
    axes.grid(alpha=0.3)
    contacts = record["scenes"][""]["contacts"]
    title = f"{each.name}: test {test:g}, {contacts:,} contacts, layout {record['layout']}"
    axes.set_title(title, fontsize=10)


def arches(
    axes: Axes, pairs: list[tuple[Case, dict[str, Any]]], tell: Callable[[str], object]
) -> None:
    """Share of the measured load that dry, rigid blocks carry: mortar and fill are not in it."""
    labels = []
    for place, (each, record) in enumerate(pairs):
        bracket = record["brackets"].get("conic")
        if bracket is None:
            continue
        marker, colour = LOOKS["conic"]
        shares = [100.0 * bracket["upper"] / test for test in tests(record)]
        axes.plot(shares, [place] * len(shares), marker=marker, color=colour, linestyle="")
        words = " and ".join(f"{share:.2g} %" for share in shares)
        axes.annotate(f"{words}, {bracket['seconds']:.2g} s", (max(shares), place), (6, 6),
                      textcoords="offset points", fontsize=8)  # fmt: skip
        tell(f"{each.name:16} {words} of the test, {bracket['seconds']} s")
        labels.append(each.name)
    axes.axvline(100.0, color="#222", linewidth=1)
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(-0.6, len(labels) - 0.4)
    axes.set_xlim(0, 110)
    axes.set_xlabel("share of the measured load, %")
    axes.set_title("arches in mortar or with fill: must stay below", fontsize=10)
    axes.grid(alpha=0.3)
