"""Pictures of a :class:`~cvxlimit.extensions.paths.path.Path`, and of the code check that follows
from it.

A path is a row of configurations, from rest to the end. Its pictures are the ``curve`` of load
factor over displacement, a ``film`` of the displaced blocks, and an interactive ``page``. Its
``pieces`` are ranges (start, stop) of configurations between two snaps, where the structure jumps
from one position to another.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.paths.path import Path
from cvxlimit.extensions.paths.wording import PROVES
from cvxlimit.plotting.contents import Bar, Drawing, Viewer, camera_for
from cvxlimit.plotting.look import DIGITS, WAY_TEXT, of_kind, printable, saved
from cvxlimit.plotting.pictures.animation import Animation, forth_and_back, frames_of
from cvxlimit.plotting.pictures.webpage import Page, path_page, sentences
from cvxlimit.plotting.registry import figures
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import motions_of
from cvxlimit.solution.bracket import Bracket, rounded

_PAUSE = 0.25
"""Seconds that a film shows a configuration for."""

_PROVED = sentences(PROVES)


def draw_path(
    path: Path, kind: str, file: str | os.PathLike[str] | None, options: dict[str, Any]
) -> Any:
    """Draws the picture of a path of that ``kind``; returns it, or the file it is saved to."""
    kinds: dict[str, Callable[..., Any]] = {"curve": curve, "film": film, "page": page}
    return of_kind("a path", kinds, kind, path, file, options)


def curve(path: Path, **options: Any) -> Any:
    """A figure of load factor over displacement, with the bracket of each configuration; of
    supports that move of their reaction, from the least to the largest."""
    chart = figures("sheet").Sheet.of((6.4, 4.4), **options)
    heights = _heights(path)
    ordinate = f"reaction ({printable(path.units.push)})" if path.motions else "load factor"
    _draw_pieces(chart.axes, path.displacement, heights, path.pieces, ordinate)
    # What has come apart: cohesion of joints, and ties.
    torn = [k - 1 for k, what in enumerate(path.failed) if what]
    if torn:
        at = path.displacement[torn], heights[torn]
        chart.axes.plot(*at, "x", color=Style.red, ms=7, label="cohesion or tie gone from there on")
    # The same path with half the step, where it was followed twice to see what steps change. Of
    # several lines of a kind the first has an entry in the legend: Matplotlib leaves out "_".
    if path.halved is not None:
        label = "with half the step"
        for start, stop in path.halved.pieces:
            x, y = path.halved.displacement[start:stop], _heights(path.halved)[start:stop]
            chart.axes.plot(x, y, color=Style.amber, lw=0.9, label=label)
            label = "_"
    # What the other flow rule says, and where blocks are followed instead of being at rest.
    if path.other_flow is not None:
        label = f"{path.other_flow.flow}, where blocks are followed"
        x, y = path.other_flow.displacement, _heights(path.other_flow)
        chart.axes.plot(x, y, color=Style.amber, ls="--", lw=0.9, label=label)
    followed = [i for i, each in enumerate(path) if each.is_followed]
    if followed:
        at = path.displacement[followed], heights[followed]
        look = {"color": Style.blue, "mfc": "white", "ms": 4.5}
        chart.axes.plot(*at, "o", **look, label="followed, not at rest")
    # The bracket of each configuration; of supports that move, what bounds their reaction.
    if path.motions:
        label, ends = "least to largest, with their bounds", path.reactions[:, [0, 3]]
    else:
        label = "bracket of a configuration"
        brackets = [each.bracket or Bracket(np.nan, np.nan) for each in path]
        ends = np.array([(each.lower, each.upper) for each in brackets])
    for i in np.flatnonzero(np.isfinite(ends).all(axis=1)):
        x = path.displacement[[i, i]]
        chart.axes.plot(x, ends[i], "_-", color=Style.violet, lw=1.2, ms=9, label=label)
        label = "_"
    left = -0.01 * path.displacement[-1] if path.motions else 0.0  # where reactions are a range
    chart.axes.set_xlim(left=min(left, chart.axes.dataLim.x0))
    proved = figures("sheet").lines_of(_PROVED, chart.letters(10.0), 0.8 * chart.width)
    chart.axes.set(xlabel="\n".join([_control(path), *proved]), ylabel=ordinate)
    chart.write(_title(path))
    return chart.figure


def draw_check(check: Any, file: str | os.PathLike[str] | None, options: dict[str, Any]) -> Any:
    """Draws the capacity curve of a code check with both limit states; returns the figure, or the
    file it is saved to."""
    chart = figures("sheet").Sheet.of((6.4, 4.4), **options)
    ax, unit = chart.axes, printable(check.units.length)
    _draw_pieces(ax, check.displacement, check.acceleration, check.pieces, "capacity curve")
    for name, limit, colour in (
        ("SLV", check.slv, Style.amber), ("SLC", check.slc, Style.red)
    ):  # fmt: skip
        if limit is None:
            continue
        d, a, period = limit.displacement, limit.acceleration, f"T = {limit.period:.3g} s"
        ax.plot([d, d, 0.0], [0.0, a, a], "--", color=colour, lw=1.0)
        ax.plot(d, a, "o", color=colour, ms=6, label=f"{name}: d = {d:.3g} {unit}, {period}")
    ax.set_xlim(left=min(0.0, ax.dataLim.x0))
    ax.set(xlabel=f"spectral displacement ({unit})", ylabel=f"spectral acceleration ({unit}/s²)")
    if check.refused:
        end = ": slides, no d0"
    elif " by " in check.ends:
        end = f", d0 = {check.d0:.3g} {unit}, an interval"
    else:
        end = f", d0 = {check.d0:.3g} {unit}"
    chart.write(f"{printable(check.scene_name)}: a0* = {check.a0_star:.3g} {unit}/s², "
                f"e* = {check.e_star:.3g}{end}")  # fmt: skip
    return chart.figure if file is None else saved(chart.figure, file, options)


def _draw_pieces(
    ax: Any, x: FloatArray, y: FloatArray, pieces: tuple[tuple[int, int], ...], label: str
) -> None:
    """Draws the curve piece by piece. At a snap a dotted line goes straight down: nothing is known
    about the way between."""
    for i, (start, stop) in enumerate(pieces):
        name = label if i == 0 else "_"
        ax.plot(x[start:stop], y[start:stop], ".-", color=Style.blue, lw=1.6, ms=5, label=name)
        if i > 0:
            at, drop, name = [x[start], x[start]], y[[start - 1, start]], "snap" if i == 1 else "_"
            ax.plot(at, drop, ":", color=Style.red, lw=1.6, label=name)
    ax.axhline(0.0, color=Style.axis, lw=0.6, zorder=0)


def film(path: Path, *, viewer: Viewer = None, **options: Any) -> Animation:
    """An animation of all configurations, from rest to the end of the path and back."""
    motions = motions_of(path.scene, [each.displacements for each in path])
    largest = max(motions, key=lambda motion: motion.largest)
    drawing = Drawing(
        path.scene, largest, camera_for(path.scene, largest, viewer), _title(path),
        f"blocks as they are displaced. {_PROVED}", bar=Bar(Style.speed, WAY_TEXT),
    )  # fmt: skip
    frames = forth_and_back(frames_of(drawing, motions, _texts(path), **options))
    return Animation(frames, _PAUSE * len(frames))


def page(path: Path) -> Page:
    """A page, one file that needs no network, with a slider over the configurations beside the
    curve."""
    of = "Reaction over movement" if path.motions else "Load factor over displacement"
    numbers = {**_numbers(path), "texts": _texts(path), "of": of, "unit": path.units.displacement}
    numbers["half"] = None if path.halved is None else _numbers(path.halved)
    reason = "" if path.reason == path.headline else path.reason
    advice = sentences(path.headline, reason, *path.notes, PROVES)
    contents = {"title": _title(path), "advice": advice, "path": numbers}
    motions = motions_of(path.scene, [each.displacements for each in path])
    return path_page(path.scene, motions, contents)


def _numbers(path: Path) -> dict[str, Any]:
    """The curve as numbers that fit into JSON."""
    d, heights = path.displacement.tolist(), _heights(path).tolist()
    return {"displacement": d, "load_factor": heights, "pieces": path.pieces}


def _heights(path: Path) -> FloatArray:
    """What the curve is of: the load factor, or the reaction of supports that move."""
    return -path.load_factor if path.motions else path.load_factor


def _texts(path: Path) -> list[str]:
    """What is written below each configuration: its load factor, or the supports' reaction, and its
    displacement."""
    _, unit, push = map(printable, path.units)
    what, of = ("reaction", f" {push}") if path.motions else ("load factor", "")
    texts = []
    for x, y, each in zip(path.displacement, _heights(path), path, strict=True):
        height = round(y, DIGITS) + 0.0  # never "-0"
        text = f"{what} {height:.{DIGITS}f}{of} at {x:.4g} {unit}"
        texts.append(f"{text}, followed" if each.is_followed else text)
    return texts


def _title(path: Path) -> str:
    """The name of the scene, where the path begins and how it ends."""
    name = printable(path.scene.name)
    if path.motions:
        end = "falls" if path.status == "falls" else path.ending
        return f"{name}: {end} at {path.w[-1]:.5g} {printable(path.units.w)} of movement"
    begin = "at rest" if path.initial is not None else "where it starts, displaced"
    start = f"{name}: load factor {rounded(path.load_factor[0], DIGITS)} {begin}"
    if path.slides_away:
        return f"{start}, slides: no d0"
    if path.control_stays:
        return f"{start}, {path.ending}; its control does not move: no d0"
    low, high = (f"{d0:.4g}" for d0 in path.d0_interval)
    if np.isnan(path.d0_interval[0]):
        end = f"{path.ending} at {path.displacement[-1]:.4g}"
    else:
        end = f"zero at {low}" if low == high else f"zero at {low} to {high}"
    title = f"{start}, {end} {printable(path.scene.units.length)}"
    return f"{title}, followed" if path.followed else title


def _control(path: Path) -> str:
    """The label of the horizontal axis: whose displacement it is."""
    if path.motions and path.control is None:
        return f"movement of the supports ({printable(path.units.w)}); reaction along it"
    of = "mean of the live load" if path.control is None else f"block {path.control[0]!r}"
    return f"displacement ({printable(path.units.displacement)}), {printable(of)}"
