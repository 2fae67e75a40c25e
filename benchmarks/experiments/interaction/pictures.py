"""The three pictures of ``docs/evidence/interaction.md``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from benchmarks.charts import LETTERS, figure_of, save
from benchmarks.experiments.interaction.runs import (
    AXES,
    DEFAULTS,
    FIRST,
    Experiment,
    Pair,
    Result,
    setting,
)

COLOURS = {
    "independent": "tab:blue",
    "signed": "tab:orange",
    "signed-torsion-bending": "tab:red",
    "paper": "tab:green",
}
SHADES = ("#1b7837", "#5aae61", "#a6dba0", "#762a83")
"""Of the four choices of axes."""

PANELS = {"s12-panel": (0.137, 0.129), "s10-panel": (0.215, 0.213), "tuff-wall": (None, None)}
"""The paper's last figure, and the experiment's."""


def draw(docs: Path, pairs: Sequence[Pair]) -> None:
    """Write all pictures."""
    histories(docs / "interaction.png", pairs)
    widths(docs / "interaction-width.png", pairs)
    spread(docs / "paper-reading.png", pairs)


def histories(path: Path, pairs: Sequence[Pair]) -> None:
    """Iterates under the readings, beside certified brackets."""
    figure = figure_of(8.0)
    axes = figure.subplots(len(PANELS), 3, sharey="row")
    columns = (("independent",), ("signed", "signed-torsion-bending"), tuple(a.name for a in AXES))
    for row, (scene, (last, experiment)) in enumerate(PANELS.items()):
        for ax, names in zip(axes[row], columns, strict=True):
            _history(ax, pairs, scene, names)
            _lines(ax.axhline, last, experiment)
            ax.set_title(
                f"{scene}, {'paper, all axes' if len(names) == 4 else names[0]}", fontsize=10
            )
        top = 1.35 * max((r.factors[0] or 0.0 for r in _tables(pairs, scene)), default=0.5)
        axes[row][0].set_ylim(0.0, top)
        for ax, names in zip(axes[row], columns, strict=True):
            _tell_outside(ax, _tables(pairs, scene, names), top)
        axes[row][0].set_ylabel("load factor")
    for ax in axes.ravel():
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    for ax in axes[-1]:
        ax.set_xlabel("iteration", fontsize=LETTERS)
    pairs_of = [pair for ax in axes.ravel() for pair in zip(*_handles(ax), strict=True)]
    keys = {label: handle for handle, label in pairs_of[::-1]}
    figure.legend(
        keys.values(),
        keys.keys(),
        loc="outside lower center",
        ncols=3,
        frameon=False,
        fontsize=LETTERS,
    )
    save(figure, path)


def _handles(ax: Axes) -> tuple[list[Any], list[Any]]:
    return ax.get_legend_handles_labels()


def _tables(pairs: Sequence[Pair], scene: str, names: Sequence[str] | None = None) -> list[Result]:
    return [
        r
        for e, r in pairs
        if (e.part, e.scene) == ("tables", scene)
        and r.factors
        and (names is None or e.moments in names)
    ]


def _tell_outside(ax: Axes, results: Sequence[Result], top: float) -> None:
    """Write iterates above the picture at its upper edge."""
    for r in results:
        for step, factor in enumerate(r.factors, 1):
            if factor is not None and factor > top:
                ax.text(step + 0.3, 0.93 * top, f"↑ {factor:.3f}", fontsize=8)


def _history(ax: Axes, pairs: Sequence[Pair], scene: str, names: Sequence[str]) -> None:
    for number, name in enumerate(names):
        colour = SHADES[number] if len(names) == 4 else COLOURS[name]
        for e, r in pairs:
            if (e.part, e.scene, e.moments) == ("tables", scene, name):
                factors = [np.nan if f is None else f for f in r.factors]
                ax.plot(np.arange(1, len(factors) + 1), factors, ".-", lw=1, c=colour, label=name)
            bounds = (r.lower, r.upper)
            is_bracket = (e.part, e.scene, e.moments, e.kind) == (
                "brackets", scene, name, "certified",
            )  # fmt: skip
            if is_bracket and None not in bounds:
                ax.axhspan(*bounds, color=colour, alpha=0.3, lw=1.5, label="certified (cone)")


def _legend(ax: Axes, **options: Any) -> None:
    """Unless nothing was drawn."""
    if ax.get_legend_handles_labels()[0]:
        ax.legend(**options)


def _lines(draw_line: Any, last: float | None, experiment: float | None) -> None:
    """``draw_line`` is the axes' ``axhline`` or ``axvline``."""
    if last is not None:
        draw_line(last, color="k", ls="--", lw=1, label="the paper's last")
    if experiment is not None:
        draw_line(experiment, color="k", ls=":", lw=1, label="experiment")


