"""Paths in finite displacements: what steps cost, and what they change."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import process_time

import numpy as np

from benchmarks.charts import COLOURS, figure_of, name_lines, save
from benchmarks.experiment import Head, Lines, Part, experiment
from cvxlimit import Block, Load, Scene, builtin_scene, pushover

LOW = "block on a low one"
SCENES = ("single-block", "arch", LOW, "tuff-wall")
"""Two that rock, of which the first has a closed form, and two that slide."""


def scene_of(name: str) -> Scene:
    """A built-in scene, or a tall block that turns and pushes the low one before it away."""
    if name != LOW:
        return builtin_scene(name)
    ground = Block.box("ground", (-2, -2, -1), (2, 2, 0))
    low = Block.box("low", (0, 0, 0), (0.3, 0.5, 0.3), density=20)
    tall = Block.box("tall", (-0.3, 0, 0), (0, 0.5, 1), density=20)
    return Scene([ground, low, tall], ["ground"], Load(acceleration=(1, 0, 0)), friction=0.3)


@experiment(Part(4))
def paths(
    scenes: Sequence[str] = SCENES,
    steps: Sequence[int] = (2, 4, 8, 16, 32),
    folder: Path = Path("docs/evidence"),
) -> Lines:
    """CPU seconds of certified paths, and how far off d0 is: of the closed form, or the run with
    the most steps."""
    figure = figure_of(3.6)
    axes = figure.subplots()
    yield Head("scene", "steps", "iterates a step", "CPU s", "d0", "off by", "ends")
    for colour, name in zip(COLOURS, scenes, strict=False):
        scene, found = scene_of(name), []
        length = pushover(scene, certify="none", flow="associated").displacement[-1]
        for number in steps:
            start = process_time()
            path = pushover(scene, step=length / number, flow="associated")
            found.append((process_time() - start, number, path))
        true = 0.2 if name == "single-block" else found.pop()[2].d0
        off = [max(abs(path.d0 / true - 1.0), 1e-13) for *_, path in found]
        for (cost, number, path), error in zip(found, off, strict=True):
            iterates = f"{np.mean([each.iterates for each in path[1:]]):.1f}"
            d0 = f"{path.d0:.6g}"
            yield name, number, iterates, f"{cost:.2f}", d0, f"{error:.0e}", path.status
        axes.loglog([x[0] for x in found], off, "o-", color=colour, ms=4, label=name)
    axes.set_xlabel("CPU s, all configurations certified")
    axes.set_ylabel("relative error of d0")
    name_lines(figure, [axes])
    yield save(figure, folder / "paths.png")
