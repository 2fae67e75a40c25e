"""Coordinate axes along a scene: level ones in front, the upright one left."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.collections import LineCollection
from matplotlib.ticker import MaxNLocator

from cvxlimit.base.arrays import FloatArray
from cvxlimit.plotting.camera import Camera, upright
from cvxlimit.plotting.picture import SURROUNDINGS, shown_bounds
from cvxlimit.plotting.sheet import POINT, Sheet, measured
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import free_size
from cvxlimit.scene import Scene

EDGE_ON = 0.05
"""Axes whose picture is shorter than this share of theirs, or whose numbers would stand on them,
are left out."""


@dataclass(frozen=True, eq=False)
class CoordinateAxis:
    """A coordinate ``axis`` (0, 1 or 2): its values at both ends, ``near`` that at the corner where
    axes meet, the picture of the ends (2, 2), and on which side (2,) of it numbers stand."""

    axis: int
    is_upright: bool
    near: float
    far: float
    ends: FloatArray
    aside: FloatArray


def coordinate_axes(scene: Scene, camera: Camera) -> Iterator[CoordinateAxis]:
    """Yields the axes that are seen: level ones along the lower edges in front, the upright one at
    the left edge."""
    bounds, up = shown_bounds(scene), upright(scene)
    pole = int(np.abs(up).argmax())
    level = [axis for axis in range(3) if axis != pole]
    low, high = bounds + np.array([[-1.0], [1.0]]) * (SURROUNDINGS + 0.03) * free_size(scene)
    front = np.where(camera.axes[2] >= 0.0, high, low)
    left = np.where(camera.axes[0] >= 0.0, low, high)
    front[pole] = left[pole] = low[pole] if up[pole] > 0.0 else high[pole]
    towards = np.diag(np.where(camera.axes[2] >= 0.0, 1.0, -1.0))
    places = [(axis, front, towards[other]) for axis, other in (level, level[::-1])]
    for axis, through, outward in [*places, (pole, left, -camera.axes[0])]:
        along, aside = camera.axes[:2, axis], camera.axes[:2] @ outward
        if np.linalg.norm(aside) < EDGE_ON and axis != pole:  # seen straight from the front
            aside = -camera.axes[:2] @ up
        shown = float(np.linalg.norm(along))
        if abs(along[0] * aside[1] - along[1] * aside[0]) < EDGE_ON * shown or shown < EDGE_ON:
            continue
        near, far = sorted(bounds[:, axis].tolist(), key=lambda x: abs(x - through[axis]))
        ends = np.tile(through, (2, 1))
        ends[:, axis] = near, far
        base = ends @ camera.axes[:2].T
        yield CoordinateAxis(axis, axis == pole, near, far, base, aside / np.linalg.norm(aside))


def draw_axis(each: CoordinateAxis, sheet: Sheet, scale: float, unit: str) -> None:
    """Draws an axis with numbers beside it, where the picture has ``scale`` inches for a unit of
    length. Its name stands at the end away from other axes: above the upright one, else beyond the
    number there. An axis that is too short for numbers says its range."""
    letters, name = sheet.letters(7.5), "xyz"[each.axis]
    run = each.ends[1] - each.ends[0]
    tick = POINT * float(rcParams["xtick.major.size"])
    values = _ticks(each.near, each.far, scale * run, letters)
    places = each.ends[0] + np.outer((values - each.near) / (each.far - each.near), run)
    lines = [each.ends, *(np.stack([at, at + tick / scale * each.aside]) for at in places)]
    sheet.axes.add_collection(
        LineCollection(lines, colors=Style.ink, linewidths=0.8, zorder=3), autolim=False
    )
    gap = 1.6 * tick
    numbers = [f"{value:.10g}" for value in values.tolist()]
    for number, at in zip(numbers, places, strict=True):
        _write(sheet.axes, number, at, gap * each.aside, letters)
    if not numbers:
        low, high = sorted((each.near, each.far))
        text = f"{name} {low:.4g} to {high:.4g} ({unit})"
        _write(sheet.axes, text, each.ends.mean(axis=0), gap * each.aside, letters)
    elif each.is_upright:
        above = gap * run / np.linalg.norm(run)
        _write(sheet.axes, f"{name} ({unit})", each.ends[1], above, letters)
    else:
        size = max(measured(number, letters) for number in numbers), 1.3 * letters * POINT
        away = gap + 0.03 + np.abs(each.aside) @ size
        _write(sheet.axes, f"{name} ({unit})", each.ends[1], away * each.aside, letters)


def _ticks(low: float, high: float, run: FloatArray, letters: float) -> FloatArray:
    """Returns as many round values, at most nine, as have room on a line of ``run`` (2,) inches:
    neighbours are apart in one direction or the other."""
    least, most = sorted((low, high))
    for number in range(8, 0, -1):
        found = np.asarray(MaxNLocator(number, steps=[1, 2, 2.5, 5, 10]).tick_values(least, most))
        slack = 1e-9 * (most - least)
        inside: FloatArray = found[(found >= least - slack) & (found <= most + slack)]
        if len(inside) < 2:
            inside = np.array([least, most])
        wide = max(measured(f"{value:.10g}", letters) for value in inside.tolist())
        step = np.abs(run) * (inside[1] - inside[0]) / (most - least)
        if step[0] > 1.4 * wide or step[1] > 1.6 * letters * POINT:
            return inside
    return np.empty(0)


def _write(axes: Any, text: str, at: FloatArray, away: FloatArray, letters: float) -> None:
    """Writes a text ``away`` (2,) inches from a point, on that side of it."""
    side = away / np.linalg.norm(away)
    axes.annotate(
        text, tuple(at), tuple(away / POINT), textcoords="offset points", fontsize=letters,
        ha="center" if abs(side[0]) < 0.3 else "left" if side[0] > 0 else "right",
        va="center" if abs(side[1]) < 0.2 else "bottom" if side[1] > 0 else "top",
        color=Style.ink, annotation_clip=False, parse_math=False,
    )  # fmt: skip
