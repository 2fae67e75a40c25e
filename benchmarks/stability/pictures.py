"""The pictures of the atlas, from the records alone."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure

from benchmarks.charts import LETTERS, figure_of
from benchmarks.rows import Row
from benchmarks.stability.families import FAMILIES
from benchmarks.stability.outcomes import RIGHT, Outcome

COLOURS = dict(zip(Outcome, ("#2f7f4f", "#7fb58f", "#e8c15a", "#b9bec4", "#c0272d"), strict=True))
_WORDS = {
    "conic": "cone", "CLARABEL": "Clarabel", "HIGHS": "HiGHS", "BLOCKWISE": "blockwise",
    "SCIPY": "SciPy",
}  # fmt: skip
"""What is spelt otherwise than a setting."""


def labelled(method: str) -> str:
    """A method's name for readers.

    >>> labelled("raw/conic/CLARABEL"), labelled("checked/conic/corners/CLARABEL")
    ('solver believed: cone, Clarabel', 'checked: cone, corners, Clarabel')
    """
    kind, *rest = dict.fromkeys(method.split("/"))
    words = ", ".join(_WORDS.get(part, part) for part in rest)
    return {"raw": "solver believed", "checked": "checked"}[kind] + f": {words}"


def outcomes(rows: Sequence[Row]) -> Figure:
    """A bar per method: the share of each class."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        counts[row["method"]][row["outcome"]] += 1
    names = list(counts)
    figure = figure_of(0.27 * len(names) + 1.6)
    axes = figure.subplots()
    left = np.zeros(len(names))
    for outcome, colour in COLOURS.items():
        share = np.array([100 * counts[n][outcome] / counts[n].total() for n in names])
        axes.barh(names, share, left=left, color=colour, label=outcome, height=0.8)
        for y, width in enumerate(share):
            if outcome is Outcome.WRONG and width > 0.0:
                said = f"{width:.0f} % wrong"
                axes.text(101, y, said, va="center", color=colour, fontsize=LETTERS)
        left += share
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_yticks(range(len(names)), [labelled(n) for n in names])
    axes.set_xlim(0, 112)
    axes.set_xticks(range(0, 101, 20))
    axes.set_xlabel("% of scenes")
    axes.tick_params(labelsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.3, 1.0), ncol=3, frameon=False, fontsize=LETTERS
    )
    return figure


def widths(rows: Sequence[Row]) -> Figure:
    """Our default: the width of every bracket, family by family."""
    figure = figure_of(5.2)
    axes = figure.subplots()
    jitter = np.random.default_rng(0)
    for y, family in enumerate(FAMILIES):
        mine = [r for r in rows if r["family"] == family and r.get("gap") is not None]
        size = np.maximum([abs(r["gap"]) for r in mine], 1e-12)
        good = size <= RIGHT
        place = y + jitter.uniform(-0.28, 0.28, len(mine))
        axes.scatter(size[good], place[good], s=7, color=COLOURS[Outcome.RIGHT], linewidths=0)
        axes.scatter(size[~good], place[~good], s=26, color="#d06a1f", marker="D", linewidths=0)
    axes.axvline(RIGHT, color="#333", linewidth=1)
    axes.text(RIGHT, len(FAMILIES) - 0.2, "certified up to here ", fontsize=LETTERS, ha="right")
    axes.set_xscale("log")
    axes.set_yticks(range(len(FAMILIES)), list(FAMILIES), fontsize=LETTERS)
    axes.invert_yaxis()
    axes.set_xlabel("width of the bracket, relative (1e-12 stands for less)")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="x", color="#e6e6e6")
    axes.set_axisbelow(True)
    return figure


PICTURES: dict[str, tuple[str, Callable[[Sequence[Row]], Figure]]] = {
    "atlas-widths.png": ("default", widths),
    "atlas-outcomes.png": ("methods", outcomes),
}
"""File name to the study it shows and who draws it."""