def widths(path: Path, pairs: Sequence[Pair]) -> None:
    """Width of the bracket against time, and the iteration's distance from it at its end."""
    chosen = [(e, r) for e, r in pairs if e.part == "brackets"]
    first = {e.scene: r.seconds for e, r in chosen if e.kind == FIRST}
    figure = figure_of(6.0)
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    for column, moments in enumerate(("independent", "signed", "paper")):
        for row, what in enumerate(("built-in scenes", "random walls")):
            ax = axes[row, column]
            mine = [
                (e, r)
                for e, r in chosen
                if e.moments == moments and e.scene.startswith("random") is (row == 1)
            ]
            _widths(ax, mine, first)
            ax.set_title(f"{what}, {moments}", fontsize=10)
            ax.set_xscale("log")
            ax.set_yscale("log")
            ax.axhline(1.0, color="0.8", lw=1, zorder=0)
    axes[-1, 1].set_xlabel("CPU time / analysis without interaction", fontsize=LETTERS)
    for ax in axes[:, 0]:
        ax.set_ylabel("width of the bracket (%)", fontsize=LETTERS)
    keys = [
        Line2D([], [], color="#134b73", marker="o", ms=3.5, label="bracket, a line a scene"),
        Line2D([], [], color="#d62246", marker="x", ls="", label="iteration's distance from it"),
    ]
    figure.legend(
        handles=keys, loc="outside lower center", ncols=2, frameon=False, fontsize=LETTERS
    )
    save(figure, path)


_LEAST = 1e-3
"""Percent below which a width or a distance is drawn at this height."""


def _widths(ax: Axes, pairs: Sequence[Pair], first: dict[str, float]) -> None:
    brackets = {e.scene: r for e, r in pairs if e.kind == "certified"}
    for e, r in pairs:
        unit = first.get(e.scene, 0.0)
        if not unit > 0.0:
            continue
        if e.kind == "certified":
            time, width = _narrowing(r)
            if len(time):
                ax.step(time / unit, width, where="post", c="#134b73", lw=0.9, alpha=0.6)
                ax.plot(time[-1:] / unit, width[-1:], "o", ms=3.5, c="#134b73")
        elif (gap := _distance(r, brackets.get(e.scene))) is not None:
            ax.plot(r.seconds / unit, max(gap, _LEAST), "x", ms=5, c="#d62246")


def _narrowing(r: Result) -> tuple[np.ndarray, np.ndarray]:
    """CPU seconds, and the width in percent of the upper bound, as the bracket closes."""
    rows = [
        (t, 100.0 * (high - low) / high)
        for t, low, high in zip(r.clock, r.lowers, r.uppers, strict=False)
        if low is not None and high is not None and high > 0.0
    ]
    time, width = np.array(rows).reshape(-1, 2).T
    return time, np.maximum(width, _LEAST)


def _distance(iteration: Result, bracket: Result | None) -> float | None:
    """Percent by which the last iterate lies outside the bracket; 0 inside."""
    if bracket is None or iteration.load_factor is None or bracket.lower is None:
        return None
    if bracket.upper is None or not bracket.lower > 0.0:
        return None
    below = 1.0 - iteration.load_factor / bracket.lower
    above = iteration.load_factor / bracket.upper - 1.0
    return 100.0 * max(below, above, 0.0)


def spread(path: Path, pairs: Sequence[Pair]) -> None:
    """The paper's reading over axes, block orders and settings, beside the paper's figure."""
    rows = {scene: _varied(pairs, scene) for scene in PANELS}
    heights = [0.17 * len(found) + 0.7 for found in rows.values()]
    figure = figure_of(sum(heights))
    axes = figure.subplots(len(PANELS), 1, height_ratios=heights)
    for ax, (scene, (last, experiment)) in zip(axes, PANELS.items(), strict=True):
        for y, ((_, kind), runs) in enumerate(rows[scene].items()):
            later = [factor for run in runs for factor in run]
            ax.plot([min(later), max(later)], [y, y], "-", lw=5, alpha=0.4, c=KINDS[kind])
            ax.plot([r[-1] for r in runs], [y] * len(runs), "o", ms=4, alpha=0.7, c=KINDS[kind])
        ax.set_yticks(range(len(rows[scene])), [label for label, _ in rows[scene]])
        ax.tick_params(labelsize=LETTERS)
        ax.invert_yaxis()
        _lines(ax.axvline, last, experiment)
        ax.set_title(f"{scene}: third iterate to last (dots)", fontsize=10, loc="left")
        _legend(ax, fontsize=LETTERS)
    axes[-1].set_xlabel("load factor (octagon)", fontsize=LETTERS)
    save(figure, path)


KINDS = {"axes": "tab:green", "order": "tab:grey", "setting": "tab:purple", "": ""}
"""What is varied in :func:`spread`, and its colour."""


def _varied(pairs: Sequence[Pair], scene: str) -> dict[tuple[str, str], list[list[float]]]:
    """What was varied on a scene, by kind, with the iterates from the third on of every run."""
    found: dict[tuple[str, str], list[list[float]]] = {}
    for e, r in sorted(pairs, key=lambda pair: list(KINDS).index(_kind(pair[0]))):
        later = [f for f in r.factors[2:] if f is not None]
        if e.scene == scene and later and _kind(e):
            found.setdefault((_label(e, _kind(e)), _kind(e)), []).append(later)
    return found


def _kind(e: Experiment) -> str:
    """Which of :data:`KINDS`: "" for what is not the paper's reading on the octagon."""
    if not e.moments.startswith("paper") or e.surface != "octagon":
        return ""
    if e.part == "settings":
        return "" if setting(e) == DEFAULTS else "setting"
    return {"tables": "axes", "orders": "order"}[e.part]


def _label(e: Experiment, kind: str) -> str:
    if kind == "axes":
        return "as it is" if e.moments == "paper" else e.moments.removeprefix("paper ").strip("()")
    if kind == "setting":
        return setting(e)
    return "other orders" + ("" if setting(e) == DEFAULTS else f", {setting(e)}")
