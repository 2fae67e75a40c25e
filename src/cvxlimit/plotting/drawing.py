"""The picture with title, axes, colour bar and legend: Matplotlib without a display."""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage, imsave
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from cvxlimit.errors import InputError
from cvxlimit.plotting.annotations import Annotations, Decal, Marking, annotated, joint_kinds
from cvxlimit.plotting.axes import INK, draw_axes
from cvxlimit.plotting.camera import Camera, camera_from, default_camera
from cvxlimit.plotting.look import (
    CASE_COLOURS,
    CULPRIT_COLOUR,
    JOINT_COLOURS,
    JOINT_TEXTS,
    MARK_COLOUR,
    STONE_COLOUR,
    SUPPORT_COLOUR,
    printable,
    scene_title,
)  # fmt: skip
from cvxlimit.plotting.movement import Motion, motion, still
from cvxlimit.plotting.picture import Picture, Pixels, paint
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

FloatArray = NDArray[np.float64]

WIDEST, TALLEST = 7.6, 6.4
"""Inches that the painted part may take."""

NARROWEST = 5.0
"""Inches below which title and legend would not fit."""

LEFT, RIGHT, TOP, BOTTOM = 0.6, 1.1, 0.6, 0.55
"""Inches around the painted part for tick labels, colour bar, title and legend."""

LETTERS, LINE = 84, 0.15
HEADING_LETTERS, HEADING_LINE = 72, 0.2
"""Letters in a line of a caption and of a title that the narrowest picture holds, and inches from
line to line."""

DPI = 150


class SceneFigure(Figure):
    """A Matplotlib figure that notebooks show without any set-up."""

    def _repr_png_(self) -> bytes:
        return self.file("png")

    def file(self, kind: str) -> bytes:
        """The figure as a ``png``, ``svg`` or ``pdf``; a character that the font lacks is a box.

        The same figure gives the same bytes.
        """
        buffer = io.BytesIO()
        dated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
        with warnings.catch_warnings(), rc_context({"svg.hashsalt": "cvxlimit"}):
            warnings.filterwarnings("ignore", message="Glyph .* missing from font")
            self.savefig(buffer, format=kind, dpi=DPI, metadata=dated)
        return buffer.getvalue()


Overlay = Callable[[Axes, Camera], FloatArray]
"""Draws over the painted scene, and returns the points (n, 2) that must be in view."""


@dataclass(frozen=True)
class Bar:
    """A colour bar: colours from its lower to its upper end, and what it measures."""

    stops: Sequence[str]
    label: str
    ends: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Drawing:
    """What a figure consists of besides the scene.

    Attributes
    ----------
    heading, caption : str
        First line, and a second one in smaller letters.
    marking : Marking or None
        Joints to outline, which are also in the legend if ``has_key``.
    notes : Annotations
        Arrows of loads, near misses, a refusal.
    colours : (n_blocks, 3) array or None
        Of blocks, in place of those of their speed.
    decals : sequence of Decal
    bar : Bar or None
    handles : sequence of Artist
        Further entries of the legend.
    overlay : callable or None
    blocks : str
        What the legend calls blocks that do not move.
    has_axes : bool
        False where places are not those of the scene.
    """

    heading: str
    caption: str = ""
    marking: Marking | None = None
    has_key: bool = True
    notes: Annotations = field(default_factory=Annotations)
    colours: FloatArray | None = None
    decals: Sequence[Decal] = ()
    bar: Bar | None = None
    handles: Sequence[Artist] = ()
    overlay: Overlay | None = None
    blocks: str = "block"
    has_axes: bool = True


def scene_figure(
    scene: Scene,
    viewer: tuple[float, float, float] | None = None,
    refusal: InputError | None = None,
) -> SceneFigure:
    """A scene that is not solved: joints by how they lie, loads, near misses, or the culprits."""
    moving = still(scene)
    notes = annotated(scene, refusal)
    drawing = Drawing(scene_title(scene), marking=_joints(scene, refusal), notes=notes)
    return drawn(scene, moving, camera_for(scene, moving, viewer), drawing)


