"""The picture with title, axes, colour bar and legend: Matplotlib without a display."""

from __future__ import annotations

import io
import textwrap
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage, imsave
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

import cvxlimit.plotting.look as look
from cvxlimit.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.plotting.annotations import Annotations, annotated
from cvxlimit.plotting.camera import Camera, default_camera, upright
from cvxlimit.plotting.contents import Bar, Drawing, Viewer, camera_for
from cvxlimit.plotting.look import IMAGES, Saved
from cvxlimit.plotting.movement import Motion, free_size, still
from cvxlimit.plotting.picture import SURROUNDINGS, Picture, paint, shown_bounds
from cvxlimit.scene import Scene

INK = "#4a4f57"


@dataclass(frozen=True)
class _Sheet:
    """Sizes of a figure: inches, letters in a line, and shares of the free blocks' size."""

    widest: float = 7.6  # that the painted part may take
    tallest: float = 6.4
    narrowest: float = 5.0  # below which title and legend would not fit
    left: float = 0.6  # for tick labels, colour bar, title and legend
    right: float = 1.1
    top: float = 0.6
    bottom: float = 0.55
    letters: int = 84  # of a caption in the narrowest picture
    line: float = 0.15  # from line to line
    heading_letters: int = 72
    heading_line: float = 0.2
    dpi: int = 150
    tick: float = 0.012  # length of a tick mark
    tick_spacing: float = 0.11  # least distance between tick labels


_SHEET = _Sheet()


class SceneFigure(Figure, Saved):
    """A Matplotlib figure that notebooks show without any set-up."""

    suffixes = IMAGES

    def _repr_png_(self) -> bytes:
        return self.file("png")

    def file(self, kind: str) -> bytes:
        """As a ``png``, ``svg`` or ``pdf``, the same bytes for the same figure; a character that
        the font lacks is a box."""
        buffer = io.BytesIO()
        dated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
        with warnings.catch_warnings(), rc_context({"svg.hashsalt": "cvxlimit"}):
            warnings.filterwarnings("ignore", message="Glyph .* missing from font")
            self.savefig(buffer, format=kind, dpi=_SHEET.dpi, metadata=dated)
        return buffer.getvalue()

    def pixels(self) -> NDArray[np.uint8]:
        """The figure as an image (height, width, 3)."""
        canvas = FigureCanvasAgg(self)
        canvas.draw()  # type: ignore[no-untyped-call]
        shown = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return shown[:, :, :3].copy()


def scene_drawing(scene: Scene, viewer: Viewer, refusal: InputError | None) -> Drawing:
    moving = still(scene)
    marking = None if refusal else look.scene_joints(scene)
    camera, notes = camera_for(scene, moving, viewer), annotated(scene, refusal)
    return Drawing(scene, moving, camera, look.scene_title(scene), marking=marking, notes=notes)


def drawn(drawing: Drawing, pixels: int = 1500) -> SceneFigure:
    return assembled(drawing, paint(drawing, pixels))[0]


def assembled(drawing: Drawing, picture: Picture) -> tuple[SceneFigure, AxesImage]:
    """A figure around a painted scene, and the artist that holds the image."""
    result = SceneFigure(dpi=_SHEET.dpi, facecolor="white")
    axes = result.add_axes((0.0, 0.0, 1.0, 1.0))
    frame = np.stack([picture.frame.low[:2], picture.frame.high[:2]])
    image = axes.imshow(
        picture.image,
        extent=(frame[0, 0], frame[1, 0], frame[0, 1], frame[1, 1]),
        interpolation="lanczos",
        interpolation_stage="rgba",
        zorder=2.0,
    )
    seen = [frame, _draw_notes(axes, drawing), _draw_lines(axes, drawing)]
    if drawing.has_axes:
        seen.append(_draw_axes(axes, drawing.scene, drawing.camera))
    seen.append(_draw_shapes(axes, drawing))
    refusal = drawing.notes.refusal
    said = textwrap.wrap(
        look.printable(f"refused: {refusal}" if refusal else drawing.caption), _SHEET.letters
    )
    heading = textwrap.wrap(drawing.heading, _SHEET.heading_letters)
    more = _SHEET.line * len(said) + _SHEET.heading_line * (len(heading) - 1)
    _arrange(result, axes, np.concatenate(seen), more)
    _draw_title(result, heading, said, look.MARK_COLOUR if refusal else INK)
    if drawing.bar is not None:
        _draw_colour_bar(result, axes, drawing.bar)
    _draw_legend(result, drawing)
    return result, image


def thumbnail(
    scene: Scene,
    moving: Motion,
    refusal: InputError | None,
    pixels: int = 420,
    camera: Camera | None = None,
) -> bytes:
    notes = Annotations() if refusal is None else annotated(scene, refusal)
    drawing = Drawing(scene, moving, camera or default_camera(scene, moving), notes=notes)
    buffer = io.BytesIO()
    imsave(buffer, np.clip(paint(drawing, pixels).image, 0.0, 1.0), format="png")
    return buffer.getvalue()


