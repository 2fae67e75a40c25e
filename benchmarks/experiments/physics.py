"""Models of the same contacts side by side: limit curves, load factors, and what they cost."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from benchmarks.charts import few_ticks, figure_of, name_lines, save, top_legend
from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.gilbert import Gilbert
from benchmarks.registry import registry
from cvxlimit import Solution, builtin_scene, solve
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.extensions.studies.models import Model, Row
from cvxlimit.geometry.polygons import torsion_arm
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.exact_friction import ExactFriction
from cvxlimit.surfaces.exact_torsion import Edges, limit_states

MARKERS = "osD^vP*X"

COLOURS = (
    "#14476f", "#2a8a8c", "#d81e4a", "#f59e0b", "#7a1010", "#5b8c2a", "#7c3aed", "#9aa0ab",
)  # fmt: skip

MANY = 200
"""Contacts beyond which zero dilatancy gets one start in place of two."""

EXACT = 5e-3
"""Width of the exact limit's bracket in the chart of all models, relative."""

CHARTED = (
    "linear", "parabolic", "exact", "vertex-forces", "crushing/100", "mortar", "zero-dilatancy",
    "gilbert",
)  # fmt: skip
"""Models of the chart, in its order."""

PLANE = (
    "single-block", "stack", "ferris-tin-loi-1", "ferris-tin-loi-2", "ferris-tin-loi-3", "arch",
    "arch-on-piers", "flying-buttress", "barrel-vault", "dam", "retaining-wall",
    "retaining-wall-shaken",
)  # fmt: skip
"""Scenes in which nothing twists: the limits of torsion with shear are one there."""

TORSION = {
    "line": (None, "conic"),
    "parabola": (None, "parabolic"),
    "exact to 0.02": (2e-2, "exact"),
    "exact to 0.005": (5e-3, "exact"),
    "exact to 0.001": (1e-3, "exact"),
}
"""Tolerance of the exact limit, or the surface, of every line in the chart of speed."""


def draw_curves(axes: Axes, l1: float, l2: float, direction: int) -> None:
    """The limit of torsion with shear along one side of a rectangle, four times."""
    v = np.linspace(0.0, 1.0, 200)
    rectangle = np.array([[-l1, -l2], [l1, -l2], [l1, l2], [-l1, l2]]) / 2.0
    edges = Edges.of_polygons([(0, rectangle)], np.array([l1 * l2]))
    centre = np.zeros((1, 4000, 2))
    centre[0, :, 1 - direction] = np.tan(np.linspace(0.0, 1.5704, 4000))
    states = limit_states(edges, centre)[0]
    shear = np.abs(states[:, direction])
    moment = np.abs(states[:, 2]) / float(torsion_arm(l1, l2))
    curves = {
        "line (Eq. 24)": (v, 1.0 - v),
        "parabola": (v, 1.0 - v**2),
        "exact (Eq. 18-21)": (shear, moment),
        "ellipse": (v, np.sqrt(1.0 - v**2)),
    }
    for (label, (x, y)), colour in zip(curves.items(), COLOURS, strict=False):
        axes.plot(x, y, color=colour, label=label, ls="--" if label == "ellipse" else "-")
    side = "a" if l1 == l2 else ("the long" if direction == 0 else "the short")
    axes.set_title(f"{l1:g} : {l2:g}, shear along {side} side", fontsize=10)
    axes.set_xlabel("|V| / (µ N)")
    axes.set_xlim(0, 1.02)
    axes.set_xticks((0.0, 0.5, 1.0))
    axes.set_ylim(0, 1.02)
    axes.grid(alpha=0.3)


@experiment(
    Part(2, "--table speed", "torsion"), Part(6, "--table models", "physics"), name="physics"
)
def tables(table: str = "models", folder: Path = Path("docs/evidence")) -> Lines:
    """Pictures of the folder, with their tables: curves (limits of torsion with shear), speed (of
    these limits), models (of the same contacts)."""
    made: dict[str, Callable[[Path], Lines]] = {
        "curves": curves, "speed": speed, "models": measured,
    }  # fmt: skip
    if table not in made:
        raise SystemExit(f"there is no table {table!r}: {', '.join(made)}")
    yield from made[table](folder)


def curves(folder: Path) -> Lines:
    """Limit curves of three rectangles."""
    figure = figure_of(3.2)
    plots = figure.subplots(1, 3, sharey=True)
    for axes, (l1, l2, direction) in zip(plots, ((1, 1, 0), (2, 1, 0), (2, 1, 1)), strict=True):
        draw_curves(axes, l1, l2, direction)
    plots[0].set_ylabel("|MT| / (µ N c_T)")
    top_legend(figure, plots[0], 4)
    yield save(figure, folder / "torsion-shear.png")


def by_size(most: int) -> list[str]:
    """Built-in scenes up to so many contacts, beyond which slow models take minutes each."""
    sizes = {name: len(builtin_scene(name).contacts) for name in BUILTIN}
    return sorted((name for name in sizes if sizes[name] <= most), key=sizes.__getitem__)