def _joints(scene: Scene, refusal: InputError | None) -> Marking | None:
    if refusal is not None:
        return None
    kind = joint_kinds(scene, scene.contacts)
    return Marking(scene.contacts, kind, JOINT_COLOURS, JOINT_TEXTS)


def camera_for(scene: Scene, moving: Motion, viewer: tuple[float, float, float] | None) -> Camera:
    """The camera in direction ``viewer``, or the one that shows the movement."""
    return default_camera(scene, moving) if viewer is None else camera_from(scene, viewer)


def drawn(
    scene: Scene, moving: Motion, camera: Camera, drawing: Drawing, pixels: int = 1500
) -> SceneFigure:
    """The figure: painted scene, axes, title, legend, colour bar, and what lies over them."""
    notes = drawing.notes
    picture = paint(
        scene, moving, camera, pixels, drawing.marking, notes.culprits, drawing.colours,
        drawing.decals,
    )  # fmt: skip
    return assembled(scene, moving, camera, drawing, picture)[0]


def assembled(
    scene: Scene, moving: Motion, camera: Camera, drawing: Drawing, picture: Picture
) -> tuple[SceneFigure, AxesImage]:
    """A figure around a painted scene, and the artist that holds the image."""
    notes = drawing.notes
    result = SceneFigure(dpi=DPI, facecolor="white")
    axes = result.add_axes((0.0, 0.0, 1.0, 1.0))
    frame = np.stack([picture.frame.low[:2], picture.frame.high[:2]])
    image = axes.imshow(
        picture.image,
        extent=(frame[0, 0], frame[1, 0], frame[0, 1], frame[1, 1]),
        interpolation="lanczos",
        interpolation_stage="rgba",
        zorder=2.0,
    )
    seen = [frame, _draw_notes(axes, camera, notes)]
    if drawing.has_axes:
        seen.append(draw_axes(axes, scene, camera))
    if drawing.overlay is not None:
        seen.append(drawing.overlay(axes, camera))
    said = _wrapped(f"refused: {notes.refusal}" if notes.refusal else drawing.caption)
    heading = textwrap.wrap(drawing.heading, HEADING_LETTERS)
    more = LINE * len(said) + HEADING_LINE * (len(heading) - 1)
    _arrange(result, axes, np.concatenate(seen), more)
    _draw_title(result, heading, said, MARK_COLOUR if notes.refusal else INK)
    if drawing.bar is not None:
        _draw_colour_bar(result, axes, drawing.bar)
    _draw_legend(result, moving, drawing)
    return result, image


def thumbnail(scene: Scene, solution: Solution, pixels: int = 420) -> bytes:
    """A small PNG of the mechanism: no axes, no title."""
    moving = motion(scene, solution)
    picture = paint(scene, moving, default_camera(scene, moving), pixels)
    return _plain_png(picture.image)


def scene_thumbnail(scene: Scene, refusal: InputError | None, pixels: int = 420) -> bytes:
    """A small PNG of a scene that is not solved."""
    moving = still(scene)
    culprits = annotated(scene, refusal).culprits
    camera = default_camera(scene, moving)
    return _plain_png(paint(scene, moving, camera, pixels, culprits=culprits).image)


def _plain_png(image: Pixels) -> bytes:
    buffer = io.BytesIO()
    imsave(buffer, np.clip(image, 0.0, 1.0), format="png")
    return buffer.getvalue()


def _draw_notes(axes: Axes, camera: Camera, notes: Annotations) -> FloatArray:
    """Arrows and rings over everything else; returns the points (n, 2) they take."""
    taken = [np.empty((0, 2))]
    for arrow in notes.arrows:
        ends = camera.project(np.array([arrow.tail, arrow.tip]))[:, :2]
        taken.append(ends)
        axes.annotate(
            "", xy=tuple(ends[1]), xytext=tuple(ends[0]), zorder=6, annotation_clip=False,
            arrowprops={
                "arrowstyle": "-|>,head_length=0.5,head_width=0.22", "lw": 2.2,
                "color": CASE_COLOURS[arrow.case], "shrinkA": 0, "shrinkB": 0,
                "path_effects": [withStroke(linewidth=3.6, foreground="#ffffffb0")],
            },
        )  # fmt: skip
    if notes.marks:
        at = camera.project(np.array([mark.at for mark in notes.marks]))[:, :2]
        taken.append(at)
        axes.plot(
            *at.T, "o", ms=9, mfc="none", mec=MARK_COLOUR, mew=1.8, zorder=7, clip_on=False
        )  # fmt: skip
    return np.concatenate(taken)


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(printable(text), LETTERS)


