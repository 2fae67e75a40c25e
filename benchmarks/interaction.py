"""``python -m benchmarks.interaction``: the fixed point's histories beside the certified bracket.

The paper's Fig. 21, for several weights of the old values, both moment conventions and two scenes,
with the bracket of the certified method as a band. Prints one line per run. ``--orders 12`` runs
the fixed point on the first scene with its blocks in twelve orders instead: which of many possible
forces a solver returns depends even on that.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
from rich.console import Console

from cvxlimit import Solution, builtin_scene, solve
from cvxlimit.methods.fixed_point import FixedPoint

matplotlib.use("Agg")
from matplotlib.axes import Axes
from matplotlib.figure import Figure

console = Console(highlight=False, soft_wrap=True)

WEIGHTS = (0.0, 0.5, 0.8, 0.95)
SCENES = ("tuff-wall", "s12-panel")
MOMENTS = ("independent", "signed")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run all histories, print them and draw the figure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.interaction", description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--iterations", type=int, default=30)
    parser.add_argument("--out", type=Path, default=Path("docs/interaction.png"))
    parser.add_argument("--orders", type=int, default=0)
    options = parser.parse_args(arguments)
    if options.orders:
        _tell_orders(options.scenes[0], options.orders)
        return
    figure = Figure(figsize=(11, 4.2 * len(options.scenes)), layout="constrained")
    axes = figure.subplots(len(options.scenes), len(MOMENTS), squeeze=False)
    for row, name in enumerate(options.scenes):
        for column, moments in enumerate(MOMENTS):
            _panel(axes[row, column], name, moments, options.iterations)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.out, dpi=110)


def _panel(ax: Axes, name: str, moments: str, iterations: int) -> None:
    scene = builtin_scene(name)
    bracket = solve(scene, interaction="certified", moments=moments)
    _tell(bracket, "certified")
    ax.axhspan(bracket.lower, bracket.upper, color="0.8", label="certified bracket")
    for weight in WEIGHTS:
        rule = FixedPoint(weight, most=iterations)
        run = solve(scene, interaction=rule, moments=moments)
        _tell(run, f"old-value weight {weight:g}")
        factors = [np.nan if h.load_factor is None else h.load_factor for h in run.history]
        steps = np.arange(1, len(factors) + 1)
        ax.plot(steps, factors, ".-", lw=1, label=f"weight {weight:g}: {run.status}")
    ax.set_title(
        f"{name}, conic, {moments} signs"
        if moments != "signed"
        else f"{name}, conic, signed moments"
    )
    ax.set_xlabel("iteration")
    ax.set_ylabel("load factor")
    ax.set_ylim(0.0, 1.5 * ax.get_ylim()[1])  # room for the legend
    ax.legend(fontsize=8, loc="upper center", ncols=2)


def _tell_orders(name: str, orders: int) -> None:
    scene = builtin_scene(name)
    blocks = np.array(scene.blocks, dtype=object)
    for seed in range(orders):
        other = replace(scene, blocks=tuple(np.random.default_rng(seed).permutation(blocks)))
        run = solve(other, interaction=FixedPoint(), moments="signed")
        _tell(run, f"order {seed}, old-value weight {FixedPoint().old_value_weight:g}")


def _tell(solution: Solution, what: str) -> None:
    factor = "none" if solution.load_factor is None else f"{solution.load_factor:.5f}"
    inside = f" in {solution.bracket}" if solution.bracket.has_any else ""
    line = (
        f"{solution.scene}, {solution.moments}, {what}: {solution.status}, {len(solution.history)} "
        f"solves, load factor {factor}{inside}, "
        f"{solution.seconds['total']:.1f} s"
    )
    console.print(line)


if __name__ == "__main__":
    main()
