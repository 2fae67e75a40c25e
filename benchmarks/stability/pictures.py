"""The pictures of the atlas, from the records alone."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from benchmarks.charts import LETTERS, figure_of
from benchmarks.rows import Row
from benchmarks.stability.families import FAMILIES
from benchmarks.stability.outcomes import RIGHT, Outcome

COLOURS = {
    Outcome.RIGHT: "#2f7f4f",
    Outcome.NO_ANSWER: "#7fb58f",
    Outcome.LOOSE: "#e8c15a",
    Outcome.HONEST: "#b9bec4",
    Outcome.WRONG: "#c0272d",
}
ENDINGS = {
    "converged": "#2f7f4f",
    "cycling": "#7a5ea8",
    "not converged": "#e08a3c",
    "diverged": "#c0272d",
    "refused": "#b9bec4",
}
"""How the fixed point ends; "not converged" is wandering."""

_INK = "#333"


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
                axes.text(
                    101, y, f"{width:.0f} % wrong", va="center", color=colour, fontsize=LETTERS
                )
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


def map_of_wrong(rows: Sequence[Row]) -> Figure:
    """Families x methods that believe the solver: the share that is wrong but called right."""
    raw = [row for row in rows if row["method"].startswith("raw/")]
    names = list(dict.fromkeys(row["method"] for row in raw))
    bad = {row["family"] for row in raw if row["outcome"] == Outcome.WRONG}
    shown = bad or {row["family"] for row in raw}  # where no answer is wrong, all stay white
    families = [f for f in FAMILIES if f in shown]
    wrong, of = (np.zeros((len(families), len(names))) for _ in range(2))
    for row in (row for row in raw if row["family"] in shown):
        at = families.index(row["family"]), names.index(row["method"])
        of[at] += 1
        wrong[at] += row["outcome"] == Outcome.WRONG
    figure = figure_of(0.31 * len(families) + 2.6)  # fmt: skip
    axes = figure.subplots()
    share = np.divide(wrong, of, out=np.zeros_like(wrong), where=of > 0)
    reds = LinearSegmentedColormap.from_list("reds", ["#f4f4f2", "#e8a08f", "#c0272d"])
    axes.imshow(share, cmap=reds, vmin=0, vmax=1, aspect="auto")
    for (i, j), number in np.ndenumerate(wrong):
        if number:
            colour = "white" if share[i, j] > 0.5 else _INK
            axes.text(j, i, f"{number:.0f}/{of[i, j]:.0f}", ha="center", va="center",
                      fontsize=8, color=colour)  # fmt: skip
    axes.set_xticks(range(len(names)), [labelled(n).split(": ")[1] for n in names], rotation=90,
                    fontsize=LETTERS)  # fmt: skip
    axes.set_yticks(range(len(families)), families, fontsize=LETTERS)
    axes.set_xticks(np.arange(-0.5, len(names)), minor=True)
    axes.set_yticks(np.arange(-0.5, len(families)), minor=True)
    axes.grid(which="minor", color="white", linewidth=1.5)
    axes.tick_params(which="both", length=0)
    axes.spines[:].set_visible(False)
    axes.set_title("wrong, though the solver said “optimal”, “infeasible” or “unbounded”",
                   fontsize=9.5, loc="left")  # fmt: skip
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
    axes.axvline(RIGHT, color=_INK, linewidth=1)
    axes.text(
        RIGHT,
        len(FAMILIES) - 0.2,
        "certified up to here ",
        fontsize=LETTERS,
        ha="right",
        color=_INK,
    )
    axes.set_xscale("log")
    axes.set_yticks(range(len(FAMILIES)), list(FAMILIES), fontsize=LETTERS)
    axes.invert_yaxis()
    axes.set_xlabel("width of the bracket, relative (1e-12 stands for less)")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="x", color="#e6e6e6")
    axes.set_axisbelow(True)
    return figure


def settling(rows: Sequence[Row]) -> Figure:
    """Blending weight x family: how the paper's iteration ends, one panel per reading.

    Scenes without a load factor even before the first step are left out.
    """
    rows = [row for row in rows if row.get("first") is not None]
    readings = list(dict.fromkeys(row["moments"] for row in rows))
    weights = sorted({row["weight"] for row in rows})
    families = [f for f in FAMILIES if any(row["family"] == f for row in rows)]
    figure = figure_of(0.42 * len(families) + 1.5)
    panels = figure.subplots(1, len(readings), sharey=True, squeeze=False)[0]
    for axes, reading in zip(panels, readings, strict=True):
        for y, family in enumerate(families):
            for x, weight in enumerate(weights):
                ends = Counter(
                    row["ending"]
                    for row in rows
                    if (row["moments"], row["family"], row["weight"]) == (reading, family, weight)
                )
                left = x - 0.42
                for ending, colour in ENDINGS.items():
                    width = 0.84 * ends[ending] / max(ends.total(), 1)
                    axes.barh(y, width, left=left, height=0.8, color=colour)
                    left += width
        axes.set_xticks(range(len(weights)), [f"{w:g}" for w in weights])
        axes.set_xlim(-0.5, len(weights) - 0.5)
        axes.set_title(f"{reading} moments", fontsize=10)
        axes.set_xlabel("weight of the old forces")
        axes.tick_params(labelsize=9)
        axes.spines[:].set_visible(False)
        axes.tick_params(length=0)
    panels[0].set_yticks(range(len(families)), families)
    panels[0].set_ylim(len(families) - 0.5, -0.5)
    shown = {e: c for e, c in ENDINGS.items() if any(row["ending"] == e for row in rows)}
    labels = {"not converged": "wandering", "refused": "refused: no such contacts"}
    handles = [panels[0].barh([0], [0], color=c, label=labels.get(e, e)) for e, c in shown.items()]
    figure.legend(
        handles=handles, loc="outside upper center", ncol=4, frameon=False, fontsize=LETTERS
    )
    return figure


PICTURES: dict[str, tuple[str, Callable[[Sequence[Row]], Figure]]] = {
    "atlas-widths.png": ("default", widths),
    "atlas-outcomes.png": ("methods", outcomes),
    "atlas-wrong.png": ("methods", map_of_wrong),
    "atlas-fixed-point.png": ("fixed-point", settling),
}
"""File name to the study it shows and who draws it."""
