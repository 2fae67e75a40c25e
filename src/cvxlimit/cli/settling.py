"""``cvxlimit settle``: the reaction of a support that moves, and the mechanism it moves with."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.options import ResultFile, SceneName, SurfaceName
from cvxlimit.cli.outputs import ExitCode
from cvxlimit.cli.solutions import Files, deliver
from cvxlimit.errors import InputError
from cvxlimit.methods.settlement import settlement
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

Job = Callable[[], int]


def settle_command(
    scene: SceneName,
    support: Annotated[
        str, typer.Option(metavar="ID", help="The support that moves.", show_default=False)
    ],
    direction: Annotated[
        str,
        typer.Option(
            metavar="X,Y,Z",
            help="Where to, as in --direction=0,0,-1; its length does not matter.",
            show_default=False,
        ),
    ],
    which: Annotated[
        str,
        typer.Option(
            metavar="least|largest",
            help="The reaction that remains while the support gives way, or the one that pushes "
            "it back.",
        ),
    ] = "least",
    surface: SurfaceName = "conic",
    json: ResultFile = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="OUT.png|.html|.vtu", help="Draw the mechanism."),
    ] = None,
) -> Job:
    """Find the least or largest reaction of a support that moves, under the dead load alone."""
    return partial(_settle_job, scene, support, direction, which, surface, Files(json, plot))


def _settle_job(
    name: str, support: str, direction: str, which: str, surface: str, files: Files
) -> ExitCode:
    files.check(name)
    along = _vector(direction)

    def settled(tell: Tell) -> tuple[Scene, Solution]:
        scene = scene_named(name)
        found = settlement(scene, support, along, which, surface, progress=tell)
        return scene, found.solution

    scene, solution = interruptible(settled)
    return deliver(scene, name, solution, files)


def _vector(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(
            f"--direction {text}: three numbers with commas are meant, as in 0,0,-1"
        ) from error
