"""``cvxlimit settle``: the reaction of a support that moves, and the mechanism it moves with."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.options import argument, option, result_option, surface_option, taking, vector
from cvxlimit.cli.outputs import ExitCode
from cvxlimit.cli.solutions import Files, deliver
from cvxlimit.methods.settlement import settlement
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution


@dataclass(frozen=True, kw_only=True)
class Movement:
    """What ``cvxlimit settle`` is asked."""

    scene: str = argument()
    support: str = option("ID", "The support that moves.", ...)
    direction: str = option(
        "X,Y,Z", "Where to, as in --direction=0,0,-1; its length does not matter.", ...
    )
    which: str = option(
        "least|largest",
        "The reaction that remains while the support gives way, or the one that pushes it back.",
        "least",
    )
    surface: str = surface_option()
    json: Path | None = result_option()
    plot: Path | None = option("OUT.png|.html|.vtu", "Draw the mechanism.")


@taking(Movement)
def settle_command(asked: Movement) -> ExitCode:
    """Find the least or largest reaction of a support that moves, under the dead load alone."""
    files = Files(asked.json, asked.plot)
    files.check(asked.scene)
    along = vector("--direction", asked.direction, "0,0,-1")

    def settled(tell: Tell) -> tuple[Scene, Solution]:
        scene = scene_named(asked.scene)
        found = settlement(scene, asked.support, along, asked.which, asked.surface, progress=tell)
        return scene, found.solution

    scene, solution = interruptible(settled)
    return deliver(scene, asked.scene, solution, files)
