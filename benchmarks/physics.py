"""Models of the same contacts side by side: limit curves, load factors, and what they cost.

python -m benchmarks.physics docs            writes torsion-shear.png and models.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from cvxlimit import builtin_scene
from cvxlimit.compare.models import Measurement
from cvxlimit.compare.registry import physics_registry
from cvxlimit.geometry.polygons import torsion_arm
from cvxlimit.masonry import BUILTIN
from cvxlimit.surfaces.exact_torsion import Edges, limit_states

COLOURS = ("#14476f", "#2a8a8c", "#d81e4a", "#f59e0b", "#7c3aed")

LARGEST = 400
"""Contacts of the largest scene in the chart: the exact limit takes minutes beyond."""


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


def measured() -> dict[str, dict[str, Measurement]]:
    """All models on all built-in scenes of up to :data:`LARGEST` contacts."""
    result: dict[str, dict[str, Measurement]] = {}
    for name in BUILTIN:
        if len(builtin_scene(name).contacts) > LARGEST:
            continue
        result[name] = {}
        for model in physics_registry().values():
            found = model.measure(builtin_scene(name))
            result[name][model.name] = found
            sys.stdout.write(f"{name} {model.name} {found.load_factor} {found.status} "
                             f"{found.total:.2f} s\n")  # fmt: skip
            sys.stdout.flush()
    return result


def chart(path: Path, found: dict[str, dict[str, Measurement]]) -> None:
    """Load factors over the paper's, and seconds, one group of bars per scene."""
    scenes, models = list(found), list(physics_registry())
    figure, (above, below) = plt.subplots(2, 1, figsize=(12, 7), sharex=True)
    width = 0.8 / len(models)
    for k, (model, colour) in enumerate(zip(models, COLOURS, strict=True)):
        at = np.arange(len(scenes)) + (k - (len(models) - 1) / 2.0) * width
        base = [found[s]["linear"].load_factor for s in scenes]
        ratio = [
            (found[s][model].load_factor or np.nan) / b if b else np.nan
            for s, b in zip(scenes, base, strict=True)
        ]
        good = [found[s][model].status in ("certified", "converged") for s in scenes]
        hatch = ["" if g else "///" for g in good]
        above.bar(at, ratio, width, color=colour, label=model, hatch=hatch)
        below.bar(at, [found[s][model].total for s in scenes], width, color=colour)
    above.set_ylabel("load factor / that of the line")
    above.set_ylim(0.6, 1.2)
    above.axhline(1.0, color="0.4", lw=0.8)
    above.legend(ncol=len(models), fontsize=9, loc="upper left")
    note = "zero dilatancy: lowest solution found; hatched: last iterate, no solution found"
    above.set_title(note, fontsize=10)
    below.set_yscale("log")
    below.set_ylabel("seconds")
    below.set_xticks(np.arange(len(scenes)), scenes, rotation=30, ha="right")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    curves(folder / "torsion-shear.png")
    chart(folder / "models.png", measured())