def _draw_notes(axes: Axes, drawing: Drawing) -> FloatArray:
    taken = [np.empty((0, 2))]
    for arrow in drawing.notes.arrows:
        ends = drawing.camera.project(np.array([arrow.tail, arrow.tip]))[:, :2]
        taken.append(ends)
        axes.annotate(
            "", xy=tuple(ends[1]), xytext=tuple(ends[0]), zorder=6, annotation_clip=False,
            arrowprops={
                "arrowstyle": "-|>,head_length=0.5,head_width=0.22", "lw": 2.2,
                "color": look.CASE_COLOURS[arrow.case], "shrinkA": 0, "shrinkB": 0,
                "path_effects": [withStroke(linewidth=3.6, foreground="#ffffffb0")],
            },
        )  # fmt: skip
    if drawing.notes.marks:
        at = drawing.camera.project(np.array([mark.at for mark in drawing.notes.marks]))[:, :2]
        taken.append(at)
        axes.plot(
            *at.T, "o", ms=9, mfc="none", mec=look.MARK_COLOUR, mew=1.8, zorder=7, clip_on=False
        )
    return np.concatenate(taken)


def _draw_lines(axes: Axes, drawing: Drawing) -> FloatArray:
    taken = np.empty((0, 2))
    if drawing.lines is not None:
        taken = drawing.camera.project(drawing.lines.ends.reshape(-1, 3))[:, :2]
        axes.add_collection(
            LineCollection(
                list(taken.reshape(-1, 2, 2)), linewidths=drawing.lines.widths,
                colors=drawing.lines.colour, zorder=6, capstyle="round",
                path_effects=[withStroke(linewidth=1.0, foreground="#ffffff60")],
            ),
            autolim=False,
        )  # fmt: skip
    if drawing.dots is not None and len(drawing.dots):
        at = drawing.camera.project(drawing.dots)[:, :2]
        size = float(np.clip(60.0 / np.sqrt(len(at)), 1.2, 5.0))
        axes.plot(*at.T, "o", ms=size, mfc=look.CENTRE_COLOUR, mec="white", mew=0.25 * size**0.5,
                  zorder=7)  # fmt: skip
    return taken


def _draw_shapes(axes: Axes, drawing: Drawing) -> FloatArray:
    taken = [np.empty((0, 2))]
    for shape in drawing.shapes:
        flat = drawing.camera.project(shape.points + shape.moves)[:, :2]
        if shape.is_zone:
            axes.fill(*flat.T, color=shape.colour, alpha=0.85, lw=2.0, zorder=6)
        else:
            axes.plot(*flat.T, "-o", color=shape.colour, lw=2.6, ms=4.0, zorder=6.5, clip_on=False)
        taken.append(flat)
    kinds = Counter((shape.label, shape.colour) for shape in drawing.shapes)
    for k, ((label, colour), count) in enumerate(kinds.items()):
        axes.text(
            0.99, 0.99 - 0.045 * k, f"{label} ({count})", color=colour, fontsize=8.5,
            weight="bold", transform=axes.transAxes, ha="right", va="top", zorder=8,
        )  # fmt: skip
    return np.concatenate(taken)