def _arrange(result: Figure, axes: Axes, seen: FloatArray, more: float) -> None:
    """Fit the figure around the points (n, 2) in view, with ``more`` inches above them."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height = high - low
    scale = min(WIDEST / width, TALLEST / height)
    inner = np.array([max(scale * width, NARROWEST), scale * height])
    outer = inner + np.array([LEFT + RIGHT, TOP + more + BOTTOM])
    result.set_size_inches(*outer)
    axes.set_position((LEFT / outer[0], BOTTOM / outer[1], *(inner / outer)))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_title(result: Figure, heading: list[str], said: list[str], colour: str) -> None:
    height = result.get_figheight()
    below = 0.4 + HEADING_LINE * (len(heading) - 1)
    result.text(
        0.5, 1.0 - 0.24 / height, "\n".join(heading),
        ha="center", va="top", fontsize=11, parse_math=False,
    )  # fmt: skip
    result.text(
        0.5, 1.0 - (below + 0.08) / height, "\n".join(said),
        ha="center", va="top", fontsize=8.5, color=colour, parse_math=False,
    )  # fmt: skip


def _draw_colour_bar(result: Figure, axes: Axes, bar_of: Bar) -> None:
    colours = LinearSegmentedColormap.from_list("bar", list(bar_of.stops))
    box = axes.get_position()
    width = result.get_figwidth()
    bar = result.add_axes(
        (box.x1 + 0.25 / width, box.y0 + 0.28 * box.height, 0.16 / width, 0.68 * box.height)
    )
    drawn = result.colorbar(ScalarMappable(Normalize(*bar_of.ends), colours), cax=bar)
    drawn.set_label(bar_of.label, fontsize=8)
    drawn.ax.tick_params(labelsize=8)


def _draw_legend(result: Figure, moving: Motion, drawing: Drawing) -> None:
    handles: list[Artist] = []
    marking, notes = drawing.marking, drawing.notes
    if marking is not None and drawing.has_key:
        for kind, colour in marking.colours.items():
            count = int((marking.kind == kind).sum())
            if count or moving.moves:
                handles.append(Patch(color=colour, label=f"{marking.texts[kind]} ({count})"))
    handles += drawing.handles
    if moving.moves:
        handles.append(Patch(facecolor="#e9ebee", edgecolor="#9aa0ab", label="undeformed"))
    else:
        handles.append(Patch(color=STONE_COLOUR, label=drawing.blocks))
    handles.append(Patch(color=SUPPORT_COLOUR, label="support"))
    if notes.culprits:
        handles.append(Patch(color=CULPRIT_COLOUR, label="refused"))
    cases = sorted({arrow.case for arrow in notes.arrows})
    handles += [
        Line2D([], [], color=CASE_COLOURS[case], lw=2.2, label=f"{case} load") for case in cases
    ]
    if notes.marks:
        label = "where it is wrong" if notes.refusal else f"near miss ({len(notes.marks)})"
        ring = {"marker": "o", "ms": 7, "mfc": "none", "mec": MARK_COLOUR, "mew": 1.6}
        handles.append(Line2D([], [], ls="none", label=label, **ring))  # type: ignore[arg-type]
    columns = min(len(handles), max(3, int(result.get_figwidth() / 1.25)))
    result.legend(
        handles=handles, loc="lower center", ncols=columns, frameon=False, fontsize=8,
        bbox_to_anchor=(0.5, 0.0), handlelength=1.1, handleheight=0.9, columnspacing=1.4,
    )  # fmt: skip
