"""The picture with title, axes, colour bar and legend: Matplotlib without a display."""

from __future__ import annotations

import io
import warnings

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from cvxlimit.plotting.axes import draw_axes
from cvxlimit.plotting.camera import camera_from, default_camera
from cvxlimit.plotting.look import (
    KIND_COLOURS,
    KIND_TEXTS,
    SPEED_STOPS,
    SPEED_TEXT,
    STONE_COLOUR,
    SUPPORT_COLOUR,
    title,
)  # fmt: skip
from cvxlimit.plotting.movement import Motion, motion
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
    camera = default_camera(scene, moving) if viewer is None else camera_from(scene, viewer)
    picture = paint(scene, moving, camera)
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
    _arrange(result, axes, np.concatenate([frame, draw_axes(axes, scene, camera)]))
    _draw_title(result, solution)
    if moving.moves:
        _draw_colour_bar(result, axes)
    _draw_legend(result, moving)
    return result


def png(drawn: Figure) -> bytes:
    """The PNG file of a figure; a character that the font lacks shows as a box."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        FigureCanvasAgg(drawn).print_figure(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def _arrange(result: Figure, axes: Axes, seen: FloatArray) -> None:
    """Fit the figure around the points (n, 2) that must be in view."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height = high - low
    scale = min(WIDEST / width, TALLEST / height)
    inner = np.array([max(scale * width, NARROWEST), scale * height])
    outer = inner + np.array([LEFT + RIGHT, TOP + BOTTOM])
    result.set_size_inches(*outer)
    axes.set_position((LEFT / outer[0], BOTTOM / outer[1], *(inner / outer)))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_title(result: Figure, solution: Solution) -> None:
    result.text(
        0.5, 1.0 - 0.32 / result.get_figheight(), title(solution),
        ha="center", va="center", fontsize=11, parse_math=False, wrap=True,
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


def _draw_legend(result: Figure, moving: Motion) -> None:
    counts = {kind: int((moving.contacts.kind == kind).sum()) for kind in KIND_COLOURS}
    patches = [
        Patch(color=KIND_COLOURS[kind], label=f"{KIND_TEXTS[kind]} ({counts[kind]})")
        for kind in KIND_COLOURS
        if moving.moves
    ]
    if moving.moves:
        patches.append(Patch(facecolor="#e9ebee", edgecolor="#9aa0ab", label="undeformed"))
    else:
        patches.append(Patch(color=STONE_COLOUR, label="block (no mechanism)"))
    patches.append(Patch(color=SUPPORT_COLOUR, label="support"))
    result.legend(
        handles=patches, loc="lower center", ncols=len(patches), frameon=False, fontsize=8,
        bbox_to_anchor=(0.5, 0.0), handlelength=1.1, handleheight=0.9, columnspacing=1.4,
    )  # fmt: skip
