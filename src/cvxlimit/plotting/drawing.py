"""Figures of scenes: what is seen of blocks, what lies over them, and what is said beside them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.patheffects import withStroke

import cvxlimit.plotting.look as look
from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.plotting.annotations import Annotations, annotated
from cvxlimit.plotting.axes import coordinate_axes, draw_axis
from cvxlimit.plotting.camera import default_camera
from cvxlimit.plotting.contents import Drawing, Lines
from cvxlimit.plotting.picture import Fill, Seen, seen
from cvxlimit.plotting.sheet import DPI, WIDE, SceneFigure, Sheet
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import Motion
from cvxlimit.scene import Scene

ROOM, NARROWEST = np.array([7.6, 6.4]), 6.7
"""Inches that a scene takes, and the least width of a figure, where nobody states a size."""


def drawn(drawing: Drawing, **options: Any) -> SceneFigure:
    """Returns the figure of a drawing; options are those of :func:`cvxlimit.plotting.picture`."""
    return assembled(drawing, seen(drawing), **options)[0]


def assembled(drawing: Drawing, picture: Seen, **options: Any) -> tuple[SceneFigure, list[Artist]]:
    """Returns a figure around a scene, and the artists of what moves in it."""
    scene, camera, notes = drawing.scene, drawing.camera, drawing.notes
    coordinates = list(coordinate_axes(scene, camera)) if drawing.has_axes else []
    points = np.concatenate([_points(drawing, picture), *(each.ends for each in coordinates)])
    extent = np.ptp(points, axis=0)
    wide, tall = extent * (ROOM / extent).min()
    sheet = Sheet.of((max(wide + 1.7, NARROWEST), tall + 2.2), **options)
    axes = sheet.axes
    axes.set_axis_off()
    axes.set(xlim=_ends(points[:, 0]), ylim=_ends(points[:, 1]), aspect="equal")
    # The scene, and over it arrows, lines, dots and shapes; lines are finer in a small figure.
    weight = min(1.0, max(0.5, sheet.width / WIDE))
    moved = draw_seen(axes, picture, weight, drawing.glass)
    _draw_notes(axes, drawing, weight)
    if drawing.lines is not None:
        _draw_lines(axes, drawing, drawing.lines, weight)
    _draw_dots(axes, drawing, weight)
    _draw_shapes(axes, drawing, weight)
    # What is said of it, and coordinates, which have as many numbers as there is room for then.
    for key in _keys(drawing):
        axes.add_line(key)
    caption = f"refused: {notes.refusal}" if notes.refusal else drawing.caption
    ink = Style.mark if notes.refusal else Style.ink
    sheet.write(drawing.heading, look.printable(caption), ink)
    if drawing.bar is not None:
        sheet.write_bar(drawing.bar)
    sheet.lay_out()
    scale = sheet.scale()
    for each in coordinates:
        draw_axis(each, sheet, scale, scene.units.length)
    sheet.lay_out()
    sheet.cut()
    return sheet.figure, moved


def thumbnail(scene: Scene, moving: Motion, refusal: InputError | None, pixels: int = 420) -> bytes:
    """Returns a small picture without any words, as a PNG of so many pixels on its longer side."""
    notes = Annotations() if refusal is None else annotated(scene, refusal)
    drawing = Drawing(
        scene, moving, default_camera(scene, moving),
        notes=Annotations(marks=notes.marks, culprits=notes.culprits), has_axes=False,
    )  # fmt: skip
    picture = seen(drawing)
    extent = np.ptp(picture.bounds, axis=0)
    size = tuple(pixels / DPI * extent / extent.max())
    figure, _ = assembled(drawing, picture, figsize=size, title="", legend=False)
    figure.set_facecolor("none")
    return figure.file("png")


# --- what is seen of the scene -------------------------------------------------------------------


def draw_seen(axes: Axes, picture: Seen, weight: float, glass: bool = False) -> list[Artist]:
    """Draws faces, outlines and joints, lines ``weight`` times as wide as stated, and returns
    them."""
    line = 0.55 * weight
    added: list[Artist] = []
    if picture.ghost.rings:
        added.append(_fills(axes, [picture.ghost], 0.0))
        added.append(_lines(axes, picture.ghost_lines, Style.ghost, line, 2.1))
    if glass:
        added.append(_lines(axes, picture.lines, Style.glass, line, 2.15))
    if picture.fills:
        added.append(_fills(axes, picture.fills, 0.35 * line))
    colour, strength = (Style.glass, 0.45) if glass else (Style.face, 1.0)
    added.append(_lines(axes, picture.lines, colour, line, 2.4, strength))
    if picture.ghost.rings:
        added.append(_lines(axes, picture.ghost_lines, Style.shadow, line, 2.5, 0.13))
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
        axes.plot(*at.T, "o", ms=9 * weight, mfc="none", mec=Style.mark, mew=1.8 * weight,
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
        axes.plot(*at.T, "o", ms=size, mfc=Style.centre, mec="white", mew=0.25 * size**0.5,
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


def _points(drawing: Drawing, picture: Seen) -> FloatArray:
    """Returns points (n, 2) of the picture that must be in view."""
    spots = [np.array([mark.at for mark in drawing.notes.marks]).reshape(-1, 3)]
    spots += [np.array([arrow.tail, arrow.tip]) for arrow in drawing.notes.arrows]
    spots += [shape.points + shape.moves for shape in drawing.shapes]
    if drawing.lines is not None:
        spots.append(drawing.lines.ends.reshape(-1, 3))
    over = drawing.camera.project(np.concatenate(spots))[:, :2]
    return np.concatenate([picture.bounds, over])


# --- the legend ----------------------------------------------------------------------------------


def _keys(drawing: Drawing) -> Iterator[Line2D]:
    """Yields the legend's entries: joints, forces, shapes, blocks, loads, marks."""
    marking, notes, lines = drawing.marking, drawing.notes, drawing.lines
    unit, moves = drawing.scene.units.force, drawing.moving.moves
    if marking is not None:
        for kind in (kind for kind in marking.colours if kind in marking.texts):
            count = int((marking.kind == kind).sum())
            if count or moves:
                yield _key(f"{marking.texts[kind]} ({count})", marking.colours[kind])
    if lines is not None:
        largest = ""
        if lines.each is not None and len(lines.ends):
            longest = np.linalg.norm(lines.ends[:, 1] - lines.ends[:, 0], axis=1).max()
            largest = f", largest {longest / lines.each:.4g} {unit}"
        yield _key(lines.label + largest, lines.colour, "-")
    if drawing.dots is not None:
        yield _key("pressure centre", Style.centre, "o", ms=4.5, mec="white")
    for colour, label in drawing.keys:
        yield _key(label, colour)
    shapes = Counter((shape.label, shape.colour) for shape in drawing.shapes)
    for (label, colour), count in shapes.items():
        yield _key(f"{label} ({count})", colour)
    if moves:
        yield _key("undeformed", Style.ghost_key[0], mec=Style.ghost_key[1])
    else:
        stone = Style.stone if drawing.colours is None else Style.pale
        yield _key(drawing.blocks, "white" if drawing.glass else stone, mec=Style.glass)
    yield _key("support", Style.support)
    if notes.culprits:
        yield _key("refused", Style.culprit)
    for case in sorted({arrow.case for arrow in notes.arrows}):
        largest = f", largest {notes.largest[case]:.4g} {unit}" if case in notes.largest else ""
        yield _key(f"{case} load{largest}", look.CASE_COLOURS[case], "-")
    if notes.marks:
        label = "where it is wrong" if notes.refusal else f"near miss ({len(notes.marks)})"
        yield _key(label, Style.mark, "o", mfc="none", mew=1.4)


def _key(label: str, colour: str, marker: str = "s", **style: Any) -> Line2D:
    """Returns an entry of the legend: a square, a dot or, with "-", a line of a colour."""
    shape = {"lw": 2.2} if marker == "-" else {"ls": "none", "marker": marker}
    return Line2D(
        [], [], color=colour, label=look.printable(label), **(shape | {"ms": 7.0} | style)
    )


def _ends(values: FloatArray) -> tuple[float, float]:
    """Returns the least and the largest value, somewhat apart."""
    low, high = float(values.min()), float(values.max())
    pad = 0.01 * (high - low) or 1.0
    return low - pad, high + pad
