"""The layout of a figure: sizes of letters, lines of text, legends, and the scale of the scene."""

from __future__ import annotations

import textwrap
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import rcParams, rcParamsDefault
from matplotlib.artist import Artist
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.textpath import text_to_path

import cvxlimit.plotting.look as look
from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.plotting.annotations import Annotations
from cvxlimit.plotting.contents import Drawing
from cvxlimit.plotting.style import Style


@dataclass(frozen=True)
class Paper:
    """Measures of figures, in inches where nothing else is said.

    Attributes
    ----------
    point : float
        A typographic point.
    widest, tallest : float
        Room of the scene in a figure whose size nobody states.
    narrowest : float
        Least width of such a figure, for title and legend.
    pad : float
        Space between parts and at the edge.
    scale_room : float
        Height of a row of bars that state scales of forces.
    fine : float
        Size of a scene below which lines are drawn finer.
    wide : float
        Width from which a colour bar stands beside the scene and not below it.
    least : float
        Smallest letters, in points, unless ``font.size`` is smaller.
    key_room : float
        Handle of a legend's entry with the spaces beside it, in sizes of letters.
    dpi : int
        Pixels per inch.
    """

    point: float = 1.0 / 72.0
    widest: float = 7.6
    tallest: float = 6.4
    narrowest: float = 6.7
    pad: float = 0.08
    scale_room: float = 0.2
    fine: float = 5.5
    wide: float = 5.0
    least: float = 7.0
    key_room: float = 3.2
    dpi: int = 150


PAPER = Paper()

KEYS = {
    "frameon": False, "handlelength": 1.1, "handleheight": 0.9, "columnspacing": 1.3,
    "handletextpad": 0.6, "borderpad": 0.0, "borderaxespad": 0.0, "labelspacing": 0.3,
}  # fmt: skip
"""Settings of all legends."""


@dataclass(frozen=True)
class Sheet:
    """What the caller of :func:`cvxlimit.plotting.picture` states about the figure."""

    ax: Any = None
    figsize: tuple[float, float] | None = None
    title: str | None = None
    legend: bool = True

    def __post_init__(self) -> None:
        if self.ax is not None and self.figsize is not None:
            raise InputError("ax has a size of its own: give ax or figsize, not both")
        if self.figsize is not None:
            size = np.asarray(self.figsize, dtype=float)
            if size.shape != (2,) or not (np.isfinite(size) & (size > 0.0)).all():
                raise InputError(f"figsize must be width and height in inches, got {self.figsize}")

    @property
    def size(self) -> tuple[float, float] | None:
        """Width and height in inches: those of ``ax``, those stated, or those of Matplotlib's
        settings where they were changed; None otherwise."""
        if self.ax is not None:
            figure = self.ax.get_figure(root=True)
            engine = figure.get_layout_engine()
            if engine is not None:
                engine.execute(figure)
            box = self.ax.get_window_extent()
            return box.width / figure.dpi, box.height / figure.dpi
        changed = list(rcParams["figure.figsize"]) != list(rcParamsDefault["figure.figsize"])
        stated = self.figsize or (rcParams["figure.figsize"] if changed else None)
        return None if stated is None else (float(stated[0]), float(stated[1]))


@dataclass(frozen=True)
class Letters:
    """Sizes in points for a figure so many inches wide, by ``font.size`` of Matplotlib."""

    width: float

    def size(self, usual: float) -> float:
        """Returns a size in points, where ``usual`` is that in a wide figure with letters of 10
        points."""
        base = float(rcParams["font.size"])
        narrow = min(1.0, max(0.8, self.width / 6.5))
        return float(max(usual * narrow * base / 10.0, min(PAPER.least, base)))

    def setting(self, name: str) -> float:
        """Returns the size of letters that Matplotlib's settings give a size, such as
        ``axes.labelsize``."""
        settings: Any = rcParams  # whose keys have types of their own in some versions
        usual = FontProperties(size=settings[name]).get_size_in_points()
        return self.size(float(usual * 10.0 / rcParams["font.size"]))

    @property
    def heading(self) -> float:
        return self.size(11.0)

    @property
    def caption(self) -> float:
        return self.size(8.5)

    @property
    def key(self) -> float:
        return self.size(8.0)

    @property
    def tick(self) -> float:
        return self.size(7.5)

    @property
    def is_wide(self) -> bool:
        return self.width >= PAPER.wide


