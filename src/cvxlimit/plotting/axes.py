"""The three coordinate axes around a painted scene, with ticks and the length unit."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from cvxlimit.arrays import FloatArray
from cvxlimit.plotting.camera import Camera, upright
from cvxlimit.plotting.mesh import SURROUNDINGS, shown_bounds
from cvxlimit.plotting.movement import free_size
from cvxlimit.scene import Scene

INK = "#4a4f57"
TICK = 0.012
"""Length of a tick mark, relative to the free blocks' size."""

TICK_SPACING = 0.11
"""Least distance between tick labels on the picture, relative to the free blocks' size."""


def draw_axes(axes: Axes, scene: Scene, camera: Camera) -> FloatArray:
    """Draw the coordinate axes along the free blocks: level ones in front, upright one left.

    Returns the points (n, 2) of the picture that must be in view for them.
    """
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
    """One axis through a point, ticks in direction ``outward``; none if seen end-on."""
    size = free_size(scene)
    along, aside = camera.axes[:2, axis], camera.axes[:2] @ outward
    shown = float(np.linalg.norm(along))
    if abs(along[0] * aside[1] - along[1] * aside[0]) < 0.05 * shown or shown < 0.05:
        return np.empty((0, 2))
    low, high = shown_bounds(scene)[:, axis]
    ticks = _ticks(low, high, int((high - low) * shown / (TICK_SPACING * size)))
    line = np.tile(through, (len(ticks) + 2, 1))
    line[:, axis] = [low, *ticks, high]
    base = line @ camera.axes[:2].T
    step = TICK * size * aside / max(float(np.linalg.norm(aside)), 0.5)
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
    """At least two round values in a range, or none where they have no room."""
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
