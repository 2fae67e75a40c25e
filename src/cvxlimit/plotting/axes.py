"""Coordinate axes along a scene: level ones in front, the upright one left."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from matplotlib.ticker import MaxNLocator

from cvxlimit.base.arrays import FloatArray
from cvxlimit.plotting.camera import Camera, upright
from cvxlimit.plotting.picture import SURROUNDINGS, shown_bounds
from cvxlimit.plotting.sheet import PAPER, Letters, Word, measured
from cvxlimit.results.movement import free_size
from cvxlimit.scene import Scene


@dataclass(frozen=True)
class Axes:
    """Lines (2, 2) of the picture, ticks (2, 2) as a point and inches from it, and what is written
    there."""

    lines: list[FloatArray] = field(default_factory=list)
    ticks: list[FloatArray] = field(default_factory=list)
    words: list[Word] = field(default_factory=list)

    @classmethod
    def of(cls, scene: Scene, camera: Camera, scale: float, letters: Letters) -> Axes:
        """``scale`` is inches of the picture for one unit of length."""
        bounds, size, up = shown_bounds(scene), free_size(scene), upright(scene)
        pole = int(np.abs(up).argmax())
        level = [axis for axis in range(3) if axis != pole]
        low, high = bounds + np.array([[-1.0], [1.0]]) * (SURROUNDINGS + 0.03) * size
        front = np.where(camera.axes[2] >= 0.0, high, low)
        left = np.where(camera.axes[0] >= 0.0, low, high)
        front[pole] = left[pole] = low[pole] if up[pole] > 0.0 else high[pole]
        towards = np.diag(np.where(camera.axes[2] >= 0.0, 1.0, -1.0))
        result = cls()
        places = [(axis, front, towards[other]) for axis, other in (level, level[::-1])]
        for axis, through, outward in [*places, (pole, left, -camera.axes[0])]:
            along, aside = camera.axes[:2, axis], camera.axes[:2] @ outward
            shown = float(np.linalg.norm(along))
            if np.linalg.norm(aside) < 0.05 and axis != pole:  # seen straight from the front
                aside = -camera.axes[:2] @ up
            if abs(along[0] * aside[1] - along[1] * aside[0]) < 0.05 * shown or shown < 0.05:
                continue
            aside = aside / np.linalg.norm(aside)
            span = bounds[:, axis]
            ends = np.tile(through, (2, 1))
            ends[:, axis] = span
            base = ends @ camera.axes[:2].T
            result.add("xyz"[axis], span, base, aside, scale, letters, scene.units.length)
        return result

    def add(
        self, name: str, span: FloatArray, base: FloatArray, aside: FloatArray, scale: float,
        letters: Letters, unit: str,
    ) -> None:  # fmt: skip
        """An axis from one end of ``base`` (2, 2) to the other, its words on the side ``aside``."""
        room = scale * float(np.linalg.norm(base[1] - base[0]))
        low, high = span.tolist()
        values = _ticks(low, high, room, letters.tick, level=abs(aside[1]) > 0.2)
        self.lines.append(base)
        align = _aligned(aside)
        places = [base[0] + (v - low) / (high - low) * (base[1] - base[0]) for v in values]
        away = tuple((1.6 * PAPER.tick * aside).tolist())
        numbers = [
            Word(tuple(at), away, f"{value:.10g}", letters.tick, *align)
            for value, at in zip(values.tolist(), places, strict=True)
        ]
        tight = 0.9 * scale  # which is somewhat less once there is room for all words
        if any(one.meets(other, tight) for one, other in pairwise(numbers)):
            numbers, places = [], []
        self.ticks.extend(np.stack([at, PAPER.tick * aside]) for at in places)
        wide = max((measured(word.text, letters.tick) for word in numbers), default=0.0)
        tall = 1.25 * letters.tick * PAPER.point if numbers else 0.0
        reach = 1.6 * PAPER.tick + float(np.abs(aside) @ [wide, tall]) + 0.03
        told = f"{name} ({unit})" if numbers else f"{name} {low:.4g} to {high:.4g} ({unit})"
        middle, size = tuple(base.mean(axis=0)), letters.size(9.0)
        label = Word(middle, tuple(reach * aside), told, size, *align)
        while any(label.meets(word, tight) for word in numbers):
            reach += 0.02
            label = Word(middle, tuple(reach * aside), told, size, *align)
        self.words.extend([*numbers, label])


def _ticks(low: float, high: float, room: float, size: float, level: bool) -> FloatArray:
    """Values that are labelled on ``room`` inches: beside each other, or above each other."""
    widest = max(measured(f"{v:.4g}", size) for v in (low, high, 0.5 * (low + high)))
    each = 1.9 * max(widest, 2.0 * size * PAPER.point) if level else 2.6 * size * PAPER.point
    most = int(room / each)
    if most < 1:
        return np.empty(0)
    locator = MaxNLocator(min(most, 8), steps=[1, 2, 2.5, 5, 10])
    found = np.asarray(locator.tick_values(low, high), dtype=float)
    slack = 1e-9 * (high - low)
    inside: FloatArray = found[(found >= low - slack) & (found <= high + slack)]
    return inside if len(inside) > 1 else np.array([low, high])


def _aligned(aside: FloatArray) -> tuple[str, str]:
    level = "center" if abs(aside[0]) < 0.3 else "left" if aside[0] > 0 else "right"
    high = "center" if abs(aside[1]) < 0.2 else "bottom" if aside[1] > 0 else "top"
    return level, high