def measured(text: str, size: float) -> float:
    """Returns the width in inches of a line of text in letters of ``size`` points."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        extent = text_to_path.get_text_width_height_descent(text, FontProperties(size=size), False)
    return float(extent[0]) * PAPER.point


def lines_of(text: str, size: float, width: float) -> list[str]:
    """Returns a text in lines no wider than ``width`` inches, unless a single word is."""
    if not text:
        return []
    letters = max(8, int(len(text) * width / max(measured(text, size), 1e-9)))
    while letters > 8 and any(
        measured(line, size) > width for line in textwrap.wrap(text, letters)
    ):
        letters -= 1
    return textwrap.wrap(text, letters)


def columns_of(texts: Sequence[str], size: float, width: float) -> int:
    """Returns the largest number of columns of a legend that fit into ``width`` inches."""
    em = size * PAPER.point
    wide = [measured(text, size) + PAPER.key_room * em for text in texts]
    for columns in range(len(texts), 1, -1):
        bounds = np.cumsum([0, *(len(part) for part in np.array_split(wide, columns))])
        if sum(max(wide[a:b]) for a, b in pairwise(bounds)) <= width:
            return columns
    return 1


@dataclass(frozen=True)
class Word:
    """A text beside a point (2,) of the picture, ``away`` inches from it; alignments as in
    Matplotlib."""

    at: tuple[float, float]
    away: tuple[float, float]
    text: str
    size: float
    level: str = "center"
    upright: str = "center"

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top beside the point, in inches."""
        width, height = measured(self.text, self.size), 1.25 * self.size * PAPER.point
        left = self.away[0] - {"left": 0.0, "center": 0.5, "right": 1.0}[self.level] * width
        foot = self.away[1] - {"bottom": 0.0, "center": 0.5, "top": 1.0}[self.upright] * height
        return left, foot, left + width, foot + height

    def meets(self, other: Word, scale: float) -> bool:
        """True if the two overlap where the picture has ``scale`` inches for one unit."""
        shift = scale * (np.asarray(other.at) - np.asarray(self.at))
        mine, their = np.array(self.box), np.array(other.box) + np.tile(shift, 2)
        return bool((mine[:2] < their[2:]).all() and (their[:2] < mine[2:]).all())


@dataclass(frozen=True)
class Fit:
    """How points of the picture lie in a box: ``scale`` inches for one unit from ``low`` on, in the
    box's lower left corner; ``taken`` are the inches used."""

    scale: float
    low: FloatArray
    taken: FloatArray


def fitted(points: FloatArray, words: Sequence[Word], room: FloatArray) -> Fit:
    """Returns the largest scale at which points (n, 2) and words lie within ``room`` (2,)
    inches."""
    boxes = np.array([word.box for word in words]).reshape(-1, 4)
    at = np.concatenate([points, np.array([word.at for word in words]).reshape(-1, 2)])
    before = np.concatenate([np.zeros((len(points), 2)), boxes[:, :2]])
    after = np.concatenate([np.zeros((len(points), 2)), boxes[:, 2:]])
    extent = np.maximum(np.ptp(points, axis=0), 1e-300)

    def taken(scale: float) -> tuple[FloatArray, FloatArray]:
        low = (scale * at + before).min(axis=0)
        return low, (scale * at + after).max(axis=0) - low

    # Bisection: words keep their size while points move apart.
    least, most = 0.0, float((room / extent).min())
    for _ in range(50):
        scale = 0.5 * (least + most)
        if (taken(scale)[1] <= room).all():
            least = scale
        else:
            most = scale
    scale = max(least, 0.2 * float((room / extent).min()))  # never less than a fifth for the scene
    low, size = taken(scale)
    return Fit(scale, low / scale, size)


def contents_keys(drawing: Drawing) -> Iterator[Artist]:
    """Yields the legend's entries about the scene and its answer."""
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
        yield _ring("pressure centre", ms=4.5, mfc=Style.centre, mec="white")
    for colour, label in drawing.keys:
        yield Patch(color=colour, label=label)
    kinds = Counter((shape.label, shape.colour) for shape in drawing.shapes)
    for (label, colour), count in kinds.items():
        yield Patch(color=colour, label=f"{label} ({count})")
    if moves:
        yield Patch(facecolor=Style.ghost_key[0], edgecolor=Style.ghost_key[1], label="undeformed")
    elif drawing.glass:
        yield Patch(facecolor="white", edgecolor=Style.glass, label=drawing.blocks)
    else:
        stone = Style.stone if drawing.colours is None else Style.pale
        yield Patch(facecolor=stone, edgecolor=Style.glass, lw=0.5, label=drawing.blocks)
    yield Patch(color=Style.support, label="support")


def notes_keys(notes: Annotations) -> Iterator[Artist]:
    """Yields the legend's entries about loads, marks and a refusal."""
    if notes.culprits:
        yield Patch(color=Style.culprit, label="refused")
    for case in sorted({arrow.case for arrow in notes.arrows}):
        yield Line2D([], [], color=look.CASE_COLOURS[case], lw=2.2, label=f"{case} load")
    if notes.marks:
        label = "where it is wrong" if notes.refusal else f"near miss ({len(notes.marks)})"
        yield _ring(label, ms=6, mfc="none", mec=Style.mark, mew=1.4)


def _ring(label: str, **look: Any) -> Line2D:
    return Line2D([], [], ls="none", marker="o", label=label, **look)