def _arrange(result: Figure, axes: Axes, seen: FloatArray, more: float) -> None:
    """Fit the figure around the points (n, 2) in view, with ``more`` inches above them."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height = high - low
    scale = min(_SHEET.widest / width, _SHEET.tallest / height)
    inner = np.array([max(scale * width, _SHEET.narrowest), scale * height])
    outer = inner + np.array([_SHEET.left + _SHEET.right, _SHEET.top + more + _SHEET.bottom])
    result.set_size_inches(*outer)
    axes.set_position((_SHEET.left / outer[0], _SHEET.bottom / outer[1], *(inner / outer)))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_title(result: Figure, heading: list[str], said: list[str], colour: str) -> None:
    height = result.get_figheight()
    below = 0.4 + _SHEET.heading_line * (len(heading) - 1)
    parts = (heading, 0.24, 11.0, "black"), (said, below + 0.08, 8.5, colour)
    for lines, top, size, ink in parts:
        result.text(
            0.5, 1.0 - top / height, "\n".join(lines),
            ha="center", va="top", fontsize=size, color=ink, parse_math=False,
        )  # fmt: skip


def _draw_colour_bar(result: Figure, axes: Axes, bar_of: Bar) -> None:
    colours = LinearSegmentedColormap.from_list("bar", list(bar_of.stops))
    box = axes.get_position()
    width = result.get_figwidth()
    bar = result.add_axes(
        (box.x1 + 0.25 / width, box.y0 + 0.28 * box.height, 0.16 / width, 0.68 * box.height)
    )
    drawn = result.colorbar(ScalarMappable(Normalize(0.0, 1.0), colours), cax=bar)
    drawn.set_label(bar_of.label, fontsize=8)
    drawn.ax.tick_params(labelsize=8)


def _draw_legend(result: Figure, drawing: Drawing) -> None:
    handles = [*_contents_keys(drawing), *_notes_keys(drawing.notes)]
    columns = min(len(handles), max(3, int(result.get_figwidth() / 1.25)))
    result.legend(
        handles=handles, loc="lower center", ncols=columns, frameon=False, fontsize=8,
        bbox_to_anchor=(0.5, 0.0), handlelength=1.1, handleheight=0.9, columnspacing=1.4,
    )  # fmt: skip


def _contents_keys(drawing: Drawing) -> Iterator[Artist]:
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
        yield _ring("pressure centre", ms=5, mfc=look.CENTRE_COLOUR, mec="white")
    if moves:
        yield Patch(facecolor="#e9ebee", edgecolor="#9aa0ab", label="undeformed")
    else:
        yield Patch(color=look.STONE_COLOUR, label=drawing.blocks)
    yield Patch(color=look.SUPPORT_COLOUR, label="support")


def _notes_keys(notes: Annotations) -> Iterator[Artist]:
    if notes.culprits:
        yield Patch(color=look.CULPRIT_COLOUR, label="refused")
    for case in sorted({arrow.case for arrow in notes.arrows}):
        yield Line2D([], [], color=look.CASE_COLOURS[case], lw=2.2, label=f"{case} load")
    if notes.marks:
        label = "where it is wrong" if notes.refusal else f"near miss ({len(notes.marks)})"
        yield _ring(label, ms=7, mfc="none", mec=look.MARK_COLOUR, mew=1.6)


def _ring(label: str, **look: Any) -> Line2D:
    return Line2D([], [], ls="none", marker="o", label=label, **look)


def _draw_axes(axes: Axes, scene: Scene, camera: Camera) -> FloatArray:
    """Axes along the free blocks, level ones in front, the upright one left."""
    bounds, size, up = shown_bounds(scene), free_size(scene), upright(scene)
    pole = int(np.abs(up).argmax())
    level = [axis for axis in range(3) if axis != pole]
    low, high = bounds + np.array([[-1.0], [1.0]]) * (SURROUNDINGS + 0.03) * size
    front = np.where(camera.axes[2] >= 0.0, high, low)
    left = np.where(camera.axes[0] >= 0.0, low, high)
    front[pole] = left[pole] = low[pole] if up[pole] > 0.0 else high[pole]
    towards = np.diag(np.where(camera.axes[2] >= 0.0, 1.0, -1.0))
    seen = [
        _draw_axis(axes, scene, camera, axis, front, towards[other])
        for axis, other in (level, level[::-1])
    ]
    seen.append(_draw_axis(axes, scene, camera, pole, left, -camera.axes[0]))
    return np.concatenate(seen)


def _draw_axis(
    axes: Axes, scene: Scene, camera: Camera, axis: int, through: FloatArray, outward: FloatArray
) -> FloatArray:
    size = free_size(scene)
    along, aside = camera.axes[:2, axis], camera.axes[:2] @ outward
    shown = float(np.linalg.norm(along))
    if abs(along[0] * aside[1] - along[1] * aside[0]) < 0.05 * shown or shown < 0.05:
        return np.empty((0, 2))
    low, high = shown_bounds(scene)[:, axis]
    ticks = _ticks(low, high, int((high - low) * shown / (_SHEET.tick_spacing * size)))
    line = np.tile(through, (len(ticks) + 2, 1))
    line[:, axis] = [low, *ticks, high]
    base = line @ camera.axes[:2].T
    step = _SHEET.tick * size * aside / max(float(np.linalg.norm(aside)), 0.5)
    axes.plot(*base[[0, -1]].T, color=INK, lw=0.8, clip_on=False, zorder=3)
    for value, at in zip(ticks, base[1:-1], strict=True):
        axes.plot(*np.stack([at, at + step]).T, color=INK, lw=0.8, clip_on=False, zorder=3)
        _write(axes, f"{value:.10g}", at + 1.7 * step, aside, 7.5)
    range_text = "" if len(ticks) else f" {low:.4g} to {high:.4g}"
    name = f"{'xyz'[axis]}{range_text} ({scene.units.length})"
    middle = base[[0, -1]].mean(axis=0, keepdims=True)
    away = 6.5 if len(ticks) else 1.7
    _write(axes, name, middle[0] + away * step, aside, 9.0)
    return np.concatenate([base, base[1:-1] + 4.5 * step, middle + (away + 2.5) * step])


def _ticks(low: float, high: float, room: int) -> FloatArray:
    if room < 1:
        return np.empty(0)
    locator = MaxNLocator(min(room, 8), steps=[1, 2, 2.5, 5, 10])
    found = np.asarray(locator.tick_values(low, high), dtype=float)
    slack = 1e-9 * (high - low)
    inside: FloatArray = found[(found >= low - slack) & (found <= high + slack)]
    return inside if len(inside) > 1 else np.array([low, high])


def _write(axes: Axes, text: str, at: FloatArray, aside: FloatArray, size: float) -> None:
    level = "center" if abs(aside[0]) < 0.3 else "left" if aside[0] > 0 else "right"
    upright = "center" if abs(aside[1]) < 0.2 else "bottom" if aside[1] > 0 else "top"
    axes.text(
        at[0], at[1], text, ha=level, va=upright, fontsize=size, color=INK,
        clip_on=False, parse_math=False,
    )  # fmt: skip
