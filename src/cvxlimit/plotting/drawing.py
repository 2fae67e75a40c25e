"""The picture with title, axes, colour bar and legend: Matplotlib without a display."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgba
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

import cvxlimit.plotting.look as look
from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.plotting.annotations import Annotations, annotated
from cvxlimit.plotting.axes import Axes as Coordinates
from cvxlimit.plotting.camera import Camera, default_camera
from cvxlimit.plotting.contents import Bar, Drawing, Lines, Viewer, camera_for
from cvxlimit.plotting.look import IMAGES, Saved
from cvxlimit.plotting.picture import Fill, Seen, seen
from cvxlimit.plotting.sheet import (
    GLASS_LINE,
    KEYS,
    PAPER,
    Fit,
    Letters,
    Sheet,
    columns_of,
    contents_keys,
    fitted,
    lines_of,
    measured,
    notes_keys,
)
from cvxlimit.results.movement import Motion, still
from cvxlimit.scene import Scene

INK = "#4a4f57"
_FACE_LINE, _GHOST_LINE = "#4b4e53", "#b4b7bd"


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
        with warnings.catch_warnings(), rc_context({"svg.hashsalt": "cvxlimit"}):
            warnings.filterwarnings("ignore", message="Glyph .* missing from font")
            self.savefig(buffer, format=kind, dpi=max(PAPER.dpi, self.dpi), metadata=dated)
        return buffer.getvalue()

    def pixels(self) -> NDArray[np.uint8]:
        """The figure as an image (height, width, 3)."""
        canvas = FigureCanvasAgg(self)
        canvas.draw()  # type: ignore[no-untyped-call]
        shown = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return shown[:, :, :3].copy()


def scene_drawing(scene: Scene, viewer: Viewer, refusal: InputError | None) -> Drawing:
    """Returns what is drawn of a scene without an answer, with its ``refusal`` if there is one."""
    moving = still(scene)
    marking = None if refusal else look.scene_joints(scene)
    camera, notes = camera_for(scene, moving, viewer), annotated(scene, refusal)
    return Drawing(scene, moving, camera, look.scene_title(scene), marking=marking, notes=notes)


def drawn(drawing: Drawing, sheet: Sheet | None = None) -> SceneFigure:
    """Returns the figure of a drawing on a ``sheet``."""
    return assembled(drawing, seen(drawing), sheet or Sheet())[0]


def assembled(drawing: Drawing, picture: Seen, sheet: Sheet) -> tuple[SceneFigure, list[Artist]]:
    """Returns a figure around a scene, and the artists of what moves in it."""
    # Places of all parts in inches, then a figure of that size, or the caller's axes.
    parts = _Parts.of(drawing, picture, sheet)
    if sheet.ax is None:
        figure: Any = SceneFigure(parts.size, dpi=PAPER.dpi, facecolor="white")
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    else:
        axes = sheet.ax
        figure = axes.get_figure(root=True)
    axes.set_axis_off()
    axes.set_xlim(parts.low[0], parts.low[0] + parts.size[0] / parts.fit.scale)
    axes.set_ylim(parts.low[1], parts.low[1] + parts.size[1] / parts.fit.scale)
    axes.set_aspect("equal")
    # The scene, and over it arrows, lines, dots, shapes and coordinates; then texts and scales.
    weight = min(1.0, max(0.5, float(parts.fit.taken.max()) / PAPER.fine))
    moved = draw_seen(axes, picture, weight, drawing.glass)
    _draw_notes(axes, drawing, weight)
    if drawing.lines is not None:
        _draw_lines(axes, drawing, drawing.lines, weight)
    _draw_dots(axes, drawing, weight)
    _draw_shapes(axes, drawing, weight)
    if parts.coordinates is not None:
        _draw_axes(axes, parts.coordinates, parts.fit.scale)
    parts.write(figure if sheet.ax is None else axes, axes, drawing)
    parts.write_scales(axes, drawing, weight)
    return figure, moved


def thumbnail(
    scene: Scene,
    moving: Motion,
    refusal: InputError | None,
    pixels: int = 420,
    camera: Camera | None = None,
) -> bytes:
    notes = Annotations() if refusal is None else annotated(scene, refusal)
    drawing = Drawing(scene, moving, camera or default_camera(scene, moving), notes=notes)
    picture = seen(drawing)
    low, high = picture.bounds
    pad = 0.01 * (high - low).max()
    extent = high - low + 2.0 * pad
    size = pixels / PAPER.dpi * extent / extent.max()
    figure = SceneFigure(tuple(size), dpi=PAPER.dpi, facecolor="none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(low[0] - pad, high[0] + pad)
    axes.set_ylim(low[1] - pad, high[1] + pad)
    draw_seen(axes, picture, 0.5)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=PAPER.dpi)
    return buffer.getvalue()


# --- what is seen of the scene -------------------------------------------------------------------


def draw_seen(axes: Axes, picture: Seen, weight: float, glass: bool = False) -> list[Artist]:
    """Draws faces, outlines and joints, lines ``weight`` times as wide as stated, and returns
    them."""
    line = 0.55 * weight
    added: list[Artist] = []
    if picture.ghost.rings:
        added.append(_fills(axes, [picture.ghost], 0.0))
        added.append(_lines(axes, picture.ghost_lines, _GHOST_LINE, line, 2.1))
    if glass:
        added.append(_lines(axes, picture.lines, GLASS_LINE, line, 2.15))
    if picture.fills:
        added.append(_fills(axes, picture.fills, 0.35 * line))
    colour, strength = (GLASS_LINE, 0.45) if glass else (_FACE_LINE, 1.0)
    added.append(_lines(axes, picture.lines, colour, line, 2.4, strength))
    if picture.ghost.rings:
        added.append(_lines(axes, picture.ghost_lines, "#26263a", line, 2.5, 0.13))
    if len(picture.marks):
        marks = LineCollection(
            list(picture.marks), colors=picture.colours, linewidths=weight * picture.widths,
            capstyle="round", zorder=2.6,
        )  # fmt: skip
        added.append(axes.add_collection(marks, autolim=False))
    return added


def _fills(axes: Axes, fills: Sequence[Fill], seam: float) -> Artist:
    """Draws regions with a hairline of their own colour, without which paper shows between them."""
    paths = [
        Path.make_compound_path(*(Path(ring, closed=True) for ring in fill.rings)) for fill in fills
    ]
    colours = [fill.colour for fill in fills]
    collection = PathCollection(
        paths, facecolors=colours, edgecolors=colours, linewidths=seam, zorder=2.2,
        transform=axes.transData,
    )  # fmt: skip
    return axes.add_collection(collection, autolim=False)


def _lines(
    axes: Axes, lines: Sequence[FloatArray], colour: str, width: float, zorder: float,
    opacity: float = 1.0,
) -> Artist:  # fmt: skip
    collection = LineCollection(
        list(lines), colors=[to_rgba(colour, opacity)], linewidths=width, joinstyle="round",
        zorder=zorder,
    )  # fmt: skip
    return axes.add_collection(collection, autolim=False)


# --- what lies over it ---------------------------------------------------------------------------


def _draw_arrow(
    axes: Axes, ends: FloatArray, colour: Any, width: float, zorder: float, halo: bool
) -> None:
    """Draws an arrow from one point (2,) to another, its head no longer than half of it."""
    style = {
        "arrowstyle": "-|>,head_length=0.32,head_width=0.14", "lw": width, "color": colour,
        "shrinkA": 0, "shrinkB": 0, "mutation_scale": 6.0 + 6.0 * width, "joinstyle": "miter",
    }  # fmt: skip
    if halo:
        style["path_effects"] = [withStroke(linewidth=width + 1.2, foreground="#ffffffb0")]
    axes.annotate("", xy=tuple(ends[1]), xytext=tuple(ends[0]), zorder=zorder,
                  annotation_clip=False, arrowprops=style)  # fmt: skip


def _draw_notes(axes: Axes, drawing: Drawing, weight: float) -> None:
    """Draws arrows of loads and rings at places to look at."""
    for arrow in drawing.notes.arrows:
        ends = drawing.camera.project(np.array([arrow.tail, arrow.tip]))[:, :2]
        _draw_arrow(axes, ends, look.CASE_COLOURS[arrow.case], 2.2 * weight, 7.5, halo=True)
    if drawing.notes.marks:
        at = drawing.camera.project(np.array([mark.at for mark in drawing.notes.marks]))[:, :2]
        axes.plot(*at.T, "o", ms=9 * weight, mfc="none", mec=look.MARK_COLOUR, mew=1.8 * weight,
                  zorder=7, clip_on=False)  # fmt: skip


def _draw_lines(axes: Axes, drawing: Drawing, lines: Lines, weight: float) -> None:
    """Draws forces as lines, or as arrows where these have heads, thick ones last."""
    ends = drawing.camera.project(lines.ends.reshape(-1, 3))[:, :2].reshape(-1, 2, 2)
    opacity = np.ones(len(ends)) if lines.opacity is None else lines.opacity
    colours = np.array([to_rgba(lines.colour, a) for a in opacity.tolist()]).reshape(-1, 4)
    widths = weight * lines.widths
    order = np.argsort(lines.widths, kind="stable")
    if not lines.heads:
        halo = withStroke(linewidth=float(widths.max(initial=0.0)) + 1.0, foreground="#ffffff40")
        axes.add_collection(
            LineCollection(
                list(ends[order]), linewidths=widths[order], colors=colours[order], zorder=6,
                capstyle="round", path_effects=[halo] if lines.opacity is None else None,
            ),
            autolim=False,
        )  # fmt: skip
        return
    for k in order.tolist():
        _draw_arrow(axes, ends[k], tuple(colours[k]), float(widths[k]), 6.0, halo=False)


def _draw_dots(axes: Axes, drawing: Drawing, weight: float) -> None:
    """Draws pressure centres, smaller where there are many."""
    if drawing.dots is not None and len(drawing.dots):
        at = drawing.camera.project(drawing.dots)[:, :2]
        size = weight * float(np.clip(60.0 / np.sqrt(len(at)), 1.2, 4.0))
        axes.plot(*at.T, "o", ms=size, mfc=look.CENTRE_COLOUR, mec="white", mew=0.25 * size**0.5,
                  zorder=7)  # fmt: skip


def _draw_shapes(axes: Axes, drawing: Drawing, weight: float) -> None:
    """Draws crushed zones and ties where the mechanism moves them."""
    for shape in drawing.shapes:
        flat = drawing.camera.project(shape.points + shape.moves)[:, :2]
        if shape.is_zone:
            axes.fill(*flat.T, color=shape.colour, alpha=0.85, lw=2.0 * weight, zorder=6)
        else:
            axes.plot(*flat.T, "-o", color=shape.colour, lw=2.6 * weight, ms=4.0 * weight,
                      zorder=6.5, clip_on=False)  # fmt: skip


def _draw_axes(axes: Axes, coordinates: Coordinates, scale: float) -> None:
    """Draws coordinate axes with ticks and numbers."""
    ticks = [np.stack([at, at + away / scale]) for at, away in coordinates.ticks]
    axes.add_collection(
        LineCollection([*coordinates.lines, *ticks], colors=INK, linewidths=0.8, zorder=3),
        autolim=False,
    )
    for word in coordinates.words:
        x, y = word.away
        axes.annotate(
            word.text, word.at, (x / PAPER.point, y / PAPER.point), textcoords="offset points",
            ha=word.level, va=word.upright, fontsize=word.size, color=INK, annotation_clip=False,
            parse_math=False,
        )  # fmt: skip


# --- the sheet around it -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Parts:
    """A figure's parts and their places, in inches from its lower left corner."""

    size: tuple[float, float]
    letters: Letters
    heading: list[str]
    said: list[str]
    keys: list[Artist]
    columns: int
    bar: tuple[float, float, float, float] | None
    bar_label: str
    fit: Fit
    low: FloatArray
    coordinates: Coordinates | None

    @classmethod
    def of(cls, drawing: Drawing, picture: Seen, sheet: Sheet) -> _Parts:
        # The width decides the size of letters, and how many lines title and caption take.
        points, stated = _points(drawing, picture), sheet.size
        width = stated[0] if stated else _automatic(points)
        letters = Letters(width)
        inner = width - 2.0 * PAPER.pad
        refusal = drawing.notes.refusal
        title = drawing.heading if sheet.title is None else sheet.title
        caption = f"refused: {refusal}" if refusal else drawing.caption
        heading = lines_of(title, letters.heading, inner)
        below = lines_of(look.printable(caption) if title else "", letters.caption, inner)
        keys = [*contents_keys(drawing), *notes_keys(drawing.notes)] if sheet.legend else []
        texts = [str(key.get_label()) for key in keys]
        columns = columns_of(texts, letters.key, inner) if keys else 1
        rows = -(-len(keys) // columns)
        # Room above for texts and scales, below for the legend, beside or below for the colour bar.
        top = PAPER.pad + PAPER.point * (
            1.3 * letters.heading * len(heading) + 1.35 * letters.caption * len(below)
        )
        foot = PAPER.pad + PAPER.point * 1.5 * letters.key * rows
        bar_label, bar_room = _bar_room(drawing.bar, letters, inner, stated and stated[1])
        top += PAPER.scale_room * bool(drawing.scales)
        side = bar_room if letters.is_wide else 0.0
        foot += 0.0 if letters.is_wide else bar_room
        # The scene takes what is left, in the middle of it.
        tallest = stated[1] if stated else top + foot + PAPER.tallest
        room = np.array([inner - side, max(tallest - top - foot - 2.0 * PAPER.pad, 0.3 * tallest)])
        fit, coordinates = _in_view(drawing, points, letters, room)
        height = stated[1] if stated else top + foot + 2.0 * PAPER.pad + float(fit.taken[1])
        room[1] = height - top - foot - 2.0 * PAPER.pad
        place = np.array([PAPER.pad, foot + PAPER.pad]) + 0.5 * np.maximum(room - fit.taken, 0.0)
        bar = None
        if drawing.bar is not None:
            bar = (width - side + 0.05, foot + PAPER.pad + 0.22 * room[1], 0.15, 0.7 * room[1])
            if not letters.is_wide:
                bar = (0.18 * width, foot - 0.02 - 0.13, 0.64 * width, 0.09)
        return cls(
            (width, height), letters, heading, below, keys, columns, bar, bar_label, fit,
            fit.low - place / fit.scale, coordinates,
        )  # fmt: skip

    def write(self, host: Any, axes: Axes, drawing: Drawing) -> None:
        """Writes title, caption, legend and colour bar onto a figure or into axes."""
        width, height = self.size
        across = host.transFigure if isinstance(host, Figure) else host.transAxes
        colour = look.MARK_COLOUR if drawing.notes.refusal else INK
        top = height - PAPER.pad
        for lines, size, ink in (
            (self.heading, self.letters.heading, "black"), (self.said, self.letters.caption, colour)
        ):  # fmt: skip
            if lines:
                host.text(
                    0.5, top / height, "\n".join(lines), transform=across, ha="center", va="top",
                    fontsize=size, color=ink, parse_math=False, linespacing=1.15,
                )  # fmt: skip
            top -= 1.3 * size * PAPER.point * len(lines)
        if self.keys:
            host.legend(
                handles=self.keys, loc="lower center", ncols=self.columns,
                fontsize=self.letters.key, bbox_to_anchor=(0.5, 0.3 * PAPER.pad / height), **KEYS,
            )  # fmt: skip
        if self.bar is not None and drawing.bar is not None:
            x, y, wide, high = self.bar
            place = (x / width, y / height, wide / width, high / height)
            figure: Any = axes.get_figure(root=True)
            box = host.add_axes(place) if isinstance(host, Figure) else host.inset_axes(place)
            colours = LinearSegmentedColormap.from_list("bar", list(drawing.bar.stops))
            level = "vertical" if self.letters.is_wide else "horizontal"
            shown = figure.colorbar(
                ScalarMappable(Normalize(0.0, 1.0), colours), cax=box, orientation=level
            )
            shown.set_label(self.bar_label, fontsize=self.letters.key)
            shown.ax.tick_params(labelsize=self.letters.tick, pad=2.0, length=2.5)

    def write_scales(self, axes: Axes, drawing: Drawing, weight: float) -> None:
        """Draws in a row above the scene, for each kind of arrow to scale, a bar as long as a round
        force."""
        y = self.size[1] - 0.5 * PAPER.scale_room - PAPER.pad - PAPER.point * (
            1.3 * self.letters.heading * len(self.heading)
            + 1.35 * self.letters.caption * len(self.said)
        )  # fmt: skip
        right = self.size[0] - 3.0 * PAPER.pad
        for each, longest, colour in reversed(drawing.scales):
            force = _round_below(longest / each)
            text = f"{force:g} {look.printable(drawing.scene.units.force)}"
            end = self.low + np.array([right, y]) / self.fit.scale
            start = end - np.array([force * each, 0.0])
            _draw_arrow(axes, np.stack([start, end]), colour, 2.0 * weight, 7.0, halo=False)
            axes.annotate(
                text, tuple(start), (-4.0, 0.0), textcoords="offset points", ha="right",
                va="center", fontsize=self.letters.key, color=colour, annotation_clip=False,
                parse_math=False,
            )  # fmt: skip
            taken = force * each * self.fit.scale + measured(text, self.letters.key)
            right -= taken + 3.0 * PAPER.pad


def _round_below(value: float) -> float:
    """Returns the largest of 1, 2 and 5 times a power of ten that is not above ``value``."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(k * power for k in (1, 2, 5) if k * power <= value))


def _points(drawing: Drawing, picture: Seen) -> FloatArray:
    """Returns points (n, 2) of the picture that must be in view."""
    spots = [np.array([mark.at for mark in drawing.notes.marks]).reshape(-1, 3)]
    spots += [np.array([arrow.tail, arrow.tip]) for arrow in drawing.notes.arrows]
    spots += [shape.points + shape.moves for shape in drawing.shapes]
    if drawing.lines is not None:
        spots.append(drawing.lines.ends.reshape(-1, 3))
    over = drawing.camera.project(np.concatenate(spots))[:, :2]
    return np.concatenate([picture.bounds, over])


def _in_view(
    drawing: Drawing, points: FloatArray, letters: Letters, room: FloatArray
) -> tuple[Fit, Coordinates | None]:
    """Returns how the scene lies in ``room`` (2,) inches, and its coordinate axes if it has any."""
    if not drawing.has_axes:
        return fitted(points, (), room), None
    fit = fitted(points, (), 0.85 * room)
    for _ in range(2):  # ticks depend on the scale, and it on them
        coordinates = Coordinates.of(drawing.scene, drawing.camera, fit.scale, letters)
        fit = fitted(np.concatenate([points, *coordinates.lines]), coordinates.words, room)
    return fit, coordinates


def _automatic(points: FloatArray) -> float:
    """Returns the width in inches of a figure whose size was not stated."""
    width, height = np.ptp(points, axis=0)
    scale = min(PAPER.widest / width, PAPER.tallest / height)
    return float(max(scale * width + 1.7, PAPER.narrowest))


def _bar_room(
    bar: Bar | None, letters: Letters, inner: float, height: float | None
) -> tuple[str, float]:
    """Returns the bar's label in lines, and the inches it takes beside or below the scene."""
    if bar is None:
        return "", 0.0
    length = 0.6 * (height or 0.6 * inner) if letters.is_wide else inner
    lines = lines_of(bar.label, letters.key, length)
    each = PAPER.point * (1.3 * letters.key * len(lines) + 1.3 * letters.tick)
    return "\n".join(lines), each + (0.5 if letters.is_wide else 0.2)
