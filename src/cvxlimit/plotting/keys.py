"""What a legend shows: a key for everything that is drawn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

import cvxlimit.plotting.look as look
from cvxlimit.plotting.annotations import Annotations
from cvxlimit.plotting.contents import Drawing

GLASS_LINE = "#a9adb4"
"""Edges of blocks that lines and coloured joints are seen through."""


def contents_keys(drawing: Drawing) -> Iterator[Artist]:
    marking, moves = drawing.marking, drawing.moving.moves
    if marking is not None:
        for kind in (kind for kind in marking.colours if kind in marking.texts):
            count = int((marking.kind == kind).sum())
            if count or moves:
                label = f"{marking.texts[kind]} ({count})"
                yield Patch(color=marking.colours[kind], label=label)
    if drawing.lines is not None:
        yield Line2D([], [], color=drawing.lines.colour, lw=2.2, label=drawing.lines.label)
    if drawing.dots is not None:
        yield _ring("pressure centre", ms=4.5, mfc=look.CENTRE_COLOUR, mec="white")
    for colour, label in drawing.keys:
        yield Patch(color=colour, label=label)
    kinds = Counter((shape.label, shape.colour) for shape in drawing.shapes)
    for (label, colour), count in kinds.items():
        yield Patch(color=colour, label=f"{label} ({count})")
    if moves:
        yield Patch(facecolor="#e9ebee", edgecolor="#9aa0ab", label="undeformed")
    elif drawing.glass:
        yield Patch(facecolor="white", edgecolor=GLASS_LINE, label=drawing.blocks)
    else:
        stone = look.STONE_COLOUR if drawing.colours is None else look.PALE
        yield Patch(facecolor=stone, edgecolor=GLASS_LINE, lw=0.5, label=drawing.blocks)
    yield Patch(color=look.SUPPORT_COLOUR, label="support")


def notes_keys(notes: Annotations) -> Iterator[Artist]:
    if notes.culprits:
        yield Patch(color=look.CULPRIT_COLOUR, label="refused")
    for case in sorted({arrow.case for arrow in notes.arrows}):
        yield Line2D([], [], color=look.CASE_COLOURS[case], lw=2.2, label=f"{case} load")
    if notes.marks:
        label = "where it is wrong" if notes.refusal else f"near miss ({len(notes.marks)})"
        yield _ring(label, ms=6, mfc="none", mec=look.MARK_COLOUR, mew=1.4)


def _ring(label: str, **look: Any) -> Line2D:
    return Line2D([], [], ls="none", marker="o", label=label, **look)
