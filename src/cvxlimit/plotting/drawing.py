"""The picture with title, axes, colour bar and legend: Matplotlib without a display."""

from __future__ import annotations

import io
import textwrap
import warnings

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from cvxlimit.errors import InputError
from cvxlimit.plotting.annotations import Annotations, Marking, annotated, joint_kinds
from cvxlimit.plotting.axes import draw_axes
from cvxlimit.plotting.camera import Camera, camera_from, default_camera
from cvxlimit.plotting.crushing import Overlay, overlay
from cvxlimit.plotting.look import (
    CASE_COLOURS,
    CULPRIT_COLOUR,
    JOINT_COLOURS,
    JOINT_TEXTS,
    KIND_COLOURS,
    KIND_TEXTS,
    MARK_COLOUR,
    SPEED_STOPS,
    SPEED_TEXT,
    STONE_COLOUR,
    SUPPORT_COLOUR,
    printable,
    scene_title,
    title,
)  # fmt: skip
from cvxlimit.plotting.movement import Motion, motion, still
from cvxlimit.plotting.picture import paint
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
"""Letters in a line of a refusal, of the narrowest picture, and inches from line to line."""

DPI = 150


class SceneFigure(Figure):
    """A Matplotlib figure that notebooks show without any set-up."""

    def _repr_png_(self) -> bytes:
        return png(self)


def figure(
    scene: Scene, solution: Solution, viewer: tuple[float, float, float] | None = None
) -> SceneFigure:
    """The mechanism as a Matplotlib figure.

    Parameters
    ----------
    scene, solution
        What was solved, and the result.
    viewer : (3,) or None
        Direction from the scene towards the viewer; chosen from the movement if None.
    """
    moving = motion(scene, solution)
    kinds = {kind: KIND_COLOURS[kind] for kind in KIND_COLOURS if moving.moves}
    marking = Marking(scene.contacts, moving.contacts.kind, kinds, KIND_TEXTS)
    over = overlay(scene, solution)
    return _drawn(scene, moving, viewer, title(solution), marking, annotated(scene), over)


def scene_figure(
    scene: Scene,
    viewer: tuple[float, float, float] | None = None,
    refusal: InputError | None = None,
) -> SceneFigure:
    """A scene that is not solved: joints by how they lie, loads, near misses, or the culprits."""
    marking = None
    if refusal is None:
        kind = joint_kinds(scene, scene.contacts)
        marking = Marking(scene.contacts, kind, JOINT_COLOURS, JOINT_TEXTS)
    return _drawn(
        scene, still(scene), viewer, scene_title(scene), marking, annotated(scene, refusal)
    )


def _drawn(
    scene: Scene,
    moving: Motion,
    viewer: tuple[float, float, float] | None,
    heading: str,
    marking: Marking | None,
    notes: Annotations,
    over: Overlay | None = None,
) -> SceneFigure:
    camera = default_camera(scene, moving) if viewer is None else camera_from(scene, viewer)
    picture = paint(scene, moving, camera, marking=marking, culprits=notes.culprits)
    result = SceneFigure(dpi=DPI, facecolor="white")
    axes = result.add_axes((0.0, 0.0, 1.0, 1.0))
    frame = np.stack([picture.frame.low[:2], picture.frame.high[:2]])
    axes.imshow(
        picture.image,
        extent=(frame[0, 0], frame[1, 0], frame[0, 1], frame[1, 1]),
        interpolation="lanczos",
        interpolation_stage="rgba",
        zorder=2.0,
    )
    seen = [frame, draw_axes(axes, scene, camera), _draw_notes(axes, camera, notes)]
    if over is not None:
        seen.append(over(axes, camera))
    said = _wrapped(notes.refusal)
    _arrange(result, axes, np.concatenate(seen), LINE * len(said))
    _draw_title(result, heading, said)
    if moving.moves:
        _draw_colour_bar(result, axes)
    _draw_legend(result, moving, marking, notes)
    return result


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


def png(drawn: Figure) -> bytes:
    """The PNG file of a figure; a character that the font lacks shows as a box."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        FigureCanvasAgg(drawn).print_figure(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def _wrapped(refusal: str) -> list[str]:
    return textwrap.wrap(printable(f"refused: {refusal}"), LETTERS) if refusal else []


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


def _draw_title(result: Figure, heading: str, refusal: list[str]) -> None:
    result.text(
        0.5, 1.0 - 0.32 / result.get_figheight(), heading,
        ha="center", va="center", fontsize=11, parse_math=False, wrap=True,
    )  # fmt: skip
    result.text(
        0.5, 1.0 - 0.48 / result.get_figheight(), "\n".join(refusal),
        ha="center", va="top", fontsize=8.5, color=MARK_COLOUR, parse_math=False,
    )  # fmt: skip


def _draw_colour_bar(result: Figure, axes: Axes) -> None:
    colours = LinearSegmentedColormap.from_list("speed", SPEED_STOPS)
    box = axes.get_position()
    width = result.get_figwidth()
    bar = result.add_axes(
        (box.x1 + 0.25 / width, box.y0 + 0.28 * box.height, 0.16 / width, 0.68 * box.height)
    )
    drawn = result.colorbar(ScalarMappable(Normalize(0.0, 1.0), colours), cax=bar)
    drawn.set_label(SPEED_TEXT, fontsize=8)
    drawn.ax.tick_params(labelsize=8)


def _draw_legend(
    result: Figure, moving: Motion, marking: Marking | None, notes: Annotations
) -> None:
    handles: list[Artist] = []
    if marking is not None:
        for kind, colour in marking.colours.items():
            count = int((marking.kind == kind).sum())
            if count or moving.moves:
                handles.append(Patch(color=colour, label=f"{marking.texts[kind]} ({count})"))
    if moving.moves:
        handles.append(Patch(facecolor="#e9ebee", edgecolor="#9aa0ab", label="undeformed"))
    else:
        label = "block (no mechanism)" if moving.is_solved else "block"
        handles.append(Patch(color=STONE_COLOUR, label=label))
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
