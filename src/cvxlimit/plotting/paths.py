"""Pictures of paths in finite displacements: curve, film, page; and of the code check."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import meant
from cvxlimit.errors import InputError
from cvxlimit.paths.path import PROVES, Path
from cvxlimit.plotting.contents import Bar, Drawing, Viewer, camera_for
from cvxlimit.plotting.look import DIGITS, SPEED_STOPS, WAY_TEXT, printable, saved
from cvxlimit.plotting.movement import Motion, moved_by
from cvxlimit.plotting.picture import seen
from cvxlimit.plotting.pictures.animation import DPI, Animation
from cvxlimit.plotting.pictures.webpage import Page, path_page, sentences
from cvxlimit.plotting.registry import figures
from cvxlimit.solution.bracket import rounded

_LINE, _DROP, _BRACKET, _FINE = "#134b73", "#d62246", "#8b2fc9", "#f59e0b"
_LIMITS = {"SLV": "#f59e0b", "SLC": "#d62246"}
_PAUSE = 0.25
"""Seconds that a film shows a configuration for."""

_SAID = sentences(PROVES)


def draw_path(
    path: Path, kind: str, file: str | os.PathLike[str] | None, options: dict[str, Any]
) -> Any:
    """The picture of a path by its kind, or its file."""
    kinds: dict[str, Callable[..., Any]] = {"curve": curve, "film": film, "page": page}
    if kind not in kinds:
        raise InputError(
            f"a path has no picture {kind!r}: choose one of {', '.join(kinds)}"
            + meant(kind, kinds, before="; ")
        )
    made = kinds[kind](path, **options)
    return made if file is None else saved(made, file, options)


def curve(path: Path, **options: Any) -> Any:
    """Load factor over displacement, with the bracket of every configuration."""
    chart = figures("chart").Chart.of(options, (6.4, 4.4))
    _draw_pieces(chart.axes, path.displacement, path.load_factor, path.pieces, "load factor")
    if (fine := path.halved) is not None:
        label = "with half the step"
        for part in (slice(*piece) for piece in fine.pieces):
            curve = fine.displacement[part], fine.load_factor[part]
            chart.axes.plot(*curve, color=_FINE, lw=0.9, label=label)
            label = "_"
    label = "bracket of a configuration"
    for x, each in zip(path.displacement, path, strict=True):
        if each.bracket is not None and each.bracket.has_both:
            ends = [each.bracket.lower, each.bracket.upper]
            chart.axes.plot([x, x], ends, "_-", color=_BRACKET, lw=1.2, ms=9, label=label)
            label = "_"
    said = figures("sheet").lines_of(_SAID, chart.size("axes.labelsize"), 0.8 * chart.width)
    chart.axes.set(xlabel="\n".join([_control(path), *said]), ylabel="load factor")
    chart.write(_title(path))
    chart.write_legend()
    return chart.figure


def draw_check(check: Any, file: str | os.PathLike[str] | None, options: dict[str, Any]) -> Any:
    """The capacity curve of a code check with both limit states, or its file."""
    chart = figures("chart").Chart.of(options, (6.4, 4.4))
    ax, unit = chart.axes, printable(check.units.length)
    _draw_pieces(ax, check.displacement, check.acceleration, check.pieces, "capacity curve")
    for name, limit in (("SLV", check.slv), ("SLC", check.slc)):
        d, a, said = limit.displacement, limit.acceleration, f"T = {limit.period:.3g} s"
        ax.plot([d, d, 0.0], [0.0, a, a], "--", color=_LIMITS[name], lw=1.0)
        ax.plot(d, a, "o", color=_LIMITS[name], ms=6, label=f"{name}: d = {d:.3g} {unit}, {said}")
    ax.set(xlabel=f"spectral displacement ({unit})", ylabel=f"spectral acceleration ({unit}/s²)")
    chart.write(f"{printable(check.scene_name)}: a0* = {check.a0_star:.3g} {unit}/s², "
                f"e* = {check.e_star:.3g}, d0 = {check.d0:.3g} {unit}")  # fmt: skip
    chart.write_legend()
    return chart.figure if file is None else saved(chart.figure, file, options)


def _draw_pieces(
    ax: Any, x: FloatArray, y: FloatArray, pieces: tuple[tuple[int, int], ...], label: str
) -> None:
    """The curve between snaps; at a snap a drop, since nothing is known on the way."""
    for i, (start, stop) in enumerate(pieces):
        part, name = slice(start, stop), "_" if i else label
        ax.plot(x[part], y[part], ".-", color=_LINE, lw=1.6, ms=5, label=name)
        if i:
            name = "snap" if i == 1 else "_"
            ax.plot([x[start]] * 2, [y[start - 1], y[start]], ":", color=_DROP, lw=1.6, label=name)
    ax.axhline(0.0, color="#888888", lw=0.6, zorder=0)
    ax.set_xlim(left=min(0.0, float(x.min())))


def film(path: Path, *, viewer: Viewer = None, **options: Any) -> Animation:
    """Every configuration as it is, from rest to the end of the path and back."""
    scene, made = path.scene, figures()
    motions = _motions(path)
    farthest = max(motions, key=lambda moving: moving.largest)
    drawing = Drawing(
        scene, farthest, camera_for(scene, farthest, viewer), _title(path),
        f"blocks as they are displaced. {_SAID}", bar=Bar(SPEED_STOPS, WAY_TEXT),
    )  # fmt: skip
    figure, shown = made.assembled(drawing, seen(drawing), made.Sheet(**options))
    figure.set_dpi(DPI)
    forth = []
    for moving, text in zip(motions, _texts(path), strict=True):
        for artist in shown:
            artist.remove()
        shown = made.draw_seen(figure.axes[0], seen(replace(drawing, moving=moving)), 1.0)
        shown.append(figure.text(0.02, 0.02, text.replace(" at ", "\nat "), fontsize=8))
        forth.append(figure.pixels())
    frames = (*forth, *forth[-2:0:-1])
    return Animation(frames, _PAUSE * len(frames))


def page(path: Path) -> Page:
    """The configurations one by one at a slider, beside the curve: in one file, offline."""
    curve = {**_numbers(path), "texts": _texts(path)}
    curve["half"] = None if path.halved is None else _numbers(path.halved)
    advice = sentences(path.reason, *path.notes, PROVES)
    said = {"title": _title(path), "advice": advice, "path": curve}
    return path_page(path.scene, _motions(path), said)


def _numbers(path: Path) -> dict[str, Any]:
    d, alpha = path.displacement.tolist(), path.load_factor.tolist()
    return {"displacement": d, "load_factor": alpha, "pieces": path.pieces}


def _motions(path: Path) -> list[Motion]:
    """Returns the motion of every configuration, in the colours of the one that is farthest from
    rest."""
    alone = [moved_by(path.scene, each.displacements) for each in path]
    farthest = max(alone, key=lambda moving: moving.largest)
    return [replace(moving, speed=farthest.speed) for moving in alone]


def _texts(path: Path) -> list[str]:
    unit = printable(path.scene.units.length)
    return [
        f"load factor {round(each.load_factor, DIGITS) + 0.0:.{DIGITS}f} at {x:.4g} {unit}"
        for x, each in zip(path.displacement, path, strict=True)
    ]


def _title(path: Path) -> str:
    start = f"load factor {rounded(path.load_factor[0], DIGITS)} at rest"
    unit = printable(path.scene.units.length)
    low, high = (f"{d0:.4g}" for d0 in path.d0_interval)
    end = f"zero at {low}" + (f" to {high}" if low != high else "")
    end = f"{path.status} at {path.displacement[-1]:.4g}" if low == "nan" else end
    return f"{printable(path.scene.name)}: {start}, {end} {unit}"


def _control(path: Path) -> str:
    of = "mean of the live load" if path.control is None else f"block {path.control[0]!r}"
    return f"displacement ({printable(path.scene.units.length)}), {printable(of)}"
