"""Pictures of a scene in time, as :func:`cvxlimit.shake` moves it: curve, film and frame."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from cvxlimit.extensions.dynamics.shaking import Shaking
from cvxlimit.plotting.contents import Bar, Drawing, Viewer, camera_for
from cvxlimit.plotting.look import WAY_TEXT, of_kind, printable
from cvxlimit.plotting.pictures.animation import Animation, frames_of
from cvxlimit.plotting.registry import figures
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import motions_of

_PER_SECOND = 12
"""Frames of a film in each second, which is one of the motion where that is long enough."""

_FEWEST, _MOST = 16, 120
"""Frames of a film."""


def draw_shaking(
    shaking: Shaking, kind: str, file: str | os.PathLike[str] | None, options: dict[str, Any]
) -> Any:
    """Draws the picture of that ``kind``; returns it, or the file it is saved to."""
    kinds = {"curve": curve, "film": film, "frame": frame}
    return of_kind("motion in time", kinds, kind, shaking, file, options)


def curve(shaking: Shaking, **options: Any) -> Any:
    """A figure of displacement over time, with all runs."""
    chart = figures("sheet").Sheet.of((6.4, 4.4), **options)
    unit = printable(shaking.scene.units.length)
    # The four runs of cvxlimit.shake, the best one last.
    colours = Style.amber, Style.violet, Style.green, Style.blue
    for each, colour in zip(shaking.histories, colours, strict=True):
        label = f"step {1e3 * each.step:.2g} ms, contacts {1e3 * each.time_constant:.2g} ms"
        width = 2.0 if each is shaking.histories[-1] else 1.0
        chart.axes.plot(each.times, shaking.displacement(each), color=colour, lw=width, label=label)
    chart.axes.axvspan(0.0, shaking.record.duration, color=Style.axis, alpha=0.15, lw=0)
    of = "largest of all blocks" if shaking.control is None else f"block {shaking.control[0]!r}"
    label = f"displacement ({unit}), {printable(of)}"
    chart.axes.set(xlabel="time (s), the record shaded", ylabel=label)
    chart.write(_title(shaking))
    return chart.figure


def film(shaking: Shaking, *, viewer: Viewer = None, **options: Any) -> Animation:
    """An animation of the best run, as the ground sees it."""
    last = float(shaking.histories[-1].times[-1])
    count = int(np.clip(round(_PER_SECOND * last), _FEWEST, _MOST))
    times = np.linspace(0.0, last, count).tolist()
    drawing, motions = _drawing(shaking, times, viewer)
    frames = frames_of(drawing, motions, [f"{time:.2f} s" for time in times], **options)
    return Animation(frames, max(last, count / _PER_SECOND))


def frame(
    shaking: Shaking, *, time: float | None = None, viewer: Viewer = None, **options: Any
) -> Any:
    """A picture of one moment of the best run, its end by itself."""
    drawing, _ = _drawing(shaking, [time], viewer)
    return figures().drawn(drawing, **options)


def _drawing(shaking: Shaking, times: Any, viewer: Viewer) -> tuple[Drawing, Any]:
    """The drawing of the moment that moved most, and the motions to all."""
    scene = shaking.scene
    motions = motions_of(scene, [shaking.configuration(time) for time in times])
    largest = max(motions, key=lambda motion: motion.largest)
    return Drawing(
        scene, largest, camera_for(scene, largest, viewer), _title(shaking),
        "blocks as they move, seen from the ground. Nothing here is proved",
        bar=Bar(Style.speed, WAY_TEXT),
    ), motions  # fmt: skip


def _title(shaking: Shaking) -> str:
    name = f"{printable(shaking.scene.name)}, {printable(shaking.record.name)}"
    if shaking.ending is None:
        return f"{name}: not decided, runs differ"
    end = {"falls": "falls", "stands": "stands", "moves": "does not fall, still moves"}
    peak = f"{shaking.peak.value:.3g} {printable(shaking.scene.units.length)}"
    words = end[shaking.ending]
    return f"{name}: {words}" + ("" if shaking.falls else f", moved by {peak} at most")
