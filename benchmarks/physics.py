"""Models of the same contacts side by side: limit curves, load factors, and what they cost.

python -m benchmarks.physics docs                       writes all three pictures
python -m benchmarks.physics docs curves                torsion-shear.png: limit curves
python -m benchmarks.physics docs speed                 torsion-shear-speed.png, with a table
python -m benchmarks.physics docs models                models.png, with a table
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from cvxlimit import Scene, builtin_scene, solve
from cvxlimit.compare.models import Measurement, Method
from cvxlimit.compare.registry import physics_registry
from cvxlimit.geometry.polygons import torsion_arm
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.driver import Rule
from cvxlimit.methods.exact_friction import ExactFriction
from cvxlimit.methods.zero_dilatancy import ZeroDilatancy
from cvxlimit.surfaces.exact_torsion import Edges, limit_states

COLOURS = (
    "#14476f", "#2a8a8c", "#d81e4a", "#f59e0b", "#7a1010", "#5b8c2a", "#7c3aed", "#9aa0ab",
)  # fmt: skip

LARGEST = 200
"""Contacts of the largest scene on which the slow models are run: they take minutes beyond."""

SLOW = ("exact", "zero-dilatancy")

CHARTED = (
    "linear", "parabolic", "exact", "vertex-forces", "crushing/100", "mortar", "zero-dilatancy",
    "gilbert",
)  # fmt: skip
"""Models of the chart, in its order."""

TORSION_SCENES = ("tuff-wall", "single-block")
"""For speed against accuracy of torsion with shear: one where it matters, one where it does not."""


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
    axes.set_ylim(0, 1.02)
    axes.grid(alpha=0.3)


def curves(path: Path) -> None:
    """Limit curves of three rectangles."""
    figure, rows = plt.subplots(1, 3, figsize=(12, 4.2), sharey=True)
    for axes, (l1, l2, direction) in zip(rows, ((1, 1, 0), (2, 1, 0), (2, 1, 1)), strict=True):
        draw_curves(axes, l1, l2, direction)
    rows[0].set_ylabel("|MT| / (µ N c_T)")
    rows[0].legend(loc="lower left", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


@dataclass(frozen=True)
class Members(Method):
    """Zero dilatancy from two starts, to 1e-4: its lowest member, without a search further down."""

    name: str = "zero-dilatancy"
    line: str = "zero dilatancy"

    def measure(self, scene: Scene) -> Measurement:
        """See :class:`Method`."""
        start = time.perf_counter()
        rule = ZeroDilatancy(starts=2, tolerance=1e-4, descents=0)
        found = solve(scene, interaction=rule)
        seconds = time.perf_counter() - start
        factor, count = found.load_factor, found.contacts
        return Measurement(str(found.status), factor, None, None, {}, seconds, count)


def measured() -> dict[str, dict[str, Measurement]]:
    """All models on all built-in scenes, but for the slow ones on large scenes."""
    models = {**physics_registry(), "zero-dilatancy": Members()}
    result: dict[str, dict[str, Measurement]] = {}
    sys.stdout.write(f"| scene | {' | '.join(CHARTED)} |\n|{'---|' * (len(CHARTED) + 1)}\n")
    for name in BUILTIN:
        is_large = len(builtin_scene(name).contacts) > LARGEST
        result[name] = {
            model: models[model].measure(builtin_scene(name))
            for model in CHARTED
            if not (is_large and model in SLOW)
        }
        cells = (_cell(result[name].get(model)) for model in CHARTED)
        sys.stdout.write(f"| {name} | {' | '.join(cells)} |\n")
        sys.stdout.flush()
    return result


def _cell(found: Measurement | None) -> str:
    """Load factor and seconds; in brackets where it is no answer."""
    if found is None:
        return "not run"
    if found.load_factor is None:
        return found.status
    text = f"{found.load_factor:.5g}"
    good = found.status in ("certified", "converged")
    return f"{text if good else f'({text})'}, {found.total:.2g} s"


def speed(path: Path) -> None:
    """Seconds of the processor against the distance from the exact limit."""
    figure, axes = plt.subplots(figsize=(8, 5))
    sys.stdout.write("| scene | torsion with shear | load factor | error | s of processor |\n")
    for scene_name, marker in zip(TORSION_SCENES, "os", strict=True):
        runs: dict[str, Rule | None] = {"line": None, "parabola": None}
        runs |= {f"exact to {t:g}": ExactFriction(tolerance=t) for t in (1e-2, 1e-3, 3e-4)}
        best = solve(builtin_scene(scene_name), torsion_shear="exact", tolerance=1e-4)
        for (label, rule), colour in zip(runs.items(), COLOURS, strict=False):
            form = {"line": "linear", "parabola": "parabolic"}.get(label, "exact")
            start = time.process_time()
            found = solve(builtin_scene(scene_name), torsion_shear=form, interaction=rule)
            seconds = time.process_time() - start
            error = best.bracket.error(found.load_factor) or 0.0
            axes.loglog(seconds, max(error, 1e-7), marker, color=colour, ms=9, mec="white")
            sys.stdout.write(f"| {scene_name} | {label} | {found.load_factor:.6f} | {error:.1e} | "
                             f"{seconds:.2f} |\n")  # fmt: skip
            sys.stdout.flush()
    shapes = [Line2D([], [], ls="", marker=m, color="0.4", label=n)
              for n, m in zip(TORSION_SCENES, "os", strict=True)]  # fmt: skip
    names = ("line", "parabola", "exact to 0.01", "exact to 0.001", "exact to 0.0003")
    colours = [Line2D([], [], ls="", marker="o", color=c, label=n)
               for n, c in zip(names, COLOURS, strict=False)]  # fmt: skip
    axes.legend(handles=[*shapes, *colours], fontsize=8, ncols=2)
    axes.set_xlabel("seconds of the processor")
    axes.set_ylabel("relative distance from the exact limit (1e-7 or less below)")
    axes.set_title("Torsion with shear: speed against accuracy", fontsize=10)
    axes.grid(alpha=0.3, which="both")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def chart(path: Path, found: dict[str, dict[str, Measurement]]) -> None:
    """Load factors over the paper's, and seconds, one group of bars per scene."""
    scenes = list(found)
    figure, (above, below) = plt.subplots(2, 1, figsize=(14, 8), sharex=True)
    width = 0.84 / len(CHARTED)
    for k, (model, colour) in enumerate(zip(CHARTED, COLOURS, strict=True)):
        at = np.arange(len(scenes)) + (k - (len(CHARTED) - 1) / 2.0) * width
        rows = [found[s].get(model) for s in scenes]
        base = [found[s]["linear"].load_factor for s in scenes]
        ratio = [
            row.load_factor / b if row and row.load_factor and b else np.nan
            for row, b in zip(rows, base, strict=True)
        ]
        good = ["certified", "converged"]
        hatch = ["" if row is None or row.status in good else "///" for row in rows]
        above.bar(at, ratio, width, color=colour, label=model, hatch=hatch)
        below.bar(at, [row.total if row else np.nan for row in rows], width, color=colour)
    above.set_ylabel("load factor / that of the line")
    above.set_ylim(0.35, 1.25)
    above.axhline(1.0, color="0.4", lw=0.8)
    above.legend(ncol=len(CHARTED), fontsize=8, loc="upper left")
    note = (
        "crushing: 100 times the mean pressure on supports; mortar: cohesion 0.2, tension 0.1 of "
        "that;\nzero dilatancy: lowest member of two starts; hatched: not converged; "
        "no bar: not run"
    )
    above.set_title(note, fontsize=10)
    below.set_yscale("log")
    below.set_ylabel("seconds")
    below.set_xticks(np.arange(len(scenes)), scenes, rotation=30, ha="right")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    which = sys.argv[2:] or ["curves", "speed", "models"]
    if "curves" in which:
        curves(folder / "torsion-shear.png")
    if "speed" in which:
        speed(folder / "torsion-shear-speed.png")
    if "models" in which:
        chart(folder / "models.png", measured())
