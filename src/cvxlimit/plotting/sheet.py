"""The sheet that all figures are drawn on: axes, with a title above them and a legend below.

Matplotlib's constrained layout places title, legend, colour bar and what stands beside the axes,
and makes room for them. Left to this file are where lines of text end, the number of columns of a
legend, and the height of a figure whose size nobody states.
"""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import rc_context, rcParams, rcParamsDefault
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from numpy.typing import NDArray

from cvxlimit.errors import InputError
from cvxlimit.plotting.contents import Bar
from cvxlimit.plotting.look import IMAGES, Saved

DPI = 150
"""Pixels per inch of figures."""

POINT = 1.0 / 72.0
"""Inches of a typographic point."""

WIDE = 6.5
"""Inches across from which a figure has letters of the size that Matplotlib's settings give."""

SMALLEST = 7.0
"""Points of the smallest letters, unless ``font.size`` is smaller: journals ask for 6 to 8."""

HEADING, KEY = 11.0, 8.0
"""Points of titles, and of legends and captions, where ``font.size`` is 10."""

BESIDE = 5.0
"""Inches across from which a colour bar stands beside the axes and not below them."""


@contextmanager
def boxes_for_missing_letters() -> Iterator[None]:
    """Without warnings of characters that the font lacks, which are boxes on the paper."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


class SceneFigure(Figure, Saved):
    """A Matplotlib figure that notebooks show without any set-up."""

    suffixes = IMAGES

    def _repr_png_(self) -> bytes:
        return self.file("png")

    def file(self, kind: str) -> bytes:
        """Returns the figure as a ``png``, ``svg`` or ``pdf``, the same bytes for the same figure;
        a character that the font lacks is a box."""
        buffer = io.BytesIO()
        dated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
        with boxes_for_missing_letters(), rc_context({"svg.hashsalt": "cvxlimit"}):
            self.savefig(buffer, format=kind, dpi=max(DPI, self.dpi), metadata=dated)
        return buffer.getvalue()

    def pixels(self) -> NDArray[np.uint8]:
        """The figure as an image (height, width, 3)."""
        canvas = FigureCanvasAgg(self)
        canvas.draw()  # type: ignore[no-untyped-call]
        shown = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return shown[:, :, :3].copy()


@dataclass(frozen=True, eq=False)
class Sheet:
    """Axes to draw into, those of the caller or in a figure of its own, and what is said of them.

    ``title`` is the caller's in place of the picture's own, ``legend`` whether there is one,
    ``is_own`` whether the figure holds nothing else, ``is_sized`` whether somebody stated its size.
    """

    figure: Any
    axes: Any
    title: str | None
    legend: bool
    is_own: bool
    is_sized: bool

    @classmethod
    def of(
        cls, usual: tuple[float, float], projection: str | None = None, *, ax: Any = None,
        figsize: tuple[float, float] | None = None, title: str | None = None, legend: bool = True,
    ) -> Sheet:  # fmt: skip
        """Options are those of :func:`cvxlimit.plotting.picture`, ``usual`` the inches of a figure
        whose size nobody states: neither the caller nor Matplotlib's settings."""
        if ax is not None and figsize is not None:
            raise InputError("ax has a size of its own: give ax or figsize, not both")
        if figsize is not None:
            size = np.asarray(figsize, dtype=float)
            if size.shape != (2,) or not (np.isfinite(size) & (size > 0.0)).all():
                raise InputError(f"figsize must be width and height in inches, got {figsize}")
        if ax is not None:
            figure = ax.get_figure(root=True)
            if figure.get_layout_engine() is None:
                figure.set_layout_engine("constrained")
            return cls(figure, ax, title, legend, is_own=False, is_sized=True)
        usual_one = list(rcParamsDefault["figure.figsize"])
        if figsize is None and list(rcParams["figure.figsize"]) != usual_one:
            figsize = rcParams["figure.figsize"]
        made = SceneFigure(figsize or usual, dpi=DPI, facecolor="white", layout="constrained")
        axes = made.add_subplot(projection=projection)
        return cls(made, axes, title, legend, is_own=True, is_sized=figsize is not None)

    @property
    def width(self) -> float:
        """Inches across: of the figure, or of the caller's axes in one."""
        share = 1.0 if self.is_own else self.axes.get_position(original=True).width
        return float(share * self.figure.get_figwidth())

    def letters(self, usual: float) -> float:
        """Points of letters that have ``usual`` in a wide figure where ``font.size`` is 10; four
        fifths of them in a narrow one."""
        base = float(rcParams["font.size"])
        narrow = min(1.0, max(0.8, self.width / WIDE))
        return max(usual * narrow * base / 10.0, min(SMALLEST, base))

    def write(self, title: str, caption: str = "", ink: str = "black") -> None:
        """Title, sizes of axes' labels, and a legend of all that was drawn with a label, which
        begins with the caption in the colour ``ink``."""
        heading, key, inner = self.letters(HEADING), self.letters(KEY), self.width - 0.2
        title = title if self.title is None else self.title
        text = "\n".join(lines_of(title, heading, inner))
        if self.is_own and text:
            self.figure.suptitle(text, fontsize=heading, parse_math=False)
        elif text:  # words stand beside a scene, whose axes are not shown
            pad = None if self.axes.axison else 14.0
            self.axes.set_title(text, fontsize=heading, pad=pad, parse_math=False)
        for axis in (getattr(self.axes, f"{name}axis", None) for name in "xyz"):
            if axis is not None:
                axis.label.set_size(self.letters(10.0))
                axis.set_tick_params(labelsize=self.letters(9.0))
        below = "\n".join(lines_of(caption, key, inner)) if title else ""
        self._write_legend(below, key, ink)

    def _write_legend(self, caption: str, key: float, ink: str) -> None:
        """The caption, and if there is to be a legend that below it, in letters of ``key`` points:
        below a figure, or a scene in the caller's axes; within those of a chart."""
        handles, labels = self.axes.get_legend_handles_labels() if self.legend else ([], [])
        if not (handles or caption):
            return
        if self.is_own and not handles:
            self.figure.supxlabel(caption, fontsize=key, color=ink, parse_math=False)
            return
        look: dict[str, Any] = {
            "ncols": columns_of(labels, key, self.width - 0.2), "fontsize": key, "frameon": False,
            "title": caption, "title_fontsize": key, "handlelength": 1.1, "handletextpad": 0.6,
            "columnspacing": 1.3, "labelspacing": 0.3,
        }  # fmt: skip
        if self.is_own:
            legend = self.figure.legend(handles, labels, loc="outside lower center", **look)
        elif self.axes.axison and handles:
            legend = self.axes.legend(handles, labels, **look | {"ncols": 1})
        else:
            look |= {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 3.0}
            legend = self.axes.legend(handles, labels, **look)
        legend.get_title().set(color=ink, parse_math=False, multialignment="center")
        for text in legend.get_texts():
            text.set_parse_math(False)

    def write_bar(self, bar: Bar) -> None:
        """A colour bar, beside wide axes and below narrow ones."""
        colours = LinearSegmentedColormap.from_list("bar", list(bar.stops))
        is_beside = self.width >= BESIDE
        shown = self.figure.colorbar(
            ScalarMappable(Normalize(0.0, 1.0), colours), ax=self.axes, shrink=0.7,
            location="right" if is_beside else "bottom", aspect=25, pad=0.02, panchor=(0.5, 0.5),
        )  # fmt: skip
        length = 0.7 * (self.figure.get_figheight() if is_beside else self.width)
        lines = lines_of(bar.label, self.letters(KEY), length)
        shown.set_label("\n".join(lines), fontsize=self.letters(KEY))
        shown.ax.tick_params(labelsize=self.letters(KEY), pad=2.0, length=2.5)

    @boxes_for_missing_letters()
    def lay_out(self) -> None:
        """Places all parts; twice, since words beside the axes move as these make room for them."""
        engine = self.figure.get_layout_engine()
        for _ in range(2 if engine else 0):
            engine.execute(self.figure)
        self.axes.apply_aspect()

    def scale(self) -> float:
        """Inches of a unit along axes of equal scales, as they are laid out."""
        ends = self.axes.transData.transform([(0.0, 0.0), (1.0, 0.0)])
        return float(ends[1, 0] - ends[0, 0]) / self.figure.dpi

    @boxes_for_missing_letters()
    def cut(self) -> None:
        """Ends a figure whose height nobody stated where the axes do."""
        if not self.is_sized:
            place = self.axes.get_position(original=True).transformed(self.figure.transFigure)
            spare = place.height - self.axes.get_tightbbox().height
            self.figure.set_figheight(self.figure.get_figheight() - spare / self.figure.dpi)


def measured(text: str, size: float) -> float:
    """Returns the width in inches of a line of text in letters of ``size`` points."""
    with boxes_for_missing_letters():
        extent = text_to_path.get_text_width_height_descent(text, FontProperties(size=size), False)
    return float(extent[0]) * POINT


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
    """Returns the largest number of columns of a legend that fit into ``width`` inches: each is as
    wide as its longest text, and 3.2 letters for the handle and the spaces beside it."""
    wide = [measured(text, size) + 3.2 * size * POINT for text in texts]
    for columns in range(len(texts), 1, -1):
        bounds = np.cumsum([0, *(len(part) for part in np.array_split(wide, columns))])
        if sum(max(wide[a:b]) for a, b in pairwise(bounds)) <= width:
            return columns
    return 1