def measured(folder: Path) -> Lines:
    """All models on all built-in scenes."""
    models = {**registry(), "gilbert": Model("gilbert", "Gilbert's scheme", method=Gilbert())}
    # Zero dilatancy to 1e-4 within a budget: its lowest member, without a search further down.
    few = ZeroDilatancy(tolerance=1e-4, searches=1, budget=120)
    models["zero-dilatancy"] = Model("zero-dilatancy", "zero dilatancy", method=few)
    models["exact"] = Model("exact", "exact", method="exact", tolerance=EXACT)
    result: dict[str, dict[str, Row]] = {}
    yield Head("scene", *CHARTED)
    for name in by_size(1_000):
        result[name] = {}
        for model in CHARTED:
            start = time.process_time()
            found = models[model].measure(builtin_scene(name))
            result[name][model] = replace(found, total=time.process_time() - start)
        yield name, *(_cell(result[name][model]) for model in CHARTED)
    save(chart(result), folder / "models.png")


def _cell(found: Row) -> str:
    """Load factor; in brackets where it is no answer."""
    if found.load_factor is None:
        return found.status
    text = f"{found.load_factor:.5g}"
    return text if found.status in ("certified", "converged") else f"({text})"


def speed(folder: Path) -> Lines:
    """Time in units of the line's against the distance from the exact limit, in space."""
    yield Head("scene", "torsion with shear", "load factor", "max. error", "time (s)",
               "over the line's")  # fmt: skip
    points: dict[str, list[tuple[float, float]]] = {}
    for name in (name for name in by_size(500) if name not in PLANE):
        found = {label: _timed(name, *how) for label, how in TORSION.items()}
        most = min(solution.upper for solution, _ in list(found.values())[2:])
        unit = found["line"][1]
        points[name] = []
        for label, (solution, seconds) in found.items():
            below = max(1.0 - solution.lower / most, 0.0)
            points[name].append((seconds / unit, max(below, 1e-7)))
            yield (name, label, f"{solution.load_factor:.6f}", f"{below:.1e}", f"{seconds:.2f}",
                   f"{seconds / unit:.1f}")  # fmt: skip
    save(speed_chart(points), folder / "torsion-shear-speed.png")


def speed_chart(points: dict[str, list[tuple[float, float]]]) -> Figure:
    """A line for every scene, named beside it, and a colour for every limit."""
    figure = figure_of(4.8)
    axes = figure.subplots()
    for name, found in points.items():
        axes.loglog(*np.transpose(found), "-", color="0.55", lw=0.8, label=name)
        for point, colour in zip(found, COLOURS, strict=False):
            axes.loglog(*point, "o", color=colour, ms=7, mec="white", zorder=3)
    keys = [Line2D([], [], ls="", marker="o", color=c, label=n)
            for n, c in zip(TORSION, COLOURS, strict=False)]  # fmt: skip
    figure.legend(handles=keys, fontsize=9, ncols=5, frameon=False, loc="outside upper center")
    axes.set_xlabel("processor time / that of the line")
    axes.set_ylabel("at most below the exact limit, relative (1e-7: or less)")
    few_ticks(axes.xaxis)
    name_lines(figure, [axes])
    return figure


def _timed(name: str, tolerance: float | None, surface: str) -> tuple[Solution, float]:
    """A solution, and its seconds of the processor."""
    scene, start = builtin_scene(name), time.process_time()
    if tolerance is None:
        found = solve(scene, surface)
    else:
        found = solve(scene, method=ExactFriction(tolerance))
    return found, time.process_time() - start


def chart(found: dict[str, dict[str, Row]]) -> Figure:
    """Load factors over the straight line's, from 0, and seconds: a row of dots for every scene."""
    scenes, good = list(found), ("certified", "converged")
    figure = figure_of(1.6 + 0.34 * len(scenes))
    left, right = figure.subplots(1, 2, sharey=True)
    for k, (model, colour) in enumerate(zip(CHARTED, COLOURS, strict=True)):
        for place, scene in enumerate(scenes):
            row, base = found[scene][model], found[scene]["linear"].load_factor
            face = colour if row.status in good else "white"
            style = {"color": colour, "mfc": face, "ms": 5.5, "ls": ""}
            if row.load_factor and base:
                left.plot(row.load_factor / base, place, MARKERS[k], **style)
            if row.total:
                right.plot(row.total, place, MARKERS[k], **style)
        left.plot([], [], MARKERS[k], color=colour, ms=5.5, label=model)
    for axes in (left, right):
        axes.grid(axis="y", color="#e4e6e9", lw=0.8)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=9)
    left.set_xlim(0.0, None)
    left.set_xlabel("load factor / that of the line", fontsize=9)
    right.set(xscale="log")
    right.set_xlabel("processor time (s)", fontsize=9)
    left.set_yticks(range(len(scenes)), scenes)
    left.invert_yaxis()
    figure.legend(loc="outside upper center", ncols=4, fontsize=9, frameon=False, handlelength=1.0)
    note = (
        "crushing: 100 times the mean pressure on supports; mortar: cohesion 0.2, tension 0.1 of "
        "that;\nexact: to 0.005; zero dilatancy: lowest member to 1e-4; hollow: not converged"
    )
    figure.supxlabel(note, fontsize=9, color="#555")
    return figure
